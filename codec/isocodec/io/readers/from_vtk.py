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
from dataclasses import dataclass, replace
from functools import partial
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, one_line, plain
from ...extras import optional
from ...field.placement import Placement
from .mesh_formats import HEIGHT, MeshFormat, MeshRead
from .opened import IN_MEMORY, Choice, Format, Opened
from .place_of_samples import placed
from .reading import check_frame, reading
from .source import InputFile

Array = NDArray[Any]
Blocks = dict[str, Callable[[], Any]]
"""Data sets by name; that of a file that is not a collection has none."""

_LIBRARY = "vtkmodules.vtkIOXML"
_HEAD = 1 << 16
_ROOT = re.compile(rb"<VTKFile\b[^>]*\btype\s*=\s*[\"'](\w+)")
_LEGACY = re.compile(rb"\s*# vtk DataFile")
_OF_LEGACY = re.compile(rb"^\s*DATASET\s+(\w+)", re.MULTILINE | re.IGNORECASE)
_SIZES = re.compile(rb"NumberOf(?:Points|Cells|Polys)\s*=\s*[\"'](\d+)|^\s*(?:POINTS|\w+_DATA)\s+(\d+)", re.M)
_EXTENTS = re.compile(rb"WholeExtent\s*=\s*[\"']([-\d\s]+)[\"']|^\s*DIMENSIONS\s+([\d\s]+)", re.MULTILINE)
_GRID_OF_XDMF = re.compile(rb"Type\s*=\s*[\"']\dD\w*Mesh", re.IGNORECASE)
_PACKED = 8256
"""Samples that a byte of a packed file holds at most: of one bit, deflated."""
_COLLECTION = "Collection"
_MESHES = ("UnstructuredGrid", "PUnstructuredGrid", "PolyData", "PPolyData")
_USUAL = re.compile(rb'<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" *(\[ *\])? *>|encoding=["\'](?i:utf-8|us-ascii)["\']')
_DECLARED = re.compile(rb"<!DOCTYPE|<!ENTITY|<\?xml[^>]*encoding")
_TOPOLOGY = re.compile(r"[23]d\w*mesh|(poly|tri|quad|tet|hex|wedge|pyramid)\w*|edge_3|mixed")
_XDMF, _PLAIN = "Xdmf", "legacy"
_DEEPEST = 8
"""Collections within collections."""
_OWN, _GHOSTS = "vtk", "vtkGhostType"
"""Beginning of names that VTK keeps for itself: numbers of points and cells before filters; ghosts."""
_HIDDEN_POINT, _LEFT_OUT_CELL = 2, 1 | 32
"""Bits of ghosts: points that are blanked; cells that another piece holds, or that are blanked."""
_COMPONENTS = ("x", "y", "z")
_TRIANGLE, _TETRA = 5, 10
_LOWER = (0, 1, 2, 3, 4, 21, 35)
"""Types of cells that are points and lines; meshes hold them beside, often as boundaries."""
_SOLID = (10, 11, 12, 13, 14, 15, 16, 24, 25, 26, 27, 29, 32, 33)
_FLAT = (5, 6, 7, 8, 9, 22, 23, 28, 30, 34)
_HIGHER = (22, 23, 24, 25, 26, 27, 28, 29, 30, 32, 33, 34)
"""Types of cells in space, in a plane, and those of them with points between their corners."""


def _vtk(module: str) -> Any:
    return optional(f"vtkmodules.{module}", extra="vtk", purpose="reading files and objects of VTK")


# ---- files ----------------------------------------------------------------------------------------------------------


def _kind_of(source: InputFile) -> str:
    """Type of the data in a file, by its first bytes, as its root names it."""
    with source.path.open("rb") as file:
        head = file.read(_HEAD)
    root = _ROOT.search(head)
    if root is not None:
        return root[1].decode()
    if _LEGACY.match(head):
        found = _OF_LEGACY.search(head)
        return _PLAIN if found is None else {b"UNSTRUCTURED_GRID": _MESHES[0], b"POLYDATA": _MESHES[2]}.get(
            found[1].upper(), _PLAIN
        )
    if b"<Xdmf" in head:
        return _XDMF
    raise InputError("is not a file of VTK or XDMF", code="unreadable")


def _holds_mesh(source: InputFile, key: str | None, depth: int = 0) -> bool:
    """Whether a file holds a mesh: of a collection the block that is chosen, else the first one."""
    try:
        kind = _kind_of(source)
        if kind == _XDMF:
            with source.path.open("rb") as file:
                return not _GRID_OF_XDMF.search(file.read(_HEAD))
        if not _is_collection(kind) or depth > _DEEPEST:
            return kind in _MESHES
        parts = [*_parts(source).items()]
        name, files = next((part for part in parts if _inner_key(key, part[0]) is not None), parts[0])
        return _holds_mesh(_other(source, files[0]), _inner_key(key, name), depth + 1)
    except (InputError, OSError, IndexError):
        return False


def _is_collection(kind: str) -> bool:
    return kind == _COLLECTION or kind.startswith("vtk")


def _elements(source: InputFile) -> Iterator[ElementTree.Element]:
    with reading("XML"):
        text = source.path.read_bytes()
        # other encodings could hide declarations, which name files
        if _DECLARED.search(_USUAL.sub(b"", text[:_HEAD]) + text[_HEAD:]) or b"\0" in text:
            raise InputError("declares entities or an encoding, which no such file needs", code="unreadable")
        return ElementTree.fromstring(text).iter()


def _parts(source: InputFile, timestep: str | None = None) -> dict[str, list[str]]:
    """Files of a collection by the name of the block; of one in time those of a time."""
    out: dict[str, list[str]] = {}

    def walk(element: ElementTree.Element, path: tuple[str, ...]) -> None:
        for number, each in enumerate(element):
            if timestep is not None and each.get("timestep", "0") != timestep:
                continue
            part = f"block {number}" if timestep is None else str(each.get("part", "0"))
            inner = (*path, str(each.get("name") or part))
            if each.tag in ("DataSet", "Piece") and each.get("file"):
                out.setdefault("/".join(inner), []).append(str(each.get("file")))
            walk(each, inner)

    root = next(element for element in _elements(source) if element.tag == "VTKFile")
    for child in root:
        walk(child, ())
    return out


def _times(source: InputFile) -> list[str]:
    found = {element.get("timestep", "0") for element in _elements(source) if element.tag == "DataSet"}
    return sorted(found, key=float)


def _other(source: InputFile, name: str) -> InputFile:
    """A file that this one names, if it may be read."""
    return InputFile(source.beside(name), source.samples, source.follow)


def _steps(source: InputFile, key: str | None) -> list[Callable[[], Blocks]]:
    """Loaders of the blocks of each time; of most files there is one."""
    kind = _kind_of(source)
    if kind == _COLLECTION:
        return [partial(_blocks_of_time, source, time, key) for time in _times(source)]
    if kind == _XDMF:
        return _steps_of_xdmf(source)
    return [partial(_blocks, source, key)]


def _blocks_of_time(source: InputFile, time: str, key: str | None) -> Blocks:
    parts = _parts(source, time)
    if len(parts) == 1 and len(*parts.values()) == 1:
        return _blocks(_other(source, next(iter(parts.values()))[0]), key)
    return {
        f"{name}{inner and '/'}{inner}": load for name, files in parts.items() for each in files
        for inner, load in _blocks(_other(source, each), key).items()
    }


def _blocks(source: InputFile, key: str | None, depth: int = 0) -> Blocks:
    """The data sets of a file; those of a collection are read when they are asked for."""
    if depth > _DEEPEST:
        raise InputError(f"collections of more than {_DEEPEST} levels", code="unreadable")
    kind = _kind_of(source)
    if not _is_collection(kind):
        return {"": partial(_dataset, source, kind, key)}
    out: Blocks = {}
    for name, files in _parts(source).items():
        for number, each in enumerate(files):
            named = name if len(files) == 1 else f"{name}/{number}"
            for inner, load in _blocks(_other(source, each), _inner_key(key, named), depth + 1).items():
                out[f"{named}{inner and '/'}{inner}"] = load
    return out


def _inner_key(key: str | None, block: str) -> str | None:
    """Cut the name of a block off a key; None if it does not begin with that."""
    return key[len(block) + 1 :] if key is not None and key.startswith(f"{block}/") else None


def _dataset(source: InputFile, kind: str, key: str | None) -> Any:
    """Read a file with one data set; of XML only the arrays that a key can mean."""
    _check_sizes(source)
    with _complaints():
        if kind in (_PLAIN, *_MESHES) and source.named(_VTK):
            reader = _vtk("vtkIOLegacy").vtkDataSetReader()
            for switch in ("ReadAllScalarsOn", "ReadAllVectorsOn", "ReadAllFieldsOn", "ReadAllTensorsOn",
                           "ReadAllNormalsOn", "ReadAllTCoordsOn", "ReadAllColorScalarsOn"):
                getattr(reader, switch)()
            reader.SetFileName(str(source.path))
        else:
            maker = getattr(_vtk("vtkIOXML"), f"vtkXML{kind}Reader", None)
            if maker is None:
                raise InputError(f"holds {plain(kind)}, not a grid or a mesh", code="unreadable")
            pieces = [] if kind == "PolyData" or kind[0] != "P" else [
                _other(source, str(element.get("Source"))) for element in _elements(source) if element.get("Source")
            ]
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
    if kind == "PImageData" and pieces:
        # which the file of the whole does not state
        found.SetDirectionMatrix(_dataset(pieces[0], "ImageData", None).GetDirectionMatrix())
    if reader.GetErrorCode() or found is None or not found.GetNumberOfPoints():
        raise InputError("cannot be read as a file of VTK (damaged, or without points)", code="unreadable")
    return found


def _check_sizes(source: InputFile) -> None:
    """Hold the counts in the beginning of a file against what may be read, and what it can hold."""
    with source.path.open("rb") as file:
        head = file.read(_HEAD)
    counts = [int(one or other) for one, other in _SIZES.findall(head)]
    for extent, dimensions in _EXTENTS.findall(head):
        numbers = [int(number) for number in (extent or dimensions).split()]
        if extent:
            numbers = [max(0, high - low + 1) for low, high in zip(numbers[::2], numbers[1::2], strict=False)]
        counts.append(math.prod(numbers[:3]))
    parallel = b'type="P' in head and b'type="Poly' not in head
    for count in counts:
        source.check_count(count)
        if not parallel:
            source.check_bytes(count // (8 if _LEGACY.match(head) else _PACKED))


@contextmanager
def _complaints() -> Iterator[None]:
    """Make an error of what VTK complains about while it goes on."""
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
            found = reader.GetOutputDataObject(0)
            data = found.NewInstance()
            data.DeepCopy(found)
        blocks = blocks_of(data)
        # the mesh of a series is often a grid beside it
        in_time = {name: load for name, load in blocks.items() if name in series}
        return in_time if time is not None and in_time else blocks

    return [partial(at, time) for time in times]


def _check_xdmf(source: InputFile) -> set[str]:
    """Check the files that XDMF names for its samples; returns the names of its series."""
    series = set()
    for element in _elements(source):
        attributes = {name.rpartition("}")[2].lower(): value for name, value in element.attrib.items()}
        if element.tag.rpartition("}")[2] == "include" and attributes.get("href"):
            source.beside(attributes["href"])
        if attributes.get("collectiontype", "").lower() == "temporal":
            series.add(attributes.get("name", ""))
        form = attributes.get("format", "xml").lower()
        if form != "xml" and "format" in attributes:
            name, _, inner = (element.text or "").strip().partition(":")
            if form not in ("hdf", "binary") or attributes.get("heavydatasetname"):
                raise InputError(f"keeps samples as {plain(form)}", code="unreadable", remedy="use XML, HDF or Binary")
            target = source.beside(name)
            if form == "hdf" and not source.follow:
                _check_hdf(source, target, inner)
        topology = attributes.get("topologytype", attributes.get("type", "")).strip().lower()
        if element.tag.rpartition("}")[2] == "Topology" and not _TOPOLOGY.fullmatch(topology):
            # the library crashes on it
            raise InputError(f"has cells of the unknown type '{plain(topology)}'", code="mesh")
        count = attributes.get("dimensions", attributes.get("numberofelements", "")).split()
        if count and all(part.isdigit() for part in count):
            source.check_count(math.prod(map(int, count)))
    return series


def _check_hdf(source: InputFile, path: Any, inner: str) -> None:
    """Check that a data set of HDF5 does not lie in yet another file."""
    h5py = optional("h5py", extra="hdf5", purpose="reading XDMF with HDF5")
    with reading("HDF5"), h5py.File(path, "r") as file:
        group = file
        for name in filter(None, inner.split("/")):
            link = group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                raise source.refused(str(link.filename), "by a link")
            group = group[name]
        if getattr(group, "external", None) or getattr(group, "is_virtual", False):
            raise source.refused(inner, "which keeps its samples in other files")
        if isinstance(group, h5py.Dataset):
            source.check_array(group.shape, group.dtype)


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
            out[f"{name or f'block {number}'}{inner and '/'}{inner}"] = load
    return out


def holds_grid(data: Any, key: str | None) -> bool:
    """Whether what a key names of an object of VTK is a grid, and not a mesh or a surface in space."""
    chosen = _chosen(blocks_of(data), key)[1]
    if not hasattr(chosen, "GetDimensions"):
        return not hasattr(chosen, "GetNumberOfCells")
    flat = sum(side == 1 for side in _sides(chosen)) == 1
    return not (flat and chosen.IsA("vtkStructuredGrid") and np.diff(np.reshape(chosen.GetBounds(), (3, 2))).all())


def _chosen(blocks: Blocks, key: str | None) -> tuple[str, Any, str | None]:
    """The block that a key names, or the only one: its name, its data, and the rest of the key."""
    matching = [name for name in blocks if name == key or _inner_key(key, name) is not None]
    if matching:
        name = max(matching, key=len)
        return name, blocks[name](), _inner_key(key, name)
    if len(blocks) != 1:
        raise InputError(
            f"holds the blocks {_listed(blocks) or '(no one)'}", code="key",
            remedy="choose one with --key BLOCK/ARRAY, or --values BLOCK/ARRAY of a mesh",
        )
    ((name, load),) = blocks.items()
    return name, load(), key


def _listed(names: Sequence[str] | Mapping[str, Any]) -> str:
    return ", ".join(plain(name) for name in [*names][:20]) + (", .." if len(names) > 20 else "")


def _arrays(attributes: Any) -> dict[str, Array]:
    """Arrays of points or cells by name, (N,) or (N, C)."""
    support = _vtk("util.numpy_support")
    out: dict[str, Array] = {}
    for number in range(attributes.GetNumberOfArrays()):
        array = attributes.GetArray(number)
        name = None if array is None else array.GetName() or f"array {number}"
        if name is not None and not name.startswith(_OWN):
            out[name] = support.vtk_to_numpy(array)
    return out


def _scalars(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """One number each: components and magnitudes of vectors under names of their own."""
    out: dict[str, Array] = {}
    for name, array in arrays.items():
        if array.ndim == 1 or array.shape[1] == 1:
            out[name] = array.reshape(-1)
            continue
        names = _COMPONENTS if array.shape[1] <= len(_COMPONENTS) else [str(i) for i in range(array.shape[1])]
        out |= {f"{name}:{part}": array[:, i] for i, part in zip(range(array.shape[1]), names, strict=False)}
        with np.errstate(over="ignore"):
            out[f"{name}:magnitude"] = np.sqrt((array.astype(np.float64) ** 2).sum(axis=1))
    return out


def _numbered(key: str) -> str:
    """A key with the letter of a component instead of its number."""
    name, colon, part = key.rpartition(":")
    return f"{name}:{_COMPONENTS[int(part)]}" if colon and part in ("0", "1", "2") else key


def _averaged(data: Any) -> Any:
    """Average values of cells at points: each the mean of the cells around it."""
    mean = _vtk("vtkFiltersCore").vtkCellDataToPointData()
    mean.SetInputData(data)
    mean.Update()
    return mean.GetOutput()


def _ghosts(attributes: Any, bits: int) -> Array | None:
    """Find the points or cells that have one of these bits; None without any."""
    array = attributes.GetArray(_GHOSTS)
    found = None if array is None else (_vtk("util.numpy_support").vtk_to_numpy(array) & bits) != 0
    return found if found is not None and found.any() else None


# ---- grids ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Grid:
    values: Array
    place: Placement


def _grid_of(data: Any, key: str | None, average: bool) -> _Grid:
    """Values at points, or of cells at their centres, with axes i, j, k; axes of one sample are left out."""
    if not hasattr(data, "GetDimensions"):
        kind = "a mesh" if hasattr(data, "GetNumberOfCells") else plain(data.GetClassName())
        raise InputError(f"holds {kind}, not a grid", code="field", remedy="name its values: --values NAME")
    at_points = _scalars(_arrays(data.GetPointData()))
    of_cells = {name: each for name, each in _scalars(_arrays(data.GetCellData())).items() if name not in at_points}
    values = at_points | of_cells
    if key is not None and key not in values and _numbered(key) in values:
        key = _numbered(key)
    if key is None and len(at_points or of_cells) == 1:
        key = next(iter(values))
    if key is None or key not in values:
        what = f"holds no array '{plain(key)}', but: " if key is not None else "holds "
        raise InputError(
            what + (_listed(values) or "no values at its points or of its cells"), code="key",
            remedy="choose one with --key" if values and key is None else None,
        )
    centred = key in of_cells
    if centred and average:
        data, centred = _averaged(data), False
        values = _scalars(_arrays(data.GetPointData()))
    sides = tuple(max(1, count - centred) for count in _sides(data))
    kept = [axis for axis in range(3) if sides[axis] > 1]
    if len(kept) not in (2, 3):
        raise InputError(f"has a grid of {' x '.join(map(str, sides))} samples", code="shape")
    found = np.ascontiguousarray(_in_axes(values[key], sides, kept))
    hidden = _ghosts(data.GetCellData(), _LEFT_OUT_CELL) if centred else _ghosts(data.GetPointData(), _HIDDEN_POINT)
    if hidden is not None:
        found = np.where(_in_axes(hidden, sides, kept), np.nan, found)
    return _Grid(found, _place_of(data, sides, kept, centred))


def _sides(data: Any) -> list[int]:
    """Points of a grid along each axis."""
    sides = [0, 0, 0]
    data.GetDimensions(sides)
    return sides


def _in_axes(array: Array, sides: Sequence[int], kept: Sequence[int]) -> Array:
    """Values as VTK has them, x fastest, with an axis for each side of more than one sample, (.., C) if of vectors."""
    shape = [sides[axis] for axis in reversed(kept)]
    n = len(shape)
    return array.reshape(*shape, *array.shape[1:]).transpose(*reversed(range(n)), *range(n, n + array.ndim - 1))


def _place_of(data: Any, sides: Sequence[int], kept: list[int], centred: bool) -> Placement:
    """Placement of the samples of a grid."""
    n = len(kept)
    if data.IsA("vtkImageData"):
        turned = data.GetDirectionMatrix()
        directions = np.array([[turned.GetElement(i, j) for j in range(3)] for i in range(3)]) * data.GetSpacing()
        first = np.array(data.GetExtent()[::2], float) + np.array([centred * 0.5 * (axis in kept) for axis in range(3)])
        matrix = np.column_stack([directions, np.array(data.GetOrigin()) + directions @ first])
        # a picture lies in the plane, other slices in space
        rows = kept if n == 3 or (kept == [0, 1] and not matrix[2, [0, 1, 3]].any()) else slice(None)
        return placed(matrix[rows][:, [*kept, 3]], n)
    support = _vtk("util.numpy_support")
    if data.IsA("vtkRectilinearGrid"):
        axes = [data.GetXCoordinates(), data.GetYCoordinates(), data.GetZCoordinates()]
        along = [np.array(support.vtk_to_numpy(axes[axis]), np.float64) for axis in kept]
        along = [(each[1:] + each[:-1]) / 2 if centred else each for each in along]
        steps = [(each[-1] - each[0]) / (len(each) - 1) for each in along]
        if all(
            np.allclose(each, each[0] + step * np.arange(len(each)), rtol=0, atol=1e-6 * abs(step))
            for each, step in zip(along, steps, strict=True)
        ):
            return placed(np.column_stack([np.diag(steps), [each[0] for each in along]]), n)
        return Placement(None, [each.reshape([-1 if a == c else 1 for a in range(n)]) for c, each in enumerate(along)])
    points = _in_axes(_points_of(data), [side + centred * (axis in kept) for axis, side in enumerate(sides)], kept)
    for axis in range(n if centred else 0):
        ends = [np.take(points, np.arange(k, points.shape[axis] - 1 + k), axis=axis) for k in (0, 1)]
        points = (ends[0] + ends[1]) / 2
    varies = [c for c in range(3) if np.ptp(points[..., c])]
    if len(varies) != n:
        raise InputError(
            f"is a surface in space of {' x '.join(map(str, points.shape[:-1]))} samples", code="shape",
            remedy="take it as a mesh: --values NAME",
        )
    return Placement(None, [points[..., c] for c in varies])


class OpenedVtk(Opened):
    """Values on a grid, in a file or an object of VTK; times are the first axis of a series."""

    def __init__(self, source: Any, choice: Choice) -> None:
        self._data = None if isinstance(source, InputFile) else source
        super().__init__(source if self._data is None else IN_MEMORY, choice)

    def _open(self, choice: Choice) -> None:
        self._choice, self._last = choice, (-1, _Grid(np.zeros(0), Placement()))
        with reading("VTK data"):
            data = self._data
            self._steps = _steps(self._source, choice.key) if data is None else [lambda: blocks_of(data)]
            first = self._grid(0)
        several = len(self._steps) > 1
        self.shape = (len(self._steps), *first.values.shape) if several else first.values.shape
        self.dtype = first.values.dtype
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
                return self._grid(frame or 0).values
            grids = [self._grid(number).values for number in range(count)]
            if any(grid.shape != grids[0].shape for grid in grids):
                raise InputError("its times have grids of different sizes", code="shape", remedy="choose one: --frame")
            return np.stack(grids)

    def _place(self, n: int, frame: int | None) -> Placement:
        with reading("VTK data"):
            grid = self._grid(frame or 0)
        return grid.place if n == grid.values.ndim else Placement()


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
    if not all(np.array_equal(each.points, first.points) and _alike(each.cells, first.cells) for each in others):
        raise InputError("its mesh changes in time", code="mesh", remedy="choose a time: --frame N")
    if not others:
        return first
    names = set(first.values).intersection(*(each.values for each in others))
    values = {name: np.stack([each.values[name] for each in meshes]) for name in first.values if name in names}
    return replace(first, values=values)


def _alike(cells: Array | None, others: Array | None) -> bool:
    return (cells is others is None) or (cells is not None and others is not None and np.array_equal(cells, others))


def mesh_of(blocks: Blocks, choice: Choice) -> MeshRead:
    """The triangles, tetrahedra or points of the block that is chosen, with the values at its points."""
    name, data, _ = _chosen(blocks, choice.key)
    if not hasattr(data, "GetNumberOfCells"):
        raise InputError(f"holds {plain(data.GetClassName())}, not a mesh", code="mesh")
    of_cells = _scalars(_arrays(data.GetCellData()))
    data, remarks = _unstructured(data)
    if choice.average and of_cells:
        data = _averaged(data)
    cells, data, about_cells = _cells_of(data)
    points, values = _points_of(data), _scalars(_arrays(data.GetPointData()))
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
    first, number = np.unique(_points_of(data), axis=0, return_index=True, return_inverse=True)[1:]
    arrays = _arrays(data.GetPointData())
    apart = [name for name, each in arrays.items()
             if not np.array_equal(each[first][number.ravel()], each, each.dtype.kind == "f")]
    joined = len(first) < len(number.ravel()) and (not arrays or len(apart) < len(arrays))
    filters = _vtk("vtkFiltersCore")
    step = filters.vtkAppendFilter()
    step.AddInputData(data)
    if joined:
        whole, step = step, filters.vtkStaticCleanUnstructuredGrid()
        step.SetInputConnection(whole.GetOutputPort())
        step.ToleranceIsAbsoluteOn()
        step.SetAbsoluteTolerance(0.0)
    step.Update()
    found = step.GetOutput()
    for name in apart if joined else ():
        found.GetPointData().RemoveArray(name)
    if _ghosts(found.GetCellData(), _LEFT_OUT_CELL) is not None:
        found.RemoveGhostCells()
    remark = f"values that differ where points coincide are left out: {_listed(apart)}"
    return found, [remark] if joined and apart else []


def _points_of(data: Any) -> Array:
    """Coordinates of points, (V, 3) float64."""
    if not hasattr(data, "GetPoints") or data.GetPoints() is None:
        return np.array([data.GetPoint(i) for i in range(data.GetNumberOfPoints())]).reshape(-1, 3)
    return np.asarray(_vtk("util.numpy_support").vtk_to_numpy(data.GetPoints().GetData()), np.float64)


def _cells_of(data: Any) -> tuple[Array | None, Any, list[str]]:
    """Triangles or tetrahedra of a data set, the data set whose points they join, and remarks; None of points alone."""
    types = _types_of(data)
    kinds = set(np.unique(types).tolist())
    if not kinds - {0, 1, 2}:
        return None, data, []
    wanted, corners = (_TETRA, 4) if kinds & {*_SOLID} else (_TRIANGLE, 3)
    odd = kinds - {*_LOWER, *_FLAT, *_SOLID}
    if odd or not kinds & {*_FLAT, *_SOLID}:
        factory = _vtk("vtkCommonDataModel").vtkCellTypes
        names = [factory.GetClassNameFromTypeId(each).removeprefix("vtk") for each in sorted(odd)]
        raise InputError(
            f"holds cells of other kinds: {', '.join(names) or 'no triangles'}", code="mesh",
            remedy="cut them into triangles or tetrahedra first",
        )
    left = sum(int((types == each).sum()) for each in kinds - {*_SOLID} - ({*_FLAT} if corners == 3 else set()))
    remarks = [f"{left:,} cells of lower dimension are left out"] if left else []
    if kinds - {wanted, *_LOWER} - ({*_FLAT} if corners == 4 else set()):
        remarks.append("cells of other kinds are cut into " + ("triangles" if corners == 3 else "tetrahedra"))
        if kinds & {*_HIGHER}:
            remarks.append("values between the points of cells of higher order are taken as linear")
        cut = _vtk("vtkFiltersGeneral").vtkDataSetTriangleFilter()
        cut.SetInputData(data)
        cut.Update()
        data = cut.GetOutput()
        types = _types_of(data)
    support = _vtk("util.numpy_support")
    start = support.vtk_to_numpy(data.GetCells().GetOffsetsArray())[:-1][types == wanted]
    members = support.vtk_to_numpy(data.GetCells().GetConnectivityArray())
    return members[start[:, None] + np.arange(corners)].astype(np.int64), data, remarks


def _types_of(data: Any) -> Array:
    """The type of each cell."""
    count = data.GetNumberOfCells()
    return np.asarray(_vtk("util.numpy_support").vtk_to_numpy(data.GetCellTypes())) if count else np.zeros(0, np.uint8)


_VTK = ".vtk"
_GRIDS = (".vti", ".vtr", ".vts", ".pvti", ".pvtr", ".pvts")
_BOTH = (_VTK, ".vtm", ".pvd", ".xdmf", ".xmf")
FORMATS = (
    Format(
        "VTK", (*_GRIDS, *_BOTH), OpenedVtk, extra="vtk", keyed=True, averages=True, confined=_LIBRARY,
        signatures=((0, b"<VTKFile", ".vti"), (0, b"<?xml", ".vti"), (0, b"# vtk DataFile", _VTK)),
    ),
)
MESHES = (
    MeshFormat(
        "VTK", (".vtu", ".vtp", ".pvtu", ".pvtp", *_BOTH, *_GRIDS), _mesh_in, extra="vtk", holds=_holds_mesh,
        options=("average", "frame"), confined=_LIBRARY,
    ),
)
