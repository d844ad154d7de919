"""Maps of curves and areas for geographic information systems: GeoPackage, FlatGeobuf, Shapefile, GeoParquet.

A line of a contour, or an area, is a row, with its isovalue; coordinates are those of the placement, in its system.
"""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.areas import areas
from ...drawing.bands import bands
from ...errors import OptionError
from ...extras import optional
from ..system import epsg_of
from .output_formats import Cost, Output, OutputOptions
from .things import Areas

if TYPE_CHECKING:
    from ...drawing.contour import Contour

SHAPEFILE = ".shp"
_DRIVERS = {".gpkg": "GPKG", ".fgb": "FlatGeobuf", SHAPEFILE: "ESRI Shapefile"}
_DATE = "2000-01-01T00:00:00.000Z"
"""What a GeoPackage says of when it was written: the same input gives the same bytes."""


def libraries() -> Any:
    """geopandas.

    Raises
    ------
    MissingExtraError
    """
    optional("pyogrio", extra="vector", purpose="writing maps")
    return optional("geopandas", extra="vector", purpose="making tables of lines")


def table_of(
    contours: Iterable[Contour], side: str | None = None, valid: NDArray[np.bool_] | None = None
) -> Any:
    """A ``GeoDataFrame`` with a row for each line, or with ``side`` for the areas of each isovalue (above, below) or
    for those between them (bands).

    Columns are ``isovalue``, ``closed`` of lines, ``side`` of areas, ``complete`` and ``geometry``; of bands ``lower``,
    ``upper`` and ``geometry``. An isocontour of the plane has lines; the system is that of the file if it names an EPSG
    number.

    Raises
    ------
    OptionError
        For an isosurface; TruncatedError and others as `areas`.
    MissingExtraError
        If geopandas or shapely are not installed.
    """
    geopandas = libraries()
    shapely = optional("shapely", extra="geo", purpose="making tables of lines")
    if side == "bands":
        return _table_of_bands(list(contours), valid, geopandas, shapely)
    columns: dict[str, list[Any]] = {"isovalue": [], "side" if side else "closed": [], "complete": []}
    shapes: list[Any] = []
    system: str | None = None
    for contour in contours:
        if contour.n != 2:
            raise OptionError("only an isocontour (n = 2) has lines for a map", code="dimension")
        if side is not None:
            parts = [shapely.geometry.shape(areas(contour, above=side == "above", valid=valid))]
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
        number = epsg_of(contour)
        system = None if number is None else f"EPSG:{number}"
        del contour
    return geopandas.GeoDataFrame(columns, geometry=shapes, crs=system)


def _table_of_bands(
    contours: list[Contour], valid: NDArray[np.bool_] | None, geopandas: Any, shapely: Any
) -> Any:
    found = bands(contours, valid=valid)
    number = epsg_of(contours[0])
    columns = {
        "lower": np.array([band.lower for band in found], float),
        "upper": np.array([band.upper for band in found], float),
    }
    shapes = [shapely.geometry.shape(band.geometry) for band in found]
    return geopandas.GeoDataFrame(columns, geometry=shapes, crs=None if number is None else f"EPSG:{number}")


def _render(contours: Iterable[Contour], suffix: str, _: OutputOptions) -> bytes:
    return _file(table_of(contours), suffix, "LineString", "isolines")


def _render_areas(what: Areas, suffix: str, _: OutputOptions) -> bytes:
    shape = "Polygon" if suffix == SHAPEFILE else "MultiPolygon"
    return _file(table_of(what.contours, what.side, what.valid), suffix, shape, "areas")


def _file(table: Any, suffix: str, shape: str, layer: str) -> bytes:
    """The file of a table; of a Shapefile, which is several, an archive of them (see `_unpacked`)."""
    if suffix not in _DRIVERS:
        buffer = io.BytesIO()
        table.to_parquet(buffer, index=False)
        return buffer.getvalue()
    pyogrio = optional("pyogrio", extra="vector", purpose=f"writing {suffix}")
    options = {"DBF_DATE_LAST_UPDATE": _DATE[:10]} if suffix == SHAPEFILE else {}
    if _DRIVERS[suffix] == "FlatGeobuf" and table.geometry.is_empty.any():
        options = {"SPATIAL_INDEX": "NO"}  # it cannot have one of what lies nowhere
    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": _DATE})
    try:
        with TemporaryDirectory(prefix="isocodec-") as folder, warnings.catch_warnings():
            # a file without a system is what the caller knows of
            warnings.filterwarnings("ignore", message="'crs' was not provided")
            path = Path(folder) / f"{layer}{suffix}"
            pyogrio.write_dataframe(
                table, path, driver=_DRIVERS[suffix], layer=layer, geometry_type=shape, layer_options=options,
            )
            if suffix != SHAPEFILE:
                return path.read_bytes()
            packed = io.BytesIO()
            with zipfile.ZipFile(packed, "w") as archive:
                for part in sorted(Path(folder).iterdir()):
                    archive.writestr(zipfile.ZipInfo(part.suffix), part.read_bytes())
            return packed.getvalue()
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": before})


def _unpacked(path: Path, data: bytes) -> list[tuple[Path, bytes]]:
    """The files of a Shapefile at ``path``, the one of that name last."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = [(path.with_suffix(name), archive.read(name)) for name in archive.namelist() if name != SHAPEFILE]
        return [*parts, (path, archive.read(SHAPEFILE))]


def _outputs(suffixes: tuple[str, ...], title: str, *libraries: str, parts: Any = None) -> tuple[Output, Output]:
    shared: Any = {
        "dimensions": (2,), "several": (2,), "holds": "a column", "names_crs": True, "extra": "vector",
        "libraries": ("pyogrio", "geopandas", "shapely", *libraries), "parts": parts,
    }
    return (
        Output("contour", suffixes, title, _render, cost={2: Cost(160, 100)}, **shared),
        Output("areas", suffixes, title, _render_areas, cost={2: Cost(300, 240, kept=100)}, **shared),
    )


OUTPUTS = (
    *_outputs((".gpkg",), "GeoPackage"), *_outputs((".fgb",), "FlatGeobuf"),
    *_outputs((SHAPEFILE,), "Shapefile", parts=_unpacked), *_outputs((".parquet",), "GeoParquet", "pyarrow"),
)
