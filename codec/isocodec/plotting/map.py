"""Contour maps: labelled lines over a shaded relief, coordinates on the frame, a scale bar, the reference system."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError, one_line
from ..field.labelling import is_of_labels, noun_of
from ..field.reference_system import short_name, system_of, to_degrees
from ..field.sampled import UNIT
from .panels import colours_of, legend_text
from .scene import drawing

Points = NDArray[np.float64]

_DPI, _MOST = 200, 16_000
"""Pixels per inch, and along a side."""
_NARROW = 0.2
"""Least ratio of the shorter to the longer side."""
_TEXT = 7
"""Size of text, in points."""
_INK, _LINE, _INDEX, _RELIEF = "#222222", "#a9744a", "#7a4a22", ("#b9b7b0", "#fdfcf8")
_EVERY = 200
"""Length of the pieces of index lines that have a label each, in points."""
_END = 16
"""Length of the ends of lines that have none."""


def map_figure(
    contours: Sequence[Any], samples: NDArray[Any] | None = None, valid: NDArray[np.bool_] | None = None,
    title: str = "", size: float = 20.0,
) -> Any:
    """Draw the map of contours of a field with two axes; the axes fill the figure, and texts lie around it.

    ``samples`` (s0, s1) give the relief, ``valid`` (s0, s1) marks those that are not missing, and ``size`` is the
    longest side of the map in centimetres. Raises `MissingExtraError` without matplotlib, or without pyproj if the
    contours name a reference system.
    """
    contours = [contour.flat for contour in contours]
    first = contours[0]
    nodes = first.place(np.argwhere(np.ones(first.shape)).astype(np.float64)).reshape(*first.shape, 2)
    low, high = nodes.min(axis=(0, 1)), nodes.max(axis=(0, 1))
    name, names, lengths, unit = _ground(first.placement, low, high)
    span = np.maximum(high - low, 1e-300) * lengths
    # a narrow map gets empty space, not another scale
    sides = np.maximum(span, _NARROW * span.max())
    figure = drawing("figure").Figure(sides / span.max() * size / 2.54, dpi=min(_DPI, _MOST * 2.54 / size))
    left, bottom = (low + high - sides / lengths) / 2
    right, top = (low + high + sides / lengths) / 2
    axes = figure.add_axes(
        (0, 0, 1, 1), xlim=(left, right), ylim=(top, bottom) if first.placement is None else (bottom, top),
        xlabel=names[0], ylabel=names[1],
    )
    axes.set_title(one_line(title), loc="left", parse_math=False)
    axes.grid(color=_INK, linewidth=0.25, alpha=0.25)
    about = _about(contours)
    if valid is not None:
        samples = np.where(valid, 0.0 if samples is None else samples, np.nan)
        about += "   blank: no data"
    if samples is not None:
        _draw_relief(axes, nodes, samples)
    _draw_lines(axes, contours)
    for axis, letters in (axes.xaxis, "WE"), (axes.yaxis, "SN"):
        steps = [1.0, 2, 5, 10]
        axis.set_major_formatter("{x:,.10g}")
        if "longitude" in names:
            axis.set_major_formatter(lambda at, _, letters=letters: _degrees(at, letters))
            steps = steps if np.ptp(axis.get_view_interval()) < 50 else [1, 1.5, 3, 4.5, 6, 9, 10]
        axis.set_major_locator(drawing("ticker").MaxNLocator(5, steps=steps))
        axis.label.set_size(_TEXT)
    axes.tick_params(labelsize=_TEXT)
    wide, high = axes.bbox.size * 72 / figure.dpi
    axes.text(0, -38 / high, f"{name}\n{about}", va="top", size=_TEXT, parse_math=False, transform=axes.transAxes)
    # a scale bar of two parts with a round length
    most = min(0.25, 160 / wide) * (right - left) * lengths[0]
    power = 10.0 ** math.floor(math.log10(most))
    length = next(k * power for k in (5, 2, 1) if k * power <= most)
    share = length / lengths[0] / (right - left)
    far, unit = (length / 1000, "km") if unit == "m" and length >= 1000 else (length, unit)
    bar = axes.inset_axes((1 - share, (-50 if wide > 250 else -85) / high, share, 4 / high), xlim=(0, 2), yticks=[])
    bar.axvspan(0, 1, color=_INK)
    bar.set_xticks([0, 1, 2], ["0", f"{far / 2:.10g}", f"{far:.10g} {unit}"], size=_TEXT, parse_math=False)
    bar.tick_params(length=0, labeltop=True, labelbottom=False, pad=1)
    return figure


def _degrees(at: float, letters: str) -> str:
    """Write a longitude or latitude: ``11.5°E``."""
    at = (at + 180) % 360 - 180
    return f"{abs(at):.10g}°" + letters[int(at > 0)] * (at not in (0, -180))


def _ground(placement: Any, low: Points, high: Points) -> tuple[str, Sequence[str], Any, str]:
    """Names of the reference system, x and y, lengths of their units on the ellipsoid amid the map, and the unit."""
    if placement is None or not placement.placed:
        return "coordinates in samples", ("column", "row"), np.ones(2), "samples"
    name = short_name(placement.crs or "reference system not stated")
    bare = name, ("x", "y"), np.ones(2), placement.unit.split()[0] if placement.unit else "units of x"
    step = (high - low).max() / 200
    ends = (low + high) / 2 + step * np.array([(-1, 0), (0, -1), (1, 0), (0, 1)])
    try:
        if (system := system_of(placement)) is None:
            return bare
        ends = to_degrees(system)(ends).T
    except OptionError:
        return bare
    metres = np.array(system.get_geod().inv(*ends[:, :2], *ends[:, 2:])[2]) / (2 * step)
    name = system.name + f" ({placement.crs})" * (placement.epsg is not None)
    if system.is_geographic:
        return name, ("longitude", "latitude"), np.maximum(metres, metres[1] / 100), "m"
    unit = system.axis_info[0].unit_name.replace("metre", "m")
    return name, (f"easting ({unit})", f"northing ({unit})"), metres[[0, 0]], "m"


def _about(contours: Sequence[Any]) -> str:
    """Describe the isovalues: their interval, if they are evenly spaced."""
    notes = contours[0].metadata
    noun, unit = noun_of(notes), f" {one_line(notes.get(UNIT, ''), 20)}".rstrip()
    values = np.sort([contour.isovalue for contour in contours])
    steps = np.diff(values)
    if len(values) == 1:
        return f"{noun} {values[0]:.10g}{unit}"
    if is_of_labels(notes) or np.ptp(steps) > 1e-6 * steps.max():
        return f"{len(values)} {noun}s"
    return f"contour interval {steps[0]:.6g}{unit}, index contours {5 * steps[0]:.6g}{unit}"


def _draw_relief(axes: Any, nodes: Points, samples: NDArray[Any]) -> None:
    """Draw a field lit from the upper left, 45 degrees high, so steep that slopes can be seen; holes stay blank.

    `matplotlib.colors.LightSource` takes neither holes nor grids that are turned or curved.
    """
    every = max(1, int(4 * min(np.array(samples.shape) / axes.bbox.size[::-1])))
    nodes, heights = nodes[::every, ::every], np.asarray(samples[::every, ::every], np.float64)
    page = axes.transData.transform(nodes.reshape(-1, 2)).reshape(nodes.shape)
    # on a curved grid, the steps in the middle represent all
    steps = np.stack(np.gradient(page, axis=(0, 1)))[:, len(page) // 2, page.shape[1] // 2]
    # next to holes, the field is taken to be level
    x, y = np.tensordot(np.linalg.inv(steps), np.nan_to_num(np.gradient(heights)), axes=1)
    x, y = np.array([x, y]) * 0.7 / max(np.percentile(np.hypot(x, y), 90), 1e-300)
    light = (x - y + np.sqrt(2)) / (2 * np.sqrt(1 + x * x + y * y))
    axes.pcolormesh(
        nodes[..., 0], nodes[..., 1], np.where(np.isnan(heights), np.nan, light), shading="gouraud", rasterized=True,
        cmap=drawing("colors").LinearSegmentedColormap.from_list("relief", _RELIEF), vmin=0, vmax=1, zorder=0,
    )


# ---- Lines and labels -----------------------------------------------------------------------------------------------


def index_lines(isovalues: Sequence[float], every: int = 5) -> list[bool]:
    """Find isovalues with index lines: multiples of the interval times ``every``, such as 100, 200 of 20, 40, ...

    If the isovalues are evenly spaced but offset from multiples of the interval, the offset is ignored: 100.5, 200.5.
    If they are not evenly spaced, every ``every``-th one is taken. Without any, all are.
    """
    rising, numbers = np.unique(np.asarray(isovalues, np.float64), return_inverse=True)
    step = np.diff(rising).min(initial=np.inf)
    found = (rising - rising[0]) / step
    if np.abs(found - np.rint(found)).max() < 1e-6 * max(found[-1], 1):
        numbers = np.rint(found)[numbers] + math.floor(rising[0] / step + 1e-6)
    index = numbers % every == 0
    return (index | ~index.any()).tolist()


def _draw_lines(axes: Any, contours: Sequence[Any]) -> None:
    """Draw thin lines, and thick index lines with labels where these are straight; of labels a colour each."""
    values, notes = [one.isovalue for one in contours], contours[0].metadata
    if is_of_labels(notes):
        for one, colour in zip(contours, colours_of(values, notes=notes), strict=True):
            axes.add_collection(drawing("collections").LineCollection(
                [one.placed[walk] for walk in one.walks], colors=[colour], linewidths=0.7, zorder=2, gid="label",
                in_layout=False, label=legend_text(one.isovalue, notes)), False)
        for text in axes.legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize=_TEXT, frameon=False).get_texts():
            text.set_parse_math(False)
        return
    index, labelled = index_lines(values), {}
    for gid, is_index, colour, width in ("contours", False, _LINE, 0.45), ("index", True, _INDEX, 1.0):
        chosen = [one for one, each in zip(contours, index, strict=True) if each == is_index]
        axes.add_collection(drawing("collections").LineCollection(
            [one.placed[walk] for one in chosen for walk in one.walks], colors=[colour], linewidths=width, zorder=2,
            gid=gid, in_layout=False), False)
    for one in sorted(chosen, key=lambda one: one.isovalue):
        if pieces := [part for walk in one.walks for part in _pieces(axes, one.placed[walk])]:
            labelled[one.isovalue] = pieces
    if not labelled:
        return
    drawn = drawing("contour").ContourSet(axes, [*labelled], [*labelled.values()], colors=_INDEX, linewidths=0)
    for text in drawn.clabel(fontsize=_TEXT, fmt=lambda value: f"{value:.10g}", inline=False, zorder=4):
        text.set(gid="label", in_layout=False, parse_math=False)
        # the halo is another text, since one with an effect would become a path
        halo = axes.text(*text.get_position(), text.get_text())
        halo.update_from(text)
        halo.set(gid=None, zorder=3, path_effects=[drawing("patheffects").Stroke(linewidth=2.4, foreground="white")])
    drawing("artist").Artist.remove(drawn)  # but not its labels


def _pieces(axes: Any, line: Points) -> list[Points]:
    """Cut a line, with a point for each pixel, into pieces that have a label each, without its ends."""
    far = np.append(0, np.cumsum(np.hypot(*np.diff(axes.transData.transform(line), axis=0).T)))
    end, every = (length * axes.figure.dpi / 72 for length in (_END, _EVERY))
    even = np.arange(end, far[-1] - end)
    if len(even) < 2 * end:
        return []
    line = np.stack([np.interp(even, far, one) for one in line.T], 1)
    return np.array_split(line, max(round(len(line) / every), 1))
