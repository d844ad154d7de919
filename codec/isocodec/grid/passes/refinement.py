"""Refinement: one round bisects simplices of one level of the tubular neighbourhood (spec clauses 5.4, 5.8).

Rows C2-refine-uniform, C2-refine-adaptive. The middles come in the order of the present leaves, so that the symbols
accompany the curve. An adaptive round asks for each middle whether it is added; a uniform one adds them all.
"""

from __future__ import annotations

import numpy as np

from ...entropy.range_coder import ENCODE, Coder, code
from ...kernel import BAD, DONE, GROW, inlined, kernel
from ..lattice.access import dimension, member, middle
from ..lattice.access import members as member_count
from ..lattice.diamond import diamond_at, middle_position
from ..lattice.simplex import Simplex, middle_at
from ..lattice.store import get, put
from ..lattice.vertex_set import IN, KEPT, KNOWN, has
from ..models import contexts as ctx
from ..models.mesh_questions import OF_LEAF, Question, ask
from ..models.refinement_signs import (
    Before,
    apart_from,
    append_point,
    code_middle,
    expected_sign,
    half_of,
    ready,
    ring,
)
from ..tube.holes import missing
from ..tube.inference import implied
from ..tube.leaf_list import child_at, leaf_done, next_leaf, push, push_row, row_done, unpacked
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
    entry,
    tired,
    truth,
)
from .adaptive_mesh import BARRED, admit, closure, short
from .bisection import bisect, bisect_member, look, push_bisected, with_middle, with_signs


@inlined
def _bisect_plain(st, diamond, seen, known):
    """Bisect the members of a diamond that are not mixed, which the curve may enter; returns the bits known then."""
    t = st.grid.tables
    children = np.int64(0)
    for m in range(member_count(t, diamond.kind)):
        bits = member(t, diamond.kind, m)[4]
        plain = (seen.above & bits) == 0 or (seen.above & bits) == bits
        if (seen.members >> m) & 1 and plain:
            known, more = bisect_member(st, diamond, m, seen, known)
            children |= more
    push_bisected(st, diamond, children)
    return known


@inlined
def _bisect_known(st, diamond, leaf, sign):
    """Bisect a leaf whose middle was known before the round: clamping put it on an older vertex (clause 5.4.4).

    Every mixed member of the diamond does so for itself; the first of them also bisects the members that are
    not mixed.
    """
    seen = look(st, diamond)
    t = st.grid.tables
    if seen.above & 1 and seen.above & 2:
        seen = with_signs(seen, seen.above | seen.corners & ~seen.known)
    seen = with_middle(st, diamond, seen, sign)
    known = seen.known
    c0, c1, c2 = leaf.b0 - (diamond.w0 >> 2), leaf.b1 - (diamond.w1 >> 2), leaf.b2 - (diamond.w2 >> 2)
    first = True
    for m in range(member_count(t, diamond.kind)):
        if not (seen.members >> m) & 1:
            continue
        cls, d0, d1, d2, bits = member(t, diamond.kind, m)
        signs = seen.above & bits
        mixed = signs != 0 and signs != bits
        same = cls == leaf.cls and d0 == c0 and d1 == c1 and d2 == c2
        if same and first:
            known = _bisect_plain(st, diamond, seen, known)
        if same:
            known, children = bisect_member(st, diamond, m, seen, known)
            push_bisected(st, diamond, children)
        if mixed:
            first = False


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
        walk = st.refinement
        if cd.reg.mode == ENCODE:
            bit = np.int64(has(st.chosen, x, y, z))
        seen = look(st, diamond)
        crossed = (seen.above & 1) != (seen.above >> 1) & 1
        size, odd = ring(seen.corners, seen.above, np.int64(1))
        odd = min(odd, size - odd)
        case = (diamond.phase * 2 + crossed) * 4 + min(odd, 3)
        question = Question(OF_LEAF, walk.splits, level, x, y, z)
        bit = ask(st, cd, question, ctx.SPLIT + case * 8 + walk.splits, bit)
        if bit < 0:
            return bit
        st.tally[SPLIT] += 1
        walk.splits = (walk.splits << 1 & 7) | bit
    if bit == 0:
        put(st.mesh, x, y, z, KEPT)
        return np.int64(KEPT)
    admit(st, count)
    if entry(st, x, y, z) != 0:
        put(st.mesh, x, y, z, IN | KNOWN)
    return get(st.mesh, x, y, z)


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
        kind, children, _ = unpacked(code)
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
    walk = st.refinement
    expected = expected_sign(st, diamond, seen)
    crossed, guess = expected.crossed, expected.guess
    apart = np.int64(0)
    if other >= 0:
        apart = apart_from(st, diamond, seen)
    bit = np.int64(0)
    if cd.reg.mode == ENCODE:
        bit = np.int64((truth(st, x, y, z) == guess) == crossed)
    bit = code_middle(st, cd, diamond, expected, Before(other, apart), missing(st, x, y, z), bit)
    if bit < 0:
        return bit
    right = bit == crossed
    st.tally[REFINEMENT_SIGN] += 1
    st.tally[PREDICTED] += 1
    st.tally[PREDICTED_RIGHT] += right
    st.calm[np.uint64(crossed)] += (ALWAYS * right - st.calm[np.uint64(crossed)]) >> AGREED_SHIFT
    sign = guess if right else 1 - guess
    if crossed:
        walk.crossed = (walk.crossed << 1 & 2) | bit
    else:
        walk.border = (walk.border << 1 & 2) | bit
    if other >= 0 and apart == 0:
        st.counters.agreed += (ALWAYS * (sign == other) - st.counters.agreed) >> AGREED_SHIFT
    return sign


@inlined
def _bisect_new(st, cd, diamond):
    """Bisect a diamond whose middle is not known yet."""
    seen = look(st, diamond)
    first = seen.above & 1
    crossed = first != (seen.above >> 1) & 1
    if first and not crossed:
        # a corner that is not known has the sign of both ends
        seen = with_signs(seen, seen.above | seen.corners & ~seen.known)
    sign = _sign(st, cd, diamond, seen)
    if sign < 0:
        return sign
    if crossed and dimension(st.grid.tables) == 2:
        p0, p1 = half_of(st, diamond, np.int64(sign == first))
        append_point(st, p0, p1)
    bisect(st, diamond, seen, sign)
    return np.int64(DONE)


@inlined
def _refine_leaf(st, cd, leaf, diamond, e):
    """Bisect a leaf of the round's level, or keep it; ``e`` is its middle's store entry, where it was looked up."""
    if not ready(st, cd):
        return np.int64(GROW)
    first_known = st.counters.before_round
    if st.counters.asks:
        state = _split(st, cd, diamond)
        if state < 0:
            return state
        if state & KEPT:
            push(st, leaf.cls, leaf.b0, leaf.b1, leaf.b2, leaf.level)
            return np.int64(DONE)
        # whether the middle was known is told by its mark: corners become known during the round, too
        first_known = st.counters.vertices if state & KNOWN else 0
        x, y, z = middle_position(diamond)
        e = entry(st, x, y, z)
    if e == 0:
        return _bisect_new(st, cd, diamond)
    if (e >> 1) - 1 < first_known:
        _bisect_known(st, diamond, leaf, e & 1)
    return np.int64(DONE)


@kernel
def refine(st: State, cd: Coder) -> int:
    """Bisect the leaves from number ``DONE_LEAVES`` on, until all are done or the pass must stop."""
    r = st.counters.level % dimension(st.grid.tables)
    edge = st.counters.edge
    asks = st.counters.asks != 0
    while st.counters.done_leaves < st.counters.leaves:
        cls, b0, b1, b2, level = next_leaf(st)
        if level < 0:
            continue
        w0, w1, w2 = middle(st.grid.tables, r, cls, b0, b1, b2)
        e = np.int64(0)
        if level == st.counters.level and not asks:
            e = entry(st, (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1)
            if e >> 1 > st.counters.before_round:
                leaf_done(st)
                continue
        if crowded(st):
            return GROW
        if tired(st):
            return BAD
        if level != st.counters.level:
            push_row(st, st.counters.done_leaves)
            row_done(st)
            continue
        leaf = Simplex(level, cls, b0, b1, b2)
        status = _refine_leaf(st, cd, leaf, diamond_at(st.grid, edge, r, w0, w1, w2), e)
        if status < 0:
            return status
        leaf_done(st)
    return DONE
