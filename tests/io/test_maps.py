"""Maps, drawings and models: written by us, read back with the libraries that users have."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import BALL as SHELL
from commands import HILLS, ok
from isocodec.errors import OptionError
from isocodec.io.formats import write
from libraries import Late
from written import Y_UP

geopandas = Late("geopandas")
etree = Late("lxml.etree")
pyogrio = Late("pyogrio")
shapely = Late("shapely")
shape_of = Late("shapely.geometry.shape")
trimesh = Late("trimesh")
vtk = Late("vtk")
vtk_to_numpy = Late("vtk.util.numpy_support.vtk_to_numpy")

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


# ---- Drawings -------------------------------------------------------------------------------------------------------


# ---- Models ---------------------------------------------------------------------------------------------------------


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
