"""Areas between neighbouring isovalues, as polygons with holes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..field.labelling import is_of_labels
from .areas import areas_of, geometry_of, lifted, oriented, polygons
from .curve import Curve


@dataclass(frozen=True)
class Band:
    """The area where values lie between two isovalues.

    Attributes
    ----------
    lower, upper : float or None
        Values in the area are greater than ``lower`` and not greater than ``upper``; None below the lowest and above
        the highest isovalue.
    geometry : dict
        GeoJSON ``MultiPolygon`` in the coordinates of `Contour.placed`.
    """

    lower: float | None
    upper: float | None
    geometry: dict[str, Any]


def bands(contours: Iterable[Curve], *, valid: NDArray[np.bool_] | None = None) -> list[Band]:
    """Make the areas between neighbouring isovalues of a field, from below the lowest to above the highest.

    Parameters
    ----------
    contours : iterable of Contour
        Isocontours (n = 2) of one field, as returned by `IsoFile.contours`.
    valid : (s0, s1) array_like of bool, optional
        As for `Contour.areas`.

    Returns
    -------
    list of Band
        In increasing order, one more than there are contours. Together they cover the grid, except for cells with a
        missing corner.

    Raises
    ------
    OptionError, TruncatedError, MissingExtraError
        As for `Contour.areas`.
    """
    return [Band(lower, upper, geometry_of(area)) for lower, upper, area in band_areas(contours, valid)]


def band_areas(
    contours: Iterable[Curve], valid: NDArray[np.bool_] | None
) -> list[tuple[float | None, float | None, Any]]:
    """Bounds of the bands, and their ``MultiPolygon``; see `bands`."""
    shapely = polygons()
    above: list[tuple[float, Any]] = []
    lowest: Curve | None = None
    for contour in contours:
        if is_of_labels(contour.metadata):
            raise OptionError("bands do not apply to labels, which do not lie inside one another", code="bands",
                              remedy="make areas: --what areas, Contour.areas")
        above.append((contour.isovalue, areas_of(contour, valid=valid)))
        if lowest is None or contour.isovalue < lowest.isovalue:
            lowest = contour
        del contour
    if lowest is None:
        return []
    above.sort(key=lambda one: one[0])
    found: list[tuple[float | None, float | None, Any]] = [
        (None, lowest.isovalue, areas_of(lowest, above=False, valid=valid))
    ]
    for i, (value, shape) in enumerate(above):
        upper, less = above[i + 1] if i + 1 < len(above) else (None, None)
        found.append((value, upper, shape if less is None else oriented(shapely.difference(shape, less))))
    return [(lower, upper, lifted(area, lowest.placement)) for lower, upper, area in found]
