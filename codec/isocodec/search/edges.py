"""Crossings on edges of a coarse mesh, of the curve and as a decoder has them (spec clauses 5.7.2, 5.7.3)."""

from __future__ import annotations

import numpy as np

from ..grid.passes.offsets import radix_of
from ..kernel import inner
from .reduced import EXACT_POINTS, LINEAR_POINTS


@inner
def _nearest(value):
    """Round to the nearest integer, halves to even, as numpy does."""
    low = np.floor(value)
    rest = value - low
    if rest > 0.5 or (rest == 0.5 and int(low) & 1):
        low += 1.0
    return int(low)


@inner
def crossing_on(dm, a, b):
    """The crossing in the middle of all on the edge from sample a to sample b, as a fraction of the way.

    The same as ``Field.crossings``, but for rounding.
    """
    length = max(abs(b[0] - a[0]), abs(b[1] - a[1]), abs(b[2] - a[2]))
    s0, s1, s2 = (b[0] - a[0]) / length, (b[1] - a[1]) / length, (b[2] - a[2]) / length
    total = 0
    for turn in range(2):
        wanted = (total + 1) // 2
        seen = 0
        p0, p1, p2 = a[0], a[1], a[2]
        before = dm.truth[p0, p1, p2]
        for i in range(1, length + 1):
            q0, q1, q2 = _nearest(a[0] + i * s0), _nearest(a[1] + i * s1), _nearest(a[2] + i * s2)
            now = dm.truth[q0, q1, q2]
            if now != before:
                seen += 1
                if turn == 1 and seen == wanted:
                    f, g = dm.phi[p0, p1, p2], dm.phi[q0, q1, q2]
                    where = 0.5
                    if f != g:
                        where = min(max(np.float64(f / (f - g)), 0.0), 1.0)
                    return (i - 1 + where) / length
            before = now
            p0, p1, p2 = q0, q1, q2
        total = seen
    return 0.5


@inner
def told_on(dm, a, b):
    """Crossing as a decoder has it, which knows ``dm.parts`` parts in ``2**dm.unit`` samples, or by its own rule."""
    if dm.parts == LINEAR_POINTS:
        f, g = np.float64(dm.phi[a[0], a[1], a[2]]), np.float64(dm.phi[b[0], b[1], b[2]])
        return min(max(f / (f - g), 0.0), 1.0) if f != g else 0.5
    where = crossing_on(dm, a, b)
    if dm.parts == EXACT_POINTS:
        return where
    length = max(abs(b[0] - a[0]), abs(b[1] - a[1]), abs(b[2] - a[2]))
    total = np.int64(1)
    while True:
        radix = radix_of(np.int64(length), total, dm.parts, dm.unit)
        if radix == 1:
            break
        total *= radix
    return (min(np.floor(where * total), total - 1) + 0.5) / total
