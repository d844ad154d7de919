"""Lines, areas and bands as tables, and as files of geographic information systems: read back by geopandas."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError
from isocodec.field.placement import RAS, Placement
from isocodec.io import map_tables as tables
from isocodec.io.formats import Areas
from libraries import Late
from written_contents import PLACES, bumps, content, written

geopandas, pyogrio, pyproj, shapely = Late("geopandas"), Late("pyogrio"), Late("pyproj"), Late("shapely")
NAMED = [place for place, (_, crs) in PLACES.items() if crs is not None and place != "plane"]
BY_GDAL = (".gpkg", ".fgb", ".shp", ".gml", ".sqlite", ".gmt")
IN_DEGREES = (".geojson", ".geojsonl", ".geojsonseq", ".kml")


def back(path: Path) -> Any:
    table = (geopandas.read_parquet if path.suffix == ".parquet" else geopandas.read_file)(path)
    return table.set_geometry(geopandas.GeoSeries.from_wkt(table.WKT)) if path.suffix == ".csv" else table


def coordinates(shapes: Any, z: bool = False) -> np.ndarray:
    return shapely.get_coordinates(np.asarray(shapes), include_z=z)


def test_a_row_is_a_line_with_columns_of_choice() -> None:
    contour = content("curve", "utm")
    table = tables.lines([contour])
    assert list(table.columns) == ["isovalue", "closed", "complete", "geometry"] and len(table) == len(contour.walks)
    assert set(table.isovalue) == {80.5} and table.crs.to_epsg() == 32631
    assert table.closed.tolist() == [walk[0] == walk[-1] for walk in contour.walks]
    assert np.array_equal(coordinates(table.geometry), np.concatenate([contour.along(walk) for walk in contour.walks]))
    assert set(tables.lines(content("curves"), "height").height) == {60.5, 80.5}
    assert len(tables.lines([content("no curve")])) == 0
    field = isocodec.Field(np.digitize(bumps(), [30, 60]).astype(np.uint8), labels="all")
    assert "label" in tables.lines(isocodec.open(isocodec.encode(field)).contours())


def test_areas_and_bands_make_up_the_field() -> None:
    above, below = (tables.areas(content("curves", "utm"), side) for side in ("above", "below"))
    assert set(above.side) == {"above"} and set(below.side) == {"below"} and list(above.isovalue) == [60.5, 80.5]
    assert np.allclose(above.area + below.area, 24 * 30 * 30.0**2) and above.geometry.is_valid.all()
    bands = tables.areas(content("curves", "utm"), "bands", attribute="from_m,to_m")
    assert bands.area.sum() == pytest.approx(24 * 30 * 30.0**2)
    assert np.array_equal(bands.from_m, [np.nan, 60.5, 80.5], equal_nan=True)
    assert np.array_equal(bands.to_m, [60.5, 80.5, np.nan], equal_nan=True)


@pytest.mark.parametrize("name", ["geometry", "Closed", "FID", ""])
def test_names_that_are_taken_are_refused(name: str, tmp_path: Path) -> None:
    for what, attribute in (("curve", name), ("above", name), ("bands", f"{name},high"), ("bands", "high,High")):
        with pytest.raises(OptionError, match="--attribute"):
            written(tmp_path, ".gpkg", (what, "utm"), attribute=attribute)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("suffix", [*BY_GDAL, *IN_DEGREES, ".parquet", ".csv", ".dxf"])
@pytest.mark.parametrize("what", ["curve", "bands"])
def test_each_format_holds_lines_and_bands(tmp_path: Path, suffix: str, what: str) -> None:
    """And nothing, and equal contents as equal files."""
    path, _ = written(tmp_path, suffix, (what, "utm"))
    table, wanted = back(path), (tables.lines([content("curve", "utm")]) if what == "curve" else
                                 tables.areas(content("bands", "utm").contours, "bands"))
    shapes = table.geometry[~table.geometry.isna() & ~table.geometry.is_empty]
    kept = wanted[~wanted.geometry.is_empty]
    assert len(shapes) == len(kept.explode() if suffix == ".dxf" else kept) and shapes.is_valid.all()
    if suffix in (*BY_GDAL, ".parquet"):
        # some formats have 15 digits
        assert np.allclose(sorted(shapes.length), sorted(kept.length), rtol=1e-6) and table.crs.to_epsg() == 32631
    if suffix in IN_DEGREES:
        assert table.crs.to_epsg() in (4326, 4979)
        assert np.allclose(shapes.to_crs(32631).length, kept.length, rtol=1e-6)
    if what == "curve" and suffix != ".dxf":
        assert {float(value) for value in table.isovalue} == {80.5}
    before = path.read_bytes()
    path.unlink()
    if suffix != ".sqlite":
        assert written(tmp_path, suffix, (what, "utm"))[0].read_bytes() == before
        path.unlink()
    path, _ = written(tmp_path, suffix, ("no curve" if what == "curve" else "no areas", "utm"))
    if suffix in (".gpkg", ".fgb", ".shp", ".geojson"):
        assert len(back(path)) == (what == "bands")


def test_drawings_have_a_layer_for_each_isovalue_at_its_height(tmp_path: Path) -> None:
    table = back(written(tmp_path, ".dxf", ("curves", "utm"))[0])
    heights = {layer: set(coordinates(rows.geometry, True)[:, 2]) for layer, rows in table.groupby("Layer")}
    assert heights == {"ISO_60.5": {60.5}, "ISO_80.5": {80.5}}


@pytest.mark.parametrize("place", ["utm", "mirrored", "turned"])
def test_lines_have_higher_values_on_their_left(tmp_path: Path, place: str) -> None:
    at = coordinates([max(back(written(tmp_path, ".gpkg", ("curve", place))[0]).geometry, key=lambda one: one.length)])
    i = len(at) // 2
    way = at[i + 1] - at[i]
    step = 0.5 * np.sqrt(abs(np.linalg.det(PLACES[place][0][:, :2])))
    left = (at[i] + at[i + 1]) / 2 + step * np.array([-way[1], way[0]]) / np.linalg.norm(way)
    assert shapely.union_all(tables.areas([content("curve", place)]).geometry).contains(shapely.Point(left))


# ---- Longitude and latitude -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("place", "what"), [
    (place, what) for k, place in enumerate(NAMED) for what in ("above", "below", "bands")
    if "pole" in place or what != ("above", "below")[k % 2]])
def test_areas_in_longitude_and_latitude_cover_the_same(tmp_path: Path, place: str, what: str) -> None:
    """Samples of the globe lie in the area where they lie in the plane."""
    areas = content(what, place)
    table = back(written(tmp_path, ".geojson", areas)[0])
    flat = tables.areas(areas.contours, what)
    assert table.geometry.is_valid.all()
    assert (abs(table.total_bounds) <= [180, 90, 180, 90]).all()
    longitude, latitude = np.random.default_rng(3).random((2, 6000))
    west, south, east, north = table.total_bounds
    longitude, latitude = west + longitude * (east - west), south + latitude * (north - south)
    x, y = pyproj.Transformer.from_crs(4326, PLACES[place][1], always_xy=True).transform(longitude, latitude)
    if PLACES[place][1] == "EPSG:4326":
        x = np.where(x < 100, x + 360, x)
    for there, here in zip(table.geometry, flat.geometry, strict=True):
        inside = shapely.contains_xy(here, x, y)
        assert np.count_nonzero(shapely.contains_xy(there, longitude, latitude) != inside) <= 0.005 * len(x)
    if what == "below" and "pole" in place:
        pole = shapely.Point(33.0, 89.95 if place == "north pole" else -89.95)
        assert table.geometry.iloc[0].contains(pole)


@pytest.mark.parametrize("place", NAMED)
def test_lines_in_longitude_and_latitude_keep_their_points_and_make_no_step(tmp_path: Path, place: str) -> None:
    table = back(written(tmp_path, ".geojson", ("curve", place))[0])
    assert all(abs(np.diff(coordinates([line])[:, 0])).max() < 180 for line in table.geometry.explode())
    contour = content("curve", place)
    x, y = pyproj.Transformer.from_crs(PLACES[place][1], 4326, always_xy=True).transform(*contour.placed.T)
    points = coordinates(table.geometry)
    off = np.hypot(((points[:, 0] - x[:, None] + 180) % 360 - 180) * np.cos(np.radians(y[:, None])),
                   points[:, 1] - y[:, None])
    # but for the cut
    assert np.median(off.min(axis=1)) < 1e-9 and (off.min(axis=1) < 1e-9).mean() > 0.9
    if place in ("utm", "turned"):
        assert len(points) == sum(map(len, contour.walks))


@pytest.mark.parametrize("crs", ["EPSG:6931", "EPSG:6932"])
def test_rings_around_a_pole_keep_their_area(crs: str) -> None:
    """With and without the pole, in the middle of a map of equal areas or not, whole or with a hole."""
    y, x = np.mgrid[-40:41, -40:41] * 1.0
    for field, value in ((-abs(np.hypot(x, y) - 20), -8.3), (-np.hypot(x - 3.2, y + 1.7), -10.3)):
        placed = isocodec.Field(field, placement=Placement([[0, 1e5, -4e6], [-1e5, 0, 4e6]], crs=crs))
        contours = isocodec.open(isocodec.encode(placed, value, precision=0.01)).contours()
        for side in ("above", "below"):
            flat = tables.areas(contours, side)
            found = tables.degrees(flat, 1e5)
            fine = geopandas.GeoSeries(shapely.segmentize(found.geometry.to_numpy(), 0.5), crs=4326)
            assert found.geometry.is_valid.all()
            assert fine.to_crs("+proj=cea +ellps=WGS84").area.sum() == pytest.approx(flat.area.sum(), rel=2e-3)


def test_the_globe_from_0_to_360_is_cut_at_180(tmp_path: Path) -> None:
    """Also in another datum than WGS 84; one from -180 to 180 stays as it is."""
    field = np.cos(np.radians(np.mgrid[-80:81:4, 0:360:4]) * [[[1]], [[3]]]).prod(axis=0)
    for crs, west in (("EPSG:4326", 0), ("EPSG:4258", 0), ("EPSG:4326", -178)):
        placed = isocodec.Field(field, placement=Placement([[0, 4, west], [4, 0, -80]], crs=crs))
        (contour,) = isocodec.open(isocodec.encode(placed, 0.3)).contours()
        for what in (contour, Areas([contour], "below")):
            table = back(written(tmp_path, ".geojson", what)[0])
            assert (abs(table.total_bounds) <= [180, 90, 180, 90]).all() and table.geometry.is_valid.all()
        assert np.ptp(table.total_bounds[::2]) > 355
        assert table.area.sum() == pytest.approx(tables.areas([contour], "below").area.sum(), rel=1e-3)


# ---- What formats state ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("place", "word"), [("samples", "in samples"), ("unnamed", "does not name")])
def test_what_has_no_system_is_said(tmp_path: Path, place: str, word: str) -> None:
    for suffix in (".geojson", ".gpkg"):
        path, made = written(tmp_path, suffix, ("curve", place), layer="features")
        assert any(word in remark for remark in made.remarks)
        assert back(path).crs is None or not back(path).crs.is_geographic
    for suffix in (".kml", ".pmtiles"):
        with pytest.raises(OptionError, match="longitude and latitude"):
            written(tmp_path, suffix, ("curve", place))


def test_an_unknown_system_names_the_remedy(tmp_path: Path) -> None:
    """Also one that GDAL alone does not know."""
    satellite = pyproj.CRS.from_user_input("+proj=nsper +h=3000000 +lat_0=-20 +lon_0=145").to_wkt()
    for crs, suffixes, words in (("EPSG:999999", (".gpkg", ".geojson", ".parquet"), "no reference system"),
                                 (satellite, (".gpkg", ".shp"), r"GDAL does not know.*write \.parquet")):
        contour = content("curve", "utm")
        contour = dataclasses.replace(contour, placement=dataclasses.replace(contour.placement, crs=crs))
        for suffix in suffixes:
            with pytest.raises(OptionError, match=words):
                written(tmp_path, suffix, contour)
    written(tmp_path, ".parquet", contour)


@pytest.mark.parametrize("suffix", [".geojson", ".fgb", ".parquet"])
@pytest.mark.parametrize("upright", [False, True])
def test_planes_in_a_body_have_heights_and_whole_areas(tmp_path: Path, suffix: str, upright: bool) -> None:
    """An upright plane is a line, seen from above: none of its areas is lost, and all are valid within the plane."""
    x = np.array([[0.6, 0, 3], [0, 0.0 if upright else 0.7, -2], [0, 0.8, 9.1]])
    field = np.random.default_rng(0).integers(0, 9, (30, 40))
    file = isocodec.open(isocodec.encode(isocodec.Field(field, placement=Placement(x, crs=RAS)), [2.5, 6.5]))
    path, _ = written(tmp_path, suffix, Areas(file.contours(), "bands"))
    shapes, back_to = back(path).geometry, np.linalg.pinv(x[:, :2]).T
    flat = shapely.transform(shapely.force_3d(shapes.to_numpy()), lambda at: np.pad((at - x[:, 2]) @ back_to, (
        (0, 0), (0, 1))), include_z=True)
    assert shapes.has_z.all() and shapely.is_valid(flat).all()
    assert shapely.area(flat).sum() == pytest.approx(29 * 39)
    if suffix == ".geojson":
        assert json.loads(path.read_text())["space"] == RAS


@pytest.mark.parametrize("seed", [8, 24, 57])
def test_bands_on_turned_planes_are_valid(seed: int) -> None:
    """From above and within the plane, where the last digits of coordinates would make rings touch."""
    rng = np.random.default_rng(seed)
    field = rng.integers(0, 9, rng.integers(6, 31, 2))
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0][:, :2] * rng.uniform(0.3, 3, 2)
    corner = rng.uniform(-200, 200, 3)
    placed = isocodec.Field(field, placement=Placement(np.column_stack([axes, corner]), crs=RAS))
    shapes = tables.areas(isocodec.open(isocodec.encode(placed, [2.5, 6.5])).contours(), "bands").geometry
    flat = shapely.transform(shapes.to_numpy(), lambda at: np.pad((at - corner) @ np.linalg.pinv(axes).T, (
        (0, 0), (0, 1))), include_z=True)
    assert shapes.is_valid.all() and shapely.is_valid(flat).all()
    assert shapely.area(flat).sum() == pytest.approx(np.prod(np.subtract(field.shape, 1)))


@pytest.mark.parametrize("suffix", [".pmtiles", ".mbtiles"])
def test_tiles_show_a_sample_as_a_pixel(tmp_path: Path, suffix: str) -> None:
    path, _ = written(tmp_path, suffix, ("curves", "utm"))
    table, wanted = back(path), tables.lines(content("curves", "utm")).to_crs(3857)
    assert table.crs.to_epsg() == 3857 and set(table.isovalue) == {60.5, 80.5}
    assert np.allclose(table.total_bounds, wanted.total_bounds, atol=60), "two pixels"
    zoom = int(pyogrio.read_info(path)["dataset_metadata"].get("ZOOM_LEVEL", tables.zoom_of(wanted)))
    assert 40075017 / 256 / 2**zoom <= 2 * 30 / np.cos(np.radians(45))
    assert list(pyogrio.list_layers(path)[:, 0]) == ["isolines"]
    with pytest.raises(OptionError, match="nothing to show"):
        written(tmp_path, suffix, ("no areas", "utm"))


def test_other_layers_of_a_geopackage_stay(tmp_path: Path) -> None:
    path, _ = written(tmp_path, ".gpkg", ("curve", "utm"), layer="old")
    written(tmp_path, ".gpkg", ("above", "utm"))
    written(tmp_path, ".gpkg", ("curves", "utm"), layer="old")
    assert set(geopandas.list_layers(path).name) == {"old", "areas"}
    assert set(geopandas.read_file(path, layer="old").isovalue) == {60.5, 80.5}
    path.write_bytes(b"something else")
    with pytest.raises(InputError, match=rf"{path.name} exists, and is no GeoPackage.*write to another name"):
        written(tmp_path, ".gpkg", ("curve", "utm"))
    assert path.read_bytes() == b"something else" and [*tmp_path.iterdir()] == [path]


def test_triangles_are_rows_too(tmp_path: Path) -> None:
    table = back(written(tmp_path, ".gpkg", ("mesh", "utm"))[0])
    assert len(table) == len(content("mesh", "utm").cells) and set(table.above) <= {0, 1, 2, 3} and "level" in table
    surface = back(written(tmp_path, ".geojson", ("tin", "utm"))[0])
    assert len(surface) == len(content("tin", "utm").triangles) and surface.geometry.has_z.all()
