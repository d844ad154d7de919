"""Inference of vertices without a symbol: as the curve does not pass, or by an earlier isovalue (5.5.4, 5.9)."""

from __future__ import annotations

import numpy as np

from ...kernel import inlined
from ..lattice.access import dimension
from ..lattice.grid import clamped, edge_of, level_at, phase_of
from .ranks import number_at
from .state import FRAME, entry


@inlined
def infer(st, x, y, z):
    """Sign of a vertex of the mesh that is not known: that of the first known vertex on the way back (clause 5.5.4).

    Above the base level the way leads to an end of the edge that the vertex was created on; on the cubes of the
    base level along their edges towards the origin, axis by axis, or by their centres where the base has cut them.
    That is the sign wherever all meshes on the way were decoded level by level, and nearly always in adaptive meshes.
    -1 when the limit of steps is reached.
    """
    coarse = edge_of(st.grid, st.counters.base_level)
    n = dimension(st.grid.tables)
    phase = phase_of(n, st.counters.base_level)
    while st.counters.work < st.counters.most_work:
        st.counters.work += 1
        e = entry(st, x, y, z)
        if e != 0:
            return e & 1
        # finest power of two that all coordinates are a multiple of
        low = x | y | z
        unit = low & -low
        odd = ((x & unit) + (y & unit) + (z & unit)) // max(unit, 1)
        if 2 * unit == coarse and odd > n - phase:
            # a centre of the base: to the lowest corner
            x -= x & unit
            y -= y & unit
            z -= z & unit
        elif unit < coarse:
            # created in cubes of edge 2 * unit, on a diagonal of the odd coordinates: its end at multiples of 4 units
            if x & unit:
                x += unit if x & (2 * unit) else -unit
            if y & unit:
                y += unit if y & (2 * unit) else -unit
            if z & unit:
                z += unit if z & (2 * unit) else -unit
        elif phase > 0:
            half = coarse >> 1
            x += -half if x > 0 else half
            y += -half if y > 0 else half
            if n == 3:
                z += -half if z > 0 else half
        elif x > 0:
            x -= coarse
        elif y > 0:
            y -= coarse
        else:
            z -= coarse
    return np.int64(-1)


@inlined
def earlier(st, x, y, z):
    """Sign of a vertex at the earlier isovalue that this one leans on, or -1; whether it is certain.

    It is inferred for the clamped image, as a separate vertex: edges off the box may belong to no existing simplex.
    """
    e = entry(st.lean, x, y, z)
    if e != 0:
        return e & 1, True
    x, y, z = clamped(st.grid, x, y, z)
    if level_at(st.grid, x, y, z) < st.lean.counters.uniform:
        return infer(st.lean, x, y, z), st.lean.counters.adapted == 0
    return np.int64(-1), False


@inlined
def implied(st, x, y, z):
    """Sign of a vertex that follows from the earlier isovalue, or -1; its sign there, or -1 (spec clause 5.9.3)."""
    side = st.counters.side
    unknown = np.int64(-1)
    if side == 0:
        return unknown, unknown
    other, certain = earlier(st, x, y, z)
    if side == FRAME or other < 0 or not certain:
        return unknown, other
    if side > 0 and other == 0:
        return np.int64(0), other
    if side < 0 and other == 1:
        return np.int64(1), other
    if len(st.lean.number) == 0:
        return unknown, other
    v = number_at(st.lean.numbers, *clamped(st.grid, x, y, z))
    if 0 <= v < len(st.lean.number) and st.lean.left[v] < st.lean.value_bits[other]:
        # the interval of its value, in steps above the earlier isovalue (of integers, above its floor)
        low = st.lean.number[v] << st.lean.left[v]
        high = ((st.lean.number[v] + 1) << st.lean.left[v]) - 1
        if other == 0:
            low, high = -high, -low
        else:
            low, high = low + 1, high + 1
        if low > st.counters.up:
            return np.int64(1), other
        if high <= st.counters.down:
            return np.int64(0), other
    return unknown, other
