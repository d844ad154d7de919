"""Signs of middles: the parabola's say and what the main profile sees (spec clauses 7.6, 7.12)."""

from __future__ import annotations

import numpy as np

from ..entropy.mixer import clear, see
from ..kernel import inlined
from ..mesh.access import corner, dimension
from ..mesh.grid import position
from ..tube.leaf_list import ones
from ..tube.state import ALWAYS, entry
from .layout import EARLIER_ROWS, MANNER_ROWS, REFINE_KIND, SIGN_ROWS
from .magnitude import bits
from .neighbourhood import see_around
from .new_components import rarity
from .parabola import MOST, nearer

_SIGN_ROWS_2, _SIGN_ROWS_3 = SIGN_ROWS[2], SIGN_ROWS[3]
FAR = 64
"""Squared distance (doubled coordinates, units of g) from which points belong to different stretches of curve."""


@inlined
def ring(corners, above, wanted):
    """Number of ring corners, and of those with the sign ``wanted``."""
    ring = corners >> 2
    signs = above >> 2 if wanted else ~(above >> 2)
    return ones(ring), ones(signs & ring)


@inlined
def apart_from(st, kind, w0, w1, w2, known, above):
    """Number of known corners that have another sign at the earlier isovalue."""
    edge = st.counters.edge
    count = 0
    i = 0
    while known >> i:
        if (known >> i) & 1:
            x, y, z = position(edge, w0 >> 2, w1 >> 2, w2 >> 2, corner(st.grid.tables, kind, np.int64(i)))
            e = entry(st.lean, x, y, z)
            count += e != 0 and (e & 1) != (above >> i) & 1
        i += 1
    return count


@inlined
def half_of(st, kind, w0, w1, end):
    """Sum of the middle and an end of its edge (twice the middle of that half) in units of g."""
    c0, c1, _ = corner(st.grid.tables, kind, end)
    return (w0 >> 2) * 4 + c0 + w0, (w1 >> 2) * 4 + c1 + w1


@inlined
def side_of(st, kind, w0, w1):
    """What the parabola says of an edge that is crossed: 1 in the half at end 0, 2 at end 1, 0 no prediction."""
    end = np.int64(0)
    a0, a1 = half_of(st, kind, w0, w1, end)
    b0, b1 = half_of(st, kind, w0, w1, end + 1)
    case = nearer(st.trail, st.refinement.points, 1, 2 * w0, 2 * w1, a0, a1, b0, b1)
    return 0 if case == 0 else (1 if case < 0 else 2)


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
def see_middle(st, cd, r, w0, w1, w2, crossed, said, guess, earlier, apart):
    """List what the main profile sees around a middle (spec clause 7.12); whether its rows speak of the bit 0."""
    n = dimension(st.grid.tables)
    walk = st.refinement
    first = r * (_SIGN_ROWS_2 if n == 2 else _SIGN_ROWS_3)
    clear(cd)
    see(cd, first + 4 * crossed + (walk.crossed if crossed else walk.border))
    here = see_around(st, cd, r, w0, w1, w2)
    target = guess if crossed else 1 - guess
    if said != 0:
        see(cd, first + 8 + ((said == 1) == (guess == here)))
    manner = first + (_SIGN_ROWS_2 if n == 2 else _SIGN_ROWS_3) - EARLIER_ROWS - MANNER_ROWS
    see(cd, manner + min(bits(st.counters.edge) - 1, 8))
    see(cd, manner + 9 + rarity(st))
    see(cd, manner + 22 + (st.calm[np.uint64(crossed)] >> 8))
    if earlier >= 0:
        rows = manner + MANNER_ROWS
        apt = bits((ALWAYS - st.counters.agreed) >> 4)
        see(cd, rows + 30 * (earlier == here) + 10 * min(apart, 2) + apt)
    return target != here, REFINE_KIND + 2 * r + crossed
