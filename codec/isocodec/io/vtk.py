"""Data sets of VTK and PyVista and the files that these read; meshes of meshio.

A key names a block of several, an array, and a component of vectors: ``inlet/velocity:x``, ``velocity:magnitude``.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, plain
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.placement import Placement
from ..field.sampled import Field
from ..verbs import Choice
from .arrays import valued
from .in_turn import check_frame
from .libraries import choose, library, reading
from .places import along_axes, at_nodes, by_matrix
from .volumes import of_frames, squeezed

SUFFIXES = (".vti", ".vtr", ".vts", ".vtu", ".vtp", ".vtk", ".pvd", ".vtm", ".pvti", ".pvtr", ".pvtu",
            ".xdmf", ".xmf", ".vtkhdf", ".ply", ".stl", ".obj", ".msh")
_BY_MESHIO = ".ply", ".obj", ".stl", ".off", ".inp"
"""Suffixes whose files VTK reads without their values, or not as a mesh."""
_GHOSTS = "vtkGhostType"
_HIDDEN_POINT, _LEFT_OUT_CELL = 2, 1 | 32
"""Bits of ghosts: points that are blanked; cells that another piece holds, or that are blanked."""
_CELLS = {*range(17), *range(21, 36)} - {31}
"""Types of cells that can be cut into triangles and tetrahedra."""
_LOWER, _TRIANGLE, _TETRAHEDRON = {*range(5), 21, 35}, 5, 10
Array = NDArray[Any]
_Numbers = Mapping[str, Callable[[], Array]]


def _vtk(module: str) -> Any:
    return library(module, extra="vtk", purpose="reading meshes and files of VTK")


def open_(path: Path, choice: Choice) -> Field | Frames | Mesh:
    """Read a file that PyVista reads, or a mesh that meshio does; of a mesh that stays, all times as values (F, V)."""
    with _complaints():
        times, read = _steps(path)

    @lru_cache(1)
    def at(number: int) -> Any:
        with _complaints():
            data = read(number)
        return of_vtk(data, choice)

    if choice.frame is not None:
        check_frame(choice.frame, len(times) if len(times) > 1 else 0)
    first = at(choice.frame or 0)
    if isinstance(first, Field):
        return of_frames(at, len(times), choice, "time", times)
    meshes, names = [*map(at, range(len(times)))] if choice.frame is None else [first], ("points", "cells")
    if not all(np.array_equal(getattr(each, name), getattr(first, name)) for each in meshes for name in names):
        raise InputError("its mesh changes in time", code="mesh", remedy="choose a time: --frame N")
    if len(meshes) == 1 or first.values is None:
        return first
    return replace(first, values=np.stack([each.values for each in meshes]), times=times)


def of_vtk(data: Any, choice: Choice) -> Field | Mesh:
    """Read a data set of VTK or PyVista, or a block of several.

    Of a grid samples with axes i, j (, k): values at its points, or of its cells at their centres. Of a surface or
    other cells a mesh; values of cells are averaged at its points. Points without cells are scattered over the plane.
    """
    with reading("VTK data"):
        data, key = _vtk("pyvista").wrap(data), choice.key
        if hasattr(data, "recursive_iterator"):
            blocks = dict(data.recursive_iterator("items", skip_none=True, prepend_names=True, separator="/"))
            named = [name for name in blocks if f"{key}/".startswith(f"{name}/")]
            name = max(named, key=len) if named else choose([*blocks], None, "blocks")
            data, key = blocks[name], str(key)[len(name) + 1 :] or None if named else key
        if not getattr(data, "n_points", 0):
            raise InputError(f"holds no points of a grid or a mesh: {plain(type(data).__name__)}", code="mesh")
        at_points = _arrays(data.point_data)
        of_cells = {name: each for name, each in _arrays(data.cell_data).items() if name not in at_points}
        grid = hasattr(data, "dimensions") and not (
            data.IsA("vtkStructuredGrid") and data.dimensions.count(1) == 1 and np.ptp(data.points, axis=0).all())
        return (_field if grid else _mesh)(data, at_points, of_cells, key)


def of_meshio(mesh: Any, choice: Choice) -> Field | Mesh:
    """Read a mesh of meshio; result and errors as of `of_vtk`."""
    with reading("mesh"):
        return of_vtk(_vtk("pyvista").from_meshio(mesh), choice)


# ---- files -----------------------------------------------------------------------------------------------------------


@contextmanager
def _complaints() -> Iterator[None]:
    """Raise an error for what VTK only complains about, before it gives zeros, and what meshio prints."""
    core = _vtk("vtkmodules.vtkCommonCore")
    logger, printed = core.vtkLogger, io.StringIO()
    level = logger.GetCurrentVerbosityCutoff()
    logger.SetStderrVerbosity(logger.VERBOSITY_OFF)
    try:
        with (reading("grid or mesh", "check it, or convert it to .vtu or .vti; grids of XDMF need a Time"),
              redirect_stdout(printed), redirect_stderr(printed),
              _vtk("pyvista").VtkErrorCatcher(send_to_logging=False)):
            yield
            if "error" in (said := core.vtkOutputWindow.GetInstance().GetOutput()).lower():
                raise ValueError(said)
    finally:
        logger.SetStderrVerbosity(level)


def _steps(path: Path) -> tuple[Sequence[float], Callable[[int], Any]]:
    """Find the times of a file and what reads the data of one."""
    pyvista, suffix = _vtk("pyvista"), path.suffix.lower()
    known, bare = suffix in pyvista.core.utilities.reader.CLASS_READERS and suffix not in _BY_MESHIO, set[str]()
    if suffix in (".xdmf", ".xmf"):
        items = [*ElementTree.parse(path).iter()]
        known = any(each.tag == "Time" for each in items)  # PyVista does not read others
        # VTK takes values of a series for those of the bare mesh that it points to
        bare = {str(each.get("Name")) for each in items if each.tag == "Grid" and not each.findall(".//Attribute")}
        for each in items:
            if each.get("Format", "XML").upper() not in ("XML", "ASCII", "APPENDED"):
                (path.parent / str(each.text).strip().partition(":")[0]).stat()  # VTK crashes where it is missing
    if not known:
        meshio = _vtk("meshio")
        # of files of ANSYS its reader may not come to an end
        return (0.0,), lambda _: pyvista.from_meshio(meshio.read(path, "gmsh" if suffix == ".msh" else None))
    reader = pyvista.get_reader(path)
    times = getattr(reader, "time_values", None) or (0.0,)

    def read(number: int) -> Any:
        if len(times) > 1:
            reader.set_active_time_point(number)
        data = reader.read()
        for name in bare.intersection(data.keys() if hasattr(data, "recursive_iterator") else ()):
            del data[name]
        if suffix == ".pvti":  # its pieces state how the image is turned, and VTK does not look there
            piece = next(ElementTree.parse(path).iter("Piece")).attrib["Source"]
            data.direction_matrix = pyvista.read(path.parent / piece).direction_matrix
        return data

    return times, read


# ---- data sets -------------------------------------------------------------------------------------------------------


def _arrays(attributes: Any) -> dict[str, Callable[[], Any]]:
    """Collect what gives numbers, by name; components and magnitudes of vectors have names that no array has itself."""
    out, parts = dict[str, Callable[[], Any]](), dict[str, Callable[[], Any]]()
    for name, array in attributes.items():
        array = np.asarray(array)
        if array.dtype.kind not in "biuf" or name.startswith("vtk"):
            continue
        if array.size == len(array):
            out[name] = array.ravel
            continue
        names = "xyz" if array.shape[1] < 4 else "012345678"
        parts |= {f"{name}:{part}": each.ravel for each, part in zip(array.T, names, strict=False)}
        parts[f"{name}:magnitude"] = partial(np.linalg.norm, array, axis=1)
    return parts | out


def _field(data: Any, at_points: _Numbers, of_cells: _Numbers, key: str | None) -> Field:
    """Read values at points, or of cells at their centres, with axes i, j, k; axes of one sample are left out."""
    only = at_points or of_cells
    name = choose([*only] if key is None and len(only) == 1 else [*at_points, *of_cells], key)
    centred = name in of_cells
    sides = [max(1, count - centred) for count in data.dimensions]
    kept = [axis for axis in range(3) if sides[axis] > 1]
    if len(kept) < 2:
        raise InputError(f"has a grid of {' x '.join(map(str, sides))} samples", code="shape")
    shape, remarks = [sides[axis] for axis in kept], list[str]()
    values = np.ma.masked_array((of_cells if centred else at_points)[name](), _hidden(data, centred, remarks))
    place = _place_of(data, kept, shape, centred, remarks)
    return squeezed(values.reshape(shape, order="F"), place, remarks)


def _hidden(data: Any, centred: bool, remarks: list[str]) -> Any:
    """Find samples that are blanked, or whose cells or points are."""
    if _GHOSTS not in data.point_data and _GHOSTS not in data.cell_data:
        return False
    points = np.asarray(data.point_data.get(_GHOSTS, np.zeros(data.n_points, np.uint8))) & _HIDDEN_POINT > 0
    cells = np.asarray(data.cell_data.get(_GHOSTS, np.zeros(data.n_cells, np.uint8))) & _LEFT_OUT_CELL > 0
    grid = data.copy(deep=False)
    grid.clear_data()
    grid.point_data["part"], grid.cell_data["part"] = points.astype(np.float64), cells.astype(np.float64)
    if centred:
        return cells | (grid.point_data_to_cell_data()["part"] > 0)
    if cells.any():
        remarks.append("hidden cells are left out only where no other cell has their points")
    return points | (grid.cell_data_to_point_data()["part"] == 1)


def _place_of(
    data: Any, kept: Sequence[int], shape: Sequence[int], centred: bool, remarks: list[str]
) -> Placement | None:
    """Place the samples of a grid."""
    if data.IsA("vtkImageData"):
        matrix, first = np.array(data.index_to_physical_matrix)[:3], np.array(data.extent[::2], np.float64)
        first[kept] += centred * 0.5
        matrix[:, 3] += matrix[:, :3] @ first
        # a picture lies in the plane, other slices in space
        flat = [*kept] == [0, 1] and not matrix[2, [0, 1, 3]].any()
        return by_matrix(matrix[:2] if flat else matrix, kept)
    if data.IsA("vtkRectilinearGrid"):
        along = [np.asarray(each, np.float64) for each in (data.x, data.y, data.z)]
        along = [(each[1:] + each[:-1]) / 2 if centred and len(each) > 1 else each for each in along]
        place: Placement | None = along_axes([along[axis] for axis in kept], range(len(kept)))
    else:
        along = [*np.asarray((data.cell_centers() if centred else data).points, np.float64).T]
        vary = [each.reshape(shape, order="F") for each in along if np.ptp(each)]
        place = at_nodes(vary) if len(vary) == len(kept) else None
    fixed = [f"{name} = {each[0]:g}" for name, each in zip("xyz", along, strict=True)
             if not np.ptp(each) and (name != "z" or each[0])]
    remarks += [f"its place in space is left out: {', '.join(fixed)}"] * bool(fixed)
    return place


# ---- meshes ----------------------------------------------------------------------------------------------------------


def _mesh(data: Any, at_points: _Numbers, of_cells: _Numbers, key: str | None) -> Mesh:
    """Read triangles, tetrahedra or points; points that coincide, as where pieces meet, are one."""
    data, remarks = data.cast_to_unstructured_grid(), list[str]()
    if key is None and len(at_points) == 1:
        (key,) = at_points
    if _GHOSTS in data.cell_data:
        data.RemoveGhostCells()
    if key in of_cells:
        data = data.clean(produce_merge_map=False, average_point_data=False).cell_data_to_point_data()
        remarks.append("values of cells are averaged at points")
    cells, data = _cells_of(data, remarks)
    points = np.asarray(data.points, np.float64)
    values = {name: give() for name, give in _arrays(data.point_data).items()}
    if cells is None:
        height = key == "z" or (not values and np.ptp(points[:, 2]))
        values = {"z": points[:, 2], **values} if height else values
        return valued(points[:, :2], None, values, key, remarks=remarks)
    found: Any = valued(points, cells, values, key, remarks=remarks)
    first, number = np.unique(found.points, axis=0, return_index=True, return_inverse=True)[1:]
    if len(first) == len(points):
        return found
    joined = None if found.values is None else found.values[first]
    if joined is not None and not np.array_equal(joined[number.ravel()], found.values, equal_nan=True):
        return replace(found, remarks=[*remarks, "points that coincide have different values, and are not joined"])
    return replace(found, points=found.points[first], cells=number.ravel()[cells], values=joined)


def _cells_of(data: Any, remarks: list[str]) -> tuple[Array | None, Any]:
    """Find triangles or tetrahedra, and the data set whose points they join; None of points alone."""
    kinds = {*data.celltypes.tolist()}
    if kinds <= {0, 1, 2}:
        return None, data
    odd = [_vtk("pyvista").CellType(each).name for each in sorted(kinds - _CELLS)]
    if kinds - _LOWER - {_TRIANGLE, _TETRAHEDRON} and not odd:
        remarks.append("cells of other kinds are cut into triangles or tetrahedra, those of higher order as linear")
        data = data.triangulate()
    wanted = _TETRAHEDRON if _TETRAHEDRON in data.cells_dict else _TRIANGLE
    cells = data.cells_dict.get(wanted)
    if odd or cells is None:
        raise InputError(f"holds cells of other kinds: {', '.join(odd) or 'no triangles'}", code="mesh",
                         remedy="cut them into triangles or tetrahedra first")
    if len(cells) < data.n_cells:
        remarks.append(f"{data.n_cells - len(cells):,} cells of lower dimension are left out")
    return np.asarray(cells, np.int64), data
