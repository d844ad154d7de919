"""Vectors of files with several isovalues (clauses 3.5.5 and 5.9)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from isocodec import Decoder
from isocodec.format.chunks import CHECKSUM_BYTES, write_further, write_turn
from isocodec.format.events import IsovalueRead
from isospec.container import (
    ALL,
    FAR_LEAN,
    MAX_ISOVALUES,
    ChunkType,
    IsovalueKind,
    Operation,
    write_varint,
    zigzag,
)

from .adaptive import SOME, SPACES, Steps, adapt_to, base_on, random_run
from .draft import Draft, encoded, within
from .dump import COMPLETE, CUT_OFF, dump
from .fields import Integers, noise, random_numbers, waves
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
                {"precision": "exact", "order": "independent"},
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
        for name, step, apart, about in (
            ("between_steps", 0.3, (10.0, 10.5, 9.25), "no whole steps apart"),
            ("below_zero", 0.3, (0.0, -0.5, 0.75), "zero and below"),
            ("tenths", 0.1, (10.1, 10.6, 11.1, 9.7), "tenths apart, which binary64 has not"),
            ("steps_far", 2.0**-36, (10.0, 1e6, 10.5), "too many steps apart for values to tell of each other"),
        ):
            yield encoded(
                f"{space}_isovalues_{name}", field / 8 - 10 * (name == "below_zero"), apart,
                f"isovalues of scaled data: {about}", precision=f"step={step!r}",
            )
        yield encoded(
            f"{space}_isovalues_steps_in_part", field / 8, tuple(v / 8 for v in part),
            "isovalues of scaled data: values known in part", layers={v / 8: plan for v, plan in part.items()},
            precision="step=0.09",
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
            ("values_twice", "values before and after refinement", [*GRID, ("values", 3)],
             [("base", 2), ("refine", 1), ("values", 2), ("refine", None), ("values", None)]),
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
        yield Draft(
            f"{space}_isovalues_end_in_leaf_base", within(leaf, "leaf_base")[1], n, ("the file ends too early", about)
        )
        data = encoded(space, field, (VALUE, VALUE + 4), precision="exact").data
        yield Draft(f"{space}_isovalues_end_in_chunk", data[: _second(data) + 2], n, ("the file ends too early", about))
        yield Draft(f"{space}_isovalues_end_in_values", data[:-15], n, ("the file ends too early", about))


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
    rough = noise((4, 3), 96, 6)
    # each leans on the one before
    yield encoded("plane_isovalues_65", rough, range(65), "65 isovalues", precision="signs", layers=4)
    many = [*range(32, -1, -1), *range(33, 128)]
    about = "isovalues: leaning on one 33 before"
    yield encoded("plane_isovalues_lean_far", rough, many, about, precision="signs", layers=4)
    start = Chunk(ChunkType.ISOVALUE, write_further(1, VALUE + 2, 0))
    for name, back in (("near", b"\1"), ("none", b"\0")):
        # a number of its own that is small
        payload = bytes([start.payload[0] | FAR_LEAN]) + back + start.payload[1:]
        data = bytes(file.with_chunks(first, Chunk(ChunkType.ISOVALUE, payload)))
        yield Draft(f"plane_isovalues_escaped_{name}", data, 2, ("isovalues: how far back, apart",))
    # nothing is coded of most of them: they cost next to nothing
    empty = [Chunk(ChunkType.ISOVALUE, write_further(i, i / 10, i - 1)) for i in range(1, MAX_ISOVALUES)]
    flat = split(encoded("flat", rough, 0, precision="signs", layers=4).data)
    # the last one leans on isovalue 0
    empty[-1] = Chunk(ChunkType.ISOVALUE, write_further(MAX_ISOVALUES - 1, 9.55, 0))
    yield Draft(
        "plane_isovalues_4096", bytes(flat.with_chunks(*flat.chunks, *empty)), 2, ("the most isovalues", "decimals"),
    )


def decimals() -> Iterator[Draft]:
    """Isovalues as decimals, and what their digits are rounded to."""
    field = _mixed(SHAPES[0])
    for name, about, isovalues in (
        # the last one is what 853 times a tenth is rounded to
        ("tenths", "tenths", (85.1, 85.2, 85.3, 85.30000000000001)),
        ("negative", "negative ones", (-0.1, -1e-15, 85.1)),
        # more digits and a smaller number each time
        ("places", "one to fourteen places", tuple(float(f"85.{'0' * k}1") for k in range(14))),
    ):
        yield encoded(f"plane_isovalues_decimal_{name}", field, isovalues, f"decimals: {about}", precision="signs")
    # others than writers take: places that are not needed, and digits that binary64 does not have
    plain = split(encoded("plain", field, VALUE, precision="signs").data)
    for name, places, units in (("zeros", 3, 90000), ("digits", 15, (1 << 53) - 1), ("minus", 15, 1 - (1 << 53))):
        payload = bytes([IsovalueKind.DECIMAL << 6 | 1, places]) + write_varint(zigzag(units))
        data = bytes(plain.with_chunks(*plain.chunks, Chunk(ChunkType.ISOVALUE, payload)))
        yield Draft(f"plane_isovalues_decimal_{name}", data, 2, ("decimals: not in their shortest form",))


def turns() -> Iterator[Draft]:
    """Layers of several isovalues in turn (clause 3.5.9)."""
    isovalues = (LOW_VALUE, VALUE, VALUE + 2, HIGH_VALUE)
    about = "layers of isovalues in turn"
    for shape in ((17, 14), (33, 32), (65, 9), (63, 8), (7, 8, 6), (9, 5, 8)):
        space, field = SPACES[len(shape)], _mixed(shape)
        size = "_".join(map(str, shape))
        for name, options in (("signs", {"precision": "signs"}), ("values", {"precision": "exact"}), ("offsets", {})):
            options = {"order": "levels", **options}
            yield encoded(f"{space}_turns_{name}_{size}", field, isovalues, about, name, states=True, **options)
    for shape in SHAPES:
        space, field = SPACES[len(shape)], _mixed(shape)
        yield encoded(f"{space}_turns_main", field, isovalues, about, profile="main", order="levels", precision="exact")
        gone = np.zeros(shape, bool)
        gone[2:5, 3:6] = True
        yield encoded(f"{space}_turns_masked", field, isovalues, about, "missing samples", order="levels", mask=gone)
        # small curves begin beyond the others
        peaks = np.minimum(field, 60)
        peaks[(3,) * len(shape)], peaks[(5,) * len(shape)] = 120, 90
        yield encoded(f"{space}_turns_late", peaks, (30, 50, 80, 100), about, order="levels", precision="signs")
        whole = encoded("whole", field, isovalues, order="levels", precision="signs").data
        yield Draft(f"{space}_turns_cut", whole[: len(whole) * 2 // 3], len(shape), (about, "the file ends too early"))
        file = split(whole)
        further = Chunk(ChunkType.ISOVALUE, write_further(4, 200.5, 3))
        yield Draft(f"{space}_turns_then_isovalue", bytes(file.with_chunks(*file.chunks, further)), len(shape),
                    (about, "a further isovalue behind them"))
        begun = [chunk for chunk in file.chunks if chunk.type == ChunkType.ISOVALUE]
        turn = Chunk(ChunkType.TURN, write_turn(range(1, 4)))
        # layers of values in turn, which encoders write isovalue by isovalue
        program = ((Operation.BASE_AND_REFINE, 2), (Operation.VALUES, ALL))
        data = random_run(file.with_chunks(*begun, turn, turn), steps_of(*program, b"\x44"), 12)
        features = (about, "a run of random bytes", "the file ends too early")
        yield Draft(f"{space}_turns_random", data, len(shape), features)


def shared() -> Iterator[Draft]:
    """Isovalues that share models with one that leans on them or on which they lean, before it has layers (5.9.2)."""
    for shape in SHAPES:
        space, field = SPACES[len(shape)], _mixed(shape)
        file = split(encoded("any", field, VALUE, precision="signs").data)
        (layers,) = file.chunks

        def further(number: int, lean: int) -> Chunk:
            return Chunk(ChunkType.ISOVALUE, write_further(number, VALUE + 5 * number, lean))

        def turn(number: int) -> Chunk:
            return Chunk(ChunkType.TURN, write_turn(range(number, number + 1)))

        # isovalue 1 has layers before 0, on which it leans; 2 begins with copies of its models, 3 shares those of 0
        begun = (further(1, 0), turn(1), layers, further(2, 1), further(3, 0), turn(0))
        program = steps_of((Operation.BASE, 1))
        runs = (bytes(random_numbers(seed, size, 8)) for seed in range(97, 997) for size in range(12, 3, -1))
        every = (Chunk(ChunkType.LAYERS, program + run) for run in runs)
        first = next(each for each in every if dump(bytes(file.with_chunks(*begun, each))).exit_code == COMPLETE)
        for number, name in ((2, "copied"), (3, "shared")):
            start = bytes(file.with_chunks(*begun, first, turn(number), Chunk(ChunkType.LAYERS, program + bytes(99))))
            start = start[: -CHECKSUM_BYTES - 99]
            data = next(
                start + run for seed in range(997, 1997)
                if dump(start + (run := bytes(random_numbers(seed, 7, 8)))).exit_code == CUT_OFF
            )
            about = (f"isovalues: models {name}", "a run of random bytes", "the file ends too early")
            yield Draft(f"{space}_isovalues_models_{name}", data, len(shape), about)


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
            chunk = Chunk(ChunkType.ISOVALUE, write_further(1, further, 0))
            # eight bits above and below
            data = random_run(file.with_chunks(*file.chunks, chunk), steps_of(*program, b"\x88"), len(program))
            about = ("a run of random bytes", "the file ends too early")
            yield Draft(f"{SPACES[n]}_isovalues_random_{name}", data, n, about)


_OFF_THE_BOX = (
    ((2, -4, -1, 0), (2, 4, 2, -1), (1, -3, 3, 0), (-1, -1, 0, -1), (5, -1, 0, 0)),
    ((3, -4, -2, -1), (0, 1, 2, 1), (0, -4, 2, -1), (-4, 1, 1, -2), (5, -2, 0, 1)),
    ((4, -1, 2, -1), (-1, 1, 3, 0), (-1, -2, 6, -2), (-6, 1, -1, -3), (6, -2, 2, 1)),
)


def off_the_box() -> Iterator[Draft]:
    """Signs at an earlier isovalue of middles off the box, which are those of their clamped images."""
    yield encoded(
        "space_isovalues_off_the_box", np.array(_OFF_THE_BOX), (-5.5, 5.5), "isovalues", "topology",
        layers="topology", precision="signs",
    )


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (off_the_box, whole, planned, cuts, chunks, decimals, turns, shared, strange):
        yield from group()
