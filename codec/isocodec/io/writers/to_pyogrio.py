"""Curves and areas for geographic information systems: GeoPackage, FlatGeobuf, Shapefile, GeoParquet.

Each line of a contour, or each area, is a row with its isovalue; coordinates are those of the placement.
"""

from __future__ import annotations

import errno
import io
import os
import warnings
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from ...drawing.line_table import Rows, rows_of
from ...errors import InputError, OptionError, one_line
from ...extras import without
from ...field.placement import Placement
from ...field.reference_system import epsg_of, system_of
from .output_formats import Cost, Output, OutputOptions
from .things import Areas, library_files

if TYPE_CHECKING:
    from ...drawing.contour import Contour

SHAPEFILE, _GEOPACKAGE, _FLAT = ".shp", ".gpkg", ".fgb"
_DRIVERS = {_GEOPACKAGE: "GPKG", _FLAT: "FlatGeobuf", SHAPEFILE: "ESRI Shapefile"}
_LINES, _AREAS = "isolines", "areas"
_PIECE = 1 << 22
_DATE = "2000-01-01T00:00:00.000Z"
"""Fixed time of writing in a GeoPackage, so that equal input gives equal bytes."""


def _render(contours: Iterable[Contour], suffix: str, options: OutputOptions) -> Iterator[bytes]:
    rows = rows_of(contours, attribute=options.attribute, index=options.index)
    return _file(rows, suffix, "LineString", options.layer or _LINES, options)


def _render_areas(what: Areas, suffix: str, options: OutputOptions) -> Iterator[bytes]:
    shape = "Polygon" if suffix == SHAPEFILE else "MultiPolygon"
    rows = rows_of(what.contours, what.side, what.valid, options.attribute, options.index)
    return _file(rows, suffix, shape, options.layer or _AREAS, options)


def _file(rows: Rows, suffix: str, shape: str, layer: str, options: OutputOptions) -> Iterator[bytes]:
    """Yield the file of some rows; for a Shapefile, an archive of its several files (see `_unpacked`)."""
    if suffix not in _DRIVERS:
        buffer = io.BytesIO()
        rows.table.to_parquet(buffer, index=False)
        yield buffer.getvalue()
        return
    more = {"DBF_DATE_LAST_UPDATE": _DATE[:10]} if suffix == SHAPEFILE else {}
    if _DRIVERS[suffix] == "FlatGeobuf" and rows.has_empty:
        more = {"SPATIAL_INDEX": "NO"}  # it cannot have one of what lies nowhere
    if suffix == SHAPEFILE:
        _check_numbers(rows)
    with library_files(suffix) as folder, warnings.catch_warnings():
        # the caller knows that the file has no reference system
        warnings.filterwarnings("ignore", message="'crs' was not provided")
        path = folder / f"{layer if suffix == SHAPEFILE else 'a'}{suffix}"
        if options.onto is not None:
            layer = _copied(options.onto, path, layer)
        # the library does not see that a disk is full when it closes a FlatGeobuf
        target: Any = io.BytesIO() if suffix == _FLAT else path
        with _dated() as pyogrio:
            pyogrio.raw.write(
                target, rows.shapes, [*rows.columns.values()], [*rows.columns], driver=_DRIVERS[suffix], layer=layer,
                # on a plane in space
                geometry_type=shape + " Z" * rows.has_z, layer_options=more, crs=_system(rows.placement),
            )
        if suffix == _FLAT:
            yield target.getvalue()
            return
        if suffix == SHAPEFILE:
            _check_whole(folder)
            from zipfile import ZipFile, ZipInfo

            packed = io.BytesIO()
            with ZipFile(packed, "w") as archive:
                for part in sorted(folder.iterdir()):
                    archive.writestr(ZipInfo(part.suffix), part.read_bytes())
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
def _dated() -> Iterator[Any]:
    """The library, which writes a fixed date, without what it loads to make tables."""
    heavy = ("geopandas", "pandas", "pyarrow", "pyproj")
    pyogrio = without("pyogrio", heavy, extra="vector", purpose="writing maps")
    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": _DATE})
    try:
        yield pyogrio
    except pyogrio.errors.CRSError as exc:
        raise OptionError(f"the reference system is unknown to GDAL, which writes maps: {one_line(str(exc))}",
                          code="crs", remedy="write .geojson, which has longitude and latitude") from exc
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": before})


def _copied(path: Path, to: Path, layer: str) -> str:
    """Copy a GeoPackage, to add or replace a layer of vectors; returns its name.

    Names are the same in capitals.

    Raises
    ------
    InputError
        If it is none, has something else by the name of the layer, or another program has it open: what that writes to
        its log would otherwise be lost, or harm the new file.
    """
    import sqlite3

    real = os.path.realpath(path)
    if any(os.path.exists(real + log) for log in ("-wal", "-journal")):
        raise InputError(f"another program has {path} open", code="open",
                         remedy="close it there, or write to another name")
    try:
        with closing(sqlite3.connect(f"file:{quote(real)}?immutable=1", uri=True)) as old:
            with closing(sqlite3.connect(to)) as new:
                old.backup(new)
                new.execute("pragma journal_mode=delete")
            kinds = dict(old.execute("select table_name, data_type from gpkg_contents"))
            tables = {name.lower(): name for name, in old.execute("select name from sqlite_master")}
    except sqlite3.DatabaseError as exc:
        raise InputError(f"{path} exists, and no layer can be added to it: {exc}", code="geopackage",
                         remedy="write to another name, or delete it") from exc
    found = tables.get(layer.lower(), layer)
    if found in tables.values() and kinds.get(found) != "features":
        raise InputError(f"{path} has a table {layer!r} that is not a layer of vectors", code="layer",
                         remedy="choose another --layer")
    return found


def _check_whole(folder: Path) -> None:
    """Check the lengths that headers of a Shapefile state: the library does not see that a disk is full at the end."""
    for part in folder.iterdir():
        data = part.read_bytes()
        count, head, row = (int.from_bytes(data[a:b], "little") for a, b in ((4, 8), (8, 10), (10, 12)))
        stated = {SHAPEFILE: 2 * int.from_bytes(data[24:28], "big"), ".shx": 2 * int.from_bytes(data[24:28], "big"),
                  ".dbf": head + count * row}
        if len(data) < stated.get(part.suffix, 0):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(part))


def _check_numbers(rows: Rows) -> None:
    """Warn of numbers that a Shapefile, which has 15 decimals, does not keep."""
    for name, column in rows.columns.items():
        numbers = np.unique(column[np.isfinite(column)]).tolist() if column.dtype.kind == "f" else []
        if lost := [repr(number) for number in numbers if abs(float(f"{number:.15f}") - number) > abs(number) * 1e-9]:
            warnings.warn(f"a Shapefile does not keep the {name} {', '.join(lost)}: its numbers have 15 decimals",
                          stacklevel=2)


def _unpacked(path: Path, data: bytes) -> list[tuple[Path, bytes]]:
    """Unpack the files of a Shapefile at ``path``, the file with that name last."""
    from zipfile import ZipFile

    with ZipFile(io.BytesIO(data)) as archive:
        parts = [(path.with_suffix(name), archive.read(name)) for name in archive.namelist() if name != SHAPEFILE]
        return [*parts, (path, archive.read(SHAPEFILE))]


def _outputs(suffix: str, title: str, *libraries: str, **more: Any) -> tuple[Output, Output]:
    shared: Any = {
        "suffixes": (suffix,), "title": title, "several": (2,), "holds": "a column", "names_crs": True,
        "extra": "vector", "libraries": ("shapely", *(libraries or ["pyogrio"])), **more,
    }
    lines, areas = (_LINES, _AREAS) if suffix in (_GEOPACKAGE, _FLAT) else ("", "")
    return (
        Output("contour", render=_render, cost={2: Cost(160, 100, kept=60)}, layer=lines, **shared),
        Output("areas", render=_render_areas, cost={2: Cost(300, 240, kept=100)}, layer=areas, **shared),
    )


OUTPUTS = (
    *_outputs(_GEOPACKAGE, "GeoPackage", keeps=True), *_outputs(_FLAT, "FlatGeobuf"),
    *_outputs(SHAPEFILE, "Shapefile", parts=_unpacked), *_outputs(".parquet", "GeoParquet", "geopandas", "pyarrow"),
)
