"""``isocodec decode``: an .iso file in, a curve, surface, mask or mesh out, in the formats of other tools."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from ..deferred import dataclass
from ..errors import OptionError, TruncatedError
from .option_records import COUNT, DRAWING, OUTPUT, PART, Converting, SizeType, Viewing, WindowType, command, option
from .report import PARTIAL, STANDARD, Failure, concerning, named, progress_bar, timed_result, written_out

if TYPE_CHECKING:
    from ..api.export import Wanted

WHAT = ("curve", "areas", "bands", "above", "valid", "labels", "mesh", "surface")


@dataclass(frozen=True, kw_only=True)
class DecodeArguments(Converting, Viewing):
    """Options of ``decode``."""

    what: str | None = option(
        "--what", heading=OUTPUT, type=click.Choice(WHAT), metavar="WHAT",
        help="One of: curve (of a volume, a surface), areas (on one side of a curve), bands (between curves), above "
        "(mask), valid (mask of the samples that are not missing), labels, mesh, surface (triangulated).  [default: "
        "curve, or surface if the file holds one]",
    )
    layers: int | None = option("--layers", heading=PART, type=COUNT, metavar="N",
                                help="Decode the first N layers of an isovalue.")
    max_bytes: int | None = option("--max-bytes", heading=PART, type=SizeType(), metavar="N",
                                   help="Decode the first N bytes.")
    window: tuple[tuple[float, float], ...] | None = option(
        "--window", heading=PART, type=WindowType(), metavar="A:B,C:D",
        help="Decode a window of samples, from:to for each axis; from a tiled file only this part is read.",
    )
    within: float | None = option("--within", heading=PART, type=float, metavar="N",
                                  help="Stop refining as soon as mesh cells are at most N samples wide.")
    through_holes: bool = option("--through-holes", heading=DRAWING, is_flag=True,
                                 help="Draw curves through missing samples, where the encoder chose their course.")
    capped: bool = option("--capped", heading=DRAWING, is_flag=True,
                          help="Close a surface in space where it leaves the field, around the --side.")
    to: str | None = option("--to", heading=OUTPUT, metavar="SUFFIX",
                            help="Format of OUT if its name has no suffix, or is -; for example .geojson.")

    def load(self) -> None:
        """Import what opens files, and what writes other formats."""
        super().load()
        from ..api import export  # noqa: F401

    @property
    def view(self) -> dict[str, Any]:
        """Keywords of `IsoFile.contour`, as far as they were given."""
        names = ("frame", "layers", "max_bytes", "window", "within", "partial", "smooth")
        given = {name: getattr(self, name) for name in names}
        unset: dict[str, Any] = {name: None if name == "smooth" else False for name in names}
        return {name: value for name, value in given.items() if value is not None and value is not unset[name]}

    @property
    def wanted(self) -> Wanted:
        """The choice of what to decode, as the library takes it."""
        from ..api.export import Wanted

        return Wanted(
            what=self.what, isovalue=self.isovalue, view=self.view, through_holes=self.through_holes,
            capped=self.capped, **self.converted,
        )

    def check(self) -> None:
        """Refuse options that cannot be combined.

        Raises
        ------
        UsageError
        """
        if self.to is None and str(self.output) == STANDARD:
            raise click.UsageError("standard output needs a format: give --to, for example --to .geojson")
        if self.what != "areas" and not self.capped:
            self.refuse("apply without --what areas or --capped", "side")
        if self.what not in (None, "curve"):
            self.refuse(f"apply to --what {self.what}", "capped")
        if self.capped:
            self.refuse("apply with --capped", "window")
        self.check_converting(self.what)
        if self.what in ("above", "valid", "labels", "surface", "mesh"):
            self.refuse(f"apply to --what {self.what}", "smooth")
        if self.what not in (None, "curve"):
            self.refuse(f"apply to --what {self.what}", "through_holes")
        if self.what in ("above", "valid", "labels"):
            self.refuse(f"apply to --what {self.what}", "keep_crs")
        if self.what in ("valid", "labels", "surface"):
            self.refuse(f"apply to --what {self.what}", "isovalue")


@command("decode", DecodeArguments, "Decode to a curve, a surface, a mask or a picture.")
def decode_command(options: DecodeArguments) -> None:
    """Decode IN.iso to OUT; the suffix of OUT chooses the format.

    IN.iso may be a URL, or - for standard input; OUT may be - for standard output (with --to).

    \b
    {formats}

    .npz has points, cells, isovalue, shape, placement and crs (of a triangulation values, too), the names under which
    encode reads them. Areas are polygons, closed along the border of the grid. In `above` and `valid` masks, samples
    that are above, or valid, are 1 (white in a picture). Meshes have the level of each cell and the sign of each vertex
    (1 above, 0 not). For a triangulation, .npy holds the surface resampled on the grid.

    Coordinates are in samples: x, y, z along axes 0, 1, 2; .svg has x along axis 1, y along axis 0. If the file states
    where its samples lie (from NIfTI or GeoTIFF, for example, or encode --spacing), all formats but .npz, .svg and .png
    have world coordinates instead. GeoJSON, KML and vector tiles have longitude and latitude (RFC 7946) if the file
    names its reference system: lines and areas are cut at 180 degrees, and areas closed over a pole that they hold.
    Areas are closed along missing samples, too. In .glb and .gltf, y is up.

    Lines run with higher values on their left, triangles of surfaces counter-clockwise as seen from the
    side of lower values, rings of areas counter-clockwise, and holes clockwise.

    If there are several isovalues, {single} hold one of them, the other formats all of them: as rows with their
    isovalue, layers (.dxf) or named objects.

    Which samples lie above an isovalue is known only if the file's mesh reaches every sample (the full grid). It may
    not do so if the file was made with --layers CRITERION, or with a (last) distance of 0.1 or more. In an `above`
    mask, the values of missing samples are undefined; --what valid shows which samples are missing.
    """
    options.check()
    from ..api.export import check_export, decoded
    from ..api.output import check_output, read_of

    with concerning(options.output):
        check_output(options.output, options.source)
        check_export(options.output, options.what, options.wanted.options)
    file = options.opened()
    with concerning(options.source), explained(options), progress_bar("decoding") as progress:
        made = decoded(file, options.output, options.wanted, progress)
    size = written_out(made, options.output, options.source)
    text, read = read_of(file)
    timed_result(
        f"{named(options.output)}: {made.text}{text}",
        {"output": str(options.output), "bytes": size, **made.facts, **read}, options.as_json,
    )


@contextmanager
def explained(options: Any) -> Iterator[None]:
    """Offer ``--partial`` in errors of truncated files, unless it was given; attribute errors of formats to OUT."""
    try:
        yield
    except OptionError as exc:
        if exc.code == "suffix":
            raise Failure(options.output, exc) from exc
        raise
    except TruncatedError as exc:
        if not options.partial and getattr(options, "max_bytes", None) is None:
            exc.remedy = PARTIAL
        raise
