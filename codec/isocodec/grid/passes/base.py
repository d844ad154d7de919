"""Bases: localisation, first signs, depth-first traversal through gates (spec clauses 5.3 and 5.8).

Rows C2-localise, C2-uniform-base, C2-adaptive-base, S3-dfs. The pass is a small machine over its registers; every
step codes at most one symbol and changes nothing before the symbol is there, so that it can stop and resume at any.
A uniform base is an adaptive one without symbols for levels.
"""

from __future__ import annotations

import numpy as np

from ...entropy.range_coder import ENCODE, Coder, code
from ...kernel import BAD, DONE, GROW, inner, kernel
from ...kernel.types import Int32Matrix, IntVector
from ..lattice.access import dimension, roots
from ..lattice.access import root as root_class
from ..lattice.grid import edge_of, phase_of
from ..lattice.path import descend, unpacked
from ..lattice.simplex import Simplex, child_of, exists, middle_at
from ..lattice.store import Store, full
from ..models import contexts as ctx
from ..models.base_signs import code_seed
from ..models.mesh_questions import ON_PATH
from ..tube.inference import implied
from ..tube.state import (
    BASE_SIGN,
    COMPONENT,
    GATE,
    LOCATION,
    ORIGIN,
    STEP_VERTICES,
    State,
    corner_entry,
    corner_truth,
    crowded,
    entry,
    learn,
    tired,
)
from .adaptive_mesh import tell
from .gates import implied_corner, learn_corner, push_gates, traverse, visit, visited

_ORIGIN, _COMPONENT, _ROOT, _LOCATE, _SIGNS, _TRAVERSE, _DONE = range(7)
_ON = 0
"""Status of a phase that has made a step."""

NO_START, NOT_CROSSED = 1, 3
"""Errors: a component begins in a simplex that does not exist or was visited before; in one that the curve does not
cross."""


@inner
def _seed(st, cd, mark, seeds):
    """Go on with the leaves of an earlier isovalue as first simplices (S3-close-by, spec clause 5.9.4)."""
    n = dimension(st.grid.tables)
    walk = st.base
    i = walk.seed
    level, cls = np.int64(seeds[i, 4]), np.int64(seeds[i, 0])
    b0, b1, b2 = np.int64(seeds[i, 1]), np.int64(seeds[i, 2]), np.int64(seeds[i, 3])
    edge, r = edge_of(st.grid, level), phase_of(n, level)
    before = 0
    for j in range(n + 1):
        e = corner_entry(st, edge, r, cls, b0, b1, b2, j)
        if e != 0:
            before |= 1 << (e & 1)
    for number in range(n + 1):
        corner = np.int64(number)
        if corner_entry(st, edge, r, cls, b0, b1, b2, corner) != 0:
            continue
        bit, other = implied_corner(st, level, cls, b0, b1, b2, corner)
        if bit < 0:
            bit = np.int64(0)
            if cd.reg.mode == ENCODE:
                bit = corner_truth(st, edge, r, cls, b0, b1, b2, corner)
            bit = code_seed(st, cd, Simplex(level, cls, b0, b1, b2), corner, other, before, bit)
            if bit < 0:
                return bit
            st.tally[BASE_SIGN] += 1
            walk.before = bit
        learn_corner(st, level, cls, b0, b1, b2, corner, bit)
        return np.int64(0)
    walk.seed = i + 1
    if before == 3 and not visited(st, mark, level, cls, b0, b1, b2):
        walk.depth, walk.cls, walk.b0, walk.b1, walk.b2 = level, cls, b0, b1, b2
        walk.corner = n + 1
        walk.phase = _SIGNS
    return np.int64(0)


@inner
def _begin(st, cd, mark, seeds):
    """Seeds of an earlier isovalue, then the sign of the first sample (spec clauses 5.3.1, 5.9.4)."""
    walk = st.base
    encoding = cd.reg.mode == ENCODE
    if st.counters.seeded and walk.seed < len(seeds):
        status = _seed(st, cd, mark, seeds)
        if status < 0:
            return status
        return _ON
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
    return _ON


@inner
def _announce(st, cd, mark, order):
    """Whether another component follows (spec clause 5.3.2)."""
    walk = st.base
    encoding = cd.reg.mode == ENCODE
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
        walk.phase = _DONE
        return _ON
    walk.phase = _ROOT
    walk.corner = max(walk.last_root, 0)
    walk.tight = 1
    return _ON


@inner
def _choose_root(st, cd, order):
    """One symbol for each root from the last component's on: is it here? (spec clause 5.3.2)"""
    walk = st.base
    encoding = cd.reg.mode == ENCODE
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
    return _ON


@inner
def _descend(st, cd, mark, order):
    """One turn of the path to the component's first simplex (spec clause 5.3.2)."""
    n = dimension(st.grid.tables)
    walk = st.base
    encoding = cd.reg.mode == ENCODE
    depth = walk.depth
    cls, b0, b1, b2 = walk.cls, walk.b0, walk.b1, walk.b2
    x, y, z = middle_at(st.grid, depth, cls, b0, b1, b2)
    split = tell(st, cd, ON_PATH, depth, x, y, z, ctx.LEVEL_PATH + depth)
    if split < 0:
        return split
    if split == 0:
        if not exists(st.grid, edge_of(st.grid, depth), phase_of(n, depth), cls, b0, b1, b2) or visited(
            st, mark, depth, cls, b0, b1, b2
        ):
            st.counters.error = NO_START
            return BAD
        walk.corner = 0
        walk.phase = _SIGNS
        return _ON
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
    return _ON


@inner
def _first_sign(st, cd, mark):
    """One sign of the first simplex, or, with all of them, its gates (spec clause 5.3.3)."""
    n = dimension(st.grid.tables)
    walk = st.base
    encoding = cd.reg.mode == ENCODE
    j = walk.corner
    level, cls, b0, b1, b2 = walk.depth, walk.cls, walk.b0, walk.b1, walk.b2
    r = phase_of(n, level)
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
                learn_corner(st, level, cls, b0, b1, b2, j, 2 - before)
            else:
                bit, other = implied_corner(st, level, cls, b0, b1, b2, j)
                if bit < 0:
                    bit = np.int64(0)
                    if encoding:
                        bit = corner_truth(st, edge, r, cls, b0, b1, b2, j)
                    bit = code(cd, ctx.FIRST + 8 * (other + 1) + 4 * (j > 0) + before, bit)
                    if bit < 0:
                        return bit
                    st.tally[BASE_SIGN] += 1
                learn_corner(st, level, cls, b0, b1, b2, j, bit)
        walk.corner = j + 1
        return _ON
    signs = 0
    for i in range(n + 1):
        signs |= 1 << (corner_entry(st, edge, r, cls, b0, b1, b2, i) & 1)
    if signs != 3:
        st.counters.error = NOT_CROSSED
        return BAD
    visit(st, mark, level, cls, b0, b1, b2)
    push_gates(st, mark, level, cls, b0, b1, b2)
    walk.points = 0
    walk.early_points = 0
    walk.branch = st.counters.leaves - 1
    walk.phase = _TRAVERSE
    return _ON


@kernel
def base(st: State, cd: Coder, mark: Store, order: IntVector, seeds: Int32Matrix) -> int:
    """Run the pass until it is done or must stop.

    ``order`` are the encoder's leaves (``GroundTruth.mixed_leaves``), ``seeds`` the leaves of the isovalue that it
    leans on.
    """
    walk = st.base
    gates = dimension(st.grid.tables) + 1
    while walk.phase != _DONE:
        if crowded(st) or full(mark, STEP_VERTICES) or (walk.gates + gates) * GATE > len(st.stack):
            return GROW
        if tired(st):
            return BAD
        phase = walk.phase
        if phase == _TRAVERSE and walk.gates == 0:
            walk.phase = _ORIGIN
            status = _ON
        elif phase == _TRAVERSE:
            status = traverse(st, cd, mark)
        elif phase == _SIGNS:
            status = _first_sign(st, cd, mark)
        elif phase == _LOCATE:
            status = _descend(st, cd, mark, order)
        elif phase == _ROOT:
            status = _choose_root(st, cd, order)
        elif phase == _COMPONENT:
            status = _announce(st, cd, mark, order)
        else:
            status = _begin(st, cd, mark, seeds)
        if status < 0:
            return status
    return DONE
