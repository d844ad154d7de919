"""``isocodec decode``: an .iso file in, a curve or surface out, in the formats of other tools."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import FormatError
from .options import iso_argument, json_option, output_option, partial_option, smooth_option
from .progress import load_kernels
from .receive import receive, receive_all, warn_of_others
from .report import check_output, concerning, read_iso, tell, warn, write_output

if TYPE_CHECKING:
    from ..contour import Contour

LOST = 0.01
"""Share of a cell by which single precision may move points without a word."""


@click.command("decode", short_help="Decode to a curve, a surface or a picture of it.")
@iso_argument
@output_option("OUT")
@click.option(
    "--isovalue", type=float, metavar="V", help="Which isovalue, of several.  [default: all that OUT can hold]"
)
@click.option(
    "--layers",
    type=click.IntRange(min=1),
    metavar="N",
    help="Only the first N layers of that isovalue, or of the first; all if it has fewer.",
)
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

    Of a file of several isovalues, .geojson, .svg and .png show all (a feature each), the others one.
    """
    from ..io.write import check_areas, check_libraries, check_suffix, holds_several, render_areas, render_contour

    with concerning(output):
        if areas:
            check_areas(output)
        suffix = check_suffix(output)
        check_libraries(suffix)
    check_output(output, source)
    data = read_iso(source)

    import isocodec

    from ..stream.header import read_header

    load_kernels()
    started = time.perf_counter()
    with concerning(source):
        found = read_header(data)
    if found and isovalue is None and layers is None and holds_several(suffix, len(found[0].shape)):
        decoder = receive_all(source, data, partial, max_bytes)
        numbers = list(range(len(decoder.isovalues)))
    else:
        decoder, number = receive(source, data, isovalue, partial, layers, max_bytes)
        numbers = [number]
    with concerning(source):
        contours = [decoder.drawn(number, smooth) for number in numbers]
    seconds = time.perf_counter() - started
    if isovalue is None and len(contours) == 1:
        # what lies behind the layers asked for may be damaged
        with suppress(FormatError):
            warn_of_others(source, contours[0].isovalue, isocodec.inspect(data).isovalues)
    if in_samples:
        contours = [replace(contour, placement=None) for contour in contours]
    with concerning(source if areas else output):
        rendered = render_areas(contours, areas == "above") if areas else render_contour(contours, suffix)
    _warn_of_places(source, suffix, contours)
    write_output(output, rendered)
    pieces = "segments" if len(contours[0].shape) == 2 else "triangles"
    points, cells = sum(len(contour.points) for contour in contours), sum(len(contour.cells) for contour in contours)
    tell(
        f"{click.format_filename(output)}: {points:,} points, {cells:,} {pieces}, {seconds:.2f} s"
        + (f", {len(contours)} isovalues" if len(contours) > 1 else ""),
        {
            "output": str(output),
            "bytes": len(rendered),
            "points": points,
            "cells": cells,
            "isovalues": [contour.isovalue for contour in contours],
            "shape": list(contours[0].shape),
            "complete": all(contour.complete for contour in contours),
            "seconds": round(seconds, 3),
        },
        as_json,
    )


def _warn_of_places(source: Path, suffix: str, contours: Sequence[Contour]) -> None:
    """Say so where nothing of a curve has come yet, or where coordinates lose what the file knows."""
    import numpy as np

    if not any(len(contour.points) for contour in contours) and not all(contour.complete for contour in contours):
        warn(source, "nothing of the curve is in the part that was decoded")
    placement = contours[0].placement
    if suffix in (".ply", ".stl") and placement is not None and len(contours[0].points):
        lost = float(np.spacing(np.float32(np.abs(contours[0].placed).max())))
        steps = np.linalg.norm(placement[:, :-1], axis=0)
        if lost > LOST * steps.min():
            warn(source, f"coordinates in {suffix} are rounded by up to {lost / 2:g}; .obj keeps them, or --in-samples")
