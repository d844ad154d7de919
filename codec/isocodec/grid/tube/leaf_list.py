"""Lists of mixed simplices: a row for a single leaf, or for all that the bisection of a diamond made (annex B.4).

Such rows are several times fewer than the simplices; taken one by one these come in the order of clause 5.4.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, kernel
from ...kernel.types import Int32Matrix
from ..lattice.access import dimension, factor, grandchild, twins
from .state import State

_KIND_BITS, _CHILD_BITS = 6, 16
_KIND, _CHILDREN = (1 << _KIND_BITS) - 1, (1 << _CHILD_BITS) - 1
"""A row is a class, its block and level, or, negative, kind and children of a diamond, the block of its middle and its
level. Children are bits, 2 m + s for child s of member m; a last bit is set if none of theirs lies at the border."""


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
    """How many of 16 bits are 1."""
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
    edge, box = st.counters.edge, st.grid
    # the children's own diamonds reach 2 g to all sides at most
    free = min(w0, w1) >= 2 and (w0 + 2) * edge <= 2 * box.last0 and (w1 + 2) * edge <= 2 * box.last1
    if dimension(st.grid.tables) == 3:
        free = free and w2 >= 2 and (w2 + 2) * edge <= 2 * box.last2
    code = kind | children << _KIND_BITS | np.int64(free) << (_KIND_BITS + _CHILD_BITS)
    _append(st, -1 - code, w0 >> 2, w1 >> 2, w2 >> 2, st.counters.level)
    st.counters.mixed += ones(children)


@inlined
def push_row(st, i):
    """Append a row of the present list as it is."""
    code = np.int64(st.leaf[i, 0])
    _append(st, code, st.leaf[i, 1], st.leaf[i, 2], st.leaf[i, 3], st.leaf[i, 4])
    st.counters.mixed += 1 if code >= 0 else ones(unpacked(code)[1])


@inlined
def unpacked(code):
    """Kind and children of a diamond's row, and whether no child's diamond lies at the border."""
    code = -1 - code
    return code & _KIND, (code >> _KIND_BITS) & _CHILDREN, code >> (_KIND_BITS + _CHILD_BITS) != 0


@inlined
def child_at(t, kind, c, b0, b1, b2):
    """Class and block of child c, 2 m + s, of a diamond with its middle in block b."""
    cls, d0, d1, d2, _ = grandchild(t, kind, c >> 1, c & 1)
    f = factor(t, kind)
    return cls, b0 * f + d0, b1 * f + d1, b2 * f + d2


@inlined
def next_leaf(st):
    """The next leaf of the list: class, block and level, which is negative if the row at hand has no other.

    Of a diamond's children in a uniform round those are passed over whose middle is that of one before.
    """
    i, c = st.counters.done_leaves, st.counters.child
    row = st.leaf[np.uint64(i)]
    code, level = np.int64(row[0]), np.int64(row[4])
    b0, b1, b2 = np.int64(row[1]), np.int64(row[2]), np.int64(row[3])
    if code >= 0:
        return code, b0, b1, b2, level
    kind, children, free = unpacked(code)
    free = free and not st.counters.asks
    while children >> c and (not children >> c & 1 or (free and children & twins(st.grid.tables, kind, c))):
        c += 1
    st.counters.child = c
    if not children >> c:
        row_done(st)
        return code, b0, b1, b2, np.int64(-1)
    cls, b0, b1, b2 = child_at(st.grid.tables, kind, c, b0, b1, b2)
    return cls, b0, b1, b2, level + 1


@inlined
def row_done(st):
    """Go on to the next row."""
    st.counters.done_leaves += 1
    st.counters.child = 0


@inlined
def leaf_done(st):
    """Go on to the next leaf."""
    if st.leaf[np.uint64(st.counters.done_leaves), 0] >= 0:
        row_done(st)
    else:
        st.counters.child += 1


@kernel
def _one_by_one(st: State, out: Int32Matrix) -> None:
    """The simplices of the list in their order, as rows of class, block and level."""
    count = 0
    for i in range(st.counters.leaves):
        code, level = np.int64(st.leaf[i, 0]), np.int64(st.leaf[i, 4])
        b0, b1, b2 = np.int64(st.leaf[i, 1]), np.int64(st.leaf[i, 2]), np.int64(st.leaf[i, 3])
        if code >= 0:
            out[count, 0], out[count, 1], out[count, 2], out[count, 3], out[count, 4] = code, b0, b1, b2, level
            count += 1
            continue
        kind, children, _ = unpacked(code)
        c = np.int64(0)
        while children >> c:
            if children >> c & 1:
                cls, d0, d1, d2 = child_at(st.grid.tables, kind, c, b0, b1, b2)
                out[count, 0], out[count, 1], out[count, 2], out[count, 3], out[count, 4] = cls, d0, d1, d2, level + 1
                count += 1
            c += 1


def one_by_one(st: State) -> NDArray[np.int32]:
    """The mixed simplices of a mesh in their order: class, block and level, (M, 5)."""
    out = np.empty((int(st.counters.held), 5), np.int32)
    _one_by_one(st, out)
    return out
