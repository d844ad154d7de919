"""Views of surfaces: who stands where, and what is up."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import isocodec
from commands import BALL, HILLS, fails, ok
from isocodec.drawing.contour import Contour
from isocodec.drawing.pictures.picture import contour_picture
from isocodec.drawing.pictures.view import NAMED, USUAL, View, read_view, upright
from isocodec.errors import OptionError

# A cone in 33^3 samples: round about axis 1, its tip at the high end.
AXES = np.mgrid[:33, :33, :33] - 16.0
CONE = np.minimum(12 - AXES[1] - 2 * np.hypot(AXES[0], AXES[2]), AXES[1] + 12)
UPRIGHT = [(0, 0, -1, 0), (1, 0, 0, 0), (0, 1, 0, 0)]
"""z of the world along axis 1."""
UPSIDE_DOWN = [(0, 0, 1, 0), (1, 0, 0, 0), (0, -1, 0, 0)]


def colours(contour: Contour, view: View = USUAL) -> np.ndarray:
    """Which pixels of a picture the surface covers: its blue."""
    picture = np.asarray(Image.open(io.BytesIO(contour_picture([contour], view=view))).convert("RGB")).astype(int)
    return picture[..., 2] - picture[..., 0] > 12


@pytest.mark.parametrize("placement, on_top", [(UPRIGHT, "tip"), (UPSIDE_DOWN, "foot")])
@pytest.mark.parametrize("view", [USUAL, NAMED["front"], NAMED["left"], View(200, 10)])
def test_up_is_z_of_the_placement(placement: list[tuple[int, ...]], on_top: str, view: View) -> None:
    covered = colours(isocodec.decode(isocodec.encode(isocodec.Field(CONE, placement=placement), 0.0)), view)
    widths = covered.sum(axis=1)
    rows = np.flatnonzero(widths)
    quarter = (rows[-1] - rows[0]) // 4
    upper, lower = widths[rows[0] : rows[0] + quarter].mean(), widths[rows[-1] - quarter : rows[-1]].mean()
    assert (upper < 0.5 * lower) if on_top == "tip" else (lower < 0.5 * upper)


def test_from_above_and_below_a_cone_is_round() -> None:
    contour = isocodec.decode(isocodec.encode(isocodec.Field(CONE, placement=UPRIGHT), 0.0))
    for name in ("top", "bottom"):
        covered = colours(contour, NAMED[name])
        height, width = (np.ptp(np.flatnonzero(covered.any(axis=axis))) for axis in (1, 0))
        assert height == pytest.approx(width, rel=0.03)
        assert covered.sum() == pytest.approx(np.pi / 4 * width**2, rel=0.05)


def test_without_a_placement_axis_0_runs_down_and_rows_from_the_front() -> None:
    contour = isocodec.decode(isocodec.encode(BALL, 50.5))
    # the viewer of old: direction in index coordinates
    assert USUAL.towards @ upright(contour) == pytest.approx(np.array([-0.42, -0.75, -0.55]) / 1.0203, abs=2e-3)
    assert NAMED["front"].towards @ upright(contour) == pytest.approx([0, -1, 0])
    assert NAMED["top"].towards @ upright(contour) == pytest.approx([-1, 0, 0])


def test_directions_are_those_of_a_compass() -> None:
    """Worked out by hand: from the front, +y, the side of +x lies on the viewer's left, as of a patient's right."""
    front, right, top = NAMED["front"], NAMED["right"], NAMED["top"]
    assert front.towards == pytest.approx([0, 1, 0]) and front.right == pytest.approx([-1, 0, 0])
    assert front.up == pytest.approx([0, 0, 1])
    assert right.towards == pytest.approx([1, 0, 0]) and right.right == pytest.approx([0, 1, 0])
    assert top.towards == pytest.approx([0, 0, 1]) and top.up == pytest.approx([0, -1, 0])
    for view in (*NAMED.values(), USUAL, View(200, -35)):
        frame = np.stack([view.right, view.up, view.towards])
        assert frame @ frame.T == pytest.approx(np.eye(3)) and np.linalg.det(frame) == pytest.approx(1)


def test_views_are_read() -> None:
    assert read_view("12.5,-30") == View(12.5, -30)
    assert read_view("back") == View(180, 0)
    for wrong in ("", "1", "1,2,3", "above", "a,b"):
        with pytest.raises(OptionError, match="is not a view: give AZIMUTH,ELEVATION, or one of front, back"):
            read_view(wrong)
    for wrong in ("361,0", "nan,0", "-181,0"):
        with pytest.raises(OptionError, match="must lie between -180 and 360"):
            read_view(wrong)
    for wrong in ("0,91", "0,nan"):
        with pytest.raises(OptionError, match="must lie between -90 and 90"):
            read_view(wrong)


def test_plot_takes_a_view(tmp_path: Path) -> None:
    ball, hills, out = tmp_path / "ball.iso", tmp_path / "hills.iso", tmp_path / "out.png"
    ball.write_bytes(isocodec.encode(CONE, 0.0))
    hills.write_bytes(isocodec.encode(HILLS, 60.5))
    seen = []
    for view in ("front", "top", "0,0"):
        ok("plot", ball, "-o", out, "--steps", 1, "--draw-mesh", "--view", view)
        seen.append(np.asarray(Image.open(out)))
        out.unlink()
    assert np.array_equal(seen[0], seen[2]) and not np.array_equal(seen[0], seen[1])
    assert "elevation 99; it must lie between -90 and 90" in fails(2, "plot", ball, "-o", out, "--view", "0,99")
    assert "'up' is not a view: give AZIMUTH,ELEVATION" in fails(2, "plot", ball, "-o", out, "--view", "up")
    assert "--view applies to surfaces only" in fails(2, "plot", hills, "-o", out, "--view", "top")
    assert not out.exists()


@pytest.mark.parametrize("mirrored", [1, -1])
def test_the_mesh_faces_the_viewer_in_a_mirrored_world_too(mirrored: int) -> None:
    from isocodec.drawing.pictures import picture
    from isocodec.drawing.pictures.picture import matplotlib_figure

    placement = [(0, 0, mirrored, 0), (1, 0, 0, 0), (0, 1, 0, 0)]
    contour = isocodec.decode(isocodec.encode(isocodec.Field(BALL, placement=placement), 50.5))
    axes = matplotlib_figure().Figure().add_subplot()
    picture._draw_mesh(axes, contour, np.zeros((0, 3), np.int64), np.zeros((0, 4), np.int64), NAMED["front"])
    (drawn,) = axes.collections
    shown = {np.round(segment[:3], 9).tobytes() for segment in np.asarray(drawn.get_segments()) + 0.0}
    corners = (contour.points[contour.cells] - 8.0) @ upright(contour).T
    near = corners.mean(axis=1)[:, 1]
    flat = np.round(corners @ NAMED["front"].screen, 9) + 0.0
    is_shown = np.array([triangle.tobytes() in shown for triangle in flat])
    clear = np.abs(near) > 1.5
    assert np.array_equal(is_shown[clear], near[clear] > 0)
