"""Encoder only: the next component's first simplex in the order of the forest (spec clause 5.3.2).

The search descends into cubes that the curve passes only, so that its cost follows the curve.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit import inner
from ..mesh.access import child, cube, dimension, roots
from ..mesh.access import root as root_class
from ..mesh.store import get
from .state import BASE_LEVEL, EDGE, SCRATCH, corner_truth, exists


def build_pyramid(
    truth: NDArray[np.bool_], last: NDArray[np.int64], k: int, level: int, n: int
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """For the cubes of every size from the root's to those of ``level``: does the mesh see both signs in them?

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
    index = [np.minimum(np.arange(cubes[a] * per + 1) * step, last[a]) if a < n else np.zeros(1, int) for a in range(3)]
    samples = truth[np.ix_(*index)]
    some, every = samples, samples
    for a in range(n):
        parts_some = [np.take(some, np.arange(cubes[a]) * per + i, axis=a) for i in range(per + 1)]
        parts_every = [np.take(every, np.arange(cubes[a]) * per + i, axis=a) for i in range(per + 1)]
        some = np.logical_or.reduce(parts_some)
        every = np.logical_and.reduce(parts_every)
    flags = [(some & ~every).astype(np.uint8)]
    shapes = [some.shape]
    for _ in range(m):
        pad = [(0, some.shape[a] % 2) if a < n else (0, 0) for a in range(3)]
        some = np.pad(some, pad, mode="edge")
        every = np.pad(every, pad, mode="edge")
        for a in range(n):
            even = [slice(None)] * 3
            odd = [slice(None)] * 3
            even[a], odd[a] = slice(0, None, 2), slice(1, None, 2)
            some = some[tuple(even)] | some[tuple(odd)]
            every = every[tuple(even)] & every[tuple(odd)]
        flags.append((some & ~every).astype(np.uint8))
        shapes.append(some.shape)
    flags.reverse()
    shapes.reverse()
    starts = np.cumsum([0] + [f.size for f in flags[:-1]])
    layout = np.array([[s, *shape] for s, shape in zip(starts, shapes, strict=True)], np.int64)
    return np.concatenate([f.ravel() for f in flags]), layout


# Registers in State.walk, beside those of passes.base: whether the search has begun, and what it found last (the
# root and one side per level); FOUND and the running search's TRACE hold one side per level.
SEEKING, FOUND_ROOT, FOUND = 12, 13, 128
_TRACE = SCRATCH + 16
_NODE = 6


@inner
def _mixed_cube(pyramid, levels, m, x, y, z):
    row = levels[m]
    if x >= row[1] or y >= row[2] or z >= row[3]:
        return False
    return pyramid[row[0] + (x * row[2] + y) * row[3] + z] != 0


@inner
def _mixed_leaf(st, r, cls, b0, b1, b2):
    e = st.at[EDGE]
    signs = 0
    for j in range(dimension(st.tables) + 1):
        signs |= 1 << corner_truth(st, e, r, cls, b0, b1, b2, j)
    return signs == 3


@inner
def seek(st, mark, pyramid, levels):
    """Go on to the next mixed, unvisited simplex; True if there is one (its path is left in the registers).

    The search stack lies in ``State.stack``, which the traversal uses only while the search rests: it is
    kept as the path itself, and rebuilt by going on right of it.
    """
    n = dimension(st.tables)
    w = st.walk
    depth_all = st.at[BASE_LEVEL]
    root = 0
    resume = w[SEEKING] == 1
    if resume:
        root = w[FOUND_ROOT]
        for i in range(depth_all):
            w[_TRACE + i] = w[FOUND + i]
    while root < roots(st.tables):
        # nodes to visit of this root, deepest last
        size = np.int64(0)
        cls = root_class(st.tables, root)
        b0 = np.int64(0)
        b1 = np.int64(0)
        b2 = np.int64(0)
        stack = st.stack
        if resume:
            for depth in range(depth_all):
                r = depth % n
                f = 2 if r == n - 1 else 1
                if w[FOUND + depth] == 0:
                    right = np.int64(1)
                    q, d0, d1, d2 = child(st.tables, r, cls, right)
                    size = _push(stack, size, np.int64(depth + 1), q, b0 * f + d0, b1 * f + d1, b2 * f + d2, right)
                cls, d0, d1, d2 = child(st.tables, r, cls, w[FOUND + depth])
                b0 = b0 * f + d0
                b1 = b1 * f + d1
                b2 = b2 * f + d2
        else:
            size = _push(stack, size, np.int64(0), cls, b0, b1, b2, np.int64(0))
        resume = False
        while size > 0:
            size -= 1
            o = size * _NODE
            depth, cls, side = stack[o], stack[o + 1], stack[o + 5]
            b0, b1, b2 = stack[o + 2], stack[o + 3], stack[o + 4]
            if depth > 0:
                w[_TRACE + depth - 1] = side
            r = depth % n
            number, p0, p1, p2 = cube(st.tables, r, cls)
            x, y, z = 2 * b0 + p0, 2 * b1 + p1, 2 * b2 + p2
            if not _mixed_cube(pyramid, levels, depth // n, x, y, z):
                continue
            if depth == depth_all:
                if not exists(st, st.at[EDGE], r, cls, b0, b1, b2) or not _mixed_leaf(st, r, cls, b0, b1, b2):
                    continue
                if (get(mark, x, y, z) >> number) & 1:
                    continue
                w[FOUND_ROOT] = root
                for i in range(depth_all):
                    w[FOUND + i] = w[_TRACE + i]
                return True
            f = 2 if r == n - 1 else 1
            for s in range(1, -1, -1):
                q, d0, d1, d2 = child(st.tables, r, cls, s)
                size = _push(stack, size, depth + 1, q, b0 * f + d0, b1 * f + d1, b2 * f + d2, s)
        root += 1
    return False


@inner
def _push(stack, size, depth, cls, b0, b1, b2, side):
    o = size * _NODE
    stack[o] = depth
    stack[o + 1] = cls
    stack[o + 2] = b0
    stack[o + 3] = b1
    stack[o + 4] = b2
    stack[o + 5] = side
    return size + 1
