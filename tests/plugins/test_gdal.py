"""The driver for GDAL, in the GDAL that comes with pyogrio: features are what the library decodes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import isocodec
import isocodec.plugins
from isocodec import Field, Frames
from libraries import Late

shapely = Late("shapely")

DRIVERS = Path(isocodec.plugins.__file__).parent
SCRIPT = """
import json, sys
import pyogrio

def answer(path, layer, box=None, **options):
    table = pyogrio.read_dataframe(path, layer=layer, bbox=box and tuple(box), fid_as_index=True, **options)
    shapes = table.geometry.values
    return {
        "layers": [[*map(str, each)] for each in pyogrio.list_layers(path)],
        "numbers": table.index.tolist(),
        "crs": str(table.crs), "bounds": pyogrio.read_info(path, layer=layer, **options)["total_bounds"],
        "columns": {name: table[name].tolist() for name in table.columns if name != "geometry"},
        "points": [[[float(x) for x in point] for point in shape.coords] if shape.geom_type == "LineString" else None
                   for shape in shapes],
        "areas": [shape.area for shape in shapes], "valid": [bool(shape.is_valid) for shape in shapes],
        "kinds": [shape.geom_type for shape in shapes],
    }

print(json.dumps([answer(**each) for each in json.loads(sys.argv[1])]))
"""


def by_gdal(*asked):
    """What pyogrio reads, in a process of its own: GDAL looks for drivers when it is loaded."""
    found = subprocess.run(
        [sys.executable, "-c", SCRIPT, json.dumps([{**each, "path": str(each["path"])} for each in asked])],
        env={**os.environ, "GDAL_PYTHON_DRIVER_PATH": str(DRIVERS),
             "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True, text=True, check=False,
    )
    assert found.returncode == 0, found.stderr
    assert not found.stderr, found.stderr
    return json.loads(found.stdout)


def waves(*sizes):
    at = np.meshgrid(*(np.arange(size) for size in sizes), indexing="ij")
    return sum(np.sin(x / (3.0 + i)) for i, x in enumerate(at)) + 0.01 * at[0]


MATRIX = [[2.0, 10.0, 500_000.0], [-10.0, 1.0, 4_000_000.0]]  # a step along axis 0, along axis 1, the origin


def place_of(points):
    matrix = np.array(MATRIX)
    return points @ matrix[:, :2].T + matrix[:, 2]


def test_lines_and_bands_of_a_map(tmp_path):
    path = tmp_path / "map.iso"
    isovalues = [-0.5, 0.25, 1.0]
    path.write_bytes(isocodec.encode(Field(waves(60, 80), placement=MATRIX, crs="EPSG:32631"), isovalues))
    found, bands = by_gdal({"path": path, "layer": "lines"}, {"path": path, "layer": "bands", "BANDS": "YES"})
    contours = isocodec.open(path).contours()
    wanted = [(contour.isovalue, place_of(line)) for contour in contours for line in contour.lines]
    assert found["layers"] == [["lines", "LineString"]]
    assert found["crs"] == "EPSG:32631"
    assert found["columns"]["isovalue"] == [isovalue for isovalue, _ in wanted]
    assert all(np.allclose(mine, line, rtol=1e-14) for mine, (_, line) in zip(found["points"], wanted, strict=True))
    corners = place_of(np.array([[0, 0], [0, 79], [59, 0], [59, 79]]))
    assert np.allclose(found["bounds"], [*corners.min(axis=0), *corners.max(axis=0)])
    assert bands["columns"]["lower"][1:] == isovalues and bands["columns"]["upper"][:-1] == isovalues
    cell = abs(np.linalg.det(np.array(MATRIX)[:, :2]))
    assert all(bands["valid"]) and np.isclose(sum(bands["areas"]), 59 * 79 * cell)


def test_fewer_layers_and_bytes(tmp_path):
    path = tmp_path / "map.iso"
    path.write_bytes(isocodec.encode(waves(60, 80), 0.25))
    asked = [{"path": path, "layer": "lines", **options} for options in ({}, {"LAYERS": "2"}, {"MAX_BYTES": "60"})]
    every, layers, some = (sum(map(len, each["points"])) for each in by_gdal(*asked))
    file = isocodec.open(path)
    assert layers == sum(map(len, file.contour(layers=2).lines)) < every
    assert some == sum(map(len, file.contour(max_bytes=60, partial=True).lines)) < every


def test_labels_series_and_surfaces(tmp_path):
    labels = np.zeros((40, 50), np.int16)
    labels[5:20, 5:30], labels[15:35, 25:45] = 3, 7
    named = Field(labels, labels="all", notes={"label 3": "lake"})
    stack = Frames([waves(30, 40) + shift for shift in (0.0, 0.2, 0.4)], times=[0, 1.5, 4])
    files = {"labels": isocodec.encode(named), "series": isocodec.encode(stack, [0.25, 1.0]),
             "surface": isocodec.encode(Field(waves(12, 13, 14), placement=[2.0, 3.0, 4.0]), 0.5)}
    for name, data in files.items():
        (tmp_path / f"{name}.iso").write_bytes(data)
    areas, lines, surface = by_gdal(*({"path": tmp_path / f"{name}.iso", "layer": layer} for name, layer in (
        ("labels", "areas"), ("series", "lines"), ("surface", "triangles"))))
    assert [name for name, _ in areas["layers"]] == ["lines", "areas"] and areas["columns"]["label"] == [3, 7]
    assert all(isinstance(each, int) for each in areas["columns"]["label"])
    assert areas["columns"]["name"] in (["lake", ""], ["lake", None])
    series = lines["columns"]
    wanted = [(contour.isovalue, frame) for frame, contours in enumerate(isocodec.open(files["series"]).each_frame())
              for contour in contours for _ in contour.lines]
    assert [*zip(series["isovalue"], series["frame"], strict=True)] == wanted
    assert [*dict.fromkeys(series["time"])] == ["0", "1.5", "4"]
    assert surface["kinds"] == ["MultiPolygon"]


@pytest.mark.parametrize("layer", ["lines", "overview"])
def test_only_tiles_in_view_are_read(tmp_path, layer):
    path = tmp_path / "tiles.iso"
    isocodec.save(path, Field(waves(300, 300), placement=MATRIX), [0.25, 1.0], tile=64)
    corners = place_of(np.array([[10.0, 10.0], [40.0, 40.0]]))
    box = [*corners.min(axis=0), *corners.max(axis=0)]
    (found,) = by_gdal({"path": path, "layer": layer, "box": box})
    assert found["layers"] == [["overview", "LineString"], ["lines", "LineString"]]
    inside = np.concatenate([np.array(line) for line in found["points"]])
    back = (inside - np.array(MATRIX)[:, 2]) @ np.linalg.inv(np.array(MATRIX)[:, :2]).T
    assert len(inside) and back.max() < 64
    if layer == "lines":
        # a line of whole tiles that passes the view is there with all of its points within
        whole = np.concatenate([line for contour in isocodec.open(path).contours() for line in contour.lines])
        whole = whole[((whole > 12) & (whole < 38)).all(axis=1)]
        assert {tuple(p) for p in np.round(whole, 6).tolist()} <= {tuple(p) for p in np.round(back, 6).tolist()}


def test_options_and_missing_samples_of_tiles(tmp_path):
    labels, mask = np.zeros((150, 150), np.int16), np.zeros((150, 150), bool)
    labels[20:100, 30:90], labels[60:140, 90:140], mask[50:60, 50:60] = 3, 5, True
    for name, field in {"labels": Field(labels, mask, labels="all"), "map": waves(150, 150)}.items():
        isocodec.save(tmp_path / f"{name}.iso", field, None if name == "labels" else [0.25, 1.0], tile=64)
    areas, lines, coarse, short = by_gdal(
        {"path": tmp_path / "labels.iso", "layer": "areas"}, {"path": tmp_path / "labels.iso", "layer": "lines"},
        {"path": tmp_path / "map.iso", "layer": "overview", "LAYERS": "1"},
        {"path": tmp_path / "map.iso", "layer": "overview", "MAX_BYTES": "400"},
    )
    file = isocodec.open(tmp_path / "labels.iso")
    whole = file.whole()
    wanted = [shapely.geometry.shape(each.areas(valid=whole.valid())).area
              for each in whole.contours(through_holes=True)]
    assert areas["areas"] == pytest.approx(wanted) and all(areas["valid"])
    assert sum(map(len, lines["points"])) == sum(len(line) for each in file.contours() for line in each.lines)
    tiled = isocodec.open(tmp_path / "map.iso")
    for seen, view in ((coarse, {"layers": 1}), (short, {"within": 2.0, "max_bytes": 400})):
        tiles = [contour for contours in tiled.each_tile(**view) for contour in contours]
        assert seen["points"] == [line[:, ::-1].tolist() for contour in tiles for line in contour.lines] != []


def test_what_a_filter_finds_are_the_features_of_the_whole(tmp_path):
    """Their numbers, too: by these programs select. An overview of few samples has all points of the lines."""
    path = tmp_path / "tiles.iso"
    isocodec.save(path, Field(waves(90, 90), placement=MATRIX), [0.25, 1.0], tile=32)
    corners = place_of(np.array([[0.0, 0.0], [31.0, 31.0]]))
    box = [*corners.min(axis=0), *corners.max(axis=0)]
    asked = [{"path": path, "layer": layer, **more} for layer in ("overview", "lines") for more in ({}, {"box": box})]
    every, seen, lines, _ = by_gdal(*asked)
    first = {number: line for number, line in zip(every["numbers"], every["points"], strict=True)
             if np.all(np.array(line) @ [[1], [0]] <= corners[:, 0].max() + 1e-6)}
    shared = first.keys() & {*seen["numbers"]}
    again = dict(zip(seen["numbers"], seen["points"], strict=True))
    assert shared and all(first[number] == again[number] for number in shared)
    assert {tuple(p) for line in lines["points"] for p in line} <= {tuple(p) for line in every["points"] for p in line}


def test_an_overview_is_as_fine_as_a_thousand_pixels(tmp_path):
    path = tmp_path / "wide.iso"
    isocodec.save(path, waves(40, 1500), 0.25, tile=64)
    (found,) = by_gdal({"path": path, "layer": "overview"})
    coarse, fine = ([contour.placed[walk].tolist() for contours in isocodec.open(path).each_tile(**view)
                     for contour in contours for walk in contour.walks] for view in ({"within": 2 * 1499 / 1000}, {}))
    assert found["points"] == coarse != fine


def test_files_that_end_too_early_open_where_fewer_bytes_are_asked_for(tmp_path):
    path = tmp_path / "cut.iso"
    data = isocodec.encode(waves(60, 80), 0.25)
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(AssertionError, match="ends"):
        by_gdal({"path": path, "layer": "lines"})
    (found,) = by_gdal({"path": path, "layer": "lines", "MAX_BYTES": str(len(data))})
    assert sum(map(len, found["points"])) == sum(map(len, isocodec.open(path).contour(partial=True).lines))


def test_other_files_are_left_to_others(tmp_path):
    path = tmp_path / "disc.iso"
    path.write_bytes(b"\0" * 40_000)
    with pytest.raises(AssertionError, match="not recognized"):
        by_gdal({"path": path, "layer": "lines"})
