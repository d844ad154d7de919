"""Slack of crossings on the edges of coarse meshes (spec annex G.3(5))."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..field.samples import OFFSET_BITS
from .tolerance import Edges, at_a_slant, slopes_at

SLANT = 2.5
"""Crossings are stored at most this many tolerances off along their edges, where the curve meets these at a slant."""
SHARES = 1.0, 0.4, 0.0
"""Shares of the slack, from one to the next of which it is taken back."""


def slanted(phi: NDArray[np.float32], low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.float64]:
    """Ratios of how far crossings may move along their edges and across the curve, by the slopes half-way, (E,)."""
    return at_a_slant(slopes_at(phi, (low + high) >> 1), high - low, SLANT)


def on_edges(slack: NDArray[np.float64], low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.int64]:
    """Lengths in cells as fractions of the edges, in units of places on them, (E,)."""
    share = np.minimum(slack / np.abs(high - low).max(axis=1).astype(np.float64), 1.0)
    return np.floor(share * (1 << OFFSET_BITS)).astype(np.int64)


class MeshSlack:
    """Slack of crossings: how far from where the field crosses the edges they may be stored.

    It is taken back block by block, around the places where the tolerance is not kept.

    Parameters
    ----------
    phi : (s0, .., sn-1) float32
        The field less its isovalue.
    tolerance : float
    fixed : callable, optional
        Which edges have none.
    """

    def __init__(self, phi: NDArray[np.float32], tolerance: float, fixed: Edges | None = None) -> None:
        self._phi, self._tolerance, self._fixed = phi, tolerance, fixed
        self._edge = max(round(2 * tolerance), 1)
        self._step = np.zeros([(size - 1) // self._edge + 1 for size in phi.shape], np.uint8)

    def tighten(self, places: NDArray[np.float64]) -> bool:
        """Take it back by a step around some places; whether there was any left."""
        last = np.array(self._step.shape) - 1
        here = np.unique(np.clip((places / self._edge).astype(np.int64), 0, last), axis=0)
        if not len(here) or (self._step[tuple(here.T)] == len(SHARES) - 1).all():
            return False
        reach = math.ceil((2 * self._tolerance + 1) / self._edge)
        around = np.array(list(product(range(-reach, reach + 1), repeat=len(last))))
        near = np.clip(here[:, None] + around, 0, last).reshape(-1, len(last))
        near = np.unravel_index(np.unique(np.ravel_multi_index(tuple(near.T), self._step.shape)), self._step.shape)
        self._step[near] = np.minimum(self._step[near] + 1, len(SHARES) - 1)
        return True

    def __call__(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.int64]:
        """Crossings, as ``Samples.crossings``."""
        block = ((low + high) >> 1) // self._edge
        share = np.array(SHARES)[self._step[tuple(block.T)]]
        slack = self._tolerance * share * slanted(self._phi, low, high)
        if self._fixed is not None:
            slack = np.where(self._fixed(low, high), 0.0, slack)
        return on_edges(slack, low, high)
