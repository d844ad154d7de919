"""Bases: localisation, first signs, depth-first traversal through gates (spec clauses 5.3 and 5.8).

Rows C2-localise, C2-uniform-base, C2-adaptive-base, S3-dfs. The pass is a small machine over its registers; every
step codes at most one symbol and changes nothing before the symbol is there, so that it can stop and resume at any.
A uniform base is an adaptive one that has nothing to tell about levels.
"""

from __future__ import annotations

import numpy as np

from ..entropy.mixer import blended, mixing
from ..entropy.range_coder import ENCODE, Coder, adapt, code
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
    GATE,
    LOCATION,
    ORIGIN,
    PREDICTED,
    PREDICTED_RIGHT,
    STEP_VERTICES,
    State,
    corner_entry,
    corner_truth,
    crowded,
    entry,
    learn,
    tired,
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
        st.counters.error = 6
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
    walk = st.base
    i = walk.seed
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
            if cd.reg.mode == ENCODE:
                bit = corner_truth(st, edge, r, cls, b0, b1, b2, corner)
            bit = code(cd, ctx.SEED + (max(other, 0) * 4 + before) * 2 + walk.before, bit)
            if bit < 0:
                return bit
            st.tally[BASE_SIGN] += 1
            walk.before = bit
        _corner_learn(st, level, cls, b0, b1, b2, corner, bit)
        return np.int64(0)
    walk.seed = i + 1
    if before == 3 and not visited(st, mark, level, cls, b0, b1, b2):
        walk.depth, walk.cls, walk.b0, walk.b1, walk.b2 = level, cls, b0, b1, b2
        walk.corner = n + 1
        walk.phase = _SIGNS
    return np.int64(0)


@kernel
def base(st: State, cd: Coder, mark: Store, order: IntVector, seeds: Int32Matrix) -> int:
    """Run the pass until it is done or must stop.

    ``order`` are the encoder's leaves (``seek.mixed_leaves``), ``seeds`` the leaves of the isovalue that it leans on.
    """
    n = dimension(st.grid.tables)
    walk = st.base
    encoding = cd.reg.mode == ENCODE
    adaptive = st.counters.uniform != st.counters.finest
    settled = st.counters.told != 0
    while True:
        if crowded(st) or full(mark, STEP_VERTICES) or (walk.gates + n + 1) * GATE > len(st.stack):
            return GROW
        if tired(st):
            return BAD
        phase = walk.phase

        if phase == _ORIGIN:
            if st.counters.seeded and walk.seed < len(seeds):
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
                    st.tally[ORIGIN] += 1
                learn(st, zero, zero, zero, bit)
            walk.phase = _COMPONENT

        elif phase == _COMPONENT:
            if encoding:
                while walk.item < len(order):
                    level, cls, b0, b1, b2 = descend(st.grid, order[walk.item])
                    if not visited(st, mark, level, cls, b0, b1, b2):
                        break
                    walk.item += 1
            bit = code(cd, ctx.COMPONENT, np.int64(walk.item < len(order)))
            if bit < 0:
                return bit
            st.tally[COMPONENT] += 1
            if bit == 0:
                return DONE
            walk.phase = _ROOT
            walk.corner = max(walk.last_root, 0)
            walk.tight = 1

        elif phase == _ROOT:
            # one symbol for each root from the last component's on: is it here?
            root = walk.corner
            bit = np.int64(1)
            if root < roots(st.grid.tables) - 1:
                here = np.int64(0)
                if encoding:
                    here = np.int64(unpacked(order[walk.item])[0] == root)
                bit = code(cd, ctx.ROOT, here)
                if bit < 0:
                    return bit
                st.tally[LOCATION] += 1
            if bit:
                if root != walk.last_root:
                    walk.tight = 0
                walk.last_root = root
                walk.cls = root_class(st.grid.tables, root)
                walk.b0 = 0
                walk.b1 = 0
                walk.b2 = 0
                walk.depth = 0
                walk.phase = _LOCATE
            else:
                walk.corner += 1

        elif phase == _LOCATE:
            depth = walk.depth
            cls, b0, b1, b2 = walk.cls, walk.b0, walk.b1, walk.b2
            x, y, z = middle_at(st.grid, depth, cls, b0, b1, b2)
            split = tell(st, cd, ON_PATH, depth, x, y, z, ctx.LEVEL_PATH + depth)
            if split < 0:
                return _trouble(st, split)
            if split == 0:
                if not exists(st.grid, edge_of(st.grid, depth), depth % n, cls, b0, b1, b2) or visited(
                    st, mark, depth, cls, b0, b1, b2
                ):
                    st.counters.error = 1
                    return BAD
                walk.corner = 0
                walk.phase = _SIGNS
                continue
            side = np.int64(0)
            k0, l0, l1, l2, left = child_of(st.grid, depth, walk.cls, walk.b0, walk.b1, walk.b2, side + 0)
            k1, r0, r1, r2, right = child_of(st.grid, depth, walk.cls, walk.b0, walk.b1, walk.b2, side + 1)
            # ascending order: along the last path nothing is left of it
            bit = np.int64(1)
            if not right:
                bit = np.int64(0)
            elif left and not (walk.tight and st.turns[depth]):
                want = np.int64(0)
                if encoding:
                    _, deep, path = unpacked(order[walk.item])
                    want = (path >> (deep - 1 - depth)) & 1
                bit = code(cd, ctx.PATH + walk.tight, want)
                if bit < 0:
                    return bit
                st.tally[LOCATION] += 1
            if walk.tight and bit != st.turns[depth]:
                walk.tight = 0
            st.turns[depth] = bit
            walk.cls = k1 if bit else k0
            walk.b0 = r0 if bit else l0
            walk.b1 = r1 if bit else l1
            walk.b2 = r2 if bit else l2
            walk.depth = depth + 1

        elif phase == _SIGNS:
            j = walk.corner
            level, cls, b0, b1, b2 = walk.depth, walk.cls, walk.b0, walk.b1, walk.b2
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
                            st.tally[BASE_SIGN] += 1
                        _corner_learn(st, level, cls, b0, b1, b2, j, bit)
                walk.corner = j + 1
                continue
            signs = 0
            for i in range(n + 1):
                signs |= 1 << (corner_entry(st, edge, r, cls, b0, b1, b2, i) & 1)
            if signs != 3:
                st.counters.error = 3
                return BAD
            visit(st, mark, level, cls, b0, b1, b2)
            push_gates(st, mark, level, cls, b0, b1, b2)
            walk.points = 0
            walk.early_points = 0
            walk.branch = st.counters.leaves - 1
            walk.phase = _TRAVERSE

        else:
            if walk.gates == 0:
                walk.phase = _ORIGIN
                continue
            g = (walk.gates - 1) * GATE
            level, cls, b0, b1, b2 = st.stack[g + 6], st.stack[g], st.stack[g + 1], st.stack[g + 2], st.stack[g + 3]
            opp, left_from = st.stack[g + 4], st.stack[g + 5]
            if adaptive:
                status = resolve(st, cd, level, cls, b0, b1, b2, opp)
                if status < 0:
                    return _trouble(st, status)
                level, cls, opp = walk.behind_level, walk.behind_cls, walk.behind_opposite
                b0, b1, b2 = walk.behind_b0, walk.behind_b1, walk.behind_b2
            if visited(st, mark, level, cls, b0, b1, b2):
                walk.gates -= 1
                continue
            r = level % n
            edge = edge_of(st.grid, level)
            if adaptive:
                if not exists(st.grid, edge, r, cls, b0, b1, b2):
                    walk.gates -= 1
                    continue
                status = np.int64(0) if settled else settle(st, level, cls, b0, b1, b2)
                if status < 0:
                    return _trouble(st, status)
            e = corner_entry(st, edge, r, cls, b0, b1, b2, opp)
            if n == 2:
                if left_from == walk.branch and left_from != st.counters.leaves - 1:
                    turn_back(st)
                    walk.branch = -1
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
                    st.tally[BASE_SIGN] += 1
                    st.tally[PREDICTED] += 1
                    st.tally[PREDICTED_RIGHT] += bit
                    sign = guess if bit else 1 - guess
                _corner_learn(st, level, cls, b0, b1, b2, opp, sign)
            else:
                adapt(cd, context, np.int64((e & 1) == guess))
            if n == 2:
                i = 1 if opp == 0 else 0
                g0, g1 = edge_sum(st, level, cls, b0, b1, i, 3 - opp - i)
                slot = walk.points % MOST
                st.trail[2 * slot] = g0
                st.trail[2 * slot + 1] = g1
                walk.points += 1
                if walk.early_points < MOST and walk.branch >= 0:
                    st.early[2 * walk.early_points] = g0
                    st.early[2 * walk.early_points + 1] = g1
                    walk.early_points += 1
            walk.gates -= 1
            visit(st, mark, level, cls, b0, b1, b2)
            push_gates(st, mark, level, cls, b0, b1, b2)
