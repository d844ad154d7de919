"""``isocodec encode``: a field in, an .iso file out."""

from __future__ import annotations

import math
import time
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..limits import FIELD_SAMPLES
from .options import Isovalue, json_option, output_option
from .progress import progress_bar
from .quiet import one_warning
from .report import check_iso_output, concerning, tell, warn, write_output

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from ..io.read import Field


@click.command("encode", short_help="Encode the isocontour of a picture, terrain or volume.")
@click.argument("source", metavar="INPUT", type=click.Path(path_type=Path, readable=False))
@output_option("OUT.iso")
@click.option(
    "--isovalue",
    "isovalues",
    type=Isovalue(),
    multiple=True,
    metavar="V",
    help="Where the contour lies: value > V is inside. May be given several times.",
)
@click.option(
    "--interval",
    type=Isovalue(),
    metavar="S",
    help="Instead of isovalues: all multiples of S among the data, in one file.",
)
@click.option(
    "--label",
    "labels",
    type=Isovalue(),
    multiple=True,
    metavar="K",
    help="Instead of an isovalue: inside is where the value is K; with --signs-only if nothing else is said.",
)
@click.option("--independent", is_flag=True, help="Several isovalues: each can be decoded without the others.")
@click.option("--exact", is_flag=True, help="All values along the contour, to the last bit (integer data).")
@click.option(
    "--tolerance",
    type=float,
    metavar="D",
    help="Largest distance to the extracted contour and back, in cells; from 0.1 on the smallest file is looked for.",
)
@click.option("--steps", metavar="D,D,..", help="What layers promise, one by one: falling distances, or exact at last.")
@click.option("--preserve-topology", is_flag=True, help="As many pieces as the contour, nested alike, in every layer.")
@click.option(
    "--criterion",
    metavar="NAME[=X]",
    help="Reduce the mesh as published: crossing, topology, curvature=K, distortion=D or level=L. What --tolerance and"
    " --exact say then holds for crossings and values on that mesh, not between them.",
)
@click.option("--signs-only", is_flag=True, help="Only on which side the samples are: no positions within a cell.")
@click.option("--step", type=float, metavar="S", help="Values along the contour in steps of S (float data).")
@click.option(
    "--base-level",
    type=int,
    metavar="L",
    help="Level of the coarsest mesh, where the file begins; the full grid follows, without a search.",
)
@click.option("--profile", default="main", show_default=True, metavar="NAME", help="Entropy coding profile.")
@click.option("--metadata", multiple=True, metavar="KEY=TEXT", help="A note to go into the file. Several may be given.")
@click.option(
    "--spacing",
    metavar="S,S[,S]",
    help="Distances of samples along the axes of the array; negative where an axis runs against its coordinate.",
)
@click.option(
    "--missing",
    type=click.Choice(["below", "above", "nearest"]),
    help="Missing samples (NaN; what GeoTIFF or NetCDF says stands for them, or --nodata) lie below or above, or are as"
    " the nearest one.",
)
@click.option("--nodata", type=float, metavar="V", help="The value that stands for missing samples.")
@click.option("--no-placement", is_flag=True, help="Leave out where INPUT says its samples lie.")
@click.option("--key", metavar="NAME", help="Which array of an .npz or HDF5 file.")
@click.option("--channel", type=int, metavar="N", help="Which channel of a colour picture, counted from 0.")
@click.option(
    "--frame",
    type=int,
    metavar="N",
    help="Which of a series, counted from 0: along the first axis of an array or TIFF stack, the last of a volume.",
)
@click.option(
    "--limit-samples",
    type=click.IntRange(min=1),
    metavar="N",
    help=f"How many samples INPUT may hold at most.  [default: {FIELD_SAMPLES:,}]",
)
@click.option(
    "--follow-paths",
    "follow",
    is_flag=True,
    help="Read other files that INPUT names by a path, or keeps its samples in (HDF5).",
)
@json_option
def encode_command(
    source: Path,
    output: Path,
    isovalues: tuple[float, ...],
    interval: float | None,
    labels: tuple[float, ...],
    independent: bool,
    exact: bool,
    tolerance: float | None,
    steps: str | None,
    preserve_topology: bool,
    criterion: str | None,
    signs_only: bool,
    step: float | None,
    base_level: int | None,
    profile: str,
    metadata: tuple[str, ...],
    spacing: str | None,
    missing: str | None,
    nodata: float | None,
    no_placement: bool,
    key: str | None,
    channel: int | None,
    frame: int | None,
    limit_samples: int | None,
    follow: bool,
    as_json: bool,
) -> None:
    """Encode the isocontour (2-D) or isosurface (3-D) of the field in INPUT.

    INPUT is .npy, .npz, HDF5 or NetCDF, a PNG, JPEG or TIFF picture (a TIFF stack is a volume), or a NIfTI, NRRD or
    MetaImage volume. At most one of --exact, --tolerance, --steps, --signs-only and --step says how precisely the
    contour is kept.
    """
    if bool(isovalues) + (interval is not None) + bool(labels) != 1:
        raise click.UsageError("needed is --isovalue, --interval, or --label of a volume of labels: one of them")
    if len(labels) > 1:
        several = " and ".join(f"--label {label:g}" for label in labels)
        raise click.UsageError(f"{several}: a file holds one label, make one after the other")
    label = labels[0] if labels else None
    if interval is not None and not 0 < interval < math.inf:
        raise click.UsageError(f"--interval {interval}: needed is a number greater than 0")
    precise = {"--exact": exact, "--tolerance": tolerance is not None, "--signs-only": signs_only}
    precise |= {"--step": step is not None, "--steps": steps is not None}
    coarse = {"--base-level": base_level is not None, "--steps": steps is not None}
    coarse |= {"--criterion": criterion is not None}
    uniform = {"--base-level": base_level is not None, "--preserve-topology": preserve_topology}
    for given in (precise, coarse, uniform):
        chosen = [name for name, is_given in given.items() if is_given]
        if len(chosen) > 1:
            raise click.UsageError(f"{' and '.join(chosen)} contradict one another: choose one")
    name, parameter = _criterion(criterion)
    notes = _metadata(metadata)
    if spacing is not None and no_placement:
        raise click.UsageError("--spacing and --no-placement contradict one another: choose one")
    if label is not None and missing is not None:
        raise click.UsageError("--label and --missing contradict one another: what has another value has another label")
    if nodata is not None and missing is None:
        raise click.UsageError("--nodata says which samples are missing; --missing has to say what is taken instead")
    steps_along = _numbers("--spacing", spacing)
    check_iso_output(output, source)

    import isocodec

    from ..field.placement import CRS, PLACEMENT
    from ..io.missing import missing_samples, read_nodata
    from ..io.place import Place, read_place
    from ..io.read import read_field

    placed = steps_along is None and not no_placement and PLACEMENT not in notes
    with concerning(source):
        with one_warning(source):
            field = read_field(source, key=key, channel=channel, frame=frame, samples=limit_samples, follow=follow)
            if nodata is None and label is None:
                nodata = read_nodata(source, key, follow=follow)
            place = Place()
            if placed:
                place = read_place(source, field.ndim, key, samples=limit_samples, follow=follow)
        if steps_along is not None and len(steps_along) != field.ndim:
            raise click.UsageError(f"--spacing {spacing}: needed is a number for each of the {field.ndim} axes")
        if label is not None:
            field, isovalues = _labelled(field, label), (0.5,)
            notes.setdefault("label", f"{label:g}")
            signs_only |= not any(precise.values())
        else:
            gone = missing_samples(field, nodata)
            if interval is not None:
                isovalues = _multiples(interval, field[~gone])
            field = _whole(source, field, gone, missing, isovalues)
        placement: ArrayLike | None = place.placement if placed else steps_along
        if place.remark:
            warn(source, place.remark)
        if place.crs is not None:
            notes.setdefault(CRS, place.crs)
        started = time.perf_counter()
        with progress_bar("encoding") as progress:
            data = isocodec.encode(
                field,
                isovalues[0] if len(isovalues) == 1 else isovalues,
                leaning=not independent,
                steps=_steps(steps),
                preserve_topology=preserve_topology,
                criterion=name,
                parameter=parameter,
                exact=exact,
                tolerance=tolerance,
                signs_only=signs_only,
                step=step,
                base_level=base_level,
                profile=profile,
                metadata=notes,
                placement=placement,
                progress=progress,
            )
        seconds = time.perf_counter() - started
    write_output(output, data)
    _warn_of_values(source, field, isovalues, exact or step is not None, preserve_topology, signs_only)
    layers = len(isocodec.inspect(data).layers)
    tell(
        f"{click.format_filename(output)}: {len(data):,} bytes, {layers} layers, {seconds:.2f} s",
        {
            "output": str(output),
            "bytes": len(data),
            "layers": layers,
            "seconds": round(seconds, 3),
            "shape": list(field.shape),
            "dtype": str(field.dtype),
            "isovalues": [float(isovalue) for isovalue in isovalues],
        },
        as_json,
    )


def _labelled(field: Field, label: float) -> Field:
    """Which samples have a label."""
    import numpy as np

    from ..errors import InputError

    inside = np.asarray(field == label)
    if not inside.any():
        there = np.unique(field)
        text = ", ".join(f"{value:g}" for value in there[:20]) + (" ..." if len(there) > 20 else "")
        raise InputError(f"no sample has the label {label:g}", code="label", remedy=f"there are {text}")
    return inside


def _multiples(interval: float, samples: Field) -> tuple[float, ...]:
    """Multiples of an interval with samples above and not above them, rising; of 0.1 they are 0.1, 0.2, 0.3 .. ."""
    from isospec.container import MAX_ISOVALUES

    from ..errors import InputError

    if not samples.size:
        return ()
    low, high = float(samples.min()), float(samples.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise InputError("the data hold infinite values, and so all multiples", code="interval", remedy="--isovalue")
    first, end = math.floor(low / interval), math.ceil(high / interval) + 1
    near = (float(k * Decimal(repr(interval))) for k in range(first, min(end, first + MAX_ISOVALUES + 3)))
    out = tuple(value for value in near if low <= value < high)
    if len(out) > MAX_ISOVALUES:
        raise InputError(
            f"some {end - first - 1:,} multiples of {interval:g} lie among the data ({low:g} to {high:g}), and a file "
            f"holds {MAX_ISOVALUES}", code="interval", remedy="choose a larger interval",
        )  # fmt: skip
    if not out:
        raise InputError(
            f"no multiple of {interval:g} lies among the data ({low:g} to {high:g})", code="interval",
            remedy="choose a smaller interval",
        )  # fmt: skip
    return out


def _warn_of_values(
    source: Path, field: Field, isovalues: Sequence[float], valued: bool, preserve_topology: bool, signs_only: bool
) -> None:
    """Say which isovalues lie outside the data, and of which there are samples that may surprise."""
    low, high = field.min(), field.max()
    for isovalue in isovalues:
        if not low <= isovalue < high:
            warn(source, f"the isovalue {isovalue:g} lies outside the data ({low:g} to {high:g}): the curve is empty")
    integer = field.dtype.kind in "biu"
    if signs_only or not (preserve_topology or integer or valued):
        return
    ties = {isovalue: int((field == isovalue).sum()) for isovalue in isovalues}
    tied = [isovalue for isovalue, count in ties.items() if count]
    if not tied:
        return
    text = "there points of the contour fall together" if valued else "they count as below"
    if preserve_topology:
        text = "they count as below in the topology"
    elif integer and len(tied) == 1:
        text += f", which {tied[0] + 0.5:g} avoids"
    of = f"the isovalue {tied[0]:g}" if len(tied) == 1 else f"one of {len(tied)} isovalues ({tied[0]:g}, ..)"
    warn(source, f"{sum(ties.values()):,} samples equal {of}: {text}")


def _whole(source: Path, field: Field, gone: Field, missing: str | None, isovalues: Sequence[float]) -> Field:
    """The field with something instead of missing samples, or a warning."""
    import numpy as np

    from ..io.missing import filled

    if missing is not None:
        if not gone.any():
            warn(source, "no samples are missing; --nodata says which value stands for them")
        return filled(field, gone, missing, isovalues)
    if gone.any() and not np.isnan(field[gone]).any():
        count = f"{int(gone.sum()):,} samples are marked as missing"
        warn(source, f"{count} and are taken as they are; --missing says what to take instead")
    return field


def _criterion(text: str | None) -> tuple[str | None, float | None]:
    """Name and number of a criterion."""
    if text is None:
        return None, None
    name, equals, number = text.partition("=")
    if not equals:
        return name, None
    try:
        return name, float(number)
    except ValueError:
        raise click.UsageError(f"--criterion {text}: {number!r} is not a number") from None


def _metadata(given: tuple[str, ...]) -> dict[str, str]:
    """Notes by their keys."""
    out: dict[str, str] = {}
    for text in given:
        key, equals, note = text.partition("=")
        if not (key and equals) or key in out:
            raise click.UsageError(f"--metadata {text}: needed is KEY=TEXT, each key once")
        out[key] = note
    return out


def _numbers(option: str, text: str | None) -> list[float] | None:
    """Numbers between commas."""
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise click.UsageError(f"{option} {text}: needed are numbers, a comma between them") from None


def _steps(text: str | None) -> list[float | str] | None:
    """Distances, and perhaps the word exact."""
    if text is None:
        return None
    out: list[float | str] = []
    for part in text.split(","):
        try:
            out.append("exact" if part.strip() == "exact" else float(part))
        except ValueError:
            raise click.UsageError(f"--steps {text}: {part.strip()!r} is neither a number nor exact") from None
    return out
