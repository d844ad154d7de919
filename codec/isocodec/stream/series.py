"""Leaning of isovalues on one another within a frame, and of frames on the one before (spec clauses 3.5.5, 3.5.7)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..format.frames import FRAME_BEFORE, is_key, key_of


@dataclass(frozen=True)
class LeanOn:
    """An isovalue that another one leans on.

    Attributes
    ----------
    number : int
        Of an isovalue.
    before : bool
        Whether it is that of the frame before instead of one of the same frame.
    """

    number: int
    before: bool = False

    @property
    def coded(self) -> int:
        """Number as in chunks: that in the same frame, or ``FRAME_BEFORE``."""
        return FRAME_BEFORE if self.before else self.number


class Series:
    """The isovalues and frames of a file in their order, and what each of them leans on.

    A file of one frame is a series without an interval. An encoder chooses leans with `choose`, a decoder reads them;
    both record them with `add`, one isovalue after the other, frame by frame.

    Parameters
    ----------
    isovalues : iterable of float
        All of a file for an encoder; for a decoder those that have come. They are added to by ``isovalues.append``.
    interval : int or None
        Every so many frames one leans on none before it, 0 if only the first does not; None of a single frame.

    Attributes
    ----------
    isovalues : list of float
    interval : int or None
    """

    def __init__(self, isovalues: Iterable[float] = (), interval: int | None = None) -> None:
        self.isovalues = list(isovalues)
        self.interval = interval
        self._leans: list[list[LeanOn | None]] = [[]]

    @property
    def frame(self) -> int:
        """Number of the present frame, whose isovalues are being added."""
        return len(self._leans) - 1

    @property
    def number(self) -> int:
        """Number of the isovalue of the present frame that was added last, -1 before the first one."""
        return len(self._leans[-1]) - 1

    @property
    def frames(self) -> int:
        """How many frames have begun."""
        return len(self._leans) if self._leans[-1] else self.frame

    def next_frame(self) -> None:
        """Begin another frame: isovalues that are added from now on belong to it."""
        self._leans.append([])

    def forget_frame(self) -> None:
        """Take back the present frame: it could not be encoded."""
        self._leans.pop()
        self._leans = self._leans or [[]]

    def add(self, lean: LeanOn | None) -> None:
        """Record what the next isovalue of the present frame leans on."""
        self._leans[-1].append(lean)

    def lean(self, number: int, frame: int = 0) -> LeanOn | None:
        """Find what an isovalue of a frame leans on."""
        return self._leans[frame][number]

    def is_key(self, frame: int) -> bool:
        """Whether a frame leans on none before it."""
        return self.interval is None or is_key(frame, self.interval)

    def key_of(self, frame: int) -> int:
        """The last frame up to this one that leans on none before it: decoding of this one begins there."""
        return frame if self.interval is None else key_of(frame, self.interval)

    def read(self, coded: int | None, number: int) -> LeanOn | None:
        """The lean of isovalue ``number`` from what a chunk holds: the inverse of `LeanOn.coded`."""
        return None if coded is None else LeanOn(number, True) if coded == FRAME_BEFORE else LeanOn(coded)

    def choose(self, number: int, independent: bool) -> LeanOn | None:
        """Choose for an encoder what an isovalue of the present frame leans on, unless that turns out to be no help.

        The same isovalue of the frame before; in frames that lean on none before them, and so in a file of one frame,
        the nearest isovalue before it.
        """
        if independent:
            return None
        if not self.is_key(self.frame):
            return LeanOn(number, True)
        return LeanOn(nearest_before(self.isovalues, number)) if number else None

    def chain(self, number: int, frame: int = 0) -> frozenset[int]:
        """Numbers of the isovalues that decoding this one of a frame takes, itself included, in whatever frame."""
        found: set[int] = set()
        at: LeanOn | None = LeanOn(number)
        while at is not None:
            frame -= at.before
            found.add(at.number)
            at = self.lean(at.number, frame)
        return frozenset(found)


def nearest_before(isovalues: Sequence[float], number: int) -> int:
    """Number of the isovalue before this one in the file that lies nearest to it."""
    return min(range(number), key=lambda i: abs(isovalues[i] - isovalues[number]))
