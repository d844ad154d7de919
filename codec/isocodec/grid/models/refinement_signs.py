"""Signs of middles: prediction by the parabola, and what the main profile sees (spec clauses 7.6, 7.12)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...entropy.mixer import blended, clear, mixing, see
from ...entropy.range_coder import code
from ...kernel import inlined
from ...kernel.types import Integer
from ..lattice.access import corner, dimension
from ..lattice.diamond import corner_position, middle_position
from ..tube.leaf_list import ones
from ..tube.state import ALWAYS, entry
from . import contexts as ctx
from .frame_before import Spot, see_before
from .magnitude import bits
from .neighbourhood import see_around, survey
from .network_rows import EARLIER_ROWS, MANNER_ROWS, REFINE_KIND, SIGN_NET, SIGN_ROWS
from .parabola import MOST, nearer
from .significance import rarity

_SIGN_ROWS_2, _SIGN_ROWS_3 = SIGN_ROWS[2], SIGN_ROWS[3]
FAR = 64
"""Squared distance (doubled coordinates, units of g) from which points belong to different stretches of curve."""


class Expected(NamedTuple):
    """Prediction of the sign of a middle (spec clause 7.6).

    Attributes
    ----------
    crossed : bool
        Whether the ends of its edge differ.
    guess : int
        The sign that is likely.
    said : int
        What the parabola predicts: 1 another one, 2 the same, 0 nothing.
    context : int
    case : int
        That of its context where the middle is missing.
    """

    crossed: bool
    guess: Integer
    said: Integer
    context: Integer
    case: Integer


class Before(NamedTuple):
    """The sign of a middle at the earlier isovalue, or -1, and how many known corners have another one there."""

    sign: Integer
    apart: Integer


@inlined
def ring(corners, above, wanted):
    """Number of ring corners, and of those with the sign ``wanted``."""
    ring = corners >> 2
    signs = above >> 2 if wanted else ~(above >> 2)
    return ones(ring), ones(signs & ring)


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
def half_of(st, diamond, end):
    """Sum of the middle and an end of its edge (twice the middle of that half) in units of g."""
    w0, w1 = diamond.w0, diamond.w1
    c0, c1, _ = corner(st.grid.tables, diamond.kind, end)
    return (w0 >> 2) * 4 + c0 + w0, (w1 >> 2) * 4 + c1 + w1


@inlined
def _side_of(st, diamond):
    """Predict by the parabola the half in which an edge is crossed: 1 at end 0, 2 at end 1, 0 no prediction."""
    a = half_of(st, diamond, np.int64(0))
    b = half_of(st, diamond, np.int64(1))
    case = nearer(st.trail, st.refinement.points, 1, (2 * diamond.w0, 2 * diamond.w1), a, b, False)
    return np.int64(0 if case == 0 else (1 if case < 0 else 2))


@inlined
def _expect_crossed(st, diamond, seen):
    """Where the ends of the edge differ: the sign of most of the ring, or the parabola's; its prediction; contexts."""
    first = seen.above & 1
    size, count = ring(seen.corners, seen.above, np.int64(1))
    guess = first
    said = np.int64(0)
    if dimension(st.grid.tables) == 2:
        said = _side_of(st, diamond)
        if said == 1:
            guess = 1 - first
    if 2 * count > size:
        guess = np.int64(1)
    elif 2 * count < size:
        guess = np.int64(0)
    if said != 0:
        said = np.int64(1 if (said == 1) == (guess != first) else 2)
    odd = min(count, size - count)
    context = ctx.REFINE_CROSSED + ((diamond.phase * 10 + odd) * 3 + said) * 4 + st.refinement.crossed
    return guess, said, context, 4 * said + min(odd, 3)


@inlined
def _expect_border(st, diamond, seen):
    """Where the ends of the edge have one sign: that one; contexts."""
    first = seen.above & 1
    _, count = ring(seen.corners, seen.above, 1 - first)
    context = ctx.REFINE_BORDER + (diamond.phase * 10 + count) * 4 + st.refinement.border
    return first, np.int64(0), context, count


@inlined
def expected_sign(st, diamond, seen):
    """Predict the sign of a middle from what is seen of its diamond, inferred signs included."""
    crossed = (seen.above & 1) != (seen.above >> 1) & 1
    guess, said, context, case = _expect_crossed(st, diamond, seen) if crossed else _expect_border(st, diamond, seen)
    return Expected(crossed, guess, said, context, case)


@inlined
def append_point(st, p0, p1):
    """Append a point of the curve, forgetting the others if it is far from the last."""
    count = st.refinement.points
    if count > 0:
        last = 2 * ((count - 1) % MOST)
        d0 = p0 - st.trail[last]
        d1 = p1 - st.trail[last + 1]
        if d0 * d0 + d1 * d1 > FAR:
            count = 0
    st.trail[2 * (count % MOST)] = p0
    st.trail[2 * (count % MOST) + 1] = p1
    st.refinement.points = count + 1


@inlined
def see_middle(st, cd, diamond, expected, before):
    """List what the main profile sees around a middle (spec clause 7.12); whether its rows speak of the bit 0."""
    n = dimension(st.grid.tables)
    walk = st.refinement
    r, crossed, said, guess = diamond.phase, expected.crossed, expected.said, expected.guess
    first = r * (_SIGN_ROWS_2 if n == 2 else _SIGN_ROWS_3)
    clear(cd)
    see(cd, first + 4 * crossed + (walk.crossed if crossed else walk.border))
    here = see_around(st, cd, r, diamond.w0, diamond.w1, diamond.w2)
    target = guess if crossed else 1 - guess
    if said != 0:
        see(cd, first + 8 + ((said == 1) == (guess == here)))
    manner = first + (_SIGN_ROWS_2 if n == 2 else _SIGN_ROWS_3) - EARLIER_ROWS - MANNER_ROWS
    see(cd, manner + min(bits(st.counters.edge) - 1, 8))
    see(cd, manner + 9 + rarity(st))
    see(cd, manner + 22 + (st.calm[np.uint64(crossed)] >> 8))
    if before.sign >= 0:
        rows = manner + MANNER_ROWS
        apt = bits((ALWAYS - st.counters.agreed) >> 4)
        see(cd, rows + 30 * (before.sign == here) + 10 * min(before.apart, 2) + apt)
    return target != here, REFINE_KIND + 2 * r + crossed


@inlined
def ready(st, cd):
    """Before a middle is coded: the main profile keeps the board up to date. False if there is no room for it."""
    return not mixing(cd) or survey(st)


@inlined
def code_middle(st, cd, diamond, expected, before, hole, bit):
    """Code whether a middle has the expected sign, or, between ends of one sign, the other one; as ``code``.

    ``hole`` is set if the middle is missing.
    """
    context = expected.context
    if hole:
        element = np.int64(ctx.CROSSED_HOLE if expected.crossed else ctx.BORDER_HOLE)
        context = ctx.hole_context(cd, element, expected.case)
    elif before.sign >= 0:
        bank = np.int64(ctx.CROSSED if expected.crossed else ctx.BORDER)
        context += bank * (1 + 2 * min(before.apart, 2) + (before.sign == expected.guess))
    if not mixing(cd):
        return code(cd, context, bit)
    flip, kind = see_middle(st, cd, diamond, expected, before)
    x, y, z = middle_position(diamond)
    target = expected.guess if expected.crossed else 1 - expected.guess
    spot = Spot(x, y, z, st.counters.edge)
    see_before(st, cd, spot, target, 2 * diamond.phase + expected.crossed, before.sign)
    return blended(cd, SIGN_NET + diamond.phase, flip, kind + 6 * (before.sign >= 0), context, bit)
