"""Closed sets of vertices: meshes between the root and the full grid, and marks of lattice points (spec clause 4.7)."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from ...kernel import inlined, record
from ...kernel.types import UInt8Volume
from .store import Flags, get, new_flags

IN, OUT, KEPT = 1, 2, 4
"""Marks of a lattice point: in the mesh; known not to be in it; kept in this layer."""
GONE = 1
"""Bit of a lattice point that is not a vertex of the mesh."""


@record
class Chosen(NamedTuple):
    """``inside`` has an entry for each sample, on three axes; ``outside`` those of lattice points off the box."""

    inside: UInt8Volume
    outside: Flags


def every_vertex(shape: tuple[int, ...]) -> Chosen:
    """The full grid: nothing is gone. ``shape`` has two or three axes."""
    return Chosen(np.zeros(shape + (1,) * (3 - len(shape)), np.uint8), new_flags(len(shape)))


@inlined
def flags(chosen, x, y, z):
    """Bits of the lattice point at unclamped (x, y, z)."""
    s0, s1, s2 = chosen.inside.shape
    if x < s0 and y < s1 and z < s2:
        return np.int64(chosen.inside[x, y, z])
    return get(chosen.outside, x, y, z)


@inlined
def has(chosen, x, y, z):
    """Whether the lattice point at unclamped (x, y, z) is a vertex of the mesh."""
    return not flags(chosen, x, y, z) & GONE


def finest_level(chosen: Chosen, k: int, n: int) -> int:
    """Greatest level of the mesh's vertices on the box, -1 without any; 2**k is the edge of the root cube."""
    shape = chosen.inside.shape
    for level in range(n * k - 1, -1, -1):
        g = 1 << (k - level // n - 1)
        odd = n - level % n
        for axes in combinations(range(n), odd):
            part = tuple(slice(g, None, 2 * g) if a in axes else slice(0, None, 2 * g) for a in range(n))
            if all(shape[a] > g or a not in axes for a in range(n)) and not (chosen.inside[part] & GONE).all():
                return level
    return -1
