"""Vectors written from the syntax, not by the encoder: rules that no field, or hardly one, leads a decoder to.

Runs of random bytes are given by their seed, the first that reaches the rule; the state is what the text of the
specification makes of them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from isocodec.format.chunks import write_further, write_turn
from isocodec.format.header import Header, write_header
from isospec.container import ALL, ESCAPE, MAX_SIDE, ChunkType, Operation, Profile

from .adaptive import SPACES
from .draft import Draft, encoded
from .fields import noise, random_numbers
from .streams import Chunk, File, Step, layers, steps_of
from .written import random_layers, said

BASE, REFINE, VALUES, OFFSETS, BOTH, ADAPTIVE, ADAPT, LEAVES = Operation
MAIN = Profile.MAIN
WIDE = MAX_SIDE[2]
RANDOM = ("a run of random bytes",)
MANY, SOME = 43000, 1500
"""Samples of the row that brings mixing weights to their limit, 52 bits each, and of those that are not all alike."""

Steps = tuple[Step, ...]


def _random(
    name: str, about: str, shape: tuple[int, ...], steps: Steps, seed: int, size: int, *,
    profile: Profile = Profile.BASELINE, clause: str | None = None,
) -> Draft:
    """One isovalue, one program, random bytes."""
    start = File(write_header(Header(shape, 0.5, profile=profile)), ())
    return _draft(name, shape, random_layers(start, steps_of(*steps), seed, size), (about, *RANDOM), clause)


def _leaning(
    name: str, about: str, shape: tuple[int, ...], programs: dict[float, Steps], seed: int, size: int, *,
    profile: Profile = Profile.BASELINE,
) -> Draft:
    """Isovalues that each lean on the one before, random bytes for each; of an empty program nothing is sent."""
    file = File(write_header(Header(shape, next(iter(programs)), profile=profile)), ())
    for number, (isovalue, steps) in enumerate(programs.items()):
        if number:
            further = Chunk(ChunkType.ISOVALUE, write_further(number, isovalue, number - 1))
            file = file.with_chunks(*file.chunks, further)
        if steps:
            file = random_layers(file, steps_of(*steps), seed + 10000 * number, size)
    return _draft(name, shape, file, (about, *RANDOM))


def _draft(
    name: str, shape: tuple[int, ...], file: File, features: tuple[str, ...], clause: str | None = None
) -> Draft:
    name = f"{SPACES[len(shape)]}_{name}"
    if clause:
        name, features = f"bad_{name}", (f"refused: {features[0]}",)
    return Draft(name, bytes(file), len(shape), features, clause)


def meshes() -> Iterator[Draft]:
    """Rules of meshes and of inference that need bases with holes, or very large domains."""
    yield _random(
        "explicit_not_candidates", "new components in uniform rounds, next to explicit vertices", (9, 9),
        ((ADAPTIVE, 0), (REFINE, ALL)), 4, 40,
    )
    yield _random(
        "inference_at_centres", "inference at centres of the cubes of the base", (17, 17), ((BASE, 3), (REFINE, ALL)),
        3143, 40,
    )
    yield _random(
        "inference_at_corners", "inference at corners of the cubes of the base", (17, 17),
        ((ADAPTIVE, 3), (REFINE, 4)), 17, 40,
    )
    yield _random(
        "inference_off_the_box", "inference that starts off the box", (11, 6), ((ADAPTIVE, 2), (REFINE, ALL)), 1847, 40
    )
    yield _random(
        "assumed_below", "corners that are not known where the ends differ", (9, 9), ((BASE, 2), (REFINE, ALL)), 278, 30
    )
    about = "crossed edges of the full grid that are edges of no leaf"
    for shape, seed in (((4, 5), 32), ((3, 3, 3), 218)):
        yield _random("offsets_beside_leaves", about, shape, ((BASE, ALL), (OFFSETS, 2)), seed, 16)
        yield _random("values_beside_leaves", about, shape, ((BASE, ALL), (VALUES, 2), b"\x22"), seed, 16)
    yield _random(
        "assumed_twice", "a corner that one diamond makes known, and another one assumes with the other sign", (17, 17),
        ((BASE, 4), (REFINE, ALL)), 14, 30,
    )
    yield _random(
        "first_mixed_member", "middles known before the round: only the first mixed member bisects the others",
        (6, 3, 6), ((BASE, 1), (REFINE, 1), (OFFSETS, 4), b"\0", (REFINE, 1), (OFFSETS, 4), b"\0", (REFINE, ALL)),
        185, 40,
    )


def curves() -> Iterator[Draft]:
    """The parabolas: their second branch, and points too far away."""
    row, column = np.indices((33, 33), np.int64)
    yield encoded(
        "plane_second_branch", (row - 16) ** 2 - 10 * column + 10, 0.5,
        "a second branch after more than 20 points of the first one", layers=[("base", None)],
    )
    field = np.zeros((1000, 600), np.int64)
    field[5:12, 6:11] = field[985:989, 584] = 1
    yield encoded(
        "plane_far_apart", field, 0.5, "points of the curve more than 1023 units away", precision="signs", layers=2,
    )


def isovalues() -> Iterator[Draft]:
    """Isovalues whose signs contradict the earlier one's, and leaf bases on adapted meshes."""
    about = "new components after a leaf base on an adapted mesh"
    programs: dict[float, Steps] = {0.5: ((ADAPTIVE, 0),), 1.5: ((LEAVES, 0), (REFINE, ALL))}
    yield _leaning("leaf_base_turned", about, (5, 5), programs, 165, 40)
    yield _leaning("leaf_base_turned", about, (5, 5, 5), programs, 411, 40)
    programs = {0.5: ((ADAPTIVE, 0),), 1.5: ((LEAVES, 0),), 2.5: ((BASE, 3),)}
    yield _leaning(
        "leaning_on_leaf_base", "leaning on a leaf base on an adapted mesh: signs that are inferred are not certain",
        (9, 9), programs, 67, 40,
    )
    yield _leaning(
        "first_sign_before_lean", "a first simplex is mixed, whatever the earlier isovalue says", (5, 5, 5),
        {0.5: ((BASE, 2),), 1.5: ((BASE, 3),)}, 87, 20,
    )
    exact: Steps = ((BASE, ALL), (VALUES, ALL), b"\x55")
    yield _leaning(
        "values_below_zero", "values taken over by an isovalue below 0", (9, 9), {0.5: exact, -3.5: exact}, 8, 60
    )
    for isovalue, side, seed in ((1.5, "above", 45), (-1.0, "below", 1)):
        programs = {0.5: ((BASE, ALL), (OFFSETS, 2)), isovalue: ((BASE, ALL), (OFFSETS, 8))}
        yield _leaning(
            f"offsets_on_fewer_parts_{side}", f"offsets {side} those of an earlier isovalue in fewer parts", (9, 9),
            programs, seed, 60,
        )


def turns() -> Iterator[Draft]:
    """Values of isovalues in turn: what the earlier one has when a vertex gets its number is what counts."""
    start = File(write_header(Header((4, 5), 0.5)), (Chunk(ChunkType.ISOVALUE, write_further(1, 3.5, 0)), _turn(0, 1)))
    steps: Steps = ((BASE, ALL), (VALUES, 1), b"\x44", (VALUES, ALL))
    about = "values in turn: the earlier isovalue's get more exact after they were taken over"
    yield _draft("turns_bounds", (4, 5), random_layers(start, steps_of(*steps), 0, 60), (about, *RANDOM))
    further = Chunk(ChunkType.ISOVALUE, write_further(1, 2.5, 0))
    file = File(write_header(Header((9, 9), 0.5)), (further,))
    programs: tuple[tuple[tuple[int, int], Steps, int, int], ...] = (
        ((0, 1), ((BASE, 2),), 38, 20),
        ((1, 1), ((VALUES, 1), b"\x44"), 38, 20),
        ((0, 0), ((REFINE, ALL), (VALUES, ALL), b"\x44"), 38, 40),
        ((1, 1), ((REFINE, ALL), (VALUES, 0), (VALUES, ALL)), 39, 60),
    )
    for (first, last), steps, seed, size in programs:
        file = random_layers(file.with_chunks(*file.chunks, _turn(first, last)), steps_of(*steps), seed, size)
    about = "values in turn: the earlier isovalue has none when the first vertices get their numbers"
    yield _draft("turns_values_first", (9, 9), file, (about, *RANDOM))


def _turn(first: int, last: int) -> Chunk:
    """A turn of isovalues, the last one included."""
    return Chunk(ChunkType.TURN, write_turn(range(first, last + 1)))


def bounds() -> Iterator[Draft]:
    """Where numbers are limited."""
    yield _random(
        "offsets_most_parts", "offsets on an edge of 2**24 samples: 2**24 parts are enough", (WIDE, 2),
        ((BASE, 0), (OFFSETS, ESCAPE), b"\x3e\0"), 2, 60,
    )
    yield _random(
        "arguments_by_escape", "arguments below 14 that follow as numbers", (9, 9),
        ((BASE, ESCAPE), b"\2", (REFINE, ESCAPE), b"\1"), 25, 20,
    )
    yield encoded(
        "plane_models_settled", noise((2, 200), 7, 2), 1.5, "more symbols in a context than its model counts",
        precision="exact", layers=1,
    )
    for n, level in ((2, 30), (3, 42)):
        about = "more than 100 ancestors come into the mesh with one vertex"
        yield _draft("many_ancestors", (MAX_SIDE[n],) * n, _descended(n, level), (about,))


def _descended(n: int, level: int) -> File:
    """One new component, deep in the largest domain, on the mesh of the root's simplices; a level of phase 0."""
    start = File(write_header(Header((MAX_SIDE[n],) * n, 0.5)), ())
    empty = [("continue", "1"), ("significance", "0")] * level
    # by turns the second and the third child; the only slot of the cube needs no symbol, CONTRARY is the last one
    turns = "".join(("01", "001")[i % 2] for i in range(level // n))
    return said(
        start, steps_of((BASE, 0), (ADAPT, 1)), ("origin", "0"), ("component", "0"), *empty, ("continue", "1"),
        ("significance", f"1{turns}0"),
    )


def main_profile() -> Iterator[Draft]:
    """Main profile: rows that stand for all larger numbers, and limits."""
    yield _random(
        "main_large_cubes", "main profile: cubes of 2**9 samples and more", (1025, 1025), ((BASE, 1), (REFINE, 2)), 162,
        20, profile=MAIN,
    )
    yield _random(
        "main_deep_mesh", "main profile: middles 24 levels and more above the full grid", (WIDE, WIDE),
        ((ADAPTIVE, 0),), 1, 20, profile=MAIN,
    )
    yield _random(
        "main_sure", "main profile: opinions that are limited", (9, 9, 9), ((BASE, 3), (REFINE, ALL)), 123, 40,
        profile=MAIN,
    )
    line = np.repeat([[0], [1]], 6000, axis=1)
    yield encoded(
        "plane_main_rarest", line, 0.5, "main profile: 8192 vertices and more for one new component", profile="main",
        precision="signs", layers=2,
    )
    # bits of 0 by the million drive the weights to their limit, some of 1 at the end show where that is
    wide = np.repeat([[0], [1]], MANY, axis=1)
    wide[:, -1] = -(1 << 51), 1 << 51
    wide[:, -SOME:-1] += np.array([[-1], [1]]) * noise((2, SOME - 1), 1, 1)
    yield encoded(
        "plane_main_mixing_limit", wide, 0.5, "main profile: weights at their limit", "4.5 million symbols",
        profile="main", precision="exact",
    )
    yield _random(
        "main_near_crossings", "main profile: crossings next to one another that are not extended", (9, 9),
        ((BASE, ALL), (OFFSETS, ESCAPE), b"\x3c"), 21, 40, profile=MAIN,
    )
    yield _random(
        "main_sides_at_the_border", "main profile: leaves beside an edge that reach beyond the box", (6, 6),
        ((ADAPTIVE, 0), (OFFSETS, 8), b"\0", (OFFSETS, ESCAPE), b"\x3e\0"), 2807, 40, profile=MAIN,
    )
    # a curve around one corner: of the last edge's ends both have another crossing that falls together with them
    start = File(write_header(Header((65, 65), 0.5, profile=MAIN)), ())
    nearest = said(
        start, steps_of((BASE, 1), (OFFSETS, ESCAPE), b"\x3e\0"), ("origin", "0"), ("component", "1"),
        ("location", "01"), ("base_sign", "1011"), ("component", "0"),
        ("offset_bit", 13 * "1" + 27 * "0" + "10110100101"),
    )
    about = "main profile: crossings in both ends of an edge"
    yield _draft("main_no_distance", (65, 65), nearest, (about, "the file ends too early"))
    yield _leaning(
        "main_leaning_on_nothing", "main profile: new components of an isovalue that leans on one without a base",
        (9, 9), {0.5: (), 1.5: ((BASE, 2), (REFINE, ALL))}, 5, 30, profile=MAIN,
    )


def refused() -> Iterator[Draft]:
    """Runs that violate a clause with their last symbol: a decoder that does not notice finds nothing wrong."""
    start = File(write_header(Header((6, 3), 0.5)), ())
    nowhere = said(start, steps_of((BASE, 3)), ("origin", "0"), ("component", "1"), ("location", "11"))
    yield _draft("start_nowhere", (6, 3), nowhere, ("a component starts in a simplex that does not exist",), "5.3.2")
    for shape, name, clause, about, seed in (
        ((5, 5), "start_not_mixed", "5.3.3", "where the curve does not pass", 548),
        ((5, 5), "start_visited", "5.3.2", "where one has been", 0),
        ((5, 5, 5), "start_not_mixed", "5.3.3", "where the surface does not pass", 92),
        ((5, 5, 5), "start_visited", "5.3.2", "where one has been", 2),
    ):
        yield _random(
            f"main_{name}", f"main profile: a component starts {about}", shape, ((BASE, 3),), seed, 14, profile=MAIN,
            clause=clause,
        )
    yield _random(
        "corners_torn", "two diamonds give a corner different signs", (9, 9, 9), ((BASE, 3), (REFINE, ALL)), 195, 60,
        clause="5.4.3",
    )
    for name, about, shape, steps, seed, size in (
        ("main_leftover", "bytes left over in a run", (5, 5), ((BASE, 1), (REFINE, 1)), 65, 20),
        ("main_overrun", "symbols past the end of a run", (5, 5, 5), ((BASE, 3), (REFINE, ALL)), 0, 8),
    ):
        run = layers(steps_of(*steps), bytes(random_numbers(seed, size, 8)))
        file = File(write_header(Header(shape, 0.5, profile=MAIN)), (run,))
        yield _draft(name, shape, file, (f"main profile: {about}",), "6.3")


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (meshes, curves, isovalues, turns, bounds, main_profile, refused):
        yield from group()
