"""``isocodec decode``: an .iso file in, a curve, surface, mask or mesh out, in the formats of other tools."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import OptionError, TruncatedError
from ..verbs import Decode
from .parameters import Call, command
from .report import PARTIAL, STANDARD, Failure, concerning, progress_bar, written_out


@command("decode", Decode, "Decode to a curve, a surface, a mask or a picture.", "IN.iso",
         shares=("output", "mesh", "limits"))
def decode_command(call: Call, options: Decode) -> None:
    """Decode IN.iso to OUT; the suffix of OUT chooses the format.

    IN.iso may be a URL, or - for standard input; OUT may be - for standard output (with --to).

    \b
    {formats}

    .npz has points, cells, isovalue, shape, placement and crs (of a triangulation values, too), the names under which
    encode reads them. Areas are polygons, closed along the border of the grid. In `above` and `valid` masks, samples
    that are above, or valid, are 1 (white in a picture). Meshes have the level of each cell and the sign of each vertex
    (1 above, 0 not). For a triangulation, .npy holds the surface resampled on the grid.

    Coordinates are in samples: x, y, z along axes 0, 1, 2; .svg has x along axis 1, y along axis 0. If the file states
    where its samples lie (from NIfTI or GeoTIFF, for example, or encode --spacing), all formats but .npz, .svg and .png
    have world coordinates instead. GeoJSON, KML and vector tiles have longitude and latitude (RFC 7946) if the file
    names its reference system: lines and areas are cut at 180 degrees, and areas closed over a pole that they hold.
    Areas are closed along missing samples, too. In .glb and .gltf, y is up.

    Lines run with higher values on their left, triangles of surfaces counter-clockwise as seen from the
    side of lower values, rings of areas counter-clockwise, and holes clockwise.

    If there are several isovalues, {single} hold one of them, the other formats all of them: as rows with their
    isovalue, layers (.dxf) or named objects.

    Which samples lie above an isovalue is known only if the file's mesh reaches every sample (the full grid). It may
    not do so if the file was made with --layers CRITERION, or with a (last) distance of 0.75 or more, of 0.1 or more
    for a smooth surface or with --effort best. In an `above` mask, the values of missing samples are undefined; --what
    valid shows which samples are missing.
    """
    if options.to is None and str(call.output) == STANDARD:
        raise OptionError("standard output needs a format", code="to", remedy="give --to, for example --to .geojson")
    from ..api.export import check_export, decoded
    from ..api.output import check_output, read_of

    with concerning(call.output):
        check_output(call.output, call.source)
        check_export(call.output, options.what, options)
    file = call.opened(threads=options.threads)
    remedy = PARTIAL if options.max_bytes is None and not options.partial else None
    with concerning(call.source), explained(call, remedy), progress_bar("decoding") as progress:
        made = decoded(file, call.output, options, progress)
    size = written_out(made, call.output, call.source)
    text, read = read_of(file)
    call.done(f"{made.text}{text}", {"bytes": size, **made.facts, **read})


@contextmanager
def explained(call: Call, remedy: str | None = None) -> Iterator[None]:
    """Attribute errors of formats to OUT; offer a remedy for files that are truncated."""
    try:
        yield
    except OptionError as exc:
        if exc.code == "suffix":
            raise Failure(call.output, exc) from exc
        raise
    except TruncatedError as exc:
        exc.remedy = remedy or exc.remedy
        raise
