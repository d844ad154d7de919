"""Data sets of VTK and PyVista and the files that these read; meshes of meshio.

A key names a block of several, an array, and a component of vectors: ``inlet/velocity:x``, ``velocity:magnitude``.
"""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, one_line, plain
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.placement import FRAME_STEP, Placement
from ..field.sampled import Field
from .libraries import choose, library, reading
from .placing import along_axes, at_nodes, by_matrix, even_steps
from .volumes import check_frame, of_frames, placed_field

__all__ = ["is_meshio", "is_vtk", "of_meshio", "of_vtk", "open_"]

Array = NDArray[Any]
_HEAD = 1 << 16
_GHOSTS = "vtkGhostType"
_HIDDEN_POINT, _LEFT_OUT_CELL = 2, 1 | 32
"""Bits of ghosts: points that are blanked; cells that another piece holds, or that are blanked."""
_COMPONENTS = "x", "y", "z"
_LOWER = {0, 1, 2, 3, 4, 21, 35}
"""Types of cells that are points and lines; meshes hold them beside, often as boundaries."""
_SOLID = {10, 11, 12, 13, 14, 15, 16, 24, 25, 26, 27, 29, 32, 33}
_FLAT = {5, 6, 7, 8, 9, 22, 23, 28, 30, 34}
_HIGHER = {22, 23, 24, 25, 26, 27, 28, 29, 30, 32, 33, 34}
"""Types of cells in space, in a plane, and those of them with points between their corners."""
_BY_MESHIO = ".ply", ".obj", ".stl", ".off", ".inp"
"""Suffixes whose files VTK reads without their values, or not as a mesh."""


def _vtk(module: str) -> Any:
    return library(module, extra="vtk", purpose="reading meshes and files of VTK")


def is_vtk(thing: Any) -> bool:
    """Whether this is an object of VTK or PyVista that holds data."""
    model = sys.modules.get("vtkmodules.vtkCommonDataModel")
    return model is not None and isinstance(thing, model.vtkDataObject)


def is_meshio(thing: Any) -> bool:
    """Whether this is a mesh of meshio."""
    return hasattr(thing, "cells_dict") and hasattr(thing, "point_sets")


def open_(path: Path, key: str | None = None, frame: int | None = None, frames: bool = False) -> Field | Frames | Mesh:
    """Read a file that PyVista reads, or a mesh that meshio does.

    Parameters
    ----------
    path : path
    key : str, optional
        As of `of_vtk`.
    frame : int, optional
        Which of several times, counted from 0.
    frames : bool
        Give all times: of a grid as a series, of a mesh, where this is also the default, as values (F, V).

    Returns
    -------
    Field, Frames or Mesh

    Raises
    ------
    InputError
        If it is damaged, or a choice is left open.
    OptionError, MissingExtraError
    """
    path = Path(path)
    found = _steps(path)
    if found is None:
        return of_meshio(_meshio(path), key)
    times, read = found
    check_frame(frame, len(times) if len(times) > 1 else 0)

    def at(number: int) -> Field | Mesh:
        with _complaints():
            data = read(number)
        return of_vtk(data, key)

    if frame is not None or len(times) == 1:
        return at(frame or 0)
    first, notes, remarks = at(0), {}, []
    even = even_steps(np.array(times))
    if even is None:
        remarks.append(f"its times are not even and are left out: {one_line(', '.join(f'{each:g}' for each in times))}")
    else:
        notes[FRAME_STEP] = f"{even[1]:g}"
        remarks += [f"its times begin at {even[0]:g}, which is left out"] * (even[0] != 0)
    if isinstance(first, Mesh):
        meshes = [first, *map(at, range(1, len(times)))]
        if not all(
            np.array_equal(np.asarray(each.points), first.points) and np.array_equal(each.cells, first.cells)
            for each in meshes
        ):
            raise InputError("its mesh changes in time", code="mesh", remedy="choose a time: --frame N")
        values = None if first.values is None else np.stack([np.asarray(each.values) for each in meshes])
        return replace(first, values=values, notes=notes, remarks=[*first.remarks, *remarks])
    return of_frames(
        lambda number: replace(at(number), notes=notes), [*first.shape, len(times)], frame, frames, "time",
        [*first.remarks, *remarks],
    )


def of_vtk(data: Any, key: str | None = None) -> Field | Mesh:
    """Read a data set of VTK or PyVista, or a block of several.

    Parameters
    ----------
    data : vtkDataObject
    key : str, optional
        Values: ``block/velocity:x``. Without it the only ones; of a mesh with others those named ``z``, or none.

    Returns
    -------
    Field or Mesh
        Of a grid samples with axes i, j (, k): values at its points, or of its cells at their centres. Of a surface or
        other cells a mesh; values of cells are averaged at its points. Points without cells are scattered over the
        plane.

    Raises
    ------
    InputError, MissingExtraError
    """
    with reading("VTK data"):
        data, key = _chosen(data, key)
        at_points, of_cells = _scalars(data.point_data), _scalars(data.cell_data)
        of_cells = {name: each for name, each in of_cells.items() if name not in at_points}
        if key is not None and key not in at_points | of_cells and key[-2:] in (":0", ":1", ":2"):
            key = key[:-1] + _COMPONENTS[int(key[-1])]
        grid = hasattr(data, "dimensions") and not (
            data.IsA("vtkStructuredGrid") and data.dimensions.count(1) == 1 and np.ptp(data.points, axis=0).all())
        return (_field if grid else _mesh)(data, at_points, of_cells, key)


def of_meshio(mesh: Any, key: str | None = None) -> Field | Mesh:
    """Read a mesh of meshio; parameters, result and errors as of `of_vtk`."""
    with reading("mesh"):
        return of_vtk(_vtk("pyvista").from_meshio(mesh), key)


# ---- files -----------------------------------------------------------------------------------------------------------


@contextmanager
def _complaints() -> Iterator[None]:
    """Raise an error for what VTK only complains about, before it gives zeros."""
    core = _vtk("vtkmodules.vtkCommonCore")
    before, window = core.vtkOutputWindow.GetInstance(), core.vtkStringOutputWindow()
    logged = core.vtkLogger.GetCurrentVerbosityCutoff()
    core.vtkOutputWindow.SetInstance(window)
    core.vtkLogger.SetStderrVerbosity(core.vtkLogger.VERBOSITY_OFF)
    try:
        with reading("file of VTK"):
            yield
    finally:
        core.vtkOutputWindow.SetInstance(before)
        core.vtkLogger.SetStderrVerbosity(logged)
    errors = [part for part in window.GetOutput().split("\n\n") if "error" in part.lower()]
    if errors:
        text = one_line(errors[0].rpartition("): ")[2]) or "damaged"
        raise InputError(f"cannot be read as file of VTK ({text})", code="unreadable")


def _steps(path: Path) -> tuple[Sequence[float], Callable[[int], Any]] | None:
    """Times of a file and what reads one of them; None of a file for meshio."""
    pyvista, suffix, times = _vtk("pyvista"), path.suffix.lower(), (0.0,)
    with path.open("rb") as file:
        file.read(1)
    with _complaints():
        if suffix in (".xdmf", ".xmf"):  # PyVista takes those with times alone
            return _of_xdmf(str(path))
        if suffix in (".pvts", ".pvtp"):
            name = "PolyData" if suffix == ".pvtp" else "StructuredGrid"
            reader: Any = getattr(_vtk("vtkmodules.vtkIOXML"), f"vtkXMLP{name}Reader")()
            reader.SetFileName(str(path))
            reader.Update()
            return times, lambda number: reader.GetOutput()
        if suffix in _BY_MESHIO or suffix not in pyvista.core.utilities.reader.CLASS_READERS:
            return None
        reader = pyvista.get_reader(path)
        times = getattr(reader, "time_values", None) or times

    def read(number: int) -> Any:
        if len(times) > 1:
            reader.set_active_time_point(number)
        data = reader.read()
        if suffix == ".pvti":
            _turn(data, path)
        return data

    return times, read


def _turn(data: Any, path: Path) -> None:
    """Turn an image as its first piece states, as VTK does not."""
    name = re.search(rb"<Piece\b[^>]*\bSource\s*=\s*[\"']([^\"']*)", path.read_bytes())
    if name:
        with (path.parent / name[1].decode()).open("rb") as file:
            found = re.search(rb"\bDirection\s*=\s*[\"']([^\"']*)", file.read(_HEAD))
        if found:
            data.direction_matrix = np.reshape([float(number) for number in found[1].split()], (3, 3))


def _of_xdmf(path: str) -> tuple[Sequence[float], Callable[[int], Any]]:
    pipeline = _vtk("vtkmodules.vtkCommonExecutionModel").vtkStreamingDemandDrivenPipeline
    reader = _vtk("vtkmodules.vtkIOXdmf2").vtkXdmfReader()
    reader.SetFileName(path)
    reader.UpdateInformation()
    about = reader.GetOutputInformation(0)
    times = about.Get(pipeline.TIME_STEPS()) if about.Has(pipeline.TIME_STEPS()) else (0.0,)

    def read(number: int) -> Any:
        reader.UpdateTimeStep(times[number]) if len(times) > 1 else reader.Update()
        data = _vtk("pyvista").wrap(reader.GetOutputDataObject(0)).copy()
        return data

    return times, read


def _meshio(path: Path) -> Any:
    meshio = _vtk("meshio")
    with path.open("rb") as file:
        gmsh = file.read(1) == b"$" and path.suffix.lower() == ".msh"
    # the library prints its complaint on the console, and then ends the process
    with reading("mesh"), redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        return meshio.read(path, "gmsh" if gmsh else None)


# ---- data sets -------------------------------------------------------------------------------------------------------


def _blocks(data: Any) -> dict[str, Any]:
    """Data sets by the names of blocks; a single one has the name ''."""
    if not hasattr(data, "GetNumberOfBlocks"):
        return {"": data}
    out: dict[str, Any] = {}
    for number in range(data.GetNumberOfBlocks()):
        block = data.GetBlock(number)
        name = data.GetMetaData(number).Get(data.NAME()) if data.HasMetaData(number) else None
        for inner, each in ({} if block is None else _blocks(block)).items():
            out["/".join(filter(None, (name or f"block {number}", inner)))] = each
    return out


def _chosen(data: Any, key: str | None) -> tuple[Any, str | None]:
    """The block that a key names, or the only one, as PyVista has it, and the rest of the key."""
    blocks = _blocks(data)
    matching = [name for name in blocks if key is not None and f"{key}/".startswith(f"{name}/")]
    name = max(matching, key=len) if matching else choose([*blocks], None, "blocks")
    found = _vtk("pyvista").wrap(blocks[name])
    if not hasattr(found, "n_cells"):
        raise InputError(f"holds {plain(type(found).__name__)}, not a grid or a mesh", code="mesh")
    return found, (key or "")[len(name) + 1 :] or None if matching else key


def _scalars(attributes: Any) -> dict[str, Array]:
    """Numbers by name; components and magnitudes of vectors have names that no array has itself."""
    arrays = {name: np.asarray(array) for name, array in attributes.items() if not name.startswith("vtk")}
    out: dict[str, Array] = {}
    for name, array in arrays.items():
        if array.dtype.kind not in "biuf":
            continue
        if array.ndim == 1 or array.shape[1] == 1:
            out[name] = array.reshape(-1)
            continue
        names = _COMPONENTS if array.shape[1] <= len(_COMPONENTS) else map(str, range(array.shape[1]))
        parts = {f"{name}:{part}": values for values, part in zip(array.T, names, strict=False)}
        with np.errstate(over="ignore"):
            parts[f"{name}:magnitude"] = np.sqrt((array.astype(np.float64) ** 2).sum(axis=1))
        out |= {part: values for part, values in parts.items() if part not in arrays}
    return out


def _ghosts(attributes: Any, bits: int) -> Array | None:
    """Find the points or cells that have one of these bits; None without any."""
    found = (np.asarray(attributes[_GHOSTS]) & bits) != 0 if _GHOSTS in attributes else None
    return found if found is not None and found.any() else None


def _field(data: Any, at_points: Mapping[str, Array], of_cells: Mapping[str, Array], key: str | None) -> Field:
    """Values at points, or of cells at their centres, with axes i, j, k; axes of one sample are left out."""
    only = at_points or of_cells
    name = next(iter(only)) if key is None and len(only) == 1 else choose([*at_points, *of_cells], key)
    centred = name in of_cells
    sides = [max(1, count - centred) for count in data.dimensions]
    kept = [axis for axis in range(3) if sides[axis] > 1]
    if len(kept) < 2:
        raise InputError(f"has a grid of {' x '.join(map(str, sides))} samples", code="shape")
    shape = [sides[axis] for axis in kept]
    values = np.asarray((of_cells if centred else at_points)[name]).reshape(shape, order="F")
    gone, remarks = _hidden(data, centred, shape)
    where = _place_of(data, kept, shape, centred)
    return placed_field(values, gone, where, remarks)


def _hidden(data: Any, centred: bool, shape: Sequence[int]) -> tuple[Array | None, list[str]]:
    """Samples that are blanked, or whose cells or points are."""
    points, cells = _ghosts(data.point_data, _HIDDEN_POINT), _ghosts(data.cell_data, _LEFT_OUT_CELL)
    long = [axis for axis in range(3) if data.dimensions[axis] > 1]
    n = len(long)
    gone = None
    own, other = (cells, points) if centred else (points, cells)
    if own is not None:
        gone = own.reshape(shape, order="F")
    if other is not None:
        sizes = [data.dimensions[axis] - (not centred) for axis in long]
        spread = other.reshape(sizes, order="F")
        spread = spread if centred else np.pad(spread, 1, constant_values=True)
        for axis in range(n):
            one, two = (spread.take(range(at, spread.shape[axis] - 1 + at), axis) for at in (0, 1))
            spread = one | two if centred else one & two
        gone = spread.reshape(shape) if gone is None else gone | spread.reshape(shape)
    remarks = []
    if cells is not None and not centred and gone is not None:
        kept = ~gone.reshape([data.dimensions[axis] for axis in long])
        for axis in range(n):
            kept = kept.take(range(kept.shape[axis] - 1), axis) & kept.take(range(1, kept.shape[axis]), axis)
        count = int((kept.ravel(order="F") & cells).sum())
        remarks += [f"{count:,} hidden cells between points of others are not left out"] * (count > 0)
    return gone, remarks


def _place_of(data: Any, kept: Sequence[int], shape: Sequence[int], centred: bool) -> Placement:
    """Place the samples of a grid."""
    n = len(kept)
    if data.IsA("vtkStructuredGrid"):
        points = np.asarray((data.cell_centers() if centred else data).points, np.float64)
        varies = [c for c in range(3) if np.ptp(points[:, c])]
        if len(varies) != n:
            return Placement(remark="its coordinates are ignored: samples lie on one another")
        fixed = {_COMPONENTS[c]: points[0, c] for c in range(3) if c not in varies}
        return at_nodes([points[:, c].reshape(shape, order="F") for c in varies], remark=_left_out(fixed))
    if data.IsA("vtkImageData"):
        matrix = np.array(data.index_to_physical_matrix)[:3]
        first = np.array(data.extent[::2], float)
        first[kept] += centred * 0.5
        matrix[:, 3] += matrix[:, :3] @ first
    else:
        along = [np.asarray(each, np.float64) for each in (data.x, data.y, data.z)]
        along = [(each[1:] + each[:-1]) / 2 if centred and len(each) > 1 else each for each in along]
        even = [even_steps(each) for each in along]
        if None in even:
            fixed = {_COMPONENTS[c]: along[c][0] for c in range(3) if c not in kept}
            return along_axes([along[axis] for axis in kept], range(n), remark=_left_out(fixed))
        starts, steps = np.array(even).T
        matrix = np.column_stack([np.diag(steps), starts])
    # a picture lies in the plane, other slices in space
    flat = n == 2 and kept == [0, 1] and not matrix[2, [0, 1, 3]].any()
    return by_matrix(matrix[:2] if flat else matrix, kept)


def _left_out(fixed: Mapping[str, float]) -> str:
    """Remark on the place of a plane that coordinates along its axes cannot state."""
    if all(name == "z" and value == 0 for name, value in fixed.items()):
        return ""
    return f"its place in space is left out: {', '.join(f'{name} = {value:g}' for name, value in fixed.items())}"


# ---- meshes ----------------------------------------------------------------------------------------------------------


def _mesh(data: Any, at_points: Mapping[str, Array], of_cells: Mapping[str, Array], key: str | None) -> Mesh:
    """Triangles, tetrahedra or points, with values at points."""
    if key is None:
        only = at_points or of_cells
        key = next(iter(only)) if len(only) == 1 else "z" if "z" in at_points else None
    data, remarks = _joined(data, key)
    if key is not None and key in of_cells:
        data = data.cell_data_to_point_data()
        remarks.append("values of cells are averaged at points")
    cells, data, about = _cells_of(data)
    points = np.asarray(data.points, np.float64)
    values = _scalars(data.point_data)
    axes = {} if cells is None and not np.ptp(points[:, 2]) else dict(zip(_COMPONENTS, points.T, strict=True))
    if key is None and cells is None and not values and axes:
        key = "z"
    if key is not None and key not in values:
        values = axes | values
        choose([*values], key)
    flat = cells is None or (cells.shape[1] == 3 and not points[:, 2].any())
    return Mesh(points[:, : 2 if flat else 3], cells, None if key is None else values[key], remarks=remarks + about)


def _joined(data: Any, key: str | None) -> tuple[Any, list[str]]:
    """The cells of any data set without those that another piece holds, and remarks.

    Points that coincide, as those where pieces meet, are joined, unless all values differ there.
    """
    grid = data.cast_to_unstructured_grid()
    first, number = np.unique(grid.points, axis=0, return_index=True, return_inverse=True)[1:]
    arrays = {name: np.asarray(each) for name, each in grid.point_data.items() if not name.startswith("vtk")}
    apart = [name for name, each in arrays.items()
             if not np.array_equal(each[first][number.ravel()], each, each.dtype.kind == "f")]
    remarks = []
    if len(first) < grid.n_points and (not arrays or len(apart) < len(arrays)):
        grid = grid.clean(produce_merge_map=False, average_point_data=False)
        for name in apart:
            del grid.point_data[name]
        if apart:
            remarks.append(f"values that differ where points coincide are left out: {', '.join(map(plain, apart))}")
    if _ghosts(grid.cell_data, _LEFT_OUT_CELL) is not None:
        grid.RemoveGhostCells()
    return grid, remarks


def _cells_of(data: Any) -> tuple[Array | None, Any, list[str]]:
    """Triangles or tetrahedra of a data set, the data set whose points they join, and remarks; None of points alone."""
    types = data.celltypes
    kinds = {*types.tolist()}
    if not kinds - {0, 1, 2}:
        return None, data, []
    solid, odd = bool(kinds & _SOLID), kinds - _LOWER - _FLAT - _SOLID
    if odd or not kinds & (_FLAT | _SOLID):
        names = [_vtk("pyvista").CellType(each).name for each in sorted(odd)]
        raise InputError(
            f"holds cells of other kinds: {', '.join(names) or 'no triangles'}", code="mesh",
            remedy="cut them into triangles or tetrahedra first",
        )
    wanted, ours = (10, _SOLID) if solid else (5, _FLAT)
    left = int(np.isin(types, [*ours], invert=True).sum())
    remarks = [f"{left:,} cells of lower dimension are left out"] if left else []
    if kinds & ours != {wanted}:
        remarks.append("cells of other kinds are cut into " + ("tetrahedra" if solid else "triangles"))
        if kinds & _HIGHER:
            remarks.append("values between the points of cells of higher order are taken as linear")
        data = data.triangulate()
    return np.asarray(data.cells_dict[wanted], np.int64), data, remarks
