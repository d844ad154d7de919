"""Surfaces: who stands where, what is up, what hides what, and how it is lit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import isocodec
from commands import BALL
from explicit_meshes import torus
from isocodec.errors import OptionError
from isocodec.plotting.panels import StepPanel, panels_figure
from isocodec.plotting.scene import USUAL, rotation, world
from tables import looped

# A cone in 33^3 samples: round about axis 1, its tip at the high end.
AXES = np.mgrid[:33, :33, :33] - 16.0
CONE = np.minimum(12 - AXES[1] - 2 * np.hypot(AXES[0], AXES[2]), AXES[1] + 12)
UPRIGHT = [(0, 0, -1, 0), (1, 0, 0, 0), (0, 1, 0, 0)]
"""z of the world along axis 1."""
UPSIDE_DOWN = [(0, 0, 1, 0), (1, 0, 0, 0), (0, -1, 0, 0)]
VIEWS = ("front", "back", "left", "right", "top", "bottom", USUAL, "200,-35")


def axes_of(contours: list[Any], view: str = USUAL, meshes: Any = ()) -> Any:
    return panels_figure([StepPanel(contours, "", meshes)], view, [], 6, 2.6).axes[0]


def covered(axes: Any) -> np.ndarray:
    """Pixels of a picture that a surface covers: bluish ones."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(axes.figure)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba()).astype(int)
    return image[..., 2] - image[..., 0] > 12


@pytest.mark.parametrize(("placement", "on_top", "view"), [
    (UPRIGHT, "tip", USUAL), (UPSIDE_DOWN, "foot", "front"), (UPRIGHT, "tip", "200,10")])
def test_up_is_z_of_the_placement(placement: Any, on_top: str, view: str) -> None:
    contour = isocodec.decode(isocodec.encode(isocodec.Field(CONE, placement=placement), 0.0))
    widths = covered(axes_of([contour], view)).sum(axis=1)
    rows = np.flatnonzero(widths)
    quarter = (rows[-1] - rows[0]) // 4
    upper, lower = widths[rows[0] : rows[0] + quarter].mean(), widths[rows[-1] - quarter : rows[-1]].mean()
    assert (upper < 0.5 * lower) if on_top == "tip" else (lower < 0.5 * upper)


def test_without_a_placement_axis_0_runs_down_and_rows_from_the_front() -> None:
    turn = world(isocodec.decode(isocodec.encode(BALL, 50.5)))
    assert rotation(USUAL)[2] @ turn == pytest.approx(np.array([-0.42, -0.75, -0.55]) / 1.0203, abs=2e-3)
    assert rotation("front")[2] @ turn == pytest.approx([0, -1, 0])
    assert rotation("top")[2] @ turn == pytest.approx([-1, 0, 0])


def test_directions_are_those_of_a_compass() -> None:
    """Worked out by hand: from the front, +y, the side of +x lies on the viewer's left, as of a patient's right."""
    right, up, towards = rotation("front")
    assert (*right, *up, *towards) == pytest.approx((-1, 0, 0, 0, 0, 1, 0, 1, 0))
    right, _, towards = rotation("right")
    assert (*right, *towards) == pytest.approx((0, 1, 0, 1, 0, 0))
    _, up, towards = rotation("top")
    assert (*up, *towards) == pytest.approx((0, -1, 0, 0, 0, 1))
    for view in VIEWS:
        frame = rotation(view)
        assert frame @ frame.T == pytest.approx(np.eye(3)) and np.linalg.det(frame) == pytest.approx(1)


@looped("wrong", ["", "1", "1,2,3", "above", "a,b", "nan,0", "0,91", "0,nan", "inf,0"])
def test_what_is_not_a_view(wrong: str) -> None:
    with pytest.raises(OptionError, match="is not a view: give AZIMUTH,ELEVATION in degrees, or one of front, back"):
        rotation(wrong)


@pytest.mark.parametrize(("edges", "field"), [(False, BALL), (True, 100 - BALL), (False, 100 - BALL)])
def test_near_triangles_come_last_and_the_light_from_above_left(field: Any, edges: bool) -> None:
    contour = isocodec.decode(isocodec.encode(field, 55.5 if field is BALL else 44.5, precision="exact"))
    axes = axes_of([contour], "front", [()] if edges else ())
    (drawn,) = axes.collections
    light = np.asarray(drawn.get_array())
    at = contour.points @ (rotation("front") @ world(contour)).T
    at = at - at.mean(axis=0)
    if not edges:
        cells = drawn._triangulation.triangles
        depth = at[cells, 2].sum(axis=1)
        assert (np.diff(depth) >= -1e-9).all() and len(cells) == len(contour.cells)
        near = at[:, 2] > 1
        normal = at[near] / np.linalg.norm(at[near], axis=1, keepdims=True)
        expected = 0.3 + 0.7 * np.maximum(normal @ [-0.4, 0.5, 1] / np.sqrt(1.41), 0)
        assert np.abs(light[near] - expected).mean() < 0.05
    assert light.min() >= 0.3 and light.max() <= 1 and drawn.get_rasterized()
    assert (drawn.get_edgecolor().size > 0) == edges


def test_surfaces_around_others_are_seen_through() -> None:
    """The smallest is opaque and drawn first, whatever its place in the file."""
    contours = isocodec.open(isocodec.encode(BALL, [60.5, 30.5, 1000.5])).contours()
    axes = panels_figure([StepPanel(contours)], USUAL, [60.5, 30.5, 1000.5], 6, 2.6).axes[0]
    inner, outer = axes.collections
    assert len(inner._triangulation.triangles) == len(contours[1].cells)
    assert inner.get_agg_filter() is None
    image = outer.get_agg_filter()(np.ones((2, 2, 4)), 72)[0]
    assert (image[..., :3] == 1).all() and 0.2 < image[0, 0, 3] < 0.5


def test_the_box_is_that_of_the_samples_also_of_meshes_and_of_nothing() -> None:
    from scipy.spatial import Delaunay

    axes = axes_of([isocodec.decode(isocodec.encode(BALL, 50.5))], "front")
    ends = np.array([line.get_data() for line in axes.lines])
    assert len(ends) == 12 and np.ptp(ends[:, 0]) == 16 and np.ptp(ends[:, 1]) == 16
    assert not axes.axison and axes.get_aspect() == 1
    points = np.random.default_rng(1).random((40, 3))
    mesh = isocodec.Mesh(points, Delaunay(points).simplices, points.sum(axis=1), stored="whole")
    assert len(axes_of([isocodec.decode(isocodec.encode(mesh, 1.3))]).collections) == 1
    assert not axes_of([isocodec.decode(isocodec.encode(BALL, 1e6))]).collections


def test_curves_on_surfaces_in_space_fade_towards_the_back() -> None:
    """From the front x runs to the left and z up: lines where the contour lies, the nearest ones strongest, on the
    triangles of a mesh if there is one."""
    points, cells = torus(24, 12)
    mesh = isocodec.Mesh(points, cells, points[:, 2], stored="whole", error=1e-6, crs="EPSG:4978")
    file = isocodec.open(isocodec.encode(mesh, 0.3))
    contour, crossed = file.contour(), file.mesh()
    axes = axes_of([contour], "front")
    (lines,) = axes.collections
    wanted = contour.points[contour.cells]
    order = np.argsort(wanted[:, :, 1].sum(axis=1))
    segments = np.array(lines.get_segments())
    assert len(segments) == len(contour.cells)
    assert np.allclose(segments.sum(axis=1)[:, 1], wanted[order].sum(axis=1)[:, 2])
    assert np.allclose(np.sort(segments[..., 0], axis=None), np.sort(-wanted[..., 0], axis=None))
    strength = 1 - lines.get_colors()[:, :3].mean(axis=1)
    assert (np.diff(strength) >= 0).all() and strength[0] < 0.6 * strength[-1]
    ground, _ = axes_of([contour], "front", [(crossed.points, crossed.cells)]).collections
    assert len(ground.get_paths()) == len(crossed.cells)
    assert panels_figure([StepPanel([contour, contour])], USUAL, [0.3, 0.6], 6, 2.6).legends
