"""Layers of several isovalues level by level: the same curves, coarse ones of all first, in every operation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec import Decoder
from isocodec.errors import OptionError
from isocodec.format.events import LayerComplete, TurnRead

ROWS, COLUMNS = np.mgrid[:33, :29]
NOISE = np.random.default_rng(2).normal(size=ROWS.shape)
HILLS = np.rint(40 * np.sin(ROWS / 5) * np.cos(COLUMNS / 7) + 6 * NOISE).astype(int)
HOLED = np.ma.masked_where((ROWS - 12) ** 2 + (COLUMNS - 9) ** 2 < 20, HILLS)
BALL = np.rint(10 * np.sqrt(((np.mgrid[:13, :12, :11] - 6.0) ** 2).sum(axis=0))).astype(np.int16)
LEVELS = [-20.5, -10.5, 0.5, 10.5, 20.5]
FIELDS: dict[str, Any] = {"plane": (HILLS, LEVELS), "holed": (HOLED, LEVELS), "space": (BALL, [30.5, 40.5, 50.5])}
PRECISIONS: list[Any] = ["signs", "exact", 0.05]


def both(field: Any, isovalues: Any, **options: Any) -> tuple[bytes, bytes]:
    return tuple(isocodec.encode(field, isovalues, order=order, **options) for order in ("levels", "isovalues"))  # type: ignore


def drawn(data: bytes, **view: Any) -> list[Any]:
    return [{*map(tuple, one.points.tolist())} for one in isocodec.open(data).contours(**view)]


@pytest.mark.cover(2)
@pytest.mark.parametrize("profile", ["main", "baseline"])
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", FIELDS)
def test_the_same_curves(name: str, precision: Any, profile: Any) -> None:
    field, values = FIELDS[name]
    turned, plain = both(field, values, precision=precision, profile=profile)
    assert isocodec.open(turned).info.turned and not isocodec.open(plain).info.turned
    if (precision, profile) == (0.05, "main"):
        # slack chooses the cheapest places within the tolerance
        assert all(one.kept for one in isocodec.open(turned).verify(field))
        assert [*map(len, drawn(turned))] == [*map(len, drawn(plain))]
    else:
        assert drawn(turned) == drawn(plain)
    there = ~np.ma.getmaskarray(field)
    for value in values:
        assert np.array_equal(isocodec.open(turned).above(value)[there], (np.asarray(field) > value)[there])
    assert len(turned) < (1.2 if precision == "exact" else 1.03) * len(plain) + 16 * len(values)


@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4], [4, 3, 2, 1, 0], [2, 0, 4, 1, 3]])
def test_isovalues_in_any_order(order: list[int]) -> None:
    values = [LEVELS[i] for i in order]
    turned, plain = both(HILLS, values, precision="exact")
    assert drawn(turned) == drawn(plain) and isocodec.open(turned).isovalues == tuple(values)


def test_all_isovalues_show_early() -> None:
    field = np.hypot(*np.mgrid[-60:60, -50:50])
    values = list(range(3, 70, 3))
    data = isocodec.encode(field, values, precision=0.05)
    assert isocodec.open(data).info.turned
    found = isocodec.open(data).contours(max_bytes=len(data) // 5)
    assert len(found) == len(values) and all(len(one.points) for one in found)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_cut_at_every_byte_and_fed_byte_by_byte(precision: Any) -> None:
    data, _ = both(HILLS, LEVELS[:3], precision=precision)
    one, at_once = Decoder(), Decoder()
    events = []
    for i in range(len(data)):
        one.feed(data[i : i + 1])
        events += [*one]
        for number in range(len(one.isovalues) if i % 4 == 0 else 0):
            one.contour(number)
    at_once.feed(data)
    assert [type(event) for event in events] == [type(event) for event in at_once]
    assert [event.number for event in events if isinstance(event, LayerComplete)] == [
        *range(1, 1 + sum(isinstance(event, LayerComplete) for event in events))
    ]
    assert any(isinstance(event, TurnRead) for event in events)
    for size in range(30, len(data), 41):
        try:
            short = isocodec.open(data).edited(size=size)
        except OptionError:
            continue
        assert len(short) <= size and isocodec.open(short).complete
        assert drawn(short) == [{*map(tuple, c.points.tolist())} for c in isocodec.open(short).contours()]


def test_edits(tmp_path: Path) -> None:
    data, plain = both(HILLS, LEVELS, precision="exact")
    file = isocodec.open(data)
    fewer = isocodec.open(file.edited(isovalues=LEVELS[1:3]))
    assert fewer.isovalues == tuple(LEVELS[1:3])
    assert np.array_equal(fewer.above(LEVELS[2]), LEVELS[2] < HILLS)
    window = isocodec.open(file.edited(window=[(3, 20), (5, 25)]))
    assert np.array_equal(window.above(LEVELS[3]), HILLS[2:21, 4:26] > LEVELS[3])
    assert drawn(file.edited(profile="baseline")) == drawn(plain)
    assert all(one.kept for one in file.verify(HILLS))
    assert file.statistics().layers


@pytest.mark.parametrize("what", ["mesh", "labels", "series", "one"])
def test_levels_are_refused_where_isovalues_cannot_come_in_turn(what: str) -> None:
    field = np.add.outer(np.arange(9), np.arange(9)) % 7
    mesh = isocodec.Mesh(np.array([[0, 0], [1, 0], [0, 1]], float), np.array([[0, 1, 2]]), np.array([0.0, 2.0, 4.0]))
    given = {
        "mesh": (mesh, [0.5, 1.5]), "labels": (isocodec.Field(field, labels=[1, 2]), None),
        "series": (isocodec.Frames([field, field]), [0.5, 1.5]), "one": (field, [0.5]),
    }
    with pytest.raises(OptionError, match="order"):
        isocodec.encode(*given[what], order="levels")
    for order in ("isovalues", "independent"):
        assert isocodec.open(isocodec.encode(*given[what], order=order)).info.complete
