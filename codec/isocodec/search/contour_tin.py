"""A surface of few points whose contours lie near to those of a field (the criterion ``contour``).

Only the contours count, so the surface need not have the field's values: near a contour its height is the distance from
that contour, and beyond a reach it is level. It is thinned within an error, mended where the contours turn out to be
too far away, and made smaller by a local search in which every change is held against the contours themselves. All
of that takes place in a band along the contours, in time that grows with their length.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.explicit import surface_contour
from ..errors import OptionError
from ..field.samples import check_field
from ..tin.criteria import AT1
from ..tin.delaunay import delaunay, triangles
from ..tin.fewest_points import inserted, lessened
from ..tin.points import Points
from ..tin.thinning import Thinning, thinning
from .original import original
from .proof import Target
from .tin_fit import ChosenPoints, evenly

_REACH = 2.0, 1.5
"""Distances from a contour up to which the surface slopes: in tolerances, and in samples."""
_STEP, _FINE = 1.0, 0.5
"""Step of heights, in tolerances; of those smaller than a sample."""
_SHARE, _KEPT = 1.3, 0.9
"""Error of the first surface next to a contour, in tolerances; and farther away, as a share of the distance from it."""
_LESS = 0.6
"""Factor of that error around pieces that lie too far away."""
_MENDED = 16
"""Rounds of mending."""
_FAR = 8
"""Spacing of samples far from all contours, in samples."""
_CHUNK = 1 << 21
"""Distances that are worked out at once."""
_MENDING = 600
"""Trials that change points around pieces too far away, at most."""
_WORK, _LEAST, _MOST = 500_000, 100, 500
"""Points in all trials that make the surface smaller, each of which changes many at once; fewest trials, and most."""
_REVERTED = 6
"""Turns in which changes of a trial that move a contour too far are undone."""
_REMOVE, _JOIN, _MEAN = 0.15, 0.7, 0.35
"""Trials that remove points; up to which share join two, and of these take the mean of their heights; others move."""

_INSERTED = 0.8
"""Share of places too far away where a trial inserts points."""

Flat = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Points (P, 2) and segments (M, 2) of a contour."""


@dataclass
class _Vertices:
    """Points of a surface: positions (K, 2), numbers of their heights (K,), and triangles (T, 3)."""

    points: NDArray[np.int64]
    numbers: NDArray[np.int64]
    cells: NDArray[np.int64]


class _Scale:
    """Heights as numbers: isovalues lie half-way between two, if they are evenly spaced.

    Parameters
    ----------
    field : (s0, s1) float64
    isovalues : sequence of float
        Rising.
    wanted : sequence of Contour
    reach : float
        In samples.
    steps : int
        Steps from a contour to what lies half-way to the next.
    """

    def __init__(
        self, field: NDArray[np.float64], isovalues: Sequence[float], wanted: Sequence[Contour], reach: float,
        steps: int,
    ) -> None:
        self.levels = np.array(isovalues)
        gaps = np.diff(self.levels)
        # heights rise next to a single contour as the field does
        slope = np.median(np.hypot(*np.gradient(field))[_beside(wanted, field.shape)])
        least = 1e-9 * max(float(np.ptp(field)), 1e-300)
        gap = float(gaps.min()) if len(gaps) else 2 * reach * max(float(slope), least)
        self.step = gap / (2 * steps)
        self.offset = float(self.levels[0]) - self.step * (steps - 0.5)
        ends = [self.levels[0] - gap / 2, *self.levels, self.levels[-1] + gap / 2]
        self.largest = int(np.ceil((ends[-1] - self.offset) / self.step - 0.5))
        self._outer, self._reach, self._gap = gap / 2, reach, np.array([gap, *gaps, gap])

    def heights(self, side: NDArray[np.int64], far: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray]:
        """Heights of samples, how fast they rise there, and how far they are from the next isovalue.

        Parameters
        ----------
        side : (N,) int64
            Number of isovalues below each sample.
        far : (N, I) float64
            Distances from their contours, at most the reach.
        """
        every = np.arange(len(side))
        below, above = np.maximum(side - 1, 0), np.minimum(side, len(self.levels) - 1)
        down, up = far[every, below], far[every, above]
        gap = self._gap[side]
        share = down / np.maximum(down + up, 1e-12)
        height = self.levels[below] + gap * share
        height = np.where(side == 0, self.levels[0] - self._outer * up / self._reach, height)
        last = side == len(self.levels)
        height = np.where(last, self.levels[-1] + self._outer * down / self._reach, height)
        apart = np.minimum(np.abs(height - self.levels[below]), np.abs(height - self.levels[above]))
        return height, gap / (2 * self._reach), apart

    def numbers(self, height: NDArray[np.float64]) -> NDArray[np.int64]:
        """The nearest numbers, on the same side of all isovalues if there are such."""
        exact = (height - self.offset) / self.step
        number = np.rint(exact)
        side, rounded = (np.searchsorted(self.levels, each) for each in (height, self.values(number)))
        number = np.where(rounded > side, np.floor(exact), np.where(rounded < side, np.ceil(exact), number))
        return np.clip(number, 0, self.largest).astype(np.int64)

    def values(self, numbers: NDArray[Any]) -> NDArray[np.float64]:
        """Heights of numbers."""
        return np.asarray(self.offset + self.step * numbers.astype(np.float64))


class _Wanted:
    """The contours of a field, that those of a surface are held against."""

    def __init__(self, contours: Sequence[Contour], isovalues: Sequence[float], distance: float) -> None:
        self._flat: list[Flat] = [(each.points, each.cells) for each in contours]
        self._isovalues, self._distance = isovalues, distance
        self._targets = [Target(*each, distance) for each in self._flat]

    def too_far(self, vertices: _Vertices, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Ends of pieces of contours of a surface too far from the wanted ones, and the other way round, (B, 2)."""
        bad = [np.zeros((0, 2))]
        points = vertices.points.astype(np.float64)
        for wanted, target, isovalue in zip(self._flat, self._targets, self._isovalues, strict=True):
            found = surface_contour(points, values, vertices.cells, isovalue, measured=True)
            for one, other in ((found, target), (wanted, Target(*found, self._distance))):
                if len(one[1]):
                    bad.append(one[0][one[1][other.exceeded(*one).cells].ravel()])
        return np.concatenate(bad)


def near_contours(
    given: Points, field: NDArray[np.float64], isovalues: Sequence[float], distance: float
) -> ChosenPoints:
    """A small surface whose contours lie within ``distance`` of the field's, both ways, which is proven.

    One of all samples, with the field's values, if the search finds none.

    Parameters
    ----------
    given : Points
        Samples of the field.
    field : (s0, s1) float64
    isovalues : sequence of float
    distance : float
        In samples.

    Raises
    ------
    OptionError
        If there is no contour, or not even all samples will do.
    """
    levels = sorted(set(isovalues))
    contours = [original(check_field(field, isovalue)) for isovalue in levels]
    if not any(len(each.cells) for each in contours):
        raise OptionError("the field has no contour at these isovalues", code="isovalue", remedy="choose others")
    reach = _REACH[0] * distance + _REACH[1]
    step = _STEP if distance >= 1 else _FINE
    scale = _Scale(field, levels, contours, reach, max(round(reach / (step * distance)), 2))
    wanted = _Wanted(contours, levels, distance)
    names = given.x.astype(np.int64) * field.shape[1] + given.y
    rank = np.empty(field.size, np.int64)
    rank[names] = np.arange(len(names))
    grain = 1 << max(int(distance).bit_length() - 1, 0)
    search = _Search(_Band(field, levels, contours, distance, reach, grain), scale, wanted, distance, rank)
    found = search.smallest(search.mended())
    if found is None:
        return _of_all(given, wanted, distance)
    some = rank[found.points @ np.array([field.shape[1], 1])]
    least = int(found.numbers.min())
    numbers = found.numbers - least
    return ChosenPoints(some, numbers, float(scale.offset + scale.step * least), scale.step, (), int(numbers.max()))


def _of_all(given: Points, wanted: _Wanted, distance: float) -> ChosenPoints:
    """All samples with their values; OptionError if contours of that surface lie too far away."""
    chosen = evenly(given, None, False)
    points = np.stack([given.x, given.y], axis=1).astype(np.int64)
    vertices = _Vertices(points, chosen.numbers, triangles(delaunay(given.x, given.y)[0]).astype(np.int64))
    if len(wanted.too_far(vertices, np.asarray(chosen.offset + chosen.step * chosen.numbers, np.float64))):
        raise OptionError(
            f"no surface was found whose contours stay within {distance:g}", code="tolerance",
            remedy="allow a larger distance, or encode the contours themselves",
        )
    return chosen


def _beside(contours: Sequence[Contour], shape: tuple[int, ...]) -> tuple[NDArray[np.int64], ...]:
    """Samples next to points of contours."""
    points = np.concatenate([each.points for each in contours])
    return tuple(np.clip(np.rint(points).astype(np.int64), 0, np.array(shape) - 1).T)


class _Band:
    """Samples that a surface may have: along contours, a few far away, and the corners.

    Where the distance allows for it these are every second or fourth sample along each axis, and so on: positions then
    take fewer bits. Where no contour can be brought near with those, any sample is used.

    Attributes
    ----------
    shape : tuple of int
    grain : int
        Samples from one of those to the next, a power of two; the last row and column are among them.
    points : (N, 2) int64
    side : (N,) int64
        Number of isovalues below each.
    far : (N, I) float64
        Distances from the contours, at most the reach.
    """

    def __init__(
        self, field: NDArray[np.float64], levels: Sequence[float], contours: Sequence[Contour], distance: float,
        reach: float, grain: int,
    ) -> None:
        self.shape, self.grain = field.shape, grain
        spacing = max(int(distance), 1)
        sides = np.searchsorted(np.array(levels), field)
        near = np.stack([_distances(each, field.shape, 2.0, 1) for each in contours], axis=-1)
        wide = np.stack([_distances(each, field.shape, reach, spacing) for each in contours], axis=-1)
        far = np.minimum(np.where(near < 2.0, near, reach), wide)
        use: NDArray[np.bool_] = np.asarray((near < 1.0).any(axis=-1) | (wide < reach).any(axis=-1))
        coarse, fine = (
            np.ix_(*[np.unique(np.append(np.arange(0, end, step), end - 1)) for end in field.shape])
            for step in (max(_FAR, grain), grain)
        )
        use[coarse] = True
        there = np.zeros(field.shape, np.bool_)
        there[fine] = True
        use &= there
        self.points = np.argwhere(use)
        self.side, self.far = sides[use].astype(np.int64), far[use]
        self.all_sides, self.all_far = sides, far


def _distances(contour: Contour, shape: tuple[int, ...], reach: float, spacing: int) -> NDArray[np.float64]:
    """Distances (s0, s1) of samples at multiples of a spacing from a contour, at most the reach; of others the reach.
    """
    out = np.full(int(np.prod(shape)), float(reach))
    first, second = (contour.points[contour.cells[:, i]] for i in (0, 1))
    along = second - first
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    most = int(np.ceil(reach / spacing)) + 1
    around = np.stack(np.meshgrid(*[np.arange(-most, most + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2) * spacing
    middle = np.rint((first + second) / 2 / spacing).astype(np.int64) * spacing
    size = max(_CHUNK // len(around), 1)
    for begin in range(0, len(first), size):
        some = slice(begin, begin + size)
        place = middle[some, None] + around
        at = np.clip(((place - first[some, None]) * along[some, None]).sum(axis=-1) / squared[some, None], 0, 1)
        away = np.sqrt(((place - first[some, None] - at[..., None] * along[some, None]) ** 2).sum(axis=-1))
        inside = ((place >= 0) & (place < np.array(shape))).all(axis=-1) & (away < reach)
        np.minimum.at(out, place[inside] @ np.array([shape[1], 1]), away[inside])
    return out.reshape(shape)


def _neighbours(cells: NDArray[np.int64], count: int) -> tuple[list[int], list[int]]:
    """Points beside each point of a mesh, and where the neighbours of each begin in the list."""
    ends = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
    ends = np.concatenate([ends, ends[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    return np.searchsorted(ends[:, 0], np.arange(count + 1)).tolist(), ends[:, 1].tolist()


def _bounds(points: list[list[int]]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Corners of a box one wider than points."""
    x, y = zip(*points, strict=True)
    return (min(x) - 1, min(y) - 1), (max(x) + 1, max(y) + 1)


class _Search:
    """The search for few points; ``rank`` has the places of all samples in the order that decides ties."""

    def __init__(
        self, band: _Band, scale: _Scale, wanted: _Wanted, distance: float, rank: NDArray[np.int64]
    ) -> None:
        self._band, self._scale, self._wanted, self._distance, self._rank = band, scale, wanted, distance, rank
        self._random = np.random.default_rng(0)
        self._last = np.array(band.shape) - 1

    def mended(self) -> _Vertices:
        """A surface within an error that shrinks where contours are too far away; they may be so still."""
        band, scale = self._band, self._scale
        height, slope, apart = scale.heights(band.side, band.far)
        value = scale.values(scale.numbers(height))
        allowed = np.full(band.shape, _SHARE * self._distance)
        where = tuple(band.points.T)

        def weights() -> NDArray[np.float64]:
            within = np.maximum(allowed[where] * slope, _KEPT * apart)
            # rounding leaves some room, too
            return 1 / np.maximum(within, 1.1 * np.abs(value - height) + 1e-12)

        x, y = (np.ascontiguousarray(each) for each in band.points.T)
        state: Thinning = thinning(x, y, value.copy(), AT1, height, weights())
        lessened(state, 0, 1.0)
        found = self._vertices(state)
        for _ in range(_MENDED):
            bad = self._wanted.too_far(found, scale.values(found.numbers))
            if not len(bad):
                break
            allowed[self._around(bad, max(round(0.5 * self._distance), 1))] *= _LESS
            state.surface.weight[:] = weights()
            inserted(state, value, 1.0)
            lessened(state, 0, 1.0)
            found = self._vertices(state)
        return found

    def _vertices(self, state: Thinning) -> _Vertices:
        some = np.flatnonzero(state.surface.tri.leaving >= 0)
        return self._joined(self._band.points[some], self._scale.numbers(state.surface.value[some]))

    def _joined(self, points: NDArray[np.int64], numbers: NDArray[np.int64]) -> _Vertices:
        """Triangulate points, in the order that they have in a file."""
        order = np.argsort(self._rank[points @ np.array([self._band.shape[1], 1])])
        points, numbers = points[order], numbers[order]
        x, y = (np.ascontiguousarray(each) for each in points.T)
        return _Vertices(points, numbers, triangles(delaunay(x, y)[0]).astype(np.int64))

    def _around(self, places: NDArray[np.float64], reach: int) -> NDArray[np.bool_]:
        """Samples around some places."""
        out = np.zeros(self._band.shape, np.bool_)
        middle = np.unique(np.rint(places).astype(np.int64), axis=0)
        for i in range(-reach, reach + 1):
            for j in range(-reach, reach + 1):
                out[tuple(np.clip(middle + (i, j), 0, self._last).T)] = True
        return out

    def smallest(self, found: _Vertices) -> _Vertices | None:
        """Join, move and remove points as long as contours stay near; None if they do not in the end."""
        bad = self._wanted.too_far(found, self._scale.values(found.numbers))
        for _ in range(_MENDING):
            if not len(bad):
                break
            found, bad = self._changed(found, bad)
        if len(bad):
            return None
        for _ in range(min(max(_WORK // len(found.points), _LEAST), _MOST)):
            found, bad = self._changed(found, bad)
        return found

    def _changed(self, found: _Vertices, bad: NDArray[np.float64]) -> tuple[_Vertices, NDArray[np.float64]]:
        """A surface with changes that move contours too far nowhere but where they are too far away already."""
        changes = self._changes(found, bad)
        known = self._around(bad, 1)
        for _ in range(_REVERTED):
            trial = changes.applied(found, self._joined)
            if trial is None:
                break
            now = self._wanted.too_far(trial, self._scale.values(trial.numbers))
            fresh = now[~known[tuple(np.clip(np.rint(now).astype(np.int64), 0, self._last).T)]]
            if not len(fresh):
                return trial, now
            changes.revert(fresh)
        return found, bad

    def _still(self, found: _Vertices, bad: NDArray[np.float64]) -> list[bool]:
        """Points that stay as they are: what is near bad places comes first, if there are any."""
        if not len(bad):
            return [False] * len(found.points)
        near_bad = self._around(bad, int(self._distance) + 3)[tuple(found.points.T)]
        still: list[bool] = (~near_bad).tolist()
        return still

    def _changes(self, found: _Vertices, bad: NDArray[np.float64]) -> _Changes:
        """Changes of points that are not next to one another."""
        draw, count = self._random, len(found.points)
        begin, beside = _neighbours(found.cells, count)
        border = ((found.points == 0) | (found.points == self._last)).any(axis=1).tolist()
        # until all contours are near, points may move to any sample
        way, (most_x, most_y), grain = draw.random(), self._last.tolist(), 1 if len(bad) else self._band.grain
        shift, lift = (grain * draw.integers(-2, 3, (count, 2))).tolist(), draw.integers(-1, 2, count).tolist()
        noise = draw.normal(size=(count, 3)).tolist()
        share, pick = draw.random(count).tolist(), draw.random(count).tolist()
        points, numbers, largest = found.points.tolist(), found.numbers.tolist(), self._scale.largest
        still = self._still(found, bad)
        busy = [False] * count
        changing = busy.__getitem__
        names = {(x, y) for x, y in points}
        out = _Changes()
        for i in draw.permutation(count).tolist():
            around = beside[begin[i] : begin[i + 1]]
            if still[i] or busy[i] or any(map(changing, around)) or (border[i] and way < _JOIN):
                continue
            other, place, number = i, None, 0
            x, y = points[i]
            if way >= _JOIN:
                place, number = (x, y), numbers[i] + lift[i]
                if not border[i]:
                    place = grain * round(x / grain) + shift[i][0], grain * round(y / grain) + shift[i][1]
            elif way >= _REMOVE:
                inner = [k for k in around if not (border[k] or still[k])]
                if not inner:
                    continue
                other = inner[int(pick[i] * len(inner))]
                more = beside[begin[other] : begin[other + 1]]
                if any(map(changing, more)):
                    continue
                around = around + more
                u, v = points[other]
                place = (grain * round((u + share[i] * (x - u)) / grain + 0.7 * noise[i][0]),
                         grain * round((v + share[i] * (y - v)) / grain + 0.7 * noise[i][1]))
                number = round((numbers[i] + numbers[other]) / 2 + noise[i][2])
            if place is not None:
                free = place not in names or list(place) in (points[i], points[other])
                if not (free and (border[i] or (0 < place[0] < most_x and 0 < place[1] < most_y))):
                    continue
                if _REMOVE <= way < _MEAN:
                    number = self._number_at(place)
                number = min(max(number, 0), largest)
                names.add(place)
            low, high = _bounds([points[k] for k in around])
            out.add((i, other), place, number, low, high)
            for k in (i, *around):
                busy[k] = not still[k]
        self._insert(out, bad, names)
        out.begin()
        return out

    def _insert(self, out: _Changes, bad: NDArray[np.float64], names: set[tuple[int, int]]) -> None:
        """Add points near places where contours are too far away; ``names`` are those that have points."""
        draw, (most_x, most_y) = self._random, self._last.tolist()
        reach = int(2 * self._distance) + 2
        places = np.unique(np.rint(bad).astype(np.int64), axis=0)
        for x, y in places[draw.random(len(places)) < _INSERTED].tolist():
            there = np.rint(draw.normal(size=2) * self._distance).astype(np.int64).tolist()
            place = min(max(x + there[0], 0), most_x), min(max(y + there[1], 0), most_y)
            number = self._number_at(place) + int(draw.integers(-1, 2))
            if place not in names:
                names.add(place)
                out.add((), place, min(max(number, 0), self._scale.largest), (place[0] - reach, place[1] - reach),
                        (place[0] + reach, place[1] + reach))

    def _number_at(self, place: tuple[int, int]) -> int:
        """The number of the height that a sample has by its distance from contours."""
        where = tuple(np.array([each]) for each in place)
        height, _, _ = self._scale.heights(self._band.all_sides[where].astype(np.int64), self._band.all_far[where])
        return int(self._scale.numbers(height)[0])


class _Changes:
    """Points to remove or replace, each with the box in which that may move a contour; no two at one place."""

    def __init__(self) -> None:
        self._from: list[tuple[int, ...]] = []
        self._to: list[tuple[tuple[int, int] | None, int]] = []
        self._boxes: list[tuple[tuple[int, int], tuple[int, int]]] = []
        self._on: NDArray[np.bool_] = np.zeros(0, np.bool_)

    def add(
        self, points: tuple[int, ...], place: tuple[int, int] | None, number: int, low: tuple[int, int],
        high: tuple[int, int],
    ) -> None:
        """Add a change: some points go, and one may come."""
        self._from.append(points)
        self._to.append((place, number))
        self._boxes.append((low, high))

    def begin(self) -> None:
        """All are to be tried."""
        self._on = np.ones(len(self._from), np.bool_)
        self._low, self._high = np.array(self._boxes).reshape(-1, 2, 2).transpose(1, 0, 2)

    def applied(
        self, found: _Vertices, joined: Callable[[NDArray[np.int64], NDArray[np.int64]], _Vertices]
    ) -> _Vertices | None:
        """The surface with all changes that are left; None if none is."""
        some = np.flatnonzero(self._on).tolist()
        if not some:
            return None
        left = np.ones(len(found.points), np.bool_)
        left[[each for i in some for each in self._from[i]]] = False
        new = [(*place, number) for place, number in (self._to[i] for i in some) if place is not None]
        fresh = np.array(new, np.int64).reshape(-1, 3)
        return joined(
            np.concatenate([found.points[left], fresh[:, :2]]), np.concatenate([found.numbers[left], fresh[:, 2]])
        )

    def revert(self, bad: NDArray[np.float64]) -> None:
        """Leave out changes whose boxes hold places where a contour is too far away, or those next to them."""
        places = np.unique(np.rint(bad).astype(np.int64), axis=0)
        first = places.min(axis=0)
        # how many lie before each sample along both axes: a box holds differences of these
        before = np.zeros(places.max(axis=0) - first + 2, np.int64)
        before[tuple((places - first + 1).T)] = 1
        before = before.cumsum(axis=0).cumsum(axis=1)
        last = np.array(before.shape) - 1
        on = np.flatnonzero(self._on)
        (x, y), (u, v) = (np.clip(each[on] - first, 0, last).T for each in (self._low, self._high + 1))
        hit = np.zeros(len(self._on), np.bool_)
        hit[on] = before[u, v] - before[x, v] - before[u, y] + before[x, y] > 0
        if not hit.any() and len(on):
            # farther away than is usual: those next to these places
            middle = (self._low[on] + self._high[on]) / 2
            hit[on[np.unique([np.abs(middle - place).max(axis=1).argmin() for place in places])]] = True
        self._on &= ~hit
