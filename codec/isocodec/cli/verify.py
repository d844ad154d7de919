"""``isocodec verify``: does a file keep what it promises of the field that it was made from?"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from .inputs import local_input
from .options import json_option, limit_options, limits_of
from .quiet import one_warning
from .report import BROKEN, concerning, read_iso, tell, url_of
from .tiled import tiled_file


@click.command("verify", short_help="Check a file against the field it was made from.")
@click.argument("source", metavar="FIELD", type=click.Path(path_type=Path, readable=False))
@click.argument("encoded", metavar="IN.iso", type=click.Path(path_type=Path, readable=False))
@click.option("--within", type=click.FloatRange(min=0), metavar="D", help="Distance to keep, in cells.")
@click.option("--key", metavar="NAME", help="Array of a file that holds several.")
@click.option("--channel", type=int, metavar="N", help="Channel of a colour picture, counted from 0.")
@click.option("--frame", type=int, metavar="N",
              help="Item of a series or time step, counted from 0; of IN.iso, too, if that is a series.")
@click.option("--kind", metavar="SUFFIX", help="Format of standard input or a URL: .tif.")
@click.option("--limit-samples", type=click.IntRange(min=1), metavar="N", help="Most samples of FIELD.")
@limit_options
@json_option
def verify_command(
    source: Path, encoded: Path, within: float | None, key: str | None, channel: int | None, frame: int | None,
    kind: str | None, limit_samples: int | None, limit_memory: int | None, limit_work: int | None, as_json: bool,
) -> None:
    """Decode IN.iso and measure how far it is from the contour of FIELD, both ways.

    Ends with exit code 9 if a sample lies on the wrong side of the isovalue, or the distance is larger than promised:
    by IN.iso (see info), or --within. Of a file in tiles, which promises nothing itself, the joined curve is measured.
    """
    limits = limits_of(limit_memory, limit_work, limit_samples)
    tiled = tiled_file(encoded, limits) is not None
    whole = b"" if tiled else read_iso(encoded)

    import isocodec

    from ..api.verification import verify

    with concerning(source), local_input(source, kind, limit_samples) as path, one_warning(source):
        field = isocodec.read(path, key=key, channel=channel, frame=frame, samples=limit_samples)
    with concerning(encoded):
        of_series = not tiled and isocodec.inspect(whole).frames
        found = verify(
            url_of(encoded) or encoded if tiled else whole, field, frame=frame if of_series else None, within=within,
            limits=limits,
        )
    kept = all(one.kept for one in found)
    lines = []
    for one in found:
        promise = "nothing promised" if one.promised is None else f"promised {one.promised:g}"
        signs = "signs not told" if one.wrong is None else f"{one.wrong:,} wrong signs"
        verdict = "kept" if one.kept else "NOT KEPT"
        far = f"{one.there:.3f} cells there, {one.back:.3f} back"
        lines.append(f"isovalue {one.isovalue:g}: {verdict}; {far}, {promise}; {signs}")
    tell("\n".join(lines), {"kept": kept, "isovalues": [asdict(one) for one in found]}, as_json)
    if not kept:
        click.get_current_context().exit(BROKEN)
