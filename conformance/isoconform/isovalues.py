"""Vectors of files with several isovalues (clauses 3.5.5 and 5.9)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from isocodec import Decoder
from isocodec.format.chunks import write_further
from isocodec.format.events import IsovalueRead
from isocodec.stream.truncation import truncate
from isospec.container import ALL, MAX_ISOVALUES, ChunkType, Operation

from .adaptive import SOME, SPACES, Steps, adapt_to, base_on, random_run
from .draft import Draft, cut_within, encoded, within
from .fields import Integers, noise, waves
from .meshes import exponent, random_mesh, uniform
from .streams import Chunk, split, steps_of

SHAPES = ((17, 14), (7, 8, 6))
HIGH = 255
LOW_VALUE, VALUE, HIGH_VALUE = 70.5, 85.5, 100.5
Plans = Mapping[float, Sequence[Steps]]

GRID: list[Steps] = [("base", 2), ("refine", None)]


def _mixed(shape: tuple[int, ...]) -> Integers:
    """Hills with some noise: curves lie close by, and not all small features are common to them."""
    return waves(shape, HIGH, 4) + noise(shape, 90, 4)


def whole() -> Iterator[Draft]:
    """As the reference encoder's options give them."""
    for shape in SHAPES:
        space, field = SPACES[len(shape)], _mixed(shape)
        for name, isovalues, about, options in (
            ("values_above", (VALUE, VALUE + 2), "above the earlier one", {"precision": "exact"}),
            ("values_below", (VALUE, VALUE - 2.5), "below the earlier one", {"precision": "exact"}),
            ("offsets_above", (VALUE, VALUE + 3), "above the earlier one", {}),
            ("offsets_below", (VALUE, VALUE - 1), "below the earlier one", {}),
            ("signs", (VALUE, VALUE + 1), "above the earlier one", {"precision": "signs", "layers": 3}),
            ("single_rate", (VALUE, VALUE - 1), "below the earlier one", {"precision": "signs", "layers": 12}),
            (
                "equal_signs", (VALUE, VALUE + 0.25, VALUE + 0.1), "equal signs, isovalues of all kinds",
                {"precision": "exact"},
            ),
            ("topology", (VALUE, HIGH_VALUE), "adaptive bases", {"precision": "signs", "keep_topology": True}),
            (
                "independent", (VALUE, VALUE + 2), "independent of one another",
                {"precision": "exact", "independent": True},
            ),
            ("empty", (VALUE, 300), "a curve without points", {"precision": "exact"}),
            ("far", (VALUE, 1e300, -1e300), "too far away for values to tell of each other", {"precision": "signs"}),
            ("empty_first", (-5, VALUE), "leaning on one without a curve", {"precision": "exact"}),
        ):
            level = options.get("layers")
            if isinstance(level, int):
                options = {**options, "layers": min(level, len(shape) * exponent(shape))}
            yield encoded(
                f"{space}_isovalues_{name}", field, isovalues, f"isovalues: {about}", states="above" in name, **options,
            )
        yield encoded(
            f"{space}_isovalues_many", field, (HIGH_VALUE, LOW_VALUE, HIGH_VALUE + 4, LOW_VALUE - 1, VALUE),
            "isovalues that lean on different earlier ones", precision="exact",
        )
        part: dict[float, list[Steps]] = {VALUE: [*GRID, ("values", 4)]}
        for further, base in ((VALUE + 2, GRID), (VALUE - 3, [("leaf_base",)]), (HIGH_VALUE, GRID)):
            part[further] = [*base, ("values", None)]
        yield encoded(
            f"{space}_isovalues_values_in_part", field, tuple(part), "isovalues: values known in part", layers=part,
            states=True,
        )
        yield encoded(
            f"{space}_isovalues_scaled", field / 8, (10.0, 10.5, 9.25), "isovalues of scaled data",
            "power-of-two step", precision="step=0.25",
        )

    yield encoded(
        "plane_isovalues_far_apart", *_far_apart(), "isovalues: numbers that are too large to be taken over",
        precision="exact",
    )


def _far_apart() -> tuple[Integers, tuple[float, ...]]:
    """Isovalues almost 2**52 apart; one corner is known to all of them, and the first tells how far it is."""
    apart = (1 << 52) - 64
    field = np.full((9, 9), -5, np.int64)
    field[0, 0] = apart
    field[7:, 7:] = 5 - apart
    field[8, 8] = -3 - 2 * apart
    return field, (0.5, -float(apart), -2.0 * apart)


def planned() -> Iterator[Draft]:
    """Layers of one kind leaning on layers of another."""
    for shape in SHAPES:
        n = len(shape)
        space, field, full = SPACES[n], _mixed(shape), n * exponent(shape)
        mesh = random_mesh(shape, 91, SOME)
        fine = random_mesh(shape, 92, SOME, mesh)
        cases: tuple[tuple[str, str, Sequence[Steps], Sequence[Steps]], ...] = (
            ("leaf_base", "on the uniform mesh of the earlier one", [("base", 5), ("offsets", 3, 0)],
             [("leaf_base",), ("offsets", 5, 0), ("refine", None), ("offsets", 3)]),
            ("leaf_base_full", "on the full grid", [*GRID, ("values", None)], [("leaf_base",), ("values", None)]),
            ("leaf_base_adaptive", "on the adaptive mesh of the earlier one",
             [base_on(field, mesh), ("offsets", 9, 1)],
             [("leaf_base",), adapt_to(field, fine), ("offsets", 9, 1), ("refine", None), ("values", None)]),
            ("leaf_base_adapted", "on a mesh of which some levels are explicit and uniform as well",
             [("base", 1), adapt_to(field, mesh | uniform(shape, 1)), ("refine", 2)], [("leaf_base",), ("values", 2)]),
            ("values_on_part", "leaning on one whose values are not complete", [*GRID, ("values", 3)],
             [*GRID, ("values", None)]),
            ("values_on_coarse", "leaning on one that is not refined to the full grid",
             [("base", 3), ("refine", 2), ("values", None)], [("base", 1), ("refine", None), ("values", None)]),
            ("values_on_adaptive", "leaning on an adaptive mesh", [base_on(field, mesh), ("values", None)],
             [*GRID, ("values", None)]),
            ("adaptive_on_values", "an adaptive mesh leaning on values", [*GRID, ("values", 4)],
             [base_on(field, mesh), adapt_to(field, fine), ("values", None)]),
            ("adaptive_on_adaptive", "two adaptive meshes", [base_on(field, mesh), adapt_to(field, fine)],
             [base_on(field, mesh, 2), adapt_to(field, fine | uniform(shape, 2)), ("refine", None)]),
            ("offsets_on_coarse", "offsets of equal edges on coarse meshes", [base_on(field, fine), ("offsets", 27, 0)],
             [base_on(field, fine), ("offsets", 9, 0), ("offsets", 27, 0)]),
            ("offsets_on_values", "offsets leaning on values", [*GRID, ("values", None)], [*GRID, ("offsets", 9)]),
            ("values_on_offsets", "values leaning on offsets", [*GRID, ("offsets", 9)], [*GRID, ("values", None)]),
            ("equal_topology", "one adaptive mesh for both", [base_on(field, uniform(shape, full - 1))],
             [("leaf_base",), ("refine", None)]),
            ("base_only", "leaning on a base of the root's simplices", [("base", 0)], GRID),
            ("nothing_told", "leaning on one that has no base", [], GRID),
            ("nothing_more", "an isovalue without layers", [*GRID, ("values", None)], []),
        )
        for name, about, first, second in cases:
            other = VALUE + (2 if n == 2 else -2)
            if name == "nothing_more":
                # the encoder ends a file with layers
                yield _three(f"{space}_isovalues_{name}", field, {VALUE: first, 200.0: second, VALUE + 9: GRID}, about)
                continue
            plans = {VALUE: first, other: second}
            yield encoded(
                f"{space}_isovalues_{name}", field, (VALUE, other), f"isovalues: {about}", layers=plans,
                states=name.startswith("leaf"),
            )


def _three(name: str, field: Integers, plans: Plans, about: str) -> Draft:
    return encoded(name, field, tuple(plans), f"isovalues: {about}", layers=plans)


def cuts() -> Iterator[Draft]:
    """Files with several isovalues, made shorter or ended too early."""
    for shape in SHAPES:
        n = len(shape)
        space, field = SPACES[n], _mixed(shape)
        rough, mesh = noise(shape, 95, 8), random_mesh(shape, 93, SOME)
        leaf = encoded(
            space, rough, (100.5, 180.5), layers={100.5: [base_on(rough, mesh)], 180.5: [("leaf_base",)]},
        ).data
        about = "several isovalues"
        yield Draft(f"{space}_isovalues_cut_leaf_base", cut_within(leaf, "leaf_base"), n, ("cut run", about))
        yield Draft(
            f"{space}_isovalues_end_in_leaf_base", within(leaf, "leaf_base")[1], n, ("the file ends too early", about)
        )
        data = encoded(space, field, (VALUE, VALUE + 4), precision="exact").data
        yield Draft(f"{space}_isovalues_end_in_chunk", data[: _second(data) + 2], n, ("the file ends too early", about))
        yield Draft(f"{space}_isovalues_end_in_values", data[:-15], n, ("the file ends too early", about))
        yield Draft(f"{space}_isovalues_cut", truncate(data, max_bytes=len(data) - 30), n, ("cut run", about))


def _second(data: bytes) -> int:
    """Where the second isovalue begins."""
    decoder = Decoder()
    decoder.feed(data)
    return next(e.offset for e in decoder if isinstance(e, IsovalueRead)) - 2


def chunks() -> Iterator[Draft]:
    """Isovalues and chunks of other kinds, in any order."""
    field = _mixed(SHAPES[0])
    file = split(encoded("plane", field, (VALUE, VALUE + 2), precision="exact").data)
    unknown = Chunk(20, b"anything", ancillary=True)
    first, second, last = file.chunks
    yield Draft(
        "plane_isovalues_between_chunks",
        bytes(file.with_chunks(unknown, first, unknown, second, unknown, last, unknown)), 2,
        ("unknown ancillary chunks around isovalues",),
    )
    # each leans on the one before
    yield encoded(
        "plane_isovalues_64", noise((4, 3), 96, 6), range(MAX_ISOVALUES), "the most isovalues", precision="signs",
        layers=4,
    )


def strange() -> Iterator[Draft]:
    """Runs of random bytes for an isovalue that leans on a proper one: no encoder writes that, every decoder reads it.

    The file ends before the run does, so that nothing depends on how the run ends.
    """
    for shape in SHAPES:
        n = len(shape)
        field = _mixed(shape)
        mesh = random_mesh(shape, 94, SOME)
        plan = [base_on(field, mesh), ("values", None)]
        file = split(encoded("any", field, VALUE, layers=plan).data)
        for name, further, program in (
            ("leaf_base", VALUE + 1, ((Operation.LEAF_BASE, 0), (Operation.ADAPT, 1), (Operation.VALUES, ALL))),
            ("adaptive", VALUE - 1, ((Operation.ADAPTIVE_BASE, 0), (Operation.ADAPT, 1), (Operation.VALUES, ALL))),
        ):
            chunk = Chunk(ChunkType.ISOVALUE, write_further(further, 0))
            # eight bits above and below
            data = random_run(file.with_chunks(*file.chunks, chunk), steps_of(*program, b"\x88"), len(program))
            about = ("a run of random bytes", "the file ends too early")
            yield Draft(f"{SPACES[n]}_isovalues_random_{name}", data, n, about)


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (whole, planned, cuts, chunks, strange):
        yield from group()
