"""What a user would pick for a surface: stacked bi-level slices, meshes, and the volume that the surface comes from.

Names tell the settings, so that sizes from elsewhere can be held against them.
"""

from __future__ import annotations

import lzma
import struct
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .measure import Codec, absent, need
from .peers2d import image, jxl_lossless, packed, unpacked, xz

DRACO_BITS = (8, 10, 14)
DRACO_LEVEL = 10
MESHOPT_BITS = 12
FINEST, COARSEST = 0.002, 0.5
"""Largest errors of samples that are tried, parts of their range."""

Mesh = tuple[NDArray[np.float32], NDArray[np.uint32]]
"""Vertices (V, 3) in array index coordinates, triangles (F, 3)."""


def mask_peers(mask: NDArray[np.bool_]) -> list[Codec]:
    """Exact inside/outside of a volume (slices, rows, columns); decoding gives it back."""
    shape = mask.shape
    tall = mask.reshape(-1, shape[2])
    return [
        Codec(
            "mask-jbig1-tall", "jbigkit", lambda: need("jbigkit").encode(tall),
            lambda d: need("jbigkit").decode(d).reshape(shape), note="slices stacked",
        ),
        Codec("mask-jbig2-tall", "jbig2", absent, absent),
        Codec(
            "mask-xz9e", "lzma", lambda: xz(packed(mask)),
            lambda d: unpacked(lzma.decompress(d), shape),
        ),
        Codec("mask-jxl-slices-e7", "imagecodecs", lambda: _jxl_slices(mask), _from_jxl_slices),
    ]


def mesh_peers(mesh: Mesh) -> list[Codec]:
    """A mesh; decoding gives vertices and triangles back."""
    peers = []
    for bits in DRACO_BITS:
        work = partial(_draco, mesh, bits)
        peers.append(Codec(f"draco-eb-qp{bits}-cl{DRACO_LEVEL}", "DracoPy", work, _from_draco))
    return peers + [
        Codec(
            f"meshopt-qp{MESHOPT_BITS}+zstd19", "meshoptimizer imagecodecs", partial(_meshopt, mesh, MESHOPT_BITS),
            _from_meshopt,
        ),
        Codec("ply+xz9", "lzma", partial(_ply, mesh), lambda d: _from_ply(lzma.decompress(d)), note="float32"),
    ]


def lossy_volumes(values: NDArray[Any]) -> list[Callable[[float], Codec]]:
    """Codecs for a setting from 0 (best) to 1 (worst): the largest error of samples, part of their range.

    Some wheels of imagecodecs are built without these modules.
    """
    samples = np.ascontiguousarray(values, np.float32)
    extent = float(samples.max() - samples.min())

    def error(setting: float) -> float:
        return extent * FINEST * (COARSEST / FINEST) ** setting

    def sperr(setting: float) -> Codec:
        return Codec(
            "volume-sperr-mean0.1vox", "imagecodecs._sperr",
            lambda: need("imagecodecs").sperr_encode(samples, error(setting), "pwe", numthreads=1),
            lambda d: need("imagecodecs").sperr_decode(d, numthreads=1), True, f"largest error {error(setting):.4g}",
        )

    def sz3(setting: float) -> Codec:
        return Codec(
            "volume-sz3-mean0.1vox", "imagecodecs._sz3",
            lambda: need("imagecodecs").sz3_encode(samples, "abs", error(setting)),
            lambda d: need("imagecodecs").sz3_decode(d, samples.shape, samples.dtype),
            note=f"largest error {error(setting):.4g}",
        )

    return [sperr, sz3]


def _jxl_slices(mask: NDArray[np.bool_]) -> bytes:
    """One codestream a slice, each behind its length."""
    parts = [jxl_lossless(piece.astype(np.uint8), 7) for piece in mask]
    return b"".join(struct.pack("<I", len(part)) + part for part in parts)


def _from_jxl_slices(data: bytes) -> NDArray[np.bool_]:
    slices, at = [], 0
    while at < len(data):
        (size,) = struct.unpack_from("<I", data, at)
        slices.append(image(data[at + 4 : at + 4 + size], "jpegxl") > 0)
        at += 4 + size
    return np.stack(slices)


def _draco(mesh: Mesh, bits: int) -> bytes:
    return need("DracoPy").encode(*mesh, quantization_bits=bits, compression_level=DRACO_LEVEL)


def _from_draco(data: bytes) -> tuple[NDArray[Any], NDArray[Any]]:
    mesh = need("DracoPy").decode(data)
    return np.asarray(mesh.points), np.asarray(mesh.faces)


def _meshopt(mesh: Mesh, bits: int) -> bytes:
    """Quantised vertices of four 16-bit numbers and triangles, both reordered for their codecs; zstd behind them."""
    mo = need("meshoptimizer")
    points, triangles = mesh
    low = points.min(axis=0)
    unit = float((points.max(axis=0) - low).max()) / ((1 << bits) - 1)
    numbers = np.zeros((len(points), 4), np.uint16)
    numbers[:, :3] = np.round((points - low) / unit)
    indices = np.ascontiguousarray(triangles.ravel(), np.uint32)
    ordered = np.zeros_like(indices)
    mo.optimize_vertex_cache(ordered, indices, len(indices), len(points))
    remap = np.zeros(len(points), np.uint32)
    count = mo.optimize_vertex_fetch_remap(remap, ordered, len(ordered), len(points))
    moved = np.zeros((count, 4), np.uint16)
    used = remap < count
    moved[remap[used]] = numbers[used]
    vertices = mo.encode_vertex_buffer(moved, count, 8)
    faces = mo.encode_index_buffer(remap[ordered], len(ordered), count)
    head = struct.pack("<3I4f", count, len(ordered), len(vertices), *low, unit)
    return need("imagecodecs").zstd_encode(head + vertices + faces, level=19)


def _from_meshopt(data: bytes) -> tuple[NDArray[Any], NDArray[Any]]:
    mo = need("meshoptimizer")
    raw = bytes(need("imagecodecs").zstd_decode(data))
    count, indices, size, *place = struct.unpack_from("<3I4f", raw)
    # the element is a whole vertex: the library makes room for so many of them
    numbers = mo.decode_vertex_buffer(count, 8, raw[28 : 28 + size], np.dtype((np.uint16, 4)))
    faces = mo.decode_index_buffer(indices, 4, raw[28 + size :])
    return numbers[:, :3] * place[3] + np.array(place[:3]), np.asarray(faces).reshape(-1, 3)


def _ply(mesh: Mesh) -> bytes:
    points, triangles = mesh
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.zeros(len(triangles), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    return lzma.compress(head.encode() + points.astype("<f4").tobytes() + faces.tobytes(), preset=9)


def _from_ply(data: bytes) -> tuple[NDArray[Any], NDArray[Any]]:
    body = data.index(b"end_header\n") + len(b"end_header\n")
    words = data[:body].decode().split()
    count = int(words[words.index("vertex") + 1])
    points = np.frombuffer(data, "<f4", 3 * count, body).reshape(-1, 3)
    faces = np.frombuffer(data, [("count", "u1"), ("corners", "<i4", 3)], -1, body + points.nbytes)
    return points, faces["corners"]
