"""The bench in tools/: distances, files of peers, and whole runs on small fields."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from home import ROOT

pytest.importorskip("scipy")
pytest.importorskip("skimage")
pytest.importorskip("contourpy")

sys.path.insert(0, str(ROOT / "tools"))


from bench.errors import Shape, apart, middles
from bench.nearest import Boxes

pytestmark = pytest.mark.heavy



# ---- Distances ----


@pytest.mark.parametrize("n", [2, 3])
def test_distances_are_exact(n):
    generator = np.random.default_rng(1)
    corners = generator.uniform(-4, 4, (30, n, n)) + generator.uniform(-9, 9, (30, 1, n))
    points = generator.uniform(-20, 20, (40, n))
    found = Boxes(corners).distances(points)
    dense = np.einsum("pk,mkd->mpd", middles(60, n), corners).reshape(-1, n)
    brute = np.array([np.linalg.norm(dense - point, axis=1).min() for point in points])
    # edges are at most 14 cells long, so that samples lie at most 14 / 60 cells apart
    assert (found <= brute + 1e-9).all()
    assert np.allclose(found, brute, atol=0.15)


def test_known_distances():
    line = np.array([[0.0, 0.0], [0.0, 10.0]])
    a, b = Shape.of_lines([line]), Shape.of_lines([line + [0.5, 0.0]])
    assert apart(a, b) == pytest.approx((0.5, 0.5))
    longer = Shape.of_lines([np.array([[0.0, 0.0], [0.0, 13.0]])])
    # from the longer one 3 of 13 cells are off, by 1.5 on average
    assert apart(a, longer) == pytest.approx((4.5 / 13, 3.0), rel=0.01)
    assert apart(longer, a) == apart(a, longer)
    assert apart(a, Shape.of_lines([])) == (float("inf"), float("inf"))
    assert apart(Shape.of_lines([]), Shape.of_lines([])) == (0.0, 0.0)
