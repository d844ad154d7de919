"""``isocodec verify``: check that a file keeps its promises about the field that it was made from."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from ..verbs import Verify
from .parameters import Call, command
from .report import BROKEN, concerning, result

if TYPE_CHECKING:
    from ..api.isofile import FileInfo
    from ..api.verification import Verified


@command("verify", Verify, "Check a file against the field it was made from.", "IN.iso", "FIELD", shares=("limits",))
def verify_command(call: Call, options: Verify) -> None:
    """Decode IN.iso and measure its distance from the contour of FIELD, in both directions.

    Ends with exit code 9 if a sample lies on the wrong side of the isovalue, or if the distance exceeds --within or,
    without it, what IN.iso promises (see info). Where nothing is promised, the distances are measured and not judged.
    Of a tiled file the curve joined from all tiles is measured. Of a file on a mesh, FIELD is that mesh with its values
    (--key), or the points.
    """
    file = call.opened()
    field = call.read(options, call.field)
    with concerning(call.source):
        found = file.verify(field, frame=options.frame if file.frames > 1 else None, within=options.within)
    # a surface has no isovalue, and a curve is infinitely far from an empty one
    records = [{name: None if isinstance(fact, float) and not math.isfinite(fact) else fact
                for name, fact in asdict(one).items()} for one in found]
    verdicts = {one.kept for one in found}
    kept = False if False in verdicts else None if None in verdicts else True
    result("\n".join(_line(one, file.info) for one in found), {"kept": kept, "isovalues": records}, call.as_json)
    if kept is False:
        click.get_current_context().exit(BROKEN)


def _line(one: Verified, info: FileInfo) -> str:
    """One line about an isovalue or a surface."""
    surface = math.isnan(one.isovalue)
    unit = f" {one.unit}".rstrip()

    def far(least: float, most: float) -> str:
        text = _between(least, most, one.promised) + unit
        low, high = one.in_asked(least), one.in_asked(most)
        return text if low is None or high is None else f"{text} ({_between(low[0], *high[:2])}{high[2]})"

    verdict = {True: "kept", False: "NOT KEPT", None: "no promise"}[one.kept]
    promise = f"promised {one.promise}" if one.promise else "measured" if one.kept is None else "no promise; measured"
    if surface:
        error = _shown(one.there, one.promised)
        return f"surface: {verdict}; {promise}{':' if one.promise else ''} largest error {error}{unit}"
    signs = "signs not known" if one.wrong is None else f"{one.wrong:,} wrong signs"
    measured = f"{far(one.there_least, one.there)} file to field, {far(one.back_least, one.back)} field to file"
    return f"{info.caption(one.isovalue)}: {verdict}; {promise}{':' if one.promise else ''} {measured}; {signs}"


def _between(least: float, most: float, promised: float | None) -> str:
    """Write the bounds of a distance: ``0.481 to 0.490``, or one number if they read the same."""
    texts = [_shown(each, promised) for each in (least, most)]
    return " to ".join(dict.fromkeys(texts))


def _shown(number: float, promised: float | None) -> str:
    """Write a number with enough digits, at least three, to show which side of a promise it lies on."""
    texts = (f"{number:.{digits}g}" for digits in range(3, 18))
    return next(text for text in texts if promised is None or (float(text) > promised) == (number > promised))
