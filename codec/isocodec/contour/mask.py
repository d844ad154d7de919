"""Which samples lie above, out of those that a file on the full grid tells (spec clause 9.7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel

_UNKNOWN = 0


def mask_of(shape: tuple[int, ...], position: NDArray[np.int32], above: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Signs of all samples, out of those of known vertices.

    A sample next to which the contour passes is known, so that any other is as its neighbours are: along each row the
    signs go on until the next one that is known.

    Parameters
    ----------
    shape : tuple of int
    position : (V, n) int32
        Sample indices of the known vertices; (0, .. 0) is one of them.
    above : (V,) bool

    Returns
    -------
    NDArray
        Bool, of this shape: True where value > isovalue.
    """
    signs = np.full(shape, _UNKNOWN, np.uint8)
    signs[tuple(position.T)] = np.where(above, 2, 1)
    _spread(signs)
    # in place: signs may take up most of the memory
    return np.equal(signs, 2, out=signs.view(np.bool_))


def _spread(signs: NDArray[np.uint8]) -> None:
    """Make all signs known: along the last axis, and of rows without any, along the others."""
    rows = signs.reshape(-1, signs.shape[-1])
    _go_on(rows)
    if signs.ndim > 1:
        heads = np.ascontiguousarray(signs[..., 0])
        _spread(heads)
        _enter_heads(rows, heads.reshape(-1))


@kernel
def _go_on(rows):
    """Let the signs of each row go on, both ways from the first that is known."""
    for i in range(len(rows)):
        sign = np.uint8(_UNKNOWN)
        for j in range(rows.shape[1]):
            if rows[i, j] != _UNKNOWN:
                if sign == _UNKNOWN:
                    rows[i, :j] = rows[i, j]
                sign = rows[i, j]
            else:
                rows[i, j] = sign


@kernel
def _enter_heads(rows, heads):
    """Rows without known signs are all as their heads."""
    for i in range(len(rows)):
        if rows[i, 0] == _UNKNOWN:
            rows[i] = heads[i]
