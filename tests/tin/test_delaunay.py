"""The exact Delaunay triangulation: against triangulations from scratch, by definition, and another library's."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest

from isocodec.errors import InputError
from isocodec.tin import points as table
from isocodec.tin.delaunay import delaunay, remove, triangles, triangulate
from isocodec.tin.rank import by_rank, ranks
from libraries import Late
from tables import looped

Delaunay = Late("scipy.spatial.Delaunay")

KINDS = ("random", "grid", "few places", "line and a point", "circle", "wide")


def points_of(kind: str, count: int, seed: int) -> np.ndarray:
    """Distinct points, in the order of their ranks; x and y in rows."""
    rng = np.random.default_rng(seed)
    if kind == "random":
        found = rng.integers(0, 1000, (count, 2))
    elif kind == "grid":
        side = int(np.sqrt(count))
        found = np.argwhere(np.ones((side, side + 1)))
    elif kind == "few places":
        found = rng.integers(0, 2 + int(np.sqrt(count)), (count, 2))
    elif kind == "line and a point":
        found = np.stack([rng.integers(0, 4000, count), np.zeros(count, int)], axis=1)
        found[0] = 77, 5
    elif kind == "circle":
        # all integer points at the distance of 65 from the centre, and others at that of 25
        found = np.array([(x, y) for x in range(-65, 66) for y in range(-65, 66) if x * x + y * y in (65**2, 25**2)])
        found = found[:count] + 65
    else:
        found = rng.integers(0, 1 << 28, (count, 2))
    found = np.unique(found, axis=0).astype(np.int64)
    return np.ascontiguousarray(found[by_rank(found[:, 0], found[:, 1])].T)


def turned(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> int:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def by_definition(points: list[tuple[int, int]]) -> set[tuple[int, ...]]:
    """Triangles whose circle holds no point, the paraboloid raised by powers of a tiny number: all in fractions."""
    # the first point is raised most; far smaller than any determinant of such points, each than the one before
    tiny = [Fraction(1, 10 ** (60 * (i + 1))) for i in range(len(points))]
    height = [x * x + y * y + e for (x, y), e in zip(points, tiny, strict=True)]
    out = set()
    for a, b, c in itertools.combinations(range(len(points)), 3):
        area = turned(points[a], points[b], points[c])
        if area == 0:
            continue
        corners = (a, b, c) if area > 0 else (a, c, b)
        if all(_above(points, height, corners, d) for d in range(len(points)) if d not in corners):
            out.add(corners)
    return out


def _above(points: list[tuple[int, int]], height: list[Fraction], corners: tuple[int, ...], d: int) -> bool:
    """Whether the raised point lies above the plane through three others."""
    a, b, c = (points[v] for v in corners)
    u, v, w = turned(b, c, points[d]), turned(c, a, points[d]), turned(a, b, points[d])
    plane = (u * height[corners[0]] + v * height[corners[1]] + w * height[corners[2]]) / Fraction(u + v + w)
    return height[d] > plane


@looped("kind", KINDS)
def test_by_definition(kind: str):
    for seed in range(3):
        x, y = points_of(kind, 12, seed)
        points = list(zip(x.tolist(), y.tolist(), strict=True))
        found = {tuple(each) for each in triangles(delaunay(x, y)[0]).tolist()}
        assert found == by_definition(points)


@looped("kind", KINDS)
def test_removal_gives_what_construction_gives(kind: str):
    """After every 50th removal; 204 sets in all, whose hulls are straight or not."""
    for seed in range(34):
        count = 60 if seed else 400
        x, y = points_of(kind, count, seed)
        tri, _ = delaunay(x, y)
        left = np.ones(len(x), np.bool_)
        done = 0
        for v in np.random.default_rng(seed).permutation(len(x)).tolist():
            if not remove(tri, v):
                continue
            left[v] = False
            done += 1
            if done % 50 == 0 or done == 7:
                some = np.flatnonzero(left)
                assert np.array_equal(triangles(tri), some[triangles(delaunay(x[some], y[some])[0])])
        # corners of the hull stay: all others can go
        assert len(triangles(tri)) == left.sum() - 2


def test_another_library():
    """Where no four points lie on a circle there is but one triangulation."""
    for seed in range(20):
        points = np.random.default_rng(seed).integers(0, 1 << 24, (300, 2))
        theirs = {tuple(sorted(each)) for each in Delaunay(points.astype(float)).simplices.tolist()}
        assert {tuple(sorted(each)) for each in triangulate(points).tolist()} == theirs


@looped("kind", KINDS)
def test_order_of_points_does_not_matter(kind: str):
    x, y = points_of(kind, 80, 5)
    points = np.stack([x, y], axis=1)
    first = points[triangulate(points)]
    shuffled = np.random.default_rng(1).permutation(points)
    assert np.array_equal(first, shuffled[triangulate(shuffled)])


def test_ranks_are_those_of_the_specification():
    """Worked out by hand for (0, 0); (1, 0) and (3, 2) with Python's own numbers, as clause 10.5.2 says."""

    def rank(x: int, y: int) -> int:
        h = x * 0x9E3779B1 % 2**32 ^ y * 0x85EBCA77 % 2**32
        h = (h ^ h >> 15) * 0xC2B2AE3D % 2**32
        h = (h ^ h >> 13) * 0xC2B2AE3D % 2**32
        return h ^ h >> 16

    places = np.array([(0, 0), (1, 0), (3, 2), (2**28 - 1, 2**28 - 1), (12345678, 87654321)])
    assert ranks(*places.T).tolist() == [rank(x, y) for x, y in places.tolist()]
    assert ranks(*places[:1].T)[0] == 0


@looped(
    ("points", "code"),
    [
        ([(0, 0), (1, 1), (2, 2), (5, 5)], "collinear"),
        ([(0, 0), (1, 1)], "collinear"),
        ([(0, 0), (1, 0), (0, 1), (1, 0)], "coincident"),
        ([(0, 0), (1, 0), (0, 1 << 28)], "range"),
        ([(0, 0), (1, 0), (0, -1)], "range"),
    ],
)
def test_what_is_no_triangulation(points: list[tuple[int, int]], code: str):
    with pytest.raises(InputError) as caught:
        triangulate(np.array(points))
    assert caught.value.code == code


def test_means_of_points_that_coincide_do_not_depend_on_their_order() -> None:
    """Sums of floats do."""
    points = np.array([[0, 0], [5, 1], [2, 7], *[[3, 3]] * 5], float)
    values = np.array([1, 2, 3, 1e16, 1, -1e16, 3, 1e-3])
    found = set()
    for seed in range(30):
        order = np.random.default_rng(seed).permutation(len(points))
        made = table.points_of(points[order], values[order])
        found.add(tuple(made.value.tolist()))
        assert made.merged == 4
    assert len(found) == 1
