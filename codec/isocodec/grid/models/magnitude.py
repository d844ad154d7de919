"""Classes of numbers, for contexts and rows: how many binary digits they have (spec clause 7.14); means of a few."""

from __future__ import annotations

import numpy as np

from ...kernel import inlined

CLASSES = 13
"""Classes of sizes that rows distinguish, on either side."""
NONE, ROUGH, FINE = range(3)
"""How well something is known: not, only in part, as well as may be."""
_AT_ONCE = 13
"""Bits of a number that are counted by one look into ``_BITS``."""
_PARTS = np.array([0, 60, 30, 20, 15, 12, 10])
"""60 by each number but 0."""
_PARTS_FIT = 1 << 57
_BITS = np.array([x.bit_length() for x in range(1 << _AT_ONCE)], np.int8)


@inlined
def bits(x):
    """Bits of a number."""
    count = np.int64(0)
    while x >> _AT_ONCE:
        x >>= _AT_ONCE
        count += _AT_ONCE
    return count + _BITS[np.uint64(x)]


@inlined
def mean(total, count):
    """``total // count`` of at most six numbers, 0 of none: dividing by a constant is faster than by what comes."""
    if abs(total) < _PARTS_FIT:
        return total * _PARTS[np.uint64(count)] // 60
    return total // max(count, 1)


@inlined
def row_of(slot, known, size, negative):
    """Row, from a list's first on, for a candidate so far from where the parts are split."""
    # the bits of larger numbers are more than the last class's, too
    of_size = np.int64(_BITS[np.uint64(min(size, (1 << CLASSES - 1) - 1))])
    return (2 * slot + (known == FINE)) * 2 * CLASSES + of_size + CLASSES * np.int64(negative)
