"""An adaptive base of a hyperbola and its refinement, symbol by symbol (rows C2-adaptive-base, C2-refine-adaptive)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import isocodec
from figures.corpus import stages
from figures.planes import draw_curve, draw_mesh, panels, save
from figures.walk import ABOVE, BELOW, symbols_of
from isocodec.grid.layers.plan import Criteria

SIDE = 33
PLAN = [
    ("adaptive_base", 0, Criteria(topology=True, distortion=1.5)), ("offsets", 3, 1),
    ("adapt", 1, Criteria(distortion=0.25)), ("offsets", 5),
]
BASE, REFINEMENT = 1, 3
"""Layers whose symbols are shown."""
COLOURS = {"=": "0.35", "<": "#2f6fb0", ">": "#b0522f", "R": "#2f8f5b", "K": "#8f2f7a"}


def hyperbola_field() -> NDArray[np.float64]:
    """Samples of ``x**2 - y**2 - 1`` on a square, (33, 33); no sample lies on the curve."""
    y, x = 6 * (np.mgrid[:SIDE, :SIDE] / (SIDE - 1) - 0.5) + np.array([0.056, -0.037])[:, None, None]
    return x**2 - y**2 - 1


def word_of(symbol: dict[str, Any]) -> str:
    """The published name of a symbol, or of the sign that it codes; empty for others."""
    if symbol["word"]:
        return str(symbol["word"])
    names = {"component": ("End", "Next:"), "continue": ("Stop", "Cont"), "location": ("Left", "Right")}
    if symbol["element"] in names:
        return names[symbol["element"]][symbol["bit"]]
    if symbol["element"] in ("origin", "base sign", "refinement sign"):
        return "".join("-+"[above] for *_, above in symbol["vertices"])
    return ""


def listed(symbols: list[dict[str, Any]], layer: int) -> str:
    """Symbols of a layer by their published names."""
    return " ".join(filter(None, (word_of(symbol) for symbol in symbols if symbol["layer"] == layer)))


def draw_symbols(axes: Any, symbols: list[dict[str, Any]], layer: int) -> None:
    """Signs where their vertices are, filled above; other symbols in their triangles or on the edges they are about."""
    for symbol in symbols:
        if symbol["layer"] != layer:
            continue
        for row, column, above in symbol["vertices"]:
            axes.plot(column, row, "o", markersize=5, color=ABOVE if above else BELOW, markeredgecolor="0.3", zorder=5)
        if symbol["places"]:
            row, column = np.mean(symbol["places"], axis=0)
            # beside the vertex that has the middle's place
            axes.text(
                column + (0.5 if layer == REFINEMENT else 0), row, symbol["word"], fontsize=8, zorder=6,
                ha="left" if layer == REFINEMENT else "center", va="center", weight="bold",
                color=COLOURS[symbol["word"]],
            )


def hyperbola(folder: Path, out: Path) -> None:
    """C2, adaptive: a hyperbola's base with its signs and `= < >`, then Refine and Keep, Cont and Stop."""
    data = isocodec.encode(hyperbola_field(), 0, layers=PLAN, profile="baseline")
    symbols = symbols_of(data)
    base, geometry, refined, whole = stages(data, [1, 2, 3, 4])
    figure, axes = panels(2, 2, (SIDE, SIDE), side=4.8)
    for axis, mesh in zip(axes, (base, base, refined, whole), strict=True):
        draw_mesh(axis, mesh.decoder.grid.mesh())
    draw_symbols(axes[0], symbols, BASE)
    draw_symbols(axes[2], symbols, REFINEMENT)
    draw_curve(axes[1], geometry.decoder.contour())
    draw_curve(axes[3], whole.decoder.contour())
    words = [symbol["word"] for symbol in symbols]
    counts = {word: words.count(word) for word in COLOURS}
    titles = (
        f"base, {base.bytes} bytes: " + ", ".join(f"{counts[word]} {word}" for word in "=<>"),
        f"with its geometry, {geometry.bytes} bytes",
        f"refinement, {refined.bytes} bytes: {counts['R']} Refine, {counts['K']} Keep", f"whole, {whole.bytes} bytes",
    )
    for axis, title in zip(axes, titles, strict=True):
        axis.set(xlim=(-1, SIDE), ylim=(SIDE, -1), aspect="equal", xticks=[], yticks=[])
        axis.set_title(title, fontsize=8)
    save(figure, out / "hyperbola.png")
    print(f"hyperbola: symbols of the base: {listed(symbols, BASE)}")
    print(f"hyperbola: symbols of the refinement: {listed(symbols, REFINEMENT)}")
