"""The signs of the frame before, softened: how far from its curve a sample lies, on which side (spec clause 7.18.1).

Signs of samples that are not known there are filled in within each page of the store, which is a block of the
specification; then they are smoothed, once and three times.
"""

from __future__ import annotations

import numpy as np

from ...kernel import inlined, inner, kernel
from ...kernel.types import IntVector
from ..lattice.access import dimension
from ..lattice.store import SHIFT, Store, get, key_page
from .state import Lean

ROUNDS = 3
"""Rounds of smoothing, each of which reaches one sample farther."""
LEVEL_BITS = 5
"""Softened signs are counted in so many bits: from 0, below, to 32, above."""
_SIGN_BITS, _LEVEL_PLACE = 2, 6
"""An entry has 1 plus the sign, or 0; from there 1 plus the sign smoothed once and three times."""


def nothing_softened(known: Store) -> Store:
    """A store with the pages of ``known`` and nothing in them."""
    return Store(known.head.copy(), known.table.copy(), np.zeros(known.pages.shape, np.int32))


def softened(lean: Lean) -> Store:
    """View of the frame before for kernels."""
    out = nothing_softened(lean.known)
    n = int(lean.grid.tables[0])
    wide = (1 << int(out.head[SHIFT])) + 2 * ROUNDS
    _soften(lean, out, np.zeros(wide**n, np.int64))
    return out


@inlined
def levels(soft, x, y, z):
    """Softened sign of a sample, smoothed once and three times; -1 in a block that the curve did not pass."""
    e = get(soft, x, y, z) >> _SIGN_BITS
    if e == 0:
        return np.int64(-1), np.int64(-1)
    return (e & 63) - 1, e >> _LEVEL_PLACE


@inner
def _fill(lean, soft, row):
    """Enter the signs of a block; one that is not known is that of a sample beside it, first of those before."""
    x0, y0, z0 = key_page(soft.table[row, 0])
    page = soft.table[row, 1]
    a, b, c = soft.head[SHIFT], soft.head[SHIFT + 1], soft.head[SHIFT + 2]
    ends = (
        min(np.int64(1) << a, lean.grid.last0 + 1 - (x0 << a)), min(np.int64(1) << b, lean.grid.last1 + 1 - (y0 << b)),
        min(np.int64(1) << c, lean.grid.last2 + 1 - (z0 << c)),
    )
    out, known = soft.pages[page], lean.known.pages[page]
    far, mid = np.int64(1) << (b + c), np.int64(1) << c
    for x in range(ends[0]):
        for y in range(ends[1]):
            for z in range(ends[2]):
                i = x * far + y * mid + z
                e = np.int64(known[i])
                s = 1 + (e & 1) if e != 0 else 0
                if s == 0 and z > 0:
                    s = np.int64(out[i - 1])
                if s == 0 and y > 0:
                    s = np.int64(out[i - mid])
                if s == 0 and x > 0:
                    s = np.int64(out[i - far])
                out[i] = s
    for x in range(ends[0] - 1, -1, -1):
        for y in range(ends[1] - 1, -1, -1):
            for z in range(ends[2] - 1, -1, -1):
                i = x * far + y * mid + z
                s = np.int64(out[i])
                if s == 0 and z < ends[2] - 1:
                    s = np.int64(out[i + 1])
                if s == 0 and y < ends[1] - 1:
                    s = np.int64(out[i + mid])
                if s == 0 and x < ends[0] - 1:
                    s = np.int64(out[i + far])
                out[i] = s


@inlined
def _within(i, size, last, block):
    """Coordinate ``i`` moved into a block, and into the box."""
    return min(min(max(i, block << size), ((block + 1) << size) - 1), last)


@inner
def _gather(lean, soft, row, room):
    """List the signs in and around a block; where a block there has none, those nearest in this one."""
    b0, b1, b2 = key_page(soft.table[row, 0])
    a, b, c = soft.head[SHIFT], soft.head[SHIFT + 1], soft.head[SHIFT + 2]
    last0, last1, last2 = lean.grid.last0, lean.grid.last1, lean.grid.last2
    deep = ROUNDS if c > 0 else 0
    i = 0
    for x in range((b0 << a) - ROUNDS, ((b0 + 1) << a) + ROUNDS):
        for y in range((b1 << b) - ROUNDS, ((b1 + 1) << b) + ROUNDS):
            for z in range((b2 << c) - deep, ((b2 + 1) << c) + deep):
                p, q, r = min(max(x, 0), last0), min(max(y, 0), last1), min(max(z, 0), last2)
                s = get(soft, p, q, r) & 3
                if s == 0:
                    p, q, r = _within(p, a, last0, b0), _within(q, b, last1, b1), _within(r, c, last2, b2)
                    s = get(soft, p, q, r) & 3
                room[i] = s - 1
                i += 1


@inner
def _smooth(room, stride, wide):
    """Add to twice each number those beside it along an axis, whose neighbours are ``stride`` apart."""
    for first in range(0, len(room), stride * wide):
        for i in range(first, first + stride):
            before = room[i]
            for k in range(i, i + stride * (wide - 1), stride):
                here = room[k]
                room[k] = before + 2 * here + room[k + stride]
                before = here


@inner
def _enter(soft, row, room, wide, part, place):
    """Enter the numbers of a block, divided by ``2**part``, from bit ``place`` on."""
    page = soft.table[row, 1]
    a, b, c = soft.head[SHIFT], soft.head[SHIFT + 1], soft.head[SHIFT + 2]
    out = soft.pages[page]
    deep = ROUNDS if c > 0 else 0
    across = wide if c > 0 else 1
    i = 0
    for x in range(np.int64(1) << a):
        for y in range(np.int64(1) << b):
            k = ((x + ROUNDS) * wide + y + ROUNDS) * across + deep
            for z in range(np.int64(1) << c):
                level = ((room[k + z] << LEVEL_BITS) + (np.int64(1) << part >> 1)) >> part
                out[i] += (level + (place == _SIGN_BITS)) << place
                i += 1


@kernel
def _soften(lean: Lean, soft: Store, room: IntVector) -> None:
    """Fill in the signs of all blocks, then smooth them; ``room`` is for a block and what is around."""
    n = dimension(lean.grid.tables)
    wide = (np.int64(1) << soft.head[SHIFT]) + 2 * ROUNDS
    for row in range(len(soft.table)):
        if soft.table[row, 0] >= 0:
            _fill(lean, soft, row)
    for row in range(len(soft.table)):
        if soft.table[row, 0] < 0:
            continue
        _gather(lean, soft, row, room)
        for number in range(ROUNDS):
            stride = np.int64(1)
            for _ in range(n):
                _smooth(room, stride, wide)
                stride *= wide
            if number == 0:
                _enter(soft, row, room, wide, 2 * n, np.int64(_SIGN_BITS))
        _enter(soft, row, room, wide, 2 * n * ROUNDS, np.int64(_SIGN_BITS + _LEVEL_PLACE))
