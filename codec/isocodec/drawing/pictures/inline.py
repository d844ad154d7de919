"""Display in notebooks: a drawing of a few curves as HTML, and a table of facts."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from ...errors import IsoError, MissingExtraError
from ...field.labelling import caption
from ..curve import Curve
from .colours import places_of
from .picture import contour_picture

MOST_POINTS = 50_000
"""Largest number of points of curves that are drawn as paths; curves with more become a picture."""
_SIDE = 480
"""Pixels along the longer side."""


def page_of(contours: Sequence[Curve], facts: Mapping[str, object]) -> str:
    """Make HTML of curves or surfaces of one field, with facts below.

    Surfaces, and curves with many points, are pictures made by matplotlib; they are omitted without it.
    """
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th><td style="text-align:left">{escape(str(fact))}</td></tr>'
        for name, fact in facts.items()
    )
    return f"<div>{_drawing(contours)}<table>{rows}</table></div>"


def _drawing(contours: Sequence[Curve]) -> str:
    if not contours:
        return ""
    points = sum(len(contour.points) for contour in contours)
    if all(contour.n == 2 and contour.points.shape[1] == 2 for contour in contours) and points <= MOST_POINTS:
        return _paths(contours)
    try:
        picture = contour_picture(contours)
    except (MissingExtraError, IsoError):
        return ""
    return f'<img alt="" style="max-width:{_SIDE}px" src="data:image/png;base64,{base64.b64encode(picture).decode()}"/>'


def _paths(contours: Sequence[Curve]) -> str:
    """Make an SVG with rows downwards, as in pictures; on a mesh in the plane, with y upwards."""
    shape = contours[0].shape
    if shape:
        low, size = np.array([-0.5, -0.5]), np.array(shape[::-1], float)
    else:
        every = np.concatenate([contour.points for contour in contours]) * (1, -1)
        low = every.min(axis=0) if len(every) else np.zeros(2)
        size = np.maximum(np.ptp(every, axis=0), 1e-9) if len(every) else np.ones(2)
    scale = _SIDE / size.max()
    width, height = np.maximum(np.rint(size * scale), 1).astype(int)
    paths = []
    places = places_of([contour.isovalue for contour in contours])
    for number, contour in enumerate(contours):
        turned = [line[:, ::-1] if shape else line * (1, -1) for line in contour.lines]
        text = "".join("M" + " ".join(f"{x:.4g},{y:.4g}" for x, y in (line - low) * scale) for line in turned)
        colour = f"hsl({270 - 210 * places[number]:.0f},60%,45%)"
        title = f"<title>{caption(contour.isovalue, contour.metadata)}</title>"
        paths.append(f'<path d="{text}" fill="none" stroke="{colour}">{title}</path>')
    box = f'width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {box}>{"".join(paths)}</svg>'
