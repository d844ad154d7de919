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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.contour import Contour
from ...drawing.line_table import table_of
from ...extras import optional

VECTOR_SUFFIXES = (".gpkg", ".fgb", ".shp", ".parquet")
LAYER = {False: "isolines", True: "areas"}
"""Names of layers of lines and of areas."""
_DRIVERS = {".gpkg": "GPKG", ".fgb": "FlatGeobuf", ".shp": "ESRI Shapefile"}
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


def render_table(
    contours: Iterable[Contour], suffix: str, side: str | None = None, valid: NDArray[np.bool_] | None = None
) -> bytes:
    """The file of such a table; of a Shapefile, which is several, an archive of them (see `unpacked`).

    Raises
    ------
    OptionError, TruncatedError, MissingExtraError
        As `table_of`.
    """
    libraries()
    table = table_of(contours, side, valid)
    layer = LAYER[side is not None]
    if suffix == ".parquet":
        optional("pyarrow", extra="vector", purpose="writing GeoParquet")
        buffer = io.BytesIO()
        table.to_parquet(buffer, index=False)
        return buffer.getvalue()
    pyogrio = optional("pyogrio", extra="vector", purpose="writing maps")
    options = {"DBF_DATE_LAST_UPDATE": _DATE[:10]} if suffix == ".shp" else {}
    kind = "MultiPolygon" if side else "LineString"
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": _DATE})
    try:
        with TemporaryDirectory(prefix="isocodec-") as folder, warnings.catch_warnings():
            # a file without a system is what the caller knows of
            warnings.filterwarnings("ignore", message="'crs' was not provided")
            path = Path(folder) / f"{layer}{suffix}"
            pyogrio.write_dataframe(
                table, path, driver=_DRIVERS[suffix], layer=layer, geometry_type="Polygon" if side and suffix == ".shp"
                else kind, layer_options=options,
            )
            if suffix != ".shp":
                return path.read_bytes()
            packed = io.BytesIO()
            with zipfile.ZipFile(packed, "w") as archive:
                for part in sorted(Path(folder).iterdir()):
                    archive.writestr(zipfile.ZipInfo(part.suffix), part.read_bytes())
            return packed.getvalue()
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})


def unpacked(path: Path, data: bytes) -> list[tuple[Path, bytes]]:
    """The files of a Shapefile at ``path``, the one of that name last."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = [(path.with_suffix(name), archive.read(name)) for name in archive.namelist() if name != ".shp"]
        return [*parts, (path, archive.read(".shp"))]
