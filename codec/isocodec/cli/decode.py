"""``isocodec decode``: an .iso file in, a curve or surface out, in the formats of other tools."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import click

from ..errors import FormatError
from .options import iso_argument, json_option, output_option, partial_option, smooth_option
from .progress import load_kernels
from .receive import receive, warn_of_others
from .report import check_output, concerning, read_iso, tell, write_output


@click.command("decode", short_help="Decode to a curve, a surface or a picture of it.")
@iso_argument
@output_option("OUT")
@click.option("--isovalue", type=float, metavar="V", help="Which isovalue, of several.  [default: the first]")
@click.option("--layers", type=click.IntRange(min=1), metavar="N", help="Only the first N layers of that isovalue.")
@click.option("--max-bytes", type=click.IntRange(min=1), metavar="N", help="Only the first N bytes.")
@click.option("--in-samples", is_flag=True, help="Coordinates in samples, even if the file says where these lie.")
@click.option(
    "--areas", type=click.Choice(["above", "below"]), help="To .geojson: polygons of what lies above, or does not."
)
@smooth_option
@partial_option
@json_option
def decode_command(
    source: Path, output: Path, isovalue: float | None, layers: int | None, max_bytes: int | None, in_samples: bool,
    areas: str | None, smooth: bool, partial: bool, as_json: bool,
) -> None:  # fmt: skip
    """Decode IN.iso to OUT; the suffix of OUT names the format.

    \b
    Curves and surfaces  .npz (points, cells, isovalue, shape; placement, crs), .png
    Curves               .geojson, .svg (x along axis 1, y along axis 0)
    Surfaces             .ply, .stl, .obj (x, y, z along axes 0, 1, 2)

    Coordinates are samples. Where the file says how these lie in the world (encode keeps what NIfTI and GeoTIFF files
    say, or --spacing), .geojson, .ply, .stl and .obj have the coordinates of the world instead.

    With --areas the .geojson holds polygons with holes: the curve, closed along the border of the samples.
    """
    from ..io.write import check_areas, check_libraries, check_suffix, render_areas, render_contour

    with concerning(output):
        if areas:
            check_areas(output)
        else:
            suffix = check_suffix(output)
            check_libraries(suffix)
    check_output(output, source)
    data = read_iso(source)

    import isocodec

    load_kernels()
    started = time.perf_counter()
    decoder, number = receive(source, data, isovalue, partial, layers, max_bytes)
    with concerning(source):
        contour = decoder.drawn(number, smooth)
    seconds = time.perf_counter() - started
    if isovalue is None:
        # what lies behind the layers asked for may be damaged
        with suppress(FormatError):
            warn_of_others(source, contour.isovalue, isocodec.inspect(data).isovalues)
    if in_samples:
        contour = replace(contour, placement=None)
    with concerning(source if areas else output):
        rendered = render_areas(contour, areas == "above") if areas else render_contour(contour, suffix)
    write_output(output, rendered)
    pieces = "segments" if len(contour.shape) == 2 else "triangles"
    tell(
        f"{click.format_filename(output)}: {len(contour.points):,} points, {len(contour.cells):,} {pieces}, "
        f"{seconds:.2f} s",
        {
            "output": str(output),
            "bytes": len(rendered),
            "points": len(contour.points),
            "cells": len(contour.cells),
            "isovalue": contour.isovalue,
            "shape": list(contour.shape),
            "complete": contour.complete,
            "seconds": round(seconds, 3),
        },
        as_json,
    )
