"""Simplices of the mesh: parents, children, middles, and which of them the box leaves (spec clauses 4.3, 4.6)."""

from __future__ import annotations

from typing import NamedTuple

from ...kernel import inlined, inner
from ...kernel.types import Integer
from .access import child, dimension, grandchild, member, middle, vertex
from .access import kind as kind_of
from .access import members as member_count
from .grid import clamped, cycle_of, edge_of, phase_of, position


class Simplex(NamedTuple):
    """A simplex: its level, its class, and the block that it lies in."""

    level: Integer
    cls: Integer
    b0: Integer
    b1: Integer
    b2: Integer


@inlined
def newest(n, r):
    """Number of the vertex of a simplex that the bisection of its parent added."""
    return 1 if r == 0 else n - r + 1


@inner
def middle_at(grid, level, cls, b0, b1, b2):
    """Unclamped position of the middle of a simplex's subdivision edge."""
    edge = edge_of(grid, level)
    w0, w1, w2 = middle(grid.tables, phase_of(dimension(grid.tables), level), cls, b0, b1, b2)
    return (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1


@inlined
def _corner(grid, edge, r, cls, b0, b1, b2, j):
    """Position of vertex j on the sampled box."""
    x, y, z = position(edge, b0, b1, b2, vertex(grid.tables, r, cls, j))
    return clamped(grid, x, y, z)


@inlined
def exists(grid, edge, r, cls, b0, b1, b2):
    """Whether the clamped image of a simplex has positive volume (spec clause 4.6); ``edge`` is its cubes'."""
    n = dimension(grid.tables)
    inside = min(b0, b1, b2) >= 0 and 2 * (b0 + 1) * edge <= grid.last0 and 2 * (b1 + 1) * edge <= grid.last1
    if inside and (n == 2 or 2 * (b2 + 1) * edge <= grid.last2):
        return True
    x, y, z = _corner(grid, edge, r, cls, b0, b1, b2, 0)
    a0, a1, a2 = _corner(grid, edge, r, cls, b0, b1, b2, 1)
    b0_, b1_, b2_ = _corner(grid, edge, r, cls, b0, b1, b2, 2)
    a0, a1, a2 = a0 - x, a1 - y, a2 - z
    b0_, b1_, b2_ = b0_ - x, b1_ - y, b2_ - z
    if n == 2:
        return a0 * b1_ - a1 * b0_ != 0
    c0, c1, c2 = _corner(grid, edge, r, cls, b0, b1, b2, 3)
    c0, c1, c2 = c0 - x, c1 - y, c2 - z
    return a0 * (b1_ * c2 - b2_ * c1) - a1 * (b0_ * c2 - b2_ * c0) + a2 * (b0_ * c1 - b1_ * c0) != 0


@inlined
def child_of(grid, level, cls, b0, b1, b2, side):
    """Class and block of a child, and whether it exists."""
    n = dimension(grid.tables)
    r = phase_of(n, level)
    q, d0, d1, d2 = child(grid.tables, r, cls, side)
    f = 2 if r == n - 1 else 1
    c0, c1, c2 = b0 * f + d0, b1 * f + d1, b2 * f + d2
    return q, c0, c1, c2, exists(grid, edge_of(grid, level + 1), phase_of(n, level + 1), q, c0, c1, c2)


@inlined
def parent_of(grid, level, cls, b0, b1, b2):
    """Class and block of the parent of a simplex, and which child it is."""
    n = dimension(grid.tables)
    r = phase_of(n, level - 1)
    f = 2 if r == n - 1 else 1
    phase = phase_of(n, level)
    z = position(edge_of(grid, level), b0, b1, b2, vertex(grid.tables, phase, cls, newest(n, phase)))
    up = grid.exponent - cycle_of(n, level - 1)
    w0, w1, w2 = (2 * z[0]) >> up, (2 * z[1]) >> up, (2 * z[2]) >> up
    kind = kind_of(grid.tables, r, w0, w1, w2)
    for m in range(member_count(grid.tables, kind)):
        for side in range(2):
            q, d0, d1, d2, _ = grandchild(grid.tables, kind, m, side)
            if q == cls and (w0 >> 2) * f + d0 == b0 and (w1 >> 2) * f + d1 == b1 and (w2 >> 2) * f + d2 == b2:
                other, d0, d1, d2, _ = member(grid.tables, kind, m)
                return other, (w0 >> 2) + d0, (w1 >> 2) + d1, (w2 >> 2) + d2, side
    return cls, b0, b1, b2, 0
