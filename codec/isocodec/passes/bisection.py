"""Bisection: what is known around a middle, and the bisection of all its simplices (spec clause 5.4)."""

from __future__ import annotations

import numpy as np

from ..kernel import inlined, inner
from ..mesh.access import child_bits, corner, delta, dimension, grandchild
from ..mesh.access import corners as corner_count
from ..mesh.access import members as member_count
from ..mesh.diamond import existing
from ..mesh.grid import position
from ..mesh.simplex import exists
from ..mesh.store import page_with
from ..tube.leaf_list import push_children
from ..tube.state import entry, learn


@inner
def look(st, edge, r, kind, w0, w1, w2):
    """What ``existing`` says of a diamond, and bits of those corners that are known, and of the known ones above."""
    whole, members, corners = existing(st.grid, edge, r, kind, w0, w1, w2)
    b0, b1, b2 = w0 >> 2, w1 >> 2, w2 >> 2
    t = st.grid.tables
    known = np.int64(0)
    above = np.int64(0)
    if whole:
        g = edge >> 1
        x, y, z = w0 * g, w1 * g, w2 * g
        page, cell = page_with(st.known, x, y, z, g)
        if page >= 0:
            here = st.known.pages[np.uint64(page)]
            for i in range(corner_count(t, kind)):
                e = np.int64(here[np.uint64(cell + delta(t, kind, i) * g)])
                known |= np.int64(e != 0) << i
                above |= (e & 1) << i
            return whole, members, corners, known, above
    for i in range(corner_count(t, kind)):
        if (corners >> i) & 1:
            x, y, z = position(edge, b0, b1, b2, corner(t, kind, i))
            e = entry(st, x, y, z)
            if e != 0:
                known |= np.int64(1) << i
                above |= (e & 1) << i
    return whole, members, corners, known, above


@inner
def _corners_learn(st, kind, b0, b1, b2, whole, known, above, bits):
    """Make corners known that are not, in order; returns the bits of all that are."""
    fresh = bits & ~known
    i = np.int64(0)
    while fresh:
        if fresh & 1:
            x, y, z = position(st.counters.edge, b0, b1, b2, corner(st.grid.tables, kind, i))
            if whole or entry(st, x, y, z) == 0:
                learn(st, x, y, z, (above >> i) & 1)
        fresh >>= 1
        i += 1
    return known | bits


@inner
def bisect_member(st, r, kind, m, w0, w1, w2, whole, known, above):
    """Make the corners of a member's mixed children known. Returns the bits known after it, and those of the children.

    ``above`` holds the signs of all corners and the middle, inferred ones included.
    """
    edge = st.counters.edge
    t = st.grid.tables
    b0, b1, b2 = w0 >> 2, w1 >> 2, w2 >> 2
    children = np.int64(0)
    below = r + 1 if r + 1 < dimension(t) else 0
    f = 1 if below else 2
    for s in range(2):
        cls, d0, d1, d2, bits = grandchild(t, kind, m, s)
        signs = above & bits
        if signs == 0 or signs == bits:
            continue
        if not whole and not exists(st.grid, edge // f, below, cls, b0 * f + d0, b1 * f + d1, b2 * f + d2):
            continue
        known = _corners_learn(st, kind, b0, b1, b2, whole, known, above, bits)
        children |= np.int64(1) << (2 * m + s)
    return known, children


@inlined
def bisect(st, r, kind, w0, w1, w2, whole, members, known, above, sign):
    """Add the middle with its sign, and append the mixed children of all members, in order."""
    edge = st.counters.edge
    learn(st, (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1, sign)
    middle = np.int64(1) << corner_count(st.grid.tables, kind)
    known |= middle
    if sign:
        above |= middle
    children = np.int64(0)
    if whole:
        b0, b1, b2 = w0 >> 2, w1 >> 2, w2 >> 2
        for c in range(2 * member_count(st.grid.tables, kind)):
            bits = child_bits(st.grid.tables, kind, c)
            signs = above & bits
            if signs != 0 and signs != bits:
                if bits & ~known:
                    known = _corners_learn(st, kind, b0, b1, b2, True, known, above, bits)
                children |= np.int64(1) << c
        push_children(st, kind, w0, w1, w2, children)
        return
    for m in range(member_count(st.grid.tables, kind)):
        if (members >> m) & 1:
            known, more = bisect_member(st, r, kind, m, w0, w1, w2, whole, known, above)
            children |= more
    push_children(st, kind, w0, w1, w2, children)
