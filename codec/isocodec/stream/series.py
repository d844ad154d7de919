"""Prediction of isovalues from one another, and of frames from the one before ("leans"; spec 3.5.5, 3.5.7)."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterable, Sequence

from ..deferred import dataclass
from ..format.frames import FRAME_BEFORE, is_key, key_of


@dataclass(frozen=True)
class LeanOn:
    """An isovalue that another one is predicted from (leans on).

    Attributes
    ----------
    number : int
        Number of the isovalue.
    before : bool
        Whether it belongs to the previous frame instead of the same frame.
    """

    number: int
    before: bool = False

    @property
    def coded(self) -> int:
        """Number as stored in chunks: the isovalue's in the same frame, or ``FRAME_BEFORE``."""
        return FRAME_BEFORE if self.before else self.number


class Series:
    """The isovalues and frames of a file in order, and what each of them is predicted from.

    A file with one frame is a series without an interval. An encoder chooses what an isovalue leans on (is predicted
    from) with `choose`, and a decoder reads it; both record it with `add`, isovalue by isovalue and frame by frame.

    Parameters
    ----------
    isovalues : iterable of float
        For an encoder, all isovalues of the file; for a decoder, those read so far. Further ones are added by
        ``isovalues.append``.
    interval : int or None
        Frames whose number is a multiple of this are key frames; 0 if only the first is, None without a series.

    Attributes
    ----------
    isovalues : list of float
    interval : int or None
    """

    def __init__(self, isovalues: Iterable[float] = (), interval: int | None = None) -> None:
        self.isovalues = list(isovalues)
        self.interval = interval
        self._leans: list[list[LeanOn | None]] = [[]]
        self._nearest: list[int] = []

    @property
    def frame(self) -> int:
        """Number of the current frame, whose isovalues are being added."""
        return len(self._leans) - 1

    @property
    def number(self) -> int:
        """Number of the isovalue of the current frame that was added last; -1 before the first one."""
        return len(self._leans[-1]) - 1

    @property
    def frames(self) -> int:
        """Number of frames begun."""
        return len(self._leans) if self._leans[-1] else self.frame

    def next_frame(self) -> None:
        """Begin a new frame; isovalues that are added from now on belong to it."""
        self._leans.append([])

    def forget_frame(self) -> None:
        """Remove the current frame, which could not be encoded."""
        self._leans.pop()
        self._leans = self._leans or [[]]

    def add(self, lean: LeanOn | None) -> None:
        """Record what the next isovalue of the current frame is predicted from."""
        self._leans[-1].append(lean)

    def lean(self, number: int, frame: int = 0) -> LeanOn | None:
        """Find what an isovalue of a frame is predicted from."""
        return self._leans[frame][number]

    def is_key(self, frame: int) -> bool:
        """Whether a frame is a key frame."""
        return self.interval is None or is_key(frame, self.interval)

    def key_of(self, frame: int) -> int:
        """The last key frame up to this one, where decoding has to begin."""
        return frame if self.interval is None else key_of(frame, self.interval)

    def read(self, coded: int | None, number: int) -> LeanOn | None:
        """Decode what isovalue ``number`` is predicted from; the inverse of `LeanOn.coded`."""
        return None if coded is None else LeanOn(number, True) if coded == FRAME_BEFORE else LeanOn(coded)

    def choose(self, number: int, independent: bool) -> LeanOn | None:
        """Choose what an encoder should predict an isovalue of the current frame from, if that helps.

        That is the same isovalue of the previous frame; in key frames, and so in a file of one frame, the nearest
        earlier isovalue.
        """
        if independent:
            return None
        if not self.is_key(self.frame):
            return LeanOn(number, True)
        if not self._nearest:
            self._nearest = nearest_before(self.isovalues)
        return LeanOn(self._nearest[number]) if number else None

    def chain(self, number: int, frame: int = 0) -> frozenset[int]:
        """Numbers of the isovalues, in any frame, that are needed to decode this one of a frame, itself included."""
        found: set[int] = set()
        at: LeanOn | None = LeanOn(number)
        while at is not None:
            frame -= at.before
            found.add(at.number)
            at = self.lean(at.number, frame)
        return frozenset(found)


def nearest_before(isovalues: Sequence[float]) -> list[int]:
    """For each isovalue, the number of the earlier one in the file that lies nearest to it; -1 for the first."""
    found: list[int] = []
    sorted_before: list[tuple[float, int]] = []
    for number, value in enumerate(isovalues):
        place = bisect(sorted_before, (value, number))
        beside = sorted_before[max(place - 1, 0) : place + 1]
        found.append(min(beside, key=lambda one: (abs(one[0] - value), one[1]))[1] if beside else -1)
        sorted_before.insert(place, (value, number))
    return found
