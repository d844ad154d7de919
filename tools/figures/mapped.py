"""One curve on a grid and on a mapped grid that is dense around a mean contour (row C2-irregular)."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from skimage.measure import EllipseModel, find_contours

import isocodec
from figures.apart import distances
from figures.corpus import Item, load
from figures.planes import INK, save
from isocodec.field.placement import Placement

NODES = ((17, 64), (25, 96), (33, 128))
"""Rings and rays of the mapped grids; grids of about as many samples stand beside them."""
REACH = 0.35
"""How far the rings go from the mean contour, as a share of its axes."""


def irregular(folder: Path, out: Path) -> None:
    """C2 figures 12 to 14, 16: as many samples on a grid and around a mean contour, and how far the curves lie off."""
    item = load(folder, "medical/ct_head_693", 300.5)
    outer = max(find_contours(item.values.astype(float), item.isovalue), key=len)
    ellipse = EllipseModel.from_estimate(outer)
    figure, axes = plt.subplots(2, len(NODES), figsize=(4 * len(NODES), 8.6), layout="constrained")
    for column, (rings, rays) in zip(axes.T, NODES, strict=True):
        for axis, (name, nodes, periodic) in zip(column, samplings(item, ellipse, rings, rays), strict=True):
            values = map_coordinates(item.values.astype(float), nodes, order=1, mode="nearest")
            y, x = nodes
            data = isocodec.encode(
                isocodec.Field(values, placement=Placement(coordinates=[x, y], periodic=periodic)), item.isovalue,
                precision=0.02,
            )
            contour = isocodec.decode(data)
            curve = [contour.place(line) for line in contour.lines]
            far = distances(outer[:, ::-1], curve)
            grid = np.stack([x, y], axis=-1)
            closed = grid if periodic is None else np.concatenate([grid, grid[:, :1]], axis=1)
            lines = [*closed, *grid.transpose(1, 0, 2)]
            axis.add_collection(LineCollection(lines, colors=["0.85"], linewidths=0.3))
            axis.add_collection(LineCollection(curve, colors=[INK], linewidths=0.8))
            axis.plot(outer[:, 1], outer[:, 0], color="0.3", linewidth=0.4, linestyle=":")
            rows, columns = item.values.shape
            axis.set(xlim=(0, columns - 1), ylim=(rows - 1, 0), aspect="equal", xticks=[], yticks=[])
            axis.set_title(
                f"{name}: {values.size:,} samples, {len(data):,} bytes\n"
                f"off by {far.mean():.2f} in the mean, {far.max():.1f} at most (samples of the slice)", fontsize=8,
            )
    save(figure, out / "irregular.png")


def samplings(
    item: Item, ellipse: EllipseModel, rings: int, rays: int
) -> list[tuple[str, NDArray[np.float64], int | None]]:
    """Places of samples, rows and columns (2, ..): on a grid, and on ellipses that crowd around the mean contour."""
    rows, columns = item.values.shape
    count = rings * rays
    height = round(np.sqrt(count * rows / columns))
    even = np.meshgrid(
        np.linspace(0, rows - 1, height), np.linspace(0, columns - 1, round(count / height)), indexing="ij"
    )
    (row, column), (a, b), angle = ellipse.center, ellipse.axis_lengths, ellipse.theta
    t = np.linspace(0, 2 * np.pi, rays, endpoint=False)
    share = np.linspace(-1, 1, rings)
    # a cube of the share: rings close to one another at the contour
    scale = 1 + REACH * (0.4 * share + 0.6 * share**3)
    u, v = scale[:, None] * a * np.cos(t), scale[:, None] * b * np.sin(t)
    around = [row + u * np.cos(angle) - v * np.sin(angle), column + u * np.sin(angle) + v * np.cos(angle)]
    return [("grid", np.array(even), None), ("around the mean contour", np.array(around), 1)]
