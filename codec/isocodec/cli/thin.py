"""``isocodec thin``: a terrain, picture or table of points in, a triangulation of the points that matter out."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import InputError
from ..limits import FIELD_SAMPLES, in_units
from ..stream.names import ThinningName
from .options import json_option, output_option
from .progress import progress_bar
from .quiet import one_warning
from .report import check_output, concerning, tell, warn

if TYPE_CHECKING:
    from ..io.readers.read import Field

CRITERIA = ("AT1", "AT2", "AT3", "inf", "l2", "NAT")
_MUCH = 1 << 30
"""Bytes of memory that are worth a warning."""


@click.command("thin", short_help="Thin a terrain, picture or table of points to a triangulation.")
@click.argument("source", metavar="INPUT", type=click.Path(path_type=Path, readable=False))
@output_option("OUT")
@click.option("--points", "to", type=click.IntRange(min=3), metavar="N", help="Keep N points.")
@click.option("--error", type=float, metavar="E", help="Keep as few as miss no value by more than E.")
@click.option("--bytes", "size", type=click.IntRange(min=1), metavar="N", help="OUT.iso: at most N bytes.")
@click.option("--isovalue", "isovalues", type=float, multiple=True, metavar="V",
              help="OUT.iso: keep the contour of V, and little else. Repeatable.")
@click.option("--tolerance", type=float, metavar="D", help="With --isovalue: samples that contours may be off.")
@click.option("--layers", type=click.IntRange(min=1), default=1, metavar="N", help="OUT.iso: points in N layers.")
@click.option(
    "--criterion", type=click.Choice(CRITERIA),
    help="Which point matters least: by its star's largest error (AT1), at the point alone (AT2, AT3), over all points "
    "(inf), by squared errors (l2), by distance (NAT).  [default: AT1]",
)
@click.option("--scattered", is_flag=True, help="INPUT is a table of points: rows of x, y, value.")
@click.option("--key", metavar="NAME", help="Array of an .npz or HDF5 file; values of points.  [z]")
@click.option("--channel", type=int, metavar="N", help="Channel of a colour picture, counted from 0.")
@click.option("--frame", type=int, metavar="N", help="Item of a series or time step, counted from 0.")
@click.option(
    "--limit-samples", type=click.IntRange(min=1), metavar="N", help=f"Most samples.  [default: {FIELD_SAMPLES:,}]"
)
@json_option
def thin_command(
    source: Path, output: Path, to: int | None, error: float | None, size: int | None,
    isovalues: tuple[float, ...], tolerance: float | None, layers: int, criterion: ThinningName | None, scattered: bool,
    key: str | None, channel: int | None, frame: int | None, limit_samples: int | None, as_json: bool,
) -> None:
    """Take the points that matter least out of INPUT one by one; write the Delaunay triangulation of the others.

    \b
    .npz       points, values, triangles; the order of removal and the error after each one
    .ply       a surface, its height the value
    .vtu       the same for tools of simulation
    .geojson   a polygon with heights for each triangle
    .iso       points and values in few bytes; decode makes the others of it

    INPUT is a picture, a terrain or any array of two axes that encode reads; or points: .csv, .xyz, .las, .laz, .gpkg.
    """
    coded = output.suffix.lower() == ".iso"
    if sum(each is not None for each in (to, error, size, isovalues or None)) != 1:
        raise click.UsageError("give exactly one of --points, --error, --bytes and --isovalue")
    if bool(isovalues) != (tolerance is not None):
        raise click.UsageError("--isovalue and --tolerance go together")
    if not coded and (size is not None or layers > 1 or isovalues):
        raise click.UsageError("--bytes, --layers and --isovalue are for an OUT that ends in .iso")
    if coded and criterion is not None:
        raise click.UsageError("--criterion: a coded surface has its own, AT1 with --error, l2 otherwise")
    from ..io.writers.things import PlacedTin, Thing
    from ..io.writers.write import check, write

    with concerning(output):
        if not coded:
            check(output, Thing("tin", 2, sampled=False))
    check_output(output, source)

    import numpy as np

    import isocodec

    from ..field.placement import unplaced
    from ..io.readers.missing import missing_samples, read_nodata
    from ..io.readers.place import Place, read_place
    from ..io.readers.points_read import POINTS, read_points
    from ..io.readers.read import read_field
    from ..tin.thinned import MEMORY

    place = Place()
    with concerning(source):
        with one_warning(source):
            if source.suffix.lower() in POINTS:
                points = read_points(source, limit_samples)
                field, scattered = np.column_stack([points.points, points.values_named(key or "z")]), True
            else:
                field = read_field(source, key=key, channel=channel, frame=frame, samples=limit_samples)
            if field.ndim == 2 and not scattered:
                place = read_place(source, 2, key, samples=limit_samples)
                gone = missing_samples(field, read_nodata(source, key))
        if scattered and (field.ndim != 2 or field.shape[1] != 3):
            raise InputError(f"the table has shape {field.shape}, needed are rows of x, y, value", code="shape")
        values: Field | None = None
        given = field
        if place.remark:
            warn(source, place.remark)
        if not scattered and field.ndim == 2 and gone.any():
            given, values = np.argwhere(~gone), field[~gone]
            warn(source, f"{int(gone.sum()):,} missing samples: the triangulation spans them")
        elif scattered:
            given, values = field[:, :2], field[:, 2]
        needed = MEMORY * (field.size if not scattered else len(field))
        if needed > _MUCH:
            warn(source, f"thinning may take {in_units(needed)} of memory")
        started = time.perf_counter()
        if coded:
            from .tin import encode_surface

            options = {
                "error": error, "to": to, "size": size, "contours": list(isovalues) or None, "tolerance": tolerance,
                "layers": layers,
            }
            encode_surface(output, given, values, place, options, as_json)
            return
        with progress_bar("thinning") as progress:
            found = isocodec.thin(given, values, criterion or "AT1", to=to, error=error, progress=progress)
            tin = found.tin()
        seconds = time.perf_counter() - started
    if found.merged:
        warn(source, f"{found.merged:,} points coincide with others: merged, with the mean of their values")
    largest = float(found.errors[-1]) if len(found.errors) else 0.0
    matrix = np.eye(2, 3) if scattered else unplaced(2) if place.placement is None else place.placement
    notes = {"order": found.order, "errors": found.errors, "anticipated": found.anticipated, "kept": found.kept}
    with concerning(output), one_warning(output, "writing"):
        written = write(output, PlacedTin(tin, matrix, place.crs or "", notes))
    tell(
        f"{click.format_filename(output)}: {len(found):,} of {len(found) + len(found.order):,} points, "
        f"{len(tin.triangles):,} triangles, largest error {largest:g}, {seconds:.2f} s",
        {
            "output": str(output), "bytes": written.bytes, "points": len(found), "triangles": len(tin.triangles),
            "removed": len(found.order), "merged": found.merged, "error": largest, "criterion": criterion or "AT1",
            "seconds": round(seconds, 3),
        },
        as_json,
    )
