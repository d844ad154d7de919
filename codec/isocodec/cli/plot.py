"""``isocodec plot``: the progressive steps of a file, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import OptionError, TruncatedError
from ..format.domain import kind_of_domain
from .on_mesh import steps_on_mesh
from .options import (
    domain_option,
    frame_option,
    iso_argument,
    limit_options,
    limits_of,
    output_option,
    partial_option,
    smooth_option,
)
from .panels import Panels
from .progress import progress_bar
from .quiet import one_warning
from .receive import warn_of_frames, warn_of_others
from .report import PARTIAL, check_output, concerning, read_iso, warn, write_output

if TYPE_CHECKING:
    from ..drawing.pictures.picture import Step
    from ..stream.decoder import Decoder

MESH = 600
"""Bytes that drawing the mesh takes for each simplex at most."""


@click.command("plot", short_help="Draw the progressive steps of a file side by side.")
@iso_argument
@output_option("OUT.png")
@click.option("--steps", type=click.IntRange(min=1), default=5, show_default=True, metavar="N", help="Number of steps.")
@click.option(
    "--mesh", is_flag=True, help="Draw the mesh, too: the triangles that the curve crosses, or those of the surface."
)
@click.option(
    "--view",
    metavar="VIEW",
    help="Look at a surface from front, back, left, right, top or bottom, or from AZIMUTH,ELEVATION in degrees "
    "(0,0 is the front, 90,0 the side of +x).",
)
@click.option(
    "--isovalue", type=float, metavar="V", help="Isovalue to draw, if there are several.  [default: the first]"
)
@frame_option
@domain_option
@smooth_option
@partial_option
@limit_options
def plot_command(
    source: Path, output: Path, steps: int, mesh: bool, view: str | None, isovalue: float | None, frame: int | None,
    domain: Path | None, smooth: bool, partial: bool, limit_memory: int | None, limit_work: int | None,
) -> None:
    """Draw what prefixes of IN.iso decode to, from its first layer to all of it (.png, .pdf or .svg).

    The steps are those of encode --steps, if the file was made with them; otherwise, and if there are more than asked
    for, they are spread evenly over the layers, from the first one on that has something of the curve. The last step of
    a file that ends within a layer shows that part of it.
    """
    from ..drawing.pictures.picture import check_picture, steps_picture
    from ..drawing.pictures.view import USUAL, read_view

    try:
        seen = USUAL if view is None else read_view(view)
    except OptionError as error:
        raise click.UsageError(f"--view {view}: {error}") from None
    with concerning(output):
        suffix = check_picture(output)
    check_output(output, source)
    data = read_iso(source)
    if kind_of_domain(data) is not None:
        if mesh or smooth or partial or view is not None:
            raise click.UsageError("the file is of a mesh: --mesh, --smooth, --partial and --view mean nothing")
        with concerning(source):
            limits = limits_of(limit_memory, limit_work)
            on_mesh = steps_on_mesh(data, steps, domain, isovalue, frame or 0, limits)
            with one_warning(output, "writing"):
                picture = steps_picture(on_mesh, suffix)
        warn_of_frames(source, data, frame, "drawn")
        write_output(output, picture)
        _tell(output, len(on_mesh), len(data))
        return
    if domain is not None:
        raise click.UsageError("--domain: the file is of a grid, not of a mesh")

    import isocodec

    from ..api.frames import check_frame

    with concerning(source), progress_bar("drawing") as progress:
        info = isocodec.inspect(data)
        if view is not None and len(info.shape) != 3:
            raise OptionError("there are views of surfaces only", code="view", remedy="leave out --view")
        number = info.number_of(isovalue)
        wanted = frame or 0
        layers = [layer for layer in info.layers if (layer.frame, layer.isovalue) == (wanted, number)]
        promised = [i for i, layer in enumerate(layers, 1) if layer.within]
        decoder = isocodec.Decoder(limits_of(limit_memory, limit_work), only=info.chain(number), frame=wanted)
        decoder.feed(data)
        drawn: list[Step] = []
        panels = Panels([layer.kind for layer in layers], steps, promised)
        own = 0
        for event in decoder:
            if not isinstance(event, isocodec.LayerComplete):
                continue
            if decoder.present == (wanted, number):
                own += 1
                if panels.draws(own, lambda: len(decoder.drawn(number, smooth).cells) > 0):
                    _draw(decoder, number, smooth, mesh, drawn, event.offset, len(data), layers[own - 1].within)
                    if progress is not None:
                        progress(len(drawn), len(panels.chosen))
        try:
            decoder.close()
        except TruncatedError as exc:
            if not partial:
                exc.remedy = PARTIAL
            begun = len(decoder.isovalues) > number and any(decoder.symbols.values())
            if not (partial and begun):
                raise
            warn(source, f"{exc.message}; drawn as far as it goes")
        check_frame(decoder, wanted)
        if own < len(layers) or not drawn:
            # the file ends within a layer
            _draw(decoder, number, smooth, mesh, drawn, len(data), len(data), None)
    with concerning(source), one_warning(output, "writing"):
        picture = steps_picture(drawn, suffix, seen)
    if isovalue is None:
        warn_of_others(source, info.isovalues[number], info.isovalues, "drawn")
    warn_of_frames(source, data, frame, "drawn")
    write_output(output, picture)
    _tell(output, len(drawn), len(data))


def _tell(output: Path, steps: int, size: int) -> None:
    click.echo(f"{click.format_filename(output)}: {steps} step{'s' * (steps != 1)} of {size:,} bytes")


def _draw(
    decoder: Decoder, number: int, smooth: bool, mesh: bool, drawn: list[Step], offset: int, total: int,
    within: float | None,
) -> None:
    """Draw another step, as far as the limit of memory allows it and the picture."""
    from ..drawing.pictures.picture import Step
    from ..io.writers.write import PICTURE

    under = decoder.mesh(number) if mesh else None
    step = Step(decoder.drawn(number, smooth), offset, total, under, within)
    drawn.append(step)
    cost = PICTURE[len(step.contour.shape)]
    sizes = [(len(one.contour.points), len(one.contour.cells)) for one in drawn]
    arrays = [a for one in drawn for a in (one.contour.points, one.contour.cells, *(one.mesh or ()))]
    held = sum(array.nbytes for array in arrays)
    if mesh:
        # of each cell or simplex three sides
        held += MESH * sum(max(len(one.mesh[1]) if one.mesh else 0, len(one.contour.cells)) for one in drawn)
    decoder.hold(held + sum(cost.after(*size) for size in sizes) + max(cost.peak(*size) for size in sizes))

