"""Reduction of the finest mesh (rows C2-reduce, C2-topology, S3-topology), against meshes by recursive bisection.

Signs of vertices never change, and a contour that keeps its topology never sweeps over a vertex that is left. So the
regions of a reduced mesh, as sets of vertices, are those of the full one without the vertices that went. With the
number of pieces between two regions, their Euler characteristics and their loops on the border that says it all,
nesting included.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import combinations, pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brute import crossing_points, examples, mesh_leaves, mixed_leaves, sign_fields, simplices, smooth
from isocodec.field.samples import check_field
from isocodec.grid.lattice.simplex import newest
from isocodec.grid.lattice.vertex_set import has
from isocodec.search.coarsening import Reduction, bent, distinct
from isocodec.search.edges import crossing_on
from isocodec.search.original import original
from isocodec.search.promise import Promise
from isocodec.search.proof import Target
from isocodec.search.reduced import number_of, place_of
from isoconform.meshes import Mesh, closed, exponent, level_of, parents
from isospec.container import MAX_SIDE

Vertex = tuple[int, ...]
SIZES = [(2, 14), (3, 6)]


def mesh_of(reduction: Reduction) -> Mesh:
    """The vertices that are left, as a set of unclamped positions."""
    pad = (0,) * (3 - reduction.n)
    return frozenset(w for w in parents(reduction.shape) if has(reduction.chosen, *map(np.int64, w + pad)))


def is_closed(mesh: Mesh, shape: tuple[int, ...]) -> bool:
    up = parents(shape)
    return all(up[w] <= mesh for w in mesh)


def of(field: NDArray[np.bool_], points: NDArray[np.float64] | None = None) -> Reduction:
    """A reduction that knows nothing but signs."""
    phi = np.where(field, 1, -1).astype(np.float32)
    return Reduction(field, phi, np.zeros((0, field.ndim)) if points is None else points)


# -- topology by brute force -----------------------------------------------------------------------------------------


class Classes:
    """Equivalence classes (union-find)."""

    def __init__(self) -> None:
        self.up: dict = {}

    def find(self, x):
        self.up.setdefault(x, x)
        while self.up[x] != x:
            self.up[x] = self.up[self.up[x]]
            x = self.up[x]
        return x

    def join(self, items: Iterable) -> None:
        first, *others = items
        for x in [first, *others]:
            self.up[self.find(x)] = self.find(first)

    def label(self) -> dict:
        return {x: self.find(x) for x in list(self.up)}


def topology(field: NDArray[np.bool_], mesh: Mesh):
    """Regions of all vertices and of those on the border; for each piece of the contour its two regions, its Euler
    characteristic, and its number of pieces on the border."""
    n = field.ndim
    last = [s - 1 for s in field.shape]
    regions, on_border, pieces, traces = Classes(), Classes(), Classes(), Classes()
    parts: dict[frozenset[Vertex], int] = {}
    border_points: set[frozenset[Vertex]] = set()
    for _, x in mesh_leaves(field.shape, mesh):
        corners = [tuple(map(int, v)) for v in x]
        faces = [f for f in combinations(corners, n)
                 if any(all(v[a] == end for v in f) for a in range(n) for end in (0, last[a]))]
        for cells, classes, crossings in [([corners], regions, pieces), (faces, on_border, traces)]:
            for cell in cells:
                for side in (True, False):
                    if same := [v for v in cell if field[v] == side]:
                        classes.join(same)
                if crossed := [frozenset(e) for e in combinations(cell, 2) if field[e[0]] != field[e[1]]]:
                    crossings.join(crossed)
                    if classes is on_border:
                        border_points.update(crossed)
        # a crossed simplex of d + 1 vertices holds a cell of d - 1 dimensions
        for d in range(1, n + 1):
            for s in combinations(corners, d + 1):
                if len({bool(field[v]) for v in s}) == 2:
                    parts[frozenset(s)] = (-1) ** (d - 1)
    euler: Counter = Counter()
    between = {}
    for s, sign in parts.items():
        above, below = next(v for v in s if field[v]), next(v for v in s if not field[v])
        piece = pieces.find(frozenset((above, below)))
        euler[piece] += sign
        between[piece] = frozenset((regions.find(above), regions.find(below)))
    loops: dict = {piece: set() for piece in euler}
    for point in border_points:
        loops[pieces.find(point)].add(traces.find(point))
    return regions.label(), on_border.label(), [(between[p], euler[p], len(loops[p])) for p in euler]


def restriction(full: dict, part: dict):
    """Which class of ``full`` each of ``part`` is, if that is one to one."""
    names: dict = {}
    if any(names.setdefault(part[v], full[v]) != full[v] for v in part):
        return None
    return names if sorted(names.values()) == sorted(set(full.values())) else None


def same_topology(field: NDArray[np.bool_], mesh: Mesh) -> bool:
    """Whether the contour on a mesh is that on the full grid, as to topology."""
    regions, on_border, pieces = topology(field, frozenset(parents(field.shape)))
    ours, ours_on_border, our_pieces = topology(field, mesh)
    names = restriction(regions, ours)
    if names is None or restriction(on_border, ours_on_border) is None:
        return False
    found = Counter((frozenset(names[r] for r in pair), euler, loops) for pair, euler, loops in our_pieces)
    return found == Counter(pieces)


def test_brute_force_tells_changes():
    """A ball, a ring, an arc, a shell that is open: gone, or changed, on the root mesh."""
    for shape in [(9, 9), (5, 5, 5)]:
        field = np.zeros(shape, bool)
        field[(slice(1, 4),) * len(shape)] = True
        full = frozenset(parents(shape))
        assert same_topology(field, full) and not same_topology(field, frozenset())
        (piece,) = topology(field, full)[2]
        assert piece[1:] == (2 if len(shape) == 3 else 0, 0)
        field[(2,) * len(shape)] = False
        assert len(topology(field, full)[2]) == 2
    torus = np.zeros((5, 9, 9), bool)
    torus[2, 2:7, 2:7] = True
    torus[2, 4, 4] = False
    (piece,) = topology(torus, frozenset(parents(torus.shape)))[2]
    assert piece[1:] == (0, 0)
    tube = np.zeros((5, 5, 5), bool)
    tube[2, 2] = True
    (piece,) = topology(tube, frozenset(parents(tube.shape)))[2]
    assert piece[1:] == (0, 2)


# -- criteria --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "k"), [(2, 3), (3, 2)])
def test_newest_vertex(n, k):
    """The parents of a middle are what the bisection that made its members added."""
    for level in range(1, n * k + 1):
        before, after = simplices(n, k, level - 1), simplices(n, k, level)
        middles = (before[:, 0] + before[:, n - (level - 1) % n]) // 2
        number = getattr(newest, "py_func", newest)(n, level % n)
        assert (after[:, number] == np.repeat(middles, 2, axis=0)).all()


def reduced(field, **how):
    """The mesh of a field that is reduced so, which is closed under parents."""
    reduction = of(field)
    reduction.reduce(**how)
    mesh = mesh_of(reduction)
    assert is_closed(mesh, field.shape)
    return mesh


@pytest.mark.parametrize(("n", "most"), SIZES)
def test_topology(n, most):
    @settings(examples(150), deadline=None)
    @given(sign_fields(n, most))
    def run(field):
        assert same_topology(field, reduced(field, topology=True))

    run()


@pytest.mark.parametrize(("n", "most"), SIZES)
def test_topology_of_all_meshes_between(n, most):
    """Whatever comes back, the topology stays: what ``restore`` and refinement to the full grid rely on."""

    @settings(examples(60), deadline=None)
    @given(sign_fields(n, most), st.integers(0, 1 << 32))
    def run(field, seed):
        rng = np.random.default_rng(seed)
        reduction = of(field)
        reduction.reduce(topology=True)
        mesh = mesh_of(reduction)
        some = [w for w in sorted(parents(field.shape)) if rng.random() < 0.1]
        assert same_topology(field, mesh | closed(field.shape, some))
        places = rng.uniform(0, np.array(field.shape) - 1, (3, n))
        added = reduction.restore(places)
        more = mesh_of(reduction)
        assert mesh <= more and is_closed(more, field.shape) and same_topology(field, more)
        assert added == len(more) - len(mesh)

    run()


@pytest.mark.parametrize("n", [2, 3])
def test_places_of_middles_as_numbers(n):
    """Any place of the largest box, and as far again beyond, has a number of its own, in the order of places."""
    most = 2 * MAX_SIDE[n] - 1
    ends = [0, 1, most // 2, most // 2 + 1, most - 1, most]
    places = [(*place, 0)[:3] for place in product(ends, repeat=n)]
    numbers = [number_of(n, *map(np.int64, place)) for place in places]
    assert all(a < b for a, b in pairwise([-1, *numbers]))
    assert [tuple(map(int, place_of(n, number))) for number in numbers] == places


@pytest.mark.parametrize("n", [2, 3])
def test_a_share_of_the_leaves(n):
    """Of many leaves those with the most places are bisected first; of few all."""
    size = 33 if n == 2 else 17
    field = smooth((size,) * n, 1) > 0
    rng = np.random.default_rng(n)
    # ever more places towards the far corner
    places = (size - 1) * rng.uniform(size=(4000, n)) ** 0.3
    reduction = of(field)
    reduction.reduce(level=n * exponent(field.shape) - 2 * n)
    leaves = reduction.leaves_at(places)
    held = Counter(tuple(leaf[:3]) for leaf in leaves)
    once, count = distinct(n, leaves)
    assert dict(zip(map(tuple, once[:, :3]), count, strict=True)) == held
    before = mesh_of(reduction)
    reduction.restore(places, share=0.25)
    bisected = {leaf for leaf in held if leaf[:n] in mesh_of(reduction) - before}
    assert len(bisected) >= len(held) // 4
    expected = sorted(held.values())[-(len(held) // 4)]
    assert {leaf for leaf in held if held[leaf] > expected} <= bisected
    # what is bisected beside these came as a parent: few
    assert sum(held[leaf] < expected for leaf in bisected) < len(bisected) / 2
    few = of(field)
    few.reduce(level=0)
    while len(leaves := distinct(n, few.leaves_at(places))[0]) < 17:
        few.restore(places, share=0.0)
        assert all(has(few.chosen, *leaf[:3]) for leaf in leaves)


@pytest.mark.parametrize(("n", "most"), SIZES)
def test_crossing(n, most):
    """The tubular neighbourhood of the full grid stays, and little else: where there is no curve, nothing does."""

    @settings(examples(80), deadline=None)
    @given(sign_fields(n, most))
    def run(field):
        mesh = reduced(field, crossing=True)
        assert mixed_leaves(field, mesh) == mixed_leaves(field, frozenset(parents(field.shape)))
        if field.all() or not field.any():
            assert not mesh

    run()


def test_start():
    """A reduction goes on from another one's mesh, and leaves that alone."""
    for seed, shape in enumerate([(17, 12), (3, 6), (9, 6, 5)]):
        phi = smooth(shape, seed).astype(np.float32)
        points = crossing_points(phi, 0.0)
        first = Reduction(phi > 0, phi, points)
        contour = original(check_field(phi, 0.0))
        near, far = (Target(contour.points, contour.cells, limit) for limit in (0.2, 1.0))
        first.reduce(topology=True, distortion=0.2, original=near)
        mesh = mesh_of(first)
        second = Reduction(phi > 0, phi, points, first.chosen)
        second.reduce(topology=True, distortion=1.0, original=far)
        assert mesh_of(second) <= mesh == mesh_of(first)
        assert is_closed(mesh_of(second), shape) and same_topology(phi > 0, mesh_of(second))


@pytest.mark.parametrize("shape", [(3, 6), (17, 9), (5, 4, 7)])
def test_levels_that_stay(shape):
    n, k = len(shape), exponent(shape)
    field = smooth(shape, 1) > 0
    for level in range(n * k + 1):
        uniform = frozenset(w for w in parents(shape) if level_of(w, shape) < level)
        reduction = of(field)
        reduction.reduce(level=level, coarsest=level)
        assert mesh_of(reduction) == uniform
        mesh = reduced(field, level=level, topology=True)
        assert uniform <= mesh and same_topology(field, mesh)


@pytest.mark.parametrize("shape", [(17, 9), (5, 4, 7)])
def test_level_alone(shape):
    """Row C2-uniform: what goes is what is finer than a level; the rest is the uniform mesh."""
    n, k = len(shape), exponent(shape)
    level = n * k - 1
    reduction = of(smooth(shape, 1) > 0)
    reduction.reduce(level=level)
    assert mesh_of(reduction) == frozenset(w for w in parents(shape) if level_of(w, shape) < level)


@pytest.mark.parametrize("shape", [(33, 33), (20, 31), (9, 8, 10)])
def test_stars_that_bend(shape):
    """Around points that bend enough the grid is full, at the border of the box as well."""
    phi = smooth(shape, 5).astype(np.float32)
    points = crossing_points(phi, 0.0)
    keep = np.random.default_rng(0).random(len(points)) < 0.1
    reduction = Reduction(phi > 0, phi, points)
    reduction.reduce(topology=True, curvature=np.where(keep, 1e9, 0.0), kappa=1.0)
    left, kept = (distinct(len(shape), reduction.leaves_at(of))[0] for of in (points, points[keep]))
    assert len(left) and not len(kept)
    assert same_topology(phi > 0, mesh_of(reduction))


def test_the_mean_over_a_star_counts():
    keys, curvature = np.array([7, -1, 3, 7, 3]), np.array([0.1, 9.0, 1.0, 0.5, 0.0])
    assert bent(keys, curvature, 0.3).tolist() == [3]
    assert bent(keys, curvature, 0.29).tolist() == [3, 7]
    assert not len(bent(keys, curvature, 0.5))


# -- distances -------------------------------------------------------------------------------------------------------


def fractions(dm, edges, out):
    for i in range(len(edges)):
        e = edges[i]
        out[i] = crossing_on(dm, (e[0], e[1], e[2]), (e[3], e[4], e[5]))


@pytest.mark.parametrize("shape", [(30, 21), (9, 17, 12)])
def test_crossings_are_those_that_are_sent(shape):
    """Edges in any direction, crossed once or more often: what ``Field.crossings`` has, but for rounding."""
    rng = np.random.default_rng(3)
    n = len(shape)
    values = (smooth(shape, 3) + 0.1 * rng.normal(size=shape)).astype(np.float32)
    field = check_field(values, 0.0)
    edges = np.zeros((500, 2, 3), np.int64)
    edges[:, :, :n] = rng.integers(0, shape, (500, 2, n))
    low, high = edges[:, 0, :n], edges[:, 1, :n]
    crossed = field.signs[tuple(low.T)] != field.signs[tuple(high.T)]
    found = np.zeros(crossed.sum())
    fractions(of(field.signs).domain._replace(phi=values.reshape(values.shape + (1,) * (3 - n))),
              edges[crossed].reshape(-1, 6), found)
    # single precision within one step of the edge
    assert np.abs(found - field.crossings(low[crossed], high[crossed]) / 2**30).max() < 1e-6


@pytest.mark.parametrize("shape", [(33, 20), (9, 10, 12)])
@pytest.mark.parametrize("parts", [2, 5])
def test_distance_after_one_level(shape, parts):
    """What a decoder draws after a sweep over the finest level is as near to the original points as was asked for.

    Later sweeps may turn an implied point into one of its own, which the proof on the decoded curve looks after.
    """
    n, k = len(shape), exponent(shape)
    rng = np.random.default_rng(0)
    promise = Promise(check_field(smooth(shape, 2) + 0.1 * rng.normal(size=shape), 0.0))
    # half a part of an edge of the full grid is what points may be off where nothing went
    tolerance = 0.3 if parts > 2 else 0.6
    reduction = promise.reduction()
    reduction.reduce(distortion=tolerance, original=promise.target(2 * tolerance), parts=parts, coarsest=n * k - 1)
    gone = len(parents(shape)) - len(mesh_of(reduction))
    _, contour = promise.trial([("adaptive_base", 0, reduction.chosen), ("offsets", parts, 0)])
    points = crossing_points(promise.field.values, 0.0)
    assert gone > len(points) / 20
    ends = contour.points[contour.cells]
    assert max(distance(p, ends) for p in points) <= tolerance + 1e-4


def distance(p: NDArray[np.float64], ends: NDArray[np.float64]) -> float:
    """From a point to the nearest of some segments or triangles."""
    sides = [(0, 1)] if ends.shape[1] == 2 else [(0, 1), (1, 2), (2, 0)]
    best = np.inf
    for i, j in sides:
        a, u = ends[:, i], ends[:, j] - ends[:, i]
        s = np.clip(((p - a) * u).sum(axis=1) / np.maximum((u * u).sum(axis=1), 1e-30), 0, 1)
        best = min(best, np.linalg.norm(p - a - s[:, None] * u, axis=1).min())
    if ends.shape[1] == 3:
        a, u, v = ends[:, 0], ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0]
        normal = np.cross(u, v)
        area = (normal * normal).sum(axis=1)
        s = (np.cross(p - a, v) * normal).sum(axis=1) / np.maximum(area, 1e-30)
        t = (np.cross(u, p - a) * normal).sum(axis=1) / np.maximum(area, 1e-30)
        over = (s >= 0) & (t >= 0) & (s + t <= 1) & (area > 1e-20)
        height = np.abs(((p - a) * normal).sum(axis=1)) / np.sqrt(np.maximum(area, 1e-30))
        best = min(best, height[over].min(initial=np.inf))
    return best
