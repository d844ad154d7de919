"""Vectors of surfaces that violate clause 10.9, one for each way to do so, and of the largest and farthest ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from isocodec.entropy.run import WritingRun
from isocodec.errors import FormatError
from isocodec.format.header import Header, write_header
from isocodec.format.surface import TinHead
from isocodec.tin.coded_tin import SurfaceLayers, _Surface, encoded
from isocodec.tin.models import new_coder
from isospec.container import ChunkType, DomainKind, Profile, write_varint, zigzag

from .draft import Draft
from .explicit import EXPLICIT
from .fields import Integers, random_numbers
from .streams import Chunk, File
from .surfaces import SURFACE, _file

# the last one comes last in the tree, too
POINTS = np.array([[0, 0], [7, 0], [0, 8], [7, 8], [3, 4], [5, 2]], np.int64)
NUMBERS = np.array([3, 5, 2, 7, 4, 6], np.int64)
_BOX, _LARGEST = (10, 10), 9
_FAR = 1 << 28


def _surface(payload: bytes) -> bytes:
    header = write_header(Header((), 0.0, None, Profile.MAIN, cells=2))
    return bytes(File(header, (Chunk(ChunkType.DOMAIN, payload),)))


def _head(**changes: Sequence[int]) -> bytes:
    """A head number by number; ``changes`` put others in the place of some. A first byte, then varints."""
    fields: dict[str, Sequence[int]] = {
        "kind": [DomainKind.POINTS << 4 | 3], "extent": _BOX, "unit": [zigzag(0), zigzag(0), zigzag(0)],
        "offset": [zigzag(1), zigzag(0)], "step": [zigzag(1), zigzag(0)], "largest": [_LARGEST],
        "palette": [1] * _LARGEST, "layers": [1, len(POINTS)],
    }
    kind, *others = ({**fields, **changes}).values()
    return bytes(kind) + b"".join(write_varint(number) for numbers in others for number in numbers)


def _heads() -> Iterator[tuple[str, str, bytes]]:
    """Names, what is wrong and files: numbers out of range, of which the run does not depend."""
    run = encoded(SurfaceLayers(POINTS, NUMBERS, (len(POINTS),)), _BOX, _LARGEST)
    far, beyond = 1 << 61, 1 << 53
    for name, about, changes in (
        ("reserved_3", "the other reserved bit", {"kind": [DomainKind.POINTS << 4 | 11]}),
        ("exponent_far", "an exponent of 1101", {"unit": [zigzag(1101), 0, 0]}),
        ("exponent_low", "an exponent of -1101", {"unit": [zigzag(-1101), 0, 0]}),
        ("origin_far_0", "an origin beyond 2**61", {"unit": [0, zigzag(far + 1), 0]}),
        ("origin_far_1", "an origin beyond 2**61", {"unit": [0, 0, zigzag(-far - 1)]}),
        ("offset_far", "an integer beyond 2**53", {"offset": [zigzag(beyond + 1), 0]}),
        ("offset_exponent", "an exponent of 1101", {"offset": [zigzag(1), zigzag(1101)]}),
        ("offset_low", "an exponent of -1101", {"offset": [zigzag(1), zigzag(-1101)]}),
        ("offset_infinite", "an offset beyond all floats", {"offset": [zigzag(1), zigzag(1024)]}),
        ("step_far", "an integer beyond 2**53", {"step": [zigzag(beyond + 1), 0]}),
        ("step_infinite", "a step beyond all floats", {"step": [zigzag(1), zigzag(1024)]}),
        ("step_least", "a step that is 0 as a float", {"step": [zigzag(1), zigzag(-1075)]}),
        ("step_negative", "a step below 0", {"step": [zigzag(-1), 0]}),
        ("palette_twice", "an entry of the palette twice", {"palette": [0] + [1] * (_LARGEST - 1)}),
        ("palette_far", "an entry of the palette too far", {"palette": [(1 << 40) + 1] + [1] * (_LARGEST - 1)}),
        ("no_points", "a layer of no points", {"layers": [1, 0]}),
    ):
        yield name, about, _surface(_head(**changes) + run)
    head = TinHead(_BOX, True, 0, (0, 0), 0.0, 1.0, (), _LARGEST, (len(POINTS),))
    for axis in range(2):
        extent = tuple(_FAR + 1 if k == axis else side for k, side in enumerate(_BOX))
        far_box = replace(head, extent=extent)  # type: ignore[arg-type]
        yield f"extent_far_{axis}", "an extent beyond 2**28", bytes(_file(far_box, POINTS, NUMBERS))
    yield "largest_far", "a largest number beyond 65535", bytes(_file(replace(head, largest=65536), POINTS, NUMBERS))
    yield "many_points", "a layer of more than 2**28 points", _surface(
        _head(layers=[1, _FAR + 1]) + _run((_FAR + 1,), POINTS, NUMBERS)
    )
    many = np.array([[x, y] for x in range(10) for y in range(10)])
    first = np.array([[0, 0], [9, 0], [0, 9], [9, 9]])
    inner = np.array([p for p in many.tolist() if p not in first.tolist()])[:64]
    counts = (4, *[1] * 64)
    points = np.concatenate([first, inner])
    yield "many_layers", "65 layers", bytes(_file(replace(head, counts=counts), points, points.sum(axis=1) % 10))


def _run(counts: Sequence[int], points: Integers, numbers: Integers, sizes: Sequence[int] = ()) -> bytes:
    """A run of layers as far as it can be decoded; ``sizes`` of the layers, where they are not as stated."""
    run = WritingRun(new_coder())
    run.room(1 << 14)
    surface = _Surface(run, _BOX, len(points))
    begin = 0
    try:
        for count, size in zip(counts, sizes or [len(points)], strict=True):
            surface.layer(count, _LARGEST, points[begin : begin + size], numbers[begin : begin + size])
            begin += size
    except FormatError:
        # what is wrong has been coded
        pass
    return run.end()


def _runs() -> Iterator[tuple[str, str, str, bytes]]:
    """Names, clauses, what is wrong and files: positions and numbers."""

    def file(points: Integers, numbers: Integers, *sizes: int) -> bytes:
        return _surface(_head(layers=[len(sizes), *sizes]) + _run(sizes, points, numbers, sizes))

    line = POINTS[:1] + np.array([[i, i] for i in range(4)])
    yield "line", "10.9.3", "points of the first layer on a line", file(line, NUMBERS[:4], 4)
    twice = np.concatenate([POINTS, POINTS[4:5]])
    yield "point_twice", "10.9.3", "a position in two layers", file(twice, np.append(NUMBERS, 1), 6, 1)
    outside = np.concatenate([POINTS, [[9, 9]]])
    yield "outside", "10.9.3", "a corner in the second layer", file(outside, np.append(NUMBERS, 1), 6, 1)
    # the point that comes last, so that nothing is missing behind it
    for name, about, number in (("number_above", "above the largest", 10), ("number_below", "below 0", -1)):
        yield name, "10.9.4", f"a number {about}", file(POINTS, np.append(NUMBERS[:-1], number), 6)
    corner = NUMBERS.copy()
    corner[:4] = 15
    yield "corner_above", "10.9.4", "a first corner above the largest number", file(POINTS, corner, 6)


def far() -> Iterator[Draft]:
    """Points so far apart that tests of circles go beyond 64 bits and floats, and weights beyond 2**24."""
    # rectangles, whose four points lie on a circle: ranks decide
    x, y = np.meshgrid(np.arange(7), np.arange(8), indexing="ij")
    lattice = np.stack([x.ravel() * 44_739_241, y.ravel() * 38_347_921], axis=1)
    places = np.array(random_numbers(71, 40, 16)).reshape(-1, 2) * 4096
    more = np.array(random_numbers(72, 40, 12)).reshape(-1, 2)
    points = np.unique(np.concatenate([lattice, places + more]), axis=0)
    numbers = np.array(random_numbers(73, len(points), 16))
    head = TinHead((_FAR, _FAR), True, 0, (0, 0), 0.0, 1.0, (), 65535, (len(points),))
    features = (EXPLICIT, SURFACE, "circles beyond 64 bits", "weights beyond 2**24")
    yield Draft("tin_far", bytes(_file(head, points, numbers)), 2, features)


def largest() -> Iterator[Draft]:
    """Heads whose numbers are as large as they may be."""
    run = encoded(SurfaceLayers(POINTS, NUMBERS, (len(POINTS),)), _BOX, _LARGEST)
    most, least = (
        _head(
            unit=[zigzag(sign * 1100), zigzag(sign << 61), zigzag(-sign << 61)],
            offset=[zigzag(sign << 53), zigzag(sign * 970)], step=[zigzag(1 << 53), zigzag(sign * 970)],
            palette=[1 << 40] * _LARGEST,
        )
        for sign in (1, -1)
    )
    for name, head in (("largest", most), ("least", least)):
        yield Draft(f"tin_head_{name}", _surface(head + run), 2, (EXPLICIT, SURFACE, f"the {name} numbers in the head"))


def early() -> Iterator[Draft]:
    """Files that end within a surface: what is wrong with its head is not seen, what is wrong with its run is."""
    features = (EXPLICIT, SURFACE, "truncated")
    payload = _head(step=[zigzag(-1), 0]) + _run((6,), POINTS, NUMBERS)
    yield Draft("tin_truncated_bad_head", _surface(payload)[:-8], 2, (*features, "a wrong head"))
    line = POINTS[:1] + np.array([[i, i] for i in range(4)])
    payload = _head(layers=[1, 4]) + _run((4,), line, NUMBERS[:4]) + bytes(30)
    yield Draft("tin_truncated_bad_run", _surface(payload)[:-16], 2, (EXPLICIT, SURFACE, "error: a line"), "10.9.3")


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (far, largest, early):
        yield from group()
    for name, about, data in _heads():
        yield Draft(f"tin_head_{name}", data, 2, (EXPLICIT, SURFACE, f"error: {about}"), "10.9.1")
    for name, clause, about, data in _runs():
        yield Draft(f"tin_{name}", data, 2, (EXPLICIT, SURFACE, f"error: {about}"), clause)
