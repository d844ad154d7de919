"""Coordinates as a file stores them, in whole units, and interpolation between samples (spec clauses 3.7.4, 9.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Coordinate:
    """One coordinate (x, y or z) of the nodes of a grid.

    Attributes
    ----------
    axes : tuple of int
        Axes of the array along which the coordinate varies.
    origin, unit : float
        The coordinate is ``origin + unit * value``.
    period : int
        Period in units; 0 if not periodic.
    """

    axes: tuple[int, ...]
    origin: float
    unit: float
    period: int = 0

    def counts(self, shape: Sequence[int]) -> tuple[int, ...]:
        """Number of nodes along each axis of an array; 1 along axes that the coordinate does not depend on."""
        return tuple(size if axis in self.axes else 1 for axis, size in enumerate(shape))


@dataclass(frozen=True, eq=False)
class Mapped(Sequence[NDArray[np.float64]]):
    """Coordinates of the samples of a file: a sequence x, y (, z) of arrays that broadcast to the shape.

    Attributes
    ----------
    shape : tuple of int
        Samples along each axis, including the plane that closes a periodic axis.
    coordinates : tuple of Coordinate
        x, y (, z).
    values : tuple of (s0 or 1, .., sn-1 or 1) int64
        For each coordinate, its values at the nodes, in units, adjusted as clause 9.9(2) requires.
    periodic : tuple of int
        Axes whose last plane of samples repeats the first one.
    """

    shape: tuple[int, ...]
    coordinates: tuple[Coordinate, ...]
    values: tuple[NDArray[np.int64], ...]
    periodic: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        for one, value in zip(self.coordinates, self.values, strict=True):
            for axis in self.periodic:
                if value.shape[axis] > 1:
                    along = np.moveaxis(value, axis, 0)
                    along[-1] = along[0]
            for axis in one.axes if one.period else ():
                along = np.moveaxis(value, axis, 0)
                along[1:] = along[:1] + np.cumsum(nearest(np.diff(along, axis=0), one.period), axis=0)

    @property
    def periods(self) -> tuple[float, ...]:
        """Period of each coordinate x, y (, z); 0.0 if it is not periodic."""
        return tuple(one.unit * one.period for one in self.coordinates)

    def __len__(self) -> int:
        return len(self.coordinates)

    @overload
    def __getitem__(self, index: int) -> NDArray[np.float64]: ...

    @overload
    def __getitem__(self, index: slice) -> list[NDArray[np.float64]]: ...

    def __getitem__(self, index: int | slice) -> NDArray[np.float64] | list[NDArray[np.float64]]:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        one = self.coordinates[index]
        return one.origin + one.unit * self.values[index].astype(np.float64)

    def place(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute coordinates x, y (, z) of points in index coordinates inside the grid, (P, n) float64 both.

        Within each unit cell they are multilinear.
        """
        last = np.array(self.shape) - 2
        cell = np.clip(np.floor(points).astype(np.int64), 0, last)
        along = points - cell
        out = np.empty(points.shape)
        for c, (one, value) in enumerate(zip(self.coordinates, self.values, strict=True)):
            out[:, c] = one.origin + one.unit * between(one.axes, value, cell, along, one.period)
        return out


def nearest(difference: NDArray[Any], period: float) -> NDArray[Any]:
    """Reduce differences by multiples of the period to those nearest to 0; integers stay integers."""
    half = period // 2 if isinstance(period, int) else period / 2
    return (difference + half) % period - half if period else difference


def between(
    axes: Sequence[int], value: NDArray[Any], cell: NDArray[np.int64], along: NDArray[np.float64], period: float
) -> NDArray[np.float64]:
    """Interpolate values multilinearly within cells.

    ``value`` has one entry along axes other than ``axes``. ``cell`` (P, n) are the lowest corners, and ``along`` (P, n)
    the positions in the cells, from 0 to 1. The period is 0 if values are not periodic.
    """

    def corner(number: int) -> NDArray[Any]:
        index = [np.zeros(len(cell), np.int64)] * value.ndim
        for bit, axis in enumerate(axes):
            index[axis] = cell[:, axis] + (number >> bit & 1)
        return np.asarray(value[tuple(index)])

    first = corner(0)
    parts = [(first + nearest(corner(i) - first, period)).astype(np.float64) for i in range(1 << len(axes))]
    for axis in axes:
        t = along[:, axis]
        # so that nothing is rounded at t = 0 and 1, and neighbouring cells agree
        parts = [a * (1 - t) + b * t for a, b in zip(parts[::2], parts[1::2], strict=True)]
    return parts[0]
