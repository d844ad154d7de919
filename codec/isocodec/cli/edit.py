"""``isocodec edit``: makes an .iso file from others, without the field."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ..verbs import Edit
from .parameters import Call, command
from .report import concerning, counted, named, progress_bar, result, warn, write_output


@command("edit", Edit, "Shorten, crop, re-encode or merge files; the original field is not needed.", "IN.iso ...",
         shares=("output", "mesh", "limits"))
def edit_command(call: Call, options: Edit) -> None:
    """Make OUT.iso from IN.iso: keep its first layers, crop it, reduce its precision, or change its profile.

    If several IN.iso are given, OUT.iso gets all their isovalues, with every point unchanged. Series with the same
    isovalues are put one after the other. Files with different placements are windows of one grid, with the same
    isovalues and a row of samples in common with their neighbours: OUT.iso is of the box around them.

    A window is enlarged to whole samples, and its start is rounded down to an even sample index. If IN.iso is a tiled
    file, only the bytes of that window are read, from disk or from a URL.

    To crop, merge or re-encode curves, the mesh of IN.iso must reach every sample (the full grid). It may not do so if
    the file was made with encode --layers CRITERION, or with a (last) distance of 0.75 or more, of 0.1 or
    more for a smooth surface or with --effort best. With --precision, OUT.iso promises that distance on top of what
    IN.iso promises, and nothing where that promises nothing; a window promises nothing.
    """
    several, (first, *_) = len(call.source) > 1, call.source
    options.check(several)
    from ..api.merging import merge
    from ..api.opening import open
    from ..api.output import check_output, read_of

    for source in call.source:
        with concerning(call.output):
            check_output(call.output, source, iso=True)
    files = [call.opened(source) for source in call.source]
    with concerning(first), progress_bar("encoding"):
        if several:
            data = merge([file.data for file in files], profile=options.profile, limits=call.limits)
        else:
            data = files[0].edited(**asdict(options))
        made = open(data, limits=call.limits)
        lost = [] if several or options.isovalues else [v for v in files[0].isovalues if v not in made.isovalues]
    write_output(call.output, data)
    if lost:
        warn(first, f"the result does not reach {' and '.join(map(made.info.caption, lost))}")
    before = sum(file.size for file in files)
    isovalues = [float(value) for value in made.isovalues]
    holds, facts = counted(len(isovalues), made.info.noun), dict[str, Any](isovalues=isovalues)
    if not several and options.given("layers", "size"):
        kept, there = len(made.info.layers), len(files[0].info.layers)
        holds, facts = f"{kept} of {counted(there, 'layer')}", {**facts, "layers": kept, "input_layers": there}
    text, read = ("", {}) if several else read_of(files[0])
    result(
        f"{named(call.output)}: {len(data):,} of {before:,} bytes, {holds}{text}",
        {"output": str(call.output), "bytes": len(data), "input_bytes": before, **facts, **read}, call.as_json,
    )
