"""Points of a surface in layers: nested sets, each the best of its size among the next one's points, sent part by part.

A set's surface should come near to the whole field, not only to the points that are kept: so sets are thinned with all
points in view. Each point has one value in the file, which all sets share: values are fitted for all sets at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tin.coded_tin import SurfaceLayers
from ..tin.criteria import NAT, SQUARED
from ..tin.fitting import Shares, shares_of, sweep
from ..tin.points import Points
from ..tin.swapping import exchange
from ..tin.thinning import Thinning, refresh, thin_to, thinning
from .tin_fit import ChosenPoints

_SETS = {0.53: 2.0, 0.22: 2.5, 0.06: 0.3, 0.87: 1.5, 0.02: 0.3}
"""Shares of all points that smaller sets have, those first that matter most, and the weights of their errors.

A file has them complete in some 57, 28, 9, 88 and 4 % of its bytes.
"""
_WHOLE = 3.0
"""Weight of the error of the whole surface."""
_LEAST = 4
"""Points that a set has at least."""
_ROUNDS = 1
"""Rounds of exchange for each set."""
_SWEEPS = 20
_PIECE = 1 << 20


class _Set(NamedTuple):
    """Vertices of a surface, their shares in the values of all points, its weight, and its mean squared error."""

    some: NDArray[np.int64]
    shares: Shares
    counts: float
    squared: float


def in_layers(given: Points, chosen: ChosenPoints, extent: tuple[int, int], layers: int) -> SurfaceLayers:
    """Put chosen points into layers, the first ones of which give surfaces as good as they can.

    Parameters
    ----------
    given : Points
        All points.
    chosen : ChosenPoints
        Fitted values are fitted anew, to the surfaces of all layers.
    extent : (int, int)
        Positions are below these.
    layers : int
        How many layers there are at most.
    """
    some, numbers = chosen.some, chosen.numbers
    points = np.stack([given.x[some], given.y[some]], axis=1)
    if layers == 1:
        return SurfaceLayers(points, numbers, (len(some),))
    palette = np.array(chosen.palette, np.int64)
    value = given.value.copy()
    value[some] = chosen.offset + chosen.step * (palette[numbers] if len(palette) else numbers)
    state = _surface_over(given, some, value, chosen.fitted)
    low, high = chosen.offset, chosen.offset + chosen.step * (chosen.palette[-1] if chosen.palette else chosen.largest)
    sets = _sets(state, layers, low, high, chosen.fitted)
    if chosen.fitted:
        _fit_all(state, sets, value, given.value, low, high, chosen.step)
        numbers = np.rint((value[some] - low) / chosen.step).astype(np.int64)
    parts = _parts(given, sets, extent, layers)
    place = np.zeros(len(given.x), np.int64)
    place[some] = np.arange(len(some))
    order = place[np.concatenate(parts)]
    return SurfaceLayers(points[order], numbers[order], tuple(np.cumsum([len(part) for part in parts]).tolist()))


def _surface_over(given: Points, some: NDArray[np.int64], value: NDArray[np.float64], fitted: bool) -> Thinning:
    """The surface over the chosen points, with all others beside."""
    state = thinning(given.x, given.y, value.copy(), NAT, given.value.copy())
    s = state.surface
    s.weight[some] = -1
    refresh(state, math.inf)
    _thin(state)
    s.error[:] = _errors(shares_of(s), s.value, s.target)
    if not fitted:
        # values stay as they are: sets come near to the whole surface then, whatever that keeps of the field
        s.target[:] += s.error
        s.error[:] = 0
    state.reg.criterion = SQUARED
    return state


def _thin(state: Thinning) -> None:
    while not thin_to(state, 3, math.inf, _PIECE):
        pass


def _vertices(state: Thinning) -> NDArray[np.int64]:
    return np.flatnonzero(state.surface.tri.leaving >= 0)


def _sets(state: Thinning, layers: int, low: float, high: float, fitted: bool) -> list[_Set]:
    """Nested sets, the largest first: each is chosen among the points of the one before."""
    s = state.surface
    sets = [_Set(_vertices(state), shares_of(s), _WHOLE, float((s.error**2).mean()))]
    count = len(sets[0].some)
    for share in sorted([*_SETS][: layers - 1], reverse=True):
        if (wanted := int(share * count)) < _LEAST:
            break
        # points of no weight are never put back
        s.weight[:] = 0
        s.weight[sets[-1].some] = 1
        exchange(state, wanted, low, high, _ROUNDS, fitted)
        found = _vertices(state)
        # corners of the hull are in all sets
        if len(found) < len(sets[-1].some):
            sets.append(_Set(found, shares_of(s), _SETS[share], float((s.error**2).mean())))
    return sets


def _errors(shares: Shares, value: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Differences of a surface from the target, at all points."""
    vertex = np.repeat(np.arange(len(value)), np.diff(shares.first))
    return np.bincount(shares.point, shares.weight * value[vertex], len(value)) - target


def _fit_all(
    state: Thinning, sets: list[_Set], value: NDArray[np.float64], target: NDArray[np.float64], low: float,
    high: float, step: float,
) -> None:
    """Fit the values of all vertices, in steps, to the surfaces of all sets, errors relative to each set's best."""
    count = len(value)
    vertices, points, weights, errors = [], [], [], []
    for number, each in enumerate(sets):
        # some surfaces miss nothing, and steps may be so small that their squares are 0
        scale = math.sqrt(each.counts / max(each.squared, 1e-6 * step**2, 1e-300))
        vertices.append(np.repeat(np.arange(count), np.diff(each.shares.first)))
        points.append(each.shares.point + number * count)
        weights.append(scale * each.shares.weight)
        errors.append(scale * _errors(each.shares, value, target))
    vertex = np.concatenate(vertices)
    order = np.argsort(vertex, kind="stable")
    first = np.concatenate([[0], np.cumsum(np.bincount(vertex, minlength=count))]).astype(np.int64)
    shares = Shares(first, np.concatenate(points)[order], np.concatenate(weights)[order])
    s = state.surface._replace(value=value, error=np.concatenate(errors))
    for steps, enough in ((0.0, 0.05 * step), (step, 0.0)):
        for _ in range(_SWEEPS):
            if sweep(s, shares, steps, low, high) <= enough:
                break


def _parts(given: Points, sets: list[_Set], extent: tuple[int, int], layers: int) -> list[NDArray[np.int64]]:
    """The points that each layer adds: a set's new ones by place, in as many parts as there are layers for."""
    news = [sets[-1].some]
    news += [np.setdiff1d(fine.some, coarse.some) for coarse, fine in zip(sets[:0:-1], sets[-2::-1], strict=True)]
    counts = np.ones(len(news), np.int64)
    sizes = np.array([len(new) for new in news])
    # the first set has the corners of the hull, and comes at once
    for _ in range(layers - len(news) if len(news) > 1 else 0):
        counts[1 + np.argmax(sizes[1:] / counts[1:])] += 1
    parts: list[NDArray[np.int64]] = []
    for new, count in zip(news, counts.tolist(), strict=True):
        parts += _cells(given, new, extent, count)
    return parts


def _cells(given: Points, some: NDArray[np.int64], extent: tuple[int, int], count: int) -> list[NDArray[np.int64]]:
    """Split points by the cells that their positions are coded in: always the cell with the most points."""
    sides = [max(side - 1, 0).bit_length() for side in extent]
    cells = [(sides[0], sides[1], some)]
    while len(cells) < count:
        at = max(range(len(cells)), key=lambda i: len(cells[i][2]))
        x, y, held = cells[at]
        if x == y == 0 or len(held) < 2:
            break
        if x >= y:
            x, second = x - 1, given.x[held] >> (x - 1) & 1
        else:
            y, second = y - 1, given.y[held] >> (y - 1) & 1
        halves = held[second == 0], held[second == 1]
        cells[at : at + 1] = [(x, y, half) for half in halves if len(half)]
    return [held for _, _, held in cells]
