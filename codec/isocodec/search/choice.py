"""Choice of the layers of a file for a tolerance (row S3-distortion; spec annex G.3).

Candidates are tried on windows of the field, and the one that takes the fewest bytes there is used for the whole field.
If the field is small, or an isovalue is predicted from an earlier one, they are tried on the whole field instead.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import field

from ..deferred import dataclass
from ..grid.lattice.vertex_set import Chosen
from .cubes import cubed, exponents
from .promise import Promise
from .repair import Course, Kept, Plan, repaired
from .strategy import HOPELESS, Found, NotKeptError, base_of, better, even_exponents, even_start, grids, loose_start
from .tolerance import parts_on, pitches
from .windows import windows

AHEAD = 1.05
"""A candidate that takes so many times the bytes of the best one so far on windows is given up."""
CLOSE = 1.06
"""The second best on windows is tried on the whole field, too, if it takes at most so many times the bytes there."""
FAR = 1.01
"""Finer pitches of offsets on a mesh are left out after one that takes so many times the best bytes. On the whole field
such a candidate is given up: nothing is tried again."""


def smallest(promise: Promise, tolerance: float, topology: bool) -> Plan:
    """The plan with the fewest bytes, of those tried, whose decoded curve is proven to keep to the tolerance."""
    whole, sizes = _Site(promise, tolerance, topology), {_GRID: 0.0}
    if promise.full_level > 0:
        parts = [] if promise.leans or topology else windows(promise, tolerance)
        sites = [_Site(part, tolerance) for part in parts] or [whole]
        sizes = _sizes(sites, _candidates(promise, tolerance, topology), AHEAD if parts else FAR)
    ranking = sorted(sizes, key=lambda candidate: sizes[candidate])
    best: Found = (math.inf, [])
    for i, candidate in enumerate([*ranking, _GRID]):
        if best[1] and (i > 1 or sizes.get(candidate, math.inf) > CLOSE * sizes[ranking[0]]):
            break
        best = whole.found(candidate, best[0]) or best
    if not best[1]:
        raise NotKeptError(
            f"no mesh was proven to stay within {tolerance:g} cells", code="tolerance",
            remedy="use a tolerance below 0.1, which needs no search for a mesh",
        )
    return best[1]


@dataclass(frozen=True)
class _Candidate:
    """A mesh to begin with, and how its points are stored.

    Attributes
    ----------
    exponent : int or None
        Even squares or cubes with an edge of ``2**exponent`` samples, 0 for the full grid; None for a mesh that is
        coarse where the curve is flat.
    pitch : (parts, unit), or None
        Of points that are fitted; None for points with slack.
    """

    exponent: int | None
    pitch: tuple[int, int] | None = None


_GRID = _Candidate(0)


def _candidates(promise: Promise, tolerance: float, topology: bool) -> Iterator[list[_Candidate]]:
    """Candidates to try, those on one mesh together, the fastest ones first."""
    yield [_GRID]
    fitted = list(pitches(tolerance, promise.n))
    if not topology:
        for exponent in exponents(tolerance, promise.full_level // promise.n - 1):
            yield [_Candidate(exponent)]
        for exponent in even_exponents(promise, tolerance):
            # on edges of cubes and of finer ones, several pitches may be the same
            same = {tuple(parts_on(1 << e, *pitch) for e in range(exponent + 1)): pitch for pitch in fitted[::-1]}
            yield [_Candidate(exponent, pitch) for pitch in fitted if pitch in same.values()]
    yield [_Candidate(None, pitch) for pitch in fitted]


def _sizes(sites: Sequence[_Site], candidates: Iterator[list[_Candidate]], ahead: float) -> dict[_Candidate, float]:
    """Bytes of the candidates that keep to the tolerance on all sites, and take less than ``ahead`` times the fewest.
    """
    best, totals = [math.inf] * len(sites), dict[_Candidate, float]()
    for alike in candidates:
        for candidate in alike:
            sums = _sums(sites, candidate, [ahead * least for least in best])
            for site in sites:
                site.done(sums[-1:] < best[-1:] and len(sums) == len(best))
            if len(sums) < len(best):
                break
            totals[candidate] = sums[-1]
            if sums[-1] < best[-1]:
                best = sums
            elif sums[-1] > FAR * best[-1]:
                break
    return totals


def _sums(sites: Sequence[_Site], candidate: _Candidate, most: Sequence[float]) -> list[float]:
    """Bytes that a candidate takes on the first site, on the first two, and so on.

    It ends where the candidate does not keep to the tolerance, or takes more than the ``most`` so far.
    """
    sums: list[float] = []
    for site, limit in zip(sites, most, strict=True):
        before = sums[-1] if sums else 0.0
        found = site.found(candidate, limit - before)
        if found is None:
            break
        sums.append(before + found[0])
    return sums


@dataclass
class _Site:
    """A field, or a window of it, on which candidates are tried.

    Attributes
    ----------
    promise : Promise
    tolerance : float
    topology : bool
    course, cubes : Course
        Of the repairs so far, and of squares or cubes.
    """

    promise: Promise
    tolerance: float
    topology: bool = False
    course: Course = field(default_factory=Course)
    cubes: Course = field(default_factory=lambda: Course(aims=False))
    _known: dict[_Candidate, Found] = field(default_factory=dict)
    _loose: Chosen | None = None

    def found(self, candidate: _Candidate, most: float = math.inf) -> Found | None:
        """Bytes and plan of a candidate; None if it misses the tolerance or takes more than ``most`` bytes."""
        if candidate not in self._known:
            found = self._made(candidate, most)
            if found is None or not found[1]:
                return None
            self._known[candidate] = found
        return self._known[candidate] if self._known[candidate][0] <= most else None

    def done(self, better: bool) -> None:
        """The end of a candidate."""
        self.course.done(better)
        self.cubes.done(better)

    def _made(self, candidate: _Candidate, most: float) -> Found | None:
        promise, tolerance = self.promise, self.tolerance
        if candidate == _GRID:
            return grids(promise, tolerance, self.topology)
        if candidate.exponent is None:
            return self._from_loose(candidate, most)
        if candidate.exponent >= promise.full_level // promise.n:
            return None
        start, lead = even_start(promise, candidate.exponent)
        if candidate.pitch is None:
            size = candidate.exponent
            return _found(cubed(promise, promise.reduction(start), tolerance, size, lead, most, self.cubes))
        reduction = promise.reduction(start)
        return _found(repaired(promise, reduction, tolerance, candidate.pitch, lead, most=most, course=self.course))

    def _from_loose(self, candidate: _Candidate, most: float) -> Found | None:
        """Begin with a mesh that is coarse where the curve is flat."""
        promise, tolerance = self.promise, self.tolerance
        assert candidate.pitch is not None
        if self._loose is None:
            self._loose = loose_start(promise, tolerance, self.topology)
            # it has its places elsewhere than even meshes
            self.course.lost = {}
        reduction = promise.reduction(self._loose)
        kept = repaired(promise, reduction, tolerance, candidate.pitch, most=HOPELESS * most, course=self.course)
        if kept is None:
            return None
        coarse = base_of(promise.n, promise.full_level)
        if self.topology or coarse == promise.full_level:
            return _found(kept)
        # a coarse uniform base has vertices that the mesh may lack: proven anew
        plan: Plan = [("base", coarse), ("adapt", 1, kept.mesh), kept.plan[-1]]
        return better(promise, tolerance, plan, (kept.size, kept.plan))


def _found(kept: Kept | None) -> Found | None:
    return None if kept is None else (kept.size, kept.plan)
