"""Halves of digits: what is seen of where an edge is crossed (spec clauses 7.8, 7.14)."""

from __future__ import annotations

import numpy as np

from ...entropy.mixer import blended, clear, mixing, see
from ...entropy.range_coder import code_below
from ...kernel import inlined
from ..lattice.access import dimension
from . import contexts as ctx
from .crossing_candidates import BEFORE, BEHIND, CHAIN, CUBIC, LINE, MEAN, MOST_RECENT, RECENT, UNIT, VERTEX
from .magnitude import CLASSES, FINE, NONE, bits, row_of
from .network_rows import LEAF_NET, LEAN_KIND, OFFSET_KIND, OFFSET_NET, OFFSET_ROW, OFFSET_ROWS

_GRID_2, _GRID_3 = OFFSET_ROW[2], OFFSET_ROW[3]


@inlined
def middle_part(walk):
    """The first part of the second half of those that are left."""
    return (walk.low + walk.high) >> 1


@inlined
def _number_from_below(crossings, i):
    """Number of the part that holds the crossing of edge i, from the end that is below."""
    number = crossings.number[i]
    return number if crossings.rising[i] else crossings.parts[i] - 1 - number


@inlined
def _recent_sides(st, crossings, i, radix):
    """Sides of the last two different places: 0 off the parts that are left, 1 in their first half, 2 in the second.

    The first counts three times. Parts are counted from the end that is below.
    """
    w, walk, parts = st.candidates, st.digit, crossings.parts[i]
    low, high, split = walk.low, walk.high, middle_part(walk)
    number = _number_from_below(crossings, i)
    sides = np.int64(0)
    for k in range(2):
        o = 2 * (RECENT + k)
        part = (w[o] * parts * radix // UNIT) - number * radix
        side = 0 if w[o + 1] == NONE or part < low or part >= high else 1 if part < split else 2
        sides = 3 * sides + side
    return sides


@inlined
def _see_along(st, cd, crossings, i, radix, nearer):
    """List what is known of whether the crossing lies in the second half of the parts that are left.

    Parts and places are counted from the end that is below. ``nearer`` of the parts are nearer than that half to the
    crossing of the earlier isovalue, -1 without one.
    """
    walk, parts, rising = st.digit, crossings.parts[i], crossings.rising[i]
    low, high, span = walk.low, walk.high, walk.span
    plane = dimension(st.grid.tables) == 2
    first = (_GRID_2 if plane else _GRID_3) + (OFFSET_ROWS if span > 0 else 0)
    # candidates that such an edge may have, before the recent ones
    begin, lead = (VERTEX, RECENT - VERTEX) if plane and span > 0 else (0, VERTEX + (span > 0))
    w = st.candidates
    clear(cd)
    bound = (_number_from_below(crossings, i) * radix + middle_part(walk)) * UNIT // (parts * radix)
    for slot in range(lead + MOST_RECENT):
        c = begin + slot if slot < lead else RECENT + slot - lead
        known = w[np.uint64(2 * c + 1)]
        if known != NONE:
            place = w[np.uint64(2 * c)]
            if not rising and c < RECENT:
                place = UNIT - place
            off = place - bound
            see(cd, first + row_of(slot, known, abs(off) >> 2, off < 0))
    o = first + (lead + MOST_RECENT) * 4 * CLASSES
    see(cd, o + bits(high - low) + (7 if parts > 1 else 0))
    see(cd, o + 14 + bits((high - low) * UNIT // (parts * radix)))
    see(cd, o + 28 + min(max(bound >> 9, 0), 7))
    if nearer >= 0:
        see(cd, o + 36 + min(bits(nearer), 7))
    if span > 0:
        see(cd, o + 43 + span)


@inlined
def _guessed(st):
    """The candidate that the baseline profile goes by, the best that there is: its place and how well it is known."""
    w, leaves = st.candidates, st.digit.span > 0
    best = np.int64(MEAN)
    if leaves and dimension(st.grid.tables) == 2:
        best = np.int64(CHAIN + CUBIC)
        for c in (LINE, BEFORE, BEHIND):
            if w[2 * best + 1] == NONE:
                best = np.int64(CHAIN + c)
    if leaves and w[2 * best + 1] == NONE:
        best = np.int64(VERTEX)
    return w[2 * best], w[2 * best + 1]


@inlined
def _near_context(st, crossings, i, radix, context):
    """The context below ``context`` for where the guessed place lies; ``context`` if nothing is guessed."""
    walk, parts = st.digit, crossings.parts[i]
    place, known = _guessed(st)
    if known == NONE:
        return context
    place = place if crossings.rising[i] else UNIT - place
    bound = (_number_from_below(crossings, i) * radix + middle_part(walk)) * UNIT
    far = (place * parts * radix - bound) * 4 // ((walk.high - walk.low) * UNIT)
    step = np.int64(4 if parts > 1 else 0) + min(walk.halved, 3)
    return ctx.OFFSET_NEAR + (2 * step + (known == FINE)) * 2 * ctx.NEAR + ctx.near_class(far)


@inlined
def code_half(st, cd, crossings, i, radix, nearer, bit):
    """Code whether the crossing lies in the second half of the parts that are left; as ``code``."""
    walk = st.digit
    grid = walk.span == 0
    again = np.int64(crossings.parts[i] > 1)
    context = ctx.OFFSET + (8 * again + min(walk.halved, 7)) * 9 + _recent_sides(st, crossings, i, radix)
    if nearer >= 0:
        context = ctx.OFFSET_LEAN + min(bits(nearer), 7) * 16 + min(walk.high - walk.low, 15)
    if not mixing(cd):
        return code_below(cd, _near_context(st, crossings, i, radix, context), context, bit)
    kind = OFFSET_KIND + min(walk.halved, 2) + 3 * again + (0 if grid else 6)
    if nearer >= 0:
        kind = LEAN_KIND + min(walk.halved, 2) + (0 if grid else 3)
    _see_along(st, cd, crossings, i, radix, nearer)
    return blended(cd, OFFSET_NET if grid else LEAF_NET, False, kind, context, bit)
