"""Vectors of series of frames (clauses 3.5.7, 5.11 and 7.18)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from isocodec import Frames, encode
from isocodec.grid.layers.plan import Entry
from isocodec.stream.container import closed
from isocodec.stream.encoder import SeriesFrames
from isocodec.stream.options import Layers, Options
from isospec.container import ChunkType, Operation

from .adaptive import SPACES, random_run
from .draft import Draft, encoded_series, within
from .fields import Integers, balls, noise, waves
from .streams import Chunk, File, split, steps_of

SHAPES = ((17, 14), (9, 8, 10))
HIGH, VALUE = 255, 85.5
COUNT = 4
WIDE = (70, 40)
"""More than a block of softened signs along one axis, and than two along the other."""


def _moving(shape: tuple[int, ...], count: int = COUNT, rough: int = 30) -> list[Integers]:
    """Hills that move along all axes, with some noise of their own."""
    wide = tuple(side + count for side in shape)
    hills = waves(wide, HIGH, 4)
    return [
        hills[tuple(slice(t, t + side) for side in shape)] + noise(shape, rough, t) if rough
        else hills[tuple(slice(t, t + side) for side in shape)] for t in range(count)
    ]


def whole() -> Iterator[Draft]:
    """As the reference encoder's options give them."""
    for shape in SHAPES:
        space, frames = SPACES[len(shape)], _moving(shape)
        for profile in ("baseline", "main"):
            for name, options in (
                ("signs", {"precision": "signs"}),
                ("values", {"precision": "exact", "interval": 2}),
                ("offsets", {"interval": 3}),
            ):
                yield encoded_series(
                    f"{space}_frames_{profile}_{name}", frames, VALUE, f"frames: {name}", profile=profile,
                    states=name == "values", **options,
                )
        yield encoded_series(
            f"{space}_frames_isovalues", frames, (VALUE, VALUE + 9, VALUE - 7), "frames: several isovalues",
            interval=2, precision="exact", profile="main", states=True,
        )
        yield encoded_series(
            f"{space}_frames_independent", frames, VALUE, "frames: that lean on none", order="independent",
            precision="signs",
        )
        base: Sequence[Entry] = [("base", len(shape)), ("refine", None)]
        for name, plan in (("refined", base), ("leaf_base", [("leaf_base",)]), ("coarse", [("base", 5)])):
            plans = encode_plans(frames, plan, base)
            yield Draft(f"{space}_frames_main_{name}", plans, len(shape), ("series of frames", f"frames: {name}"))
        finer = encode_plans(frames, base, [("base", 3)])
        yield Draft(
            f"{space}_frames_main_finer", finer, len(shape), ("series of frames", "frames: after a coarse one")
        )
        file, frame = split(encode_plans(frames[:1], base, base)), Chunk(ChunkType.FRAME, b"")
        program = steps_of((Operation.BASE_AND_REFINE, 2))
        yield Draft(
            f"{space}_frames_main_between", random_run(file.with_chunks(*file.chunks, frame, frame), program, 3),
            len(shape), ("series of frames", "frames: one without layers", "the file ends too early"),
        )
        yield encoded_series(
            f"{space}_frames_main_adapted", frames, VALUE, "frames: adaptive meshes", profile="main",
            precision="signs", keep_topology=True,
        )
        empty = [np.zeros_like(frames[0]), *frames[:2], np.zeros_like(frames[0]), frames[2]]
        yield encoded_series(
            f"{space}_frames_empty", empty, VALUE, "frames: some without a curve", profile="main", precision="signs",
        )
        gone = noise(shape, 9, 5) == 0
        yield encoded_series(
            f"{space}_frames_missing", frames, VALUE, "frames: missing samples", mask=gone, profile="main",
            precision="exact",
        )
    smooth = _moving(WIDE, 3, 0)
    yield encoded_series(
        "plane_frames_main_wide", smooth, VALUE, "frames: softened signs of several blocks", profile="main",
        precision="signs",
    )
    spot = [balls(WIDE, [((2 * (29 + t), 40), 9)]) for t in range(3)]
    yield encoded_series(
        "plane_frames_main_spot", spot, -0.5, "frames: softened signs beside a block without vertices", profile="main",
        precision="signs",
    )
    smooth = _moving((18, 11, 9), 3, 0)
    yield encoded_series(
        "space_frames_main_wide", smooth, VALUE, "frames: softened signs of several blocks", profile="main",
        precision="signs",
    )


def encode_plans(frames: list[Integers], plan: Sequence[Entry], first: Sequence[Entry]) -> bytes:
    """A series in the main profile whose first frame has one plan and all others another."""
    series = SeriesFrames(VALUE, Options.of(profile="main", layers=first, interval=0), None)

    def chunks() -> Iterator[bytes]:
        yield from series.chunks(frames[0])
        grid = series.grid
        assert grid is not None
        grid.file = replace(grid.file, options=replace(grid.file.options, layers=Layers.of(plan)))
        for frame in frames[1:]:
            yield from series.chunks(frame)

    return b"".join(closed(chunks()))


def _file(shape: tuple[int, ...]) -> File:
    """A small series of two isovalues."""
    return split(
        encode(Frames(_moving(shape, 3)), (VALUE, VALUE + 9), profile="baseline", interval=2, precision="signs")
    )


def parts() -> Iterator[Draft]:
    """Series that end early: truncated, without all isovalues of the last frame."""
    for shape in SHAPES:
        space, n = SPACES[len(shape)], len(shape)
        file = _file(shape)
        places = [i for i, chunk in enumerate(file.chunks) if chunk.type == ChunkType.FRAME]
        data = bytes(file.with_chunks(*file.chunks[: places[-1]]))
        yield Draft(
            f"{space}_frames_fewer_isovalues", data, n,
            ("series of frames", "frames: the last one without its last isovalue"),
        )
        data = bytes(file.with_chunks(*file.chunks[: places[-1] + 1]))
        yield Draft(
            f"{space}_frames_begun", data, n, ("series of frames", "frames: the last isovalue without layers")
        )
        data = bytes(file)
        yield Draft(f"{space}_frames_truncated", data[: len(data) * 2 // 3], n, ("series of frames", "truncated"))
        yield encoded_series(
            f"{space}_frames_promises", _moving(shape, 3), (VALUE, VALUE + 9), "frames: promises", precision=1,
            profile="main",
        )
        whole = encode(Frames(_moving(shape)), VALUE, profile="main", precision="exact", interval=0)
        yield Draft(
            f"{space}_frames_end_in_values", within(whole, "values")[1], n, ("series of frames", "truncated")
        )


def refused() -> Iterator[Draft]:
    """Chunks of frames that violate the format."""
    for shape in SHAPES:
        space, n = SPACES[len(shape)], len(shape)
        file = _file(shape)
        chunks = file.chunks
        first = next(i for i, chunk in enumerate(chunks) if chunk.type == ChunkType.SERIES)
        second, third = [i for i, chunk in enumerate(chunks) if chunk.type == ChunkType.FRAME][:2]
        layers = next(chunk for chunk in chunks if chunk.type == ChunkType.LAYERS)
        isovalue = next(chunk for chunk in chunks if chunk.type == ChunkType.ISOVALUE)

        def changed(number: int, payload: bytes) -> tuple[Chunk, ...]:
            return tuple(replace(c, payload=payload) if i == number else c for i, c in enumerate(chunks))  # noqa: B023

        for name, clause, about, found in (
            ("no_interval", "3.5.7", "no interval", changed(first, b"")),
            ("interval_and_more", "3.5.7", "more than an interval", changed(first, b"\2\0")),
            ("interval_long", "3.5.7", "an interval not in its shortest form", changed(first, b"\x80\2")),
            ("behind_layers", "3.5.7", "a chunk of series behind layers", (layers, chunks[first])),
            ("series_twice", "3.5.7", "a second chunk of series", (chunks[first], chunks[first])),
            ("series_later", "3.5.7", "a second chunk of series in a further frame",
             (*chunks[: second + 1], chunks[first])),
            ("no_series", "3.5.7", "a frame in a file that is no series", (layers, chunks[second])),
            ("second_base", "3.6", "the next frame without a chunk of frames", (chunks[first], layers, layers)),
            ("lean_on_itself", "3.5.7", "leaning on an isovalue that has not begun", changed(second, b"\1")),
            ("lean_too_far", "3.5.7", "leaning on an isovalue that has not begun", changed(third, b"\2")),
            ("lean_and_more", "3.5.7", "more than one number", changed(third, b"\0\0")),
            ("lean_cut", "3.5.7", "a number that does not end", changed(third, b"\x81")),
            ("lean_long", "3.5.7", "a number not in its shortest form", changed(third, b"\x80\1")),
            ("ancillary", "3.5.2", "a frame marked as ancillary",
             tuple(replace(c, ancillary=True) if i == second else c for i, c in enumerate(chunks))),
            ("series_ancillary", "3.5.2", "a series marked as ancillary",
             tuple(replace(c, ancillary=True) if i == first else c for i, c in enumerate(chunks))),
            ("isovalue_later", "3.5.7", "another isovalue in a further frame", (*chunks[: second + 1], isovalue)),
            ("mask_later", "3.5.7", "a mask in a further frame", (*chunks[: second + 1], Chunk(ChunkType.MASK, b""))),
        ):
            yield Draft(
                f"{space}_frames_{name}", bytes(file.with_chunks(*found)), n, (f"error: {about}",), clause
            )


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (whole, parts, refused):
        yield from group()
