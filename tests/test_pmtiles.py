"""Maps of vector tiles, read back with the libraries of both formats."""

from __future__ import annotations

import gzip
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
from scipy.spatial import KDTree

import isocodec
from commands import fails, ok
from isocodec.io.writers.to_pmtiles import EXTENT, cut
from tiled import encoded, hilly, tiled_of
from written import rendered

mapbox_vector_tile = pytest.importorskip("mapbox_vector_tile")
reader = pytest.importorskip("pmtiles.reader")

UTM = [[0.0, 30, 5e5], [-20, 0, 5e6]]
CRS = {"crs": "EPSG:32631"}
TO_MERCATOR = pyproj.Transformer.from_crs(32631, 3857, always_xy=True)
HALF = math.pi * 6378137


def render(contours: list[isocodec.Contour]) -> bytes:
    return rendered(contours, ".pmtiles")


def mercator(contour: isocodec.Contour) -> np.ndarray:
    """Points in units of the world's width, by pyproj."""
    x, y = TO_MERCATOR.transform(*contour.placed.T)
    return np.stack([(np.array(x) + HALF) / 2 / HALF, (HALF - np.array(y)) / 2 / HALF], axis=1)


def opened(data: bytes) -> tuple[dict[str, Any], dict[tuple[int, int, int], dict[str, Any]]]:
    """Header, and the tiles as the libraries read them."""

    def get(offset: int, length: int) -> bytes:
        return data[offset : offset + length]

    archive = reader.Reader(get)
    tiles = {}
    for key, packed in reader.all_tiles(get):
        assert archive.get(*key) == packed
        tiles[key] = mapbox_vector_tile.decode(gzip.decompress(packed), default_options={"y_coord_down": True})
    return archive.header(), tiles


def lines_of(feature: dict[str, Any]) -> list[np.ndarray]:
    shape = feature["geometry"]
    lines = shape["coordinates"] if shape["type"] == "MultiLineString" else [shape["coordinates"]]
    return [np.array(line) for line in lines]


def test_points_lie_where_they_lie() -> None:
    """At the largest zoom, within half a unit, both ways; every segment; each isovalue with its own."""
    field = hilly()
    data = isocodec.encode(isocodec.Field(field, placement=UTM), [30.5, 60.5], metadata=CRS)
    contours = isocodec.open(data).contours()
    header, tiles = opened(render(contours))
    most = header["max_zoom"]
    for contour in contours:
        found: set[tuple[tuple[int, int], tuple[int, int]]] = set()
        for (z, x, y), tile in tiles.items():
            if z != most:
                continue
            for feature in tile["contours"]["features"]:
                if feature["properties"]["isovalue"] == contour.isovalue:
                    for line in lines_of(feature):
                        whole = line + np.array([x, y]) * EXTENT
                        for a, b in zip(whole[:-1].tolist(), whole[1:].tolist(), strict=True):
                            found.add((tuple(a), tuple(b)))
        wanted = mercator(contour) * (EXTENT << most)
        whole = np.array(list(found)).reshape(-1, 2)
        assert KDTree(whole).query(wanted)[0].max() <= math.sqrt(0.5) + 0.01
        assert KDTree(wanted).query(whole)[0].max() <= math.sqrt(0.5) + 0.01
        # pyproj and the archive may round a point to neighbouring units
        ends = np.array(list(found)).reshape(-1, 4)
        assert KDTree(ends).query(wanted[contour.cells].reshape(-1, 4))[0].max() <= 1.01


def test_zooms_and_bounds(tmp_path: Path) -> None:
    """A pixel is a sample wide at the largest zoom; the archive says where the curve is; low zooms show it, too."""
    field = hilly()
    contour = isocodec.decode(isocodec.encode(isocodec.Field(field, placement=UTM), 30.5, metadata=CRS))
    header, tiles = opened(render([contour]))
    step = 20 / math.cos(math.radians(45.15)) / 2 / HALF  # metres of a row, on the ground and in Mercator
    pixel = 1 / 256 / 2 ** header["max_zoom"]
    assert step / 2 <= pixel <= step * 1.01
    assert header["min_zoom"] == 0
    degrees = pyproj.Transformer.from_crs(32631, 4326, always_xy=True).transform(*contour.placed.T)
    for axis, name in enumerate(("lon", "lat")):
        assert header[f"min_{name}_e7"] == pytest.approx(np.min(degrees[axis]) * 1e7, abs=20)
        assert header[f"max_{name}_e7"] == pytest.approx(np.max(degrees[axis]) * 1e7, abs=20)
    # the curve is some 4 km wide, a unit of a tile of the world 10 km
    assert {z for z, _, _ in tiles} >= set(range(2, header["max_zoom"] + 1))
    assert render([contour]) == render([contour])


def test_coarse_layers_at_low_zooms(tmp_path: Path) -> None:
    """Of a file in tiles: where a pixel is 16 samples wide the curve of the first layer, and far fewer points."""
    x, y = np.meshgrid(np.arange(600), np.arange(700), indexing="ij")
    field = np.sin(x / 9) * np.cos(y / 7) + x / 900
    data = encoded(tmp_path, isocodec.Field(field, placement=UTM), 0.25, tile=128, metadata=CRS)
    (tmp_path / "t.iso").write_bytes(data)
    facts = json.loads(ok("decode", tmp_path / "t.iso", "-o", tmp_path / "map.pmtiles", "--json"))
    made = (tmp_path / "map.pmtiles").read_bytes()
    assert facts["bytes"] == len(made)
    header, tiles = opened(made)
    file = tiled_of(data)
    most = header["max_zoom"]
    for zoom, layer in ((most, None), (most - 2, 1), (most - 4, 0)):
        wanted = mercator(file.window(layer=layer)) * (EXTENT << zoom)
        found = [
            line + np.array([x, y]) * EXTENT
            for (z, x, y), tile in tiles.items() if z == zoom
            for feature in tile["contours"]["features"] for line in lines_of(feature)
        ]
        # all points are the layer's, rounded; those left out lie on lines between others
        assert KDTree(wanted).query(np.concatenate(found))[0].max() <= math.sqrt(0.5) + 0.01


def test_nothing_to_see_and_nowhere(tmp_path: Path) -> None:
    header, tiles = opened(
        render([isocodec.decode(isocodec.encode(isocodec.Field(np.zeros((9, 9)), placement=UTM), 1, metadata=CRS))])
    )
    assert list(tiles) == [(0, 0, 0)] and header["max_zoom"] == 0
    (tmp_path / "a.iso").write_bytes(isocodec.encode(hilly(), 30.5))
    assert "reference system" in fails(2, "decode", tmp_path / "a.iso", "-o", tmp_path / "a.pmtiles")
    (tmp_path / "a.iso").write_bytes(encoded(tmp_path, isocodec.Field(hilly(), placement=UTM), 30.5))
    assert "reference system" in fails(2, "decode", tmp_path / "a.iso", "-o", tmp_path / "a.pmtiles")
    (tmp_path / "b.iso").write_bytes(isocodec.encode(np.mgrid[:9, :9, :9][0], 3.5))
    assert "cannot hold" in fails(2, "decode", tmp_path / "b.iso", "-o", tmp_path / "a.pmtiles")


def test_lines_over_tiles_and_round_the_world() -> None:
    """By hand: a line goes on in the buffers of tiles, and beyond the last column in the first one."""
    got = dict(cut([np.array([[0.49, 0.25], [0.51, 0.25]])], 1, 0))
    assert set(got) == {(1, 0, 0), (1, 1, 0)}
    (left,), (right,) = got[1, 0, 0], got[1, 1, 0]
    assert left.tolist() == [[4014, 2048], [4178, 2048]] and right.tolist() == [[-82, 2048], [82, 2048]]
    got = dict(cut([np.array([[0.999, 0.6], [1.001, 0.6]])], 3, 0))
    assert set(got) == {(3, 7, 4), (3, 0, 4)}
    # a long segment is divided, and every column has its part
    got = dict(cut([np.array([[0.01, 0.6], [0.99, 0.6]])], 3, 0))
    assert set(got) == {(3, x, 4) for x in range(8)}
    assert all(np.abs(line).max() <= 4096 + 64 + 1024 for lines in got.values() for line in lines)
    # less than a unit: nothing is left
    assert not dict(cut([np.array([[0.5, 0.5], [0.50001, 0.5]])], 0, 0))
