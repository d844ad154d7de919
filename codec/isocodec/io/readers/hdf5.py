"""HDF5, with what NetCDF says of its own. Samples that lie in other files are left there unless they are asked for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, one_line, plain
from ...extras import optional
from .numpyfile import DEFAULT_KEY
from .reading import check_frame, reading
from .source import Source

Field = NDArray[Any]

HDF5_SUFFIXES = (".h5", ".hdf5", ".nc")

_PACKED = ("scale_factor", "add_offset")
_LISTED = 20


@contextmanager
def dataset(source: Source, key: str | None) -> Iterator[Any]:
    """The array of an HDF5 file that a key names: the only one of two or more axes, or ``values``, if there is none."""
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


def read_hdf5(source: Source, key: str | None, frame: int | None) -> Field:
    """Samples as they are; packed ones of NetCDF unpacked to float64, NaN where there are none."""
    with dataset(source, key) as stored:
        # One time, one height: axes along which nothing lies.
        where: list[int | slice] = [0 if count == 1 else slice(None) for count in stored.shape]
        taken = [1 if isinstance(place, int) else count for place, count in zip(where, stored.shape, strict=True)]
        if frame is not None:
            axes = [axis for axis, count in enumerate(stored.shape) if count > 1]
            check_frame(frame, stored.shape[axes[0]] if len(axes) > 2 else 0)
            where[axes[0]], taken[axes[0]] = frame, 1
        check_storage(source, stored, taken)
        return unpacked(stored, np.asarray(stored[tuple(where)]))


def unpacked(stored: Any, field: Field) -> Field:
    """Samples of a dataset; packed ones unpacked, NaN where there are none."""
    if field.dtype.kind not in "iuf" or not is_packed(stored):
        return field
    slope, offset = (_attribute(stored, name) for name in _PACKED)
    found = field * (1.0 if slope is None else slope) + (0.0 if offset is None else offset)
    fill = fill_value(stored)
    return found if fill is None else np.where(field == fill, np.nan, found)


def check_storage(source: Source, stored: Any, taken: list[int]) -> None:
    """That what is taken of an array may be read, and has ever been written."""
    source.check_array(taken, stored.dtype)
    # a chunk is unpacked as a whole, however few of its samples are wanted
    source.check_count(math.prod(stored.chunks or ()))
    if not (stored.is_virtual or stored.external) and stored.size and not stored.id.get_storage_size():
        raise InputError(f"holds the shape of '{plain(stored.name)}', {stored.shape}, but no samples", code="empty")


def is_packed(stored: Any) -> bool:
    """Whether a dataset holds numbers that are to be multiplied or added to."""
    return any(_attribute(stored, name) is not None for name in _PACKED)


def fill_value(stored: Any) -> float | None:
    """The number that stands for missing samples in a dataset, as it is stored; None if there is none."""
    fill = _attribute(stored, "_FillValue")
    return _attribute(stored, "missing_value") if fill is None else fill


def _attribute(stored: Any, name: str) -> float | None:
    """A number that a dataset's attribute holds; None if it is not there or holds none."""
    try:
        return float(np.ravel(stored.attrs[name])[0])
    except (KeyError, IndexError, TypeError, ValueError, OSError):
        return None


def attribute_text(stored: Any, name: str) -> str | None:
    """What an attribute of a dataset says in words; None if it is not there or holds none."""
    try:
        said = stored.attrs[name]
    except (KeyError, TypeError, ValueError, OSError):
        return None
    said = said.decode(errors="replace") if isinstance(said, bytes) else said
    return one_line(said) if isinstance(said, str) and said.strip() else None
