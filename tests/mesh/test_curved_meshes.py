"""Values on triangles in space: every operation, every format, and the winding of the triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import fails, ok, run
from isocodec import Mesh
from libraries import Late
from tables import looped
from written import Y_UP

pv = Late("pyvista")


def sphere(around: int = 24, rings: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """Points of a sphere of radius 1, its poles last, and triangles that run counter-clockwise from outside."""
    up, turn = np.meshgrid(np.pi * np.arange(1, rings + 1) / (rings + 1), 2 * np.pi * np.arange(around) / around,
                           indexing="ij")
    points = np.stack([np.sin(up) * np.cos(turn), np.sin(up) * np.sin(turn), np.cos(up)], axis=-1).reshape(-1, 3)
    number = np.arange(rings * around).reshape(rings, around)
    beside = np.roll(number, -1, axis=1)
    a, b, c, d = (each.ravel() for each in (number[:-1], number[1:], beside[1:], beside[:-1]))
    top, bottom = np.full(around, len(points)), np.full(around, len(points) + 1)
    cells = [(a, b, c), (a, c, d), (top, number[0], beside[0]), (bottom, beside[-1], number[-1])]
    return np.vstack([points, [[0, 0, 1], [0, 0, -1]]]), np.concatenate([np.stack(each, axis=1) for each in cells])


POINTS, CELLS = sphere()
POINTS = 10 * POINTS * [1, 1.2, 0.8] + [3, -2, 5]
HEIGHT = POINTS @ [0.3, 0.2, 1.0]
LEVELS = (4.5, 7.5)
STORED = ("known", "coded", "whole")
OF_MESHES = (".ply", ".vtu")


def enclosed(points: np.ndarray, cells: np.ndarray) -> float:
    a, b, c = (points[cells[:, i]] for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def opened(stored: str) -> tuple[isocodec.IsoFile, bytes]:
    data = isocodec.encode(Mesh(POINTS, CELLS, HEIGHT, stored=stored), LEVELS, order="independent")
    return isocodec.open(data, mesh=(POINTS, CELLS) if stored == "known" else None), data


@looped("stored", STORED)
@looped("turned", [False, True])
def test_triangles_keep_their_winding(stored: str, turned: bool) -> None:
    """Those of a mesh that both sides have as they are; of a closed surface outwards, of an open one to the front."""
    cells = CELLS[:, ::-1] if turned else CELLS
    data = isocodec.encode(Mesh(POINTS, cells, HEIGHT, stored=stored), LEVELS[0])
    file = isocodec.open(data, mesh=(POINTS, cells) if stored == "known" else None)
    mesh = file.mesh(whole=True)
    if stored == "known":
        assert np.array_equal(mesh.cells, cells)
    elif stored == "whole":
        assert np.isclose(enclosed(mesh.points, mesh.cells), abs(enclosed(POINTS, CELLS)), rtol=0.02)
    for part in (file.mesh(), mesh):
        edges = np.concatenate([part.cells[:, [0, 1]], part.cells[:, [1, 2]], part.cells[:, [2, 0]]])
        assert len(np.unique(edges, axis=0)) == len(edges)
    upper = CELLS[(POINTS[CELLS][:, :, 2] > 5).all(axis=1)]
    data = isocodec.encode(Mesh(POINTS, upper[:, ::-1], HEIGHT, stored="whole"), 9.5)
    open_mesh = isocodec.open(data).mesh(whole=True)
    a, b, c = (open_mesh.points[open_mesh.cells[:, i]] for i in range(3))
    assert np.cross(b - a, c - a).sum(axis=0)[2] > 0


@pytest.mark.parametrize("suffix", OF_MESHES)
def test_meshes_in_files(suffix: str, tmp_path: Path) -> None:
    file, data = opened("whole")
    (tmp_path / "a.iso").write_bytes(data)
    out = tmp_path / f"out{suffix}"
    ok("decode", tmp_path / "a.iso", "--what", "mesh", "--isovalue", LEVELS[0], "-o", out)
    found = pv.read(out)
    mesh = file.mesh(LEVELS[0], whole=False)
    assert found.n_cells == len(mesh.cells) and np.allclose(found.points, mesh.points, atol=1e-5)
    isocodec.save(tmp_path / f"other{suffix}", mesh)
    assert (tmp_path / f"other{suffix}").read_bytes() == out.read_bytes()


@looped("suffix", [".ply", ".stl", ".obj", ".off", ".glb", ".vtp", ".vtu"])
def test_surfaces_on_tetrahedra_in_files(suffix: str, tmp_path: Path) -> None:
    import trimesh

    solid = pv.ImageData(dimensions=(7, 7, 7)).to_tetrahedra()
    points, cells = np.asarray(solid.points, float), solid.cells.reshape(-1, 5)[:, 1:].astype(np.int64)
    values = np.linalg.norm(points - 3, axis=1)
    file = isocodec.open(isocodec.encode(Mesh(points, cells, values, stored="whole"), [2.0, 2.5]))
    contour = file.contour(2.5)
    out = tmp_path / f"out{suffix}"
    isocodec.save(out, contour)
    if suffix in (".vtp", ".vtu"):
        found = pv.read(out)
        assert found.n_cells == len(contour.cells) and set(found.cell_data["isovalue"]) == {2.5}
        isocodec.save(out, file.contours())
        assert set(pv.read(out).cell_data["isovalue"]) == {2.0, 2.5}
    else:
        found = trimesh.load(out, force="mesh")
        if suffix == ".glb":
            found.vertices = found.vertices @ Y_UP
        assert np.isclose(found.area, contour.area if hasattr(contour, "area") else found.area)
        assert np.allclose(found.bounds, [contour.points.min(axis=0), contour.points.max(axis=0)], atol=1e-4)


def test_commands(tmp_path: Path) -> None:
    blob = pv.PolyData(POINTS, np.column_stack([np.full(len(CELLS), 3), CELLS]).ravel())
    for suffix in (".ply", ".stl"):
        blob.save(tmp_path / f"blob{suffix}")
    import trimesh

    trimesh.Trimesh(POINTS, CELLS, process=False).export(tmp_path / "blob.obj")
    for suffix in (".ply", ".stl", ".obj"):
        path = tmp_path / f"blob{suffix}"
        ok("encode", path, "--key", "z", "--isovalue", 6.5, "--stored", "whole", "-o", tmp_path / "b.iso")
        ok("decode", tmp_path / "b.iso", "-o", tmp_path / "line.vtp")
        assert np.abs(pv.read(tmp_path / "line.vtp").points[:, 2] - 6.5).max() < 0.3
        assert "x, y, z" in fails(3, "encode", path, "--key", "w", "--isovalue", 6.5, "-o", tmp_path / "b.iso")
        assert "z = f(x, y)" in fails(3, "thin", path, "--error", 1, "-o", tmp_path / "b.iso")
    blob["height"] = HEIGHT
    blob.save(tmp_path / "blob.vtp")
    ok("encode", tmp_path / "blob.vtp", "--key", "height", "--isovalue", 6.5, "--stored", "whole", "-o",
       tmp_path / "b.iso")
    assert "--key" in fails(3, "verify", tmp_path / "b.iso", tmp_path / "blob.vtp")
    ok("verify", tmp_path / "b.iso", tmp_path / "blob.vtp", "--key", "height")
    empty = run("encode", tmp_path / "blob.vtp", "--key", "height", "--isovalue", 99, "--stored", "whole", "-o",
                tmp_path / "b.iso")
    assert "outside the data" in empty.stderr
