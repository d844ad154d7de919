"""Input of the drawing: the mixed leaf simplices of a decoded state, and their geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..grid.tube.ranks import Ranks

WholeCells = Callable[[NDArray[np.int64]], NDArray[np.bool_]]


@dataclass(frozen=True)
class Leaves:
    """Mixed leaf simplices of one isovalue (spec clause 9).

    Attributes
    ----------
    shape : tuple of int
        Samples along each axis of the sampled box.
    isovalue : float
    vertex : (V, 4) int32
        Sample indices of the vertices, clamped to the box, 0 along axes beyond n; and the sign, 1 if
        value > isovalue.
    value : (V,) float64, or None
        Estimate of the field at the vertices, NaN where nothing is known; None without geometry by values.
    simplices : (M, n + 1) int64
        Vertices x0 .. xn of each leaf, in Maubach's order; not all of one sign.
    levels : (M,) int64
        Level of each leaf.
    full : bool
        Whether all leaves are of the full grid: x0 and xn are opposite corners of a unit cell, and the drawing has
        points on grid edges only.
    edges : (E, 2) int64
        Edges that carry an offset: the vertices at their ends, the lexicographically smaller position first.
    edge_offset : (E,) float64
        Place of the crossing as a fraction of the way from the first end, within (0, 1).
    edge_parts : (E,) int64
        Number of parts of the edge; the crossing is the middle of one part.
    whole : callable, optional
        Finds which unit cells, by their lowest corners (C, n), lie in the box and have no missing corner, (C,) bool;
        all cells if not given.
    known : Ranks, optional
        On the full grid, once it is complete, all known vertices by position: the drawing follows from them, and
        ``simplices`` and ``levels`` may be left empty.
    """

    shape: tuple[int, ...]
    isovalue: float
    vertex: NDArray[np.int32]
    value: NDArray[np.float64] | None
    simplices: NDArray[np.int64]
    levels: NDArray[np.int64]
    full: bool
    edges: NDArray[np.int64]
    edge_offset: NDArray[np.float64]
    edge_parts: NDArray[np.int64]
    whole: WholeCells | None = None
    known: Ranks | None = None

    @property
    def position(self) -> NDArray[np.int32]:
        """Sample indices of the vertices, (V, n) int32."""
        return self.vertex[:, : len(self.shape)]

    @property
    def above(self) -> NDArray[np.bool_]:
        """Whether the value at each vertex is above the isovalue, (V,) bool."""
        return self.vertex[:, 3] != 0
