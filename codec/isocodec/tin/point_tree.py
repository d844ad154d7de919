"""Coding of positions: a box is halved repeatedly, and it is coded which halves have points (clause 10.9.3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..entropy.guesses import clear_opinions, decided, hear, say
from ..entropy.range_coder import Coder
from ..entropy.run import Run
from ..errors import LimitError
from ..kernel import DONE, inlined, inner, kernel, record
from ..kernel.types import IntMatrix, IntVector
from .models import AREAS, CONTEXT, MIX_CELL, NEAR, OPEN, STATES, WIDE

_NEAR, _SIDES, _WIDE, _PAST = CONTEXT.firsts("NEAR", "SIDES", "WIDE", "PAST")
_FIRST = np.array([1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2047, 2047, 2047, 2047, 2047, 2047])
"""Logits that the first half has points, by the logarithm of its expected number, from 2**-8 on."""
_SECOND = np.array(
    [-1419, -1241, -1063, -883, -702, -516, -322, -111, 139, 475, 1019, 2047, 2047, 2047, 2047, 2047, 2047]
)
"""Logits that the second half has points, too."""
_WORK = 24
"""Units of work for halving a cell, memory included."""
_EMPTY, _FULL, _OPEN = 0, 1, 2
_FREE = -1


@record
class Level(NamedTuple):
    """Cells with points before and after a halving.

    ``cell`` (C, 2) are the cells before, in order, ``half`` those after; ``table`` and ``halves`` are their hash
    tables, with a key and a number in each row. ``size`` holds the sizes of halves as exponents, the axis, the extents
    of the box, the approximate number of points, the number of halves listed, whether the last three second halves had
    points, and the sizes of the box as exponents.
    """

    cell: IntMatrix
    half: IntMatrix
    table: IntMatrix
    halves: IntMatrix
    size: IntVector


_SX, _SY, _AXIS, _W, _H, _COUNT, _LISTED, _PASTS, _LOG_W, _LOG_H = range(10)


@inlined
def _hash(x, y, size):
    h = (x * 73856093) ^ (y * 19349663)
    return (h ^ (h >> 24)) & (size - 1)


@inlined
def _key(x, y):
    return (x << 30) | y


@inner
def _find(table, x, y):
    """Number of a cell; -1 if it has no points."""
    if x < 0 or y < 0:
        return np.int64(_FREE)
    key = _key(x, y)
    at = _hash(x, y, len(table))
    while table[at, 0] != key:
        if table[at, 0] < 0:
            return np.int64(_FREE)
        at = (at + 1) & (len(table) - 1)
    return table[at, 1]


@inner
def _enter(table, x, y, number):
    key = _key(x, y)
    at = _hash(x, y, len(table))
    while table[at, 0] >= 0:
        at = (at + 1) & (len(table) - 1)
    table[at, 0] = key
    table[at, 1] = number


@inner
def _state(lv, x, y, at):
    """State of a half while cell ``at`` is being halved."""
    parent = _find(lv.table, x >> 1, y) if lv.size[_AXIS] == 0 else _find(lv.table, x, y >> 1)
    if parent < 0:
        return _EMPTY
    if _find(lv.halves, x, y) >= 0:
        return _FULL
    return _OPEN if parent >= at else _EMPTY


@inner
def _around(lv, x, y):
    """Number of the 24 cells around a cell that have points."""
    count = 0
    for i in range(-2, 3):
        for j in range(-2, 3):
            if (i != 0 or j != 0) and _find(lv.table, x + i, y + j) >= 0:
                count += 1
    return count


@inner
def _class(count, area, whole):
    """Class of the expected number of points of a cell."""
    # whole and area are sums of logarithms
    out = np.int64(8 - (whole - area))
    while count > 1:
        count >>= 1
        out += 1
    return min(max(out, 0), len(_FIRST) - 1)


@inner
def _code_half(cd, lv, at, x, y, second, bit):
    """Code whether a half has points; x, y count halves."""
    size = lv.size
    beside = 0
    near = unknown = 0
    place = 1
    for i in range(-1, 2):
        for j in range(-1, 2):
            if i == 0 and j == 0:
                continue
            found = _state(lv, x + i, y + j, at)
            if found == _FULL:
                near += 1
            elif found == _OPEN:
                unknown += 1
            if i == 0 or j == 0:
                beside += place * found
                place *= 3
    area = min(size[_SX] + size[_SY], AREAS - 1)
    wide = _around(lv, lv.cell[at, 0], lv.cell[at, 1])
    clear_opinions(cd)
    whole = size[_LOG_W] + size[_LOG_H]
    found = _class(size[_COUNT], size[_SX] + size[_SY], whole)
    say(cd, _SECOND[found] if second else _FIRST[found])
    hear(cd, _NEAR + ((area * NEAR + near) * OPEN + min(unknown, OPEN - 1)) * 2 + second)
    hear(cd, _SIDES + (min(area, 3) * STATES + beside) * 2 + second)
    hear(cd, _WIDE + (area * WIDE + wide) * 2 + second)
    hear(cd, _PAST + ((area * 2 + size[_AXIS]) * 8 + size[_PASTS]) * 2 + second)
    bit = decided(cd, MIX_CELL + 2 * area + second, bit)
    if bit >= 0 and second:
        size[_PASTS] = (size[_PASTS] << 1 | bit) & 7
    return bit


@inner
def _list(lv, x, y):
    count = lv.size[_LISTED]
    lv.half[count, 0] = x
    lv.half[count, 1] = y
    lv.size[_LISTED] = count + 1
    _enter(lv.halves, x, y, count)


@kernel
def halve(cd: Coder, lv: Level, truth: IntVector) -> int:
    """Halve all cells; an encoder's ``truth`` is 1 if the first half has points, plus 2 if the second has."""
    size = lv.size
    for at in range(len(lv.cell)):
        x, y = lv.cell[at, 0], lv.cell[at, 1]
        first, dx, dy = np.int64(1), np.int64(1), np.int64(0)
        if size[_AXIS] == 0:
            x <<= 1
            there = (x + 1) << size[_SX] < size[_W]
        else:
            y <<= 1
            dx, dy = dy, dx
            there = (y + 1) << size[_SY] < size[_H]
        told = truth[at] if len(truth) else np.int64(0)
        second = np.int64(0)
        if there:
            first = _code_half(cd, lv, at, x, y, 0, told & 1)
            if first < 0:
                return first
        if first:
            _list(lv, x, y)
            if there:
                second = _code_half(cd, lv, at, x + dx, y + dy, 1, told >> 1)
                if second < 0:
                    return second
        else:
            second = np.int64(1)
        if second:
            _list(lv, x + dx, y + dy)
    return DONE


def _table(count: int) -> NDArray[np.int64]:
    return np.full((_rows(count), 2), _FREE, np.int64)


def _table_bytes(count: int) -> int:
    return 16 * _rows(count)


def _rows(count: int) -> int:
    return 1 << (2 * count + 2).bit_length()


@kernel
def enter_all(table: IntMatrix, cell: IntMatrix) -> None:
    """Put cells into a hash table."""
    for i in range(len(cell)):
        _enter(table, cell[i, 0], cell[i, 1], i)


def code_positions(
    run: Run, extent: tuple[int, int], count: int, points: NDArray[np.int64] | None, most: int,
    hold: Callable[[int, int], None] | None = None,
) -> tuple[int, NDArray[np.int64]]:
    """Code about ``count`` positions from 0 to below ``extent``: the distinct ``points`` (N, 2) of an encoder, or None.

    ``hold`` is called before each halving with the bytes that it keeps, and those that it needs in addition. Returns
    DONE, or why the coder stopped, and all positions in the order of the tree. Raises `LimitError` if there are more
    than ``most`` points, or this takes more work than the run allows or more memory than ``hold`` does.
    """
    sx, sy = (max(side - 1, 0).bit_length() for side in extent)
    cell = np.zeros((1, 2), np.int64)
    owner = None if points is None else np.zeros(len(points), np.int64)
    size = np.array([sx, sy, 0, *extent, count, 0, 0, sx, sy], np.int64)
    while sx or sy:
        axis = 0 if sx >= sy else 1
        sx, sy = (sx - 1, sy) if axis == 0 else (sx, sy - 1)
        size[:3] = sx, sy, axis
        size[_LISTED] = size[_PASTS] = 0
        truth = np.zeros(0, np.int64)
        if owner is not None:
            assert points is not None
            side = points[:, axis] >> (sx, sy)[axis] & 1
            truth = np.zeros(len(cell), np.int64)
            np.bitwise_or.at(truth, owner, 1 + side)
        run.spend(_WORK * len(cell))
        if hold is not None:
            hold(2 * cell.nbytes, 2 * cell.nbytes + _table_bytes(len(cell)) + _table_bytes(2 * len(cell)))
        table, halves = _table(len(cell)), _table(2 * len(cell))
        enter_all(table, cell)
        level = Level(cell, np.zeros((2 * len(cell), 2), np.int64), table, halves, size)
        status = halve(run.coder, level, truth)
        if status != DONE:
            return status, cell[:0]
        cell = level.half[: size[_LISTED]].copy()
        del table, halves, level
        if len(cell) > most:
            raise LimitError(f"more than {most:,} points", code="limit-vertices", clause="11.2")
        if owner is not None:
            # halves of each cell lie one after the other
            before = np.concatenate([[0], np.cumsum((truth & 1) + (truth >> 1))])
            owner = before[owner] + (side & truth[owner] & 1)
    return DONE, cell
