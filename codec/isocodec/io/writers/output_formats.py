"""Capabilities of formats: a record for each kind of content and the suffixes with which a library writes it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, Literal

from ...deferred import dataclass
from ...extras import check_installed

Kind = Literal["contour", "areas", "mask", "labels", "mesh", "tin", "pyramid", "picture"]
"""A curve or surface; polygons beside curves or between them; bools of samples, or labels; simplices under a contour; a
triangulated surface; a contour at each zoom of a map; whatever draws itself."""
Coordinates = Literal["samples", "placement", "degrees"]
"""Sample indices; x, y (, z) of the placement; longitude and latitude if the reference system is known."""
COLUMNS = ("fid", "geom", "geometry", "side", "area", "shape", "closed", "complete", "index")
"""Columns, or properties of features, that files have beside that of isovalues; names are the same in capitals."""
Pieces = bytes | Iterable[bytes]
"""A file, complete or in pieces."""


@dataclass(frozen=True)
class Cost:
    """Most memory, in bytes, that writing takes: for each point, for each cell, and in any case.

    ``kept`` bytes for each point are held until the file is complete; all of them if None.
    """

    point: int
    cell: int
    fixed: int = 0
    kept: int | None = None

    def peak(self, points: int, cells: int) -> int:
        """Memory while one drawing is written."""
        return self.point * points + self.cell * cells + self.fixed

    def after(self, points: int, cells: int) -> int:
        """Memory after a drawing has been written, while others follow."""
        return self.point * points + self.cell * cells if self.kept is None else self.kept * points


@dataclass(frozen=True)
class OutputOptions:
    """Options for all writers.

    Attributes
    ----------
    keep_crs : bool
        Write GeoJSON in the reference system of the file instead of longitude and latitude.
    in_samples : bool
        Write coordinates in samples, even if there is a placement.
    to : str or None
        Suffix of the format, if the name has none: ``".geojson"``.
    layer : str or None
        Name of the layer, where a format has one; by default that of the content (`Output.layer`).
    decimals : int or None
        Decimals of coordinates, where a format has them as text; all that they have if None.
    higher_on : {"left", "right"}
        Side of lines on which values are higher, with x to the right and y upwards; for formats in samples, as pictures
        show the array.
    onto : Path or None
        The existing file whose other layers are kept; set by `write`.
    attribute : str or None
        Name of the column or property that holds isovalues, none of `COLUMNS`; if None, ``isovalue``, or ``label`` in
        a file of labels.
    index : collection of float, or None
        Isovalues of index contours; a column or property ``index`` marks them.
    raised : bool
        Give points of curves a third coordinate, the isovalue.
    """

    keep_crs: bool = False
    in_samples: bool = False
    to: str | None = None
    layer: str | None = None
    decimals: int | None = None
    higher_on: str = "left"
    onto: Path | None = None
    attribute: str | None = None
    index: Collection[float] | None = None
    raised: bool = False


@dataclass(frozen=True)
class Output:
    """A writer for one kind of content and files of some suffixes.

    Attributes
    ----------
    kind : str
    suffixes : tuple of str
        In lower case, with the dot.
    title : str
        Name of the format.
    render : callable
        ``render(what, suffix, options)`` makes the file of content of this kind (see `isocodec.io.writers.things`). For
        contours, ``what`` is an iterable, which is iterated over once.
    dimensions : tuple of int
        Numbers of axes of fields whose content can be written.
    several : tuple of int
        Numbers of axes of fields for which a file can hold several isovalues.
    holds : str
        How several isovalues are represented in the file.
    coordinates : str
        Kind of the coordinates in the file.
    names_crs, names_space : bool
        Whether the file names the reference system, or the sides of a body that coordinates run to.
    decimal : bool
        Whether coordinates are text with a number of decimals that can be chosen.
    layer : str
        Usual name of the layer; empty if the format has no names of layers that can be chosen.
    keeps : bool
        Whether an existing file keeps its other layers.
    heights : bool
        Whether points of curves may have a third coordinate.
    single : bool
        Whether coordinates have single precision.
    sampled : bool
        Whether the content must lie on a sampled grid, rather than on a mesh or scattered points.
    extra : str
        Extra of this package that installs the libraries.
    libraries : tuple of str
        Modules that ``render`` needs.
    cost : mapping of int to Cost
        Memory that ``render`` takes, by the number of axes of the field.
    parts : callable or None
        For formats of several files: ``parts(path, data)`` returns their paths and contents, from what ``render`` made.
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
    names_space: bool = False
    decimal: bool = False
    layer: str = ""
    keeps: bool = False
    heights: bool = True
    single: bool = False
    sampled: bool = True
    extra: str = ""
    libraries: tuple[str, ...] = ()
    cost: Mapping[int, Cost] = field(default_factory=dict)
    parts: Callable[[Path, bytes], list[tuple[Path, bytes]]] | None = None

    def fits(self, n: int | None, several: bool, sampled: bool) -> bool:
        """Whether the format can hold content of a field with ``n`` axes (any number, if None)."""
        return (
            (n is None or n in self.dimensions) and (sampled or not self.sampled)
            and (not several or (bool(self.several) if n is None else n in self.several))
        )

    @property
    def attributed(self) -> bool:
        """Whether isovalues are in a column, or property of features, which has a name."""
        return self.holds in ("a column", "a feature each")

    def check_libraries(self, suffix: str) -> None:
        """Check, before the work begins, that no library is missing.

        Raises
        ------
        MissingExtraError
        """
        for module in self.libraries:
            check_installed(module, extra=self.extra, purpose=f"writing {suffix}")
