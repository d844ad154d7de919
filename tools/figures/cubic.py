"""A cubic curve, an oval and a branch: uniform with bits between levels, and adaptive under thresholds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

import isocodec
from figures.apart import along, distances
from figures.corpus import Stage, stages
from figures.planes import draw_curve, draw_mesh, panels, save
from isocodec.grid.layers.plan import Criteria

SIDE, REACH = 129, 2.6
"""Samples along an edge, and where the edges lie on both axes."""
STEPS = 512
"""Of values for each unit of ``y**2 - x**3 + 3 x - 1``."""
PLAN = [
    ("base", 6), ("values", 5), *3 * [("refine", 2), ("values", 2)], ("refine", None), ("values", None),
]
"""Five bits of values, and two more between two levels each, as published."""
ALLOWED = (4.0, 2.0, 1.0, 0.5, 0.25)


def cubic_field() -> NDArray[np.int32]:
    """Samples of ``y**2 - x**3 + 3 x - 1``, rounded, (129, 129)."""
    y, x = REACH * (2 * np.mgrid[:SIDE, :SIDE] / (SIDE - 1) - 1)
    return np.rint(STEPS * (y**2 - x**3 + 3 * x - 1)).astype(np.int32)


def cubic_points() -> NDArray[np.float64]:
    """Points of the cubic itself within the square, close to one another, as rows and columns (K, 2)."""
    x = np.linspace(-REACH, REACH, 200_001)
    squared = x**3 - 3 * x + 1
    x, squared = x[squared >= 0], squared[squared >= 0]
    found = [np.stack([sign * np.sqrt(squared), x], axis=1) for sign in (-1, 1)]
    # where it is steep, by rows
    for y in np.linspace(-REACH, REACH, 4001):
        roots = np.roots([1, 0, -3, 1 - y * y])
        real = roots[np.abs(roots.imag) < 1e-9].real
        found.append(np.stack([np.full(len(real), y), real], axis=1))
    points = np.concatenate(found)
    points = points[(np.abs(points) <= REACH).all(axis=1)]
    return (points / REACH + 1) * (SIDE - 1) / 2


def off(contour: isocodec.Contour, points: NDArray[np.float64]) -> float:
    """Largest distance of a decoded curve from the cubic's points, both ways, in cells."""
    return float(max(distances(points, contour.lines).max(), KDTree(points).query(along(contour.lines))[0].max()))


def uniform_stages() -> list[Stage]:
    """The cubic after each run of values of the uniform plan."""
    data = isocodec.encode(cubic_field(), 0.5, layers=PLAN)
    kinds = [layer.kind for layer in isocodec.open(data).info.layers]
    last = [i for i, kind in enumerate(kinds, start=1) if kind == "values" and kinds[i : i + 1] != ["values"]]
    return stages(data, last)


def cubic(folder: Path, out: Path) -> None:
    """C2, the cubic: uniform levels with bits between them, and adaptive meshes; bytes, distance from the curve."""
    points = cubic_points()
    figure, axes = panels(2, len(ALLOWED), (SIDE, SIDE), side=3.0)
    shown = [(f"level {stage.level}, values", stage) for stage in uniform_stages()]
    for threshold in ALLOWED:
        plan = [("adaptive_base", 0, Criteria(topology=True, distortion=threshold)), ("offsets", 5, 1)]
        (stage,) = stages(isocodec.encode(cubic_field(), 0.5, layers=plan), [2])
        shown.append((f"threshold {threshold:g}", stage))
    for axis, (name, stage) in zip(axes, shown, strict=True):
        contour = stage.decoder.contour()
        far = off(contour, points)
        if stage.level < 14:
            draw_mesh(axis, stage.decoder.grid.mesh())
        draw_curve(axis, contour)
        axis.set_title(f"{name}\n{stage.bytes:,} bytes, off by {far:.3f} cells", fontsize=8)
    save(figure, out / "cubic.png")
