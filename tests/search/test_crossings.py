"""Curves of neighbouring isovalues do not cross under a tolerance: by shapely, on what decoders draw."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.drawing.contour import Contour
from isocodec.search.fences import Fences
from isocodec.search.proof import Target
from libraries import Late
from tables import looped

shapely = Late("shapely")

ROWS, COLUMNS = np.mgrid[:41, :37]
NOISE = np.random.default_rng(5).normal(size=ROWS.shape)
FIELDS: dict[str, Any] = {
    "hills": np.rint(90 * np.sin(ROWS / 6) * np.cos(COLUMNS / 5) + 4 * NOISE).astype(np.int16),
    "cliff": 40 * np.tanh((COLUMNS - 18 + 5 * np.sin(ROWS / 4)) / 2) + ROWS,
    "plateaus": np.rint(3 * np.sin(ROWS / 5) + 3 * np.cos(COLUMNS / 6)) * 10 + NOISE,
}
FIELDS["holed"] = np.ma.masked_where((ROWS - 20) ** 2 + (COLUMNS - 12) ** 2 < 30, FIELDS["hills"])
ORDERS = {"rising": slice(None), "falling": slice(None, None, -1), "outward": [3, 4, 2, 5, 1, 6, 0]}


def levels(field: Any) -> list[float]:
    low, high = float(field.min()), float(field.max())
    return [round(low + (high - low) * (i + 0.5) / 7, 1) + 0.05 for i in range(7)]


def crossing(contours: list[Contour]) -> list[tuple[float, float]]:
    """Where curves of isovalues next to one another cross, by more than a millionth of a cell."""
    found = []
    for one, other in pairwise(sorted(contours, key=lambda contour: contour.isovalue)):
        first, second = (shapely.multilinestrings(c.points[c.cells]) for c in (one, other))
        meeting = shapely.get_parts(shapely.intersection(first, second))
        for place in shapely.get_coordinates(meeting[shapely.get_type_id(meeting) == 0]):
            # on both sides of each there must be something of the other near a crossing: touching is none
            around = shapely.Point(place).buffer(1e-3)
            a, b = (shapely.line_merge(shapely.intersection(curve, around)) for curve in (first, second))
            ends = [shapely.get_coordinates(shapely.boundary(part)) for part in (a, b)]
            if all(len(end) == 2 for end in ends) and _between(place, *ends):
                found.append((float(place[0]), float(place[1])))
    return found


def _between(place: np.ndarray, first: np.ndarray, second: np.ndarray) -> bool:
    """Whether, around a place, the ends of one curve lie on both sides of the other."""
    angle = [np.arctan2(*(ends - place).T) % (2 * np.pi) for ends in (first, second)]
    low, high = sorted(angle[0])
    gaps = np.abs(angle[1][:, None] - angle[0])
    return bool(np.min(gaps) > 1e-6 and ((low < angle[1]) & (angle[1] < high)).sum() == 1)


@pytest.mark.cover(1)
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("tolerance", [0.05, 0.3, 1.0, 3.0])
@pytest.mark.parametrize("name", FIELDS)
def test_isovalues_next_to_one_another_do_not_cross(name: str, tolerance: float, order: str) -> None:
    field = FIELDS[name]
    isovalues = np.array(levels(field))[ORDERS[order]].tolist()
    data = isocodec.encode(field, isovalues, precision=tolerance)
    contours = isocodec.open(data).contours()
    assert crossing(contours) == []
    for number, contour in enumerate(contours):
        # and each keeps its promise
        original = isocodec.decode(isocodec.encode(field, isovalues[number], precision=1e-4))
        apart = Target(original.points, original.cells, tolerance + 0.01)
        assert not len(apart.exceeded(contour.points, contour.cells).cells)


@pytest.mark.heavy
@pytest.mark.parametrize("options", [
    {"keep_topology": True}, {"profile": "baseline"}, {"order": "independent"}, {"order": "isovalues"},
])
def test_nor_with_other_options(options: dict[str, Any]) -> None:
    field = FIELDS["hills"]
    data = isocodec.encode(field, levels(field), precision=1.0, **options)
    assert crossing(isocodec.open(data).contours()) == []
    assert data == isocodec.encode(field, levels(field), precision=1.0, **options)


def test_by_themselves_they_do() -> None:
    """What the others are about: the oracle sees crossings."""
    field = FIELDS["hills"]
    apart = [isocodec.decode(isocodec.encode(field, value, precision=3.0)) for value in levels(field)]
    assert len(crossing(apart)) > 3


def contour(isovalue: float, *places: tuple[float, float]) -> Contour:
    points = np.array(places, float)
    number = np.arange(len(points))
    return Contour(points, np.stack([number[:-1], number[1:]], axis=1), shape=(9, 9), isovalue=isovalue)


@looped("turned", [False, True])
@looped("higher", [False, True])
@looped(("line", "below", "above"), [
    # beside it, on the side of what is higher or not
    ([(0, 5), (8, 5)], 0, 0), ([(9, 0), (9, 8)], 0, 0),
    # across it: inside segments, at points of one, of both
    ([(0, 3), (8, 5)], 1, 1), ([(0, 3), (4, 4), (8, 5)], 1, 1), ([(0, 3), (2, 4), (8, 5)], 1, 1),
    ([(0, 0), (8, 8)], 1, 1),
    # touching it from either side
    ([(0, 6), (4, 4), (8, 6)], 1, 0), ([(0, 2), (4, 4), (8, 2)], 0, 1), ([(0, 6), (2, 4), (8, 6)], 1, 0),
    # along it, coming from either side and leaving
    ([(0, 4), (4, 4), (8, 4)], 0, 0), ([(0, 4), (8, 4)], 0, 0), ([(0, 6), (2, 4), (6, 4), (8, 6)], 2, 0),
    ([(0, 2), (2, 4), (6, 4), (8, 6)], 1, 1), ([(0, 4 - 1e-12), (8, 4 + 1e-12)], 0, 0),
])
def test_what_counts_as_crossing(
    line: list[tuple[float, float]], below: int, above: int, higher: bool, turned: bool
) -> None:
    """Lines against one from (0, 4) by way of (4, 4) to (8, 4), to the left of which it is higher."""
    fence = contour(0.0, (0, 4), (4, 4), (8, 4))
    if turned:
        fence = contour(0.0, (4, 8), (4, 4), (4, 0))
        line = [(y, 8 - x) for x, y in line]
    given = contour(1.0 if higher else -1.0, *line)
    count = above if higher else below
    coded, waiting = Fences(given.isovalue, [fence], []), Fences(given.isovalue, [], [fence])
    assert (len(coded.coded_crossed(given)) > 0) == (len(waiting.waiting_crossed(given)) > 0) == (count > 0)
    assert not len(coded.waiting_crossed(given)) and not len(waiting.coded_crossed(given))
