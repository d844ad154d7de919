"""The cubes of a level, and the places of middles in them: slots (spec clause 5.5.2).

In a cube the middles differ in which of their coordinates (in units of g) are odd.
"""

from __future__ import annotations

from ...kernel import inlined
from .access import dimension
from .grid import edge_of, phase_of


@inlined
def slots(n, r):
    """Number of slots of a cube: middles have n - r odd coordinates."""
    return 1 if r == 0 else n


@inlined
def middle_of(n, r, x, y, z, slot):
    """Lattice point (units of g) of a slot: all odd, or the axis ``slot`` apart from the others (spec clause 5.5.2)."""
    if r == 0:
        return 2 * x + 1, 2 * y + 1, 2 * z + (1 if n == 3 else 0)
    # one odd axis (n - r == 1), or one even axis (n = 3, r == 1)
    here = 1 if n - r == 1 else 0
    there = 1 - here
    return (
        2 * x + (here if slot == 0 else there),
        2 * y + (here if slot == 1 else there),
        2 * z + ((here if slot == 2 else there) if n == 3 else 0),
    )


@inlined
def cubes(grid, level):
    """Cubes along each axis that hold a slot: one more than cover the box where slots lie on the lower faces."""
    n = dimension(grid.tables)
    edge = edge_of(grid, level)
    more = 0 if phase_of(n, level) == 0 else 1
    c0 = (grid.last0 + edge - 1) // edge + more
    c1 = (grid.last1 + edge - 1) // edge + more
    c2 = (grid.last2 + edge - 1) // edge + more if n == 3 else 1
    return c0, c1, c2


@inlined
def height(most):
    """Height of the tree over ``most`` cubes along the longest axis: the root's cube covers them all."""
    h = 0
    while (1 << h) < most:
        h += 1
    return h
