"""Halves of digits: what is seen of where an edge is crossed (spec clauses 7.8, 7.14)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...entropy.mixer import blended, mixing, see
from ...entropy.range_coder import code_below
from ...kernel import inlined
from ...kernel.types import Integer
from ..lattice.access import dimension
from . import contexts as ctx
from .crossing_candidates import BEFORE, BEHIND, CHAIN, CUBIC, LINE, MEAN, MOST_RECENT, RECENT, UNIT, VERTEX
from .magnitude import CLASSES, FINE, NONE, bits, by_few, row_of
from .network_rows import LEAF_NET, LEAN_KIND, OFFSET_KIND, OFFSET_NET, OFFSET_ROW, OFFSET_ROWS

_GRID_2, _GRID_3 = OFFSET_ROW[2], OFFSET_ROW[3]
_LISTED, _LIST = 40, 41
"""In ``State.candidates``, where the list of those that are known ends and where it begins: a place and a row each."""


class Digit(NamedTuple):
    """Numbers that stay the same for all symbols of a digit; parts and places are counted from the end that is below.

    Attributes
    ----------
    base, total : int
        Number of the first part of the digit, and parts of the whole edge.
    again : int
        Whether it is another digit of its edge.
    span : int
        Off the full grid, along how many axes the ends differ, else 0.
    recent, recent_too : int
        Parts where the last two different places are, -1 if there is no such place.
    guess, known : int
        Where the best candidate lies, in quarters of a part from the first on, and how well it is known.
    """

    base: Integer
    total: Integer
    again: Integer
    span: Integer
    recent: Integer
    recent_too: Integer
    guess: Integer
    known: Integer


@inlined
def _recent_part(st, number, base, total):
    """Part where one of the last different places is."""
    w, o = st.candidates, 2 * (RECENT + number)
    return np.int64(-1) if w[o + 1] == NONE else (w[o] * total // UNIT) - base


@inlined
def begun_digit(st, cd, crossings, i, radix):
    """Make a `Digit` of edge i, whose candidates are there, and list these if they are rows of a network."""
    span, number, parts, rising = st.digit.span, crossings.number[i], crossings.parts[i], crossings.rising[i]
    total = parts * radix
    base = (number if rising else parts - 1 - number) * radix
    place, known = np.int64(0), np.int64(NONE)
    if mixing(cd):
        _list_candidates(st, span, rising)
    else:
        place, known = _guessed(st, span)
        place = place if rising else UNIT - place
    return Digit(
        base, total, np.int64(parts > 1), span, _recent_part(st, np.int64(0), base, total),
        _recent_part(st, np.int64(1), base, total), (4 * place * total // UNIT) - 4 * base, known,
    )


@inlined
def _list_candidates(st, span, rising):
    """List the candidates that are known: for each its place and the first row of those for its distances."""
    w = st.candidates
    plane = dimension(st.grid.tables) == 2
    # candidates that such an edge may have, before the recent ones
    begin, lead = (VERTEX, RECENT - VERTEX) if plane and span > 0 else (0, VERTEX + (span > 0))
    end = _LIST
    for slot in range(lead + MOST_RECENT):
        c = begin + slot if slot < lead else RECENT + slot - lead
        known = w[np.uint64(2 * c + 1)]
        place = w[np.uint64(2 * c)]
        w[np.uint64(end)] = place if rising or c >= RECENT else UNIT - place
        w[np.uint64(end + 1)] = row_of(slot, known, 0, False)
        end += 2 * (known != NONE)
    w[_LISTED] = end


@inlined
def _side(part, low, split, high):
    """Side of a part: 0 off the parts that are left, 1 in their first half, 2 in the second."""
    return np.int64(low <= part) * np.int64(part < high) * (1 + np.int64(part >= split))


@inlined
def _see_along(st, cd, digit, low, high, nearer):
    """List what is known of whether the crossing lies in the second half of the parts that are left.

    ``nearer`` of the parts are nearer than that half to the crossing of the earlier isovalue, -1 without one.
    """
    w, span, total = st.candidates, digit.span, digit.total
    plane = dimension(st.grid.tables) == 2
    first = (_GRID_2 if plane else _GRID_3) + (OFFSET_ROWS if span > 0 else 0)
    lead = RECENT - VERTEX if plane and span > 0 else VERTEX + (span > 0)
    bound = by_few((digit.base + ((low + high) >> 1)) * UNIT, total)
    rows, at = cd.blend.row, np.int64(1)
    for o in range(_LIST, w[_LISTED], 2):
        off = w[np.uint64(o)] - bound
        rows[np.uint64(at)] = first + w[np.uint64(o + 1)] + row_of(0, NONE, abs(off) >> 2, off < 0)
        at += 1
    # the count of rows comes first
    rows[0] = at - 1
    o = first + (lead + MOST_RECENT) * 4 * CLASSES
    see(cd, o + bits(high - low) + 7 * digit.again)
    see(cd, o + 14 + bits(by_few((high - low) * UNIT, total)))
    see(cd, o + 28 + min(max(bound >> 9, 0), 7))
    if nearer >= 0:
        see(cd, o + 36 + min(bits(nearer), 7))
    if span > 0:
        see(cd, o + 43 + span)


@inlined
def _guessed(st, span):
    """The best candidate, which the baseline profile uses: its place and how well it is known."""
    w, leaves = st.candidates, span > 0
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
def _near_context(digit, low, high, halved, context):
    """The context below ``context`` for where the guessed place lies; ``context`` if nothing is guessed."""
    if digit.known == NONE:
        return context
    step = 4 * digit.again + min(halved, 3)
    # as of ``contexts.near_class``, of the distance in quarters of what is left
    left = high - low
    far = digit.guess - 4 * ((low + high) >> 1)
    near = by_few(min(max(far + ctx.NEAR * left, 0), 2 * ctx.NEAR * left - 1), left)
    return ctx.OFFSET_NEAR + (2 * step + (digit.known == FINE)) * 2 * ctx.NEAR + near


@inlined
def code_half(st, cd, digit, low, high, halved, nearer, bit):
    """Code whether the crossing lies in the second half of the parts from ``low`` to ``high``; as ``code``.

    The digit was halved ``halved`` times before; ``nearer`` as of ``_see_along``.
    """
    split = (low + high) >> 1
    grid = digit.span == 0
    sides = 3 * _side(digit.recent, low, split, high) + _side(digit.recent_too, low, split, high)
    context = ctx.OFFSET + (8 * digit.again + min(halved, 7)) * 9 + sides
    if nearer >= 0:
        context = ctx.OFFSET_LEAN + min(bits(nearer), 7) * 16 + min(high - low, 15)
    if not mixing(cd):
        return code_below(cd, _near_context(digit, low, high, halved, context), context, bit)
    kind = OFFSET_KIND + min(halved, 2) + 3 * digit.again + (0 if grid else 6)
    if nearer >= 0:
        kind = LEAN_KIND + min(halved, 2) + (0 if grid else 3)
    _see_along(st, cd, digit, low, high, nearer)
    return blended(cd, OFFSET_NET if grid else LEAF_NET, False, kind, context, bit)
