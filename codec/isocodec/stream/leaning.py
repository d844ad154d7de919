"""Prediction of isovalues from one another, or from the frame before ("leans"; spec 3.5.5, 3.5.7)."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterator, Sequence

from ..format.frames import FRAME_BEFORE


def lean_of(number: int, nearest: Sequence[int], key: bool) -> int | None:
    """Choose what an isovalue leans on: itself in the frame before, or in a key frame the nearest earlier one."""
    if not key:
        return FRAME_BEFORE
    return nearest[number] if number else None


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
