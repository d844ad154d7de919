"""A surface of few points whose contours lie near to those of a field (the criterion ``contour``)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.explicit import surface_contour
from ..errors import OptionError
from ..field.samples import check_field
from ..tin.delaunay import delaunay, triangles
from ..tin.points import Points
from .original import original
from .proof import Target
from .tin_fit import ChosenPoints, along_contours

_STEP = 0.2
"""Steps of values, as a share of what is allowed next to a contour in the mean."""
_SHARES = 1.0, 0.5
"""Shares of the distance that the surface may move a contour by at first."""
_KEPT = 0.7
"""Share of a value's distance from all isovalues that the surface may miss it by."""
_ROUNDS = 24
_NEAR = 2
"""Samples around a piece that lies too far away where less is allowed from then on."""


def near_contours(
    given: Points, field: NDArray[np.float64], isovalues: Sequence[float], distance: float,
    size: Callable[[ChosenPoints], int],
) -> ChosenPoints:
    """The smallest surface that is found whose contours lie within ``distance`` of the field's, both ways.

    At a sample the surface may miss the field by what moves a contour so far along its slope, or by what keeps the
    sample on its side of all isovalues, whichever is more. Distances are proven on the contours; around pieces that lie
    too far away less is allowed, round by round.

    Parameters
    ----------
    given : Points
        Samples of the field.
    field : (s0, s1) float64
    isovalues : sequence of float
    distance : float
        In samples.
    size : callable
        Bytes of a file of a surface.

    Raises
    ------
    OptionError
        If no surface is found.
    """
    wanted = [original(check_field(field, isovalue)) for isovalue in isovalues]
    if not any(len(each.cells) for each in wanted):
        raise OptionError("the field has no contour at these isovalues", code="isovalue", remedy="choose others")
    tried = [_refined(given, field, isovalues, distance, share, wanted) for share in _SHARES]
    found = [each for each in tried if each is not None]
    if not found:
        raise OptionError(
            f"no surface was found whose contours stay within {distance:g}", code="tolerance",
            remedy="allow a larger distance, or encode the contours themselves",
        )
    return min(found, key=size)


def _refined(
    given: Points, field: NDArray[np.float64], isovalues: Sequence[float], distance: float, share: float,
    wanted: Sequence[Contour],
) -> ChosenPoints | None:
    """A surface whose contours keep to a distance; None if rounds do not lead to one."""
    slope = np.hypot(*np.gradient(field))
    apart = np.abs(field[..., None] - np.array(isovalues)).min(axis=-1)
    allowed = np.maximum(share * distance * slope, _KEPT * apart)
    step = _STEP * share * distance * float(np.median(slope[apart <= slope]))
    allowed = np.maximum(allowed, 1e-6 * max(float(np.ptp(field)), 1e-300))
    least = len(given.x) ** 2
    for _ in range(_ROUNDS):
        chosen = along_contours(given, isovalues, allowed[given.x, given.y], step)
        bad = _too_far(given, chosen, wanted, isovalues, distance)
        if not len(bad):
            return chosen
        if len(bad) >= least:
            # what is left is what values are rounded by
            step /= 2
        least = min(len(bad), least)
        here = np.zeros(field.shape, np.bool_)
        for i in range(-_NEAR, _NEAR + 1):
            for j in range(-_NEAR, _NEAR + 1):
                x, y = (np.rint(bad) + (i, j)).astype(np.int64).T
                inside = (x >= 0) & (y >= 0) & (x < field.shape[0]) & (y < field.shape[1])
                here[x[inside], y[inside]] = True
        allowed[here] /= 2
    return None


def _too_far(
    given: Points, chosen: ChosenPoints, wanted: Sequence[Contour], isovalues: Sequence[float], distance: float
) -> NDArray[np.float64]:
    """Ends of pieces of contours of a surface too far from the wanted ones, and the other way round, (B, 2)."""
    x, y = (np.ascontiguousarray(each[chosen.some]) for each in (given.x, given.y))
    cells = triangles(delaunay(x, y)[0]).astype(np.int64)
    points = np.stack([x, y], axis=1).astype(np.float64)
    values = chosen.offset + chosen.step * chosen.numbers.astype(np.float64)
    bad = [np.zeros((0, 2))]
    for one, isovalue in zip(wanted, isovalues, strict=True):
        found = surface_contour(points, values, cells, isovalue, measured=True)
        for (a, a_cells), (b, b_cells) in ((found, (one.points, one.cells)), ((one.points, one.cells), found)):
            if not len(a_cells):
                continue
            far = a_cells
            if len(b_cells):
                far = Target(b, b_cells, distance).exceeded(a, a_cells, np.arange(len(a_cells))).cells
                far = a_cells[far]
            bad.append(a[far.ravel()])
    return np.concatenate(bad)
