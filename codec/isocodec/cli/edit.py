"""``isocodec edit``: makes an .iso file from others, without the field."""

from __future__ import annotations

from typing import Any

import click

from ..deferred import dataclass
from .option_records import (
    COUNT,
    PART,
    PRECISION,
    NumberType,
    Opening,
    SizeType,
    WindowType,
    Writing,
    argument,
    command,
    option,
)
from .report import concerning, counted, named, progress_bar, result, warn, write_output

ASKED = ("layers", "size", "window", "isovalues", "profile", "precision", "keep_topology")
"""Options that change a file."""


@dataclass(frozen=True, kw_only=True)
class EditArguments(Writing, Opening):
    """Options of ``edit``."""

    source: Any = argument("IN.iso ...", nargs=-1, required=True)
    layers: int | None = option("--layers", heading=PART, type=COUNT, metavar="N",
                                help="Keep the first N layers, counted over all isovalues; of a tiled file, the "
                                "first N stages of every tile.")
    size: int | None = option("--size", heading=PART, type=SizeType(), metavar="SIZE",
                              help="Keep as much as fits into this many bytes: 900, 20K.")
    window: tuple[tuple[float, float], ...] | None = option(
        "--window", heading=PART, type=WindowType(), metavar="A:B,C:D",
        help="Keep a window of samples, from:to for each axis.",
    )
    isovalues: tuple[float, ...] = option("--isovalue", heading=PART, type=NumberType(), multiple=True, metavar="V",
                                          help="Keep this isovalue. Repeatable.")
    profile: Any = option("--profile", heading=PRECISION, type=click.Choice(["main", "baseline"]),
                                 help="Encode the curves again in this profile; no point moves.")
    precision: str | None = option(
        "--precision", heading=PRECISION, metavar="P",
        help="Encode the curves again less precisely: signs, or a distance from the curves of IN.iso, in cells or "
        "in the world: 0.5, 10m.",
    )
    keep_topology: bool = option("--keep-topology", heading=PRECISION, is_flag=True,
                                 help="With --precision: keep the topology of the curves in every layer.")


@command("edit", EditArguments, "Shorten, crop, re-encode or merge files; the original field is not needed.")
def edit_command(options: EditArguments) -> None:
    """Make OUT.iso from IN.iso: keep its first layers or bytes, crop it, reduce its precision, or change its profile.

    If several IN.iso are given, they must all be of the same field; OUT.iso gets the isovalues of all of them, with
    every point unchanged.

    A window is enlarged to whole samples, and its start is rounded down to an even sample index. If IN.iso is a tiled
    file, only the bytes of that window are read, from disk or from a URL.

    To crop, merge or re-encode curves, the mesh of IN.iso must reach every sample (the full grid). It may not do so if
    the file was made with encode --layers CRITERION, or with a (last) distance of 0.1 or more. With --precision,
    OUT.iso promises that distance on top of what IN.iso promises, and nothing where that promises nothing; a window
    promises nothing.
    """
    from ..api.export import counted as inspected
    from ..api.merging import merge
    from ..api.opening import open
    from ..api.output import check_output, read_of

    for source in options.source:
        with concerning(options.output):
            check_output(options.output, source, iso=True)
    several = len(options.source) > 1
    if several:
        options.refuse("apply to several files: merge them first", *(name for name in ASKED if name != "profile"))
    elif not options.given(*ASKED):
        raise click.UsageError("give one of --layers, --size, --window, --isovalue, --profile or --precision")
    files = [options.opened(source) for source in options.source]
    with concerning(options.source[0]), progress_bar("encoding"):
        if several:
            pieces = [file.data for file in files]
            data = merge(pieces, profile=options.profile, limits=options.limits)
        else:
            asked = {name: getattr(options, name) for name in ASKED if options.given(name)}
            data = files[0].edited(**asked)
        made = open(data, limits=options.limits)
        lost = [] if several or options.isovalues else [v for v in files[0].isovalues if v not in made.isovalues]
    write_output(options.output, data)
    if lost:
        warn(options.source[0], f"the result does not reach {' and '.join(map(made.info.caption, lost))}")
    before = sum(file.size for file in files)
    isovalues = [float(value) for value in made.isovalues]
    holds, facts = counted(len(isovalues), made.info.noun), dict[str, Any](isovalues=isovalues)
    if not several and options.given("layers", "size"):
        kept = sum(layer.bytes is not None for layer in inspected(made).layers)
        holds, facts = counted(kept, "whole layer"), {**facts, "layers": kept}
    text, read = ("", {}) if several else read_of(files[0])
    result(
        f"{named(options.output)}: {len(data):,} of {before:,} bytes, {holds}{text}",
        {"output": str(options.output), "bytes": len(data), "input_bytes": before, **facts, **read},
        options.as_json,
    )
