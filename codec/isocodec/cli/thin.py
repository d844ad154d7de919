"""``isocodec thin``: thin a terrain, picture or table of points to a triangulation of its most significant points."""

from __future__ import annotations

from dataclasses import replace

from ..verbs import OutputOptions, Thin
from .parameters import Call, command
from .report import concerning, progress_bar, write_output, written_to


@command("thin", Thin, "Thin a terrain, picture or table of points to a triangulation.", "INPUT", shares=("output",))
def thin_command(call: Call, options: Thin) -> None:
    """Remove the least significant points of INPUT one by one; write the Delaunay triangulation of the rest.

    OUT is one of {surfaces}: a surface whose height is the value. .npz (points, values, cells, placement, crs) also has
    the order of removal and the error after each removal; .npy holds the surface resampled on the grid. Or OUT is .iso:
    compactly coded points and values; decode converts that file to the other formats.

    INPUT is a picture, a terrain or any array with two axes that encode reads; or points: .csv, .xyz, .las, .laz,
    .gpkg.
    """
    coded = str(call.output).lower().endswith(".iso")
    options.check(coded)
    from ..api.encoding import encode
    from ..api.export import check_export, write
    from ..api.inputs import facts_of, to_thin
    from ..api.output import check_output
    from ..api.thinned import thinned

    with concerning(call.output):
        check_output(call.output, call.source)
        if not coded:
            check_export(call.output, "surface", OutputOptions())
    what = call.read(options)
    with concerning(call.source):
        given, remarks = to_thin(what, coded)
    call.warn(*getattr(what, "remarks", ()), *remarks)
    criterion = options.criterion or (None if coded else "AT1")
    with concerning(call.source), progress_bar("thinning") as progress:
        tin = thinned(given, replace(options, criterion=criterion), progress=progress)
    if tin.removals is not None and tin.merged:
        call.warn(f"{tin.merged:,} points coincide with others: each group is merged into one point with the mean of "
                  "its values")
    if coded:
        data = encode(tin)
        size = len(data)
        write_output(call.output, data)
    else:
        with written_to(call.output, call.source) as target:
            size = write(target, tin, OutputOptions()).bytes
    facts = facts_of(tin, given)
    error = f", largest error {facts['error']:g}" if "error" in facts else ""
    error += f", RMS error {facts['rms']:.4g}" if "rms" in facts else ""
    of = f" of {facts['points'] + facts['removed']:,}" if "removed" in facts else ""
    call.done(
        f"{size:,} bytes, {facts['points']:,}{of} points, {facts['triangles']:,} triangles{error}",
        {"bytes": size, **facts, **({"criterion": criterion} if criterion else {})},
    )
