"""Arrays of numpy: in memory, masked, of .npy files (mapped) and .npz archives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OptionError, plain
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.placement import CRS, PLACEMENT, Placement
from ..field.sampled import Field
from .in_turn import InTurn, check_frame, check_series, placed_field
from .libraries import choose, reading
from .places import along_axes, at_nodes

VALUES = "values"
"""Name of the array that is taken if there are several and no key is given."""
_PAIRS = (("lon", "lat"), ("longitude", "latitude"), ("rlon", "rlat"), ("nav_lon", "nav_lat"), ("x", "y"))
"""Names of coordinates x and y in .npz files."""
_ARCHIVE = b"PK"
_PLACED = "placed"
"""Name of the points in the world, beside those in samples."""


def check_kind(dtype: Any) -> None:
    """Raise `InputError` unless a dtype is one of real numbers or truth values."""
    if dtype.kind in "biuf":
        return
    names = {"c": "complex numbers", "M": "dates", "m": "dates", "O": "Python objects or strings", "U": "strings",
             "S": "strings", "T": "strings", "V": f"records ({', '.join(map(plain, dtype.names or ()))})"}
    raise InputError(f"holds {names.get(dtype.kind, 'values')} (dtype {dtype}), not real numbers", code="dtype",
                     remedy="give a part that holds real numbers")


def channel_of(count: int, band: int | None) -> int:
    """Number, from 0, of one of so many channels, which users count from 1.

    Raises
    ------
    InputError
        If there are several, and none is chosen.
    OptionError
        If there is no such channel.
    """
    if band is not None and not 1 <= band <= count:
        raise OptionError(f"there is no band {band}: there are {count}, counted from 1", code="channel")
    if band is None and count > 1:
        raise InputError(f"is a picture of {count} channels, colours or components", code="colour",
                         remedy=f"take one with --band 1 to {count} (band= in Python), or convert it to one")
    return (band or 1) - 1


def numbers(values: Any) -> Any:
    """Real numbers in native byte order, contiguous, a masked array if they are masked; truth values as uint8."""
    values = np.asanyarray(values)
    check_kind(values.dtype)
    if values.dtype.kind == "b":
        values = values.astype(np.uint8)
    bare = np.ascontiguousarray(np.asarray(values), values.dtype.newbyteorder("="))
    masked = isinstance(values, np.ma.MaskedArray)
    return np.ma.masked_array(bare, np.ascontiguousarray(np.ma.getmaskarray(values))) if masked else bare


def of_array(
    values: Any, frame: int | None = None, frames: bool = False, placement: Placement | None = None, **more: Any
) -> Field | Frames:
    """Samples of an array with two or three axes, or with a further first one that counts frames.

    Parameters
    ----------
    values : array_like
        Bool, integers or floats; of a masked array, what is masked is missing.
    frame : int, optional
        Number of the frame, counted from 0.
    frames : bool
        Give all frames; with ``frame``, the slices of that one.
    placement : Placement, optional
        Of a frame, or of the whole without frames.
    **more
        Attributes of `Field`.

    Raises
    ------
    InputError
        If these are not real numbers.
    OptionError
        If there is no such frame.
    """
    values = np.asanyarray(values)
    check_kind(values.dtype)
    whole = values.shape
    if frame is not None:
        check_frame(frame, len(values) if values.ndim > 2 else 0)
        values = values[frame]
    if not frames:
        return placed_field(values, None, placement, **more)
    check_series(values.ndim)
    remarks = more.get("remarks", ())
    return Frames(InTurn(len(values), lambda at: placed_field(values[at], None, placement, **more), whole, remarks))


def open_(path: str, key: str | None = None, frame: int | None = None, frames: bool = False) -> Field | Frames | Mesh:
    """Read an .npy file, whose samples stay in the file until they are used, or an .npz archive.

    An archive with ``points`` and ``cells`` is a mesh. Beside an array, ``placement`` is the matrix that places it and
    ``crs`` its reference system; or arrays such as ``lon`` and ``lat`` are its coordinates.

    Raises
    ------
    InputError, OptionError
    """
    with reading("NumPy file"), open(path, "rb") as file:
        start = file.read(6)
        if start != b"\x93NUMPY" and not start.startswith(_ARCHIVE):
            raise InputError("is not a NumPy file", code="unreadable")
    with reading("NumPy file"):
        found = np.load(path, mmap_mode="r", allow_pickle=False)
        if not hasattr(found, "files"):
            if key is not None:
                raise OptionError("a key names an array of an .npz file; this is a single array", code="key")
            plain = found.dtype.isnative and found.dtype.kind != "b"
            return of_array(found if plain else numbers(found), frame, frames)
        with found:
            if {"points", "cells"} <= {*found.files}:
                return _mesh(found, key, frame)
            return _archived(found, key, frame, frames)


def _archived(archive: Mapping[str, Any], key: str | None, frame: int | None, frames: bool) -> Field | Frames:
    names = [name for name in archive if name not in (PLACEMENT, CRS)]
    if not names:
        raise InputError("holds no arrays", code="key")
    name = choose(names if key is None else [*archive], VALUES if key is None and VALUES in names else key)
    values = archive[name]
    if not isinstance(values, np.ndarray):
        raise InputError(f"'{plain(name)}' is not an array", code="key")
    values = numbers(values)
    n = values.ndim - (1 if (frame is not None) != frames else 2 if frames else 0)
    where, remark = _placement(archive, values.shape[-n:] if n > 0 else ())
    return of_array(values, frame, frames, where, remarks=(remark,) if remark else ())


def _placement(archive: Mapping[str, Any], shape: Sequence[int]) -> tuple[Placement | None, str]:
    crs = _text(archive)
    if PLACEMENT in archive:
        return Placement(archive[PLACEMENT], crs=crs), ""
    remark = ""
    for pair in _PAIRS if len(shape) == 2 else ():
        if {*pair} <= archive.keys():
            x, y = (np.asarray(numbers(archive[name]), np.float64) for name in pair)
            if x.shape == y.shape == tuple(shape):
                return at_nodes([x, y], pair[0] != "x", crs=crs), ""
            if x.ndim == y.ndim == 1 and (len(y), len(x)) == tuple(shape):
                return along_axes([y, x], [1, 0], pair[0] != "x", crs=crs), ""
            remark = (f"its {pair[0]} {x.shape} and {pair[1]} {y.shape} are left out: they do not fit samples of shape "
                      f"{tuple(shape)}, whose first axis is {pair[1]}")
    return None, remark


def _text(archive: Mapping[str, Any]) -> str | None:
    return str(archive[CRS]) or None if CRS in archive else None


def _mesh(archive: Mapping[str, Any], key: str | None, frame: int | None) -> Mesh:
    points, cells = np.asarray(archive["points"], np.float64), np.asarray(archive["cells"]).astype(np.int64)
    if points.ndim != 2 or cells.ndim != 2 or cells.shape[1] not in (3, 4):
        raise InputError("holds points or cells of another shape", code="mesh")
    names = [name for name in archive if name not in ("points", "cells", _PLACED, PLACEMENT, CRS)]
    names = [name for name in names if np.shape(archive[name])[-1:] == (len(points),)]
    if _PLACED in archive and len(archive[_PLACED]) == len(points):
        points = np.asarray(archive[_PLACED], np.float64)
    elif PLACEMENT in archive:
        points = Placement(archive[PLACEMENT]).place(points)
    return valued(points, cells, {name: archive[name] for name in names}, key, frame, crs=_text(archive))


def valued(
    points: NDArray[Any], cells: NDArray[Any] | None, values: Mapping[str, Any], key: str | None,
    frame: int | None = None, **more: Any,
) -> Mesh:
    """A mesh or scattered points with the values that a key names, or the only ones, or those named ``z``; or bare.

    Parameters
    ----------
    points : (V, n) array
    cells : (T, 3) or (T, 4) array of int, or None
    values : mapping of str to (V,) or (F, V) array
        By name; the coordinates of the points go by ``x``, ``y`` and ``z``, too.
    key : str, optional
    frame : int, optional
        Of several frames, the number of one.
    **more
        Attributes of `Mesh`.

    Raises
    ------
    InputError
        Listing the names.
    OptionError
        If there is no such frame.
    """
    if cells is not None and cells.shape[1] == 3 and points.shape[1] == 3 and (points[:, 2] == 0).all():
        points = np.ascontiguousarray(points[:, :2])
    axes = {name: points[:, axis] for axis, name in enumerate("xyz"[: points.shape[1]])}
    known = {**(axes if key in axes or cells is not None else {}), **values}
    name = key if key is not None else next(iter(values)) if len(values) == 1 else "z" if "z" in values else None
    chosen = None if name is None else numbers(known[choose([*known], name, "values at points")])
    if chosen is not None and frame is not None:
        check_frame(frame, len(chosen) if chosen.ndim == 2 else 0)
        chosen = chosen[frame]
    return Mesh(points, cells, chosen, **more)
