"""What is transparent in a picture is missing, as it is in a GeoTIFF; GDAL says what is."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import rasterio
from PIL import Image

import isocodec
from commands import ok

GREY = (np.arange(60).reshape(6, 10) * 4).astype(np.uint8)
ALPHA = np.full((6, 10), 255, np.uint8)
ALPHA[:2], ALPHA[2] = 0, 1
COLOURS = np.dstack([GREY, GREY // 2, GREY[::-1]])


def png(depth: int, samples: np.ndarray, kind: int = 0, **chunks: bytes) -> bytes:
    """A PNG file of grey or of indices, with chunks before its samples."""
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    bits = (samples[..., None] >> np.arange(depth)[::-1] & 1).astype(np.uint8).reshape(len(samples), -1)
    rows = b"".join(b"\0" + np.packbits(row).tobytes() for row in bits)
    head = struct.pack(">IIBBBBB", *samples.shape[::-1], depth, kind, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + b"".join(
        chunk(name.encode(), data) for name, data in chunks.items()
    ) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def of_grey(depth: int) -> bytes:
    """Grey of that many bits, of which one shade is transparent."""
    shades = (np.arange(60).reshape(6, 10) * 1021 % (1 << depth)).astype(np.uint16)
    return png(depth, shades, tRNS=struct.pack(">H", int(shades[1, 3])))


def of_palette(clear: bytes) -> bytes:
    """Indices of 4 bits into 16 colours, of which some are transparent."""
    palette = np.arange(48, dtype=np.uint8).tobytes()
    return png(4, GREY % 16, 3, PLTE=palette, **({"tRNS": clear} if clear else {}))


def saved(path: Path, picture: np.ndarray, **options: object) -> bytes:
    Image.fromarray(picture).save(path, **options)
    return path.read_bytes()


PICTURES = {
    "LA": lambda path: saved(path, np.dstack([GREY, ALPHA])), "L": lambda path: saved(path, GREY),
    "RGBA": lambda path: saved(path, np.dstack([COLOURS, ALPHA])),
    "LA opaque": lambda path: saved(path, np.dstack([GREY, ALPHA * 0 + 255])),
    "RGBA opaque": lambda path: saved(path, np.dstack([COLOURS, ALPHA * 0 + 255])),
    "RGB with a clear colour": lambda path: saved(path, COLOURS, transparency=tuple(map(int, COLOURS[1, 2]))),
    **{f"grey of {depth} bits": lambda path, depth=depth: of_grey(depth) for depth in (1, 2, 4, 8, 16)},
    "palette": lambda path: of_palette(b""), "palette, one": lambda path: of_palette(b"\0"),
    "palette, some": lambda path: of_palette(bytes([255, 0, 100, 255, 0])),
    "palette, partly": lambda path: of_palette(bytes([1, 254])),
}


@pytest.mark.parametrize("kind", PICTURES)
def test_transparent_samples(tmp_path: Path, kind: str) -> None:
    """Of each channel: fully transparent samples alone are missing, not those of alpha; a number is beside alpha."""
    path = tmp_path / "a.png"
    path.write_bytes(PICTURES[kind](path))
    with rasterio.open(path) as file:
        clear = file.dataset_mask() == 0
        if "palette" in kind:
            colours = np.array([file.colormap(1)[index] for index in range(16)])[file.read(1)]
            clear, known = colours[..., 3] == 0, [colours[..., band] for band in range(3)]
        else:
            known = [file.read(band) for band in file.indexes]
            if len(known) in (2, 4):
                clear = known[-1] == 0
    assert clear.any() == ("opaque" not in kind and kind not in ("L", "palette", "palette, partly"))
    shades = np.asarray(Image.open(path)) if "bits" in kind else None
    for band, values in enumerate(known):
        values = values if shades is None else shades
        field = isocodec.read(path, channel=band)
        assert np.array_equal(field.values, values)
        alpha = band == len(known) - 1 and len(known) in (2, 4)
        assert np.array_equal(np.zeros_like(clear) if field.mask is None else field.mask, clear & (not alpha))
        marked = isocodec.read(path, channel=band, nodata=float(values[5, 5]))
        assert np.array_equal(marked.mask, (values == values[5, 5]) | (clear & (not alpha)))
    if kind.startswith("LA"):
        assert np.array_equal(isocodec.read(path).values, GREY)


@pytest.mark.parametrize("kind", ["palette", "palette, some", "tif"])
def test_labels_are_indices(tmp_path: Path, kind: str) -> None:
    """Of a palette with labels, as GDAL has the indices: read, encoded to labels, and verified."""
    path, out = tmp_path / f"a.{'tif' if kind == 'tif' else 'png'}", tmp_path / "a.iso"
    if kind == "tif":
        with rasterio.open(path, "w", driver="GTiff", width=10, height=6, count=1, dtype="uint8") as file:
            file.write(GREY % 16, 1)
            file.write_colormap(1, {index: (index, 0, 9, 255) for index in range(16)})
    else:
        path.write_bytes(PICTURES[kind](path))
    with rasterio.open(path) as file:
        indices = file.read(1)
    field = isocodec.read(path, labels=True)
    assert np.array_equal(field.values, indices) and np.array_equal(indices, GREY % 16)
    assert field.mask is None
    ok("encode", path, "-o", out, "--label", "all")
    assert np.array_equal(isocodec.open(out).labels(), indices)
    assert "NOT" not in ok("verify", out, path)
