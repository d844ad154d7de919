"""One opener: paths, URLs, open files, objects; what is chosen, refused and remarked on."""

from __future__ import annotations

import io
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, MissingExtraError, OptionError
from isocodec.io.opener import SUFFIXES, Choice, load
from tables import looped

HILLS = np.rint(100 - 3 * np.hypot(*(np.mgrid[:13, :17] - np.array([5.3, 8.2])[:, None, None]))).astype(np.int16)


def test_parameters() -> None:
    import inspect

    assert [*inspect.signature(isocodec.read).parameters] == [
        "source", "key", "band", "frame", "frames", "bbox", "nodata"]


def test_importing_is_light() -> None:
    """No library comes in before it is needed."""
    done = subprocess.run(
        [sys.executable, "-c", "import sys, isocodec.io.opener; print([n for n in ('xarray', 'rasterio', 'PIL', "
         "'tifffile', 'pandas', 'SimpleITK', 'vtk', 'numpy.ma') if n in sys.modules])"],
        capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_what_is_ours_stays() -> None:
    for thing in (isocodec.Field(HILLS), isocodec.Frames([HILLS]), isocodec.Mesh(np.zeros((3, 2)), None)):
        assert isocodec.read(thing) is thing


def written(folder: Path, suffix: str) -> Path:
    path = folder / f"a{suffix}"
    if suffix == ".npy":
        np.save(path, HILLS)
    elif suffix == ".npz":
        np.savez(path, values=HILLS)
    elif suffix == ".png":
        from PIL import Image

        Image.fromarray(HILLS.astype("u1")).save(path)
    elif suffix == ".tif":
        import tifffile

        tifffile.imwrite(path, HILLS)
    elif suffix == ".h5":
        import h5py

        with h5py.File(path, "w") as file:
            file["v"] = HILLS
    elif suffix == ".nc":
        import xarray

        xarray.DataArray(HILLS, dims=("y", "x"), name="v").to_netcdf(path, engine="scipy")
    return path


KINDS = [".npy", ".npz", ".png", ".tif", ".h5", ".nc"]


@pytest.mark.parametrize("suffix", KINDS)
def test_ways_to_give_a_file(tmp_path: Path, suffix: str) -> None:
    """By name, or by first bytes where there is none; nothing is said of what is kept."""
    path = written(tmp_path, suffix)
    with path.open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("error")
        for source in (path, str(path), file, io.BytesIO(path.read_bytes()), f"file://{path}"):
            assert np.array_equal(isocodec.read(source).values, HILLS)


def test_copies_of_files_last_as_long_as_their_samples(tmp_path: Path) -> None:
    """Series and windows of a URL are read later; then the copy goes."""
    np.save(tmp_path / "a.npy", np.stack([HILLS, HILLS + 1]))
    written(tmp_path, ".h5")
    series: Any = isocodec.read(f"file://{tmp_path}/a.npy", frames=True)
    assert np.array_equal(series.fields[1].values, HILLS + 1)
    lazy: Any = load(f"file://{tmp_path}/a.h5", Choice(), lazy=True)
    assert np.array_equal(lazy.values[2:5, 3:9], HILLS[2:5, 3:9])


def test_what_is_nothing_unknown_or_damaged(tmp_path: Path) -> None:
    for source, words in ((io.BytesIO(b"nothing known"), "unknown format"), (object(), "not numbers"),
                          ({"a": 1}, "not numbers")):
        with pytest.raises(InputError, match=words):
            isocodec.read(source)
    for source in (tmp_path / "no-such.npy", f"file://{tmp_path}/no-such.npy"):
        with pytest.raises(FileNotFoundError, match="no-such"):
            isocodec.read(source)
    for suffix, words in ((".xlsx", r"a\.xlsx: \.xlsx is not a supported format.*\.nii\.gz.*\.npy"), (".grib", "cdo")):
        (tmp_path / f"a{suffix}").write_text("1 2 3")
        with pytest.raises(InputError, match=words):
            isocodec.read(tmp_path / f"a{suffix}")
    for suffix in (".npy", ".npz", ".png", ".tif", ".h5", ".nc", ".las", ".mha", ".nii", ".vti"):
        (tmp_path / f"a{suffix}").write_bytes(b"this is a text, not a field\n" * 40)
        with pytest.raises(InputError) as caught:
            isocodec.read(tmp_path / f"a{suffix}")
        assert str(caught.value).startswith(str(tmp_path)) and "\n" not in str(caught.value)
        assert "0x" not in str(caught.value)  # where VTK keeps its objects
    for suffix in KINDS:
        path = written(tmp_path, suffix)
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        with pytest.raises(InputError, match=rf"^{path}: cannot be read as .*: \w+"):
            isocodec.read(path)


@looped("suffix, choice", [
    (".npy", {"band": 1}), (".png", {"key": "a"}), (".png", {"frames": True}), (".npz", {"band": 2}),
    (".npz", {"band": 2}), (".png", {"frame": 0}),
])
def test_choices_that_do_not_apply_are_refused(tmp_path: Path, suffix: str, choice: dict[str, Any]) -> None:
    with pytest.raises(OptionError, match="does not apply"):
        isocodec.read(written(tmp_path, suffix), **choice)


def test_choices_that_do_not_apply_to_objects_are_refused() -> None:
    """A mesh of meshio is none of these files, though it has a method ``read``."""
    import meshio
    import pyvista
    import xarray

    mesh = meshio.Mesh(np.eye(3), [("triangle", np.array([[0, 1, 2]]))], point_data={"z": np.arange(3.0)})
    read: Any = isocodec.read(mesh)
    assert read.values.tolist() == [0, 1, 2]
    grid = pyvista.ImageData(dimensions=(3, 4, 5))
    grid["a"] = np.arange(60.0)
    for thing, choice in ((grid, {"band": 2}), (HILLS, {"key": "a"}), (xarray.DataArray(HILLS), {"key": "a"}),
                          (mesh, {"frame": 0}), (isocodec.Field(HILLS), {"band": 1})):
        with pytest.raises(OptionError, match=f"does not apply to {type(thing).__name__}"):
            isocodec.read(thing, **choice)


@looped("module, suffix, extra", [
    ("tifffile", ".tif", "raster"), ("h5py", ".h5", "labelled"), ("PIL.Image", ".png", "pictures"),
])
def test_a_library_that_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, suffix: str, extra: str
) -> None:
    path = written(tmp_path, suffix)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError) as caught:
        isocodec.read(path)
    assert f"[{extra}]" in str(caught.value.remedy)


def test_a_series_within_a_box_and_with_a_marker(tmp_path: Path) -> None:
    import xarray

    coords = {"y": ("y", 6e6 - 30.0 * np.arange(13)), "x": ("x", 4e5 + 30.0 * np.arange(17))}
    array = xarray.DataArray(np.stack([HILLS, HILLS + 1]), dims=("t", "y", "x"), coords=coords)
    series: Any = isocodec.read(array, frames=True, bbox=(4e5, 6e6 - 100, 4e5 + 70, 6e6), nodata=91)
    for number, field in enumerate(series.fields):
        part = HILLS[:4, :3] + number
        assert np.array_equal(field.values, part)
        assert np.array_equal(np.zeros(part.shape, bool) if field.mask is None else field.mask, part == 91)


def test_objects_go_straight_into_encoding(tmp_path: Path) -> None:
    """With their places; encoders of single chunks refuse what would lose them."""
    import xarray

    coords = {"lat": ("lat", 50 - np.arange(13.0), {"units": "degrees_north"}),
              "lon": ("lon", 5 + np.arange(17.0), {"units": "degrees_east"})}
    array = xarray.DataArray(HILLS, dims=("lat", "lon"), coords=coords)
    field = isocodec.read(array)
    assert isocodec.encode(array, 90.5) == isocodec.encode(field, 90.5)
    series = isocodec.encode(isocodec.Frames([array, array]), 90.5)
    assert isocodec.open(series).crs == "EPSG:4326"
    isocodec.save(tmp_path / "a.iso", array, 90.5, tile=32)
    assert np.allclose(isocodec.open(tmp_path / "a.iso").placement.matrix, field.placement.matrix)
    with pytest.raises(InputError, match=r"isocodec\.read"):
        isocodec.Encoder(90.5).add(array)


def test_suffixes_are_listed_once() -> None:
    assert len({*SUFFIXES}) == len(SUFFIXES) and ".grib" not in SUFFIXES
