"""Contours of scattered points: what a file keeps of a survey, beside all of its points."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.tri import Triangulation
from scipy.ndimage import map_coordinates
from scipy.spatial import Delaunay

import isocodec
from figures.apart import curves_apart
from figures.corpus import load
from figures.planes import INK, save

TERRAIN = "terrain/jacksboro_fault_dem"
COUNT = 23_000
"""Points of the survey: as many as the paper on thinning has, nearly."""
UNIT = 1 / 32
"""Of the points' coordinates, in samples: they are stored as they are, so that triangles along the hull stay, too."""
ISOVALUES = (400.5, 500.5, 600.5)


def scattered(folder: Path, out: Path) -> None:
    """Contours of scattered points: bytes with the points they need and with all points, and how far they lie off."""
    terrain = load(folder, TERRAIN, ISOVALUES[1]).values
    # not on the grid, where triangulations of the same points differ
    points = np.random.default_rng(0).random((COUNT, 2)) * (np.array(terrain.shape[::-1]) - 1)
    points = np.unique(np.rint(points / UNIT) * UNIT, axis=0)
    values = map_coordinates(terrain.astype(float), points.T[::-1], order=1)
    triangles = Triangulation(*points.T, Delaunay(points).simplices)
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.6), layout="constrained")
    axes[0].plot(*points.T, ",", color="0.4")
    axes[0].set_title(f"{len(points):,} points", fontsize=9)
    for axis, isovalues in zip(axes[1:], (ISOVALUES[1:2], ISOVALUES), strict=True):
        files = {
            stored: isocodec.encode(isocodec.Mesh(points, None, values, stored=stored, error=UNIT), isovalues)
            for stored in ("delaunay", "whole")
        }
        far = 0.0
        for stored, data in files.items():
            opened = isocodec.open(data)
            for isovalue in isovalues:
                found = opened.contour(isovalue)
                lines = [np.asarray(found.place(line)) for line in found.lines]
                sections = axis.tricontour(triangles, values, levels=[isovalue], alpha=0).allsegs[0]
                far = max(far, curves_apart(lines, [line for line in sections if len(line) > 1]))
                if stored == "delaunay":
                    axis.add_collection(LineCollection(lines, colors=[INK], linewidths=0.8))
        kept = isocodec.open(files["delaunay"]).mesh().points
        axis.plot(*np.asarray(kept).T, ",", color="0.6", zorder=0)
        share = len(files["delaunay"]) / len(files["whole"])
        what = (f"{len(isovalues)} isovalue{'s' * (len(isovalues) > 1)}: {len(kept):,} points, "
                f"{len(files['delaunay']):,} bytes; all points {len(files['whole']):,} ({share:.2f})")
        axis.set_title(what, fontsize=9)
        print(f"scattered: {len(isovalues)} isovalues: contours of both files off by {far:.3f} samples at most")
    for axis in axes:
        axis.set(aspect="equal", xlim=(0, terrain.shape[1]), ylim=(terrain.shape[0], 0), xticks=[], yticks=[])
    save(figure, out / "scattered.png")
