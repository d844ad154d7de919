"""What a decoded state hands to the drawing: the mixed leaf simplices and all that is known of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Leaves:
    """Mixed leaf simplices of one isovalue (spec clause 9).

    Attributes
    ----------
    shape : tuple of int
        Samples along each axis of the sampled box.
    isovalue : float
    position : (V, n) int64
        Sample indices of the vertices, clamped onto the box.
    above : (V,) bool
        The sign: value > isovalue.
    value : (V,) float64, or None
        Estimate of the field at the vertices, NaN where nothing is known; None without geometry by values.
    simplices : (M, n + 1) int64
        Vertices x0 .. xn of each leaf, in Maubach's order; not all of one sign.
    full : bool
        All leaves are of the full grid: x0 and xn are opposite corners of a unit cell, and the
        drawing has points on grid edges only.
    edge_vertex, edge_axis : (E,) int64
        Grid edges that carry an offset: the end with the smaller index, and the axis. Only when ``full``.
    edge_offset : (E,) float64
        Distance of the crossing from that end, in cells, within (0, 1).
    """

    shape: tuple[int, ...]
    isovalue: float
    position: NDArray[np.int64]
    above: NDArray[np.bool_]
    value: NDArray[np.float64] | None
    simplices: NDArray[np.int64]
    full: bool
    edge_vertex: NDArray[np.int64]
    edge_axis: NDArray[np.int64]
    edge_offset: NDArray[np.float64]
