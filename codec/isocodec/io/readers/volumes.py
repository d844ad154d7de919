"""Shared by readers of volumes: axes that come last and count volumes, or have one sample; whole numbers rescaled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .opened import Opened, numbers
from .reading import check_frame
from .slices import Slices

Array = NDArray[Any]


class OpenedVolumes(Opened):
    """A volume, or a series of volumes, which the last of four axes counts.

    Subclasses state the shape with all axes as ``_whole``, and the time from one volume to the next as ``_step``.
    """

    _whole: tuple[int, ...]
    _step = ""

    @property
    def _several(self) -> bool:
        return len(self._whole) == 4 and self._whole[3] > 1

    def _series(self) -> Slices | None:
        if not self._several:
            return None
        return Slices(
            self._whole, 3, lambda number: numbers(self._values(number)), squeezed(self._whole[:3]), step=self._step
        )


def single(volume: Array, frame: int | None) -> Array:
    """Headers have at least three axes; a picture, or a slice of a volume, has axes of length 1."""
    volume = volume.reshape(squeezed(volume.shape))
    if frame is not None:
        check_frame(frame, volume.shape[-1] if volume.ndim > 3 else 0)
        volume = volume[..., frame].reshape(squeezed(volume.shape[:-1]))
    if volume.ndim > 3:
        raise of_a_series(volume.shape)
    return volume


def of_a_series(shape: Sequence[int], by: str = "") -> InputError:
    """The error for a series of which no volume is chosen."""
    return InputError(
        f"holds a series of volumes, of shape {tuple(shape)}" + f", which differ by {by}" * bool(by), code="shape",
        remedy=f"take one with --frame 0 to {shape[-1] - 1}",
    )


def squeezed(shape: Sequence[int]) -> tuple[int, ...]:
    """A shape without the axes of one sample that `kept_axes` leaves out."""
    return tuple(int(shape[axis]) for axis in kept_axes(shape))


def scaled(raw: Array, slope: float, inter: float) -> Array | None:
    """Samples that need no floats: those of a volume without scaling, or integers by whole numbers; else None."""
    if (slope, inter) == (1.0, 0.0):
        return raw
    if raw.dtype.kind not in "iu" or not (slope.is_integer() and inter.is_integer()):
        return None
    ends = [int(end) * int(slope) + int(inter) for end in (np.iinfo(raw.dtype).min, np.iinfo(raw.dtype).max)]
    for kind in ("int32", "int64"):
        if np.iinfo(kind).min <= min(*ends, int(slope)) and max(*ends, int(slope)) <= np.iinfo(kind).max:
            values: Array = raw.astype(kind)
            values *= int(slope)
            values += int(inter)
            return values
    return None


def kept_axes(shape: Sequence[int]) -> list[int]:
    """Axes of a volume without those of one sample: at its end, and if it has three axes anywhere; at least two."""
    axes = list(range(len(shape)))
    while len(axes) > 3 and shape[axes[-1]] == 1:
        axes.pop()
    for axis in reversed(axes if len(axes) == 3 else []):
        if len(axes) > 2 and shape[axis] == 1:
            axes.remove(axis)
    return axes
