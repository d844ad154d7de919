"""Files in tiles on the command line: what decode and info do with them."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError
from ..limits import Limits
from .options import iso_argument, json_option, limit_options, limits_of, output_option
from .quiet import written
from .report import STANDARD, check_iso_output, check_output, concerning, tell, warn, write_output

if TYPE_CHECKING:
    from ..api.tiled_api import TiledIsoFile
    from ..drawing.contour import Contour

Box = list[tuple[float, float]]
_CUT = "the file ends before its tiles do: where they are missing curves are coarser, or not there"


def tiled_file(source: Path, limits: Limits) -> TiledIsoFile | None:
    """A file in tiles, of which what is needed is read later; None if it is something else, or comes through a pipe."""
    if str(source) == STANDARD:
        return None
    from ..api.tiled_api import tiled_at
    from .report import url_of

    with concerning(source):
        return tiled_at(url_of(source) or source, limits)


def read_box(text: str | None) -> Box | None:
    """A box of samples: ``0:100,50:90``."""
    if text is None:
        return None
    try:
        return [(float(low), float(high)) for low, high in (part.split(":") for part in text.split(","))]
    except ValueError:
        raise click.UsageError(
            f"--window {text}: give from:to for each axis, with commas between: --window 0:100,50:90"
        ) from None


def decode_tiled(
    file: TiledIsoFile, source: Path, output: Path, named: Path, isovalue: float | None, layers: int | None,
    window: str | None, within: float | None, partial: bool, in_samples: bool, keep_crs: bool, as_json: bool,
) -> None:
    """Write a window of a tiled file, or all of it."""
    from ..io.writers.output_formats import OutputOptions
    from ..io.writers.registry import suffixes_of
    from ..io.writers.things import Pyramid, Thing
    from ..io.writers.write import check

    n = len(file.shape)
    with concerning(output):
        suffix, form = check(named, Thing("contour", n))
    check_output(output, source)
    box = read_box(window)
    started = time.perf_counter()
    several = isovalue is None and n in form.several
    wanted = file.isovalues if several else (file.isovalues[0] if isovalue is None else isovalue,)
    layer = None if layers is None else min(layers, len(file.head.stages)) - 1
    contours: list[Contour] = []
    with concerning(source):
        for value in wanted:
            contours.append(file.window(box, isovalue=value, within=within, layer=layer, partial=partial))
        if partial and file.cut:
            warn(source, _CUT)
    seconds = time.perf_counter() - started
    with concerning(source):
        zooms = suffix in suffixes_of("pyramid") and within is None and layer is None and not (in_samples or partial)
        what = Pyramid(_by_width(file, box, contour) for contour in contours) if zooms else contours
        done = written(output, what, OutputOptions(keep_crs, in_samples, suffix))
    for remark in done.remarks:
        warn(source, remark)
    points, cells = (sum(len(getattr(c, name)) for c in contours) for name in ("points", "cells"))
    tell(
        f"{click.format_filename(output)}: {points:,} points, {cells:,} {'segments' if n == 2 else 'triangles'}, "
        f"{_read(file)}, {seconds:.2f} s",
        {
            "output": str(output), "bytes": done.bytes, "points": points, "cells": cells,
            "isovalues": list(wanted), "shape": list(file.shape), "complete": all(c.complete for c in contours),
            "seconds": round(seconds, 3),
            "read": file.received, "pieces": file.requests,
        },
        as_json,
    )


def _read(file: TiledIsoFile) -> str:
    """What has been read of a file; the head is read first, and may be read again with what lies behind it."""
    pieces = "piece" if file.requests == 1 else "pieces"
    return f"{file.received:,} bytes read in {file.requests} {pieces} of a file of {file.size:,}"


def _by_width(file: TiledIsoFile, box: Box | None, finest: Contour) -> Callable[[float], Contour]:
    """A window as zooms of a map see it, by samples that a pixel is wide: coarse layers if their cubes are no wider."""
    stages = file.head.stages
    drawn = {len(stages) - 1: finest}

    def at(width: float) -> Contour:
        stage = file.layer_within(width)
        # signs of all samples would be seen as steps
        stage = stage if stages[stage].edge else len(stages) - 1
        if stage not in drawn:
            drawn[stage] = file.window(box, isovalue=finest.isovalue, layer=stage)
        return drawn[stage]

    return at


def truncate_tiled(file: TiledIsoFile, source: Path, output: Path, layers: int, as_json: bool) -> None:
    """Write the first layers of a tiled file."""
    from ..storage.atomic import writing

    def pieces() -> Iterator[bytes]:
        # what goes wrong here is about the source, the rest about the output
        with concerning(source):
            yield from file.truncated(layers)

    written = 0
    with concerning(output), nullcontext(sys.stdout.buffer) if str(output) == STANDARD else writing(output) as out:
        for piece in pieces():
            out.write(piece)
            written += len(piece)
    kept = min(layers, len(file.head.stages))
    tell(
        f"{click.format_filename(output)}: {written:,} of {file.size:,} bytes, {kept} whole layers",
        {"output": str(output), "bytes": written, "input_bytes": file.size, "layers": kept},
        as_json,
    )


@click.command("extract", short_help="Take a window of a file in tiles out as a file in one piece.")
@iso_argument
@output_option("OUT.iso")
@click.option("--window", required=True, metavar="A:B,C:D", help="The box of samples, from:to for each axis.")
@click.option("--isovalue", type=float, metavar="V", help="One of its isovalues.  [default: all]")
@limit_options
@json_option
def extract_command(
    source: Path, output: Path, window: str, isovalue: float | None, limit_memory: int | None, limit_work: int | None,
    as_json: bool,
) -> None:
    """Take a window of IN.iso, a file in tiles or its URL, out as a file in one piece; no point moves.

    The window is grown to whole samples, and to even ones where it begins. Of a file with a tolerance from 0.1 on in
    the plane, or with its first layers only, the window has to be that of one tile.
    """
    check_iso_output(output, source)
    file = tiled_file(source, limits_of(limit_memory, limit_work))
    if file is None:
        with concerning(source):
            raise InputError("not a file in tiles, whose parts can be read", code="tiles", remedy="use transcode")
    with concerning(source):
        made = file.extract(read_box(window), isovalue=isovalue)
    write_output(output, made)
    tell(
        f"{click.format_filename(output)}: {len(made):,} bytes, {_read(file)}",
        {
            "output": str(output), "bytes": len(made), "input_bytes": file.size, "read": file.received,
            "pieces": file.requests,
        },
        as_json,
    )


def info_tiled(file: TiledIsoFile, source: Path, as_json: bool) -> None:
    """Print what a tiled file says of itself."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from ..errors import plain

    facts = _facts(file)
    with concerning(source):
        facts["complete"] = not file.cut
    if as_json:
        click.echo(json.dumps(facts, allow_nan=False))
        return
    console = Console()
    table = Table(title=escape(plain(str(source))), title_justify="left", title_style="bold", show_header=False,
                  box=None)
    for name in ("profile", "shape", "tiles", "bytes"):
        value = facts[name]
        text = (
            " x ".join(f"{n:,}" for n in value)
            if isinstance(value, list)
            else f"{value:,}"
            if isinstance(value, int)
            else str(value)
        )
        table.add_row(name, f"{text} of {facts['tile']} samples" if name == "tiles" else text)
    table.add_row("isovalues", ", ".join(f"{value:.17g}" for value in file.isovalues))
    for key, text in file.metadata.items():
        table.add_row(escape(plain(key, "\n")), escape(plain(text, "\n")))
    console.print(table)
    layers = Table()
    for heading in ("layer", "cubes", "holds", "bytes"):
        layers.add_column(heading, justify="right")
    for number, layer in enumerate(facts["layers"], 1):
        layers.add_row(
            str(number), f"{layer['cube']}" + ("+" if layer["adaptive"] else ""), layer["holds"], f"{layer['bytes']:,}"
        )
    console.print(layers)
    if not facts["complete"]:
        warn(source, _CUT)


def _facts(file: TiledIsoFile) -> dict[str, Any]:
    head, root = file.head, file.root
    layers = [
        {
            "cube": 1 << stage.edge, "holds": "geometry" if stage.geometry else "signs",
            "adaptive": stage.adaptive,
            "bytes": sum(int(root.sizes[:, head.area(i, number)].sum()) for i in range(len(head.isovalues))),
        }
        for number, stage in enumerate(head.stages)
    ]
    return {
        "tiled": True, "bytes": file.size, "profile": head.profile.name.lower(), "shape": list(file.shape),
        "tile": 1 << head.grid.exponent, "tiles": list(head.grid.counts), "isovalues": list(file.isovalues),
        "scale": head.scale, "masked": head.masked, "metadata": file.metadata,
        "directories": int(root.end + root.lengths.sum()), "layers": layers,
    }
