"""Classes of numbers, for contexts and rows: how many binary digits they have (spec clause 7.14); means of a few."""

from __future__ import annotations

import numpy as np

from ..jit import inner

CLASSES = 13
"""Classes of sizes that rows tell apart, on either side."""
NONE, ROUGH, FINE = range(3)
"""How well something is known: not, only in part, as well as may be."""
_AT_ONCE = 13
"""Bits of a number that are counted by one look into ``_BITS``."""
_BITS = np.array([x.bit_length() for x in range(1 << _AT_ONCE)], np.int8)


@inner
def bits(x):
    """Bits of a number."""
    count = np.int64(0)
    while x >> _AT_ONCE:
        x >>= _AT_ONCE
        count += _AT_ONCE
    return count + _BITS[x]


@inner
def mean(total, count):
    """``total // count`` of a few numbers: a division by one that is not constant takes longer than all of this."""
    if count == 1 or count == 2 or count == 4:
        return total >> (count >> 1)
    if count == 3:
        return total // 3
    return total // 5 if count == 5 else total // count


@inner
def row_of(slot, known, size, negative):
    """Row, from a list's first on, for a candidate so far from where the parts are split."""
    return (2 * slot + (known == FINE)) * 2 * CLASSES + min(bits(size), CLASSES - 1) + (CLASSES if negative else 0)
