"""Surfaces as in the paper on surfaces: base mesh, geometry, refinement, upright (S3 figures 1, 6, 7, 8)."""

from __future__ import annotations

from pathlib import Path

import isocodec
from figures.corpus import Y_UP, Z_UP, ends, load, stages
from isocodec.drawing.pictures.picture import Step, steps_picture
from isocodec.drawing.pictures.view import View

PLAN = """
adaptive-base topology distortion={coarse}
offsets 5 unit=1
refine
offsets {parts}
"""
COARSE, FINE = 3.0, 0.2
"""Thresholds of the paper's figure 8, in cells of 257 samples a side: of the mesh with its geometry, and of the whole.

No mesh but the full grid keeps to the finer one on all of these models: points that are implied are too far away.
"""
PARTS = 5
"""Parts of an edge of the full grid, whose middles are nearer than the finer threshold."""
MODELS = {"horse": (Z_UP, View(60, 12)), "eight": (Y_UP, View(20, 15)), "happy_buddha": (Y_UP, View(15, 5))}
"""Which way up they are stored, and from where they are seen."""
SAMPLES = 257


def steps_of(data: bytes) -> list[int]:
    """Layers, from 1, by which the four steps are there: mesh, geometry, refinement to the full grid, geometry."""
    count = len(ends(data))
    return [1, 2, count - 1, count]


def surfaces(folder: Path, out: Path) -> None:
    """S3 figures 1, 6, 7, 8: each model after each of its layers, the coarse ones with their triangles."""
    for name, (placement, view) in MODELS.items():
        item = load(folder, f"sdf/{name}_{SAMPLES}", 0.5)
        plan = PLAN.format(coarse=COARSE, parts=PARTS)
        data = isocodec.encode(isocodec.Field(item.values, placement=placement), item.isovalue, layers=plan)
        steps = [
            Step([stage.decoder.contour()], stage.bytes, len(data), [stage.decoder.grid.mesh()] if number < 2 else [])
            for number, stage in enumerate(stages(data, steps_of(data)))
        ]
        (out / f"{name}.png").write_bytes(steps_picture(steps, ".png", view))
        whole = isocodec.decode(data)
        (out / f"{name}-whole.png").write_bytes(steps_picture([Step([whole], len(data), len(data))], ".png", view))
