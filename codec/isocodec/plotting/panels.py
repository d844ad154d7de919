"""Pictures of contours: those of one field, the steps of a progressive file side by side, and for notebooks.

Figures are made without ``pyplot``, so that no window system is needed and no state remains.
"""

from __future__ import annotations

import io
import math
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import IsoError, OptionError, one_line
from ..field.labelling import caption, colour_of, name_of, noun_of
from ..field.sampled import UNIT
from .scene import USUAL, draw_in_space, drawing, rotation, world

PICTURES = (".png", ".pdf", ".svg")
_INK, _SURFACE = (0.10, 0.25, 0.45), (0.62, 0.72, 0.84)
"""Colours of a curve and a surface that are drawn alone."""
_NAMED = 12
"""Largest number of isovalues that a legend lists."""
Meshes = Sequence[tuple[NDArray[np.float64], NDArray[np.int64]]]


class StepPanel(NamedTuple):
    """Contours of one field, a title, and meshes to be drawn below: points and triangles of each."""

    contours: Sequence[Any]
    title: str = ""
    meshes: Meshes = ()


def check_picture(path: Path, view: str | None) -> str:
    """Check a picture's name, a view, and that the library for it is installed; returns the suffix.

    Raises `OptionError` or `MissingExtraError`.
    """
    rotation(view or USUAL)
    suffix = path.suffix.lower()
    if suffix not in PICTURES:
        raise OptionError(f"{suffix or 'a name without a suffix'} is not a picture", code="suffix",
                          remedy=f"one of {', '.join(PICTURES)}")
    drawing("figure")
    return suffix


def picture_file(figure: Any, suffix: str, **options: Any) -> bytes:
    """Make the file of a figure: texts stay texts, no point is left out, and equal figures give equal bytes."""
    buffer = io.BytesIO()
    same = {"svg.fonttype": "none", "svg.hashsalt": "isocodec", "pdf.fonttype": 42, "path.simplify": False}
    date = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix)
    with drawing("style").context(same):
        figure.savefig(buffer, format=suffix[1:], dpi=figure.dpi, metadata=date, **options)
    return buffer.getvalue()


def colours_of(isovalues: Sequence[float], solid: bool = False, notes: Mapping[str, str] | None = None) -> Any:
    """Colours, (V, 4) in 0 .. 1: of labels those in the notes of a file; of others by rank, from violet to a yellow
    that lines, or shades, still show in."""
    rising, rank = np.unique(isovalues, return_inverse=True)
    low, high = (0.3, 0.9) if solid else (0.0, 8 / 9)
    ranked = drawing("cm").viridis(low + rank / max(len(rising) - 1, 1) * (high - low))
    own = [colour_of(one, notes or {}) for one in isovalues]
    return np.array([drawing("colors").to_rgba(one or colour) for one, colour in zip(own, ranked, strict=True)])


def legend_text(isovalue: float, notes: Mapping[str, str]) -> str:
    """An isovalue, or a label with its name, in a legend."""
    return f"{isovalue:.10g} {one_line(name_of(isovalue, notes), 20)}".rstrip()


def contour_picture(contours: Iterable[Any], suffix: str = ".png") -> bytes:
    """Make the picture of contours of a field: curves in one panel, surfaces side by side.

    An SVG of curves has the pixels of the field as its unit and no frame, so that the two can be overlaid. Raises
    `MissingExtraError` if matplotlib is missing.
    """
    every = [*contours]
    first, isovalues = every[0], [one.isovalue for one in every]
    panels = [StepPanel([one], caption(one.isovalue, one.metadata)) for one in every]
    if first.n == 3:
        columns = math.ceil(math.sqrt(len(every)))
        return panels_picture(panels, suffix, columns=columns, side=6 / columns)
    if suffix != ".svg" or not first.shape:
        return panels_picture([StepPanel(every)] if len(every) > 1 else panels, suffix, isovalues=isovalues, side=6)
    figure = drawing("figure").Figure(np.array(first.shape[::-1]) / 72, dpi=72, frameon=False)
    axes = figure.add_axes((0, 0, 1, 1))
    colours = colours_of(isovalues, notes=first.metadata) if len(every) > 1 else [_INK]
    _draw_curves(axes, every, colours, max(first.shape) / 600)
    axes.set_aspect("auto")
    axes.set_axis_off()
    return picture_file(figure, suffix)


def panels_picture(
    panels: Sequence[StepPanel], suffix: str = ".png", view: str = USUAL, isovalues: Sequence[float] = (),
    columns: int = 6, side: float = 2.6,
) -> bytes:
    """Make a picture of panels of one field side by side, the longer side of each ``side`` inches.

    The view of surfaces is that of `scene.rotation`; colours distinguish isovalues.
    """
    return picture_file(panels_figure(panels, view, isovalues, columns, side), suffix)


def panels_figure(
    panels: Sequence[StepPanel], view: str, isovalues: Sequence[float], columns: int, side: float
) -> Any:
    """Draw panels; parameters as of `panels_picture`."""
    last = panels[-1].contours[0]
    solid, in_space, several = last.n == 3, last.points.shape[1] == 3, len(isovalues) > 1
    size = np.ptp(last.points, axis=0)[::-1] if not last.shape else np.linalg.norm(world(last), axis=0) * last.shape
    size = np.ones(2) if in_space else np.maximum(size / max(size.max(), 1e-300), 0.25)
    columns, rows = min(len(panels), columns), -(-len(panels) // columns)
    whole = side * size[::-1] * [columns, rows] + [several, 0.4 * rows]
    figure = drawing("figure").Figure(np.maximum(whole, 2.2 * several), dpi=150, layout="constrained")
    colours = dict(zip(isovalues, colours_of(isovalues, solid, last.metadata), strict=True)) if several else {}
    for number, (contours, title, meshes) in enumerate(panels, 1):
        axes = figure.add_subplot(rows, columns, number)
        axes.set_title(title, fontsize=7)
        axes.tick_params(labelsize=7)
        if len(panels) > 1:
            axes.set(xticks=[], yticks=[])
        own = [colours.get(one.isovalue, _SURFACE if solid else _INK) for one in contours]
        if in_space:
            draw_in_space(axes, contours, own, view, meshes)
        else:
            _draw_curves(axes, contours, own, 0.7 if len(contours) <= _NAMED else 0.45, meshes)
    if several:
        named = sorted(isovalues)[:: -(-len(isovalues) // _NAMED)][::-1]
        unit = one_line(last.metadata.get(UNIT, ""), 20)
        figure.legend(
            [drawing("lines").Line2D([], [], color=colours[one]) for one in named],
            [legend_text(one, last.metadata) for one in named],
            loc="outside right upper", fontsize=7, title=noun_of(last.metadata) + f" ({unit})" * bool(unit),
            title_fontsize=7,
        )
    return figure


def html_of(contours: Sequence[Any], facts: Mapping[str, object]) -> str:
    """Make HTML of contours of one field, with facts below; without a picture if matplotlib is missing."""
    picture = ""
    try:
        if contours:
            data = b64encode(contour_picture(contours)).decode()
            picture = f'<img alt="" style="max-width:480px" src="data:image/png;base64,{data}"/>'
    except IsoError:
        pass
    left = 'style="text-align:left"'
    rows = "".join(f"<tr><th {left}>{escape(k)}</th><td {left}>{escape(str(v))}</td></tr>" for k, v in facts.items())
    return f"<div>{picture}<table>{rows}</table></div>"


def _draw_curves(
    axes: Any, contours: Sequence[Any], colours: Iterable[Any], width: float, meshes: Meshes = ()
) -> None:
    """Draw curves of one field: those of a grid in samples, with rows downwards as in pictures."""
    first = contours[0]
    order = slice(None, None, -1 if first.shape else 1)
    for points, cells in meshes:
        axes.triplot(*points.T[order], cells, color="0.7", linewidth=0.25, zorder=0)
    for contour, colour in zip(contours, colours, strict=True):
        axes.add_collection(drawing("collections").LineCollection(
            [line[:, order] for line in contour.lines], colors=[colour], linewidths=width, capstyle="round",
            gid=caption(contour.isovalue, contour.metadata),
        ))
    axes.autoscale()
    down, across = np.linalg.norm(world(first), axis=0)
    axes.set_aspect(down / across)
    if first.shape:
        axes.set(xlim=(-0.5, first.shape[1] - 0.5), ylim=(first.shape[0] - 0.5, -0.5))
