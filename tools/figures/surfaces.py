"""Surfaces as in the paper on surfaces: base mesh, geometry, refinement, upright (S3 figures 1, 6, 7, 8)."""

from __future__ import annotations

from pathlib import Path

import isocodec
from figures.corpus import Y_UP, Z_UP, load, stages
from isocodec.drawing.pictures.picture import Step, steps_picture
from isocodec.drawing.pictures.view import View

PLAN = """
adaptive-base topology distortion={coarse}
offsets 5 unit=1
adapt topology distortion={fine}
offsets 5
"""
COARSE, FINE = 3.0, 0.2
"""Thresholds of the paper's figure 8, in cells of 257 samples a side."""
MODELS = {"horse": (Z_UP, View(60, 12)), "eight": (Y_UP, View(20, 15)), "happy_buddha": (Y_UP, View(15, 5))}
"""Which way up they are stored, and from where they are seen."""
SAMPLES = 257


def surfaces(folder: Path, out: Path) -> None:
    """S3 figures 1, 6, 7, 8: each model after each of its layers, the coarse ones with their triangles."""
    for name, (placement, view) in MODELS.items():
        item = load(folder, f"sdf/{name}_{SAMPLES}", 0.5)
        plan = PLAN.format(coarse=COARSE, fine=FINE)
        data = isocodec.encode(isocodec.Field(item.values, placement=placement), item.isovalue, layers=plan)
        steps = [
            Step([stage.decoder.contour()], stage.bytes, len(data), [stage.decoder.grid.mesh()] if number < 2 else [])
            for number, stage in enumerate(stages(data, [1, 2, 3, 4]))
        ]
        (out / f"{name}.png").write_bytes(steps_picture(steps, ".png", view))
        whole = isocodec.decode(data)
        (out / f"{name}-whole.png").write_bytes(steps_picture([Step([whole], len(data), len(data))], ".png", view))
