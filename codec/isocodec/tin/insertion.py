"""Fewer points within an error: thinned beyond it, put back where the surface misses most, thinned again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .removed_points import farthest
from .swapping import put_back
from .thinning import Thinning, refresh, thin_to

_SHARE = 0.3
"""Points that a round takes out beyond the error, of all vertices."""
_PIECE = 1 << 20


def fewest(state: Thinning, value: NDArray[np.float64], error: float, rounds: int) -> NDArray[np.int64]:
    """Vertices of a surface that misses no point by more than an error: as few as some rounds find.

    Parameters
    ----------
    state : Thinning
        Thinned within the error.
    value : (N,) float64
        What points have as vertices; errors are held against the surface's ``target``.
    error : float
    rounds : int

    Returns
    -------
    (K,) int64
    """
    s = state.surface
    best = np.flatnonzero(s.tri.leaving >= 0)
    for _ in range(rounds):
        lessened(state, int((1 - _SHARE) * state.reg.count), np.inf)
        inserted(state, value, error)
        lessened(state, 0, error)
        found = np.flatnonzero(s.tri.leaving >= 0)
        if len(found) < len(best):
            best = found
    return best


def inserted(state: Thinning, value: NDArray[np.float64], error: float) -> None:
    """Put points back, those that the surface misses most first, until it misses none by more than an error."""
    s = state.surface
    triangles = len(s.first)
    point, size = np.zeros(triangles, np.int32), np.zeros(triangles)
    apart = value - s.target
    inserting = state._replace(surface=s._replace(target=value))
    while True:
        farthest(s, point, size)
        some = np.flatnonzero(size > error)
        if len(some) == 0:
            return
        order = some[np.lexsort((some, -size[some]))].astype(np.int32)
        # an inserted point has its value, not the one that errors are measured against
        s.error[:] -= apart
        put_back(inserting, order, point, len(order), np.zeros(triangles, np.uint8))
        s.error[:] += apart


def lessened(state: Thinning, count: int, error: float) -> None:
    """Take out points down to a count, as long as the surface misses none by more than an error."""
    refresh(state, error)
    state.reg.removed = 0
    while not thin_to(state, count, error, _PIECE):
        pass
