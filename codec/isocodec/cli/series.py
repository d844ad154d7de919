"""Slices of a volume as the frames of a series, for ``isocodec encode``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..io.place import Place


def check_series(frames: bool, axis: int | None, interval: int | None) -> None:
    """Refuse options of a series where none is asked for."""
    if not frames and (axis is not None or interval is not None):
        option = "--frame-axis" if axis is not None else "--frame-interval"
        raise click.UsageError(f"{option} is about a series: add --frames")


def along_axis(field: NDArray[Any], axis: int) -> NDArray[Any]:
    """The volume with the axis that counts frames first."""
    import numpy as np

    if field.ndim != 3:
        raise click.UsageError(f"--frames makes a series of a volume; the data have {field.ndim} axes")
    if not -3 <= axis < 3:
        raise click.UsageError(f"--frame-axis {axis}: the data have the axes 0 to 2")
    return np.moveaxis(field, axis, 0)


def place_of_slices(read: Callable[[int, int | None], Place], axis: int) -> Place:
    """Where the samples of a slice lie; ``read`` asks the input, of so many axes and of one of its frames.

    Files say it of slices along their first axis: times, pages. Ends that meet are not joined in a series.
    """
    from dataclasses import replace

    from ..io.place import Place

    if axis not in (0, -3):
        whole = read(3, None)
        if whole.placement is None and whole.mapped is None and not whole.remark:
            return Place()
        return Place(remark="its coordinates are ignored; set the steps of a slice with --spacing")
    place = read(2, 0)
    if place.mapped is None or not place.mapped.periodic:
        return place
    remark = f"its ends along axis {place.mapped.periodic[0]} are not joined, as it is a series"
    return replace(place, mapped=replace(place.mapped, periodic=()), remark=remark)


def encode_series(
    field: NDArray[Any], hole: NDArray[Any] | None, axis: int, interval: int, isovalues: Sequence[float],
    options: Mapping[str, Any], progress: Callable[[int, int], object] | None,
) -> bytes:  # fmt: skip
    """Encode the slices of a volume as a series; ``progress`` is told of frames."""
    import numpy as np

    from ..stream.series import SeriesEncoder

    frames = along_axis(field, axis)
    holes = None if hole is None else along_axis(hole, axis)
    series = SeriesEncoder(isovalues[0] if len(isovalues) == 1 else isovalues, interval=interval, **options)
    out = []
    for number, frame in enumerate(frames):
        out.append(series.add(frame if holes is None else np.ma.array(frame, mask=holes[number])))
        if progress:
            progress(number + 1, len(frames))
    return b"".join(out) + series.finish()
