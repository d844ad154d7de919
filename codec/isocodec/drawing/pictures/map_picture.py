"""Contour maps: labelled lines over a shaded relief, coordinates on the frame, a scale bar, and hatched holes."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...errors import OptionError, one_line
from ...extras import optional
from ...field.sampled import UNIT
from ..curve import Curve
from .ground import Ground, ground_of
from .line_labels import Label, Page, label_lines, page_of
from .picture import matplotlib_figure
from .relief import colour_map, draw_relief, hole_path, within_holes

Points = NDArray[np.float64]

INCH = 2.54
"""Centimetres."""
MOST_PIXELS = 1 << 28
_POINTS = 72
"""In an inch."""
_LEFT, _RIGHT, _BELOW, _ABOVE, _TITLE = 0.62, 0.25, 0.95, 0.38, 0.22
"""Width of the margin around the map for text, in inches."""
_LEAST = 0.2
"""Least ratio of the shorter to the longer side of a map."""
_SMALL = 7
"""Size of text, in points."""


@dataclass(frozen=True)
class Colours:
    """Colours of a map."""

    paper: str
    text: str
    line: str
    index: str
    shadow: str
    light: str
    hole: str


LIGHT = Colours("#ffffff", "#222222", "#a9744a", "#7a4a22", "#b9b7b0", "#fdfcf8", "#e4e4e4")
DARK = Colours("#16181b", "#d8d8d8", "#c79a63", "#f0c68c", "#0c0d0f", "#4a4e54", "#2b2e33")


@dataclass(frozen=True)
class MapLook:
    """Look of a map.

    Attributes
    ----------
    index : int
        Every line whose number is a multiple of this is thick and labelled.
    title : str
    size : float
        Longest side of the map, without its frame, in centimetres.
    dpi : int
    colours : Colours
    """

    index: int = 5
    title: str = ""
    size: float = 20.0
    dpi: int = 200
    colours: Colours = LIGHT


class Map(NamedTuple):
    """Make the file of a map; also returns the number of labels."""

    data: bytes
    labels: int


def map_picture(
    contours: Sequence[Curve], suffix: str, look: MapLook, field: NDArray[Any] | None = None,
    valid: NDArray[np.bool_] | None = None,
) -> Map:
    """Draw the map of the isocontours of a field.

    Parameters
    ----------
    contours : sequence of Curve
        Contours of one field with two axes.
    suffix : str
        One of `picture.PICTURE_SUFFIXES`.
    look : MapLook
    field : (s0, s1) array, optional
        Samples for the shaded relief; without them, the map has no relief.
    valid : (s0, s1) array of bool, optional
        Which samples are not missing; all if not given.

    Raises
    ------
    OptionError
        If the field does not have two axes, or the picture has too many pixels.
    MissingExtraError
        If matplotlib is missing, or if the contours name a reference system and pyproj is missing.
    """
    contours = [contour.flat for contour in contours]
    first = contours[0]
    if len(first.shape) != 2:
        raise OptionError("a map needs a field with two axes", code="dimension", remedy="isocodec plot draws surfaces")
    ground = ground_of(first)
    figure, axes = _sheet(first, look, ground)
    if field is not None:
        draw_relief(axes, first, field, valid, colour_map(look.colours.shadow, look.colours.light))
    page = page_of(*(axes.bbox.size / figure.dpi * _POINTS))
    if valid is not None and not valid.all():
        _draw_holes(axes, first, valid, look.colours, page)
    labels = _draw_lines(axes, contours, look, page)
    _write_around(figure, axes, contours, look, ground, valid is not None and not valid.all())
    return Map(_file(figure, suffix, look), labels)


# ---- The sheet ------------------------------------------------------------------------------------------------------


def _sheet(contour: Curve, look: MapLook, ground: Ground) -> tuple[Any, Any]:
    """Make figure and axes of a map, with the same scale along both axes regardless of the text around it."""
    low, high = _extent(contour)
    size = np.maximum(high - low, 1e-300) * [ground.shrinks, 1]
    sides = size / size.max()
    # a narrow map gets empty space, not a different scale
    shown = np.maximum(sides, _LEAST)
    middle, half = (low + high) / 2, (high - low) / 2 * shown / sides
    width, height = shown * look.size / INCH
    above = _ABOVE + (_TITLE if look.title else 0)
    whole = np.array([width + _LEFT + _RIGHT, height + _BELOW + above])
    if np.prod(whole * look.dpi) > MOST_PIXELS or (whole * look.dpi).max() >= 1 << 16:
        pixels = " x ".join(f"{n:,.0f}" for n in whole * look.dpi)
        raise OptionError(f"a picture of {pixels} pixels is too large", code="size", remedy="choose a smaller size or "
                                                                                            "dpi")
    figure = matplotlib_figure().Figure(figsize=whole, dpi=look.dpi)
    axes = figure.add_axes((_LEFT / whole[0], _BELOW / whole[1], width / whole[0], height / whole[1]))
    axes.set_facecolor(look.colours.paper)
    for k, limits in enumerate((axes.set_xlim, axes.set_ylim)):
        ends = middle[k] - half[k], middle[k] + half[k]
        # sample indices increase downwards, as in pictures
        limits(*(ends if k == 0 or ground.placed else ends[::-1]))
    return figure, axes


def _extent(contour: Curve) -> tuple[Points, Points]:
    """Least and largest x and y of samples."""
    if contour.placement is not None and contour.bent:
        nodes = contour.placement.nodes()
        return np.array([node.min() for node in nodes]), np.array([node.max() for node in nodes])
    far = np.array(contour.shape) - 1.0
    corners = contour.place(np.array([(0, 0), (far[0], 0), far, (0, far[1])]))
    return corners.min(axis=0), corners.max(axis=0)


# ---- Holes and lines ------------------------------------------------------------------------------------------------


def _draw_holes(axes: Any, contour: Curve, valid: NDArray[np.bool_], colours: Colours, page: Page) -> None:
    """Hatch unit cells with a missing corner, where curves end."""
    patches = optional("matplotlib.patches", extra="plot", purpose="drawing a picture")
    axes.add_patch(
        patches.PathPatch(
            hole_path(contour, valid), facecolor=colours.hole, edgecolor=colours.text, linewidth=0, hatch="//////",
            alpha=0.4, zorder=1, gid="holes",
        )
    )
    page.shut_box(_on_page(axes, contour.place(within_holes(valid, page.shut.shape))))


def _draw_lines(axes: Any, contours: Sequence[Curve], look: MapLook, page: Page) -> int:
    """Draw thin lines, thick index lines broken under their labels, and the labels; returns the number of labels."""
    thick = index_lines([contour.isovalue for contour in contours], look.index)
    thin_lines: list[Points] = []
    index: list[tuple[Points, str]] = []
    for contour, is_index in zip(contours, thick, strict=True):
        for walk in contour.walks:
            line = _on_page(axes, contour.placed[walk])
            page.add(line)
            if is_index:
                index.append((line, f"{contour.isovalue:.10g}"))
            else:
                thin_lines.append(line)
    widths = {text: _width(text) for text in {text for _, text in index}}
    labels, broken = label_lines(page, index, widths, 0.75 * _SMALL)
    collections = optional("matplotlib.collections", extra="plot", purpose="drawing a picture")
    transforms = optional("matplotlib.transforms", extra="plot", purpose="drawing a picture")
    on_map = transforms.Affine2D().scale(1 / _POINTS).translate(_LEFT, _BELOW) + axes.figure.dpi_scale_trans
    for name, lines, colour, width in (
        ("contours", thin_lines, look.colours.line, 0.45), ("index-contours", broken, look.colours.index, 1.0),
    ):
        drawn = collections.LineCollection(
            lines, colors=[colour], linewidths=width, capstyle="butt", joinstyle="round", zorder=2, gid=name
        )
        drawn.set_transform(on_map)
        drawn.set_clip_path(axes.patch)
        axes.add_collection(drawn, autolim=False)
    for number, label in enumerate(labels, 1):
        _write_label(axes, label, on_map, look.colours, f"label-{number}")
    return len(labels)


def _write_label(axes: Any, label: Label, on_map: Any, colours: Colours, gid: str) -> None:
    """Draw a label over its halo, as two texts, since a text with an effect would become a path."""
    effects = optional("matplotlib.patheffects", extra="plot", purpose="drawing a picture")
    common = {
        "rotation": label.angle, "rotation_mode": "anchor", "ha": "center", "va": "center_baseline", "fontsize": _SMALL,
        "transform": on_map, "parse_math": False,
    }
    halo = effects.Stroke(linewidth=1.6, foreground=colours.paper, alpha=0.85)
    axes.text(*label.at, label.text, path_effects=[halo], zorder=3, **common)
    axes.text(*label.at, label.text, color=colours.index, zorder=4, gid=gid, **common)


def index_lines(isovalues: Sequence[float], every: int) -> list[bool]:
    """Find isovalues with index lines: multiples of the interval times ``every``, such as 100, 200 of 20, 40, ...

    If the isovalues are evenly spaced but offset from multiples of the interval, the offset is ignored: 100.5, 200.5.
    If they are not evenly spaced, every ``every``-th one is taken.
    """
    order = np.argsort(isovalues, kind="stable")
    rising = np.asarray(isovalues, np.float64)[order]
    steps = np.diff(rising)
    numbers = np.arange(len(rising))
    if len(steps) and (step := steps.min()) > 0:
        found = np.round((rising - rising[0]) / step)
        if np.abs(rising - rising[0] - found * step).max() < 1e-6 * step * max(found[-1], 1):
            numbers = found.astype(np.int64) + math.floor(rising[0] / step + 1e-6)
    out = np.empty(len(rising), np.bool_)
    out[order] = numbers % every == 0
    return out.tolist() if out.any() else [True] * len(rising)


def _on_page(axes: Any, points: Points) -> Points:
    """Convert world coordinates to points on the page, from the lower left corner of the map."""
    pixels = axes.transData.transform(points) - axes.bbox.min
    return np.asarray(pixels * (_POINTS / axes.figure.dpi))


def _width(text: str, size: float = _SMALL) -> float:
    """Width of a text, in points."""
    paths = optional("matplotlib.textpath", extra="plot", purpose="drawing a picture")
    return float(paths.TextPath((0, 0), text.replace("$", "S"), size=size).get_extents().width)


# ---- Around the map -------------------------------------------------------------------------------------------------


def _write_around(
    figure: Any, axes: Any, contours: Sequence[Curve], look: MapLook, ground: Ground, holes: bool
) -> None:
    """Draw frame, coordinates, title, notes and scale bar."""
    ticker = optional("matplotlib.ticker", extra="plot", purpose="drawing a picture")
    colours = look.colours
    for k, axis in enumerate((axes.xaxis, axes.yaxis)):
        low, high = sorted(axis.get_view_interval())
        axis.set_major_locator(ticker.MaxNLocator(5, steps=ground.steps(k, high - low)))
        # ticks outside the map would move its border
        places = [at for at in axis.get_majorticklocs() if low <= at <= high]
        axis.set_ticks(places, [ground.written(at, k, places) for at in places])
        axis.set_label_text(ground.axes[k], fontsize=_SMALL, color=colours.text)
    axes.tick_params(labelsize=_SMALL, colors=colours.text, direction="out", length=3, width=0.6)
    for tick in axes.get_yticklabels():
        tick.set_rotation(90)
        tick.set_va("center")
    axes.grid(True, color=colours.text, linewidth=0.25, alpha=0.25, zorder=0.5)
    for spine in axes.spines.values():
        spine.set(linewidth=0.9, color=colours.text)
    write = {"color": colours.text, "parse_math": False, "transform": figure.dpi_scale_trans}
    width, height = figure.get_size_inches()
    lines = _said_of_lines(contours, look.index) + ("   hatched: no data" if holes else "")
    for gid, text, low, size in (
        ("title", one_line(look.title), height - 0.4, 11), ("system", ground.name, 0.33, _SMALL),
        ("interval", lines, 0.16, _SMALL),
    ):
        if text:
            fitting = min(size, size * (width - _LEFT - 0.05) * _POINTS / _width(text, size))
            weight = "bold" if gid == "title" else "normal"
            figure.text(_LEFT, low, text, fontsize=fitting, fontweight=weight, gid=gid, **write)
    _scale_bar(figure, axes, ground, write)


def _said_of_lines(contours: Sequence[Curve], every: int) -> str:
    """Describe the interval of the lines and of the index lines, if the lines are evenly spaced."""
    unit = one_line(contours[0].metadata.get(UNIT, ""), 20)
    values = sorted(contour.isovalue for contour in contours)
    steps = np.diff(values)
    behind = f" {unit}" if unit else ""
    if len(values) == 1:
        return f"contour {values[0]:.10g}{behind}"
    if np.ptp(steps) > 1e-6 * steps.max():
        return f"{len(values)} contours{', ' + unit if unit else ''}"
    step = float(steps.mean())
    return f"contour interval {step:.6g}{behind}, index contours {step * every:.6g}{behind}"


def _scale_bar(figure: Any, axes: Any, ground: Ground, write: dict[str, Any]) -> None:
    """Draw a scale bar of two parts with a round length, below the map at its right end."""
    patches = optional("matplotlib.patches", extra="plot", purpose="drawing a picture")
    inches = axes.bbox.width / figure.dpi
    a_inch = abs(np.diff(axes.get_xlim())[0]) * ground.scale / inches
    length = _round_below(min(0.25 * inches, 2.2) * a_inch)
    divisor, unit = (1000, "km") if ground.unit == "m" and length >= 1000 else (1, ground.unit)
    numbers = [f"{part * length / 2 / divisor:.10g}" for part in (0, 1, 2)]
    right, low = _LEFT + inches - (_width(f"{numbers[2]} {unit}") - _width(numbers[2]) / 2) / _POINTS, 0.5
    half = length / a_inch / 2
    for part, number in enumerate(numbers):
        at = right + (part - 2) * half
        if part < 2:
            box = patches.Rectangle(
                (at, low), half, 0.05, transform=figure.dpi_scale_trans, edgecolor=write["color"], linewidth=0.6,
                facecolor="none" if part else write["color"], gid=f"scale-bar-{part}",
            )
            figure.add_artist(box)
        # the unit follows the number in the middle
        figure.text(
            at - _width(number) / _POINTS / 2, low + 0.08, f"{number} {unit}" if part == 2 else number,
            fontsize=_SMALL, **write,
        )


def _round_below(number: float) -> float:
    """The largest of 1, 2, 5, 10, 20, .. that is not greater than a number."""
    power = 10.0 ** math.floor(math.log10(number))
    return next((k * power for k in (5, 2) if k * power <= number), power)


def _file(figure: Any, suffix: str, look: MapLook) -> bytes:
    """Write the picture; in .svg, texts stay texts, and equal maps give equal bytes."""
    matplotlib = optional("matplotlib", extra="plot", purpose="drawing a picture")
    dated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "isocodec", "pdf.fonttype": 42}):
        figure.savefig(
            buffer, format=suffix[1:], dpi=look.dpi, facecolor=look.colours.paper, metadata=dated.get(suffix)
        )
    return buffer.getvalue()
