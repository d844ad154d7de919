"""Masks and labels in files of rasterio, nibabel and SimpleITK, read back by these libraries; arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import OptionError
from isocodec.field.placement import LPS
from isocodec.io.formats import SampleMask
from written_contents import content, written

VOLUMES = (".nii", ".nii.gz", ".nrrd", ".mha")


@pytest.mark.parametrize(("what", "place"), [("mask", "utm"), ("labels", "mirrored"), ("mask", "turned")])
def test_rasters_lie_where_the_samples_do(tmp_path: Path, what: str, place: str) -> None:
    import rasterio

    mask = content(what, place)
    path, made = written(tmp_path, ".tif", mask)
    with rasterio.open(path) as file:
        assert np.array_equal(file.read(1), mask.values) and file.crs.to_string() == mask.placement.crs
        where = mask.placement.place(np.array([[3.0, 5.0]]))[0]
        assert np.allclose(file.transform @ (5.5, 3.5) if hasattr(file.transform, "__matmul__")
                           else file.transform * (5.5, 3.5), where)
    assert not made.remarks


@pytest.mark.parametrize("suffix", VOLUMES)
@pytest.mark.parametrize(("what", "place"), [("mask of space", "ras"), ("labels of space", "lps")])
def test_volumes_lie_where_the_samples_do(tmp_path: Path, suffix: str, what: str, place: str) -> None:
    mask = content(what, place)
    path, made = written(tmp_path, suffix, mask)
    at = np.array([3, 4, 5])
    where = mask.placement.place(at[None].astype(float))[0] * ([-1, -1, 1] if mask.placement.crs == LPS else 1)
    if suffix.startswith(".nii"):
        import nibabel

        image = nibabel.load(path)
        values, found = np.asarray(image.dataobj), nibabel.affines.apply_affine(image.affine, at)
        assert image.header["sform_code"] > 0
    else:
        import SimpleITK

        image = SimpleITK.ReadImage(str(path))
        values = SimpleITK.GetArrayFromImage(image).T
        found = np.array(image.TransformIndexToPhysicalPoint(at.tolist())) * [-1, -1, 1]
    assert np.array_equal(values, mask.values) and not made.remarks
    # ITK has directions at right angles only within a tolerance
    assert np.allclose(found, where, atol=1e-4)


@pytest.mark.parametrize(("suffix", "what", "word"), [
    (".tif", "mask", "without a reference system"), (".mha", "labels of space", "steps of 1"),
    (".nrrd", "mask of space", "steps of 1"), (".nii", "mask of space", ""), (".nii.gz", "labels of space", "")])
def test_samples_without_a_placement(tmp_path: Path, suffix: str, what: str, word: str) -> None:
    path, made = written(tmp_path, suffix, (what, "samples"))
    assert any(word in remark for remark in made.remarks) == bool(word)
    if suffix.startswith(".nii"):
        import nibabel

        assert nibabel.load(path).header["sform_code"] == 0


@pytest.mark.parametrize("suffix", [".nii.gz", ".nrrd"])
def test_planes_are_volumes_of_one_slice(tmp_path: Path, suffix: str) -> None:
    import SimpleITK

    mask = content("labels", "plane")
    image = SimpleITK.ReadImage(str(written(tmp_path, suffix, mask)[0]))
    assert image.GetSize() == (*mask.values.shape, 1)
    assert np.array_equal(SimpleITK.GetArrayFromImage(image)[0].T, mask.values)


@pytest.mark.parametrize("dtype", ["u1", "i2", "i4", "f4", "f8"])
@pytest.mark.parametrize("suffix", [".tif", ".nii", ".nrrd"])
def test_labels_keep_their_type(tmp_path: Path, suffix: str, dtype: str) -> None:
    labels = (np.arange(12).reshape(3, 4) * 10).astype(dtype)
    path, _ = written(tmp_path, suffix, SampleMask(labels))
    if suffix == ".tif":
        import rasterio

        with pytest.warns(rasterio.errors.NotGeoreferencedWarning), rasterio.open(path) as file:
            values: Any = file.read(1)
    else:
        import SimpleITK

        values = SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(str(path)))[0].T
    assert np.array_equal(values, labels) and values.dtype == labels.dtype


def test_a_raster_holds_no_volume(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"one of \.nii"):
        written(tmp_path, ".tif", ("mask of space", "ras"))


def test_arrays_are_in_samples_with_their_placement(tmp_path: Path) -> None:
    for place in ("utm", "samples"):
        contour, tin = content("curve", place), content("tin", place)
        with np.load(written(tmp_path, ".npz", contour)[0]) as arrays:
            assert np.array_equal(arrays["points"], contour.points) and np.array_equal(arrays["cells"], contour.cells)
            assert arrays["isovalue"] == 80.5 and tuple(arrays["shape"]) == contour.shape
            assert ("placement" in arrays) == (place == "utm")
            if place == "utm":
                assert np.array_equal(arrays["placement"], contour.placement.matrix)
                assert str(arrays["crs"]) == "EPSG:32631"
        with np.load(written(tmp_path, ".npz", tin)[0]) as arrays:
            assert np.array_equal(arrays["values"], tin.values) and np.array_equal(arrays["cells"], tin.triangles)
            assert tin.removals is None or np.array_equal(arrays["order"], tin.removals.order)
            assert place != "utm" or np.array_equal(arrays["placement"], contour.placement.matrix)
        assert np.array_equal(np.load(written(tmp_path, ".npy", tin)[0]), tin.raster(), equal_nan=True)
    mask = content("mask")
    assert np.array_equal(np.load(written(tmp_path, ".npy", mask)[0]), mask.values)


def test_masks_of_a_file_are_those_of_the_field() -> None:
    field = np.random.default_rng(0).integers(0, 9, (20, 30))
    assert np.array_equal(isocodec.open(isocodec.encode(field, 4.5, precision="exact")).above(), field > 4.5)
