"""What a file costs: bits by what they are spent on, and how often signs were as predicted (rows F-2bits, F-80)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..format.events import LayerComplete
from ..format.kinds import GEOMETRY
from ..limits import Limits
from .decoder import Decoder

SIGNS = ("base_sign", "refinement_sign")


@dataclass(frozen=True)
class LayerStatistics:
    """One layer.

    Attributes
    ----------
    kind : str
    level : int
        Level up to which the mesh is uniform afterwards.
    isovalue : int
        Number of the isovalue that it belongs to.
    bits : int
        Entropy-coded, without the container.
    signs : int
        Signs that were sent, each of them predicted, by the parabola or by the majority around.
    right : int
        How many of them were as predicted.
    """

    kind: str
    level: int
    isovalue: int
    bits: int
    signs: int
    right: int


@dataclass(frozen=True)
class ContourStatistics:
    """The layers of one isovalue together.

    Attributes
    ----------
    isovalue : float
    pixels : int or None
        Cells of the grid (pixels, voxels) that the contour crosses; None on a mesh that is coarser.
    simplices : int
        Simplices of the mesh that it crosses.
    vertices, faces : int
        Points of the drawing, and its segments or triangles.
    connectivity_bits, geometry_bits : int
        Of signs and the mesh, and of values and offsets.
    signs : int
    """

    isovalue: float
    pixels: int | None
    simplices: int
    vertices: int
    faces: int
    connectivity_bits: int
    geometry_bits: int
    signs: int

    @property
    def bits(self) -> int:
        """Of all layers."""
        return self.connectivity_bits + self.geometry_bits


@dataclass(frozen=True)
class FileStatistics:
    """Of all layers and isovalues that were decoded."""

    layers: list[LayerStatistics]
    contours: list[ContourStatistics]

    def as_dict(self) -> dict[str, Any]:
        """Plain data, for JSON."""
        return asdict(self)


def statistics(data: bytes, limits: Limits | None = None) -> FileStatistics:
    """Decode a file, or the beginning of one, and count.

    Parameters
    ----------
    data : bytes
    limits : Limits, optional
        What decoding may take at most.

    Raises
    ------
    FormatError
        If the bytes are no valid file; not if they end too early.
    LimitError
        If decoding takes more than the limits allow.
    """
    decoder = Decoder(limits)
    decoder.feed(data)
    layers: list[LayerStatistics] = []
    before = 0
    for event in decoder:
        if isinstance(event, LayerComplete):
            _, right = decoder.predictions
            layers.append(
                LayerStatistics(
                    str(event.layer.kind), event.layer.level, decoder.present[1], 8 * event.bytes,
                    sum(event.symbols.get(name, 0) for name in SIGNS), right - before,
                )
            )
            before = right
    contours = []
    for number in range(len(decoder.isovalues)):
        contours.append(_contour(decoder, number, [layer for layer in layers if layer.isovalue == number]))
        decoder.discard(number)
    return FileStatistics(layers, contours)


def _contour(decoder: Decoder, number: int, layers: Sequence[LayerStatistics]) -> ContourStatistics:
    """What an isovalue has come to."""
    assert decoder.header is not None
    contour = decoder.drawn(number)
    vertices, faces = len(contour.points), len(contour.cells)
    del contour
    position, simplices = decoder.mesh(number)
    pixels = None
    if len(simplices) and int(np.ptp(position[simplices], axis=1).max()) == 1:
        # simplices of the full grid have the lower corner of their cell as their least coordinates
        corners = position[simplices].min(axis=1)
        pixels = len(np.unique(np.ravel_multi_index(tuple(corners.T), decoder.header.shape)))
    geometry = sum(layer.bits for layer in layers if layer.kind in GEOMETRY)
    return ContourStatistics(
        decoder.isovalues[number], pixels, len(simplices), vertices, faces,
        sum(layer.bits for layer in layers) - geometry, geometry, sum(layer.signs for layer in layers),
    )
