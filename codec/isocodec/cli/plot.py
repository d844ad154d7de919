"""``isocodec plot``: draw the progressive steps of a file side by side, or a contour map of a field or a file."""

from __future__ import annotations

from typing import Any

import click

from ..deferred import dataclass
from .option_records import (
    COUNT,
    DRAWING,
    INPUT,
    ISOVALUE,
    PART,
    WHOLE,
    NumberType,
    Opening,
    Reading,
    Writing,
    argument,
    command,
    multiples_of,
    notes_of,
    option,
)
from .report import concerning, named, one_warning, progress_bar, timed_result, warn, write_output

OF_MAPS, OF_STEPS = ("map_interval", "title", "size"), ("steps", "draw_mesh", "seen_from")
OF_FIELDS = ("map_interval", "metadata", "nodata", "key", "band", "bbox")


@dataclass(frozen=True, kw_only=True)
class PlotArguments(Writing, Opening, Reading):
    """Options of ``plot``."""

    source: str = argument("INPUT")
    isovalue: Any = option("--isovalue", heading=ISOVALUE, type=NumberType(), multiple=True, metavar="V",
                           help="Isovalue to draw alone; repeatable with --map.  [default: all]")
    map_interval: float | None = option("--interval", heading=ISOVALUE, type=NumberType(), metavar="S",
                                        help="With a field: draw all multiples of S.  [default: about 20 lines]")
    frame: int | None = option("--frame", heading=PART, type=WHOLE, metavar="N",
                               help="Frame of a series, from 0.  [default: the first]")
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
    title: str = option("--title", heading=DRAWING, default="", metavar="TEXT", help="With --map: title of the map.")
    size: float = option("--size", heading=DRAWING, type=click.FloatRange(4, 400), default=20, show_default=True,
                         metavar="CM", help="With --map: length of the longest side.")

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

    All isovalues are drawn, coloured by value. The steps are those of encode --precision 4,1,.., if the file was made
    with them; otherwise they are spread evenly over the layers, beginning with the first one that shows any of the
    curve. Of a truncated file, the last step shows as much as there is.

    With --map, INPUT may also be any field with two axes that encode reads. Its lines are drawn
    over a shaded relief; every fifth one is thicker and labelled. The map shows world coordinates, the reference system
    and a scale bar, as far as INPUT states where its samples lie; holes are blank.
    """
    options.check()
    every = multiples_of(options.map_interval, None)
    from ..api.output import check_output
    from ..api.plots import USUAL, check_plot, plot_map, plot_steps

    view = options.seen_from or USUAL
    with concerning(options.output):
        check_output(options.output, options.source)
        suffix = check_plot(options.output, view)
    what: Any = options.opened() if options.coded else options.read(options.source)
    with concerning(options.source), one_warning(options.output, "writing"), progress_bar("drawing") as progress:
        if options.map:
            drawn = plot_map(
                what, suffix, every or [*options.isovalue] or None, options.frame, options.title, options.size,
                notes_of(options.metadata), progress,
            )
        else:
            drawn = plot_steps(
                what, suffix, next(iter(options.isovalue), None), options.frame, options.steps, options.draw_mesh, view,
                progress,
            )
    write_output(options.output, drawn.data)
    for remark in drawn.remarks:
        warn(options.source, remark)
    timed_result(
        f"{named(options.output)}: {drawn.text}",
        {"output": str(options.output), "bytes": len(drawn.data), **drawn.facts},
        options.as_json,
    )
