"""The mesh under a curve or surface as a file: ``isocodec decode --mesh``."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

import click

from ..errors import FormatError
from ..limits import Limits
from .quiet import one_warning
from .receive import receive, warn_of_frames, warn_of_others
from .report import check_output, concerning, read_iso, tell


def write_mesh(
    source: Path, output: Path, isovalue: float | None, whole: bool, in_samples: bool, partial: bool, limits: Limits,
    layers: int | None, max_bytes: int | None, as_json: bool, frame: int | None,
) -> None:
    """Decode what was asked for and write its mesh, of the whole box or the tube alone."""
    from ..io.writers.output_formats import OutputOptions
    from ..io.writers.things import Thing
    from ..io.writers.write import check, write

    with concerning(output):
        check(output, Thing("mesh", None))
    check_output(output, source)
    data = read_iso(source)

    import isocodec

    started = time.perf_counter()
    decoder, number = receive(source, data, isovalue, partial, limits, layers, max_bytes, frame)
    if isovalue is None:
        # what lies behind the layers asked for may be damaged
        with suppress(FormatError):
            warn_of_others(source, decoder.isovalues[number], isocodec.inspect(data).isovalues)
    warn_of_frames(source, data, frame)
    with concerning(source):
        mesh = decoder.tessellation(number, whole)
        n = len(mesh.shape)
        with concerning(output):
            _, form = check(output, Thing("mesh", n))
        held = sum(array.nbytes for array in (mesh.points, mesh.cells, mesh.levels, mesh.above))
        decoder.hold(held + form.cost[n].peak(len(mesh.points), len(mesh.cells)))
        with one_warning(output, "writing"):
            written = write(output, mesh, options=OutputOptions(in_samples=in_samples))
    seconds = time.perf_counter() - started
    pieces = "triangles" if len(mesh.shape) == 2 else "tetrahedra"
    counts = f"{len(mesh.points):,} vertices, {len(mesh.cells):,} {pieces}"
    tell(
        f"{click.format_filename(output)}: {counts}, {seconds:.2f} s",
        {
            "output": str(output),
            "bytes": written.bytes,
            "vertices": len(mesh.points),
            pieces: len(mesh.cells),
            "isovalue": mesh.isovalue,
            "shape": list(mesh.shape),
            "complete": mesh.complete,
            "seconds": round(seconds, 3),
        },
        as_json,
    )
