"""DICOM as it lies about: without suffix, preamble or meta group, among other files; films in colour."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
import pytest
from isocodec.io.readers.source import is_dicom

import isocodec
from commands import fails
from dicom_files import header, slices, stored

NAMES = {"IM": "IM{:04d}", "counted": "IM{}", "ima": "{}.IMA", "uid": "1.2.840.{}", "dcm": "{:03d}.dcm"}
ORDER = [11, 2, 0, 10, 1]
"""Numbers in the names of slices, whose order is not that of their positions."""
BARE = [(preamble, implicit, little) for preamble in (True, False) for implicit, little in
        ((True, True), (False, True), (False, False))]


def bare(path: Path, made: Any, preamble: bool, implicit: bool, little: bool) -> None:
    """Write a file, with a preamble and its meta group or without both."""
    if preamble:
        uid = pydicom.uid.ImplicitVRLittleEndian if implicit else pydicom.uid.ExplicitVRLittleEndian
        made.file_meta.TransferSyntaxUID = uid if little else pydicom.uid.ExplicitVRBigEndian
        pydicom.dcmwrite(path, made, enforce_file_format=True, implicit_vr=implicit, little_endian=little)
        return
    pydicom.dcmwrite(path, pydicom.Dataset(made), implicit_vr=implicit, little_endian=little)


def scattered(tmp_path: Path, name: str, kind: tuple[bool, bool, bool], placed: bool = True) -> Path:
    """Write a folder of slices with such names, and files that are no slices."""
    folder = tmp_path / "in"
    folder.mkdir()
    for path, number in zip(sorted(slices(tmp_path / "out", stored()).iterdir()), ORDER, strict=True):
        made = pydicom.dcmread(path)
        if not placed:
            del made.InstanceNumber, made.ImagePositionPatient, made.ImageOrientationPatient
        if not kind[2]:
            made["PixelData"].VR, made.PixelData = "OW", np.frombuffer(made.PixelData, "<u2").astype(">u2").tobytes()
        bare(folder / NAMES[name].format(number), made, *kind)
    (folder / "README").write_text("slices")
    (folder / "series.json").write_text('{"a": 1}')
    (folder / "empty").write_bytes(b"")
    (folder / "zeros").write_bytes(bytes(400))
    (folder / "short").write_bytes(b"\x08\0\x05\0")
    index = header(pydicom.uid.MediaStorageDirectoryStorage, 1, 1, np.dtype("u1"))
    for attribute in ("Rows", "Columns"):
        delattr(index, attribute)
    index.save_as(folder / "DICOMDIR", enforce_file_format=True)
    return folder


@pytest.mark.parametrize("kind", BARE)
@pytest.mark.parametrize("name", NAMES)
def test_folders_of_slices(tmp_path: Path, name: str, kind: tuple[bool, bool, bool]) -> None:
    """Values by positions, whatever files are called; a single file is read, too."""
    folder = scattered(tmp_path, name, kind)
    field = isocodec.read(folder)
    assert np.array_equal(field.values, stored().transpose(2, 1, 0))
    assert field.placement.matrix[2].round(6).tolist() == [0, 0, 2.5, 30]
    one = folder / NAMES[name].format(ORDER[3])
    assert is_dicom(one)
    assert np.array_equal(isocodec.read(one).values, stored()[3].T)


@pytest.mark.parametrize("name", ["IM", "counted"])
def test_slices_without_positions(tmp_path: Path, name: str) -> None:
    """Slices that nothing else orders come as their names count them."""
    field = isocodec.read(scattered(tmp_path, name, (True, False, True), placed=False))
    assert np.array_equal(field.values, stored()[np.argsort(ORDER)].transpose(2, 1, 0))


def test_an_index_alone(tmp_path: Path) -> None:
    """A DICOMDIR holds no samples, and a folder without DICOM is none."""
    folder = scattered(tmp_path, "IM", (True, False, True))
    assert "give a file or folder of slices" in fails(3, "encode", folder / "DICOMDIR", "-o", tmp_path / "a.iso",
                                                      "--isovalue", 5)
    for path in folder.glob("IM*"):
        path.unlink()
    (folder / "DICOMDIR").unlink()
    assert not any(map(is_dicom, folder.iterdir()))
    shutil.rmtree(folder)


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize(("colours", "planar"), [
    ("MONOCHROME2", 0), ("RGB", 0), ("RGB", 1), ("YBR_FULL", 0), ("YBR_FULL", 1), ("YBR_FULL_422", 0),
])
def test_films(tmp_path: Path, colours: str, planar: int, timed: bool) -> None:
    """One frame of a film, and one channel of that, as pydicom has them."""
    several = 1 if colours == "MONOCHROME2" else 3
    raw = np.random.default_rng(1).integers(0, 256, (4, 6, 8, several), dtype=np.uint8)
    made = header(pydicom.uid.UltrasoundMultiFrameImageStorage, 6, 8, raw.dtype)
    made.Modality, made.NumberOfFrames, made.SamplesPerPixel, made.PhotometricInterpretation = "US", 4, several, colours
    if timed:
        made.FrameTime = 40
    if several == 3:
        made.PlanarConfiguration = planar
    if colours == "YBR_FULL_422":  # two of Y, one of each other
        pairs = raw.reshape(-1, 2, 3)
        raw = np.concatenate([pairs[:, :, 0], pairs[:, 0, 1:]], axis=1)
    made.PixelData = (raw.transpose(0, 3, 1, 2) if planar else raw).tobytes()
    made["PixelData"].VR = "OB"
    made.save_as(tmp_path / "film", enforce_file_format=True)
    frames = pydicom.pixels.pixel_array(tmp_path / "film")
    for frame in (0, 3):
        for channel in range(several):
            field = isocodec.read(tmp_path / "film", frame=frame, **({"channel": channel} if several > 1 else {}))
            asked = frames[frame][..., channel] if several > 1 else frames[frame]
            assert np.array_equal(field.values, asked.T)
    assert "--frame 0 to 3" in fails(3, "encode", tmp_path / "film", "-o", tmp_path / "a.iso", "--isovalue", 5,
                                     *(["--channel", 1] if several > 1 else []))
