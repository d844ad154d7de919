"""Lines and areas as rows: geometries in WKB with columns, and geopandas tables of these."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..errors import OptionError
from ..extras import optional
from ..field.labelling import noun_of
from ..field.placement import Placement
from ..field.reference_system import system_of
from .areas import areas_of, lifted
from .bands import band_areas
from .curve import Curve


@dataclass(frozen=True, eq=False)
class Rows:
    """A row for each line, or for the areas of each isovalue, or for each band.

    Attributes
    ----------
    shapes : (R,) array of bytes
        Geometries in WKB.
    columns : dict of str to (R,) array
        ``isovalue`` or ``label``, ``closed`` of lines, ``side`` of areas, ``complete``, and ``index`` if it is asked
        for; of bands ``lower`` and ``upper``.
    placement : Placement or None
        That of the contours.
    has_z, has_empty : bool
        Whether coordinates are three; whether a geometry is empty.
    """

    shapes: NDArray[Any]
    columns: dict[str, NDArray[Any]]
    placement: Placement | None
    has_z: bool
    has_empty: bool

    @property
    def table(self) -> Any:
        """The rows as a ``GeoDataFrame``."""
        geopandas = optional("geopandas", extra="vector", purpose="making tables of lines")
        return geopandas.GeoDataFrame(
            self.columns, geometry=geopandas.GeoSeries.from_wkb(self.shapes), crs=system_of(self.placement)
        )


def rows_of(
    contours: Iterable[Curve], side: str | None = None, valid: NDArray[np.bool_] | None = None,
    attribute: str | None = None, index: Collection[float] | None = None,
) -> Rows:
    """Make a row for each line or, with ``side``, for the areas of each isovalue or the bands.

    Of each contour no more is kept than its rows.

    Parameters
    ----------
    contours : iterable of Contour
        Of the plane, in one reference system.
    side, valid
        As of `areas`; ``"bands"`` for bands.
    attribute : str, optional
        Name of the column of isovalues; if not given, ``isovalue``, or ``label`` of contours of labels.
    index : collection of float, optional
        Isovalues of index contours, which a column marks.

    Raises
    ------
    OptionError
        For an isosurface; TruncatedError and others as for `Contour.areas`.
    MissingExtraError
        If shapely is not installed.
    """
    shapely = optional("shapely", extra="geo", purpose="making tables of lines")
    found: list[tuple[NDArray[Any], dict[str, Any]]] = []
    placement, has_z, has_empty = None, False, False
    for contour, shapes, columns in (_bands if side == "bands" else _isovalues)(contours, side, valid, shapely):
        if side != "bands":
            level = float(contour.isovalue)
            marks = {} if index is None else {"index": level in index}
            name = attribute or noun_of(contour.metadata)
            columns = {name: level, **columns, "complete": bool(contour.complete), **marks}
        has_z |= bool(shapely.has_z(shapes).any())
        has_empty |= bool(shapely.is_empty(shapes).any())
        found.append((shapely.to_wkb(shapes), {
            name: np.broadcast_to(np.asarray(column, object if isinstance(column, str) else None), len(shapes))
            for name, column in columns.items()
        }))
        placement = contour.placement
        del contour, shapes
    joined = {name: np.concatenate([columns[name] for _, columns in found]) for name in (found[0][1] if found else ())}
    shapes = np.concatenate([shapes for shapes, _ in found]) if found else np.zeros(0, object)
    return Rows(shapes, joined, placement, has_z, has_empty)


def _isovalues(
    contours: Iterable[Curve], side: str | None, valid: NDArray[np.bool_] | None, shapely: Any
) -> Iterator[tuple[Curve, NDArray[Any], dict[str, Any]]]:
    """Make the geometries of each contour, and their columns but that of isovalues."""
    for contour in contours:
        if contour.n != 2:
            raise OptionError("only an isocontour (n = 2) has lines for a map", code="dimension")
        if side is not None:
            areas = lifted(areas_of(contour, above=side == "above", valid=valid), contour.placement)
            yield contour, np.array([areas], object), {"side": side}
        else:
            whole = contour.joined
            walks = whole.walks
            places = [whole.along(walk) for walk in walks] or [np.zeros((0, 2))]
            owner = np.repeat(np.arange(len(walks)), [len(walk) for walk in walks])
            closed = np.array([len(walk) > 2 and walk[0] == walk[-1] for walk in walks], np.bool_)
            yield contour, shapely.linestrings(np.concatenate(places), indices=owner), {"closed": closed}
            del whole, walks, places
        del contour


def _bands(
    contours: Iterable[Curve], _: str | None, valid: NDArray[np.bool_] | None, __: Any
) -> Iterator[tuple[Curve, NDArray[Any], dict[str, Any]]]:
    """Make the geometries of all bands."""
    whole = list(contours)
    lower, upper, shapes = zip(*band_areas(whole, valid), strict=True)
    columns = {"lower": np.array(lower, float), "upper": np.array(upper, float)}
    yield whole[0], np.array(shapes, object), columns
