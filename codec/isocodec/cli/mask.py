"""``isocodec mask``: an .iso file in, which of its samples lie above out."""

from __future__ import annotations

import time
from pathlib import Path

import click

from .options import iso_argument, json_option, output_option, partial_option
from .progress import load_kernels
from .receive import receive, warn_of_others
from .report import check_output, concerning, read_iso, tell, write_output


@click.command("mask", short_help="Decode to which samples lie above, as an array, a picture or a volume.")
@iso_argument
@output_option("OUT")
@click.option("--isovalue", type=float, metavar="V", help="Which isovalue, of several.  [default: the first]")
@partial_option
@json_option
def mask_command(source: Path, output: Path, isovalue: float | None, partial: bool, as_json: bool) -> None:
    """Decode which samples of IN.iso lie above the isovalue; the suffix of OUT names the format.

    \b
    .npy           true above
    .png           of pictures: white above
    .nii, .nii.gz  of volumes: 1 above, where the file says that the samples lie

    The file has to tell all signs, as it does unless its precision ends at 0.1 cells or more, or at a criterion's mesh.
    """
    from ..io.mask import check_mask_suffix, render_mask

    with concerning(output):
        check_mask_suffix(output)
    check_output(output, source)
    data = read_iso(source)

    from ..grid.placement import read_placement

    load_kernels()
    started = time.perf_counter()
    decoder, number = receive(source, data, isovalue, partial)
    with concerning(source):
        mask = decoder.mask(number)
    seconds = time.perf_counter() - started
    if isovalue is None:
        warn_of_others(source, decoder.isovalues[number], decoder.isovalues)
    placement = read_placement(decoder.metadata, mask.ndim)
    with concerning(output):
        rendered = render_mask(mask, check_mask_suffix(output, mask.ndim), placement)
    write_output(output, rendered)
    above = int(mask.sum())
    tell(
        f"{click.format_filename(output)}: {above:,} of {mask.size:,} samples above, {seconds:.2f} s",
        {
            "output": str(output), "bytes": len(rendered), "above": above, "samples": mask.size,
            "isovalue": decoder.isovalues[number], "shape": list(mask.shape), "complete": decoder.complete,
            "seconds": round(seconds, 3),
        },
        as_json,
    )  # fmt: skip
