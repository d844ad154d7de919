"""Prediction of a sign from the frame before: how its curve has moved nearby, and where it lies then (clause 7.18).

Softened signs fall from above to below like a field. Where the curve moves, the signs around are those of that field at
another level: the level at which the fewest known signs nearby are wrong, once if this sign is above, once if below.
"""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from ...entropy.panel import KIND, LEVEL, LEVELS, MARGIN, ON, WIDE_LEVEL, WIDE_MARGIN
from ...kernel import constant, inlined, inner
from ...kernel.types import Integer
from ..lattice.access import dimension
from ..lattice.grid import clamped
from ..lattice.store import get
from ..tube.softened import levels
from .magnitude import bits

_FAR, _REACH = 17, 4
"""Largest squared distance of signs that are looked at, in the smallest step of the mesh there, and its root."""
_MIDDLE = LEVELS
"""Twice the level at which the curve has not moved."""
_MOST_CLASS = 9
SEED = np.int64(9)
"""Kind of the signs at the seeds of a leaf base; those of other signs come before it."""
BEHIND = 6
"""First kind of signs behind gates, by phase; those of refinement signs, by phase and crossing, begin at 0."""


def _around(n: int) -> np.ndarray:
    """Steps to the signs that are looked at, and their weights."""
    steps = [d + (0,) * (3 - n) for d in product(range(-_REACH, _REACH + 1), repeat=n)]
    return np.array([(*d, 640 // (7 + 3 * q)) for d in steps if 0 < (q := sum(x * x for x in d)) <= _FAR], np.int64)


_PLANE, _SPACE = constant(partial(_around, 2)), constant(partial(_around, 3))


class Spot(NamedTuple):
    """A vertex, unclamped, and the edge of the cubes of its level."""

    x: Integer
    y: Integer
    z: Integer
    edge: Integer


@inner
def _compared(st, spot, wrong):
    """For each level how much is wrong if the curve lies there now, as differences from the level before."""
    x, y, z, edge = spot
    plane = dimension(st.grid.tables) == 2
    step = max(edge >> 1, 1)
    count = len(_PLANE) if plane else len(_SPACE)
    for i in range(count):
        if plane:
            a, b, c, weight = x + _PLANE[i, 0] * step, y + _PLANE[i, 1] * step, z, _PLANE[i, 3]
        else:
            a, b, c, weight = (
                x + _SPACE[i, 0] * step, y + _SPACE[i, 1] * step, z + _SPACE[i, 2] * step, _SPACE[i, 3]
            )
        if min(min(a, b), c) < 0 or a > st.grid.last0 or b > st.grid.last1 or c > st.grid.last2:
            continue
        e = get(st.known, a, b, c)
        if e == 0:
            continue
        level, wide = levels(st.soft, a, b, c)
        if level < 0:
            continue
        if e & 1:
            wrong[level + 1] += weight
            wrong[LEVELS + 1 + wide + 1] += weight
        else:
            wrong[0] += weight
            wrong[level + 1] -= weight
            wrong[LEVELS + 1] += weight
            wrong[LEVELS + 1 + wide + 1] -= weight


@inlined
def _margin(wrong, first, level):
    """Class of how much more is wrong at best if the sign is below than if it is above."""
    run = np.int64(0)
    above = below = np.int64(1) << 40
    for j in range(LEVELS + 1):
        run += wrong[first + j]
        cost = run + abs(2 * j - _MIDDLE)
        if level >= j:
            above = min(above, cost)
        else:
            below = min(below, cost)
    size = min(bits(abs(below - above) >> 3), _MOST_CLASS)
    return size if below > above else -size


@inlined
def see_before(st, cd, spot, target, kind, other):
    """Enter the prediction of a sign from the frame before into the panel; ``target`` is the sign that a 1 means.

    ``other`` is the sign in the frame before, or -1.
    """
    panel = cd.blend.panel
    panel.about[ON] = 0
    if len(panel.prob) == 0 or other < 0:
        return
    x, y, z = clamped(st.grid, spot.x, spot.y, spot.z)
    level, wide = levels(st.soft, x, y, z)
    if level < 0:
        level = wide = (LEVELS - 1) * other
    wrong = st.scratch[: 2 * (LEVELS + 1)]
    wrong[:] = 0
    _compared(st, Spot(x, y, z, spot.edge), wrong)
    way = 2 * target - 1
    panel.about[ON] = 1
    panel.about[KIND] = kind
    panel.about[MARGIN] = _MOST_CLASS + way * _margin(wrong, 0, level)
    panel.about[WIDE_MARGIN] = _MOST_CLASS + way * _margin(wrong, LEVELS + 1, wide)
    panel.about[LEVEL] = level if target else LEVELS - 1 - level
    panel.about[WIDE_LEVEL] = wide if target else LEVELS - 1 - wide
