"""Bisection: what is known around a middle, and the bisection of all its simplices (spec clause 5.4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import inlined, inner
from ...kernel.bit_length import bit_length
from ...kernel.types import Integer
from ..lattice.access import child_bits, delta, dimension, factor
from ..lattice.access import corners as corner_count
from ..lattice.access import members as member_count
from ..lattice.diamond import corner_position, existing
from ..lattice.grid import clamped
from ..lattice.simplex import exists
from ..lattice.store import PAGES_AROUND, get_around, page_with, pages_around, reaches_two, spot
from ..tube.leaf_list import child_at, push_children
from ..tube.state import entry, learn_at


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
        if reaches_two(st.known, g):
            near = st.scratch[:PAGES_AROUND]
            pages_around(st.known, x, y, z, g, g if dimension(t) == 3 else 0, near)
            for i in range(corner_count(t, kind)):
                e = get_around(st.known, near, *corner_position(st.grid, diamond, i))
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


@inlined
def _corners_learn(st, diamond, above, fresh):
    """Make corners known that are not, in order; False if one became known with another sign since it was looked up."""
    agree = True
    while fresh != 0:
        i = bit_length(fresh & -fresh) - 1
        fresh &= fresh - 1
        x, y, z = clamped(st.grid, *corner_position(st.grid, diamond, i))
        page, cell = spot(st.known, x, y, z)
        e = np.int64(st.known.pages[np.uint64(page), np.uint64(cell)])
        if e == 0:
            learn_at(st, page, cell, x, y, z, (above >> i) & 1)
        elif (e ^ above >> i) & 1:
            agree = False
    return agree


@inlined
def _exists(st, diamond, c):
    """Whether child c, 2 m + s, of a diamond exists."""
    t = st.grid.tables
    below = diamond.phase + 1 if diamond.phase + 1 < dimension(t) else 0
    f = factor(t, diamond.kind)
    cls, c0, c1, c2 = child_at(t, diamond.kind, c, diamond.w0 >> 2, diamond.w1 >> 2, diamond.w2 >> 2)
    return exists(st.grid, diamond.edge >> (f - 1), below, cls, c0, c1, c2)


@inner
def bisect(st, diamond, seen):
    """Append the mixed children of all members, and make their vertices known (clauses 5.4.3, 5.5.4).

    ``seen`` has the middle and the assumed signs. False if two diamonds give a corner different signs.
    """
    t = st.grid.tables
    above = seen.above
    children, corners = np.int64(0), np.int64(0)
    if seen.whole:
        # which children are mixed is as good as random: no branches
        for c in range(2 * member_count(t, diamond.kind)):
            bits = child_bits(t, diamond.kind, c)
            mixed = np.int64((above & bits != 0) & (~above & bits != 0))
            children |= mixed << c
            corners |= bits & -mixed
    else:
        for c in range(2 * member_count(t, diamond.kind)):
            bits = child_bits(t, diamond.kind, c)
            if above & bits != 0 and ~above & bits != 0 and seen.members >> (c >> 1) & 1 and _exists(st, diamond, c):
                children |= np.int64(1) << c
                corners |= bits
    agree = _corners_learn(st, diamond, above, corners & ~seen.known)
    push_children(st, diamond.kind, diamond.w0, diamond.w1, diamond.w2, children)
    return agree
