"""The order of lattice points and samples: block by block (spec clause 4.8)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined

BLOCK = {2: (6, 6), 3: (3, 3, 6)}
"""Edges of a block along the axes (log2)."""
EDGE_BLOCK = {2: (2, 2), 3: BLOCK[3]}
"""Edges of the blocks that crossed edges lie in: like crossings follow one another along a curve."""
_KEY_BITS = 63
_PLANE, (_SHORT, _, _LONG) = BLOCK[2][0], BLOCK[3]
assert _PLANE == BLOCK[2][1] == _LONG and BLOCK[3][1] == _SHORT
_DIGIT = 11
"""Bits by which numbers are sorted at a time."""
DIGITS = 1 << _DIGIT
COUNTS = DIGITS + 1
"""Numbers that `sort` counts."""


def in_order(
    point: NDArray[np.integer], *further: NDArray[np.integer], block: tuple[int, ...] | None = None,
) -> NDArray[np.int64]:
    """Sort points (V, n), those of one place by ``further`` points lexicographically: numbers of the rows, (V,) int64.

    Points are lattice points in units of g, or samples; none is negative. ``block`` has the edges of blocks (log2).
    """
    axes = list(zip(point.T, block or BLOCK[point.shape[1]], strict=True))
    # the block of each point, and its place in it
    columns = [x >> shift for x, shift in axes] + [x & (1 << shift) - 1 for x, shift in axes]
    columns += [x for points in further for x in points.T]
    bits = [int(column.max(initial=0)).bit_length() for column in columns]
    if sum(bits) > _KEY_BITS:
        return np.lexsort(columns[::-1])
    key = np.zeros(len(point), np.int64)
    for column, width in zip(columns, bits, strict=True):
        key <<= width
        key |= column
    own = len(key).bit_length()
    if sum(bits) + own > _KEY_BITS:
        return np.argsort(key, kind="stable")
    # with the row's number behind it each key is another one: sorted in a third of the time
    key <<= own
    key |= np.arange(len(key))
    key.sort()
    key &= (1 << own) - 1
    return key


@inlined
def along_rows(plane, x, y, z):
    """Coordinates with the last axis, along which the rows of a block run, as the third; those of a plane have no y."""
    return (x, np.int64(0), y) if plane else (x, y, z)


@inlined
def block_of(plane, x, y, z):
    """Coordinates of the block of a lattice point, in blocks; both as of ``along_rows``."""
    short = _PLANE if plane else _SHORT
    return x >> short, y >> short, z >> _LONG


@inlined
def key_bits(plane, bits):
    """Bits of an ``order_key``; ``bits`` are those of a coordinate."""
    if plane:
        return 2 * max(bits, _PLANE)
    return 2 * max(bits, _SHORT) + max(bits, _LONG)


@inlined
def order_key(plane, bits, w0, w1, w2):
    """A number by which lattice points are in order; a coordinate has at most 21 bits if there are three."""
    if plane:
        block = w0 >> _PLANE << max(bits - _PLANE, 0) | w1 >> _PLANE
        return (block << _PLANE | w0 & (1 << _PLANE) - 1) << _PLANE | w1 & (1 << _PLANE) - 1
    block = w0 >> _SHORT << max(bits - _SHORT, 0) | w1 >> _SHORT
    block = block << max(bits - _LONG, 0) | w2 >> _LONG
    low = (w0 & (1 << _SHORT) - 1) << _SHORT | w1 & (1 << _SHORT) - 1
    return (block << 2 * _SHORT | low) << _LONG | w2 & (1 << _LONG) - 1


@inlined
def _next_part(key, bits):
    """The last bits of a number, and the rest of it."""
    return key & (1 << bits) - 1, key >> bits


@inlined
def point_of(plane, bits, key):
    """The lattice point of an ``order_key``."""
    if plane:
        low1, key = _next_part(key, _PLANE)
        low0, key = _next_part(key, _PLANE)
        high1, high0 = _next_part(key, max(bits - _PLANE, 0))
        return high0 << _PLANE | low0, high1 << _PLANE | low1, np.int64(0)
    low2, key = _next_part(key, _LONG)
    low1, key = _next_part(key, _SHORT)
    low0, key = _next_part(key, _SHORT)
    high2, key = _next_part(key, max(bits - _LONG, 0))
    high1, high0 = _next_part(key, max(bits - _SHORT, 0))
    return high0 << _SHORT | low0, high1 << _SHORT | low1, high2 << _LONG | low2


@inlined
def sort(key, count, bits, place):
    """Sort the first numbers of row 0 of ``key`` (2, M), digit by digit; returns the row that has them then."""
    row = 0
    for shift in range(0, bits, _DIGIT):
        place[:] = 0
        for i in range(count):
            place[np.uint64((key[row, i] >> shift & DIGITS - 1) + 1)] += 1
        for number in range(DIGITS):
            place[number + 1] += place[number]
        for i in range(count):
            digit = np.uint64(key[row, i] >> shift & DIGITS - 1)
            key[1 - row, place[digit]] = key[row, i]
            place[digit] += 1
        row = 1 - row
    return row
