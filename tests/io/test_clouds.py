"""Scattered points: tables, point clouds and layers of points, against the libraries that write them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError
from tables import looped

POINTS = np.random.default_rng(1).integers(0, 1000, (30, 2)) / 8
VALUES = np.arange(30.0)


@looped("name, head", [
    ("named.csv", "depth;Lat; lon\n"), ("commas.csv", 'x,y,"depth"\n'), ("bare.xyz", ""),
    ("tabs.tsv", "easting\tnorthing\tz\n"), ("numpy.csv", "# x y z\n"),
])
def test_tables(tmp_path: Path, name: str, head: str) -> None:
    """Columns by their names, or the first two; dividers by the first line."""
    divider = next((each for each in ";,\t" if each in head), " ")
    rows = np.column_stack([VALUES, POINTS[:, ::-1]] if name == "named.csv" else [POINTS, VALUES])
    text = "".join(divider.join(map(str, row)) + "\n" for row in rows.tolist())
    (tmp_path / name).write_text("\ufeff" + head + text, encoding="utf-8")
    mesh: Any = isocodec.read(tmp_path / name)
    assert mesh.cells is None and np.array_equal(mesh.points, POINTS) and np.array_equal(mesh.values, VALUES)


def test_tables_with_gaps_and_without_use(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x,y,a,b\n1,2,3,4\n5,6,,8\n7,8,NA,9\n")
    mesh: Any = isocodec.read(tmp_path / "a.csv", key="a")
    assert mesh.values[0] == 3 and np.isnan(mesh.values[1:]).all() and isocodec.read(tmp_path / "a.csv").values is None
    (tmp_path / "g.csv").write_text("1,2,\n4,5,6\n")
    first: Any = isocodec.read(tmp_path / "g.csv")
    assert np.isnan(first.values[0]) and first.values[1] == 6
    for text, words in (("x,y\n1,2\n", "2 columns"), ("", "holds nothing"), ("x,y,z\n1,2,3\n4,5\n", "3 to 2 at row 2"),
                        ("1 2 3\n4 5 \n", "3 to 2 at row 2"), ("x,y,z\n1,2,high\n", "'high'"),
                        ("x,y\n1,2,3\n", "2 columns, and others have 3")):
        (tmp_path / "b.csv").write_text(text)
        with pytest.raises(InputError, match=words):
            isocodec.read(tmp_path / "b.csv")
    with pytest.raises(InputError, match="'c': a, b"):
        isocodec.read(tmp_path / "a.csv", key="c")
    with pytest.raises(OptionError, match="nodata does not apply"):
        isocodec.read(tmp_path / "a.csv", nodata=3)


@looped("suffix, form", [(".las", 1), (".laz", 6)])
def test_clouds(tmp_path: Path, suffix: str, form: int) -> None:
    """Withheld points and noise are left out, with a remark; other dimensions by their names."""
    import laspy

    cloud = laspy.LasData(laspy.LasHeader(point_format=form, version="1.4"))
    cloud.header.scales, cloud.x, cloud.y, cloud.z = [0.125] * 3, POINTS[:, 0], POINTS[:, 1], VALUES
    kinds = np.full(30, 2)
    kinds[:3], kinds[3:5] = 7, 18
    cloud.classification, cloud.intensity = kinds, np.arange(30)
    cloud.withheld = withheld = np.arange(30) % 10 == 9
    cloud.write(tmp_path / f"a{suffix}")
    kept = ~withheld & (kinds != 7) & ((kinds != 18) | (form < 6))
    with pytest.warns(UserWarning, match="3 withheld points") as caught:
        mesh: Any = isocodec.read(tmp_path / f"a{suffix}")
    assert any("points of noise are left out" in str(one.message) for one in caught)
    las = laspy.read(tmp_path / f"a{suffix}")
    assert np.array_equal(mesh.points, np.stack([las.x, las.y], axis=1)[kept])
    assert np.array_equal(mesh.values, np.asarray(las.z)[kept])
    with pytest.warns(UserWarning):
        assert np.array_equal(isocodec.read(las, key="intensity").values, np.arange(30)[kept])


@pytest.mark.parametrize("suffix", [".gpkg", ".fgb", ".shp", ".geojson", ".parquet"])
def test_layers(tmp_path: Path, suffix: str) -> None:
    import geopandas

    shapes = geopandas.points_from_xy(*(POINTS / 10).T)
    table = geopandas.GeoDataFrame({"depth": VALUES, "name": "a"}, geometry=shapes, crs="EPSG:4326")
    path = tmp_path / f"a{suffix}"
    (table.to_parquet if suffix == ".parquet" else table.to_file)(path)
    for source in (path, table):
        mesh: Any = isocodec.read(source)
        order = np.argsort(mesh.values)  # FlatGeobuf has an order of its own
        assert np.allclose(np.asarray(mesh.points)[order], POINTS / 10) and mesh.crs == "EPSG:4326"
        assert np.array_equal(np.sort(mesh.values), VALUES)


def test_heights_and_other_shapes(tmp_path: Path) -> None:
    import geopandas

    table = geopandas.GeoDataFrame(geometry=geopandas.points_from_xy(*POINTS.T, VALUES), crs="EPSG:32631")
    assert np.array_equal(isocodec.read(table).values, VALUES)
    table.buffer(1).to_file(tmp_path / "a.gpkg")
    with pytest.raises(InputError, match=r"Polygon.*not points"):
        isocodec.read(tmp_path / "a.gpkg")
    table.to_file(tmp_path / "b.fgb")
    (tmp_path / "b.fgb").rename(tmp_path / "b.shp")
    with pytest.raises(InputError):
        isocodec.read(tmp_path / "b.shp")
