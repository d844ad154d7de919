"""Classes of the corners around a middle, up to the symmetries of its diamond (spec clause 7.6)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...kernel import constant
from ..lattice.tables import MOST_CORNERS, MOST_KINDS, MOST_MEMBERS, START, mesh_tables

CLASSES = {2: (3, 3), 3: (20, 9, 51)}
"""Most classes of ring corners at each phase, of those where the ends differ and of those where they do not."""
PATTERNS = sum(CLASSES[3])
"""Contexts of either; for n = 2, with middles before, there are 64."""


def _kinds(n: int) -> Iterator[tuple[int, int, NDArray[np.int64]]]:
    """Kinds of diamonds with phase and middle, modulo 4 in units of g."""
    kind = mesh_tables(n)[START["KIND"] :][: 64 * n].reshape(n, 64)
    for r, key in np.argwhere(kind >= 0):
        yield int(kind[r, key]), int(r), key >> np.array([0, 2, 4]) & 3


def _corners(n: int, kind: int) -> NDArray[np.int64]:
    """Corners of a kind of diamond in units of g, both ends first."""
    t = mesh_tables(n)
    return t[START["CORNER"] + kind * MOST_CORNERS * 3 :][: 3 * t[START["CORNERS"] + kind]].reshape(-1, 3).astype(int)


def _anchors(n: int) -> NDArray[np.int64]:
    """The end that is the anchor, by kind: along the odd axes of the middle it lies at multiples of 4 g."""
    ends = np.zeros(MOST_KINDS, np.int64)
    for kind, _, w in _kinds(n):
        ends[kind] = (_corners(n, kind)[0][w % 2 == 1] % 4).any()
    return ends


def _circle(kind: int, first: int) -> list[int]:
    """Ring corners of a kind of diamond, n = 3, from the first on, each beside those with which it shares members."""
    t = mesh_tables(3)
    bits = t[START["MEMBER"] + kind * MOST_MEMBERS * 5 + 4 :][: 5 * t[START["MEMBERS"] + kind] : 5]
    pairs = [{i for i in range(2, MOST_CORNERS) if b >> i & 1} for b in bits]
    circle = [first]
    while pairs:
        pair = next(p for p in pairs if circle[-1] in p)
        pairs.remove(pair)
        circle += pair - {circle[-1]}
    return circle[:-1]


def _classes(size: int, step: int) -> NDArray[np.int64]:
    """Class of all signs around a circle, read from every ``step``-th corner, either way: (2**size,) int64.

    Signs are a number, that of the first corner its highest bit. Classes are in the order of their least readings.
    """
    corner = np.arange(size)
    digit = 1 << corner[::-1]
    signs = np.arange(1 << size)[:, None] // digit & 1
    ways = [(at + way * corner) % size for at in range(0, size, step) for way in (1, -1)]
    readings = [signs[:, way] @ digit for way in ways]
    return np.unique(np.min(readings, axis=0), return_inverse=True)[1]


def _table() -> NDArray[np.uint8]:
    """Class by kind of diamond, n = 3, and bits of the corners but for the anchor that have not its sign.

    The lowest bit is that of the other end. Classes of a phase follow those of the one before.
    """
    found = np.zeros((MOST_KINDS, 1 << MOST_CORNERS - 1), np.uint8)
    anchors = _anchors(3)
    size = (6, 4, 8)
    # ends of one sign may change places: corners beside one of them are like those beside the other
    classes = [[_classes(size[r], 1 if r == 0 and not crossed else 2) for crossed in (0, 1)] for r in range(3)]
    for kind, r, w in _kinds(3):
        corner = _corners(3, kind)
        along = (corner[2:] != (w if r else corner[anchors[kind]])).sum(axis=1) == 1
        circle = np.array(_circle(kind, 2 + int(np.argmax(along))))
        bits = np.arange(1 << size[r] + 1)
        ring = (bits[:, None] >> circle - 1 & 1) @ (1 << np.arange(size[r])[::-1])
        found[kind, : len(bits)] = np.where(bits & 1, classes[r][1][ring], classes[r][0][ring]) + sum(CLASSES[3][:r])
    return found


ANCHOR_2, ANCHOR_3, CLASS = constant(partial(_anchors, 2)), constant(partial(_anchors, 3)), constant(_table)
