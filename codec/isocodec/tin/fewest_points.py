"""Reduce points within an error: thin beyond it, reinsert points where the error is largest, thin again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .removed_points import farthest
from .swapping import put_back
from .thinning import Thinning, lessened

_SHARE = 0.3
"""Share of the vertices that a round removes beyond the error."""


def fewest(state: Thinning, value: NDArray[np.float64], error: float, rounds: int) -> NDArray[np.int64]:
    """Search some rounds for the fewest vertices, (K,), of a surface within an error of all points.

    ``state`` is thinned within the error. ``value`` (N,) are the values that points have as vertices, while errors are
    measured against the surface's ``target``.
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
    """Reinsert points, those with the largest errors first, until no error exceeds a bound."""
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
        # an inserted point takes its value, not the target that errors are measured against
        s.error[:] -= apart
        put_back(inserting, order, point, len(order), np.zeros(triangles, np.uint8))
        s.error[:] += apart
