"""Rounds of smoothing that bring a curve nearest to the original, if any do (spec clause 9.10)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.smoothing import evened, normals

_TRIED = (2, 4, 8, 16)
"""Rounds; beyond the last one curves hardly change."""
_WORTH = 0.97
"""Share of the error without smoothing that it must come below."""


def rounds_for(original: Contour, parts: int) -> int:
    """Rounds after which a curve, whose points are known to one of ``parts`` parts of edges, is nearest in the mean.

    Errors are measured across the curve. 0 if the original is so rough that the middles of parts are nearer.

    Parameters
    ----------
    original : Contour
        Drawing of the full grid, with points on its edges.
    parts : int
        Parts of an edge, of equal length.
    """
    errors = _errors(original, parts)
    best = int(errors.argmin())
    return _TRIED[best - 1] if best and errors[best] <= _WORTH * errors[0] else 0


def _errors(original: Contour, parts: int) -> NDArray[np.float64]:
    """Sums of distances of a curve's points from the original one, across it, without and with smoothing."""
    points, cells = original.points, original.cells
    inside = points - np.floor(points)
    # points in the middles of cells are not on an edge, those at samples on no single one
    on_edge = (inside > 0).sum(axis=1) == 1
    order = np.argsort(~on_edge, kind="stable")
    count = int(on_edge.sum())
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    points, inside, cells = points[order], inside[order][:count], place[cells]
    along = (inside > 0).astype(np.float64)
    where = inside.sum(axis=1)
    steep = np.abs((normals(points, cells)[:count] * along).sum(axis=1))
    number = np.floor(where * parts)
    middle = (number + 0.5) / parts
    part = np.stack([number, number + 1], axis=1) / parts
    low = np.floor(points[:count])
    coarse = points.copy()
    coarse[:count] = low + middle[:, None] * along
    out = [float(steep @ np.abs(middle - where))]
    for rounds in _TRIED:
        moved = evened(coarse, cells, low, along, middle, part, rounds)[:count]
        out.append(float(steep @ np.abs(moved - points[:count]).sum(axis=1)))
    return np.array(out)
