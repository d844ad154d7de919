"""The base of a small curve, symbol by symbol: the walk, its gates, predictions and their parabola (C2 12, 14, 16)."""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

import isocodec
from figures.planes import INK, draw_curve, draw_mesh, panels, save
from isoconform.plain import environment

SIDE = 17
ABOVE, BELOW, RIGHT, WRONG = "#c26a2a", "white", "#2f8f5b", "#c0392b"
LEAST = 12
"""Points of the curve before the sign that is shown with its parabola."""


def small_field() -> NDArray[np.float64]:
    """A curve of three lobes in a small grid."""
    y, x = np.mgrid[:SIDE, :SIDE] - np.array([8.1, 7.8])[:, None, None]
    return 5.6 + 1.3 * np.cos(3 * np.arctan2(y, x)) - np.hypot(y, x)


def symbols_of(data: bytes) -> list[dict[str, Any]]:
    """What `traced` tells, from a process that runs kernels as plain Python."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "small.iso"
        path.write_bytes(data)
        script = Path(__file__).with_name("traced.py")
        run = subprocess.run([sys.executable, script, path], env=environment(), capture_output=True, check=True)
    return json.loads(run.stdout)


def draw_signs(axes: Any, symbols: list[dict[str, Any]], numbers: bool) -> None:
    """Vertices in the order in which their signs come: filled above, empty below; the first triangle in bold."""
    place = 0
    for symbol in symbols:
        if symbol["element"] not in ("origin", "base sign"):
            continue
        first = symbol["context"].startswith("FIRST")
        for row, column, above in symbol["vertices"]:
            edge = "0.3" if numbers else RIGHT if symbol["right"] else WRONG
            if first or symbol["element"] == "origin":
                edge = "black"
            axes.plot(
                column, row, "o", markersize=9 if numbers else 6, color=ABOVE if above else BELOW,
                markeredgecolor=edge, markeredgewidth=1.6 if first or not numbers else 0.6, zorder=5,
            )
            if numbers:
                axes.text(column, row, str(place), fontsize=5, ha="center", va="center", zorder=6)
            place += 1


def path_of(symbols: list[dict[str, Any]]) -> NDArray[np.float64]:
    """Middles of the gates in the order of the walk."""
    points: list[list[float]] = []
    for symbol in symbols:
        for point in symbol["points"]:
            if point not in points:
                points.append(point)
    return np.array(points)


def draw_gates(axes: Any, path: NDArray[np.float64]) -> None:
    """An arrow from each gate to the next one."""
    for (r0, c0), (r1, c1) in pairwise(path):
        if np.hypot(r1 - r0, c1 - c0) < 1.5:
            axes.annotate("", (c1, r1), (c0, r0), arrowprops={"arrowstyle": "->", "color": INK, "lw": 0.9}, zorder=4)


def parabola(points: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least-squares parabola through (i, point i), each coordinate by itself, at some indices."""
    index = np.arange(len(points))
    return np.stack([np.polyval(np.polyfit(index, points[:, a], 2), at) for a in range(2)], axis=1)


def draw_prediction(axes: Any, symbols: list[dict[str, Any]], number: int) -> None:
    """The last points (squares), their parabola and its next point (star), the gate (diamond), the sign beyond it."""
    symbol = symbols[number]
    points = np.array(symbol["points"])
    fit = parabola(points, np.linspace(0, len(points), 100))
    axes.plot(points[:, 1], points[:, 0], "s", color=INK, markersize=4, zorder=6)
    axes.plot(fit[:, 1], fit[:, 0], "-", color="#7a4fb0", linewidth=1.4, zorder=5)
    axes.plot(fit[-1, 1], fit[-1, 0], "*", color="#7a4fb0", markersize=11, zorder=7)
    for row, column, above in (vertex for before in symbols[:number] for vertex in before["vertices"]):
        axes.plot(column, row, "o", markersize=6, color=ABOVE if above else BELOW, markeredgecolor="0.3", zorder=4)
    ((row, column, above),) = symbol["vertices"]
    colour = RIGHT if symbol["right"] else WRONG
    axes.plot(column, row, "o", markersize=9, color=ABOVE if above else BELOW, markeredgecolor=colour,
              markeredgewidth=2, zorder=6)
    said = above if symbol["right"] else not above
    gate = symbols[number + 1]["points"][-1]
    axes.plot(gate[1], gate[0], "D", color="white", markeredgecolor=INK, markersize=5, zorder=6)
    words = ["below", "above"]
    axes.set_title(
        f"predicted {words[said]}, is {words[above]}: {'right' if symbol['right'] else 'wrong'}", fontsize=8,
        color=colour,
    )


def walk(folder: Path, out: Path) -> None:
    """C2 figures 12, 14, 16: the walk of a base with its signs, gates and predictions, on a small grid."""
    data = isocodec.encode(small_field(), 0, layers=[("base", None)], profile="baseline")
    symbols = symbols_of(data)
    decoder = isocodec.Decoder()
    decoder.feed(data)
    for _ in decoder:
        pass
    predicted = [i for i, symbol in enumerate(symbols) if symbol["context"].startswith("CURVE") and symbol["vertices"]]
    shown = [i for i in predicted[:-1] if len(symbols[i]["points"]) >= LEAST]
    # a right prediction, and a wrong one of the clearest case
    good = next(i for i in shown if symbols[i]["right"])
    wrong = [i for i in shown if not symbols[i]["right"]]
    bad = next((i for i in wrong if symbols[i]["context"].startswith("CURVE(0, 3")), shown[-1])
    figure, axes = panels(2, 2, (SIDE, SIDE), side=4.6)
    for axis in axes:
        draw_mesh(axis, decoder.grid.mesh())
    draw_curve(axes[0], decoder.contour())
    draw_signs(axes[0], symbols, numbers=True)
    axes[0].set_title("signs in the order of the walk (origin first, then the first triangle)", fontsize=8)
    draw_signs(axes[1], symbols, numbers=False)
    draw_gates(axes[1], path_of(symbols))
    right = sum(symbols[i]["right"] for i in predicted)
    axes[1].set_title(f"gates; {right} of {len(predicted)} signs as predicted (green), others red", fontsize=8)
    draw_prediction(axes[2], symbols, good)
    draw_prediction(axes[3], symbols, bad)
    for axis in axes:
        axis.set(xlim=(-0.7, SIDE - 0.3), ylim=(SIDE - 0.3, -0.7), aspect="equal", xticks=[], yticks=[])
    for axis, number in zip(axes[2:], (good, bad), strict=True):
        row, column, _ = symbols[number]["vertices"][0]
        axis.set(xlim=(column - 5, column + 5), ylim=(row + 5, row - 5))
    save(figure, out / "walk.png")
