"""Samples out of a file: their signs, and next to the curve their numbers of steps, or crossings."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from .samples import Samples, interval_value

LABELS = "labels"
"""The note of a file whose isovalues are labels: a sample lies above the one that it has."""


@dataclass(frozen=True)
class DecodedSamples(Samples):
    """Samples at one isovalue as a file on the full grid holds them; ``values`` are made up to agree with it.

    Attributes
    ----------
    number : (s0, .., sn-1) int64, or None
        Steps from the isovalue's side, -1 where they are unknown; None of a file without values.
    edges : (E,) int64
        Without numbers: grid edges that have a crossing, ascending: ``n`` times the index of the lower end in the
        flattened array, plus the axis.
    places : (E,) float64
        Where these are crossed, from their lower ends, within (0, 1). Those that are not among them are half-way.
    """

    number: NDArray[np.int64] | None = None
    edges: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    places: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @property
    def integer(self) -> bool:
        """Whether there are numbers, and these are integers."""
        return self.number is not None and self.scale is None

    def numbers(self, positions: NDArray[np.integer], above: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Numbers as in the file; see `Samples.numbers`."""
        assert self.number is not None
        return np.maximum(self.number[tuple(positions.T)], 0)

    def number_bits(self) -> tuple[int, int]:
        """Bits that the known numbers need, above and below the isovalue."""
        assert self.number is not None
        above, below = (int(self.number[self.signs == side].max(initial=0)).bit_length() for side in (True, False))
        return above, below

    def between(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.float64]:
        """Where edges between samples next to one another are crossed.

        A diagonal is taken to be crossed where the ways along the axes between its ends are, in the mean.
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
        """Where edges along an axis are crossed, from their first ends."""
        first = np.minimum(low, high)
        key = np.ravel_multi_index(tuple(first.T), self.signs.shape) * low.shape[1] + axis
        place = places_of(key, self.edges, self.places)
        return np.where(low[:, axis] <= high[:, axis], place, 1.0 - place)


def places_of(
    keys: NDArray[np.int64], edges: NDArray[np.int64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Places of edges (K,) among those that are known, ascending, half-way for the others."""
    if not len(edges):
        return np.full(len(keys), 0.5)
    at = np.minimum(np.searchsorted(edges, keys), len(edges) - 1)
    return np.where(edges[at] == keys, places[at], 0.5)


def values_of_steps(
    signs: NDArray[np.bool_], isovalue: float, scale: float | None, number: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Samples (s0, .., sn-1) with so many steps from the isovalue; with none where the number is unknown."""
    out: NDArray[np.float64] = interval_value(isovalue, scale, np.maximum(number, 0), signs)
    return out


def near_values(
    signs: NDArray[np.bool_], isovalue: float, edges: NDArray[np.int64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Samples as far from the isovalue as the nearest crossing of an edge is from them, in cells; 1 if none is known.

    Only searches use them, to see where it goes up.
    """
    n = signs.ndim
    far = np.ones(signs.size)
    low = edges // n
    strides = np.array([int(np.prod(signs.shape[axis + 1 :])) for axis in range(n)])
    np.minimum.at(far, low, places)
    np.minimum.at(far, low + strides[edges % n], 1.0 - places)
    distance = far.reshape(signs.shape)
    return np.where(signs, isovalue + distance, isovalue - distance)
