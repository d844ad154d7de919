"""A box of coordinates keeps the samples in it, those on its border too; by the coordinates of every sample."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails, ok
from isocodec.errors import OptionError
from isocodec.field.cropping import cropped, window_around
from isocodec.field.placement import Placement
from isocodec.field.sampled import Field
from libraries import Late
from tables import looped

shapely = Late("shapely")

SHAPE = (7, 9)
MATRICES = {
    "upwards": [[0, 2, 10], [2, 0, 20]], "downwards": [[0, 2, 10], [-2, 0, 34]], "turned": [[2, 0, 10], [0, 2, 20]],
}
BOXES = [(12, 22, 18, 30), (12.5, 22.5, 17.5, 29.5), (10, 20, 26, 32), (16, 26, 16, 26), (-99, 24, 99, 25.9)]


@pytest.mark.parametrize("name", MATRICES)
@pytest.mark.parametrize("box", BOXES)
def test_samples_within(name, box):
    field = Field(np.arange(63).reshape(SHAPE), placement=Placement(MATRICES[name]))
    rows, columns = np.indices(SHAPE)
    x, y = field.placement.place(np.stack([rows.ravel(), columns.ravel()], axis=1).astype(float)).T
    inside = (x >= box[0]) & (y >= box[1]) & (x <= box[2]) & (y <= box[3])
    if not inside.any():
        with pytest.raises(OptionError, match="no samples"):
            cropped(field, box)
        return
    part = cropped(field, box)
    assert sorted(part.values.ravel()) == sorted(field.values.ravel()[inside])
    places = np.stack([*map(np.ravel, np.indices(part.shape))], axis=1).astype(float)
    kept = {tuple(place) for place in part.placement.place(places).round(9).tolist()}
    assert kept == {(a, b) for a, b in zip(x[inside].round(9).tolist(), y[inside].round(9).tolist(), strict=True)}


# ---- Windows of files by coordinates --------------------------------------------------------------------------------

PLACES = {
    "down": [[0, 30, 5e5], [-30, 0, 4e6]], "up": [[0, 0.1, 7.3], [0.1, 0, 51.7]],
    "swapped": [[30, 0, 5e5], [0, 30, 4e6]], "swapped back": [[-2, 0, 90], [0, -3, 10]],
    "turned": [[3, 20, 500], [-7, 1, -40]],
}
"""Of both orders of axes, with negative heights, and turned."""


def box_around(matrix: Any, low: Any, high: Any) -> tuple[float, ...]:
    """The box of two corners in samples."""
    ends = np.array(matrix) @ np.array([[low[0], high[0]], [low[1], high[1]], [1, 1]])
    return (*ends.min(axis=1), *ends.max(axis=1))


@looped("name", PLACES)
@looped("low,high", [((3, 5), (20, 30)), ((3.2, 5.7), (20.9, 30.1)), ((-9, -9), (4, 4)), ((7.4, 8.1), (7.6, 8.2))])
def test_windows_are_those_of_rasterio(name: str, low: Any, high: Any) -> None:
    windows, affine = pytest.importorskip("rasterio.windows"), pytest.importorskip("affine")
    matrix = np.array(PLACES[name], np.float64)
    box = box_around(matrix, low, high)
    found = window_around(Placement(matrix), HILLS.shape, box)
    (a, b, c), (d, e, f) = matrix[:, [1, 0, 2]] - np.array([[0, 0, 1]]) * matrix[:, :2].sum(axis=1)[:, None] / 2
    corners = ~affine.Affine(a, b, c, d, e, f)
    ends = np.array([corners * (x, y) for x in box[::2] for y in box[1::2]])[:, ::-1] - 0.5
    assert found == pytest.approx(np.stack([ends.min(axis=0), ends.max(axis=0)], axis=1), abs=1e-6)
    if b == d == 0 < a and e < 0:
        window = windows.from_bounds(*box, transform=affine.Affine(a, b, c, d, e, f))
        wanted = [window.row_off, window.row_off + window.height, window.col_off, window.col_off + window.width]
        assert found.ravel() == pytest.approx(np.array(wanted) - 0.5, abs=1e-6)


def files_of(matrix: Any, path: Path) -> dict[str, isocodec.IsoFile]:
    field = Field(HILLS, placement=Placement(matrix, crs="EPSG:32631"))
    isocodec.save(path / "tiles.iso", field, 80.5, tile=32)
    rows, columns = np.indices(HILLS.shape)
    curved = Placement(coordinates=(columns * 2.0 + rows / 9, rows * 3.0 + columns**2 / 400))
    return {
        "grid": isocodec.open(isocodec.encode(field, [80.5, 60.5])),
        "series": isocodec.open(isocodec.encode(isocodec.Frames([field, field]), 80.5)),
        "tiles": isocodec.open(path / "tiles.iso"),
        "surface": isocodec.open(isocodec.encode(isocodec.thin(field, error=3.0))),
        "coordinates": isocodec.open(isocodec.encode(Field(HILLS, placement=curved), 80.5)),
    }


@looped("name", ["down", "swapped back", "turned"])
def test_everything_within_a_box_is_drawn(name: str, tmp_path: Path) -> None:
    """Of every kind of file; clipped to the box, by shapely, nothing is missing."""
    for kind, file in files_of(PLACES[name], tmp_path).items():
        whole = file.contour(80.5).to_shapely()
        placed = file.contour(80.5).placed
        least, most = placed.min(axis=0), placed.max(axis=0)
        for share in ((0.1, 0.45), (0.5, 0.52)):
            low, high = least + share[0] * (most - least), least + share[1] * (most - least)
            box = (*low, *high)
            part = file.contour(80.5, bbox=box)
            assert len(part.cells) < len(file.contour(80.5).cells) and (share[0] > 0.1 or len(part.cells))
            assert np.array_equal(part.points, file.contour(80.5, window=file.window_around(box)).points)
            clip = shapely.box(*box)
            lines = shapely.intersection(whole, clip)
            assert lines.is_empty or shapely.covers(shapely.buffer(part.to_shapely(), 1e-6), lines), (kind, share)
        for wrong in ((*(least - 9000), *(least - 8000)), (1, 2, 3), (5, 5, 1, 1), (np.nan, 0, 1, 1)):
            with pytest.raises(OptionError):
                file.contour(80.5, bbox=wrong)
        with pytest.raises(OptionError, match="--window and --bbox"):
            file.contour(80.5, bbox=box, window=[(0, 4), (0, 4)])
        if kind in ("grid", "series", "tiles"):
            low, high = least + 0.1 * (most - least), least + 0.45 * (most - least)
            made = isocodec.open(file.edited(bbox=(*low, *high)))
            lines = shapely.intersection(whole, shapely.box(*low, *high))
            assert shapely.covers(shapely.buffer(made.contour(80.5).to_shapely(), 1e-6), lines)
            if name != "turned":
                assert max(made.shape) < max(file.shape)


def test_boxes_of_meshes_and_volumes() -> None:
    points = np.random.default_rng(0).random((300, 2)) * 10
    file = isocodec.open(isocodec.encode(isocodec.Mesh(points, None, np.hypot(*(points - 5).T), stored="whole"), 3.0))
    part = file.contour(bbox=(2, 3, 5, 6))
    assert np.array_equal(part.points, file.contour(window=[(2, 5), (3, 6)]).points) and len(part.points)
    ball = np.hypot(np.hypot(*np.mgrid[-8:9, -8:9, -8:9][:2]), np.mgrid[-8:9, -8:9, -8:9][2])
    file = isocodec.open(isocodec.encode(Field(ball, placement=(2.0, -3.0, 1.0)), 6.1))
    window = [[1.5, 6.0], [3.0, 7.5], [2.0, 9.0]]
    assert file.window_around((3, -22.5, 2, 12, -9, 9)) == window
    assert isocodec.open(file.edited(bbox=(3, -22.5, 2, 12, -9, 9))).shape == (7, 7, 8)
    plane = np.array([[1.0, 0, 5], [0, 1, 5], [0, 0.5, 5]])
    file = isocodec.open(isocodec.encode(Field(HILLS, placement=Placement(plane)), 80.5))
    with pytest.raises(OptionError, match="plane in space"):
        file.contour(bbox=(0, 0, 9, 9))
    with pytest.raises(OptionError, match="placement"):
        isocodec.open(isocodec.encode(HILLS, 80.5)).contour(bbox=(0, 0, 9, 9))


def test_boxes_on_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "a.iso"
    path.write_bytes(files_of(PLACES["down"], tmp_path)["grid"].data)
    box = ",".join(map(str, box_around(PLACES["down"], (3, 5), (20, 30))))
    ok("edit", path, "-o", tmp_path / "b.iso", "--bbox", box)
    assert isocodec.open(tmp_path / "b.iso").shape == (19, 27)
    for suffix in ("svg", "geojson"):
        for option, value in (("--bbox", box), ("--window", "3:20,5:30")):
            ok("decode", path, "-o", tmp_path / f"{option}.{suffix}", option, value)
        assert (tmp_path / f"--bbox.{suffix}").read_text() == (tmp_path / f"--window.{suffix}").read_text()
    assert "the field extends from 500000, 3999040 to 501200, 4000000" in fails(
        2, "decode", path, "-o", tmp_path / "c.svg", "--bbox", "1,2,3,4")
    for more in (["--window", "0:9,0:9"], ["--what", "above"], ["--capped", "above"]):
        fails(2, "decode", path, "-o", tmp_path / "c.npy", "--bbox", box, *more)
    fails(2, "edit", path, "-o", tmp_path / "c.iso", "--bbox", box, "--window", "0:9,0:9")
