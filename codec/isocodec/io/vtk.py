"""Data sets of VTK and PyVista and the files that these read; meshes of meshio.

A key names a block of several, an array, and a component of vectors: ``inlet/velocity:x``, ``velocity:magnitude``.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import lru_cache, partial
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
from .volumes import of_frames, squeezed

Array = NDArray[Any]
_Numbers = Mapping[str, Callable[[], Array]]
_GHOSTS = "vtkGhostType"
_HIDDEN_POINT, _LEFT_OUT_CELL = 2, 1 | 32
"""Bits of ghosts: points that are blanked; cells that another piece holds, or that are blanked."""
_SOLID, _FLAT = {*range(10, 17), *range(24, 28), 29, 32, 33}, {*range(5, 10), 22, 23, 28, 30, 34}
_LOWER = {*range(5), 21, 35}
"""Types of cells in space, in a plane and of lower dimension; those above 21 have points between their corners."""
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
        times, read = _steps(path, key)
    count, notes, remarks = len(times), {}, list[str]()
    if frame is not None:
        check_frame(frame, count if count > 1 else 0)
    elif count > 1:
        even = even_steps(np.array(times))
        if even is not None:
            notes[FRAME_STEP] = f"{even[1]:g}"
        if even is None or even[0]:
            remarks.append(f"its times are left out: {one_line(', '.join(f'{time:g}' for time in times))}")

    @lru_cache(1)
    def at(number: int) -> Any:
        with _complaints():
            data = read(number)
        found = of_vtk(data, key)
        return replace(found, notes=notes, remarks=(*found.remarks, *remarks))

    first = at(frame or 0)
    if isinstance(first, Field):
        return of_frames(at, count, frame, frames, "time")
    meshes = [first, *(map(at, range(1, count)) if frame is None else ())]
    names = "points", "cells"
    if not all(np.array_equal(getattr(each, name), getattr(first, name)) for each in meshes for name in names):
        raise InputError("its mesh changes in time", code="mesh", remedy="choose a time: --frame N")
    if len(meshes) == 1 or first.values is None:
        return first
    return replace(first, values=np.stack([each.values for each in meshes]))


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
        data, blocks = _vtk("pyvista").wrap(data), {"": data}
        if hasattr(data, "recursive_iterator"):
            blocks = dict(data.recursive_iterator("items", skip_none=True, prepend_names=True, separator="/"))
        named = [name for name in blocks if key is not None and f"{key}/".startswith(f"{name}/")]
        name = max(named, key=len) if named else choose([*blocks], None, "blocks")
        data, key = blocks[name], (key or "")[len(name) + 1 :] or None if named else key
        if not hasattr(data, "n_cells"):
            raise InputError(f"holds {plain(type(data).__name__)}, not a grid or a mesh", code="mesh")
        at_points, of_cells = _scalars(data.point_data), _scalars(data.cell_data)
        of_cells = {name: each for name, each in of_cells.items() if name not in at_points}
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
    """Raise an error for what VTK only complains about, before it gives zeros, and what meshio prints."""
    core = _vtk("vtkmodules.vtkCommonCore")
    remedy = "check it, or convert it to .vtu or .vti; grids of XDMF need a Time"
    logger, printed = core.vtkLogger, io.StringIO()
    level = logger.GetCurrentVerbosityCutoff()
    logger.SetStderrVerbosity(logger.VERBOSITY_OFF)
    try:
        with (reading("grid or mesh", remedy), redirect_stdout(printed), redirect_stderr(printed),
              _vtk("pyvista").VtkErrorCatcher(send_to_logging=False)):
            yield
            if "error" in (said := core.vtkOutputWindow.GetInstance().GetOutput()).lower():
                raise ValueError(said.partition("): ")[2])
    finally:
        logger.SetStderrVerbosity(level)


def _steps(path: Path, key: str | None) -> tuple[Sequence[float], Callable[[int], Any]]:
    """Times of a file and what reads one of them."""
    pyvista, suffix = _vtk("pyvista"), path.suffix.lower()
    known = suffix in pyvista.core.utilities.reader.CLASS_READERS and suffix not in _BY_MESHIO
    if suffix in (".xdmf", ".xmf"):
        known = False
        for each in ElementTree.parse(path).iter():
            if each.get("Format", "XML").upper() not in ("XML", "ASCII", "APPENDED"):
                (path.parent / str(each.text).strip().partition(":")[0]).stat()  # VTK crashes where it is missing
            known |= each.tag == "Time"  # PyVista does not read others
    if not known:
        meshio = _vtk("meshio")
        # of files of ANSYS its reader may not come to an end
        return (0.0,), lambda _: pyvista.from_meshio(meshio.read(path, "gmsh" if suffix == ".msh" else None))
    reader = pyvista.get_reader(path)
    for kind in ("point", "cell"):
        names = getattr(reader, f"{kind}_array_names", [])
        named = [name for name in names if name in (key or "")]
        for name in {*names} - {*named, _GHOSTS} if named else ():
            getattr(reader, f"disable_{kind}_array")(name)
    times = getattr(reader, "time_values", None) or (0.0,)

    def read(number: int) -> Any:
        if len(times) > 1:
            reader.set_active_time_point(number)
        data = reader.read()
        if suffix == ".pvti":  # its pieces state how the image is turned, and VTK does not look there
            piece = next(ElementTree.parse(path).iter("Piece")).attrib["Source"]
            data.direction_matrix = pyvista.read(path.parent / piece).direction_matrix
        return data

    return times, read


# ---- data sets -------------------------------------------------------------------------------------------------------


def _scalars(attributes: Any) -> dict[str, Callable[[], Any]]:
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
    values = values if gone is None else np.ma.masked_array(values, gone.reshape(shape, order="F"))
    return squeezed(values, place, remarks)


def _hidden(data: Any, centred: bool, remarks: list[str]) -> Array | None:
    """Find samples that are blanked, or whose cells or points are."""
    if _GHOSTS not in data.point_data and _GHOSTS not in data.cell_data:
        return None
    points = np.asarray(data.point_data.get(_GHOSTS, np.zeros(data.n_points, np.uint8))) & _HIDDEN_POINT > 0
    cells = np.asarray(data.cell_data.get(_GHOSTS, np.zeros(data.n_cells, np.uint8))) & _LEFT_OUT_CELL > 0
    grid = data.copy(deep=False)
    grid.clear_data()
    grid.point_data["part"], grid.cell_data["part"] = points.astype(np.float64), cells.astype(np.float64)
    if centred:
        return np.asarray(cells | (grid.point_data_to_cell_data()["part"] > 0))
    if cells.any():
        remarks.append("hidden cells are left out only where no other cell has their points")
    return np.asarray(points | (grid.cell_data_to_point_data()["part"] == 1))


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
    place = None
    if data.IsA("vtkRectilinearGrid"):
        along = [np.asarray(each, np.float64) for each in (data.x, data.y, data.z)]
        along = [(each[1:] + each[:-1]) / 2 if centred and len(each) > 1 else each for each in along]
        place = along_axes([along[axis] for axis in kept], range(len(kept)))
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
    """Triangles, tetrahedra or points, with values at points; points that coincide, as where pieces meet, are one."""
    if key is None:
        key = next(iter(at_points)) if len(at_points) == 1 else "z" if "z" in at_points else None
    data, remarks = data.cast_to_unstructured_grid(), list[str]()
    if _GHOSTS in data.cell_data:
        data.RemoveGhostCells()
    if key in of_cells:
        data = data.clean(produce_merge_map=False, average_point_data=False).cell_data_to_point_data()
        remarks.append("values of cells are averaged at points")
    cells, data = _cells_of(data, remarks)
    points, values = np.asarray(data.points, np.float64), _scalars(data.point_data)
    if cells is not None or np.ptp(points[:, 2]):
        values = {name: each.ravel for name, each in zip("xyz", points.T, strict=True)} | values
        key = "z" if key is None and cells is None and len(values) == 3 else key
    flat = cells is None or (cells.shape[1] == 3 and not points[:, 2].any())
    chosen = None if key is None else values[choose([*values], key)]()
    first, number = np.unique(points, axis=0, return_index=True, return_inverse=True)[1:]
    if len(first) < len(points):
        if chosen is not None and not np.array_equal(chosen[first][number.ravel()], chosen, equal_nan=True):
            remarks.append("points that coincide have different values, and are not joined")
        else:
            points, chosen = points[first], None if chosen is None else chosen[first]
            cells = None if cells is None else number.ravel()[cells]
    return Mesh(points[:, : 2 if flat else 3], cells, chosen, remarks=remarks)


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
        remarks.append(f"cells of other kinds are cut into {name}, those of higher order as linear")
        data = data.triangulate()
    return np.asarray(data.cells_dict[wanted], np.int64), data
