"""Meshes in: points, cells and values at points, by meshio (VTU, MSH, PLY, XDMF and others), or as NPZ."""

from __future__ import annotations

import io
import os
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, OptionError, plain
from ...extras import optional
from .reading import reading
from .source import Source, source_of

MESHES = (".vtu", ".msh", ".ply", ".xdmf", ".npz")
"""Suffixes of what is read."""
_CELLS = {"triangle": 3, "tetra": 4}
_LOWER = ("vertex", "line")
"""Cells of lower dimension beside, as boundaries are often given; they are left out."""


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
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64] | None
    values: dict[str, NDArray[Any]] = field(default_factory=dict)
    of_cells: list[str] = field(default_factory=list)

    def values_named(self, name: str) -> NDArray[Any]:
        """Values at points, by name.

        Raises
        ------
        OptionError
            If there are none of that name; the message names those that there are.
        """
        if name in self.values:
            return self.values[name]
        there = ", ".join(map(plain, self.values)) or "none"
        if name in self.of_cells:
            raise OptionError(
                f"the values {plain(name)} belong to cells, not to points", code="values",
                remedy=f"average them at the points first; values at points: {there}",
            )
        raise OptionError(f"there are no values {plain(name)} at points", code="values", remedy=f"there are: {there}")


def read_mesh(path: str | os.PathLike[str], samples: int | None = None) -> MeshRead:
    """Read a mesh.

    Parameters
    ----------
    path : path
        Its suffix, one of ``MESHES``, names the format. An .npz file has the arrays ``points``, ``cells``, and values
        at points, of one frame or of several, under other names. Of an XDMF file with time steps all are read.
    samples : int, optional
        As of `read_field`: most points and cells.

    Raises
    ------
    InputError
        If the file cannot be read, or holds cells other than triangles or tetrahedra.
    MissingExtraError
        If meshio is not installed.
    """
    source = source_of(path, samples)
    if not source.named(*MESHES):
        raise InputError(
            f"the suffix {plain(source.path.suffix)!r} names no format of meshes", code="suffix",
            remedy=f"known are {', '.join(MESHES)}",
        )
    found = _npz(source) if source.named(".npz") else _by_meshio(source)
    points = found.points
    assert found.cells is not None
    source.check_count(len(points) + len(found.cells))
    if found.cells.shape[1] == 3 and points.shape[1] == 3 and (points[:, 2] == points[:1, 2]).all():
        points = np.ascontiguousarray(points[:, :2])
    return MeshRead(points, found.cells, found.values, found.of_cells)


def _npz(source: Source) -> MeshRead:
    with reading("NumPy file"), np.load(source.path, allow_pickle=False) as arrays:
        if not {"points", "cells"} <= set(arrays.files):
            raise InputError("holds no arrays points and cells", code="mesh")
        points, cells = np.asarray(arrays["points"], np.float64), np.asarray(arrays["cells"]).astype(np.int64)
        if points.ndim != 2 or cells.ndim != 2 or cells.shape[1] not in (3, 4):
            raise InputError("holds points or cells of another shape", code="mesh")
        others = {name: arrays[name] for name in arrays.files if name not in ("points", "cells")}
    return MeshRead(points, cells, {name: each for name, each in others.items() if each.shape[-1:] == (len(points),)})


def _series(meshio: Any, source: Source) -> Any:
    """A series of an XDMF file as a mesh whose values have an axis of frames; None if the file holds none."""
    try:
        with meshio.xdmf.TimeSeriesReader(source.path) as series:
            points, cells = series.read_points_cells()
            steps = [series.read_data(number)[1] for number in range(series.num_steps)]
    except meshio.ReadError:
        return None
    mesh = meshio.Mesh(points, cells)
    names = set(steps[0]).intersection(*steps)
    # set behind the library's back, which knows values of one frame only
    mesh.point_data.update({name: np.stack([step[name] for step in steps]) for name in sorted(names)})
    return mesh


def _by_meshio(source: Source) -> MeshRead:
    meshio = optional("meshio", extra="vtu", purpose=f"reading {source.path.suffix}")
    with reading("mesh"):
        try:
            # the library says on the console what it does not like, and then ends the process
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                found = (source.named(".xdmf") and _series(meshio, source)) or meshio.read(source.path)
        except SystemExit:
            raise InputError("cannot be read as a mesh", code="unreadable") from None
        kinds = {block.type for block in found.cells}
        wanted = "tetra" if "tetra" in kinds else "triangle"
        left = sorted(kinds - {wanted, *_LOWER} - ({"triangle"} if wanted == "tetra" else set()))
        if left or wanted not in kinds:
            raise InputError(
                f"holds cells of other kinds: {', '.join(map(plain, left)) or 'no triangles'}", code="mesh",
                remedy="cut them into triangles or tetrahedra first",
            )
        cells = np.concatenate([block.data for block in found.cells if block.type == wanted]).astype(np.int64)
        points = np.asarray(found.points, np.float64)
        values = {str(name): np.asarray(each) for name, each in found.point_data.items()}
        of_cells = [str(name) for name in found.cell_data]
    return MeshRead(points, cells.reshape(-1, _CELLS[wanted]), values, of_cells)
