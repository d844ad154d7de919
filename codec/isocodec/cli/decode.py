"""``isocodec decode``: an .iso file in, a curve or surface out, in the formats of other tools."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import click

from ..errors import FormatError
from .mesh import write_mesh
from .options import (
    domain_option,
    frame_option,
    iso_argument,
    json_option,
    limit_options,
    limits_of,
    output_option,
    partial_option,
    smooth_option,
)
from .quiet import written
from .receive import Drawings, receive, receive_all, warn_of_frames, warn_of_others
from .report import STANDARD, check_output, concerning, read_iso, tell, warn


@click.command("decode", short_help="Decode to a curve, a surface or a picture of it.")
@iso_argument
@output_option("OUT")
@click.option("--to", metavar="SUFFIX", help="Format of OUT, where its name does not tell: .geojson, for - as OUT.")
@click.option(
    "--isovalue",
    type=float,
    metavar="V",
    help="Isovalue to decode, if there are several.  [default: all that OUT can hold]",
)
@frame_option
@click.option(
    "--layers",
    type=click.IntRange(min=1),
    metavar="N",
    help="Decode only the first N layers of the isovalue.",
)
@click.option("--max-bytes", type=click.IntRange(min=1), metavar="N", help="Decode only the first N bytes.")
@click.option(
    "--keep-crs", is_flag=True,
    help="Write .geojson in the reference system of the file, not in longitude and latitude.",
)
@click.option("--in-samples", is_flag=True, help="Write coordinates in samples, even if the file has a placement.")
@click.option(
    "--areas", type=click.Choice(["above", "below", "bands"]),
    help="Write polygons of the areas above or below, or between isovalues (.geojson, .gpkg, .fgb, .shp, .parquet).",
)
@click.option("--along-holes", is_flag=True, help="With --areas: close areas along missing samples, too.")
@click.option(
    "--mesh", type=click.Choice(["whole", "tube"]),
    help="Write the mesh instead: of the whole box, or the simplices that the curve crosses (.vtu, .ply, .geojson).",
)
@click.option("--window", metavar="A:B,C:D", help="Of a file in tiles: the box of samples, from:to for each axis.")
@click.option("--within", type=float, metavar="N", help="Likewise: cubes of the mesh no wider than N samples will do.")
@domain_option
@smooth_option
@partial_option
@limit_options
@json_option
def decode_command(
    source: Path, output: Path, to: str | None, isovalue: float | None, frame: int | None, layers: int | None,
    max_bytes: int | None, keep_crs: bool, in_samples: bool, areas: str | None, along_holes: bool, mesh: str | None,
    window: str | None, within: float | None, domain: Path | None, smooth: bool, partial: bool,
    limit_memory: int | None, limit_work: int | None, as_json: bool,
) -> None:
    """Decode IN.iso to OUT; the suffix of OUT names the format. IN.iso may be - or a URL, OUT - (with --to).

    \b
    Curves and surfaces  .npz (points, cells, isovalue, shape; placement, crs), .png, .dxf, .vtp
    Curves               .geojson, .gpkg, .fgb, .shp, .parquet, .pmtiles, .svg (x along axis 1, y along axis 0)
    Surfaces             .ply, .stl, .off, .obj, .glb, .3mf (x, y, z along axes 0, 1, 2)

    Coordinates are in samples. If the file has a placement (from NIfTI or GeoTIFF, for example, or encode --spacing),
    all but .npz, .svg and .png have world coordinates instead. GeoJSON has longitude and latitude (RFC 7946) if the
    file names its reference system.

    With --areas the file holds polygons with holes: the curve, closed along the border of the samples,
    and with --along-holes along unit cells that have a missing corner.

    Of values on a mesh, curves are written as .geojson or .npz, surfaces as .ply, .stl, .obj or .npz, as it lies.

    Triangulated surfaces (of thin) are written as .ply, .vtu, .geojson or .npz, pictures of them as .npy.

    With --mesh the file holds triangles or tetrahedra with their level, and vertices with their sign (above: 1, 0).

    If there are several isovalues, .npz, .ply, .stl and .off hold one of them, the other formats all: as features and
    rows with their isovalue, layers (.dxf) or named objects.
    """
    if along_holes and not areas:
        raise click.UsageError("--along-holes closes areas: choose --areas above, below or bands, too")
    if mesh and (areas or smooth):
        raise click.UsageError(f"--mesh and --{'areas' if areas else 'smooth'} contradict one another: choose one")
    if mesh:
        write_mesh(
            source, output, isovalue, mesh == "whole", in_samples, partial, limits_of(limit_memory, limit_work),
            layers, max_bytes, as_json, frame,
        )
        return

    from isospec.container import DomainKind

    from ..format.domain import kind_of_domain
    from .on_mesh import decode_on_mesh
    from .tiled import decode_tiled, tiled_file
    from .tin import decode_surface

    if to is None and str(output) == STANDARD:
        raise click.UsageError("--to says in which format to write to standard output: --to .geojson")
    named = output if to is None else Path(f"_.{to.lstrip('.')}")
    limits = limits_of(limit_memory, limit_work)
    check_output(output, source)
    if (tiled := tiled_file(source, limits)) is not None:
        if areas or smooth or max_bytes is not None or frame is not None or domain is not None:
            raise click.UsageError(
                "the file is in tiles: --areas, --smooth, --max-bytes, --frame and --domain mean nothing"
            )
        return decode_tiled(
            tiled, source, output, named, isovalue, layers, window, within, partial, in_samples, keep_crs,
            as_json,
        )
    if window is not None or within is not None:
        raise click.UsageError("--window and --within are for files in tiles")
    data = read_iso(source)
    kind = kind_of_domain(data)
    if kind == DomainKind.POINTS:
        if layers is not None or areas or smooth:
            raise click.UsageError("the file holds a surface: --layers, --areas and --smooth mean nothing")
        return decode_surface(
            source, data, output, named, max_bytes, in_samples, partial, limits, as_json, isovalue
        )
    if kind is not None:
        if layers is not None or areas or smooth:
            raise click.UsageError("the file is of a mesh: --layers, --areas and --smooth mean nothing")
        return decode_on_mesh(source, data, output, named, domain, isovalue, frame, max_bytes, limits, as_json)
    if domain is not None:
        raise click.UsageError("--domain: the file is of a grid, not of a mesh")

    from ..io.writers.output_formats import OutputOptions
    from ..io.writers.things import Areas, Thing
    from ..io.writers.write import check

    asked = Thing("areas" if areas else "contour", None)
    with concerning(output):
        _, form = check(named, asked)

    import isocodec

    from ..format.header import read_header

    started = time.perf_counter()
    with concerning(source):
        found = read_header(data)
    if found and isovalue is None and layers is None and len(found[0].shape) in form.several:
        decoder = receive_all(source, data, partial, limits, max_bytes, frame)
        numbers = list(range(len(decoder.isovalues)))
    else:
        decoder, number = receive(source, data, isovalue, partial, limits, layers, max_bytes, frame)
        numbers = [number]
    seconds = time.perf_counter() - started
    isovalues = [decoder.isovalues[number] for number in numbers]
    if isovalue is None and len(numbers) == 1:
        # what lies behind the layers asked for may be damaged
        with suppress(FormatError):
            warn_of_others(source, isovalues[0], isocodec.inspect(data).isovalues)
    warn_of_frames(source, data, frame)
    assert decoder.header is not None
    n = len(decoder.header.shape)
    with concerning(output):
        suffix, form = check(named, replace(asked, n=n))
    drawings = Drawings(decoder, numbers, smooth, form.cost[n], along_holes)
    with concerning(source):
        valid = decoder.valid() if areas and along_holes else None
        done = written(output, Areas(drawings, areas, valid) if areas else drawings,
                       OutputOptions(keep_crs, in_samples, suffix))
    if not drawings.points and not drawings.complete:
        warn(source, "the part that was decoded holds nothing of the curve")
    for remark in done.remarks:
        warn(source, remark)
    pieces = "segments" if n == 2 else "triangles"
    tell(
        f"{click.format_filename(output)}: {drawings.points:,} points, {drawings.cells:,} {pieces}, {seconds:.2f} s"
        + (f", {len(numbers)} isovalues" if len(numbers) > 1 else ""),
        {
            "output": str(output),
            "bytes": done.bytes,
            "points": drawings.points,
            "cells": drawings.cells,
            "isovalues": isovalues,
            "shape": list(drawings.shape),
            "complete": drawings.complete,
            "seconds": round(seconds, 3),
        },
        as_json,
    )
