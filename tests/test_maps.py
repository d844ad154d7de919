"""Maps, drawings and models: written by us, read back with the libraries that users have."""

from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import ezdxf
import geopandas
import numpy as np
import pyogrio
import pyproj
import pytest
import shapely
import trimesh
import vtk
from isocodec.io.writers.write import write
from lxml import etree
from shapely.geometry import shape as shape_of
from vtk.util.numpy_support import vtk_to_numpy

import isocodec
from commands import BALL as SHELL
from commands import HILLS, fails, ok, run
from isocodec.errors import OptionError
from written import Y_UP, rendered

BALL = int(SHELL.max()) - SHELL
VALUES = [60.5, 80.5, 100.5]
UTM = np.array([[0.0, 30, 5e5], [-20, 0, 5e6]])
SPACE = np.array([[0.0, 0, -2, 4e5], [0, 1.5, 0, 5e6], [3, 0, 0, 7]])
SHELLS = [float(v) for v in np.quantile(BALL, [0.3, 0.6])]


@pytest.fixture(scope="module")
def hills() -> bytes:
    return isocodec.encode(isocodec.Field(HILLS, placement=UTM), VALUES, metadata={"crs": "EPSG:32631"})


@pytest.fixture(scope="module")
def shells() -> bytes:
    return isocodec.encode(isocodec.Field(BALL, placement=SPACE), SHELLS, precision=0.01)


def written(tmp_path: Path, data: bytes, name: str, *more: str) -> Path:
    (tmp_path / "in.iso").write_bytes(data)
    ok("decode", tmp_path / "in.iso", "-o", tmp_path / name, *more)
    return tmp_path / name


def ends(lines: Any) -> np.ndarray:
    return np.sort(shapely.get_coordinates(list(lines)), axis=0)


# ---- Maps -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".gpkg", ".fgb", ".shp", ".parquet"])
def test_maps_of_lines(tmp_path: Path, hills: bytes, suffix: str) -> None:
    """A row for each line with its isovalue, in the reference system of the file, to the last digit."""
    path = written(tmp_path, hills, f"map{suffix}")
    table = geopandas.read_parquet(path) if suffix == ".parquet" else geopandas.read_file(path)
    assert table.crs.to_epsg() == 32631
    contours = {contour.isovalue: contour for contour in isocodec.open(hills).contours()}
    assert set(table.isovalue) == set(VALUES)
    for isovalue, contour in contours.items():
        rows = table[table.isovalue == isovalue]
        assert len(rows) == len(contour.walks)
        assert np.array_equal(ends(rows.geometry), ends([shapely.LineString(contour.placed[w]) for w in contour.walks]))
        assert [bool(c) for c in rows.closed] == [line.is_closed for line in rows.geometry]
    first = path.read_bytes()
    path.unlink()
    assert written(tmp_path, hills, f"map{suffix}").read_bytes() == first
    if suffix == ".gpkg":
        assert [name for name, _ in pyogrio.list_layers(path)] == ["isolines"]


@pytest.mark.parametrize("suffix", [".gpkg", ".fgb", ".shp", ".parquet"])
def test_maps_of_areas(tmp_path: Path, hills: bytes, suffix: str) -> None:
    path = written(tmp_path, hills, f"map{suffix}", "--what", "areas", "--side", "above")
    table = geopandas.read_parquet(path) if suffix == ".parquet" else geopandas.read_file(path)
    contours = isocodec.open(hills).contours()
    table = table.sort_values("isovalue")
    assert list(table.isovalue) == VALUES and set(table.side) == {"above"}
    for shape, contour in zip(table.geometry, contours, strict=True):
        assert shape.area == pytest.approx(shape_of(contour.areas()).area, rel=1e-12)


def test_maps_of_nothing(tmp_path: Path) -> None:
    data = isocodec.encode(HILLS, 1e6)
    for suffix in (".gpkg", ".fgb", ".shp"):
        assert len(geopandas.read_file(written(tmp_path, data, f"map{suffix}"))) == 0


def test_geojson_is_in_degrees(tmp_path: Path, hills: bytes) -> None:
    """Longitude and latitude as pyproj has them of the coordinates of the file; areas are turned right."""
    whole = json.loads(written(tmp_path, hills, "map.geojson").read_text())
    assert "crs" not in whole
    to_degrees = pyproj.Transformer.from_crs(32631, 4326, always_xy=True)
    for feature, contour in zip(whole["features"], isocodec.open(hills).contours(), strict=True):
        at = np.concatenate([np.array(line) for line in feature["geometry"]["coordinates"]])
        expected = np.stack(to_degrees.transform(*contour.placed[np.concatenate(contour.walks)].T), axis=1)
        assert np.abs(at - expected).max() < 1e-9
        assert (np.abs(at) <= [180, 90]).all()
    for feature in json.loads(
        written(tmp_path, hills, "map.geojson", "--what", "areas", "--side", "above").read_text()
    )["features"]:
        for part in shape_of(feature["geometry"]).geoms:
            assert part.exterior.is_ccw and not any(hole.is_ccw for hole in part.interiors)


def test_geojson_that_is_not_in_degrees(tmp_path: Path, hills: bytes) -> None:
    """There is a clear word, and none where it was asked for."""
    for placement, said in ((None, "in samples"), ((2, 3), "that the file does not name")):
        (tmp_path / "in.iso").write_bytes(isocodec.encode(isocodec.Field(HILLS, placement=placement), 80.5))
        result = run("decode", tmp_path / "in.iso", "-o", tmp_path / "out.geojson")
        assert result.exit_code == 0 and "not the longitudes and latitudes" in result.stderr and said in result.stderr
        assert not run("decode", tmp_path / "in.iso", "-o", tmp_path / "out.geojson", "--in-samples").stderr
    outside = isocodec.encode(isocodec.Field(HILLS, placement=(1e12, 1e12)), 80.5, metadata={"crs": "EPSG:32631"})
    (tmp_path / "in.iso").write_bytes(outside)
    assert "no longitude and latitude" in fails(2, "decode", tmp_path / "in.iso", "-o", tmp_path / "out.geojson")
    unknown = isocodec.encode(isocodec.Field(HILLS, placement=(1, 1)), 80.5, metadata={"crs": "EPSG:999999"})
    (tmp_path / "in.iso").write_bytes(unknown)
    line = fails(2, "decode", tmp_path / "in.iso", "-o", tmp_path / "o.geojson")
    assert "no reference system EPSG:999999" in line


# ---- Drawings -------------------------------------------------------------------------------------------------------


def test_dxf_of_curves(tmp_path: Path, hills: bytes) -> None:
    document = ezdxf.readfile(written(tmp_path, hills, "a.dxf"))
    assert not document.audit().errors
    for contour in isocodec.open(hills).contours():
        lines = [e for e in document.modelspace() if e.dxf.layer == f"ISO_{contour.isovalue:g}"]
        assert len(lines) == len(contour.walks)
        for line, walk in zip(lines, contour.walks, strict=True):
            assert line.dxf.elevation == contour.isovalue
            points = np.array(list(line.get_points("xy")))
            closed = len(walk) > 2 and walk[0] == walk[-1]
            assert line.closed == closed
            assert np.abs(points - contour.placed[walk[:-1] if closed else walk]).max() < 1e-6
    first = (tmp_path / "a.dxf").read_bytes()
    assert written(tmp_path, hills, "a.dxf").read_bytes() == first


def test_dxf_of_surfaces(tmp_path: Path, shells: bytes) -> None:
    document = ezdxf.readfile(written(tmp_path, shells, "a.dxf"))
    meshes = list(document.modelspace().query("MESH"))
    assert [mesh.dxf.layer for mesh in meshes] == [f"ISO_{value:.12g}" for value in SHELLS]
    for mesh, contour in zip(meshes, isocodec.open(shells).contours(), strict=True):
        with mesh.edit_data() as data:
            assert np.abs(np.array([tuple(v) for v in data.vertices]) - contour.placed).max() < 1e-6
            assert np.array_equal(np.array(data.faces), contour.placed_cells)


# ---- Models ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".glb", ".3mf", ".obj"])
def test_models_with_a_group_for_each(tmp_path: Path, shells: bytes, suffix: str) -> None:
    """In the place of the file, the triangles turned right although its placement mirrors, and named."""
    path = written(tmp_path, shells, f"a{suffix}")
    contours = isocodec.open(shells).contours()
    if suffix == ".obj":
        names = [line for line in path.read_text().splitlines() if line.startswith("o ")]
        assert names == [f"o isovalue {value:.12g}" for value in SHELLS]
        whole = trimesh.load_mesh(path, process=False)
        assert np.abs(whole.bounds - sum(c.to_trimesh() for c in contours).bounds).max() < 1e-7
        assert whole.volume == pytest.approx(sum(c.to_trimesh().volume for c in contours), rel=1e-6)
        return
    scene = trimesh.load_scene(path)
    assert sorted(scene.graph.nodes_geometry) == sorted(f"isovalue {value:.12g}" for value in SHELLS)
    meshes = sorted(scene.dump(), key=lambda mesh: -np.ptp(mesh.vertices, axis=0).max())
    for mesh, contour in zip(meshes, sorted(contours, key=lambda c: -np.ptp(c.placed, axis=0).max()), strict=True):
        expected = contour.to_trimesh()
        if suffix == ".glb":
            mesh.vertices = mesh.vertices @ Y_UP
        assert np.abs(mesh.bounds - expected.bounds).max() < 1e-7 * np.ptp(expected.bounds, axis=0).max()
        assert mesh.volume == pytest.approx(expected.volume, rel=1e-6) and mesh.volume > 0
    first = path.read_bytes()
    assert written(tmp_path, shells, f"a{suffix}").read_bytes() == first


FAR = {
    "in degrees": np.array([[1e-6, 0, 0, 84.414], [0, -1e-6, 0, 36.7], [0, 0, 1e-6, 0]]),
    "around the earth": np.array([[0.36, 0.48, -0.8, 4.2e6], [-0.8, 0.6, 0, 1.1e6], [0.48, 0.64, 0.6, 4.7e6]]) * 1e-3,
    "in metres": np.array([[1e-9, 0, 0, 0.25], [0, 1e-9, 0, -0.75], [0, 0, 1e-9, 3]]),
}


@pytest.mark.parametrize("where", FAR)
def test_models_small_and_far_away(tmp_path: Path, where: str) -> None:
    """Each object as its size demands, by trimesh and by the bytes alone: GLB to 1e-7 of it, 3MF to the last digit."""
    far = FAR[where]
    data = isocodec.encode(isocodec.Field(BALL, placement=far), SHELLS, precision=0.01)
    contours = {f"isovalue {c.isovalue:.12g}": c for c in isocodec.open(data).contours()}
    scene = trimesh.load_scene(written(tmp_path, data, "a.glb"), process=False)
    assert {*scene.graph.nodes_geometry} == {*contours}
    content = (tmp_path / "a.glb").read_bytes()
    length = int.from_bytes(content[12:16], "little")
    said, buffer = json.loads(content[20 : 20 + length]), content[28 + length :]
    for name, contour in contours.items():
        places = contour.placed @ Y_UP.T
        size = np.ptp(places, axis=0).max()
        matrix, geometry = scene.graph[name]
        seen = trimesh.transform_points(scene.geometry[geometry].vertices, matrix)
        # far from 0, double precision says no more of the thing than that
        most = 1e-7 * size + 2 * np.spacing(np.abs(places).max())
        assert np.abs(seen - places).max() <= most
        node = next(one for one in said["nodes"] if one.get("name") == name)
        primitive = said["meshes"][node["mesh"]]["primitives"][0]
        accessor = said["accessors"][primitive["attributes"]["POSITION"]]
        begin = said["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get("byteOffset", 0)
        single = np.frombuffer(buffer, "<f4", 3 * accessor["count"], begin).reshape(-1, 3).astype(float)
        # the matrix is by columns, and only moves
        assert np.abs(single + np.array(node["matrix"][12:15]) - places).max() <= most
    with zipfile.ZipFile(written(tmp_path, data, "a.3mf")) as archive:
        model = etree.fromstring(archive.read("3D/3dmodel.model"))
    told = [
        np.array([[float(v.get(k)) for k in "xyz"] for v in mesh.iter("{*}vertex")]) for mesh in model.iter("{*}mesh")
    ]
    assert all(any(np.array_equal(one, c.placed) for one in told) for c in contours.values())


@pytest.mark.parametrize("suffix", [".off", ".ply", ".stl", ".obj"])
def test_models_of_one(tmp_path: Path, suffix: str) -> None:
    contour = isocodec.decode(isocodec.encode(isocodec.Field(BALL, placement=SPACE[:, :3] @ np.eye(3, 4)), 80.5))
    write(tmp_path / f"a{suffix}", contour)
    mesh = trimesh.load_mesh(tmp_path / f"a{suffix}")
    assert mesh.volume == pytest.approx(contour.to_trimesh().volume, rel=1e-5) and mesh.volume > 0


def test_models_of_nothing(tmp_path: Path) -> None:
    nothing = isocodec.decode(isocodec.encode(BALL, 1e6))
    assert rendered(nothing, ".off") == b"OFF\n0 0 0\n"
    for suffix in (".glb", ".3mf"):
        with pytest.raises(OptionError, match="empty"):
            rendered(nothing, suffix)


def polydata(path: Path) -> Any:
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def test_vtp(tmp_path: Path, hills: bytes, shells: bytes) -> None:
    """All isovalues, in double precision, as VTK reads them."""
    for data in (hills, shells):
        mesh = polydata(written(tmp_path, data, "a.vtp"))
        contours = isocodec.open(data).contours()
        points = vtk_to_numpy(mesh.GetPoints().GetData())
        assert points.dtype == np.float64
        n = len(contours[0].shape)
        assert np.array_equal(points[:, :n], np.concatenate([contour.placed for contour in contours]))
        values = vtk_to_numpy(mesh.GetCellData().GetArray("isovalue"))
        counts = [len(c.walks) if n == 2 else len(c.cells) for c in contours]
        assert np.array_equal(values, np.repeat([c.isovalue for c in contours], counts))
        if n == 3:
            cells = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
            assert np.array_equal(cells[: len(contours[0].cells)], contours[0].placed_cells)
            normals = vtk_to_numpy(mesh.GetPointData().GetNormals())
            assert np.allclose(normals, np.concatenate([c.normals for c in contours]), atol=1e-6)
        else:
            assert mesh.GetNumberOfLines() == sum(counts)
    assert polydata(written(tmp_path, isocodec.encode(HILLS, 1e6), "a.vtp")).GetNumberOfPoints() == 0


# ---- Objects of other libraries -------------------------------------------------------------------------------------


def test_shapely_and_geopandas(hills: bytes) -> None:
    contour = isocodec.decode(hills)
    lines = contour.to_shapely()
    assert lines.equals(shape_of(contour.__geo_interface__))
    table = contour.to_geodataframe()
    assert table.crs.to_epsg() == 32631 and len(table) == len(contour.lines) and set(table.isovalue) == {60.5}
    assert table.length.sum() == pytest.approx(lines.length)
    with pytest.raises(OptionError, match="to_trimesh"):
        isocodec.decode(isocodec.encode(BALL, 80.5)).to_shapely()


@pytest.mark.parametrize("placement", [None, SPACE, SPACE * [[1, 1, -1, 1]]])
def test_surfaces_are_turned_right(placement: Any) -> None:
    """Outside is what lies below, mirrored or not: the volume is positive, normals point away from the middle."""
    contour = isocodec.decode(isocodec.encode(isocodec.Field(BALL, placement=placement), 80.5))
    mesh = contour.to_trimesh()
    assert mesh.volume > 0 and mesh.is_watertight
    outward = contour.placed - contour.placed.mean(axis=0)
    assert (np.einsum("ij,ij->i", contour.normals, outward) > 0).mean() > 0.99
    assert np.allclose(np.linalg.norm(contour.normals, axis=1), 1)
    agree = np.einsum("ij,ij->i", contour.normals, mesh.vertex_normals)
    assert np.median(agree) > 0.98
    assert contour.flip().to_trimesh().volume == pytest.approx(-mesh.volume)
    assert contour.flip().flip().origin_above == contour.origin_above


@pytest.mark.parametrize("placement", [None, UTM, UTM * [[1, -1, 1]]])
def test_normals_of_curves(placement: Any) -> None:
    """A little way along them values are lower."""
    contour = isocodec.decode(
        isocodec.encode(isocodec.Field(HILLS.astype(float), placement=placement), 80.5, precision=0.001)
    )
    back = np.array([[0, 1], [1, 0]]) if placement is None else np.linalg.inv(placement[:, :2])
    step = 0.2 / np.linalg.norm(contour.normals @ back.T, axis=1, keepdims=True)
    low, high = ((contour.points + sign * step * (contour.normals @ back.T)).T for sign in (1, -1))
    from scipy.ndimage import map_coordinates

    field = HILLS.astype(float)
    at_low, at_high = (map_coordinates(field, at, order=1, mode="nearest") for at in (low, high))
    assert (at_low <= at_high).mean() > 0.97


def test_pyvista(hills: bytes, shells: bytes) -> None:
    lines = isocodec.decode(hills).to_pyvista()
    contour = isocodec.decode(hills)
    assert lines.n_lines == len(contour.walks) and lines.length > 0
    surface = isocodec.decode(shells).to_pyvista()
    assert surface.n_cells == len(isocodec.decode(shells).cells)
    assert surface.volume == pytest.approx(isocodec.decode(shells).to_trimesh().volume, rel=1e-6)


def test_xarray(hills: bytes) -> None:
    contour = isocodec.decode(hills)
    made = contour.to_xarray()
    assert np.array_equal(made.x, contour.placed[:, 0]) and np.array_equal(made.cells, contour.cells)
    assert made.attrs["isovalue"] == 60.5 and made.attrs["crs"] == "EPSG:32631"
    assert made.to_netcdf(engine="scipy")


def test_picture_of_a_notebook(hills: bytes, shells: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    for data in (hills, shells):
        contour = isocodec.decode(data)
        assert (contour._repr_png_() or b"").startswith(b"\x89PNG")
        assert contour._repr_png_() == rendered(replace(contour), ".png")
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    assert isocodec.decode(hills)._repr_png_() is None
