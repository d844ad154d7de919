"""Coded surfaces beside other formats: ``tin_peers.py terrain FILE.npy ..``, ``tin_peers.py picture FILE.npy=BYTES ..``

Terrains: bytes of `encode_tin` at a largest error against quantized-mesh and gzip of pydelatin's surface, JPEG 2000 at
the same largest error, near-lossless JPEG-LS and LERC, and the vertices of pydelatin's. Pictures: PSNR in so many bytes
against JPEG 2000 and JPEG XL. Values other than bytes are spread over 0 to 255 first. Needs the extra ``bench``.
"""

from __future__ import annotations

import gzip
import io
import math
import sys
from collections.abc import Callable

import imagecodecs
import numpy as np

import isocodec

ERRORS = (5, 10, 20, 40)
WINDOW = slice(20, 220), slice(20, 220)


def jpeg2000_within(field: np.ndarray, error: float) -> int:
    """Bytes of the smallest file of JPEG 2000 whose largest error is no greater."""
    for level in range(30, 110):
        data = imagecodecs.jpeg2k_encode(field.astype(np.uint16), level=level, codecformat="j2k", reversible=False)
        if np.abs(imagecodecs.jpeg2k_decode(data).astype(float) - field).max() <= error:
            return len(data)
    return len(imagecodecs.jpeg2k_encode(field.astype(np.uint16), codecformat="j2k", reversible=True))


def greedy(field: np.ndarray, error: float) -> tuple[int, int]:
    """Vertices of pydelatin's surface, and its bytes as quantized-mesh with gzip."""
    import quantized_mesh_encoder
    from pydelatin import Delatin

    found = Delatin(field.astype(np.float32), max_error=error)
    file = io.BytesIO()
    vertices, triangles = found.vertices.ravel().astype(np.float32), found.triangles.ravel().astype(np.uint32)
    quantized_mesh_encoder.encode(file, vertices, triangles)
    return len(found.vertices), len(gzip.compress(file.getvalue()))


def terrain(name: str) -> None:
    """A line for each error."""
    field = np.load(name)[WINDOW].astype(float)
    field -= field.min()
    for error in ERRORS:
        data = isocodec.encode(isocodec.thin(field, error=error))
        tin = isocodec.open(data).surface()
        assert np.abs(tin.raster() - field).max() <= error + 1e-9
        vertices, mesh = greedy(field, error)
        peers = {
            "quantized-mesh": mesh,
            "JPEG 2000": jpeg2000_within(field, error),
            "JPEG-LS": len(imagecodecs.jpegls_encode(field.astype(np.uint16), level=error)),
            "LERC": len(imagecodecs.lerc_encode(field.astype(np.int32), level=float(error))),
        }
        shares = ", ".join(f"{len(data) / size:.3f} of {peer}" for peer, size in peers.items())
        print(f"{name} {error}: {len(data)} bytes; {shares}; {len(tin.points) / vertices:.3f} of pydelatin's vertices")


def psnr(field: np.ndarray, decoded: np.ndarray) -> float:
    """In decibels, of values from 0 to 255."""
    mean = ((decoded.astype(float) - field) ** 2).mean()
    return 10 * math.log10(255**2 / mean) if mean else math.inf


def filling(size: int, encode: Callable[[float], bytes], low: float, high: float) -> bytes:
    """The largest file of an encoder that takes no more bytes, which grow with its number."""
    best = b""
    for _ in range(14):
        middle = (low + high) / 2
        data = encode(middle)
        if len(data) <= size:
            low, best = middle, max(best, data, key=len)
        else:
            high = middle
    return best


def jpeg2000_filling(whole: np.ndarray, size: int) -> bytes:
    """The largest file of JPEG 2000 within a size."""
    return filling(size, lambda level: imagecodecs.jpeg2k_encode(whole, level=level, codecformat="j2k"), 10, 80)


def jpegxl_filling(whole: np.ndarray, size: int) -> bytes:
    """The largest file of JPEG XL within a size."""
    return filling(size, lambda level: imagecodecs.jpegxl_encode(whole, distance=16 - level), 0, 15.9)


def picture(argument: str) -> None:
    """A line for a picture and a size."""
    name, _, size = argument.rpartition("=")
    field = np.load(name).astype(float)
    if field.min() < 0 or field.max() > 255 or field.max() <= 1:
        field = (field - field.min()) / np.ptp(field) * 255
    whole = np.rint(field).astype(np.uint8)
    found = isocodec.open(isocodec.encode(isocodec.thin(field, size=int(size)))).surface()
    jpeg2000, jpegxl = jpeg2000_filling(whole, int(size)), jpegxl_filling(whole, int(size))
    print(
        f"{name} in {size} bytes: {psnr(field, found.raster()):.2f} dB, {len(found.points)} points; "
        f"JPEG 2000 {psnr(field, imagecodecs.jpeg2k_decode(jpeg2000)):.2f}"
        + (f", JPEG XL {psnr(field, imagecodecs.jpegxl_decode(jpegxl)):.2f}" if jpegxl else "")
    )


if __name__ == "__main__":
    for each in sys.argv[2:]:
        {"terrain": terrain, "picture": picture}[sys.argv[1]](each)
