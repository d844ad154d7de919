"""``isocodec plot``: draw the progressive steps of a file side by side, or a contour map of a field or a file."""

from __future__ import annotations

from typing import Any

from ..verbs import Plot
from .parameters import Call, command
from .report import concerning, one_warning, progress_bar, write_output


@command("plot", Plot, "Draw the progressive steps of a file, or a contour map.", "INPUT",
         shares=("output", "mesh", "limits"))
def plot_command(call: Call, options: Plot) -> None:
    """Draw prefixes of INPUT, an .iso file, from its first layer to all of it ({pictures}).

    All isovalues are drawn, coloured by value. The steps are those of encode --precision 4,1,.., if the file was made
    with them; otherwise they are spread evenly over the layers, beginning with the first one that shows any of the
    curve. Of a truncated file, the last step shows as much as there is.

    With --map, INPUT may also be any field with two axes that encode reads. Its lines are drawn
    over a shaded relief; every fifth one is thicker and labelled. The map shows world coordinates, the reference system
    and a scale bar, if INPUT states where its samples lie; holes are blank.
    """
    coded = not options.map or call.source.lower().endswith(".iso")
    options.check(coded, call.mesh)
    from ..api.output import check_output
    from ..api.plots import check_picture, plot_map, plot_steps

    with concerning(call.output):
        check_output(call.output, call.source)
        suffix = check_picture(call.output, options.view)
    what: Any = call.opened() if coded else call.read(options)
    with concerning(call.source), one_warning(call.output, "writing"), progress_bar("drawing") as progress:
        drawn = (plot_map if options.map else plot_steps)(what, suffix, options, progress)
    write_output(call.output, drawn.data)
    call.warn(*drawn.remarks)
    call.done(drawn.text, {"bytes": len(drawn.data), **drawn.facts})
