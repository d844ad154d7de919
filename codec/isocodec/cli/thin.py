"""``isocodec thin``: thin a terrain, picture or table of points to a triangulation of its most significant points."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import click

from ..deferred import dataclass
from .option_records import (
    COUNT,
    SURFACE,
    From,
    NumberType,
    Reading,
    SizeType,
    Writing,
    argument,
    command,
    option,
)
from .report import concerning, named, progress_bar, timed_result, warn, write_output, written_to

CRITERIA = ("AT1", "AT2", "AT3", "inf", "l2", "NAT")


@dataclass(frozen=True, kw_only=True)
class ThinArguments(Writing, Reading):
    """Options of ``thin``."""

    source: str = argument("INPUT")
    isovalues: tuple[float, ...] = option("--isovalue", heading=SURFACE, type=NumberType(), multiple=True, metavar="V",
                                          help="If OUT is .iso: keep the contour of V, and hardly any other points. "
                                               "Repeatable.")
    layers: int = option("--layers", heading=SURFACE, type=COUNT, default=1, metavar="N",
                         help="If OUT is .iso: store the points in N layers at most, so that any beginning of the file "
                              "gives a good surface.")
    criterion: str | None = option(
        "--criterion", heading=SURFACE, type=click.Choice(CRITERIA),
        help="How points are ranked; the point whose removal does least harm goes first. AT1: largest error in the "
        "triangles around the point; AT2: error at the point itself; AT3: the same, estimated faster from triangles in "
        "each direction; inf: largest error over all points; l2: sum of squared errors; NAT: distance to the nearest "
        "point, whatever the values.  [default: AT1; if OUT is .iso, points are chosen so that the file is best]",
    )
    points: int | None = option("--points", heading=SURFACE, type=From(min=3), metavar="N",
                                help="Keep N points.")
    error: str | None = option("--error", heading=SURFACE, metavar="E",
                               help="Keep as few points as miss no value by more than E: 0.5, or 2m.")
    size: int | None = option("--size", heading=SURFACE, type=SizeType(), metavar="SIZE",
                              help="Keep as many points as fit into an .iso file of this size.")
    tolerance: str | None = option(
        "--tolerance", heading=SURFACE, metavar="D",
        help="With --isovalue: keep its contour to within D, in samples or in the world (0.5, 10m), and little else.",
    )
    step: float | None = option("--step", heading=SURFACE, type=float, metavar="S",
                                help="In an .iso file: round values to multiples of this step.")

    def thinned(self, what: Any, contours: Collection[float], layers: int, criterion: Any, progress: Any) -> Any:
        """Thin a field or points to a triangulation."""
        from ..api.thinned import thin

        return thin(
            what, criterion=criterion, to=self.points, error=self.error, size=self.size,
            contours=[*contours] or None, tolerance=self.tolerance, step=self.step, layers=layers, progress=progress,
        )

    def check_thinning(self, isovalues: Collection[float]) -> None:
        """Check that one measure of thinning is given."""
        measures = self.given("points", "error", "size") + ["--isovalue"] * bool(isovalues)
        if len(measures) != 1:
            raise click.UsageError("give exactly one of --points, --error, --size or --isovalue")
        if bool(isovalues) != (self.tolerance is not None):
            raise click.UsageError("--isovalue and --tolerance must be given together")


@command("thin", ThinArguments, "Thin a terrain, picture or table of points to a triangulation.")
def thin_command(options: ThinArguments) -> None:
    """Remove the least significant points of INPUT one by one; write the Delaunay triangulation of the rest.

    OUT is one of {surfaces}: a surface whose height is the value. .npz (points, values, cells, placement, crs) also has
    the order of removal and the error after each removal; .npy holds the surface resampled on the grid. Or OUT is .iso:
    compactly coded points and values; decode converts that file to the other formats.

    INPUT is a picture, a terrain or any array with two axes that encode reads; or points: .csv, .xyz, .las, .laz,
    .gpkg.

    """
    coded = options.output.suffix.lower() == ".iso"
    options.check_thinning(options.isovalues)
    if not coded:
        options.refuse("apply unless OUT ends in .iso", "size", "layers", "isovalues", "step")
    elif options.criterion is not None:
        options.refuse("apply with --criterion", "size", "isovalues")
    from ..api.encoding import encode
    from ..api.export import OutputOptions, check_export, write
    from ..api.inputs import facts_of, merged_by, to_thin
    from ..api.output import check_output

    with concerning(options.output):
        check_output(options.output, options.source)
        if not coded:
            check_export(options.output, "surface", OutputOptions())
    what = options.read(options.source)
    with concerning(options.source):
        given, remarks = to_thin(what, coded)
    for remark in [*getattr(what, "remarks", ()), *remarks]:
        warn(options.source, remark)
    with concerning(options.source), progress_bar("thinning") as progress:
        criterion = options.criterion or (None if coded else "AT1")
        tin = options.thinned(given, options.isovalues, options.layers, criterion, progress)
    for remark in merged_by(tin):
        warn(options.source, remark)
    if coded:
        data = encode(tin)
        size = len(data)
        write_output(options.output, data)
    else:
        with written_to(options.output, options.source) as target:
            size = write(target, tin, OutputOptions()).bytes
    facts = facts_of(tin, given)
    error = f", largest error {facts['error']:g}" if "error" in facts else ""
    error += f", RMS error {facts['rms']:.4g}" if "rms" in facts else ""
    of = f" of {facts['points'] + facts['removed']:,}" if "removed" in facts else ""
    timed_result(
        f"{named(options.output)}: {size:,} bytes, {facts['points']:,}{of} points, {facts['triangles']:,} triangles"
        f"{error}",
        {"output": str(options.output), "bytes": size, **facts, **({"criterion": criterion} if criterion else {})},
        options.as_json,
    )
