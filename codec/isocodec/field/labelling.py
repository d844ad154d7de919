"""Labels of samples: which there are, and which samples have one, also where scaling has moved them a little."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

ALL = "all"
"""All labels but 0."""
_MOVED = 0.05
"""Largest distance of a scaled value from the label that it is."""


def having(values: NDArray[Any], label: float) -> NDArray[np.bool_]:
    """Find the samples that have a label; of floats, if none has, those of the only value that is close to it."""
    inside = np.ascontiguousarray(values == label)
    if values.dtype.kind == "f" and not inside.any():
        near = values[np.abs(values - label) < _MOVED]
        if near.size and (near == near.flat[0]).all():
            return np.ascontiguousarray(values == near.flat[0])
    return inside


def labels_in(values: NDArray[Any], gone: NDArray[np.bool_] | None = None) -> tuple[float, ...]:
    """Find the labels of samples that are not missing, in order, but for 0; a value close to a whole number is that."""
    there = np.unique(values if gone is None else values[~gone])
    if there.dtype.kind == "f":
        there = there[np.isfinite(there)]
        whole = np.rint(there)
        there = np.unique(np.where(np.abs(there - whole) < _MOVED, whole, there)) if (
            len(np.unique(whole)) == len(there)) else there
    return tuple(each.item() for each in there if each)
