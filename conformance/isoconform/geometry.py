"""Vectors of geometry on coarse and adaptive meshes: offsets and values (clauses 5.6 and 5.7)."""

from __future__ import annotations

from collections.abc import Iterator

from .adaptive import FEW, MANY, SOME, SPACES, Steps, adapt_to, base_on
from .draft import Draft, encoded, within
from .fields import noise, torus, waves
from .meshes import Point, exponent, random_mesh, uniform

HILLS = waves((17, 20), 255)
LONG = waves((5, 40), 255, 6)
RING = torus((15, 15, 9), 9, 4)
DUNES = waves((9, 10, 8), 4095, 3)
SHAPES: tuple[Point, ...] = ((13, 11), (5, 7, 6))


def offsets_uniform() -> Iterator[Draft]:
    """Offsets on uniform meshes short of the full grid."""
    for space, field, isovalue, level in (("plane", HILLS, 100.5, 5), ("space", DUNES, 600.5, 7)):
        for radix, unit in ((2, 0), (3, 0), (4, 1), (5, 1), (27, 3), (63, 0)):
            yield encoded(
                f"{space}_offsets_coarse_{radix}_unit_{unit}", field, isovalue, "offsets on a coarse mesh",
                f"{radix} parts in {2**unit} samples", "smooth", layers=[("base", level), ("offsets", radix, unit)],
            )
        plan: list[Steps] = [
            ("base", level),
            ("offsets", 2, 3),
            ("offsets", 3, 1),
            ("offsets", 8, 0),
            ("offsets", 3, 0),
        ]
        yield encoded(
            f"{space}_offsets_coarse_repeated", field, isovalue, "offsets on a coarse mesh, told finer and finer",
            "an edge that is fine enough takes no digit", layers=plan, states=True,
        )
        plan = [("base", level), ("offsets", 2, 1), ("refine", 1), ("offsets", 3, 0), ("refine", None),
                ("offsets", 4, 0), ("offsets", 5, 0)]
        yield encoded(
            f"{space}_offsets_between_rounds", field, isovalue, "offsets on a coarse mesh, then on the full grid",
            "edges that stay keep their offsets", layers=plan, states=True,
        )
    for unit, radix in ((3, 3), (24, 63)):
        yield encoded(
            f"plane_offsets_long_unit_{unit}", LONG, 100.5, "offsets on edges of many samples",
            f"{radix} parts in {2**unit} samples", layers=[("base", 2), ("offsets", radix, unit)],
        )
    plan = [("base", 1), ("offsets", 63, 0), ("refine", None), ("offsets", 63, 0)]
    yield encoded("plane_offsets_several_digits", LONG, 90.5, "edges that take several digits in a layer", layers=plan)
    for level in (4, 5, 6, 7, 8):
        yield encoded(
            f"space_offsets_implied_{level}", RING, 0.5, "offsets on a coarse mesh",
            "no offsets on subdivision edges of whole diamonds", layers=[("base", level), ("offsets", 3, 0)],
        )


def offsets_adaptive() -> Iterator[Draft]:
    """Offsets on adaptive meshes, and what becomes of them when the mesh changes."""
    for shape in SHAPES:
        n = len(shape)
        space = SPACES[n]
        full = n * exponent(shape)
        for kind, field, isovalue in (("noise", noise(shape, 51, 6), 31.5), ("smooth", waves(shape, 255, 4), 90.5)):
            coarse = random_mesh(shape, 52, SOME)
            fine = random_mesh(shape, 53, MANY, coarse)
            for radix, unit in ((3, 0), (9, 1), (5, 3)):
                yield encoded(
                    f"{space}_offsets_adaptive_{kind}_{radix}_unit_{unit}", field, isovalue,
                    "offsets on an adaptive mesh", kind, f"{radix} parts in {2**unit} samples",
                    layers=[base_on(field, fine), ("offsets", radix, unit)],
                )
            plan: list[Steps] = [
                base_on(field, coarse), ("offsets", 2, 1), ("offsets", 5, 1), adapt_to(field, fine), ("offsets", 5, 1),
                ("offsets", 28, 0), ("refine", None), ("offsets", 3), ("offsets", 4),
            ]
            yield encoded(
                f"{space}_offsets_before_and_after_{kind}", field, isovalue, "offsets on an adaptive mesh", kind,
                "edges that stay keep their offsets", layers=plan, states=True,
            )
        field = noise(shape, 54, 6)
        plan = [base_on(field, uniform(shape, full)), ("offsets", 7, 0), ("refine", None), ("offsets", 3)]
        yield encoded(
            f"{space}_offsets_all_middles", field, 31.5, "offsets on a mesh of all middles that is not the full grid",
            layers=plan, states=True,
        )
    border: tuple[Point, ...] = ((3, 6), (6, 3), (5, 6, 3))
    for seed, shape in enumerate(border, 80):
        field = noise(shape, seed, 6)
        yield encoded(
            f"{SPACES[len(shape)]}_offsets_adaptive_{'x'.join(map(str, shape))}", field, 31.5,
            "offsets on an adaptive mesh", "border: positions that coincide", "noise",
            layers=[base_on(field, random_mesh(shape, seed, MANY)), ("offsets", 9, 0)],
        )


def values() -> Iterator[Draft]:
    """Values on adaptive meshes, and with refinement in between."""
    for shape in SHAPES:
        n = len(shape)
        space = SPACES[n]
        field = noise(shape, 61, 5)
        coarse = random_mesh(shape, 62, FEW)
        fine = random_mesh(shape, 63, SOME, coarse)
        yield encoded(
            f"{space}_values_adaptive", field, 15.5, "values on an adaptive mesh", "noise",
            layers=[base_on(field, fine), ("values", None)], states=True,
        )
        plan: list[Steps] = [
            base_on(field, coarse), ("values", 2), adapt_to(field, fine), ("values", 0), ("values", 1),
            ("refine", None), ("values", None),
        ]
        yield encoded(
            f"{space}_values_around_adapt", field, 15.5, "values, adaptive refinement, values",
            "new vertices catch up, with and without a new bit for the others", layers=plan, states=True,
        )
        plan = [base_on(field, coarse), ("offsets", 5, 1), adapt_to(field, fine), ("values", 3), ("refine", None)]
        yield encoded(
            f"{space}_values_after_offsets", field, 15.5, "values drop offsets", "values that are never brought up",
            layers=plan, states=True,
        )
        plan = [("base", n), ("refine", None), ("offsets", 5), ("values", None)]
        yield encoded(
            f"{space}_values_after_offsets_full", field, 15.5, "values drop offsets, on the full grid", layers=plan,
            states=True,
        )
        yield encoded(
            f"{space}_values_scaled_adaptive", field / 8, 2.0, "values on an adaptive mesh", "power-of-two step",
            precision="step=0.25", layers=[base_on(field, fine), ("values", None)],
        )


def cuts() -> Iterator[Draft]:
    """Files that end within geometry on adaptive meshes."""
    for shape in SHAPES:
        field = noise(shape, 71, 6)
        space = SPACES[len(shape)]
        mesh = random_mesh(shape, 72, SOME)
        for kind, last in (("offsets", ("offsets", 9, 0)), ("values", ("values", None))):
            data = encoded(space, field, 31.5, layers=[base_on(field, mesh), ("offsets", 3, 1), last]).data
            about = f"within {kind} on an adaptive mesh"
            yield Draft(
                f"{space}_ends_in_{kind}_adaptive",
                within(data, kind)[1],
                field.ndim,
                ("the file ends too early", about),
            )


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (offsets_uniform, offsets_adaptive, values, cuts):
        yield from group()
