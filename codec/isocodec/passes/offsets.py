"""Offsets: digits of the place where an edge is crossed (spec clause 5.7)."""

from __future__ import annotations

import numpy as np

from isospec.container import MAX_PARTS, MAX_RADIX, STEP_RADIX

from ..entropy.mixer import EITHER, blended, mixing
from ..entropy.range_coder import ENCODE, Coder, code
from ..field.samples import OFFSET_BITS
from ..kernel import DONE, inlined, kernel
from ..kernel.types import BoolVector, IntMatrix, IntVector
from ..models import contexts as ctx
from ..models.crossings_nearby import Beside
from ..models.layout import LEAF_NET, LEAN_KIND, OFFSET_KIND, OFFSET_NET
from ..models.magnitude import bits
from ..models.offsets import count_near, find_candidates, place_of, recent_sides, remember, see_along
from ..tube.state import OFFSET_BIT, State

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
    """Part that holds the earlier isovalue's crossing, and how many parts lie beyond it."""
    number, parts = earlier[i, 0], earlier[i, 1]
    if rising[i] == (st.counters.side > 0):
        bound = number * radix // parts
        return bound, radix - 1 - bound
    bound = ((number + 1) * radix - 1) // parts
    return bound, bound


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


@inlined
def _halve(st, cd, beside, edges, number, parts, length, i, radix, rising, earlier, leaning, wanted, slack):
    """One symbol of a digit in the main profile (spec clause 7.14): which half of the parts left holds the crossing.

    Parts are counted from the end that is below; those before the earlier isovalue's crossing are ruled out. Returns
    what the coder says; the digit is complete when one part is left.
    """
    walk = st.digit
    grid = len(beside.near) == 0
    earlier_part = np.int64(-1)
    if leaning:
        bound = _beyond(st, i, radix, rising, earlier)[0]
        earlier_part = bound if rising[i] else radix - 1 - bound
    if walk.halved == 0:
        walk.low, walk.high = 0, radix
        if leaning:
            if st.counters.side > 0:
                walk.low = earlier_part
            else:
                walk.high = earlier_part + 1
            if walk.high - walk.low == 1:
                return np.int64(DONE)
        walk.span = find_candidates(st, beside, edges, parts, length, i)
    split = (walk.low + walk.high) >> 1
    bit = np.int64(0)
    if cd.reg.mode == ENCODE:
        bit = _choice(wanted[i], slack[i], parts[i], radix, number[i], rising[i], walk.low, walk.high, split)
    again = np.int64(parts[i] > 1)
    sides = recent_sides(st, walk.low, walk.high, split, radix, number[i], parts[i], rising[i])
    context = ctx.OFFSET + (8 * again + min(walk.halved, 7)) * 9 + sides
    kind = OFFSET_KIND + min(walk.halved, 2) + 3 * again + (0 if grid else 6)
    nearer = np.int64(-1)
    if leaning:
        nearer = split - earlier_part if st.counters.side > 0 else earlier_part + 1 - split
        context = ctx.OFFSET_LEAN + min(bits(nearer), 7) * 16 + min(walk.high - walk.low, 15)
        kind = LEAN_KIND + min(walk.halved, 2) + (0 if grid else 3)
    see_along(st, cd, walk.low, walk.high, split, radix, number[i], parts[i], rising[i], walk.span, nearer)
    net = OFFSET_NET if grid else LEAF_NET
    bit = blended(cd, net, False, kind, context, bit)
    if bit >= 0:
        walk.halved += 1
        if bit:
            walk.low = split
        else:
            walk.high = split
    return bit


@kernel
def offsets(
    st: State, cd: Coder, beside: Beside, edges: IntMatrix, number: IntVector, parts: IntVector, length: IntVector,
    rising: BoolVector, earlier: IntMatrix, target: int, unit: int, wanted: IntVector, slack: IntVector,
) -> int:  # fmt: skip
    """Divide the part of every edge that holds its crossing until the parts are fine enough (spec clause 5.7.3).

    Radices are odd and a digit counts from the middle part, so that a crossing drawn in the middle of its part
    is never moved away from where it is. Where the edge is also crossed at an earlier isovalue (``earlier``: number
    and parts), the digit counts from there. ``rising`` tells whether the upper end is above, ``wanted`` are the
    encoder's offsets as 30-bit fractions. In the main profile it may tell a part whose middle is at most ``slack`` from
    there instead of the one that holds it: the more probable of those.
    """
    walk = st.digit
    encoding = cd.reg.mode == ENCODE
    while walk.item < len(number):
        # only an index: unsigned, no test whether it counts from the end
        i = np.uint64(walk.item)
        radix = radix_of(length[i], parts[i], target, unit)
        if radix == 1:
            walk.item += 1
            continue
        leaning = parts[i] == 1 and earlier[i, 1] > 0
        if mixing(cd):
            told = walk.halved
            bit = _halve(
                st, cd, beside, edges, number, parts, length, i, radix, rising, earlier, leaning, wanted, slack
            )
            if bit < 0:
                return bit
            st.tally[OFFSET_BIT] += walk.halved - told
            if walk.high - walk.low == 1:
                count_near(beside, edges, parts, length, i, -1)
                number[i] = number[i] * radix + (walk.low if rising[i] else radix - 1 - walk.low)
                parts[i] *= radix
                beside.place[i] = _place_of(number[i], parts[i])
                count_near(beside, edges, parts, length, i, 1)
                walk.halved = 0
                remember(st, beside.place[i], rising[i])
            continue
        half = radix // 2
        contexts = ctx.OFFSET + (min(half, ctx.OFFSET_SIZES) - 1 + (ctx.OFFSET_SIZES if parts[i] > 1 else 0)) * (
            ctx.OFFSET_STRIDE
        )
        step = walk.step
        digit = np.int64(0)
        if encoding:
            digit = ((wanted[i] * parts[i] * radix) >> OFFSET_BITS) - number[i] * radix - half
        if leaning:
            bound, room = _beyond(st, i, radix, rising, earlier)
            way = np.int64(1 if rising[i] == (st.counters.side > 0) else -1)
            bit = np.int64(0)
            if step < room:
                context = ctx.OFFSET_LEAN + min(step, 7) * 16 + min(room - step, 15)
                bit = code(cd, context, np.int64((digit + half - bound) * way > step))
                if bit < 0:
                    return bit
                st.tally[OFFSET_BIT] += 1
            if bit:
                walk.step = step + 1
                continue
            number[i] = bound + way * step
            digit = number[i] - half
            parts[i] = radix
            walk.before = 1 if digit == 0 else (3 if digit > 0 else 2)
            walk.step = 0
            continue
        if step == 0:
            bit = code(cd, contexts + walk.before, np.int64(digit != 0))
        elif step == 1:
            bit = code(cd, contexts + 4 + walk.before, np.int64(digit > 0))
        else:
            bit = code(cd, contexts + 8 + step - 2, np.int64(abs(digit) >= step))
        if bit < 0:
            return bit
        st.tally[OFFSET_BIT] += 1
        if step == 0 and bit:
            walk.step = 1
            continue
        if step == 1:
            walk.sign = bit
            bit = np.int64(1)
            step = 1
        # a magnitude goes on while its bits are 1 and larger ones exist
        if bit and step < half:
            walk.step = step + 1
            continue
        size = step if bit else step - 1
        if step == 0:
            size = 0
        number[i] = number[i] * radix + half + (size if walk.sign else -size)
        parts[i] *= radix
        walk.before = 1 if size == 0 else (3 if walk.sign else 2)
        walk.step = 0
        walk.sign = 0
    return DONE
