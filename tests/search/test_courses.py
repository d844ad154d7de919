"""Searches that give up: what a mesh took on its way against others before it (spec annex G.3)."""

from __future__ import annotations

import numpy as np
import pytest

import isocodec
from brute import smooth
from isocodec.search.repair import BEHIND, CLEAR, NOISE, SURE, Course
from tables import looped

LOST = {100: 500, 60: 800, 20: 1000}
"""Bytes by places too far away of a way that did not lead to the fewest bytes."""


def course(way: dict[int, int], better: bool, least: float = 1100.0, **options: bool) -> Course:
    """What is known after a way; if it was given up, at so many bytes for 1000."""
    made = Course(**options)
    for places, size in way.items():
        assert not made.behind(places, size)
    if not better:
        made.lose(least, 1000.0)
    made.done(better)
    for places in range(SURE):
        assert not made.behind(1000 + places, 10**6), "the first turns are never behind"
    return made


@looped(("places", "size", "expected"), [
    (60, 799, False), (60, 800, True), (80, 650, True), (80, 649, False), (20, 1000, True), (19, 10**6, False),
    (101, 10**6, False),
])
@looped("aims", [False, True])
def test_no_fewer_bytes_than_one_that_was_lost(places: int, size: int, expected: bool, aims: bool) -> None:
    assert course(LOST, False, aims=aims).behind(places, size) == expected


def test_one_that_was_nearly_as_good_is_not_lost() -> None:
    assert course(LOST, False, CLEAR * 1000).lost == {}
    assert course(LOST, False, CLEAR * 1000 + 1).lost == LOST


@pytest.mark.parametrize("aims", [False, True])
def test_clearly_more_bytes_than_the_best_one(aims: bool) -> None:
    allowed = int(BEHIND * 800 + NOISE)
    assert not course(LOST, True, aims=aims).behind(60, allowed)
    assert course(LOST, True, aims=aims).behind(60, allowed + 1) == aims


def test_one_that_follows_does_not_take_the_place_of_the_lost_one() -> None:
    made = course(LOST, False)
    assert made.behind(80, 700)
    made.done(False)
    assert made.lost == LOST


def test_ways_of_one_turn_leave_nothing() -> None:
    made = Course()
    made.done(False)
    assert made.lost == {} and made.best == {}
    made.behind(10, 100)
    made.done(True)
    assert made.best == {10: 100} and made.now == {}


@pytest.mark.heavy
@pytest.mark.parametrize("shape", [(70, 64), (15, 17, 16)])
@pytest.mark.parametrize("tolerance", [0.6, 1.5])
def test_giving_up_loses_nothing(shape: tuple[int, ...], tolerance: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files as small as those of a search in which no way follows one that was lost."""
    field = smooth(shape, 7) + 0.2 * np.random.default_rng(1).normal(size=shape)
    small = isocodec.encode(field, 0.1, precision=tolerance)
    turns: list[bool] = []
    behind = Course.behind

    def alone(self: Course, places: int, size: int) -> bool:
        turns.append(behind(self, places, size))
        self.lost = {}
        return behind(self, places, size)

    monkeypatch.setattr(Course, "behind", alone)
    assert len(isocodec.encode(field, 0.1, precision=tolerance)) == len(small) and turns
