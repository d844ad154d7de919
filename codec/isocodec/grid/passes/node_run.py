"""Coordinates of the samples as a run, and back (spec clause 3.7.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...entropy.context_layout import context_coder
from ...entropy.range_coder import Coder
from ...entropy.run import Account, WritingRun, whole_run
from ...errors import FormatError
from ...kernel import NEED
from .nodes import AXES, CONTEXT, Nodes, code_coordinate

_ROOM = 1 << 12
"""Bytes of a run at first."""
_REASONS = {0: ("a coordinate out of range", "3.7.4")}


@dataclass(frozen=True)
class NodeGrid:
    """The nodes of one coordinate.

    Attributes
    ----------
    counts : tuple of int
        Nodes along each axis; 1 along an axis that the coordinate does not depend on.
    period : int
        In units; 0 if not periodic.
    """

    counts: tuple[int, ...]
    period: int

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return int(np.prod([int(count) for count in self.counts], dtype=object))

    @property
    def along(self) -> NDArray[np.int64]:
        """Nodes along each of three axes, (3,)."""
        return np.array(self.counts + (1,) * (AXES - len(self.counts)), np.int64)


def _coder(count: int) -> Coder:
    """A coder with contexts for so many coordinates."""
    prob, seen = CONTEXT.begun()
    return context_coder(np.tile(prob, count), np.tile(seen, count))


def encode_run(
    grids: Sequence[NodeGrid], goals: Sequence[NDArray[np.int64]], free: Sequence[NDArray[np.bool_]]
) -> tuple[bytes, list[NDArray[np.int64]]]:
    """The run of coordinates, and the values that it holds, which are near those wanted where these are not free."""
    room = _ROOM
    while (found := _encoded(grids, goals, free, room)) is None:
        room *= 4
    return found


def _encoded(
    grids: Sequence[NodeGrid], goals: Sequence[NDArray[np.int64]], free: Sequence[NDArray[np.bool_]], room: int
) -> tuple[bytes, list[NDArray[np.int64]]] | None:
    """Encode in so many bytes; None if these are too few."""
    run = WritingRun(_coder(len(grids)))
    run.room(room // 2)
    values = []
    for i, (grid, goal, loose) in enumerate(zip(grids, goals, free, strict=True)):
        value = np.zeros(grid.nodes, np.int64)
        nodes = Nodes(value, goal.ravel(), loose.ravel(), grid.along)
        status = code_coordinate(run.coder, nodes, grid.period, i * CONTEXT.count)
        if status == NEED:
            return None
        run.check(status)
        values.append(value.reshape(grid.counts))
    return run.end(), values


def decode_run(data: bytes, grids: Sequence[NodeGrid], account: Account) -> list[NDArray[np.int64]] | None:
    """Inverse of ``encode_run``; None if the bytes are no such run.

    Raises
    ------
    LimitError
        If it takes more than the account allows.
    """
    run = whole_run(_coder(len(grids)), data, account)
    values = []
    try:
        for i, grid in enumerate(grids):
            value = np.zeros(grid.nodes, np.int64)
            nodes = Nodes(value, np.zeros(0, np.int64), np.zeros(0, np.bool_), grid.along)
            run.check(code_coordinate(run.coder, nodes, grid.period, i * CONTEXT.count), _REASONS)
            values.append(value.reshape(grid.counts))
        run.end()
    except FormatError:
        return None
    return values
