"""Curves on their meshes: criteria side by side, uniform levels, single rate and progressive, steps by bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection

import isocodec
from figures.corpus import Item, Stage, by_bytes, load, stages
from isocodec.drawing.tessellation import Tessellation
from isocodec.grid.layers.plan import Criteria

SLICE = 128
"""Of the horse: along its body."""
INK = (0.10, 0.25, 0.45)
CRITERIA = (
    ("crossing", Criteria(crossing=True)), ("topology", Criteria(topology=True)),
    ("curvature > 0.25", Criteria(curvature=0.25)), ("distortion < 1", Criteria(distortion=1)),
    ("distortion < 1, topology", Criteria(distortion=1, topology=True)), ("level 10", Criteria(level=10)),
)


def draw_mesh(axes: Any, mesh: Tessellation) -> None:
    """All sides of the triangles, fine and grey; those of crossed triangles darker."""
    signs = mesh.above[mesh.cells]
    crossed = signs.any(axis=1) & ~signs.all(axis=1)
    for which, grey, width in ((~crossed, "0.82", 0.3), (crossed, "0.5", 0.4)):
        sides = np.sort(mesh.cells[which][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        lines = mesh.points[np.unique(sides, axis=0)][:, :, ::-1]
        axes.add_collection(LineCollection(lines, colors=[grey], linewidths=width, zorder=int(crossed is which)))


def draw_curve(axes: Any, contour: isocodec.Contour, width: float = 0.9) -> None:
    """The curve, rows downwards."""
    lines = [line[:, ::-1] for line in contour.lines]
    axes.add_collection(LineCollection(lines, colors=[INK], linewidths=width, zorder=3))
    rows, columns = contour.shape
    axes.set(xlim=(-1, columns), ylim=(rows, -1), aspect="equal", xticks=[], yticks=[])


def panels(rows: int, columns: int, shape: tuple[int, ...], side: float = 3.2) -> tuple[Any, list[Any]]:
    """A figure with so many panels of a field."""
    height = side * shape[0] / shape[1] + 0.4
    figure, axes = plt.subplots(rows, columns, figsize=(columns * side, rows * height), layout="constrained")
    return figure, list(np.atleast_1d(axes).ravel())


def save(figure: Any, path: Path) -> None:
    """Write and forget a figure; the titles of its panels, which hold the numbers, are printed."""
    for axes in figure.axes:
        if title := axes.get_title():
            print(f"{path.stem}: {', '.join(title.splitlines())}")
    figure.savefig(path, dpi=150)
    plt.close(figure)


def draw_stage(axes: Any, stage: Stage, what: str, mesh: bool = True) -> None:
    """A prefix of a file with the mesh of the whole box."""
    if mesh:
        draw_mesh(axes, stage.decoder.grid.mesh())
    contour = stage.decoder.contour()
    draw_curve(axes, contour)
    axes.set_title(f"{what}\n{stage.bytes:,} bytes, {len(contour.cells):,} segments", fontsize=8)


def criteria(folder: Path, out: Path) -> None:
    """C2 figures 5, 7, 9, 19: one curve on meshes that are reduced under each criterion."""
    model = load(folder, "sdf/horse_257", 0)
    # a slice along the body, upright
    item = Item("horse slice", np.ascontiguousarray(model.values[::-1, :, SLICE]), 0)
    figure, axes = panels(2, 3, item.values.shape)
    for axis, (name, asked) in zip(axes, CRITERIA, strict=True):
        plan = [("adaptive_base", 0, asked), ("offsets", 5)]
        data = isocodec.encode(item.values, item.isovalue + 0.5, layers=plan)
        draw_stage(axis, stages(data, [2])[0], name)
    save(figure, out / "criteria.png")


def levels(folder: Path, out: Path) -> None:
    """C2 figures 2 and 6: uniform levels, from coarse to fine."""
    item = load(folder, "terrain/esterel_257", 300)
    data = isocodec.encode(item.values, item.isovalue + 0.5, layers=[("base", 4), ("refine", None)])
    figure, axes = panels(2, 3, item.values.shape)
    for axis, stage in zip(axes, stages(data, [1, 3, 5, 7, 9, 13]), strict=True):
        draw_stage(axis, stage, f"level {stage.level}", mesh=stage.level < 14)
    save(figure, out / "levels.png")


def plate(folder: Path, out: Path) -> None:
    """C2 figure 21: a number plate at a single rate, and progressively."""
    item = load(folder, "image/car_plate_de", 127.5)
    single = isocodec.encode(item.values, item.isovalue, layers=20, precision="signs")
    whole = isocodec.encode(item.values, item.isovalue, precision="signs")
    figure, axes = panels(3, 2, item.values.shape, side=5.0)
    draw_stage(axes[0], stages(single, [1])[0], "single rate", mesh=False)
    chosen = by_bytes(whole, 5)
    for axis, stage in zip(axes[1:], stages(whole, chosen), strict=False):
        draw_stage(axis, stage, f"progressive, level {stage.level}", mesh=stage.level < 12)
    for axis in axes[1 + len(chosen) :]:
        axis.set_axis_off()
    save(figure, out / "plate.png")


def steps(item: Item, out: Path, name: str, count: int = 5) -> None:
    """A curve whose topology is kept in every layer, by bytes."""
    data = isocodec.encode(item.values, item.isovalue, keep_topology=True, precision=0.05)
    chosen = by_bytes(data, count)
    figure, axes = panels(1, len(chosen), item.values.shape, side=3.0)
    for axis, stage in zip(axes, stages(data, chosen), strict=True):
        draw_stage(axis, stage, f"{stage.bytes / len(data):.0%} of the file", mesh=stage.level < 10)
    save(figure, out / f"{name}.png")


def cortex(folder: Path, out: Path) -> None:
    """F-cortex: a slice of a head, topology controlled, steps that double the bytes."""
    steps(load(folder, "medical/mni152_axial_100", 120.5), out, "cortex")
    steps(load(folder, "medical/ct_head_693", 300.5), out, "bone")


def terrain(folder: Path, out: Path) -> None:
    """F-sugar: an elevation curve in five steps, each of which promises a distance."""
    item = load(folder, "terrain/jacksboro_fault_dem", 500.5)
    distances = (16.0, 4.0, 1.0, 0.25)
    data = isocodec.encode(item.values, item.isovalue, precision=[*distances, "exact"], keep_topology=True)
    layers = isocodec.open(data).info.layers
    kept = [number for number, layer in enumerate(layers, start=1) if layer.within] + [len(layers)]
    figure, axes = panels(1, len(kept), item.values.shape, side=3.0)
    words = [*(f"within {distance:g} cells" for distance in distances), "exact"]
    for axis, stage, what in zip(axes, stages(data, kept), words, strict=True):
        draw_stage(axis, stage, what, mesh=what != "exact")
    save(figure, out / "terrain.png")
