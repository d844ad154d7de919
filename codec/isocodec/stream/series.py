"""The isovalues and frames of a file as an encoder goes through them; key frames (spec 3.5.5, 3.5.7)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property

from ..format.frames import is_key
from .container import opening
from .leaning import lean_of, nearest_before


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
    time : str or None
        Time of the next frame, or of the current one once it has begun.
    """

    def __init__(
        self, isovalues: Iterable[float], interval: int | None = None, independent: bool = False
    ) -> None:
        self.isovalues = list(isovalues)
        self.interval, self._independent = interval, independent
        self.frame = -1
        self.leans: list[int | None] = []
        self.time: str | None = None

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
        """Choose what an isovalue of the current frame is predicted from; None if nothing."""
        return None if self._independent else lean_of(number, self._nearest, self.key)

    def opening(self, number: int) -> list[bytes]:
        """Write the chunk with which an isovalue of the current frame begins, if there is any."""
        return opening(self.frame, number, self.isovalues[number], self.leans[number], self.interval, self.time)
