"""README's first sentence: the first bytes of a file draw the whole curve, for all kinds of files and all options."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import isocodec
from brute import examples
from isocodec import Field, Frames, Mesh
from isocodec.errors import TruncatedError
from isocodec.stream.options import ProfileName
from isoconform.fields import noise
from libraries import Late

gaussian_filter = Late("scipy.ndimage.gaussian_filter")
map_coordinates = Late("scipy.ndimage.map_coordinates")
Delaunay = Late("scipy.spatial.Delaunay")

SHARE = 20
"""One byte of so many is the beginning of a file."""
LEAST_BYTES = 1000
PARTS = 8
"""Slabs along each axis that the box of the whole curve is cut into."""
LEAST_POINTS = 0.05
"""Fraction of the curve's points from which on a slab has to be reached."""


def smooth(shape: tuple[int, ...], width: float, seed: int) -> NDArray[np.int32]:
    """Hills of a width in samples, in whole numbers from about -300 to 300."""
    field = gaussian_filter(np.random.default_rng(seed).normal(size=shape), width)
    return np.rint(100 * field / field.std()).astype(np.int32)


def drawn(data: bytes, size: int, mesh: Mesh | None, isovalues: Sequence[float]) -> NDArray[np.float64]:
    """Points that the first bytes of a file draw, of all frames and isovalues."""
    file = isocodec.open(data, mesh=mesh and (mesh.points, mesh.cells))
    points = []
    for frame in range(file.frames):
        for isovalue in file.isovalues or isovalues:
            try:
                contour = file.contour(isovalue, frame=frame or None, max_bytes=size, partial=True)
            except TruncatedError:
                continue
            points.append(contour.points[np.unique(contour.cells)])
    return np.concatenate(points or [np.zeros((0, 1))])


def unreached(whole: NDArray[np.float64], part: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Axes and slabs that hold a good part of the whole curve and nothing of the other."""
    if not len(part):
        return [(0, 0)]
    low, high = whole.min(axis=0), whole.max(axis=0)

    def slabs(points: NDArray[np.float64], axis: int) -> NDArray[np.int64]:
        at = PARTS * (points[:, axis] - low[axis]) / max(high[axis] - low[axis], 1e-300)
        return np.bincount(np.clip(at.astype(int), 0, PARTS - 1), minlength=PARTS)

    return [
        (axis, int(slab)) for axis in range(whole.shape[1])
        for slab in np.flatnonzero((slabs(whole, axis) >= LEAST_POINTS * len(whole)) & (slabs(part, axis) == 0))
    ]


def letters(shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Shapes of eight by eight samples that come again and again, between lines without any."""
    glyphs = (noise((4, 7, 5), 7, 8) > 120).astype(np.int64)
    out = np.zeros(shape, np.int64)
    for i in range(1, shape[0] - 7, 12):
        for j in range(1, shape[1] - 5, 7):
            out[i : i + 7, j : j + 5] = glyphs[(3 * i + 5 * j) % 4]
    return out


def field_of(shape: tuple[int, ...], width: float, seed: int) -> NDArray[np.int32]:
    """Smooth and noisy fields, and pages of letters, whose curves have no shape to follow."""
    if width == 0.0 and len(shape) == 2:
        return (200 * letters(shape) - 100).astype(np.int32)
    return smooth(shape, width, seed)


def recipes(n: int) -> st.SearchStrategy[tuple[tuple[int, ...], float, int]]:
    """Arguments of `field_of`."""
    sides = st.tuples(*[st.integers(80, 140) if n == 2 else st.integers(22, 36)] * n)
    return st.tuples(sides, st.sampled_from([0.0, 1.0, 2.0, 4.0, 8.0]), st.integers(0, 1 << 20))


def labels_of(field: NDArray[np.int64]) -> Field:
    return Field(field, labels=tuple(label for label in np.unique(field).tolist() if label))


def with_holes(field: NDArray[np.int32]) -> NDArray[np.float64]:
    missing = np.zeros(field.shape, bool)
    missing[tuple(slice(s // 4, s // 2) for s in field.shape)] = True
    return np.where(missing, np.nan, field)


LEVELS = (20.5, -35.5, 70.5)
PRECISIONS = (None, "signs", "exact")
ENCODERS: dict[str, Callable[..., bytes]] = {
    "isovalue": lambda field, **options: isocodec.encode(field, LEVELS[0], **options),
    "isovalues": lambda field, **options: isocodec.encode(field, LEVELS, **options),
    "mask": lambda field, **options: isocodec.encode(field > LEVELS[0], **options),
    "labels": lambda field, **options: isocodec.encode(
        labels_of(np.digitize(field, sorted(LEVELS))), **options
    ),
    "missing samples": lambda field, **options: isocodec.encode(with_holes(field), LEVELS[0], **options),
    "series": lambda field, **options: isocodec.encode(Frames([field, field + 9]), LEVELS[0], **options),
}
"""Kinds of files of grids, and what encodes a field as each."""


def check(data: bytes, mesh: Mesh | None = None) -> None:
    """Compare the first bytes with all of them; each isovalue, mask, frame and tile needs bytes enough of its own.

    Notes and masks come before the layers, and are not counted as first bytes: small files hold little else there.
    """
    file = isocodec.open(data, mesh=mesh and (mesh.points, mesh.cells))
    curves = max(len(file.isovalues), 1) + (file.kind == "grid" and not file.valid().all())
    assume(len(data) >= LEAST_BYTES * curves * file.frames * math.prod(file.info.tiles or ()))
    whole = drawn(data, len(data), mesh, LEVELS[:1])
    assume(len(whole))
    apart = sum(chunk.bytes for chunk in file.info.chunks if chunk.type in ("metadata", "mask"))
    assert not unreached(whole, drawn(data, apart + (len(data) - apart) // SHARE, mesh, LEVELS[:1]))


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("kind", ENCODERS)
@settings(examples(6), suppress_health_check=[HealthCheck.filter_too_much])
@given(st.data())
def test_grids(kind: str, n: int, data: st.DataObject) -> None:
    field, profile = field_of(*data.draw(recipes(n))), data.draw(st.sampled_from(get_args(ProfileName)))
    options = {} if kind in ("mask", "labels") else {"precision": data.draw(st.sampled_from(PRECISIONS))}
    if kind == "missing samples" and options["precision"] == "exact":  # which is for integers
        options["precision"] = "step=1"
    check(ENCODERS[kind](field, profile=profile, **options))


@pytest.mark.cover(1)
@pytest.mark.parametrize("precision", [None, "exact"])
@pytest.mark.parametrize("profile", get_args(ProfileName))
@pytest.mark.parametrize(("shape", "tile"), [((260, 260), 128), ((70, 40, 40), 32)])
def test_tiles(tmp_path: Path, shape: tuple[int, ...], tile: int, profile: ProfileName, precision: Any) -> None:
    path = tmp_path / "tiles.iso"
    isocodec.save(path, smooth(shape, 2.0, 0), LEVELS[:1], tile=tile, profile=profile, precision=precision)
    data = path.read_bytes()
    assert len(data) >= LEAST_BYTES * math.prod(isocodec.open(data).info.tiles or ())
    check(data)
