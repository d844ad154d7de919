"""What writing leaves as it was: layers of a GeoPackage, files on a full disk; and which way lines run."""

from __future__ import annotations

import json
import resource
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pyogrio
import pytest
import shapely
from isocodec.io.writers.registry import OUTPUTS
from isocodec.io.writers.write import write

import isocodec
from commands import BALL, HILLS, fails, ok, run
from isocodec.field.placement import Placement
from isocodec.io.writers.output_formats import COLUMNS, OutputOptions
from isocodec.io.writers.things import Areas

UTM = np.array([[0.0, 30, 5e5], [-20, 0, 5e6]])


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "a.iso"
    path.write_bytes(isocodec.encode(isocodec.Field(HILLS, placement=UTM, crs="EPSG:32631"), [80.5, 120.5]))
    return path


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Somebody's, with two layers, one of which has a style."""
    path = tmp_path / "map.gpkg"
    towns = geopandas.GeoDataFrame({"name": ["A", "B"]}, geometry=shapely.points([[1, 2], [3, 4]]), crs=4326)
    towns.to_file(path, layer="towns")
    towns.iloc[:1].to_file(path, layer="isolines")
    with closing(sqlite3.connect(path)) as base, base:
        base.execute("create table notes (text)")
        base.execute("insert into notes values ('mine')")
    return path


def layers(path: Path) -> dict[str, int]:
    return {name: pyogrio.read_info(path, layer=name)["features"] for name in pyogrio.list_layers(path)[:, 0]
            if name != "notes"}


def test_other_layers_are_kept(source: Path, package: Path) -> None:
    ok("decode", source, "-o", package, "--layer", "contours")
    found = layers(package)
    assert found.keys() == {"towns", "isolines", "contours"} and found["towns"] == 2 and found["isolines"] == 1
    ok("decode", source, "-o", package, "--what", "areas", "--layer", "contours")
    ok("decode", source, "-o", package)
    found = layers(package)
    assert found.keys() == {"towns", "isolines", "contours"} and found["contours"] == 2 and found["isolines"] > 2
    assert geopandas.read_file(package, layer="towns").crs == "EPSG:4326"
    assert geopandas.read_file(package, layer="contours").crs == "EPSG:32631"
    assert geopandas.read_file(package, layer="contours").geom_type.unique().tolist() == ["MultiPolygon"]
    with closing(sqlite3.connect(package)) as base:
        assert base.execute("select text from notes").fetchall() == [("mine",)]
        assert base.execute("pragma integrity_check").fetchall() == [("ok",)]


def test_the_same_name_in_capitals(source: Path, package: Path) -> None:
    """Names of tables are the same in capitals: one layer is replaced."""
    ok("decode", source, "-o", package, "--layer", "TOWNS")
    found = layers(package)
    assert len(found) == 2 and {name.lower() for name in found} == {"towns", "isolines"}


def test_changes_that_another_program_has_open(source: Path, package: Path) -> None:
    with closing(sqlite3.connect(package)) as base:
        base.execute("pragma journal_mode=wal")
        base.execute("insert into notes values ('new')")
        base.commit()
        before = package.read_bytes()
        assert "open: close it there" in fails(3, "decode", source, "-o", package, "--layer", "new")
        assert package.read_bytes() == before
    ok("decode", source, "-o", package, "--layer", "new")
    with closing(sqlite3.connect(package)) as base:
        assert base.execute("select text from notes").fetchall() == [("mine",), ("new",)]
    assert layers(package).keys() == {"towns", "isolines", "new"}


@pytest.mark.parametrize("layer", ["notes", "gpkg_contents"])
def test_tables_that_are_no_layers(source: Path, package: Path, layer: str) -> None:
    before = package.read_bytes()
    assert "not a layer" in fails(3, "decode", source, "-o", package, "--layer", layer)
    assert package.read_bytes() == before


def test_what_is_no_package_is_kept(source: Path, tmp_path: Path) -> None:
    path = tmp_path / "b.gpkg"
    for content in (b"old", b"PK\3\4" * 1000):
        path.write_bytes(content)
        assert "no layer can be added" in fails(3, "decode", source, "-o", path)
        assert path.read_bytes() == content
    path.write_bytes(b"")
    ok("decode", source, "-o", path)
    assert layers(path).keys() == {"isolines"}


def test_a_package_has_equal_bytes(source: Path, tmp_path: Path) -> None:
    for name in ("b.gpkg", "c.gpkg"):
        ok("decode", source, "-o", tmp_path / name)
    assert (tmp_path / "b.gpkg").read_bytes() == (tmp_path / "c.gpkg").read_bytes()


@pytest.mark.parametrize("suffix", [".shp", ".parquet", ".geojson", ".dxf", ".vtp"])
def test_formats_without_named_layers(source: Path, tmp_path: Path, suffix: str) -> None:
    assert "--layer" in fails(2, "decode", source, "-o", tmp_path / f"b{suffix}", "--layer", "x")


def test_names_of_layers_elsewhere(source: Path, tmp_path: Path) -> None:
    ok("decode", source, "-o", tmp_path / "b.fgb", "--layer", "x")
    assert pyogrio.list_layers(tmp_path / "b.fgb")[:, 0].tolist() == ["x"]
    ok("decode", source, "-o", tmp_path / "b.pmtiles", "--layer", "x")
    assert b"contours" not in (tmp_path / "b.pmtiles").read_bytes()


def test_numbers_that_a_shapefile_has_not(tmp_path: Path) -> None:
    curve = isocodec.decode(isocodec.encode(isocodec.Field(HILLS * 1e-20, placement=UTM, crs="EPSG:32631"), 80.5e-20))
    with pytest.warns(UserWarning, match="does not keep the isovalue 8.05e-19"):
        write(tmp_path / "a.shp", curve)


# ---- A full disk ----------------------------------------------------------------------------------------------------


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """Let writing of longer files fail, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


FULL = sorted({
    (output.suffixes[0], {"contour": "curve"}.get(output.kind, output.kind), n)
    for output in OUTPUTS if output.kind in ("contour", "areas", "mask", "mesh") for n in output.dimensions
})


@pytest.fixture(scope="module")
def volume(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("volume") / "b.iso"
    matrix = np.array([[1.0, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7]])
    path.write_bytes(isocodec.encode(isocodec.Field(BALL, placement=matrix), 55.5))
    return path


@pytest.mark.parametrize(("suffix", "what", "n"), FULL)
def test_a_full_disk(source: Path, volume: Path, tmp_path: Path, suffix: str, what: str, n: int) -> None:
    """Files may not be longer than a part of what is written: exit code 3, and what was there."""
    target = tmp_path / f"out{suffix}"
    asked = ["decode", str(source if n == 2 else volume), "--what", "above" if what == "mask" else what]
    asked += [] if suffix in (".geojson", ".dxf") or what == "mesh" else ["--isovalue", "80.5" if n == 2 else "55.5"]
    ok(*asked, "-o", target)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    size = target.stat().st_size
    for part in (size // 2, size - 1):
        with files_up_to(part):
            line = fails(3, *asked, "-o", target)
        assert "internal" not in line
        assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


# ---- Which way lines run --------------------------------------------------------------------------------------------


def rising(points: np.ndarray, values: Any) -> float:
    """Share of segments with higher values on the left; ``values`` at places (x, y)."""
    along = np.diff(points, axis=0)
    middle = (points[1:] + points[:-1]) / 2
    left = np.column_stack([-along[:, 1], along[:, 0]])
    return float((values(middle + left / 2) > values(middle - left / 2)).mean())


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("matrix", [
    UTM, UTM * [[1, 1, 1], [-1, 1, 1]], UTM * [[1, -1, 1], [1, 1, 1]], UTM[:, [1, 0, 2]],
    [[12.0, 25, 4e5], [-20, 9, 6e6]], None,
])
@pytest.mark.parametrize("suffix", [".geojson", ".gpkg", ".fgb", ".shp", ".parquet"])
def test_higher_on(tmp_path: Path, suffix: str, matrix: Any, side: str) -> None:
    i, j = np.indices((31, 41))
    values = 100 - np.hypot(i - 14.3, j - 21.2)
    placement = None if matrix is None else Placement(np.array(matrix), crs="EPSG:32631")
    curve = isocodec.decode(isocodec.encode(isocodec.Field(values, placement=placement), 91.0))
    with np.errstate(all="ignore"):
        write(tmp_path / f"a{suffix}", curve, options=OutputOptions(higher_on=side, keep_crs=True))
    if suffix == ".geojson":
        (line,) = json.loads((tmp_path / "a.geojson").read_text())["geometry"]["coordinates"]
    else:
        table = (geopandas.read_parquet if suffix == ".parquet" else geopandas.read_file)(tmp_path / f"a{suffix}")
        line = table.geometry[0].coords
    middle = np.array([[14.3, 21.2]])
    middle = placement.place(middle) if placement is not None else middle[:, ::-1]
    share = rising(np.array(line), lambda places: -np.linalg.norm(places - middle, axis=1))
    assert share > 0.9 if side == "left" else share < 0.1


def test_higher_on_a_mesh_and_in_samples(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points = rng.random((300, 2)) * 100
    values = -np.hypot(*(points - 50).T)
    curve = isocodec.decode(isocodec.encode(isocodec.Mesh(points, None, values), -30.0))
    write(tmp_path / "a.geojson", curve)
    lines = json.loads((tmp_path / "a.geojson").read_text())["geometry"]["coordinates"]
    around = [rising(np.array(line), lambda places: -np.hypot(*(places - 50).T)) for line in lines if len(line) > 20]
    assert min(around) > 0.8
    flat = isocodec.decode(isocodec.encode(HILLS, 80.5))
    for side, reverse in (("left", False), ("right", True)):
        write(tmp_path / "a.npz", flat, options=OutputOptions(higher_on=side))
        cells = np.load(tmp_path / "a.npz")["cells"]
        assert np.array_equal(cells, flat.cells[:, ::-1] if reverse else flat.cells)


def test_higher_on_is_for_lines(source: Path, tmp_path: Path) -> None:
    assert "--higher-on" in fails(2, "decode", source, "-o", tmp_path / "b.geojson", "--what", "areas", "--higher-on",
                                  "right")
    curve = isocodec.open(source).contour(80.5)
    write(tmp_path / "a.geojson", Areas([curve], "above"))


# ---- Columns, and contours that there are not ------------------------------------------------------------------------


ATTRIBUTED = sorted({(each.suffixes[0], each.kind) for each in OUTPUTS if each.attributed})


@pytest.mark.parametrize(("suffix", "kind"), ATTRIBUTED)
def test_no_column_has_the_name_of_another(source: Path, tmp_path: Path, suffix: str, kind: str) -> None:
    """Over the columns that each writer makes, as they are read again: whatever the case of letters."""
    words = ["--what", {"contour": "curve"}.get(kind, kind), "--index", 2]
    path = tmp_path / f"a{suffix}"
    ok("decode", source, "-o", path, *words, "--attribute", "height")
    read = geopandas.read_parquet if suffix == ".parquet" else geopandas.read_file
    columns = set(read(path).columns)
    assert "height" in columns and columns - {"height"} <= set(COLUMNS)
    before = path.read_bytes()
    for name in (*COLUMNS, "GEOMETRY", ""):
        assert "--attribute" in fails(2, "decode", source, "-o", path, *words, "--attribute", name)
    assert path.read_bytes() == before


@pytest.mark.parametrize("options", [["--isovalue", 300], ["--isovalue", 300, "--isovalue", 400], ["--interval", 900]])
@pytest.mark.parametrize("values", ["hills", "flat", "missing"])
def test_fields_without_contours_leave_layers_as_they_are(
    source: Path, tmp_path: Path, values: str, options: list[object]
) -> None:
    """One answer for all, and nothing is written."""
    field = HILLS.astype(float) + 1
    field = {"hills": field, "flat": 0 * field + 7, "missing": np.nan * field}[values]
    np.save(tmp_path / "f.npy", field)
    path = tmp_path / "a.gpkg"
    ok("decode", source, "-o", path)
    before = path.read_bytes()
    line = fails(3, "encode", tmp_path / "f.npy", "-o", path, *options)
    assert "contours" in line or "missing" in line or "no multiple" in line
    assert path.read_bytes() == before


def test_files_without_contours_are_decoded_with_a_word(tmp_path: Path) -> None:
    (tmp_path / "e.iso").write_bytes(isocodec.encode(HILLS, 300.5))
    result = run("decode", tmp_path / "e.iso", "-o", tmp_path / "e.gpkg")
    assert result.exit_code == 0 and "the curve is empty" in result.stderr
