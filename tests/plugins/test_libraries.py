"""Registries of other libraries: napari's manifest, engines of xarray, readers of PyVista, meshio and trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import isocodec
import isocodec.plugins
from libraries import Late

meshio = Late("meshio")
npe2 = Late("npe2")
pyvista = Late("pyvista")
trimesh = Late("trimesh")
xarray = Late("xarray")


def ball(*sizes, radius=4.0):
    at = np.meshgrid(*(np.arange(size) - size / 2 for size in sizes), indexing="ij")
    return radius - np.sqrt(sum(x**2 for x in at))


@pytest.fixture
def surface(tmp_path):
    path = tmp_path / "surface.iso"
    path.write_bytes(isocodec.encode(isocodec.Field(ball(12, 13, 14), placement=[2.0, 3.0, 4.0]), [0.0, 1.0]))
    return path


def test_the_manifest_of_napari_names_what_there_is(surface):
    manifest = npe2.PluginManifest.from_file(Path(isocodec.plugins.__file__).parent / "napari.yaml")
    manifest.validate_imports()
    npe2.PluginManager.instance().register(manifest)
    (data, _, kind), *rest = npe2.read([str(surface)], stack=False, plugin_name="isocodec")
    assert kind == "surface" and len(rest) == 1 and np.array_equal(data[0], isocodec.open(surface).contour().points)


def test_meshes(surface):
    from isocodec.plugins import meshes_iso

    contours = isocodec.open(surface).contours()
    first = contours[0]
    blocks = pyvista.read(surface)
    assert [*blocks.keys()] == ["isovalue 0", "isovalue 1"]
    assert [block.n_points for block in blocks] == [len(each.points) for each in contours]
    mesh = meshio.read(surface)
    assert np.array_equal(mesh.points, np.concatenate([each.placed for each in contours]))
    corners = mesh.points[mesh.cells_dict["triangle"]]
    assert np.array_equal(corners[len(first.cells) :], contours[1].placed[contours[1].placed_cells])
    assert np.array_equal(mesh.cell_data["isovalue"][0], np.repeat([0.0, 1.0], [len(each.cells) for each in contours]))
    solid = trimesh.load_mesh(surface)
    assert solid.is_watertight and np.array_equal(solid.vertices, first.placed)
    assert meshes_iso.of_pyvista(isocodec.encode(ball(12, 13, 14), 0.0)).n_cells


def test_samples_and_contours_of_xarray(tmp_path):
    from isocodec.plugins import xarray_iso

    field = ball(20, 24)
    array = xarray.DataArray(field, dims=("y", "x"), coords={"y": np.arange(20) * 10.0, "x": np.arange(24) * 5.0})
    contour = array.iso.contour(0.5)
    assert np.array_equal(contour.placed, contour.points[:, ::-1] * [5.0, 10.0])
    path = tmp_path / "masks.iso"
    path.write_bytes(array.iso.encode([0.5, 1.5]))
    found = xarray.open_dataset(path, engine=xarray_iso.Backend)
    assert np.array_equal(found.above, np.stack([field > 0.5, field > 1.5]))
    labels = np.zeros((3, 20, 24), np.int16)
    labels[:, 3:9, 4:20], labels[1:, 12:18, 2:7] = 2, 5
    path.write_bytes(isocodec.encode(isocodec.Field(labels[1], labels="all")))
    assert np.array_equal(xarray.open_dataset(path, engine=xarray_iso.Backend).labels, labels[1])
    path.write_bytes(isocodec.encode(isocodec.Frames([field, field + 1]), [0.5]))
    found = xarray.open_dataset(path, engine=xarray_iso.Backend)
    assert found.above.dims[:2] == ("frame", "isovalue") and np.array_equal(found.above[1, 0], field + 1 > 0.5)
