"""A linear function through estimated heights of a ring, in integers (spec clause 10.8.4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import inlined, inner, record
from ..kernel.types import IntMatrix, IntVector, Registers
from .affine import root
from .shape import shift_of

SPAN, NEAR, HEIGHT, MOMENT, FORCE, SLOPE = 11, 10, 15, 13, 23, 20
"""Bits of differences, of weights, of heights, of second moments, of moments with heights, and of the gradient."""
SIXTEENTH = 4
"""Heights are multiples of ``2**-SIXTEENTH`` of a difference."""


class RingRegisters(Registers):
    """Ring of the current vertex.

    Attributes
    ----------
    clock, count : int
        Mark of its vertices, and how many there are.
    shift : int
        Low bits of positions that are dropped.
    near, far : int
        Square of the distance of the nearest, at least 1, and the mean distance, at least 1, of shifted positions.
    total : int
        Sum of the weights.
    fit, slope : int
        Value of the fit there, in parts of shifted positions, and size of its gradient.
    past : int
        Whether the fit had the last signs right, as bits, the latest lowest.
    """

    clock: int
    count: int
    shift: int
    near: int
    far: int
    total: int
    fit: int
    slope: int
    past: int


@record
class RingEstimates(NamedTuple):
    """Estimates at V vertices, and the ring of one.

    ``position`` (V, 3); ``height`` (V,): estimated distances above the isovalue, in units of positions; ``trust``
    (V,): shares of signs around that were those of the fit, in 1/256; ``tilt`` (V,): means of signs around, from -256
    to 256; ``mark`` (V + 1,); ``ring``, ``square``, ``distance``, ``weight``, ``level`` (R,): vertices of the ring,
    with squares of their distances, distances, weights and heights, of shifted positions; ``side`` (R, 3): differences;
    ``mean`` (3,): weighted means of these.
    """

    position: IntMatrix
    height: IntVector
    trust: IntVector
    tilt: IntVector
    mark: IntVector
    ring: IntVector
    square: IntVector
    distance: IntVector
    weight: IntVector
    level: IntVector
    side: IntMatrix
    mean: IntVector
    reg: RingRegisters


@inlined
def bounded(x, bits):
    """Clamp a number to ``bits`` bits."""
    most = np.int64(1) << bits
    return min(max(x, -most), most)


@inner
def _measure(g, v):
    """Compute differences, distances and heights of the ring."""
    reg = g.reg
    far = np.int64(0)
    for i in range(reg.count):
        for k in range(3):
            far = max(far, abs(g.position[g.ring[i], k] - g.position[v, k]))
    s = shift_of(far, SPAN)
    reg.shift = s
    reg.near = np.int64(1) << 62
    total = np.int64(0)
    for i in range(reg.count):
        u = g.ring[i]
        square = np.int64(0)
        for k in range(3):
            g.side[i, k] = (g.position[u, k] - g.position[v, k]) >> s
            square += g.side[i, k] * g.side[i, k]
        g.distance[i] = root(square)
        g.square[i] = max(square, np.int64(1))
        reg.near = min(reg.near, g.square[i])
        total += g.distance[i]
        g.level[i] = bounded((g.height[u] << SIXTEENTH) >> s, HEIGHT)
    reg.far = max(total // reg.count, np.int64(1))


@inner
def _weigh(g):
    """Compute weights and weighted means of the ring; returns that of the heights."""
    reg = g.reg
    reg.total = 0
    heights = np.int64(0)
    g.mean[:] = 0
    for i in range(reg.count):
        weight = max((reg.near << NEAR) // g.square[i], np.int64(1))
        g.weight[i] = weight
        reg.total += weight
        heights += weight * g.level[i]
        for k in range(3):
            g.mean[k] += weight * g.side[i, k]
    mean = heights // reg.total
    for k in range(3):
        g.mean[k] = g.mean[k] // reg.total
    return mean


@inner
def _solve(g, mean):
    """Find the gradient of the fit by Cramer's rule; returns its value at the vertex."""
    reg, m = g.reg, g.mean
    c00, c01, c02, c11, c12, c22 = (np.int64(0), np.int64(0), np.int64(0), np.int64(0), np.int64(0), np.int64(0))
    f0, f1, f2 = np.int64(0), np.int64(0), np.int64(0)
    for i in range(reg.count):
        x, y, z = g.side[i, 0] - m[0], g.side[i, 1] - m[1], g.side[i, 2] - m[2]
        w, h = g.weight[i], g.level[i] - mean
        c00 += w * x * x
        c01 += w * x * y
        c02 += w * x * z
        c11 += w * y * y
        c12 += w * y * z
        c22 += w * z * z
        f0 += w * x * h
        f1 += w * y * h
        f2 += w * z * h
    stiff = reg.total * reg.far * reg.far // 100 + 1
    r = shift_of(max(c00, c11, c22) + stiff, MOMENT)
    c00, c11, c22 = (c00 + stiff) >> r, (c11 + stiff) >> r, (c22 + stiff) >> r
    c01, c02, c12 = c01 >> r, c02 >> r, c12 >> r
    f0, f1, f2 = bounded(f0 >> r, FORCE), bounded(f1 >> r, FORCE), bounded(f2 >> r, FORCE)
    a00, a01, a02 = c11 * c22 - c12 * c12, c02 * c12 - c01 * c22, c01 * c12 - c02 * c11
    a11, a12, a22 = c00 * c22 - c02 * c02, c01 * c02 - c00 * c12, c00 * c11 - c01 * c01
    whole = max((c00 * a00 + c01 * a01 + c02 * a02) >> 10, np.int64(1))
    b0 = bounded((a00 * f0 + a01 * f1 + a02 * f2) // whole, SLOPE)
    b1 = bounded((a01 * f0 + a11 * f1 + a12 * f2) // whole, SLOPE)
    b2 = bounded((a02 * f0 + a12 * f1 + a22 * f2) // whole, SLOPE)
    reg.slope = root(b0 * b0 + b1 * b1 + b2 * b2)
    return mean - ((b0 * m[0] + b1 * m[1] + b2 * m[2]) >> 10)


@inner
def gather(g, v, face, start, end):
    """Find the ring of a vertex, from its cells or their faces opposite, and fit a linear function to its heights."""
    reg = g.reg
    reg.clock += 1
    reg.count = 0
    apex = len(g.position)
    for i in range(start, end):
        for j in range(face.shape[1]):
            u = face[i, j]
            if u not in (v, apex) and g.mark[u] != reg.clock:
                g.mark[u] = reg.clock
                g.ring[reg.count] = u
                reg.count += 1
    _measure(g, v)
    reg.fit = _solve(g, _weigh(g))


@inner
def weighted(g, value):
    """Weighted mean over the ring."""
    total = np.int64(0)
    for i in range(g.reg.count):
        total += g.weight[i] * value[g.ring[i]]
    return total // g.reg.total
