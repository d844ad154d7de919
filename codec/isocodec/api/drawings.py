"""Contours of a decoded file, drawn one by one, so that the data of each can be released after it is drawn."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

from ..drawing.contour import Contour
from ..io.writers.output_formats import Cost
from ..stream.decoder import Decoder
from ..stream.recoder import clipped, ends_of
from .files import Viewed


class Counts(NamedTuple):
    """Counts of a contour, kept after the contour itself is released."""

    points: int
    cells: int
    isovalue: float
    complete: bool

    @classmethod
    def of(cls, contour: Contour) -> Counts:
        """Count a contour."""
        return cls(len(contour.points), len(contour.cells), float(contour.isovalue), contour.complete)


class Drawings(Collection[Contour]):
    """Contours of all isovalues that a decoder of a grid has decoded; can be iterated over once.

    Together, the decoder's state, one drawing and a writer's copy of it stay within the memory limit.

    Parameters
    ----------
    decoder : Decoder
    view : Viewed
    cost : Cost
        Memory that writing needs.

    Attributes
    ----------
    n : int
        Axes of the field.
    shape : tuple of int
    counts : list of Counts
        Counts of the contours drawn so far.
    """

    def __init__(self, decoder: Decoder, view: Viewed, cost: Cost) -> None:
        assert decoder.header is not None
        self.shape = decoder.header.shape
        self.n = len(self.shape)
        self.counts: list[Counts] = []
        self._decoder, self._view, self._cost = decoder, view, cost
        if view.window is not None:
            ends_of(view.window, self.n)

    def __len__(self) -> int:
        return len(self._decoder.isovalues)

    def __contains__(self, contour: object) -> bool:
        return False

    def __iter__(self) -> Iterator[Contour]:
        decoder, view, kept = self._decoder, self._view, 0
        for number in range(len(self)):
            contour = decoder.contour(number, smooth=view.smooth, through_holes=view.through_holes)
            decoder.discard(number)
            contour = clipped(contour, view.window)
            counts = Counts.of(contour)
            size = contour.points.nbytes + contour.cells.nbytes
            decoder.hold(kept + size + self._cost.peak(counts.points, counts.cells))
            self.counts.append(counts)
            yield contour
            del contour
            kept += self._cost.after(counts.points, counts.cells)
            decoder.hold(kept)
