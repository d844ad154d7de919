"""Diamonds: the simplices around a middle, their corners, and the middles that made them (spec clauses 4.4, 4.6).

Corners are held as bits of an integer: 0 and 1 are the ends of the subdivision edge, the ring follows, and the bit
after the last corner is the middle itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import inlined, inner
from ...kernel.types import Integer
from .access import corner, dimension, member, vertex
from .access import corners as corner_count
from .access import kind as kind_of
from .access import members as member_count
from .grid import clamped, phase_of, position
from .simplex import exists, newest


class Diamond(NamedTuple):
    """The simplices of a level around a middle.

    Attributes
    ----------
    edge : int
        Of the cubes of the level.
    phase : int
        The level, modulo the dimension.
    kind : int
        See ``lattice.tables``.
    w0, w1, w2 : int
        The middle, in units of g.
    """

    edge: Integer
    phase: Integer
    kind: Integer
    w0: Integer
    w1: Integer
    w2: Integer


@inlined
def diamond_at(grid, edge, r, w0, w1, w2):
    """The diamond around a middle."""
    return Diamond(edge, r, kind_of(grid.tables, r, w0, w1, w2), w0, w1, w2)


@inlined
def middle_position(diamond):
    """Unclamped position of the middle."""
    edge = diamond.edge
    return (diamond.w0 * edge) >> 1, (diamond.w1 * edge) >> 1, (diamond.w2 * edge) >> 1


@inlined
def corner_position(grid, diamond, i):
    """Unclamped position of corner i."""
    w0, w1, w2 = diamond.w0, diamond.w1, diamond.w2
    return position(diamond.edge, w0 >> 2, w1 >> 2, w2 >> 2, corner(grid.tables, diamond.kind, i))


@inlined
def coincident(grid, edge, kind, corners, w0, w1, w2):
    """Whether the middle falls on one of the corners after clamping: no vertex is added then (spec clause 4.6)."""
    t = grid.tables
    here = clamped(grid, (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1)
    for i in range(corner_count(t, kind)):
        if (corners >> i) & 1:
            x, y, z = position(edge, w0 >> 2, w1 >> 2, w2 >> 2, corner(t, kind, i))
            x, y, z = clamped(grid, x, y, z)
            if x == here[0] and y == here[1] and z == here[2]:
                return True
    return False


@inlined
def inside(grid, edge, w0, w1, w2):
    """Whether the diamond around a middle lies wholly inside the box: it reaches g to all sides."""
    if min(w0, w1) < 1 or (w0 + 1) * edge > 2 * grid.last0 or (w1 + 1) * edge > 2 * grid.last1:
        return False
    return dimension(grid.tables) == 2 or (w2 >= 1 and (w2 + 1) * edge <= 2 * grid.last2)


@inner
def existing(grid, edge, r, kind, w0, w1, w2):
    """Whether a diamond lies wholly inside the box, and bits of its members that exist and of their corners."""
    t = grid.tables
    members = (np.int64(1) << member_count(t, kind)) - 1
    corners = (np.int64(1) << corner_count(t, kind)) - 1
    if inside(grid, edge, w0, w1, w2):
        return True, members, corners
    members = np.int64(0)
    corners = np.int64(0)
    for m in range(member_count(t, kind)):
        cls, d0, d1, d2, bits = member(t, kind, m)
        if exists(grid, edge, r, cls, (w0 >> 2) + d0, (w1 >> 2) + d1, (w2 >> 2) + d2):
            members |= np.int64(1) << m
            corners |= bits
    return False, members, corners


@inlined
def parent(t, level, edge, kind, m, w0, w1, w2):
    """Unclamped position of the middle whose bisection made member m of the diamond around w."""
    r = phase_of(dimension(t), level)
    cls, d0, d1, d2, _ = member(t, kind, m)
    newest_vertex = vertex(t, r, cls, newest(dimension(t), r))
    return position(edge, (w0 >> 2) + d0, (w1 >> 2) + d1, (w2 >> 2) + d2, newest_vertex)
