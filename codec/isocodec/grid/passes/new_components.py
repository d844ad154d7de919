"""New components: added vertices that differ from all corners of their diamond (spec clause 5.5).

Their set is coded as a pruned tree over the cubes of the level, in time by their number. In a cube the middles
differ in which of their coordinates (in units of g) are odd: the slots.
"""

from __future__ import annotations

import numpy as np

from ...entropy.range_coder import ENCODE, Coder, code
from ...kernel import BAD, DONE, GROW, inlined, inner, kernel
from ...kernel.types import IntVector
from ..lattice.access import dimension
from ..lattice.diamond import coincident, corner_position, diamond_at, middle_position
from ..lattice.grid import clamped, phase_of
from ..lattice.slots import cubes, height, middle_of, slots
from ..lattice.store import PAGES, get
from ..lattice.vertex_set import IN
from ..models import contexts as ctx
from ..models.significance import CUBE, NODE, ROOT, SLOT, Node, add_birth, begin_round, code_significance
from ..tube.inference import implied, infer
from ..tube.leaf_list import ones
from ..tube.state import (
    OUT_OF_STEPS,
    SIGNIFICANCE,
    State,
    crowded,
    entry,
    learn,
    tired,
    truth,
)
from .adaptive_mesh import BARRED, admit, closure, short
from .bisection import bisect, look, with_middle, with_signs

UNPLACED = 4
"""Error: the encoder's list names a slot that no new component can lie in."""
FRAME = 7
"""A frame: height, cube at that height, Morton number, next child, number of significant children."""
SLOT_BITS = 2


@inner
def candidate(st, diamond):
    """Nearness (plus one) if the decoder cannot rule out a new component at a middle, else 0 (spec clause 5.5.1)."""
    x, y, z = middle_position(diamond)
    if entry(st, x, y, z) != 0:
        return 0
    level = st.counters.level
    seen = look(st, diamond)
    known, above = seen.known, seen.above
    if seen.members == 0 or (above != 0 and above != known):
        return 0
    if not seen.whole and coincident(
        st.grid, diamond.edge, diamond.kind, seen.corners, diamond.w0, diamond.w1, diamond.w2
    ):
        return 0
    meshed = st.counters.asks or st.mesh.head[PAGES] > 0
    if meshed and (get(st.mesh, x, y, z) & IN or closure(st, level, x, y, z, np.int64(0)) == BARRED):
        return 0
    count = ones(known)
    near = 0 if count == 0 else (1 if count <= 2 else 2)
    if known != 0 and st.counters.side != 0:
        # as an earlier isovalue implies it
        sign, other = implied(st, x, y, z)
        here = np.int64(above != 0)
        if sign == here:
            return 0
        if other >= 0 and other != here:
            near += 2
    return near + 1


@inlined
def _diamond_of(st, x, y, z, slot):
    """The diamond of a slot of a cube of the round."""
    n = dimension(st.grid.tables)
    r = phase_of(n, st.counters.level)
    w0, w1, w2 = middle_of(n, r, x, y, z, slot)
    return diamond_at(st.grid, st.counters.edge, r, w0, w1, w2)


@inner
def _nearest(st, x, y, z, first):
    """Greatest nearness (plus one) of the slots of a cube from number ``first`` on, 0 if all are ruled out."""
    n = dimension(st.grid.tables)
    out = np.int64(0)
    for slot in range(first, slots(n, phase_of(n, st.counters.level))):
        out = max(out, np.int64(candidate(st, _diamond_of(st, x, y, z, slot))))
    return out


@inlined
def _push_frame(st, h, x, y, z, number):
    o = st.tree.frames * FRAME
    frame = st.stack[o : o + FRAME]
    frame[0], frame[1], frame[2], frame[3], frame[4] = h, x, y, z, number
    frame[5] = frame[6] = 0
    st.tree.frames += 1


@inlined
def _wanted(items, i, number, shift):
    """Encoder: whether item i lies under the node ``number``, which has ``2**shift`` slots."""
    return np.int64(i < len(items) and (items[i] >> shift) == number)


@inner
def _sign_of_new(st, cd, diamond, seen):
    """Sign of a new component: other than that of the corners (spec clause 5.5.4); negative: no effect yet.

    Where none is known their sign is inferred; in adaptive meshes it may not be, and what is inferred is corrected.
    """
    if seen.known != 0:
        return np.int64(seen.above == 0)
    i = 0
    while not (seen.corners >> i) & 1:
        i += 1
    u0, u1, u2 = corner_position(st.grid, diamond, i)
    sign = infer(st, u0, u1, u2)
    if sign < 0:
        st.counters.error = OUT_OF_STEPS
        return np.int64(BAD)
    if st.counters.adapted:
        contrary = np.int64(0)
        if cd.reg.mode == ENCODE:
            x, y, z = middle_position(diamond)
            contrary = np.int64(sign == truth(st, x, y, z))
        contrary = code(cd, ctx.CONTRARY, contrary)
        if contrary < 0:
            return contrary
        st.tally[SIGNIFICANCE] += 1
        sign ^= contrary
    return 1 - sign


@inner
def _add(st, cd, x, y, z, slot):
    """Add the new component of a slot, with all its diamond (spec clause 5.5.4); negative: no effect yet."""
    diamond = _diamond_of(st, x, y, z, slot)
    seen = look(st, diamond)
    sign = _sign_of_new(st, cd, diamond, seen)
    if sign < 0:
        return sign
    m0, m1, m2 = middle_position(diamond)
    u0, u1, u2 = clamped(st.grid, m0, m1, m2)
    add_birth(st, cd, u0, u1, u2)
    if st.counters.asks:
        admit(st, closure(st, st.counters.level, m0, m1, m2, np.int64(0)))
    learn(st, m0, m1, m2, sign)
    seen = with_middle(st, diamond, with_signs(seen, np.int64(0) if sign else seen.corners), sign)
    bisect(st, diamond, seen)
    return np.int64(DONE)


@inlined
def _begin(st, cd, items):
    """The root of the tree, which covers all cubes."""
    begin_round(st)
    cubes0, cubes1, cubes2 = cubes(st.grid, st.counters.level)
    zero = np.int64(0)
    h = np.int64(height(max(cubes0, cubes1, cubes2)))
    want = np.int64(cd.reg.mode == ENCODE and len(items) > 0)
    bit = code_significance(st, cd, Node(NODE, h, zero, zero, zero, zero, ROOT, zero), want)
    if bit < 0:
        return bit
    st.tree.started = 1
    if bit:
        _push_frame(st, h, zero, zero, zero, zero)
    return np.int64(DONE)


@inlined
def _next_child(n, frame):
    """The next child of a frame: a node or cube of a node, or a slot of a cube. Its nearness is not known yet."""
    h, x, y, z, child, hits, zero = frame[0], frame[1], frame[2], frame[3], frame[5], frame[6], np.int64(0)
    if h == 0:
        return Node(SLOT, zero, x, y, z, hits, child, zero)
    x = 2 * x + (child >> (n - 1))
    y = 2 * y + ((child >> (n - 2)) & 1)
    z = 2 * z + (child & 1 if n == 3 else 0)
    return Node(CUBE if h == 1 else NODE, h - 1, x, y, z, hits, child, zero)


@inlined
def _nearness(st, node):
    """Nearness (plus one) of a node, 0 if no new component can lie there; of a slot, whether none can in later ones."""
    if node.what == NODE:
        return np.int64(1), False
    if node.what == CUBE:
        return _nearest(st, node.x, node.y, node.z, np.int64(0)), False
    near = np.int64(candidate(st, _diamond_of(st, node.x, node.y, node.z, node.child)))
    return near, near > 0 and _nearest(st, node.x, node.y, node.z, node.child + 1) == 0


@inlined
def _lacks_room(st, node):
    """Whether the store of the mesh lacks room for the new component of a slot and its ancestors."""
    if node.what != SLOT or not st.counters.asks:
        return False
    x, y, z = middle_position(_diamond_of(st, node.x, node.y, node.z, node.child))
    return short(st, closure(st, st.counters.level, x, y, z, np.int64(0)))


@inlined
def _descend(st, cd, items, extent, frame):
    """Go on to the next child of a frame, of a tree over ``extent`` cubes along each axis."""
    n = dimension(st.grid.tables)
    fan = 1 << n
    walk = st.tree
    node = _next_child(n, frame)
    what, shift, child = node.what, node.shift, node.child
    if (node.x << shift) >= extent[0] or (node.y << shift) >= extent[1] or (node.z << shift) >= extent[2]:
        frame[5] = child + 1
        return np.int64(DONE)
    near, last = _nearness(st, node)
    if near == 0:
        frame[5] = child + 1
        return np.int64(DONE)
    if what != SLOT:
        last = child == fan - 1
    if _lacks_room(st, node):
        return np.int64(GROW)
    number = frame[4] << (SLOT_BITS if what == SLOT else n) | child
    bit = np.int64(1)
    if node.hits > 0 or not last:
        want = np.int64(0)
        if cd.reg.mode == ENCODE:
            want = _wanted(items, walk.item, number, np.int64(0) if what == SLOT else SLOT_BITS + n * shift)
        node = Node(what, shift, node.x, node.y, node.z, node.hits, child, near - 1)
        bit = code_significance(st, cd, node, want)
        if bit < 0:
            return bit
    frame[5] = child + 1
    if bit == 0:
        return np.int64(DONE)
    frame[6] = node.hits + 1
    if what == SLOT:
        walk.item += 1
        walk.adding = 1
    else:
        _push_frame(st, shift, node.x, node.y, node.z, number)
    return np.int64(DONE)


@kernel
def significance(st: State, cd: Coder, items: IntVector) -> int:
    """Code the set of new components of the round, adding each to the mesh.

    ``items`` is the encoder's sorted list (``find``), empty for the decoder.
    """
    n = dimension(st.grid.tables)
    walk = st.tree
    per_cube = slots(n, phase_of(n, st.counters.level))
    extent = cubes(st.grid, st.counters.level)
    if walk.started == 0:
        status = _begin(st, cd, items)
        if status < 0:
            return status
    while walk.frames > 0:
        if crowded(st):
            return GROW
        if tired(st):
            return BAD
        o = (walk.frames - 1) * FRAME
        frame = st.stack[o : o + FRAME]
        status = np.int64(DONE)
        if walk.adding:
            status = _add(st, cd, frame[1], frame[2], frame[3], frame[5] - 1)
            if status == DONE:
                walk.adding = 0
        elif frame[5] == (1 << n if frame[0] > 0 else per_cube):
            walk.frames -= 1
        else:
            status = _descend(st, cd, items, extent, frame)
        if status < 0:
            return status
    if cd.reg.mode == ENCODE and walk.item != len(items):
        st.counters.error = UNPLACED
        return BAD
    return DONE
