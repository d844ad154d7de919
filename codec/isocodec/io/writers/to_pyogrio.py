"""Curves and areas for geographic information systems: GeoPackage, FlatGeobuf, Shapefile, GeoParquet.

Each line of a contour, or each area, is a row with its isovalue; coordinates are those of the placement.
"""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from ...drawing.line_table import Rows, rows_of
from ...errors import OptionError, one_line
from ...extras import without
from ...field.placement import Placement
from ...field.reference_system import epsg_of, system_of
from .output_formats import Cost, Output, OutputOptions
from .things import Areas

if TYPE_CHECKING:
    from ...drawing.contour import Contour

SHAPEFILE = ".shp"
_DRIVERS = {".gpkg": "GPKG", ".fgb": "FlatGeobuf", SHAPEFILE: "ESRI Shapefile"}
_DATE = "2000-01-01T00:00:00.000Z"
"""Fixed time of writing in a GeoPackage, so that equal input gives equal bytes."""
_LINES, _AREAS = "isolines", "areas"
_PIECE = 1 << 20
"""Bytes of a file that are handed on at once."""


def _render(contours: Iterable[Contour], suffix: str, options: OutputOptions) -> Iterator[bytes]:
    rows = rows_of(contours, attribute=options.attribute, index=options.index)
    return _file(rows, suffix, "LineString", options.layer or _LINES)


def _render_areas(what: Areas, suffix: str, options: OutputOptions) -> Iterator[bytes]:
    shape = "Polygon" if suffix == SHAPEFILE else "MultiPolygon"
    rows = rows_of(what.contours, what.side, what.valid, options.attribute, options.index)
    return _file(rows, suffix, shape, options.layer or _AREAS)


def _file(rows: Rows, suffix: str, shape: str, layer: str) -> Iterator[bytes]:
    """Write the file of some rows, and yield it; for a Shapefile, an archive of its several files (see `_unpacked`)."""
    if suffix not in _DRIVERS:
        buffer = io.BytesIO()
        rows.table.to_parquet(buffer, index=False)
        yield buffer.getvalue()
        return
    options = {"DBF_DATE_LAST_UPDATE": _DATE[:10]} if suffix == SHAPEFILE else {}
    if _DRIVERS[suffix] == "FlatGeobuf" and rows.has_empty:
        options = {"SPATIAL_INDEX": "NO"}  # it cannot have one of what lies nowhere
    with TemporaryDirectory(prefix="isocodec-") as folder:
        path = Path(folder) / f"{layer}{suffix}"
        with _pyogrio(suffix) as raw, warnings.catch_warnings():
            # the caller knows that the file has no reference system
            warnings.filterwarnings("ignore", message="'crs' was not provided")
            raw.write(
                path, rows.shapes, [*rows.columns.values()], [*rows.columns], driver=_DRIVERS[suffix], layer=layer,
                # on a plane in space
                geometry_type=shape + " Z" * rows.has_z, layer_options=options,
                crs=_system(rows.placement),
            )
        if suffix == SHAPEFILE:
            packed = io.BytesIO()
            with zipfile.ZipFile(packed, "w") as archive:
                for part in sorted(Path(folder).iterdir()):
                    archive.writestr(zipfile.ZipInfo(part.suffix), part.read_bytes())
            yield packed.getvalue()
            return
        with path.open("rb") as file:
            while piece := file.read(_PIECE):
                yield piece


def _system(placement: Placement | None) -> str | None:
    """The reference system of coordinates as GDAL takes it."""
    if (number := epsg_of(placement)) is not None:
        return f"EPSG:{number}"
    system = system_of(placement)
    return None if system is None else str(system.to_wkt("WKT1_GDAL"))


@contextmanager
def _pyogrio(suffix: str) -> Iterator[Any]:
    """Yield ``pyogrio.raw``, which writes arrays, while the time of writing is fixed."""
    heavy = ("geopandas", "pandas", "pyarrow", "pyproj")
    pyogrio = without("pyogrio", heavy, extra="vector", purpose=f"writing {suffix}")
    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": _DATE})
    try:
        yield pyogrio.raw
    except pyogrio.errors.CRSError as exc:
        raise OptionError(f"the reference system is unknown to GDAL, which writes {suffix}: {one_line(str(exc))}",
                          code="crs", remedy="write .geojson with --keep-crs") from exc
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": before})


def _unpacked(path: Path, data: bytes) -> list[tuple[Path, bytes]]:
    """Unpack the files of a Shapefile at ``path``, the file with that name last."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = [(path.with_suffix(name), archive.read(name)) for name in archive.namelist() if name != SHAPEFILE]
        return [*parts, (path, archive.read(SHAPEFILE))]


def _outputs(suffixes: tuple[str, ...], title: str, *libraries: str, parts: Any = None) -> tuple[Output, Output]:
    shared: Any = {
        "dimensions": (2,), "several": (2,), "holds": "a column", "names_crs": True, "extra": "vector",
        "libraries": ("shapely", *(libraries or ["pyogrio"])), "parts": parts,
    }
    lines, areas = (_LINES, _AREAS) if suffixes[0] in (".gpkg", ".fgb") else ("", "")
    return (
        Output("contour", suffixes, title, _render, cost={2: Cost(160, 100, kept=60)}, layer=lines, **shared),
        Output("areas", suffixes, title, _render_areas, cost={2: Cost(300, 240, kept=100)}, layer=areas, **shared),
    )


OUTPUTS = (
    *_outputs((".gpkg",), "GeoPackage"), *_outputs((".fgb",), "FlatGeobuf"),
    *_outputs((SHAPEFILE,), "Shapefile", parts=_unpacked),
    *_outputs((".parquet",), "GeoParquet", "geopandas", "pyarrow"),
)
