"""Triangulated surfaces on the command line: into an .iso file, and out of it."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..limits import Limits
from .places import Places, warn_of_places
from .quiet import one_warning
from .report import concerning, tell, write_output

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..field.placement import Placement
    from ..tin.tin import Tin

PICTURE = ".npy"
"""Suffix of the picture that a surface makes."""


def encode_surface(
    output: Path, points: NDArray[Any], values: NDArray[Any] | None, place: Placement, options: dict[str, Any],
    as_json: bool,
) -> None:
    """Encode a surface and say how well it came out."""
    import json

    import numpy as np

    import isocodec

    from ..field.placement import CRS, PLACEMENT

    started = time.perf_counter()
    notes: dict[str, str] = {}
    if place.matrix is not None:
        notes[PLACEMENT] = json.dumps(place.matrix.tolist())
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
    from ..io.writers.tin_files import check_tin
    from ..io.writers.write import check_libraries, check_suffix, render_contour
    from .on_mesh import check_on_mesh

    with concerning(output):
        if isovalue is not None:
            suffix = check_suffix(named, 2)
            check_libraries(suffix)
        else:
            suffix = named.suffix.lower() if named.suffix.lower() == PICTURE else check_tin(named)
    started = time.perf_counter()
    with concerning(source):
        tin = isocodec.decode_tin(data, max_bytes=len(data) if partial and max_bytes is None else max_bytes,
                                  limits=limits)
    places = Places()
    with concerning(source if suffix == PICTURE else output):
        if isovalue is None:
            with one_warning(output, "writing"):
                written = _rendered(tin, suffix, in_samples)
            record: dict[str, Any] = {"triangles": len(tin.triangles)}
            points, pieces = len(tin.points), len(tin.triangles)
        else:
            if tin.shape is None:
                check_on_mesh(suffix)
            contour = contour_of(tin, isovalue)
            contour = replace(contour, placement=None) if in_samples else contour
            with one_warning(output, "writing"):
                written = render_contour([contour], suffix, 2)
            places.see(contour)
            points, pieces = len(contour.points), len(contour.cells)
            record = {"cells": pieces, "isovalues": [isovalue]}
    warn_of_places(source, suffix, places, False, in_samples)
    write_output(output, written)
    seconds = time.perf_counter() - started
    tell(
        f"{click.format_filename(output)}: {points:,} points, {pieces:,} "
        f"{'triangles' if isovalue is None else 'segments'}, {seconds:.2f} s",
        {
            "output": str(output), "bytes": len(written), "points": points, **record, "complete": tin.complete,
            "seconds": round(seconds, 3),
        },
        as_json,
    )


def _rendered(tin: Tin, suffix: str, in_samples: bool) -> bytes:
    """A surface as a file, or the picture that it makes."""
    import io

    import numpy as np

    from ..field.placement import CRS, Placement, read_placement, unplaced
    from ..io.writers.tin_files import PlacedTin, render_tin

    if suffix == PICTURE:
        buffer = io.BytesIO()
        np.save(buffer, tin.raster())
        return buffer.getvalue()
    found = None if in_samples else read_placement(dict(tin.metadata), 2)
    if found is None:
        found = Placement(np.eye(2, 3) if tin.shape is None else unplaced(2), crs=tin.metadata.get(CRS))
    return render_tin(PlacedTin(tin, found, {}), suffix)
