"""Pictures of contours: one alone, or the steps of a progressive file side by side, as the papers show them.

Figures are made without ``pyplot``: no window system, no state left behind.
"""

from __future__ import annotations

import io
import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from .extras import optional
from .formats import Cost

if TYPE_CHECKING:
    from ..drawing.contour import Contour

PICTURE_SUFFIXES = (".png", ".pdf", ".svg")

_DPI = 150
_INK = (0.10, 0.25, 0.45)
_INKS = "viridis"
_NAMED = 12
"""Most isovalues that a legend lists."""
_SURFACE = np.array([0.62, 0.72, 0.84])
_STRETCH = 100.0
_BAND = 32
"""Rows of a surface's picture that are coloured at a time."""
# Panels in one row; more go on to the next.
_COLUMNS = 6

# The direction of view on a surface: from the side, in front and above. Volumes are mostly stored slice by slice, so
# axis 0 of the array is upright; it runs downwards, as the rows of a picture do.
_TOWARDS = np.array([-0.42, -0.75, -0.55]) / np.linalg.norm([-0.42, -0.75, -0.55])
_RIGHT = np.cross([-1.0, 0.0, 0.0], _TOWARDS) / np.linalg.norm(np.cross([-1.0, 0.0, 0.0], _TOWARDS))
_UP = np.cross(_TOWARDS, _RIGHT)
# Light from over the viewer's left shoulder.
_LIGHT = (_TOWARDS + 0.5 * _UP - 0.4 * _RIGHT) / np.linalg.norm(_TOWARDS + 0.5 * _UP - 0.4 * _RIGHT)


@dataclass(frozen=True)
class Step:
    """A prefix of a file: what it decodes to, its size, and the size of the whole file.

    ``mesh``, if it is to be drawn, holds the vertices of its crossed simplices and their numbers in rows; ``within`` is
    what the file promises.
    """

    contour: Contour
    bytes: int
    total: int
    mesh: tuple[np.ndarray, np.ndarray] | None = None
    within: float | None = None


PICTURE = {2: Cost(200, 160, fixed=1 << 25), 3: Cost(80, 260, fixed=1 << 27, kept=0)}
"""Memory that pictures take, by axes of the field."""


def contour_picture(contours: Collection[Contour], suffix: str = ".png") -> bytes:
    """The file of a picture of a contour, 2-D or 3-D, or of several of one field: curves in one, surfaces side by side.

    Raises
    ------
    OptionError
        If the contours are neither.
    MissingExtraError
        Without matplotlib.
    """
    each = iter(contours)
    first = next(each)
    count = len(contours)
    if count > 1 and len(first.shape) == 2:
        return _file(_curves_figure(chain([first], each)), suffix)
    width, height = _panel_size(first, 6.0)
    columns = math.ceil(math.sqrt(count))
    rows = -(-count // columns)
    figure = _figure((width, height * rows / columns))
    for number, contour in enumerate(chain([first], each), start=1):
        axes = figure.add_subplot(rows, columns, number)
        _draw(axes, contour, pixels=6 * _DPI // columns)
        axes.set_title(f"isovalue {contour.isovalue:g}", fontsize=9)
        del contour
    return _file(figure, suffix)


def _curves_figure(contours: Iterable[Contour]) -> Any:
    """Curves of several isovalues in one picture, each in its colour."""
    cm = optional("matplotlib.cm", extra="plot", purpose="drawing a picture")
    isovalues: list[float] = []
    figure: Any = None
    axes: Any = None
    for contour in contours:
        if figure is None:
            width, height = _panel_size(contour, 6.0)
            figure = _figure((width + 1.0, height))  # room for what names the colours
            axes = figure.add_subplot()
        _draw_curve(axes, contour)
        isovalues.append(contour.isovalue)
        del contour
    lines = list(axes.collections)
    colours = cm.ScalarMappable(cmap=_INKS)
    low, high = min(isovalues), max(isovalues)
    colours.set_clim(low, high + (high - low) / 8)  # without the palest, on white
    for line, isovalue in zip(lines, isovalues, strict=True):
        line.set_color(colours.to_rgba(isovalue))
    if len(lines) > _NAMED:
        bar = figure.colorbar(colours, ax=axes, label="isovalue").ax
        bar.set_ylim(low, high)
        bar.tick_params(labelsize=7)
        return figure
    down = sorted(range(len(lines)), key=lambda i: -isovalues[i])
    names = [f"{isovalues[i]:g}" for i in down]
    figure.legend([lines[i] for i in down], names, loc="outside right upper", fontsize=7, title="isovalue",
                  title_fontsize=7)  # fmt: skip
    return figure


def steps_picture(steps: Sequence[Step], suffix: str = ".png") -> bytes:
    """The file of a picture of several prefixes side by side, each under its bytes and its share of the file.

    Raises
    ------
    OptionError
        If the contours are neither 2-D nor 3-D.
    MissingExtraError
        Without matplotlib.
    """
    columns = min(len(steps), _COLUMNS)
    rows = -(-len(steps) // columns)
    side = 2.6
    width, height = _panel_size(steps[0].contour, side)
    title = 0.45
    figure = _figure((columns * width, rows * (height + title)))
    for number, step in enumerate(steps, start=1):
        axes = figure.add_subplot(rows, columns, number)
        if step.mesh is not None:
            _draw_mesh(axes, step.contour, *step.mesh)
        _draw(axes, step.contour, pixels=round(side * _DPI))
        axes.set_xticks([])
        axes.set_yticks([])
        promise = "" if step.within is None else f", within {step.within:g}"
        axes.set_title(f"{step.bytes:,} bytes{promise}\n{step.bytes / step.total:.1%} of the file", fontsize=7)
    return _file(figure, suffix)


def matplotlib_figure() -> Any:
    """The library that draws.

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


def _proportions(contour: Contour) -> NDArray[np.float64]:
    """Distances of neighbouring samples along each axis, the shortest of them 1, the longest at most ``_STRETCH``."""
    n = len(contour.shape)
    if contour.placement is None:
        return np.ones(n)
    steps = np.linalg.norm(contour.placement[:, :n], axis=0)
    return np.minimum(steps / steps.min(), _STRETCH)


def _panel_size(contour: Contour, longest: float) -> tuple[float, float]:
    """Width and height in inches: in the proportions of a plane grid, but never a mere strip."""
    if len(contour.shape) != 2:
        return longest, longest
    rows, columns = contour.shape * _proportions(contour)
    least = longest / 4
    if columns >= rows:
        return longest, max(longest * rows / columns, least)
    return max(longest * columns / rows, least), longest


def _draw(axes: Any, contour: Contour, pixels: int) -> None:
    if len(contour.shape) == 2:
        _draw_curve(axes, contour)
    elif len(contour.shape) == 3:
        _draw_surface(axes, contour, pixels)
    else:
        raise OptionError(f"there is no picture of a field of {len(contour.shape)} axes", code="dimension")


def _draw_mesh(axes: Any, contour: Contour, position: np.ndarray, simplices: np.ndarray) -> None:
    """The triangles under a curve; of a surface the sides of its own triangles, those that look at the viewer."""
    collections = optional("matplotlib.collections", extra="plot", purpose="drawing a picture")
    if len(contour.shape) == 2:
        ends = np.unique(np.sort(simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
        axes.add_collection(
            collections.LineCollection(position[ends][:, :, ::-1], colors=["0.7"], linewidths=0.25, zorder=0)
        )
        return
    corners = contour.points[contour.cells] * _proportions(contour)
    # normals point to the samples below; what is outside is what the box's first corner is
    below = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ _TOWARDS > 0
    front = below != bool(contour.origin_above)
    flat = _box(contour) @ np.stack([_RIGHT, _UP], axis=1)
    shown = corners[front] @ np.stack([_RIGHT, _UP], axis=1) - (flat.min(axis=0) + flat.max(axis=0)) / 2
    axes.add_collection(
        collections.LineCollection(shown[:, [0, 1, 2, 0]], colors=[(0, 0, 0, 0.25)], linewidths=0.2, zorder=3)
    )


def _draw_curve(axes: Any, contour: Contour) -> None:
    collections = optional("matplotlib.collections", extra="plot", purpose="drawing a picture")
    lines = [np.asarray(line)[:, ::-1] for line in contour.lines]
    axes.add_collection(collections.LineCollection(lines, colors=[_INK], linewidths=0.7, capstyle="round"))
    rows, columns = contour.shape
    axes.set_xlim(-0.5, columns - 0.5)
    # Downwards, as pictures are shown.
    axes.set_ylim(rows - 0.5, -0.5)
    down, across = _proportions(contour)
    axes.set_aspect(down / across)
    axes.tick_params(labelsize=7)


def _draw_surface(axes: Any, contour: Contour, pixels: int) -> None:
    """The surface as a picture of its own: matplotlib sorts whole triangles, and that shows in every fold."""
    flat = _box(contour) @ np.stack([_RIGHT, _UP], axis=1)
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float((high - low).max()) or 1.0
    centre = (low + high) / 2
    image = shade(contour.points * _proportions(contour), contour.cells, centre, scale, pixels)
    half = scale / 2
    for a, b in zip(*_box_edges(), strict=True):
        line = flat[[a, b]] - centre
        axes.plot(line[:, 0], line[:, 1], color="0.75", linewidth=0.5, zorder=1)
    axes.imshow(image, extent=(-half, half, -half, half), origin="lower", zorder=2, interpolation="antialiased")
    axes.set_xlim(-1.04 * half, 1.04 * half)
    axes.set_ylim(-1.04 * half, 1.04 * half)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _box(contour: Contour) -> NDArray[np.float64]:
    """Corners of the sampled box, (8, 3)."""
    return np.array(list(product(*((0.0, n - 1.0) for n in contour.shape)))) * _proportions(contour)


def _box_edges() -> tuple[list[int], list[int]]:
    """Pairs of corners of a cube, numbered by their bits, that differ in one bit."""
    pairs = [(a, a | 1 << axis) for a in range(8) for axis in range(3) if not a >> axis & 1]
    return [a for a, _ in pairs], [b for _, b in pairs]


def shade(
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    centre: NDArray[np.float64],
    scale: float,
    pixels: int,
) -> NDArray[np.float64]:
    """Draw triangles in parallel projection with a depth buffer, lit by their normals.

    Triangles are splatted as lattices of points less than a pixel apart, so that the time follows the
    area on the screen and not the number of triangles.

    Parameters
    ----------
    points : (P, 3) float64
    cells : (M, 3) int64
    centre : (2,) float64
        What lies in the middle of the picture, along right and up.
    scale : float
        Width and height of what the picture shows.
    pixels : int
        Width and height of the picture.

    Returns
    -------
    (pixels, pixels, 4) float64
        Red, green, blue and opacity in 0 .. 1; the first row is the lowest.
    """
    side = 2 * pixels  # averaged down below, against ragged edges
    # Half a pixel of room, so that what lies on the border of the box falls inside.
    screen = (points @ np.stack([_RIGHT, _UP], axis=1) - centre) * ((side - 1) / scale) + side / 2
    depth = points @ _TOWARDS
    nearest = np.full(side * side, -np.inf)
    shown = np.full(side * side, -1, dtype=np.int64)
    for chosen, weights in _lattices(screen, cells):
        corners = cells[chosen]
        at = weights @ screen[corners]
        inside = np.clip(np.floor(at).astype(np.int64), 0, side - 1)
        pixel = (inside[..., 1] * side + inside[..., 0]).ravel()
        near = (depth[corners] @ weights.T).ravel()
        np.maximum.at(nearest, pixel, near)
        front = near == nearest[pixel]
        shown[pixel[front]] = np.repeat(chosen, len(weights))[front]

    image = np.empty((pixels, pixels, 4))
    for start in range(0, pixels, _BAND):
        end = min(start + _BAND, pixels)
        seen = shown[2 * start * side : 2 * end * side]
        image[start:end] = _lit(points, cells, seen).reshape(end - start, 2, pixels, 2, 4).sum(axis=(1, 3))
    # Colours weighted by opacity, or empty pixels would darken the outline.
    image[..., :3] /= np.maximum(image[..., 3:], 1.0)
    image[..., 3] /= 4.0
    return image


def _lit(points: NDArray[np.float64], cells: NDArray[np.int64], shown: NDArray[np.int64]) -> NDArray[np.float64]:
    """Colour and opacity, (S, 4), of pixels that show a triangle each, or none (-1)."""
    image = np.zeros((len(shown), 4))
    seen = shown >= 0
    a, b, c = (points[cells[shown[seen], k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0, length, 1.0)[:, None]
    # Both sides are lit alike: an open surface shows its inside.
    normal *= np.where(normal @ _TOWARDS < 0, -1.0, 1.0)[:, None]
    image[seen, :3] = _SURFACE * (0.3 + 0.7 * np.clip(normal @ _LIGHT, 0.0, 1.0))[:, None]
    image[seen, 3] = 1.0
    return image


def _lattices(
    screen: NDArray[np.float64], cells: NDArray[np.int64], batch: int = 1 << 17
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Batches of triangles, each with the barycentric weights (S, 3) of points dense enough for all of them."""
    if len(cells) == 0:
        return
    a, b, c = (screen[cells[:, k]] for k in range(3))
    longest = np.sqrt(np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0))
    # At 0.85 pixels no pixel inside a triangle stays empty: the widest gap in the lattice is then below one.
    steps = np.maximum(np.ceil(longest / 0.85), 1.0)
    sizes = np.unique([m << k for k in range(14) for m in (2, 3)] + [1])
    size = sizes[np.minimum(np.searchsorted(sizes, steps), len(sizes) - 1)]
    for n in np.unique(size):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        kept = i + j <= n
        weights = np.stack([i[kept], j[kept], n - i[kept] - j[kept]], axis=1) / n
        chosen = np.flatnonzero(size == n)
        count = max(1, batch // len(weights))
        for start in range(0, len(chosen), count):
            yield chosen[start : start + count], weights
