"""The parabola predictors of curves in integers (C2-arith; spec clause 7.3).

A parabola is fitted by least squares to the last points of the curve, each coordinate against the point's index,
and extrapolated by one. Extrapolation is a fixed linear combination: the weights are integers over a common
denominator, one row for each number of points. There are two. The stiff parabola goes through the gate's point, which
is known, and is kept from bending too much; it is right more often on rough curves. The free one is the published
parabola, to which the gate's point is the last one of those that it is fitted to; it is right more often on smooth
curves.
"""

from __future__ import annotations

from collections.abc import Callable
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


def beside_the_gate(points: int) -> tuple[int, list[int]]:
    """Denominator and weights that take f(-points) .. f(-1) to the value at 1 of the free parabola, where f(0) is 0.

    It is fitted to f(0), too, and to ``MOST`` points at most: those before have the weight 0.
    """
    m = min(points + 1, MOST)
    weights = [3 * ((m - 1) * (m - 2) - (8 * m - 6) * i + 10 * i * i) for i in range(m - 1)]
    denominator = m * (m - 1) * (m - 2)
    common = gcd(denominator, *weights)
    return denominator // common, [0] * (points + 1 - m) + [w // common for w in weights]


def _table(fit: Callable[[int], tuple[int, list[int]]], least: int) -> NDArray[np.int64]:
    table = np.zeros((MOST + 1, MOST + 1), np.int64)
    for points in range(least, MOST + 1):
        denominator, weights = fit(points)
        table[points, 0] = denominator
        table[points, 1 : points + 1] = weights
    return table


LEAST = 2
"""Points that the free parabola takes at least, besides the gate's."""
ONWARD = _table(through_the_gate, 1)
FREE = _table(beside_the_gate, LEAST)


@inlined
def nearer(trail, count, unit, g, a, b):
    """Compare the extrapolated points with the points a and b (pairs; all coordinates doubled).

    The curve is extrapolated from the gate's point ``g`` to the point behind, by both parabolas.

    ``trail`` holds the last points, a ring of MOST pairs. Everything is measured from the point ``g`` in units of
    ``2**(unit - 1)``, and cut off where it is too far away to matter, so that the numbers stay small. Returns 0 without
    a prediction, else the case 1 (doubtful), 2 or 3 (sure) of the stiff parabola, negative if a is nearer than b to its
    point; and 1 if the same one is nearer to the free parabola's, else, or if that has too few points, 0.
    """
    if count == 0:
        return 0, 0
    used = min(count, MOST)
    denominator = ONWARD[used, 0]
    p0 = np.int64(0)
    p1 = np.int64(0)
    q0 = np.int64(0)
    q1 = np.int64(0)
    j = (count - used) % MOST - 1
    for i in range(used):
        w = ONWARD[used, 1 + i]
        v = FREE[used, 1 + i]
        j = j + 1 if j + 1 < MOST else 0
        f0 = min(max(((trail[2 * j] - g[0]) << 1) >> unit, -REACH), REACH)
        f1 = min(max(((trail[2 * j + 1] - g[1]) << 1) >> unit, -REACH), REACH)
        p0 += w * f0
        p1 += w * f1
        q0 += v * f0
        q1 += v * f1
    a0 = ((a[0] - g[0]) << 1) >> unit
    a1 = ((a[1] - g[1]) << 1) >> unit
    b0 = ((b[0] - g[0]) << 1) >> unit
    b1 = ((b[1] - g[1]) << 1) >> unit
    gap = a0 * a0 + a1 * a1 - b0 * b0 - b1 * b1
    s = 2 * (p0 * (b0 - a0) + p1 * (b1 - a1)) + denominator * gap
    free = 2 * (q0 * (b0 - a0) + q1 * (b1 - a1)) + FREE[used, 0] * gap
    span = denominator * ((b0 - a0) * (b0 - a0) + (b1 - a1) * (b1 - a1))
    size = abs(s)
    case = 1
    if 2 * size >= span:
        case = 2
    if size >= span:
        case = 3
    agree = 1 if used >= LEAST and (free > 0) == (s > 0) else 0
    return case if s > 0 else -case, agree
