"""NumPy reads arrays (.npy), archives of arrays and meshes (.npz), and tables of points.

Headers are read first, and held against what is allowed.
"""

from __future__ import annotations

import csv
import io
import zipfile
from functools import cached_property
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ...errors import InputError, OptionError, plain
from ...field.placement import CRS, PLACEMENT, Placement
from .mesh_formats import MeshFormat, MeshRead
from .opened import DEFAULT_KEY, Choice, Format, Opened, numbers
from .place_of_samples import open_grid, placed, placed_grid
from .reading import check_frame, pick_frame, reading
from .source import InputFile
from .windows import Windows

Array = NDArray[Any]

_HEADER = 1 << 16
"""Bytes in which a header has to end; NumPy reads none of more than 10,000 characters."""
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Compressions that NumPy writes. Decoders of others take memory before they know how much comes out."""
_LISTED = 20
_PAIRS = (("lon", "lat"), ("longitude", "latitude"), ("rlon", "rlat"), ("nav_lon", "nav_lat"), ("x", "y"))
"""Names of coordinates x and y in .npz files."""
_OF_PLACE = (PLACEMENT, CRS)
"""Names of arrays that place the others: a matrix with a row for each coordinate, and a text."""
_OF_MESHES = ("points", "cells")
"""Names of arrays that make an .npz file a mesh."""
_ACROSS = ("x", "lon", "longitude", "easting")
_UP = ("y", "lat", "latitude", "northing")


class _NumpyFile(Opened):
    """An array of an .npy file, or of an .npz file."""

    def _open(self, choice: Choice) -> None:
        self._file = file = self.hold(self._source.path.open("rb"))
        magic = file.read(6)
        # numpy takes anything else for a pickle, and an error about that would lead the user astray
        if magic != b"\x93NUMPY" and magic[:4] not in (b"PK\x03\x04", b"PK\x05\x06"):
            raise InputError("is not a NumPy file", code="unreadable")
        file.seek(0)
        self._archive: zipfile.ZipFile | None = None
        with reading("NumPy file"):
            if magic[:2] == b"PK":
                self._archive = self.hold(zipfile.ZipFile(file))
                self._info = _member(self._source, self._archive, choice.key)
                with _opened(self._source, self._archive, self._info) as member:
                    self.shape, self.dtype, _ = _header(member.read(_HEADER))
                return
            if choice.key is not None:
                raise OptionError("a key names an array of an .npz file; this is a single array", code="key")
            self.shape, self.dtype, _ = _header(file.read(_HEADER))

    def _values(self, frame: int | None) -> Array:
        with reading("NumPy file"):
            if self._archive is None:
                self._file.seek(0)
                return pick_frame(_array(self._source, self._file, self._source.path.stat().st_size), frame)
            return pick_frame(_member_array(self._source, self._archive, self._info), frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        found = None if self._archive is None else _beside(self._source, self._archive, self.shape[-n:])
        return found or Placement()

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


def _member(source: InputFile, archive: zipfile.ZipFile, key: str | None) -> zipfile.ZipInfo:
    """The array that a key names, or the only one, or the one of the usual name."""
    members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
    if key is None:
        if len(fields := members.keys() - set(_OF_PLACE)) == 1:
            (key,) = fields
        elif DEFAULT_KEY in members:
            key = DEFAULT_KEY
        elif not members:
            raise InputError("holds no arrays", code="key")
        else:
            raise InputError(
                f"holds {len(members)} arrays: {_listing(source, archive, members)}", code="key",
                remedy="choose one with --key",
            )
    elif (key := key.removesuffix(".npy")) not in members:
        listing = _listing(source, archive, members) or "nothing"
        raise InputError(f"holds no array '{plain(key)}', but: {listing}", code="key")
    info = members[key]
    if not info.filename.endswith(".npy"):
        raise InputError(f"'{plain(key)}' is not an array", code="key")
    return info


def _member_array(source: InputFile, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Array:
    with _opened(source, archive, info) as member:
        return _array(source, member, info.file_size)


def _text(source: InputFile, archive: zipfile.ZipFile, info: zipfile.ZipInfo | None) -> str | None:
    """A text of an archive; None if it is none, or empty."""
    if info is None or info.file_size > _HEADER:
        return None
    with _opened(source, archive, info) as member:
        text = npy.read_array(io.BytesIO(member.read(_HEADER)), allow_pickle=False)
    return str(text) or None if text.dtype.kind == "U" and text.ndim == 0 else None


def _opened(source: InputFile, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> IO[bytes]:
    if info.compress_type not in _PACKED:
        raise InputError("is packed in a way that NumPy does not write", code="unreadable", remedy="use np.savez")
    source.check_packed(info.file_size, info.compress_size)
    return archive.open(info)


def _listing(source: InputFile, archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo]) -> str:
    parts = []
    for name, info in [*members.items()][:_LISTED]:
        try:
            with _opened(source, archive, info) as member:
                shape, dtype, _ = _header(member.read(_HEADER))
            kind = str(shape) if dtype.kind != "O" else "unreadable"
        except Exception:  # an unreadable neighbour must not hide the names of the others
            kind = "unreadable"
        parts.append(f"{plain(name)} {kind}")
    return ", ".join(parts + ["..."] * (len(members) > _LISTED))


def _beside(source: InputFile, archive: zipfile.ZipFile, shape: tuple[int, ...]) -> Placement | None:
    """Coordinates of a field beside it: a matrix ``placement`` with a text ``crs``, or of a field of two axes
    under the usual names: along the axes, or for each sample.

    Those of other sizes are not of this field.
    """
    members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
    if PLACEMENT in members:
        with reading("NumPy file"):
            matrix = _member_array(source, archive, members[PLACEMENT])
            crs = _text(source, archive, members.get(CRS))
        return placed(matrix, len(shape), crs)
    if len(shape) != 2:
        return None
    for pair in _PAIRS:
        if members.keys() >= set(pair):
            with reading("NumPy file"):
                x, y = (np.asarray(numbers(_member_array(source, archive, members[name])), np.float64) for name in pair)
            if x.shape == y.shape == shape:
                return placed_grid([x, y], shape, pair[0] != "x")
            if x.ndim == y.ndim == 1 and (len(y), len(x)) == shape:
                return placed_grid(open_grid([y, x]), shape, pair[0] != "x")
    return None


def _holds_mesh(source: InputFile, key: str | None) -> bool:
    """Whether an archive has points and cells."""
    try:
        with zipfile.ZipFile(source.path) as archive:
            return {f"{name}.npy" for name in _OF_MESHES} <= set(archive.namelist())
    except (OSError, zipfile.BadZipFile):
        return False


def _mesh(source: InputFile, choice: Choice) -> MeshRead:
    with reading("NumPy file"), zipfile.ZipFile(source.path) as archive:
        arrays = {
            info.filename.removesuffix(".npy"): _member_array(source, archive, info) for info in archive.infolist()
        }
        if not set(_OF_MESHES) <= set(arrays):
            raise InputError("holds no arrays points and cells", code="mesh")
        points, cells = np.asarray(arrays["points"], np.float64), np.asarray(arrays["cells"]).astype(np.int64)
        if points.ndim != 2 or cells.ndim != 2 or cells.shape[1] not in (3, 4):
            raise InputError("holds points or cells of another shape", code="mesh")
        others = {name: each for name, each in arrays.items() if name not in _OF_MESHES}
    values = {name: each for name, each in others.items() if each.shape[-1:] == (len(points),)}
    if choice.frame is not None:
        count = max((len(each) for each in values.values() if each.ndim == 2), default=0)
        check_frame(choice.frame, count)
        values = {name: each[choice.frame] for name, each in values.items() if each.ndim == 2}
    return MeshRead(points, cells, values)


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
        named = not all(map(_is_number, names))
        if not named:
            names = [*"xyz", *(f"column {i}" for i in range(4, len(names) + 1))][: len(names)]
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


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


FORMATS = (
    Format("NumPy array", (".npy",), _NumpyFile, signatures=((0, b"\x93NUMPY", ".npy"),), keyed=True),
    Format("NumPy archive", (".npz",), _NumpyFile, signatures=((0, b"PK\x03\x04", ".npz"),), keyed=True),
)
MESHES = (
    MeshFormat("NumPy archive", (".npz",), _mesh, holds=_holds_mesh, options=("frame",)),
    MeshFormat("table", (".csv", ".xyz"), _table, scattered=True),
)
