"""Find the least and the largest sample of a field, tile by tile, so that it need not be in memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..field.samples import missing_of
from .layout import TileGrid, in_order


def sample_range(
    field: Any, grid: TileGrid, progress: Callable[[int, int], object] | None = None
) -> tuple[float, float] | None:
    """Find the least and the largest of the samples that are not missing; None if all are missing.

    Parameters
    ----------
    field : array
        Anything with slices that `encode_tiles` accepts; at most one tile is in memory.
    grid : TileGrid
        The tiles to read.
    progress : callable, optional
        Called with the number of tiles done and the total.
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
