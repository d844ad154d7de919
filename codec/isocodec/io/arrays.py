"""Named arrays: NumPy files, and HDF5 with what NetCDF says of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OptionError
from .extras import optional
from .reading import check_frame, pick_frame, reading

Field = NDArray[Any]

HDF5_SUFFIXES = (".h5", ".hdf5", ".nc")

_PACKED = ("scale_factor", "add_offset")

# The array of a file that is taken if there are several and none is named.
DEFAULT_KEY = "values"


def read_numpy(path: Path, key: str | None, frame: int | None) -> Field:
    with path.open("rb") as file:
        magic = file.read(6)
    # numpy takes anything else for a pickle and says so, which would lead the user astray.
    if magic != b"\x93NUMPY" and magic[:4] not in (b"PK\x03\x04", b"PK\x05\x06"):
        raise InputError("is not a NumPy file", code="unreadable")
    with reading("NumPy file"):
        loaded = _array(lambda: np.load(path, allow_pickle=False))
        if isinstance(loaded, np.ndarray):
            if key is not None:
                raise OptionError("a key names an array of an .npz file; this is a single array", code="key")
            return pick_frame(loaded, frame)
        with loaded:
            return pick_frame(_member(loaded, key), frame)


def _member(archive: Any, key: str | None) -> Field:
    names = list(archive.files)
    if key is None:
        if len(names) == 1:
            key = names[0]
        elif DEFAULT_KEY in names:
            key = DEFAULT_KEY
        elif not names:
            raise InputError("holds no arrays", code="key")
        else:
            raise InputError(
                f"holds {len(names)} arrays: {_listing(archive)}", code="key", remedy="name one with --key"
            )
    elif key not in names:
        raise InputError(f"holds no array {key!r}, but: {_listing(archive) or 'nothing'}", code="key")
    field = _array(lambda: archive[key])
    if not isinstance(field, np.ndarray):  # numpy returns the bytes of a member that is no .npy
        raise InputError(f"{key!r} is not an array", code="key")
    return field


def _listing(archive: Any, limit: int = 20) -> str:
    parts = []
    for name in archive.files[:limit]:
        try:
            shape = str(archive[name].shape)
        except Exception:  # an unreadable neighbour must not hide the names of the others
            shape = "unreadable"
        parts.append(f"{name} {shape}")
    if len(archive.files) > limit:
        parts.append("...")
    return ", ".join(parts)


def _array(load: Callable[[], Any]) -> Any:
    try:
        return load()
    except ValueError as exc:
        if "Object arrays" in str(exc):
            raise InputError("holds Python objects, not real numbers", code="dtype") from exc
        raise


@contextmanager
def dataset(path: Path, key: str | None) -> Iterator[Any]:
    """The array of an HDF5 file that a key names: the only one of two or more axes, or ``values``, if there is none."""
    h5py = optional("h5py", extra="hdf5", purpose=f"reading {path.suffix}")
    with path.open("rb") as file:
        if file.read(3) == b"CDF":
            raise InputError(
                "is NetCDF of the classic kind, not HDF5", code="unreadable", remedy="convert it: nccopy -k nc4 IN OUT"
            )
    with reading("HDF5 file"), h5py.File(path, "r") as file:
        shapes: dict[str, tuple[int, ...]] = {}
        file.visititems(lambda name, item: shapes.update({name: item.shape} if getattr(item, "shape", None) else {}))
        fields = {name: shape for name, shape in shapes.items() if len(shape) > 1}
        if key is None:
            if not fields:
                raise InputError(f"holds no array of two or more axes, but: {_shapes(shapes)}", code="key")
            if len(fields) > 1 and DEFAULT_KEY not in fields:
                raise InputError(
                    f"holds {len(fields)} arrays: {_shapes(fields)}", code="key", remedy="name one with --key"
                )
            key = DEFAULT_KEY if DEFAULT_KEY in fields else next(iter(fields))
        elif key.strip("/") not in shapes:
            raise InputError(f"holds no array {key!r}, but: {_shapes(shapes)}", code="key")
        yield file[key]


def _shapes(shapes: dict[str, tuple[int, ...]], limit: int = 20) -> str:
    parts = [f"{name} {shape}" for name, shape in [*shapes.items()][:limit]] + ["..."] * (len(shapes) > limit)
    return ", ".join(parts) or "nothing"


def read_hdf5(path: Path, key: str | None, frame: int | None) -> Field:
    """Samples as they are; packed ones of NetCDF unpacked to float64, NaN where there are none."""
    with dataset(path, key) as stored:
        # One time, one height: axes along which nothing lies.
        where: list[int | slice] = [0 if count == 1 else slice(None) for count in stored.shape]
        if frame is not None:
            axes = [axis for axis, count in enumerate(stored.shape) if count > 1]
            check_frame(frame, stored.shape[axes[0]] if len(axes) > 2 else 0)
            where[axes[0]] = frame
        field = np.asarray(stored[tuple(where)])
        if field.dtype.kind not in "iuf" or not is_packed(stored):
            return field
        slope, offset = (_attribute(stored, name) for name in _PACKED)
        unpacked = field * (1.0 if slope is None else slope) + (0.0 if offset is None else offset)
        fill = fill_value(stored)
        return unpacked if fill is None else np.where(field == fill, np.nan, unpacked)


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
