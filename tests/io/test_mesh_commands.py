"""Meshes in files of other tools, and the commands that take them."""

from __future__ import annotations

import json

import numpy as np
import pytest

import isocodec
from commands import fails, ok
from explicit_meshes import plane, space
from isocodec.errors import OptionError


def written(path, mesh, **values):
    meshio = pytest.importorskip("meshio")
    points, cells = mesh
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    kind = "triangle" if cells.shape[1] == 3 else "tetra"
    form = {"file_format": "gmsh"} if path.suffix == ".msh" else {}
    meshio.Mesh(points, [(kind, cells)], point_data=values).write(path, **form)
    return path


def test_commands(tmp_path):
    mesh = plane(3, 80, 1.0)
    path = written(tmp_path / "mesh.vtu", mesh, depth=mesh[0][:, 0])
    iso, out = tmp_path / "out.iso", tmp_path / "out.geojson"
    ok("encode", path, "--key", "depth", "--isovalue", 50, "--isovalue", 70, "-o", iso)
    ok("decode", iso, "--mesh", path, "-o", out)
    assert len(json.loads(out.read_text())["features"]) == 2
    fails(3, "decode", iso, "-o", out)
    ok("info", iso)
    told = json.loads(
        ok("encode", path, "--key", "depth", "--isovalue", 50, "--stored", "coded", "-o", iso, "--json")
    )
    assert told["cells"] == len(mesh[1]) and told["layers"] == 2
    ok("decode", iso, "-o", tmp_path / "out.npz")
    contour = isocodec.decode(iso.read_bytes())
    assert np.array_equal(np.load(tmp_path / "out.npz")["points"], contour.points)
    assert np.allclose(contour.points[:, 0], 50, atol=2)
    ok("decode", iso, "-o", tmp_path / "out.svg")


def test_surfaces(tmp_path):
    mesh = space(3, 40, 1.0)
    path = written(tmp_path / "mesh.vtu", mesh, depth=mesh[0][:, 0])
    ok("encode", path, "--key", "depth", "--isovalue", 50, "--stored", "whole", "-o", tmp_path / "out.iso")
    for suffix in (".ply", ".stl", ".obj", ".npz"):
        ok("decode", tmp_path / "out.iso", "-o", tmp_path / f"out{suffix}")
    fails(2, "decode", tmp_path / "out.iso", "-o", tmp_path / "out.geojson")


def test_options_that_do_not_fit(tmp_path):
    mesh = plane(3)
    path = written(tmp_path / "mesh.vtu", mesh, depth=mesh[0][:, 0])
    out = tmp_path / "out.iso"
    fails(2, "encode", path, "--key", "depth", "-o", out)
    fails(3, "encode", path, "--key", "width", "--isovalue", 5, "-o", out)
    fails(2, "encode", path, "--key", "depth", "--isovalue", 5, "--layers", "distortion=1", "-o", out)
    np.save(tmp_path / "field.npy", np.eye(8))
    fails(2, "encode", tmp_path / "field.npy", "--stored", "coded", "--isovalue", 0.5, "-o", out)
    ok("encode", tmp_path / "field.npy", "--isovalue", 0.5, "-o", out)
    fails(2, "decode", out, "--mesh", path, "-o", tmp_path / "out.geojson")


def test_pictures(tmp_path):
    pytest.importorskip("matplotlib")
    mesh = plane(3, 1500, kept=1)
    np.savez(tmp_path / "mesh.npz", points=mesh[0], cells=mesh[1], depth=mesh[0].sum(axis=1))
    data, out = tmp_path / "a.iso", tmp_path / "a.png"
    data.write_bytes(isocodec.encode(isocodec.Mesh(*mesh, mesh[0].sum(axis=1), progressive=True), [80.0, 120.0]))
    assert "3 steps" in ok(
        "plot", data, "-o", out, "--mesh", tmp_path / "mesh.npz", "--isovalue", 120, "--steps", 3
    )
    assert out.read_bytes().startswith(b"\x89PNG")
    assert "does not store" in fails(3, "plot", data, "-o", out)
    solid = tmp_path / "solid.iso"
    solid.write_bytes(isocodec.encode(isocodec.Mesh(*space(1), np.arange(30), stored="coded"), 14.5))
    assert "steps" in ok("plot", solid, "-o", out)


@pytest.mark.parametrize("progressive", [False, True])
def test_shorter_files(progressive):
    """After each layer, by number or by bytes, whatever of a file is there; the result is complete."""
    mesh = plane(3, 200, kept=1)
    values = np.array([mesh[0].sum(axis=1), mesh[0] @ [1, 2]])
    data = isocodec.encode(isocodec.Mesh(*mesh, values, progressive=progressive), [80.0, 120.0])
    layers = isocodec.open(data).info.layers
    for count in range(1, len(layers) + 1):
        short = isocodec.open(data).edited(layers=count)
        info = isocodec.open(short).info
        assert info.complete and len(info.layers) == count
        assert isocodec.open(data).edited(size=len(short)) == short
        assert isocodec.open(data[: len(short)]).edited(layers=count) == short
        isocodec.open(short, mesh=mesh).contours(frame=info.layers[-1].frame)
    assert isocodec.open(data).edited(layers=len(layers)) == data == isocodec.open(data).edited(layers=99)
    for wrong in ({"layers": 0}, {"size": 40}):
        with pytest.raises(OptionError):
            isocodec.open(data).edited(**wrong)
    with pytest.raises(OptionError, match="only 2"):
        isocodec.open(isocodec.open(data).edited(layers=2)[:-4]).edited(layers=3)
