"""Adaptive thinning of scattered points, pictures and terrains: what remains of them, at any size."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import OptionError
from ..stream.names import ThinningName
from .criteria import NAMES
from .delaunay import delaunay, triangles
from .points import Points, points_of
from .thinning import thin_to, thinning
from .tin import Tin

MEMORY = 320
"""Bytes that thinning takes for each point at most, beside what is given."""
_PIECE = 1 << 14
"""Removals between two reports of progress."""


@dataclass(frozen=True)
class Thinned:
    """Points in the order of their significance, the least significant first.

    Attributes
    ----------
    kept : (K,) int64
        Numbers of the points that are left, rising: rows of what was given (samples of a field row by row).
    order : (R,) int64
        Numbers of the points that were taken out, in the order in which they went.
    anticipated : (R,) float64
        What each removal was expected to cost, in the measure of the criterion.
    errors : (R,) float64
        Largest distance of the surface from the values of all points, after each removal.
    merged : int
        Points that coincided with others: only the first of them is in ``kept`` or ``order``, with their mean value.
    """

    kept: NDArray[np.int64]
    order: NDArray[np.int64]
    anticipated: NDArray[np.float64]
    errors: NDArray[np.float64]
    merged: int
    _points: Points

    def __len__(self) -> int:
        return len(self.kept)

    @cached_property
    def _place(self) -> NDArray[np.int64]:
        """Points by rank in the order of significance, the most significant first."""
        number = np.full(int(self._points.source.max()) + 1, -1)
        number[self._points.source] = np.arange(len(self._points.source))
        return number[np.concatenate([self.kept, self.order[::-1]])]

    def tin(self, count: int | None = None) -> Tin:
        """The surface over the ``count`` most significant points; over all that are left, if not given.

        Raises
        ------
        OptionError
            If fewer are asked for than are left, or more than there are.
        """
        count = len(self.kept) if count is None else count
        if not (isinstance(count, Integral) and len(self.kept) <= count <= len(self._place)):
            raise OptionError(
                f"there are surfaces of {len(self.kept)} to {len(self._place)} points, not of {count}", code="points"
            )
        some = np.sort(self._place[:count])
        points = self._points
        found = triangles(delaunay(points.x[some], points.y[some])[0])
        return Tin(points.positions[some], points.value[some], found.astype(np.int64))


def thin(
    points: ArrayLike,
    values: ArrayLike | None = None,
    criterion: ThinningName = "AT1",
    *,
    to: int | None = None,
    error: float | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Thinned:
    """Take points out of a Delaunay triangulation one by one, always the one that matters least.

    Parameters
    ----------
    points : (N, 2) array_like, or (s0, s1) array_like without ``values``
        Positions of scattered points, or the samples of a picture or terrain, which lie at their indices. Positions
        that no grid of ``2**28`` steps holds are rounded to ``2**24`` steps of the longer side.
    values : (N,) array_like, optional
        Points that coincide become one with the mean of their values.
    criterion : str
        Which point matters least. The smallest largest error, over the point's star: ``AT1``; over all points:
        ``inf``; at the point alone: ``AT2``; there, by triangles in each direction, which is fastest: ``AT3``. The
        least growth of the sum of squared errors: ``l2``. The nearest neighbour, whatever the values: ``NAT``.
    to : int, optional
        How many points are to be left. Corners of the convex hull always stay.
    error : float, optional
        Take out all points that can go while the surface misses none by more.
    progress : callable, optional
        Called with the points taken out and how many there are at most.

    Returns
    -------
    Thinned

    Raises
    ------
    InputError
        If there are fewer than three distinct points, all lie on a line, or numbers are not finite.
    OptionError
        If the criterion is none of these, or not exactly one of ``to`` and ``error`` is given, or it is out of range.

    Notes
    -----
    The result does not depend on the order of the points. Memory: up to `MEMORY` bytes a point, 3.2 GB for ten
    million. Time grows with ``N log N``.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[:32, :32]
    >>> len(thin(np.hypot(x - 9.5, y - 20), to=50))
    50
    """
    if criterion not in NAMES:
        raise OptionError(f"there is no criterion {criterion!r}", code="criterion", remedy=f"one of {', '.join(NAMES)}")
    if (to is None) == (error is None):
        raise OptionError("give exactly one of to and error", code="thin", remedy="to=1000 or error=5.0")
    if to is not None and not (isinstance(to, Integral) and to >= 3):
        raise OptionError(f"{to} points are to be left; needed are 3 or more", code="points")
    if error is not None and not (error >= 0):
        raise OptionError(f"the error is {error}; it must be 0 or more", code="error")
    given = points_of(points, values)
    state = thinning(given.x, given.y, given.value, NAMES[criterion])
    least, most = (0, float(error)) if to is None else (int(to), math.inf)  # type: ignore[arg-type]
    while not thin_to(state, least, most, _PIECE):
        if progress:
            progress(state.reg.removed, len(given.x) - least)
    count = state.reg.removed
    order = state.order[:count]
    left = np.ones(len(given.x), np.bool_)
    left[order] = False
    return Thinned(
        np.sort(given.source[left]), given.source[order], state.anticipated[:count].copy(),
        state.largest[:count].copy(), given.merged, given,
    )
