"""``isocodec info``: print what an .iso file states about itself."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import click

from ..errors import plain
from ..verbs import Info
from .parameters import Call, command
from .report import concerning, table, warn

if TYPE_CHECKING:
    from ..api.isofile import FileInfo, FileStatistics


@command("info", Info, "Show what a file holds, layer by layer.", "IN.iso", shares=("mesh", "limits"))
def info_command(call: Call, options: Info) -> None:
    """Show version, profile, shape, isovalues and the layers of IN.iso."""
    file = call.opened()
    with concerning(call.source):
        if options.statistics:
            from ..api.export import counted

            info = counted(file)
        else:
            info = file.info
        statistics = file.statistics() if options.statistics else None
        complete, promise = file.complete, file.promise
    if call.as_json:
        import json

        more = {} if statistics is None else {"statistics": statistics.as_dict()}
        click.echo(json.dumps({**info.as_dict(), "complete": complete, "promise": promise, **more}, allow_nan=False))
    else:
        _print(call.source, info, complete, promise)
        if statistics is not None:
            _print_statistics(statistics, info)
    if not complete:
        cut = f"after {info.bytes:,} bytes, before it is complete" if info.tiles is None else "before its tiles do"
        warn(call.source, f"the file ends {cut}")


def _print(source: str, info: FileInfo, complete: bool, promise: str | None) -> None:
    promised = "nothing about distances" if promise is None else promise if complete else f"{promise}, when complete"
    # not by click, which writes UTF-8 where the terminal's encoding is ASCII
    facts = [(plain(name, "\n"), plain(text, "\n")) for name, text in [*_facts(info), ("promise", promised)]]
    print(plain(source))
    width = max(len(name) for name, _ in facts)
    for name, text in facts:
        print(f"{name:{width}}  {text}")
    print("\n" + table(*(_frames(info) if info.frames else _layers(info))))
    if info.kind == "mesh" and any(layer.within is not None for layer in info.layers):
        print("within: in the unit of the points.")
    if not info.frames and any(layer.bytes is None for layer in info.layers):
        why = "is too small for an index of its layers" if complete else "has no index of its layers, or not all of it"
        print(f"- : unknown, because the file {why}; --statistics decodes the file to find out.")


def _facts(info: FileInfo) -> list[tuple[str, str]]:
    """Collect by name the facts about the whole file."""
    out = [("kind", info.kind), ("version", f"{info.version} (read version {info.read_version})"),
           ("profile", str(info.profile))]
    if info.shape:
        out.append(("shape", " x ".join(f"{n}" for n in info.shape)))
    if info.tiles is not None:
        out.append(("tiles", f"{' x '.join(map(str, info.tiles))} of {info.tile} samples"))
    if info.domain is not None:
        out.append(("mesh", f"{info.domain.vertices:,} points, {info.domain.cells:,} cells"))
    for number, isovalue in enumerate(info.isovalues):
        lean = info.leans[number] if info.leans else None
        leaning = "" if lean is None else f"; predicted from {shortest(info.isovalues[lean])}"
        counted = number and info.noun == "isovalue"
        out.append((f"isovalue {number}" if counted else info.noun, f"{shortest(isovalue)}{leaning}"))
    out += info.metadata.items()
    if any(info.topology):
        kept = [shortest(v) for v, kept in zip(info.isovalues, info.topology, strict=True) if kept]
        whose = "" if all(info.topology) else f" of {', '.join(kept)}"
        out.append(("topology", f"kept in every layer{whose}"))
    if info.coordinates is not None:
        out.append(("coordinates", info.coordinates))
    if info.mask_bytes is not None:
        out.append(("mask", f"{info.mask_bytes:,} bytes"))
    if info.interval is not None:
        every = f", with a key frame every {info.interval}" if info.interval else ""
        whole = sum(frame.complete for frame in info.frames)
        begun = "; another one has begun" if whole < len(info.frames) else ""
        out.append(("frames", f"{whole}{every}{begun}"))
    return [*out, ("bytes", f"{info.bytes:,}"), ("overhead", f"{_number(info.overhead_bytes)} bytes")]


Rows = tuple[dict[str, str], list[list[str]]]
"""Headings, each with how its column is justified, and rows."""


def _columns(*names: str) -> dict[str, str]:
    return {name: "left" if name in ("kind", "symbols", "for each") else "right" for name in names}


def _frames(info: FileInfo) -> Rows:
    rows = []
    counts, timed = Counter(layer.frame for layer in info.layers), any(frame.time for frame in info.frames)
    for number, frame in enumerate(info.frames):
        row = [str(number), *[plain(frame.time or "")] * timed, f"{frame.offset:,}", f"{frame.bytes:,}"]
        rows.append([*row, str(counts[number]), "yes" if frame.key else ""])
    return _columns("frame", *["time"] * timed, "offset", "bytes", "layers", "key frame"), rows


def _layers(info: FileInfo) -> Rows:
    promised = any(layer.within is not None for layer in info.layers)
    symbols = any(layer.symbols for layer in info.layers)
    names = ["layer", "kind", "level", *["within"] * promised, "offset", "bytes", *["symbols"] * symbols]
    rows = []
    for number, layer in enumerate(info.layers, start=1):
        row = [str(number), str(layer.kind), _number(layer.level)]
        row += ["" if layer.within is None else f"{layer.within:g}" if layer.within else "exact"] * promised
        row += [_number(layer.offset), _number(layer.bytes)]
        row += ["\n".join(f"{count:,} {element}" for element, count in (layer.symbols or {}).items())] * symbols
        rows.append(row)
    return _columns(*names), rows


def _print_statistics(statistics: FileStatistics, info: FileInfo) -> None:
    """Print two tables: signs predicted correctly, by layer; bits for each pixel, vertex and face, by isovalue."""
    rows = [
        [str(number), str(layer.kind), str(layer.level), f"{layer.bits:,}", f"{layer.signs:,}",
         f"{layer.predicted:,}", f"{layer.right / layer.predicted:.1%}"]
        for number, layer in enumerate(statistics.layers, start=1) if layer.predicted
    ]
    signs, predicted, right = (
        sum(getattr(layer, name) or 0 for layer in statistics.layers) for name in ("signs", "predicted", "right")
    )
    if predicted:
        rows.append(["", "all", "", "", f"{signs:,}", f"{predicted:,}", f"{right / predicted:.1%}"])
        columns = _columns("layer", "kind", "level", "bits", "signs", "predicted", "right")
        print("\n" + table(columns, rows, "Signs that were predicted correctly"))

    pixel, face = ("crossed voxel", "face") if len(info.shape) == 3 else ("crossed pixel", "segment")
    for one in statistics.contours:
        signs = {} if one.signs is None else {"signs before coding": one.signs}
        columns = _columns("for each", "number", "connectivity", "geometry", "all", *signs)
        parts = (one.connectivity_bits, one.geometry_bits, one.bits, *signs.values())
        counts = ((pixel, one.pixels), ("vertex", one.vertices), (face, one.faces))
        rows = [[name, f"{count:,}", *(f"{part / count:.3f}" for part in parts)] for name, count in counts if count]
        print("\n" + table(columns, rows, f"Bits, {info.caption(one.isovalue)}"))


def shortest(number: float) -> str:
    """Write a number with the fewest digits that it can be read back from."""
    return repr(float(number)).removesuffix(".0")


def _number(number: Any) -> str:
    return "-" if number is None else f"{number:,}"
