"""``isocodec info``: what an .iso file states about itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import plain
from .options import iso_argument, json_option, limit_options, limits_of
from .report import concerning, read_iso, warn

if TYPE_CHECKING:
    from .. import FileInfo, FileStatistics


@click.command("info", short_help="Show what a file holds, layer by layer.")
@iso_argument
@click.option("--symbols", is_flag=True, help="Also count symbols by syntax element (decodes the file).")
@click.option(
    "--statistics",
    "counted",
    is_flag=True,
    help="Also tell bits per crossed pixel, vertex and face, and how many signs were as predicted (decodes the file).",
)
@limit_options
@json_option
def info_command(
    source: Path, symbols: bool, counted: bool, limit_memory: int | None, limit_work: int | None, as_json: bool
) -> None:
    """Show version, profile, shape, isovalue and the layers of IN.iso."""
    limits = limits_of(limit_memory, limit_work)
    from .tiled import info_tiled, tiled_file

    if (tiled := tiled_file(source, limits)) is not None:
        if symbols or counted:
            raise click.UsageError("the file is in tiles: --symbols and --statistics mean nothing")
        return info_tiled(tiled, source, as_json)
    data = read_iso(source)

    import isocodec

    with concerning(source):
        info = isocodec.inspect(data, symbols=symbols, limits=limits)
        statistics = isocodec.statistics(data, limits) if counted else None
    if as_json:
        more = {} if statistics is None else {"statistics": statistics.as_dict()}
        click.echo(json.dumps({**info.as_dict(), **more}, allow_nan=False))
    else:
        _print(source, info)
        if statistics is not None:
            _print_statistics(statistics, len(info.shape))
    if not info.complete:
        warn(source, f"the file ends after {info.bytes:,} bytes, before it is complete")


def _print(source: Path, info: FileInfo) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console()
    facts = Table(
        title=escape(plain(str(source))), title_justify="left", title_style="bold", show_header=False, box=None
    )
    facts.add_row("version", f"{info.version} (read version {info.read_version})")
    facts.add_row("profile", str(info.profile))
    facts.add_row("shape", " x ".join(str(n) for n in info.shape))
    facts.add_row("isovalue", f"{info.isovalue:.17g}")
    for number, (isovalue, lean) in enumerate(zip(info.isovalues[1:], info.leans[1:], strict=True), 1):
        leaning = "" if lean is None else f", leans on {info.isovalues[lean]:.17g}"
        facts.add_row(f"isovalue {number}", f"{isovalue:.17g}{leaning}")
    for key, text in info.metadata.items():
        facts.add_row(escape(plain(key, "\n")), escape(plain(text, "\n")))
    if any(info.topology):
        kept = [f"{v:.17g}" for v, kept in zip(info.isovalues, info.topology, strict=True) if kept]
        whose = "" if all(info.topology) else f" of {', '.join(kept)}"
        facts.add_row("topology", f"promised in every layer{whose}")
    if info.coordinates is not None:
        facts.add_row("coordinates", info.coordinates)
    if info.mask_bytes is not None:
        facts.add_row("mask", f"{info.mask_bytes:,} bytes")
    if info.interval is not None:
        every = f", every {info.interval} one that stands by itself" if info.interval else ""
        facts.add_row("frames", f"{len(info.frames)}{every}")
    facts.add_row("bytes", f"{info.bytes:,}")
    facts.add_row("overhead", f"{_number(info.overhead_bytes)} bytes")
    console.print(facts)

    if info.frames:
        frames = Table()
        for heading in ("frame", "offset", "bytes", "layers", "stands by itself"):
            frames.add_column(heading, justify="right")
        for number, frame in enumerate(info.frames):
            count = sum(layer.frame == number for layer in info.layers)
            frames.add_row(
                str(number), f"{frame.offset:,}", f"{frame.bytes:,}", str(count), "yes" if frame.key else ""
            )
        console.print(frames)
        return

    counted = any(layer.symbols for layer in info.layers)
    layers = Table()
    layers.add_column("layer", justify="right")
    layers.add_column("kind")
    promised = any(layer.within for layer in info.layers)
    for heading in ("level", "within", "offset", "bytes") if promised else ("level", "offset", "bytes"):
        layers.add_column(heading, justify="right")
    if counted:
        layers.add_column("symbols")
    for number, layer in enumerate(info.layers, start=1):
        row = [str(number), layer.kind, _number(layer.level)]
        if promised:
            row.append("" if layer.within is None else f"{layer.within:g}")
        row += [_number(layer.offset), _number(layer.bytes)]
        if counted:
            row.append("\n".join(f"{count:,} {element}" for element, count in (layer.symbols or {}).items()))
        layers.add_row(*row)
    console.print(layers)
    if any(layer.bytes is None for layer in info.layers):
        why = "which is too small for a level index" if info.complete else "or in the part that is missing"
        console.print(f"- : not in the file, {why}; --symbols decodes the file to find out.")


def _print_statistics(statistics: FileStatistics, dimension: int) -> None:
    """Two tables: signs as predicted, by layer; bits for each pixel, vertex and face, by isovalue."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    layers = Table(title="Signs that were as predicted", title_justify="left")
    for heading in ("layer", "kind", "level", "bits", "signs", "right"):
        layers.add_column(heading, justify="left" if heading == "kind" else "right")
    for number, layer in enumerate(statistics.layers, start=1):
        if layer.signs:
            shown = (str(number), layer.kind, str(layer.level), f"{layer.bits:,}", f"{layer.signs:,}")
            layers.add_row(*shown, f"{layer.right / layer.signs:.1%}")
    signs = sum(layer.signs for layer in statistics.layers)
    if signs:
        layers.add_section()
        right = sum(layer.right for layer in statistics.layers) / signs
        layers.add_row("", "all", "", "", f"{signs:,}", f"{right:.1%}")
    console.print(layers)

    pixel, face = ("crossed pixel", "segment") if dimension == 2 else ("crossed voxel", "face")
    for one in statistics.contours:
        bits = Table(title=f"Bits, isovalue {one.isovalue:.17g}", title_justify="left")
        for heading in ("for each", "number", "connectivity", "geometry", "all", "signs before coding"):
            bits.add_column(heading, justify="left" if heading == "for each" else "right")
        for name, count in ((pixel, one.pixels), ("vertex", one.vertices), (face, one.faces)):
            if count:
                parts = (one.connectivity_bits, one.geometry_bits, one.bits, one.signs)
                bits.add_row(name, f"{count:,}", *(f"{part / count:.3f}" for part in parts))
        console.print(bits)


def _number(number: Any) -> str:
    return "-" if number is None else f"{number:,}"
