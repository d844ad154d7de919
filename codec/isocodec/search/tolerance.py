"""Precision of stored crossings for a tolerance, and their slack (docs/encoders.md, 3)."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import count, product

import numpy as np
from numpy.typing import NDArray

from isospec.container import MAX_PARTS, MAX_RADIX

from ..errors import OptionError
from ..field.samples import OFFSET_BITS
from ..grid.layers.plan import Entry

Edges = Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.bool_]]
"""Choice of edges, by the positions of their ends (E, n) each."""
EXACT = 0.0
"""A step that asks for all values, to the last bit."""
NO_OFFSETS = 1, 40
"""Parts and unit of crossings that are not stored: middles of edges, all of them shorter than the unit."""
MOST_SLACK = 2.0
"""Crossings are stored at most this many tolerances off along their edges."""
MOST_DOUBLED = 4
"""Exponent of the greatest power of two that is a radix."""
ROUNDING = 1e-6
"""Share of a tolerance that is below its rounding."""
HALF = 0.5
"""Tolerance in cells that signs alone keep to: points are in the middles of edges."""


class Slack:
    """Slack of crossings: how far from where the field crosses edges they may be stored.

    If all on the full grid are stored within a tolerance, the curve keeps to it. Where the curve meets an edge at a
    slant it takes a longer way along the edge to get as far from the curve; that is tried, and taken back where the
    tolerance is not kept. So is all slack on longer edges, between which the curve is some way off already.

    Parameters
    ----------
    tolerance : float
    phi : (s0, .., sn-1) float32, optional
        The field less its isovalue, if slants are to be made use of.
    fixed : callable, optional
        Which edges have none.
    longest : int
        Length of the longest edges, in samples.
    """

    def __init__(
        self, tolerance: float, phi: NDArray[np.float32] | None = None, fixed: Edges | None = None, longest: int = 1
    ) -> None:
        self._tolerance, self._phi, self._fixed, self._longest = tolerance, phi, fixed, longest
        self._halved = np.zeros(() if phi is None else phi.shape, np.uint8)

    def tighten(self, places: NDArray[np.float64]) -> None:
        """Take half of it back around some places."""
        shape = self._halved.shape
        reach = math.ceil(self._tolerance) + self._longest
        around = np.array(list(product(range(-reach, reach + 1), repeat=len(shape))))
        here = np.unique(np.floor(places).astype(np.int64), axis=0)
        near = tuple(np.clip(here[:, None] + around, 0, np.array(shape) - 1).reshape(-1, len(shape)).T)
        self._halved[near] = self._halved[near] + 1

    def __call__(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.int64]:
        """Crossings, as ``Samples.crossings``."""
        slack = np.full(len(low), self._tolerance)
        if self._phi is not None:
            slope = slopes_at(self._phi, low) + slopes_at(self._phi, high)
            halved = self._halved[tuple((low + high >> 1).T)]
            slanted = self._tolerance * at_a_slant(slope, high - low, MOST_SLACK) / 2.0**halved
            slack = slanted if self._longest > 1 else np.maximum(slanted, slack)
        if self._fixed is not None:
            slack = np.where(self._fixed(low, high), 0.0, slack)
        share = np.minimum(slack / np.abs(high - low).max(axis=1, initial=1), 1.0)
        # places are rounded to the same unit
        return np.maximum(np.floor(share * (1 << OFFSET_BITS)).astype(np.int64) - 2, 0)


def slopes_at(phi: NDArray[np.float32], position: NDArray[np.int64]) -> NDArray[np.float64]:
    """Central differences of a field at samples (E, n), (E, n)."""
    out = np.empty(position.shape)
    for axis, size in enumerate(phi.shape):
        up, down = position.copy(), position.copy()
        up[:, axis] = np.minimum(up[:, axis] + 1, size - 1)
        down[:, axis] = np.maximum(down[:, axis] - 1, 0)
        out[:, axis] = phi[tuple(up.T)].astype(np.float64) - phi[tuple(down.T)]
    return out


def at_a_slant(slope: NDArray[np.float64], way: NDArray[np.int64], most: float) -> NDArray[np.float64]:
    """Ratios of how far crossings may move along their edges and across the curve, at most a given one, (E,).

    Parameters
    ----------
    slope : (E, n) float64
        Of the field at the crossings.
    way : (E, n) int64
        From one end of the edges to the other.
    most : float
    """
    steep = np.sqrt((slope**2).sum(axis=1))
    along = np.abs((slope * way).sum(axis=1)) / np.sqrt((way**2).sum(axis=1))
    least = np.maximum(steep / most, np.finfo(np.float64).tiny)
    times = np.clip(steep / np.maximum(along, least), 1.0, most)
    return np.where(np.isfinite(times), times, 1.0)


def grid_offsets(tolerance: float | None, free: bool, fixed: Edges | None = None) -> list[Entry]:
    """Layers of offsets on the full grid that keep to the tolerance; if ``free``, the last one has slack.

    ``fixed`` are edges without any, as of `Slack`.
    """
    plan: list[Entry] = [("offsets", radix) for radix in radices(tolerance)]
    if free and tolerance is not None and plan:
        plan[-1] = (*plan[-1], 0, None, Slack(tolerance, fixed=fixed))
    return plan


def radices(tolerance: float | None) -> list[int]:
    """Parts that layers of offsets divide into, so that crossings end up within ``tolerance`` of where they are.

    The middle of the right one of m parts is at most 1 / 2m off.
    """
    if tolerance is None:
        return []
    if not (math.isfinite(tolerance) and tolerance > 0):
        raise OptionError(f"the tolerance {tolerance} is not a positive number", code="tolerance")
    if tolerance < 0.5 / (MAX_PARTS * 0.9):
        raise OptionError(
            f"a tolerance of {tolerance} cells is too fine for offsets", code="tolerance", remedy="use exact or step"
        )
    if tolerance >= HALF:
        return []
    # offsets are rounded to 30 bits before they are coded
    return radices_of(math.ceil(HALF / (tolerance * (1 + ROUNDING) - 2.0**-OFFSET_BITS)))


def radices_of(parts: int) -> list[int]:
    """Radices of layers that make so many parts, or the next number that can be made.

    Odd ones first, which keep the middle of a part in the middle of one: 5 and 2 take 1 to 2 % fewer bytes than 10, and
    a file that ends between them is of use. What is left is a power of two, in as few layers as can be.
    """
    for total in count(parts):
        rest, odd = total, []
        for radix in range(3, MAX_RADIX + 1, 2):
            while rest % radix == 0:
                rest //= radix
                odd.append(radix)
        if rest & (rest - 1) == 0:
            times, twos = divmod(rest.bit_length() - 1, MOST_DOUBLED)
            return [*odd, *[1 << MOST_DOUBLED] * times, *([1 << twos] if twos else [])]
    raise AssertionError
