"""Inputs are bounded before they are read: by samples, by the bytes that there are, and by an end that comes."""

from __future__ import annotations

import gzip
import io
import os
import struct
import tracemalloc
import warnings
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails, ok, run
from files import same
from inputs import META, NRRD, read_field, read_nodata, read_place, written
from isocodec import Limits
from isocodec.cli import option_records
from isocodec.errors import InputError, LimitError, OptionError
from isocodec.storage import content
from libraries import Late
from tables import looped

h5py = Late("h5py")
nibabel = Late("nibabel")
Image = Late("PIL.Image")
tifffile = Late("tifffile")

KINDS = ["a.npy", "a.npz", "a.h5", "a.tif", "packed.tif", "a.png", "a.jpg", "a.nii", "a.nii.gz", "a.nrrd", "a.nhdr"]
KINDS += ["a.mha", "a.mhd"]


@looped("name", KINDS)
def test_one_limit_for_all_formats(tmp_path: Path, name: str) -> None:
    path, field = written(tmp_path, name)
    assert same(read_field(path, samples=field.size), field)
    with pytest.raises(LimitError) as caught:
        read_field(path, samples=field.size - 1)
    assert caught.value.code == "limit-samples"
    said = f"holds {field.size} samples, more than the limit of {field.size - 1}: raise it with --limit-samples"
    assert str(caught.value).startswith(f"{path}: {said}")
    out = tmp_path / "out.iso"
    line = fails(6, "encode", path, "-o", out, "--isovalue", 5.5, "--limit-samples", field.size - 1)
    assert line.startswith(f"isocodec: {path}: {said}") and not out.exists()
    ok("encode", path, "-o", out, "--isovalue", 5.5, "--limit-samples", field.size)
    for wrong in (0, -1):
        with pytest.raises(OptionError):
            read_field(path, samples=wrong)


def npy_header(shape: tuple[int, ...], descr: str = "<f8") -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": descr, "fortran_order": False, "shape": shape})
    return buffer.getvalue()


def huge(folder: Path, name: str) -> Path:
    """A small file that claims to hold 64,000 by 64,000 samples, far more than are read."""
    path, side = folder / name, 64000
    if name == "a.npy":
        path.write_bytes(npy_header((side, side)))
    elif name == "a.npz":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("a.npy", npy_header((side, side)))
    elif name == "a.h5":
        with h5py.File(path, "w") as file:
            file.create_dataset("x", (side, side), "u1")
    elif name == "chunk.h5":
        with h5py.File(path, "w") as file:
            space = h5py.h5s.create_simple((4, 4), (h5py.h5s.UNLIMITED, h5py.h5s.UNLIMITED))
            layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            layout.set_chunk((1 << 16, 1 << 15))
            h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_UINT8, space, layout)
    elif name in ("a.tif", "tile.tif"):
        tifffile.imwrite(path, HILLS, compression="zlib", tile=(16, 16), metadata=None)
        data = bytearray(path.read_bytes())
        with tifffile.TiffFile(path) as tiff:
            tags = [tiff.pages[0].tags[tag] for tag in ((256, 257) if name == "a.tif" else (322, 323))]
        for tag in tags:
            # of a tag: its number, type (4 is long), count, value
            data[tag.offset : tag.offset + 12] = struct.pack("<HHII", tag.code, 4, 1, side)
        path.write_bytes(data)
    elif name == "a.png":
        head = b"IHDR" + struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
        body = b"IDAT" + zlib.compress(bytes(100))
        chunks = [struct.pack(">I", len(c) - 4) + c + struct.pack(">I", zlib.crc32(c)) for c in (head, body, b"IEND")]
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))
    elif name == "a.jpg":
        Image.fromarray(HILLS).save(path)
        data = bytearray(path.read_bytes())
        at = data.index(b"\xff\xc0") + 5
        data[at : at + 4] = struct.pack(">HH", side, side)
        path.write_bytes(data)
    elif name in ("a.nii", "a.nii.gz"):
        header = nibabel.Nifti2Header()
        header.set_data_shape((side, side, 1))
        header.set_data_dtype(np.float64)
        header["magic"], header["vox_offset"] = b"n+2\0\r\n\x1a\n", 544
        data = header.binaryblock + bytes(4 + 96)
        path.write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
    elif name == "a.mha":
        path.write_bytes(META.replace(b"2 3 4", b"64000 64000 1") + b"ElementDataFile = LOCAL\n" + bytes(100))
    else:
        path.write_bytes(NRRD.replace(b"2 3 4", b"64000 64000 1") + b"\n" + bytes(100))
    return path


HUGE = [
    "a.npy",
    "a.npz",
    "a.h5",
    "chunk.h5",
    "a.tif",
    "tile.tif",
    "a.png",
    "a.jpg",
    "a.nii",
    "a.nii.gz",
    "a.mha",
    "a.nrrd",
]


@looped("name", HUGE)
def test_small_files_that_claim_to_be_huge(tmp_path: Path, name: str) -> None:
    path = huge(tmp_path, name)
    assert path.stat().st_size < 10_000
    tracemalloc.start()
    try:
        line = fails(6, "encode", path, "-o", tmp_path / "out.iso", "--isovalue", 5.5)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert "samples, more than the limit of 1,073,741,824: raise it with --limit-samples" in line
    assert peak < 50e6


@looped("name", ["a.npy", "a.npz", "a.nii", "a.mha", "a.nrrd", "a.tif"])
def test_sizes_that_the_bytes_cannot_hold(tmp_path: Path, name: str) -> None:
    """Of 2000 samples a side: allowed, but not there."""
    path = tmp_path / name
    if name == "a.npy":
        path.write_bytes(npy_header((2000, 2000)) + bytes(99))
    elif name == "a.npz":
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("a.npy", npy_header((2000, 2000)) + bytes(99))
    elif name == "a.nii":
        nibabel.Nifti1Image(np.ones((200, 200, 100)), np.eye(4)).to_filename(path)
    elif name == "a.mha":
        path.write_bytes(META.replace(b"2 3 4", b"200 200 100") + b"ElementDataFile = LOCAL\n" + bytes(99))
    elif name == "a.nrrd":
        path.write_bytes(NRRD.replace(b"2 3 4", b"200 200 100") + b"\n" + bytes(99))
    else:
        tifffile.imwrite(path, np.ones((2000, 2000)))
    path.write_bytes(path.read_bytes()[:2000])
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"is cut short: its header states [34][,0-9]{8,} bytes, but there are"):
            read_field(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 3e6


def test_sizes_that_the_zip_file_states_are_not_believed(tmp_path: Path) -> None:
    """What a directory promises is held against what unpacks."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", npy_header((50, 50)) + bytes(99))
    data = (tmp_path / "a.npz").read_bytes()
    stated = len(npy_header((50, 50))) + 99
    for where in (stated.to_bytes(4, "little"),):
        data = data.replace(where, (stated - 99 + 20000).to_bytes(4, "little"))
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_field(tmp_path / "a.npz")
    assert caught.value.code == "unreadable"
    with zipfile.ZipFile(tmp_path / "b.npz", "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("a.npy", npy_header((1, 1)) + bytes(8))
    with pytest.raises(InputError, match="packed in a way that NumPy does not write"):
        read_field(tmp_path / "b.npz")


def test_listing_arrays_reads_headers_only(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("a.npy", "b.npy"):
            archive.writestr(name, npy_header((1 << 20, 1 << 20)))
    with pytest.raises(InputError, match=r"a \(1048576, 1048576\), b \(1048576, 1048576\): choose one with --key"):
        read_field(tmp_path / "a.npz")


def test_extensions_of_nifti_are_bounded(tmp_path: Path) -> None:
    """They may state any size, and zeros pack to a thousandth."""
    header = nibabel.Nifti1Header()
    header.set_data_shape((2, 3, 4))
    header["magic"], header["vox_offset"] = b"n+1", 400
    for size in (1 << 30, 0):
        extended = header.binaryblock + b"\1\0\0\0" + struct.pack("<ii", size, 6)
        (tmp_path / "a.nii.gz").write_bytes(gzip.compress(extended + bytes(1 << 20), 1))
        with pytest.raises(InputError, match="states more than 64 MiB before its samples"):
            read_field(tmp_path / "a.nii.gz")


def test_strips_that_unpack_to_more_than_the_picture(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    noise = np.random.default_rng(1).integers(0, 255, (300, 300), np.uint8)
    tifffile.imwrite(path, noise, compression="zlib", metadata=None)
    assert same(read_field(path), noise)
    data = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as tiff:
        count = tiff.pages[0].tags[279]
        at, old = tiff.pages[0].dataoffsets[0], tiff.pages[0].databytecounts[0]
    bomb = zlib.compress(bytes(80 << 20))
    assert len(bomb) < old, "it has to fit into the place of the picture"
    data[at : at + len(bomb)] = bomb
    path.write_bytes(data)
    assert count.value == (old,)
    with pytest.raises(InputError, match="unpack to more than its header states"):
        read_field(path)


def test_arrays_of_hdf5_that_were_never_written(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("x", (3, 4), "u1")
    with pytest.raises(InputError, match=r"the shape of '/x', \(3, 4\), but no samples"):
        read_field(tmp_path / "a.h5")


def test_a_large_picture_is_no_bomb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit is ours, not the one that the library has for the whole process."""
    paths = [written(tmp_path, name)[0] for name in ("a.png", "a.jpg")]
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 5)
    for path in paths:
        with warnings.catch_warnings(action="error"):
            assert read_field(path).shape == (3, 4)
    assert Image.MAX_IMAGE_PIXELS == 5


def test_devices_and_pipes(tmp_path: Path) -> None:
    """Nothing is read of what may never end: encoding would wait for it, or take all memory."""
    os.mkfifo(tmp_path / "pipe.npy")
    for kind in (".npy", ".nii", ".tif", ".h5", ".png", ".mha"):
        (tmp_path / f"zero{kind}").symlink_to("/dev/zero")
    for path in [tmp_path / "pipe.npy", *tmp_path.glob("zero*")]:
        line = fails(3, "encode", path, "-o", tmp_path / "out.iso", "--isovalue", 1)
        assert "is a device or a pipe" in line
        for read in (lambda p: read_place(p, 3), read_nodata):
            with pytest.raises(InputError, match="device or a pipe"):
                read(path)
    (tmp_path / "v.mhd").write_bytes(META + b"ElementDataFile = zero.npy\n")
    with pytest.raises(InputError, match="no such file beside it"):
        read_field(tmp_path / "v.mhd", follow=True)
    for verb in (["info"], ["decode", "--what", "above", "-o", tmp_path / "m.npy"]):
        assert "not an .iso file" in fails(4, verb[0], "/dev/zero", *verb[1:])


def test_a_curve_comes_in_pieces_but_not_without_end(
    tmp_path: Path, curve: Path, curve_data: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(content, "_PIECE", 7)
    assert isocodec.open(curve).data == curve_data
    for most, code in ((len(curve_data), 0), (len(curve_data) - 1, 6)):
        monkeypatch.setattr(option_records, "Limits", lambda most=most: Limits(bytes=most))
        assert run("info", curve).exit_code == code
