"""Plugins whose programs are not needed for what matters: layers for napari, surfaces for 3D Slicer, the bundle."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import isocodec
from isocodec import Field, Frames
from isocodec.cli import main
from isocodec.field.placement import Placement
from isocodec.plugins import napari_iso, slicer_iso


def ball(*sizes, radius=4.0, shift=0.0):
    at = np.meshgrid(*(np.arange(size) - size / 2 for size in sizes), indexing="ij")
    return radius - np.sqrt(sum(x**2 for x in at)) + shift


def written(tmp_path, what, *isovalues):
    path = tmp_path / "some.iso"
    path.write_bytes(isocodec.encode(what, [*isovalues] or None))
    return str(path)


def test_layers_of_napari(tmp_path):
    plane, space = ball(20, 24), ball(12, 13, 14)
    path = written(tmp_path, plane, 0.0, 1.5)
    layers = napari_iso.get_reader(path)(path)
    assert [kind for _, _, kind in layers] == ["shapes", "shapes"]
    lines = [contour.lines for contour in isocodec.open(path).contours()]
    pairs = [pair for (data, _, _), each in zip(layers, lines, strict=True) for pair in zip(data, each, strict=True)]
    assert pairs and all(np.array_equal(a, b) for a, b in pairs)
    path = written(tmp_path, Frames([space, space + 1.0]), 0.0)
    ((points, cells, values), _, kind), = napari_iso.layers_of(path)
    first, second = (contours[0] for contours in isocodec.open(path).each_frame())
    assert kind == "surface" and len(values) == len(points)
    assert np.array_equal(points[:, 0], np.repeat([0, 1], [len(first.points), len(second.points)]))
    assert np.array_equal(points[:, 1:], np.concatenate([first.points, second.points]))
    assert np.array_equal(cells, np.concatenate([first.cells, second.cells + len(first.points)]))
    assert napari_iso.get_reader("some.tif") is None and napari_iso.get_reader([path]) is None


def test_labels_and_images_to_and_from_napari(tmp_path):
    labels = np.zeros((20, 24), np.uint8)
    labels[3:9, 4:20], labels[12:18, 2:7] = 2, 5
    path = str(tmp_path / "labels.iso")
    assert napari_iso.write_labels(path, labels, {"scale": [2.0, 3.0]}) == [path]
    (data, _, kind), = napari_iso.layers_of(path)
    assert kind == "labels" and np.array_equal(data, labels)
    napari_iso.write_image(path, ball(20, 24), {"contrast_limits": [-2.0, 3.0], "scale": [2, 3], "translate": [7, 8]})
    file = isocodec.open(path)
    assert file.isovalues == (0.5,) and file.placement is not None
    assert file.placement.place(np.array([[1.0, 10.0]])).tolist() == [[38.0, 9.0]]
    before = file.data
    for values, limits in ((ball(20, 24), [900, 901]), (np.full((3, 4), 1.0), None), (np.zeros((2, 3, 4, 5)), None)):
        with pytest.raises((ValueError, isocodec.IsoError)):
            napari_iso.write_image(path, values, {"contrast_limits": limits})
    assert isocodec.open(path).data == before


@pytest.mark.parametrize("system, turn", [("right-anterior-superior", 1), ("left-posterior-superior", -1)])
def test_surfaces_of_slicer_point_outwards_in_their_system(tmp_path, system, turn):
    field = Field(ball(12, 13, 14), placement=Placement([[2.0, 0, 0, 5], [0, 3.0, 0, 6], [0, 0, 4.0, 7]], crs=system))
    (_, points, cells), = slicer_iso.surfaces(written(tmp_path, field, 0.0))
    centre = np.array([turn * (5 + 2 * 6.0), turn * (6 + 3 * 6.5), 7 + 4 * 7.0])
    assert np.allclose(points.mean(axis=0), centre, atol=0.5)
    a, b, c = (points[cells[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->i", np.cross(a - centre, b - centre), c - centre).sum() / 6
    assert volume == pytest.approx(24 * 4 / 3 * np.pi * 4**3, rel=0.06)


def test_slicer_is_handed_the_meshes(tmp_path, monkeypatch):
    """By its calls alone: nodes of models with points and triangles; a message for a file of curves."""
    from vtk.util.numpy_support import vtk_to_numpy

    nodes, messages = [], []

    class Node(SimpleNamespace):
        def SetAndObservePolyData(self, mesh):
            self.mesh = mesh

        def CreateDefaultDisplayNodes(self):
            self.shown = True

        def GetID(self):
            return self.name

    def added(kind, name):
        nodes.append(Node(kind=kind, name=name))
        return nodes[-1]

    monkeypatch.setitem(sys.modules, "slicer", SimpleNamespace(
        mrmlScene=SimpleNamespace(AddNewNodeByClass=added), util=SimpleNamespace(errorDisplay=messages.append)))
    parent = SimpleNamespace()
    reader = slicer_iso.slicer_isoFileReader(parent)
    path = written(tmp_path, ball(12, 13, 14), 0.0, 1.0)
    assert reader.canLoadFile(path) and reader.load({"fileName": path})
    assert parent.loadedNodes == ["isovalue 0", "isovalue 1"] and all(node.shown for node in nodes)
    for node, (_, points, cells) in zip(nodes, slicer_iso.surfaces(path), strict=True):
        assert node.kind == "vtkMRMLModelNode"
        assert np.array_equal(vtk_to_numpy(node.mesh.GetPoints().GetData()), points)
        assert np.array_equal(vtk_to_numpy(node.mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3), cells)
    assert not reader.load({"fileName": written(tmp_path, ball(20, 24), 0.0)})
    assert messages == ["the file has curves, no surfaces"]


def test_a_bundle_decodes_with_numpy_alone(tmp_path):
    path, bundle = written(tmp_path, ball(20, 24), 0.0), tmp_path / "isocodec.zip"
    done = CliRunner().invoke(main, ["plugins", "--bundle", str(bundle), "--json"])
    assert done.exit_code == 0 and json.loads(done.output)["bundle"] == str(bundle)
    assert bundle.stat().st_size < 3_000_000
    with zipfile.ZipFile(bundle) as archive:
        assert {name.split("/")[0] for name in archive.namelist()} == {"isocodec", "isospec", "construct"}
    script = (
        "import sys; import isocodec; contour = isocodec.open(sys.argv[1]).contour();"
        "print(len(contour.points), isocodec.__file__);"
        "print({m.split('.')[0] for m in sys.modules} & {'click', 'rich', 'scipy', 'shapely', 'matplotlib'})"
    )
    home = Path(np.__file__).parent.parent
    only = tmp_path / "only"
    only.mkdir()
    for name in ("numpy", "numpy.libs"):
        if (home / name).exists():
            (only / name).symlink_to(home / name)
    done = subprocess.run(
        [sys.executable, "-S", "-c", script, path], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(bundle), str(only)])},
    )
    count, home = done.stdout.splitlines()[0].split(" ", 1)
    assert int(count) == len(isocodec.open(path).contour().points) and home.startswith(str(bundle))
    assert done.stdout.splitlines()[1] == "set()"


def test_a_plugin_for_each_program_is_where_it_is_listed(tmp_path, monkeypatch):
    done = CliRunner().invoke(main, ["plugins", "--json"])
    assert done.exit_code == 0 and all(Path(place).exists() for place in json.loads(done.output).values())
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    done = CliRunner().invoke(main, ["plugins", "--qgis", "--json"])
    home = Path(json.loads(done.output)["qgis"])
    assert done.exit_code == 0 and home.is_relative_to(tmp_path)
    assert (home / "metadata.txt").exists() and (home / "bundle/isocodec/plugins/gdal_iso.py").exists()
    assert CliRunner().invoke(main, ["plugins", "--bundle", str(tmp_path / "bundle.tar")]).exit_code == 2
