"""Triangulated surfaces on the command line: into an .iso file, and out of it."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..limits import Limits
from .report import concerning, tell, write_output

if TYPE_CHECKING:
    from ..io.place import Place
    from ..io.read import Field


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
    }  # fmt: skip
    text = ""
    if tin.shape is not None:
        missed = tin.raster() - points
        record |= {"error": float(np.abs(missed).max()), "rms": float(np.sqrt((missed**2).mean()))}
        text = f", largest error {record['error']:g}, in the mean {record['rms']:.4g}"
    write_output(output, data)
    tell(
        f"{click.format_filename(output)}: {len(data):,} bytes, {len(tin.points):,} points{text}, {seconds:.2f} s",
        record, as_json,
    )  # fmt: skip


def decode_surface(
    source: Path, data: bytes, output: Path, named: Path, max_bytes: int | None, in_samples: bool, partial: bool,
    limits: Limits, as_json: bool, isovalue: float | None = None,
) -> None:  # fmt: skip
    """Write the surface of a file, its contour, or the picture that it makes; ``named`` has the format's suffix."""
    if isovalue is not None:
        return _contour(source, data, output, named, isovalue, max_bytes, in_samples, limits, as_json)
    import io

    import numpy as np

    import isocodec

    from ..field.placement import CRS, read_placement, unplaced
    from ..io.tin import PlacedTin, check_tin, render_tin

    picture = named.suffix.lower() == ".npy"
    with concerning(output):
        suffix = ".npy" if picture else check_tin(named)
    started = time.perf_counter()
    with concerning(source):
        tin = isocodec.decode_tin(data, max_bytes=len(data) if partial and max_bytes is None else max_bytes,
                                  limits=limits)  # fmt: skip
        if picture:
            buffer = io.BytesIO()
            np.save(buffer, tin.raster())
            written = buffer.getvalue()
    if not picture:
        found = None if in_samples else read_placement(dict(tin.metadata), 2)
        matrix = found if found is not None else np.eye(2, 3) if tin.shape is None else unplaced(2)
        with concerning(output):
            written = render_tin(PlacedTin(tin, matrix, tin.metadata.get(CRS, ""), {}), suffix)
    write_output(output, written)
    seconds = time.perf_counter() - started
    tell(
        f"{click.format_filename(output)}: {len(tin.points):,} points, {len(tin.triangles):,} triangles, "
        f"{seconds:.2f} s",
        {
            "output": str(output), "bytes": len(written), "points": len(tin.points), "triangles": len(tin.triangles),
            "complete": tin.complete, "seconds": round(seconds, 3),
        },
        as_json,
    )  # fmt: skip


def _contour(
    source: Path, data: bytes, output: Path, named: Path, isovalue: float, max_bytes: int | None, in_samples: bool,
    limits: Limits, as_json: bool,
) -> None:  # fmt: skip
    """Write a contour of the surface of a file."""
    import isocodec

    from ..io.write import check_libraries, check_suffix, render_contour
    from .on_mesh import check_on_mesh

    with concerning(output):
        suffix = check_suffix(named, 2)
        check_libraries(suffix)
    started = time.perf_counter()
    with concerning(source):
        contour = isocodec.decode(data, isovalue=isovalue, max_bytes=max_bytes, limits=limits)
        if in_samples:
            contour = replace(contour, placement=None)
    with concerning(output):
        if not contour.shape:
            check_on_mesh(suffix)
        rendered = render_contour([contour], suffix, 2)
    write_output(output, rendered)
    seconds = time.perf_counter() - started
    tell(
        f"{click.format_filename(output)}: {len(contour.points):,} points, {len(contour.cells):,} segments, "
        f"{seconds:.2f} s",
        {
            "output": str(output), "bytes": len(rendered), "points": len(contour.points), "cells": len(contour.cells),
            "isovalues": [isovalue], "complete": contour.complete, "seconds": round(seconds, 3),
        },
        as_json,
    )  # fmt: skip
