"""``isocodec tile``: a field that need not fit into memory, tile by tile into one file."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from ..stream.names import ProfileName
from .encode_options import read_metadata
from .isovalues import check_interval, multiples
from .options import Isovalue, json_option, output_option
from .progress import progress_bar
from .quiet import one_warning
from .report import check_iso_output, concerning, tell, warn


@click.command("tile", short_help="Encode a field that does not fit into memory, tile by tile.")
@click.argument("source", metavar="INPUT", type=click.Path(path_type=Path, readable=False))
@output_option("OUT.iso")
@click.option("--isovalue", "isovalues", type=Isovalue(), multiple=True, metavar="V",
              help="Inside is value > V. Repeatable.")
@click.option("--interval", type=Isovalue(), metavar="S",
              help="All multiples of S within the data; these are read once more for that.")
@click.option("--offset", type=Isovalue(), metavar="V", help="With --interval: V, V + S, V + 2 S, ..")
@click.option("--tile", type=int, metavar="N",
              help="Samples along each axis of a tile: 2**k.  [default: 1024; in space 128]")
@click.option("--workers", type=click.IntRange(min=1), default=1, show_default=True, metavar="N",
              help="Processes that encode.")
@click.option("--scheduler", metavar="ADDRESS", help="Encode on the Dask cluster of this scheduler: tcp://HOST:PORT.")
@click.option("--spool", type=click.Path(path_type=Path), metavar="FOLDER",
              help="Where encoded tiles are kept until all are there; the same command goes on with them.  "
              "[default: OUT.iso.tiles]")
@click.option("--exact", is_flag=True, help="Integer data: keep the values next to the curve.")
@click.option("--tolerance", type=float, metavar="D", help="Samples that the curve may be off.  [default: 0.05]")
@click.option("--signs-only", is_flag=True, help="Keep only which samples lie above.")
@click.option("--step", type=float, metavar="S", help="Keep values next to the curve to within half this step.")
@click.option("--profile", type=click.Choice(["baseline", "main"]), default="main", show_default=True,
              help="Faster, or smaller.")
@click.option("--metadata", multiple=True, metavar="KEY=TEXT", help="A note to keep. Repeatable.")
@click.option("--no-placement", is_flag=True, help="Do not keep where the samples lie.")
@click.option("--key", metavar="NAME", help="Array of a file that has several.")
@json_option
def tile_command(
    source: Path, output: Path, isovalues: tuple[float, ...], interval: float | None, offset: float | None,
    tile: int | None, workers: int, scheduler: str | None, spool: Path | None, exact: bool, tolerance: float | None,
    signs_only: bool, step: float | None, profile: ProfileName, metadata: tuple[str, ...], no_placement: bool,
    key: str | None, as_json: bool,
) -> None:
    """Encode the isocontours of the field in INPUT tile by tile; samples of a tile are read at a time.

    INPUT is .npy, GeoTIFF (read in windows), Zarr, HDF5 or NetCDF; other formats that encode takes are read whole.

    If it is stopped, the same command goes on where it was. Curves of neighbouring tiles meet without seams. decode
    reads the whole file, or --window of it, also from a URL.
    """
    if scheduler is not None and workers > 1:
        raise click.UsageError("--scheduler and --workers contradict one another: choose one")
    if bool(isovalues) == (interval is not None):
        raise click.UsageError("give either --isovalue or --interval")
    check_interval(interval, offset)
    check_iso_output(output, source)
    notes = read_metadata(metadata)

    import isocodec

    from ..api.tiled_api import TiledIsoFile, tiling_of
    from ..field.placement import CRS, Placement
    from ..io.readers.opened import Choice
    from ..io.readers.registry import open_file
    from ..tiles.sample_range import sample_range

    started = time.perf_counter()
    with ExitStack() as stack:
        stack.enter_context(concerning(source))
        with one_warning(source):
            opened = stack.enter_context(open_file(source, Choice(key), label=""))
            field = opened.windows()
            place = Placement() if no_placement else opened.place(len(field.shape))
        if place.remark:
            warn(source, place.remark)
        if place.crs is not None:
            notes.setdefault(CRS, place.crs)
        options: dict[str, Any] = {
            "exact": exact, "tolerance": tolerance, "signs_only": signs_only, "step": step, "profile": profile,
            "metadata": notes, "placement": place.matrix,
        }
        if interval is not None:
            tiling = tiling_of(field, 0, tile, **options)
            with progress_bar("reading tiles") as progress:
                found = sample_range(field, tiling.grid, progress)
            if found is None:
                raise InputError("all samples are missing", code="missing")
            isovalues = multiples(interval, *found, offset)
        engine = stack.enter_context(_engine(workers, scheduler))
        with progress_bar("encoding tiles") as progress:
            isocodec.encode_tiles(
                field, list(isovalues), output, tile=tile, engine=engine, workers=workers if engine else None,
                spool=spool, progress=progress, **options,
            )
    seconds = time.perf_counter() - started
    from ..storage.ranges import ranges_of

    file = TiledIsoFile(ranges_of(output))
    tiles, stages = file.head.grid.total, range(len(file.head.stages))
    for number, isovalue in enumerate(file.isovalues):
        if not any(file.root.sizes[:, file.head.area(number, stage)].any() for stage in stages):
            warn(source, f"no samples lie on both sides of the isovalue {isovalue:g}: the curve is empty")
    tell(
        f"{click.format_filename(output)}: {file.size:,} bytes, {tiles:,} tile{'s' * (tiles != 1)}, {seconds:.2f} s",
        {
            "output": str(output), "bytes": file.size, "tiles": tiles, "seconds": round(seconds, 3),
            "shape": list(file.shape), "isovalues": list(file.isovalues),
        },
        as_json,
    )


def _engine(workers: int, scheduler: str | None) -> Any:
    """A context with who encodes."""
    from contextlib import nullcontext

    if scheduler is not None:
        from ..extras import optional

        distributed = optional("distributed", extra="tiles", purpose="--scheduler")
        return distributed.Client(scheduler, timeout="10s")
    if workers > 1:
        import multiprocessing
        from concurrent.futures import ProcessPoolExecutor

        from ..tiles.running import end_with_parent

        spawned = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(workers, mp_context=spawned, initializer=end_with_parent)
    return nullcontext()
