"""Encoder of triangulated surfaces (spec clause 10.9)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from isospec.container import Profile

from ..errors import OptionError
from ..format.surface import TinHead
from ..search.nested_points import in_layers
from ..search.tin_fit import ChosenPoints, evenly
from ..tin.coded_tin import SurfaceLayers
from ..tin.points import Points, points_of
from ..tin.tin import Tin
from .container import ContainerEncoder
from .options import BEST, Options
from .surface_contents import surface_chunks


class SurfaceEncoder(ContainerEncoder):
    """Encodes a triangulated surface; iterating, which is possible once, yields the bytes of the file.

    Parameters
    ----------
    tin : Tin
        The surface. If `thin` chose it for a file, or it was read from a file, its positions, values and layers are
        kept. For any other surface, values are rounded by the precision, and the triangles become those of a Delaunay
        triangulation.
    options : Options

    Raises
    ------
    OptionError
        If options do not apply to surfaces.
    """

    def __init__(self, tin: Tin, options: Options) -> None:
        precision = options.precision
        options.check_unused("surfaces", {
            "keep_topology": options.keep_topology, "layers": not options.layers.default,
            f"profile {options.profile!r}": options.entropy != Profile.MAIN, "order": options.order is not None,
            f"precision {precision.text!r}": precision.signs or precision.steps is not None or bool(precision.world)
            or precision.smooth,
            "effort": options.effort == BEST,
        })
        if tin.coded is not None and not options.precision.default:
            raise OptionError("the values of the surface are already rounded to a step",
                              code="precision", remedy="leave it out")
        self._metadata = {**tin.metadata, **options.metadata}
        self._head, self._layers = tin.coded if tin.coded is not None else _coded(tin, options)

    def _chunks(self) -> Iterator[bytes]:
        yield from surface_chunks(self._head, self._layers, self._metadata)


def surface_of(
    given: Points, chosen: ChosenPoints, shape: tuple[int, int] | None, layers: int = 1
) -> tuple[TinHead, SurfaceLayers]:
    """Convert chosen points to what a file holds."""
    extent = (int(given.x.max()) + 1, int(given.y.max()) + 1) if shape is None else shape
    parts = in_layers(given, chosen, extent, layers)
    exponent = math.frexp(given.unit)[1] - 1
    first, second = (int(each / given.unit) for each in given.origin)
    counts = np.diff([0, *parts.ends]).tolist()
    head = TinHead(
        extent, shape is not None, exponent, (first, second), chosen.offset, chosen.step, chosen.palette,
        chosen.largest, tuple(counts),
    )
    return head, parts


def _coded(tin: Tin, options: Options) -> tuple[TinHead, SurfaceLayers]:
    """Round the values of a surface that was not made for a file."""
    precision = options.precision
    points = tin.points if tin.shape is None else tin.points.astype(np.int64)
    given = points_of(points, tin.values)
    if tin.shape is not None:
        low = given.origin.astype(np.int64)
        given = replace(given, x=given.x + low[0], y=given.y + low[1], origin=np.zeros(2))
    step = precision.step
    if precision.tolerance is not None:
        step = 2 * precision.tolerance
    return surface_of(given, evenly(given, step, precision.exact), tin.shape)
