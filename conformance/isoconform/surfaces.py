"""Vectors of surfaces: points and values, from which Delaunay triangles follow (clauses 10.5, 10.9)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from isocodec import encode, thin
from isocodec.format.header import Header, write_header
from isocodec.format.surface import TinHead, write_tin
from isocodec.tin.coded_tin import SurfaceLayers, encoded
from isospec.container import ChunkType, Profile

from .draft import Draft
from .explicit import EXPLICIT
from .fields import Integers, noise, random_numbers, waves
from .streams import Chunk, File, bare

SURFACE = "surface"


def _file(head: TinHead, points: Integers, numbers: Integers) -> File:
    """A file of stated points, in layers of stated sizes."""
    ends = tuple(np.cumsum(head.counts).tolist())
    run = encoded(SurfaceLayers(points, numbers, ends), head.extent, head.largest)
    header = write_header(Header((), 0.0, None, Profile.MAIN, cells=2))
    return File(header, (Chunk(ChunkType.DOMAIN, write_tin(head) + run),))


def _scattered(count: int, side: int, largest: int) -> tuple[Integers, Integers]:
    """Distinct points, the corners of the box first, and numbers."""
    found = np.array(random_numbers(41, 2 * count, 16), np.int64).reshape(-1, 2) % side
    corners = np.array([[0, 0], [0, side - 1], [side - 1, 0], [side - 1, side - 1]])
    points = np.concatenate([corners, found])
    _, first = np.unique(points, axis=0, return_index=True)
    points = points[np.sort(first)]
    return points, np.array(random_numbers(42, len(points), 16), np.int64) % (largest + 1)


def whole() -> Iterator[Draft]:
    """Terrains of the encoder, and files of stated points."""
    field = waves((24, 31), 90, 4) + noise((24, 31), 2, 2)
    for name, options in (
        ("terrain", {"error": 6.0}), ("exact", {"error": 0.0}), ("layers", {"error": 6.0, "layers": 3}),
    ):
        data = bare(encode(thin(field if name != "exact" else field[:7, :9], **options)))  # type: ignore[arg-type]
        yield Draft(f"tin_{name}", data, 2, (EXPLICIT, SURFACE, name))
    head = TinHead((100, 100), False, -3, (5, -7), -1.5, 0.25, (), 40, (60,))
    for name, side, largest, more in (
        ("scattered", 100, 40, {}), ("palette", 100, 3, {"palette": (0, 1, 7, 8), "counts": (20,)}),
        ("one_value", 30, 0, {"counts": (12,)}), ("many_values", 60, 65535, {"counts": (25,)}),
        ("two_layers", 100, 40, {"counts": (10, 50)}),
    ):
        found = replace(head, extent=(side, side), largest=largest, **more)
        points, numbers = _scattered(sum(found.counts) - 4, side, largest)
        counts = (found.counts[0], len(points) - found.counts[0]) if len(found.counts) > 1 else (len(points),)
        yield Draft(
            f"tin_{name}", bytes(_file(replace(found, counts=counts), points, numbers)), 2, (EXPLICIT, SURFACE, name)
        )
    x, y = np.meshgrid(np.arange(6), np.arange(5), indexing="ij")
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    grid = TinHead((6, 5), True, 0, (0, 0), 0.0, 1.0, (), 9, (30,))
    yield Draft(
        "tin_grid", bytes(_file(grid, points, points.sum(axis=1))), 2, (EXPLICIT, SURFACE, "four points on a circle")
    )
    file = _file(grid, points, points.sum(axis=1))
    notes = Chunk(ChunkType.METADATA, b"{}", ancillary=True)
    yield Draft(
        "tin_notes_behind", bytes(file.with_chunks(*file.chunks, notes)), 2,
        (EXPLICIT, SURFACE, "an ancillary chunk behind the surface"),
    )
    # three points on a circle, and one that lies a unit of the radius' square beyond
    far = (1 << 27) - 1
    near = np.array([[0, 0], [0, 2 * far], [2 * far, 0], [2 * far, 2 * far], [2 * far, far], [far, 2 * far], [0, far],
                     [far + 1, 0]])
    wide = replace(grid, extent=(2 * far + 1, 2 * far + 1), counts=(8,))
    yield Draft(
        "tin_nearly_circle", bytes(_file(wide, near, np.arange(8))), 2,
        (EXPLICIT, SURFACE, "four points nearly on a circle, far apart"),
    )
    line = np.array([[0, 0], [1, 0], [2, 0], [3, 0], [1, 5]])
    yield Draft(
        "tin_border", bytes(_file(replace(grid, extent=(4, 6), counts=(5,)), line, line[:, 0])), 2,
        (EXPLICIT, SURFACE, "points on the border"),
    )


def parts() -> Iterator[Draft]:
    """Files that end early."""
    field = waves((24, 31), 90, 4)
    data = bare(encode(thin(field, error=3.0, layers=3)))
    for name, size in (("head", 14), ("first", len(data) // 4), ("later", len(data) * 2 // 3), ("end", len(data) - 2)):
        yield Draft(f"tin_truncated_{name}", data[:size], 2, (EXPLICIT, SURFACE, "truncated"))


def refused() -> Iterator[Draft]:
    """Files that violate clause 10.9."""
    points, numbers = _scattered(20, 30, 9)
    head = TinHead((30, 30), True, 0, (0, 0), 0.0, 1.0, (), 9, (len(points),))
    file = _file(head, points, numbers)
    payload = file.chunks[0].payload

    def changed(found: bytes) -> bytes:
        return bytes(file.with_chunks(Chunk(ChunkType.DOMAIN, found)))

    layer = Chunk(ChunkType.LAYERS, b"\0")
    # the payload: kind, two extents, the offset 0, the step 1 (its integer and exponent), the largest number, layers
    for name, clause, about, data in (
        ("reserved", "10.9.1", "reserved bits", changed(bytes([payload[0] | 4]) + payload[1:])),
        ("extent_zero", "10.9.1", "an extent of 0", changed(payload[:1] + b"\0" + payload[2:])),
        ("step_zero", "10.9.1", "a step of 0", changed(payload[:4] + b"\0" + payload[6:])),
        ("no_layers", "10.9.1", "no layers", changed(payload[:7] + b"\0" + payload[8:])),
        ("short_head", "10.9.1", "a head that ends early", changed(payload[:6])),
        ("run_short", "6.3", "a run that is too short", changed(payload[:12])),
        ("run_long", "6.3", "bytes left over", changed(payload + bytes(5))),
        ("layers_before", "3.5.8", "a chunk of layers before the domain", bytes(file.with_chunks(layer, *file.chunks))),
        ("layers_behind", "10.9.1", "a chunk of layers behind it", bytes(file.with_chunks(*file.chunks, layer))),
        ("twice", "3.5.8", "two surfaces", bytes(file.with_chunks(*file.chunks, *file.chunks))),
    ):
        yield Draft(f"tin_{name}", data, 2, (EXPLICIT, SURFACE, f"error: {about}"), clause)


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (whole, parts, refused):
        yield from group()
