"""Rounded positions of a mesh that a file stores, and where its curve then lies: for encoders (clause 10.10)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .complex import Complex, assembled, determinants, has_volume, neighbours

EXTENT = 1 << 24
"""Most positions along an axis."""
MOST_ORIGIN = 2.0**40
"""Upper bound of the origin of positions."""
SLACK = 1e-9
"""Tolerance, in barycentric coordinates, within which a point counts as inside a cell."""
MULTIPLES = 16
"""Units are from ``MULTIPLES`` to twice as many times a power of two."""


class Quantised(NamedTuple):
    """Positions from 0 on, (V, d), with unit, origin and extent."""

    position: NDArray[np.int64]
    multiple: int
    exponent: int
    origin: tuple[int, ...]
    extent: tuple[int, ...]

    @property
    def unit(self) -> float:
        """Unit of positions."""
        return math.ldexp(self.multiple, self.exponent)

    def widened(self, steps: int) -> Quantised:
        """Widen the box on each side by ``steps``, or fewer if positions allow no more."""
        room = max(min(steps, (EXTENT - max(self.extent)) // 2), 0)
        return self._replace(
            position=self.position + room, origin=tuple(each - room for each in self.origin),
            extent=tuple(each + 2 * room for each in self.extent),
        )


def quantised(
    points: NDArray[np.float64], cells: NDArray[np.int64], error: float
) -> tuple[Quantised, Complex]:
    """Round points (V, d), all vertices of cells (T, n + 1), to within ``error``, or less where cells would fold.

    Also returns their complex. Raises `InputError` if that takes more positions than a file may have.
    """
    found = rounded(points, error)
    while _folds(points, found.position, cells):
        error /= 2
        try:
            found = rounded(points, error)
        except InputError:
            exact = _shared(points, None)
            if exact is None or _folds(points, exact.position, cells):
                raise
            found = exact
    return found, assembled(found.position, cells, found.unit, neighbours(cells))


def rounded(points: NDArray[np.float64], error: float) -> Quantised:
    """Round points (V, d) to within ``error``; raises `InputError` if that takes more positions than a file may have.
    """
    wanted = 2 * error / math.sqrt(points.shape[1])
    exponent = math.frexp(wanted)[1] - MULTIPLES.bit_length()
    multiple = int(math.ldexp(wanted, -exponent))
    return _counted(np.rint(points / math.ldexp(multiple, exponent)), multiple, exponent)


def _counted(scaled: NDArray[np.float64], multiple: int, exponent: int) -> Quantised:
    """Positions that are whole numbers, counted from the least one."""
    origin = scaled.min(axis=0)
    extent = scaled.max(axis=0) - origin + 1
    if extent.max() > EXTENT or np.abs(origin).max() >= MOST_ORIGIN:
        raise InputError(
            "the mesh is too large for so small an error of its points", code="mesh-error",
            remedy="allow a larger error, or a larger distance of the contour; a mesh with cells can be known to both "
                   "sides",
        )
    position = (scaled - origin).astype(np.int64)
    return Quantised(position, multiple, exponent, tuple(map(int, origin.tolist())), tuple(map(int, extent.tolist())))


def rounded_points(
    points: NDArray[np.float64], error: float, kept: NDArray[np.int64], exact: bool = True
) -> tuple[Quantised, float]:
    """Round those points of the plane that are kept, (W,), as `rounded` does; they may coincide then.

    Origin and extent are those of all points. If ``exact``, and all points are multiples of a unit that is not much
    finer, no point moves. Also returns how far points may have been moved.
    """
    found = _shared(points, error) if exact else None
    if found is not None:
        return found._replace(position=found.position[kept]), 0.0
    corners = np.stack([points.min(axis=0), points.max(axis=0)])
    found = rounded(np.concatenate([points[kept], corners]), error)
    return found._replace(position=found.position[:-2]), error


def _shared(points: NDArray[np.float64], error: float | None) -> Quantised | None:
    """Positions in the largest power of two that holds all coordinates exactly, if that is not too fine.

    It may be half the unit that ``error`` asks for, since exact positions are worth one more bit. Without an error, it
    may be as fine as positions can be.
    """
    if error is None:
        exponent = math.frexp(float(np.ptp(points, axis=0).max()))[1] - EXTENT.bit_length() + 1
    else:
        exponent = math.frexp(2 * error / math.sqrt(points.shape[1]))[1] - 1
    with np.errstate(over="ignore"):
        scaled = np.ldexp(points, -exponent)
    if not (np.abs(scaled).max() < MOST_ORIGIN and np.array_equal(scaled, np.rint(scaled))):
        return None
    whole = scaled.astype(np.int64)
    bits = int(np.bitwise_or.reduce(whole, axis=None))
    shift = (bits & -bits).bit_length() - 1
    if error is None and np.ptp(whole >> shift, axis=0).max() >= EXTENT:
        return None
    return _counted(np.ldexp(scaled, -shift), 1, exponent + shift)


def _folds(points: NDArray[np.float64], position: NDArray[np.int64], cells: NDArray[np.int64]) -> bool:
    """Whether rounding makes a cell degenerate, or turns it over."""
    if points.shape[1] == cells.shape[1]:
        return not bool(has_volume(position, cells).all())
    rounded = np.asarray(determinants(position, cells)).astype(np.float64)
    side = points[cells[:, 1:]] - points[cells[:, :1]]
    return bool((rounded * np.linalg.det(side) <= 0).any())


def refitted(
    domain: Complex, points: NDArray[np.float64], rounded: NDArray[np.float64], edges: NDArray[np.int64],
    above: NDArray[np.float64], where: NDArray[np.float64], off: float,
) -> NDArray[np.float64]:
    """Intersect edges (E, 2) between rounded points with the contour of the original mesh.

    ``points`` and ``rounded`` (V, d) are the vertices before and after rounding, ``above`` (V,) their values less the
    isovalue, ``where`` (E,) the crossings before, from 0 to 1. A crossing farther than ``off`` from the original place
    stays at its share of the edge, since the contour between both would be lost where it turns; so does that of an edge
    that no longer meets the contour.
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
    met = (at >= 0) & (at <= 1)
    owner, number, first, at = owner[met], number[met], first[met], at[met]
    place_of = begin[met] + at[:, None] * (end - begin)[met]
    crossed = points[edges[:, 0]] + where[:, None] * (points[edges[:, 1]] - points[edges[:, 0]])
    met = np.sqrt(((place_of - crossed[owner]) ** 2).sum(axis=1)) <= off
    owner, number, first, at, place_of = owner[met], number[met], first[met], at[met], place_of[met]
    share = np.einsum("ti,tij->tj", place_of - points[first], inverse[number])
    inside = (share >= -SLACK).all(axis=1) & (share.sum(axis=1) <= 1 + SLACK)
    owner, at = owner[inside], at[inside]
    order = np.lexsort((at, np.abs(at - where[owner]), owner))
    owner, at = owner[order], at[order]
    nearest = np.flatnonzero(np.diff(owner, prepend=-1))
    out = where.copy()
    out[owner[nearest]] = at[nearest]
    return out
