"""Vectors of the main profile: every network and kind of symbols, in both dimensions (clauses 7.10 to 7.17)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from isocodec import encode
from isocodec.grid.lattice.tables import cube_exponent

from .adaptive import SPACES
from .draft import Draft, encoded, within
from .fields import balls, checkers, noise, salt, torus, waves
from .meshes import chosen, random_mesh, uniform

SHAPES = ((33, 41), (13, 12, 14))


def grids() -> Iterator[Draft]:
    """Signs and geometry on the full grid."""
    for shape in SHAPES:
        space, n = SPACES[len(shape)], len(shape)
        whole = waves(shape, 255, 3) + noise(shape, 7, 5)
        smooth, rough = waves(shape, 255, 2).astype(np.float64), whole.astype(np.float64)
        almost = n * cube_exponent(shape) - 1
        for name, field, options in (
            ("signs", rough, {"precision": "signs", "layers": 1}),
            ("signs_smooth", smooth, {"precision": "signs"}),
            ("single_rate", rough, {"precision": "signs", "layers": 12}),
            ("values", whole, {"precision": "exact"}),
            ("values_scaled", smooth, {"precision": "step=0.0001"}),
            (
                "values_between", whole,
                {
                    "layers": [
                        ("base", 1), ("refine", n), ("values", 4), ("refine", None), ("values", 2), ("values", None),
                    ]
                },
            ),
            ("values_coarse", whole, {"layers": [("base", almost), ("values", None), ("refine", 1), ("values", None)]}),
            ("offsets", smooth, {}),
            (
                "offsets_fine", smooth,
                {"layers": [("base", n), ("refine", None)] + [("offsets", r) for r in (4, 63, 9)]}
            ),
            (
                "offsets_between", rough,
                {
                    "layers": [
                        ("base", 1), ("refine", n), ("offsets", 7), ("refine", None), ("offsets", 2), ("offsets", 3),
                    ]
                },
            ),
        ):
            yield encoded(
                f"{space}_main_{name}", field, 100.5, "main profile", states="offsets" in name or "between" in name,
                profile="main", **options,
            )


def extremes() -> Iterator[Draft]:
    """Fields that drive models to their ends."""
    for name, field in (
        ("noise", noise((24, 31), 21, 1)), ("checkers", checkers((21, 18))), ("below", np.zeros((40, 40), np.int64)),
        ("salt", salt((50, 70), [(3, 3), (20, 6), (21, 40), (40, 60), (42, 61)])),
        ("disc", balls((65, 50), [((60, 50), 61)])), ("narrow", noise((2, 40), 5, 1)),
    ):
        yield encoded(
            f"plane_main_{name}", field, 0.5, "main profile", name, profile="main", precision="signs", layers=0,
        )
    for name, field in (
        ("noise", noise((9, 7, 8), 22, 1)), ("torus", torus((25, 25, 13), 15, 7)), ("narrow", noise((2, 19, 2), 6, 1)),
    ):
        yield encoded(
            f"space_main_{name}", field, 0.5, "main profile", name, profile="main", precision="signs", layers=0,
        )


def meshes() -> Iterator[Draft]:
    """Adaptive meshes, whose edges carry offsets; further isovalues."""
    for shape, seed, level, radix, unit in (
        ((2, 9), 37, 2, 9, 1), ((2, 33), 8, 0, 9, 3), ((6, 7, 2), 18, 0, 3, 0), ((3, 9, 2), 38, 2, 15, 3),
    ):
        yield encoded(
            f"{SPACES[len(shape)]}_main_vertex_{'x'.join(map(str, shape))}", noise(shape, seed, 2), 0.5,
            "main profile", "places far off an edge that much longer ones show", profile="main",
            layers=[("base", level), ("offsets", radix, unit)],
        )
    for shape, field, isovalue, seed in (
        ((7, 9), noise((7, 9), 1, 1), 0.5, 44), ((9, 12), waves((9, 12), 255, 23), 90.5, 23),
        ((11, 17), noise((11, 17), 24, 1), 0.5, 24),
    ):
        yield encoded(
            f"plane_main_out_by_ancestor_{seed}", field, isovalue, "main profile",
            "middles told out by being asked for, an older ancestor being out", profile="main",
            layers=[("adaptive_base", 0, chosen(shape, random_mesh(shape, seed, 30)))],
        )
    for shape in SHAPES:
        space = SPACES[len(shape)]
        field = waves(shape, 255, 2)
        coarse = random_mesh(shape, 41, 100)
        fine = random_mesh(shape, 42, 200, coarse)
        plan = [
            ("adaptive_base", 1, chosen(shape, coarse)), ("offsets", 6, 1), ("adapt", 1, chosen(shape, fine)),
            ("offsets", 9, 0), ("offsets", 41, 0), ("refine", None), ("offsets", 3, 0),
        ]
        yield encoded(f"{space}_main_meshes", field, 100.5, "main profile", states=True, profile="main", layers=plan)
        leaves = {
            100.5: [("adaptive_base", 1, chosen(shape, coarse))],
            104.5: [("leaf_base",), ("adapt", 1, chosen(shape, fine)), ("refine", None)],
        }
        yield encoded(
            f"{space}_main_isovalues_leaf_base", field + noise(shape, 3, 4), tuple(leaves), "main profile",
            states=True, profile="main", layers=leaves,
        )
        plan = [
            ("adaptive_base", 1, chosen(shape, coarse)), ("offsets", 7, 0), ("adapt", 1, chosen(shape, fine)),
            ("offsets", 9, 0), ("refine", None), ("offsets", 3, 0),
        ]
        yield encoded(
            f"{space}_main_isovalues_chain", field + noise(shape, 3, 4), (100.5, 104.5, 107), "main profile",
            states=True, profile="main", layers=plan,
        )
        further: list[tuple[str, dict[str, Any]]] = [
            ("isovalues", {}), ("isovalues_values", {"precision": "exact"}),
            ("isovalues_signs", {"precision": "signs", "layers": 2}),
        ]
        for level in (10, 11, 12):
            further.append((f"isovalues_base_{level}", {"precision": "signs", "layers": level}))
        for name, options in further:
            yield encoded(
                f"{space}_main_{name}", field + noise(shape, 3, 4), (100.5, 104.5, 97), "main profile", states=True,
                profile="main", **options,
            )


def cubes() -> Iterator[Draft]:
    """Leaves that make up cubes, the last ones cut off at the box: only the edges of cubes carry offsets."""
    for name, field in (("even", torus((17, 17, 9), 11, 5)), ("cut", torus((15, 18, 12), 11, 6))):
        shape = field.shape
        full = 3 * cube_exponent(shape)
        finer = chosen(shape, random_mesh(shape, 43, 20, uniform(shape, full - 3)))
        plan = [("base", full - 6), ("offsets", 5, 1), ("refine", 3), ("offsets", 3, 0), ("adapt", 1, finer),
                ("offsets", 9, 0)]
        yield encoded(f"space_cubes_{name}", field, 0.5, "main profile", states=True, profile="main", layers=plan)


def cuts() -> Iterator[Draft]:
    """Files that end within a layer."""
    for shape in ((61, 57), (17, 16, 18)):
        space = SPACES[len(shape)]
        field = waves(shape, 255, 2) + noise(shape, 9, 5)
        mesh = chosen(shape, random_mesh(shape, 43, 400))
        for kinds, options in (
            (("refine", "offsets"), {"layers": 2}),
            (("values",), {"precision": "exact"}),
            (("adaptive_base",), {"layers": [("adaptive_base", 0, mesh)]}),
        ):
            data = encode(field, 100.5, profile="main", **options)
            for kind in kinds:
                start = within(data, kind)[1]
                yield Draft(f"{space}_main_start_{kind}", start, len(shape), ("main profile", "start of a file"))


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (grids, extremes, meshes, cubes, cuts):
        yield from group()
