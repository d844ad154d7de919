"""Curvature of extracted curves and surfaces, against circles, lines, balls and cylinders."""

from __future__ import annotations

import numpy as np
import pytest

from isocodec.field.samples import check_field
from isocodec.search.curvature import curvature
from isocodec.search.original import original


def of(values):
    contour = original(check_field(values, 0.0))
    return curvature(contour), contour


@pytest.mark.parametrize("radius", [6.3, 15.0, 40.0])
def test_circles(radius):
    x, y = np.indices((101, 101)) - 49.7
    found, _ = of(radius - np.hypot(x, y))
    assert np.median(found) == pytest.approx(1 / radius, rel=0.1)
    assert np.abs(found - 1 / radius).max() < 0.5 / radius + 0.02


def test_lines_and_their_ends():
    x, y = np.indices((40, 30))
    found, _ = of(x - 2 * y + 3.3)
    assert found.max() < 1e-6


@pytest.mark.parametrize("radius", [8.3, 14.0])
def test_balls(radius):
    x = np.indices((33,) * 3) - 15.8
    found, _ = of(radius - np.sqrt((x * x).sum(axis=0)))
    assert np.median(found) == pytest.approx(1 / radius, rel=0.1)


def test_cylinders_bend_half_as_much_and_end_at_the_border():
    x, y, _ = np.indices((33, 33, 12)) - 15.8
    found, contour = of(9.2 - np.hypot(x, y))
    inside = (contour.points[:, 2] > 2) & (contour.points[:, 2] < 9)
    assert np.median(found[inside]) == pytest.approx(0.5 / 9.2, rel=0.15)
    assert np.median(found[~inside]) < 0.2
    flat, _ = of(np.indices((9, 10, 11)).sum(axis=0) - 9.4)
    assert flat.max() < 1e-6
