"""Surfaces, meshes and curves in files of trimesh and PyVista, and as objects, read back by these libraries."""

from __future__ import annotations

import dataclasses
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import HILLS
from isocodec.errors import OptionError
from isocodec.field.placement import Placement
from libraries import Late
from written_contents import ball, content, volume, written

pyvista, trimesh, etree = Late("pyvista"), Late("trimesh"), Late("lxml.etree")
ONE, SEVERAL = (".ply", ".stl", ".off"), (".obj", ".glb", ".gltf", ".3mf")
BY_TRIMESH, BY_PYVISTA = (*ONE, *SEVERAL), (".vtp", ".vtk", ".vtu")
FROM_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def whole(path: Path) -> Any:
    """The surfaces of a file as one, with z up."""
    mesh = trimesh.load_scene(path, process=False).to_geometry()
    if path.suffix in (".glb", ".gltf"):
        mesh.vertices = mesh.vertices @ FROM_Y_UP
    return mesh


def ordered(points: np.ndarray) -> np.ndarray:
    return points[np.lexsort(np.round(points, 3).T)]


@pytest.mark.parametrize("suffix", BY_TRIMESH)
@pytest.mark.parametrize("place", ["samples", "ras", "lps"])
def test_surfaces_keep_their_points_their_side_and_their_space(tmp_path: Path, suffix: str, place: str) -> None:
    contour = content("surface", place)
    path, made = written(tmp_path, suffix, contour)
    mesh, wanted = whole(path), trimesh.Trimesh(contour.placed, contour.placed_cells, process=False)
    assert len(mesh.faces) == len(contour.cells)
    assert mesh.volume == pytest.approx(wanted.volume, rel=1e-5) and mesh.volume > 0
    if suffix != ".stl":
        assert np.allclose(ordered(mesh.vertices), ordered(contour.placed), rtol=1e-5, atol=1e-5)
    named = suffix not in (".off", ".3mf")
    assert len(made.remarks) == (place != "samples" and not named)
    if suffix in (".ply", ".stl", ".obj"):
        assert (f"SPACE={place.upper()}".encode() in path.read_bytes()[:400]) == (place != "samples")
    elif suffix == ".gltf" and place != "samples":
        assert json.loads(path.read_text())["scenes"][0]["extras"] == {"up": "y", "SPACE": place.upper()}


@pytest.mark.parametrize("suffix", BY_TRIMESH)
def test_each_isovalue_is_a_named_object_if_the_format_holds_several(tmp_path: Path, suffix: str) -> None:
    if suffix in ONE:
        with pytest.raises(OptionError, match="several contours"):
            written(tmp_path, suffix, ("surfaces", "ras"))
        return
    path, _ = written(tmp_path, suffix, ("surfaces", "ras"))
    scene = trimesh.load_scene(path, process=False)
    names = {one.removeprefix("o ") for one in path.read_text().splitlines()} if suffix == ".obj" else (
        {*scene.geometry} | {*scene.graph.nodes_geometry})
    assert {"isovalue 30.5", "isovalue 50.5"} <= names


@pytest.mark.parametrize("suffix", [*BY_TRIMESH, ".vtu"])
def test_empty_surfaces_are_refused_with_a_remedy(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(OptionError, match=r"write \.vtp"):
        written(tmp_path, suffix, ("no surface", "ras"))
    assert not [*tmp_path.iterdir()]
    assert pyvista.read(written(tmp_path, ".vtp", ("no surface", "ras"))[0]).n_cells == 0


@pytest.mark.parametrize("suffix", BY_PYVISTA)
@pytest.mark.parametrize(("what", "place"), [("curves", "samples"), ("surfaces", "ras"), ("curves", "plane")])
def test_vtk_holds_curves_and_surfaces_with_values(tmp_path: Path, suffix: str, what: str, place: str) -> None:
    """To the last digit, each cell with its isovalue, surfaces with their normals, with the sides of the body."""
    contours = content(what, place)
    mesh = pyvista.read(written(tmp_path, suffix, contours)[0])
    counts = [len(one.walks if what == "curves" else one.cells) for one in contours]
    assert np.array_equal(mesh.cell_data["isovalue"], np.repeat([float(one.isovalue) for one in contours], counts))
    placed = np.concatenate([one.placed for one in contours])
    assert mesh.points.dtype == np.float64 and np.array_equal(mesh.points[:, : placed.shape[1]], placed)
    if what == "surfaces":
        assert np.allclose(mesh.point_data["Normals"], np.concatenate([one.normals for one in contours]), atol=1e-6)
    assert [*mesh.field_data.get("SPACE", [])] == ["RAS"] * (place != "samples")


@pytest.mark.parametrize("suffix", [".vtp", ".vtu", ".vtk", ".ply", ".obj", ".glb", ".stl"])
@pytest.mark.parametrize(("what", "place"), [("mesh", "utm"), ("mesh", "mirrored"), ("mesh", "plane"),
                                             ("tin", "samples"), ("tin", "utm")])
def test_triangles_of_meshes_and_surfaces_of_points(tmp_path: Path, suffix: str, what: str, place: str) -> None:
    """Seen counter-clockwise from above, in the plane; with heights."""
    given = content(what, place)
    path, _ = written(tmp_path, suffix, given)
    if suffix in BY_PYVISTA:
        found = pyvista.read(path)
        assert what == "tin" or (set(found.point_data["above"]) == {0, 1} and "level" in found.cell_data)
        corners = np.asarray(found.points)[found.cells.reshape(-1, 4)[:, 1:] if suffix == ".vtu" else
                                           found.regular_faces]
    else:
        corners = whole(path).triangles
    assert len(corners) == len(given.cells if what == "mesh" else given.triangles)
    a, b, c = np.moveaxis(np.asarray(corners, float), 1, 0)
    assert place == "plane" or (np.cross(b - a, c - a)[:, 2] > 0).all()
    if what == "tin":
        assert np.allclose(np.unique(corners[..., 2]), np.unique(given.values), rtol=1e-6)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".ply", ".stl", ".vtp"])
def test_tetrahedra_have_volume_or_are_refused(tmp_path: Path, suffix: str) -> None:
    for place in ("samples", "ras", "lps"):
        if suffix in (".vtu", ".vtk"):
            found = pyvista.read(written(tmp_path, suffix, ("solid", place))[0])
            assert found.n_cells == len(content("solid", place).cells)
            assert (np.asarray(found.compute_cell_sizes()["Volume"]) > 0).all()
        else:
            with pytest.raises(OptionError, match=r"one of \.vtu, \.vtk"):
                written(tmp_path, suffix, ("solid", place))


@pytest.mark.parametrize("far", [
    np.array([[1e-6, 0, 0, 84.414], [0, -1e-6, 0, 36.7], [0, 0, 1e-6, 0]]),
    np.array([[0.36, 0.48, -0.8, 4.2e6], [-0.8, 0.6, 0, 1.1e6], [0.48, 0.64, 0.6, 4.7e6]]) * 1e-3,
    np.array([[1e-9, 0, 0, 0.25], [0, 1e-9, 0, -0.75], [0, 0, 1e-9, 3]]),
], ids=["in degrees", "around the earth", "in metres"])
def test_models_small_and_far_away(tmp_path: Path, far: np.ndarray) -> None:
    """Each object as its size demands: GLB, by its bytes, to 1e-7 of it, 3MF to the last digit; STL says what it loses.
    """
    contour = dataclasses.replace(content("surface", "ras"), placement=Placement(far))
    content_of = written(tmp_path, ".glb", contour)[0].read_bytes()
    length = int.from_bytes(content_of[12:16], "little")
    said, buffer = json.loads(content_of[20 : 20 + length]), content_of[28 + length :]
    (node,) = [one for one in said["nodes"] if one.get("name") == "isovalue 50.5"]
    accessor = said["accessors"][said["meshes"][node["mesh"]]["primitives"][0]["attributes"]["POSITION"]]
    begin = said["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get("byteOffset", 0)
    single = np.frombuffer(buffer, "<f4", 3 * accessor["count"], begin).reshape(-1, 3).astype(float)
    # the matrix is by columns, and only moves; far from 0, double precision says no more of the thing than that
    seen, placed = (single + np.array(node["matrix"][12:15])) @ FROM_Y_UP, contour.placed
    assert np.abs(seen - placed).max() <= 1e-7 * np.ptp(placed, axis=0).max() + 2 * np.spacing(np.abs(placed).max())
    with zipfile.ZipFile(written(tmp_path, ".3mf", contour)[0]) as archive:
        model = etree.fromstring(archive.read("3D/3dmodel.model"))
    assert np.array_equal([[float(one.get(k)) for k in "xyz"] for one in model.iter("{*}vertex")], placed)
    assert "rounded" in written(tmp_path, ".stl", contour)[1].remarks[0]


def test_coordinates_in_samples(tmp_path: Path) -> None:
    path, _ = written(tmp_path, ".obj", ("surface", "ras"), in_samples=True)
    assert np.allclose(ordered(whole(path).vertices), ordered(content("surface", "ras").points), atol=1e-6)


# ---- Objects --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", ["samples", "ras", "lps"])
def test_surfaces_as_objects_are_turned_right(place: str) -> None:
    """Outside is what lies below, mirrored or not: the volume is positive, normals point away from the middle."""
    file = isocodec.encode(isocodec.Field(ball(), placement=volume(place).placement), 50.5)
    contour = isocodec.decode(file)
    mesh = contour.to_trimesh()
    assert mesh.volume > 0 and mesh.is_watertight
    assert contour.to_pyvista().volume == pytest.approx(mesh.volume, rel=1e-6)
    outward = contour.placed - contour.placed.mean(axis=0)
    assert (np.einsum("ij,ij->i", contour.normals, outward) > 0).mean() > 0.95
    assert np.allclose(np.linalg.norm(contour.normals, axis=1), 1)
    assert np.median(np.einsum("ij,ij->i", contour.normals, mesh.vertex_normals)) > 0.98
    assert contour.flip().to_trimesh().volume == pytest.approx(-mesh.volume)
    (points, cells, values), about, kind = contour.to_napari()
    assert kind == "surface" and about["name"] == "isovalue 50.5"
    assert len(points) == len(values) and cells.shape[1] == 3


@pytest.mark.parametrize("matrix", [None, [[0, 30, 5e5], [-20, 0, 5e6]], [[0, -30, 5e5], [-20, 0, 5e6]]])
def test_normals_of_curves_point_to_lower_values(matrix: Any) -> None:
    from scipy.ndimage import map_coordinates

    field = isocodec.Field(HILLS.astype(float), placement=matrix)
    contour = isocodec.decode(isocodec.encode(field, 80.5, precision=0.001))
    back = np.array([[0, 1], [1, 0]]) if matrix is None else np.linalg.inv(np.array(matrix)[:, :2])
    way = contour.normals @ back.T
    way *= 0.2 / np.linalg.norm(way, axis=1, keepdims=True)
    low, high = (map_coordinates(field.values, (contour.points + sign * way).T, order=1, mode="nearest")
                 for sign in (1, -1))
    assert (low <= high).mean() > 0.97


def test_curves_as_objects() -> None:
    contour = content("curve", "utm")
    lines, table, made = contour.to_shapely(), contour.to_geodataframe(), contour.to_xarray()
    assert lines.equals(Late("shapely.geometry.shape")(contour.__geo_interface__))
    assert table.crs.to_epsg() == 32631 and set(table.isovalue) == {80.5}
    assert table.length.sum() == pytest.approx(lines.length) and contour.to_pyvista().n_lines == len(contour.walks)
    assert np.array_equal(made.x, contour.placed[:, 0]) and np.array_equal(made.cells, contour.cells)
    assert made.attrs["crs"] == "EPSG:32631" and made.to_netcdf(engine="scipy")
    data, about, kind = contour.to_napari()
    assert kind == "shapes" and about["shape_type"] == "path" and len(data) == len(contour.lines)
    with pytest.raises(OptionError, match="to_trimesh"):
        content("surface").to_shapely()
