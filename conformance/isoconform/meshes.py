"""Meshes for the vectors: closed sets of middles, picked by random numbers, by recursive bisection (clause 4.7).

Nothing here uses the tables of the codec.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from itertools import permutations

import numpy as np

from isocodec.grid.lattice.store import grown, put
from isocodec.grid.lattice.vertex_set import GONE, Chosen, every_vertex

from .fields import Shape, random_numbers

Point = tuple[int, ...]
Mesh = frozenset[Point]
BITS = 10
"""Of the random number that decides about a middle: shares are counted in 1 / 2**BITS."""


@cache
def parents(shape: Shape) -> dict[Point, Mesh]:
    """All middles of the full mesh, unclamped, with their parents."""
    n, k = len(shape), exponent(shape)
    found: dict[Point, set[Point]] = {}
    stack = []
    for order in permutations(range(n)):
        path = [(0,) * n]
        for axis in order:
            path.append(tuple(c + (a == axis) * (1 << k) for a, c in enumerate(path[-1])))
        stack.append((0, path))
    while stack:
        level, simplex = stack.pop()
        if level == n * k or not _exists(simplex, shape):
            continue
        tag = n - level % n
        middle = tuple((a + b) // 2 for a, b in zip(simplex[0], simplex[tag], strict=True))
        up = found.setdefault(middle, set())
        if level > 0:
            up.add(simplex[1 if level % n == 0 else tag + 1])
        stack.append((level + 1, [*simplex[:tag], middle, *simplex[tag + 1 :]]))
        stack.append((level + 1, [*simplex[1 : tag + 1], middle, *simplex[tag + 1 :]]))
    return {middle: frozenset(up) for middle, up in found.items()}


def exponent(shape: Shape) -> int:
    """The root cube has the edge 2**k."""
    return max(max(shape) - 2, 0).bit_length()


def level_of(middle: Point, shape: Shape) -> int:
    """Level of a middle (clause 4.7(1))."""
    unit = min(c & -c for c in middle if c)
    return len(shape) * (exponent(shape) - unit.bit_length() + 1) - sum(c // unit % 2 for c in middle)


def _exists(simplex: list[Point], shape: Shape) -> bool:
    """Whether the clamped image has a volume."""
    clamped = [[min(c, s - 1) for c, s in zip(p, shape, strict=True)] for p in simplex]
    rows = [[a - b for a, b in zip(p, clamped[0], strict=True)] for p in clamped[1:]]
    return _determinant(rows) != 0


def _determinant(rows: list[list[int]]) -> int:
    if len(rows) == 1:
        return rows[0][0]
    minors = ([row[:i] + row[i + 1 :] for row in rows[1:]] for i in range(len(rows)))
    return sum((-1) ** i * rows[0][i] * _determinant(minor) for i, minor in enumerate(minors))


def closed(shape: Shape, wanted: Iterable[Point]) -> Mesh:
    """The smallest mesh that has the wanted middles."""
    up = parents(shape)
    found: set[Point] = set()
    stack = list(wanted)
    while stack:
        middle = stack.pop()
        if middle not in found:
            found.add(middle)
            stack += up[middle]
    return frozenset(found)


def uniform(shape: Shape, level: int) -> Mesh:
    """The mesh of a uniform level."""
    return frozenset(w for w in parents(shape) if level_of(w, shape) < level)


def random_mesh(shape: Shape, seed: int, share: int, inside: Mesh = frozenset()) -> Mesh:
    """Middles picked at random, about ``share`` of ``2**BITS``, with their ancestors and all of another mesh."""
    every = sorted(parents(shape))
    numbers = random_numbers(seed, len(every), BITS)
    return closed(shape, [w for w, number in zip(every, numbers, strict=True) if number < share]) | inside


def chosen(shape: Shape, mesh: Mesh) -> Chosen:
    """A mesh as the encoder takes it."""
    out = every_vertex(shape)
    for middle in sorted(parents(shape).keys() - mesh):
        p = middle + (0,) * (3 - len(middle))
        if all(x < s for x, s in zip(p, out.inside.shape, strict=True)):
            out.inside[p] |= GONE
        else:
            out = out._replace(outside=grown(out.outside, 1))
            put(out.outside, *map(np.int64, p), GONE)
    return out
