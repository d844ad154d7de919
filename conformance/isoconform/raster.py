"""Vectors of raster layers (clauses 5.12 and 7.19)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from isocodec.format.header import Header, write_header
from isospec.container import ALL, ChunkType

from .adaptive import SOME, base_on
from .draft import Draft, cut_within, encoded
from .fields import Integers, balls, checkers, noise, waves
from .meshes import random_mesh
from .rules import BASE, REFINE
from .streams import Chunk, File, layers, split, steps_of

RASTER = [("raster",)]
ABOUT = "raster layer"
SIGNS = "signs"


def letters(shape: tuple[int, int]) -> Integers:
    """Shapes of eight by eight samples that come again and again, between lines without any."""
    glyphs = (noise((4, 7, 5), 7, 8) > 120).astype(np.int64)
    out = np.zeros(shape, np.int64)
    for i in range(1, shape[0] - 7, 12):
        for j in range(1, shape[1] - 5, 7):
            out[i : i + 7, j : j + 5] = glyphs[(3 * i + 5 * j) % 4]
    return out


def shapes() -> Iterator[Draft]:
    """Boxes of all sorts, from nothing."""
    for shape in ((2, 2), (3, 6), (6, 3), (31, 33), (32, 32), (33, 31), (63, 5), (5, 64), (65, 65)):
        name = "x".join(map(str, shape))
        yield encoded(
            f"plane_raster_{name}", noise(shape, 11, 2) // 3, 0.5, f"{ABOUT}: {name} samples", layers=RASTER,
            states=shape == (3, 6),
        )
    for name, field in (
        ("letters", letters((70, 90))), ("stripes", waves((40, 70), 255) // 16 % 2), ("checkers", checkers((40, 40))),
        ("disc", balls((80, 80), [((70, 90), 40)])), ("above", np.ones((40, 70), np.int64)),
        ("below", np.zeros((70, 40), np.int64)), ("noise", noise((66, 66), 12, 1)),
    ):
        yield encoded(f"plane_raster_{name}", field, 0.5, f"{ABOUT}: {name}", layers=RASTER)
    yield encoded(
        "plane_main_raster_letters", letters((70, 90)), 0.5, f"{ABOUT}: letters, main profile", layers=RASTER,
        profile="main",
    )


def behind() -> Iterator[Draft]:
    """Behind other layers, before geometry, with missing samples, and before an isovalue that leans on it."""
    field = waves((40, 45), 40, 3) + noise((40, 45), 13, 5)
    mesh = random_mesh((40, 45), 14, SOME)
    gone = noise((40, 45), 15, 3) == 0
    for name, about, plan in (
        ("base", "behind a base", [("base", 0), *RASTER]),
        ("odd", "behind a base of an odd level", [("base", 3), *RASTER]),
        ("rounds", "behind rounds", [("base", 1), ("refine", 4), *RASTER]),
        ("adaptive", "behind an adaptive base", [base_on(field, mesh), *RASTER, ("values", 2)]),
        ("values", "behind and before values", [("base", 2), ("values", 2), *RASTER, ("values", None)]),
        ("offsets", "behind and before offsets", [("base", 2), ("offsets", 3, 1), *RASTER, ("offsets", 9)]),
        ("exact", "before values", [*RASTER, ("values", None)]),
    ):
        for profile in ("baseline", "main"):
            mark = "" if profile == "baseline" else "main_"
            yield encoded(
                f"plane_{mark}raster_{name}", field, 36, f"{ABOUT}: {about}", layers=plan, profile=profile,
                states=name == "rounds",
            )
    masked = [*RASTER, ("values", 3)]
    yield encoded("plane_raster_masked", field, 36, f"{ABOUT}: missing samples", layers=masked, mask=gone)
    for name, other in (("leaf", [("leaf_base",), ("values", 3)]), ("base", [("base", 1), ("refine", None)])):
        yield encoded(
            f"plane_raster_leant_on_{name}", field, (36, 40), f"{ABOUT}: another isovalue leans on it",
            layers={36: [*RASTER, ("values", 2)], 40: other},
        )
    whole = encoded("", letters((70, 90)), 0.5, layers=[("base", 4), *RASTER]).data
    yield Draft("plane_raster_cut", cut_within(whole, "raster"), 2, (ABOUT, "cut run"))


def refused() -> Iterator[Draft]:
    """Raster layers where there may be none."""
    run = bytes(8)
    for name, shape, steps, clause, about in (
        ("space", (5, 5, 5), ((REFINE, 0),), "5.12", "n = 3"),
        ("large", (1 << 14, (1 << 14) + 1), ((REFINE, 0),), "5.12", "more than 2**28 samples"),
        ("twice", (5, 5), ((REFINE, 0), (REFINE, 0)), "3.6", "on the full grid"),
        ("then_base", (5, 5), ((REFINE, 0), (BASE, 0)), "3.6", "a base behind it"),
    ):
        file = File(write_header(Header(shape, 0.5)), (layers(steps_of(*steps), run),))
        yield Draft(f"bad_raster_{name}", bytes(file), len(shape), (f"{ABOUT}: {about}",), clause)
    for name, before in (("base", (BASE, ALL)), ("raster", (REFINE, 0))):
        unread = Chunk(ChunkType.CUT_LAYERS, b"\0" + steps_of(before, (REFINE, 0)))
        data = bytes(File(write_header(Header((5, 5), 0.5)), (unread,)))
        about = f"on the full grid behind a {name}, of which nothing is read"
        yield Draft(f"bad_unread_raster_after_{name}", data, 2, (f"{ABOUT}: {about}",), "3.6")
    field = waves((9, 9), 40, 3)
    leaning = split(encoded("", field, (20, 24), precision=SIGNS).data)
    kept = [chunk for chunk in leaning.chunks if chunk.type in (ChunkType.LAYERS, ChunkType.ISOVALUE)]
    file = leaning.with_chunks(*kept[:-1], Chunk(ChunkType.LAYERS, steps_of((REFINE, 0)) + run))
    yield Draft("bad_raster_leaning", bytes(file), 2, (f"{ABOUT}: an isovalue that leans on another one",), "5.12")


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (shapes, behind, refused):
        yield from group()
