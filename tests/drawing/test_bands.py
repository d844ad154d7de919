"""Areas between isovalues: they make up the box, and samples lie in the band of their value; shapely says where."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import HILLS, ok
from files import picture
from libraries import Late
from tables import looped

geopandas = Late("geopandas")
shapely = Late("shapely")

VALUES = [60.5, 100.5, 20.5, 140.5]
UTM = np.array([[0.0, 30, 5e5], [-20, 0, 5e6]])


def shapes(found: list[isocodec.Band]) -> list[shapely.Geometry]:
    return [shapely.geometry.shape(band.geometry) for band in found]


@pytest.mark.parametrize("options", [{"precision": "exact"}, {}, {"precision": "signs"}])
def test_bands(options: dict[str, bool]) -> None:
    for field, values in ((HILLS, VALUES), (picture((25, 31), 5, noise=0.4), [-20.5, 0.5, 10.5])):
        found = isocodec.bands(isocodec.open(isocodec.encode(field, values, **options)).contours())
        rising = sorted(values)
        assert [(band.lower, band.upper) for band in found] == list(zip([None, *rising], [*rising, None], strict=True))
        parts = shapes(found)
        assert all(part.is_valid for part in parts)
        rows, columns = field.shape
        assert sum(part.area for part in parts) == pytest.approx((rows - 1) * (columns - 1), rel=1e-12)
        for one, other in pairwise(parts):
            assert one.intersection(other).area < 1e-9
        y, x = np.mgrid[1 : rows - 1, 1 : columns - 1].reshape(2, -1)
        of = np.searchsorted(rising, field[y, x])
        for number, part in enumerate(parts):
            inside = shapely.intersects_xy(part, x[of == number], y[of == number])
            assert inside.all()


def test_of_one_and_with_holes() -> None:
    field = HILLS.astype(float)
    field[10:13, 8:15] = np.nan
    data = isocodec.encode(field, [60.25, 100.25])
    contours = [isocodec.decode(data, isovalue=value, through_holes=True) for value in (60.25, 100.25)]
    parts = shapes(isocodec.bands(contours, valid=isocodec.open(data).valid()))
    assert sum(part.area for part in parts) == pytest.approx(32 * 40 - 4 * 8)
    assert len(isocodec.bands([isocodec.decode(isocodec.encode(HILLS, 80.5))])) == 2
    assert isocodec.bands([]) == []


@looped("suffix", [".gpkg", ".fgb", ".shp", ".parquet"])
def test_files(tmp_path: Path, suffix: str) -> None:
    data = isocodec.encode(isocodec.Field(HILLS, placement=UTM), VALUES, metadata={"crs": "EPSG:32631"})
    (tmp_path / "in.iso").write_bytes(data)
    ok("decode", tmp_path / "in.iso", "-o", tmp_path / f"b{suffix}", "--what", "bands")
    read = geopandas.read_parquet if suffix == ".parquet" else geopandas.read_file
    table = read(tmp_path / f"b{suffix}").sort_values("lower", na_position="first")
    assert table.crs.to_epsg() == 32631
    rising = sorted(VALUES)
    assert np.array_equal(table.lower, [np.nan, *rising], equal_nan=True)
    assert np.array_equal(table.upper, [*rising, np.nan], equal_nan=True)
    assert table.area.sum() == pytest.approx(32 * 20 * 40 * 30)
    first = (tmp_path / f"b{suffix}").read_bytes()
    (tmp_path / f"b{suffix}").unlink()  # into a GeoPackage that is there a layer is written
    ok("decode", tmp_path / "in.iso", "-o", tmp_path / f"b{suffix}", "--what", "bands")
    assert (tmp_path / f"b{suffix}").read_bytes() == first


def test_in_degrees(tmp_path: Path) -> None:
    (tmp_path / "in.iso").write_bytes(
        isocodec.encode(isocodec.Field(HILLS, placement=UTM), 80.5, metadata={"crs": "EPSG:32631"})
    )
    ok("decode", tmp_path / "in.iso", "-o", tmp_path / "b.geojson", "--what", "bands")
    features = json.loads((tmp_path / "b.geojson").read_text())["features"]
    assert [feature["properties"] for feature in features] == [
        {"lower": None, "upper": 80.5}, {"lower": 80.5, "upper": None},
    ]
    west, south, east, north = shapely.geometry.shape(features[0]["geometry"]).bounds
    assert 2.9 < west < east < 3.1 and 45.0 < south < north < 45.2
