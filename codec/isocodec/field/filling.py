"""Values for missing samples in an encoder: a smooth continuation of the others.

Decoders do not use them, but curves through holes cost bytes, so that they should be short and smooth: at each scale,
from the coarsest to the finest, missing samples start from the coarser scale and move towards the mean of their
neighbours.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROUNDS = 12
"""Steps towards the mean of the neighbours, at each scale."""
_MOST = 1e150
"""Bound to which samples are clipped, so that their sums are finite."""


def filled_smoothly(values: NDArray[Any], gone: NDArray[np.bool_]) -> NDArray[Any]:
    """Fill missing samples (not all may be) smoothly, within the type and the range of the others."""
    there = values[~gone]
    smooth = np.where(gone, 0, values).astype(np.float64)
    _fill(np.clip(smooth, -_MOST, _MOST, out=smooth), gone)
    found = smooth[gone]
    if values.dtype.kind in "iu":
        found = np.rint(found)
    out = values.copy()
    # rounding must not leave the range
    least, most = there.min(), there.max()
    inside = (found > float(least)) & (found < float(most))
    out[gone] = np.where(found >= float(most), most, least)
    place = np.flatnonzero(gone)[inside]
    out.reshape(-1)[place] = np.clip(found[inside].astype(values.dtype), least, most)
    return out


def _fill(values: NDArray[np.float64], gone: NDArray[np.bool_]) -> None:
    """Replace missing values in place."""
    if not gone.any():
        return
    if max(values.shape) == 1 or gone.all():
        values[gone] = 0.0
        return
    coarse, empty = _coarser(values, gone)
    _fill(coarse, empty)
    for axis, size in enumerate(values.shape):
        coarse = np.take(np.repeat(coarse, 2, axis=axis), range(size), axis=axis)
    values[gone] = coarse[gone]
    _relax(values, gone)


def _coarser(values: NDArray[np.float64], gone: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Average the known samples in blocks of two along each axis; also returns which blocks have none."""
    shape = tuple((size + 1) // 2 for size in values.shape)
    total, count = np.zeros(shape), np.zeros(shape)
    for start in product((0, 1), repeat=values.ndim):
        some = tuple(slice(first, None, 2) for first in start)
        here = ~gone[some]
        block = tuple(slice(size) for size in here.shape)
        total[block] += np.where(here, values[some], 0.0)
        count[block] += here
    return total / np.maximum(count, 1), count == 0


def _relax(values: NDArray[np.float64], gone: NDArray[np.bool_]) -> None:
    """Move missing values towards the mean of their neighbours; at the border, they are their own neighbours."""
    place = np.nonzero(gone)
    last = np.array(values.shape) - 1
    around = []
    for axis in range(values.ndim):
        for step in (-1, 1):
            moved = list(place)
            moved[axis] = np.clip(place[axis] + step, 0, last[axis])
            around.append(np.ravel_multi_index(tuple(moved), values.shape))
    flat, here = values.reshape(-1), np.ravel_multi_index(place, values.shape)
    for _ in range(ROUNDS):
        total = np.zeros(len(here))
        for neighbour in around:
            total += flat[neighbour]
        flat[here] = total / len(around)
