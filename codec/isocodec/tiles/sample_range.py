"""The least and the largest sample of a field that need not be in memory: tile by tile."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..field.samples import missing_of
from .layout import TileGrid, in_order


def sample_range(
    field: Any, grid: TileGrid, progress: Callable[[int, int], object] | None = None
) -> tuple[float, float] | None:
    """The least and the largest of the samples that are not missing; None if all are.

    Parameters
    ----------
    field : array
        Anything with slices, as `encode_tiles` takes it; no more than a tile of it is in memory.
    grid : TileGrid
        The tiles that are read.
    progress : callable, optional
        Called with tiles done and their total.
    """
    found: list[tuple[Any, Any]] = []
    for done, index in enumerate(map(tuple, in_order(grid.counts).tolist()), 1):
        window = field[grid.window(index)]
        values = np.asarray(window)[~missing_of(window)]
        if values.size:
            found = [*found, (values.min(), values.max())]
            found = [(min(low for low, _ in found), max(high for _, high in found))]
        if progress:
            progress(done, grid.total)
    return (float(found[0][0]), float(found[0][1])) if found else None
