"""What ``decode`` and ``mask`` take of a file: one isovalue or all of them, the whole or what was received."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import FormatError, TruncatedError
from .progress import progress_bar
from .report import PARTIAL, concerning, warn

if TYPE_CHECKING:
    from ..drawing.contour import Contour
    from ..io.writers.output_formats import Cost
    from ..limits import Limits
    from ..stream.decoder import Decoder

Taken = TypeVar("Taken")


def receive(
    source: Path, data: bytes, isovalue: float | None, partial: bool, limits: Limits, layers: int | None = None,
    max_bytes: int | None = None, frame: int | None = None,
) -> tuple[Decoder, int]:
    """A decoder that has taken what was asked for, and the number of the isovalue; a warning if it is a part."""
    from ..api.whole import decoded

    def take(most: int | None, progress: Any) -> tuple[Decoder, int]:
        return decoded(data, isovalue, layers, most, limits, progress, frame)

    return _taken(take, source, data, partial, max_bytes)


def receive_all(
    source: Path, data: bytes, partial: bool, limits: Limits, max_bytes: int | None, frame: int | None = None
) -> Decoder:
    """Likewise a decoder that has taken all isovalues."""
    from ..api.whole import received

    def take(most: int | None, progress: Any) -> Decoder:
        return received(data, None, most, limits, progress, frame=frame)

    return _taken(take, source, data, partial, max_bytes)


def _taken(
    take: Callable[[int | None, Any], Taken], source: Path, data: bytes, partial: bool, max_bytes: int | None
) -> Taken:
    with concerning(source), progress_bar("decoding") as progress:
        try:
            return take(max_bytes, progress)
        except TruncatedError as exc:
            if max_bytes is not None:
                raise
            if not partial:
                exc.remedy = PARTIAL
                raise
            taken = take(len(data) or 1, progress)
            warn(source, f"{exc.message}; decoded as far as it goes")
            return taken


class Drawings:
    """Contours of a decoder, each drawn when it is its turn, so that what it was drawn from can go.

    They are gone through once. What decoding holds, drawings and what is made of them are within the limit of memory
    together.

    Attributes
    ----------
    points, cells : int
        Of the contours so far.
    complete : bool
        Whether all of them are.
    shape : tuple of int
    n : int
    """

    def __init__(
        self, decoder: Decoder, numbers: Sequence[int], smooth: bool, cost: Cost, through_holes: bool = False
    ) -> None:
        self.points = self.cells = 0
        self.complete = True
        assert decoder.header is not None
        self.shape = decoder.header.shape
        self.n = len(self.shape)
        self._decoder = decoder
        self._numbers = numbers
        self._smooth = smooth
        self._through_holes = through_holes
        self._cost = cost

    def __len__(self) -> int:
        return len(self._numbers)

    def __contains__(self, contour: object) -> bool:
        return False

    def __iter__(self) -> Iterator[Contour]:
        kept = 0
        for number in self._numbers:
            contour = self._decoder.drawn(number, self._smooth, self._through_holes)
            self._decoder.discard(number)
            points, cells = contour.points, contour.cells
            size = points.nbytes + cells.nbytes
            self._decoder.hold(kept + size + self._cost.peak(len(points), len(cells)))
            self.points += len(points)
            self.cells += len(cells)
            self.complete &= contour.complete
            yield contour
            kept += self._cost.after(len(points), len(cells))
            del contour, points, cells
            self._decoder.hold(kept)


_LISTED = 5
"""Isovalues that a warning lists."""


def warn_of_others(source: Path, isovalue: float, isovalues: Sequence[float], verb: str = "written") -> None:
    """Say that a file holds further isovalues, where none was asked for."""
    others = [repr(v) for v in isovalues if v != isovalue]
    if others:
        listed = " or ".join(others[:_LISTED]) + ", .." * (len(others) > _LISTED)
        warn(source, f"only isovalue {isovalue!r} is {verb}; choose another with --isovalue: {listed}")


def warn_of_frames(source: Path, data: bytes, frame: int | None, verb: str = "written") -> None:
    """Say that a file is a series of which the first frame was taken, where none was asked for."""
    import isocodec

    if frame is not None:
        return
    # what lies behind the first frame may be damaged
    with suppress(FormatError):
        count = len(isocodec.inspect(data).frames)
        if count > 1:
            warn(
                source,
                f"only frame 0 of {count} is {verb}; choose another with --frame, from 1 to {count - 1}, or take all "
                "with isocodec.decode_frames",
            )
