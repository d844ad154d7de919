"""The sampled box, the root cube around it, and places on its lattice (spec clauses 4.1, 4.6)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import inlined, record
from ...kernel.types import Int16Vector
from .access import dimension
from .tables import AXES, cube_exponent, mesh_tables


@record
class Grid(NamedTuple):
    """A mesh over a box of samples: all that its geometry depends on.

    Attributes
    ----------
    tables : int16
        Of the mesh, see `lattice.access`.
    last0, last1, last2 : int
        Largest sample index along each axis, 0 along a third one of a plane.
    exponent : int
        The root cube's edge is the power of two with this exponent.
    """

    tables: Int16Vector
    last0: int
    last1: int
    last2: int
    exponent: int


def grid_of(shape: tuple[int, ...]) -> Grid:
    """The mesh over a field of a shape."""
    last0, last1, last2 = (size - 1 for size in shape + (1,) * (AXES - len(shape)))
    return Grid(mesh_tables(len(shape)), last0, last1, last2, cube_exponent(shape))


@inlined
def clamped(grid, x, y, z):
    """Position on the sampled box (spec clause 4.6)."""
    return min(max(x, 0), grid.last0), min(max(y, 0), grid.last1), min(max(z, 0), grid.last2)


@inlined
def cycle_of(n, level):
    """Level // n, without a division, which takes as long as much else of a step."""
    return level >> 1 if n == 2 else (level * 171) >> 9


@inlined
def phase_of(n, level):
    """Level modulo n."""
    return level - n * cycle_of(n, level)


@inlined
def edge_of(grid, level):
    """Edge of the cubes of a level."""
    return np.int64(1) << (grid.exponent - cycle_of(dimension(grid.tables), level))


@inlined
def at(edge, block, offset):
    """Coordinate of a lattice point given in units of g = edge / 2 relative to a block."""
    return ((4 * block + offset) * edge) >> 1


@inlined
def position(edge, b0, b1, b2, offset):
    """Unclamped position of a lattice point given in units of g relative to a block."""
    return at(edge, b0, offset[0]), at(edge, b1, offset[1]), at(edge, b2, offset[2])


@inlined
def lattice(grid, level, x, y, z):
    """Unclamped position in units of g of a level."""
    shift = grid.exponent - cycle_of(dimension(grid.tables), level)
    return (2 * x) >> shift, (2 * y) >> shift, (2 * z) >> shift


@inlined
def level_at(grid, x, y, z):
    """Level of the middle at unclamped (x, y, z); -1 for a corner of the root cube."""
    low = x | y | z
    if low == 0:
        return np.int64(-1)
    depth = np.int64(0)
    while not (low >> depth) & 1:
        depth += 1
    if depth >= grid.exponent:
        return np.int64(-1)
    odd = ((x >> depth) & 1) + ((y >> depth) & 1) + ((z >> depth) & 1)
    return dimension(grid.tables) * (grid.exponent - depth) - odd
