"""``isocodec plot``: draw the progressive steps of a file side by side, or a contour map of a field or a file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from ..deferred import dataclass
from .decode import explained
from .option_records import (
    COUNT,
    DRAWING,
    INPUT,
    ISOVALUE,
    NumberType,
    Reading,
    Viewing,
    Writing,
    argument,
    command,
    multiples_of,
    notes_of,
    option,
)
from .report import concerning, named, one_warning, progress_bar, timed_result, warn, write_output

if TYPE_CHECKING:
    from ..api.plots import Plotted

OF_MAPS = ("map_interval", "offset", "index", "title", "size", "dpi", "dark", "no_relief")
OF_STEPS = ("steps", "draw_mesh", "seen_from", "partial", "smooth")
OF_FIELDS = ("metadata", "nodata", "key", "band", "bbox")


@dataclass(frozen=True, kw_only=True)
class PlotArguments(Writing, Viewing, Reading):
    """Options of ``plot``."""

    source: str = argument("INPUT")
    isovalue: Any = option("--isovalue", heading=ISOVALUE, type=NumberType(), multiple=True, metavar="V",
                           help="Isovalue to draw alone; repeatable with --map.  [default: all]")
    steps: int = option("--steps", heading=DRAWING, type=COUNT, default=5, show_default=True, metavar="N",
                        help="Number of steps.")
    draw_mesh: bool = option("--draw-mesh", heading=DRAWING, is_flag=True,
                             help="Also draw the triangles that the curve crosses, or those of the surface.")
    seen_from: str | None = option(
        "--view", heading=DRAWING, metavar="VIEW",
        help="Look at a surface from front, back, left, right, top or bottom, or from AZIMUTH,ELEVATION in degrees "
        "(0,0 is the front, 90,0 the side of +x).",
    )
    map: bool = option("--map", heading=DRAWING, is_flag=True, help="Draw a contour map.")
    map_interval: float | None = option("--interval", heading=ISOVALUE, type=NumberType(), metavar="S",
                                        help="With a field: draw all multiples of S.  [default: about 20 lines]")
    offset: float | None = option("--offset", heading=ISOVALUE, type=NumberType(), metavar="V",
                                  help="With --interval: draw V, V + S, V + 2 S, ..")
    index: int = option("--index", heading=DRAWING, type=COUNT, default=5, show_default=True, metavar="K",
                        help="With --map: draw every K-th line thicker and label it, that is, the multiples of "
                        "K times S.")
    title: str = option("--title", heading=DRAWING, default="", metavar="TEXT", help="With --map: title of the map.")
    size: float = option("--size", heading=DRAWING, type=click.FloatRange(4, 400), default=20, show_default=True,
                         metavar="CM", help="With --map: length of the longest side.")
    dpi: int = option("--dpi", heading=DRAWING, type=click.IntRange(30, 2400), default=200, show_default=True,
                      metavar="N", help="With --map: resolution in pixels per inch, of the whole .png; in .pdf and "
                      ".svg, of the relief only.")
    dark: bool = option("--dark", heading=DRAWING, is_flag=True, help="With --map: light lines on a dark background.")
    no_relief: bool = option("--no-relief", heading=DRAWING, is_flag=True,
                             help="With --map: leave out the shaded relief.")
    metadata: tuple[str, ...] = option("--metadata", heading=INPUT, multiple=True, metavar="KEY=TEXT",
                                       help="With a field: state what it does not: placement, crs or unit.")

    @property
    def coded(self) -> bool:
        """Whether INPUT is an .iso file."""
        return not self.map or self.source.lower().endswith(".iso")

    def check(self) -> None:
        """Refuse options that cannot be combined.

        Raises
        ------
        UsageError
        """
        self.refuse("apply to maps", *OF_STEPS) if self.map else self.refuse("apply without --map", *OF_MAPS)
        if self.coded:
            self.refuse("apply to .iso files, which have their isovalues and notes", *OF_FIELDS)
        else:
            self.refuse("apply to fields", "mesh")
            self.choose("map_interval", "isovalue")
        if not self.map and len(self.isovalue) > 1:
            raise click.UsageError("--isovalue may be given only once, except with --map")


@command("plot", PlotArguments, "Draw the progressive steps of a file, or a contour map.")
def plot_command(options: PlotArguments) -> None:
    """Draw prefixes of INPUT, an .iso file, from its first layer to all of it ({pictures}).

    All isovalues are drawn, coloured by value, and the steps are spread over them. The steps of one isovalue are those
    of encode --precision 4,1,.., if the file was made with them; otherwise, or if those outnumber --steps, they are
    spread evenly over the layers, starting with the first one that shows any of the curve. If the file ends in the
    middle of a layer, the last step shows as much of that layer as there is.

    With --map, INPUT may also be any field with two axes that encode reads. Its lines are those of encode --precision
    0.005, drawn over a shaded relief. The map shows world coordinates, the reference system and a scale bar, as far as
    INPUT states where its samples lie; holes are hatched.
    """
    options.check()
    every = multiples_of(options.map_interval, options.offset)
    from ..api.output import check_output
    from ..api.plots import check_plot

    with concerning(options.output):
        check_output(options.output, options.source)
        check_plot(options.output, options.seen_from)
    drawn = (_map if options.map else _steps)(options, every)
    with concerning(options.source), one_warning(options.output, "writing"):
        data = drawn.render()
    write_output(options.output, data)
    for remark in drawn.remarks:
        warn(options.source, remark)
    timed_result(
        f"{named(options.output)}: {drawn.text}",
        {"output": str(options.output), "bytes": len(data), **drawn.facts},
        options.as_json,
    )


def _steps(options: PlotArguments, _: str | None) -> Plotted:
    """Draw the steps of a file."""
    from ..api.plots import Steps, steps_of

    steps = Steps(
        count=options.steps, isovalue=next(iter(options.isovalue), None), frame=options.frame, smooth=options.smooth,
        mesh=options.draw_mesh, partial=options.partial, view=options.seen_from,
    )
    file = options.opened()
    with concerning(options.source), explained(options), progress_bar("drawing") as progress:
        return steps_of(file, options.output, steps, progress)


def _map(options: PlotArguments, every: str | None) -> Plotted:
    """Draw a contour map of a file or a field."""
    from ..api.plots import Look, map_of

    look = Look(options.index, options.title, options.size, options.dpi, options.dark, not options.no_relief)
    what: Any = options.opened() if options.coded else options.read(options.source)
    isovalues: Any = every or [*options.isovalue] or None
    with concerning(options.source), progress_bar("decoding" if options.coded else "encoding") as progress:
        return map_of(
            what, options.output, look, isovalues, frame=options.frame, metadata=notes_of(options.metadata),
            progress=progress,
        )
