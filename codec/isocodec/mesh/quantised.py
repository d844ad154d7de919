"""Positions of a mesh that goes into a file, rounded, and where its curve lies then: for encoders (clause 10.10)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .complex import Complex, assembled, determinants, has_volume, neighbours

EXTENT = 1 << 24
"""Positions along an axis at most."""
MOVED = 0.25
"""Crossings move by that share of an edge at most."""
SLACK = 1e-9
"""Points of cells may lie so far beyond their faces."""
MULTIPLES = 16
"""Units are from so many to twice as many times a power of two."""


class Quantised(NamedTuple):
    """Positions from 0 on, (V, d), what they count in, and where they begin."""

    position: NDArray[np.int64]
    multiple: int
    exponent: int
    origin: tuple[int, ...]
    extent: tuple[int, ...]

    @property
    def unit(self) -> float:
        """Unit of positions."""
        return math.ldexp(self.multiple, self.exponent)


def quantised(
    points: NDArray[np.float64], cells: NDArray[np.int64], error: float
) -> tuple[Quantised, Complex]:
    """Positions, and their complex: vertices lie within ``error`` of points, nearer where cells would fold otherwise.

    Parameters
    ----------
    points : (V, d) float64
        All of which cells have.
    cells : (T, n + 1) int64
        As of a complex.
    error : float

    Raises
    ------
    InputError
        If that takes more positions than a file may have.
    """
    found = rounded(points, error)
    while _folds(points, found.position, cells):
        error /= 2
        found = rounded(points, error)
    return found, assembled(found.position, cells, found.unit, neighbours(cells))


def rounded(points: NDArray[np.float64], error: float) -> Quantised:
    """Positions within ``error`` of points (V, d).

    Raises
    ------
    InputError
        If that takes more positions than a file may have.
    """
    wanted = 2 * error / math.sqrt(points.shape[1])
    exponent = math.frexp(wanted)[1] - MULTIPLES.bit_length()
    multiple = int(math.ldexp(wanted, -exponent))
    scaled = np.rint(points / math.ldexp(multiple, exponent))
    origin = scaled.min(axis=0)
    extent = scaled.max(axis=0) - origin + 1
    if extent.max() > EXTENT or np.abs(origin).max() >= 2.0**40:
        raise InputError(
            "the mesh is too large for so small an error of its points", code="mesh-error",
            remedy="allow a larger error, or make the mesh known to both sides",
        )
    position = (scaled - origin).astype(np.int64)
    return Quantised(position, multiple, exponent, tuple(map(int, origin.tolist())), tuple(map(int, extent.tolist())))


def rounded_apart(points: NDArray[np.float64], error: float) -> Quantised:
    """Round distinct points, more finely where two would come together or all would lie on a line."""
    found = rounded(points, error)
    while len(np.unique(found.position, axis=0)) < len(points) or np.linalg.matrix_rank(
        found.position - found.position[:1]
    ) < min(2, points.shape[1]):
        error /= 2
        found = rounded(points, error)
    return found


def _folds(points: NDArray[np.float64], position: NDArray[np.int64], cells: NDArray[np.int64]) -> bool:
    """Whether rounding takes the size of a cell, or turns it over."""
    if points.shape[1] == cells.shape[1]:
        return not bool(has_volume(position, cells).all())
    rounded = np.asarray(determinants(position, cells)).astype(np.float64)
    side = points[cells[:, 1:]] - points[cells[:, :1]]
    return bool((rounded * np.linalg.det(side) <= 0).any())


def refitted(
    domain: Complex, points: NDArray[np.float64], rounded: NDArray[np.float64], edges: NDArray[np.int64],
    above: NDArray[np.float64], where: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Where edges between rounded points meet the contour of the mesh as it was.

    Parameters
    ----------
    domain : Complex
    points, rounded : (V, d) float64
        Where the vertices were, and are now.
    edges : (E, 2) int64
        Crossed edges.
    above : (V,) float64
        How far values lie above the isovalue.
    where : (E,) float64
        Where the edges were crossed, from 0 to 1.

    Returns
    -------
    (E,) float64
        From 0 to 1; ``where`` if an edge does not meet the contour any more.
    """
    mesh = domain.mesh
    ends = edges.ravel()
    count = mesh.first[ends + 1] - mesh.first[ends]
    owner = np.repeat(np.repeat(np.arange(len(edges)), 2), count)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    cell = mesh.star[np.repeat(mesh.first[ends], count) + place]
    around, number = np.unique(cell, return_inverse=True)
    corners = mesh.cell[around]
    inverse = np.linalg.pinv(points[corners[:, 1:]] - points[corners[:, :1]])
    slope = np.einsum("tij,tj->ti", inverse, above[corners[:, 1:]] - above[corners[:, :1]])[number]
    first = corners[number, 0]
    begin, end = rounded[edges[owner, 0]], rounded[edges[owner, 1]]
    with np.errstate(all="ignore"):
        at = -(above[first] + (slope * (begin - points[first])).sum(axis=1)) / (slope * (end - begin)).sum(axis=1)
    met = (at >= 0) & (at <= 1) & (np.abs(at - where[owner]) <= MOVED)
    owner, number, first, at = owner[met], number[met], first[met], at[met]
    place_of = begin[met] + at[:, None] * (end - begin)[met]
    share = np.einsum("ti,tij->tj", place_of - points[first], inverse[number])
    inside = (share >= -SLACK).all(axis=1) & (share.sum(axis=1) <= 1 + SLACK)
    owner, at = owner[inside], at[inside]
    order = np.lexsort((at, np.abs(at - where[owner]), owner))
    owner, at = owner[order], at[order]
    nearest = np.flatnonzero(np.diff(owner, prepend=-1))
    out = where.copy()
    out[owner[nearest]] = at[nearest]
    return out
