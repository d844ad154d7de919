"""Surfaces as in the paper on surfaces: base mesh, geometry, refinement, upright (S3 figures 1, 6, 7, 8)."""

from __future__ import annotations

from pathlib import Path

import isocodec
from figures.apart import surfaces_apart
from figures.corpus import Y_UP, Z_UP, load, original_of, stages
from isocodec.grid.layers.plan import Criteria
from isocodec.plotting.panels import StepPanel, panels_picture

COARSE, FINE = 3.0, 0.2
"""Thresholds of the paper's figure 8, in cells of 257 samples a side, each of a mesh with its geometry."""
PLAN = [
    ("adaptive_base", 0, Criteria(topology=True, distortion=COARSE)), ("offsets", 5, 1),
    ("adapt", 1, Criteria(crossing=True, distortion=FINE)), ("offsets", 3),
]
"""Both distances hold for what is decoded, quantised as it is.

With ``crossing`` the finer mesh is the full grid along the surface from the start: no other keeps to the finer
threshold on these models, since points that are implied are too far away.
"""
THRESHOLDS = ("", f"{COARSE:g} cells asked, ", "", f"{FINE:g} cells asked, ")
MODELS = {"horse": (Z_UP, "60,12"), "eight": (Y_UP, "20,15"), "happy_buddha": (Y_UP, "15,5")}
"""Which way up they are stored, and from where they are seen."""
SAMPLES = 257


def surfaces(folder: Path, out: Path) -> None:
    """S3 figures 1, 6, 7, 8: each model after each layer; bytes, distance asked and as measured by VTK (minutes)."""
    for name, (placement, view) in MODELS.items():
        item = load(folder, f"sdf/{name}_{SAMPLES}", 0.5)
        data = isocodec.encode(isocodec.Field(item.values, placement=placement), item.isovalue, layers=PLAN)
        whole = original_of(item)
        steps = []
        before = 0
        for number, (stage, asked) in enumerate(zip(stages(data, [1, 2, 3, 4]), THRESHOLDS, strict=True)):
            contour = stage.decoder.contour()
            mesh = stage.decoder.grid.mesh(whole=False)
            title = f"{stage.bytes:,} bytes\n{stage.bytes / len(data):.1%} of the file"
            steps.append(StepPanel([contour], title, [(mesh.points, mesh.cells)] if number < 2 else []))
            there, back = surfaces_apart((whole.points, whole.cells), (contour.points, contour.cells))
            print(
                f"surfaces, {name}, {stage.layer}: {stage.bytes - before:,} bytes, {stage.bytes:,} by then, "
                f"{len(contour.cells):,} triangles; "
                f"{asked}{max(there, back):.3f} measured ({there:.3f} of the original, {back:.3f} of the decoded)"
            )
            before = stage.bytes
        (out / f"{name}.png").write_bytes(panels_picture(steps, ".png", view))
        (out / f"{name}-whole.png").write_bytes(panels_picture([StepPanel([contour])], ".png", view))
