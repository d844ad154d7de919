"""VTK reads its files, parallel ones and collections, and XDMF: grids, meshes, points; and objects of VTK and PyVista.

Samples are the values at the points of a grid, or at the centres of its cells. The key that chooses them names a block
of a collection, an array, and a component of vectors: ``inlet/velocity:x``, ``velocity:1``, ``velocity:magnitude``.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, one_line, plain
from ...extras import optional
from ...field.placement import Placement
from .from_h5py import arrays_of_hdf5
from .mesh_formats import HEIGHT, MeshFormat, MeshRead
from .opened import Choice, Format, Opened
from .place_of_samples import placed
from .reading import check_frame, named, reading
from .source import InputFile

Array = NDArray[Any]
Blocks = dict[str, Callable[[], Any]]
"""Data sets by name; one that is not in a collection has the name ``""``."""
_Grid = tuple[Array, Placement]

_HEAD = 1 << 16
_ROOT = re.compile(rb"<VTKFile\b[^>]*\btype\s*=\s*[\"'](\w+)")
_LEGACY = re.compile(rb"\s*# vtk DataFile.*?^\s*DATASET\s+(\w+)", re.MULTILINE | re.IGNORECASE | re.DOTALL)
_SIZES = re.compile(rb"NumberOf(?:Points|Cells|Polys)\s*=\s*[\"'](\d+)|^\s*(?:POINTS|\w+_DATA)\s+(\d+)", re.M)
_EXTENTS = re.compile(rb"WholeExtent\s*=\s*[\"']([-\d\s]+)[\"']|^\s*DIMENSIONS\s+([\d\s]+)", re.MULTILINE)
_GRID_OF_XDMF = re.compile(rb"Type\s*=\s*[\"']\dD\w*Mesh", re.IGNORECASE)
_PACKED = 8256
"""Samples that a byte of a packed file holds at most: of one bit, deflated."""
_COLLECTION, _XDMF = "Collection", "Xdmf"
_MESHES = ("UnstructuredGrid", "PUnstructuredGrid", "PolyData", "PPolyData", "UNSTRUCTURED_GRID", "POLYDATA")
_USUAL = re.compile(rb'<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" *(\[ *\])? *>|encoding=["\'](?i:utf-8|us-ascii)["\']')
_DECLARED = re.compile(rb"<!DOCTYPE|<!ENTITY|<\?xml[^>]*encoding")
_DEEPEST = 8
"""Collections within collections."""
_OWN, _GHOSTS = "vtk", "vtkGhostType"
"""Beginning of names that VTK keeps for itself: numbers of points and cells before filters; ghosts."""
_HIDDEN_POINT, _LEFT_OUT_CELL = 2, 1 | 32
"""Bits of ghosts: points that are blanked; cells that another piece holds, or that are blanked."""
_COMPONENTS = ("x", "y", "z")
_TRIANGLE, _TETRA = 5, 10
_LOWER = {0, 1, 2, 3, 4, 21, 35}
"""Types of cells that are points and lines; meshes hold them beside, often as boundaries."""
_SOLID = {10, 11, 12, 13, 14, 15, 16, 24, 25, 26, 27, 29, 32, 33}
_FLAT = {5, 6, 7, 8, 9, 22, 23, 28, 30, 34}
_HIGHER = {22, 23, 24, 25, 26, 27, 28, 29, 30, 32, 33, 34}
"""Types of cells in space, in a plane, and those of them with points between their corners."""


def _vtk(module: str) -> Any:
    return optional(f"vtkmodules.{module}", extra="vtk", purpose="reading files and objects of VTK")


def _pyvista() -> Any:
    return optional("pyvista", extra="vtk", purpose="reading files and objects of VTK")


# ---- files ----------------------------------------------------------------------------------------------------------


def _head(source: InputFile) -> bytes:
    with source.path.open("rb") as file:
        return file.read(_HEAD)


def _kind_of(source: InputFile) -> str:
    """Type of the data in a file, by its first bytes; in capitals if it is a legacy file."""
    head = _head(source)
    if found := _LEGACY.match(head):
        return found[1].decode().upper()
    if found := _ROOT.search(head):
        return found[1].decode()
    if b"<Xdmf" in head:
        return _XDMF
    raise InputError("is not a file of VTK or XDMF", code="unreadable")


def _is_collection(kind: str) -> bool:
    return kind == _COLLECTION or kind.startswith("vtk")


def _holds_mesh(source: InputFile, key: str | None, depth: int = 0) -> bool:
    """Whether a file holds a mesh: of a collection the block that is chosen, else the first one."""
    try:
        kind = _kind_of(source)
        if kind == _XDMF:
            return not _GRID_OF_XDMF.search(_head(source))
        if not _is_collection(kind) or depth > _DEEPEST:
            return kind in _MESHES
        parts = [*_parts(source).items()]
        name, files = next((part for part in parts if _inner_key(key, part[0]) is not None), parts[0])
        return _holds_mesh(_other(source, files[0]), _inner_key(key, name), depth + 1)
    except (InputError, OSError, IndexError):
        return False


def _elements(source: InputFile) -> Iterator[ElementTree.Element]:
    with reading("XML"):
        text = source.path.read_bytes()
        # other encodings could hide declarations, which name files
        if _DECLARED.search(_USUAL.sub(b"", text[:_HEAD]) + text[_HEAD:]) or b"\0" in text:
            raise InputError("declares entities or an encoding, which no such file needs", code="unreadable")
        return ElementTree.fromstring(text).iter()


def _parts(source: InputFile, time: str | None = None) -> dict[str, list[str]]:
    """Files of a collection by the name of the block; of one in time those of a time."""
    out: dict[str, list[str]] = {}

    def walk(element: ElementTree.Element, path: tuple[str, ...]) -> None:
        for number, each in enumerate(element):
            if time is not None and each.get("timestep", "0") != time:
                continue
            part = f"block {number}" if time is None else str(each.get("part", "0"))
            inner = (*path, str(each.get("name") or part))
            if each.tag in ("DataSet", "Piece") and each.get("file"):
                out.setdefault("/".join(inner), []).append(str(each.get("file")))
            walk(each, inner)

    for child in next(element for element in _elements(source) if element.tag == "VTKFile"):
        walk(child, ())
    return out


def _other(source: InputFile, name: str | None) -> InputFile:
    """A file that this one names, if it may be read."""
    return replace(source, path=source.beside(str(name)))


def _steps(source: InputFile, key: str | None) -> list[Callable[[], Blocks]]:
    """Loaders of the blocks of each time; most files have only one."""
    kind = _kind_of(source)
    if kind == _XDMF:
        return _steps_of_xdmf(source)
    times: set[str | None] = {None}
    if kind == _COLLECTION:
        times = {element.get("timestep", "0") for element in _elements(source) if element.tag == "DataSet"}
    return [partial(_blocks, source, key, time) for time in sorted(times, key=lambda time: float(time or 0))]


def _blocks(source: InputFile, key: str | None, time: str | None = None, depth: int = 0) -> Blocks:
    """The data sets of a file; those of a collection are read when they are asked for."""
    if depth > _DEEPEST:
        raise InputError(f"collections of more than {_DEEPEST} levels", code="unreadable")
    kind, out = _kind_of(source), Blocks()
    if not _is_collection(kind):
        return {"": partial(_dataset, source, kind, key)}
    parts = _parts(source, time)
    for block, files in parts.items():
        for number, each in enumerate(files):
            name = block if len(files) == 1 else f"{block}/{number}"
            name = "" if time is not None and len(parts) == len(files) == 1 else name
            blocks = _blocks(_other(source, each), _inner_key(key, name) if name else key, None, depth + 1)
            out |= {"/".join(filter(None, (name, inner))): load for inner, load in blocks.items()}
    return out


def _inner_key(key: str | None, block: str) -> str | None:
    """Cut the name of a block off a key; None if it does not begin with that."""
    return key[len(block) + 1 :] if key is not None and key.startswith(f"{block}/") else None


def _dataset(source: InputFile, kind: str, key: str | None) -> Any:
    """Read a file with one data set; of XML only the arrays that a key can mean."""
    _check_sizes(source, kind)
    pieces: list[InputFile] = []
    with _complaints():
        if kind.isupper():
            reader = _pyvista().VTKDataSetReader(str(source.path)).reader
        else:
            maker = getattr(_vtk("vtkIOXML"), f"vtkXML{kind}Reader", None)
            if maker is None:
                raise InputError(f"holds {plain(kind)}, not a grid or a mesh", code="unreadable")
            if kind[0] == "P" and kind != "PolyData":
                pieces = [_other(source, each.get("Source")) for each in _elements(source) if each.get("Source")]
            reader = maker()
            reader.SetFileName(str(source.path))
            reader.UpdateInformation()
            for selection in (reader.GetPointDataArraySelection(), reader.GetCellDataArraySelection()):
                names = [selection.GetArrayName(i) for i in range(selection.GetNumberOfArrays())]
                if key is not None and any(name in key for name in names):
                    for name in names:
                        selection.SetArraySetting(name, int(name in key or name == _GHOSTS))
        reader.Update()
    found = reader.GetOutputDataObject(0)
    if reader.GetErrorCode() or found is None or not found.GetNumberOfPoints():
        raise InputError("cannot be read as a file of VTK (damaged, or without points)", code="unreadable")
    if kind == "PImageData" and pieces:
        # only the pieces state it
        found.SetDirectionMatrix(_dataset(pieces[0], "ImageData", None).GetDirectionMatrix())
    return found


def _check_sizes(source: InputFile, kind: str) -> None:
    """Check the counts at the beginning of a file against the limit, and against the bytes of the file."""
    head = _head(source)
    counts = [int(one or other) for one, other in _SIZES.findall(head)]
    for extent, dimensions in _EXTENTS.findall(head):
        numbers = [int(number) for number in (extent or dimensions).split()]
        if extent:
            numbers = [max(0, high - low + 1) for low, high in zip(numbers[::2], numbers[1::2], strict=False)]
        counts.append(math.prod(numbers[:3]))
    for count in counts:
        source.check_count(count)
        if kind[0] != "P" or kind in ("PolyData", "POLYDATA"):
            source.check_bytes(count // (8 if kind.isupper() else _PACKED))


@contextmanager
def _complaints() -> Iterator[None]:
    """Raise an error for what VTK only complains about."""
    core = _vtk("vtkCommonCore")
    before, window = core.vtkOutputWindow.GetInstance(), core.vtkStringOutputWindow()
    logged = core.vtkLogger.GetCurrentVerbosityCutoff()
    core.vtkOutputWindow.SetInstance(window)
    core.vtkLogger.SetStderrVerbosity(core.vtkLogger.VERBOSITY_OFF)
    try:
        with reading("a file of VTK"):
            yield
    finally:
        core.vtkOutputWindow.SetInstance(before)
        core.vtkLogger.SetStderrVerbosity(logged)
    errors = [part for part in window.GetOutput().split("\n\n") if "error" in part.lower()]
    if errors:
        text = one_line(errors[0].rpartition("): ")[2]) or "damaged"
        raise InputError(f"cannot be read as a file of VTK ({text})", code="unreadable")


def _steps_of_xdmf(source: InputFile) -> list[Callable[[], Blocks]]:
    series = _check_xdmf(source)
    pipeline = _vtk("vtkCommonExecutionModel").vtkStreamingDemandDrivenPipeline
    reader = _vtk("vtkIOXdmf2").vtkXdmfReader()
    with _complaints():
        reader.SetFileName(str(source.path))
        reader.UpdateInformation()
        about = reader.GetOutputInformation(0)
        times = about.Get(pipeline.TIME_STEPS()) if about.Has(pipeline.TIME_STEPS()) else (None,)

    def at(time: float | None) -> Blocks:
        with _complaints():
            reader.Update() if time is None else reader.UpdateTimeStep(time)
            blocks = blocks_of(_pyvista().wrap(reader.GetOutputDataObject(0)).copy())
        # the mesh of a series is often a grid beside it
        in_time = {name: load for name, load in blocks.items() if name in series}
        return in_time if time is not None and in_time else blocks

    return [partial(at, time) for time in times]


def _check_xdmf(source: InputFile) -> set[str]:
    """Check the files that XDMF names for its samples; returns the names of its series."""
    series, arrays = set(), dict[Path, set[str]]()
    for element in _elements(source):
        attributes = {name.rpartition("}")[2].lower(): value for name, value in element.attrib.items()}
        if element.tag.rpartition("}")[2] == "include" and attributes.get("href"):
            source.beside(attributes["href"])
        if attributes.get("collectiontype", "").lower() == "temporal":
            series.add(attributes.get("name", ""))
        form = attributes.get("format", "xml").lower()
        if form != "xml":
            name, _, inner = (element.text or "").strip().partition(":")
            if form not in ("hdf", "binary") or attributes.get("heavydatasetname"):
                raise InputError(f"keeps samples as {plain(form)}", code="unreadable", remedy="use XML, HDF or Binary")
            target = source.beside(name)
            if form == "hdf" and not source.follow:
                arrays.setdefault(target, set()).add(inner.strip("/"))
        count = attributes.get("dimensions", attributes.get("numberofelements", "")).split()
        if count and all(part.isdigit() for part in count):
            source.check_count(math.prod(map(int, count)))
    for path, names in arrays.items():
        with arrays_of_hdf5(replace(source, path=path)) as held:
            for name in names:
                if name in held.away:
                    raise source.refused(held.away[name], "which holds samples of it")
                if name not in held.found:
                    raise InputError(f"names the array {plain(name)}, which {plain(path.name)} does not hold itself",
                                     code="unreadable")
                source.check_array(held.found[name].shape, held.found[name].dtype)
    return series


# ---- data sets ------------------------------------------------------------------------------------------------------


def is_vtk(thing: Any) -> bool:
    """Whether something is an object of VTK or PyVista that holds data."""
    model = sys.modules.get("vtkmodules.vtkCommonDataModel")
    return model is not None and isinstance(thing, model.vtkDataObject)


def blocks_of(data: Any) -> Blocks:
    """The data sets of an object of VTK, by the names of blocks."""
    if not hasattr(data, "GetNumberOfBlocks"):
        return {"": lambda: data}
    out: Blocks = {}
    for number in range(data.GetNumberOfBlocks()):
        block = data.GetBlock(number)
        name = data.GetMetaData(number).Get(data.NAME()) if data.HasMetaData(number) else None
        for inner, load in ({} if block is None else blocks_of(block)).items():
            out["/".join(filter(None, (name or f"block {number}", inner)))] = load
    return out


def holds_grid(data: Any, key: str | None) -> bool:
    """Whether what a key names of an object of VTK is a grid, and not a mesh or a surface in space."""
    chosen = _chosen(blocks_of(data), key)[1]
    if not hasattr(chosen, "dimensions"):
        return not hasattr(chosen, "n_cells")
    flat = chosen.dimensions.count(1) == 1
    return not (flat and chosen.IsA("vtkStructuredGrid") and np.diff(np.reshape(chosen.bounds, (3, 2))).all())


def _chosen(blocks: Blocks, key: str | None) -> tuple[str, Any, str | None]:
    """The block that a key names, or the only one: its name, its data as PyVista has them, the rest of the key."""
    matching = [name for name in blocks if name == key or _inner_key(key, name) is not None]
    remedy = "choose one with --key BLOCK/ARRAY, or --values BLOCK/ARRAY of a mesh"
    name = max(matching, key=len) if matching else named("blocks", {each: (each,) for each in blocks}, None, remedy)
    with reading("VTK data"):
        return name, _pyvista().wrap(blocks[name]()), _inner_key(key, name) if matching else key


def _arrays(attributes: Any) -> dict[str, Array]:
    """Arrays of numbers of points or cells by name, (N,) or (N, C)."""
    found = {name: np.asarray(array) for name, array in attributes.items() if not name.startswith(_OWN)}
    return {name: array for name, array in found.items() if array.dtype.kind in "biuf"}


def _scalars(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Arrays of one number each; components and magnitudes of vectors have names that no array has itself."""
    out: dict[str, Array] = {}
    for name, array in arrays.items():
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


# ---- grids ----------------------------------------------------------------------------------------------------------


def _grid_of(data: Any, key: str | None, average: bool) -> _Grid:
    """Values at points, or of cells at their centres, with axes i, j, k; axes of one sample are left out."""
    if not hasattr(data, "dimensions"):
        kind = "a mesh" if hasattr(data, "n_cells") else plain(type(data).__name__)
        raise InputError(f"holds {kind}, not a grid", code="field", remedy="name its values: --values NAME")
    at_points = _scalars(_arrays(data.point_data))
    of_cells = {name: each for name, each in _scalars(_arrays(data.cell_data)).items() if name not in at_points}
    values = at_points | of_cells
    if not values:
        raise InputError("holds no values at its points or of its cells", code="key")
    if key is not None and key not in values and key[-2:] in (":0", ":1", ":2"):
        key = key[:-1] + _COMPONENTS[int(key[-1])]
    if key is None and len(at_points or of_cells) == 1:
        key = next(iter(values))
    key = named("arrays", {name: (name,) for name in values}, key)
    centred = key in of_cells
    if centred and average:
        data, centred = data.cell_data_to_point_data(), False
        values = _scalars(_arrays(data.point_data))
    sides = [max(1, count - centred) for count in data.dimensions]
    kept = [axis for axis in range(3) if sides[axis] > 1]
    if len(kept) not in (2, 3):
        raise InputError(f"has a grid of {' x '.join(map(str, sides))} samples", code="shape")
    # x is the fastest axis of VTK
    shape = [sides[axis] for axis in kept]
    found = np.ascontiguousarray(values[key].reshape(shape, order="F"))
    hidden = _ghosts(data.cell_data, _LEFT_OUT_CELL) if centred else _ghosts(data.point_data, _HIDDEN_POINT)
    if hidden is not None:
        found = np.where(hidden.reshape(shape, order="F"), np.nan, found)
    return found, _place_of(data, shape, kept, centred)


def _place_of(data: Any, shape: Sequence[int], kept: list[int], centred: bool) -> Placement:
    """Placement of the samples of a grid."""
    n = len(kept)
    if data.IsA("vtkImageData"):
        matrix = np.array(data.index_to_physical_matrix)[:3]
        first = np.array(data.extent[::2], float)
        first[kept] += centred * 0.5
        matrix[:, 3] += matrix[:, :3] @ first
        # a picture lies in the plane, other slices in space
        rows = kept if n == 3 or (kept == [0, 1] and not matrix[2, [0, 1, 3]].any()) else slice(None)
        return placed(matrix[rows][:, [*kept, 3]], n)
    if data.IsA("vtkRectilinearGrid"):
        along = [np.array((data.x, data.y, data.z)[axis], np.float64) for axis in kept]
        along = [(each[1:] + each[:-1]) / 2 if centred else each for each in along]
        steps = [(each[-1] - each[0]) / (len(each) - 1) for each in along]
        if all(
            np.allclose(each, each[0] + step * np.arange(len(each)), rtol=0, atol=1e-6 * abs(step))
            for each, step in zip(along, steps, strict=True)
        ):
            return placed(np.column_stack([np.diag(steps), [each[0] for each in along]]), n)
        return Placement(None, [each.reshape([-1 if a == c else 1 for a in range(n)]) for c, each in enumerate(along)])
    points = np.asarray((data.cell_centers() if centred else data).points, np.float64)
    varies = [c for c in range(3) if np.ptp(points[:, c])]
    if len(varies) != n:
        raise InputError(f"is a surface in space of {' x '.join(map(str, shape))} samples", code="shape",
                         remedy="take it as a mesh: --values NAME")
    return Placement(None, [points[:, c].reshape(shape, order="F") for c in varies])


class OpenedVtk(Opened):
    """Values on a grid, in a file or an object of VTK; times are the first axis of a series."""

    def _open(self, choice: Choice) -> None:
        self._choice, self._last = choice, (-1, (np.zeros(0), Placement()))
        with reading("VTK data"):
            data = self._given
            self._steps = _steps(self._source, choice.key) if data is None else [lambda: blocks_of(data)]
            first = self._grid(0)[0]
        several = len(self._steps) > 1
        self.shape, self.dtype = (*[len(self._steps)] * several, *first.shape), first.dtype
        self._source.check_count(math.prod(self.shape))

    def _grid(self, number: int) -> _Grid:
        if self._last[0] != number:
            _, data, key = _chosen(self._steps[number](), self._choice.key)
            self._last = number, _grid_of(data, key, self._choice.average)
        return self._last[1]

    def _values(self, frame: int | None) -> Array:
        count = len(self._steps)
        if frame is not None:
            check_frame(frame, count if count > 1 else 0)
        with reading("VTK data"):
            if frame is not None or count == 1:
                return self._grid(frame or 0)[0]
            grids = [self._grid(number)[0] for number in range(count)]
            if any(grid.shape != grids[0].shape for grid in grids):
                raise InputError("its times have grids of different sizes", code="shape", remedy="choose one: --frame")
            return np.stack(grids)

    def _place(self, n: int, frame: int | None) -> Placement:
        with reading("VTK data"):
            values, place = self._grid(frame or 0)
        return place if n == values.ndim else Placement()


# ---- meshes ---------------------------------------------------------------------------------------------------------


def _mesh_in(source: InputFile, choice: Choice) -> MeshRead:
    """Read a mesh or points; several times as a series on one mesh."""
    with reading("VTK data"):
        steps = _steps(source, None)
        if choice.frame is not None:
            check_frame(choice.frame, len(steps) if len(steps) > 1 else 0)
            steps = [steps[choice.frame]]
        meshes = [mesh_of(step(), choice) for step in steps]
    first, *others = meshes
    cells: list[Any] = [each.cells for each in meshes]
    if not all(np.array_equal(each, cells[0]) for each in cells) or any(
        not np.array_equal(each.points, first.points) for each in others
    ):
        raise InputError("its mesh changes in time", code="mesh", remedy="choose a time: --frame N")
    if not others:
        return first
    names = [name for name in first.values if all(name in each.values for each in others)]
    return replace(first, values={name: np.stack([each.values[name] for each in meshes]) for name in names})


def mesh_of(blocks: Blocks, choice: Choice) -> MeshRead:
    """The triangles, tetrahedra or points of the block that is chosen, with the values at its points."""
    name, data, _ = _chosen(blocks, choice.key)
    if not hasattr(data, "n_cells"):
        raise InputError(f"holds {plain(type(data).__name__)}, not a mesh", code="mesh")
    of_cells = _scalars(_arrays(data.cell_data))
    data, remarks = _unstructured(data)
    if choice.average and of_cells:
        data = data.cell_data_to_point_data()
    cells, data, about_cells = _cells_of(data)
    points, values = np.asarray(data.points, np.float64), _scalars(_arrays(data.point_data))
    if cells is None:
        if np.ptp(points[:, 2]):
            values.setdefault(HEIGHT, points[:, 2])
        points = points[:, :2]
    prefix = f"{name}/" if len(blocks) > 1 and name else ""
    return MeshRead(
        points, cells, {prefix + each: array for each, array in values.items()},
        [prefix + each for each in of_cells if each not in values], remarks=remarks + about_cells,
    )


def _unstructured(data: Any) -> tuple[Any, list[str]]:
    """The cells of any data set without those that another piece holds, and remarks.

    Points that coincide, as those where pieces meet, are joined, unless all values differ there.
    """
    grid = data.cast_to_unstructured_grid()
    first, number = np.unique(grid.points, axis=0, return_index=True, return_inverse=True)[1:]
    arrays = _arrays(grid.point_data)
    apart = [name for name, each in arrays.items()
             if not np.array_equal(each[first][number.ravel()], each, each.dtype.kind == "f")]
    joined = len(first) < grid.n_points and (not arrays or len(apart) < len(arrays))
    if joined:
        grid = grid.clean(produce_merge_map=False, average_point_data=False)
        for name in apart:
            del grid.point_data[name]
    if _ghosts(grid.cell_data, _LEFT_OUT_CELL) is not None:
        grid.RemoveGhostCells()
    remark = f"values that differ where points coincide are left out: {', '.join(map(plain, apart))}"
    return grid, [remark] if joined and apart else []


def _cells_of(data: Any) -> tuple[Array | None, Any, list[str]]:
    """Triangles or tetrahedra of a data set, the data set whose points they join, and remarks; None of points alone."""
    types = data.celltypes
    kinds = {*types.tolist()}
    if not kinds - {0, 1, 2}:
        return None, data, []
    solid, odd = bool(kinds & _SOLID), kinds - _LOWER - _FLAT - _SOLID
    if odd or not kinds & (_FLAT | _SOLID):
        names = [_pyvista().CellType(each).name for each in sorted(odd)]
        raise InputError(
            f"holds cells of other kinds: {', '.join(names) or 'no triangles'}", code="mesh",
            remedy="cut them into triangles or tetrahedra first",
        )
    wanted, ours = (_TETRA, _SOLID) if solid else (_TRIANGLE, _FLAT)
    left = int(np.isin(types, [*ours], invert=True).sum())
    remarks = [f"{left:,} cells of lower dimension are left out"] if left else []
    if kinds & ours != {wanted}:
        remarks.append("cells of other kinds are cut into " + ("tetrahedra" if solid else "triangles"))
        if kinds & _HIGHER:
            remarks.append("values between the points of cells of higher order are taken as linear")
        data = data.triangulate()
    return np.asarray(data.cells_dict[wanted], np.int64), data, remarks


_VTK = ".vtk"
_GRIDS = (".vti", ".vtr", ".vts", ".pvti", ".pvtr", ".pvts")
_BOTH = (_VTK, ".vtm", ".pvd", ".xdmf", ".xmf")
FORMATS = (
    Format(
        "VTK", (*_GRIDS, *_BOTH), OpenedVtk, extra="vtk", keyed=True, averages=True, confined="pyvista",
        signatures=((0, b"<VTKFile", ".vti"), (0, b"<?xml", ".vti"), (0, b"# vtk DataFile", _VTK)),
    ),
)
MESHES = (
    MeshFormat(
        "VTK", (".vtu", ".vtp", ".pvtu", ".pvtp", *_BOTH, *_GRIDS), _mesh_in, extra="vtk", holds=_holds_mesh,
        options=("average", "frame"), confined="pyvista",
    ),
)
