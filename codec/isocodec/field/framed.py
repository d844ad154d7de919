"""A series of fields."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from .times import Time


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames of the same shape, in order, for a file that holds a series: time steps, slices, channels.

    Attributes
    ----------
    fields : iterable of Field or array_like
        Fields of the same shape and type; in an array, frames lie along the first axis. They are read one by one.
    interval : int or None
        Frames whose number is a multiple of this are key frames, not predicted from earlier frames, so that decoding
        can begin there; 0 if only the first is. None leaves this to the option of `encode`, by default 16.
    times : sequence of numbers, texts or dates, or None
        The time of each frame, as for `Encoder.add`; they need not be even.
    """

    fields: Iterable[Any]
    interval: int | None = None
    times: Sequence[Time] | None = None

    def __iter__(self) -> Iterator[Any]:
        return iter(self.fields)

    @property
    def repeatable(self) -> bool:
        """Whether the frames can be iterated over more than once."""
        return iter(self.fields) is not self.fields
