"""Offsets: the parts of a digit are halved until one is left (spec clause 5.7.3)."""

from __future__ import annotations

import numpy as np

from isospec.container import MAX_PARTS, MAX_RADIX, STEP_RADIX

from ...entropy.mixer import EITHER
from ...entropy.range_coder import ENCODE, Coder
from ...field.samples import OFFSET_BITS
from ...kernel import DONE, inlined, kernel
from ...kernel.types import IntVector
from ..models.crossing_candidates import Crossings, count_near, enter_place, find_candidates, remember
from ..models.crossings_nearby import Beside
from ..models.offset_digits import begun_digit, code_half
from ..tube.state import OFFSET_BIT, State


@inlined
def radix_of(length, parts, target, unit):
    """Smallest number of parts that brings an edge of so many samples to ``target`` parts in ``2**unit`` samples.

    Large ones are reached in steps.
    """
    wanted = min((length * target + (np.int64(1) << unit) - 1) >> unit, MAX_PARTS)
    if wanted <= parts:
        return np.int64(1)
    # most edges have one part: divisions take long
    radix = wanted if parts == 1 else (wanted + parts - 1) // parts
    return radix if radix <= MAX_RADIX else np.int64(STEP_RADIX)


@inlined
def _leans(crossings, i):
    """Whether edge i is crossed at an earlier isovalue, too, and a digit of it counts from there."""
    return len(crossings.earlier) > 0 and crossings.parts[i] == 1 and crossings.earlier[i, 1] > 0


@inlined
def _choice(crossings, i, radix, low, high, wanted, slack):
    """Encoder: the symbol that leads to a part whose middle is near enough to the crossing, or EITHER.

    The part that holds the crossing is always good enough, unless it is ruled out: then the one next to it is.
    """
    parts, number, split = crossings.parts[i], crossings.number[i], (low + high) >> 1
    total = parts * radix
    true = (wanted * total) >> OFFSET_BITS
    half = np.int64(1) << (OFFSET_BITS - 1)
    least = min(((wanted - slack) * total + half - 1) >> OFFSET_BITS, true) - number * radix
    most = max(((wanted + slack) * total - half) >> OFFSET_BITS, true) - number * radix
    if not crossings.rising[i]:
        least, most = radix - 1 - most, radix - 1 - least
    least, most = min(max(least, low), high - 1), min(max(most, low), high - 1)
    if most < split:
        return np.int64(0)
    return np.int64(1 if least >= split else EITHER)


@inlined
def _earlier_part(st, crossings, i, radix):
    """Part that holds the earlier isovalue's crossing, counted from the end that is below, or -1 without one."""
    if not _leans(crossings, i):
        return np.int64(-1)
    number, parts, rising = crossings.earlier[i, 0], crossings.earlier[i, 1], crossings.rising[i]
    if rising == (st.counters.side > 0):
        bound = number * radix // parts
    else:
        bound = ((number + 1) * radix - 1) // parts
    return bound if rising else radix - 1 - bound


@inlined
def _begin(st, beside, crossings, i, radix, earlier):
    """All parts are left but those before the earlier isovalue's crossing; what is nearby gives candidates."""
    walk = st.digit
    walk.low, walk.high = 0, radix
    if earlier >= 0:
        if st.counters.side > 0:
            walk.low = earlier
        else:
            walk.high = earlier + 1
    if walk.high - walk.low > 1:
        walk.span = find_candidates(st, beside, crossings, i)


@inlined
def _nearer(st, low, high, earlier):
    """Number of the parts left that are nearer to the earlier isovalue's crossing than their second half, or -1."""
    if earlier < 0:
        return np.int64(-1)
    split = (low + high) >> 1
    return split - earlier if st.counters.side > 0 else earlier + 1 - split


@inlined
def _enter(st, beside, crossings, i, radix, part):
    """Enter the one part that is left; the next digit begins."""
    number, parts, rising = crossings.number, crossings.parts, crossings.rising
    count_near(beside, crossings, i, -1)
    number[i] = number[i] * radix + (part if rising[i] else radix - 1 - part)
    parts[i] *= radix
    place = enter_place(beside.around, i, number[i], parts[i])
    count_near(beside, crossings, i, 1)
    remember(st, place, rising[i])


@kernel
def offsets(
    st: State, cd: Coder, beside: Beside, crossings: Crossings, target: int, unit: int, wanted: IntVector,
    slack: IntVector,
) -> int:
    """Divide the part of every edge that holds its crossing until there are ``target`` in ``2**unit`` samples (5.7.3).

    ``wanted`` are the encoder's offsets as 30-bit fractions. It may code a part whose middle is at most ``slack`` from
    there instead of the one that holds the crossing: the more probable of those.
    """
    walk = st.digit
    encoding = cd.reg.mode == ENCODE
    bit = np.int64(0)
    while walk.item < len(crossings.number):
        # only an index: unsigned, no test whether it counts from the end
        i = np.uint64(walk.item)
        radix = radix_of(crossings.length[i], crossings.parts[i], target, unit)
        if radix == 1:
            walk.item += 1
            continue
        earlier = _earlier_part(st, crossings, i, radix)
        if walk.halved == 0:
            _begin(st, beside, crossings, i, radix, earlier)
        digit = begun_digit(st, cd, crossings, i, radix)
        low, high, halved = walk.low, walk.high, walk.halved
        while high - low > 1:
            if encoding:
                bit = _choice(crossings, i, radix, low, high, wanted[i], slack[i])
            bit = code_half(st, cd, digit, low, high, halved, _nearer(st, low, high, earlier), bit)
            if bit < 0:
                walk.low, walk.high, walk.halved = low, high, halved
                return bit
            st.tally[OFFSET_BIT] += 1
            split = (low + high) >> 1
            low, high = (split, high) if bit else (low, split)
            halved += 1
        walk.halved = 0
        _enter(st, beside, crossings, i, radix, low)
    return DONE
