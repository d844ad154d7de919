"""``isocodec plot --map``: read back as an SVG, and looked at pixel by pixel."""

from __future__ import annotations

import io
import json
import re
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pyproj
import pytest
from PIL import Image

import isocodec
from commands import BALL, HILLS, fails, ok, run
from isocodec.drawing.pictures.map_picture import DARK, LIGHT, index_lines
from isocodec.drawing.pictures.relief import shaded
from isocodec.field.placement import Placement

SVG = "{http://www.w3.org/2000/svg}"
UTM = "placement=0 30 500000 -20 0 5000000"
# of a plane that rises by 1 a column, contours are columns
ROWS, COLUMNS = np.mgrid[:50, :61].astype(float)


@pytest.fixture
def plane(tmp_path: Path) -> Path:
    np.save(tmp_path / "plane.npy", COLUMNS)
    return tmp_path / "plane.npy"


@pytest.fixture
def hills(tmp_path: Path) -> Path:
    np.save(tmp_path / "hills.npy", np.kron(HILLS, np.ones((1, 1))))
    return tmp_path / "hills.npy"


class Drawn:
    """What an SVG shows."""

    def __init__(self, path: Path) -> None:
        self.root = ElementTree.parse(path).getroot()
        self.texts = ["".join(e.itertext()) for e in self.root.iter(f"{SVG}text")]

    def group(self, name: str) -> ElementTree.Element:
        return next(e for e in self.root.iter(f"{SVG}g") if e.get("id") == name)

    def paths(self, name: str) -> list[np.ndarray]:
        """Corners of each path of a group, (K, 2), in points from the upper left corner."""
        found = [e.get("d", "") for e in self.group(name).iter(f"{SVG}path")]
        return [np.array(re.findall(r"-?[0-9.]+(?:e-?[0-9]+)?", d), float).reshape(-1, 2) for d in found]

    def stroke(self, name: str) -> float:
        """Width of the lines of a group; 1 is what SVG has if nothing is said."""
        (width,) = {
            float(found[1]) if (found := re.search(r"stroke-width: ([0-9.]+)", e.get("style", ""))) else 1.0
            for e in self.group(name).iter(f"{SVG}path")
        }
        return width

    @property
    def frame(self) -> tuple[np.ndarray, np.ndarray]:
        """Upper left and lower right corner of the map."""
        (patch,) = self.paths("patch_2")
        return patch.min(axis=0), patch.max(axis=0)

    @property
    def labels(self) -> list[tuple[str, np.ndarray]]:
        """Texts along lines, and where their middles are."""
        out = []
        for group in self.root.iter(f"{SVG}g"):
            if (group.get("id") or "").startswith("label-"):
                (text,) = group.iter(f"{SVG}text")
                out.append((text.text or "", np.array([float(text.get("x", "0")), float(text.get("y", "0"))])))
        return out


def drawn(source: Path, *more: object) -> Drawn:
    out = source.with_suffix(".svg")
    ok("plot", "--map", source, "-o", out, *more)
    return Drawn(out)


def pixels(source: Path, *more: object) -> np.ndarray:
    out = source.with_suffix(".png")
    ok("plot", "--map", source, "-o", out, *more)
    return np.asarray(Image.open(out).convert("RGB")).astype(float)


def near(image: np.ndarray, colour: str, within: float = 40) -> np.ndarray:
    """Pixels of about a colour."""
    wanted = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return np.asarray(np.abs(image - wanted).max(axis=-1) < within)


# ---- Lines and labels -----------------------------------------------------------------------------------------------


def test_lines_lie_where_they_belong(plane: Path) -> None:
    """Thin ones and index lines, with an offset, as shares of the frame's width."""
    map_ = drawn(plane, "--interval", 4, "--offset", 1, "--index", 3)
    low, high = map_.frame
    wanted = {v: low[0] + (v / 60) * (high[0] - low[0]) for v in range(1, 60, 4)}
    for name, values in (("contours", [v for v in wanted if v // 4 % 3]), ("index-contours", [1, 13, 25, 37, 49])):
        found = np.concatenate([path[:, 0] for path in map_.paths(name)])
        right = np.array([wanted[v] for v in values])
        apart = np.abs(found[:, None] - right)
        # a cell is 9 points wide, lines are within 0.005 of it
        assert apart.min(axis=1).max() < 0.06 and apart.min(axis=0).max() < 0.06
    assert map_.stroke("index-contours") >= 2 * map_.stroke("contours")
    assert {text for text, _ in map_.labels} == {"1", "13", "25", "37", "49"}


def test_lines_are_broken_under_labels(hills: Path) -> None:
    map_ = drawn(hills, "--interval", 5, "--index", 4)
    labels = map_.labels
    assert len(labels) >= 4 and {text for text, _ in labels} <= {str(v) for v in range(0, 200, 20)}
    lines = [np.linspace(a, b, 50) for path in map_.paths("index-contours") for a, b in pairwise(path)]
    for text, at in labels:
        # digits are about 4.4 points wide, of 7
        assert min(np.hypot(*(line - at).T).min() for line in lines) > len(text) * 4.4 / 2 - 0.5
    # and no label lies on another one
    places = np.array([at for _, at in labels])
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) + 1e9 * np.eye(len(places))
    assert apart.min() > 10


def test_labels_are_turned_with_their_line(plane: Path) -> None:
    """Along a contour that is upright, and readable: from below or from the right."""
    out = plane.with_suffix(".svg")
    ok("plot", "--map", plane, "-o", out, "--interval", 10)
    turns = re.findall(r'id="label-[^<]*<text [^>]*rotate\((-?[0-9.]+) ', out.read_text())
    assert turns and all(abs(float(turn) % 180 - 90) < 1 for turn in turns)


def test_a_file_gives_the_lines_of_its_field(hills: Path, tmp_path: Path) -> None:
    ok("encode", hills, "-o", tmp_path / "hills.iso", "--interval", 20, "--precision", 0.005)
    ok("plot", "--map", hills, "-o", tmp_path / "a.svg", "--interval", 20, "--no-relief")
    ok("plot", "--map", tmp_path / "hills.iso", "-o", tmp_path / "b.svg")
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    record = json.loads(ok("plot", "--map", tmp_path / "hills.iso", "-o", tmp_path / "c.svg", "--json"))
    assert record["isovalues"] == list(range(0, 200, 20)) and record["labels"] == len(Drawn(tmp_path / "c.svg").labels)


@pytest.mark.parametrize(
    ("isovalues", "every", "index"),
    [
        (range(20, 320, 20), 5, [100, 200, 300]),
        ([v + 0.5 for v in range(400, 900, 100)], 2, [400.5, 600.5, 800.5]),
        ([-0.2, -0.1, 0.0, 0.1, 0.2, 0.30000000000000004], 2, [-0.2, 0.0, 0.2]),
        ([1, 2.5, 7, 8], 2, [1, 7]),
        ([7.0], 5, [7.0]),
        ([2, 3], 5, [2, 3]),
        ([300, 100, 200], 2, [200]),
    ],
)
def test_index_lines(isovalues: Any, every: int, index: list[float]) -> None:
    """Multiples of so many intervals; where there are none among them, all."""
    thick = index_lines([*isovalues], every)
    assert [v for v, one in zip(isovalues, thick, strict=True) if one] == index


def test_an_interval_is_chosen(plane: Path) -> None:
    """A round one: 0 to 60 in steps of 5."""
    record = json.loads(ok("plot", "--map", plane, "-o", plane.with_suffix(".svg"), "--json"))
    assert record["isovalues"] == list(range(0, 60, 5))


# ---- Around the map -------------------------------------------------------------------------------------------------


def test_coordinates_and_system(plane: Path) -> None:
    map_ = drawn(
        plane, "--interval", 10, "--title", "A & B $x^2$", "--metadata", UTM, "--metadata", "crs=EPSG:32631",
        "--metadata", "unit=m",
    )
    for text in (
        "A & B $x^2$", "WGS 84 / UTM zone 31N (EPSG:32631)", "500,500", "4,999,600", "easting (m)", "northing (m)",
        "contour interval 10 m, index contours 50 m",
    ):
        assert text in map_.texts
    low, high = map_.frame
    # 60 steps of 30 m, and 49 of 20 m, at one scale
    assert (high - low)[0] / (high - low)[1] == pytest.approx(60 * 30 / (49 * 20), rel=1e-3)


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:3857", "EPSG:2263"])
def test_the_scale_bar_is_as_long_as_it_says(plane: Path, crs: str) -> None:
    """On the ellipsoid, in the middle of the map: of degrees, of a projection that stretches, of feet."""
    step, x, y = {"EPSG:4326": (0.001, 11.0, 47.0), "EPSG:3857": (100, 1e6, 6e6), "EPSG:2263": (100, 980000, 2e5)}[crs]
    placement = f"placement=0 {step} {x} -{step} 0 {y}"
    map_ = drawn(plane, "--interval", 10, "--metadata", placement, "--metadata", f"crs={crs}")
    bars = [path for part in (0, 1) for path in map_.paths(f"scale-bar-{part}")]
    length = max(bar[:, 0].max() for bar in bars) - min(bar[:, 0].min() for bar in bars)
    low, high = map_.frame
    (said,) = [text for text in map_.texts if re.fullmatch(r"[0-9.]+ k?m", text)]
    metres = float(said.split()[0]) * (1000 if said.endswith("km") else 1)
    middle = y - step * 24.5
    degrees = pyproj.Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    ends = [degrees.transform(x + step * k, middle) for k in (0, 60)]
    whole = pyproj.Geod(ellps="WGS84").inv(*ends[0], *ends[1])[2]
    assert length / (high - low)[0] == pytest.approx(metres / whole, rel=0.002)
    if crs == "EPSG:4326":
        assert "11.02\u00b0E" in map_.texts and "46.97\u00b0N" in map_.texts
        # degrees of longitude are shorter
        assert (high - low)[0] / (high - low)[1] == pytest.approx(60 / 49 * np.cos(np.radians(middle)), rel=0.01)


def test_without_a_placement_rows_run_down(tmp_path: Path) -> None:
    np.save(tmp_path / "rows.npy", ROWS)
    map_ = drawn(tmp_path / "rows.npy", "--isovalue", 10)
    low, high = map_.frame
    found = np.concatenate([path[:, 1] for path in map_.paths("index-contours")])
    assert found == pytest.approx(low[1] + 10 / 49 * (high[1] - low[1]), abs=0.1)
    assert {"column", "row", "coordinates in samples", "contour 10"} <= {*map_.texts}


# ---- Holes and relief -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("as_file", [False, True])
def test_nothing_is_drawn_over_holes(tmp_path: Path, as_file: bool) -> None:
    """Lines and labels end at the hole, which is hatched."""
    field = COLUMNS.copy()
    field[15:36, 20:41] = np.nan
    source = tmp_path / "holes.npy"
    np.save(source, field)
    options: list[object] = ["--interval", 1, "--index", 2]
    if as_file:
        ok("encode", source, "-o", tmp_path / "holes.iso", "--interval", 1)
        source, options = tmp_path / "holes.iso", ["--index", 2]
    map_ = drawn(source, *options)
    low, high = map_.frame
    assert "hatched: no data" in " ".join(map_.texts)

    def page(row: float, column: float) -> np.ndarray:
        return np.array(low + (high - low) * [column / 60, row / 49])

    # cells with a missing corner
    first, last = page(14, 19), page(36, 41)
    (hole,) = [path for path in map_.paths("holes") if len(path) > 4]
    assert np.allclose([hole.min(axis=0), hole.max(axis=0)], [first, last], atol=0.01)
    for name in ("contours", "index-contours"):
        for path in map_.paths(name):
            dense = np.concatenate([np.linspace(a, b, 100) for a, b in pairwise(path)])
            assert not ((dense > first + 0.1) & (dense < last - 0.1)).all(axis=1).any()
    assert map_.labels
    for _, at in map_.labels:
        assert not ((at > first - 3) & (at < last + 3)).all()

    image = pixels(source, *options, "--dpi", 144)
    (left, top), (right, bottom) = (np.round(corner * 2).astype(int) for corner in (first + 2, last - 2))
    inside = image[top:bottom, left:right]
    line = near(image, LIGHT.line, 60) | near(image, LIGHT.index, 60)
    assert line.sum() > 5000 and not line[top:bottom, left:right].any()
    # hatched: dark strokes on a pale ground
    assert 0.05 < (inside.max(axis=-1) < 200).mean() < 0.7


@pytest.mark.parametrize("placement", [None, "placement=0 30 0 -30 0 0", "placement=0 30 0 30 0 0",
                                       "placement=0 -30 0 -30 0 0", "placement=10 30 0 -30 10 0"])
def test_light_comes_from_the_upper_left(tmp_path: Path, placement: str | None) -> None:
    """However the rows of the array run: the left upper side of a cone is brighter than the right lower one."""
    source = tmp_path / "cone.npy"
    np.save(source, -np.hypot(*np.mgrid[-40:41, -40:41]))
    notes = () if placement is None else ("--metadata", placement)
    # but for one line there is the relief alone
    image = pixels(source, "--isovalue", -39.5, *notes, "--dpi", 100).mean(axis=-1)
    middle = np.array(image.shape) / 2
    # the map lies a little above and right of the middle
    box = image[int(middle[0]) - 150 : int(middle[0]) + 110, int(middle[1]) - 110 : int(middle[1]) + 150]
    upper, lower = box[:100, :100], box[-100:, -100:]
    assert np.median(upper) > np.median(lower) + 10


def test_shading_is_that_of_matplotlib() -> None:
    """Of a field whose slopes need no exaggeration, but for how lights are scaled."""
    from matplotlib.colors import LightSource

    heights = np.exp(-((ROWS - 25) ** 2 + (COLUMNS - 30) ** 2) / 200)
    ours = shaded(heights, np.array([[0.0, 1.0], [-1.0, 0.0]]))
    slopes = np.hypot(*np.gradient(heights))
    theirs = LightSource(315, 45).hillshade(heights, vert_exag=0.7 / np.percentile(slopes, 90))
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.999999


def test_dark_maps(hills: Path) -> None:
    image = pixels(hills, "--interval", 20, "--dark", "--no-relief", "--size", 8)
    assert near(image, DARK.paper, 3).mean() > 0.6 and near(image, DARK.index, 30).any()
    assert not near(image, "#ffffff", 10).any()


def test_size_and_resolution(hills: Path) -> None:
    """The longest side of the map is so long, whatever is written around it."""
    for size, dpi in ((10, 127), (20, 254)):
        image = pixels(hills, "--interval", 20, "--size", size, "--dpi", dpi, "--no-relief", "--title", "T")
        dark = (image.max(axis=-1) < 120).sum(axis=0)
        sides = np.flatnonzero(dark > 0.6 * image.shape[0] * 33 / 41)
        assert np.ptp(sides) == pytest.approx(size / 2.54 * dpi, abs=4)


def test_a_mapped_grid(tmp_path: Path) -> None:
    """Lines lie where its coordinates say."""
    x = np.cumsum(1 + np.arange(61) / 60)
    data = isocodec.encode(
        isocodec.Field(
            COLUMNS,
            placement=Placement(
                coordinates=(np.broadcast_to(x, COLUMNS.shape), np.broadcast_to(-ROWS, ROWS.shape)), error=0.001,
            ),
        ),
        [10.0, 30.0, 50.0], precision=0.005,
    )
    (tmp_path / "m.iso").write_bytes(data)
    map_ = drawn(tmp_path / "m.iso", "--index", 1)
    low, high = map_.frame
    found = np.concatenate([path[:, 0] for path in map_.paths("index-contours")])
    right = low[0] + (x[[10, 30, 50]] - x[0]) / (x[-1] - x[0]) * (high - low)[0]
    apart = np.abs(found[:, None] - right)
    assert apart.min(axis=1).max() < 0.2 and apart.min(axis=0).max() < 0.2


def test_a_file_in_tiles(tmp_path: Path) -> None:
    """It is drawn as the same curve in one piece is."""
    isocodec.save(tmp_path / "whole.iso", COLUMNS, 10.5)
    isocodec.save(tmp_path / "tiles.iso", COLUMNS, 10.5, tile=32)
    lines = []
    for name in ("whole.iso", "tiles.iso"):
        map_ = drawn(tmp_path / name, "--index", 1)
        line = np.concatenate(map_.paths("index-contours"))
        assert [text for text, _ in map_.labels] and {text for text, _ in map_.labels} == {"10.5"}
        lines.append((line.min(axis=0), line.max(axis=0), *map_.frame))
    assert np.array(lines[0]) == pytest.approx(np.array(lines[1]), abs=0.1)


def test_the_same_map_has_the_same_bytes(hills: Path, tmp_path: Path) -> None:
    for suffix in (".svg", ".pdf", ".png"):
        for name in ("a", "b"):
            ok("plot", "--map", hills, "-o", tmp_path / f"{name}{suffix}", "--interval", 20, "--size", 6)
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()
    assert (tmp_path / "a.pdf").read_bytes()[:5] == b"%PDF-"


# ---- Errors ---------------------------------------------------------------------------------------------------------


def test_errors(plane: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.png"
    np.save(tmp_path / "ball.npy", BALL)
    np.save(tmp_path / "nan.npy", COLUMNS * np.nan)
    isocodec.save(tmp_path / "plane.iso", COLUMNS, 10.5)
    isocodec.save(tmp_path / "ball.iso", BALL, 60.5)
    (tmp_path / "cut.iso").write_bytes((tmp_path / "plane.iso").read_bytes()[:-9])
    (tmp_path / "no.iso").write_bytes(b"no curve")
    for code, source, more, word in (
        (2, plane, ["--offset", 3], "--offset needs --interval"),
        (2, plane, ["--interval", 3, "--isovalue", 3], "cannot be combined"),
        (2, plane, ["--interval", 0], "greater than 0"),
        (2, plane, ["--size", 300, "--dpi", 2000], "too large"),
        (2, plane, ["--metadata", "crs"], "KEY=TEXT"),
        (2, tmp_path / "plane.iso", ["--interval", 3], "an interval does not apply"),
        (2, tmp_path / "ball.iso", [], "two axes"),
        (3, tmp_path / "ball.npy", [], "a field with two axes; this one has 3"),
        (3, tmp_path / "nan.npy", [], "all samples are missing"),
        (3, tmp_path / "none.npy", [], "No such file"),
        (3, plane, ["--interval", 1000, "--offset", 500], "choose a smaller interval"),
        (3, plane, ["--interval", 0.01], "choose a larger interval"),
        (4, tmp_path / "no.iso", [], "not an .iso file"),
        (5, tmp_path / "cut.iso", [], "before it is complete"),
    ):
        line = fails(code, "plot", "--map", source, "-o", out, *more)
        assert word in line, line
        assert not out.exists()
    assert ".png, .pdf, .svg" in fails(2, "plot", "--map", plane, "-o", tmp_path / "a.tif")


def test_missing_libraries(plane: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notes = ("--metadata", UTM, "--metadata", "crs=EPSG:32631")
    monkeypatch.setitem(sys.modules, "pyproj", None)
    line = fails(7, "plot", "--map", plane, "-o", plane.with_suffix(".png"), *notes)
    assert line.endswith("a map in EPSG:32631 needs pyproj: pip install '.[geo]' in a checkout of isocodec")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert "'.[plot]'" in fails(7, "plot", "--map", plane, "-o", plane.with_suffix(".png"))


def test_a_system_that_is_none(plane: Path) -> None:
    """It is named, and nothing is measured in it."""
    map_ = drawn(plane, "--interval", 10, "--metadata", UTM, "--metadata", "crs=EPSG:999999")
    assert "EPSG:999999" in map_.texts and {"x", "y"} <= {*map_.texts}


def test_standard_input(plane: Path, tmp_path: Path) -> None:
    from click.testing import CliRunner

    from isocodec.cli import main

    result = CliRunner().invoke(
        main, [
            "plot", "--map", "-", "-o", str(tmp_path / "a.png"),
        ], input=io.BytesIO(plane.read_bytes())
    )
    assert result.exit_code == 0, result.output
    ok("plot", "--map", plane, "-o", tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_glyphs_that_are_not_there_are_one_warning(plane: Path) -> None:
    result = run("plot", "--map", plane, "-o", plane.with_suffix(".png"), "--title", "\u5c71\u5ddd\u8349\u6728")
    assert result.exit_code == 0
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"isocodec: {plane.with_suffix('.png')}: warning: ") and "missing from" in line


def test_degrees_of_the_globe(tmp_path: Path) -> None:
    """Ticks stand at the quarters of a circle, and 180 degrees are neither west nor east."""
    field = np.cos(np.radians(np.arange(0, 360, 5)))[None] + np.zeros((35, 1))
    data = isocodec.encode(
        isocodec.Field(field, placement=[[0, 5, 0], [-5, 0, 85]]), 0.5, metadata={"crs": "EPSG:4326"},
    )
    (tmp_path / "a.iso").write_bytes(data)
    ok("plot", "--map", tmp_path / "a.iso", "-o", tmp_path / "a.svg")
    text = (tmp_path / "a.svg").read_text()
    assert all(f">{tick}<" in text or f"<!-- {tick} -->" in text for tick in ("90°E", "180°", "90°W", "45°N", "45°S"))
