"""Frames of an input as a series, for ``isocodec encode``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import click

from .prepared import Prepared


def check_series(frames: bool, axis: int | None, interval: int | None) -> None:
    """Refuse options of a series where none is asked for."""
    if not frames and (axis is not None or interval is not None):
        option = "--frame-axis" if axis is not None else "--frame-interval"
        raise click.UsageError(f"{option} is about a series: add --frames")


def encode_series(
    prepared: Prepared, interval: int, isovalues: Sequence[float], options: Mapping[str, Any],
    progress: Callable[[int, int], object] | None,
) -> bytes:
    """Encode frames as a series; ``progress`` is told of them."""
    import numpy as np

    from ..stream.series import SeriesEncoder

    series = SeriesEncoder(isovalues[0] if len(isovalues) == 1 else isovalues, interval=interval, **options)
    out = []
    for number, (frame, hole) in enumerate(prepared.each(isovalues), 1):
        out.append(series.add(frame if hole is None else np.ma.array(frame, mask=hole)))
        if progress:
            progress(number, len(prepared))
    return b"".join(out) + series.finish()
