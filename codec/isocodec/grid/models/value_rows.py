"""Samples near those of a list: places in the list by position (spec clauses 4.8, 7.15).

A list in order goes through blocks row by row. Kept are the samples of each row that are listed, and the rows around
it: from these follow the places of all that are near a sample, in a fraction of the memory that the places take.
"""

from __future__ import annotations

from functools import partial
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import constant, inlined, kernel, record
from ...kernel.types import Int32Matrix, Int32Vector, IntVector, UInt8Matrix
from ..lattice.access import dimension
from ..lattice.order import BLOCK, along_rows, block_of
from ..tube.state import State

_SHIFT = BLOCK[3][2]
LENGTH = 1 << _SHIFT
"""Samples of a row: those of a block along the last axis."""
ROWS = 64
"""Rows of a block."""
assert BLOCK[2] == (_SHIFT, _SHIFT) and ROWS == 1 << BLOCK[2][0] == 1 << BLOCK[3][0] + BLOCK[3][1]
_SHORT = BLOCK[3][0]
ABSENT = 255
"""In place of the rank of a sample that is not listed."""
_AROUND = 27
"""Blocks around a block, and that block."""


@record
class ValueRows(NamedTuple):
    """Rows of the samples of a list, in order; the last row is one without samples.

    Attributes
    ----------
    first : (R + 1,) int32
        Place in the list of the first sample of each row; of the last row that behind the list.
    rank : (R + 1, 64) uint8
        Number of listed samples before each one in its row, ``ABSENT`` for those that are not listed.
    beside : (R, columns) int32
        Rows around each: see `_columns`.
    around : (steps,) int32
        Places of the samples near one of the list, as `find_around` leaves them.
    """

    first: Int32Vector
    rank: UInt8Matrix
    beside: Int32Matrix
    around: Int32Vector


def _steps(n: int) -> NDArray[np.int64]:
    """Steps to the samples near a sample, (steps, 3): along axes of blocks, of which a plane has no second one.

    For each axis those 1 before, 1 behind, 2 before and 2 behind, then for each two axes the four across.
    """
    unit = np.eye(3, dtype=np.int64)[[0, 2] if n == 2 else [0, 1, 2]]
    steps = [unit[axis] * far for axis in range(n) for far in (-1, 1, -2, 2)]
    for a, b in combinations(range(n), 2):
        steps += [unit[a] * i + unit[b] * j for i, j in product((-1, 1), repeat=2)]
    return np.array(steps)


def _columns(n: int) -> NDArray[np.int64]:
    """Rows around a row, (columns, 3): steps to them, the last one in rows. Those of one line follow one another."""
    steps = _steps(n)
    lines = sorted({(int(x), int(y)) for x, y, _ in steps})
    rows = []
    for line in lines:
        along = steps[(steps[:, :2] == line).all(axis=1), 2].any()
        rows += [(*line, way) for way in ((-1, 0, 1) if along else (0,))]
    return np.array(rows)


def _ways(n: int) -> NDArray[np.int64]:
    """For each step the column of the row that it leads to, in the same block along the last axis, and how far there.
    """
    columns = [tuple(column) for column in _columns(n).tolist()]
    return np.array([(columns.index((x, y, 0)), z) for x, y, z in _steps(n).tolist()])


_COLUMNS_2, _COLUMNS_3 = constant(partial(_columns, 2)), constant(partial(_columns, 3))
_WAYS_2, _WAYS_3 = constant(partial(_ways, 2)), constant(partial(_ways, 3))


def no_rows() -> ValueRows:
    """Rows of no list."""
    return ValueRows(
        np.zeros(0, np.int32), np.zeros((0, LENGTH), np.uint8), np.zeros((0, 0), np.int32), np.zeros(0, np.int32)
    )


def counted(st: State, active: NDArray[np.int64]) -> tuple[int, int]:
    """Count the rows of a list of vertices in order, and the blocks."""
    counts = np.empty(2, np.int64)
    count_rows(st, active, counts)
    return int(counts[0]), int(counts[1])


def rows_bytes(n: int, rows: int, blocks: int) -> int:
    """Bytes of the rows of a list, and of what making them takes for a moment."""
    return (rows + 1) * (4 + LENGTH + 4 * len(_columns(n))) + blocks * (8 + 4 * ROWS)


def rows_of_list(st: State, active: NDArray[np.int64], rows: int, blocks: int) -> ValueRows:
    """Make the rows of a list of vertices in order: as many as `counted`."""
    n = int(dimension(st.grid.tables))
    out = ValueRows(
        np.empty(rows + 1, np.int32), np.empty((rows + 1, LENGTH), np.uint8),
        np.empty((rows, len(_columns(n))), np.int32), np.empty(len(_steps(n)), np.int32),
    )
    key, row = np.empty(blocks, np.int64), np.empty((blocks, ROWS), np.int32)
    enter_rows(st, active, key, row, out)
    enter_beside(st, key, row, np.empty(_AROUND, np.int64), out.beside)
    return out


@inlined
def _key(plane, b0, b1, b2):
    """A number by which blocks are in order."""
    return b0 << 32 | b2 if plane else b0 << 40 | b1 << 20 | b2


@inlined
def _block_at(plane, key):
    """Coordinates of the block of a key."""
    if plane:
        return key >> 32, np.int64(0), key & (1 << 32) - 1
    return key >> 40, key >> 20 & (1 << 20) - 1, key & (1 << 20) - 1


@inlined
def _at(st, plane, v):
    """The block of a vertex, the row within it, and the place in that row."""
    x, y, z = along_rows(plane, np.int64(st.vertex[v, 0]), np.int64(st.vertex[v, 1]), np.int64(st.vertex[v, 2]))
    key = _key(plane, *block_of(plane, x, y, z))
    return key, _row(plane, x, y), z & LENGTH - 1


@inlined
def _row(plane, x, y):
    """The row of its block that a place lies in."""
    if plane:
        return x & ROWS - 1
    return (x & (1 << _SHORT) - 1) << _SHORT | y & (1 << _SHORT) - 1


@kernel
def count_rows(st: State, active: IntVector, counts: IntVector) -> None:
    """Enter the numbers of rows of a list of vertices in order, and of blocks."""
    plane = dimension(st.grid.tables) == 2
    rows, blocks = 0, 0
    before, row_before = np.int64(-1), np.int64(-1)
    for v in active:
        key, row, _ = _at(st, plane, v)
        if key != before or row != row_before:
            rows += 1
            blocks += key != before
        before, row_before = key, row
    counts[0], counts[1] = rows, blocks


@kernel
def enter_rows(st: State, active: IntVector, key: IntVector, row: Int32Matrix, out: ValueRows) -> None:
    """Enter the samples of the rows of a list, the keys of its blocks, and the rows of each block: (blocks, 64)."""
    plane = dimension(st.grid.tables) == 2
    rows, blocks = -1, -1
    none = len(out.first) - 1
    for i in range(len(active)):
        here, own, cell = _at(st, plane, active[i])
        if blocks < 0 or key[blocks] != here:
            blocks += 1
            key[blocks] = here
            row[blocks, :] = none
        if row[blocks, own] == none:
            rows += 1
            row[blocks, own] = rows
            out.first[rows] = i
            out.rank[rows, :] = ABSENT
        out.rank[rows, cell] = i - out.first[rows]
    out.first[none] = len(active)
    out.rank[none, :] = ABSENT


@inlined
def _number_of(key, one):
    """Number of a key among others in order, -1 if it is not there."""
    low, high = 0, len(key)
    while low < high:
        middle = (low + high) >> 1
        if key[middle] < one:
            low = middle + 1
        else:
            high = middle
    return low if low < len(key) and key[low] == one else -1


@kernel
def enter_beside(st: State, key: IntVector, row: Int32Matrix, near: IntVector, beside: Int32Matrix) -> None:
    """Enter the rows around each row; ``near`` is room for the numbers of the blocks around a block."""
    plane = dimension(st.grid.tables) == 2
    none = len(beside)
    columns = _COLUMNS_2 if plane else _COLUMNS_3
    short = _SHIFT if plane else _SHORT
    for block in range(len(key)):
        b0, b1, b2 = _block_at(plane, key[block])
        for i in range(_AROUND):
            x, y, z = b0 + i // 9 - 1, b1 + i // 3 % 3 - 1, b2 + i % 3 - 1
            near[i] = _number_of(key, _key(plane, x, y, z)) if min(x, y, z) >= 0 else -1
        for own in range(ROWS):
            here = row[block, own]
            if here == none:
                continue
            x, y = (own, 0) if plane else (own >> short, own & (1 << short) - 1)
            for i in range(len(columns)):
                u, w = x + columns[i, 0], y + columns[i, 1]
                other = near[9 * (u >> short) + 3 * (w >> short) + columns[i, 2] + 13]
                beside[here, i] = row[other, _row(plane, u, w)] if other >= 0 else none


@inlined
def go_to_row(rows, row, item):
    """The row of a sample of the list that is not before the row."""
    while rows.first[np.uint64(row + 1)] <= item:
        row += 1
    return row


@inlined
def find_around(st, rows, row, v):
    """Enter the places in the list of the samples near vertex v of a row; for those not listed that behind the list."""
    plane = dimension(st.grid.tables) == 2
    cell = np.int64(st.vertex[v, 1] if plane else st.vertex[v, 2]) & LENGTH - 1
    beside, none = rows.beside[np.uint64(row)], rows.first[np.uint64(len(rows.first) - 1)]
    ways = _WAYS_2 if plane else _WAYS_3
    for i in range(len(ways)):
        at = cell + ways[i, 1]
        other = np.uint64(beside[np.uint64(ways[i, 0] + (at >> _SHIFT))])
        rank = rows.rank[other, np.uint64(at & LENGTH - 1)]
        place = rows.first[other] + np.int32(rank)
        rows.around[np.uint64(i)] = none if rank == ABSENT else place
