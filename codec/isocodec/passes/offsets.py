"""Offsets: into how many parts an edge is divided, and where an earlier isovalue's crossing lies (spec clause 5.7)."""

from __future__ import annotations

import numpy as np

from isospec.container import MAX_PARTS, MAX_RADIX, STEP_RADIX

from ..kernel import inlined


@inlined
def radix_of(length, parts, target, unit):
    """Smallest odd number of parts that brings an edge of so many samples to ``target`` parts in ``2**unit`` samples.

    Large ones are reached in steps.
    """
    wanted = min((length * target + (np.int64(1) << unit) - 1) >> unit, MAX_PARTS)
    radix = (wanted + parts - 1) // parts | 1
    return radix if radix <= MAX_RADIX else np.int64(STEP_RADIX)


@inlined
def leans(crossings, i):
    """Whether edge i is crossed at an earlier isovalue, too, and a digit of it counts from there."""
    return crossings.parts[i] == 1 and crossings.earlier[i, 1] > 0


@inlined
def beyond(crossings, i, radix, side):
    """Part that holds the earlier isovalue's crossing, and how many parts lie beyond it.

    ``side`` says on which side of it the present isovalue lies (``Counters.side``).
    """
    number, parts = crossings.earlier[i, 0], crossings.earlier[i, 1]
    if crossings.rising[i] == (side > 0):
        bound = number * radix // parts
        return bound, radix - 1 - bound
    bound = ((number + 1) * radix - 1) // parts
    return bound, bound
