"""``isocodec encode``: a field, a series, a mesh or points in, an .iso file out, or contours in another format."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..deferred import dataclass
from .decode import explained
from .option_records import (
    COUNT,
    INPUT,
    ISOVALUE,
    LAYERS,
    MESH,
    OUTPUT,
    PRECISION,
    TILES,
    WHOLE,
    Converting,
    LabelType,
    NumbersType,
    NumberType,
    Reading,
    argument,
    command,
    multiples_of,
    notes_of,
    option,
)
from .report import (
    STANDARD,
    Failure,
    concerning,
    counted,
    named,
    own_warnings,
    progress_bar,
    say,
    timed_result,
    warn,
    write_output,
    written_out,
)

if TYPE_CHECKING:
    from ..api.inputs import Added, Observed

CRITERION = re.compile(r"[0-9]+|crossing|topology|(curvature|distortion|level)=.*")
"""Layers that are not a plan in a file."""
OF_WHOLE = ("labels", "order", "effort", "keep_topology", "layers", "frames", "frame_interval", "periodic")
"""Options that do not apply to tiles."""
CODED = ("tile", "frames", "layers", "order", "effort", "stored", "mesh_error", "metadata", "profile")
"""Options of .iso files that other formats do not have."""
CONVERTED = ("what", "side", "layer", "attribute", "keep_crs", "in_samples", "simplify")
"""Options of other formats."""


@dataclass(frozen=True, kw_only=True)
class EncodeArguments(Converting, Reading):
    """Options of ``encode``."""

    source: str = argument("INPUT")
    isovalues: tuple[float, ...] = option("--isovalue", heading=ISOVALUE, type=NumberType(), multiple=True, metavar="V",
                                          help="Samples with value > V are inside. Repeatable.")
    interval: float | None = option("--interval", heading=ISOVALUE, type=NumberType(), metavar="S",
                                    help="All multiples of S within the range of the data, in one file.")
    offset: float | None = option("--offset", heading=ISOVALUE, type=NumberType(), metavar="V",
                                  help="With --interval: V, V + S, V + 2 S, ..")
    labels: tuple[Any, ...] = option(
        "--label", heading=ISOVALUE, type=LabelType(), multiple=True, metavar="K",
        help="Inside is value == K; all: of all values but 0. --precision signs by default. Repeatable.",
    )
    order: str | None = option(
        "--order", heading=ISOVALUE, metavar="O",
        help="levels: the first bytes show all isovalues (default where possible); isovalues: one by one; independent: "
        "each decodable alone.",
    )
    precision: str | None = option(
        "--precision", heading=PRECISION, metavar="P",
        help="exact (integers); signs (samples inside); a distance in cells or in the world: 0.05, 100m, "
        "0.2mm; falling ones: 4,1,0.25,exact; step=S (floats); drawn smooth: '0.2 smooth'.  [default: 0.05]",
    )
    keep_topology: bool = option("--keep-topology", heading=PRECISION, is_flag=True,
                                 help="Keep the topology of the contour in every layer.")
    effort: str = option("--effort", heading=PRECISION, type=click.Choice(["normal", "best"]), default="normal",
                         metavar="E", help="best: take four to ten times the time at distances from 0.1 to 0.5 cells, "
                         "for files that are 1 to 5 % smaller.")
    layers: str | None = option(
        "--layers", heading=LAYERS, metavar="L",
        help="One of: a level L, to start from the uniform mesh of that level instead of searching for the best mesh; "
        "a criterion that the coarsened mesh must meet (crossing, topology, curvature=K, distortion=D or level=L); a "
        "plan file that lists the layers (see docs/plans.md).",
    )
    frames: bool = option("--frames", heading=INPUT, is_flag=True,
                          help="Encode the slices, or the volumes of a 4-D file, as a series.")
    frame_interval: int | None = option(
        "--frame-interval", heading=INPUT, type=WHOLE, metavar="K",
        help="Make every K-th frame a key frame, which decodes on its own.  [default: 0, the first only]",
    )
    missing: str | None = option(
        "--missing", heading=INPUT, type=click.Choice(["hole", "below", "above", "nearest"]), metavar="HOW",
        help="What to do with missing samples: hole, the contour ends there (default); below or above, count them as "
        "such; nearest, copy the nearest sample.",
    )
    spacing: tuple[float, ...] | None = option("--spacing", heading=INPUT, type=NumbersType(), metavar="S,S[,S]",
                                               help="Distances of samples along the axes; may be negative.")
    origin: tuple[float, ...] | None = option("--origin", heading=INPUT, type=NumbersType(), metavar="X,Y[,Z]",
                                              help="Coordinates of the first sample.")
    crs: str | None = option("--crs", heading=INPUT, metavar="CRS",
                             help="Reference system of the coordinates: EPSG:32631, WKT or PROJJSON.")
    periodic: tuple[int, ...] = option("--periodic", heading=INPUT, type=WHOLE, multiple=True, metavar="AXIS",
                                       help="Join the two ends of this axis (counted from 0). Repeatable.")
    stored: str | None = option(
        "--stored", heading=MESH, type=click.Choice(["known", "coded", "whole", "delaunay"]), metavar="HOW",
        help="known: decoders have the mesh (default); coded: the file stores the cells that the contour crosses; "
        "whole: it stores all cells or points;  delaunay: it stores the points that the contour needs, which decoders "
        "triangulate (default for points).",
    )
    mesh_error: float | None = option("--mesh-error", heading=MESH, type=float, metavar="D",
                                      help="For a mesh that the file stores: largest error of its point positions.")
    tile: int | None = option("--tile", heading=TILES, type=COUNT, metavar="N",
                              help="Encode tile by tile, N = 2**k samples along each axis, for fields larger than "
                              "memory. Run the same command again to resume an interrupted one.")
    workers: int | None = option("--workers", heading=TILES, type=COUNT, metavar="N",
                                 help="Number of encoding processes.  [default: 1]")
    metadata: tuple[str, ...] = option("--metadata", heading=OUTPUT, multiple=True, metavar="KEY=TEXT",
                                       help="Add a note to the file. Repeatable.")
    profile: str = option("--profile", heading=OUTPUT, type=click.Choice(["main", "baseline"]), default="main",
                          metavar="NAME", help="Entropy coding: main (default) or baseline.")

    what: str | None = option(
        "--what", heading=OUTPUT, type=click.Choice(["curve", "areas", "bands"]), metavar="WHAT",
        help="Unless OUT is .iso: curve (default), areas (on one side), or bands (between curves).",
    )

    def check(self) -> None:
        """Refuse options that cannot be combined.

        Raises
        ------
        UsageError
        """
        if self.converts:
            self.refuse("apply unless OUT is .iso", *CODED)
            self.check_converting(self.what)
            if self.what != "areas":
                self.refuse("apply without --what areas", "side")
        else:
            self.refuse("apply to .iso files", *CONVERTED)
        if self.tile is None:
            self.refuse("apply without --tile", "workers")
        else:
            self.refuse("apply with --tile", *OF_WHOLE)
        self.choose("isovalues", "interval", "labels", required=self.plan is None)
        if "all" in self.labels and len(self.labels) > 1:
            raise click.UsageError("--label all takes no other labels")
        self.choose("labels", "missing")

    @property
    def converts(self) -> bool:
        """Whether contours are written in another format than .iso."""
        from ..api.output import is_converted

        return is_converted(self.output)

    @property
    def plan(self) -> Path | None:
        """The file that lists the layers."""
        return None if self.layers is None or CRITERION.fullmatch(self.layers) else Path(self.layers)

    @property
    def isovalue(self) -> Any:
        """Isovalues as the library takes them."""
        several: Any = multiples_of(self.interval, self.offset) or [*self.isovalues]
        return several[0] if len(several) == 1 else several or None

    def keywords(self) -> dict[str, Any]:
        """Keywords of `encode`, as far as they were given."""
        names = ("precision", "keep_topology", "effort", "order")
        given = {name: getattr(self, name) for name in names if self.given(name)}
        if self.layers is not None:
            from ..api.inputs import layers_of

            with concerning(self.plan or self.source):
                given["layers"] = layers_of(self.layers, self.plan)
        if self.frame_interval is not None:
            given["interval"] = self.frame_interval
        if self.converts:
            return given
        return {**given, "profile": self.profile, "metadata": notes_of(self.metadata)}

    def observed(self) -> Observed:
        """Read the input, and add what options state about it."""
        from ..api.inputs import observed

        what = self.read(self.source, self.frames)
        with concerning(self.source):
            return observed(what, self.added())

    def added(self) -> Added:
        """Collect what options state about the input."""
        from ..api.georeference import Georeference, named_system
        from ..api.inputs import Added

        crs = None if self.crs is None else named_system(self.crs)
        return Added(
            labels="all" if "all" in self.labels else self.labels,
            where=Georeference(spacing=self.spacing, origin=self.origin, crs=crs), periodic=self.periodic,
            stored=self.stored, mesh_error=self.mesh_error, missing=self.missing, interval=self.frame_interval,
            frames=self.frames,
        )


@command("encode", EncodeArguments, "Encode the isocontour of a picture, terrain, volume or mesh.", hidden=Converting)
def encode_command(options: EncodeArguments) -> None:
    """Encode the isocontour (2-D) or isosurface (3-D) of the field in INPUT.

    If OUT has the suffix of another format, contours of the samples are written there (with --precision or
    --keep-topology those of an .iso file), of any number of isovalues, and no .iso file is kept: encode dem.tif -o
    map.gpkg --interval 20. See decode for its options --side, --layer, --attribute, --keep-crs, --in-samples and
    --simplify.

    INPUT is .npy, .npz, HDF5, NetCDF, Zarr, a picture, TIFF (a stack is a volume), another raster that GDAL reads
    (.asc, .hgt, .img, .vrt, ..), NIfTI, NRRD, MetaImage, DICOM (a folder of slices, or a file), or a grid of VTK, XDMF;
    - for standard input, or a URL. It may be a mesh of triangles or tetrahedra with the values --key: .vtu, .vtp, .vtk,
    .msh, .ply, .xdmf, .obj, .stl (values: x, y or z), or .npz with points and cells; or hold scattered points, which
    are joined to triangles: .csv, .xyz, .las, .laz, .gpkg.

    With --tile, INPUT is read one tile at a time (.npy, GeoTIFF, Zarr, HDF5, NetCDF; other formats at once). Curves of
    neighbouring tiles meet without seams, and decode --window reads only a part of the file, also from a URL.
    """
    options.check()
    from ..api.output import check_output

    with concerning(options.output):
        check_output(options.output, options.source, iso=not options.converts)
    keywords = options.keywords()
    if options.converts:
        _drawn(options, keywords)
        return
    facts, remarks = (_tiled if options.tile is not None else _whole)(options, keywords)
    for remark in remarks:
        warn(options.source, remark)
    holds = counted(facts["layers"], "layer")
    if len(options.labels) > 1 or "all" in options.labels:
        holds = counted(len(facts["isovalues"]), "label")
    if options.tile is not None:
        holds = counted(facts["tiles"], "tile")
    timed_result(
        f"{named(options.output)}: {facts['bytes']:,} bytes, {holds}", {"output": str(options.output), **facts},
        options.as_json,
    )


def _drawn(options: EncodeArguments, keywords: dict[str, Any]) -> None:
    """Write contours in another format, without an .iso file."""
    from ..api.export import Wanted, check_export, drawn

    wanted = Wanted(what=options.what, **options.converted)
    with concerning(options.output):
        check_export(options.output, options.what or "curve", wanted.options)
    seen = options.observed()
    for remark in seen.before:
        warn(options.source, remark)
    with (
        concerning(options.source), explained(options), own_warnings(options.source),
        progress_bar("drawing") as progress,
    ):
        made = drawn(seen.what, options.output, wanted, options.isovalue, progress, **keywords)
    size = written_out(made, options.output, options.source)
    marked = options.nodata is not None or options.missing is not None
    for remark in seen.after(made.drawings, keywords or {"precision": "exact"}, marked):
        warn(options.source, remark)
    facts = {name: fact for name, fact in seen.facts(made.drawings).items() if name in ("dtype", "missing")}
    timed_result(
        f"{named(options.output)}: {made.text}",
        {"output": str(options.output), "bytes": size, **made.facts, **facts}, options.as_json,
    )


def _whole(options: EncodeArguments, keywords: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Encode without tiles; returns facts about the file, and remarks."""
    from ..api.encoding import encode
    from ..api.opening import open

    seen = options.observed()
    for remark in seen.before:
        warn(options.source, remark)
    with (
        concerning(options.source), progress_bar("encoding") as progress, seen.blaming(options.plan, Failure),
        own_warnings(options.source),
    ):
        data = encode(seen.what, options.isovalue, progress=progress, **keywords)
    write_output(options.output, data)
    file = open(data)
    marked = options.nodata is not None or options.missing is not None
    facts = {"bytes": file.size, "layers": len(file.info.layers), **seen.facts(file)}
    return facts, seen.after(file, keywords, marked)


def _tiled(options: EncodeArguments, keywords: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Encode tile by tile; returns facts about the file, and remarks."""
    from ..api.inputs import observed
    from ..api.opening import open
    from ..api.output import engine_of
    from ..api.saving import save_tiles

    if str(options.output) == STANDARD:
        raise click.UsageError("a tiled file cannot be written to standard output")
    field = options.windowed(options.source, options.missing)
    with (
        concerning(options.source),
        engine_of(options.workers) as engine, progress_bar("encoding tiles") as progress,
    ):
        seen = observed(field, options.added())
        for remark in seen.before:
            warn(options.source, remark)
        try:
            seen.in_tiles(save_tiles(
                options.output, seen.what, options.isovalue, tile=options.tile, engine=engine,
                workers=options.workers if engine else None, progress=progress,
                resumed=lambda done, total: say(f"{named(options.output)}: resuming at tile {done + 1:,} of {total:,}"),
                **keywords,
            ))
        except OSError as exc:  # of the input, the spool or the output
            raise Failure(exc.filename or options.source, exc) from exc
    file = open(str(options.output))
    facts = {"bytes": file.size, "layers": len(file.info.layers), "tiles": math.prod(file.info.tiles or ()),
             **seen.facts(file)}
    return facts, seen.after(file, keywords, options.nodata is not None or options.missing is not None)
