"""Geometry: bits of the values at vertices, or of the crossings' offsets on edges (spec clauses 5.6, 5.7).

Row C2-geometry, and offsets on any mesh. Both code the distance from where the sign already says the
number to be, from the highest bit down.
"""

from __future__ import annotations

import numpy as np

from isospec.container import MAX_PARTS, MAX_RADIX, STEP_RADIX

from ..entropy import baseline as ctx
from ..entropy.blend import EITHER, blended, mixing
from ..entropy.coder import ENCODE, MODE, Coder, code
from ..entropy.main import LEAF_NET, LEAN_KIND, OFFSET_KIND, OFFSET_NET, VALUE_KIND, VALUE_NET
from ..grid.field import OFFSET_BITS
from ..kernel import DONE, inlined, kernel
from ..kernel.types import BoolVector, Int32Matrix, IntMatrix, IntVector, UInt8Vector
from ..mesh.access import dimension
from ..mesh.store import get
from .along import count_near, find_candidates, place_of, recent_sides, remember, see_along
from .beside import Beside
from .classes import bits
from .nearby import UNKNOWN, packed, see_nearby
from .state import OFFSET_BIT, SIDE, TALLY, VALUE_BIT, State

# Registers in State.walk: next item of the list, the symbol before, the place within a digit, its sign.
ITEM, BEFORE, STEP, SIGN = range(4)
LOW, HIGH, HALVED, SPAN = range(4, 8)
"""Main profile: parts that are left of a digit, how often they were halved, and what `find_candidates` says."""
VERTEX_ACTIVE = 8
"""Bit of a vertex's mark that says it is in the list; bits 0 to 2 are the grid edges that leave it upwards."""


_place_of = inlined(place_of)


@kernel
def active_vertices(st: State, leaves: IntMatrix, mark: UInt8Vector, full: bool, out: IntVector) -> int:
    """Vertices that geometry by values refines, in the order of the leaves (spec clause 5.6.2).

    On the full grid these are the ends of the grid edges that are crossed, else all vertices of the leaves. ``leaves``
    are rows of numbers of vertices.
    """
    n = dimension(st.grid.tables)
    count = 0
    for i in range(len(leaves)):
        for j in range(n + 1):
            v = leaves[i, j]
            drawn = not full
            if j > 0 and st.vertex[v, 3] != st.vertex[leaves[i, j - 1], 3]:
                drawn = True
            if j < n and st.vertex[v, 3] != st.vertex[leaves[i, j + 1], 3]:
                drawn = True
            if drawn and not mark[v] & VERTEX_ACTIVE:
                mark[v] |= VERTEX_ACTIVE
                out[count] = v
                count += 1
    return count


@inlined
def _lower(st, a, b):
    """Which of two vertices comes first in the order of positions."""
    for axis in range(3):
        if st.vertex[a, axis] != st.vertex[b, axis]:
            return a if st.vertex[a, axis] < st.vertex[b, axis] else b
    return a


@kernel
def grid_edges(st: State, leaves: IntMatrix, mark: UInt8Vector, out: IntMatrix) -> int:
    """Edges of the full grid that are crossed, in the order of the leaves: both ends, the lower first (5.7.2)."""
    n = dimension(st.grid.tables)
    count = 0
    for i in range(len(leaves)):
        for j in range(n):
            a, b = leaves[i, j], leaves[i, j + 1]
            if st.vertex[a, 3] == st.vertex[b, 3]:
                continue
            low = _lower(st, a, b)
            high = b if low == a else a
            axis = 0
            while st.vertex[a, axis] == st.vertex[b, axis]:
                axis += 1
            if not mark[low] >> axis & 1:
                mark[low] |= 1 << axis
                out[count, 0] = low
                out[count, 1] = high
                count += 1
    return count


@kernel
def leaf_edges(st: State, leaves: IntMatrix, out: IntMatrix) -> int:
    """Crossed edges of all leaves, repeated as they come: both ends, the lower first (spec clause 5.7.2)."""
    n = dimension(st.grid.tables)
    count = 0
    for i in range(len(leaves)):
        for j in range(n + 1):
            for k in range(j + 1, n + 1):
                a, b = leaves[i, j], leaves[i, k]
                if st.vertex[a, 3] != st.vertex[b, 3]:
                    low = _lower(st, a, b)
                    out[count, 0] = low
                    out[count, 1] = b if low == a else a
                    count += 1
    return count


@kernel
def entries(st: State, position: IntMatrix, out: IntVector) -> None:
    """Numbers of the vertices at positions (E, 3), -1 where none is known."""
    for i in range(len(position)):
        out[i] = (get(st.known, position[i, 0], position[i, 1], position[i, 2]) >> 1) - 1


@kernel
def values(
    st: State, cd: Coder, near: Int32Matrix, told: IntVector, active: IntVector, number: IntVector, left: IntVector,
    plane: int, wanted: IntVector,
) -> int:  # fmt: skip
    """Bring the vertices' numbers down to ``plane`` bits left (spec clause 5.6.3).

    ``number`` is the distance from the isovalue's side of the interval as far as known, ``left`` the bits of it
    that are missing, ``wanted`` the encoder's whole number (empty for the decoder). For the main profile ``near`` says
    which vertices of the list lie near each, ``told`` what is told of them (`packed`).
    """
    w = st.walk
    encoding = cd.reg[MODE] == ENCODE
    while w[ITEM] < len(active):
        v = np.uint64(active[np.uint64(w[ITEM])])
        if left[v] <= plane:
            w[ITEM] += 1
            continue
        p = left[v] - 1
        bit = np.int64(0)
        if encoding:
            bit = (wanted[v] >> p) & 1
        context = ctx.VALUE + (p * 2 + np.int64(number[v] != 0)) * 3 + w[BEFORE]
        if mixing(cd):
            see_nearby(st, cd, near, told, w[ITEM], number, v, p)
            bit = blended(cd, VALUE_NET, False, VALUE_KIND + min(bits(number[v]), 2), context, bit)
        else:
            bit = code(cd, context, bit)
        if bit < 0:
            return bit
        st.at[TALLY + VALUE_BIT] += 1
        w[BEFORE] = 1 + bit
        number[v] = number[v] << 1 | bit
        left[v] = p
        if len(told) > 0:
            told[np.uint64(w[ITEM])] = packed(st, number, left, v)
    return DONE


@kernel
def tell(st: State, active: IntVector, number: IntVector, left: IntVector, told: IntVector) -> None:
    """Enter what is told of the vertices of a list, and behind them what stands for all others."""
    for i in range(len(active)):
        told[i] = packed(st, number, left, np.uint64(active[i]))
    told[len(active)] = UNKNOWN


@inlined
def radix_of(length, parts, target, unit):
    """Smallest odd number of parts that brings an edge of so many samples to ``target`` parts in ``2**unit`` samples.

    Large ones are reached in steps.
    """
    wanted = min((length * target + (np.int64(1) << unit) - 1) >> unit, MAX_PARTS)
    radix = (wanted + parts - 1) // parts | 1
    return radix if radix <= MAX_RADIX else np.int64(STEP_RADIX)


@inlined
def _beyond(st, i, radix, rising, earlier):
    """Part that holds the earlier isovalue's crossing, and how many parts lie beyond it."""
    number, parts = earlier[i, 0], earlier[i, 1]
    if rising[i] == (st.at[SIDE] > 0):
        bound = number * radix // parts
        return bound, radix - 1 - bound
    bound = ((number + 1) * radix - 1) // parts
    return bound, bound


@inlined
def _choice(wanted, slack, parts, radix, number, rising, low, high, split):
    """Encoder: the symbol that leads to a part whose middle is near enough to the crossing, or EITHER.

    The part that holds the crossing is always good enough, unless it is ruled out: then the one next to it is.
    """
    total = parts * radix
    true = (wanted * total) >> OFFSET_BITS
    half = np.int64(1) << (OFFSET_BITS - 1)
    least = min(((wanted - slack) * total + half - 1) >> OFFSET_BITS, true) - number * radix
    most = max(((wanted + slack) * total - half) >> OFFSET_BITS, true) - number * radix
    if not rising:
        least, most = radix - 1 - most, radix - 1 - least
    least, most = min(max(least, low), high - 1), min(max(most, low), high - 1)
    if most < split:
        return np.int64(0)
    return np.int64(1 if least >= split else EITHER)


@inlined
def _halve(st, cd, beside, edges, number, parts, length, i, radix, rising, earlier, leaning, wanted, slack):
    """One symbol of a digit in the main profile (spec clause 7.14): which half of the parts left holds the crossing.

    Parts are counted from the end that is below; those before the earlier isovalue's crossing are ruled out. Returns
    what the coder says; the digit is complete when one part is left.
    """
    w = st.walk
    grid = len(beside.near) == 0
    earlier_part = np.int64(-1)
    if leaning:
        bound = _beyond(st, i, radix, rising, earlier)[0]
        earlier_part = bound if rising[i] else radix - 1 - bound
    if w[HALVED] == 0:
        w[LOW], w[HIGH] = 0, radix
        if leaning:
            if st.at[SIDE] > 0:
                w[LOW] = earlier_part
            else:
                w[HIGH] = earlier_part + 1
            if w[HIGH] - w[LOW] == 1:
                return np.int64(DONE)
        w[SPAN] = find_candidates(st, beside, edges, parts, length, i)
    split = (w[LOW] + w[HIGH]) >> 1
    bit = np.int64(0)
    if cd.reg[MODE] == ENCODE:
        bit = _choice(wanted[i], slack[i], parts[i], radix, number[i], rising[i], w[LOW], w[HIGH], split)
    again = np.int64(parts[i] > 1)
    sides = recent_sides(st, w[LOW], w[HIGH], split, radix, number[i], parts[i], rising[i])
    context = ctx.OFFSET + (8 * again + min(w[HALVED], 7)) * 9 + sides
    kind = OFFSET_KIND + min(w[HALVED], 2) + 3 * again + (0 if grid else 6)
    nearer = np.int64(-1)
    if leaning:
        nearer = split - earlier_part if st.at[SIDE] > 0 else earlier_part + 1 - split
        context = ctx.OFFSET_LEAN + min(bits(nearer), 7) * 16 + min(w[HIGH] - w[LOW], 15)
        kind = LEAN_KIND + min(w[HALVED], 2) + (0 if grid else 3)
    see_along(st, cd, w[LOW], w[HIGH], split, radix, number[i], parts[i], rising[i], w[SPAN], nearer)
    net = OFFSET_NET if grid else LEAF_NET
    bit = blended(cd, net, False, kind, context, bit)
    if bit >= 0:
        w[HALVED] += 1
        if bit:
            w[LOW] = split
        else:
            w[HIGH] = split
    return bit


@kernel
def offsets(
    st: State, cd: Coder, beside: Beside, edges: IntMatrix, number: IntVector, parts: IntVector, length: IntVector,
    rising: BoolVector, earlier: IntMatrix, target: int, unit: int, wanted: IntVector, slack: IntVector,
) -> int:  # fmt: skip
    """Divide the part of every edge that holds its crossing until the parts are fine enough (spec clause 5.7.3).

    Radices are odd and a digit counts from the middle part, so that a crossing drawn in the middle of its part
    is never moved away from where it is. Where the edge is also crossed at an earlier isovalue (``earlier``: number
    and parts), the digit counts from there. ``rising`` tells whether the upper end is above, ``wanted`` are the
    encoder's offsets as 30-bit fractions. In the main profile it may tell a part whose middle is at most ``slack`` from
    there instead of the one that holds it: the more probable of those.
    """
    w = st.walk
    encoding = cd.reg[MODE] == ENCODE
    while w[ITEM] < len(number):
        # only an index: unsigned, no test whether it counts from the end
        i = np.uint64(w[ITEM])
        radix = radix_of(length[i], parts[i], target, unit)
        if radix == 1:
            w[ITEM] += 1
            continue
        leaning = parts[i] == 1 and earlier[i, 1] > 0
        if mixing(cd):
            told = w[HALVED]
            bit = _halve(
                st, cd, beside, edges, number, parts, length, i, radix, rising, earlier, leaning, wanted, slack
            )
            if bit < 0:
                return bit
            st.at[TALLY + OFFSET_BIT] += w[HALVED] - told
            if w[HIGH] - w[LOW] == 1:
                count_near(beside, edges, parts, length, i, -1)
                number[i] = number[i] * radix + (w[LOW] if rising[i] else radix - 1 - w[LOW])
                parts[i] *= radix
                beside.place[i] = _place_of(number[i], parts[i])
                count_near(beside, edges, parts, length, i, 1)
                w[HALVED] = 0
                remember(st, beside.place[i], rising[i])
            continue
        half = radix // 2
        contexts = ctx.OFFSET + (min(half, ctx.OFFSET_SIZES) - 1 + (ctx.OFFSET_SIZES if parts[i] > 1 else 0)) * (
            ctx.OFFSET_STRIDE
        )
        step = w[STEP]
        digit = np.int64(0)
        if encoding:
            digit = ((wanted[i] * parts[i] * radix) >> OFFSET_BITS) - number[i] * radix - half
        if leaning:
            bound, room = _beyond(st, i, radix, rising, earlier)
            way = np.int64(1 if rising[i] == (st.at[SIDE] > 0) else -1)
            bit = np.int64(0)
            if step < room:
                context = ctx.OFFSET_LEAN + min(step, 7) * 16 + min(room - step, 15)
                bit = code(cd, context, np.int64((digit + half - bound) * way > step))
                if bit < 0:
                    return bit
                st.at[TALLY + OFFSET_BIT] += 1
            if bit:
                w[STEP] = step + 1
                continue
            number[i] = bound + way * step
            digit = number[i] - half
            parts[i] = radix
            w[BEFORE] = 1 if digit == 0 else (3 if digit > 0 else 2)
            w[STEP] = 0
            continue
        if step == 0:
            bit = code(cd, contexts + w[BEFORE], np.int64(digit != 0))
        elif step == 1:
            bit = code(cd, contexts + 4 + w[BEFORE], np.int64(digit > 0))
        else:
            bit = code(cd, contexts + 8 + step - 2, np.int64(abs(digit) >= step))
        if bit < 0:
            return bit
        st.at[TALLY + OFFSET_BIT] += 1
        if step == 0 and bit:
            w[STEP] = 1
            continue
        if step == 1:
            w[SIGN] = bit
            bit = np.int64(1)
            step = 1
        # a magnitude goes on while its bits are 1 and larger ones exist
        if bit and step < half:
            w[STEP] = step + 1
            continue
        size = step if bit else step - 1
        if step == 0:
            size = np.int64(0)
        number[i] = number[i] * radix + half + (size if w[SIGN] else -size)
        parts[i] *= radix
        w[BEFORE] = 1 if size == 0 else (3 if w[SIGN] else 2)
        w[STEP] = 0
        w[SIGN] = 0
    return DONE
