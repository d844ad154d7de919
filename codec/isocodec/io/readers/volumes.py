"""Shared by readers of volumes: axes that come last and count volumes, or have one sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

from ...errors import InputError
from .reading import check_frame

Array = NDArray[Any]


def single(volume: Array, frame: int | None) -> Array:
    """Headers have at least three axes; a picture, or one volume of a series, ends in axes of length 1."""
    volume = _without_ones(volume)
    if frame is not None:
        check_frame(frame, volume.shape[-1] if volume.ndim > 3 else 0)
        volume = _without_ones(volume[..., frame])
    if volume.ndim > 3:
        raise InputError(
            f"holds a series of volumes, of shape {volume.shape}", code="shape",
            remedy=f"take one with --frame 0 to {volume.shape[-1] - 1}",
        )
    return volume


def is_series_of_volumes(shape: Sequence[int]) -> bool:
    """Whether the axes of a volume file count volumes, too, by the fourth and last of them."""
    return len(shape) == 4 and shape[3] > 1


def _without_ones(volume: Array) -> Array:
    while volume.ndim > 2 and volume.shape[-1] == 1:
        volume = volume[..., 0]
    return volume


def squeezed(shape: Sequence[int]) -> tuple[int, ...]:
    """A shape without axes of length 1 at its end, but at least two axes."""
    kept = tuple(map(int, shape))
    while len(kept) > 2 and kept[-1] == 1:
        kept = kept[:-1]
    return kept
