"""What a user would pick for a curve: bi-level pictures, vector files, and the picture that the curve comes from.

Names tell the settings, so that sizes from elsewhere can be held against them.
"""

from __future__ import annotations

import gzip
import io
import lzma
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import lines as vector
from .measure import Codec, absent, need

JBIG_LAYERS = 5
TWKB_PARTS = 16
SIMPLIFIED = (0.1, 0.25, 0.5, 1.0)
"""Tolerances of Douglas-Peucker in cells."""


def mask_peers(mask: NDArray[np.bool_]) -> list[Codec]:
    """Exact inside/outside of a picture (rows, columns); decoding gives it back."""
    octets = mask.astype(np.uint8)
    peers = [
        Codec(
            "jbig1-seq", "jbigkit", lambda: need("jbigkit").encode(mask), lambda d: need("jbigkit").decode(d),
            note="one stripe",
        ),
        Codec(
            f"jbig1-prog{JBIG_LAYERS}", "jbigkit", lambda: need("jbigkit").encode(mask, JBIG_LAYERS),
            lambda d: need("jbigkit").decode(d), True,
        ),
        Codec("jbig2-generic", "jbig2", absent, absent),
    ]
    for effort in (7, 9):
        peers.append(Codec(
            f"jxl-ll-e{effort}", "imagecodecs", partial(jxl_lossless, octets, effort), lambda d: image(d, "jpegxl") > 0,
            note="8-bit samples 0 and 1",
        ))
    return peers + [
        Codec("j2k-ll", "imagecodecs", lambda: _j2k(octets), lambda d: image(d, "jpeg2k") > 0, True, "1 bit"),
        Codec("webp-ll", "imagecodecs", lambda: _webp(octets), lambda d: image(d, "webp")[..., 0] > 0),
        Codec("tiff-g4", "PIL", lambda: _group4(mask), _pillow, note="one strip"),
        Codec("xz", "lzma", lambda: xz(packed(mask)), lambda d: unpacked(lzma.decompress(d), mask.shape)),
        Codec(
            "brotli", "brotli", lambda: need("brotli").compress(packed(mask)),
            lambda d: unpacked(need("brotli").decompress(d), mask.shape),
        ),
    ]


def curve_peers(lines: vector.Lines) -> list[Codec]:
    """Polylines; decoding gives polylines back."""
    brotli = "brotli"

    def squeezed(name: str, needs: str, write: Callable[[], bytes], read: Callable[[bytes], Any]) -> Codec:
        return Codec(
            f"{name}+brotli11", f"{needs} {brotli}".strip(), lambda: need(brotli).compress(write(), quality=11),
            lambda d: read(need(brotli).decompress(d)),
        )

    peers = [
        Codec(
            "geojson2d+gzip9", "gzip", lambda: gzip.compress(vector.to_geojson(lines, 2), 9),
            lambda d: vector.from_geojson(gzip.decompress(d)),
        ),
        squeezed("geojson2d", "", lambda: vector.to_geojson(lines, 2), vector.from_geojson),
        squeezed(
            f"topojson-1/{TWKB_PARTS}px", "topojson shapely", partial(vector.to_topojson, lines, TWKB_PARTS),
            vector.from_topojson,
        ),
        Codec(
            f"twkb-1/{TWKB_PARTS}px+xz9e", "lzma", lambda: xz(vector.to_twkb(lines, TWKB_PARTS)),
            lambda d: vector.from_twkb(lzma.decompress(d), TWKB_PARTS),
        ),
    ]
    for parts in (4, 8, 16, 32, 64):
        write = partial(vector.to_twkb, lines, parts)
        peers.append(squeezed(f"twkb-1/{parts}px", "", write, partial(vector.from_twkb, parts=parts)))
    for tolerance in SIMPLIFIED:
        write = partial(_simplified_twkb, lines, tolerance)
        read = partial(vector.from_twkb, parts=TWKB_PARTS)
        peers.append(squeezed(f"dp{tolerance:g}px+twkb-1/{TWKB_PARTS}px", "shapely", write, read))
    return peers


def picture_peers(values: NDArray[Any]) -> list[Codec]:
    """The whole picture, lossless; decoding gives samples in the field's own numbers."""
    samples, back = as_picture(values)
    return [
        Codec("image-jxl-ll-e7", "imagecodecs", lambda: jxl_lossless(samples, 7), lambda d: back(image(d, "jpegxl"))),
        Codec("image-j2k-ll", "imagecodecs", lambda: _j2k(samples), lambda d: back(image(d, "jpeg2k")), True),
    ]


def lossy_pictures(values: NDArray[Any]) -> list[Callable[[float], Codec]]:
    """Codecs for a setting from 0 (best) to 1 (worst)."""
    samples, back = as_picture(values)

    def jxl(setting: float) -> Codec:
        distance = 0.05 * 500**setting
        work = partial(_imagecodecs, "jpegxl_encode", samples, distance=distance, effort=7, numthreads=1)
        note = f"distance {distance:.4g}"
        return Codec("image-jxl-lossy", "imagecodecs", work, lambda d: back(image(d, "jpegxl")), True, note)

    def j2k(setting: float) -> Codec:
        psnr = 95 - 75 * setting
        work = partial(_imagecodecs, "jpeg2k_encode", samples, level=psnr, reversible=False)
        note = f"PSNR {psnr:.4g}"
        return Codec("image-j2k-lossy", "imagecodecs", work, lambda d: back(image(d, "jpeg2k")), True, note)

    return [jxl, j2k]


def as_picture(values: NDArray[Any]) -> tuple[NDArray[Any], Callable[[NDArray[Any]], NDArray[np.float64]]]:
    """Samples of 8 or 16 bits that picture formats take, and the way back; wider ones are scaled to 16 bits."""
    low, high = float(values.min()), float(values.max())
    if values.dtype.kind in "iub" and high - low < 1 << 16:
        low, unit, kind = (0.0, 1.0, np.uint8) if low >= 0 and high < 256 else (low, 1.0, np.uint16)
    else:
        unit, kind = (high - low) / 65535, np.uint16
    samples = np.round((values.astype(float) - low) / unit).astype(kind)
    return samples, lambda read: read.astype(float) * unit + low


def packed(mask: NDArray[np.bool_]) -> bytes:
    """Eight samples a byte, every row from a byte of its own."""
    return np.packbits(mask, axis=-1).tobytes()


def unpacked(data: bytes, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """The way back."""
    octets = np.frombuffer(data, np.uint8).reshape(*shape[:-1], -1)
    return np.unpackbits(octets, axis=-1)[..., : shape[-1]].astype(bool)


def xz(data: bytes) -> bytes:
    """The smallest of several settings of xz."""
    settings = [(3, 0, 2), (0, 0, 0), (3, 0, 0), (4, 0, 0), (0, 2, 2)]
    tried = [
        lzma.compress(data, check=lzma.CHECK_NONE, filters=[
            {"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "lc": lc, "lp": lp, "pb": pb}
        ])
        for lc, lp, pb in settings
    ]
    return min(tried, key=len)


def _simplified_twkb(lines: vector.Lines, tolerance: float) -> bytes:
    return vector.to_twkb(vector.simplified(lines, tolerance), TWKB_PARTS)


def _imagecodecs(function: str, *arguments: Any, **options: Any) -> Any:
    return getattr(need("imagecodecs"), function)(*arguments, **options)


def image(data: bytes, codec: str) -> NDArray[Any]:
    """Samples of a file of a codec of imagecodecs."""
    return _imagecodecs(f"{codec}_decode", data)


def jxl_lossless(samples: NDArray[Any], effort: int) -> bytes:
    """A JPEG XL file of a picture of 8 or 16 bits."""
    return _imagecodecs("jpegxl_encode", samples, lossless=True, effort=effort, numthreads=1)


def _j2k(samples: NDArray[Any]) -> bytes:
    bits = 1 if samples.max() <= 1 else None
    return _imagecodecs("jpeg2k_encode", samples, level=0, reversible=True, bitspersample=bits)


def _webp(samples: NDArray[Any]) -> bytes:
    colours = np.repeat(samples[..., None] * np.uint8(255), 3, axis=2)
    return _imagecodecs("webp_encode", colours, lossless=True, level=100, method=6)


def _group4(mask: NDArray[np.bool_]) -> bytes:
    """What lies above is black, which makes smaller files."""
    file = io.BytesIO()
    strip = {need("PIL.TiffImagePlugin").ROWSPERSTRIP: len(mask)}
    need("PIL.Image").fromarray(~mask).save(file, "TIFF", compression="group4", tiffinfo=strip)
    return file.getvalue()


def _pillow(data: bytes) -> NDArray[np.bool_]:
    return ~np.asarray(need("PIL.Image").open(io.BytesIO(data))).astype(bool)
