"""Refinement: one round bisects simplices of one level of the tubular neighbourhood (spec clauses 5.4, 5.8).

Rows C2-refine-uniform, C2-refine-adaptive. The active middles come in order, block by block; when all of them are
known the corners of their diamonds become known. An adaptive round asks for each middle whether it is added; a uniform
one adds them all.
"""

from __future__ import annotations

import numpy as np

from ...entropy.mixer import mixing
from ...entropy.range_coder import ENCODE, ONE, Coder, code
from ...kernel import BAD, DONE, GROW, inlined, kernel
from ...kernel.bit_length import bit_length
from ...kernel.types import Int32Matrix, IntMatrix, IntVector
from ..lattice.access import below, dimension, middle, twins, vertex
from ..lattice.diamond import diamond_at, existing, middle_position
from ..lattice.grid import clamped, cycle_of, phase_of
from ..lattice.order import DIGITS, key_bits, order_key, point_of, sort
from ..lattice.simplex import middle_at
from ..lattice.store import get, put, spot
from ..lattice.vertex_set import IN, KEPT, has
from ..models import contexts as ctx
from ..models.mesh_questions import OF_LEAF, Question, ask, nearby
from ..models.neighbourhood import corners_around
from ..models.refinement_signs import (
    Before,
    anchored,
    apart_from,
    code_middle,
    context_of,
    expected_sign,
    ready,
)
from ..tube.inference import implied
from ..tube.leaf_list import child_at, level_of, ones, push, push_row, unpacked
from ..tube.state import (
    AGREED_SHIFT,
    ALWAYS,
    CONTINUE,
    PREDICTED,
    PREDICTED_RIGHT,
    REFINEMENT_SIGN,
    SPLIT,
    State,
    crowded,
    learn_at,
    tired,
    truth,
)
from .adaptive_mesh import BARRED, admit, closure, short
from .bisection import Known, bisect, look, with_middle, with_signs

TORN = 7
"""Error: two diamonds give a corner different signs."""
_KNOWN, _CORNERS, _WHOLE = 12, 12, 24
"""Bits of a row of ``State.active`` at which what is known begins, behind the signs, and corners, behind members."""


@inlined
def _look(st, cd, diamond):
    """Look up what is known of a diamond: in the main profile on the board."""
    if not mixing(cd):
        return look(st, diamond)
    w0, w1, w2 = diamond.w0, diamond.w1, diamond.w2
    whole, members, corners = existing(st.grid, diamond.edge, diamond.phase, diamond.kind, w0, w1, w2)
    known, above = corners_around(st, diamond, corners)
    return Known(whole, members, corners, known, above)


@inlined
def _assumed(st, diamond, seen):
    """Let corners that are not known have the sign of the anchor (clause 5.4.3)."""
    return with_signs(seen, seen.above | seen.corners & ~seen.known) if anchored(st, diamond, seen) else seen


@inlined
def _split(st, cd, diamond):
    """Code Refine or Keep: IN if the middle is in the mesh, KEPT if not, or the coder's status, or GROW.

    Keep bars the middle and its descendants until the layer's end; what its refinement implies costs nothing.
    """
    x, y, z = middle_position(diamond)
    state = get(st.mesh, x, y, z)
    if state & (IN | KEPT):
        return state
    level = st.counters.level
    count = closure(st, level, x, y, z, np.int64(0))
    bit = np.int64(0)
    if count != BARRED:
        if short(st, count):
            return np.int64(GROW)
        if cd.reg.mode == ENCODE:
            bit = np.int64(has(st.chosen, x, y, z))
        seen = look(st, diamond)
        crossed = (seen.above & 1) != (seen.above >> 1) & 1
        size, above = ones(seen.corners >> 2), ones(seen.above >> 2)
        case = (diamond.phase * 2 + crossed) * 4 + min(above, size - above, 3)
        around = nearby(st, diamond)
        bit = ask(st, cd, Question(OF_LEAF, around, level, x, y, z), ctx.SPLIT + case * 8 + around, bit)
        if bit < 0:
            return bit
        st.tally[SPLIT] += 1
    if bit == 0:
        put(st.mesh, x, y, z, KEPT)
        return np.int64(KEPT)
    admit(st, count)
    return np.int64(IN)


@kernel
def pending(st: State) -> bool:
    """Encoder: whether some leaf of this level or a later one is to be bisected in an adaptive layer."""
    for i in range(st.counters.leaves):
        code, level = np.int64(st.leaf[i, 0]), np.int64(st.leaf[i, 4])
        b0, b1, b2 = np.int64(st.leaf[i, 1]), np.int64(st.leaf[i, 2]), np.int64(st.leaf[i, 3])
        if code >= 0:
            if _chosen(st, level, code, b0, b1, b2):
                return True
            continue
        kind, children = unpacked(code)
        c = np.int64(0)
        while children >> c:
            cls, d0, d1, d2 = child_at(st.grid.tables, kind, c, b0, b1, b2)
            if children >> c & 1 and _chosen(st, level + 1, cls, d0, d1, d2):
                return True
            c += 1
    return False


@inlined
def _chosen(st, level, cls, b0, b1, b2):
    """Encoder: whether the middle of a leaf is one that this round or a later one adds."""
    if level < st.counters.level or level >= st.grid.exponent * dimension(st.grid.tables):
        return False
    x, y, z = middle_at(st.grid, level, cls, b0, b1, b2)
    return has(st.chosen, x, y, z)


@kernel
def go_on(st: State, cd: Coder, more: int) -> int:
    """Cont/Stop before a round of an adaptive layer; the answer is left in the first register."""
    bit = code(cd, ctx.CONTINUE, more)
    if bit < 0:
        return bit
    st.tally[CONTINUE] += 1
    st.refinement.more = bit
    return DONE


@inlined
def _sign(st, cd, diamond, seen):
    """The sign of a middle, as an earlier isovalue implies it or as it is coded; or the coder's status."""
    x, y, z = middle_position(diamond)
    sign, other = implied(st, x, y, z)
    if sign >= 0:
        return sign
    expected = expected_sign(st, diamond, seen)
    crossed, guess = expected.crossed, expected.guess
    apart = np.int64(0)
    if other >= 0:
        apart = apart_from(st, diamond, seen)
    bit = np.int64(0)
    if cd.reg.mode == ENCODE:
        bit = np.int64((truth(st, x, y, z) == guess) == crossed)
    before = Before(other, apart)
    context = context_of(expected, before)
    likely = np.int64(cd.prob[np.uint64(context)] > ONE >> 1)
    bit = code_middle(st, cd, diamond, seen, expected, before, context, bit)
    if bit < 0:
        return bit
    right = bit == crossed
    st.tally[REFINEMENT_SIGN] += 1
    st.tally[PREDICTED] += 1
    st.tally[PREDICTED_RIGHT] += bit == likely
    st.calm[np.uint64(crossed)] += (ALWAYS * right - st.calm[np.uint64(crossed)]) >> AGREED_SHIFT
    sign = guess if right else 1 - guess
    if other >= 0 and apart == 0:
        st.counters.agreed += (ALWAYS * (sign == other) - st.counters.agreed) >> AGREED_SHIFT
    return sign


@inlined
def _list_key(key, count, last, one):
    """List a key, unless it is among the last ones, or there is no room; how many there are then, room or not."""
    at = np.uint64(one & DIGITS - 1)
    if last[at] == one:
        return count
    last[at] = one
    if count < key.shape[1]:
        key[0, np.uint64(count)] = one
    return count + 1


@kernel
def list_middles(st: State, key: IntMatrix, place: IntVector) -> int:
    """List the middles of the leaves of the round's level in order, each once; how many there are.

    They are in row 0 of ``key`` (2, M), as numbers of ``order_key``. If M is too small, nothing is listed; returned is
    then how large it must be, less than 0. Leaves with the same middle are near one another: until they are sorted,
    ``place`` has the last keys, and most are found there; then it has the numbers that `sort` counts.
    """
    t, count = st.grid.tables, 0
    n = dimension(t)
    r, bits = phase_of(n, st.counters.level), cycle_of(n, st.counters.level) + 2
    place[:] = -1
    for i in range(st.counters.leaves):
        code, level = np.int64(st.leaf[i, 0]), np.int64(st.leaf[i, 4])
        if level_of(code, level) != st.counters.level:
            continue
        b0, b1, b2 = np.int64(st.leaf[i, 1]), np.int64(st.leaf[i, 2]), np.int64(st.leaf[i, 3])
        if code >= 0:
            count = _list_key(key, count, place, order_key(n == 2, bits, *middle(t, r, code, b0, b1, b2)))
            continue
        kind, children = unpacked(code)
        while children != 0:
            c = bit_length(children) - 1
            # children of a diamond share middles
            children &= ~(np.int64(1) << c | np.int64(twins(t, kind, c)))
            count = _list_key(key, count, place, order_key(n == 2, bits, *below(t, kind, c, b0, b1, b2)))
    if count > key.shape[1]:
        return -count
    row = sort(key, count, key_bits(n == 2, bits), place)
    found, before = 0, np.int64(-1)
    for i in range(count):
        one = key[row, i]
        if one != before:
            key[0, found] = one
            found += 1
        before = one
    return found


@kernel
def enter_middles(st: State, key: IntMatrix, active: Int32Matrix) -> None:
    """Enter the middles that are listed in row 0 of ``key``, as many as ``active`` has rows."""
    n = dimension(st.grid.tables)
    bits = cycle_of(n, st.counters.level) + 2
    for i in range(len(active)):
        w0, w1, w2 = point_of(n == 2, bits, np.int64(key[0, i]))
        active[i, 0], active[i, 1], active[i, 2] = w0, w1, w2


@kernel
def places(st: State, rows: Int32Matrix, out: IntMatrix) -> None:
    """Middles of leaves, and the sums of their vertices, both in units of g; rows of class, block and level."""
    t = st.grid.tables
    n = dimension(t)
    for i in range(len(rows)):
        cls, r = np.int64(rows[i, 0]), phase_of(n, np.int64(rows[i, 4]))
        b0, b1, b2 = np.int64(rows[i, 1]), np.int64(rows[i, 2]), np.int64(rows[i, 3])
        out[i, 0], out[i, 1], out[i, 2] = middle(t, r, cls, b0, b1, b2)
        out[i, 3], out[i, 4], out[i, 5] = 4 * (n + 1) * b0, 4 * (n + 1) * b1, 4 * (n + 1) * b2
        for j in range(n + 1):
            d0, d1, d2 = vertex(t, r, cls, j)
            out[i, 3] += d0
            out[i, 4] += d1
            out[i, 5] += d2


@inlined
def _diamond(st, row):
    """The diamond of an active middle."""
    r = phase_of(dimension(st.grid.tables), st.counters.level)
    return diamond_at(st.grid, st.counters.edge, r, np.int64(row[0]), np.int64(row[1]), np.int64(row[2]))


@inlined
def _signs(st, cd):
    """Code the signs of the active middles from number ``coded`` on, in order, until all are known."""
    while st.counters.coded < st.counters.active:
        if crowded(st) or not ready(st, cd):
            return np.int64(GROW)
        if tired(st):
            return np.int64(BAD)
        row = st.active[np.uint64(st.counters.coded)]
        diamond = _diamond(st, row)
        row[3] = -1
        if st.counters.asks:
            state = _split(st, cd, diamond)
            if state < 0:
                return state
            if state & KEPT:
                st.counters.coded += 1
                continue
        seen = _assumed(st, diamond, _look(st, cd, diamond))
        x, y, z = clamped(st.grid, *middle_position(diamond))
        page, cell = spot(st.known, x, y, z)
        e = np.int64(st.known.pages[np.uint64(page), np.uint64(cell)])
        sign = e & 1
        if e == 0:
            sign = _sign(st, cd, diamond, seen)
            if sign < 0:
                return sign
            learn_at(st, page, cell, x, y, z, sign)
        seen = with_middle(st, diamond, seen, sign)
        row[3] = seen.above | seen.known << _KNOWN
        row[4] = seen.members | seen.corners << _CORNERS | np.int64(seen.whole) << _WHOLE
        st.counters.coded += 1
    return np.int64(DONE)


@inlined
def _seen(row):
    """Unpack what was seen of the diamond of an active middle, assumed signs and the middle included."""
    most = (np.int64(1) << _KNOWN) - 1
    signs, there = np.int64(row[3]), np.int64(row[4])
    return Known(there >> _WHOLE != 0, there & most, there >> _CORNERS & most, signs >> _KNOWN, signs & most)


@inlined
def _corners(st):
    """Bisect the diamonds of the active middles from number ``bisected`` to ``coded``, which makes corners known."""
    while st.counters.bisected < st.counters.coded:
        if crowded(st):
            return np.int64(GROW)
        row = st.active[np.uint64(st.counters.bisected)]
        if row[3] >= 0 and not bisect(st, _diamond(st, row), _seen(row)):
            st.counters.error = TORN
            return np.int64(BAD)
        st.counters.bisected += 1
    return np.int64(DONE)


@inlined
def _stays(st, cls, b0, b1, b2):
    """Whether a leaf of the round's level was kept."""
    x, y, z = middle_at(st.grid, st.counters.level, cls, b0, b1, b2)
    return get(st.mesh, x, y, z) & KEPT != 0


@inlined
def _keep(st):
    """Take over the leaves of other levels, and those whose middle is kept."""
    while st.counters.done_leaves < st.counters.leaves:
        if crowded(st):
            return np.int64(GROW)
        i = st.counters.done_leaves
        code, level = np.int64(st.leaf[i, 0]), np.int64(st.leaf[i, 4])
        b0, b1, b2 = np.int64(st.leaf[i, 1]), np.int64(st.leaf[i, 2]), np.int64(st.leaf[i, 3])
        if level_of(code, level) != st.counters.level:
            push_row(st, i)
        elif not st.counters.asks:
            pass
        elif code >= 0:
            if _stays(st, code, b0, b1, b2):
                push_row(st, i)
        else:
            kind, children = unpacked(code)
            c = np.int64(0)
            while children >> c:
                cls, d0, d1, d2 = child_at(st.grid.tables, kind, c, b0, b1, b2)
                if children >> c & 1 and _stays(st, cls, d0, d1, d2):
                    push(st, cls, d0, d1, d2, level + 1)
                c += 1
        st.counters.done_leaves = i + 1
    return np.int64(DONE)


@kernel
def refine(st: State, cd: Coder) -> int:
    """Go on with a round: signs first, then corners, then the leaves that stay."""
    status = _signs(st, cd)
    if status == DONE:
        status = _corners(st)
    return _keep(st) if status == DONE else status


@kernel
def corners(st: State) -> int:
    """Make the corners of the diamonds known that have been coded: in a copy of the state, for a drawing."""
    return _corners(st)
