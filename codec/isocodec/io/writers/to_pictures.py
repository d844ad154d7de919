"""Pictures: curves and surfaces by matplotlib, masks by Pillow."""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import Any

import numpy as np

from ...drawing.contour import Contour
from ...extras import optional
from .output_formats import Cost, Output, OutputOptions
from .things import Picture, SampleMask


def _drawn(contours: Iterable[Contour], suffix: str, _: OutputOptions) -> bytes:
    from ...plotting.panels import contour_picture

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


PICTURE = {2: Cost(200, 160, fixed=1 << 25), 3: Cost(80, 260, fixed=3 << 26, kept=0)}
"""Memory that pictures take, by the number of axes of the field."""
_MATPLOTLIB: Any = {"extra": "plot", "libraries": ("matplotlib.figure",), "coordinates": "samples"}
OUTPUTS = (
    Output("contour", (".png",), "PNG", _drawn, (2, 3), (2, 3), "a colour or a panel each", cost=PICTURE,
           **_MATPLOTLIB),
    Output("contour", (".svg",), "SVG", _drawn, (2,), (2,), "a group each", cost=PICTURE, **_MATPLOTLIB),
    Output("mask", (".png",), "PNG", _mask_png, (2,), coordinates="samples", extra="image", libraries=("PIL.Image",)),
    Output("picture", (".png", ".pdf", ".svg"), "PNG, PDF, SVG", _picture, (2, 3), (2, 3), "a colour or a panel each",
           sampled=False, **_MATPLOTLIB),
)
