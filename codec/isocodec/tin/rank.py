"""Points of the plane in the order of their ranks (spec clause 10.5.2).

Where geometry leaves a choice open, rank decides: a hash of the position, so that nothing depends on the order of the
points in a file, and rows of a grid form no pattern.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BITS = 28
"""Coordinates are from 0 to below ``2**BITS``."""
_MASK = (1 << 32) - 1
_X, _Y, _MIX = 0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D


def ranks(x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.int64]:
    """Hash positions to 32 bits each."""
    h = (x * _X & _MASK) ^ (y * _Y & _MASK)
    for shift in (15, 13):
        h = (h ^ h >> shift) * _MIX & _MASK
    return h ^ h >> 16


def by_rank(x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.int64]:
    """Order points by rank; of equal hashes, smaller x, then smaller y comes first."""
    return np.lexsort((y, x, ranks(x, y)))
