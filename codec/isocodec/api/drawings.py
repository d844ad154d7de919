"""Contours that are drawn one by one, so that the data of each can be released after it is drawn."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ..drawing.contour import Contour
from ..drawing.simplifying import simplified
from ..field.labelling import noun_of
from ..io import cost

if TYPE_CHECKING:
    from ..stream.decoder import Decoder
    from ..verbs import Progress, Viewed


class Counts(NamedTuple):
    """Counts of a contour, kept after the contour itself is released."""

    points: int
    cells: int
    isovalue: float
    complete: bool
    noun: str

    @classmethod
    def of(cls, contour: Contour) -> Counts:
        """Count a contour."""
        return cls(len(contour.points), len(contour.cells), float(contour.isovalue), contour.complete,
                   noun_of(contour.metadata))


class OneByOne(Collection[Contour]):
    """Contours of a field of ``n`` axes, each drawn when it is needed; can be iterated over once.

    ``shape`` is empty on a mesh. ``progress`` is called with the number of contours drawn and the total, which counts
    one more for what a writer does with them. `counts` has the counts of the contours drawn so far.
    """

    def __init__(
        self, isovalues: Sequence[float], shape: tuple[int, ...], n: int, progress: Progress | None
    ) -> None:
        self.isovalues, self.shape, self.n = tuple(isovalues), shape, n
        self.counts: list[Counts] = []
        self.progress = progress

    @abstractmethod
    def draw(self, number: int) -> Contour:
        """Draw the contour of an isovalue, by its number."""

    def __len__(self) -> int:
        return len(self.isovalues)

    def __contains__(self, contour: object) -> bool:
        return False

    def __iter__(self) -> Iterator[Contour]:
        for number in range(len(self)):
            contour = self.draw(number)
            self.counts.append(Counts.of(contour))
            yield contour
            del contour
            self.drawn(self.counts[-1])
            if self.progress is not None:
                # writing takes time, too, when all are drawn
                self.progress(number + 1, len(self) + 1)

    def drawn(self, counts: Counts) -> None:
        """Take notice that a contour has been used."""


class Fewer(OneByOne):
    """Isocontours simplified together (see `simplified`).

    `facts` has counts before and after and the largest distance, for programs, and `text` the same for people.
    """

    def __init__(
        self, contours: Collection[Contour], distance: str, progress: Progress | None = None
    ) -> None:
        if isinstance(contours, OneByOne):
            contours.progress = progress
        given = [*contours]
        super().__init__([one.isovalue for one in given], given[0].shape, given[0].n, None)
        made = simplified(given, distance)
        self._made = made.contours
        self.facts = {"simplified": {"before": made.before, "after": made.after, "farthest": made.farthest}}
        self.text = f", simplified from {made.before:,} to within {made.farthest:.3g}{made.unit or ' cells'}"

    def draw(self, number: int) -> Contour:
        """Return the contour of an isovalue, by its number."""
        return self._made[number]


class Drawings(OneByOne):
    """Contours of isovalues, by default all, that a decoder of a grid has decoded.

    The decoder's state, one drawing and a writer's copy of it stay within the memory limit together.
    """

    def __init__(self, decoder: Decoder, view: Viewed, isovalues: Collection[float] = ()) -> None:
        assert decoder.header is not None
        shape = decoder.header.shape
        self._numbers = [i for i, one in enumerate(decoder.isovalues) if not isovalues or one in isovalues]
        super().__init__([decoder.isovalues[i] for i in self._numbers], shape, len(shape), None)
        self._decoder, self._view = decoder, view
        self._kept = 0
        if view.window is not None:
            from ..drawing.window import ends_of

            ends_of(view.window, self.n)

    def draw(self, number: int) -> Contour:
        """Draw the contour of an isovalue, by its number, and release what was decoded of it."""
        from ..drawing.window import clipped

        decoder, view, number = self._decoder, self._view, self._numbers[number]
        contour = decoder.contour(number, smooth=view.smooth, through_holes=view.through_holes)
        decoder.discard(number)
        contour = clipped(contour, view.window)
        size = contour.points.nbytes + contour.cells.nbytes
        decoder.hold(self._kept + size + cost.peak(len(contour.points), len(contour.cells)))
        return contour

    def drawn(self, counts: Counts) -> None:
        """Count what a writer keeps of a contour."""
        self._kept += cost.kept(counts.points)
        self._decoder.hold(self._kept)
