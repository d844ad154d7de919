"""The registry of readers, held against itself: every suffix with every way in which a file can be wrong."""

from __future__ import annotations

import ast
import inspect
import shutil
from pathlib import Path
from typing import Any

import h5py
import meshio
import numpy as np
import pytest
import pyvista as pv
import vtk
import xarray
import zarr
from pydicom.dataset import FileDataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, SecondaryCaptureImageStorage, generate_uid
from vtk.util.numpy_support import numpy_to_vtk

import isocodec
from inputs import CELLS, raster, written
from isocodec.errors import InputError, OptionError
from isocodec.io import readers
from isocodec.io.readers import from_rasterio
from isocodec.io.readers.input_formats import (
    FIELD_SUFFIXES,
    FORMATS,
    MESH_FORMATS,
    MESH_SUFFIXES,
    POINT_SUFFIXES,
    holds_mesh,
    open_file,
    recognised,
)

HOME = Path(inspect.getfile(readers)).parent
SUFFIXES = [*dict.fromkeys((*FIELD_SUFFIXES, *MESH_SUFFIXES, *POINT_SUFFIXES))]
GRIB = (".grib", ".grib2", ".grb", ".grb2")
POINTS = np.array([[0.0, 0], [4, 0], [0, 3], [5, 4], [2, 2]])
TRIANGLES = np.array([[0, 1, 4], [1, 3, 4], [3, 2, 4], [2, 0, 4]])


def dicom(path: Path) -> None:
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = SecondaryCaptureImageStorage, generate_uid()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    one = FileDataset("", {}, file_meta=meta, preamble=bytes(128))
    one.SOPClassUID, one.SOPInstanceUID = SecondaryCaptureImageStorage, meta.MediaStorageSOPInstanceUID
    one.SeriesInstanceUID, one.StudyInstanceUID, one.Modality = generate_uid(), generate_uid(), "OT"
    one.Rows, one.Columns, one.SamplesPerPixel, one.PhotometricInterpretation = 40, 30, 1, "MONOCHROME2"
    one.BitsAllocated, one.BitsStored, one.HighBit, one.PixelRepresentation = 16, 16, 15, 0
    one.PixelData = np.arange(1200, dtype=np.uint16).tobytes()
    one.save_as(path, enforce_file_format=True)


def of_pyvista(path: Path, suffix: str) -> None:
    """Grids, meshes, parallel files with one piece, and collections of one."""
    image = pv.ImageData(dimensions=(4, 5, 6))
    data = {"r": image.cast_to_rectilinear_grid(), "s": image.cast_to_structured_grid(), "u": image.to_tetrahedra(),
            "p": pv.Sphere(theta_resolution=6, phi_resolution=5)}.get(suffix[-1], image)
    data.clear_data()
    data.point_data["height"] = np.arange(data.n_points, dtype=float)
    if suffix in (".xdmf", ".xmf"):
        path.write_text(
            '<Xdmf><Domain><Grid Name="g"><Topology TopologyType="2DCoRectMesh" Dimensions="3 4"/><Geometry '
            'GeometryType="ORIGIN_DXDY"><DataItem Dimensions="2">0 0</DataItem><DataItem Dimensions="2">1 1</DataItem>'
            '</Geometry><Attribute Name="a" Center="Node"><DataItem Dimensions="3 4">1 2 3 4 5 6 7 8 9 10 11 12'
            "</DataItem></Attribute></Grid></Domain></Xdmf>"
        )
    elif suffix in (".vtm", ".pvd"):
        data.save(path.with_name("part.vti"))
        kind, inner = {".vtm": ("vtkMultiBlockDataSet",) * 2, ".pvd": ("Collection",) * 2}[suffix]
        path.write_text(f'<VTKFile type="{kind}" version="1.0"><{inner}><DataSet index="0" file="part.vti"/></{inner}>'
                        "</VTKFile>")
    elif suffix.startswith(".pv"):
        name = "UnstructuredGrid" if suffix == ".pvtu" else "PolyData" if suffix == ".pvtp" else {
            "i": "ImageData", "r": "RectilinearGrid", "s": "StructuredGrid"}[suffix[-1]]
        writer = getattr(vtk, f"vtkXMLP{name}Writer")()
        writer.SetFileName(str(path))
        writer.SetInputData(data)
        writer.Write()
    else:
        data.save(path)


def image_data(path: Path) -> None:
    made = vtk.vtkImageData()
    made.SetDimensions(4, 5, 6)
    array = numpy_to_vtk(np.arange(120.0), deep=True)
    array.SetName("density")
    made.GetPointData().AddArray(array)
    writer = vtk.vtkXMLImageDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(made)
    writer.Write()


def grib(path: Path) -> None:
    eccodes = pytest.importorskip("eccodes")
    message = eccodes.codes_grib_new_from_samples("regular_ll_sfc_grib2")
    with path.open("wb") as file:
        eccodes.codes_write(message, file)
    eccodes.codes_release(message)


def points(path: Path, suffix: str) -> None:
    values = np.arange(5.0)
    if suffix in (".csv", ".xyz"):
        rows = np.column_stack([POINTS, values])
        np.savetxt(path, rows, delimiter="," if suffix == ".csv" else " ")
    elif suffix in (".las", ".laz"):
        import laspy

        cloud = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
        cloud.x, cloud.y, cloud.z = *POINTS.T, values
        cloud.write(str(path))
    else:
        import geopandas

        geopandas.GeoDataFrame({"z": values}, geometry=geopandas.points_from_xy(*POINTS.T)).to_file(path)


def made(folder: Path, suffix: str) -> Path:
    """A file of that suffix that can be read."""
    path = folder / f"a{suffix}"
    if suffix == ".zarr":
        stored = zarr.open(str(path), mode="w", shape=CELLS.shape, chunks=CELLS.shape, dtype="u1")
        stored[:] = CELLS
    elif suffix == ".zarr.zip":
        shutil.make_archive(str(path.with_suffix("")), "zip", made(folder, ".zarr"))
    elif suffix in (".h5", ".hdf5", ".nc"):
        with h5py.File(path, "w") as file:
            file["x"] = CELLS[0]
    elif suffix == ".vti":
        image_data(path)
    elif suffix.startswith((".vt", ".pv", ".x")) and suffix not in (".vtu", ".xyz"):
        of_pyvista(path, suffix)
    elif suffix == ".dcm":
        dicom(path)
    elif suffix in GRIB:
        grib(path)
    elif suffix in POINT_SUFFIXES:
        points(path, suffix)
    elif suffix in from_rasterio.DRIVERS and suffix not in (".tif", ".tiff"):
        return raster(folder, suffix)
    elif suffix in MESH_SUFFIXES and suffix not in FIELD_SUFFIXES:
        space = np.column_stack([POINTS, np.zeros(5)])
        meshio.write(path, meshio.Mesh(space, [("triangle", TRIANGLES)], point_data={"height": np.arange(5.0)}))
    else:
        return written(folder, {".jpeg": "a.jpg", ".tiff": "a.tif"}.get(suffix, f"a{suffix}"))[0].rename(path)
    return path


def spoilt(path: Path, how: str) -> Path:
    """The same name with something else behind it."""
    inner = path / "zarr.json" if path.is_dir() else path
    if how == "missing":
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    else:
        data = inner.read_bytes()
        cut = data[: len(data) * 9 // 20]
        inner.write_bytes({"empty": b"", "cut": cut, "other": b"nothing of the kind\n" * 9}[how])
    return path


@pytest.mark.parametrize("suffix, how", [
    pytest.param(suffix, how, marks=[pytest.mark.heavy] * (how != "missing" and suffix in GRIB[1:]))
    for suffix in SUFFIXES for how in ("missing", "empty", "cut", "other")
])
def test_every_suffix_with_every_fault(tmp_path: Path, suffix: str, how: str) -> None:
    """An error of ours that names the file in one line, or what the system has for a file that is missing."""
    path = made(tmp_path, suffix)
    if how == "missing":
        isocodec.read(path)
    spoilt(path, how)
    with pytest.raises(FileNotFoundError if how == "missing" else InputError) as caught:
        isocodec.read(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_suffix_stands_in_one_module(suffix: str) -> None:
    found = [
        path.name for path in HOME.glob("*.py")
        if any(isinstance(n, ast.Constant) and n.value == suffix for n in ast.walk(ast.parse(path.read_text("utf-8"))))
    ]
    assert len(found) == 1 and found[0].startswith("from_")


def test_records() -> None:
    """No suffix twice in a table, none hides behind another, and signatures lead to suffixes that there are."""
    assert len(set(FIELD_SUFFIXES)) == len(FIELD_SUFFIXES)
    meshes = MESH_SUFFIXES + POINT_SUFFIXES
    assert len(set(meshes)) == len(meshes)
    for each in (*FORMATS, *MESH_FORMATS):
        assert each.name and all(suffix == suffix.lower() and suffix[0] == "." for suffix in each.suffixes)
    for each in FORMATS:
        for at, sign, suffix in each.signatures:
            assert suffix in each.suffixes and recognised("", bytes(at) + sign + bytes(600)) == suffix
        for suffix in each.suffixes:
            assert recognised(f"https://somewhere/A{suffix.upper()}", b"") == suffix


@pytest.mark.parametrize("suffix", [suffix for suffix in FIELD_SUFFIXES if suffix not in GRIB])
def test_what_is_known_before_samples_are_read(tmp_path: Path, suffix: str) -> None:
    """Shape and type are those of what is read, whole, a window at a time and as a field."""
    with open_file(raster(tmp_path, suffix) if suffix == ".gpkg" else made(tmp_path, suffix)) as opened:
        values = opened.values()
        assert opened.shape == values.shape and opened.dtype == values.dtype
        windows = opened.windows()
        part = tuple(slice(0, 2) for _ in values.shape)
        if windows is not None:
            assert tuple(windows.shape) == values.shape and windows.dtype == values.dtype
            assert np.array_equal(windows[part], values[part])
        field = opened.field()
        assert np.array_equal(field.values, values)
        assert opened.place(values.ndim).placed == (field.placement is not None)


@pytest.mark.parametrize("suffix", [".npy", ".h5", ".tif", ".nii", ".mha", ".vti", ".npz"])
def test_a_file_is_opened_once(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By our modules; what libraries do is theirs."""
    path = made(tmp_path, suffix)
    count = [each for each in FORMATS if suffix in each.suffixes]
    assert len(count) == 1
    calls: list[Any] = []
    found = count[0].open

    def counted(*arguments: Any) -> Any:
        calls.append(arguments)
        return found(*arguments)

    confined = count[0].confined
    object.__setattr__(count[0], "open", counted)
    object.__setattr__(count[0], "confined", "")
    try:
        isocodec.read(path)
        isocodec.read(path, frames=True) if suffix in (".npy", ".npz", ".tif") else None
    finally:
        object.__setattr__(count[0], "open", found)
        object.__setattr__(count[0], "confined", confined)
    assert len(calls) == (2 if suffix in (".npy", ".npz", ".tif") else 1)


def test_series_in_memory_and_in_files(tmp_path: Path) -> None:
    """The same frames from a file, an open file, an array, a masked array and an array with labels."""
    values = np.arange(60.0).reshape(3, 4, 5)
    values[1, 2, 3] = -1
    np.save(tmp_path / "a.npy", values)
    labelled = xarray.DataArray(values, dims=("time", "y", "x"))
    with (tmp_path / "a.npy").open("rb") as file:
        for source in (tmp_path / "a.npy", file, values, labelled):
            fields = isocodec.read(source, frames=True, nodata=-1.0, missing="below").fields
            assert len(fields) == 3 and fields.shape == (4, 5) and fields[-1].missing == "below"
            assert all(np.array_equal(field.values, frame) for field, frame in zip(fields, values, strict=True))
            assert np.array_equal(np.argwhere(fields[1].mask), [[2, 3]])
            turned = isocodec.read(tmp_path / "a.npy", frames=True, axis=2).fields
            assert len(turned) == 5 and np.array_equal(turned[4].values, values[:, :, 4])
    masked = isocodec.read(np.ma.masked_equal(values, -1), frames=True).fields
    assert np.array_equal(np.argwhere(masked[1].mask), [[2, 3]])
    with pytest.raises(OptionError, match="frames=True"):
        isocodec.read(values, axis=1)
    with pytest.raises(OptionError, match="missing"):
        isocodec.read(values, missing="somewhere")


def test_a_marker_takes_the_place_of_that_of_the_file(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["z"] = CELLS[0]
        file["z"].attrs["_FillValue"] = np.uint8(3)
    for marker, gone in ((None, 3), (5.0, 5), (float("nan"), None)):
        mask = isocodec.read(tmp_path / "a.nc", nodata=marker).mask
        assert mask is None if gone is None else np.array_equal(mask, CELLS[0] == gone)


def test_meshes_and_points(tmp_path: Path) -> None:
    """What a name leaves open is decided by what is in the file."""
    found = isocodec.read(made(tmp_path, ".vtu"))
    assert isinstance(found, isocodec.Mesh) and np.array_equal(found.values, np.arange(5.0))
    assert np.array_equal(found.points, POINTS) and np.array_equal(found.cells, TRIANGLES)
    assert isocodec.read(made(tmp_path, ".csv")).cells is None
    np.savez(tmp_path / "mesh.npz", points=POINTS, cells=TRIANGLES, a=np.ones(5), b=np.zeros(5))
    assert holds_mesh(tmp_path / "mesh.npz") and not holds_mesh(made(tmp_path, ".npz"))
    assert isocodec.read(tmp_path / "mesh.npz").values is None
    assert np.array_equal(isocodec.read(tmp_path / "mesh.npz", key="b").values, np.zeros(5))
    with pytest.raises(OptionError, match="there is no frame 1"):
        isocodec.read(tmp_path / "mesh.npz", frame=1)
    with pytest.raises(OptionError, match="frame does not apply"):
        isocodec.read(made(tmp_path, ".csv"), frame=1)
