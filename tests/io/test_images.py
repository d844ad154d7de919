"""Pictures against Pillow, stacks against tifffile: channels, orientation, transparency, sizes of voxels."""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError
from libraries import Late
from tables import looped

Image, tifffile = Late("PIL.Image"), Late("tifffile")
GREY = (np.arange(40) * 6).astype(np.uint8).reshape(5, 8)
CELLS = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)


@looped("suffix, picture", [
    *((each, GREY) for each in (".png", ".jpg", ".bmp", ".gif", ".pgm", ".webp", ".PNG", ".tif")),
    *((each, made) for each in (".png", ".tif") for made in (GREY.astype(np.uint16) * 250, GREY > 100)),
])
def test_suffixes_and_depths(tmp_path: Path, suffix: str, picture: Any) -> None:
    path = tmp_path / f"a{suffix}"
    Image.fromarray(picture).save(path)
    with Image.open(path) as image:
        expected = np.asarray(image)
    found = isocodec.read(path, band=1).values
    assert np.array_equal(found, expected if expected.ndim == 2 else expected[..., 0])
    assert found.dtype == (np.uint8 if picture.dtype == bool else picture.dtype)


@looped("suffix", [".png", ".tif"])
def test_colours_and_palettes_need_a_band(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    Image.fromarray(np.dstack([GREY, GREY + 1, GREY + 2])).save(path)
    with pytest.raises(InputError, match=r"3 (channels|bands).*--band"):
        isocodec.read(path)
    assert np.array_equal(isocodec.read(path, band=3).values, GREY + 2)
    with pytest.raises(OptionError, match=r"no (channel|band) 4"):
        isocodec.read(path, band=4)
    Image.fromarray(GREY).convert("P").save(path)
    with Image.open(path) as image:
        expected = np.asarray(image)
    with pytest.raises(InputError, match=r"palette.*band=1"):
        isocodec.read(path)
    assert np.array_equal(isocodec.read(path, band=1).values, expected)


def test_sixteen_bits_of_colour_are_refused(tmp_path: Path) -> None:
    """Pillow halves them without a word."""
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    row = zlib.compress(b"\0" + struct.pack(">6H", 1, 2, 3, 400, 500, 600))
    header = struct.pack(">IIBBBBB", 2, 1, 16, 2, 0, 0, 0)
    (tmp_path / "a.png").write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", row) + chunk(b"IEND", b""))
    with pytest.raises(InputError, match=r"16 bits per channel.*TIFF"):
        isocodec.read(tmp_path / "a.png", band=1)


@looped("orientation", range(1, 9))
def test_orientations(tmp_path: Path, orientation: int) -> None:
    """Pictures are turned upright; files of TIFF are refused, and images of it that Pillow scrambles."""
    from PIL import ImageOps

    exif = Image.Exif()
    exif[274] = orientation
    for suffix in (".png", ".tif"):
        Image.fromarray(GREY).save(tmp_path / f"a{suffix}", exif=exif)
    with Image.open(tmp_path / "a.png") as image:
        upright = np.asarray(ImageOps.exif_transpose(image))
        assert np.array_equal(isocodec.read(image).values, upright)
    assert np.array_equal(isocodec.read(tmp_path / "a.png").values, upright)
    for source, refused in ((tmp_path / "a.tif", orientation > 1), (Image.open(tmp_path / "a.tif"), orientation > 4)):
        if refused:
            with pytest.raises(InputError, match="on its side"):
                isocodec.read(source)
        else:
            assert np.array_equal(isocodec.read(source).values, upright)


@looped("kind", ["LA", "RGBA", "L", "RGB"])
def test_what_cannot_be_seen(tmp_path: Path, kind: str) -> None:
    """What alpha hides is missing; alpha itself is whole; of a transparent shade there is a word."""
    clear = GREY < 60
    layers = [GREY] * len(kind.rstrip("A")) + [np.where(clear, 0, 9).astype("u1")] * kind.endswith("A")
    Image.fromarray(np.dstack(layers) if len(layers) > 1 else GREY, kind).save(
        tmp_path / "a.png", **({} if kind.endswith("A") else {"transparency": 60 if kind == "L" else (60, 60, 60)}))
    if not kind.endswith("A"):
        with pytest.warns(UserWarning, match=r"transparent shade is kept: .*60.*--nodata"):
            assert isocodec.read(tmp_path / "a.png", band=1).mask is None
        return
    assert np.array_equal(isocodec.read(tmp_path / "a.png", band=1).mask, clear)
    assert isocodec.read(tmp_path / "a.png", band=len(layers)).mask is None
    if kind == "LA":
        assert np.array_equal(isocodec.read(tmp_path / "a.png").mask, clear)


def test_several_pictures_damage_and_world_files(tmp_path: Path) -> None:
    Image.fromarray(GREY).save(tmp_path / "a.gif", save_all=True, append_images=[Image.fromarray(GREY[::-1])])
    with pytest.warns(UserWarning, match="holds 2 pictures"):
        isocodec.read(tmp_path / "a.gif", band=1)
    Image.fromarray(GREY).save(tmp_path / "a.png")
    (tmp_path / "a.pgw").write_text("2\n0\n0\n-3\n101\n199\n")
    placed: Any = isocodec.read(tmp_path / "a.png")
    assert placed.placement.matrix.tolist() == [[0, 2, 101], [-3, 0, 199]] and np.array_equal(placed.values, GREY)
    (tmp_path / "a.pgw").unlink()
    (tmp_path / "a.png").write_bytes((tmp_path / "a.png").read_bytes()[:-20])
    with pytest.raises(InputError, match="cannot be read as picture"):
        isocodec.read(tmp_path / "a.png")


SIZES = {"PhysicalSizeX": 0.25, "PhysicalSizeY": 0.5, "PhysicalSizeZ": 2.5}


@looped("more, unit", [
    ({"imagej": True, "resolution": (4.0, 2.0), "metadata": {"axes": "ZYX", "spacing": 2.5, "unit": "um"}}, "um"),
    ({"ome": True, "metadata": {"axes": "ZYX", **SIZES}}, "µm"), ({"photometric": "minisblack"}, None),
    ({"ome": True, "metadata": {"axes": "ZYX", **SIZES, "PhysicalSizeZUnit": "mm"}}, "µm µm mm"),
])
def test_sizes_of_voxels(tmp_path: Path, more: dict[str, Any], unit: str | None) -> None:
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, CELLS, **more)
    field: Any = isocodec.read(path)
    frame: Any = isocodec.read(path, frame=1)
    assert np.array_equal(field.values, CELLS) and np.array_equal(frame.values, CELLS[1])
    assert [each.values[0, 0] for each in isocodec.read(path, frames=True).fields] == [0, 20, 40]
    if unit is None:
        assert field.placement is frame.placement is None
        return
    assert field.placement.matrix.tolist() == [[0, 0, 0.25, 0], [0, 0.5, 0, 0], [2.5, 0, 0, 0]]
    assert field.placement.unit == unit and frame.placement.matrix.tolist() == [[0, 0.25, 0], [0.5, 0, 0]]


@looped("notes, words", [
    ({"axes": "TYX", "PhysicalSizeX": 0.25, "PhysicalSizeY": 0.5}, "ignored: its axes"),
    ({"axes": "ZYX", "PhysicalSizeX": 0.25, "PhysicalSizeY": 0.5, "PhysicalSizeZ": 0.0}, "ignored"),
    ({"axes": "ZYX", "PhysicalSizeX": 0.25, "PhysicalSizeY": 0.5}, "ignored"),
])
def test_sizes_that_do_not_fit_are_remarked_on(tmp_path: Path, notes: dict[str, Any], words: str) -> None:
    tifffile.imwrite(tmp_path / "a.tif", CELLS, ome=True, metadata=notes)
    with pytest.warns(UserWarning, match=words):
        assert isocodec.read(tmp_path / "a.tif").placement is None


@looped("compression", ["lzw", "zstd", "zlib", "packbits"])
def test_compressed_stacks(tmp_path: Path, compression: str) -> None:
    tifffile.imwrite(tmp_path / "a.tif", CELLS.astype(">i2"), photometric="minisblack", compression=compression)
    found = isocodec.read(tmp_path / "a.tif").values
    assert np.array_equal(found, CELLS) and found.dtype == np.int16 and found.dtype.isnative


def test_pages_of_different_kinds_and_geography(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        file.write(GREY, photometric="minisblack")
        file.write(CELLS[0].astype("u2"), photometric="minisblack")
    with pytest.raises(InputError, match=r"2 pictures of different kinds.*--key"):
        isocodec.read(tmp_path / "a.tif")
    assert np.array_equal(isocodec.read(tmp_path / "a.tif", key="2").values, CELLS[0])
    scale = [(33550, "d", 3, (30.0, 30.0, 0.0)), (33922, "d", 6, (0, 0, 0, 5e5, 4e6, 0))]
    marker = (42113, "s", 0, "9", True)
    tifffile.imwrite(tmp_path / "b.tif", CELLS, photometric="minisblack", extratags=[*scale, marker])
    with pytest.warns(UserWarning, match="take a page with --key"):
        assert np.array_equal(isocodec.read(tmp_path / "b.tif").mask, CELLS == 9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert isocodec.read(tmp_path / "b.tif", key="1").placement is not None
