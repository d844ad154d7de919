"""Damaged and hostile files: none crashes this process, hangs, takes too much memory, or reaches other files."""

from __future__ import annotations

import gzip
import io
import json
import os
import struct
import subprocess
import sys
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import laspy
import meshio
import nibabel
import numpy as np
import pytest
import SimpleITK
import tifffile
import zarr
from PIL import Image

import foreign
import isocodec
from isocodec.errors import InputError, LimitError
from test_readers import GRIB, SUFFIXES, made

HERE = Path(__file__).parent
SAMPLES = 1 << 20
VOLUME = np.random.default_rng(4).integers(0, 900, (6, 7, 8)).astype(np.int16)


def outcomes(folder: Path, file: str, count: int, seed: int = 0, samples: int = SAMPLES) -> list[dict[str, Any]]:
    """Results of reading a file of ``folder/files``, or that many edits of it."""
    for name in ("secret", "site", "edited", "temp"):
        (folder / name).mkdir(exist_ok=True)
    (folder / "secret/key").write_bytes(b"KEY!" * 100)
    (folder / "site/sitecustomize.py").write_text(foreign.AUDIT)
    log = folder / "log"
    fine = [str(folder / name) for name in ("files", "edited", "temp")]
    fine += [str(HERE), *filter(None, map(os.path.abspath, sys.path))]
    environment = {
        **os.environ, "TMPDIR": str(folder / "temp"), "FOREIGN_LOG": str(log), "FOREIGN_FINE": os.pathsep.join(fine),
        "PYTHONPATH": os.pathsep.join([str(folder / "site"), *filter(None, sys.path)]),
    }
    found: list[dict[str, Any]] = []
    first = 0
    while True:
        call = [sys.executable, str(HERE / "foreign.py"), str(folder), file, *map(str, (count, seed, first, samples))]
        done = subprocess.run(call, env=environment, capture_output=True, text=True)
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        found += [line for line in lines if "result" in line]
        if done.returncode == 0:
            break
        assert lines and "result" not in lines[-1], done.stderr
        found.append({**lines[-1], "result": "ended", "ended": done.returncode, "why": done.stderr[-2000:]})
        first = lines[-1]["number"] + 1
        if not count or first >= count:
            break
    return found + [{"result": "other", "other": line} for line in dict.fromkeys(log.read_text().splitlines())]


def wrong(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those that did what no file may do."""
    return [each for each in found if set(each) - {"file", "number", "result"}]


@pytest.mark.parametrize("suffix", [suffix for suffix in SUFFIXES if suffix not in GRIB[1:]])
def test_a_few_edits(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "files").mkdir()
    path = made(tmp_path / "files", suffix)
    assert wrong(outcomes(tmp_path, path.name, 3)) == []


@pytest.mark.heavy
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_many_edits(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "files").mkdir()
    path = made(tmp_path / "files", suffix)
    found = outcomes(tmp_path, path.name, 500, seed=1)
    print(suffix, dict(Counter(each["result"] for each in found)))
    assert wrong(found) == []


def _packed(array: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("values.npy", array)
    return file.getvalue()


def _npy(shape: str) -> bytes:
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape}), }}".ljust(117).encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head


def _nifti(*shape: int) -> bytes:
    header = nibabel.Nifti1Header()
    header.set_data_dtype(np.float64)
    header.set_data_shape(shape)
    header["vox_offset"], header["magic"] = 352, b"n+1"
    return bytes(header.binaryblock) + bytes(4)


def _las(at: int, form: str, number: int) -> bytes:
    file = io.BytesIO()
    cloud = laspy.create()
    cloud.x = cloud.y = cloud.z = np.arange(3.0)
    cloud.write(file)
    data = bytearray(file.getvalue())
    struct.pack_into(form, data, at, number)
    return bytes(data)


def _picture(kind: str, at: bytes, form: str, *numbers: int) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.zeros((8, 8), np.uint8)).save(file, kind)
    data = bytearray(file.getvalue())
    where = data.index(at) + (4 if kind == "PNG" else 5)
    struct.pack_into(form, data, where, *numbers)
    if kind == "PNG":
        struct.pack_into(">I", data, where + 13, zlib.crc32(data[where - 4 : where + 13]))
    return bytes(data)


def _tiff(**tags: Any) -> bytes:
    file = io.BytesIO()
    tifffile.imwrite(file, np.zeros((8, 8), np.uint8), metadata=None, **tags)
    return file.getvalue()


def _large_tiff(compression: str) -> bytes:
    data = bytearray(_tiff(compression=compression))
    for tag in (256, 257, 278):
        at = data.index(struct.pack("<H", tag), 8)
        struct.pack_into("<HIHH", data, at + 2, 3, 1, 32000, 0)
    return bytes(data)


def _unwritten(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("x", shape=(1 << 10, 1 << 10, 1 << 9), dtype="f8", chunks=(64, 64, 64), compression="gzip")


def _zarr(path: Path) -> None:
    stored = zarr.open(str(path), mode="w", shape=(4, 4), chunks=(4, 4), dtype="f8", fill_value=1.5)
    stored[:] = 0
    text = json.loads((path / "zarr.json").read_text())
    text["shape"] = text["chunk_grid"]["configuration"]["chunk_shape"] = [30000, 30000]
    (path / "zarr.json").write_text(json.dumps(text))


LAUGHS = b'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "' + b"a" * 100 + b'">' + b"".join(
    b'<!ENTITY %c "%s">' % (c, b"&%c;" % (c - 1) * 100) for c in range(ord("b"), ord("h"))
) + b"]>"
VTU = (
    b'<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
    b'<Piece NumberOfPoints="%d" NumberOfCells="1"><Points><DataArray type="Float64" Name="Points" '
    b'NumberOfComponents="3" format="%s">%s</DataArray></Points><Cells></Cells></Piece></UnstructuredGrid></VTKFile>'
)
VTI = (
    b'<VTKFile type="ImageData" version="0.1" byte_order="LittleEndian"%s><ImageData WholeExtent="0 %d 0 %d 0 %d" '
    b'Origin="0 0 0" Spacing="1 1 1"><Piece Extent="0 %d 0 %d 0 %d"><PointData Scalars="v"><DataArray type="Float64" '
    b'Name="v" format="%s">%s</DataArray></PointData></Piece></ImageData></VTKFile>'
)
MHA = (
    b"ObjectType = Image\nNDims = %s\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = %s\n"
    b"DimSize = %s\nElementType = MET_DOUBLE\nElementDataFile = %s\n"
)
NRRD = b"NRRD0004\ntype: double\ndimension: %s\nsizes: %s\nencoding: %s\n%s\n"
BOMBS: dict[str, bytes | Callable[[Path], None]] = {
    "axes.mha": MHA % (b"99999999999999", b"True", b"8 10 12", b"LOCAL") + bytes(600),
    "axes31.mha": MHA % (b"2147483648", b"True", b"8 10 12", b"LOCAL") + bytes(600),
    "wide.mha": MHA % (b"3", b"True", b"1000 1000 1000", b"LOCAL") + zlib.compress(bytes(1 << 20)),
    "raw.mha": MHA % (b"3", b"False", b"1000 1000 1000", b"LOCAL") + bytes(600),
    "many.mhd": MHA % (b"3", b"False", b"8 8 99999999", b"a%d.raw 1 99999999 1"),
    "axes.nrrd": NRRD % (b"99999999", b"1 " * 99, b"gzip", b"") + gzip.compress(bytes(99)),
    "wide.nrrd": NRRD % (b"3", b"1000 1000 1000", b"gzip", b"") + gzip.compress(bytes(1 << 20)),
    "text.nrrd": NRRD % (b"3", b"1000 1000 1000", b"ascii", b"") + b"1 2 3",
    "shape.npy": _npy("1 << 10, 1 << 10, 1 << 10"),
    "large.npy": _npy("1024, 1024, 1023"),
    "large.npz": _packed(_npy("1024, 1024, 1023") + bytes(1 << 20)),
    "wide.nii": _nifti(1000, 1000, 1000),
    "wide.nii.gz": gzip.compress(_nifti(1000, 1000, 1000) + bytes(1 << 22)),
    "wide.vti": VTI % (b"", *[999] * 6, b"ascii", b"1 2 3"),
    "packed.vti": VTI % (b' compressor="vtkZLibDataCompressor"', *[999] * 6, b"binary", b"AQAAAACAAAAAgAAAEAAA"),
    "laughs.vti": LAUGHS + (VTI % (b"", *[1] * 6, b"ascii", b"&g;")),
    "wide.vtu": VTU % (1 << 40, b"ascii", b"0 0 0"),
    "laughs.vtu": LAUGHS + (VTU % (1, b"ascii", b"&g;")),
    "many.ply": b"ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 4000000000\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n",
    "binary.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n"
    b"property float y\nproperty float z\nend_header\n" + bytes(12),
    "ansys.msh": b'(1 "mesh',
    "many.msh": b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 4000000000 1 4000000000\n2 1 0 4000000000\n1\n",
    "laughs.xdmf": LAUGHS + b"<Xdmf><Domain>&g;</Domain></Xdmf>",
    "records.las": _las(100, "<I", 0xFFFFFFFF),
    "points.las": _las(107, "<I", 0xFFFFFFF0),
    "wide.png": _picture("PNG", b"IHDR", ">II", 30000, 30000),
    "wide.jpg": _picture("JPEG", b"\xff\xc0", ">HH", 65000, 16000),
    "wide.tif": _large_tiff("zlib"),
    "sparse.tif": _large_tiff("lzw"),
    "circle.tif": b"II*\0\x08\0\0\0\x01\0" + struct.pack("<HHII", 256, 3, 1, 8) + struct.pack("<I", 8),
    "unwritten.h5": _unwritten,
    "fill.zarr": _zarr,
}
"""Files of few bytes that state, or unpack to, far more."""


@pytest.mark.parametrize("name", BOMBS)
def test_bombs(tmp_path: Path, name: str) -> None:
    """An error of ours within the time, with the default limits and within 64 MB."""
    (tmp_path / "files").mkdir()
    path, bomb = tmp_path / "files" / name, BOMBS[name]
    path.write_bytes(bomb) if isinstance(bomb, bytes) else bomb(path)
    size = sum(each.stat().st_size for each in [path, *path.rglob("*")] if each.is_file())
    assert size < 1 << 18
    (found,) = outcomes(tmp_path, name, 0, samples=1 << 30)
    assert found["result"] in ("InputError", "LimitError") and wrong([found]) == []


@pytest.mark.parametrize(("name", "kind"), [("axes.mha", InputError), ("ansys.msh", InputError)])
def test_a_library_that_crashes_or_hangs(tmp_path: Path, name: str, kind: type[Exception]) -> None:
    bomb = BOMBS[name]
    assert isinstance(bomb, bytes)
    (tmp_path / name).write_bytes(bomb)
    with pytest.raises(kind, match=name):
        isocodec.read(tmp_path / name)


def _write_packed(path: Path) -> None:
    if path.suffix in (".mha", ".nrrd"):
        SimpleITK.WriteImage(SimpleITK.GetImageFromArray(VOLUME), str(path), useCompression=True)
    elif path.suffix == ".gz":
        nibabel.save(nibabel.Nifti1Image(VOLUME, np.eye(4)), path)
    elif path.suffix == ".npz":
        np.savez_compressed(path, values=VOLUME)
    elif path.suffix == ".png":
        Image.fromarray(VOLUME[0].repeat(9, 0).astype(np.uint8)).save(path)
    elif path.suffix == ".tif":
        tifffile.imwrite(path, VOLUME, compression="zlib")
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file.create_dataset("x", data=VOLUME, compression="gzip")
    else:
        import vtk
        from vtk.util.numpy_support import numpy_to_vtk

        image = vtk.vtkImageData()
        image.SetDimensions(8, 7, 6)
        array = numpy_to_vtk(VOLUME.ravel(), deep=True)
        array.SetName("v")
        image.GetPointData().SetScalars(array)
        writer = vtk.vtkXMLImageDataWriter()
        writer.SetFileName(str(path))
        writer.SetInputData(image)
        writer.Write()


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("suffix", [".mha", ".nrrd", ".nii.gz", ".npz", ".png", ".tif", ".h5", ".vti"])
def test_a_flipped_bit_of_packed_samples_is_found(tmp_path: Path, suffix: str, place: int) -> None:
    """Of formats that have a checksum."""
    path = tmp_path / f"a{suffix}"
    _write_packed(path)
    right = isocodec.read(path).values
    data = bytearray(path.read_bytes())
    # in the samples, wherever the format has them
    at = len(data) * (9 + 2 * place) // 20
    if suffix == ".h5":
        with h5py.File(path) as file:
            chunk = file["x"].id.get_chunk_info(0)
        at = chunk.byte_offset + chunk.size * (2 + place) // 8
    data[at] ^= 4
    path.write_bytes(data)
    try:
        assert np.array_equal(isocodec.read(path).values, right)  # a bit that nothing depends on
    except InputError as error:
        assert "a" + suffix in str(error)


def test_a_stack_that_ends_early(tmp_path: Path) -> None:
    """Tifffile logs that a page is missing, and gives those before it."""
    tifffile.imwrite(tmp_path / "a.tif", VOLUME, metadata=None)
    data = (tmp_path / "a.tif").read_bytes()
    (tmp_path / "a.tif").write_bytes(data[: len(data) * 2 // 3])
    with pytest.raises(InputError, match=r"a\.tif"):
        isocodec.read(tmp_path / "a.tif")


def test_time_and_memory_have_remedies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    meshio.Mesh(points, [("triangle", [[0, 1, 2]])], {"z": points[:, 0]}).write(tmp_path / "a.msh")
    monkeypatch.setenv("ISOCODEC_TIMEOUT", "0.0001")
    monkeypatch.setattr("isocodec.limits.RATE", 1 << 60)
    with pytest.raises(InputError, match=r"longer than .* read it with meshio.*ISOCODEC_TIMEOUT"):
        isocodec.read(tmp_path / "a.msh")
    monkeypatch.setattr("isocodec.io.readers.confined._SMALL", 0)
    with pytest.raises(LimitError, match=r"longer than"):
        isocodec.read(tmp_path / "a.msh")
    monkeypatch.setenv("ISOCODEC_TIMEOUT", "soon")
    with pytest.raises(isocodec.errors.OptionError, match="number of seconds"):
        isocodec.read(tmp_path / "a.msh")
