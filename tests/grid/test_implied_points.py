"""Points that follow from others, against plain geometry: no phases, tags or tables."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import isocodec
from brute import examples, smooth
from isocodec.drawing.crossing import edge_ratios, enter_points
from isocodec.drawing.simplices import draw_simplices
from isocodec.drawing.snapshot import leaves_of
from isocodec.field.samples import check_field
from isocodec.grid.lattice.implied import Implied, implied_ratio
from isocodec.search.promise import Promise
from isocodec.search.strategy import reduced
from isoconform.meshes import chosen, uniform
from libraries import Late
from tables import looped

KDTree = Late("scipy.spatial.KDTree")


def leaves_and_told(shape, seed, mesh):
    """Leaves of a file with offsets, and the edges it told."""
    promise = Promise(check_field(smooth(shape, seed) - 0.01, 0.0))
    n, full = promise.n, promise.full_level
    if mesh < 0:
        (base,) = reduced(promise, "distortion", 0.6, False)
    else:
        base = ("adaptive_base", 0, chosen(shape, uniform(shape, max(full - mesh, 0))))
    tube = promise._encoded([base, ("offsets", 9, 0)])[1]
    leaves = leaves_of(tube, 0.0, lambda number, above: number)
    position = tube.state.vertex[:, :n].astype(np.int64)
    told = {(tuple(position[a]), tuple(position[b])) for a, b in tube.estimates.edges}
    return leaves, told


def pairs_of_rings(leaves):
    """For each implied edge, by both ends: the pairs of opposite corners."""
    n = len(leaves.shape)
    place = [tuple(map(int, p)) for p in leaves.position]
    sign = dict(zip(place, leaves.above, strict=True))
    longest, sides = {}, set()
    for row in leaves.simplices:
        corners = sorted(place[v] for v in row)
        sides |= set(combinations(corners, 3))
        edges = list(combinations(corners, 2))
        length = [sum((np.array(a) - b) ** 2) for a, b in edges]
        edge = edges[int(np.argmax(length))]
        longest.setdefault(edge, []).append([c for c in corners if c not in edge])
    found = {}
    for a, b in {e for s in sides for e in combinations(s, 2)} if n == 3 else longest:
        if sign[a] == sign[b]:
            continue
        d = np.abs(np.subtract(b, a))
        axes = np.flatnonzero(d)
        others = longest.get((a, b), [])
        if n == 3 and len(axes) == 2:
            one, two = list(a), list(a)
            one[axes[0]], two[axes[1]] = b[axes[0]], b[axes[1]]
            corners = [tuple(one), tuple(two)]
            if d[axes[0]] == d[axes[1]] and all(tuple(sorted((a, b, c))) in sides for c in corners):
                found[a, b] = [corners]
        elif len(others) == (2 if n == 2 else {3: 6, 1: 8}.get(len(axes))):
            ring = {c for other in others for c in other}
            opposite = {c: tuple(int(x) for x in np.add(a, b) - c) for c in ring}
            assert all(c in ring for c in opposite.values())
            found[a, b] = [pair for pair in opposite.items() if pair[0] < pair[1]]
    return found


def straight(a, b, pair, points, sign):
    """Where the line between the points on the two sides of a pair meets the edge, as a fraction."""
    ends = []
    for corner in pair:
        end = a if sign[corner] != sign[a] else b
        ends.append(points[tuple(sorted((end, corner)))])
    # a + t * (b - a) = p + u * (q - p), in the plane of all
    p, q = ends
    matrix = np.stack([np.subtract(b, a), p - q], axis=1).astype(float)
    return np.linalg.lstsq(matrix, p - np.array(a, float), rcond=None)[0][0]


@pytest.mark.parametrize("n", [2, 3])
def test_which_edges_are_implied_and_where(n):
    @settings(examples(12), deadline=None)
    @given(st.integers(0, 10_000), st.integers(-1, 2 * n))
    def run(seed, mesh):
        shape = (17, 17) if n == 2 else (9, 9, 9)
        leaves, told = leaves_and_told(shape, seed, mesh)
        if not len(leaves.simplices):
            return
        found = pairs_of_rings(leaves)
        simplices = draw_simplices(leaves)
        edges = simplices.edges.astype(np.int64)
        place = [tuple(map(int, p)) for p in leaves.position]
        names = [(place[u], place[v]) for u, v in edges]
        assert told == set(names) - set(found)
        sign = dict(zip(place, leaves.above, strict=True))
        points = np.empty((len(edges), n))
        enter_points(leaves.vertex, simplices.edges.astype(np.int32), simplices.ratio, points)
        drawn = dict(zip(names, points, strict=True))
        stated = dict(zip(names, edge_ratios(leaves, edges)[0], strict=True))
        for (a, b), pairs in found.items():
            t = np.mean([straight(a, b, pair, drawn, sign) for pair in pairs])
            assert drawn[a, b] == pytest.approx(np.array(a) + t * np.subtract(b, a), abs=1e-9)
        for a, b in told:
            assert drawn[a, b] == pytest.approx(np.array(a) + stated[a, b] * np.subtract(b, a))

    run()


@pytest.mark.parametrize("above", [[True, False, True, False], [True, False, False, False], [True, False, False, True]])
@pytest.mark.filterwarnings("error")
def test_a_crossing_that_does_not_follow_is_in_the_middle(above):
    """Clause 9.5(5): with both crossings of the ring at an end of their edges the quotient is 0 / 0."""
    implied = Implied(np.array([[0, 1]]), np.array([[2, 3]]))
    assert implied_ratio(implied, np.array(above), np.zeros((1, 2))) == [0.5]


@looped("layers", ["crossing", "topology", "curvature=0.3", "distortion=1"])
@looped("shape", [(40, 50), (17, 20, 18)])
def test_known_values_win(shape: tuple[int, ...], layers: str) -> None:
    """On meshes by any criterion, each point lies where the values at both ends of its edge place it."""
    field = np.rint(100 * smooth(shape, 5)).astype(np.int64)
    file = isocodec.open(isocodec.encode(field, 20.5, layers=layers, precision="exact"))
    mesh = file.mesh()
    ends = np.concatenate([mesh.cells[:, pair] for pair in combinations(range(len(shape) + 1), 2)])
    p, q = mesh.points[ends].swapaxes(0, 1)
    f_p, f_q = (field[tuple(each.astype(int).T)] for each in (p, q))
    crossed = (f_p > 20.5) != (f_q > 20.5)
    assert crossed.any()
    p, q, t = p[crossed], q[crossed], ((20.5 - f_p[crossed]) / (f_q - f_p)[crossed])[:, None]
    assert KDTree(p + t * (q - p)).query(file.contour().points)[0].max() < 1e-5
