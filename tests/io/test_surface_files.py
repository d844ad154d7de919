"""Surfaces, meshes and curves in files of trimesh and PyVista, read back by these libraries."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isocodec.errors import OptionError
from written_contents import content, volume, written

ONE, SEVERAL = (".ply", ".stl", ".off"), (".obj", ".glb", ".gltf", ".3mf")
BY_TRIMESH, BY_PYVISTA = (*ONE, *SEVERAL), (".vtp", ".vtk", ".vtu")
FROM_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def scene(path: Path) -> Any:
    import trimesh

    return trimesh.load_scene(path, process=False)


def points_of(path: Path) -> np.ndarray:
    points = scene(path).dump(concatenate=True).vertices
    return points @ FROM_Y_UP if path.suffix in (".glb", ".gltf") else points


def ordered(points: np.ndarray) -> np.ndarray:
    return points[np.lexsort(np.round(points, 3).T)]


@pytest.mark.parametrize("suffix", BY_TRIMESH)
@pytest.mark.parametrize("place", ["samples", "ras", "lps"])
def test_surfaces_keep_their_points_and_their_side(tmp_path: Path, suffix: str, place: str) -> None:
    import trimesh

    contour = content("surface", place)
    path, _ = written(tmp_path, suffix, contour)
    mesh = scene(path).dump(concatenate=True)
    wanted = trimesh.Trimesh(contour.placed, contour.placed_cells, process=False)
    assert len(mesh.faces) == len(contour.cells)
    assert mesh.volume == pytest.approx(wanted.volume, rel=1e-5) and mesh.volume > 0
    if suffix != ".stl":
        assert len(mesh.vertices) == len(contour.points)
        assert np.allclose(ordered(points_of(path)), ordered(contour.placed), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("suffix", SEVERAL)
def test_each_isovalue_is_a_named_object(tmp_path: Path, suffix: str) -> None:
    path, _ = written(tmp_path, suffix, ("surfaces", "ras"))
    if suffix == ".obj":
        assert {"o isovalue 30.5", "o isovalue 50.5"} <= {*path.read_text().splitlines()}
        return
    assert {"isovalue 30.5", "isovalue 50.5"} <= {*scene(path).geometry} | {*scene(path).graph.nodes_geometry}


@pytest.mark.parametrize("suffix", ONE)
def test_formats_of_one_surface_refuse_several(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(OptionError, match="several contours"):
        written(tmp_path, suffix, ("surfaces", "ras"))


@pytest.mark.parametrize("suffix", [*BY_TRIMESH, ".vtu"])
def test_empty_surfaces_are_refused_with_a_remedy(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(OptionError, match=r"write \.vtp"):
        written(tmp_path, suffix, ("no surface", "ras"))
    assert not [*tmp_path.iterdir()]


def test_an_empty_surface_in_vtp(tmp_path: Path) -> None:
    import pyvista

    assert pyvista.read(written(tmp_path, ".vtp", ("no surface", "ras"))[0]).n_cells == 0


@pytest.mark.parametrize(("place", "word"), [("ras", b"SPACE=RAS"), ("lps", b"SPACE=LPS")])
@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
def test_files_state_the_sides_of_the_body(tmp_path: Path, suffix: str, place: str, word: bytes) -> None:
    path, made = written(tmp_path, suffix, ("surface", place))
    assert word in path.read_bytes()[:400] and not made.remarks
    assert b"SPACE" not in written(tmp_path, suffix, ("surface", "samples"))[0].read_bytes()[:400]


def test_gltf_has_y_up_and_the_sides_of_the_body(tmp_path: Path) -> None:
    path, _ = written(tmp_path, ".gltf", ("surface", "ras"))
    assert json.loads(path.read_text())["scenes"][0]["extras"] == {"up": "y", "SPACE": "RAS"}


@pytest.mark.parametrize("suffix", [".off", ".3mf"])
def test_formats_without_a_place_for_it_say_so(tmp_path: Path, suffix: str) -> None:
    assert "does not state" in written(tmp_path, suffix, ("surface", "ras"))[1].remarks[0]


@pytest.mark.parametrize("suffix", BY_PYVISTA)
@pytest.mark.parametrize("what", ["curves", "surfaces"])
def test_vtk_holds_curves_and_surfaces_with_values(tmp_path: Path, suffix: str, what: str) -> None:
    import pyvista

    contours = content(what)
    mesh = pyvista.read(written(tmp_path, suffix, contours)[0])
    values = np.asarray(mesh.cell_data["isovalue"])
    assert set(values) == {float(one.isovalue) for one in contours}
    assert mesh.n_points == sum(len(one.points) for one in contours)
    pieces = sum(len(one.walks if what == "curves" else one.cells) for one in contours)
    assert mesh.n_cells == pieces and mesh.points.dtype == np.float64
    placed = np.concatenate([one.placed for one in contours])
    assert np.array_equal(mesh.points[:, : placed.shape[1]], placed)


def test_a_curve_on_a_plane_in_space(tmp_path: Path) -> None:
    import pyvista

    mesh = pyvista.read(written(tmp_path, ".vtp", ("curve", "plane"))[0])
    assert np.allclose(mesh.points, content("curve", "plane").placed) and np.ptp(mesh.points[:, 2]) > 1
    assert mesh.field_data["SPACE"][0] == "RAS"


@pytest.mark.parametrize("suffix", [".vtp", ".vtu", ".vtk", ".ply", ".obj", ".glb", ".stl"])
@pytest.mark.parametrize("place", ["utm", "mirrored", "plane"])
def test_triangles_of_a_mesh(tmp_path: Path, suffix: str, place: str) -> None:
    """Seen counter-clockwise from above, in the plane."""
    mesh = content("mesh", place)
    path, _ = written(tmp_path, suffix, mesh)
    if suffix in BY_PYVISTA:
        import pyvista

        found = pyvista.read(path)
        assert set(np.asarray(found.point_data["above"])) == {0, 1} and "level" in found.cell_data
        assert found.n_cells == len(mesh.cells)
        faces = found.cells.reshape(-1, 4)[:, 1:] if suffix == ".vtu" else found.regular_faces
        corners = np.asarray(found.points)[faces]
    else:
        found = scene(path).dump(concatenate=True)
        corners = found.triangles @ FROM_Y_UP if suffix == ".glb" else found.triangles
        assert len(corners) == len(mesh.cells)
    if place != "plane":
        a, b, c = np.moveaxis(np.asarray(corners, float), 1, 0)
        assert (np.cross((b - a)[:, :2], (c - a)[:, :2]) > 0).all()


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_tetrahedra_have_volume(tmp_path: Path, suffix: str) -> None:
    import pyvista

    for place in ("samples", "ras", "lps"):
        found = pyvista.read(written(tmp_path, suffix, ("solid", place))[0])
        assert found.n_cells == len(content("solid", place).cells)
        assert (np.asarray(found.compute_cell_sizes()["Volume"]) > 0).all()


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".vtp"])
def test_tetrahedra_are_refused_elsewhere(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(OptionError, match=r"one of \.vtu, \.vtk"):
        written(tmp_path, suffix, ("solid", "ras"))


@pytest.mark.parametrize("suffix", [".vtu", ".vtp", ".ply", ".obj"])
@pytest.mark.parametrize("place", ["samples", "utm"])
def test_triangulated_surfaces_have_heights(tmp_path: Path, suffix: str, place: str) -> None:
    tin = content("tin", place)
    path, _ = written(tmp_path, suffix, tin)
    if suffix in BY_PYVISTA:
        import pyvista

        points = np.asarray(pyvista.read(path).points)
    else:
        points = points_of(path)
    assert len(points) == len(tin.points)
    assert np.allclose(np.sort(points[:, 2]), np.sort(tin.values), rtol=1e-6)


def test_coarse_single_precision_is_said(tmp_path: Path) -> None:
    import dataclasses

    far = content("surface", "ras")
    matrix = far.placement.matrix + [[0, 0, 0, 5e6]] * 3
    far = dataclasses.replace(far, placement=dataclasses.replace(far.placement, matrix=matrix))
    assert "rounded" in written(tmp_path, ".stl", far)[1].remarks[0]
    # an object of GLB is placed by its node
    path, made = written(tmp_path, ".glb", far)
    assert not made.remarks
    assert np.allclose(ordered(points_of(path) - 5e6), ordered(far.placed - 5e6), atol=1e-4)


def test_coordinates_in_samples(tmp_path: Path) -> None:
    path, _ = written(tmp_path, ".obj", ("surface", "ras"), in_samples=True)
    assert np.allclose(ordered(points_of(path)), ordered(content("surface", "ras").points), atol=1e-6)


def test_objects_of_a_surface() -> None:
    contour = volume("ras").contours()[1]
    assert contour.to_trimesh().volume == pytest.approx(contour.to_pyvista().volume, rel=1e-6)
    (points, cells, values), about, kind = contour.to_napari()
    assert kind == "surface" and about["name"] == "isovalue 50.5"
    assert len(points) == len(values) and cells.shape[1] == 3
