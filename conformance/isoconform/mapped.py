"""Vectors of mapped grids (clauses 3.7.4 and 9.9), and their coordinates as canonical text (annex B.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from isocodec import encode
from isocodec.field.mapped import Coordinate
from isocodec.format.coordinate_record import CoordinatesRecord, write_coordinates
from isocodec.format.header import Header, write_header
from isocodec.grid.passes.node_run import NodeGrid, encode_run
from isospec.container import ChunkType, write_varint

from .adaptive import SPACES
from .draft import Draft
from .fields import Integers, noise, waves
from .isovalues import HIGH, SHAPES, VALUE
from .streams import Chunk, File, split
from .written import shortest

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
    for period in (b"\x00", b"\x80\x07", write_varint(1 << 32)):
        yield good[:1] + bytes([9]) + good[2:18] + period + good[18:]
    yield good[:1] + bytes([9]) + good[2:18] + b"\x87"
    yield good + bytes(5)


Residuals = Sequence[tuple[int, Sequence[int]]]
"""Of a coordinate: for each stride, and each axis along which nodes come with it, the stride and the residuals."""
_EVEN = -1
"""Instead of a context: a symbol that does not adapt."""
LARGEST = (1 << 52) - 16
"""The largest value that a node has which is predicted to be 0."""


def _run(*coordinates: Residuals) -> bytes:
    """The run that says these residuals (clause 3.7.4(5)), whatever values they lead to."""
    low, width, moved = 0, 1 << 32, 0
    for residuals in coordinates:
        models: dict[int, tuple[int, int]] = {}
        for context, bit in _symbols(residuals):
            # as in clauses 6.2 and 6.5
            p, seen = models.get(context, (1 << 15, 1))
            bound = width * p >> 16
            low, width = (low, bound) if bit else (low + bound, width - bound)
            while width < 1 << 24:
                low, width, moved = low << 8, width << 8, moved + 1
            if context != _EVEN:
                step = 65536 // (seen + 2)
                p = p + ((65536 - p) * step >> 16) if bit else p - (p * step >> 16)
                models[context] = min(max(p, 32), 65504), min(seen + 1, 158)
    return shortest(low, width, moved)


def _symbols(residuals: Residuals) -> Iterator[tuple[int, int]]:
    """Contexts within a coordinate's, and symbols."""
    for stride, row in residuals:
        grade, before = min(stride, 4) >> 1, 0
        for r in row:
            yield 9 * grade + before, int(r == 0)
            if r:
                digits = f"{abs(r):b}"[1:]
                yield 27 + grade, int(r < 0)
                yield from ((30 + e, int(e < len(digits))) for e in range(len(digits) + 1))
                yield from ((_EVEN, int(digit)) for digit in digits)
            before = 3 * (before % 3) + min(abs(r), 2)


def limits() -> Iterator[Draft]:
    """Where numbers are limited; of nodes, of values, of a run's length."""
    both, first, second = (Coordinate(axes, 0.0, 1.0) for axes in ((0, 1), (0,), (1,)))
    for name, about, shape in (
        ("most_nodes", "as many nodes as a run of no bytes may have, but not the symbols", (128, 127)),
        ("too_many_nodes", "one node more than a run of no bytes may have: the chunk before counts", (113, 144)),
    ):
        dense = write_coordinates(CoordinatesRecord((), (both, first), b""))
        yield _mapped(name, about, shape, next(_payloads(shape))[2], dense)
    # the last node is predicted by those four and two before it, which lie as far apart as they may
    up = LARGEST >> 4
    down = -(LARGEST + (LARGEST >> 1) >> 4)
    far = [(4, [up]), (2, [down]), (1, [0, 0, -(LARGEST // 16 * 33 // 8)])]
    for name, about, size, residuals in (
        ("values_most", "values as large and as small as they may be, a residual of 51 digits", 6, far),
        ("value_above", "a value of 2**52", 5, [(4, [up + 1]), (2, [0]), (1, [0, 0])]),
        ("value_below", "a value of -2**52", 5, [(4, [-up - 1]), (2, [0]), (1, [0, 0])]),
        ("residual_long", "a residual of 52 digits", 5, [(4, [1 << 51]), (2, [0]), (1, [0, 0])]),
    ):
        run = _run(residuals, [(1, [0])])
        yield _mapped(name, about, (size, 2), write_coordinates(CoordinatesRecord((), (first, second), run)))
    (rough,) = (payload for name, _, payload in _payloads(SHAPES[0]) if name == "noise")
    yield _mapped("overrun", "a run that ends too early", SHAPES[0], rough[: len(rough) // 2])


def _mapped(name: str, about: str, shape: tuple[int, ...], *payloads: bytes) -> Draft:
    """A file of a plane that holds these coordinates, and no layers."""
    chunks = [Chunk(ChunkType.COORDINATES, payload, ancillary=True) for payload in payloads]
    data = bytes(File(write_header(Header(shape, 0.5)), tuple(chunks)))
    return Draft(f"plane_mapped_{name}", data, 2, (f"mapped grid: {about}",))


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    yield from limits()
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
