"""Triangulated surfaces on the command line: into an .iso file, and out of it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..limits import Limits
from .quiet import written
from .report import concerning, tell, warn, write_output

if TYPE_CHECKING:
    from ..io.readers.place import Place
    from ..io.readers.read import Field


def encode_surface(
    output: Path, points: Field, values: Field | None, place: Place, options: dict[str, Any], as_json: bool
) -> None:
    """Encode a surface and say how well it came out."""
    import json

    import numpy as np

    import isocodec

    from ..field.placement import CRS, PLACEMENT

    started = time.perf_counter()
    notes: dict[str, str] = {}
    if place.placement is not None:
        notes[PLACEMENT] = json.dumps(place.placement.tolist())
    if place.crs is not None:
        notes[CRS] = place.crs
    data = isocodec.encode_tin(points, values, metadata=notes, **options)
    seconds = time.perf_counter() - started
    tin = isocodec.decode_tin(data)
    record = {
        "output": str(output), "bytes": len(data), "points": len(tin.points), "triangles": len(tin.triangles),
        "seconds": round(seconds, 3),
    }
    text = ""
    if tin.shape is not None:
        missed = tin.raster() - points
        record |= {"error": float(np.abs(missed).max()), "rms": float(np.sqrt((missed**2).mean()))}
        text = f", largest error {record['error']:g}, in the mean {record['rms']:.4g}"
    write_output(output, data)
    tell(
        f"{click.format_filename(output)}: {len(data):,} bytes, {len(tin.points):,} points{text}, {seconds:.2f} s",
        record, as_json,
    )


def decode_surface(
    source: Path, data: bytes, output: Path, named: Path, max_bytes: int | None, in_samples: bool, partial: bool,
    limits: Limits, as_json: bool, isovalue: float | None,
) -> None:
    """Write the surface of a file, a contour of it, or the picture that it makes.

    ``named`` has the suffix that names the format.
    """
    import isocodec

    from ..api.tin_api import contour_of
    from ..io.writers.output_formats import OutputOptions
    from ..io.writers.things import Thing
    from ..io.writers.write import check

    with concerning(output):
        suffix, _ = check(named, Thing("tin" if isovalue is None else "contour", 2))
    started = time.perf_counter()
    with concerning(source):
        tin = isocodec.decode_tin(data, max_bytes=len(data) if partial and max_bytes is None else max_bytes,
                                  limits=limits)
    what: Any = tin if isovalue is None else contour_of(tin, isovalue)
    pieces = len(tin.triangles) if isovalue is None else len(what.cells)
    record = {"triangles": pieces} if isovalue is None else {"cells": pieces, "isovalues": [isovalue]}
    with concerning(output):
        done = written(output, what, OutputOptions(in_samples=in_samples, to=suffix))
    for remark in done.remarks:
        warn(source, remark)
    points = len(what.points)
    seconds = time.perf_counter() - started
    tell(
        f"{click.format_filename(output)}: {points:,} points, {pieces:,} "
        f"{'triangles' if isovalue is None else 'segments'}, {seconds:.2f} s",
        {
            "output": str(output), "bytes": done.bytes, "points": points, **record, "complete": tin.complete,
            "seconds": round(seconds, 3),
        },
        as_json,
    )
