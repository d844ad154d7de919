"""The options of ``isocodec encode``, under their headings, and how the texts among them are read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from ..limits import FIELD_SAMPLES
from .options import Isovalue, json_option, output_option, section


def _explain(context: click.Context, option: click.Parameter, asked: bool) -> None:
    """Print what a plan may say."""
    if asked:
        from ..stream import plan_file

        click.echo((plan_file.__doc__ or "").replace("``", ""), nl=False)
        context.exit()


SECTIONS = (
    section(
        "Isovalue (give one of --isovalue, --interval and --label, unless a plan does)",
        click.option(
            "--isovalue",
            "isovalues",
            type=Isovalue(),
            multiple=True,
            metavar="V",
            help="Inside is value > V. Repeatable.",
        ),
        click.option(
            "--interval", type=Isovalue(), metavar="S", help="All multiples of S within the data, in one file."
        ),
        click.option("--offset", type=Isovalue(), metavar="V", help="With --interval: V, V + S, V + 2 S, .."),
        click.option(
            "--label",
            "labels",
            type=Isovalue(),
            multiple=True,
            metavar="K",
            help="Inside is value == K; --signs-only by default. Repeatable.",
        ),
        click.option("--independent", is_flag=True, help="Keep each isovalue decodable without the others."),
    ),
    section(
        "Precision (choose at most one; the default is --tolerance 0.05)",
        click.option("--exact", is_flag=True, help="Keep all values along the contour (integer data)."),
        click.option("--step", type=float, metavar="S", help="Round values along the contour to steps of S (floats)."),
        click.option(
            "--tolerance",
            metavar="D",
            help="Largest distance from the contour and back, in cells (or in the world: 100m); from 0.1 on, search "
            "for the smallest file.",
        ),
        click.option("--steps", metavar="D,D,..", help="Falling tolerances, one by one; the last may be exact."),
        click.option("--signs-only", is_flag=True, help="Keep only which samples are inside."),
    ),
    section(
        "Layers",
        click.option("--preserve-topology", is_flag=True, help="Keep the topology of the contour in every layer."),
        click.option("--base-level", type=int, metavar="L", help="Begin on the uniform mesh of level L; no search."),
        click.option(
            "--criterion",
            metavar="NAME[=X]",
            help="Reduce the mesh by crossing, topology, curvature=K, distortion=D or level=L; precision then holds "
            "for crossings on that mesh only.",
        ),
        click.option(
            "--plan",
            type=click.Path(path_type=Path, readable=False),
            metavar="FILE",
            help="Make the layers that FILE lists (--plan-help).",
        ),
        click.option(
            "--plan-help",
            is_flag=True,
            is_eager=True,
            expose_value=False,
            callback=_explain,
            help="Explain such lists.",
        ),
    ),
    section(
        "Input",
        click.option("--key", metavar="NAME", help="Array of an .npz or HDF5 file."),
        click.option("--channel", type=int, metavar="N", help="Channel of a colour picture, counted from 0."),
        click.option("--kind", metavar="SUFFIX", help="Format of standard input or a URL: .tif."),
        click.option("--frame", type=int, metavar="N", help="Item of a series or time step, counted from 0."),
        click.option("--frames", is_flag=True, help="Keep slices, or the volumes of a 4-D file, as a series."),
        click.option(
            "--frame-axis", type=int, metavar="A",
            help="With --frames: the axis that counts them.  [default: 0; of 4-D volume files 3]",
        ),
        click.option(
            "--frame-interval", type=click.IntRange(min=0), metavar="K",
            help="Of a series: every K frames one decodes without those before it.  [default: 0, the first only]",
        ),
        click.option(
            "--missing",
            type=click.Choice(["hole", "below", "above", "nearest"]),
            metavar="HOW",
            help="Treat missing samples as a hole, where the contour ends (default), below, above, or as the nearest "
            "one.",
        ),
        click.option("--nodata", type=float, metavar="V", help="Value that marks missing samples, besides NaN."),
        click.option("--spacing", metavar="S,S[,S]", help="Distances of samples along the axes; may be negative."),
        click.option("--no-placement", is_flag=True, help="Ignore the coordinates that INPUT gives its samples."),
        click.option(
            "--coordinates-error", type=float, metavar="D", help="Cells that coordinates may be off.  [default: 0.005]"
        ),
        click.option(
            "--periodic", type=int, multiple=True, metavar="AXIS", help="Join the ends of an axis (from 0). Repeatable."
        ),
        click.option("--period", metavar="P[,P..]", help="Distance after which x (or x, y, z) repeats; 0: never."),
    ),
    section(
        "Meshes of triangles or tetrahedra",
        click.option("--values", "values_name", metavar="NAME", help="INPUT is a mesh; which values at its points."),
        click.option(
            "--mesh",
            type=click.Choice(["known", "coded", "whole", "delaunay"]),
            metavar="HOW",
            help="known: whoever decodes has it (default); the file has the crossed cells: coded, or all: whole.",
        ),
        click.option("--mesh-error", type=float, metavar="D", help="Largest error of points of a mesh in the file."),
    ),
    section(
        "Limits",
        click.option(
            "--limit-samples",
            type=click.IntRange(min=1),
            metavar="N",
            help=f"Most samples.  [default: {FIELD_SAMPLES:,}]",
        ),
        click.option("--follow-paths", "follow", is_flag=True, help="Read other files that INPUT refers to by a path."),
    ),
    section(
        "Output",
        output_option("OUT.iso"),
        click.option("--metadata", multiple=True, metavar="KEY=TEXT", help="Add a note to the file. Repeatable."),
        click.option("--profile", default="main", metavar="NAME", help="Entropy coding: main (default) or baseline."),
        json_option,
    ),
)
"""Headings with their options, in the order that help has."""


def encode_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command all of them."""
    for each in reversed(SECTIONS):
        command = each(command)
    return command


def read_criterion(text: str | None) -> tuple[str | None, float | None]:
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


def read_metadata(given: tuple[str, ...]) -> dict[str, str]:
    """Notes by their keys."""
    out: dict[str, str] = {}
    for text in given:
        key, equals, note = text.partition("=")
        if not (key and equals) or key in out:
            raise click.UsageError(f"--metadata {text}: give KEY=TEXT, each key once")
        out[key] = note
    return out


def read_numbers(option: str, text: str | None) -> list[float] | None:
    """Numbers between commas."""
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise click.UsageError(f"{option} {text}: give numbers separated by commas") from None


def read_steps(text: str | None) -> list[float | str] | None:
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
