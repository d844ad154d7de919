"""Coordinates of the samples: each node predicted from nodes twice as far apart (spec clause 3.7.4).

Coordinates are smooth, so that nearly all symbols are: as predicted. Nodes come in steps from far apart to next
to each other; the nodes of a step are predicted along one axis from those that are there, with cubic interpolation
where there are two on either side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from isospec.container import MOST_COORDINATE

from ...entropy.context_layout import Layout
from ...entropy.range_coder import Coder, code, emit
from ...kernel import BAD, DONE, inlined, inner, kernel, record
from ...kernel.types import BoolVector, IntVector

QUANTUM = 4
"""A residual counts in ``1 << QUANTUM`` units."""
MOST_EXPONENT = 50
"""Binary digits of a residual behind its first one."""
GRADES = 3
"""Classes of distances of nodes: 1, 2, and more."""
# element: (contexts, probability of a 1 at the start, weight of that start in symbols)
CONTEXT = Layout({
    "ZERO": (9 * GRADES, 0.5, 1),
    "SIGN": (GRADES, 0.5, 1),
    "EXPONENT": (MOST_EXPONENT + 1, 0.5, 1),
})
"""Contexts of one coordinate."""
ZERO, SIGN, EXPONENT = CONTEXT.firsts("ZERO", "SIGN", "EXPONENT")
AXES = 3


@record
class Nodes(NamedTuple):
    """The nodes of one coordinate.

    ``value`` (N,) becomes their values, in units, in the order of the array. For an encoder ``goal`` (N,) holds those
    that are wanted, ``free`` (N,) which do not matter; a decoder has none of them. ``counts`` (3,) are nodes along each
    axis: 1 along one that the coordinate does not depend on.
    """

    value: IntVector
    goal: IntVector
    free: BoolVector
    counts: IntVector


@inlined
def nearest(difference, period):
    """A difference up to multiples of the period: the one nearest to 0; as it is without one."""
    if period > 0:
        return (difference + (period >> 1)) % period - (period >> 1)
    return difference


@inner
def predicted(value, at, step, place, count, period):
    """Prediction at a node, ``step`` entries behind the last known one along an axis (spec clause 3.7.4(5)).

    ``place`` is its number and ``count`` that of all along the axis, in steps.
    """
    base = value[np.uint64(at - step)]
    before = place >= 3
    behind = place + 1 < count
    far = np.int64(0)
    if before:
        far = nearest(value[np.uint64(at - 3 * step)] - base, period)
    if not behind:
        if place >= 5:
            farther = nearest(value[np.uint64(at - 5 * step)] - base, period)
            return base + ((3 * farther - 10 * far + 4) >> 3)
        if before:
            return base + ((1 - far) >> 1)
        return base
    next_one = nearest(value[np.uint64(at + step)] - base, period)
    if place + 3 < count:
        last = nearest(value[np.uint64(at + 3 * step)] - base, period)
        if before:
            return base + ((9 * next_one - far - last + 8) >> 4)
        return base + ((6 * next_one - last + 4) >> 3)
    if before:
        return base + ((3 * next_one - far + 4) >> 3)
    return base + ((next_one + 1) >> 1)


@inner
def _code_residual(cd, first, grade, recent, residual):
    """Code one residual in the contexts from ``first`` on; returns it and a status."""
    zero = code(cd, first + ZERO + 9 * grade + recent, np.int64(residual == 0))
    if zero < 0:
        return np.int64(0), zero
    if zero:
        return np.int64(0), np.int64(DONE)
    negative = code(cd, first + SIGN + grade, np.int64(residual < 0))
    if negative < 0:
        return np.int64(0), negative
    size = abs(residual)
    exponent = 0
    while True:
        if exponent > MOST_EXPONENT:
            return np.int64(0), np.int64(BAD)
        more = code(cd, first + EXPONENT + exponent, np.int64((size >> (exponent + 1)) > 0))
        if more < 0:
            return np.int64(0), more
        if more == 0:
            break
        exponent += 1
    out = np.int64(1)
    for i in range(exponent - 1, -1, -1):
        bit = emit(cd, 1 << 15, (size >> i) & 1)
        if bit < 0:
            return np.int64(0), bit
        out = 2 * out + bit
    if negative:
        out = -out
    return out, np.int64(DONE)


@inner
def _aim(goal, at, guess, period):
    """The residual that takes a guess nearest to where the encoder wants it."""
    return (nearest(goal[np.uint64(at)] - guess, period) + (1 << (QUANTUM - 1))) >> QUANTUM


@inner
def _code_step(cd, nodes, stride, axis, period, first):
    """Code the nodes of one step: those at odd multiples of ``stride`` along an axis."""
    value, counts = nodes.value, nodes.counts
    rows, columns, deep = counts[0], counts[1], counts[2]
    grade = min(stride, 4) >> 1
    inward = np.int64(1)
    if axis < 2:
        inward *= deep
    if axis < 1:
        inward *= columns
    along = (counts[np.uint64(axis)] - 1) // stride + 1
    recent = np.int64(0)
    for x in range(stride * (axis == 0), rows, stride * (1 + (axis == 0))):
        for y in range(stride * (axis == 1), columns, stride * (1 + (axis <= 1))):
            for z in range(stride * (axis == 2), deep, 2 * stride):
                at = (x * columns + y) * deep + z
                place = (x if axis == 0 else y if axis == 1 else z) // stride
                guess = predicted(value, at, stride * inward, place, along, period)
                residual = np.int64(0)
                if len(nodes.goal) and not nodes.free[np.uint64(at)]:
                    residual = _aim(nodes.goal, at, guess, period)
                residual, status = _code_residual(cd, first, grade, recent, residual)
                if status != DONE:
                    return status
                here = guess + (residual << QUANTUM)
                if here >= MOST_COORDINATE or here <= -MOST_COORDINATE:
                    return BAD
                value[np.uint64(at)] = here
                size = abs(residual)
                recent = 3 * (recent % 3) + (2 if size > 2 else size)
    return DONE


@kernel
def code_coordinate(cd: Coder, nodes: Nodes, period: int, first: int) -> int:
    """Code the values of one coordinate, whose first one is 0.

    Parameters
    ----------
    cd : Coder
    nodes : Nodes
    period : int
        In units; 0 if not periodic.
    first : int
        Its first context.

    Returns
    -------
    int
        DONE, NEED, SPENT, or BAD if a number is out of range.
    """
    counts = nodes.counts
    nodes.value[0] = 0
    stride = np.int64(1)
    most = max(counts[0], counts[1], counts[2])
    while 2 * stride < most:
        stride *= 2
    while stride > 0:
        for axis in range(AXES):
            if counts[axis] > stride:
                status = _code_step(cd, nodes, stride, axis, period, first)
                if status != DONE:
                    return status
        stride >>= 1
    return DONE
