"""Pictures of contours: a single one, or the steps of a progressive file side by side, as in the papers.

Figures are made without ``pyplot``, so that no window system is needed and no state remains.
"""

from __future__ import annotations

import io
import math
from collections.abc import Collection, Iterable, Sequence
from itertools import chain, product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...errors import OptionError, one_line
from ...extras import optional
from ...field.labelling import caption, noun_of
from ...field.sampled import UNIT
from ..curve import Curve
from .colours import colours_of
from .shading import SURFACE, Solid, shade
from .view import USUAL, View, proportions, upright

PICTURE_SUFFIXES = (".png", ".pdf", ".svg")

_DPI = 150
_INK = (0.10, 0.25, 0.45)
_NAMED = 12
"""Largest number of isovalues that a legend lists."""
# Panels in one row; further ones go to the next row.
_COLUMNS = 6


@dataclass(frozen=True)
class Step:
    """A prefix of a file: contours of the isovalues it holds, its size, and the size of the whole file.

    ``meshes``, if they are to be drawn, hold for each contour the vertices of the crossed simplices, and the simplices
    as rows of indices; ``within`` is the distance that the file guarantees.
    """

    contours: Sequence[Curve]
    bytes: int
    total: int
    meshes: Sequence[tuple[np.ndarray, np.ndarray]] = ()
    within: float | None = None


def contour_picture(contours: Collection[Curve], suffix: str = ".png", view: View = USUAL) -> bytes:
    """Make the picture of one or several contours of a field: curves in one picture, surfaces side by side.

    ``view`` applies to surfaces.

    Raises
    ------
    OptionError
        If the contours are neither 2-D nor 3-D.
    MissingExtraError
        If matplotlib is missing.
    """
    each = iter(contours)
    first = next(each)
    count = len(contours)
    if count > 1 and (len(first.shape) == 2 or _flat(first)):
        return _file(_curves_figure(chain([first], each), count), suffix)
    width, height = _panel_size(first, 6.0)
    columns = math.ceil(math.sqrt(count))
    rows = -(-count // columns)
    figure = _figure((width, height * rows / columns))
    for number, contour in enumerate(chain([first], each), start=1):
        axes = figure.add_subplot(rows, columns, number)
        _draw(axes, [contour], [_INK], 6 * _DPI // columns, view)
        axes.set_title(caption(contour.isovalue, contour.metadata), fontsize=9)
        del contour
    return _file(figure, suffix)


def _curves_figure(contours: Iterable[Curve], count: int) -> Any:
    """Draw curves of several isovalues in one picture, each in a colour."""
    isovalues: list[float] = []
    figure: Any = None
    axes: Any = None
    title = ""
    for contour in contours:
        if figure is None:
            width, height = _panel_size(contour, 6.0)
            figure = _figure((width + 1.0, height))  # room for what names the colours
            axes = figure.add_subplot()
            title = _legend_title(contour)
        _draw_curve(axes, contour, _INK, count)
        isovalues.append(contour.isovalue)
        del contour
    colours = colours_of(isovalues)
    for line, colour in zip(axes.collections, colours, strict=True):
        line.set_color(colour)
    _name_colours(figure, [axes], isovalues, colours, title)
    return figure


def _legend_title(contour: Curve) -> str:
    noun, unit = noun_of(contour.metadata), contour.metadata.get(UNIT, "")
    return f"{noun} ({one_line(unit, 20)})" if unit else noun


def _name_colours(figure: Any, axes: list[Any], isovalues: Sequence[float], colours: NDArray[np.float64],
                  title: str) -> None:
    """Name the colours of isovalues beside the axes: each, or if there are many, some on a scale of all."""
    order = np.argsort(isovalues, kind="stable")
    names = [f"{isovalues[i]:.10g}" for i in order]
    if len(isovalues) <= _NAMED:
        lines = optional("matplotlib.lines", extra="plot", purpose="drawing a picture")
        handles = [lines.Line2D([], [], color=colours[i], linewidth=2) for i in order[::-1]]
        figure.legend(handles, names[::-1], loc="outside right upper", fontsize=7, title=title,
                      title_fontsize=7)
        return
    cm = optional("matplotlib.cm", extra="plot", purpose="drawing a picture")
    colors = optional("matplotlib.colors", extra="plot", purpose="drawing a picture")
    # a field of the scale for each isovalue, named in its middle
    norm = colors.BoundaryNorm(np.arange(len(order) + 1), len(order))
    scale = cm.ScalarMappable(norm, colors.ListedColormap(colours[order]))
    shown = range(0, len(order), -(-len(order) // 20))
    bar = figure.colorbar(scale, ax=axes, ticks=[i + 0.5 for i in shown], spacing="uniform", pad=0.01, fraction=0.05)
    bar.set_label(title, fontsize=7)
    bar.ax.set_yticklabels([names[i] for i in shown])
    bar.ax.tick_params(labelsize=7, length=2)
    bar.ax.minorticks_off()


def steps_picture(
    steps: Sequence[Step], suffix: str = ".png", view: View = USUAL, isovalues: Sequence[float] = ()
) -> bytes:
    """Make a picture of several prefixes side by side, each titled with its size and its share of the file.

    ``view`` applies to surfaces; ``isovalues`` are all that the file holds, which decide on colours.

    Raises
    ------
    OptionError
        If the contours are neither 2-D nor 3-D.
    MissingExtraError
        If matplotlib is missing.
    """
    columns = min(len(steps), _COLUMNS)
    rows = -(-len(steps) // columns)
    side = 2.6
    width, height = _panel_size(steps[-1].contours[0], side)
    several = len(isovalues) > 1
    figure = _figure((columns * width + 0.9 * several, rows * max(height + 0.45, 2.5 * (len(isovalues) > _NAMED))))
    inks = colours_of(isovalues, solid=len(steps[-1].contours[0].shape) == 3) if several else np.array([_INK])
    panels = []
    for number, step in enumerate(steps, start=1):
        axes = figure.add_subplot(rows, columns, number)
        for contour, mesh in zip(step.contours, step.meshes, strict=False):
            _draw_mesh(axes, contour, *mesh, view)
        own = [inks[isovalues.index(one.isovalue) if several else 0] for one in step.contours]
        _draw(axes, step.contours, own, round(side * _DPI), view, several)
        axes.set_xticks([])
        axes.set_yticks([])
        more = "" if step.within is None else f", within {step.within:g}"
        held = len(step.contours)
        more += f", {held} {noun_of(step.contours[0].metadata)}{'s' * (held > 1)}" * several
        axes.set_title(f"{step.bytes:,} bytes{more}\n{step.bytes / step.total:.1%} of the file", fontsize=7)
        panels.append(axes)
    if several:
        _name_colours(figure, panels, isovalues, inks, _legend_title(steps[-1].contours[0]))
    return _file(figure, suffix)


def check_picture(path: Path) -> str:
    """Check a picture's name, and that the library for it is installed; returns the suffix.

    Raises
    ------
    OptionError
        If the suffix is not that of a picture.
    MissingExtraError
    """
    suffix = path.suffix.lower()
    if suffix not in PICTURE_SUFFIXES:
        raise OptionError(
            f"{suffix or 'a name without a suffix'} is not a picture", code="suffix",
            remedy="one of " + ", ".join(PICTURE_SUFFIXES),
        )
    matplotlib_figure()
    return suffix


def matplotlib_figure() -> Any:
    """Import the library that draws.

    Raises
    ------
    MissingExtraError
    """
    return optional("matplotlib.figure", extra="plot", purpose="drawing a picture")


def _figure(size: tuple[float, float]) -> Any:
    return matplotlib_figure().Figure(figsize=size, dpi=_DPI, layout="constrained")


def _file(figure: Any, suffix: str) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format=suffix[1:], facecolor="white")
    return buffer.getvalue()


def _panel_size(contour: Curve, longest: float) -> tuple[float, float]:
    """Width and height in inches: in the proportions of the grid, but not too narrow."""
    if _flat(contour) and len(contour.points):
        columns, rows = np.maximum(np.ptp(contour.points, axis=0), 1e-300)
    elif len(contour.shape) != 2:
        return longest, longest
    else:
        rows, columns = contour.shape * proportions(contour)
    least = longest / 4
    if columns >= rows:
        return longest, max(longest * rows / columns, least)
    return max(longest * columns / rows, least), longest


def _flat(contour: Curve) -> bool:
    """Whether a contour is a curve on a mesh in the plane, with coordinates x and y."""
    return not contour.shape and contour.points.shape[1] == 2


def _draw(
    axes: Any, contours: Sequence[Curve], inks: Sequence[Any], pixels: int, view: View, several: bool = False
) -> None:
    """Draw contours of one field, each in its ink; surfaces in theirs only if there are several."""
    contour = contours[0]
    if _flat(contour) or len(contour.shape) == 2:
        for one, ink in zip(contours, inks, strict=True):
            _draw_curve(axes, one, ink, len(contours))
    elif len(contour.shape) == 3:
        _draw_surfaces(axes, contours, inks if several else [SURFACE], pixels, view)
    else:
        what = f"a field with {len(contour.shape)} axes" if contour.shape else "a curve or surface on a mesh in space"
        raise OptionError(f"{what} cannot be drawn", code="dimension", remedy="decode it to PLY or STL")


def _draw_mesh(
    axes: Any, contour: Curve, position: np.ndarray, simplices: np.ndarray, view: View = USUAL
) -> None:
    """Draw triangles under a curve; for a surface, the edges of triangles that face the viewer."""
    collections = optional("matplotlib.collections", extra="plot", purpose="drawing a picture")
    if _flat(contour) or len(contour.shape) == 2:
        ends = np.unique(np.sort(simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
        lines = position[ends] if _flat(contour) else position[ends][:, :, ::-1]
        axes.add_collection(collections.LineCollection(lines, colors=["0.7"], linewidths=0.25, zorder=0))
        return
    world = upright(contour)
    corners = contour.points[contour.cells] @ world.T
    below = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ view.towards
    # normals point to lower values, unless the placement mirrors; outside is the side of the grid's first corner
    front = (below > 0) != (bool(contour.origin_above) != (np.linalg.det(world) < 0))
    flat = _box(contour) @ world.T @ view.screen
    shown = corners[front] @ view.screen - (flat.min(axis=0) + flat.max(axis=0)) / 2
    axes.add_collection(
        collections.LineCollection(shown[:, [0, 1, 2, 0]], colors=[(0, 0, 0, 0.25)], linewidths=0.2, zorder=3)
    )


def _draw_curve(axes: Any, contour: Curve, ink: Any, count: int = 1) -> None:
    """Draw a curve, one of ``count``."""
    collections = optional("matplotlib.collections", extra="plot", purpose="drawing a picture")
    turned = 1 if _flat(contour) else -1
    lines = [np.asarray(line)[:, ::turned] for line in contour.lines]
    width = 0.45 if count > _NAMED else 0.7
    axes.add_collection(collections.LineCollection(lines, colors=[ink], linewidths=width, capstyle="round"))
    if _flat(contour):
        axes.autoscale()
        axes.set_aspect("equal")
        axes.tick_params(labelsize=7)
        return
    rows, columns = contour.shape
    axes.set_xlim(-0.5, columns - 0.5)
    # Downwards, as in pictures.
    axes.set_ylim(rows - 0.5, -0.5)
    down, across = proportions(contour)
    axes.set_aspect(down / across)
    axes.tick_params(labelsize=7)


def _draw_surfaces(axes: Any, contours: Sequence[Curve], inks: Sequence[Any], pixels: int, view: View) -> None:
    """Draw surfaces as a separate image, since matplotlib sorts whole triangles, which is visible in folds.

    The innermost one is opaque, those around it are seen through.
    """
    world = upright(contours[0])
    flat = _box(contours[0]) @ world.T @ view.screen
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float((high - low).max()) or 1.0
    centre = (low + high) / 2
    sizes = {i: np.ptp(one.points, axis=0).sum() for i, one in enumerate(contours) if len(one.cells)}
    order = sorted(sizes, key=lambda i: sizes[i])
    solids = [Solid(contours[i].points @ world.T, contours[i].cells, np.asarray(inks[i])) for i in order]
    image = shade(solids, view, centre, scale, pixels)
    half = scale / 2
    for a, b in zip(*_box_edges(), strict=True):
        line = flat[[a, b]] - centre
        axes.plot(line[:, 0], line[:, 1], color="0.75", linewidth=0.5, zorder=1)
    axes.imshow(image, extent=(-half, half, -half, half), origin="lower", zorder=2, interpolation="antialiased")
    axes.set_xlim(-1.04 * half, 1.04 * half)
    axes.set_ylim(-1.04 * half, 1.04 * half)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _box(contour: Curve) -> NDArray[np.float64]:
    """Corners of the sampled box, (8, 3), in samples."""
    return np.array(list(product(*((0.0, n - 1.0) for n in contour.shape))))


def _box_edges() -> tuple[list[int], list[int]]:
    """Pairs of corners of a cube, numbered by their bits, that differ in one bit."""
    pairs = [(a, a | 1 << axis) for a in range(8) for axis in range(3) if not a >> axis & 1]
    return [a for a, _ in pairs], [b for _, b in pairs]
