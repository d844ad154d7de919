"""Encoder only: the mixed leaves of the mesh in the order of the forest, where components begin (spec clause 5.3.2).

The search descends into cubes that the curve passes only, so that its cost follows the curve.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.access import child, cube, dimension, roots
from ..grid.lattice.access import root as root_class
from ..grid.lattice.grid import edge_of
from ..grid.lattice.path import _ROOT_SHIFT
from ..grid.lattice.simplex import exists, middle_at
from ..grid.lattice.store import get
from ..grid.lattice.vertex_set import has
from ..grid.tube.state import State, corner_truth
from ..kernel import inner, kernel
from ..kernel.types import IntMatrix, IntVector, UInt8Vector


def build_pyramid(
    truth: NDArray[np.bool_], last: NDArray[np.int64], k: int, level: int, n: int
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Find which cubes of every size, from the root's to those of ``level``, hold both signs of the mesh.

    Parameters
    ----------
    truth : (s0, s1, s2) bool
        Signs of the field, padded to three axes.
    last : (3,) int64
        Largest index along each axis.

    Returns
    -------
    mixed : (total,) uint8
        One flag a cube, sizes one after the other, the largest first.
    layout : (levels, 4) int64
        Where each size starts, and its number of cubes along each axis.
    """
    m = level // n
    edge = 1 << (k - m)
    step = edge if level % n == 0 else max(edge // 2, 1)
    per = edge // step
    cubes = [max(-(-int(last[a]) // edge), 1) if a < n else 1 for a in range(3)]
    shapes = [tuple(-(-c // (1 << i)) if a < n else 1 for a, c in enumerate(cubes)) for i in range(m, -1, -1)]
    starts = np.cumsum([0, *map(math.prod, shapes)])
    layout = np.array([[s, *shape] for s, shape in zip(starts[:-1], shapes, strict=True)], np.int64)
    mixed = np.empty(starts[-1], np.uint8)

    index = [np.minimum(np.arange(cubes[a] * per + 1) * step, last[a]) for a in range(n)]
    some = truth
    for a in range(n):
        # of the finest mesh that is all there is
        if not np.array_equal(index[a], np.arange(truth.shape[a])):
            some = some.take(index[a], axis=a)
    every = some
    for a in range(n):
        some, every = _gathered(some, every, a, cubes[a], per, per + 1)
    for i in range(m, -1, -1):
        np.greater(some, every, out=mixed[starts[i] : starts[i + 1]].reshape(shapes[i]))
        for a in range(n if i else 0):
            some, every = _gathered(some, every, a, shapes[i - 1][a], 2, 2)
    return mixed, layout


def _gathered(
    some: NDArray[np.bool_], every: NDArray[np.bool_], axis: int, count: int, step: int, width: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Along an axis, for each of ``count`` groups of ``width`` entries from every ``step`` on: is one True, are all?"""

    def every_step(first: int) -> tuple[slice, ...]:
        return (slice(None),) * axis + (slice(first, first + (count - 1) * step + 1, step),)

    any_of, all_of = some[every_step(0)].copy(), every[every_step(0)].copy()
    for i in range(1, width):
        more, still = some[every_step(i)], every[every_step(i)]
        # the last group may have fewer
        there = (slice(None),) * axis + (slice(more.shape[axis]),)
        any_of[there] |= more
        all_of[there] &= still
    return any_of, all_of


_NODE = 6


@inner
def _mixed_cube(pyramid, levels, m, x, y, z):
    if m >= len(levels):
        return True
    row = levels[m]
    if x >= row[1] or y >= row[2] or z >= row[3]:
        return False
    return pyramid[row[0] + (x * row[2] + y) * row[3] + z] != 0


@inner
def _mixed_leaf(st, level, cls, b0, b1, b2):
    signs = 0
    for j in range(dimension(st.grid.tables) + 1):
        signs |= 1 << corner_truth(st, edge_of(st.grid, level), level % dimension(st.grid.tables), cls, b0, b1, b2, j)
    return signs == 3


@inner
def is_split(st, level, cls, b0, b1, b2):
    """Encoder: whether the mesh goes on below a simplex."""
    if level < st.counters.uniform:
        return True
    if level >= st.counters.finest:
        return False
    x, y, z = middle_at(st.grid, level, cls, b0, b1, b2)
    if st.counters.told:
        return get(st.mesh, x, y, z) != 0
    return has(st.chosen, x, y, z)


@kernel
def mixed_leaves(st: State, pyramid: UInt8Vector, levels: IntMatrix, out: IntVector) -> int:
    """All mixed leaves in the order of the forest, packed; fills ``out`` as far as it goes and returns their number."""
    n = dimension(st.grid.tables)
    stack = st.stack
    zero = np.int64(0)
    count = 0
    for root in range(roots(st.grid.tables)):
        size = _push(stack, zero, zero, root_class(st.grid.tables, root), zero, zero, zero, zero + 1)
        while size > 0:
            size -= 1
            o = size * _NODE
            depth, cls, path = stack[o], stack[o + 1], stack[o + 5]
            b0, b1, b2 = stack[o + 2], stack[o + 3], stack[o + 4]
            r = depth % n
            _, p0, p1, p2 = cube(st.grid.tables, r, cls)
            if not _mixed_cube(pyramid, levels, depth // n, 2 * b0 + p0, 2 * b1 + p1, 2 * b2 + p2):
                continue
            if not is_split(st, depth, cls, b0, b1, b2):
                if exists(st.grid, edge_of(st.grid, depth), r, cls, b0, b1, b2) and _mixed_leaf(
                    st, depth, cls, b0, b1, b2
                ):
                    if count < len(out):
                        out[count] = np.int64(root) << _ROOT_SHIFT | path
                    count += 1
                continue
            f = 2 if r == n - 1 else 1
            for s in range(1, -1, -1):
                q, d0, d1, d2 = child(st.grid.tables, r, cls, s)
                size = _push(stack, size, depth + 1, q, b0 * f + d0, b1 * f + d1, b2 * f + d2, path << 1 | s)
    return count


@inner
def _push(stack, size, depth, cls, b0, b1, b2, path):
    o = size * _NODE
    stack[o] = depth
    stack[o + 1] = cls
    stack[o + 2] = b0
    stack[o + 3] = b1
    stack[o + 4] = b2
    stack[o + 5] = path
    return size + 1
