"""Series of volumes in 4-D files, as nibabel and SimpleITK have them, and arrays of four axes as series."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import pytest
import SimpleITK as sitk

import isocodec
from commands import fails, ok, run
from inputs import read_field

AFFINE = np.array([[0.0, -3, 0, 10], [2, 0, 0, 20], [0, 0, 4, -30], [0, 0, 0, 1]])
I, J, K = np.mgrid[:12, :14, :10]


def beating(count: int = 4) -> np.ndarray:
    """A ball that grows, (i, j, k, count) int16."""
    return np.stack(
        [np.rint(10 * np.sqrt((I - 5.6) ** 2 + (J - 6.7) ** 2 + (K - 4.4) ** 2) - 6 * t) for t in range(count)], axis=-1
    ).astype(np.int16)


def saved(path: Path, data: np.ndarray, unit: str = "sec", slope: tuple[float, float] | None = None) -> Any:
    """The image as nibabel reads it back."""
    image = nibabel.Nifti1Image(data, AFFINE)
    image.header.set_zooms((2.0, 3.0, 4.0, 1.5))
    image.header.set_xyzt_units("mm", unit)
    if slope is not None:
        image.header.set_slope_inter(*slope)
    nibabel.save(image, path)
    return nibabel.load(path)


@pytest.mark.parametrize("name", ["v.nii", "v.nii.gz"])
def test_volumes_are_frames(tmp_path: Path, name: str) -> None:
    """Signs, coordinates and the time from one to the next are those of nibabel."""
    image = saved(tmp_path / name, beating())
    record = json.loads(ok("encode", tmp_path / name, "-o", tmp_path / "v.iso", "--isovalue", 20.5, "--frames",
                           "--frame-interval", 2, "--json"))
    assert record["shape"] == [12, 14, 10, 4] and record["dtype"] == "int16"
    data = (tmp_path / "v.iso").read_bytes()
    info = isocodec.open(data).info
    assert len(info.frames) == 4 and info.interval == 2 and info.metadata["frame_step"] == "1.5 s"
    stored = np.asarray(image.dataobj)
    for number in range(4):
        assert np.array_equal(isocodec.open(data).above(frame=number), stored[..., number] > 20.5)
        contour = isocodec.decode(data, frame=number)
        assert np.allclose(contour.placed, nibabel.affines.apply_affine(image.affine, contour.points))
        assert np.array_equal(read_field(tmp_path / name, frame=number), stored[..., number])


@pytest.mark.parametrize(
    ("slope", "dtype"), [((1.0, 0.0), np.int16), ((2.0, -3.0), np.int32), ((0.5, 1.0), np.float64)]
)
def test_scaling(tmp_path: Path, slope: tuple[float, float], dtype: type) -> None:
    """Of all volumes alike: whole numbers stay whole."""
    image = saved(tmp_path / "v.nii", beating().astype(">i2"), slope=slope)
    frames = isocodec.read(tmp_path / "v.nii", frames=True)
    assert len(frames.fields) == 4 and frames.fields[0].notes["frame_step"] == "1.5 s"
    for number, field in enumerate(frames.fields):
        found = field.values
        assert found.dtype == dtype and found.dtype.isnative and found.flags.c_contiguous
        assert np.array_equal(found, np.asarray(image.dataobj)[..., number])


@pytest.mark.parametrize(("unit", "step"), [("msec", "1.5 ms"), ("usec", "1.5 µs"), ("unknown", None), ("hz", None)])
def test_the_time_from_one_to_the_next(tmp_path: Path, unit: str, step: str | None) -> None:
    saved(tmp_path / "v.nii", beating(2), unit)
    ok("encode", tmp_path / "v.nii", "-o", tmp_path / "v.iso", "--isovalue", 20.5, "--frames", "--precision", "signs")
    assert isocodec.open(tmp_path / "v.iso").metadata.get("frame_step") == step


@pytest.mark.parametrize("name", ["v.nii", "v.nii.gz"])
def test_one_volume_is_in_memory_at_a_time(tmp_path: Path, name: str) -> None:
    image = nibabel.Nifti1Image(np.zeros((64, 64, 64, 12), np.int16), AFFINE)
    nibabel.save(image, tmp_path / name)
    one = 2 * 64**3
    tracemalloc.start()
    frames = isocodec.read(tmp_path / name, frames=True).fields
    assert all(not field.values.any() for field in frames)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(frames) == 12 and peak < 4 * one + (1 << 18)


def test_limits_count_a_volume(tmp_path: Path) -> None:
    saved(tmp_path / "v.nii", beating())
    command = ["encode", tmp_path / "v.nii", "-o", tmp_path / "v.iso", "--isovalue", 20.5]
    samples = 12 * 14 * 10
    for series in (["--frames"], ["--frame", 3]):
        ok(*command, *series, "--limit-samples", samples)
        assert "--limit-samples" in fails(6, *command, *series, "--limit-samples", samples - 1)
    assert "--frame 0 to 3" in fails(3, *command)


def test_isovalues_of_all_volumes(tmp_path: Path) -> None:
    data = beating()
    saved(tmp_path / "v.nii", data)
    record = json.loads(ok("encode", tmp_path / "v.nii", "-o", tmp_path / "v.iso", "--interval", 15, "--offset", 0.5,
                           "--frames", "--precision", "signs", "--json"))
    assert record["isovalues"] == [v + 0.5 for v in range(-90, 200, 15) if data.min() <= v + 0.5 < data.max()]
    command = ["encode", tmp_path / "v.nii", "-o", tmp_path / "v.iso", "--frames", "--isovalue"]
    (line,) = run(*command, 20).stderr.splitlines()
    assert f"{(data == 20).sum()} samples equal the isovalue 20" in line
    assert f"outside the data ({data.min()} to {data.max()})" in run(*command, 999).stderr


def test_missing_samples_and_labels(tmp_path: Path) -> None:
    data = beating().astype(np.float32)
    data[2:4, 3, 5] = np.nan
    saved(tmp_path / "v.nii", data)
    command = ["encode", tmp_path / "v.nii", "-o", tmp_path / "v.iso", "--frames"]
    assert json.loads(ok(*command, "--isovalue", 20.5, "--json"))["missing"] == 8
    assert np.array_equal(isocodec.open(tmp_path / "v.iso").valid(), ~np.isnan(data[..., 0]))
    ok(*command, "--isovalue", 20.5, "--missing", "above", "--precision", "signs")
    above = isocodec.open(tmp_path / "v.iso").above(frame=2)
    assert np.array_equal(above, np.where(np.isnan(data[..., 2]), True, data[..., 2] > 20.5))
    data[..., 2] = data[..., 3] = 7
    saved(tmp_path / "v.nii", data)
    assert "missing samples differ" in fails(3, *command, "--isovalue", 20.5)
    ok(*command, "--label", 7)
    assert isocodec.open(tmp_path / "v.iso").above(frame=3).all()
    assert not isocodec.open(tmp_path / "v.iso").above(frame=0).any() and not (data[..., 0] == 7).any()
    assert "no frame has the label 1234" in fails(3, *command, "--label", 1234)


def test_pictures_in_volumes(tmp_path: Path) -> None:
    """Volumes of one slice are pictures."""
    data = beating()[:, :, 4:5]
    saved(tmp_path / "v.nii", data)
    ok("encode", tmp_path / "v.nii", "-o", tmp_path / "v.iso", "--isovalue", 20.5, "--frames")
    assert isocodec.open(tmp_path / "v.iso").shape == (12, 14)
    assert np.array_equal(isocodec.open(tmp_path / "v.iso").above(frame=3), data[:, :, 0, 3] > 20.5)


@pytest.mark.parametrize("name", ["v.nii", "v.nii.gz"])
def test_files_that_end_early(tmp_path: Path, name: str) -> None:
    saved(tmp_path / name, np.random.default_rng(1).integers(0, 100, (12, 14, 10, 6)).astype(np.int16))
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: len(whole) * 2 // 3])
    fails(3, "encode", tmp_path / name, "-o", tmp_path / "v.iso", "--isovalue", 50.5, "--frames")
    assert not (tmp_path / "v.iso").exists()


def test_axes(tmp_path: Path) -> None:
    """That of volumes is the last one; of arrays any may be."""
    data = beating()
    saved(tmp_path / "v.nii", data)
    command = ["encode", tmp_path / "v.nii", "-o", tmp_path / "v.iso", "--isovalue", 20.5, "--frames", "--frame-axis"]
    first = (ok(*command, 3), (tmp_path / "v.iso").read_bytes())[1]
    ok(*command, -1)
    assert (tmp_path / "v.iso").read_bytes() == first
    assert "the last axis counts" in fails(2, *command, 0)
    np.save(tmp_path / "a.npy", np.moveaxis(data, -1, 1))
    command[1] = tmp_path / "a.npy"
    ok(*command, 1)
    assert isocodec.open(tmp_path / "v.iso").shape == (12, 14, 10)
    for number in range(4):
        assert np.array_equal(isocodec.open(tmp_path / "v.iso").above(frame=number), data[..., number] > 20.5)
    assert "axes 0 to 3" in fails(2, *command, 4)
    np.save(tmp_path / "a.npy", data[0, 0])
    assert "three or four axes" in fails(2, *command, 0)


def test_series_of_itk(tmp_path: Path) -> None:
    data = beating()
    image = sitk.GetImageFromArray(data.T, isVector=False)
    image.SetSpacing([2.0, 3.0, 4.0, 1.0])
    sitk.WriteImage(image, tmp_path / "v.nrrd")
    ok("encode", tmp_path / "v.nrrd", "-o", tmp_path / "v.iso", "--isovalue", 20.5, "--frames")
    for number in range(4):
        assert np.array_equal(isocodec.open(tmp_path / "v.iso").above(frame=number), data[..., number] > 20.5)
    contour = isocodec.decode(tmp_path / "v.iso", frame=1)
    there = [image.TransformContinuousIndexToPhysicalPoint([*map(float, point), 1.0])[:3] for point in contour.points]
    assert np.allclose(contour.placed, np.array(there) * [-1, -1, 1])


def test_slices_of_one_volume(tmp_path: Path) -> None:
    data = beating()
    saved(tmp_path / "v.nii", data)
    ok("encode", tmp_path / "v.nii", "-o", tmp_path / "v.iso", "--isovalue", 20.5, "--frames", "--frame", 2,
       "--frame-axis", 2)
    for number in range(10):
        assert np.array_equal(isocodec.open(tmp_path / "v.iso").above(frame=number), data[:, :, number, 2] > 20.5)


def test_a_frame_is_held_against_its_volume(tmp_path: Path) -> None:
    saved(tmp_path / "v.nii", beating())
    ok("encode", tmp_path / "v.nii", "-o", tmp_path / "v.iso", "--isovalue", 20.5, "--frames")
    for number in range(4):
        said = ok("verify", tmp_path / "v.iso", tmp_path / "v.nii", "--frame", number, "--within", 0.05)
        assert ": kept; promised within 0.05 cells: 0.04" in said
