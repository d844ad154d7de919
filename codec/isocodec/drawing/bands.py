"""Areas between neighbouring isovalues, as polygons with holes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .areas import areas_of, lifted, pieces_of, polygons
from .curve import Curve


@dataclass(frozen=True)
class Band:
    """Area where values lie between two isovalues.

    Attributes
    ----------
    lower, upper : float or None
        Values there are greater than the one and not greater than the other; None below the lowest isovalue and above
        the highest one.
    geometry : dict
        GeoJSON ``MultiPolygon`` in the coordinates of `Contour.placed`.
    """

    lower: float | None
    upper: float | None
    geometry: dict[str, Any]


def bands(contours: Iterable[Curve], *, valid: NDArray[np.bool_] | None = None) -> list[Band]:
    """Areas between neighbouring isovalues of a field, from below the lowest one to above the highest one.

    Parameters
    ----------
    contours : iterable of Contour
        Isocontours (n = 2) of one field, as `IsoFile.contours` gives them.
    valid : (s0, s1) array_like of bool, optional
        As of `Contour.areas`.

    Returns
    -------
    list of Band
        Rising, one more than there are contours. They make up the box, without cells that have a missing corner.

    Raises
    ------
    OptionError, TruncatedError, MissingExtraError
        As `Contour.areas`.
    """
    shapely = polygons()
    above: list[tuple[float, Any]] = []
    lowest: Curve | None = None
    for contour in contours:
        above.append((contour.isovalue, shapely.geometry.shape(areas_of(contour, valid=valid))))
        if lowest is None or contour.isovalue < lowest.isovalue:
            lowest = contour
        del contour
    above.sort(key=lambda one: one[0])
    out = [] if lowest is None else [Band(None, lowest.isovalue, areas_of(lowest, above=False, valid=valid))]
    for i, (value, shape) in enumerate(above):
        upper, less = above[i + 1] if i + 1 < len(above) else (None, None)
        rest = shape if less is None else shapely.difference(shape, less)
        out.append(Band(value, upper, _mapping(rest, shapely)))
    return [replace(band, geometry=lifted(band.geometry, None if lowest is None else lowest.placement)) for band in out]


def _mapping(shape: Any, shapely: Any) -> dict[str, Any]:
    parts = [shapely.geometry.polygon.orient(part) for part in pieces_of(shape)]
    geometry: dict[str, Any] = shapely.geometry.mapping(shapely.MultiPolygon(parts))
    return geometry
