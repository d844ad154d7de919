"""H5py reads HDF5, with the attributes of NetCDF-4.

Samples that lie in other files are left there unless they are asked for. Of a field over latitude and longitude, x is
the longitude. An axis is periodic if the longitudes along it, a step behind the last one, are at the first one again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, one_line, plain
from ...extras import optional
from ...field.placement import Placement
from .from_xarray import OpenedClassic
from .opened import DEFAULT_KEY, Choice, Format, Opened
from .place_of_samples import EVEN, in_steps, open_grid, placed_grid
from .reading import check_frame, reading
from .source import InputFile

Array = NDArray[Any]
Numbers = NDArray[np.float64]

_PACKED = ("scale_factor", "add_offset")
_LISTED = 20
_WEST_EAST = ("degrees_east", "degree_east", "degree_E", "degrees_E", "degreeE", "degreesE")
_SOUTH_NORTH = ("degrees_north", "degree_north", "degree_N", "degrees_N", "degreeN", "degreesN")


@contextmanager
def dataset(source: InputFile, key: str | None) -> Iterator[Any]:
    """Open the array of an HDF5 file by its key; without a key the only one of two or more axes, or ``values``."""
    h5py = optional("h5py", extra="hdf5", purpose=f"reading {source.path.suffix}")
    with reading("HDF5 file"), h5py.File(source.path, "r") as file:
        there: dict[str, Any] = {}
        file.visititems(lambda name, item: there.update({name: item} if isinstance(item, h5py.Dataset) else {}))
        # even the shape of an array whose samples lie elsewhere may be looked up there
        elsewhere = {} if source.follow else {n: f for n in there if (f := _other_file(n, there)) is not None}
        shapes = {name: item.shape for name, item in there.items() if name not in elsewhere and item.shape}
        fields = {name: shape for name, shape in shapes.items() if len(shape) > 1}
        if key is None:
            candidates = [*fields, *elsewhere]
            if not candidates:
                raise InputError(f"holds no array of two or more axes, but: {_shapes(shapes)}", code="key")
            if len(candidates) > 1 and DEFAULT_KEY not in candidates:
                raise InputError(
                    f"holds {len(candidates)} arrays: {_shapes(fields, elsewhere)}", code="key",
                    remedy="choose one with --key",
                )
            key = DEFAULT_KEY if DEFAULT_KEY in candidates else candidates[0]
        elif key.strip("/") not in {*shapes, *elsewhere}:
            raise InputError(f"holds no array '{plain(key)}', but: {_shapes(shapes, elsewhere)}", code="key")
        if key.strip("/") in elsewhere:
            raise source.refused(elsewhere[key.strip("/")], "in which samples lie")
        yield file[key]


def _other_file(name: str, there: Mapping[str, Any], seen: frozenset[str] = frozenset()) -> str | None:
    """Another file in which samples of an array lie, directly or of one that it is put together from."""
    item = there[name]
    if item.external:
        return str(item.external[0][0])
    if item.is_virtual:
        for part in item.virtual_sources():
            if part.file_name != ".":
                return str(part.file_name)
            inner = part.dset_name.strip("/")
            if inner not in there:  # a link, or a pattern of names
                return str(part.dset_name)
            if inner not in seen and (found := _other_file(inner, there, seen | {name})) is not None:
                return found
    return None


def _shapes(shapes: Mapping[str, tuple[int, ...]], elsewhere: Mapping[str, str] | None = None) -> str:
    parts = [f"{plain(name)} {shape}" for name, shape in shapes.items()]
    parts += [f"{plain(name)} in another file" for name in elsewhere or ()]
    return ", ".join(parts[:_LISTED] + ["..."] * (len(parts) > _LISTED)) or "nothing"


class _Hdf5(Opened):
    """An array of an HDF5 file: packed ones of NetCDF unpacked to float64, NaN where samples are missing."""

    def _open(self, choice: Choice) -> None:
        stored = self._stored = self.hold(dataset(self._source, choice.key))
        # One time, one height: axes along which nothing lies.
        self.shape = tuple(count for count in stored.shape if count > 1)
        self.dtype = unpacked(stored, np.zeros(0, stored.dtype)).dtype
        self.nodata = None if is_packed(stored) else fill_value(stored)
        name = attribute_text(stored, "long_name") or str(stored.name).strip("/")
        self.name, self.unit = plain(name), attribute_text(stored, "units")

    def _values(self, frame: int | None) -> Array:
        stored = self._stored
        with reading("HDF5 file"):
            where: list[int | slice] = [0 if count == 1 else slice(None) for count in stored.shape]
            taken = [1 if isinstance(place, int) else count for place, count in zip(where, stored.shape, strict=True)]
            if frame is not None:
                axes = [axis for axis, count in enumerate(stored.shape) if count > 1]
                check_frame(frame, stored.shape[axes[0]] if len(axes) > 2 else 0)
                where[axes[0]], taken[axes[0]] = frame, 1
            check_storage(self._source, stored, taken)
            return unpacked(stored, np.asarray(stored[tuple(where)]))

    def _place(self, n: int, frame: int | None) -> Placement:
        with reading("HDF5 file"):
            return _of_scales(self._source, self._stored, n)

    def _windows(self) -> StoredWindows:
        with reading("HDF5 file"):
            check_storage(self._source, self._stored, [1])
        return StoredWindows(self._stored)


def _opened(source: InputFile, choice: Choice) -> Opened:
    """Open HDF5, or by its first bytes NetCDF of the classic kind."""
    with source.path.open("rb") as file:
        classic = file.read(3) == b"CDF"
    return OpenedClassic(source, choice) if classic else _Hdf5(source, choice)


def unpacked(stored: Any, field: Array) -> Array:
    """Samples of a dataset; packed ones unpacked, NaN where they are missing."""
    if field.dtype.kind not in "iuf" or not is_packed(stored):
        return field
    slope, offset = (_attribute(stored, name) for name in _PACKED)
    found = field * (1.0 if slope is None else slope) + (0.0 if offset is None else offset)
    fill = fill_value(stored)
    return found if fill is None else np.where(field == fill, np.nan, found)


def check_storage(source: InputFile, stored: Any, taken: list[int]) -> None:
    """Check that the data of an array may be read, and have ever been written."""
    source.check_array(taken, stored.dtype)
    # a chunk is unpacked as a whole, however few of its samples are wanted
    source.check_count(math.prod(stored.chunks or ()))
    if not (stored.is_virtual or stored.external) and stored.size and not stored.id.get_storage_size():
        raise InputError(f"holds the shape of '{plain(stored.name)}', {stored.shape}, but no samples", code="empty")


def is_packed(stored: Any) -> bool:
    """Whether a dataset holds numbers that are to be multiplied or added to."""
    return any(_attribute(stored, name) is not None for name in _PACKED)


def fill_value(stored: Any) -> float | None:
    """Fill value for missing samples in a dataset, as it is stored; None without one."""
    fill = _attribute(stored, "_FillValue")
    return _attribute(stored, "missing_value") if fill is None else fill


def _attribute(stored: Any, name: str) -> float | None:
    """A number that a dataset's attribute holds; None if it is not there or holds none."""
    try:
        return float(np.ravel(stored.attrs[name])[0])
    except (KeyError, IndexError, TypeError, ValueError, OSError):
        return None


def attribute_text(stored: Any, name: str) -> str | None:
    """Text of an attribute of a dataset; None if it is missing or not text."""
    try:
        said = stored.attrs[name]
    except (KeyError, TypeError, ValueError, OSError):
        return None
    said = said.decode(errors="replace") if isinstance(said, bytes) else said
    return one_line(said) if isinstance(said, str) and said.strip() else None


class StoredWindows:
    """An array of an HDF5 file, decoded by its attributes: unpacked, with missing samples masked.

    Attributes
    ----------
    shape : tuple of int
        Without axes of one sample.
    dtype : dtype
    """

    def __init__(self, stored: Any) -> None:
        self._stored = stored
        self.shape = tuple(count for count in stored.shape if count > 1)
        self.dtype = unpacked(stored, np.zeros(0, stored.dtype)).dtype

    def __getitem__(self, window: tuple[slice, ...]) -> NDArray[Any]:
        asked = iter(window)
        place = tuple(0 if count == 1 else next(asked) for count in self._stored.shape)
        with reading("HDF5 file"):
            raw = np.asarray(self._stored[place])
        found = unpacked(self._stored, raw)
        fill = fill_value(self._stored)
        # of numbers that are unpacked NaN stands for those
        return found if found is not raw or fill is None else np.ma.masked_array(raw, raw == fill)


def _of_scales(source: InputFile, stored: Any, n: int) -> Placement:
    """Placement by the scales of a dataset's axes, as far as these are kept in the file."""
    axes = [(count, _scales(source, stored, axis)) for axis, count in enumerate(stored.shape) if count > 1][-n:]
    shape = [count for count, _ in axes]
    if any(" since " in str(scale.attrs.get("units")) for _, scales in axes for scale in scales):
        return Placement(remark="its coordinates are ignored, as one of its axes is time; choose one time with --frame")
    found = [_scale(*axis) for axis in axes]
    scales = [None if one is None else one[0] for one in found]
    curvilinear = auxiliary(stored, shape, scales[0] if n == 3 else None)
    if curvilinear is not None:
        return curvilinear
    if all(scale is None for scale in scales):
        return Placement()
    steps = []
    even = True
    for axis, scale in enumerate(scales):
        if scale is None:
            return Placement(remark="its coordinates are ignored: not all axes have them")
        step = (scale[-1] - scale[0]) / (len(scale) - 1)
        each = np.diff(scale)
        if not (np.isfinite(scale).all() and ((each > 0).all() or (each < 0).all() or not each.any())):
            return Placement(remark=f"its coordinates are ignored: along axis {axis} they neither rise nor fall")
        even &= bool(np.abs(scale - (scale[0] + step * np.arange(len(scale)))).max() <= abs(step) * EVEN)
        steps.append((step, scale[0]))
    mapped = scales_of([one for one in found if one is not None])
    return in_steps(steps) if even and not mapped.periodic else mapped


def _scales(source: InputFile, stored: Any, axis: int) -> list[Any]:
    scales = [*stored.dims[axis].values()]
    return [scale for scale in scales if source.follow or not (scale.is_virtual or scale.external)]


def _scale(count: int, scales: list[Any]) -> tuple[NDArray[np.float64], str] | None:
    """Coordinates along an axis of so many samples and their unit; None if they are missing, or not so many."""
    for scale in scales:
        # NetCDF has scales that only say how long an axis is
        named = "This is a netCDF dimension but not a netCDF variable" not in str(scale.attrs.get("NAME"))
        if named and scale.shape == (count,) and scale.dtype.kind in "iuf":
            return np.asarray(scale[()], np.float64), text_of(scale, "units")
    return None


def scales_of(scales: Sequence[tuple[Numbers, str]]) -> Placement:
    """Place samples by the coordinates along each axis and their units."""
    units = scales[-1][1]
    coordinates = open_grid([scale for scale, _ in scales])
    return placed_grid(coordinates, [len(scale) for scale, _ in scales], units in _WEST_EAST)


def auxiliary(stored: Any, shape: Sequence[int], scale: Numbers | None) -> Placement | None:
    """Longitude and latitude for each sample of the last two axes, as the attribute ``coordinates`` names them.

    ``scale`` are coordinates along the first of three axes.
    """
    found: dict[str, Numbers] = {}
    for name in text_of(stored, "coordinates").split():
        other = stored.parent.get(name)
        if other is None or getattr(other, "shape", None) is None or other.is_virtual or other.external:
            continue
        units = text_of(other, "units")
        counts = tuple(count for count in other.shape if count > 1)
        if counts == tuple(shape[-2:]) and other.dtype.kind in "iuf":
            which = "x" if units in _WEST_EAST else "y" if units in _SOUTH_NORTH else ""
            found[which] = _valid(other).reshape((1,) * (len(shape) - 2) + counts)
    if not {"x", "y"} <= found.keys() or (len(shape) == 3 and scale is None):
        return None
    coordinates = [found["x"], found["y"]] + ([] if scale is None else [scale.reshape(-1, 1, 1)])
    return placed_grid(coordinates, shape, True)


def text_of(stored: Any, name: str) -> str:
    """Text of an attribute; empty where it is missing."""
    text = stored.attrs.get(name, "")
    return text.decode(errors="replace") if isinstance(text, bytes) else str(text)


def _valid(stored: Any) -> Numbers:
    """Numbers of a dataset, NaN where it has its fill value."""
    out = np.asarray(stored[()], np.float64)
    for name in ("_FillValue", "missing_value"):
        if name in stored.attrs:
            out = np.where(out == float(np.ravel(stored.attrs[name])[0]), np.nan, out)
    return out


FORMATS = (
    Format(
        "HDF5", (".h5", ".hdf5", ".nc"), _opened, extra="hdf5", keyed=True,
        signatures=(
            (0, b"\x89HDF\r\n\x1a\n", ".h5"), *((0, b"CDF" + version, ".nc") for version in (b"\1", b"\2", b"\5")),
        ),
    ),
)
