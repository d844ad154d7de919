"""Levels of many lattice points at once (spec clause 4.7(1))."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def levels_of(position: NDArray[np.int64], k: int) -> NDArray[np.int64]:
    """Levels of the middles at (V, n) in a root cube of edge ``2**k``, (V,) int64; -1 of its corners."""
    bits = np.bitwise_or.reduce(position, axis=1)
    unit = np.where(bits == 0, 1 << k, np.minimum(bits & -bits, 1 << k))
    odd = (position // unit[:, None] & 1).sum(axis=1)
    return np.where(unit < 1 << k, position.shape[1] * (k - np.log2(unit).astype(np.int64)) - odd, -1)
