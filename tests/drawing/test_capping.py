"""Surfaces closed at the box: trimesh finds them watertight, and both parts make up the box."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import OptionError, TruncatedError
from libraries import Late
from tables import heavy, looped

gaussian_filter = Late("scipy.ndimage.gaussian_filter")

SHAPE = (9, 11, 10)
BOX = 8 * 10 * 9


def noise(seed: int) -> np.ndarray:
    return gaussian_filter(np.random.default_rng(seed).standard_normal(SHAPE), 1.5)


@looped("seed", [0, *heavy(1, 2, 3)])
@looped("options", [{}, {"precision": "signs"}, {"precision": 0.5}])
def test_both_parts_make_up_the_box(seed: int, options: dict[str, Any]) -> None:
    contour = isocodec.decode(isocodec.encode(noise(seed), 0.02, **options))
    volumes = []
    for above in (True, False):
        mesh = contour.capped(above=above).to_trimesh()
        assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
        assert np.array_equal(mesh.vertices[: len(contour.points)], contour.points)
        volumes.append(mesh.volume)
    assert sum(volumes) == pytest.approx(BOX, rel=1e-9)
    assert volumes[0] / BOX == pytest.approx((noise(seed) > 0.02).mean(), abs=0.1)


@pytest.mark.parametrize("value", [-1.0, 1.0])
def test_a_whole_box_or_nothing(value: float) -> None:
    contour = isocodec.decode(isocodec.encode(np.full(SHAPE, value), 0.0))
    volume = {above: len(c.cells) and c.to_trimesh().volume for above in (True, False)
              for c in [contour.capped(above=above)]}
    assert volume[value > 0] == pytest.approx(BOX) and volume[value < 0] == 0


def test_what_cannot_be_capped() -> None:
    with pytest.raises(OptionError, match="isosurface"):
        isocodec.decode(isocodec.encode(noise(1)[0], 0.02)).capped()
    field = noise(1)
    field[2, 2, 2] = np.nan
    with pytest.raises(OptionError, match="samples are missing"):
        isocodec.decode(isocodec.encode(field, 0.02)).capped()
    data = isocodec.encode(noise(1), 0.02)
    ends = []
    for size in range(len(data) // 12, len(data), 4):
        contour = isocodec.decode(data, max_bytes=size)
        if not contour.complete:
            try:
                contour.capped()
            except TruncatedError:
                ends.append(size)
    assert ends
