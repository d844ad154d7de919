"""Cost of a file: what bits are spent on, and how often signs were predicted correctly (rows F-2bits, F-80)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..format.events import DomainRead, LayerComplete, MeshLayerComplete
from ..format.kinds import GEOMETRY
from ..limits import Limits
from .decoder import Decoder
from .inspect import inspect

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
        Entropy-coded bits, without the container.
    signs : int or None
        Number of coded signs; None if they are not counted: on meshes.
    predicted : int
        Number of those that were predicted, by parabolas or by neighbours: all but the first of a base's components.
    right : int
        Number of signs that were predicted correctly; of bases, that were the likelier ones in their contexts.
    """

    kind: str
    level: int
    isovalue: int
    bits: int
    signs: int | None
    predicted: int
    right: int


@dataclass(frozen=True)
class ContourStatistics:
    """All layers of one isovalue.

    Attributes
    ----------
    isovalue : float
    pixels : int or None
        Cells of the grid (pixels, voxels) that the contour crosses; None on a mesh that is coarser.
    simplices : int
        Number of simplices of the mesh that the contour crosses.
    vertices, faces : int
        Number of points of the drawing, and of its segments or triangles.
    connectivity_bits, geometry_bits : int
        Bits of signs and the mesh, and bits of values and offsets.
    signs : int or None
        Number of coded signs; None if they are not counted: on meshes.
    """

    isovalue: float
    pixels: int | None
    simplices: int
    vertices: int
    faces: int
    connectivity_bits: int
    geometry_bits: int
    signs: int | None

    @property
    def bits(self) -> int:
        """Bits of all layers."""
        return self.connectivity_bits + self.geometry_bits


@dataclass(frozen=True)
class FileStatistics:
    """Statistics of all layers and isovalues that were decoded."""

    layers: list[LayerStatistics]
    contours: list[ContourStatistics]

    def as_dict(self) -> dict[str, Any]:
        """Convert to plain data for JSON."""
        return asdict(self)


def statistics(
    data: bytes, limits: Limits | None = None, *, mesh: tuple[ArrayLike, ArrayLike] | None = None
) -> FileStatistics:
    """Decode a file of any kind, or the beginning of one, and count its bits.

    Parameters
    ----------
    data : bytes
    limits : Limits, optional
        Limits for decoding.
    mesh : (points, cells), optional
        The mesh that was encoded, for files that do not store it.

    Raises
    ------
    FormatError
        If the bytes are not a valid file; a truncated file is no error.
    LimitError
        If decoding takes more than the limits allow.
    """
    decoder = Decoder(limits, mesh=mesh)
    decoder.feed(data)
    layers: list[LayerStatistics] = []
    before = (0, 0)
    for event in decoder:
        number = decoder.present[1]
        if isinstance(event, LayerComplete):
            made, right = decoder.grid.predictions
            layers.append(LayerStatistics(
                str(event.layer.kind), event.layer.level, number, 8 * event.bytes,
                sum(event.symbols.get(name, 0) for name in SIGNS), made - before[0], right - before[1],
            ))
            before = made, right
        elif isinstance(event, MeshLayerComplete):
            layers.append(LayerStatistics(event.kind, -1, number, 8 * event.bytes, None, 0, 0))
        elif isinstance(event, DomainRead) and decoder.contents is not None and decoder.contents.kind == "surface":
            layers += [
                LayerStatistics(one.kind, one.level, 0, 8 * (one.bytes or 0), None, 0, 0)
                for one in inspect(data, symbols=True, limits=limits).layers
            ]
    contents = decoder.contents
    if contents is None or contents.kind not in ("grid", "mesh"):
        return FileStatistics(layers, [])
    contours = []
    for number in range(len(decoder.isovalues)):
        own = [layer for layer in layers if layer.isovalue == number]
        contours.append(_contour(decoder, number, own))
        decoder.discard(number)
    return FileStatistics(layers, contours)


def _contour(decoder: Decoder, number: int, layers: Sequence[LayerStatistics]) -> ContourStatistics:
    """Count the statistics of an isovalue."""
    assert decoder.header is not None
    contour = decoder.contour(number)
    vertices, faces = len(contour.points), len(contour.cells)
    del contour
    if decoder.header.cells is not None:
        position, simplices = np.zeros((0, 2)), decoder.on_mesh.mesh(number, whole=False).cells
    else:
        position, simplices = decoder.grid.crossed(number)
    pixels = None
    if len(position) and len(simplices) and int(np.ptp(position[simplices], axis=1).max()) == 1:
        # the least coordinates of a simplex of the full grid are the lower corner of its cell
        corners = position[simplices].min(axis=1)
        pixels = len(np.unique(np.ravel_multi_index(tuple(corners.T), decoder.header.shape)))
    signs = [layer.signs for layer in layers if layer.signs is not None]
    geometry = sum(layer.bits for layer in layers if layer.kind in (*GEOMETRY, "offsets", "values"))
    return ContourStatistics(
        decoder.isovalues[number], pixels, len(simplices), vertices, faces,
        sum(layer.bits for layer in layers) - geometry, geometry, sum(signs) if len(signs) == len(layers) else None,
    )
