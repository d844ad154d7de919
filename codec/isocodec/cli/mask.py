"""``isocodec mask``: an .iso file in, which of its samples lie above out."""

from __future__ import annotations

import functools
import math
import time
from pathlib import Path

import click

from ..limits import Limits
from .options import frame_option, iso_argument, json_option, limit_options, limits_of, output_option, partial_option
from .quiet import one_warning
from .receive import receive, warn_of_frames, warn_of_others
from .report import check_output, concerning, read_iso, tell


@click.command("mask", short_help="Decode which samples are inside, to an array, picture or volume.")
@iso_argument
@output_option("OUT")
@click.option(
    "--isovalue", type=float, metavar="V", help="Isovalue to decode, if there are several.  [default: the first]"
)
@frame_option
@click.option(
    "--limit-samples", type=click.IntRange(min=1), metavar="N",
    help=f"Most samples of the mask.  [default: {Limits().samples:,}]",
)
@click.option("--valid", is_flag=True, help="Write which samples are valid instead: all but the missing ones.")
@partial_option
@limit_options
@json_option
def mask_command(
    source: Path, output: Path, isovalue: float | None, frame: int | None, limit_samples: int | None, valid: bool,
    partial: bool, limit_memory: int | None, limit_work: int | None, as_json: bool,
) -> None:
    """Decode which samples of IN.iso lie above the isovalue; the suffix of OUT names the format.

    \b
    .npy           true above
    .png           of pictures: white above
    .nii, .nii.gz  of volumes: 1 above, placed as the file states

    The file must hold the full grid. Files made with a criterion, or with a (last) tolerance of 0.1 or more, may not.
    What is written of missing samples means nothing; --valid tells which are valid, in any file.
    """
    from ..io.writers.things import SampleMask, Thing
    from ..io.writers.write import check, write

    with concerning(output):
        check(output, Thing("mask", None))
    check_output(output, source)
    data = read_iso(source)

    from ..field.placement import read_placement

    started = time.perf_counter()
    limits = limits_of(limit_memory, limit_work, limit_samples)
    decoder, number = receive(source, data, isovalue, partial, limits, frame=frame)
    assert decoder.header is not None
    shape = decoder.header.shape
    with concerning(output):
        check(output, Thing("mask", len(shape)))
    taken = decoder.valid_rows if valid else functools.partial(decoder.mask_rows, number)
    with concerning(source):
        taken(False)
    if isovalue is None and not valid:
        warn_of_others(source, decoder.isovalues[number], decoder.isovalues)
    if not valid:
        warn_of_frames(source, data, frame)
    placement = read_placement(decoder.metadata, len(shape))
    with concerning(output), one_warning(output, "writing"):
        above = write(output, SampleMask(taken, placement)).above
    seconds = time.perf_counter() - started
    samples, which = math.prod(shape), "valid" if valid else "above"
    tell(
        f"{click.format_filename(output)}: {above:,} of {samples:,} samples {which}, {seconds:.2f} s",
        {
            "output": str(output), "bytes": output.stat().st_size, which: above, "samples": samples,
            "isovalue": decoder.isovalues[number], "shape": list(shape), "complete": decoder.complete,
            "seconds": round(seconds, 3),
        },
        as_json,
    )
