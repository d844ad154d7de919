"""Bases: localisation, first signs, depth-first traversal through gates (spec clauses 5.3 and 5.8).

Rows C2-localise, C2-uniform-base, C2-adaptive-base, S3-dfs. The pass is a small machine over ``State.walk``; every step
codes at most one symbol and changes nothing before the symbol is there, so that it can stop and resume at any of them.
A uniform base is an adaptive one that has nothing to tell about levels.
"""

from __future__ import annotations

import numpy as np

from ..entropy.mixer import blended, mixing
from ..entropy.range_coder import ENCODE, MODE, Coder, adapt, code
from ..kernel import BAD, DONE, GROW, inlined, inner, kernel
from ..kernel.types import Int32Matrix, IntVector
from ..mesh.access import dimension, roots, vertex
from ..mesh.access import root as root_class
from ..mesh.grid import edge_of, position
from ..mesh.path import descend, unpacked
from ..mesh.simplex import child_of, exists, middle_at
from ..mesh.store import Store, full
from ..models import contexts as ctx
from ..models.base_signs import curve_context, edge_sum, see_behind, surface_context, turn_back
from ..models.layout import BASE_KIND, BASE_NET
from ..models.mesh_questions import ON_PATH
from ..models.parabola import MOST
from ..tube.inference import implied
from ..tube.state import (
    BASE_SIGN,
    COMPONENT,
    EARLY,
    ERROR,
    FINEST,
    GATE,
    LEAVES,
    LOCATION,
    ORIGIN,
    PREDICTED,
    PREDICTED_RIGHT,
    SEEDED,
    STEP_VERTICES,
    TALLY,
    TOLD,
    TRAIL,
    UNIFORM,
    State,
    corner_entry,
    corner_truth,
    crowded,
    entry,
    learn,
    tired,
)
from ..tube.walk import (
    B0,
    B1,
    B2,
    BEFORE,
    BRANCH,
    CLASS,
    CORNER,
    DEPTH,
    FRESH,
    GATES,
    HISTORY,
    ITEM,
    LAST_ROOT,
    PATH,
    PHASE,
    RESOLVED,
    SEED,
    TIGHT,
)
from .adaptive_mesh import BARRED, settle, tell
from .traversal import push_gates, resolve, visit, visited

# Phases.
_ORIGIN, _COMPONENT, _ROOT, _LOCATE, _SIGNS, _TRAVERSE = range(6)


@inlined
def _corner_learn(st, level, cls, b0, b1, b2, j, sign):
    n = dimension(st.grid.tables)
    x, y, z = position(edge_of(st.grid, level), b0, b1, b2, vertex(st.grid.tables, level % n, cls, j))
    learn(st, x, y, z, sign)


@inner
def _trouble(st, status):
    """What the pass returns when a question about the mesh was not answered."""
    if status == BARRED:
        st.at[ERROR] = 6
        return BAD
    return status


@inner
def _implied_corner(st, level, cls, b0, b1, b2, j):
    """What ``implied`` says of vertex j of a simplex."""
    x, y, z = position(
        edge_of(st.grid, level), b0, b1, b2, vertex(st.grid.tables, level % dimension(st.grid.tables), cls, j)
    )
    return implied(st, x, y, z)


@inner
def _seed(st, cd, mark, seeds):
    """Go on with the leaves of an earlier isovalue as first simplices (S3-close-by, spec clause 5.9.4)."""
    n = dimension(st.grid.tables)
    w = st.walk
    i = w[SEED]
    level, cls = np.int64(seeds[i, 4]), np.int64(seeds[i, 0])
    b0, b1, b2 = np.int64(seeds[i, 1]), np.int64(seeds[i, 2]), np.int64(seeds[i, 3])
    edge, r = edge_of(st.grid, level), level % n
    before = 0
    for j in range(n + 1):
        e = corner_entry(st, edge, r, cls, b0, b1, b2, j)
        if e != 0:
            before |= 1 << (e & 1)
    for number in range(n + 1):
        corner = np.int64(number)
        if corner_entry(st, edge, r, cls, b0, b1, b2, corner) != 0:
            continue
        bit, other = _implied_corner(st, level, cls, b0, b1, b2, corner)
        if bit < 0:
            bit = np.int64(0)
            if cd.reg[MODE] == ENCODE:
                bit = corner_truth(st, edge, r, cls, b0, b1, b2, corner)
            bit = code(cd, ctx.SEED + (max(other, 0) * 4 + before) * 2 + w[BEFORE], bit)
            if bit < 0:
                return bit
            st.at[TALLY + BASE_SIGN] += 1
            w[BEFORE] = bit
        _corner_learn(st, level, cls, b0, b1, b2, corner, bit)
        return np.int64(0)
    w[SEED] = i + 1
    if before == 3 and not visited(st, mark, level, cls, b0, b1, b2):
        w[DEPTH], w[CLASS], w[B0], w[B1], w[B2] = level, cls, b0, b1, b2
        w[CORNER] = n + 1
        w[PHASE] = _SIGNS
    return np.int64(0)


@kernel
def base(st: State, cd: Coder, mark: Store, order: IntVector, seeds: Int32Matrix) -> int:
    """Run the pass until it is done or must stop.

    ``order`` are the encoder's leaves (``seek.mixed_leaves``), ``seeds`` the leaves of the isovalue that it leans on.
    """
    n = dimension(st.grid.tables)
    w = st.walk
    encoding = cd.reg[MODE] == ENCODE
    adaptive = st.at[UNIFORM] != st.at[FINEST]
    settled = st.at[TOLD] != 0
    while True:
        if crowded(st) or full(mark, STEP_VERTICES) or (w[GATES] + n + 1) * GATE > len(st.stack):
            return GROW
        if tired(st):
            return BAD
        phase = w[PHASE]

        if phase == _ORIGIN:
            if st.at[SEEDED] and w[SEED] < len(seeds):
                status = _seed(st, cd, mark, seeds)
                if status < 0:
                    return _trouble(st, status)
                continue
            zero = np.int64(0)
            if entry(st, zero, zero, zero) == 0:
                bit, other = implied(st, zero, zero, zero)
                if bit < 0:
                    bit = code(cd, ctx.ORIGIN + other + 1, np.int64(encoding and st.truth[0, 0, 0]))
                    if bit < 0:
                        return bit
                    st.at[TALLY + ORIGIN] += 1
                learn(st, zero, zero, zero, bit)
            w[PHASE] = _COMPONENT

        elif phase == _COMPONENT:
            if encoding:
                while w[ITEM] < len(order):
                    level, cls, b0, b1, b2 = descend(st.grid, order[w[ITEM]])
                    if not visited(st, mark, level, cls, b0, b1, b2):
                        break
                    w[ITEM] += 1
            bit = code(cd, ctx.COMPONENT, np.int64(w[ITEM] < len(order)))
            if bit < 0:
                return bit
            st.at[TALLY + COMPONENT] += 1
            if bit == 0:
                return DONE
            w[PHASE] = _ROOT
            w[CORNER] = max(w[LAST_ROOT], 0)
            w[TIGHT] = 1

        elif phase == _ROOT:
            # one symbol for each root from the last component's on: is it here?
            root = w[CORNER]
            bit = np.int64(1)
            if root < roots(st.grid.tables) - 1:
                here = np.int64(0)
                if encoding:
                    here = np.int64(unpacked(order[w[ITEM]])[0] == root)
                bit = code(cd, ctx.ROOT, here)
                if bit < 0:
                    return bit
                st.at[TALLY + LOCATION] += 1
            if bit:
                if root != w[LAST_ROOT]:
                    w[TIGHT] = 0
                w[LAST_ROOT] = root
                w[CLASS] = root_class(st.grid.tables, root)
                w[B0] = 0
                w[B1] = 0
                w[B2] = 0
                w[DEPTH] = 0
                w[PHASE] = _LOCATE
            else:
                w[CORNER] += 1

        elif phase == _LOCATE:
            depth = w[DEPTH]
            cls, b0, b1, b2 = w[CLASS], w[B0], w[B1], w[B2]
            x, y, z = middle_at(st.grid, depth, cls, b0, b1, b2)
            split = tell(st, cd, ON_PATH, depth, x, y, z, ctx.LEVEL_PATH + depth)
            if split < 0:
                return _trouble(st, split)
            if split == 0:
                if not exists(st.grid, edge_of(st.grid, depth), depth % n, cls, b0, b1, b2) or visited(
                    st, mark, depth, cls, b0, b1, b2
                ):
                    st.at[ERROR] = 1
                    return BAD
                w[CORNER] = 0
                w[PHASE] = _SIGNS
                continue
            side = np.int64(0)
            k0, l0, l1, l2, left = child_of(st.grid, depth, w[CLASS], w[B0], w[B1], w[B2], side + 0)
            k1, r0, r1, r2, right = child_of(st.grid, depth, w[CLASS], w[B0], w[B1], w[B2], side + 1)
            # ascending order: along the last path nothing is left of it
            bit = np.int64(1)
            if not right:
                bit = np.int64(0)
            elif left and not (w[TIGHT] and w[PATH + depth]):
                want = np.int64(0)
                if encoding:
                    _, deep, path = unpacked(order[w[ITEM]])
                    want = (path >> (deep - 1 - depth)) & 1
                bit = code(cd, ctx.PATH + w[TIGHT], want)
                if bit < 0:
                    return bit
                st.at[TALLY + LOCATION] += 1
            if w[TIGHT] and bit != w[PATH + depth]:
                w[TIGHT] = 0
            w[PATH + depth] = bit
            w[CLASS] = k1 if bit else k0
            w[B0] = r0 if bit else l0
            w[B1] = r1 if bit else l1
            w[B2] = r2 if bit else l2
            w[DEPTH] = depth + 1

        elif phase == _SIGNS:
            j = w[CORNER]
            level, cls, b0, b1, b2 = w[DEPTH], w[CLASS], w[B0], w[B1], w[B2]
            r = level % n
            edge = edge_of(st.grid, level)
            if j <= n:
                if corner_entry(st, edge, r, cls, b0, b1, b2, j) == 0:
                    before = 0
                    unknown = 0
                    for i in range(n + 1):
                        e = corner_entry(st, edge, r, cls, b0, b1, b2, i)
                        if e == 0:
                            unknown += 1
                        else:
                            before |= 1 << (e & 1)
                    if unknown == 1 and before != 3:
                        _corner_learn(st, level, cls, b0, b1, b2, j, 2 - before)
                    else:
                        bit, other = _implied_corner(st, level, cls, b0, b1, b2, j)
                        if bit < 0:
                            bit = np.int64(0)
                            if encoding:
                                bit = corner_truth(st, edge, r, cls, b0, b1, b2, j)
                            bit = code(cd, ctx.FIRST + 8 * (other + 1) + 4 * (j > 0) + before, bit)
                            if bit < 0:
                                return bit
                            st.at[TALLY + BASE_SIGN] += 1
                        _corner_learn(st, level, cls, b0, b1, b2, j, bit)
                w[CORNER] = j + 1
                continue
            signs = 0
            for i in range(n + 1):
                signs |= 1 << (corner_entry(st, edge, r, cls, b0, b1, b2, i) & 1)
            if signs != 3:
                st.at[ERROR] = 3
                return BAD
            visit(st, mark, level, cls, b0, b1, b2)
            push_gates(st, mark, level, cls, b0, b1, b2)
            w[HISTORY] = 0
            w[FRESH] = 0
            w[BRANCH] = st.at[LEAVES] - 1
            w[PHASE] = _TRAVERSE

        else:
            if w[GATES] == 0:
                w[PHASE] = _ORIGIN
                continue
            g = (w[GATES] - 1) * GATE
            level, cls, b0, b1, b2 = st.stack[g + 6], st.stack[g], st.stack[g + 1], st.stack[g + 2], st.stack[g + 3]
            opp, left_from = st.stack[g + 4], st.stack[g + 5]
            if adaptive:
                status = resolve(st, cd, level, cls, b0, b1, b2, opp)
                if status < 0:
                    return _trouble(st, status)
                level, cls, opp = w[RESOLVED], w[RESOLVED + 1], w[RESOLVED + 5]
                b0, b1, b2 = w[RESOLVED + 2], w[RESOLVED + 3], w[RESOLVED + 4]
            if visited(st, mark, level, cls, b0, b1, b2):
                w[GATES] -= 1
                continue
            r = level % n
            edge = edge_of(st.grid, level)
            if adaptive:
                if not exists(st.grid, edge, r, cls, b0, b1, b2):
                    w[GATES] -= 1
                    continue
                status = np.int64(0) if settled else settle(st, level, cls, b0, b1, b2)
                if status < 0:
                    return _trouble(st, status)
            e = corner_entry(st, edge, r, cls, b0, b1, b2, opp)
            if n == 2:
                if left_from == w[BRANCH] and left_from != st.at[LEAVES] - 1:
                    turn_back(st)
                    w[BRANCH] = -1
                guess, context = curve_context(st, level, cls, b0, b1, opp)
            else:
                guess, context = surface_context(st, level, cls, b0, b1, b2, opp)
            if e == 0:
                sign, other = _implied_corner(st, level, cls, b0, b1, b2, opp)
                if sign < 0:
                    if other >= 0:
                        context += (ctx.SURFACE if n == 3 else 4) * (1 + (other == guess))
                    right_guess = np.int64(0)
                    if encoding:
                        right_guess = np.int64(corner_truth(st, edge, r, cls, b0, b1, b2, opp) == guess)
                    if mixing(cd):
                        case = context - (ctx.BASE_CURVE if n == 2 else ctx.BASE_SURFACE)
                        see_behind(st, cd, level, cls, b0, b1, b2, opp, guess, case, other)
                        bit = blended(cd, BASE_NET, False, BASE_KIND + r + 3 * (other >= 0), context, right_guess)
                    else:
                        bit = code(cd, context, right_guess)
                    if bit < 0:
                        return bit
                    st.at[TALLY + BASE_SIGN] += 1
                    st.at[TALLY + PREDICTED] += 1
                    st.at[TALLY + PREDICTED_RIGHT] += bit
                    sign = guess if bit else 1 - guess
                _corner_learn(st, level, cls, b0, b1, b2, opp, sign)
            else:
                adapt(cd, context, np.int64((e & 1) == guess))
            if n == 2:
                i = 1 if opp == 0 else 0
                g0, g1 = edge_sum(st, level, cls, b0, b1, i, 3 - opp - i)
                slot = w[HISTORY] % MOST
                w[TRAIL + 2 * slot] = g0
                w[TRAIL + 2 * slot + 1] = g1
                w[HISTORY] += 1
                if w[FRESH] < MOST and w[BRANCH] >= 0:
                    w[EARLY + 2 * w[FRESH]] = g0
                    w[EARLY + 2 * w[FRESH] + 1] = g1
                    w[FRESH] += 1
            w[GATES] -= 1
            visit(st, mark, level, cls, b0, b1, b2)
            push_gates(st, mark, level, cls, b0, b1, b2)
