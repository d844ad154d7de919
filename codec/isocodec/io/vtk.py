"""Data sets of VTK and PyVista and the files that these read; meshes of meshio.

A key names a block of several, an array, and a component of vectors: ``inlet/velocity:x``, ``velocity:magnitude``.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, one_line, plain
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.placement import FRAME_STEP, Placement
from ..field.sampled import Field
from .in_turn import check_frame
from .libraries import choose, library, reading
from .places import along_axes, at_nodes, by_matrix, even_steps
from .volumes import of_frames, placed_field

Array = NDArray[Any]
_Numbers = Mapping[str, Callable[[], Array]]
_GHOSTS = "vtkGhostType"
_HIDDEN_POINT, _LEFT_OUT_CELL = 2, 1 | 32
"""Bits of ghosts: points that are blanked; cells that another piece holds, or that are blanked."""
_LOWER = {0, 1, 2, 3, 4, 21, 35}
"""Types of cells that are points and lines; meshes hold them beside, often as boundaries."""
_SOLID = {*range(10, 17), *range(24, 28), 29, 32, 33}
_FLAT = {*range(5, 10), 22, 23, 28, 30, 34}
"""Types of cells in space and in a plane; those above 21 have points between their corners."""
_BY_VTK = {
    ".xdmf": ("vtkIOXdmf2", "vtkXdmfReader"), ".xmf": ("vtkIOXdmf2", "vtkXdmfReader"),
    ".pvts": ("vtkIOXML", "vtkXMLPStructuredGridReader"), ".pvtp": ("vtkIOXML", "vtkXMLPPolyDataReader"),
}
"""Modules and readers of files that PyVista does not take, or not without times."""
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
    with _complaints():
        found = _steps(path, key)
    if found is None:
        return of_meshio(_meshio(path), key)
    times, read = found
    count, notes, remarks = len(times), {}, list[str]()
    if frame is not None:
        check_frame(frame, count if count > 1 else 0)
    elif count > 1:
        even = even_steps(np.array(times))
        if even is not None:
            notes[FRAME_STEP] = f"{even[1]:g}"
        if even is None or even[0]:
            listed = one_line(", ".join(f"{time:g}" for time in times))
            remarks.append(f"its times are left out{' but for their step' * (even is not None)}: {listed}")

    def at(number: int) -> Any:
        with _complaints():
            data = read(number)
        found = of_vtk(data, key)
        return replace(found, notes=notes, remarks=(*found.remarks, *remarks))

    first = at(frame or 0)
    if isinstance(first, Field):
        return of_frames(lambda number: first if number == (frame or 0) else at(number), count, frame, frames, "time")
    if count == 1 or frame is not None:
        return first
    meshes = [first, *map(at, range(1, count))]
    names = "points", "cells"
    if not all(np.array_equal(getattr(each, name), getattr(first, name)) for each in meshes for name in names):
        raise InputError("its mesh changes in time", code="mesh", remedy="choose a time: --frame N")
    return first if first.values is None else replace(first, values=np.stack([each.values for each in meshes]))


def of_vtk(data: Any, key: str | None = None) -> Field | Mesh:
    """Read a data set of VTK or PyVista, or a block of several.

    Parameters
    ----------
    data : vtkDataObject
    key : str, optional
        Values: ``block/velocity:x``. Without it the only ones; of a mesh those at points, named ``z``, or none.

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
            key = key[:-1] + "xyz"[int(key[-1])]
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
    before, window, logger = core.vtkOutputWindow.GetInstance(), core.vtkStringOutputWindow(), core.vtkLogger
    logged = logger.GetCurrentVerbosityCutoff()
    core.vtkOutputWindow.SetInstance(window)
    logger.SetStderrVerbosity(logger.VERBOSITY_OFF)
    try:
        with reading("file of VTK"):
            yield
    finally:
        core.vtkOutputWindow.SetInstance(before)
        logger.SetStderrVerbosity(logged)
    errors = [part for part in window.GetOutput().split("\n\n") if "error" in part.lower()]
    if errors:
        text = one_line(errors[0].rpartition("): ")[2]) or "damaged"
        raise InputError(f"cannot be read as file of VTK ({text})", code="unreadable")


def _steps(path: Path, key: str | None) -> tuple[Sequence[float], Callable[[int], Any]] | None:
    """Times of a file and what reads one of them; None of a file for meshio."""
    pyvista, suffix, series = _vtk("pyvista"), path.suffix.lower(), list[Any]()
    if suffix in _BY_VTK:
        for each in ElementTree.parse(path).iter():
            if each.get("Format", "XML").upper() not in ("XML", "ASCII", "APPENDED"):
                (path.parent / str(each.text).strip().partition(":")[0]).stat()  # VTK crashes where it is missing
            if each.get("CollectionType") == "Temporal":
                series.append(each.get("Name"))
        module, name = _BY_VTK[suffix]
        reader = getattr(_vtk(f"vtkmodules.{module}"), name)()
        reader.SetFileName(str(path))
        reader.UpdateInformation()
        known = _vtk("vtkmodules.vtkCommonExecutionModel").vtkStreamingDemandDrivenPipeline.TIME_STEPS()
        about = reader.GetOutputInformation(0)
        times = about.Get(known) if about.Has(known) else (0.0,)
    elif suffix in _BY_MESHIO or suffix not in pyvista.core.utilities.reader.CLASS_READERS:
        return None
    else:
        reader = pyvista.get_reader(path)
        for kind in ("point", "cell"):
            names = getattr(reader, f"{kind}_array_names", [])
            named = [name for name in names if name in (key or "")]
            for name in {*names} - {*named, _GHOSTS} if named else ():
                getattr(reader, f"disable_{kind}_array")(name)
        times = getattr(reader, "time_values", None) or (0.0,)

    def read(number: int) -> Any:
        if suffix in _BY_VTK:
            reader.UpdateTimeStep(times[number])
            found = reader.GetOutputDataObject(0)
            # beside a series is often its mesh
            return _blocks(found).get(series[0], found) if len(series) == 1 else found
        if len(times) > 1:
            reader.set_active_time_point(number)
        data = reader.read()
        if suffix == ".pvti":  # its pieces state how the image is turned, and VTK does not look there
            piece = next(ElementTree.parse(path).iter("Piece")).attrib["Source"]
            data.direction_matrix = pyvista.read(path.parent / piece).direction_matrix
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


def _scalars(attributes: Any) -> dict[str, Callable[[], Array]]:
    """Find what gives numbers, by name; components and magnitudes of vectors have names that no array has itself."""
    arrays = {name: np.asarray(array) for name, array in attributes.items() if not name.startswith("vtk")}
    out = dict[str, Callable[[], Array]]()
    for name, array in arrays.items():
        if array.dtype.kind not in "biuf":
            continue
        if array.size == len(array):
            out[name] = array.ravel
            continue
        names = "xyz" if array.shape[1] <= len("xyz") else map(str, range(array.shape[1]))
        parts = {f"{name}:{part}": each.ravel for each, part in zip(array.T, names, strict=False)}
        parts[f"{name}:magnitude"] = partial(np.linalg.norm, array.astype(np.float64, copy=False), axis=1)
        out |= {part: values for part, values in parts.items() if part not in arrays}
    return out


def _ghosts(attributes: Any, bits: int) -> Array | None:
    """Find the points or cells that have one of these bits; None without any."""
    found = (np.asarray(attributes[_GHOSTS]) & bits) != 0 if _GHOSTS in attributes else None
    return found if found is not None and found.any() else None


def _field(data: Any, at_points: _Numbers, of_cells: _Numbers, key: str | None) -> Field:
    """Values at points, or of cells at their centres, with axes i, j, k; axes of one sample are left out."""
    only = at_points or of_cells
    name = next(iter(only)) if key is None and len(only) == 1 else choose([*at_points, *of_cells], key)
    centred = name in of_cells
    sides = [max(1, count - centred) for count in data.dimensions]
    kept = [axis for axis in range(3) if sides[axis] > 1]
    if len(kept) < 2:
        raise InputError(f"has a grid of {' x '.join(map(str, sides))} samples", code="shape")
    shape, remarks = [sides[axis] for axis in kept], list[str]()
    values = (of_cells if centred else at_points)[name]().reshape(shape, order="F")
    gone, place = _hidden(data, centred, remarks), _place_of(data, kept, shape, centred, remarks)
    return placed_field(values, None if gone is None else gone.reshape(shape), place, remarks)


def _hidden(data: Any, centred: bool, remarks: list[str]) -> Array | None:
    """Find samples that are blanked, or whose cells or points are."""
    points, cells = _ghosts(data.point_data, _HIDDEN_POINT), _ghosts(data.cell_data, _LEFT_OUT_CELL)
    if points is None and cells is None:
        return None
    shape = data.dimensions
    points = np.zeros(shape, np.bool_) if points is None else points.reshape(shape, order="F")
    between = [max(1, count - 1) for count in shape]
    cells = np.zeros(between, np.bool_) if cells is None else cells.reshape(between, order="F")
    if centred:
        return cells | _over(points, np.logical_or)
    around = np.pad(cells, [(int(count > 1),) * 2 for count in shape], constant_values=True)
    gone = points | _over(around, np.logical_and)
    if count := int((cells & ~_over(gone, np.logical_or)).sum()):
        remarks.append(f"{count:,} hidden cells between points of others are not left out")
    return gone


def _over(array: Array, join: Any) -> Array:
    """Join neighbours along each axis of several."""
    for axis, count in enumerate(array.shape):
        if count > 1:
            array = join(array.take(range(count - 1), axis), array.take(range(1, count), axis))
    return array


def _place_of(
    data: Any, kept: Sequence[int], shape: Sequence[int], centred: bool, remarks: list[str]
) -> Placement | None:
    """Place the samples of a grid."""
    n, place, matrix, fixed = len(kept), None, np.zeros((3, 4)), dict[str, float]()
    if data.IsA("vtkImageData"):
        matrix = np.array(data.index_to_physical_matrix)[:3]
        first = np.array(data.extent[::2], float)
        first[kept] += centred * 0.5
        matrix[:, 3] += matrix[:, :3] @ first
    elif data.IsA("vtkRectilinearGrid"):
        along = [np.asarray(each, np.float64) for each in (data.x, data.y, data.z)]
        along = [(each[1:] + each[:-1]) / 2 if centred and len(each) > 1 else each for each in along]
        even = [even_steps(each) for each in along]
        if None in even:
            place = along_axes([along[axis] for axis in kept], range(n))
            fixed = {name: each[0] for name, each in zip("xyz", along, strict=True) if len(each) == 1}
        else:
            starts, steps = np.array(even).T
            matrix = np.column_stack([np.diag(steps), starts])
    else:
        along = [*np.asarray((data.cell_centers() if centred else data).points, np.float64).T]
        vary = [each.reshape(shape, order="F") for each in along if np.ptp(each)]
        place = at_nodes(vary) if len(vary) == n else Placement()
        fixed = {name: each[0] for name, each in zip("xyz", along, strict=True) if not np.ptp(each)}
    if place is None:
        # a picture lies in the plane, other slices in space
        flat = n == 2 and kept == [0, 1] and not matrix[2, [0, 1, 3]].any()
        return by_matrix(matrix[:2] if flat else matrix, kept)
    if any(name != "z" or value for name, value in fixed.items()):
        remarks.append(f"its place in space is left out: {', '.join(f'{c} = {value:g}' for c, value in fixed.items())}")
    return place if place.placed else None


# ---- meshes ----------------------------------------------------------------------------------------------------------


def _mesh(data: Any, at_points: _Numbers, of_cells: _Numbers, key: str | None) -> Mesh:
    """Triangles, tetrahedra or points, with values at points."""
    if key is None:
        key = next(iter(at_points)) if len(at_points) == 1 else "z" if "z" in at_points else None
    remarks = list[str]()
    data = _joined(data, remarks)
    if key in of_cells:
        data = data.cell_data_to_point_data()
        remarks.append("values of cells are averaged at points")
    cells, data = _cells_of(data, remarks)
    points, values = np.asarray(data.points, np.float64), _scalars(data.point_data)
    if cells is not None or np.ptp(points[:, 2]):
        values = {name: each.ravel for name, each in zip("xyz", points.T, strict=True)} | values
        key = "z" if key is None and cells is None and len(values) == 3 else key
    flat = cells is None or (cells.shape[1] == 3 and not points[:, 2].any())
    return Mesh(points[:, : 2 if flat else 3], cells, None if key is None else values[choose([*values], key)](),
                remarks=remarks)


def _joined(data: Any, remarks: list[str]) -> Any:
    """The cells of any data set without those that another piece holds.

    Points that coincide, as those where pieces meet, are joined, unless all values differ there.
    """
    grid = data.cast_to_unstructured_grid()
    first, number = np.unique(grid.points, axis=0, return_index=True, return_inverse=True)[1:]
    arrays = {name: np.asarray(each) for name, each in grid.point_data.items() if not name.startswith("vtk")}
    apart = [name for name, each in arrays.items()
             if not np.array_equal(each[first][number.ravel()], each, each.dtype.kind == "f")]
    if len(first) < grid.n_points and (not arrays or len(apart) < len(arrays)):
        grid = grid.clean(produce_merge_map=False, average_point_data=False)
        for name in apart:
            del grid.point_data[name]
            remarks.append(f"values that differ where points coincide are left out: {plain(name)}")
    if _ghosts(grid.cell_data, _LEFT_OUT_CELL) is not None:
        grid.RemoveGhostCells()
    return grid


def _cells_of(data: Any, remarks: list[str]) -> tuple[Array | None, Any]:
    """Triangles or tetrahedra of a data set, and the data set whose points they join; None of points alone."""
    types = data.celltypes
    kinds = {*types.tolist()}
    if not kinds - {0, 1, 2}:
        return None, data
    odd = kinds - _LOWER - _FLAT - _SOLID
    if odd or not kinds & (_FLAT | _SOLID):
        names = [_vtk("pyvista").CellType(each).name for each in sorted(odd)]
        raise InputError(f"holds cells of other kinds: {', '.join(names) or 'no triangles'}", code="mesh",
                         remedy="cut them into triangles or tetrahedra first")
    wanted, ours, name = (10, _SOLID, "tetrahedra") if kinds & _SOLID else (5, _FLAT, "triangles")
    if left := int(np.isin(types, [*ours], invert=True).sum()):
        remarks.append(f"{left:,} cells of lower dimension are left out")
    if kinds & ours != {wanted}:
        remarks.append(f"cells of other kinds are cut into {name}")
        if max(kinds & ours) > 21:
            remarks.append("values between the points of cells of higher order are taken as linear")
        data = data.triangulate()
    return np.asarray(data.cells_dict[wanted], np.int64), data
