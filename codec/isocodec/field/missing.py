"""Missing samples: find them, or fill them instead of keeping holes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..extras import optional

WAYS = ("below", "above", "nearest")
"""Alternatives to holes for missing samples."""
HOLE = "hole"
Array = NDArray[Any]


def missing_samples(field: Array, nodata: float | None) -> NDArray[np.bool_]:
    """Find the samples that are NaN or have the value ``nodata``, rounded to their type: (s0, .., sn-1) bool."""
    gone = np.isnan(field) if field.dtype.kind == "f" else np.zeros(field.shape, np.bool_)
    if nodata is None or math.isnan(nodata):
        return gone
    if field.dtype.kind == "f":
        with np.errstate(over="ignore"):
            gone |= field == np.asarray(nodata).astype(field.dtype)
    elif field.dtype.kind in "iu" and nodata.is_integer():
        info = np.iinfo(field.dtype)
        if info.min <= nodata <= info.max:
            gone |= field == int(nodata)
    return gone


def filled(field: Array, gone: NDArray[np.bool_], way: str, isovalues: Sequence[float]) -> Array:
    """Replace missing samples, keeping the type of the field.

    ``"below"`` takes the smallest sample or less, so that they lie below all isovalues, and ``"above"`` the largest or
    more; in both cases the curve runs around them. ``"nearest"`` takes the nearest valid sample and needs scipy. Raises
    `InputError` if all samples are missing, or the type has no value beyond the isovalues.
    """
    if not gone.any():
        return field
    if gone.all():
        raise InputError("all samples are missing", code="missing")
    if way == "nearest":
        ndimage = optional("scipy.ndimage", extra="vector", purpose="filling missing samples")
        nearest = ndimage.distance_transform_edt(gone, return_distances=False, return_indices=True)
        return np.asarray(field[tuple(nearest)])
    there = field[~gone]
    value = min(there.min(), _just(field, min(isovalues), way)) if way == "below" else (
        max(there.max(), _just(field, max(isovalues), way))
    )
    out = field.copy()
    out[gone] = value
    return out


def _just(field: Array, isovalue: float, way: str) -> Any:
    """Find the value of the field's type that lies next to an isovalue on the given side."""
    if field.dtype.kind == "f":
        value = field.dtype.type(isovalue)
        return value if way == "below" else np.nextafter(value, field.dtype.type(np.inf))
    whole = math.floor(isovalue) + (way == "above")
    info = np.iinfo(field.dtype)
    if not info.min <= whole <= info.max:
        raise InputError(f"{field.dtype} has no value {way} the isovalue {isovalue:g}", code="missing")
    return field.dtype.type(whole)
