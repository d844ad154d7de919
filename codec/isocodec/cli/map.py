"""``isocodec map``: a terrain, or the file of its contours, as a contour map."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from ..errors import InputError, OptionError
from ..limits import FIELD_SAMPLES, Limits
from .encode_options import read_metadata
from .inputs import local_input
from .isovalues import check_interval, multiples, range_of, usual_interval
from .options import Isovalue, frame_option, json_option, limit_options, limits_of, output_option
from .progress import progress_bar
from .quiet import one_warning
from .receive import warn_of_frames
from .report import check_output, concerning, read_iso, tell, write_output

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..drawing.contour import Contour
    from ..field.sampled import Field

_TOLERANCE = 0.005
"""Cells: where a cell is as wide as a thumb, lines are still right to a tenth of a millimetre."""


class Drawn(NamedTuple):
    """What a map is drawn of: curves, the samples if they are there, which of these are valid."""

    contours: list[Contour]
    field: NDArray[Any] | None
    valid: NDArray[Any] | None


@click.command("map", short_help="Draw a contour map of a terrain, or of an .iso file.")
@click.argument("source", metavar="INPUT", type=click.Path(path_type=Path, readable=False))
@output_option("OUT")
@click.option("--interval", type=Isovalue(), metavar="S", help="Draw all multiples of S.  [default: about 20 lines]")
@click.option("--offset", type=Isovalue(), metavar="V", help="With --interval: draw V, V + S, V + 2 S, ..")
@click.option(
    "--isovalue", "isovalues", type=Isovalue(), multiple=True, metavar="V", help="Or draw these lines. Repeatable."
)
@click.option(
    "--index", type=click.IntRange(min=1), default=5, show_default=True, metavar="K",
    help="Draw each K-th line thicker and label it: the multiples of K S.",
)
@click.option("--title", default="", metavar="TEXT", help="Title of the map.")
@click.option(
    "--size", type=click.FloatRange(4, 400), default=20, show_default=True, metavar="CM",
    help="Longest side of the map.",
)
@click.option(
    "--dpi", type=click.IntRange(30, 2400), default=200, show_default=True, metavar="N",
    help="Pixels in 2.54 cm: of a .png all, otherwise those of the relief.",
)
@click.option("--dark", is_flag=True, help="Draw light lines on dark ground.")
@click.option("--no-relief", is_flag=True, help="Leave out the shaded relief.")
@click.option("--metadata", multiple=True, metavar="KEY=TEXT", help="What INPUT does not say: placement, crs, unit.")
@click.option("--nodata", type=float, metavar="V", help="Value that marks missing samples, besides NaN.")
@click.option("--key", metavar="NAME", help="Array of an .npz or HDF5 file.")
@click.option("--channel", type=int, metavar="N", help="Channel of a colour picture, counted from 0.")
@click.option("--kind", metavar="SUFFIX", help="Format of standard input or a URL: .tif, .iso.")
@frame_option
@click.option(
    "--limit-samples", type=click.IntRange(min=1), metavar="N", help=f"Most samples.  [default: {FIELD_SAMPLES:,}]"
)
@limit_options
@json_option
def map_command(
    source: Path, output: Path, interval: float | None, offset: float | None, isovalues: tuple[float, ...], index: int,
    title: str, size: float, dpi: int, dark: bool, no_relief: bool, metadata: tuple[str, ...], nodata: float | None,
    key: str | None, channel: int | None, kind: str | None, frame: int | None, limit_samples: int | None,
    limit_memory: int | None, limit_work: int | None, as_json: bool,
) -> None:
    """Draw the contour map of INPUT (.png, .pdf or .svg): a field of two axes that encode reads, or an .iso file.

    Lines of a field are those of encode --tolerance 0.005. Around them stand the coordinates of the world, its
    reference system and a scale bar, as far as INPUT says where its samples lie; holes are hatched. Of a field there is
    a shaded relief beneath.
    """
    check_interval(interval, offset)
    if interval is not None and isovalues:
        raise click.UsageError("--interval and --isovalue contradict one another: choose one")
    notes = read_metadata(metadata)
    coded = (kind or source.suffix).lstrip(".").lower() == "iso"
    if coded and (interval is not None or isovalues or notes or (nodata, key, channel) != (None, None, None)):
        raise click.UsageError(
            "an .iso file has its isovalues and notes: --interval, --isovalue, --metadata, --nodata, --key and "
            "--channel mean nothing"
        )
    import isocodec

    from ..drawing.pictures.map_picture import DARK, LIGHT, Look, map_picture
    from ..drawing.pictures.picture import check_picture

    with concerning(output):
        suffix = check_picture(output)
    check_output(output, source)
    started = time.perf_counter()
    if coded:
        drawn = _of_iso(source, frame, limits_of(limit_memory, limit_work, limit_samples))
    else:
        with concerning(source):
            with local_input(source, kind, limit_samples) as path, one_warning(source):
                field = isocodec.read(path, key=key, channel=channel, frame=frame, samples=limit_samples)
            drawn = _of_field(field, isovalues, interval, offset, notes, nodata)
    look = Look(index, title, size, dpi, DARK if dark else LIGHT)
    with concerning(source), one_warning(output, "writing"):
        data, labels = map_picture(drawn.contours, suffix, look, None if no_relief else drawn.field, drawn.valid)
    seconds = time.perf_counter() - started
    write_output(output, data)
    count = len(drawn.contours)
    tell(
        f"{click.format_filename(output)}: {count} isovalue{'s' * (count != 1)}, {labels} labels, {seconds:.2f} s",
        {
            "output": str(output), "bytes": len(data), "isovalues": [c.isovalue for c in drawn.contours],
            "labels": labels, "seconds": round(seconds, 3),
        },
        as_json,
    )


def _of_iso(source: Path, frame: int | None, limits: Limits) -> Drawn:
    """The curves of a file, and its holes."""
    from ..format.domain import kind_of_domain
    from .tiled import tiled_file

    if tiled_file(source, limits) is not None:
        raise click.UsageError("the file is in tiles: take a part of it by isocodec extract")
    data = read_iso(source)

    import isocodec

    with concerning(source), progress_bar("decoding") as progress:
        if kind_of_domain(data) is not None:
            raise OptionError("there are no maps of values on a mesh", code="dimension", remedy="decode it to .geojson")
        contours = isocodec.decode_all(data, frame=frame, limits=limits, progress=progress)
        valid = isocodec.decode_valid(data, limits=limits) if contours[0].masked else None
    warn_of_frames(source, data, frame, "drawn")
    return Drawn(contours, None, valid)


def _of_field(
    field: Field, isovalues: tuple[float, ...], interval: float | None, offset: float | None, notes: dict[str, str],
    nodata: float | None,
) -> Drawn:
    """The curves that a file of this field would hold, its samples and its holes."""
    import isocodec

    from ..field.missing import missing_samples

    if field.values.ndim != 2:
        raise InputError(f"it has {field.values.ndim} axes, and maps are of two", code="dimension")
    gone = missing_samples(field.values, nodata)
    if field.mask is not None:
        gone |= field.mask
    there = field.values[~gone]
    if not there.size:
        raise InputError("all samples are missing", code="empty")
    if not isovalues:
        isovalues = multiples(usual_interval(there) if interval is None else interval, *range_of(there), offset)
    with progress_bar("encoding") as progress:
        mask = gone if gone.any() else None
        data = isocodec.encode(
            field, [*isovalues], mask=mask, metadata=notes, tolerance=_TOLERANCE, progress=progress
        )
    return Drawn(isocodec.decode_all(data), field.values, None if mask is None else ~mask)
