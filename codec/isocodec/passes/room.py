"""Arrays of a tube: small at first, longer where a pass needs them so, never beyond the limits (spec clause 11.2)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..errors import LimitError
from ..limits import Limits
from ..mesh.chosen import every_vertex
from ..mesh.store import PAGES, grown, new_board, new_store
from ..mesh.tables import cube_exponent, mesh_tables
from .mesh import MOST_ANCESTORS
from .state import (
    AGREED,
    CALM,
    COUNTERS,
    LAST,
    LEAVES,
    MIXED,
    MOST_MIXED,
    MOST_WORK,
    MOSTLY,
    NEXT,
    ROOM,
    SHIFT,
    SIDE,
    SIZE,
    STEP_CELLS,
    STEP_LEAVES,
    STEP_VERTICES,
    VERTICES,
    Lean,
    State,
)
from .walk import registers

NOTHING = np.zeros(0, np.int64)
STACK = 4096
ROWS = 2048


def first_state(
    shape: tuple[int, ...],
    limits: Limits,
    signs: NDArray[np.bool_] | None,
    earlier: State | None,
    shift: int,
    side: int,
) -> State:
    """What is known of an isovalue of which nothing is told.

    Parameters
    ----------
    shape : tuple of int
        Samples along each axis, 2 or 3 axes.
    limits : Limits
    signs : (s0, s1, s2) bool, optional
        Encoder: those of the field, padded to three axes.
    earlier : State, optional
        That of the isovalue that this one leans on; it lies ``shift`` whole steps below, on ``side`` 1 or -1 of this.
    """
    n = len(shape)
    counters = np.zeros(COUNTERS, np.int64)
    counters[SIZE] = cube_exponent(shape)
    counters[MOST_WORK] = limits.steps
    counters[MOST_MIXED] = limits.simplices
    counters[AGREED] = counters[CALM : CALM + 2] = MOSTLY
    counters[LAST : LAST + n] = np.array(shape) - 1
    counters[SIDE] = side
    counters[SHIFT] = shift
    return State(
        mesh_tables(n), counters, new_store(n), _rows(4, limits.vertices), _rows(5, limits.simplices),
        _rows(5, limits.simplices), new_store(n), new_store(n), new_board(n), np.zeros((MOST_ANCESTORS, 4), np.int64),
        every_vertex((0,) * n), _lean(earlier, n), np.zeros((0, 0, 0), np.bool_) if signs is None else signs,
        registers(), np.zeros(STACK, np.int64),
    )  # fmt: skip


def _lean(earlier: State | None, n: int) -> Lean:
    """What the kernels see of the earlier isovalue: values only where they are whole steps of the same scale."""
    if earlier is None:
        return Lean(mesh_tables(n), np.zeros(COUNTERS, np.int64), new_store(n), new_store(n), NOTHING, NOTHING)
    return Lean(earlier.tables, earlier.at, earlier.known, earlier.mesh, NOTHING, NOTHING)


def wider_state(st: State, limits: Limits) -> State:
    """The same state with room for the next steps of any pass.

    Raises
    ------
    LimitError
        If that is more than the limits allow.
    """
    at = st.at
    # of the mesh there may be vertices that are not known
    if max(at[VERTICES] + STEP_VERTICES, st.mesh.head[PAGES] + at[ROOM]) > limits.vertices:
        raise LimitError(
            f"more than {limits.vertices} vertices", code="limit-vertices", clause="11.2",
            remedy="raise Limits.vertices if the file is trusted",
        )  # fmt: skip
    if max(at[LEAVES], at[MIXED]) + STEP_LEAVES > limits.simplices:
        raise LimitError(
            f"more than {limits.simplices} simplices", code="limit-simplices", clause="11.2",
            remedy="raise Limits.simplices if the file is trusted",
        )  # fmt: skip
    return st._replace(
        known=grown(st.known, STEP_VERTICES),
        mesh=grown(st.mesh, max(STEP_VERTICES, int(at[ROOM]))),
        crowd=grown(st.crowd, STEP_CELLS),
        board=grown(st.board, STEP_VERTICES),
        vertex=_room(st.vertex, int(at[VERTICES]) + STEP_VERTICES, limits.vertices),
        leaf=_room(st.leaf, int(at[LEAVES]) + STEP_LEAVES, limits.simplices),
        below=_room(st.below, int(at[NEXT]) + STEP_LEAVES, limits.simplices),
    )


def filled(kernel: Callable[[NDArray[np.int64]], int]) -> NDArray[np.int64]:
    """What a kernel writes into an array that it fills as far as it goes, returning how much it has."""
    out = np.empty(1024, np.int64)
    count = kernel(out)
    if count > len(out):
        out = np.empty(count, np.int64)
        kernel(out)
    return out[:count]


def wider(array: NDArray, size: int) -> NDArray:
    """The same array with ``size`` rows, those further on zero."""
    out = np.zeros((size, *array.shape[1:]), array.dtype)
    out[: len(array)] = array
    return out


def _rows(width: int, most: int) -> NDArray[np.int32]:
    """An array that begins with some rows: small files need no more; never longer than the limit ``most``."""
    return np.zeros((min(ROWS, most), width), np.int32)


def _room(array: NDArray, needed: int, most: int) -> NDArray:
    """The array, or a longer one where it has no place for ``needed`` rows; never longer than the limit ``most``."""
    return array if needed <= len(array) else wider(array, max(min(4 * len(array), most), needed))
