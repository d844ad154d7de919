"""``isocodec verify``: check that a file keeps its promises about the field that it was made from."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import click

from .option_records import INPUT, Limited, Reading, argument, command, opened, option
from .report import BROKEN, concerning, result


@dataclass(frozen=True, kw_only=True)
class VerifyArguments(Reading, Limited):
    """Options of ``verify``."""

    field: str = argument("FIELD")
    source: str = argument("IN.iso")
    within: float | None = option("--within", heading=INPUT, type=click.FloatRange(min=0), metavar="D",
                                  help="Distance to check, in cells; for a surface the largest error of its values.  "
                                  "[default: the promise of IN.iso]")


@command("verify", VerifyArguments, "Check a file against the field it was made from.")
def verify_command(options: VerifyArguments) -> None:
    """Decode IN.iso and measure its distance from the contour of FIELD, in both directions.

    Ends with exit code 9 if a sample lies on the wrong side of the isovalue, or if the distance exceeds --within or,
    without it, the promise (guaranteed distance) that IN.iso records (see info). A tiled file records no promise; the
    curve joined from all tiles is measured.

    """
    file = opened(options.source, options.limits)
    field = options.read(options.field)
    with concerning(options.source):
        found = file.verify(field, frame=options.frame if file.frames > 1 else None, within=options.within)
    kept = all(one.kept for one in found)
    lines, records = [], []
    for one in found:
        surface = math.isnan(one.isovalue)
        records.append({**asdict(one), "isovalue": None if surface else one.isovalue})
        promise = "no promise in the file" if one.promised is None else f"promised {one.promised:g}"
        signs = "signs not known" if one.wrong is None else f"{one.wrong:,} wrong signs"
        far = f"largest distance {one.there:.3f} cells from file to field, {one.back:.3f} from field to file"
        verdict = "ok" if one.kept else "NOT KEPT"
        lines.append(
            f"surface: {verdict}; largest error {one.there:g}; {promise}" if surface
            else f"isovalue {one.isovalue:g}: {verdict}; {far}; {promise}; {signs}"
        )
    result("\n".join(lines), {"kept": kept, "isovalues": records}, options.as_json)
    if not kept:
        click.get_current_context().exit(BROKEN)
