"""Fields in tiles, for tests: a few fields, and files of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import isocodec
from encoded import encoded as kept
from isocodec.storage.ranges import ranges_of
from isocodec.tiles.tiled import TiledFile
from libraries import Late

gaussian_filter = Late("scipy.ndimage.gaussian_filter")


def hilly(shape: tuple[int, ...] = (129, 161)) -> np.ndarray:
    x, y = np.meshgrid(*map(np.arange, shape), indexing="ij")
    return np.rint(100 * np.sin(x / 17) * np.cos(y / 11) + x / 3).astype(np.int16)


def encoded(
    tmp_path: Path, field: np.ndarray | isocodec.Field, isovalue: object, tile: int = 32, **options: object
) -> bytes:
    if isinstance(field, np.ndarray | isocodec.Field) and "engine" not in options:
        return kept(field, isovalue, tile=tile, **options)
    path = tmp_path / "tiled.iso"
    isocodec.save(path, field, isovalue, tile=tile, **options)  # type: ignore[arg-type]
    return path.read_bytes()


def tiled_of(data: bytes, limits: isocodec.Limits | None = None) -> TiledFile:
    """What reads a file in tiles, piece by piece, of bytes that are all there."""
    return TiledFile(ranges_of(data), limits)


def pieces(contour: isocodec.Contour) -> list[tuple[tuple[float, ...], ...]]:
    """Cells as what they are made of, wherever they stand."""
    points = contour.points.round(7) + 0.0
    return sorted(tuple(sorted(map(tuple, points[cell].tolist()))) for cell in contour.cells)


def holed(field: np.ndarray, seed: int) -> np.ndarray:
    gone = gaussian_filter((np.random.default_rng(seed).random(field.shape) < 0.02).astype(float), 1) > 0.05
    return np.ma.masked_array(field, mask=gone)
