"""Pictures against Pillow, stacks against tifffile: channels, orientation, transparency, sizes of voxels."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError

GREY = (np.arange(40) * 6).astype(np.uint8).reshape(5, 8)
CELLS = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".gif", ".pgm", ".webp", ".PNG"])
def test_suffixes(tmp_path: Path, suffix: str) -> None:
    from PIL import Image

    path = tmp_path / f"a{suffix}"
    Image.fromarray(GREY).save(path)
    with Image.open(path) as image:
        expected = np.asarray(image)
    choice = {"band": 1} if expected.ndim == 3 or suffix == ".gif" else {}
    assert np.array_equal(isocodec.read(path, **choice).values, expected if expected.ndim == 2 else expected[..., 0])


@pytest.mark.parametrize("picture", [GREY.astype(np.uint16) * 250, GREY > 100], ids=["16 bits", "1 bit"])
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_depths(tmp_path: Path, suffix: str, picture: Any) -> None:
    from PIL import Image

    Image.fromarray(picture).save(tmp_path / f"a{suffix}")
    found = isocodec.read(tmp_path / f"a{suffix}").values
    assert np.array_equal(found, picture) and found.dtype == (np.uint8 if picture.dtype == bool else np.uint16)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_colours_need_a_band(tmp_path: Path, suffix: str) -> None:
    from PIL import Image

    Image.fromarray(np.dstack([GREY, GREY + 1, GREY + 2])).save(tmp_path / f"a{suffix}")
    with pytest.raises(InputError, match=r"3 (channels|bands).*--band"):
        isocodec.read(tmp_path / f"a{suffix}")
    assert np.array_equal(isocodec.read(tmp_path / f"a{suffix}", band=3).values, GREY + 2)
    with pytest.raises(OptionError, match=r"no (channel|band) 4"):
        isocodec.read(tmp_path / f"a{suffix}", band=4)


def test_sixteen_bits_of_colour_are_refused(tmp_path: Path) -> None:
    """Pillow halves them without a word."""
    import struct
    import zlib

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    row = zlib.compress(b"\0" + struct.pack(">6H", 1, 2, 3, 400, 500, 600))
    header = struct.pack(">IIBBBBB", 2, 1, 16, 2, 0, 0, 0)
    (tmp_path / "a.png").write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", row) + chunk(b"IEND", b""))
    with pytest.raises(InputError, match=r"16 bits per channel.*TIFF"):
        isocodec.read(tmp_path / "a.png", band=1)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_orientations(tmp_path: Path, suffix: str, orientation: int) -> None:
    from PIL import Image, ImageOps

    path = tmp_path / f"a{suffix}"
    exif = Image.Exif()
    exif[274] = orientation
    Image.fromarray(GREY).save(path, exif=exif)
    Image.fromarray(GREY).save(tmp_path / "b.png", exif=exif)
    with Image.open(tmp_path / "b.png") as image:
        upright = np.asarray(ImageOps.exif_transpose(image))
        assert np.array_equal(isocodec.read(image).values, upright)
    assert np.array_equal(isocodec.read(path).values, upright)
    with Image.open(path) as image:
        if suffix == ".tif" and orientation > 4:
            with pytest.raises(InputError, match="on its side"):  # what Pillow makes of it is neither
                isocodec.read(image)
        else:
            assert np.array_equal(isocodec.read(image).values, upright)


@pytest.mark.parametrize("kind", ["LA", "RGBA", "L", "RGB"])
def test_what_cannot_be_seen_is_missing(tmp_path: Path, kind: str) -> None:
    """By alpha, or by a colour that counts as transparent; alpha itself is whole."""
    from PIL import Image

    clear = GREY < 60
    layers = [GREY] * len(kind.rstrip("A")) + [np.where(clear, 0, 9).astype("u1")] * kind.endswith("A")
    Image.fromarray(np.dstack(layers) if len(layers) > 1 else GREY, kind).save(
        tmp_path / "a.png", **({} if kind.endswith("A") else {"transparency": 60 if kind == "L" else (60, 60, 60)}))
    field: Any = isocodec.read(tmp_path / "a.png", band=1)
    assert np.array_equal(field.mask, clear if kind.endswith("A") else GREY == 60)
    if kind.endswith("A"):
        assert isocodec.read(tmp_path / "a.png", band=len(layers)).mask is None
    if kind == "LA":
        assert np.array_equal(isocodec.read(tmp_path / "a.png").mask, clear)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_palettes_are_refused_with_a_remedy(tmp_path: Path, suffix: str) -> None:
    from PIL import Image

    Image.fromarray(GREY).convert("P").save(tmp_path / f"a{suffix}")
    with Image.open(tmp_path / f"a{suffix}") as image:
        expected = np.asarray(image)
    with pytest.raises(InputError, match=r"palette.*band=1"):
        isocodec.read(tmp_path / f"a{suffix}")
    assert np.array_equal(isocodec.read(tmp_path / f"a{suffix}", band=1).values, expected)


def test_several_pictures_and_damage(tmp_path: Path) -> None:
    from PIL import Image

    Image.fromarray(GREY).save(tmp_path / "a.gif", save_all=True, append_images=[Image.fromarray(GREY[::-1])])
    with pytest.warns(UserWarning, match="holds 2 pictures"):
        isocodec.read(tmp_path / "a.gif", band=1)
    Image.fromarray(GREY).save(tmp_path / "a.png")
    data = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(data[:-20])
    with pytest.raises(InputError, match="cannot be read as picture"):
        isocodec.read(tmp_path / "a.png")


def test_world_files_place_a_picture(tmp_path: Path) -> None:
    from PIL import Image

    Image.fromarray(GREY).save(tmp_path / "a.png")
    (tmp_path / "a.pgw").write_text("2\n0\n0\n-3\n101\n199\n")
    assert isocodec.read(tmp_path / "a.png").placement.matrix.tolist() == [[0, 2, 101], [-3, 0, 199]]


@pytest.mark.parametrize("kind", ["imagej", "ome", "odd units", "bare"])
def test_sizes_of_voxels(tmp_path: Path, kind: str) -> None:
    import tifffile

    sizes = {"PhysicalSizeX": 0.25, "PhysicalSizeY": 0.5, "PhysicalSizeZ": 2.5}
    path = tmp_path / "a.tif"
    if kind == "imagej":
        tifffile.imwrite(path, CELLS, imagej=True, resolution=(4.0, 2.0),
                         metadata={"axes": "ZYX", "spacing": 2.5, "unit": "um"})
    elif kind == "bare":
        tifffile.imwrite(path, CELLS, photometric="minisblack")
    else:
        more = {"PhysicalSizeZUnit": "mm"} if kind == "odd units" else {}
        tifffile.imwrite(path, CELLS, ome=True, metadata={"axes": "ZYX", **sizes, **more})
    field: Any = isocodec.read(path)
    assert np.array_equal(field.values, CELLS)
    if kind == "bare":
        assert field.placement is None
        return
    assert field.placement.matrix.tolist() == [[0, 0, 0.25, 0], [0, 0.5, 0, 0], [2.5, 0, 0, 0]]
    assert field.placement.unit == {"imagej": "um", "ome": "µm", "odd units": "µm µm mm"}[kind]
    frame: Any = isocodec.read(path, frame=1)
    assert np.array_equal(frame.values, CELLS[1]) and frame.placement.matrix.tolist() == [[0, 0.25, 0], [0.5, 0, 0]]
    assert [each.values[0, 0] for each in isocodec.read(path, frames=True).fields] == [0, 20, 40]


@pytest.mark.parametrize("notes, word", [
    ({"axes": "TYX", "PhysicalSizeX": 0.25, "PhysicalSizeY": 0.5}, "ignored: its axes"),
    ({"axes": "ZYX", "PhysicalSizeX": 0.25, "PhysicalSizeY": 0.5, "PhysicalSizeZ": 0.0}, "ignored"),
])
def test_sizes_that_do_not_fit_are_remarked_on(tmp_path: Path, notes: dict[str, Any], word: str) -> None:
    import tifffile

    tifffile.imwrite(tmp_path / "a.tif", CELLS, ome=True, metadata=notes)
    with pytest.warns(UserWarning, match=word):
        assert isocodec.read(tmp_path / "a.tif").placement is None


@pytest.mark.parametrize("compression", ["lzw", "zstd", "zlib", "packbits"])
def test_compressed_stacks(tmp_path: Path, compression: str) -> None:
    import tifffile

    tifffile.imwrite(tmp_path / "a.tif", CELLS.astype(">i2"), photometric="minisblack", compression=compression)
    found = isocodec.read(tmp_path / "a.tif").values
    assert np.array_equal(found, CELLS) and found.dtype == np.int16 and found.dtype.isnative


def test_pages_of_different_kinds_and_geography(tmp_path: Path) -> None:
    import tifffile

    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        file.write(GREY, photometric="minisblack")
        file.write(CELLS[0].astype("u2"), photometric="minisblack")
    with pytest.raises(InputError, match=r"2 pictures of different kinds.*--key"):
        isocodec.read(tmp_path / "a.tif")
    assert np.array_equal(isocodec.read(tmp_path / "a.tif", key="2").values, CELLS[0])
    scale = [(33550, "d", 3, (30.0, 30.0, 0.0)), (33922, "d", 6, (0, 0, 0, 5e5, 4e6, 0))]
    tifffile.imwrite(tmp_path / "b.tif", CELLS, photometric="minisblack", extratags=scale)
    with pytest.warns(UserWarning, match="take a page with --key"):
        isocodec.read(tmp_path / "b.tif")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert isocodec.read(tmp_path / "b.tif", key="1").placement is not None
