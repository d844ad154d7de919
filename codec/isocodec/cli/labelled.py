"""``isocodec encode --label`` given several times: the borders of several labels in one file."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from .encode_options import read_metadata, read_numbers
from .inputs import local_input
from .mapped import read_tolerance
from .quiet import one_warning
from .report import concerning, tell, warn, write_output

_TAKEN = (
    "source", "output", "labels", "independent", "tolerance", "signs_only", "preserve_topology", "profile", "metadata",
    "spacing", "no_placement", "key", "channel", "frame", "kind", "limit_samples", "follow", "as_json",
)
"""Options that go with several labels."""


def encode_labelled(source: Path, output: Path, given: Mapping[str, Any]) -> None:
    """Encode several labels of the volume or picture in a file; ``given`` has all options of the command."""
    for name, value in given.items():
        if name not in _TAKEN and value not in (None, False, ()):
            option = name.replace("_", "-")
            raise click.UsageError(f"--{option} and several labels contradict one another: give one --label")
    tolerance = read_tolerance(given["tolerance"])
    if given["tolerance"] is not None and tolerance is None:
        raise click.UsageError("--tolerance of several labels is a number of cells")
    if tolerance is not None and given["signs_only"]:
        raise click.UsageError("--tolerance and --signs-only contradict one another: choose one")
    notes, spacing = read_metadata(given["metadata"]), read_numbers("--spacing", given["spacing"])

    import isocodec

    from ..field.placement import CRS, PLACEMENT, Placement
    from ..io.readers.opened import Choice
    from ..io.readers.registry import open_file

    placed = spacing is None and not given["no_placement"] and PLACEMENT not in notes
    where, frame = {"samples": given["limit_samples"], "follow": given["follow"]}, given["frame"]
    choice = Choice(given["key"], given["channel"])
    with concerning(source):
        with (
            local_input(source, given["kind"], given["limit_samples"]) as path, one_warning(source),
            open_file(path, choice, label="", **where) as opened,
        ):
            field = opened.values(frame)
            place = opened.place(field.ndim, frame) if placed else Placement()
        if place.remark:
            warn(source, place.remark)
        if place.coordinates is not None:
            warn(source, "coordinates of its own are left out of a file of several labels")
        if place.crs is not None:
            notes.setdefault(CRS, place.crs)
        started = time.perf_counter()
        data = isocodec.encode_labels(
            field, given["labels"], tolerance=tolerance, preserve_topology=given["preserve_topology"],
            profile=given["profile"], metadata=notes, placement=place.matrix if placed else spacing,
        )
        seconds = time.perf_counter() - started
    write_output(output, data)
    count = len(given["labels"])
    tell(
        f"{click.format_filename(output)}: {len(data):,} bytes, {count} labels, {seconds:.2f} s",
        {"output": str(output), "bytes": len(data), "labels": [float(label) for label in given["labels"]],
         "shape": list(field.shape), "seconds": round(seconds, 3)},
        given["as_json"],
    )
