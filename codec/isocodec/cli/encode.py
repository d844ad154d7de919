"""``isocodec encode``: a field, a series, a mesh or points in, an .iso file out, or contours in another format."""

from __future__ import annotations

import math
from typing import Any

from ..errors import OptionError
from ..verbs import Encode, OutputOptions
from .decode import explained
from .parameters import Call, command, stream
from .report import (
    STANDARD,
    Failure,
    concerning,
    counted,
    named,
    one_warning,
    own_warnings,
    progress_bar,
    say,
    write_output,
    written_out,
)


@command("encode", Encode, "Encode the isocontour of a picture, terrain, volume or mesh.", "INPUT",
         shares=("output",), hidden=OutputOptions)
def encode_command(call: Call, options: Encode) -> None:
    """Encode the isocontour (2-D) or isosurface (3-D) of the field in INPUT.

    If OUT has the suffix of another format, contours of the samples are written there (with --precision or
    --keep-topology those of an .iso file), of any number of isovalues, and no .iso file is kept: encode dem.tif -o
    map.gpkg --interval 20. See decode for its options --layer, --attribute, --in-samples and --simplify.

    INPUT is .npy, .npz, HDF5, NetCDF, Zarr, a picture, TIFF (a stack is a volume), another raster that GDAL reads
    (.asc, .hgt, .img, .vrt, ..), NIfTI, NRRD, MetaImage, DICOM (a folder of slices, or a file), or a grid of VTK, XDMF;
    - for standard input, or a URL. It may be a mesh of triangles or tetrahedra with the values --key: .vtu, .vtp, .vtk,
    .msh, .ply, .xdmf, .obj, .stl (values: x, y or z), or .npz with points and cells; or hold scattered points, which
    are joined to triangles: .csv, .xyz, .las, .laz, .gpkg.

    With --tile, INPUT is read one tile at a time (.npy, GeoTIFF, Zarr, HDF5, NetCDF; other formats at once). Curves of
    neighbouring tiles meet without seams, and decode --window reads only a part of the file, also from a URL.
    """
    from ..api.export import suffix_of
    from ..api.inputs import keywords_of
    from ..api.output import check_output

    converts = suffix_of(call.output) is not None
    options.check(converts)
    with concerning(call.output):
        check_output(call.output, call.source, iso=not converts)
    keywords = keywords_of(options)
    if converts:
        _drawn(call, options, keywords)
        return
    facts, remarks = (_tiled if options.tile is not None else _whole)(call, options, keywords)
    call.warn(*remarks)
    holds = counted(facts["layers"], "layer")
    if len(options.labels) > 1 or "all" in options.labels:
        holds = counted(len(facts["isovalues"]), "label")
    if options.tile is not None:
        holds = counted(facts["tiles"], "tile")
    call.done(f"{facts['bytes']:,} bytes, {holds}", facts)


def _observed(call: Call, options: Encode) -> Any:
    """Read the input, add what options state about it, and print its remarks."""
    from ..api.inputs import Observed, stated

    what = call.read(options)
    with concerning(call.source):
        seen = Observed(stated(what, options))
    call.warn(*seen.before)
    return seen


def _drawn(call: Call, options: Encode, keywords: dict[str, Any]) -> None:
    """Write contours in another format, without an .iso file."""
    from ..api.export import check_export, drawn

    with concerning(call.output):
        check_export(call.output, options.what or "curve", options)
    seen = _observed(call, options)
    with (
        concerning(call.source), explained(call), own_warnings(call.source), progress_bar("drawing") as progress,
    ):
        made = drawn(seen.what, call.output, options, options.isovalue, progress, **keywords)
    size = written_out(made, call.output, call.source)
    call.warn(*seen.after(made.drawings, keywords or {"precision": "exact"}, options.marked))
    facts = {name: fact for name, fact in seen.facts(made.drawings).items() if name in ("dtype", "missing")}
    call.done(made.text, {"bytes": size, **made.facts, **facts})


def _whole(call: Call, options: Encode, keywords: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Encode without tiles; returns facts about the file, and remarks."""
    from ..api.encoding import encode
    from ..api.opening import open

    seen = _observed(call, options)
    with (
        concerning(call.source), progress_bar("encoding") as progress, explained(call),
        own_warnings(call.source),
    ):
        data = encode(seen.what, options.isovalue, progress=progress, **keywords)
    write_output(call.output, data)
    file = open(data)
    facts = {"bytes": file.size, "layers": len(file.info.layers), **seen.facts(file)}
    return facts, seen.after(file, keywords, options.marked)


def _tiled(call: Call, options: Encode, keywords: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Encode tile by tile; returns facts about the file, and remarks."""
    from ..api.inputs import Observed, stated, windowed
    from ..api.opening import open
    from ..api.saving import save_tiles

    if str(call.output) == STANDARD:
        raise OptionError("a tiled file cannot be written to standard output", code="tile")
    with concerning(call.source), one_warning(call.source):
        field = windowed(stream(call.source), options, options.missing or "hole")
    with concerning(call.source), progress_bar("encoding tiles") as progress:
        seen = Observed(stated(field, options))
        call.warn(*seen.before)
        try:
            seen.in_tiles(save_tiles(
                call.output, seen.what, options.isovalue, tile=options.tile, threads=options.threads,
                progress=progress,
                resumed=lambda done, total: say(f"{named(call.output)}: resuming at tile {done + 1:,} of {total:,}"),
                **keywords,
            ))
        except OSError as exc:  # of the input, the spool or the output
            raise Failure(exc.filename or call.source, exc) from exc
    file = open(str(call.output))
    facts = {"bytes": file.size, "layers": len(file.info.layers), "tiles": math.prod(file.info.tiles or ()),
             **seen.facts(file)}
    return facts, seen.after(file, keywords, options.marked)
