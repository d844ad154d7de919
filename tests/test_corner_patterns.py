"""Contexts of refinement signs against plain geometry: which corners look alike, and what a pattern holds (7.6)."""

from __future__ import annotations

from collections import defaultdict
from copy import copy
from functools import cache
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import clamped, examples, simplices
from isocodec.grid.lattice.access import kind
from isocodec.grid.lattice.diamond import diamond_at
from isocodec.grid.lattice.tables import mesh_tables
from isocodec.grid.models.corner_patterns import CLASS, CLASSES
from isocodec.grid.models.refinement_signs import expected_sign
from isocodec.grid.passes.bisection import look
from isocodec.grid.passes.refinement import _assumed
from isoconform.meshes import exponent
from tables import looped

STARTS = {0: 0, 1: 20, 2: 29}
"""First of the patterns of a phase, n = 3."""
SHAPES = [(5, 5), (4, 7), (9, 6), (2, 6), (3, 3, 3), (4, 5, 3), (2, 5, 6), (6, 3, 4)]


class Around:
    """The diamond of a middle, of so many simplices as there are: all in units of g, unclamped."""

    def __init__(self, w, members):
        n = len(w)
        self.w, self.n, self.phase = np.array(w), n, n - int((np.array(w) % 2).sum())
        self.simplices, tag = members, n - self.phase
        ends = sorted([tuple(members[0][0]), tuple(members[0][tag])])
        self.ring = sorted({tuple(v) for s in members for v in s} - set(ends))
        self.members = {frozenset(map(tuple, s)) for s in members}
        odd = self.w % 2 == 1
        self.anchor, self.other = sorted(ends, key=lambda p: (np.array(p)[odd] % 4 != 0).any())
        self.ends = ends


@cache
def arounds(n, level, k):
    """All diamonds of a level, the root cube being 2**k wide, by middle; units of g are wholes."""
    r = level % n
    found = defaultdict(list)
    for s in simplices(n, k, level):
        doubled = s if level // n == k else s * 2 >> k - level // n
        found[tuple((doubled[0] + doubled[n - r]) // 2)].append(doubled)
    return {w: Around(w, members) for w, members in found.items()}


def whole(n, r):
    """A diamond for each middle modulo 4 that lies in the midst of a mesh."""
    return [a for a in arounds(n, 2 * n + r, 3).values() if ((a.w >= 2) & (a.w <= 5)).all()]


def symmetries(around, crossed):
    """Permutations of the ring by what takes the diamond to itself, its anchor too, or if need be to the other end."""
    points = [np.array(p) for p in around.ring]
    found = set()
    for order, signs in product(permutations(range(3)), product((1, -1), repeat=3)):
        def image(p, order=order, signs=signs):
            return tuple(around.w + (np.array(p) - around.w)[list(order)] * signs)

        if {frozenset(map(image, m)) for m in around.members} != around.members:
            continue
        if image(around.anchor) == around.anchor or not crossed:
            found.add(tuple(around.ring.index(image(p)) for p in points))
    return found


@pytest.mark.parametrize("r", range(3))
def test_corners_have_one_class_if_a_symmetry_takes_them_to_one_another(r):
    """Each middle modulo 4, all signs; the numbers are those that Burnside's lemma gives."""
    tables = mesh_tables(3)
    tried = whole(3, r)
    assert len(tried) == (8, 24, 24)[r]
    for around in tried:
        size = len(around.ring)
        for crossed in (0, 1):
            moves = symmetries(around, crossed)
            signs = np.arange(1 << size)
            smallest = np.min([sum((signs >> i & 1) << to for i, to in enumerate(move)) for move in moves], axis=0)
            number = kind(tables, np.int64(r), *around.w)
            found = CLASS[number, signs << 1 | crossed].astype(int) - STARTS[r]
            assert len({*zip(smallest.tolist(), found.tolist(), strict=True)}) == len({*smallest}) == len({*found})
            assert len({*found}) == found.max() + 1 == ((13, 9, 51), (20, 9, 51))[crossed][r]
            assert max(CLASSES[3][r] - found) > 0


def reading(around, signs, crossed):
    """The least reading of the text, as a string of digits."""
    def beside(p, q):
        return p != q and any({p, q} <= m for m in around.members)

    found = []
    for first in around.ring:
        for second in filter(lambda p, first=first: beside(first, p), around.ring):
            circle = [first, second]
            while len(circle) < len(around.ring):
                circle.append(next(p for p in around.ring if beside(circle[-1], p) and p not in circle))
            away = np.array(first) - (around.anchor if around.phase == 0 else around.w)
            if (around.phase == 0 and not crossed) or np.count_nonzero(away) == 1:
                found.append("".join(str(signs[p]) for p in circle))
    return min(found)


@cache
def readings(r, crossed):
    """All least readings at a phase, in order."""
    around = whole(3, r)[0]
    return sorted({
        reading(around, dict(zip(around.ring, signs, strict=True)), crossed)
        for signs in product((0, 1), repeat=len(around.ring))
    })


def wanted(around, sign, whole_one):
    """What 7.6 makes of a diamond: whether it is crossed, predicted sign, pattern and class.

    ``sign`` is a function of points, None for those that are not known. ``around`` has the ring corners of existing
    members, ``whole_one`` all.
    """
    here, s = sign(around.anchor), sign(around.ends[0] if around.n == 2 else around.anchor)
    ring = {p: int(p in around.ring and sign(p) not in (None, s)) for p in whole_one.ring}
    crossed = int(sign(around.other) not in (None, here))
    count = sum(ring.values())
    likely = 1 - s if crossed and 2 * count > len(ring) else s
    if around.n == 3:
        number = readings(around.phase, crossed).index(reading(whole_one, ring, crossed))
        pattern = STARTS[around.phase] + number
    else:
        number = count if s == here else 2 - count
        (a0, a1), w = ring.values(), around.w
        steps = ((0, 2), (2, 0)) if around.phase == 0 else ((1, 1), (1, -1))
        b0, b1 = (int(sign(tuple(w - d)) not in (None, s)) for d in steps)
        along = np.array(around.ends[1]) - around.ends[0]
        way = along[0] * along[1] < 0 if around.phase == 0 else along[0] != 0
        pattern = 32 * around.phase + 16 * way + 8 * b1 + 4 * b0 + 2 * a1 + a0
    return crossed, likely, pattern, crossed * CLASSES[around.n][around.phase] + number


@cache
def rims(shape, level):
    """The diamonds of a level in a box: by middle the whole one, and the one of the members that exist."""
    n, k = len(shape), exponent(shape)
    there = {tuple(sorted(map(tuple, s))) for s in clamped(shape, level).tolist()}
    out = {}
    for w, inside in arounds(n, level, k).items():
        members = [m for m in inside.members if tuple(sorted(at(p, shape, level) for p in m)) in there]
        if members:
            like = next(a for a in whole(n, level % n) if not ((a.w - inside.w) % 4).any())
            around = Around(w, [np.array(s) + inside.w - like.w for s in like.simplices])
            part = copy(around)
            part.ring = [p for p in around.ring if any(p in m for m in members)]
            out[w] = around, part
    return out


def at(p, shape, level):
    """The position of a lattice point of a level, which it shares with its image."""
    c = 1 << exponent(shape) - level // len(shape)
    return tuple(np.minimum(np.array(p) * c // 2, np.array(shape) - 1).tolist())


def compared(shape, seed):
    """Compare patterns at all middles after each byte of a file: how many, and at how many the ring is not whole."""
    n = len(shape)
    field = np.random.default_rng(seed).integers(0, 2, shape)
    data = isocodec.encode(field, 0.5, layers=[("base", 0), ("refine", None)], profile="baseline")
    decoder, tried, cut_off = isocodec.Decoder(), 0, 0
    for i in range(len(data)):
        decoder.feed(data[i : i + 1])
        list(decoder)
        tubes = [tube for tube in getattr(decoder.contents, "tubes", []) if tube]
        if not tubes or tubes[0].state.counters.base_level or tubes[0].state.counters.level >= n * exponent(shape):
            continue
        state = tubes[0].state
        level = int(state.counters.level)
        known = {tuple(v[:n]): v[3] for v in state.vertex[: state.counters.vertices].tolist()}

        def sign(p, level=level, known=known):
            return known.get(at(np.maximum(p, 0), shape, level))

        for w, (around, part) in rims(shape, level).items():
            if sign(around.anchor) is None or sign(around.other) is None:
                continue
            place = [np.int64(x) for x in (*w, *[0] * (3 - n))]
            edge = np.int64(1 << exponent(shape) - level // n)
            diamond = diamond_at(state.grid, edge, np.int64(level % n), *place)
            found = expected_sign(state, diamond, _assumed(state, diamond, look(state, diamond)))
            assert tuple(map(int, found)) == tuple(map(int, wanted(part, sign, around)))
            tried += 1
            cut_off += part.ring != around.ring
    return tried, cut_off


@pytest.mark.parametrize("shape", SHAPES)
@examples(20)
@given(st.integers(0, 999))
def test_patterns_in_the_midst_of_rounds(shape, seed):
    """On and off the border, with corners and middles known or not, whatever the phase."""
    compared(shape, seed)


@looped("shape", SHAPES)
def test_patterns_are_compared_at_the_border(shape):
    tried, cut_off = np.sum([compared(shape, seed) for seed in range(3)], axis=0)
    assert tried > 10 and (cut_off > 0 or shape == (2, 6))
