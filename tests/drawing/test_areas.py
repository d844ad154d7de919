"""Areas: polygons that hold the samples of one side, and with those of the other side make up the box."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples
from isocodec import Contour
from isocodec.errors import OptionError, TruncatedError
from libraries import Late
from places import matrix

shapely = Late("shapely")
shape_of = Late("shapely.geometry.shape")

SHAPES = st.tuples(*[st.integers(2, 14)] * 2)


def both(contour):
    above, below = (shape_of(contour.areas(above=side)) for side in (True, False))
    box = (contour.shape[0] - 1) * (contour.shape[1] - 1)
    assert above.is_valid and below.is_valid
    assert above.area + below.area == pytest.approx(box)
    assert above.intersection(below).area == pytest.approx(0, abs=1e-6)
    return above, below


def covered(area, shape):
    rows, columns = np.indices(shape)
    shapely.prepare(area)
    return shapely.intersects(area, shapely.points(columns, rows))


@given(SHAPES, st.integers(0, 2**32 - 1), st.sampled_from([{}, {"precision": "signs"}, {"profile": "baseline"}]))
@examples(60)
def test_samples_lie_in_the_area_of_their_side(shape, seed, way):
    rng = np.random.default_rng(seed)
    field = rng.normal(size=shape) + rng.normal()
    data = isocodec.encode(field, 0.1, **way)
    above, below = both(isocodec.decode(data))
    mask = isocodec.open(data).above()
    assert np.array_equal(covered(above, shape), mask)
    assert np.array_equal(covered(below, shape), ~mask)


@given(SHAPES, st.integers(0, 2**32 - 1), st.sampled_from([0.3, 1, 3]))
@examples(30)
def test_coarse_curves_have_areas_too(shape, seed, tolerance):
    rng = np.random.default_rng(seed)
    both(isocodec.decode(isocodec.encode(rng.normal(size=shape), 0.2, precision=tolerance)))


@given(SHAPES, st.integers(0, 2**32 - 1))
@examples(120)
def test_where_points_fall_together(shape, seed):
    """Values equal to the isovalue lie on the rings, which touch themselves, one another and the border."""
    field = np.random.default_rng(seed).integers(0, 4, shape)
    above, below = both(isocodec.decode(isocodec.encode(field, 1, precision="exact")))
    for area, inside, outside in ((above, field > 1, field < 1), (below, field < 1, field > 1)):
        held = covered(area, shape)
        assert held[inside].all() and not held[outside].any()


def test_islands_in_lakes():
    field = np.zeros((40, 50))
    for side, value in ((3, 1), (6, 0), (10, 1), (14, 0)):
        field[side:-side, side:-side] = value
    field[20, 0] = 1
    above, below = both(isocodec.decode(isocodec.encode(field, 0.5, precision="signs")))
    assert sorted(len(part.interiors) for part in above.geoms) == [0, 1, 1]
    assert sorted(len(part.interiors) for part in below.geoms) == [0, 1, 1]


@pytest.mark.parametrize("value", [0, 2])
def test_without_a_curve_the_box_lies_on_one_side(value):
    contour = isocodec.decode(isocodec.encode(np.full((3, 6), value), 1))
    above, below = both(contour)
    assert (above.area, below.area) == ((10, 0) if value else (0, 10))


@pytest.mark.parametrize("placement", [None, (2.0, -3.0), [[0, 5, 100], [4, 0, 7]], [[3, 1, 0], [-1, 3, 0]]])
def test_rings_in_the_world_run_as_in_geojson(placement):
    """Exterior counter-clockwise, holes clockwise, whether or not the placement mirrors the plane."""
    field = np.hypot(*(np.mgrid[:30, :40] - np.array([14, 20]).reshape(2, 1, 1)))
    contour = isocodec.decode(isocodec.encode(isocodec.Field(field, placement=placement), 9.0))
    cell = 1.0 if placement is None else abs(np.linalg.det(matrix(contour)[:, :2]))
    (outside,) = shape_of(contour.areas()).geoms
    (hole,) = outside.interiors
    assert outside.exterior.is_ccw and not hole.is_ccw
    assert outside.area == pytest.approx(cell * (29 * 39 - np.pi * 81), rel=2e-3)
    corners = contour.place(np.array([(0.0, 0.0), (29.0, 39.0)]))
    assert all(outside.exterior.distance(shapely.Point(corner)) < 1e-9 for corner in corners)


def test_surfaces_and_parts_of_layers_have_none():
    with pytest.raises(OptionError, match="n = 2"):
        isocodec.decode(isocodec.encode(np.random.default_rng(1).normal(size=(4, 4, 4)), 0.0)).areas()
    contour = isocodec.decode(isocodec.encode(np.mgrid[:9, :9][0] * 1.0, 4.2))
    torn = replace(contour, cells=contour.cells[:-1])
    with pytest.raises(TruncatedError, match="inside the field"):
        torn.areas()
    with pytest.raises(TruncatedError):
        Contour(np.zeros((0, 2)), np.zeros((0, 2), np.int64), 1.0, (3, 3), False).areas()


@pytest.mark.parametrize("tile", [None, 64], ids=["one piece", "tiles"])
@pytest.mark.parametrize("window", [[(2, 24), (2, 24)], [(0, 64), (0, 64)], [(90, 124), (90, 124)]], ids=str)
def test_areas_of_a_window_are_refused(tile, window, tmp_path):
    """Also where all lines in it are rings, beyond which others are missing; a cropped file has them."""
    distances = [np.hypot(*(np.mgrid[:129, :129] - np.array(at).reshape(2, 1, 1))) for at in ((12, 12), (108, 108))]
    isocodec.save(tmp_path / "a.iso", 9 - np.minimum(*distances), 0.0, precision="step=0.01", tile=tile)
    file = isocodec.open(tmp_path / "a.iso")
    part = file.contour(window=window)
    assert len(part.lines) == 1
    for closing in (part.areas, lambda: isocodec.bands([part])):
        with pytest.raises(TruncatedError, match="crop the file"):
            closing()
    for whole in (file.contour(window=[(0, 129), (0, 129)]), file.contour()):
        assert shape_of(whole.areas()).area == pytest.approx(2 * np.pi * 81, rel=1e-2)
    cropped = isocodec.open(file.edited(window=window)).contour()
    assert shape_of(cropped.areas()).area == pytest.approx(np.pi * 81, rel=1e-2)
