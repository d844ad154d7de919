"""Vectors of mapped grids (clauses 3.7.4 and 9.9), and their coordinates as canonical text (annex C.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from isocodec import encode
from isocodec.field.mapped import Coordinate
from isocodec.format.coordinate_record import CoordinatesRecord, write_coordinates
from isocodec.grid.passes.node_run import NodeGrid, encode_run
from isospec.container import ChunkType

from .adaptive import SPACES
from .draft import Draft
from .fields import Integers, noise, waves
from .isovalues import HIGH, SHAPES, VALUE
from .streams import Chunk, split

WHOLE = 5040
"""A period that is none of the powers of two."""


def _payload(shape: tuple[int, ...], periodic: tuple[int, ...], coordinates: Sequence[Coordinate],
             goals: Sequence[Integers]) -> bytes:
    """A chunk's payload with values near the stated ones."""
    grids = [NodeGrid(one.counts(shape), one.period) for one in coordinates]
    free = [np.zeros(grid.counts, np.bool_) for grid in grids]
    shaped = [np.asarray(goal, np.int64).reshape(grid.counts) for goal, grid in zip(goals, grids, strict=True)]
    return write_coordinates(CoordinatesRecord(periodic, tuple(coordinates), encode_run(grids, shaped, free)[0]))


def _payloads(shape: tuple[int, ...]) -> Iterator[tuple[str, str, bytes]]:
    """Names, what it is about, and payloads for a field of a shape."""
    n = len(shape)
    whole = tuple(range(n))
    steps = np.indices(shape)
    axes = [Coordinate((axis,), 0.5, 0.25) for axis in whole]
    rows = [np.arange(size) ** 2 * 40 + 300 * np.arange(size) for size in shape]
    yield "axes", "a coordinate for each axis", _payload(shape, (), axes, rows)
    bent = [37 * steps[a] ** 2 + 500 * steps[a] + 3 * steps[a - 1] ** 3 for a in whole]
    nodes = [Coordinate(whole, -1.0, 0.125) for _ in whole]
    yield "nodes", "coordinates for each node", _payload(shape, (), nodes, [b - b.flat[0] for b in bent])
    rough = [noise(shape, 70 + a, 12) * (1 << 30 * (a == 0)) for a in whole]
    yield "noise", "values of many digits", _payload(shape, (), nodes, [r - r.flat[0] for r in rough])
    mixed = [replace(nodes[0], period=WHOLE), *(Coordinate((a,), 0.0, 1.0, 97) for a in whole[1:])]
    goals = [(steps[1] * 700 + noise(shape, 81, 10)) % WHOLE, *(rows[a] % 97 for a in whole[1:])]
    goals[0] = goals[0] - goals[0].flat[0]
    yield "wraps", "coordinates with periods, a periodic axis", _payload(shape, (1,), mixed, goals)
    yield "closed", "all axes periodic", _payload(shape, whole, nodes, [r - r.flat[0] for r in rough])


def _odd(shape: tuple[int, ...]) -> Iterator[bytes]:
    """Payloads that are to be ignored."""
    _, _, good = next(_payloads(shape))
    n = len(shape)
    yield b""
    yield bytes([1 << n]) + good[1:]
    yield good[:1] + bytes([0]) + good[2:]
    yield good[:1] + bytes([1 << n]) + good[2:]
    yield good[:1] + bytes([17]) + good[2:]
    yield good[:2] + bytes.fromhex("7ff0000000000000") + good[10:]
    yield good[:10] + bytes(8) + good[18:]
    yield good[: 17 * n]
    yield good[:1] + bytes([9]) + good[2:18] + b"\x00" + good[18:]
    yield good + bytes(5)


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for shape in (*SHAPES, (1, 7)):
        flat = min(shape) == 1
        space = "plane_flat" if flat else SPACES[len(shape)]
        field = np.ones((2, 7), np.int64) if flat else waves(shape, HIGH, 4)
        file = split(encode(field, VALUE, precision="signs", profile="baseline"))
        if flat:
            file = replace(file, header=file.header[:6] + b"\x01\x07" + file.header[8:], chunks=())
        n = len(shape)
        for name, about, payload in _payloads(shape):
            if flat and name in ("noise", "closed"):
                continue
            chunk = Chunk(ChunkType.COORDINATES, payload, ancillary=True)
            data = bytes(file.with_chunks(chunk, *file.chunks))
            yield Draft(f"{space}_mapped_{name}", data, n, (f"mapped grid: {about}",))
        if flat:
            continue
        odd = [Chunk(ChunkType.COORDINATES, payload, ancillary=True) for payload in _odd(shape)]
        good = next(_payloads(shape))[2]
        # the last one counts of those whose head is right, even if its run is none
        heads = [chunk for chunk in odd if chunk.payload != good + bytes(5)]
        data = bytes(file.with_chunks(Chunk(ChunkType.COORDINATES, good, ancillary=True), *heads, *file.chunks))
        yield Draft(f"{space}_mapped_odd", data, n, ("mapped grid: chunks to ignore",))
        data = bytes(file.with_chunks(*file.chunks, odd[-1]))
        yield Draft(f"{space}_mapped_leftover", data, n, ("mapped grid: bytes left over in its run",))
