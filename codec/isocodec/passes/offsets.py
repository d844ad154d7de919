"""Offsets: digits of the place where an edge is crossed (spec clause 5.7)."""

from __future__ import annotations

import numpy as np

from isospec.container import MAX_PARTS, MAX_RADIX, STEP_RADIX

from ..entropy.range_coder import ENCODE, Coder
from ..field.samples import OFFSET_BITS
from ..kernel import DONE, inlined, kernel
from ..kernel.types import BoolVector, IntMatrix, IntVector
from ..models.crossings_nearby import Beside
from ..models.offsets import code_half, count_near, find_candidates, place_of, remember
from ..tube.state import OFFSET_BIT, State
from ..entropy.mixer import EITHER

_place_of = inlined(place_of)


@inlined
def radix_of(length, parts, target, unit):
    """Smallest odd number of parts that brings an edge of so many samples to ``target`` parts in ``2**unit`` samples.

    Large ones are reached in steps.
    """
    wanted = min((length * target + (np.int64(1) << unit) - 1) >> unit, MAX_PARTS)
    radix = (wanted + parts - 1) // parts | 1
    return radix if radix <= MAX_RADIX else np.int64(STEP_RADIX)


@inlined
def _beyond(st, i, radix, rising, earlier):
    """Part that holds the earlier isovalue's crossing, counted from the end that is below."""
    number, parts = earlier[i, 0], earlier[i, 1]
    if rising[i] == (st.counters.side > 0):
        bound = number * radix // parts
    else:
        bound = ((number + 1) * radix - 1) // parts
    return bound if rising[i] else radix - 1 - bound


@inlined
def _choice(wanted, slack, parts, radix, number, rising, low, high, split):
    """Encoder: the symbol that leads to a part whose middle is near enough to the crossing, or EITHER.

    The part that holds the crossing is always good enough, unless it is ruled out: then the one next to it is.
    """
    total = parts * radix
    true = (wanted * total) >> OFFSET_BITS
    half = np.int64(1) << (OFFSET_BITS - 1)
    least = min(((wanted - slack) * total + half - 1) >> OFFSET_BITS, true) - number * radix
    most = max(((wanted + slack) * total - half) >> OFFSET_BITS, true) - number * radix
    if not rising:
        least, most = radix - 1 - most, radix - 1 - least
    least, most = min(max(least, low), high - 1), min(max(most, low), high - 1)
    if most < split:
        return np.int64(0)
    return np.int64(1 if least >= split else EITHER)


@kernel
def offsets(
    st: State, cd: Coder, beside: Beside, edges: IntMatrix, number: IntVector, parts: IntVector, length: IntVector,
    rising: BoolVector, earlier: IntMatrix, target: int, unit: int, wanted: IntVector, slack: IntVector,
) -> int:  # fmt: skip
    """Divide the part of every edge that holds its crossing until the parts are fine enough (spec clause 5.7.3).

    Parts are counted from the end that is below; those before the crossing of an earlier isovalue (``earlier``: number
    and parts) are ruled out. ``rising`` tells whether the upper end is above, ``wanted`` are the encoder's offsets as
    30-bit fractions. It may tell a part whose middle is at most ``slack`` from there instead of the one that holds it:
    the more probable of those.
    """
    walk = st.digit
    while walk.item < len(number):
        # only an index: unsigned, no test whether it counts from the end
        i = np.uint64(walk.item)
        radix = radix_of(length[i], parts[i], target, unit)
        if radix == 1:
            walk.item += 1
            continue
        leaning = parts[i] == 1 and earlier[i, 1] > 0
        if walk.halved == 0:
            walk.low, walk.high = 0, radix
            walk.nearest = -1
            if leaning:
                walk.nearest = _beyond(st, i, radix, rising, earlier)
                if st.counters.side > 0:
                    walk.low = walk.nearest
                else:
                    walk.high = walk.nearest + 1
            if walk.high - walk.low > 1:
                walk.span = find_candidates(st, beside, edges, parts, length, i)
        if walk.high - walk.low > 1:
            split = (walk.low + walk.high) >> 1
            bit = np.int64(0)
            if cd.reg.mode == ENCODE:
                bit = _choice(wanted[i], slack[i], parts[i], radix, number[i], rising[i], walk.low, walk.high, split)
            bit = code_half(st, cd, radix, split, number[i], parts[i], rising[i], bit)
            if bit < 0:
                return bit
            st.tally[OFFSET_BIT] += 1
            walk.halved += 1
            if bit:
                walk.low = split
            else:
                walk.high = split
        if walk.high - walk.low == 1:
            count_near(beside, edges, parts, length, i, -1)
            number[i] = number[i] * radix + (walk.low if rising[i] else radix - 1 - walk.low)
            parts[i] *= radix
            beside.place[i] = _place_of(number[i], parts[i])
            count_near(beside, edges, parts, length, i, 1)
            walk.halved = 0
            remember(st, beside.place[i], rising[i])
    return DONE
