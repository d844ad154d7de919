"""``isocodec encode``: a field, a series, a mesh or points in, an .iso file out."""

from __future__ import annotations

import math
import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .option_records import (
    COUNT,
    FILE,
    INPUT,
    ISOVALUE,
    LAYERS,
    MESH,
    OUTPUT,
    PRECISION,
    SURFACE,
    TILES,
    WHOLE,
    NumbersType,
    NumberType,
    Reading,
    ThinningArguments,
    Writing,
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
    result,
    warn,
    write_output,
)

if TYPE_CHECKING:
    from ..api.inputs import Observed

CRITERION = re.compile(r"[0-9]+|crossing|topology|(curvature|distortion|level)=.*")
"""Layers that are not a plan in a file."""
GRIDS = ("spacing", "no_placement", "coordinates_error", "periodic", "period", "labels", "missing", "channel")
"""Options of sampled grids."""
APART = {
    "values": ("frames", "frame_axis", *GRIDS),
    "surface": ("labels", "interval", "offset", "independent", "precision", "keep_topology", "frames", "frame_axis",
                "frame_interval", "periodic", "period", "coordinates_error", "missing"),
    "tile": ("labels", "independent", "keep_topology", "layers", "frames", "frame_axis", "frame_interval", "periodic",
             "period", "coordinates_error", "missing"),
}
"""Options that do not go with the one that names a kind of file."""
OF_TILES, OF_SURFACES = ("workers", "scheduler", "spool"), ("points", "error", "size", "tolerance", "step")


def _explain(context: click.Context, _: click.Parameter, asked: bool) -> None:
    """Print the language of plans."""
    if asked:
        from ..api.inputs import plan_help

        click.echo(plan_help(), nl=False)
        context.exit()


@dataclass(frozen=True, kw_only=True)
class EncodeArguments(ThinningArguments, Writing, Reading):
    """Options of ``encode``."""

    source: str = argument("INPUT")
    isovalues: tuple[float, ...] = option("--isovalue", heading=ISOVALUE, type=NumberType(), multiple=True, metavar="V",
                                          help="Inside is value > V. Repeatable.")
    interval: float | None = option("--interval", heading=ISOVALUE, type=NumberType(), metavar="S",
                                    help="All multiples of S within the data, in one file.")
    offset: float | None = option("--offset", heading=ISOVALUE, type=NumberType(), metavar="V",
                                  help="With --interval: V, V + S, V + 2 S, ..")
    labels: tuple[float, ...] = option(
        "--label", heading=ISOVALUE, type=NumberType(), multiple=True, metavar="K",
        help="Inside is value == K; --precision signs by default. Repeatable.",
    )
    independent: bool = option("--independent", heading=ISOVALUE, is_flag=True,
                               help="Keep each isovalue decodable without the others.")
    precision: str | None = option(
        "--precision", heading=PRECISION, metavar="P",
        help="exact (integers); signs (only which samples are inside); a distance in cells or in the world: 0.05, "
        "100m; falling distances: 4,1,0.25,exact; step=S (floats, in steps).  [default: 0.05]",
    )
    keep_topology: bool = option("--keep-topology", heading=PRECISION, is_flag=True,
                                 help="Keep the topology of the contour in every layer.")
    layers: str | None = option(
        "--layers", heading=LAYERS, metavar="L",
        help="Begin on the uniform mesh of level L, without a search; or reduce the mesh by crossing, topology, "
        "curvature=K, distortion=D or level=L; or make the layers that a file lists (--plan-help).",
    )
    plan_help: bool = option("--plan-help", heading=LAYERS, is_flag=True, is_eager=True, expose_value=False,
                             callback=_explain, help="Explain the format of these files.")
    frames: bool = option("--frames", heading=INPUT, is_flag=True,
                          help="Keep slices, or the volumes of a 4-D file, as a series.")
    frame_axis: int | None = option(
        "--frame-axis", heading=INPUT, type=int, metavar="A",
        help="With --frames: the axis that counts them.  [default: 0; for 4-D volume files 3]",
    )
    frame_interval: int | None = option(
        "--frame-interval", heading=INPUT, type=WHOLE, metavar="K",
        help="Make every K-th frame decodable without those before it.  [default: 0, the first only]",
    )
    missing: str | None = option(
        "--missing", heading=INPUT, type=click.Choice(["hole", "below", "above", "nearest"]), metavar="HOW",
        help="Treat missing samples as a hole, where the contour ends (default), below, above, or as the nearest one.",
    )
    spacing: tuple[float, ...] | None = option("--spacing", heading=INPUT, type=NumbersType(), metavar="S,S[,S]",
                                               help="Distances of samples along the axes; may be negative.")
    no_placement: bool = option("--no-placement", heading=INPUT, is_flag=True,
                                help="Ignore the coordinates that INPUT gives its samples.")
    coordinates_error: float | None = option("--coordinates-error", heading=INPUT, type=float, metavar="D",
                                             help="Cells that coordinates may be off.  [default: 0.005]")
    periodic: tuple[int, ...] = option("--periodic", heading=INPUT, type=WHOLE, multiple=True, metavar="AXIS",
                                       help="Join the ends of an axis (from 0). Repeatable.")
    period: tuple[float, ...] | None = option("--period", heading=INPUT, type=NumbersType(), metavar="P[,P..]",
                                              help="Distance after which x (or x, y, z) repeats; 0: never.")
    surface: bool = option("--surface", heading=SURFACE, is_flag=True,
                           help="Encode a triangulated surface instead of contours.")
    values: str | None = option("--values", heading=MESH, metavar="NAME",
                                help="Encode these values at the points of INPUT, a mesh or scattered points.")
    stored: str | None = option(
        "--stored", heading=MESH, type=click.Choice(["known", "coded", "whole", "delaunay"]), metavar="HOW",
        help="known: decoders have the mesh (default); coded: the file stores the crossed cells; whole: it stores all; "
        "delaunay: cells follow from the points (default for points).",
    )
    mesh_error: float | None = option("--mesh-error", heading=MESH, type=float, metavar="D",
                                      help="Largest error of points of a mesh in the file.")
    tile: int | None = option("--tile", heading=TILES, type=COUNT, metavar="N",
                              help="Encode tile by tile, N = 2**k samples along each axis, for fields larger than "
                              "memory; a stopped command resumes.")
    workers: int | None = option("--workers", heading=TILES, type=COUNT, metavar="N",
                                 help="Number of encoding processes.  [default: 1]")
    scheduler: str | None = option("--scheduler", heading=TILES, metavar="ADDRESS",
                                   help="Encode on the Dask cluster of this scheduler: tcp://HOST:PORT.")
    spool: Path | None = option("--spool", heading=TILES, type=FILE, metavar="FOLDER",
                                help="Keep encoded tiles here until all are done.  [default: OUT.iso.tiles]")
    metadata: tuple[str, ...] = option("--metadata", heading=OUTPUT, multiple=True, metavar="KEY=TEXT",
                                       help="Add a note to the file. Repeatable.")
    profile: str = option("--profile", heading=OUTPUT, type=click.Choice(["main", "baseline"]), default="main",
                          metavar="NAME", help="Entropy coding: main (default) or baseline.")

    def check(self) -> None:
        """Refuse options that do not go together.

        Raises
        ------
        UsageError
        """
        self.choose("values", "surface", "tile")
        for kind, apart in APART.items():
            if self.given(kind):
                self.refuse(f"apply with --{kind}", *apart)
        if self.tile is None:
            self.refuse("apply without --tile", *OF_TILES)
        if self.values is None:
            self.refuse("apply without --values", "stored", "mesh_error")
        if not self.frames and self.values is None:
            self.refuse("apply without --frames", "frame_axis", "frame_interval")
        if self.surface:
            self.check_thinning(self.isovalues)
        else:
            self.refuse("apply without --surface", *OF_SURFACES)
            self.choose("isovalues", "interval", "labels", required=self.plan is None)
        self.choose("spacing", "no_placement")
        self.choose("labels", "missing")
        self.choose("workers", "scheduler")

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
        if self.surface:
            return {"profile": self.profile, "metadata": notes_of(self.metadata)}
        names = ("precision", "keep_topology", "independent")
        given = {name: getattr(self, name) for name in names if self.given(name)}
        if self.layers is not None:
            from ..api.inputs import layers_of

            with concerning(self.plan or self.source):
                given["layers"] = layers_of(self.layers, self.plan)
        if self.frame_interval is not None:
            given["interval"] = self.frame_interval
        return {**given, "profile": self.profile, "metadata": notes_of(self.metadata)}

    def observed(self) -> Observed:
        """Read the input, and add what options state about it."""
        from ..api.inputs import Added, observed

        given = {"frames": self.frames, "axis": self.frame_axis, "missing": self.missing}
        more = {name: value for name, value in given.items() if value is not None}
        what = self.read(self.source, self.values, **more)
        added = Added(
            labels=self.labels, spacing=self.spacing, placed=not self.no_placement, periodic=self.periodic,
            periods=self.period or (), error=self.coordinates_error, stored=self.stored, mesh_error=self.mesh_error,
        )
        with concerning(self.source):
            return observed(what, added)


@command("encode", EncodeArguments, "Encode the isocontour of a picture, terrain, volume or mesh.")
def encode_command(options: EncodeArguments) -> None:
    """Encode the isocontour (2-D) or isosurface (3-D) of the field in INPUT.

    INPUT is .npy, .npz, HDF5, NetCDF, Zarr, GRIB, PNG, JPEG, TIFF (a stack is a volume), NIfTI, NRRD, MetaImage, DICOM
    (a folder of slices, or a file), or a grid of VTK or XDMF; - for standard input, or a URL. With --values it is a
    mesh of triangles or tetrahedra: .vtu, .vtp, .vtk, .msh, .ply, .xdmf, .obj, .stl (values: x, y or z), or .npz with
    points and cells; or it holds scattered points, which are joined to triangles: .csv, .xyz, .las, .laz, .gpkg.

    With --tile, INPUT is read in windows (.npy, GeoTIFF, Zarr, HDF5, NetCDF; other formats whole). Curves of
    neighbouring tiles meet without seams, and decode --window reads a part of the file, also from a URL.
    """
    options.check()
    from ..api.output import check_output

    with concerning(options.output):
        check_output(options.output, options.source, iso=True)
    keywords = options.keywords()
    started = time.perf_counter()
    facts, remarks = (_tiled if options.tile is not None else _whole)(options, keywords)
    for remark in remarks:
        warn(options.source, remark)
    seconds = time.perf_counter() - started
    holds = counted(facts["points"], "point") if options.surface else counted(facts["layers"], "layer")
    if len(options.labels) > 1:
        holds = counted(len(options.labels), "label")
    if options.tile is not None:
        holds = counted(facts["tiles"], "tile")
    result(
        f"{named(options.output)}: {facts['bytes']:,} bytes, {holds}, {seconds:.2f} s",
        {"output": str(options.output), **facts, "seconds": round(seconds, 3)}, options.as_json,
    )


def _whole(options: EncodeArguments, keywords: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Encode in one piece; facts about the file, and remarks."""
    from ..api.encoding import encode
    from ..api.inputs import facts_of, to_thin
    from ..api.isofile import open

    seen = options.observed()
    given, remarks = to_thin(seen.what, True) if options.surface else (seen.what, [])
    for remark in [*seen.before, *remarks]:
        warn(options.source, remark)
    with concerning(options.source), progress_bar("encoding") as progress, seen.blaming(options.plan, Failure):
        if options.surface:
            tin = options.thinned(given, options.isovalues, int(options.layers or 1), None, progress)
            data = encode(tin, **keywords)
        else:
            with own_warnings(options.source):
                data = encode(seen.what, options.isovalue, progress=progress, **keywords)
    write_output(options.output, data)
    file = open(data)
    marked = options.nodata is not None or options.missing is not None
    facts = {"bytes": file.size, "layers": len(file.info.layers), **seen.facts(file)}
    return (facts | facts_of(tin, given), []) if options.surface else (facts, seen.after(file, keywords, marked))


def _tiled(options: EncodeArguments, keywords: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Encode tile by tile; facts about the file, and remarks."""
    from ..api.inputs import windows_of
    from ..api.isofile import open
    from ..api.output import engine_of
    from ..api.saving import save

    if str(options.output) == STANDARD:
        raise click.UsageError("a file in tiles is not written to standard output")
    with (
        concerning(options.source), windows_of(options.source, options.reading(options.source)) as (what, place),
        engine_of(options.workers, options.scheduler) as engine, progress_bar("encoding tiles") as progress,
    ):
        if place.remark and not options.no_placement:
            warn(options.source, place.remark)
        if not options.no_placement:
            keywords["metadata"] = {**place.notes(), **keywords["metadata"]}
        save(
            options.output, what, options.isovalue, tile=options.tile, engine=engine, spool=options.spool,
            workers=options.workers if engine else None, progress=progress, **keywords,
        )
    file = open(str(options.output))
    sizes = {number: sum(layer.bytes or 0 for layer in file.info.layers if layer.isovalue == number)
             for number in range(len(file.isovalues))}
    empty = [file.isovalues[number] for number, size in sizes.items() if not size]
    facts = {"bytes": file.size, "layers": len(file.info.layers), "tiles": math.prod(file.info.tiles or ()),
             "shape": list(file.shape), "isovalues": [float(value) for value in file.isovalues]}
    return facts, [f"no samples lie on both sides of the isovalue {value:g}: the curve is empty" for value in empty]
