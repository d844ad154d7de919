"""The fields of a series, each made when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from ..errors import OptionError
from ..field.placement import Placement
from ..field.sampled import Field


class InTurn:
    """Fields in order, each made when it is asked for.

    ``make`` gets a number from 0, ``whole`` is the shape of the array in the source with the axis of frames, and
    ``remarks`` name what the source states and the fields leave out.
    """

    def __init__(
        self, count: int, make: Callable[[int], Field], whole: Sequence[int] = (), remarks: Sequence[str] = ()
    ) -> None:
        self._count, self._make, self.whole, self.remarks = count, make, tuple(whole), tuple(remarks)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Field]:
        return map(self._make, range(self._count))

    def __getitem__(self, number: int) -> Field:
        return self._make(range(self._count)[number])


def check_frame(frame: int, count: int) -> None:
    """Raise `OptionError` unless a series of that many frames, 0 if it is none, has such a frame."""
    if not 0 <= frame < count:
        there = f"the series has {count}, counted from 0" if count else "this is not a series"
        raise OptionError(f"there is no frame {frame}: {there}", code="frame")


def check_series(axes: int) -> None:
    """Raise `OptionError` unless an array with this number of axes is a series of fields."""
    if axes not in (3, 4):
        raise OptionError(f"--frames makes a series of an array of three or four axes; the data have {axes}",
                          code="frame")


def placed_field(
    values: Any, mask: Any = None, place: Placement | None = None, remarks: Sequence[str] = (), **more: Any
) -> Field:
    """Make a field that carries the remark of its placement; an invalid placement is dropped with a remark."""
    said = (*remarks, *([place.remark] if place is not None and place.remark else []))
    try:
        return Field(values, mask, place if place is not None and place.placed else None, remarks=said, **more)
    except OptionError as error:
        more.pop("crs", None)
        return Field(values, mask, remarks=(*said, f"its coordinates are ignored: {error.message}"), **more)


def unjoined(placement: Placement | None) -> tuple[Placement | None, tuple[str, ...]]:
    """Placement of a frame or of tiles, whose ends are not joined, and a remark if they meet."""
    if placement is None or not placement.periodic:
        return placement, ()
    remark = f"its ends along axis {placement.periodic[0]} are not joined, as it is a series"
    return replace(placement, periodic=(), inferred=False), (remark,)
