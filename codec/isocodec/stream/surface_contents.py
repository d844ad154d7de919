"""Chunks of a triangulated surface: points as they arrive, and the surface over them (spec 10.9)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from isospec.container import ChunkType, Profile

from ..drawing.contour import Contour
from ..drawing.explicit import surface_contour
from ..entropy.run import Account
from ..errors import FormatError, OptionError, TruncatedError
from ..field.placement import own_placement, read_placement
from ..format.chunks import Envelope, write_chunk
from ..format.events import DomainRead, Event
from ..format.header import Header
from ..format.surface import TinHead, read_tin, values_of, write_tin
from ..tin.coded_tin import SurfaceLayers, decoded, encoded
from ..tin.delaunay import delaunay, triangles
from ..tin.rank import by_rank
from ..tin.tin import Tin
from .container import beginning
from .session import Session

PER_POINT = 400
"""Most memory, in bytes, that decoding takes for each point."""


class SurfaceContents:
    """Decodes the chunk of a surface, or the beginning of one.

    Parameters
    ----------
    session : Session

    Attributes
    ----------
    outline : Outline
    head : TinHead or None
        What the file states about its points, once that has been read.
    """

    kind = "surface"

    def __init__(self, session: Session) -> None:
        self.outline = session.outline
        self._session = session
        self._chunk: Envelope | None = None
        self._parts: SurfaceLayers | None = None
        self._counted = 0
        self.head: TinHead | None = None

    def arrive(self, chunk: Envelope, at: int) -> tuple[Event | None, bool]:
        """See `Contents.arrive`: points are decoded only when they are asked for."""
        if self._chunk not in (None, chunk):
            raise FormatError("not allowed in a file of a surface", code="chunk", offset=at, clause="10.9.1")
        self._chunk = chunk
        return None, True

    def take(self, chunk: Envelope, at: int, behind: int) -> Event:
        """See `Contents.take`."""
        payload = bytes(self._session.data[chunk.start : chunk.end])
        if chunk.type != ChunkType.DOMAIN:
            return self.outline.read(chunk, payload, behind)
        self.head, self._parts = self._decoded(payload, chunk.start, whole=True)
        return DomainRead(behind, len(self._parts.points), 0)

    def drop(self) -> None:
        """See `Contents.drop`."""
        self._parts = None

    def received(self) -> tuple[TinHead, SurfaceLayers]:
        """Head of the surface, and those points that have arrived, with their numbers.

        Raises
        ------
        TruncatedError
            Before three points have arrived.
        FormatError
            If they are malformed.
        LimitError
            If they take more than the limits allow.
        """
        if (error := self._session.exceeded) is not None:
            raise error
        if self._parts is not None and self.head is not None:
            return self.head, self._parts
        if self._chunk is None or len(self._session.data) <= self._chunk.start < self._chunk.end:
            raise _early(len(self._session.data))
        chunk = self._chunk
        return self._decoded(bytes(self._session.data[chunk.start : chunk.end]), chunk.start, whole=False)

    def tin(self, layers: int | None = None) -> Tin:
        """The surface over the points of the first layers that have arrived; errors as for `received`.

        It is complete if these are all layers of a complete file.
        """
        head, parts = self.received()
        parts = parts.first(layers)
        order = by_rank(parts.points[:, 0], parts.points[:, 1])
        x, y = np.ascontiguousarray(parts.points[order].T)
        tri, _ = delaunay(x, y)
        positions = np.stack([x, y], axis=1).astype(np.float64)
        if not head.grid:
            with np.errstate(over="ignore"):
                positions = np.ldexp(positions + np.array(head.origin, np.float64), head.exponent)
        values = np.array(values_of(head, parts.numbers[order].tolist()))
        complete = self._session.complete and parts.complete
        return Tin(
            positions, values, triangles(tri).astype(np.int64), head.extent if head.grid else None, complete,
            dict(self.outline.metadata),
        )

    def contour(
        self, number: int = 0, *, isovalue: float | None = None, smooth: bool | None = None,
        through_holes: bool = False, before: bool = False,
    ) -> Contour:
        """Draw an isocontour of the surface, which is linear on its triangles; errors as for `received`.

        Raises
        ------
        OptionError
            Without a finite isovalue.
        """
        if smooth:
            raise OptionError("smooth applies to grids only", code="smooth", remedy="leave it out")
        return contour_of_tin(self.tin(), isovalue)

    def _decoded(self, payload: bytes, start: int, whole: bool) -> tuple[TinHead, SurfaceLayers]:
        """Decode a payload, or its beginning; an invalid head is refused only with verified checksums (``whole``)."""
        if not payload:
            raise FormatError("the domain chunk is empty", code="domain", offset=start, clause="3.5.8")
        try:
            head, at = read_tin(payload, start)
        except FormatError:
            if whole:
                raise
            raise _early(len(self._session.data)) from None
        limits = self._session.limits
        most = min(limits.vertices, limits.memory // PER_POINT)
        account = Account(limits.symbols, limits.work)
        arrived = self._chunk is not None and self._chunk.end <= len(self._session.data)
        parts = decoded(payload[at:], head.counts, head.extent, head.largest, most, account, start + at, arrived)
        if len(parts.points) < 3:
            raise _early(len(self._session.data))
        return head, parts


def surface_chunks(head: TinHead, parts: SurfaceLayers, metadata: Mapping[str, str]) -> list[bytes]:
    """Write the header and the chunks of a file of a surface."""
    payload = write_tin(head) + encoded(parts, head.extent, head.largest)
    header = Header((), 0.0, None, Profile.MAIN, cells=2)
    return beginning(header, metadata, [write_chunk(ChunkType.DOMAIN, payload)])


def contour_of_tin(tin: Tin, isovalue: float | None) -> Contour:
    """Draw an isocontour of a triangulated surface, which is linear on each triangle.

    Returns
    -------
    Contour
        Contour with points in the coordinates of the surface; for a surface of a field, in samples, with the placement
        in the notes.

    Raises
    ------
    OptionError
        Without a finite isovalue.
    """
    if isovalue is None:
        raise OptionError("a contour of a surface needs an isovalue", code="isovalue",
                          remedy="IsoFile.surface returns the whole surface")
    if not math.isfinite(isovalue):
        raise OptionError(f"the isovalue is {isovalue}; it must be finite", code="isovalue")
    points, pieces = surface_contour(tin.points, tin.values, tin.triangles, isovalue)
    notes = dict(tin.metadata)
    placement = own_placement(notes, 2) if tin.shape is None else read_placement(notes, 2)
    return Contour(points, pieces, float(isovalue), tin.shape or (), tin.complete, placement, metadata=notes)


def _early(received: int) -> TruncatedError:
    return TruncatedError(
        "the file ends before its surface begins", code="truncated", offset=received, clause="8.3"
    )
