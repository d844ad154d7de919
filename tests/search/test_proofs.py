"""Certified distances, against hand cases and dense sampling."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brute import examples, smooth
from isocodec.field.samples import check_field
from isocodec.search.original import original
from isocodec.search.proof import SMALLEST, Target, hausdorff, in_parts, one_sided, processors
from libraries import Late

KDTree = Late("scipy.spatial.KDTree")


def line(*points):
    """A polyline as points and cells."""
    points = np.array(points, float)
    return points, np.stack([np.arange(len(points) - 1), np.arange(1, len(points))], axis=1)


def test_parallel_segments():
    a, b = line((0, 0), (10, 0)), line((0, 1), (10, 1))
    assert hausdorff(*a, *b) == pytest.approx((1, 1), abs=0.01)
    assert not len(Target(*b, 1.001).exceeded(*a).cells)
    assert Target(*b, 0.999).exceeded(*a).cells.tolist() == [0]


def test_a_gap_shows_between_vertices():
    """Every vertex of the long segment is near, its middle is not."""
    points = np.array([(0, 1), (4, 1), (6, 1), (10, 1)], float)
    broken = points, np.array([[0, 1], [2, 3]])
    whole = line((0, 0), (10, 0))
    assert one_sided(*whole, *broken) == pytest.approx(np.sqrt(2), abs=0.01)
    assert one_sided(*broken, *whole) == pytest.approx(1, abs=0.01)


def test_the_middle_of_a_triangle():
    """All sides of a triangle are covered, its inside is not."""
    corners = np.array([(0, 0, 0), (9, 0, 0), (0, 9, 0)], float)
    inner = corners * 0.6 + corners.mean(axis=0) * 0.4
    ring = np.concatenate([corners, inner])
    cells = np.array([[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4], [2, 0, 5], [0, 3, 5]])
    one, two = (
        one_sided(corners, np.array([[0, 1, 2]]), ring, cells),
        one_sided(ring, cells, corners, np.array([[0, 1, 2]])),
    )
    inradius = 0.6 * 9 * (1 - np.sqrt(0.5))
    assert one == pytest.approx(inradius, abs=0.01)
    assert two <= 0.01


def test_empty_ones():
    some, none = line((0, 0), (1, 1)), (np.zeros((0, 2)), np.zeros((0, 2), np.int64))
    assert hausdorff(*some, *none) == (np.inf, 0.0)
    assert hausdorff(*none, *none) == (0.0, 0.0)
    assert Target(*none, 1.0).exceeded(*some).cells.tolist() == [0]


@pytest.mark.parametrize("n", [2, 3])
def test_a_few_pieces_far_apart_take_few_buckets(n):
    """Time and memory follow the curve, not the box that it lies in."""
    starts = np.array([(0.0,) * n, (30_000.0,) * n, (10.0,) * (n - 1) + (40_000.0,)])
    points = np.concatenate([starts, starts + np.eye(n)[0], starts + np.eye(n)[1]])
    cells = np.array([[i, i + 3, i + 6][:n] for i in range(3)])
    target = Target(points, cells, 1.0)
    assert len(target.buckets.first) < 10_000
    near, far = points[cells].mean(axis=1) + 0.4 * np.eye(n)[1], points[cells].mean(axis=1) + 90 * np.eye(n)[0]
    assert target.nearest(near)[0].tolist() == [0, 1, 2]
    assert target.nearest(far)[0].tolist() == [-1] * 3
    assert not len(target.exceeded(points, cells).cells)
    assert target.exceeded(points + 1.2 * np.eye(n)[-1], cells).cells.tolist() == [0, 1, 2]


def distance_to(points, corners):
    """Distances of points to the nearest of some segments or triangles, by dense sampling of these: an upper bound."""
    n = corners.shape[1]
    steps = 40
    if n == 2:
        t = np.linspace(0, 1, steps * 4)[:, None]
        samples = (corners[:, None, 0] * (1 - t) + corners[:, None, 1] * t).reshape(-1, corners.shape[2])
    else:
        u, v = np.meshgrid(np.linspace(0, 1, steps), np.linspace(0, 1, steps))
        keep = u + v <= 1 + 1e-9
        u, v = u[keep][:, None], v[keep][:, None]
        samples = corners[:, None, 0] * (1 - u - v) + corners[:, None, 1] * u + corners[:, None, 2] * v
        samples = samples.reshape(-1, 3)
    return np.sqrt(((points[:, None] - samples[None]) ** 2).sum(axis=2).min(axis=1)), samples


@examples(60)
@given(
    st.integers(2, 3), st.integers(0, 1 << 32), st.integers(1, 6), st.integers(1, 6), st.sampled_from([0.3, 3.0, 30.0])
)
def test_bounds_against_samples(n, seed, a_cells, b_cells, scale):
    rng = np.random.default_rng(seed)

    def some(cells):
        points = rng.uniform(0, scale, (cells + n, n))
        return points, rng.integers(0, len(points), (cells, n))

    a, b = some(a_cells), some(b_cells)
    _, samples = distance_to(np.zeros((1, n)), a[0][a[1]])
    rough, _ = distance_to(samples, b[0][b[1]])
    bound = one_sided(*a, *b, 0.02)
    # the samples lie at most this far from any place on their triangle
    spacing = scale * np.sqrt(n) / 39
    assert bound >= rough.max() - spacing - 1e-9
    assert bound <= rough.max() + spacing + 0.02 + 2 * SMALLEST


def test_parts_of_work_are_all_of_it():
    done = np.zeros(50_001, np.int64)

    def work(some):
        done[some] += 1

    in_parts(len(done), work)
    assert (done == 1).all() and processors() >= 1


@pytest.mark.parametrize("n", [2, 3])
def test_nearest_pieces(n):
    """Against points spread densely over the pieces."""
    rng = np.random.default_rng(n)
    contour = original(check_field(smooth((12,) * n, 5), 0.05))
    samples = rng.uniform(0, 11, (400, n))
    target = Target(contour.points, contour.cells, 0.4)
    piece, weight = target.nearest(samples)
    shares = rng.dirichlet(np.ones(n), 400)
    spread = np.einsum("sk,mkc->msc", shares, contour.points[contour.cells]).reshape(-1, n)
    far, _ = KDTree(spread).query(samples)
    near = np.linalg.norm(samples - np.einsum("pk,pkc->pc", weight, contour.points[contour.cells[piece]]), axis=1)
    found = piece >= 0
    assert found.any() and not found.all()
    assert (near[found] <= np.minimum(far[found] + 1e-9, 0.4)).all() and (far[~found] > 0.4 - 1e-9).all()
    assert np.abs(weight[found].sum(axis=1) - 1).max() < 1e-9 and weight[found].min() >= -1e-9
    assert (near[found] > far[found] - 0.15).all()
