"""Every compression of TIFF that GDAL and tifffile write comes back as these libraries have it, and none is a bomb."""

from __future__ import annotations

import resource
import tracemalloc
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import pytest
import rasterio
import tifffile
from rasterio.transform import from_origin

import isocodec
from commands import ok
from inputs import read_field, read_place
from isocodec.errors import InputError

RAMP = np.add.outer(np.arange(70) * 2, np.arange(90))
ANY = ["LZW", "PACKBITS", "DEFLATE", "LZMA", "ZSTD", "LERC", "LERC_DEFLATE", "LERC_ZSTD"]
TYPES = ["uint8", "int16", "uint16", "int32", "float32", "float64"]
GDAL = [*((c, t) for c in ANY for t in TYPES), ("JPEG", "uint8"), ("CCITTFAX4", "uint8")]


@pytest.mark.parametrize(("compression", "dtype"), GDAL)
@pytest.mark.parametrize("tiled", [False, True])
def test_gdal(tmp_path: Path, compression: str, dtype: str, tiled: bool) -> None:
    """GDAL writes, and what GDAL reads again is what we read, with its coordinates."""
    bits = {"nbits": 1} if compression == "CCITTFAX4" else {}
    field = (RAMP % 2 if bits else RAMP).astype(dtype)
    tiles = {"tiled": True, "blockxsize": 32, "blockysize": 48} if tiled else {}
    predictors = [1, 3 if dtype.startswith("f") else 2] if compression in ("LZW", "DEFLATE", "ZSTD") else [1]
    for predictor in predictors:
        more: dict[str, Any] = {**bits, **tiles} | ({"predictor": predictor} if len(predictors) > 1 else {})
        path = tmp_path / f"{predictor}.tif"
        with rasterio.open(
            path, "w", driver="GTiff", height=70, width=90, count=1, dtype=dtype, compress=compression,
            crs="EPSG:32631", transform=from_origin(5e5, 4e6, 30, 20), **more,
        ) as written:
            written.write(field, 1)
        with rasterio.open(path) as read:
            expected = read.read(1)
        assert np.array_equal(read_field(path), expected)
        place = read_place(path, 2)
        assert place.crs == "EPSG:32631" and place.matrix is not None
        assert place.matrix.tolist() == [[0, 30, 500015], [-20, 0, 3999990]]


@pytest.mark.parametrize("compression", ["lzw", "zstd", "lzma", "packbits", "webp", "lerc"])
def test_tifffile(tmp_path: Path, compression: str) -> None:
    field = RAMP.astype(np.uint8)
    lossless: dict[str, Any] = {"compressionargs": {"lossless": True}} if compression == "webp" else {}
    picture = np.stack([field] * 3, axis=-1) if compression == "webp" else field
    kind = "rgb" if compression == "webp" else "minisblack"
    tifffile.imwrite(tmp_path / "a.tif", picture, compression=compression, photometric=kind, tile=(32, 32), **lossless)
    channel = {"channel": 1} if compression == "webp" else {}
    assert np.array_equal(read_field(tmp_path / "a.tif", **channel), field)


def test_encode_of_the_command_line(tmp_path: Path) -> None:
    """The case that used to need a library that no extra brought: tiles of 16-bit heights with LZW."""
    field = (RAMP - 30).astype(np.int16)
    tifffile.imwrite(tmp_path / "dem.tif", field, compression="lzw", predictor=2, tile=(32, 32))
    ok("encode", tmp_path / "dem.tif", "-o", tmp_path / "dem.iso", "--isovalue", "50.5", "--precision", "exact")
    assert np.array_equal(isocodec.open((tmp_path / "dem.iso").read_bytes()).above(), field > 50.5)


def test_parts_with_a_size_of_their_own(tmp_path: Path) -> None:
    """A tile of 32 x 32 samples that holds a picture of 4,000 x 4,000: nothing is allocated for it."""
    large = np.zeros((4000, 4000), np.uint8)
    parts = {
        "jpeg2000": imagecodecs.jpeg2k_encode(large), "png": imagecodecs.png_encode(large),
        "jpeg": imagecodecs.jpeg_encode(large), "lerc": imagecodecs.lerc_encode(large),
    }
    for compression, part in parts.items():
        path = tmp_path / f"{compression}.tif"
        tifffile.imwrite(
            path, iter([part]), shape=(32, 32), dtype=np.uint8, compression=compression, tile=(32, 32),
            photometric="minisblack",
        )
        tracemalloc.start()
        try:
            with pytest.raises(InputError, match="cannot be read"):
                read_field(path)
            assert tracemalloc.get_traced_memory()[1] < 8e6
        finally:
            tracemalloc.stop()


def test_zstandard_that_unpacks_to_more(tmp_path: Path) -> None:
    """GDAL unpacks as much as a tile holds."""
    bomb = imagecodecs.zstd_encode(bytes(100 << 20))
    tifffile.imwrite(
        tmp_path / "a.tif", iter([bomb]), shape=(32, 32), dtype=np.uint8, compression="zstd", tile=(32, 32)
    )
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert not read_field(tmp_path / "a.tif").any()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 64 << 10


def test_a_compression_that_is_not_read(tmp_path: Path) -> None:
    part = imagecodecs.jpegxl_encode(RAMP[:32, :32].astype(np.uint8))
    tifffile.imwrite(
        tmp_path / "a.tif", iter([part]), shape=(32, 32), dtype=np.uint8, compression=50002, tile=(32, 32),
        photometric="minisblack",
    )
    with pytest.raises(InputError, match=r"missing codec JXL.*: save it with LZW, Deflate or Zstandard"):
        read_field(tmp_path / "a.tif")
