"""Bisection: what is known around a middle, and the bisection of all its simplices (spec clause 5.4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import inlined, inner
from ...kernel.types import Integer
from ..lattice.access import child_bits, delta, dimension, grandchild
from ..lattice.access import corners as corner_count
from ..lattice.access import members as member_count
from ..lattice.diamond import corner_position, existing, middle_position
from ..lattice.simplex import exists
from ..lattice.store import page_with
from ..tube.leaf_list import push_children
from ..tube.state import entry, learn


class Known(NamedTuple):
    """Known part of a diamond.

    Attributes
    ----------
    whole : bool
        Whether it lies wholly inside the box.
    members, corners : int
        Bits of its members that exist, and of their corners.
    known, above : int
        Bits of the corners that are known, and of the known ones above.
    """

    whole: bool
    members: Integer
    corners: Integer
    known: Integer
    above: Integer


@inner
def look(st, diamond):
    """Look up what is known of a diamond."""
    edge, kind = diamond.edge, diamond.kind
    w0, w1, w2 = diamond.w0, diamond.w1, diamond.w2
    whole, members, corners = existing(st.grid, edge, diamond.phase, kind, w0, w1, w2)
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
            return Known(whole, members, corners, known, above)
    for i in range(corner_count(t, kind)):
        if (corners >> i) & 1:
            x, y, z = corner_position(st.grid, diamond, i)
            e = entry(st, x, y, z)
            if e != 0:
                known |= np.int64(1) << i
                above |= (e & 1) << i
    return Known(whole, members, corners, known, above)


@inlined
def with_signs(seen, above):
    """Replace the signs of a diamond: inferred ones included."""
    return Known(seen.whole, seen.members, seen.corners, seen.known, above)


@inlined
def with_middle(st, diamond, seen, sign):
    """Add the middle of a diamond as known: its bit is the one after the last corner's."""
    middle = np.int64(1) << corner_count(st.grid.tables, diamond.kind)
    above = seen.above | middle if sign else seen.above
    return Known(seen.whole, seen.members, seen.corners, seen.known | middle, above)


@inner
def _corners_learn(st, diamond, whole, known, above, bits):
    """Make corners known that are not, in order; returns the bits of all that are."""
    fresh = bits & ~known
    i = np.int64(0)
    while fresh:
        if fresh & 1:
            x, y, z = corner_position(st.grid, diamond, i)
            if whole or entry(st, x, y, z) == 0:
                learn(st, x, y, z, (above >> i) & 1)
        fresh >>= 1
        i += 1
    return known | bits


@inner
def bisect_member(st, diamond, m, seen, known):
    """Make the corners of a member's mixed children known. Returns the bits known after it, and those of the children.

    ``known`` holds the bits of the corners known before it; the signs that were seen are those of all corners and the
    middle, inferred ones included.
    """
    t = st.grid.tables
    r, above = diamond.phase, seen.above
    b0, b1, b2 = diamond.w0 >> 2, diamond.w1 >> 2, diamond.w2 >> 2
    children = np.int64(0)
    below = r + 1 if r + 1 < dimension(t) else 0
    f = 1 if below else 2
    for s in range(2):
        cls, d0, d1, d2, bits = grandchild(t, diamond.kind, m, s)
        signs = above & bits
        if signs == 0 or signs == bits:
            continue
        if not seen.whole:
            c0, c1, c2 = b0 * f + d0, b1 * f + d1, b2 * f + d2
            if not exists(st.grid, diamond.edge // f, below, cls, c0, c1, c2):
                continue
        known = _corners_learn(st, diamond, seen.whole, known, above, bits)
        children |= np.int64(1) << (2 * m + s)
    return known, children


@inlined
def push_bisected(st, diamond, children):
    """Append children of a diamond, if there are any."""
    push_children(st, diamond.kind, diamond.w0, diamond.w1, diamond.w2, children)


@inlined
def bisect(st, diamond, seen, sign):
    """Add the middle with its sign, and append the mixed children of all members, in order."""
    x, y, z = middle_position(diamond)
    learn(st, x, y, z, sign)
    seen = with_middle(st, diamond, seen, sign)
    known, above, kind = seen.known, seen.above, diamond.kind
    children = np.int64(0)
    if seen.whole:
        for c in range(2 * member_count(st.grid.tables, kind)):
            bits = child_bits(st.grid.tables, kind, c)
            signs = above & bits
            if signs != 0 and signs != bits:
                if bits & ~known:
                    known = _corners_learn(st, diamond, True, known, above, bits)
                children |= np.int64(1) << c
        push_bisected(st, diamond, children)
        return
    for m in range(member_count(st.grid.tables, kind)):
        if (seen.members >> m) & 1:
            known, more = bisect_member(st, diamond, m, seen, known)
            children |= more
    push_bisected(st, diamond, children)
