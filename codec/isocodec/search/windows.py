"""Parts of a field to try meshes on, when all of it would take long."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from isospec.container import Profile

from ..field.samples import Samples, mask_field
from ..format.header import Header
from ..grid.layers.layer_writer import encoded_mask
from ..grid.tube.holes import Holes
from .ground_truth import truth_of
from .promise import Promise

SIDE = {2: 128, 3: 32}
"""Cells along the sides of windows at a tolerance of up to one cell."""
ENOUGH = {2: (0.08, 1200), 3: (0.08, 4000)}
"""Windows have this share of the crossings of the grid's edges, and at least so many."""
MOST = 3
"""Windows have at most about so many times that number of crossings."""


def windows(promise: Promise, tolerance: float) -> list[Promise]:
    """Promises of some parts of a field that represent all of it; none if the field is small."""
    n = promise.n
    share, least = ENOUGH[n]
    points = promise.crossing_points
    if len(points) < 2 * least:
        return []
    side = SIDE[n] << max(math.ceil(math.log2(tolerance)), 0)
    found = [_window(promise, corner, side) for corner in _corners(points, promise.field.signs.shape, side,
                                                                   min(max(share * len(points), least), MOST * least))]
    return found if 2 * sum(len(each.crossing_points) for each in found) < len(points) else []


def _corners(points: NDArray[np.float64], shape: tuple[int, ...], side: int, wanted: float) -> NDArray[np.int64]:
    """Lowest corners of blocks that have so many of the points or more, those with the most of them first."""
    blocks = np.maximum((np.array(shape) - 1 + side // 2) // side, 1)
    block = np.minimum(points.astype(np.int64) // side, blocks - 1)
    some, counts = np.unique(np.ravel_multi_index(tuple(block.T), tuple(blocks)), return_counts=True)
    order = np.argsort(counts, kind="stable")
    mass = np.cumsum(counts[order])
    chosen = order[:0]
    for number in range(1, len(some) + 1):
        # places where the curve is rough and where it is smooth both count
        at = np.unique(np.searchsorted(mass, (np.arange(number) + 0.5) / number * mass[-1]))
        chosen = order[at]
        if counts[chosen].sum() >= wanted:
            break
    # those with most of the curve first
    chosen = some[chosen[::-1]]
    return np.stack(np.unravel_index(chosen, tuple(blocks)), axis=1) * side


def _window(promise: Promise, corner: NDArray[np.int64], side: int) -> Promise:
    """The promise of a block."""
    field = promise.field
    # the last blocks of each axis are as wide as it takes
    ends = [size if size - first - 1 < side + (side + 1) // 2 else first + side + 1
            for first, size in zip(corner.tolist(), field.signs.shape, strict=True)]
    here = tuple(slice(first, end) for first, end in zip(corner.tolist(), ends, strict=True))
    gone = None if field.gone is None or not field.gone[here].any() else np.ascontiguousarray(field.gone[here])
    part = Samples(np.ascontiguousarray(field.values[here]), field.isovalue, np.ascontiguousarray(field.signs[here]),
                   field.scale, gone)
    return Promise(part, free=promise.free, tried=promise.tried, holes=_holes(part))


def _holes(part: Samples) -> Holes | None:
    """The missing samples of a block, in the form that decoders have."""
    if part.gone is None:
        return None
    missing = mask_field(part.gone)
    header = Header(part.values.shape, part.isovalue, part.scale, Profile.MAIN)
    return encoded_mask(header, missing, truth_of(missing))[1]
