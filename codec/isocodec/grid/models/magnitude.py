"""Classes of numbers, for contexts and rows: how many binary digits they have (spec clause 7.14); means of a few."""

from __future__ import annotations

import numpy as np

from ...kernel import inlined
from ...kernel.bit_length import bit_length

CLASSES = 13
"""Classes of sizes that rows distinguish, on either side."""
NONE, ROUGH, FINE = range(3)
"""Classes of how well something is known: not, only in part, as well as may be."""
_PARTS = np.array([0, 60, 30, 20, 15, 12, 10])
"""60 by each number but 0."""
_PARTS_FIT = 1 << 57
_FEW = 63
"""Divisors up to this have a reciprocal."""
_SHIFT = 24
_RECIPROCALS = np.array([0] + [(1 << _SHIFT) // count + 1 for count in range(1, _FEW + 1)])
"""``2**_SHIFT`` by each number, rounded up, or one more."""
FEW_TIMES = 1 << 18
"""Up to this many times a number up to ``_FEW``, too little is added by a rounded reciprocal to show."""


@inlined
def bits(x):
    """Bits of a number."""
    return bit_length(x)


@inlined
def mean(total, count):
    """``total // count`` of at most six numbers, 0 of none: dividing by a constant is faster than by what comes."""
    if abs(total) < _PARTS_FIT:
        return total * _PARTS[np.uint64(count)] // 60
    return total // max(count, 1)


@inlined
def by_few(x, count):
    """``x // count`` of x from 0 to ``FEW_TIMES - 1``, mostly without a division; of any x if count is large."""
    if count <= _FEW:
        return (x * _RECIPROCALS[np.uint64(count)]) >> _SHIFT
    return x // count


@inlined
def row_of(slot, known, size, negative):
    """Row, from a list's first on, for a candidate so far from where the parts are split."""
    # the bits of larger numbers are more than the last class's, too
    of_size = min(bits(size), CLASSES - 1)
    return (2 * slot + (known == FINE)) * 2 * CLASSES + of_size + CLASSES * np.int64(negative)
