"""``isocodec encode`` and ``decode`` of values on meshes (spec clause 10)."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .panels import Panels
from .quiet import one_warning, written
from .receive import warn_of_frames, warn_of_others
from .report import concerning, tell, write_output

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from numpy.typing import NDArray

    from ..io.writers.picture import Step
    from ..limits import Limits

NOT_ON_MESHES = (
    "interval", "offset", "labels", "steps", "preserve_topology", "criterion", "plan", "base_level", "spacing",
    "missing", "nodata", "no_placement", "key", "channel", "frame", "follow", "frames", "frame_axis",
)
"""Options of encode that mean nothing there."""


def encode_on_mesh(
    source: Path, output: Path, values: str, isovalues: Sequence[float], samples: int | None,
    options: Mapping[str, object], as_json: bool,
) -> None:
    """Encode values at the points of a mesh in a file; ``options`` are those of `encode_mesh`."""
    given = click.get_current_context().params
    wrong = [name for name in NOT_ON_MESHES if given.get(name) not in (None, False, ())]
    if wrong:
        option = "label" if wrong[0] == "labels" else wrong[0].replace("_", "-")
        raise click.UsageError(f"--{option} means nothing for values on a mesh")
    if not isovalues:
        raise click.UsageError("give --isovalue")
    import isocodec

    from ..io.readers.mesh_read import read_mesh
    from ..io.readers.points_read import POINTS, read_points

    started = time.perf_counter()
    with concerning(source):
        with one_warning(source):
            found = (read_points if source.suffix.lower() in POINTS else read_mesh)(source, samples)
        data = isocodec.encode_mesh(
            found.points, found.cells, found.values_named(values), list(isovalues), **options  # type: ignore[arg-type]
        )
        info = isocodec.inspect(data)
        assert info.domain is not None
    seconds = time.perf_counter() - started
    write_output(output, data)
    layers = len(info.layers)
    tell(
        f"{click.format_filename(output)}: {len(data):,} bytes, {layers} layers, {seconds:.2f} s",
        {
            "output": str(output),
            "bytes": len(data),
            "layers": layers,
            "seconds": round(seconds, 3),
            "points": len(found.points),
            "cells": info.domain.cells if found.cells is None else len(found.cells),
            "isovalues": [float(isovalue) for isovalue in isovalues],
        },
        as_json,
    )


def mesh_of(domain: Path | None) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """Points and cells of a file with a mesh, if one is named."""
    if domain is None:
        return None
    from ..io.readers.mesh_read import read_mesh

    with concerning(domain), one_warning(domain):
        found = read_mesh(domain)
    assert found.cells is not None
    return found.points, found.cells


def steps_on_mesh(
    data: bytes, steps: int, domain: Path | None, isovalue: float | None, frame: int, limits: Limits
) -> list[Step]:
    """Of an isovalue of a file of a mesh, what prefixes decode to, after that many layers at most."""
    import isocodec

    from ..api.frames import check_frame
    from ..io.writers.picture import Step

    info = isocodec.inspect(data)
    number = info.number_of(isovalue)
    count = sum((layer.frame, layer.isovalue) == (frame, number) for layer in info.layers)
    decoder = isocodec.MeshDecoder(mesh_of(domain), limits, only=info.chain(number), frame=frame)
    decoder.feed(data)
    drawn: list[Step] = []
    panels = Panels([""] * count, steps)
    own = 0
    for event in decoder:
        if isinstance(event, isocodec.MeshLayerComplete) and decoder.present == (frame, number):
            own += 1
            if panels.draws(own, lambda: len(decoder.drawn(number).cells) > 0):
                drawn.append(Step(decoder.drawn(number), event.offset, len(data)))
    decoder.close()
    check_frame(decoder, frame)
    return drawn


def decode_on_mesh(
    source: Path, data: bytes, output: Path, named: Path, domain: Path | None, isovalue: float | None,
    frame: int | None, max_bytes: int | None, limits: Limits, as_json: bool,
) -> None:
    """Decode a file of values on a mesh; ``domain`` is the file with the mesh, if ``source`` does not hold it.

    ``named`` has the suffix that names the format.
    """
    import isocodec

    from ..io.writers.output_formats import OutputOptions
    from ..io.writers.things import Thing
    from ..io.writers.write import check

    with concerning(output):
        suffix, form = check(named, Thing("contour", None, sampled=False))
    mesh = mesh_of(domain)
    started = time.perf_counter()
    with concerning(source):
        if isovalue is None and 2 in form.several:
            contours = isocodec.decode_all(data, frame=frame, max_bytes=max_bytes, mesh=mesh, limits=limits)
        else:
            contours = [
                isocodec.decode(
                    data, isovalue=isovalue, frame=frame, max_bytes=max_bytes, mesh=mesh, limits=limits
                )
            ]
            if isovalue is None:
                warn_of_others(source, contours[0].isovalue, isocodec.inspect(data).isovalues)
    warn_of_frames(source, data, frame)
    seconds = time.perf_counter() - started
    n = contours[0].n
    with concerning(output):
        done = written(output, contours, OutputOptions(to=suffix))
    pieces = "segments" if n == 2 else "triangles"
    points, cells = sum(len(contour.points) for contour in contours), sum(len(contour.cells) for contour in contours)
    tell(
        f"{click.format_filename(output)}: {points:,} points, {cells:,} {pieces}, {seconds:.2f} s",
        {
            "output": str(output),
            "bytes": done.bytes,
            "points": points,
            "cells": cells,
            "isovalues": [contour.isovalue for contour in contours],
            "complete": all(contour.complete for contour in contours),
            "seconds": round(seconds, 3),
        },
        as_json,
    )
