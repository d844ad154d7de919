"""The parabola predictor of curves in integers (C2-arith; spec clause 7.3).

A parabola is fitted by least squares to the last points of the curve, each coordinate against the point's index,
and extrapolated by one. Extrapolation is a fixed linear combination: the weights are integers over a common
denominator, one row for each number of points. The parabola goes through the gate's point, which is known, and is kept
from bending too much.
"""

from __future__ import annotations

from math import gcd

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined

MOST = 20
"""Points that the fit looks back at."""
STIFFNESS = 1 << 16
"""Added to what keeps a parabola through the gate's point from bending: it is nearly a line."""
REACH = 1023
"""Farthest that a point counts, in units of g."""


def through_the_gate(points: int) -> tuple[int, list[int]]:
    """Denominator and weights that take f(-points) .. f(-1) to the value at 1 of a stiff parabola that is 0 at 0."""
    t = range(-points, 0)
    s2, s3, s4 = sum(v**2 for v in t), sum(v**3 for v in t), sum(v**4 for v in t) + STIFFNESS
    weights = [v * (s4 - s3 + (s2 - s3) * v) for v in t]
    denominator = s2 * s4 - s3 * s3
    common = gcd(denominator, *weights)
    return denominator // common, [w // common for w in weights]


def _table() -> NDArray[np.int64]:
    table = np.zeros((MOST + 1, MOST + 1), np.int64)
    for points in range(1, MOST + 1):
        denominator, weights = through_the_gate(points)
        table[points, 0] = denominator
        table[points, 1 : points + 1] = weights
    return table


ONWARD = _table()


@inlined
def nearer(trail, count, unit, g, a, b):
    """Compare the extrapolated point with the points a and b (pairs; all coordinates doubled).

    The curve is extrapolated through ``g`` to the point behind.

    ``trail`` holds the last points, a ring of MOST pairs. Everything is measured from the point ``g`` in units of
    ``2**(unit - 1)``, and cut off where it is too far away to matter, so that the numbers stay small. Returns 0 without
    a prediction, else the case 1 (doubtful), 2 or 3 (sure), negative if a is nearer than b.
    """
    if count == 0:
        return 0
    used = min(count, MOST)
    denominator = ONWARD[used, 0]
    p0 = np.int64(0)
    p1 = np.int64(0)
    j = (count - used) % MOST - 1
    for i in range(used):
        w = ONWARD[used, 1 + i]
        j = j + 1 if j + 1 < MOST else 0
        p0 += w * min(max(((trail[2 * j] - g[0]) << 1) >> unit, -REACH), REACH)
        p1 += w * min(max(((trail[2 * j + 1] - g[1]) << 1) >> unit, -REACH), REACH)
    a0 = ((a[0] - g[0]) << 1) >> unit
    a1 = ((a[1] - g[1]) << 1) >> unit
    b0 = ((b[0] - g[0]) << 1) >> unit
    b1 = ((b[1] - g[1]) << 1) >> unit
    s = 2 * (p0 * (b0 - a0) + p1 * (b1 - a1)) + denominator * (a0 * a0 + a1 * a1 - b0 * b0 - b1 * b1)
    span = denominator * ((b0 - a0) * (b0 - a0) + (b1 - a1) * (b1 - a1))
    size = abs(s)
    case = 1
    if 2 * size >= span:
        case = 2
    if size >= span:
        case = 3
    return case if s > 0 else -case
