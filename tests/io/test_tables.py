"""Lines, areas and bands as tables, and as files of geographic information systems: read back by geopandas."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError
from isocodec.io import map_tables as tables
from written_contents import PLACES, bumps, content, plane, written

NAMED = [place for place, (_, crs) in PLACES.items() if crs is not None and place != "plane"]
CLOSE = 60.0
"""Metres of two pixels."""
BY_GDAL = (".gpkg", ".fgb", ".shp", ".gml", ".sqlite", ".gmt")


def back(path: Path) -> Any:
    import geopandas

    return (geopandas.read_parquet if path.suffix == ".parquet" else geopandas.read_file)(path)


def coordinates(shapes: Any, z: bool = False) -> np.ndarray:
    import shapely

    return shapely.get_coordinates(np.asarray(shapes), include_z=z)


def test_a_row_is_a_line() -> None:
    contour = content("curve", "utm")
    table = tables.lines([contour])
    assert list(table.columns) == ["isovalue", "closed", "complete", "geometry"] and len(table) == len(contour.walks)
    assert set(table.isovalue) == {80.5} and table.crs.to_epsg() == 32631
    assert table.closed.tolist() == [walk[0] == walk[-1] for walk in contour.walks]
    assert np.array_equal(coordinates(table.geometry), np.concatenate([contour.along(walk) for walk in contour.walks]))


def test_several_isovalues_with_other_names_and_index_lines() -> None:
    table = tables.lines(content("curves"), "height", index=[80.5])
    assert set(table.height) == {60.5, 80.5} and (table["index"] == (table.height == 80.5)).all()


def test_a_table_without_lines_has_its_columns() -> None:
    table = tables.lines([content("no curve")])
    assert len(table) == 0 and "isovalue" in table


@pytest.mark.parametrize("side", ["above", "below"])
def test_areas_make_up_the_field(side: str) -> None:
    table = tables.areas(content("curves", "utm"), side)
    assert set(table.side) == {side} and table.geometry.is_valid.all() and list(table.isovalue) == [60.5, 80.5]
    if side == "above":
        other = tables.areas(content("curves", "utm"), "below")
        assert np.allclose(table.area + other.area, 24 * 30 * 30.0**2)


def test_bands_make_up_the_field_under_names_of_choice() -> None:
    table = tables.areas(content("curves", "utm"), "bands", attribute="from_m,to_m")
    assert table.area.sum() == pytest.approx(24 * 30 * 30.0**2)
    assert np.array_equal(table.from_m, [np.nan, 60.5, 80.5], equal_nan=True)
    assert np.array_equal(table.to_m, [60.5, 80.5, np.nan], equal_nan=True)


@pytest.mark.parametrize("name", ["geometry", "closed", "Index", "FID", ""])
def test_names_that_are_taken_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="--attribute"):
        tables.lines([content("curve")], name)
    with pytest.raises(OptionError, match="--attribute"):
        written(tmp_path, ".gpkg", ("curve", "utm"), attribute=name)
    with pytest.raises(OptionError):
        tables.areas(content("curves"), "bands", attribute=f"{name or chr(97)},{name or chr(65)}")
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("suffix", [*BY_GDAL, ".parquet", ".geojson", ".geojsonl", ".geojsonseq", ".csv", ".kml",
                                    ".dxf"])
@pytest.mark.parametrize("what", ["curve", "bands"])
def test_each_format_holds_lines_and_bands(tmp_path: Path, suffix: str, what: str) -> None:
    path, _ = written(tmp_path, suffix, (what, "utm"))
    table, wanted = back(path), tables.lines([content("curve", "utm")]) if what == "curve" else tables.areas(side="bands", contours=
        content("bands", "utm").contours)
    if suffix == ".csv":
        import geopandas

        table = table.set_geometry(geopandas.GeoSeries.from_wkt(table.WKT))
    shapes = table.geometry[~table.geometry.isna() & ~table.geometry.is_empty]
    kept = wanted[~wanted.geometry.is_empty]
    assert len(shapes) == len(kept.explode() if suffix == ".dxf" else kept) and shapes.is_valid.all()
    if suffix in (*BY_GDAL, ".parquet"):
        # some formats have 15 digits
        assert np.allclose(sorted(shapes.length), sorted(kept.length), rtol=1e-6) and table.crs.to_epsg() == 32631
    if suffix in (".geojson", ".geojsonl", ".geojsonseq", ".kml"):
        assert table.crs.to_epsg() in (4326, 4979)
        assert np.allclose(shapes.to_crs(32631).length, kept.length, rtol=1e-6)
    if what == "curve" and suffix != ".dxf":
        assert {float(value) for value in table.isovalue} == {80.5}


def test_drawings_have_a_layer_for_each_isovalue_at_its_height(tmp_path: Path) -> None:
    table = back(written(tmp_path, ".dxf", ("curves", "utm"))[0])
    assert set(table.Layer) == {"ISO_60.5", "ISO_80.5"}
    heights = {layer: set(coordinates(rows.geometry, True)[:, 2]) for layer, rows in table.groupby("Layer")}
    assert heights == {"ISO_60.5": {60.5}, "ISO_80.5": {80.5}}


def test_lines_have_higher_values_on_their_left(tmp_path: Path) -> None:
    import shapely

    for place in ("utm", "mirrored", "turned"):
        path, _ = written(tmp_path, ".gpkg", ("curve", place))
        line = max(back(path).geometry, key=lambda one: one.length)
        matrix = PLACES[place][0]
        step = 0.05 * np.sqrt(abs(np.linalg.det(matrix[:, :2])))
        at = coordinates([line])
        i = len(at) // 2
        way = at[i + 1] - at[i]
        left = (at[i] + at[i + 1]) / 2 + 10 * step * np.array([-way[1], way[0]]) / np.linalg.norm(way)
        area = shapely.union_all(tables.areas([content("curve", place)]).geometry)
        assert area.contains(shapely.Point(left)), place


@pytest.mark.parametrize("place", NAMED)
@pytest.mark.parametrize("what", ["above", "below", "bands"])
def test_areas_in_longitude_and_latitude_cover_the_same(tmp_path: Path, place: str, what: str) -> None:
    """Samples of the globe lie in the area where they lie in the plane."""
    import pyproj
    import shapely

    areas = content(what, place)
    table = back(written(tmp_path, ".geojson", areas)[0])
    flat = tables.areas(areas.contours, "bands") if what == "bands" else tables.areas(areas.contours, what)
    assert table.geometry.is_valid.all()
    assert (abs(table.total_bounds) <= [180, 90, 180, 90]).all()
    longitude, latitude = np.random.default_rng(3).random((2, 20000))
    west, south, east, north = table.total_bounds
    longitude, latitude = west + longitude * (east - west), south + latitude * (north - south)
    x, y = pyproj.Transformer.from_crs(4326, PLACES[place][1], always_xy=True).transform(longitude, latitude)
    if PLACES[place][1] == "EPSG:4326":
        x = np.where(x < 100, x + 360, x)
    for there, here in zip(table.geometry, flat.geometry, strict=True):
        inside = shapely.contains_xy(here, x, y)
        assert np.count_nonzero(shapely.contains_xy(there, longitude, latitude) != inside) <= 0.005 * len(x)


@pytest.mark.parametrize("place", NAMED)
def test_lines_in_longitude_and_latitude_make_no_step_around_the_globe(tmp_path: Path, place: str) -> None:
    table = back(written(tmp_path, ".geojson", ("curve", place))[0])
    for line in table.geometry.explode():
        assert abs(np.diff(coordinates([line])[:, 0])).max() < 180


def test_an_area_around_a_pole_holds_the_pole(tmp_path: Path) -> None:
    import shapely

    for place, latitude in (("north pole", 89.95), ("south pole", -89.95)):
        table = back(written(tmp_path, ".geojson", ("below", place))[0])
        assert table.geometry.iloc[0].contains(shapely.Point(33.0, latitude))


def test_a_system_can_be_kept(tmp_path: Path) -> None:
    path, made = written(tmp_path, ".geojson", ("curve", "utm"), keep_crs=True)
    assert back(path).crs.to_epsg() == 32631 and not made.remarks
    wanted = tables.lines([content("curve", "utm")])
    assert np.array_equal(coordinates(back(path).geometry), coordinates(wanted.geometry))


@pytest.mark.parametrize(("place", "word"), [("samples", "in samples"), ("unnamed", "does not name")])
def test_what_has_no_system_is_said(tmp_path: Path, place: str, word: str) -> None:
    for suffix in (".geojson", ".gpkg"):
        path, made = written(tmp_path, suffix, ("curve", place))
        assert any(word in remark for remark in made.remarks)
        assert back(path).crs is None or not back(path).crs.is_geographic
    for suffix in (".kml", ".pmtiles"):
        with pytest.raises(OptionError, match="longitude and latitude"):
            written(tmp_path, suffix, ("curve", place))


def test_a_plane_in_a_body_has_heights_and_names_its_space(tmp_path: Path) -> None:
    path, _ = written(tmp_path, ".geojson", ("bands", "plane"))
    assert json.loads(path.read_text())["space"] == "right-anterior-superior"
    assert back(path).geometry.has_z.all()
    assert back(written(tmp_path, ".fgb", ("bands", "plane"))[0]).geometry.has_z.all()


@pytest.mark.parametrize("suffix", [".pmtiles", ".mbtiles"])
def test_tiles_show_a_sample_as_a_pixel(tmp_path: Path, suffix: str) -> None:
    import pyogrio

    path, _ = written(tmp_path, suffix, ("curves", "utm"))
    table = back(path)
    wanted = tables.lines(content("curves", "utm")).to_crs(3857)
    assert table.crs.to_epsg() == 3857 and set(table.isovalue) == {60.5, 80.5}
    assert np.allclose(table.total_bounds, wanted.total_bounds, atol=CLOSE)
    zoom = int(pyogrio.read_info(path)["dataset_metadata"].get("ZOOM_LEVEL", tables.zoom_of(wanted)))
    assert 40075017 / 256 / 2**zoom <= 2 * 30 / np.cos(np.radians(45))
    assert list(pyogrio.list_layers(path)[:, 0]) == ["isolines"]





def test_other_layers_of_a_geopackage_stay(tmp_path: Path) -> None:
    import geopandas

    path, _ = written(tmp_path, ".gpkg", ("curve", "utm"), layer="old")
    written(tmp_path, ".gpkg", ("above", "utm"))
    written(tmp_path, ".gpkg", ("curves", "utm"), layer="old")
    assert set(geopandas.list_layers(path).name) == {"old", "areas"}
    assert set(geopandas.read_file(path, layer="old").isovalue) == {60.5, 80.5}


def test_what_is_no_geopackage_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    path.write_bytes(b"something else")
    with pytest.raises(InputError, match="no GeoPackage"):
        written(tmp_path, ".gpkg", ("curve", "utm"))
    assert path.read_bytes() == b"something else" and len([*tmp_path.iterdir()]) == 1


def test_empty_areas_have_a_row(tmp_path: Path) -> None:
    for suffix in (".gpkg", ".fgb", ".shp", ".geojson"):
        assert len(back(written(tmp_path, suffix, ("no areas", "utm"))[0])) == 1
    with pytest.raises(OptionError, match="nothing to show"):
        written(tmp_path, ".pmtiles", ("no areas", "utm"))


def test_an_unknown_system_names_the_remedy(tmp_path: Path) -> None:
    import dataclasses

    contour = content("curve", "utm")
    contour = dataclasses.replace(contour, placement=dataclasses.replace(contour.placement, crs="EPSG:999999"))
    for suffix in (".gpkg", ".geojson", ".parquet"):
        with pytest.raises(OptionError, match="no reference system"):
            written(tmp_path, suffix, contour)


def test_equal_contents_give_equal_files(tmp_path: Path) -> None:
    for suffix in (".gpkg", ".shp", ".fgb", ".geojson"):
        before = written(tmp_path, suffix, ("curve", "utm"))[0].read_bytes()
        (tmp_path / f"a{suffix}").unlink()
        assert written(tmp_path, suffix, ("curve", "utm"))[0].read_bytes() == before


def test_labels_have_their_own_column(tmp_path: Path) -> None:
    field = isocodec.Field(np.digitize(bumps(), [30, 60]).astype(np.uint8), labels="all")
    file = isocodec.open(isocodec.encode(field))
    table = back(written(tmp_path, ".gpkg", file.contours())[0])
    assert "label" in table and set(table.label) <= {1.0, 2.0}


def test_triangles_are_rows_too(tmp_path: Path) -> None:
    table = back(written(tmp_path, ".gpkg", ("mesh", "utm"))[0])
    assert len(table) == len(content("mesh", "utm").cells) and set(table.above) <= {0, 1, 2, 3} and "level" in table
    surface = back(written(tmp_path, ".geojson", ("tin", "utm"))[0])
    assert len(surface) == len(content("tin", "utm").triangles) and surface.geometry.has_z.all()


def test_objects_of_a_contour() -> None:
    contour = plane("utm").contours()[1]
    assert len(contour.to_geodataframe()) == len(contour.walks)
    data, about, kind = contour.to_napari()
    assert kind == "shapes" and about["shape_type"] == "path" and len(data) == len(contour.lines)
