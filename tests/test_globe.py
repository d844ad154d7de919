"""Longitudes and latitudes of lines and areas: cut at 180 degrees, closed over poles; points asked one by one."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import antimeridian
import numpy as np
import pyproj
import pytest
import shapely

import isocodec
from commands import fails, ok
from isocodec.drawing.globe import Globe, ragged, rounded, rounded_areas
from written import rendered

FAR = np.hypot(*np.mgrid[-50:51, -50:51])
HILL, RING = 100 - FAR, -abs(FAR - 35)


def map_of(x: float, dx: float, y: float, dy: float) -> np.ndarray:
    return np.array([[0, dx, x], [dy, 0, y]])


def projected(text: str) -> str:
    return str(pyproj.CRS(text).to_wkt())


LAEA = projected("+proj=laea +lat_0=10 +lon_0=20 +R=6371000")
PLACES: dict[str, tuple[str, np.ndarray]] = {
    "UTM 60": ("EPSG:32660", map_of(44e4, 4e3, 74e5, -4e3)),
    "UTM 1": ("EPSG:32601", map_of(16e4, 4e3, 74e5, -4e3)),
    "around the north pole": ("EPSG:3413", map_of(-2e6, 4e4, 2e6, -4e4)),
    "around the south pole": ("EPSG:3031", map_of(-2e6, 4e4, 2e6, -4e4)),
    "beside the north pole": ("EPSG:3413", map_of(-1e6, 4e4, 2.5e6, -4e4)),
    "beside the south pole": ("EPSG:3031", map_of(-3.1e6, 4e4, 2e6, -4e4)),
    "mirrored": ("EPSG:3413", map_of(-2e6, 4e4, -2e6, 4e4)),
    "both poles": (LAEA, map_of(-85e5, 1.7e5, 85e5, -1.7e5)),
    "longitudes to 360": ("EPSG:4326", map_of(0, 3.6, 85, -1.7)),
    "longitudes to 360, another datum": ("EPSG:4267", map_of(0, 3.6, 85, -1.7)),
    "beyond 180": ("EPSG:4326", map_of(190, 1, 60, -1)),
    "the whole globe": ("EPSG:4087", map_of(-2e7, 4e5, 85e5, -1.7e5)),
    "Mercator": ("EPSG:3832", map_of(-2e6, 4e4, 2e6, -4e4)),
    "Lambert": ("EPSG:32198", map_of(-1e6, 2e4, 12e5, -2e4)),
}


@cache
def contour(place: str, field: str) -> isocodec.Contour:
    crs, matrix = PLACES[place]
    values, isovalue = (HILL, 70.0) if field == "hill" else (RING, -10.0)
    return isocodec.decode(isocodec.encode(isocodec.Field(values, placement=matrix, crs=crs), isovalue))


@pytest.mark.parametrize("side", ["above", "below"])
@pytest.mark.parametrize("field", ["hill", "ring"])
@pytest.mark.parametrize("place", PLACES)
def test_areas_hold_what_they_hold(place: str, field: str, side: str) -> None:
    """Places within the field lie in the areas of the file as they do in the projection."""
    crs, matrix = PLACES[place]
    curve = contour(place, field)
    before = shapely.geometry.shape(curve.areas(above=side == "above"))
    feature = json.loads(rendered(isocodec_areas(curve, side), ".geojson"))
    area = shapely.geometry.shape(feature["geometry"])
    assert "crs" not in feature and area.is_valid
    west, south, east, north = area.bounds
    assert -180 <= west < east <= 180 and -90 <= south < north <= 90
    assert all(part.exterior.is_ccw and not any(ring.is_ccw for ring in part.interiors) for part in area.geoms)
    places = np.random.default_rng(0).uniform(0, 100, (1500, 2)) @ matrix[:, :2].T + matrix[:, 2]
    lon, lat = pyproj.Transformer.from_crs(crs, 4326, always_xy=True).transform(*places.T)
    clear = shapely.distance(before.boundary, shapely.points(places)) > 0.05 * np.linalg.norm(matrix[:, 0])
    inside = shapely.contains_xy(before, *places.T)
    assert np.array_equal(shapely.contains_xy(area, (lon + 180) % 360 - 180, lat)[clear], inside[clear])


def isocodec_areas(curve: isocodec.Contour, side: str) -> Any:
    from isocodec.io.writers.things import Areas

    return Areas([curve], side)


@pytest.mark.parametrize("field", ["hill", "ring"])
@pytest.mark.parametrize("place", [
    name for name in PLACES if PLACES[name][0] not in ("EPSG:4326", "EPSG:4267") and name != "mirrored"
])
def test_areas_as_of_another_library(place: str, field: str) -> None:
    curve = contour(place, field)
    globe = Globe.of(curve.placement, curve.placed, curve.cells)
    before = shapely.geometry.shape(curve.areas())
    fine = shapely.segmentize(before, globe.cell / 8)
    degrees = shapely.MultiPolygon([*getattr(moved := shapely.transform(fine, globe.move), "geoms", [moved])])
    other = shapely.make_valid(antimeridian.fix_multi_polygon(degrees, fix_winding=False, great_circle=False))
    own = shapely.union_all(globe.areas(shapely.get_parts(before)))
    # it lets lines of the projection be straight beside a pole
    assert shapely.symmetric_difference(other, own).area < 0.02 * own.area


@pytest.mark.parametrize("field", ["hill", "ring"])
@pytest.mark.parametrize("place", PLACES)
def test_lines_are_cut(place: str, field: str) -> None:
    """All points are there, others lie on lines of the projection; no line goes round the globe."""
    crs, matrix = PLACES[place]
    curve = contour(place, field)
    lines = [np.array(line) for line in json.loads(rendered(curve, ".geojson"))["geometry"]["coordinates"]]
    assert all(len(line) > 1 and abs(np.diff(line[:, 0])).max() < 180 for line in lines)
    points = np.concatenate(lines)
    assert abs(points[:, 0]).max() <= 180
    x, y = pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(*points.T)
    if crs in ("EPSG:4326", "EPSG:4267"):
        x = np.where(x < matrix[0, 2] - 1e-6, x + 360, x)
    back = shapely.distance(shapely.MultiLineString(list(curve.placed[curve.cells])), shapely.points(x, y))
    assert back.max() < 0.02 * np.linalg.norm(matrix[:, 0])


def test_numbers_of_decimals() -> None:
    """Points that fall together are one, and what has no length or area is left out."""
    points, starts = ragged([np.array([[0.123456, 1], [0.123457, 1], [5, 5]]), np.array([[1.0001, 2], [1.0002, 2]])])
    points, starts = rounded(points, starts, 3)
    assert points.tolist() == [[0.123, 1], [5, 5]] and starts.tolist() == [0, 2]
    shape = shapely.MultiPolygon([shapely.box(0.12345, 0, 3.00004, 1), shapely.box(5, 5, 5.001, 5.001)])
    made = rounded_areas(shape, 1)
    assert made.is_valid and made.area == pytest.approx(2.9) and "0.1 " in made.wkt
    assert rounded(*ragged([]), 3)[1].tolist() == [0]


def test_beyond_a_pole_is_no_latitude(tmp_path: Path) -> None:
    """An error by name instead of a latitude of 95 degrees."""
    field = isocodec.Field(HILL, placement=map_of(0, 0.5, 120, -0.5), crs="EPSG:4326")
    (tmp_path / "a.iso").write_bytes(isocodec.encode(field, 70.0))
    assert "beyond a pole" in fails(2, "decode", tmp_path / "a.iso", "-o", tmp_path / "a.geojson")
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.geojson", "--keep-crs")


def test_precision_on_the_command_line(tmp_path: Path) -> None:
    crs, matrix = PLACES["UTM 60"]
    (tmp_path / "a.iso").write_bytes(isocodec.encode(isocodec.Field(HILL, placement=matrix, crs=crs), 70.0))
    for what in ("curve", "areas"):
        ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.geojson", "--precision", 3, "--what", what)
        text = (tmp_path / "a.geojson").read_text()
        shape = shapely.geometry.shape(json.loads(text)["geometry"])
        points = shapely.get_coordinates(shape)
        assert shape.is_valid and len(points) > 100 and np.array_equal(np.round(points, 3), points)
        assert "00000" not in text and "99999" not in text
    assert "--precision" in fails(2, "decode", tmp_path / "a.iso", "-o", tmp_path / "a.gpkg", "--precision", 3)
