"""Lists of mixed simplices: a row for a single leaf, or for all that the bisection of a diamond made."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, kernel
from ...kernel.types import Int32Matrix
from ..lattice.access import factor, grandchild
from .state import State

_KIND_BITS, _CHILD_BITS = 6, 16
_KIND, _CHILDREN = (1 << _KIND_BITS) - 1, (1 << _CHILD_BITS) - 1
"""A row is a class, its block and level, or, negative, kind and children of a diamond, the block of its middle and its
level. Children are bits, 2 m + s for child s of member m."""


@inlined
def _append(st, code, b0, b1, b2, level):
    i = st.counters.next
    row = st.below[np.uint64(i)]
    row[0] = code
    row[1] = b0
    row[2] = b1
    row[3] = b2
    row[4] = level
    st.counters.next = i + 1


@inlined
def ones(bits):
    """Number of ones among 16 bits."""
    bits -= bits >> 1 & 0x5555
    bits = (bits & 0x3333) + (bits >> 2 & 0x3333)
    bits = bits + (bits >> 4) & 0x0F0F
    return bits + (bits >> 8) & 31


@inlined
def push(st, cls, b0, b1, b2, level):
    """Append a simplex to the list that the round makes."""
    _append(st, cls, b0, b1, b2, level)
    st.counters.mixed += 1


@inlined
def push_children(st, kind, w0, w1, w2, children):
    """Append children of the diamond around w, of the present level, if there are any."""
    if children == 0:
        return
    _append(st, -1 - (kind | children << _KIND_BITS), w0 >> 2, w1 >> 2, w2 >> 2, st.counters.level)
    st.counters.mixed += ones(children)


@inlined
def push_row(st, i):
    """Append a row of the present list as it is."""
    code = np.int64(st.leaf[i, 0])
    _append(st, code, st.leaf[i, 1], st.leaf[i, 2], st.leaf[i, 3], st.leaf[i, 4])
    st.counters.mixed += 1 if code >= 0 else ones(unpacked(code)[1])


@inlined
def level_of(code, level):
    """Level of the simplices of a row."""
    return level if code >= 0 else level + 1


@inlined
def unpacked(code):
    """Kind and children of a diamond's row."""
    code = -1 - code
    return code & _KIND, (code >> _KIND_BITS) & _CHILDREN


@inlined
def child_at(t, kind, c, b0, b1, b2):
    """Class and block of child c, 2 m + s, of a diamond with its middle in block b."""
    cls, d0, d1, d2, _ = grandchild(t, kind, c >> 1, c & 1)
    f = factor(t, kind)
    return cls, b0 * f + d0, b1 * f + d1, b2 * f + d2


@kernel
def _one_by_one(st: State, out: Int32Matrix) -> int:
    """List the simplices as rows of class, block and level; how many these are."""
    count = 0
    for i in range(st.counters.leaves):
        code, level = np.int64(st.leaf[i, 0]), np.int64(st.leaf[i, 4])
        b0, b1, b2 = np.int64(st.leaf[i, 1]), np.int64(st.leaf[i, 2]), np.int64(st.leaf[i, 3])
        if code >= 0:
            out[count, 0], out[count, 1], out[count, 2], out[count, 3], out[count, 4] = code, b0, b1, b2, level
            count += 1
            continue
        kind, children = unpacked(code)
        c = np.int64(0)
        while children >> c:
            if children >> c & 1:
                cls, d0, d1, d2 = child_at(st.grid.tables, kind, c, b0, b1, b2)
                out[count, 0], out[count, 1], out[count, 2], out[count, 3], out[count, 4] = cls, d0, d1, d2, level + 1
                count += 1
            c += 1
    return count


def one_by_one(st: State) -> NDArray[np.int32]:
    """The mixed simplices of a mesh: class, block and level, (M, 5)."""
    out = np.empty((int(st.counters.held), 5), np.int32)
    return out[: _one_by_one(st, out)]
