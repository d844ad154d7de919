"""Prediction of isovalues from one another, and of frames from the one before ("leans"; spec 3.5.5, 3.5.7)."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property

from ..format.frames import FRAME_BEFORE, is_key
from .container import opening


class Series:
    """The isovalues and frames of a file as an encoder goes through them, and what each is predicted from.

    A file with one frame is a series without an interval.

    Parameters
    ----------
    isovalues : iterable of float
    interval : int or None
        Frames whose number is a multiple of this are key frames; 0 if only the first is, None without a series.
    independent : bool
        Whether no isovalue and no frame is predicted from earlier ones.

    Attributes
    ----------
    frame : int
        Number of the current frame; -1 before the first one.
    leans : list of int or None
        For each isovalue of the current frame that has begun, what it is predicted from: the number of an earlier one,
        or ``FRAME_BEFORE``.
    """

    def __init__(
        self, isovalues: Iterable[float], interval: int | None = None, independent: bool = False
    ) -> None:
        self.isovalues = list(isovalues)
        self.interval, self._independent = interval, independent
        self.frame = -1
        self.leans: list[int | None] = []

    @contextmanager
    def next_frame(self) -> Iterator[None]:
        """Begin a new frame; it is forgotten if it cannot be encoded."""
        self.frame += 1
        try:
            yield
        except BaseException:
            self.frame -= 1
            raise

    @property
    def key(self) -> bool:
        """Whether the current frame is a key frame."""
        return self.interval is None or is_key(self.frame, self.interval)

    @cached_property
    def _nearest(self) -> list[int]:
        return nearest_before(self.isovalues)

    def choose(self, number: int) -> int | None:
        """Choose what an isovalue of the current frame should be predicted from, if that helps.

        That is the same isovalue of the previous frame; in key frames, and so in a file of one frame, the nearest
        earlier isovalue.
        """
        if self._independent:
            return None
        if not self.key:
            return FRAME_BEFORE
        return self._nearest[number] if number else None

    def opening(self, number: int) -> list[bytes]:
        """Write the chunk with which an isovalue of the current frame begins, if there is any."""
        return opening(self.frame, number, self.isovalues[number], self.leans[number], self.interval)


def chain(leans: Sequence[int | None], number: int) -> Iterator[int]:
    """Yield the isovalues of a frame that one is predicted from, directly and indirectly, the nearest first."""
    lean = leans[number]
    while lean is not None and lean != FRAME_BEFORE:
        yield lean
        lean = leans[lean]


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
