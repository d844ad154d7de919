"""Shared by readers of volumes: axes that come last and count volumes, or have one sample; whole numbers rescaled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
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
        raise of_a_series(volume.shape)
    return volume


def of_a_series(shape: Sequence[int], by: str = "") -> InputError:
    """The error for a series of which no volume is chosen."""
    return InputError(
        f"holds a series of volumes, of shape {tuple(shape)}" + f", which differ by {by}" * bool(by), code="shape",
        remedy=f"take one with --frame 0 to {shape[-1] - 1}",
    )


def is_series_of_volumes(shape: Sequence[int]) -> bool:
    """Whether the axes of a volume file count volumes, too, by the fourth and last of them."""
    return len(shape) == 4 and shape[3] > 1


def _without_ones(volume: Array) -> Array:
    return volume.reshape(squeezed(volume.shape))


def squeezed(shape: Sequence[int]) -> tuple[int, ...]:
    """A shape without the axes of one sample that `kept_axes` leaves out."""
    return tuple(int(shape[axis]) for axis in kept_axes(shape))


def scaled(raw: Array, slope: float, inter: float) -> Array | None:
    """Samples that need no floats: those of a volume without scaling, or integers by whole numbers; else None."""
    if (slope, inter) == (1.0, 0.0):
        return raw
    if raw.dtype.kind not in "iu" or not (slope.is_integer() and inter.is_integer()):
        return None
    info = np.iinfo(raw.dtype)
    ends = [int(end) * int(slope) + int(inter) for end in (info.min, info.max)]
    for kind in ("int32", "int64"):
        if np.iinfo(kind).min <= min(*ends, int(slope)) and max(*ends, int(slope)) <= np.iinfo(kind).max:
            scaled: Array = raw.astype(kind)
            scaled *= int(slope)
            scaled += int(inter)
            return scaled
    return None


def kept_axes(shape: Sequence[int]) -> list[int]:
    """Axes of a volume without those of one sample: at its end, and if it has three axes anywhere; at least two."""
    axes = list(range(len(shape)))
    while len(axes) > 3 and shape[axes[-1]] == 1:
        axes.pop()
    for axis in reversed(axes if len(axes) == 3 else []):
        if len(axes) > 2 and shape[axis] == 1:
            axes = [each for each in axes if each != axis]
    return axes
