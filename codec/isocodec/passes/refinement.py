"""Refinement: one round bisects simplices of one level of the tubular neighbourhood (spec clauses 5.4, 5.8).

Rows C2-refine-uniform, C2-refine-adaptive. The middles come in the order of the present leaves, so that the symbols
accompany the curve. An adaptive round asks for each middle whether it is added; a uniform one adds them all.
"""

from __future__ import annotations

import numpy as np

from ..entropy.mixer import blended, mixing
from ..entropy.range_coder import ENCODE, Coder, code
from ..kernel import BAD, DONE, GROW, inlined, kernel
from ..mesh.access import corners as corner_count
from ..mesh.access import dimension, member, middle
from ..mesh.access import kind as kind_of
from ..mesh.access import members as member_count
from ..mesh.simplex import middle_at
from ..mesh.store import get, put
from ..mesh.vertex_set import IN, KEPT, KNOWN, has
from ..models import contexts as ctx
from ..models.layout import SIGN_NET
from ..models.mesh_questions import OF_LEAF, ask
from ..models.neighbourhood import survey
from ..models.refinement_signs import (
    apart_from,
    append_point,
    half_of,
    ring,
    see_middle,
    side_of,
)
from ..tube.inference import implied
from ..tube.leaf_list import child_at, leaf_done, next_leaf, push, push_children, push_row, row_done, unpacked
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
from .bisection import bisect, bisect_member, look


@inlined
def _bisect_known(st, r, kind, w0, w1, w2, cls, b0, b1, b2, sign):
    """Bisect a leaf whose middle was known before the round: clamping put it on an older vertex (clause 5.4.4).

    Every mixed member of the diamond does so for itself; the first of them also bisects the members that are
    not mixed, which the curve may enter.
    """
    inside, members, corners, known, above = look(st, st.counters.edge, r, kind, w0, w1, w2)
    t = st.grid.tables
    if above & 1 and above & 2:
        above |= corners & ~known
    middle = np.int64(1) << corner_count(t, kind)
    known |= middle
    if sign:
        above |= middle
    first = True
    for m in range(member_count(t, kind)):
        if not (members >> m) & 1:
            continue
        q, d0, d1, d2, bits = member(t, kind, m)
        signs = above & bits
        mixed = signs != 0 and signs != bits
        same = q == cls and d0 == b0 - (w0 >> 2) and d1 == b1 - (w1 >> 2) and d2 == b2 - (w2 >> 2)
        if same and first:
            others = np.int64(0)
            for u in range(member_count(t, kind)):
                bits = member(t, kind, u)[4]
                plain = (above & bits) == 0 or (above & bits) == bits
                if (members >> u) & 1 and plain:
                    known, children = bisect_member(st, r, kind, u, w0, w1, w2, inside, known, above)
                    others |= children
            push_children(st, kind, w0, w1, w2, others)
        if same:
            known, children = bisect_member(st, r, kind, m, w0, w1, w2, inside, known, above)
            push_children(st, kind, w0, w1, w2, children)
        if mixed:
            first = False


@inlined
def _split(st, cd, kind, w0, w1, w2, x, y, z):
    """Refine or Keep: IN if the middle is in the mesh, KEPT if not, or what the coder says, or GROW.

    Keep bars the middle and its descendants until the layer's end; what its refinement implies costs nothing.
    """
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
        r = level % dimension(st.grid.tables)
        _, _, corners, _, above = look(st, st.counters.edge, r, kind, w0, w1, w2)
        crossed = (above & 1) != (above >> 1) & 1
        size, odd = ring(corners, above, np.int64(1))
        odd = min(odd, size - odd)
        case = (r * 2 + crossed) * 4 + min(odd, 3)
        bit = ask(st, cd, OF_LEAF, walk.splits, level, x, y, z, ctx.SPLIT + case * 8 + walk.splits, bit)
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


@kernel
def refine(st: State, cd: Coder) -> int:
    """Bisect the leaves from number ``DONE_LEAVES`` on, until all are done or the pass must stop."""
    n = dimension(st.grid.tables)
    walk = st.refinement
    r = st.counters.level % n
    edge = st.counters.edge
    encoding = cd.reg.mode == ENCODE
    asks = st.counters.asks != 0
    while st.counters.done_leaves < st.counters.leaves:
        t = st.grid.tables
        cls, b0, b1, b2, level = next_leaf(st)
        if level < 0:
            continue
        w0, w1, w2 = middle(t, r, cls, b0, b1, b2)
        x, y, z = (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1
        e = np.int64(0)
        if level == st.counters.level and not asks:
            e = entry(st, x, y, z)
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
        if mixing(cd) and not survey(st):
            return GROW
        kind = kind_of(t, r, w0, w1, w2)
        first_known = st.counters.before_round
        if asks:
            state = _split(st, cd, kind, w0, w1, w2, x, y, z)
            if state < 0:
                return state
            if state & KEPT:
                push(st, cls, b0, b1, b2, st.counters.level)
                leaf_done(st)
                continue
            # whether the middle was known is told by its mark: corners become known during the round, too
            first_known = st.counters.vertices if state & KNOWN else 0
            e = entry(st, x, y, z)
        if e != 0:
            if (e >> 1) - 1 < first_known:
                _bisect_known(st, r, kind, w0, w1, w2, cls, b0, b1, b2, e & 1)
            leaf_done(st)
            continue
        inside, members, corners, known, above = look(st, edge, r, kind, w0, w1, w2)
        first = above & 1
        crossed = first != (above >> 1) & 1
        said = 0
        if crossed:
            size, count = ring(corners, above, np.int64(1))
            guess = first
            if n == 2:
                said = side_of(st, kind, w0, w1)
                if said == 1:
                    guess = 1 - first
            if 2 * count > size:
                guess = np.int64(1)
            elif 2 * count < size:
                guess = np.int64(0)
            if said != 0:
                said = 1 if (said == 1) == (guess != first) else 2
            odd = min(count, size - count)
            context = ctx.REFINE_CROSSED + ((r * 10 + odd) * 3 + said) * 4 + walk.crossed
            bank = np.int64(ctx.CROSSED)
        else:
            if first:
                above |= corners & ~known
            size, count = ring(corners, above, 1 - first)
            guess = first
            context = ctx.REFINE_BORDER + (r * 10 + count) * 4 + walk.border
            bank = np.int64(ctx.BORDER)
        sign, other = implied(st, x, y, z)
        if sign < 0:
            apart = np.int64(0)
            if other >= 0:
                apart = apart_from(st, kind, w0, w1, w2, known, above)
                context += bank * (1 + 2 * min(apart, 2) + (other == guess))
            bit = np.int64(0)
            if encoding:
                bit = np.int64((truth(st, x, y, z) == guess) == crossed)
            if mixing(cd):
                flip, symbols = see_middle(st, cd, r, w0, w1, w2, crossed, said, guess, other, apart)
                bit = blended(cd, SIGN_NET + r, flip, symbols + 6 * (other >= 0), context, bit)
            else:
                bit = code(cd, context, bit)
            if bit < 0:
                return bit
            st.tally[REFINEMENT_SIGN] += 1
            st.tally[PREDICTED] += 1
            right = bit == crossed
            st.tally[PREDICTED_RIGHT] += right
            st.calm[np.uint64(crossed)] += (ALWAYS * right - st.calm[np.uint64(crossed)]) >> AGREED_SHIFT
            sign = guess if right else 1 - guess
            if crossed:
                walk.crossed = (walk.crossed << 1 & 2) | bit
            else:
                walk.border = (walk.border << 1 & 2) | bit
            if other >= 0 and apart == 0:
                st.counters.agreed += (ALWAYS * (sign == other) - st.counters.agreed) >> AGREED_SHIFT
        if crossed and n == 2:
            p0, p1 = half_of(st, kind, w0, w1, np.int64(sign == first))
            append_point(st, p0, p1)
        bisect(st, r, kind, w0, w1, w2, inside, members, known, above, sign)
        leaf_done(st)
    return DONE
