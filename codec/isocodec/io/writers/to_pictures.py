"""Pictures: curves and surfaces by matplotlib, masks by Pillow, and curves as SVG paths."""

from __future__ import annotations

import io
from collections.abc import Collection, Iterable, Iterator
from itertools import chain
from typing import Any

import numpy as np

from ...drawing.contour import Contour
from ...extras import optional
from ...field.labelling import caption
from .decimal_text import millionths, pair_texts
from .output_formats import Cost, Output, OutputOptions
from .things import Picture, SampleMask


def _drawn(contours: Collection[Contour], suffix: str, _: OutputOptions) -> bytes:
    from ...drawing.pictures.picture import contour_picture

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


def _picture(picture: Picture, suffix: str, _: OutputOptions) -> bytes:
    return picture.draw(suffix)


_STROKES = b'<g fill="none" stroke="black" stroke-width="1" stroke-linejoin="round"><title>%s</title>'
_PATH = b'<path d="M%b" vector-effect="non-scaling-stroke" />'
"""The line width is measured on screen, since a contour has no width."""


def _svg(contours: Iterable[Contour], _: str, __: OutputOptions) -> bytes:
    """Write a group for each isovalue, with a path for each polyline.

    The view box matches the picture's pixels, so that the two can be overlaid: x runs along axis 1 of the array and y
    along axis 0, in samples, regardless of the placement.
    """
    size, groups = "", []
    for contour in contours:
        rows, columns = contour.shape
        # samples are the centres of pixels
        size = f' width="{columns}" height="{rows}" viewBox="-0.5 -0.5 {columns} {rows}"'
        groups += [_STROKES % caption(contour.isovalue, contour.metadata).encode(), *_paths(contour), b"</g>"]
        del contour
    head = f'<?xml version="1.0" encoding="UTF-8"?>\n<svg xmlns="http://www.w3.org/2000/svg"{size}>'
    return b"".join([head.encode(), *groups, b"</svg>\n"])


def _paths(contour: Contour) -> Iterator[bytes]:
    """Yield a path for each polyline.

    Six decimals are a millionth of a cell, finer than any stroke, and take half the size of all digits.
    """
    walks = contour.walks
    if not walks:
        return
    sizes = np.array([len(walk) for walk in walks])
    points = contour.points[np.fromiter(chain.from_iterable(walks), np.int64, int(sizes.sum()))][:, ::-1]
    ends = np.cumsum(sizes)
    firsts = ends - sizes
    closed = (sizes > 2) & (points[firsts] == points[ends - 1]).all(axis=1)
    corners = millionths(points)
    # points that fall together are one, and one point is no path
    apart = np.concatenate([[True], (corners[1:] != corners[:-1]).any(axis=1)])
    apart[firsts] = True
    number = np.cumsum(apart)
    stops = number[ends - 1]
    starts = np.concatenate([[0], stops[:-1]])
    text, at = pair_texts(corners[apart])
    from_, to = at[starts].tolist(), at[stops - closed].tolist()
    for start, stop, ring, single in zip(from_, to, closed.tolist(), (stops - starts < 2).tolist(), strict=True):
        if not single:
            yield _PATH % (text[start : stop - 1] + b"Z" * ring)


PICTURE = {2: Cost(200, 160, fixed=1 << 25), 3: Cost(80, 260, fixed=3 << 26, kept=0)}
"""Memory that pictures take, by the number of axes of the field."""
_MATPLOTLIB: Any = {"extra": "plot", "libraries": ("matplotlib.figure",), "coordinates": "samples"}
OUTPUTS = (
    Output("contour", (".png",), "PNG", _drawn, (2, 3), (2, 3), "a colour or a panel each", cost=PICTURE,
           **_MATPLOTLIB),
    Output("contour", (".svg",), "SVG", _svg, (2,), (2,), "a group each", "samples",
           cost={2: Cost(170, 145, kept=50)}),
    Output("mask", (".png",), "PNG", _mask_png, (2,), coordinates="samples", extra="image", libraries=("PIL.Image",)),
    Output("picture", (".png", ".pdf", ".svg"), "PNG, PDF, SVG", _picture, (2, 3), (2, 3), "a colour or a panel each",
           sampled=False, **_MATPLOTLIB),
)
