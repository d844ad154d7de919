"""Zarr, DICOM and VTK image data: written with the libraries of their users."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import fails, ok
from inputs import read_field, read_place
from isocodec.api.inputs import Choice, windowed
from isocodec.errors import OptionError
from libraries import Late
from places import matrix

pytestmark = pytest.mark.heavy

pydicom = Late("pydicom")
FileDataset = Late("pydicom.dataset.FileDataset")
FileMetaDataset = Late("pydicom.dataset.FileMetaDataset")
CTImageStorage = "1.2.840.10008.5.1.4.1.1.2"
ExplicitVRLittleEndian = "1.2.840.10008.1.2.1"
generate_uid = Late("pydicom.uid.generate_uid")
SimpleITK = Late("SimpleITK")
vtk = Late("vtk")
numpy_to_vtk = Late("vtk.util.numpy_support.numpy_to_vtk")
zarr = Late("zarr")

HILL = 100 - np.hypot(*(np.mgrid[:20, :30] - np.array([9.3, 14.2])[:, None, None])) * 5
BALL = 100 - np.linalg.norm(np.mgrid[:12, :13, :14] - np.array([5.6, 6.2, 6.9])[:, None, None, None], axis=0) * 10


def test_zarr_stores_that_are_an_array(tmp_path: Path) -> None:
    """As zarr.open makes them: without names and coordinates."""
    path, values = tmp_path / "a.zarr", np.stack([HILL, HILL + 1]).astype(np.float32)
    stored = zarr.open(str(path), mode="w", shape=values.shape, chunks=(1, 10, 10), dtype=values.dtype)
    stored[:] = values
    assert np.array_equal(isocodec.read(path).values, values)
    assert np.array_equal(read_field(path, frame=1), values[1])
    with pytest.raises(OptionError, match="no frame 2"):
        read_field(path, frame=2)
    ok("encode", path, "-o", tmp_path / "a.iso", "--isovalue", 70, "--frame", 1)
    assert np.array_equal(isocodec.open(tmp_path / "a.iso").above(), values[1] > 70)
    ok("encode", path, "-o", tmp_path / "b.iso", "--isovalue", 70, "--tile", 128)


def test_tiles_of_damaged_zarr(tmp_path: Path) -> None:
    field = np.random.default_rng(1).integers(0, 9, (40, 40))
    stored = zarr.open(str(tmp_path / "a.zarr"), mode="w", shape=field.shape, chunks=(20, 20), dtype=field.dtype)
    stored[:] = field
    chunk = next(p for p in sorted((tmp_path / "a.zarr").rglob("*")) if p.is_file() and p.name != "zarr.json")
    chunk.write_bytes(b"nothing")
    fails(3, "encode", tmp_path / "a.zarr", "-o", tmp_path / "b.iso", "--isovalue", 4.5, "--tile", 128)


def test_tiles_of_zarr_larger_than_memory(tmp_path: Path) -> None:
    """Coordinates are read without the samples: here more than the limit, of which no chunk is there."""
    path = tmp_path / "a.zarr"
    group = zarr.open_group(str(path), mode="w")
    size = 40_000
    group.create_array("z", shape=(size, size), chunks=(1000, 1000), dtype="float32", dimension_names=("y", "x"))
    for name, start, step in [("y", 9e6, -30.0), ("x", 4e5, 30.0)]:
        group.create_array(name, data=start + step * np.arange(size), dimension_names=(name,))
    place = windowed(path, Choice()).placement
    assert place is not None and place.matrix is not None and place.matrix.tolist() == [[0, 30, 4e5], [-30, 0, 9e6]]


# ---- DICOM ----------------------------------------------------------------------------------------------------------

TILT = np.array([[1, 0, 0], [0, np.cos(0.3), -np.sin(0.3)], [0, np.sin(0.3), np.cos(0.3)]])


def slices(folder: Path, count: int = 5, series: str = "1.2.3") -> np.ndarray:
    """A series of CT slices as pydicom writes it, names in no order; values in Hounsfield units, axes i, j, k."""
    folder.mkdir(exist_ok=True)
    volume = np.rint(BALL[:, :, :count] * 10).astype(np.int16)
    for k in range(count):
        meta = FileMetaDataset()
        meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = CTImageStorage, generate_uid()
        meta.TransferSyntaxUID = ExplicitVRLittleEndian
        one = FileDataset("", {}, file_meta=meta, preamble=bytes(128))
        one.SOPClassUID, one.SOPInstanceUID = CTImageStorage, meta.MediaStorageSOPInstanceUID
        one.SeriesInstanceUID, one.StudyInstanceUID, one.Modality = series, "1.2", "CT"
        one.Columns, one.Rows = volume.shape[:2]
        one.PixelSpacing, one.SliceThickness = [2.0, 1.5], 3.0
        one.ImageOrientationPatient = [*TILT[:, 0], *TILT[:, 1]]
        one.ImagePositionPatient = [*(np.array([-90.0, 12.5, 7.0]) + 3.0 * k * TILT[:, 2])]
        one.InstanceNumber, one.SamplesPerPixel, one.PhotometricInterpretation = k + 1, 1, "MONOCHROME2"
        one.BitsAllocated, one.BitsStored, one.HighBit, one.PixelRepresentation = 16, 16, 15, 1
        one.RescaleSlope, one.RescaleIntercept = 1, -1024
        one.PixelData = (volume[:, :, k].T + 1024).astype(np.int16).tobytes()
        one.save_as(folder / f"{(k * 7) % count:03}-{series}.dcm", enforce_file_format=True)
    return volume


def test_dicom_series(tmp_path: Path) -> None:
    """Sorted by position, rescaled, and where pydicom says that the samples lie."""
    volume = slices(tmp_path / "ct")
    field = isocodec.read(tmp_path / "ct")
    assert np.array_equal(field.values, volume)
    first = pydicom.dcmread(next(p for p in (tmp_path / "ct").iterdir() if pydicom.dcmread(p).InstanceNumber == 1))
    corner = np.array([float(x) for x in first.ImagePositionPatient])
    expected = np.column_stack([TILT[:, 0] * 1.5, TILT[:, 1] * 2.0, TILT[:, 2] * 3.0, corner])
    assert np.allclose(matrix(field), np.diag([-1.0, -1, 1]) @ expected, atol=1e-6)
    names = SimpleITK.ImageSeriesReader.GetGDCMSeriesFileNames(str(tmp_path / "ct"))
    assert np.allclose(matrix(isocodec.read(SimpleITK.ReadImage(names))), matrix(field), atol=1e-6)
    ok("encode", tmp_path / "ct", "-o", tmp_path / "ct.iso", "--isovalue", 650.5, "--precision", "exact")
    assert np.array_equal(isocodec.open(tmp_path / "ct.iso").above(), volume > 650.5)
    one = read_field(tmp_path / "ct" / "000-1.2.3.dcm")
    assert np.array_equal(one, volume[:, :, 0])
    assert read_place(tmp_path / "ct" / "000-1.2.3.dcm").in_space


# ---- VTK ------------------------------------------------------------------------------------------------------------


def image(path: Path, field: np.ndarray, *names: str, mode: str = "appended") -> None:
    made = vtk.vtkImageData()
    shape = (*field.shape, 1)[:3]
    made.SetExtent(2, shape[0] + 1, 0, shape[1] - 1, 0, shape[2] - 1)
    made.SetSpacing(0.5, 2, 3)
    made.SetOrigin(10, 20, 30)
    made.SetDirectionMatrix(0, -1, 0, 1, 0, 0, 0, 0, 1)
    for name in names:
        array = numpy_to_vtk(np.ascontiguousarray(field.T).ravel(), deep=True)
        array.SetName(name)
        made.GetPointData().AddArray(array)
    writer = vtk.vtkXMLImageDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(made)
    writer.SetDataMode(["ascii", "binary", "appended"].index(mode))
    writer.Write()


@pytest.mark.parametrize("mode", ["appended", "ascii", "binary"])
def test_vti(tmp_path: Path, mode: str) -> None:
    image(tmp_path / "a.vti", BALL, "density", mode=mode)
    field = isocodec.read(tmp_path / "a.vti")
    assert np.allclose(field.values, BALL, rtol=1e-5)
    assert field.placement is not None
    # the first point is number 2 along x
    assert np.allclose(field.placement.matrix, [[0, -2, 0, 10], [0.5, 0, 0, 21], [0, 0, 3, 30]])
    ok("encode", tmp_path / "a.vti", "-o", tmp_path / "a.iso", "--isovalue", 50)
    with (tmp_path / "a.vti").open("rb") as file:
        assert isocodec.read(file).shape == BALL.shape
