"""Curves and areas for geographic information systems: GeoPackage, FlatGeobuf, Shapefile, GeoParquet.

Each line of a contour, or each area, is a row with its isovalue; coordinates are those of the placement.
"""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from ...drawing.line_table import table_of
from ...extras import optional
from .output_formats import Cost, Output, OutputOptions
from .things import Areas

if TYPE_CHECKING:
    from ...drawing.contour import Contour

SHAPEFILE = ".shp"
_DRIVERS = {".gpkg": "GPKG", ".fgb": "FlatGeobuf", SHAPEFILE: "ESRI Shapefile"}
_DATE = "2000-01-01T00:00:00.000Z"
"""Fixed time of writing in a GeoPackage, so that equal input gives equal bytes."""


def _render(contours: Iterable[Contour], suffix: str, _: OutputOptions) -> bytes:
    return _file(table_of(contours), suffix, "LineString", "isolines")


def _render_areas(what: Areas, suffix: str, _: OutputOptions) -> bytes:
    shape = "Polygon" if suffix == SHAPEFILE else "MultiPolygon"
    return _file(table_of(what.contours, what.side, what.valid), suffix, shape, "areas")


def _file(table: Any, suffix: str, shape: str, layer: str) -> bytes:
    """Write the file of a table; for a Shapefile, an archive of its several files (see `_unpacked`)."""
    if suffix not in _DRIVERS:
        buffer = io.BytesIO()
        table.to_parquet(buffer, index=False)
        return buffer.getvalue()
    pyogrio = optional("pyogrio", extra="vector", purpose=f"writing {suffix}")
    options = {"DBF_DATE_LAST_UPDATE": _DATE[:10]} if suffix == SHAPEFILE else {}
    if _DRIVERS[suffix] == "FlatGeobuf" and table.geometry.is_empty.any():
        options = {"SPATIAL_INDEX": "NO"}  # it cannot have one of what lies nowhere
    # on a plane in space
    shape += " Z" * bool(table.geometry.has_z.any())
    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": _DATE})
    try:
        with TemporaryDirectory(prefix="isocodec-") as folder, warnings.catch_warnings():
            # the caller knows that the file has no reference system
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
    """Unpack the files of a Shapefile at ``path``, the file with that name last."""
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
