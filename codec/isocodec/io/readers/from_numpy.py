"""NumPy reads arrays (.npy), archives of arrays and meshes (.npz), and tables of points.

Headers are read first, and held against what is allowed.
"""

from __future__ import annotations

import csv
import io
import zipfile
from contextlib import suppress
from functools import cached_property
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ...errors import InputError, OptionError, plain
from ...field.placement import CRS, PLACEMENT, Placement
from .mesh_formats import MeshFormat, MeshRead
from .opened import Choice, Format, Opened, Windows, numbers
from .place_of_samples import open_grid, placed, placed_grid
from .reading import check_frame, choose, pick_frame, reading
from .source import InputFile

Array = NDArray[Any]

_HEADER = 1 << 16
"""Bytes in which a header has to end; NumPy reads none of more than 10,000 characters."""
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Compressions that NumPy writes. Decoders of others take memory before they know how much comes out."""
_PAIRS = (("lon", "lat"), ("longitude", "latitude"), ("rlon", "rlat"), ("nav_lon", "nav_lat"), ("x", "y"))
"""Names of coordinates x and y in .npz files."""
_OF_PLACE = (PLACEMENT, CRS)
"""Names of arrays that place the others: a matrix with a row for each coordinate, and a text."""
_OF_MESHES = ("points", "cells")
"""Names of arrays that make an .npz file a mesh."""
_PLACED = "placed"
"""Name of the array of points in the world, beside those in samples."""
_ACROSS = ("x", "lon", "longitude", "easting")
_UP = ("y", "lat", "latitude", "northing")


class _NumpyFile(Opened):
    """An array of an .npy file, or of an .npz file."""

    def _open(self, choice: Choice) -> None:
        file = self.hold(self._source.path.open("rb"))
        magic = file.read(6)
        # numpy takes anything else for a pickle, and an error about that would lead the user astray
        if magic != b"\x93NUMPY" and magic[:4] not in (b"PK\x03\x04", b"PK\x05\x06"):
            raise InputError("is not a NumPy file", code="unreadable")
        file.seek(0)
        self._archive = None
        with reading("NumPy file"):
            if magic[:2] == b"PK":
                self._archive = _Archive(self._source, self.hold(zipfile.ZipFile(file)))
                self._key = self._archive.chosen(choice.key)
                self.shape, self.dtype, _ = self._archive.header(self._key)
            elif choice.key is not None:
                raise OptionError("a key names an array of an .npz file; this is a single array", code="key")
            else:
                self.shape, self.dtype, _ = _header(file.read(_HEADER))

    def _values(self, frame: int | None) -> Array:
        with reading("NumPy file"):
            if self._archive is not None:
                return pick_frame(self._archive.array(self._key), frame)
            with self._source.path.open("rb") as file:
                return pick_frame(_array(self._source, file, self._source.path.stat().st_size), frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        with reading("NumPy file"):
            return Placement() if self._archive is None else self._archive.place(self.shape[-n:])

    def _windows(self) -> Any:
        if self._archive is not None:
            return super()._windows()
        with reading(".npy"):
            return MappedWindows(self._source.path)


class MappedWindows(Windows):
    """The array of an ``.npy`` file."""

    @cached_property
    def _file(self) -> Any:
        return np.load(self._path, mmap_mode="r", allow_pickle=False)

    def __getitem__(self, window: tuple[slice, ...]) -> Array:
        found: Array = self._file[window]
        return found


def _array(source: InputFile, file: IO[bytes], there: int) -> Array:
    """The array in an open file, of so many bytes."""
    shape, dtype, begin = _header(file.read(_HEADER))
    source.check_bytes(begin + source.check_array(shape, dtype), there)
    file.seek(0)
    return np.asarray(npy.read_array(file, allow_pickle=False))


def _header(begin: bytes) -> tuple[tuple[int, ...], np.dtype[Any], int]:
    """Shape and type of an array out of the first bytes of its file, and where its samples begin."""
    file = io.BytesIO(begin)
    # the third version is the second one in UTF-8, which changes names of fields only
    read = npy.read_array_header_1_0 if npy.read_magic(file) == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(file)
    return shape, dtype, file.tell()


class _Archive:
    """The arrays of an .npz file, by name."""

    def __init__(self, source: InputFile, archive: zipfile.ZipFile) -> None:
        self._source, self._archive = source, archive
        self.members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}

    def _opened(self, name: str) -> IO[bytes]:
        info = self.members[name]
        if info.compress_type not in _PACKED:
            raise InputError("is packed in a way that NumPy does not write", code="unreadable", remedy="use np.savez")
        self._source.check_packed(info.file_size, info.compress_size)
        return self._archive.open(info)

    def header(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any], int]:
        with self._opened(name) as file:
            return _header(file.read(_HEADER))

    def array(self, name: str) -> Array:
        with self._opened(name) as file:
            return _array(self._source, file, self.members[name].file_size)

    def chosen(self, key: str | None) -> str:
        """The array that a key names, or the only one, or the one of the usual name."""
        if not self.members:
            raise InputError("holds no arrays", code="key")
        shapes = {name: self._shape(name) for name in self.members if key is not None or name not in _OF_PLACE}
        key = choose(shapes, key and key.removesuffix(".npy"), axes=0)
        if not self.members[key].filename.endswith(".npy"):
            raise InputError(f"'{plain(key)}' is not an array", code="key")
        return key

    def _shape(self, name: str) -> tuple[int, ...] | str:
        with suppress(Exception):  # an unreadable neighbour must not hide the names of the others
            shape, dtype, _ = self.header(name)
            return shape if dtype.kind != "O" else "unreadable"
        return "unreadable"

    def text(self, name: str) -> str | None:
        with self._opened(name) as file:
            text = npy.read_array(io.BytesIO(file.read(_HEADER)), allow_pickle=False)
        return str(text) or None if text.dtype.kind == "U" and text.ndim == 0 else None

    def place(self, shape: tuple[int, ...]) -> Placement:
        """Placement by a matrix with a text ``crs``, or of a field of two axes by coordinates of the usual names."""
        if PLACEMENT in self.members:
            return placed(self.array(PLACEMENT), len(shape), self.text(CRS) if CRS in self.members else None)
        remark = ""
        for pair in _PAIRS if len(shape) == 2 else ():
            if self.members.keys() >= set(pair):
                x, y = (np.asarray(numbers(self.array(name)), np.float64) for name in pair)
                if x.shape == y.shape == shape:
                    return placed_grid([x, y], shape, pair[0] != "x")
                if x.ndim == y.ndim == 1 and (len(y), len(x)) == shape:
                    return placed_grid(open_grid([y, x]), shape, pair[0] != "x")
                remark = (f"its {pair[0]} {x.shape} and {pair[1]} {y.shape} are left out: they do not fit samples of "
                          f"shape {shape}, whose first axis is {pair[1]}")
        return Placement(remark=remark)


def _holds_mesh(source: InputFile, key: str | None) -> bool:
    """Whether an archive has points and cells."""
    try:
        with zipfile.ZipFile(source.path) as archive:
            return {f"{name}.npy" for name in _OF_MESHES} <= set(archive.namelist())
    except (OSError, zipfile.BadZipFile):
        return False


def _mesh(source: InputFile, choice: Choice) -> MeshRead:
    with reading("NumPy file"), zipfile.ZipFile(source.path) as archive:
        held = _Archive(source, archive)
        arrays = {name: held.array(name) for name in held.members if name not in _OF_PLACE}
        if not set(_OF_MESHES) <= set(arrays):
            raise InputError("holds no arrays points and cells", code="mesh")
        points, cells = np.asarray(arrays["points"], np.float64), np.asarray(arrays["cells"]).astype(np.int64)
        if points.ndim != 2 or cells.ndim != 2 or cells.shape[1] not in (3, 4):
            raise InputError("holds points or cells of another shape", code="mesh")
        crs = held.text(CRS) if CRS in held.members else None
        place = placed(held.array(PLACEMENT), points.shape[1], crs) if PLACEMENT in held.members else Placement(crs=crs)
        others = {name: each for name, each in arrays.items() if name not in (*_OF_MESHES, _PLACED)}
        where = arrays.get(_PLACED)
    values = {name: each for name, each in others.items() if each.shape[-1:] == (len(points),)}
    if choice.frame is not None:
        count = max((len(each) for each in values.values() if each.ndim == 2), default=0)
        check_frame(choice.frame, count)
        values = {name: each[choice.frame] for name, each in values.items() if each.ndim == 2}
    if where is not None and where.ndim == 2 and len(where) == len(points):
        points = np.asarray(where, np.float64)
    elif place.matrix is not None:
        points = place.place(points)
    remarks = [place.remark] if place.remark else []
    return MeshRead(points, cells, values, crs=place.crs, remarks=remarks)


def _table(source: InputFile, _: Choice) -> MeshRead:
    with reading("table of points"):
        with source.path.open(newline="", encoding="utf-8-sig") as file:
            start = file.read(1 << 16)
        if not start.strip():
            raise InputError("holds nothing", code="points")
        first = start.splitlines()[0]
        divider = next((each for each in ",;\t" if each in first), " ")
        names = next(csv.reader([first], delimiter=divider, skipinitialspace=True), [])
        names = [name.strip() for name in names if name.strip()]
        try:
            named = np.array(names, np.float64).ndim == 0
            names = [*"xyz", *(f"column {i}" for i in range(4, len(names) + 1))][: len(names)]
        except ValueError:
            named = True
        rows = np.loadtxt(
            source.path, delimiter=None if divider == " " else divider, skiprows=int(named), ndmin=2,
            encoding="utf-8-sig", converters=None if divider == " " else _number,
        )
    if rows.shape[1] != len(names) or len(names) < 3:
        raise InputError(
            f"the table has {rows.shape[1]} columns, and {len(names)} are named", code="shape",
            remedy="give x, y and values, named in the first line or not at all",
        )
    low = [name.lower() for name in names]
    across, up = (next((low.index(each) for each in wanted if each in low), None) for wanted in (_ACROSS, _UP))
    if across is None or up is None:
        across, up = 0, 1
    values = {name: rows[:, i] for i, name in enumerate(names) if i not in (across, up)}
    return MeshRead(np.ascontiguousarray(rows[:, [across, up]]), None, values)


def _number(text: str) -> float:
    """A number of a table; NaN where nothing is between two dividers."""
    return float(text.strip() or "nan")


FORMATS = (
    Format("NumPy array", (".npy",), _NumpyFile, signatures=((0, b"\x93NUMPY", ".npy"),), keyed=True),
    Format("NumPy archive", (".npz",), _NumpyFile, signatures=((0, b"PK\x03\x04", ".npz"),), keyed=True),
)
MESHES = (
    MeshFormat("NumPy archive", (".npz",), _mesh, holds=_holds_mesh, options=("frame",)),
    MeshFormat("table", (".csv", ".xyz"), _table, scattered=True),
)
