"""Symbols and right predictions of single-rate bases; bits for a vertex of surfaces (rows F-2bits, F-80, F-surface)."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

import isocodec
from figures.corpus import load, original_of
from figures.planes import save

CURVES = (
    ("terrain/esterel_257", 300.5), ("terrain/jacksboro_fault_dem", 500.5), ("medical/ct_head_693", 300.5),
    ("medical/mni152_axial_100", 120.5), ("image/car_plate_de", 127.5), ("image/camera", 128.5),
)
SURFACES = (("sdf/horse_129", 0.5), ("sdf/eight_129", 0.5), ("volume/engine", 90.5), ("volume/mni152_t1", 120.5))
PUBLISHED = {"bits a crossed pixel": 2.0, "right predictions": 0.8}


def crossed_pixels(above: NDArray[np.bool_]) -> int:
    """Number of squares between four samples whose signs differ."""
    corners = [above[i : above.shape[0] - 1 + i, j : above.shape[1] - 1 + j] for i, j in product((0, 1), repeat=2)]
    return int((np.any(corners, axis=0) & ~np.all(corners, axis=0)).sum())


def predictions(folder: Path, out: Path) -> None:
    """F-2bits, F-80, F-surface: symbols a pixel of bases, right predictions, bits a vertex of surfaces' signs."""
    names, rates, right = [], [], []
    for name, isovalue in CURVES:
        item = load(folder, name, isovalue)
        data = isocodec.encode(item.values, item.isovalue, layers=[("base", None)], profile="baseline")
        (layer,) = isocodec.open(data).statistics().layers
        pixels = crossed_pixels(item.values > item.isovalue)
        # localisation apart
        rates.append(layer.signs / pixels)
        right.append(layer.right / layer.predicted)
        names.append(item.title)
        print(f"predictions, {item.title}: {rates[-1]:.2f} symbols a pixel of {pixels:,}, {right[-1]:.3f} right, "
              f"{8 * len(data) / pixels:.2f} bits a pixel with localisation once coded")
    figure, panels = plt.subplots(1, 2, figsize=(12, 3.6), layout="constrained", sharey=True)
    for axis, numbers, (what, published) in zip(panels, (rates, right), PUBLISHED.items(), strict=True):
        axis.barh(names, numbers)
        axis.axvline(published, color="0.3", linestyle=":")
        axis.set_xlabel(f"{what} (published: {published:g})")
    save(figure, out / "predictions.png")
    for name, isovalue in SURFACES:
        item = load(folder, name, isovalue)
        whole = original_of(item)
        signs = isocodec.encode(item.values, item.isovalue, precision="signs")
        print(f"predictions, {item.title}: {8 * len(signs) / len(whole.points):.3f} bits a vertex for signs, "
              f"{len(whole.points):,} vertices")
