"""Vectors of whole, valid files that the reference encoder writes: fields, levels, geometry."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from .draft import Draft, encoded
from .fields import balls, checkers, noise, salt, sprinkled, torus, waves

DISC = [((16, 17), 19)]
BLOBS = [((5, 6, 7), 5), ((24, 20, 9), 9), ((10, 25, 24), 8)]


def bases() -> Iterator[Draft]:
    """Bases alone and with all rounds, at levels of every residue."""
    disc = balls((17, 17), DISC)
    for level in (0, 3, 6, 8):
        yield encoded(
            f"plane_base_{level}", disc, 0.5, f"base at level {level}", "17 x 17 samples", precision="signs",
            layers=level, states=level in (0, 8),
        )
    blob = balls((9, 9, 9), [((7, 8, 9), 11)])
    for level in (0, 4, 5, 9):
        yield encoded(
            f"space_base_{level}", blob, 0.5, f"base at level {level}", "9 x 9 x 9 samples", precision="signs",
            layers=level, states=level in (0, 9),
        )


def shapes() -> Iterator[Draft]:
    """Domains whose sides are not a power of two and one."""
    for shape in ((5, 3), (3, 6), (2, 2), (16, 16), (2, 40)):
        name = "x".join(map(str, shape))
        for kind, field in (("noise", noise(shape, shape[1], 1)), ("stripes", waves(shape, 255) // 16 % 2)):
            if kind == "noise" or min(shape) > 3:
                yield encoded(
                    f"plane_{kind}_{name}", field, 0.5, f"border: {name} samples", kind, precision="signs", layers=0,
                )
    for sides in ((7, 4, 2), (5, 6, 7), (2, 2, 2), (3, 17, 3)):
        name = "x".join(map(str, sides))
        yield encoded(
            f"space_noise_{name}", noise(sides, sides[1], 1), 0.5, f"border: {name} samples", "noise",
            precision="signs", layers=0,
        )


def clamped_middles() -> Iterator[Draft]:
    """Middles that clamping puts on an older vertex, next to members that the curve enters there (clause 5.4.2)."""
    for name, rows in (
        ("plane_known_middle_6x3", ("001", "011", "000", "000", "100", "010")),
        ("plane_known_middle_3x6", ("000010", "000010", "000010")),
        ("plane_known_middle_3x6_corner", ("000000", "000001", "000010")),
    ):
        field = np.array([[int(c) for c in row] for row in rows])
        for level in (0, 1):
            yield encoded(
                f"{name}_{level}", field, 0.5, "border: middles known before the round", precision="signs",
                layers=level,
            )
    for seed, shape in enumerate(((6, 11), (11, 6), (10, 3), (19, 12), (6, 3, 6), (5, 6, 3), (11, 3, 6), (6, 2, 6))):
        name = "x".join(map(str, shape))
        yield encoded(
            f"{'plane' if len(shape) == 2 else 'space'}_known_middles_{name}", noise(shape, 60 + seed, 3), 1.5,
            "border: middles known before the round", "noise", precision="signs", layers=seed % 3,
        )


def seams() -> Iterator[Draft]:
    """Curves through several blocks, whose edges the sizes are near (clause 4.8)."""
    for n, sides in ((2, (63, 64, 65, 129)), (3, (7, 8, 9))):
        for side in sides:
            # along the last axis of volumes, along which blocks are longer, three blocks
            shape, isovalue, level = ((side, side + 2), 19.5, None) if n == 2 else ((side, 10, 130), 9.5, 0)
            name, field = f"{'plane' if n == 2 else 'space'}_seams_{side}", waves(shape, 40, side)
            assert field.min() < isovalue < field.max(), f"{name} has no curve"
            profile = "main" if side % 2 == 0 else "baseline"
            for kind, precision in (("signs", "signs"), ("exact", "exact"), ("offsets", 0.05)):
                yield encoded(
                    f"{name}_{kind}", field, isovalue, "seams of blocks", kind, precision=precision, profile=profile,
                    layers=level,
                )


def components() -> Iterator[Draft]:
    """Components of a base, and such that show up later, near others and far from them."""
    yield encoded(
        "plane_components_single_rate", checkers((9, 9)), 0.5, "single rate", "many components, free locations",
        precision="signs", layers=6,
    )
    yield encoded(
        "space_components_single_rate", sprinkled((9, 9, 9), 5, 12), 0.5, "single rate",
        "many components, free locations", precision="signs", layers=9,
    )
    # isolated samples: odd in both coordinates, in one, in none of 2, 4, 8
    points = [(x, y) for x, y in product((3, 20, 34), (6, 17, 40, 52))]
    yield encoded(
        "plane_new_components_far", salt((41, 60), points), 0.5, "new components far from known curves",
        precision="signs", layers=0, states=True,
    )
    points3 = [(3, 3, 4), (3, 12, 17), (10, 9, 3), (16, 6, 6), (14, 15, 16), (6, 17, 9), (12, 2, 13), (17, 17, 17)]
    yield encoded(
        "space_new_components_far", salt((20, 18, 19), points3), 0.5, "new components far from known curves",
        precision="signs", layers=0, states=True,
    )
    for level in (1, 2, 5):
        yield encoded(
            f"plane_new_components_above_{level}", 1 - salt((41, 60), points), 0.5,
            "new components below, far from known curves", f"base at level {level}", precision="signs", layers=level,
        )
    for level in (1, 2, 4):
        yield encoded(
            f"space_new_components_above_{level}", 1 - salt((20, 18, 19), points3), 0.5,
            "new components below, far from known surfaces", f"base at level {level}", precision="signs", layers=level,
        )
    yield encoded(
        "plane_new_components_near", noise((17, 17), 3, 8), 127.5, "new components near known curves",
        "all slots of a cube", "noise", precision="signs", layers=2, states=True,
    )
    yield encoded(
        "space_new_components_near", noise((9, 9, 9), 4, 8), 160, "new components near known curves",
        "all slots of a cube", "noise", precision="signs", layers=1, states=True,
    )
    yield encoded(
        "plane_sprinkled", sprinkled((33, 29), 7, 40), 0.5, "new components far and near", precision="signs", layers=4,
    )
    yield encoded("space_blobs", balls((16, 17, 18), BLOBS), 0.5, "several components", "smooth", precision="signs")
    yield encoded(
        "space_torus", torus((15, 15, 9), 9, 4), 0.5, "torus: a surface with a handle", "smooth", precision="signs",
        layers=6,
    )
    yield encoded("plane_all_below", np.zeros((6, 7), np.int64), 0.5, "no curve: all below", precision="signs")
    yield encoded("plane_all_above", np.ones((6, 7), np.int64), 0.5, "no curve: all above", precision="exact")
    yield encoded("space_all_below", np.zeros((4, 3, 5), np.int64), 0.5, "no surface: all below")
    yield encoded("space_all_above", np.ones((4, 3, 5), np.int64), 0.5, "no surface: all above", precision="signs")


def values() -> Iterator[Draft]:
    """Geometry by values."""
    yield encoded(
        "plane_values_8_bit", waves((17, 20), 255), 100.5, "values", "half-integer isovalue", "smooth",
        precision="exact", states=True,
    )
    yield encoded("plane_values_ties", waves((17, 20), 31), 12, "values", "integer isovalue", "ties", precision="exact")
    yield encoded(
        "plane_values_negative", noise((12, 11), 8, 12) - 3000, -1000, "values", "negative isovalue", "12-bit data",
        "noise", precision="exact",
    )
    yield encoded(
        "plane_values_negative_half", noise((7, 9), 9, 4) - 11, -2.5, "values", "negative half-integer isovalue",
        precision="exact",
    )
    yield encoded(
        "plane_values_wide", (noise((8, 9), 10, 16) - 30000) * 40000, 7, "values", "15 bits or more, stated by escape",
        precision="exact",
    )
    yield encoded(
        "plane_values_52_bits", (noise((4, 5), 15, 16) - 32768) << 37, 0.5, "values", "52 value bits, the most",
        "noise", precision="exact",
    )
    yield encoded(
        "plane_values_one_sided", 200 - 199 * (noise((9, 9), 14, 4) > 7), 199.5, "values",
        "different numbers of bits above and below", precision="exact",
    )
    yield encoded(
        "space_values_12_bit", waves((9, 10, 8), 4095, 3), 600.5, "values", "12-bit data", "smooth", precision="exact",
    )
    yield encoded(
        "space_values_noise", noise((5, 6, 7), 11, 8), 128, "values", "integer isovalue", "ties", "noise",
        precision="exact", states=True,
    )
    # multiples of 1 / 16: exact in any binary format
    hills = waves((15, 18), 1023).astype(np.float64) / 16
    yield encoded(
        "plane_scaled_power_of_two", hills, 20.25, "values", "power-of-two step", "isovalue as float32",
        precision="step=0.25",
    )
    yield encoded(
        "plane_scaled_float64", hills, 20.3, "values", "step as float64", "isovalue as float64", precision="step=0.1",
    )
    yield encoded(
        "space_scaled_power_of_two", waves((6, 7, 8), 255, 5).astype(np.float64) / 8, 4.0625, "values",
        "power-of-two step", "step greater than one", precision="step=2.0",
    )


def offsets() -> Iterator[Draft]:
    """Geometry by crossing offsets, as many layers as a tolerance takes."""
    # a stated base level keeps the encoder from choosing a mesh
    for tolerance in (1 / 4, 1 / 32):
        yield encoded(
            f"plane_offsets_{round(1 / tolerance)}", waves((17, 20), 255), 100.5, "offsets", "smooth",
            precision=tolerance, layers=8, states=tolerance == 1 / 32,
        )
    yield encoded(
        "space_offsets_4", torus((15, 15, 9), 9, 4), 0.5, "offsets", "torus: a surface with a handle", precision=1 / 4,
        layers=12,
    )
    yield encoded(
        "space_offsets_32", waves((9, 8, 7), 255, 3), 32.5, "offsets", "smooth", precision=1 / 32, states=True,
    )


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (bases, shapes, clamped_middles, seams, components, values, offsets):
        yield from group()
