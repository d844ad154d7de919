"""A series of fields."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames of one shape in their order, for a file that holds a series: time steps, slices, channels.

    Attributes
    ----------
    fields : iterable of Field or array_like
        Fields of one shape and type; an array's first axis counts them. They are taken one by one.
    interval : int or None
        Frames whose number is a multiple of this lean on none before them, so that decoding can begin there; 0 if only
        the first does. None leaves it to the option of `encode`.
    """

    fields: Iterable[Any]
    interval: int | None = None

    def __iter__(self) -> Iterator[Any]:
        return iter(self.fields)

    @property
    def repeatable(self) -> bool:
        """Whether the frames can be taken more than once."""
        return iter(self.fields) is not self.fields
