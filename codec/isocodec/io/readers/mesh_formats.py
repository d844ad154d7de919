"""Formats of meshes: the result of their readers, and how they are registered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...errors import OptionError, plain
from ...field.meshed import Mesh
from .opened import Choice
from .source import InputFile

HEIGHT = "z"
"""Values of points in space that are joined over the plane."""


@dataclass(frozen=True)
class MeshRead:
    """A mesh, or scattered points, as a file has them.

    Attributes
    ----------
    points : (V, 2) or (V, 3) float64
        Coordinates; two where all points have the same third one and cells are triangles.
    cells : (T, 3) or (T, 4) int64, or None
        None of points that are scattered.
    values : dict of str to (V,) or (F, V) array
        Numbers at points, by name; with two axes, those of F frames.
    of_cells : list of str
        Names of numbers that cells have.
    crs : str or None
        Reference system of the points.
    remarks : list of str
        What of the file is left out or changed.
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64] | None
    values: dict[str, NDArray[Any]] = field(default_factory=dict)
    of_cells: list[str] = field(default_factory=list)
    crs: str | None = None
    remarks: list[str] = field(default_factory=list)

    def values_named(self, name: str) -> NDArray[Any]:
        """Values at points, by name; x, y and z are the coordinates, if no values have these names.

        Raises
        ------
        OptionError
            If no values have that name; the message lists the names in the file.
        """
        if name in self.values:
            return self.values[name]
        axes = "xyz"[: self.points.shape[1]] if self.cells is not None else ""
        if len(name) == 1 and name in axes:
            return self.points[:, axes.index(name)]
        there = ", ".join([*map(plain, self.values), *axes])
        if name in self.of_cells:
            raise OptionError(
                f"the values {plain(name)} belong to cells, not to points", code="values",
                remedy=f"average them at the points (--average-cells); values at points: {there or 'none'}",
            )
        raise OptionError(
            f"no values {plain(name)} at points", code="values",
            remedy=f"choose one of: {there}" if there else "add a column of values",
        )

    def mesh(self, name: str | None) -> Mesh:
        """A mesh with the values of a name, or without any; raises `OptionError` as `values_named`."""
        values = None if name is None else self.values_named(name)
        return Mesh(self.points, self.cells, values, crs=self.crs, remarks=self.remarks)


@dataclass(frozen=True)
class MeshFormat:
    """A format of meshes, or of scattered points; ``name``, ``suffixes``, ``extra`` and ``confined`` as of `Format`.

    Attributes
    ----------
    read : callable
        Reads what is chosen of a source.
    scattered : bool
        Whether it holds points only.
    holds : callable, optional
        Whether a file, or what a key names in it, is a mesh; for formats that may also hold a field.
    options : tuple of str
        Attributes of `Choice`, besides the key, that apply to it.
    """

    name: str
    suffixes: tuple[str, ...]
    read: Callable[[InputFile, Choice], MeshRead]
    extra: str = ""
    scattered: bool = False
    holds: Callable[[InputFile, str | None], bool] | None = None
    options: tuple[str, ...] = ()
    confined: str = ""
