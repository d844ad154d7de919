"""Signs of a mesh in the plane level by level: those left of it, then vertices that come back (spec clause 10.8)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..entropy.guesses import clear_opinions, decided, hear
from ..entropy.range_coder import Coder, code
from ..kernel import DONE, inlined, inner, kernel
from ..kernel.types import IntMatrix, IntVector
from .before import AGREED, UNKNOWN, learn_agreement, sign_before
from .history import MOST_RING, History
from .models import (
    COARSE,
    COARSE_THEN,
    LEVEL_COUNT,
    LEVEL_PAST,
    LEVEL_RING,
    LEVEL_THEN,
    LEVEL_THEN_SHARE,
    MIX_LEVEL,
    NEW,
    NEW_THEN,
    TURNED,
)
from .walk import WalkState

NEAR = 16
"""Weights count in parts of that of the nearest vertex: ``2**NEAR`` of them."""
PARTS = 16
"""The share of the weight around that lies above is taken in as many parts."""


@inlined
def _square(position, v, u):
    """Squared distance of two vertices."""
    x, y = position[u, 0] - position[v, 0], position[u, 1] - position[v, 1]
    return x * x + y * y


@inner
def _share(position, sign, v, around, start, end):
    """Share of the weight of the known vertices around one that lies above, of ``PARTS``; -1 if none is known."""
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
    return PARTS * above // total


@inner
def _told(st, v, bit):
    """A vertex becomes known."""
    st.sign[v] = bit
    learn_agreement(st, v, bit)
    st.reg.past = (st.reg.past << 1 | bit) & 63


@kernel
def code_coarse(
    position: IntMatrix, st: WalkState, cd: Coder, first: IntVector, around: IntVector, order: IntVector
) -> int:
    """Code the signs of what is left, each vertex after one beside it.

    ``around[first[v] : first[v + 1]]`` are those beside vertex v; ``order`` (V,), all -1 at first, takes their order.
    """
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
                share = _share(position, st.sign, v, around, first[v], first[v + 1])
                ctx = COARSE + 8 * (share + 1) + (st.reg.past & 7)
                if st.reg.leans:
                    ctx = COARSE_THEN + 3 * (AGREED * (share + 1) + st.reg.agreed) + sign_before(st, v, 1)
                bit = code(cd, ctx, np.int64(st.truth[v]))
                if bit < 0:
                    return bit
            _told(st, v, bit)
            for k in range(first[v], first[v + 1]):
                if st.sign[around[k]] == UNKNOWN:
                    order[end] = around[k]
                    end += 1
    return DONE


@inlined
def _turned(st, ring, start, end):
    """Class of how many vertices of a ring have another sign than in the frame before."""
    count = np.int64(0)
    for k in range(start, end):
        count += np.int64(st.before[ring[k]] != UNKNOWN and st.before[ring[k]] != st.sign[ring[k]])
    return min(count, TURNED - 1)


@inner
def _mixed_sign(position, st, cd, v, ring, start, end):
    """Sign of a vertex that comes back into a ring of both signs."""
    bit = np.int64(st.given[v])
    if bit != UNKNOWN:
        return bit
    share = _share(position, st.sign, v, ring, start, end)
    above = np.int64(0)
    turns = np.int64(0)
    last = st.sign[ring[end - 1]]
    for k in range(start, end):
        sign = st.sign[ring[k]]
        above += sign
        turns += np.int64(sign != last)
        last = sign
    clear_opinions(cd)
    hear(cd, LEVEL_RING + 2 * share + np.int64(turns > 2))
    hear(cd, LEVEL_COUNT + (MOST_RING + 1) * (end - start) + above)
    hear(cd, LEVEL_PAST + 8 * (share >> 1) + (st.reg.past & 7))
    if st.reg.leans:
        then = 3 * st.reg.agreed + sign_before(st, v, 1)
        before = _share(position, st.before, v, ring, start, end)
        hear(cd, LEVEL_THEN_SHARE + 12 * (before + 1) + then)
        hear(cd, LEVEL_THEN + 12 * (5 * _turned(st, ring, start, end) + (share >> 2)) + then)
    return decided(cd, MIX_LEVEL + (share >> 1), np.int64(st.truth[v]))


@inlined
def _any(prefix, low, high):
    """Encoder: whether there are new components among some candidates."""
    return np.int64(prefix[high] > prefix[low])


@inlined
def _width(low, high):
    """Class of how many candidates there are."""
    wide = np.int64(0)
    while (high - low) >> wide and wide < 15:
        wide += 1
    return wide


@inner
def _new_components(st, cd, candidate, count, prefix, stack):
    """Find candidates that differ from the ring that they come back into, by halves of their list."""
    if count == 0:
        return np.int64(DONE)
    bit = code(cd, NEW + _width(0, count), _any(prefix, 0, count))
    if bit <= 0:
        return bit if bit < 0 else np.int64(DONE)
    stack[0], stack[1] = 0, count
    top = np.int64(2)
    while top > 0:
        top -= 2
        low, high = stack[top], stack[top + 1]
        if high - low == 1:
            st.sign[candidate[low]] = 1 - st.sign[candidate[low]]
            continue
        middle = (low + high) >> 1
        left = code(cd, NEW + _width(low, middle), _any(prefix, low, middle))
        right = np.int64(1)
        if left > 0:
            right = code(cd, NEW + _width(middle, high), _any(prefix, middle, high))
        if left < 0 or right < 0:
            return min(left, right)
        if right:
            stack[top], stack[top + 1] = middle, high
            top += 2
        if left:
            stack[top], stack[top + 1] = low, middle
            top += 2
    return np.int64(DONE)


@kernel
def code_round(
    position: IntMatrix, st: WalkState, cd: Coder, vertex: IntVector, first: IntVector, ring: IntVector, room: IntMatrix
) -> int:
    """Code the signs of the vertices that come back in a round; ``room`` is (3, R + 128)."""
    candidate, prefix = room[0], room[1]
    count = np.int64(0)
    prefix[0] = 0
    for i in range(len(vertex)):
        v = vertex[i]
        sign = st.sign[ring[first[i]]]
        mixed = False
        for k in range(first[i], first[i + 1]):
            mixed = mixed or st.sign[ring[k]] != sign
        if mixed:
            bit = _mixed_sign(position, st, cd, v, ring, first[i], first[i + 1])
            if bit < 0:
                return bit
            _told(st, v, bit)
        elif st.given[v] != UNKNOWN:
            st.sign[v] = st.given[v]
        elif st.before[v] != UNKNOWN and st.before[v] != sign:
            bit = code(cd, NEW_THEN + _turned(st, ring, first[i], first[i + 1]), np.int64(st.truth[v] != sign))
            if bit < 0:
                return bit
            st.sign[v] = sign ^ bit
        else:
            candidate[count] = v
            count += 1
            prefix[count] = prefix[count - 1] + np.int64(st.truth[v] != sign)
            st.sign[v] = sign
    return _new_components(st, cd, candidate, count, prefix, room[2])


def beside(cells: NDArray[np.int64], vertices: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Vertices beside each: those of vertex v from ``first[v]`` to ``first[v + 1]``, ascending."""
    pairs = cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    keys = np.unique(np.concatenate([pairs, pairs[:, ::-1]]) @ np.array([vertices, 1]))
    return np.searchsorted(keys // vertices, np.arange(vertices + 1)), keys % vertices


def coarse_signs(history: History, rounds: int, st: WalkState, cd: Coder) -> int:
    """Code the signs of what is left after some rounds."""
    vertices = len(history.position)
    first, around = beside(history.cells[rounds], vertices)
    return code_coarse(history.position, st, cd, first, around, np.full(len(around) + vertices, -1, np.int64))


def signs_of_round(history: History, number: int, st: WalkState, cd: Coder) -> int:
    """Code the signs of the vertices that a round has removed."""
    removed = history.rounds[number]
    room = np.zeros((3, len(removed.vertex) + 128), np.int64)
    return code_round(history.position, st, cd, removed.vertex, removed.first, removed.ring, room)
