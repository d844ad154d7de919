"""Signs of middles: contexts by the corners of their diamonds, and what the main profile sees (clauses 7.6, 7.12)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...entropy.mixer import blended, clear, mixing, see
from ...entropy.range_coder import code
from ...kernel import inlined
from ...kernel.types import Integer
from ..lattice.access import corners as corner_count
from ..lattice.access import dimension
from ..lattice.diamond import corner_position, middle_position
from ..tube.leaf_list import ones
from ..tube.state import ALWAYS, entry
from . import contexts as ctx
from .corner_patterns import ANCHOR_2, ANCHOR_3, CLASS, CLASSES, PATTERNS
from .frame_before import Spot, see_before
from .magnitude import bits
from .neighbourhood import see_around, survey
from .network_rows import AROUND, EARLIER_ROWS, MANNER_ROWS, REFINE_KIND, SIGN_NET, SIGN_ROW
from .significance import rarity

_FIRST_2, _FIRST_3 = np.array(SIGN_ROW[2]), np.array(SIGN_ROW[3])
_MANNER_2, _MANNER_3 = 2 * AROUND[2], 2 * AROUND[3]
_CLASSES_3 = np.array(CLASSES[3])
_FIRST_CLASS_3 = np.cumsum(_CLASSES_3) - _CLASSES_3


class Expected(NamedTuple):
    """Prediction of the sign of a middle (spec clause 7.6).

    Attributes
    ----------
    crossed : int
        Whether the ends of its edge differ.
    guess : int
        The sign that is likely.
    pattern : int
        Number of its context among those of ``crossed``.
    row : int
        The main profile's row for the signs of the corners.
    """

    crossed: Integer
    guess: Integer
    pattern: Integer
    row: Integer


class Before(NamedTuple):
    """The sign of a middle at the earlier isovalue, or -1, and how many known corners have another one there."""

    sign: Integer
    apart: Integer


@inlined
def apart_from(st, diamond, seen):
    """Number of known corners that have another sign at the earlier isovalue."""
    count = np.int64(0)
    i = np.int64(0)
    while seen.known >> i:
        if (seen.known >> i) & 1:
            x, y, z = corner_position(st.grid, diamond, i)
            e = entry(st.lean, x, y, z)
            count += e != 0 and (e & 1) != (seen.above >> i) & 1
        i += 1
    return count


@inlined
def anchored(st, diamond, seen):
    """Sign of the anchor of a diamond."""
    kind = np.uint64(diamond.kind)
    return (seen.above >> (ANCHOR_2[kind] if dimension(st.grid.tables) == 2 else ANCHOR_3[kind])) & 1


@inlined
def _other(st, diamond, first, d0, d1):
    """Whether the lattice point at a distance from a middle is known and has not the sign ``first``; n = 2."""
    e = entry(st, ((diamond.w0 + d0) * diamond.edge) >> 1, ((diamond.w1 + d1) * diamond.edge) >> 1, np.int64(0))
    return np.int64(e != 0 and (e & 1) != first)


@inlined
def _pattern_2(st, diamond, first, ring):
    """Number of the context of ring corners, both middles before, and how the edge lies; n = 2."""
    if diamond.phase == 0:
        way = (diamond.w0 ^ diamond.w1) >> 1 & 1
        before = _other(st, diamond, first, 0, -2) | _other(st, diamond, first, -2, 0) << 1
    else:
        way = diamond.w0 & 1
        before = _other(st, diamond, first, -1, -1) | _other(st, diamond, first, -1, 1) << 1
    return ring | before << 2 | way << 4 | diamond.phase << 5


@inlined
def expected_sign(st, diamond, seen):
    """Predict the sign of a middle from what is seen of its diamond, inferred signs included."""
    plane = dimension(st.grid.tables) == 2
    first = seen.above & 1 if plane else anchored(st, diamond, seen)
    other = (~seen.above if first else seen.above) & seen.corners
    # of the first two one is 0: that of the anchor, or of the first end
    other = other >> 1 | other & 1
    crossed, ring = other & 1, other >> 1
    size, count = corner_count(st.grid.tables, diamond.kind) - 2, ones(ring)
    guess = 1 - first if crossed and 2 * count > size else first
    if plane:
        row = 3 * crossed + (count if anchored(st, diamond, seen) == first else 2 - count)
        return Expected(crossed, guess, _pattern_2(st, diamond, first, ring), row)
    pattern = np.int64(CLASS[np.uint64(diamond.kind), np.uint64(other)])
    r = np.uint64(diamond.phase)
    return Expected(crossed, guess, pattern, pattern - _FIRST_CLASS_3[r] + crossed * _CLASSES_3[r])


@inlined
def see_middle(st, cd, diamond, seen, expected, before):
    """List what the main profile sees around a middle (spec clause 7.12); whether its rows speak of the bit 0."""
    plane = dimension(st.grid.tables) == 2
    r, crossed = diamond.phase, expected.crossed
    clear(cd)
    here = anchored(st, diamond, seen)
    see_around(st, cd, diamond, here)
    target = expected.guess if crossed else 1 - expected.guess
    manner = _FIRST_2[np.uint64(r)] + _MANNER_2 if plane else _FIRST_3[np.uint64(r)] + _MANNER_3
    see(cd, manner + min(bits(st.counters.edge) - 1, 8))
    see(cd, manner + 9 + rarity(st))
    see(cd, manner + 22 + (st.calm[np.uint64(crossed)] >> 8))
    if before.sign >= 0:
        rows = manner + MANNER_ROWS
        apt = bits((ALWAYS - st.counters.agreed) >> 4)
        see(cd, rows + 30 * (before.sign == here) + 10 * min(before.apart, 2) + apt)
    see(cd, manner + MANNER_ROWS + EARLIER_ROWS + expected.row)
    return target != here, REFINE_KIND + 2 * r + crossed


@inlined
def ready(st, cd):
    """Before a middle is coded: the main profile keeps the board up to date. False if there is no room for it."""
    return not mixing(cd) or survey(st)


@inlined
def context_of(expected, before):
    """Context of the sign of a middle (clause 7.6)."""
    context = np.int64(ctx.SIGN_CROSSED if expected.crossed else ctx.SIGN) + expected.pattern
    if before.sign >= 0:
        context += PATTERNS * (1 + 2 * min(before.apart, 2) + (before.sign == expected.guess))
    return context


@inlined
def code_middle(st, cd, diamond, seen, expected, before, context, bit):
    """Code whether a middle has the expected sign, or, between ends of one sign, the other one; as ``code``."""
    if not mixing(cd):
        return code(cd, context, bit)
    flip, kind = see_middle(st, cd, diamond, seen, expected, before)
    x, y, z = middle_position(diamond)
    target = expected.guess if expected.crossed else 1 - expected.guess
    spot = Spot(x, y, z, st.counters.edge)
    see_before(st, cd, spot, target, 2 * diamond.phase + expected.crossed, before.sign)
    return blended(cd, SIGN_NET + diamond.phase, flip, kind + 6 * (before.sign >= 0), context, bit)
