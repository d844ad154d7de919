"""Stand-ins for the bench's codecs where these are not installed: they lose what a codec loses, and pack little.

What the bench does around a codec (splitting, rounding, stacking, reordering, and the way back) then runs without it.
"""

from __future__ import annotations

import io
import json
import zlib
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray


def _kept(samples: NDArray[Any], *_: Any, **__: Any) -> bytes:
    file = io.BytesIO()
    np.save(file, samples)
    return zlib.compress(file.getvalue())


def _back(data: bytes, *_: Any, **__: Any) -> NDArray[Any]:
    return np.load(io.BytesIO(zlib.decompress(data)))


def _within(samples: NDArray[Any], error: float) -> bytes:
    """Samples in steps of twice an error."""
    return _kept((np.round(samples / (2 * error)) * (2 * error)).astype(samples.dtype))


def _draco(points: NDArray[Any], faces: NDArray[Any], quantization_bits: int, compression_level: int) -> bytes:
    assert 0 <= compression_level <= 10
    low = points.min(axis=0)
    unit = (points.max(axis=0) - low).max() / ((1 << quantization_bits) - 1)
    file = io.BytesIO()
    np.savez_compressed(file, points=np.round((points - low) / unit) * unit + low, faces=faces)
    return file.getvalue()


def _from_draco(data: bytes) -> SimpleNamespace:
    with np.load(io.BytesIO(data)) as arrays:
        return SimpleNamespace(points=arrays["points"], faces=arrays["faces"])


def _cache_order(out: NDArray[Any], indices: NDArray[Any], *_: int) -> None:
    """Triangles the other way round, which is an order as good as any."""
    out[:] = indices.reshape(-1, 3)[::-1].ravel()


def _fetch_order(remap: NDArray[Any], indices: NDArray[Any], *_: int) -> int:
    """Vertices in the order of their first use; those without any get the largest number."""
    used, first = np.unique(indices, return_index=True)
    remap[:] = np.iinfo(remap.dtype).max
    remap[used[np.argsort(first)]] = np.arange(len(used), dtype=remap.dtype)
    return len(used)


class _Topology:
    """The arcs of a multi-line string on a grid, each from its first point in steps."""

    def __init__(self, shape: Any, topoquantize: dict[str, list[float]], **_: bool) -> None:
        scale = np.array(topoquantize["scale"])
        arcs = [np.round(np.asarray(line.coords) / scale).astype(int) for line in shape.geoms]
        steps = [np.diff(arc, axis=0, prepend=np.zeros((1, 2), int)).tolist() for arc in arcs]
        self._text = json.dumps({"transform": topoquantize, "arcs": steps})

    def to_json(self) -> str:
        return self._text


_SPERR = SimpleNamespace(
    sperr_encode=lambda samples, error, mode, numthreads: _within(samples, error), sperr_decode=_back,
)
_SZ3 = SimpleNamespace(sz3_encode=lambda samples, mode, error: _within(samples, error), sz3_decode=_back)
_PICTURES = {f"{name}_{way}": work for name in ("jpegxl", "jpeg2k", "webp") for way, work in
             (("encode", _kept), ("decode", _back))}

STAND_INS = {
    "brotli": SimpleNamespace(compress=lambda data, quality=11: zlib.compress(data, 9), decompress=zlib.decompress),
    "imagecodecs": SimpleNamespace(
        **_PICTURES, **vars(_SPERR), **vars(_SZ3),
        zstd_encode=lambda data, level: zlib.compress(data), zstd_decode=zlib.decompress,
    ),
    "imagecodecs._sperr": _SPERR,
    "imagecodecs._sz3": _SZ3,
    "DracoPy": SimpleNamespace(encode=_draco, decode=_from_draco),
    "meshoptimizer": SimpleNamespace(
        optimize_vertex_cache=_cache_order, optimize_vertex_fetch_remap=_fetch_order,
        encode_vertex_buffer=lambda vertices, count, size: vertices.tobytes(),
        decode_vertex_buffer=lambda count, size, data, kind: np.frombuffer(data, kind, count),
        encode_index_buffer=lambda indices, count, vertices: indices.astype("<u4").tobytes(),
        decode_index_buffer=lambda count, size, data: np.frombuffer(data, "<u4", count),
    ),
    "topojson": SimpleNamespace(Topology=_Topology),
}
"""By name of the library."""
