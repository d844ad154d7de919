"""Lines and areas as geopandas tables."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..extras import optional
from ..field.reference_system import system_of
from .areas import areas_of, lifted
from .bands import band_areas
from .curve import Curve


def table_of(
    contours: Iterable[Curve], side: str | None = None, valid: NDArray[np.bool_] | None = None
) -> Any:
    """Make a ``GeoDataFrame`` with a row for each line or, with ``side``, for the areas of each isovalue or the bands.

    Columns are ``isovalue``, ``closed`` of lines, ``side`` of areas, ``complete`` and ``geometry``; of bands ``lower``,
    ``upper`` and ``geometry``. An isocontour of the plane has lines; the system is that of the file if it names one by
    its EPSG number or a definition.

    Raises
    ------
    OptionError
        For an isosurface; TruncatedError and others as for `Contour.areas`.
    MissingExtraError
        If geopandas or shapely are not installed.
    """
    geopandas = optional("geopandas", extra="vector", purpose="making tables of lines")
    shapely = optional("shapely", extra="geo", purpose="making tables of lines")
    if side == "bands":
        return _table_of_bands(list(contours), valid, geopandas)
    columns: dict[str, list[Any]] = {"isovalue": [], "side" if side else "closed": [], "complete": []}
    shapes: list[Any] = []
    system: Any = None
    for contour in contours:
        if contour.n != 2:
            raise OptionError("only an isocontour (n = 2) has lines for a map", code="dimension")
        if side is not None:
            parts = [lifted(areas_of(contour, above=side == "above", valid=valid), contour.placement)]
            kinds: list[Any] = [side]
        else:
            whole = contour.joined
            parts = [shapely.LineString(whole.along(walk)) for walk in whole.walks]
            kinds = [len(walk) > 2 and walk[0] == walk[-1] for walk in whole.walks]
            del whole
        shapes += parts
        columns["isovalue"] += [float(contour.isovalue)] * len(parts)
        columns["side" if side else "closed"] += kinds
        columns["complete"] += [bool(contour.complete)] * len(parts)
        system = system_of(contour.placement)
        del contour
    return geopandas.GeoDataFrame(columns, geometry=shapes, crs=system)


def _table_of_bands(contours: list[Curve], valid: NDArray[np.bool_] | None, geopandas: Any) -> Any:
    lower, upper, shapes = zip(*band_areas(contours, valid), strict=True)
    columns = {"lower": np.array(lower, float), "upper": np.array(upper, float)}
    return geopandas.GeoDataFrame(columns, geometry=list(shapes), crs=system_of(contours[0].placement))
