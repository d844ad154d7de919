"""Scattered points prepared for triangulation: distinct, with integer coordinates, in the order of ranks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .rank import BITS, by_rank

_FINE = 24
"""Bits of the longer side to which floating-point coordinates are rounded if no grid holds them exactly."""


@dataclass(frozen=True)
class Points:
    """Distinct points in the order of their ranks.

    Attributes
    ----------
    x, y : (N,) int64
        From 0 to below ``2**28``: position ``origin + unit * (x, y)``.
    value : (N,) float64
        The mean of points that coincide.
    source : (N,) int64
        Number of the given point, the first of several that coincide.
    origin : (2,) float64
    unit : float
        A power of two.
    merged : int
        Given points that were merged into others.
    """

    x: NDArray[np.int64]
    y: NDArray[np.int64]
    value: NDArray[np.float64]
    source: NDArray[np.int64]
    origin: NDArray[np.float64]
    unit: float
    merged: int

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions of the points on the grid, (N, 2) float64."""
        return self.origin + self.unit * np.stack([self.x, self.y], axis=1)


def points_of(points: ArrayLike, values: ArrayLike | None = None) -> Points:
    """Prepare points (M, 2) with values (M,), or, without values, samples (s0, s1) that lie at their indices.

    Positions are exact if a grid of ``2**28`` steps along the longer side holds them; others are rounded to ``2**24``
    steps. Raises `InputError` if there are fewer than three distinct points, or numbers that are not finite.
    """
    if values is None:
        field = np.asarray(points)
        if field.ndim != 2:
            raise InputError(f"the field has {field.ndim} axes {field.shape}, not 2", code="axes")
        given = np.moveaxis(np.indices(field.shape), 0, -1).reshape(-1, 2)
        numbers = field.ravel()
    else:
        given, numbers = np.asarray(points), np.asarray(values)
        if given.ndim != 2 or given.shape[1] != 2:
            raise InputError(f"the points have shape {given.shape}, not (N, 2)", code="shape")
        if numbers.shape != (len(given),):
            raise InputError(f"the values have shape {numbers.shape}, not ({len(given)},)", code="shape")
    for what, array in (("points", given), ("values", numbers)):
        if array.dtype.kind not in "biuf":
            raise InputError(f"the {what} are of type {array.dtype}", code="dtype", remedy="convert them to numbers")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise InputError(
                f"some {what} are not finite", code="missing",
                remedy="leave them out: points[np.isfinite(values)], values[np.isfinite(values)]",
            )
    if len(given) == 0:
        raise InputError("no points are given", code="points", remedy="give three or more")
    at, origin, unit = _whole(given)
    return _distinct(at[:, 0], at[:, 1], numbers.astype(np.float64), origin, unit)


def _whole(given: NDArray[np.generic]) -> tuple[NDArray[np.int64], NDArray[np.float64], float]:
    """Convert to integer coordinates; also returns their origin and unit."""
    low, high = given.min(axis=0), given.max(axis=0)
    span = max(float(b) - float(a) for a, b in zip(low.tolist(), high.tolist(), strict=True))
    if not math.isfinite(span):
        raise InputError("the points lie too far apart", code="range", remedy="scale them")
    if given.dtype.kind != "f":
        if span >= 1 << BITS:
            raise InputError(f"the points span {span:.0f} units, more than 2**{BITS}", code="range",
                             remedy="divide them, or give floats, which are rounded")
        return (given - low).astype(np.int64), low.astype(np.float64), 1.0
    exponent = math.frexp(span)[1]
    for bits in (BITS, _FINE):
        # the finest grid that holds everything exactly, else a coarser one
        unit = math.ldexp(1.0, exponent - bits)
        origin = np.floor(low.astype(np.float64) / unit) * unit
        steps = (given.astype(np.float64) - origin) / unit
        at = np.rint(steps).astype(np.int64)
        if at.max() < 1 << BITS and (bits == _FINE or np.array_equal(at, steps)):
            break
    # a grid that is coarser, if that holds everything, too
    shared = int(np.bitwise_or.reduce(at, axis=None)) | int(origin[0] / unit) | int(origin[1] / unit)
    shift = (shared & -shared).bit_length() - 1 if shared else 0
    return at >> shift, origin, unit * (1 << shift)


def _distinct(
    x: NDArray[np.int64], y: NDArray[np.int64], value: NDArray[np.float64], origin: NDArray[np.float64], unit: float
) -> Points:
    """Merge points that coincide, with the mean of their values, and order all by rank."""
    order = by_rank(x, y)
    first = np.ones(len(x), np.bool_)
    first[1:] = (x[order[1:]] != x[order[:-1]]) | (y[order[1:]] != y[order[:-1]])
    starts = np.flatnonzero(first)
    if len(starts) < len(x):
        # summed in the order of the values, whatever order they came in
        group = np.empty(len(x), np.int64)
        group[order] = np.cumsum(first) - 1
        sums = np.add.reduceat(value[np.lexsort((value, group))], starts)
        mean = sums / np.diff(np.append(starts, len(x)))
        source = np.minimum.reduceat(order, starts)
    else:
        mean, source = value[order], order
    if len(starts) < 3:
        raise InputError(f"{len(starts)} distinct points are fewer than 3", code="points")
    order = order[starts]
    return Points(x[order], y[order], mean, source, origin, unit, len(x) - len(starts))
