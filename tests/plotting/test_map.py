"""Contour maps: lines, labels, coordinates, scale bar and relief as objects of matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import BALL, HILLS, fails, ok, run
from isocodec.api.plots import plot_map
from isocodec.field.placement import Placement
from isocodec.plotting.map import index_lines, map_figure
from isocodec.verbs import Plot

ROWS, COLUMNS = np.mgrid[:50, :61].astype(float)
UTM = "0 30 500000 -20 0 5000000"
STEPS = [[0, 30, 500000], [-20, 0, 5000000]]


def drawn(
    field: Any, isovalues: Any, placement: Any = None, notes: dict[str, str] | None = None, relief: bool = False,
    title: str = "", size: float = 20, crs: str | None = None,
) -> Any:
    """The axes of a map."""
    file = isocodec.open(isocodec.encode(
        isocodec.Field(field, placement=placement, crs=crs), isovalues, precision=0.001, metadata=notes))
    contours = file.contours()
    valid = file.valid() if contours[0].masked else None
    figure = map_figure(contours, field if relief else None, valid, title, size)
    figure.draw_without_rendering()
    return figure.axes[0]


def lines(axes: Any, name: str) -> list[np.ndarray]:
    (found,) = [one for one in axes.collections if one.get_gid() == name]
    return [np.asarray(one) for one in found.get_segments()]


def labels(axes: Any) -> list[Any]:
    return [one for one in axes.texts if one.get_gid() == "label"]


def texts(axes: Any) -> str:
    return "\n".join(one.get_text() for one in axes.texts)


def ticks(axis: Any) -> list[str]:
    low, high = sorted(axis.get_view_interval())
    return [one.get_text() for one in axis.get_ticklabels() if low <= one.get_position()[axis.axis_name == "y"] <= high]


def bar(axes: Any) -> tuple[float, str]:
    """Share of the map's width, and the text at the end."""
    (found,) = axes.child_axes
    return found.bbox.width / axes.bbox.width, found.get_xticklabels()[-1].get_text()


# ---- Lines and labels -----------------------------------------------------------------------------------------------


def test_lines_lie_where_they_belong_with_turned_labels_on_index_lines() -> None:
    axes = drawn(COLUMNS, [float(v) for v in range(1, 60, 4)])
    for name, values in (("contours", [5, 9, 13, 17, 25]), ("index", [1, 21, 41])):
        found = np.concatenate(lines(axes, name))[:, 0]
        assert all(np.abs(found - v).min() < 0.005 for v in values)
        assert np.abs(found - np.round((found - 1) / 4) * 4 - 1).max() < 0.005
    thin, thick = (one.get_linewidth()[0] for one in axes.collections if one.get_gid() in ("contours", "index"))
    assert thick >= 2 * thin
    assert {one.get_text() for one in labels(axes)} == {"1", "21", "41"}
    assert all(abs(one.get_rotation() % 180 - 90) < 1 for one in labels(axes))
    assert not labels(drawn(-np.hypot(ROWS - 25, COLUMNS - 30), [-0.8])), "a ring of 5 mm"


def test_labels_lie_on_lines_upright_within_the_map_and_apart() -> None:
    isovalues = [float(v) for v in range(5, 200, 5)]
    axes = drawn(HILLS, isovalues)
    found, place = labels(axes), axes.transData.transform
    assert len(found) >= 6
    contours = isocodec.open(isocodec.encode(HILLS, isovalues, precision=0.001)).contours()
    dots = axes.figure.dpi / 72
    for one in found:
        own = next(c for c in contours if c.isovalue == float(one.get_text()))
        ends = np.concatenate([place(c[:-1] * (1 - t) + c[1:] * t) for w in own.walks for c in [own.placed[w]]
                               for t in np.linspace(0, 1, 9)])
        assert np.hypot(*(ends - place(one.get_position())).T).min() < 3 * dots
        assert -90 <= one.get_rotation() - 360 * (one.get_rotation() > 180) <= 90
        box = one.get_window_extent()
        assert axes.bbox.contains(box.x0, box.y0) and axes.bbox.contains(box.x1, box.y1)
    places = np.array([place(one.get_position()) for one in found])
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) + 1e9 * np.eye(len(places))
    assert apart.min() > 15 * dots


@pytest.mark.parametrize(
    ("isovalues", "every", "index"),
    [
        (range(20, 320, 20), 5, [100, 200, 300]), ([v + 0.5 for v in range(400, 900, 100)], 2, [400.5, 600.5, 800.5]),
        ([-0.2, -0.1, 0.0, 0.1, 0.2, 0.30000000000000004], 2, [-0.2, 0.0, 0.2]), ([1, 2.5, 7, 8], 2, [1, 7]),
        ([7.0], 5, [7.0]), ([2, 3], 5, [2, 3]), ([300, 100, 200], 2, [200]),
    ],
)
def test_index_lines(isovalues: Any, every: int, index: list[float]) -> None:
    """Multiples of so many intervals; where there are none among them, all."""
    thick = index_lines([*isovalues], every)
    assert [v for v, one in zip(isovalues, thick, strict=True) if one] == index


# ---- Around the map -------------------------------------------------------------------------------------------------


def test_coordinates_system_and_title() -> None:
    axes = drawn(COLUMNS, "every 10", None, {"placement": UTM, "crs": "EPSG:32631", "unit": "m"}, title="A & B $x^2$")
    assert axes.get_title(loc="left") == "A & B $x^2$"
    assert "WGS 84 / UTM zone 31N (EPSG:32631)" in texts(axes)
    assert "contour interval 10 m, index contours 50 m" in texts(axes)
    assert "500,500" in ticks(axes.xaxis) and "4,999,600" in ticks(axes.yaxis)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("easting (m)", "northing (m)")
    # 60 steps of 30 m, and 49 of 20 m, at one scale, north up
    assert axes.bbox.width / axes.bbox.height == pytest.approx(60 * 30 / (49 * 20), rel=1e-3)
    assert axes.get_ylim() == pytest.approx((5e6 - 980, 5e6))
    assert axes.bbox.width == pytest.approx(20 / 2.54 * axes.figure.dpi, rel=1e-6)


@pytest.mark.parametrize(("crs", "step", "x", "y"), [
    ("EPSG:4326", 0.001, 11.0, 47.0), ("EPSG:3857", 100, 1e6, 6e6), ("EPSG:2263", 100, 980000, 2e5)])
def test_the_scale_bar_is_as_long_as_it_says(crs: str, step: float, x: float, y: float) -> None:
    """On the ellipsoid, in the middle of the map: of degrees, of a projection that stretches, of feet."""
    import pyproj

    axes = drawn(COLUMNS, [10.0], [[0, step, x], [-step, 0, y]], crs=crs)
    share, text = bar(axes)
    metres = float(text.split()[0]) * (1000 if text.endswith("km") else 1)
    degrees = pyproj.Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    ends = [degrees.transform(x + step * k, y - step * 24.5) for k in (0, 60)]
    assert share == pytest.approx(metres / pyproj.Geod(ellps="WGS84").inv(*ends[0], *ends[1])[2], rel=0.002)
    assert text.split()[0].strip("0")[:1] in "125" and share <= 0.25
    if crs == "EPSG:4326":
        assert "11.02\u00b0E" in ticks(axes.xaxis) and "46.97\u00b0N" in ticks(axes.yaxis)
        shrunk = np.cos(np.radians(y - step * 24.5))
        assert axes.bbox.width / axes.bbox.height == pytest.approx(60 / 49 * shrunk, rel=0.01)


def test_degrees_of_the_globe() -> None:
    """Ticks stand at the quarters of a circle, and 180 degrees are neither west nor east."""
    field = np.cos(np.radians(np.arange(0, 360, 5)))[None] + np.zeros((35, 1))
    axes = drawn(field, 0.5, [[0, 5, 0], [-5, 0, 85]], crs="EPSG:4326")
    assert {"90°E", "180°", "90°W"} <= {*ticks(axes.xaxis)} and {"45°N", "0°", "45°S"} <= {*ticks(axes.yaxis)}


def test_without_a_placement_rows_run_down_and_without_samples_there_is_no_relief() -> None:
    axes = drawn(ROWS, 10.0)
    assert relief(axes) is None
    assert axes.yaxis_inverted() and np.concatenate(lines(axes, "index"))[:, 1] == pytest.approx(10, abs=0.01)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("column", "row")
    assert "coordinates in samples" in texts(axes) and "isovalue 10" in texts(axes) and "samples" in bar(axes)[1]


def test_a_system_that_there_is_not() -> None:
    axes = drawn(COLUMNS, [10.0], None, {"placement": UTM, "crs": "EPSG:999999"})
    assert "EPSG:999999" in texts(axes) and axes.get_xlabel() == "x" and "units of x" in bar(axes)[1]


@pytest.mark.parametrize(("shape", "size"), [((5, 400), 20), ((400, 5), 20), ((40, 40), 4), ((9, 8), 400)])
def test_extreme_shapes_and_sizes_fit(shape: tuple[int, int], size: float) -> None:
    """There is one scale, and nothing lies outside of the picture."""
    field = np.add.outer(np.arange(shape[0]), np.arange(shape[1])).astype(float)
    axes = drawn(field, [30.0, 60.0], size=size, title="A title that is longer than a narrow map is wide")
    wide, high = np.ptp(axes.get_xlim()) / axes.bbox.width, np.ptp(axes.get_ylim()) / axes.bbox.height
    assert wide == pytest.approx(high)
    assert 0.19 < axes.bbox.width / axes.bbox.height < 5.1
    whole = axes.figure.get_tightbbox()
    assert whole.x1 * axes.figure.dpi >= axes._left_title.get_window_extent().x1 - 1
    assert max(axes.bbox.size) == pytest.approx(min(size / 2.54 * 200, 16_000), rel=1e-6)


# ---- Relief and holes -----------------------------------------------------------------------------------------------


def relief(axes: Any) -> Any:
    return next((one for one in axes.collections if one.get_array() is not None), None)


@pytest.mark.parametrize("placement", [
    None, [[0, 30, 0], [-30, 0, 0]], [[0, -30, 0], [-30, 0, 0]], [[10, 30, 0], [-30, 10, 0]], [[30, 0, 0], [0, 30, 0]],
])
def test_light_comes_from_the_upper_left(placement: Any) -> None:
    """However the rows of the array run: the left upper side of a cone is brighter than the right lower one."""
    field = -np.hypot(*np.mgrid[-40:41, -40:41])
    axes = drawn(field, -39.5, placement, relief=True)
    mesh = relief(axes)
    at = axes.transData.transform(np.asarray(mesh.get_coordinates()).reshape(-1, 2)) - axes.bbox.size / 2
    light = np.asarray(mesh.get_array()).ravel()
    towards = at @ [-1, 1] / np.hypot(*at.T).max()
    assert light[towards > 0.4].mean() > light[towards < -0.4].mean() + 0.2


@pytest.mark.parametrize("with_relief", [False, True])
def test_holes_are_blank(with_relief: bool) -> None:
    """Also without a relief, where the rest has a plain tone; lines and labels end there."""
    field = COLUMNS.copy()
    field[15:36, 20:41] = np.nan
    axes = drawn(field, "every 2", relief=with_relief)
    tones = np.ma.getmaskarray(relief(axes).get_array()).reshape(field.shape)
    assert np.array_equal(tones, np.isnan(field)) and "blank: no data" in texts(axes)
    for name in ("contours", "index"):
        at = np.concatenate(lines(axes, name))
        assert not ((at > [19.2, 14.2]) & (at < [40.8, 35.8])).all(axis=1).any()
    assert labels(axes)


def test_a_curved_grid() -> None:
    """Lines, and the relief, lie where its coordinates say."""
    x = np.cumsum(1 + np.arange(61) / 60)
    placement = Placement(coordinates=(np.broadcast_to(x, COLUMNS.shape), -ROWS), error=0.001)
    axes = drawn(COLUMNS, [10.0, 30.0, 50.0], placement, relief=True)
    found = np.concatenate(lines(axes, "contours") + lines(axes, "index"))[:, 0]
    assert np.abs(found[:, None] - x[[10, 30, 50]]).min(axis=1).max() < 0.02
    ends = np.asarray(relief(axes).get_coordinates())[..., 0]
    assert (ends.min(), ends.max()) == pytest.approx((x[0], x[-1]), abs=0.01)


# ---- Files and fields -----------------------------------------------------------------------------------------------


@pytest.fixture
def hills(tmp_path: Path) -> Path:
    np.save(tmp_path / "hills.npy", HILLS)
    return tmp_path / "hills.npy"


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_each_format_with_the_same_bytes_twice(suffix: str, magic: bytes) -> None:
    """Of a field, and of a file of it, which has the same lines."""
    one, two = (plot_map(isocodec.Field(HILLS), suffix, Plot(every="every 40", size=5)) for _ in range(2))
    assert one.data == two.data and one.data.startswith(magic) and one.text == "5 isovalues"
    assert plot_map(isocodec.open(isocodec.encode(HILLS, "every 40")), suffix, Plot(size=5)).facts == one.facts
    if suffix == ".svg":
        texts_of = [text for text in one.data.decode().split("<") if text.startswith("text")]
        assert any("contour interval 40" in text for text in texts_of) and any(">0" in text for text in texts_of)


@pytest.mark.parametrize(("field", "isovalues"), [
    (COLUMNS, list(range(0, 60, 5))), (HILLS // 50, [0, 1, 2, 3]), (COLUMNS / 60, [k / 20 for k in range(20)]),
    (np.full((9, 9), 3.0), [3.0]),
])
def test_an_interval_is_chosen(field: Any, isovalues: list[float]) -> None:
    """A round one, a whole one of integers."""
    assert plot_map(isocodec.Field(field), ".png", Plot(size=2)).facts["isovalues"] == pytest.approx(isovalues)


def test_surfaces_labels_series_and_tiles(tmp_path: Path) -> None:
    tin = isocodec.open(isocodec.encode(isocodec.thin(HILLS, to=60)))
    assert plot_map(tin, ".png", Plot(size=5, isovalues=(50.0, 100.0))).facts["isovalues"] == [50, 100]
    labels_of = isocodec.open(isocodec.encode(isocodec.Field(HILLS // 80, labels=[1, 2])))
    assert plot_map(labels_of, ".png", Plot(size=5)).text == "2 labels"
    series = isocodec.open(isocodec.encode(isocodec.Frames([HILLS, HILLS // 2]), 60.5))
    assert "only frame 0 of 2" in plot_map(series, ".png", Plot(size=5)).remarks[0]
    assert not plot_map(series, ".png", Plot(size=5, frame=1)).remarks
    isocodec.save(tmp_path / "tiles.iso", COLUMNS, 10.5, tile=32)
    assert plot_map(isocodec.open(tmp_path / "tiles.iso"), ".png", Plot(size=5)).facts["isovalues"] == [10.5]


def test_the_command_line(hills: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.svg"
    placed = isocodec.Field(np.load(hills), placement=STEPS, crs="EPSG:32631")
    isocodec.save(tmp_path / "placed.iso", placed, "every 50")
    said = ok("plot", "--map", tmp_path / "placed.iso", "-o", out, "--title", "Two hills", "--size", 8)
    assert "4 isovalues" in said
    for text in ("Two hills", "WGS 84 / UTM zone 31N", "easting (m)", "contour interval 50"):
        assert text in out.read_text()
    result = run("plot", "--map", hills, "-o", tmp_path / "b.png", "--title", "\u5c71", "--size", 5)
    (line,) = result.stderr.splitlines()
    assert result.exit_code == 0 and "missing from" in line


def test_errors(hills: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.png"
    np.save(tmp_path / "ball.npy", BALL)
    np.save(tmp_path / "nan.npy", COLUMNS * np.nan)
    isocodec.save(tmp_path / "hills.iso", HILLS, 60.5)
    isocodec.save(tmp_path / "ball.iso", BALL, 60.5)
    (tmp_path / "cut.iso").write_bytes((tmp_path / "hills.iso").read_bytes()[:-9])
    for code, source, more, word in (
        (2, hills, ["--interval", 3, "--isovalue", 3], "cannot be combined"), (2, hills, ["--interval", 0], "greater"),
        (2, hills, ["--steps", 3], "--steps does not apply to maps"),
        (2, tmp_path / "hills.iso", ["--interval", 3], "--interval does not apply to .iso files"),
        (2, tmp_path / "ball.iso", [], "two axes"), (2, tmp_path / "ball.npy", [], "two axes"),
        (3, tmp_path / "nan.npy", [], "all samples are missing"), (3, tmp_path / "none.npy", [], "No such file"),
        (5, tmp_path / "cut.iso", [], "before it is complete"),
    ):
        assert word in fails(code, "plot", "--map", source, "-o", out, *more)
        assert not out.exists()
    assert ".png, .pdf, .svg" in fails(2, "plot", "--map", hills, "-o", tmp_path / "a.tif")


def test_missing_libraries(hills: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    placed = hills.with_suffix(".iso")
    isocodec.save(placed, isocodec.Field(np.load(hills), placement=STEPS, crs="EPSG:32631"), "every 50")
    monkeypatch.setitem(__import__("sys").modules, "pyproj", None)
    assert "needs pyproj" in fails(7, "plot", "--map", placed, "-o", hills.with_suffix(".png"))
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    assert "'isocodec[plot]'" in fails(7, "plot", "--map", hills, "-o", hills.with_suffix(".png"))
