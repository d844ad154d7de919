"""Samples decoded from a file: their signs and, next to the curve, their values in steps, or crossings."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from .samples import Samples, interval_value


@dataclass(frozen=True)
class DecodedSamples(Samples):
    """Samples at one isovalue as decoded from a file on the full grid; ``values`` are chosen to agree with the file.

    Attributes
    ----------
    number : (s0, .., sn-1) int64, or None
        Distance from the isovalue in steps, -1 where it is unknown; None for a file without values.
    edges : (E,) int64
        If there are no numbers: grid edges with a known crossing, in ascending order, each as ``n`` times the index of
        the lower end in the flattened array, plus the axis.
    places : (E,) float64
        Position of the crossing on each of these edges, measured from the lower end, within (0, 1). Other crossings are
        at midpoints.
    """

    number: NDArray[np.int64] | None = None
    edges: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    places: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @property
    def integer(self) -> bool:
        """Whether there are numbers, and the data are integers."""
        return self.number is not None and self.scale is None

    def numbers(self, positions: NDArray[np.integer], above: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Numbers as stored in the file; see `Samples.numbers`."""
        assert self.number is not None
        return np.maximum(self.number[tuple(positions.T)], 0)

    def number_bits(self) -> tuple[int, int]:
        """Number of bits that the known numbers need, above and below the isovalue."""
        assert self.number is not None
        above, below = (int(self.number[self.signs == side].max(initial=0)).bit_length() for side in (True, False))
        return above, below

    def between(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.float64]:
        """Find the crossings of edges between neighbouring samples.

        A diagonal is taken to be crossed at the average position of the crossings on the axis-parallel paths between
        its ends.
        """
        if self.number is not None:
            return super().between(low, high)
        moves = high - low
        orders = list(permutations(range(low.shape[1])))
        total = np.zeros(len(low))
        for order in orders:
            at, steps = low.copy(), np.zeros(len(low))
            crossed = np.zeros(len(low), np.bool_)
            for axis in order:
                to = at.copy()
                to[:, axis] += moves[:, axis]
                here = ~crossed & (self.signs[tuple(at.T)] != self.signs[tuple(to.T)])
                total[here] += steps[here] + self._place(at[here], to[here], axis)
                crossed |= here
                steps += np.abs(moves[:, axis])
                at = to
        return total / (len(orders) * np.abs(moves).sum(axis=1))

    def _place(self, low: NDArray[np.int64], high: NDArray[np.int64], axis: int) -> NDArray[np.float64]:
        """Find the crossings of edges along an axis, measured from their first ends."""
        first = np.minimum(low, high)
        key = np.ravel_multi_index(tuple(first.T), self.signs.shape) * low.shape[1] + axis
        place = np.full(len(key), 0.5)
        if len(self.edges):
            at = np.minimum(np.searchsorted(self.edges, key), len(self.edges) - 1)
            place = np.where(self.edges[at] == key, self.places[at], 0.5)
        return np.where(low[:, axis] <= high[:, axis], place, 1.0 - place)


def values_of_steps(
    signs: NDArray[np.bool_], isovalue: float, scale: float | None, number: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Make samples (s0, .., sn-1) at these numbers of steps from the isovalue, or next to it where unknown."""
    out: NDArray[np.float64] = interval_value(isovalue, scale, np.maximum(number, 0), signs)
    return out


def near_values(
    signs: NDArray[np.bool_], isovalue: float, edges: NDArray[np.int64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Make samples as far from the isovalue as their nearest crossing, in cells; 1 if no crossing is known.

    Used only by searches, to find the direction in which the field increases.
    """
    n = signs.ndim
    far = np.ones(signs.size)
    low = edges // n
    strides = np.array([int(np.prod(signs.shape[axis + 1 :])) for axis in range(n)])
    np.minimum.at(far, low, places)
    np.minimum.at(far, low + strides[edges % n], 1.0 - places)
    distance = far.reshape(signs.shape)
    return np.where(signs, isovalue + distance, isovalue - distance)
