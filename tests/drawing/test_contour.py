"""Contours: of parts of a mesh, of nothing, of any signs; and what they offer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import isocodec
from brute import ball, border, noise
from drawings import check_manifold, check_winding, leaves_of
from isocodec.drawing.contour import Contour
from isocodec.drawing.drawing import draw
from isocodec.drawing.leaves import Leaves
from isocodec.drawing.window import reaching
from isocodec.field.placement import Placement
from tables import looped

# --- parts, nothing, anything ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(12, 12), (7, 7, 7)])
def test_cells_whose_leaves_are_not_all_there_are_left_out(shape):
    leaves = leaves_of(noise(shape, 4))
    whole = draw(leaves)
    kept = np.random.default_rng(1).random(len(leaves.simplices)) < 0.9
    part = draw(Leaves(**{**vars(leaves), "simplices": leaves.simplices[kept]}), complete=False)
    assert whole.complete and not part.complete

    def corners(contour):
        return {frozenset(map(tuple, cell)) for cell in np.round(contour.points[contour.cells], 9).tolist()}

    assert corners(part) < corners(whole)
    if len(shape) == 2:
        assert sum(len(line) - 1 for line in part.lines) == len(part.cells)


signs_2d = hnp.arrays(bool, hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=7))
signs_3d = hnp.arrays(bool, hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=5))


@settings(max_examples=150, deadline=None)
@given(st.one_of(signs_2d, signs_3d), st.booleans())
def test_any_signs(signs, pad):
    if pad:
        signs = np.pad(signs, 1)
    n = signs.ndim
    for bisections in (None, *range(n)):
        size, count = (1, 0) if bisections is None else (2, bisections)
        leaves = leaves_of(np.zeros(signs.shape), values=False, above=signs, size=size, bisections=count)
        contour = draw(leaves)
        assert contour.points.dtype == np.float64 and contour.cells.dtype == np.int64
        check_manifold(contour)
        if not signs[border(signs.shape)].any():
            check_winding(contour, leaves)


# --- the result ------------------------------------------------------------------------------------------------------


def test_geo_interface_has_columns_as_x():
    contour = draw(leaves_of(ball((8, 20), (3.5, 14.0), 2.2)))
    geometry = contour.__geo_interface__
    (line,) = geometry["coordinates"]
    assert geometry["type"] == "MultiLineString"
    assert [(y, x) for x, y in line] == [tuple(p) for p in contour.lines[0].tolist()]
    shapely = pytest.importorskip("shapely.geometry")
    assert shapely.shape(contour).bounds == pytest.approx((11.8, 1.3, 16.2, 5.7), abs=0.1)


@looped("matrix", [None, [[0, 2, 1], [2, 0, 3]], [[0, 2, 1], [-2, 0, 3]], [[1, 0.5, 0], [0, -3, 1]]])
def test_normals_point_to_lower_values_wherever_samples_lie(matrix):
    rows, columns = np.mgrid[:21, :23]
    placement = None if matrix is None else Placement(matrix)
    field = isocodec.Field(9 - np.hypot(rows - 10, columns - 11), placement=placement)
    contour = isocodec.decode(isocodec.encode(field, 2.2, precision=0.01))
    outwards = contour.placed - contour.placed.mean(axis=0)
    assert ((contour.normals * outwards).sum(axis=1) > 0).all()
    assert ((contour.flip().normals * outwards).sum(axis=1) < 0).all() and contour.flip().origin_above


def test_cells_that_only_touch_a_window_are_not_in_it():
    contour = Contour(np.array([[0, 0.5], [1, 0.5], [2, 0.5]]), np.array([[0, 1], [1, 2]]), 0.0, (4, 4))
    assert reaching(contour, [(1, 3), (0, 1)]).tolist() == [False, True]
    assert reaching(contour, [(0, 1), (0, 1)]).tolist() == [True, False]
    assert reaching(contour, [(0.5, 1.5), (0, 1)]).tolist() == [True, True]
