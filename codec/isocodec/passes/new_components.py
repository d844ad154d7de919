"""New components: added vertices that differ from all corners of their diamond (spec clause 5.5).

Their set is coded as a pruned tree over the cubes of the level, in time by their number. In a cube the middles are
told apart by which of their coordinates (in units of g) are odd: the slots.
"""

from __future__ import annotations

import numpy as np

from ..entropy.mixer import mixing
from ..entropy.range_coder import ENCODE, Coder, code
from ..kernel import BAD, DONE, GROW, inlined, inner, kernel
from ..kernel.types import IntVector
from ..mesh.access import corner, dimension
from ..mesh.access import kind as kind_of
from ..mesh.diamond import coincident
from ..mesh.grid import clamped, position
from ..mesh.slots import cubes, height, middle_of, slots
from ..mesh.store import PAGES, get
from ..mesh.vertex_set import IN
from ..models import contexts as ctx
from ..models.new_components import CUBE, NODE, ROOT, SLOT, add_birth, census, code_significance
from ..tube.inference import implied, infer
from ..tube.state import (
    OUT_OF_STEPS,
    SIGNIFICANCE,
    State,
    crowded,
    entry,
    tired,
    truth,
)
from .adaptive_mesh import BARRED, admit, closure, short
from .bisection import bisect, look

UNPLACED = 4
"""Error: the encoder's list names a slot that no new component can lie in."""
FRAME = 7
"""A frame: height, cube at that height, Morton number, next child, number of significant children."""
SLOT_BITS = 2


@inner
def candidate(st, r, w0, w1, w2):
    """Nearness (plus one) if the decoder cannot rule out a new component at w, else 0 (spec clause 5.5.1)."""
    kind = kind_of(st.grid.tables, r, w0, w1, w2)
    edge = st.counters.edge
    x, y, z = (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1
    if entry(st, x, y, z) != 0:
        return 0
    level = st.counters.level
    inside, members, corners, known, above = look(st, edge, r, kind, w0, w1, w2)
    if members == 0 or (above != 0 and above != known):
        return 0
    if not inside and coincident(st.grid, edge, kind, corners, w0, w1, w2):
        return 0
    meshed = st.counters.asks or st.mesh.head[PAGES] > 0
    if meshed and (get(st.mesh, x, y, z) & IN or closure(st, level, x, y, z, np.int64(0)) == BARRED):
        return 0
    count = 0
    bits = known
    while bits:
        count += bits & 1
        bits >>= 1
    near = 0 if count == 0 else (1 if count <= 2 else 2)
    if known != 0 and st.counters.side != 0:
        # what an earlier isovalue says of it
        sign, other = implied(st, x, y, z)
        here = np.int64(above != 0)
        if sign == here:
            return 0
        if other >= 0 and other != here:
            near += 2
    return near + 1


@inlined
def _push_frame(st, h, x, y, z, number):
    o = st.tree.frames * FRAME
    frame = st.stack[o : o + FRAME]
    frame[0], frame[1], frame[2], frame[3], frame[4] = h, x, y, z, number
    frame[5] = frame[6] = 0
    st.tree.frames += 1


@inlined
def _wanted(items, i, number, shift):
    """Encoder: whether the next item lies under the node ``number``."""
    return np.int64(i < len(items) and (items[i] >> shift) == number)


@inner
def _add(st, cd, x, y, z, slot):
    """Add the new component of a slot, with all its diamond (spec clause 5.5.4); negative: no effect yet."""
    n = dimension(st.grid.tables)
    level, edge = st.counters.level, st.counters.edge
    r = level % n
    w0, w1, w2 = middle_of(n, r, x, y, z, slot)
    kind = kind_of(st.grid.tables, r, w0, w1, w2)
    inside, members, corners, known, above = look(st, edge, r, kind, w0, w1, w2)
    m0, m1, m2 = (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1
    if known != 0:
        sign = np.int64(1 if above != 0 else 0)
    else:
        i = 0
        while not (corners >> i) & 1:
            i += 1
        u0, u1, u2 = position(edge, w0 >> 2, w1 >> 2, w2 >> 2, corner(st.grid.tables, kind, i))
        sign = infer(st, u0, u1, u2)
        if sign < 0:
            st.counters.error = OUT_OF_STEPS
            return BAD
        if st.counters.adapted:
            turned = np.int64(0)
            if cd.reg.mode == ENCODE:
                turned = np.int64(sign == truth(st, m0, m1, m2))
            turned = code(cd, ctx.TURNED, turned)
            if turned < 0:
                return turned
            st.tally[SIGNIFICANCE] += 1
            sign ^= turned
    if mixing(cd):
        u0, u1, u2 = clamped(st.grid, m0, m1, m2)
        add_birth(st, u0, u1, u2)
        st.counters.births += 1
    if st.counters.asks:
        admit(st, closure(st, level, m0, m1, m2, np.int64(0)))
    bisect(st, r, kind, w0, w1, w2, inside, members, known, corners if sign else np.int64(0), 1 - sign)
    return DONE


@kernel
def significance(st: State, cd: Coder, items: IntVector) -> int:
    """Code the set of new components of the round, adding each to the mesh.

    ``items`` is the encoder's sorted list (``find``), empty for the decoder.
    """
    n = dimension(st.grid.tables)
    r = st.counters.level % n
    edge = st.counters.edge
    walk = st.tree
    encoding = cd.reg.mode == ENCODE
    fan = 1 << n
    per_cube = slots(n, r)
    cubes0, cubes1, cubes2 = cubes(st.grid, st.counters.level)
    zero = np.int64(0)
    if walk.started == 0:
        if mixing(cd) and census(st) == GROW:
            return GROW
        h = np.int64(height(max(cubes0, cubes1, cubes2)))
        want = np.int64(encoding and len(items) > 0)
        bit = code_significance(st, cd, NODE, h, zero, zero, zero, zero, ROOT, zero, ctx.SIGNIFICANT + h * 3, want)
        if bit < 0:
            return bit
        walk.started = 1
        if bit:
            _push_frame(st, h, zero, zero, zero, zero)
    while walk.frames > 0:
        if crowded(st):
            return GROW
        if tired(st):
            return BAD
        o = (walk.frames - 1) * FRAME
        frame = st.stack[o : o + FRAME]
        h, c0, c1, c2 = frame[0], frame[1], frame[2], frame[3]
        number, child, hits = frame[4], frame[5], frame[6]
        if walk.adding:
            status = _add(st, cd, c0, c1, c2, child - 1)
            if status < 0:
                return status
            walk.adding = 0
            continue
        if child == (fan if h > 0 else per_cube):
            walk.frames -= 1
            continue

        # the next child: a node or cube of a node, or a slot of a cube
        what, shift = SLOT, zero
        last = False
        near, later = zero, zero
        if h > 0:
            shift = h - 1
            what = CUBE if shift == 0 else NODE
            last = child == fan - 1
            c0 = 2 * c0 + (child >> (n - 1))
            c1 = 2 * c1 + ((child >> (n - 2)) & 1)
            c2 = 2 * c2 + (child & 1 if n == 3 else 0)
            if (c0 << shift) >= cubes0 or (c1 << shift) >= cubes1 or (c2 << shift) >= cubes2:
                frame[5] = child + 1
                continue
        if what != NODE:
            first = child if what == SLOT else zero
            for slot in range(first, per_cube):
                w0, w1, w2 = middle_of(n, r, c0, c1, c2, slot)
                found = np.int64(candidate(st, r, w0, w1, w2))
                if slot > first:
                    later = max(later, found)
                else:
                    near = found
                    if what == SLOT and near == 0:
                        break
            if what == CUBE:
                near = max(near, later)
            else:
                last = later == 0
            if near == 0:
                frame[5] = child + 1
                continue
            near -= 1
        if what == SLOT and st.counters.asks:
            w0, w1, w2 = middle_of(n, r, c0, c1, c2, child)
            x, y, z = (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1
            if short(st, closure(st, st.counters.level, x, y, z, zero)):
                return GROW

        number = number << (SLOT_BITS if what == SLOT else n) | child
        bit = np.int64(1)
        if hits > 0 or not last:
            if what == NODE:
                context = ctx.SIGNIFICANT + shift * 3
            else:
                context = ctx.SIGNIFICANT_LEAF + ((1 + r if what == SLOT else 0) * ctx.NEARNESS + near) * 3
            below = zero if what == SLOT else SLOT_BITS + n * shift
            want = _wanted(items, walk.item, number, below) if encoding else zero
            bit = code_significance(st, cd, what, shift, c0, c1, c2, hits, child, near, context + min(hits, 2), want)
            if bit < 0:
                return bit
        frame[5] = child + 1
        if bit == 0:
            continue
        frame[6] = hits + 1
        if what == SLOT:
            walk.item += 1
            walk.adding = 1
        else:
            _push_frame(st, shift, c0, c1, c2, number)
    if encoding and walk.item != len(items):
        st.counters.error = UNPLACED
        return BAD
    return DONE
