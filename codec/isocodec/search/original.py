"""The curve or surface that an encoder starts from, drawn as a decoder of the full grid would (spec clause 9)."""

from __future__ import annotations

import math
from functools import partial
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.drawing import draw
from ..drawing.leaves import Leaves
from ..field.decoded_samples import DecodedSamples
from ..field.samples import Samples
from ..grid.tube.holes import whole_cells_of

_LARGE = np.finfo(np.float64).max / 2
"""A value beside which others do not count, and whose distance from its opposite does not overflow."""


def original(field: Samples, *, measured: bool = True) -> Contour:
    """The contour of a field: points on the grid's edges by linear interpolation; ``measured``: see `draw`."""
    shape, n = field.signs.shape, field.signs.ndim
    cells = mixed_cells(field.signs)
    # x0 has even indices only, xn odd ones; a simplex is a path between them, one axis at a time
    even = cells + (cells & 1)
    step = 1 - 2 * (cells & 1)
    first = np.ravel_multi_index(tuple(even.T), shape)[:, None]
    moves = step * [math.prod(shape[axis + 1 :]) for axis in range(n)]
    paths = [np.hstack([first, first + np.cumsum(moves[:, order], axis=1)]) for order in permutations(range(n))]
    flat = np.stack(paths, axis=1).reshape(-1, n + 1)
    signs = field.signs.reshape(-1)[flat]
    flat = flat[signs.any(axis=1) & ~signs.all(axis=1)]
    used, index = np.unique(flat, return_inverse=True)
    vertex = np.zeros((len(used), 4), np.int32)
    vertex[:, :n] = np.stack(np.unravel_index(used, shape), axis=-1).reshape(-1, n)
    vertex[:, 3] = field.signs.reshape(-1)[used]
    decoded = field if isinstance(field, DecodedSamples) else None
    edges, places = (np.zeros((0, 2), np.int64), np.zeros(0)) if decoded is None else _known_edges(decoded, used)
    numbered = decoded is None or decoded.number is not None
    values = field.values.reshape(-1)[used].astype(np.float64) if numbered else None
    if values is not None:
        # beside an infinite sample the crossing is at the finite one, as beside a large one (`Samples.between`)
        values = np.where(np.isinf(values), np.copysign(_LARGE, values), values)
    # parts are for smoothing, which this drawing is not for
    leaves = Leaves(
        shape=shape, isovalue=field.isovalue, vertex=vertex, value=values,
        simplices=index.reshape(-1, n + 1), levels=np.zeros(len(flat), np.int64), full=True,
        edges=edges, edge_offset=places, edge_parts=np.ones(len(places), np.int64),
        whole=None if field.gone is None else partial(whole_cells_of, field.gone),
    )
    return draw(leaves, measured=measured)


def _known_edges(field: DecodedSamples, used: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Edges with a place that is coded, as numbers of their vertices among those used, and the places."""
    shape = field.signs.shape
    strides = np.array([math.prod(shape[axis + 1 :]) for axis in range(len(shape))])
    low = field.edges // len(shape)
    ends = np.stack([low, low + strides[field.edges % len(shape)]], axis=1)
    return np.searchsorted(used, ends), field.places


def mixed_cells(signs: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Unit cells whose corners are not all of one sign, by their lowest corner."""
    some, every = signs, signs
    for axis in range(signs.ndim):
        low = [slice(None)] * signs.ndim
        high = [slice(None)] * signs.ndim
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        some, every = some[tuple(low)] | some[tuple(high)], every[tuple(low)] & every[tuple(high)]
    found = some & ~every
    # on one axis it takes a tenth of the time of argwhere
    return np.stack(np.unravel_index(np.flatnonzero(found), found.shape), axis=1)
