"""Files in pairs, distinguished by what is in their headers: NIfTI, Analyze and ENVI; colours of NIfTI; zipped Zarr."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError
from libraries import Late
from tables import looped

nibabel = Late("nibabel")
rasterio = Late("rasterio")
from_origin = Late("rasterio.transform.from_origin")
zarr = Late("zarr")

VOLUME = np.arange(60, dtype=np.int16).reshape(3, 4, 5)
AFFINE = np.array([[-2.0, 0, 0, 5], [0, 3, 0, 6], [0, 0, 4, -7], [0, 0, 0, 1]])
PLANE = np.arange(60, dtype=np.float32).reshape(6, 10)


@looped("kind", ["Nifti1Pair", "AnalyzeImage", "Spm99AnalyzeImage", "scaled"])
@looped("given", [".hdr", ".img"])
def test_pairs_of_volumes(tmp_path: Path, kind: str, given: str) -> None:
    """Values and places as nibabel has them, whichever of the two files is given."""
    made: Any = getattr(nibabel, kind, nibabel.Nifti1Pair)(VOLUME, AFFINE if "Analyze" not in kind else None)
    if kind == "scaled":
        made = nibabel.Nifti1Pair(VOLUME * 0.37, AFFINE)
        made.set_data_dtype(np.int16)
    nibabel.save(made, tmp_path / "a.img")
    asked = nibabel.load(tmp_path / "a.img")
    field = isocodec.read(tmp_path / f"a{given}")
    assert np.array_equal(field.values, np.array(asked.dataobj))
    assert np.allclose(field.placement.matrix, asked.affine[:3])
    assert any("left and right" in remark for remark in field.remarks) == ("Analyze" in kind)


def test_halves_of_pairs(tmp_path: Path) -> None:
    """A pair that is cut short, or of which one file is missing."""
    nibabel.save(nibabel.Nifti1Pair(VOLUME, AFFINE), tmp_path / "a.img")
    (tmp_path / "a.img").write_bytes((tmp_path / "a.img").read_bytes()[:-2])
    with pytest.raises(InputError, match="cannot be read"):
        isocodec.read(tmp_path / "a.hdr")
    (tmp_path / "a.img").unlink()
    with pytest.raises(FileNotFoundError, match=r"a.img"):
        isocodec.read(tmp_path / "a.hdr")


@looped("name", ["a.dat", "a.img", "a", "a.bsq", "a.DAT", "a.b.dat"])
def test_envi(tmp_path: Path, name: str) -> None:
    """Values, places and missing samples as GDAL has them, by the file with the samples alone; a band of several."""
    path = tmp_path / name
    with rasterio.open(path, "w", driver="ENVI", width=10, height=6, count=2, dtype="float32", nodata=7,
                       transform=from_origin(100, 200, 3, 2), crs="EPSG:32633") as file:
        file.write(PLANE + 1, 1)
        file.write(PLANE, 2)
    with pytest.raises(InputError, match="give the file with the samples"):
        isocodec.read(path.with_suffix(".hdr"), band=2)
    field = isocodec.read(path, band=2)
    with rasterio.open(path, driver="ENVI") as file:
        assert np.array_equal(field.values, file.read(2)) and np.array_equal(field.mask, file.read_masks(2) == 0)
    assert field.placement.matrix.tolist() == [[0, 3, 101.5], [-2, 0, 199]] and field.crs == "EPSG:32633"


@looped("kind, suffix", [("RGB", ".nii"), ("RGBA", ".nii.gz"), ("RGB", ".img")])
def test_colours_of_nifti(tmp_path: Path, kind: str, suffix: str) -> None:
    """They are refused: a field has one number for each sample."""
    stored = np.zeros(VOLUME.shape, [(name, "u1") for name in kind])
    for number, name in enumerate(kind):
        stored[name] = VOLUME + number
    path = tmp_path / f"a{suffix}"
    nibabel.save((nibabel.Nifti1Pair if suffix == ".img" else nibabel.Nifti1Image)(stored, AFFINE), path)
    with pytest.raises(InputError, match=r"'R'.*'G'.*give a part"):
        isocodec.read(path)


@looped("version", [2, 3])
@looped("kind", ["array", "group"])
def test_zipped_zarr(tmp_path: Path, version: int, kind: str) -> None:
    """A store in a zip; not the folder that is one, which zarr does not find."""
    folder, out = tmp_path / "in" / "a.zarr", tmp_path / "a.zarr.zip"
    if kind == "array":
        made = zarr.create_array(folder, shape=PLANE.shape, chunks=(4, 3), dtype="f4", zarr_format=version)
    else:
        group = zarr.open_group(folder, mode="w", zarr_format=version)
        made = group.create_array("deep/v", shape=PLANE.shape, chunks=(4, 3), dtype="f4")
    made[:] = PLANE
    shutil.make_archive(str(out.with_suffix("")), "zip", folder)
    assert np.array_equal(isocodec.read(out).values, PLANE)
    shutil.make_archive(str(out.with_suffix("")), "zip", folder.parent, "a.zarr")
    with pytest.raises(InputError, match="zip what is in the folder"):
        isocodec.read(out)
