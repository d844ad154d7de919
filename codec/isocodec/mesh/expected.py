"""Prediction of the vertex across an open face of a growing mesh (spec clause 10.10.3(1))."""

from __future__ import annotations

import numpy as np

from ..kernel import inlined, inner
from .affine import SPAN, root
from .growth import OPEN

REFLECTED, EVEN = 0, 1
"""Two predictions of a vertex, rows of ``Growth.aim``; the one with the smaller error so far is used."""
HALVES, HEIGHT, SIDE, BENT = 128, 128, 80, 32
"""Weights of an even place, in parts of 256: each end of the face, the height of the triangle before it, a line as
long as the face, and the open sides at both ends."""


@inlined
def _front(g, t, o, v):
    """Other end of another open side that begins at v, a vertex of face o of triangle t; v without one."""
    k = g.head[v]
    while k >= 0:
        other = k // 3
        place = k - 3 * other
        g.reg.work += 1
        for f in range(3):
            if f != place and g.neighbour[other, f] == OPEN and (other != t or f != o):
                return g.cell[other, 3 - f - place]
        k = g.link[k]
    return v


@inlined
def _spread(g, t):
    """Greatest difference of a coordinate of two vertices of a cell."""
    far = np.int64(0)
    for k in range(g.position.shape[1]):
        for i in range(g.cell.shape[1]):
            for j in range(i):
                far = max(far, abs(g.position[g.cell[t, i], k] - g.position[g.cell[t, j], k]))
    return far


@inner
def _even(g, t, o):
    """Predict a vertex so that its adjacent angles, and the lengths of its sides, are about equal."""
    d = g.position.shape[1]
    a, b, left = g.cell[t, (o + 1) % 3], g.cell[t, (o + 2) % 3], g.cell[t, o]
    far = _spread(g, t)
    shift = np.int64(0)
    while far >> shift >= 1 << (SPAN - 1):
        shift += 1
    base, along, length = np.int64(0), np.int64(0), np.int64(0)
    for k in range(d):
        side = g.position[b, k] - g.position[a, k]
        length += side * side
        base += (side >> shift) * (side >> shift)
        along += (side >> shift) * ((g.position[left, k] - g.position[a, k]) >> shift)
    height = np.int64(0)
    for k in range(d):
        side = g.position[b, k] - g.position[a, k]
        g.aim[EVEN, k] = g.position[a, k] + along * side // (base if base > 0 else np.int64(1)) - g.position[left, k]
        height += g.aim[EVEN, k] * g.aim[EVEN, k]
    length, height = root(length), max(root(height), np.int64(1))
    at_a, at_b = _front(g, t, o, a), _front(g, t, o, b)
    for k in range(d):
        bent = g.position[at_a, k] - g.position[a, k] + g.position[at_b, k] - g.position[b, k]
        up = HEIGHT * g.aim[EVEN, k] + SIDE * (g.aim[EVEN, k] * length // height)
        g.aim[EVEN, k] = (HALVES * (g.position[a, k] + g.position[b, k]) + up + BENT * bent) >> 8


@inner
def expect(g, t, o):
    """Store both predictions of a vertex across face o of cell t, and which one is used."""
    corners = g.cell.shape[1]
    for k in range(g.position.shape[1]):
        total = np.int64(0)
        for i in range(corners):
            if i != o:
                total += g.position[g.cell[t, i], k]
        g.aim[REFLECTED, k] = 2 * total // (corners - 1) - g.position[g.cell[t, o], k]
    chosen = REFLECTED
    if corners == 3:
        _even(g, t, o)
        if g.missed[EVEN] < g.missed[REFLECTED]:
            chosen = EVEN
    for m in range(2):
        for k in range(g.position.shape[1]):
            g.aim[m, k] = min(max(g.aim[m, k], 0), g.extent[k] - 1)
    g.reg.chosen = chosen


@inlined
def learn_miss(g, k, place, fine):
    """Record the errors of both predictions in coordinate k of a vertex."""
    for m in range(2):
        g.missed[m] += ((abs(place - g.aim[m, k]) << fine) - g.missed[m]) >> 5
