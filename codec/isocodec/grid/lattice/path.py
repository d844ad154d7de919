"""Paths of simplices in the forest of binary trees, as numbers (spec clause 5.3.2)."""

from __future__ import annotations

import numpy as np

from ...kernel import inner
from .access import child, dimension
from .access import root as root_class

_ROOT_SHIFT = 60
"""A leaf is packed into a number: its root, then a 1, then one bit for each turn of its path."""


@inner
def unpacked(item):
    """Root, depth and turns of a packed leaf."""
    path = item & ((np.int64(1) << _ROOT_SHIFT) - 1)
    depth = np.int64(0)
    while path >> depth > 1:
        depth += 1
    return item >> _ROOT_SHIFT, depth, path


@inner
def descend(grid, item):
    """Level, class and block of a packed leaf."""
    n = dimension(grid.tables)
    root, depth, path = unpacked(item)
    cls = root_class(grid.tables, root)
    b0, b1, b2 = np.int64(0), np.int64(0), np.int64(0)
    for level in range(depth):
        r = level % n
        f = 2 if r == n - 1 else 1
        cls, d0, d1, d2 = child(grid.tables, r, cls, (path >> (depth - 1 - level)) & 1)
        b0, b1, b2 = b0 * f + d0, b1 * f + d1, b2 * f + d2
    return depth, cls, b0, b1, b2
