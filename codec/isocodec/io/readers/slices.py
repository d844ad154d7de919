"""The frames of a series in a file: slices of an array or a volume, pages, or the volumes of a file of four axes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import field, replace
from typing import Any

from numpy.typing import NDArray

from ...deferred import dataclass
from ...field.cropping import Box, part_of, spans_within
from ...field.placement import Placement
from ...field.sampled import Field


@dataclass(frozen=True)
class Slices:
    """Samples of frames, each read or cut out when it is asked for.

    Attributes
    ----------
    shape : tuple of int
        Of the array that the file holds.
    axis : int
        Which of its axes counts the frames, from 0.
    frame : callable
        Gives the one of a number, (s0, s1) or (s0, s1, s2) array.
    frame_shape : tuple of int
        Samples along each axis of a frame.
    place : Placement
        Where the samples of each of them lie.
    step : str
        Time from one to the next with its unit, if the file states it; else empty.
    """

    shape: tuple[int, ...]
    axis: int
    frame: Callable[[int], NDArray[Any]]
    frame_shape: tuple[int, ...]
    place: Placement = field(default_factory=Placement)
    step: str = ""

    def __len__(self) -> int:
        return self.shape[self.axis]

    def within(self, box: Box) -> Slices:
        """Take the part of each frame within a box of coordinates.

        Raises
        ------
        OptionError
            As `isocodec.field.cropping.spans_within`.
        """
        spans = spans_within(self.place, self.frame_shape, box)
        return replace(
            self, frame=lambda number: self.frame(number)[spans], place=part_of(self.place, spans, self.frame_shape),
            frame_shape=tuple(span.stop - span.start for span in spans),
        )


class FieldsInTurn:
    """The fields of a series, each read when it is asked for; files stay open until this is closed or forgotten.

    Attributes
    ----------
    shape : tuple of int
        Samples along each axis of each field.
    whole : tuple of int
        Shape of the array that the input holds, with the axis that counts the frames.
    remarks : tuple of str
        What the input states and the fields leave out, and why.
    """

    def __init__(
        self, slices: Slices, make: Callable[[int], Field], missing: str, held: ExitStack, remarks: Sequence[str] = ()
    ) -> None:
        self.shape, self.whole = slices.frame_shape, slices.shape
        self.remarks: tuple[str, ...] = (*remarks, *((slices.place.remark,) if slices.place.remark else ()))
        self._count, self._make, self._missing, self._held = len(slices), make, missing, held

    def close(self) -> None:
        """Close the files that are open for this series."""
        self._held.close()

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Field]:
        return map(self.__getitem__, range(self._count))

    def __getitem__(self, number: int) -> Field:
        return replace(self._make(range(self._count)[number]), missing=self._missing)
