"""Capabilities of formats: a record for each kind of thing and the suffixes that one library writes it to."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ...extras import optional

Kind = Literal["contour", "areas", "mask", "labels", "mesh", "tin", "pyramid", "picture"]
"""A curve or surface; polygons beside curves or between them; bools of samples, or labels; simplices under a contour; a
triangulated surface; a contour at each zoom of a map; whatever draws itself."""
Coordinates = Literal["samples", "placement", "degrees"]
"""Indices of samples; x, y (, z) of the placement; longitude and latitude where the reference system is known."""
Pieces = bytes | Iterable[bytes]
"""A file, whole or in pieces."""


@dataclass(frozen=True)
class Cost:
    """Bytes of memory that writing takes at most: for each point, for each cell, and in any case.

    ``kept`` of them, for each point, stay until the file is whole; all if it is None.
    """

    point: int
    cell: int
    fixed: int = 0
    kept: int | None = None

    def peak(self, points: int, cells: int) -> int:
        """While one drawing is written."""
        return self.point * points + self.cell * cells + self.fixed

    def after(self, points: int, cells: int) -> int:
        """Cost once it has been, and others follow."""
        return self.point * points + self.cell * cells if self.kept is None else self.kept * points


@dataclass(frozen=True)
class OutputOptions:
    """Options of everything that is written.

    Attributes
    ----------
    keep_crs : bool
        GeoJSON in the reference system of the file instead of longitude and latitude.
    in_samples : bool
        Coordinates in samples, even if there is a placement.
    to : str or None
        Suffix of the format, where no name ends in it: ``".geojson"``.
    """

    keep_crs: bool = False
    in_samples: bool = False
    to: str | None = None


@dataclass(frozen=True)
class Output:
    """A writer for one kind of thing and files of some suffixes.

    Attributes
    ----------
    kind : str
    suffixes : tuple of str
        In lower case, with the dot.
    title : str
        Name of the format.
    render : callable
        ``render(what, suffix, options)`` makes the file of a thing of this kind (see `isocodec.io.writers.things`). Of
        contours it takes an iterable, which it goes through once.
    dimensions : tuple of int
        Axes of the fields that the thing may be of.
    several : tuple of int
        Axes of the fields for which a file can hold several isovalues.
    holds : str
        What several isovalues are in the file.
    coordinates : str
        Which it has.
    names_crs : bool
        Whether the file names the reference system.
    single : bool
        Whether coordinates have single precision.
    sampled : bool
        Whether the thing has to lie on samples; what lies on an explicit mesh or scattered points does not.
    extra : str
        Extra of this package that brings the libraries.
    libraries : tuple of str
        Modules that ``render`` needs.
    cost : mapping of int to Cost
        Memory that ``render`` takes, by axes of the field.
    parts : callable or None
        Where the format is several files: ``parts(path, data)`` gives the paths and contents, out of what ``render``
        made.
    """

    kind: Kind
    suffixes: tuple[str, ...]
    title: str
    render: Callable[[Any, str, OutputOptions], Pieces]
    dimensions: tuple[int, ...] = (2,)
    several: tuple[int, ...] = ()
    holds: str = ""
    coordinates: Coordinates = "placement"
    names_crs: bool = False
    single: bool = False
    sampled: bool = True
    extra: str = ""
    libraries: tuple[str, ...] = ()
    cost: Mapping[int, Cost] = field(default_factory=dict)
    parts: Callable[[Path, bytes], list[tuple[Path, bytes]]] | None = None

    def fits(self, n: int | None, several: bool, sampled: bool) -> bool:
        """Whether it can hold a thing of a field of ``n`` axes (of any, if None)."""
        return (
            (n is None or n in self.dimensions) and (sampled or not self.sampled)
            and (not several or (bool(self.several) if n is None else n in self.several))
        )

    def check_libraries(self, suffix: str) -> None:
        """Find out before the work that a library is missing.

        Raises
        ------
        MissingExtraError
        """
        for module in self.libraries:
            optional(module, extra=self.extra, purpose=f"writing {suffix}")
