"""Pictures: curves and surfaces by matplotlib, masks by Pillow, and curves as SVG paths."""

from __future__ import annotations

import io
import re
from collections.abc import Collection, Iterable
from itertools import groupby
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...drawing.contour import Contour
from ...drawing.pictures.picture import contour_picture
from ...extras import optional
from .output_formats import Cost, Output, OutputOptions
from .things import Picture, SampleMask


def _drawn(contours: Collection[Contour], suffix: str, _: OutputOptions) -> bytes:
    return contour_picture(contours, suffix)


def _mask_png(mask: SampleMask, _: str, __: OutputOptions) -> bytes:
    """Write a picture that is white where samples lie above."""
    pillow: Any = optional("PIL.Image", extra="image", purpose="writing .png")
    shape, rows = mask.taken()
    # the library needs the whole picture
    picture = pillow.new("L", shape[::-1])
    start = 0
    for some in rows:
        picture.paste(pillow.fromarray(some.view(np.uint8) * np.uint8(255)), (0, start))
        start += len(some)
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    return buffer.getvalue()


_ZEROS = re.compile(r"\.?0+(?=[ ,])")
"""Decimals that are 0, at the end of a number."""


def _picture(picture: Picture, suffix: str, _: OutputOptions) -> bytes:
    return picture.draw(suffix)


def _svg(contours: Iterable[Contour], _: str, __: OutputOptions) -> bytes:
    """Write a group for each isovalue, with a path for each polyline.

    The view box matches the picture's pixels, so that the two can be overlaid: x runs along axis 1 of the array and y
    along axis 0, in samples, regardless of the placement.
    """
    strokes = {"fill": "none", "stroke": "black", "stroke-width": "1", "stroke-linejoin": "round"}
    size: dict[str, str] = {}
    groups = []
    for contour in contours:
        rows, columns = contour.shape
        # samples are the centres of pixels
        size = {"width": str(columns), "height": str(rows), "viewBox": f"-0.5 -0.5 {columns} {rows}"}
        group = ElementTree.Element("g", strokes)
        ElementTree.SubElement(group, "title").text = f"isovalue {contour.isovalue:g}"
        for path in filter(None, map(_path, contour.lines)):
            # The line width is measured on screen, since a contour has no width.
            ElementTree.SubElement(group, "path", {"d": path, "vector-effect": "non-scaling-stroke"})
        groups.append(ElementTree.tostring(group))
        del contour, group
    root = ElementTree.tostring(ElementTree.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", **size}))
    head = b'<?xml version="1.0" encoding="UTF-8"?>\n' + root.replace(b" />", b">")
    return b"".join([head, *groups, b"</svg>\n"])


def _path(line: NDArray[np.float64]) -> str:
    closed = len(line) > 2 and bool((line[0] == line[-1]).all())
    # Six decimals are a millionth of a cell, finer than any stroke, and take half the size of all digits.
    text = "%.6f,%.6f " * len(line) % tuple(line[:, ::-1].ravel().tolist())
    text = _ZEROS.sub("", text.replace("-0.000000", "0.000000"))
    # points that fall together are one, and one point is no path
    corners = [corner for corner, _ in groupby(text.split())]
    return "" if len(corners) < 2 else "M" + " ".join(corners[: -1 if closed else None]) + ("Z" if closed else "")


PICTURE = {2: Cost(200, 160, fixed=1 << 25), 3: Cost(80, 260, fixed=3 << 26, kept=0)}
"""Memory that pictures take, by the number of axes of the field."""
_MATPLOTLIB: Any = {"extra": "plot", "libraries": ("matplotlib.figure",), "coordinates": "samples"}
OUTPUTS = (
    Output("contour", (".png",), "PNG", _drawn, (2, 3), (2, 3), "a colour or a panel each", cost=PICTURE,
           **_MATPLOTLIB),
    Output("contour", (".svg",), "SVG", _svg, (2,), (2,), "a group each", "samples",
           cost={2: Cost(120, 100, kept=50)}),
    Output("mask", (".png",), "PNG", _mask_png, (2,), coordinates="samples", extra="image", libraries=("PIL.Image",)),
    Output("picture", (".png", ".pdf", ".svg"), "PNG, PDF, SVG", _picture, (2, 3), (2, 3), "a colour or a panel each",
           sampled=False, **_MATPLOTLIB),
)
