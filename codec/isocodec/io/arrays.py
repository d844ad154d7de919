"""Arrays of numpy: in memory, masked, of .npy files (mapped) and .npz archives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OptionError, plain
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.placement import CRS, PLACEMENT, Placement
from ..field.sampled import Field
from ..verbs import Choice
from .in_turn import InTurn, check_frame, check_series, placed_field
from .libraries import choose, reading
from .places import along_axes, at_nodes

SUFFIXES = (".npy", ".npz")
_SIGNATURES = (b"\x93NUMPY", b"PK")
"""First bytes of arrays, and of archives of arrays."""
VALUES = "values"
"""Name of the array that is taken if there are several and no key is given."""
_PAIRS = (("lon", "lat"), ("longitude", "latitude"), ("rlon", "rlat"), ("nav_lon", "nav_lat"), ("x", "y"))
"""Names of coordinates x and y in .npz files."""
_POINTS, _CELLS, _PLACED = "points", "cells", "placed"
"""Names of the arrays of a mesh; of its points in samples and in the world."""


def check_kind(dtype: Any) -> None:
    """Raise `InputError` unless a dtype is one of real numbers or truth values."""
    if dtype.kind in "biuf":
        return
    raise InputError(f"holds values of the type {plain(str(dtype))}, not real numbers", code="dtype",
                     remedy="give a part that holds real numbers")


def channel_of(count: int, band: int | None) -> int:
    """Number, from 0, of one of ``count`` channels, which users count from 1.

    Raises `InputError` if there are several and none is chosen, and `OptionError` if there is no such channel.
    """
    if band is not None and not 1 <= band <= count:
        raise OptionError(f"there is no band {band}: there are {count}, counted from 1", code="channel")
    if band is None and count > 1:
        raise InputError(f"is a picture of {count} channels, colours or components", code="colour",
                         remedy=f"take one with --band 1 to {count} (band= in Python), or convert it to one")
    return (band or 1) - 1


def indices() -> InputError:
    """Error of a picture whose samples are indices of a palette."""
    return InputError("holds indices of a palette, not samples", code="palette",
                      remedy="band=1 (--band 1) takes the indices; or save it as grey")


def numbers(values: Any) -> Any:
    """Convert real numbers to native byte order, contiguous, and truth values to uint8; masks stay."""
    values = np.asanyarray(values)
    check_kind(values.dtype)
    kind = np.dtype(np.uint8) if values.dtype.kind == "b" else values.dtype.newbyteorder("=")
    bare = np.ascontiguousarray(np.asarray(values), kind)
    masked = isinstance(values, np.ma.MaskedArray)
    return np.ma.masked_array(bare, np.ascontiguousarray(np.ma.getmaskarray(values))) if masked else bare


def of_array(
    values: Any, choice: Choice, placement: Placement | None = None, **more: Any
) -> Field | Frames:
    """Read an array of two or three axes, or with another in front that counts frames.

    Without ``frames``, ``placement`` is that of the whole; ``more`` are attributes of `Field`. Raises `InputError`
    unless these are real numbers, `OptionError` if there is no such frame.
    """
    values = np.asanyarray(values)
    check_kind(values.dtype)
    whole = values.shape
    if choice.frame is not None:
        check_frame(choice.frame, len(values) if values.ndim > 2 else 0)
        values = values[choice.frame]
    if not choice.frames:
        return placed_field(values, None, placement, **more)
    check_series(values.ndim)
    remarks = more.get("remarks", ())
    return Frames(InTurn(len(values), lambda at: placed_field(values[at], None, placement, **more), whole, remarks))


def open_(path: Path, choice: Choice) -> Field | Frames | Mesh:
    """Read an .npy file, whose samples stay in the file until they are used, or an .npz archive.

    An archive with ``points`` and ``cells`` is a mesh. Beside an array, ``placement`` is the matrix that places it and
    ``crs`` its reference system; or arrays such as ``lon`` and ``lat`` are its coordinates.
    """
    with reading("NumPy file"):
        with path.open("rb") as file:
            if not file.read(6).startswith(_SIGNATURES):  # numpy would take it for a pickle
                raise InputError("is not a NumPy file", code="unreadable")
        found = np.load(path, mmap_mode="r")
        if isinstance(found, np.ndarray):
            if choice.key is not None:
                raise OptionError("a key names an array of an .npz file; this is a single array", code="key")
            return of_array(found if found.dtype.isnative and found.dtype != bool else numbers(found), choice)
        with found:
            return (_mesh if {_POINTS, _CELLS} <= {*found} else _field)(found, choice)


def _field(archive: Mapping[str, Any], choice: Choice) -> Field | Frames:
    key, names = choice.key, [name for name in archive if name not in (PLACEMENT, CRS)]
    values = numbers(archive[choose(names, VALUES if key is None and VALUES in names else key)])
    n = values.ndim - (choice.frame is not None) - choice.frames
    where, remarks = _placement(archive, values.shape[values.ndim - n :])
    return of_array(values, choice, where, remarks=remarks)


def _placement(archive: Mapping[str, Any], shape: Sequence[int]) -> tuple[Placement | None, list[str]]:
    crs = _crs(archive)
    if PLACEMENT in archive:
        return Placement(archive[PLACEMENT], crs=crs), []
    remarks = []
    for pair in _PAIRS:
        if len(shape) != 2 or not {*pair} <= {*archive}:
            continue
        x, y = (numbers(archive[name]).astype(np.float64) for name in pair)
        turns = pair[0] != "x"
        if x.shape == y.shape == shape:
            return at_nodes([x, y], turns, crs=crs), []
        if (*y.shape, *x.shape) == shape:
            return along_axes([y, x], [1, 0], turns, crs=crs), []
        remarks = [f"its {pair[0]} {x.shape} and {pair[1]} {y.shape} are left out: they do not fit samples of shape "
                   f"{shape}, whose first axis is {pair[1]}"]
    return None, remarks


def _crs(archive: Mapping[str, Any]) -> str | None:
    return str(archive[CRS]) or None if CRS in archive else None


def _mesh(archive: Mapping[str, Any], choice: Choice) -> Mesh:
    points, cells = np.asarray(archive[_POINTS], np.float64), np.asarray(archive[_CELLS]).astype(np.int64)
    if points.ndim != 2 or cells.ndim != 2 or cells.shape[1] not in (3, 4):
        raise InputError("holds points or cells of another shape", code="mesh")
    values = {name: archive[name] for name in archive if name not in (_POINTS, _CELLS, _PLACED, PLACEMENT, CRS)}
    values = {name: each for name, each in values.items() if each.shape[-1:] == points.shape[:1]}
    if _PLACED in archive and len(archive[_PLACED]) == len(points):
        points = np.asarray(archive[_PLACED], np.float64)
    elif PLACEMENT in archive:
        points = Placement(archive[PLACEMENT]).place(points)
    return valued(points, cells, values, choice.key, choice.frame, crs=_crs(archive))


def valued(
    points: NDArray[Any], cells: NDArray[Any] | None, values: Mapping[str, Any], key: str | None,
    frame: int | None = None, **more: Any,
) -> Mesh:
    """Make a mesh, or scattered points, with the values of a key, or the only ones, or those named ``z``; or bare.

    ``values`` are (V,) or (F, V) by name; the coordinates of the points go by ``x``, ``y`` and ``z``, too. ``frame``
    takes one of several frames, and ``more`` are attributes of `Mesh`. Raises `InputError` with the names if the choice
    is open, and `OptionError` if there is no such frame.
    """
    if cells is not None and cells.shape[1] == 3 and points.shape[1] == 3 and not points[:, 2].any():
        points = np.ascontiguousarray(points[:, :2])
    if key is None:
        key = next(iter(values)) if len(values) == 1 else "z" if "z" in values else None
    if key is None:
        return Mesh(points, cells, **more)
    axes = dict(zip("xyz", points.T, strict=False))
    known = {**(axes if key in axes or cells is not None else {}), **values}
    chosen = numbers(known[choose([*known], key, "values at points")])
    if frame is not None:
        check_frame(frame, len(chosen) if chosen.ndim == 2 else 0)
        chosen = chosen[frame]
    return Mesh(points, cells, chosen, **more)
