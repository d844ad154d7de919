"""Signs of a mesh level by level: the coarsest mesh, then vertices that come back (spec clauses 10.8.3 to 10.8.5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..entropy.guesses import clear_opinions, decided, hear
from ..entropy.range_coder import Coder, code
from ..kernel import DONE, inlined, inner, kernel
from ..kernel.types import IntMatrix, IntVector
from .before import AGREED, UNKNOWN, learn_agreement, sign_before
from .hierarchy import MOST_STAR
from .models import (
    CHANGED,
    COARSE,
    COARSE_THEN,
    FIT_BOUNDS,
    LEVEL_COUNT,
    LEVEL_FIT,
    LEVEL_PAST,
    LEVEL_RING,
    LEVEL_SHARE,
    LEVEL_SLOPE,
    LEVEL_THEN,
    LEVEL_THEN_SHARE,
    LEVEL_TILT,
    MIX_LEVEL,
    MOST_COUNT,
    NEW,
    NEW_THEN,
    PARTS,
    TILTS,
)
from .ring_fit import RingEstimates, RingRegisters, gather, weighted
from .walk import WalkState

NEAR = 16
"""Weights around a vertex of the coarse mesh are multiples of ``2**-NEAR`` of the weight of the nearest one."""
COARSE_PARTS = 16
"""Classes of the share of the surrounding weight that lies above."""
TRUST = 180
"""Initial trust, out of ``ALL``."""
ALL = 256
"""Full trust; also the tilt of a vertex whose neighbours all lie above."""
OPEN = 1
"""Status of a returning vertex that got the sign of its ring, and may still have the other one."""
LEARNT = 77
"""Share of the way, out of ``ALL``, that trust and tilt of a ring move towards a new sign."""


@inlined
def _square(position, v, u):
    """Squared distance of two vertices."""
    x, y, z = position[u, 0] - position[v, 0], position[u, 1] - position[v, 1], position[u, 2] - position[v, 2]
    return x * x + y * y + z * z


@inner
def _share(position, sign, v, around, start, end):
    """Class of the share of the known weight around a vertex that lies above; -1 if none is known."""
    nearest = np.int64(-1)
    for k in range(start, end):
        if sign[around[k]] != UNKNOWN:
            d = _square(position, v, around[k])
            if nearest < 0 or d < nearest:
                nearest = d
    if nearest < 0:
        return np.int64(-1)
    shift = np.int64(0)
    while nearest >> shift >= 1 << 40:
        shift += 1
    above = np.int64(0)
    total = np.int64(0)
    for k in range(start, end):
        if sign[around[k]] != UNKNOWN:
            far = _square(position, v, around[k]) >> shift
            weight = ((nearest >> shift) << NEAR) // (far if far > 0 else np.int64(1))
            total += weight
            above += weight * sign[around[k]]
    # without a distance, as in a folded mesh, no weight is left
    return COARSE_PARTS * above // total if total > 0 else np.int64(0)


@inner
def _mean_edge(position, first, around):
    """Mean length of the sides of cells, along the axis where each is longest."""
    total = np.int64(0)
    for v in range(len(first) - 1):
        for i in range(first[v], first[v + 1]):
            far = np.int64(0)
            for k in range(3):
                far = max(far, abs(position[around[i], k] - position[v, k]))
            total += far
    return total // max(np.int64(len(around)), np.int64(1))


@inner
def _begin(st, g, v, bit, height):
    """Enter the sign and first estimates of a vertex of the coarse mesh."""
    st.sign[v] = bit
    learn_agreement(st, v, bit)
    st.reg.past = (st.reg.past << 1 | bit) & 63
    g.height[v] = height if bit else -height
    g.trust[v] = TRUST
    g.tilt[v] = ALL >> 1 if bit else -(ALL >> 1)


@kernel
def code_coarse(
    g: RingEstimates, st: WalkState, cd: Coder, first: IntVector, around: IntVector, order: IntVector
) -> int:
    """Code the signs of the coarsest mesh, each vertex after a neighbour.

    ``around[first[v] : first[v + 1]]`` are the neighbours of vertex v; ``order`` (V,), -1 at first, receives the order.
    """
    height = _mean_edge(g.position, first, around) >> 1
    end = np.int64(0)
    at = np.int64(0)
    for seed in range(len(first) - 1):
        if first[seed] == first[seed + 1] or st.sign[seed] != UNKNOWN:
            continue
        order[end] = seed
        end += 1
        while at < end:
            v = order[at]
            at += 1
            if st.sign[v] != UNKNOWN:
                continue
            bit = np.int64(st.given[v])
            if bit == UNKNOWN:
                share = _share(g.position, st.sign, v, around, first[v], first[v + 1])
                ctx = COARSE + 8 * (share + 1) + (st.reg.past & 7)
                if st.reg.leans:
                    ctx = COARSE_THEN + 3 * (AGREED * (share + 1) + st.reg.agreed) + sign_before(st, v, 1)
                bit = code(cd, ctx, np.int64(st.truth[v]))
                if bit < 0:
                    return bit
            _begin(st, g, v, bit, height)
            for k in range(first[v], first[v + 1]):
                if st.sign[around[k]] == UNKNOWN:
                    order[end] = around[k]
                    end += 1
    return DONE


@inner
def _changed(st, g):
    """Class of the number of vertices of a ring whose sign changed since the previous frame."""
    count = np.int64(0)
    for i in range(g.reg.count):
        u = g.ring[i]
        count += np.int64(st.before[u] != UNKNOWN and st.before[u] != st.sign[u])
    return min(count, np.int64(CHANGED - 1))


@inner
def _class_of(size, far):
    """Class of the size of a fit relative to the mean distance."""
    share = 4 * size // far
    out = np.int64(0)
    for bound in FIT_BOUNDS:
        out += np.int64(share >= bound)
    return out


@inner
def _agreeing(g, sign, above):
    """Class of the share of the ring's weight that has a sign; -1 if no sign is known."""
    some, total = np.int64(0), np.int64(0)
    for i in range(g.reg.count):
        one = sign[g.ring[i]]
        if one != UNKNOWN:
            total += g.weight[i]
            some += g.weight[i] * np.int64(one == above)
    return min(PARTS * some // total, np.int64(PARTS - 1)) if total > 0 else np.int64(-1)


@inner
def _hear_ring(st, g, cd, target, above, then):
    """List the opinions on whether the fit has the right sign; returns the class of the fit's size."""
    reg = g.reg
    size = _class_of(abs(reg.fit), reg.far)
    share = _agreeing(g, st.sign, above)
    trust = weighted(g, g.trust)
    tilt = weighted(g, g.tilt)
    tilt = min(((ALL + (tilt if above else -tilt)) * (TILTS >> 1)) >> 8, np.int64(TILTS - 1))
    like = np.int64(0)
    for i in range(reg.count):
        like += np.int64(st.sign[g.ring[i]] == above)
    clear_opinions(cd)
    hear(cd, LEVEL_FIT + 8 * size + min(trust >> 5, np.int64(7)))
    hear(cd, LEVEL_RING + TILTS * share + tilt)
    hear(cd, LEVEL_SHARE + 2 * (PARTS * size + share) + np.int64(st.sign[target] == above))
    hear(cd, LEVEL_TILT + TILTS * size + tilt)
    many = np.int64(MOST_COUNT)
    hear(cd, LEVEL_COUNT + (MOST_COUNT + 1) * min(reg.count, many) + min(like, many))
    hear(cd, LEVEL_PAST + 16 * size + reg.past)
    steep = min((6 * reg.slope) >> 14, np.int64(7))
    hear(cd, LEVEL_SLOPE + 3 * (8 * size + steep) + min((3 * trust) >> 8, np.int64(2)))
    if st.reg.leans:
        then += 3 * st.reg.agreed
        hear(cd, LEVEL_THEN_SHARE + 12 * (_agreeing(g, st.before, above) + 1) + then)
        hear(cd, LEVEL_THEN + 12 * (4 * _changed(st, g) + (share >> 2)) + then)
    return size


@inner
def _learn(st, g, v, sign, right):
    """Estimate a vertex that returned to a ring of both signs, and update the estimates of its ring."""
    reg = g.reg
    height = ((3 * reg.far) << reg.shift) // 5
    if right:
        height = max(height, (abs(reg.fit) << reg.shift) >> 4)
    g.trust[v] = (weighted(g, g.trust) + ALL * right) >> 1
    g.tilt[v] = (weighted(g, g.tilt) + (ALL if sign else -ALL)) >> 1
    for i in range(reg.count):
        u = g.ring[i]
        g.trust[u] += (LEARNT * (ALL * right - g.trust[u])) >> 8
        g.tilt[u] += (LEARNT * ((ALL if sign else -ALL) - g.tilt[u])) >> 8
        if st.sign[u] != sign:
            distance = g.distance[i] << reg.shift
            height = min(height, distance)
            size = abs(g.height[u])
            if 5 * size > 3 * distance:
                size = (15 * size + 21 * distance) // 50
                g.height[u] = size if st.sign[u] else -size
    g.height[v] = height if sign else -height


@inner
def _mixed_sign(st, g, cd, v, target):
    """Code the sign of a vertex that returns to a ring of both signs."""
    above = np.int64(g.reg.fit > 0)
    if st.given[v] != UNKNOWN:
        right = np.int64(st.given[v] == above)
    else:
        size = _hear_ring(st, g, cd, target, above, sign_before(st, v, above))
        right = decided(cd, MIX_LEVEL + size, np.int64(st.truth[v] == above))
        if right < 0:
            return right
    g.reg.past = (g.reg.past << 1 | right) & 15
    sign = above if right else 1 - above
    st.sign[v] = sign
    learn_agreement(st, v, sign)
    _learn(st, g, v, sign, right)
    return sign


@inner
def _follow(st, g, v, sign):
    """Give a vertex the sign of its ring."""
    reg = g.reg
    height = ((3 * reg.far) << reg.shift) // 10
    if (reg.fit > 0) == (sign == 1):
        height = max(height, (abs(reg.fit) << reg.shift) >> 4)
    st.sign[v] = sign
    g.height[v] = height if sign else -height
    g.trust[v] = weighted(g, g.trust)
    g.tilt[v] = weighted(g, g.tilt)


@inlined
def flip(st, g, v):
    """Give a vertex the sign opposite to its ring."""
    st.sign[v] = 1 - st.sign[v]
    size = (3 * abs(g.height[v])) // 10
    g.height[v] = size if st.sign[v] else -size


@inner
def comes_back(g, st, cd, v, target, face, start, end):
    """Code the sign of a returning vertex; OPEN if it got that of its ring, and may still have the other one."""
    gather(g, v, face, start, end)
    sign = np.int64(st.sign[g.ring[0]])
    for k in range(g.reg.count):
        if st.sign[g.ring[k]] != sign:
            return min(_mixed_sign(st, g, cd, v, target), np.int64(DONE))
    _follow(st, g, v, sign)
    if st.given[v] == UNKNOWN:
        return np.int64(OPEN)
    if st.given[v] != sign:
        flip(st, g, v)
    return np.int64(DONE)


@inlined
def _any(prefix, low, high):
    """Encoder: whether any item of a range of the list is sought."""
    return np.int64(prefix[high] > prefix[low])


@inlined
def _width(low, high):
    """Class of the length of a range."""
    wide = np.int64(0)
    while (high - low) >> wide and wide < 15:
        wide += 1
    return wide


@inner
def code_list(cd, context, listed, count, prefix, stack):
    """Code which items of a list are sought, by bisection; moves them to its start, and returns their number."""
    found = np.int64(0)
    if count == 0:
        return found
    bit = code(cd, context + _width(0, count), _any(prefix, 0, count))
    if bit <= 0:
        return bit
    stack[0], stack[1] = 0, count
    top = np.int64(2)
    while top > 0:
        top -= 2
        low, high = stack[top], stack[top + 1]
        if high - low == 1:
            listed[found] = listed[low]
            found += 1
            continue
        middle = (low + high) >> 1
        left = code(cd, context + _width(low, middle), _any(prefix, low, middle))
        right = np.int64(1)
        if left > 0:
            right = code(cd, context + _width(middle, high), _any(prefix, middle, high))
        if left < 0 or right < 0:
            return min(left, right)
        if right:
            stack[top], stack[top + 1] = middle, high
            top += 2
        if left:
            stack[top], stack[top + 1] = low, middle
            top += 2
    return found


@kernel
def code_round(
    g: RingEstimates, st: WalkState, cd: Coder, vertex: IntVector, target: IntVector, first: IntVector, face: IntMatrix,
    room: IntMatrix,
) -> int:
    """Code the signs of the vertices that return in a round, the last first; ``room`` (3, R + 128) is scratch space."""
    candidate, prefix = room[0], room[1]
    count = np.int64(0)
    prefix[0] = 0
    for i in range(len(vertex) - 1, -1, -1):
        v = vertex[i]
        status = comes_back(g, st, cd, v, target[i], face, first[i], first[i + 1])
        if status < 0:
            return status
        if status != OPEN:
            continue
        sign = np.int64(st.sign[v])
        if st.before[v] != UNKNOWN and st.before[v] != sign:
            bit = code(cd, NEW_THEN + _changed(st, g), np.int64(st.truth[v] != sign))
            if bit < 0:
                return bit
            if bit:
                flip(st, g, v)
        else:
            candidate[count] = v
            count += 1
            prefix[count] = prefix[count - 1] + np.int64(st.truth[v] != sign)
    found = code_list(cd, NEW, candidate, count, prefix, room[2])
    for i in range(found):
        flip(st, g, candidate[i])
    return min(found, np.int64(DONE))


def estimates_of(position: NDArray[np.int64], corners: int) -> RingEstimates:
    """Make the initial estimates at positions (V, 3) of cells with ``corners`` corners."""
    vertices = len(position)
    most = MOST_STAR[corners - 1] * corners

    def zeros(*shape: int) -> NDArray[np.int64]:
        return np.zeros(shape, np.int64)

    return RingEstimates(
        position, zeros(vertices), zeros(vertices), zeros(vertices), zeros(vertices + 1), zeros(most),
        zeros(most), zeros(most), zeros(most), zeros(most), zeros(most, 3), zeros(3), RingRegisters(),
    )


def beside(cells: NDArray[np.int64], vertices: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """List the neighbours of each vertex, ascending: those of v from ``first[v]`` to ``first[v + 1]``."""
    corners = cells.shape[1]
    pairs = cells[:, [[i, j] for i in range(corners) for j in range(corners) if i != j]].reshape(-1, 2)
    keys = np.unique(pairs @ np.array([vertices, 1]))
    return np.searchsorted(keys // vertices, np.arange(vertices + 1)), keys % vertices


def coarse_signs(cells: NDArray[np.int64], g: RingEstimates, st: WalkState, cd: Coder) -> int:
    """Code the signs of the vertices of the coarsest cells, (T, n + 1)."""
    vertices = len(g.position)
    first, around = beside(cells, vertices)
    return code_coarse(g, st, cd, first, around, np.full(len(around) + vertices, -1, np.int64))
