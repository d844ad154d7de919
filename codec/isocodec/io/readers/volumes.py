"""Shared by readers of volumes: axes that come last and count volumes, or have one sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

from ...errors import InputError
from .reading import check_frame

Array = NDArray[Any]


def single(volume: Array, frame: int | None) -> Array:
    """Headers have at least three axes; a picture, or a slice of a volume, has axes of length 1."""
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
    return volume.reshape(squeezed(volume.shape))


def squeezed(shape: Sequence[int]) -> tuple[int, ...]:
    """A shape without the axes of one sample that `kept_axes` leaves out."""
    return tuple(int(shape[axis]) for axis in kept_axes(shape))


def kept_axes(shape: Sequence[int]) -> list[int]:
    """Axes of a volume without those of one sample: at its end, and if it has three axes anywhere; at least two."""
    axes = list(range(len(shape)))
    while len(axes) > 3 and shape[axes[-1]] == 1:
        axes.pop()
    for axis in reversed(axes if len(axes) == 3 else []):
        if len(axes) > 2 and shape[axis] == 1:
            axes = [each for each in axes if each != axis]
    return axes
