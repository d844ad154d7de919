"""Thresholds times quantisations: bytes and distances of a curve on coarsened meshes (rows C2-distortion, F-rd)."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import isocodec
from figures.apart import curves_apart
from figures.corpus import load, original_of
from figures.planes import save
from figures.rates import DIVISIONS, in_parts
from isocodec.errors import OptionError
from isocodec.grid.layers.plan import Criteria

CURVE = "terrain/esterel_257", 300.5
DISTANCES = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)


def parts_of(parts: int) -> str:
    """A quantisation in words."""
    return f"{parts} part{'s' * (parts > 1)}"


def thresholds(folder: Path, out: Path) -> None:
    """C2: a table of thresholds times quantisations of crossings, bytes and distances as measured, a line for each."""
    item = load(folder, *CURVE)
    whole = original_of(item).lines
    sizes, far = np.full((2, len(DISTANCES), len(DIVISIONS)), np.nan)
    for (i, distance), (j, parts) in product(enumerate(DISTANCES), enumerate(DIVISIONS)):
        plan = [("adaptive_base", 0, Criteria(topology=True, distortion=distance)), *in_parts(parts, 1)]
        asked = f"thresholds, {item.title}: {distance:g} cells asked, {parts_of(parts)}"
        try:
            data = isocodec.encode(item.values, item.isovalue, layers=plan)
        except OptionError:
            print(f"{asked}: no mesh keeps it")
            continue
        sizes[i, j] = len(data)
        far[i, j] = curves_apart(whole, isocodec.decode(data).lines)
        print(f"{asked}: {len(data):,} bytes, {far[i, j]:.3f} cells measured")
    figure, (table, axes) = plt.subplots(1, 2, figsize=(13, 4.8), layout="constrained")
    table.imshow(np.log(sizes), cmap="Blues", aspect="auto")
    table.set_xticks(range(len(DIVISIONS)), [parts_of(parts) for parts in DIVISIONS])
    table.set_yticks(range(len(DISTANCES)), [f"{distance:g} cells" for distance in DISTANCES])
    for i, j in np.argwhere(~np.isnan(sizes)):
        dark = np.log(sizes[i, j]) > np.nanmean(np.log(sizes))
        table.text(j, i, f"{sizes[i, j]:,.0f} bytes\n{far[i, j]:.2f}", ha="center", va="center", fontsize=8,
                   color="white" if dark else "black")
    table.set_title(f"{item.title}: bytes, and distance in cells", fontsize=9)
    for j, parts in enumerate(DIVISIONS):
        axes.loglog(sizes[:, j], far[:, j], marker="o", markersize=4, linewidth=1, label=parts_of(parts))
    axes.set(xlabel="bytes", ylabel="distance (cells)")
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.legend(fontsize=8)
    save(figure, out / "thresholds.png")
