"""Arrays of a tube: small at first, longer where a pass needs them so, never beyond the limits (spec clause 11.2)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from isospec.elements import ELEMENTS

from ...errors import LimitError
from ...limits import Limits
from ..lattice.grid import Grid, grid_of
from ..lattice.store import (
    PAGES,
    Store,
    bytes_of,
    new_board,
    new_counts,
    new_flags,
    new_store,
    resized,
    size_for,
    size_of,
    spare,
)
from ..lattice.tables import mesh_tables
from ..lattice.vertex_set import Chosen, every_vertex
from .ranks import Ranks, numbered
from .state import (
    FRAME,
    GATE,
    MOST_ANCESTORS,
    MOST_NEAR,
    MOSTLY,
    STEP_CELLS,
    STEP_LEAVES,
    STEP_VERTICES,
    BaseWalk,
    Counters,
    DigitWalk,
    Lean,
    RefinementWalk,
    State,
    TreeWalk,
    ValueWalk,
)

NOTHING = np.zeros(0, np.int64)
STACK = 4096
MOST_LEVELS, MOST_POINTS, SCRATCH = 80, 20, 128
"""Turns of a path and points of a curve that are remembered, and passing numbers, at most."""
ROWS = 2048
STEP_GATES = 128
"""Gates for which a base's stack has room after it has grown: many more than a step pushes."""


def first_state(
    shape: tuple[int, ...],
    limits: Limits,
    signs: NDArray[np.bool_] | None,
    earlier: State | None,
    shift: tuple[int, int],
    side: int,
    hole: Lean | None = None,
) -> State:
    """State of an isovalue of which nothing is decoded.

    Parameters
    ----------
    shape : tuple of int
        Samples along each axis, 2 or 3 axes.
    limits : Limits
    signs : (s0, s1, s2) bool, optional
        Encoder: those of the field, padded to three axes.
    earlier : State, optional
        That of the isovalue that this one leans on, ``shift`` steps below, rounded down and up; ``side`` is 1 if this
        one lies above it, else -1.
    hole : Lean, optional
        The mask that is coded with, if there is one: see `tube.holes`.
    """
    n = len(shape)
    counters = Counters()
    counters.most_work, counters.most_mixed = limits.steps, limits.simplices
    counters.agreed = MOSTLY
    counters.side = side
    counters.down, counters.up = shift
    counters.masked = hole is not None
    base = BaseWalk()
    base.last_root = -1
    turns, trail, early, candidates, window, scratch, stack = (
        np.zeros(size, np.int64) for size in (MOST_LEVELS, 2 * MOST_POINTS, 2 * MOST_POINTS, 80, 10, SCRATCH, STACK)
    )
    return State(
        grid_of(shape), counters, np.zeros(len(ELEMENTS) + 2, np.int64), np.full(2, MOSTLY, np.int64),
        np.zeros(2, np.int64), new_flags(n), _rows(4, limits.vertices), _rows(5, limits.simplices),
        _rows(5, limits.simplices), np.zeros((0, 5), np.int32), new_flags(n), new_counts(n),
        np.zeros(MOST_LEVELS, np.int64), new_board(n),
        np.zeros((MOST_ANCESTORS, 4), np.int64), _first_arrays(n).chosen, _lean(earlier, n), hole or no_lean(n),
        no_store(n),
        np.zeros((0, 0, 0), np.bool_) if signs is None else signs,
        base, RefinementWalk(), TreeWalk(), ValueWalk(), DigitWalk(),
        turns, trail, early, candidates, window, np.empty(MOST_NEAR, np.int8), scratch, stack,
    )


@cache
def no_store(n: int) -> Store:
    """A store without pages."""
    return _trimmed(new_store(n))


@cache
def no_numbers(n: int) -> Ranks:
    """Ranks of no vertices."""
    return numbered(_trimmed(new_flags(n)), np.zeros((0, 4), np.int32))


@cache
def no_lean(n: int) -> Lean:
    """View for kernels without an earlier isovalue."""
    empty = Grid(mesh_tables(n), 0, 0, 0, 0)
    nothing = _trimmed(new_flags(n))
    return Lean(empty, Counters(), np.zeros(2, np.int64), nothing, nothing, NOTHING, NOTHING, no_numbers(n))


def _lean(earlier: State | None, n: int) -> Lean:
    """View of the earlier isovalue for kernels: values only where they are whole steps of the same scale."""
    if earlier is None:
        return no_lean(n)
    return no_lean(n)._replace(
        grid=earlier.grid, counters=earlier.counters, value_bits=earlier.value_bits, known=earlier.known,
        mesh=earlier.mesh,
    )


def state_bytes(st: State, mark: Store) -> int:
    """Bytes of the arrays of a state, and of the store of visited simplices; not of what others hold or all share."""
    held = (st.known, st.mesh, st.crowd, st.board, mark, *([st.soft] if st.counters.side == FRAME else []))
    arrays = (st.vertex, st.leaf, st.below, st.active, st.path, st.stack)
    return sum(map(bytes_of, held)) + sum([array.nbytes for array in arrays])


def wider_state(
    st: State, mark: Store, walking: bool, limits: Limits, hold: Callable[[int, int], None]
) -> tuple[State, Store]:
    """Enlarge the state for the next steps of any pass, and the store of visited simplices.

    Parameters
    ----------
    walking : bool
        Whether the pass is a base, which needs its stack and that store.
    hold : callable
        Called before anything is allocated with the bytes there will be, and those more while arrays are copied.

    Raises
    ------
    LimitError
        If that is more than the limits allow.
    """
    counters = st.counters
    # of the mesh there may be vertices that are not known
    if max(counters.vertices + STEP_VERTICES, st.mesh.head[PAGES] + counters.room) > limits.vertices:
        raise LimitError(
            f"more than {limits.vertices} vertices", code="limit-vertices", clause="11.2",
            remedy="raise Limits.vertices if the file is trusted",
        )
    if max(counters.leaves, counters.mixed) + STEP_LEAVES > limits.simplices:
        raise LimitError(
            f"more than {limits.simplices} simplices", code="limit-simplices", clause="11.2",
            remedy="raise Limits.simplices if the file is trusted",
        )
    stack = len(st.stack)
    if walking and (st.base.gates + STEP_GATES) * GATE > stack:
        stack += spare(st.stack.nbytes, stack)
    arrays = {
        "vertex": _length(st.vertex, int(counters.vertices) + STEP_VERTICES, limits.vertices),
        "leaf": _length(st.leaf, int(counters.leaves) + STEP_LEAVES, limits.simplices),
        "below": _length(st.below, int(counters.next) + STEP_LEAVES, limits.simplices),
        "stack": stack,
    }
    stores = {
        "known": size_for(st.known, STEP_VERTICES),
        "mesh": size_for(st.mesh, max(STEP_VERTICES, int(counters.room))),
        "crowd": size_for(st.crowd, STEP_CELLS),
        "board": size_for(st.board, STEP_VERTICES),
    }
    visited = size_for(mark, STEP_VERTICES if walking else 0)
    # only what grows is made anew: the slots of the rest are known
    stores = {name: size for name, size in stores.items() if size != size_of(getattr(st, name))}
    arrays = {name: length for name, length in arrays.items() if length > len(getattr(st, name))}
    after, passing = state_bytes(st, mark), 0
    for store, size in [(mark, visited), *((getattr(st, name), size) for name, size in stores.items())]:
        if size != size_of(store):
            after += size.bytes(store) - bytes_of(store)
            passing += bytes_of(store)
    for name, length in arrays.items():
        array = getattr(st, name)
        after += length * array[:1].nbytes - array.nbytes
        passing += array.nbytes
    hold(after, passing)
    larger: dict[str, Any] = {name: wider(getattr(st, name), length) for name, length in arrays.items()}
    larger |= {name: resized(getattr(st, name), size) for name, size in stores.items()}
    return st._replace(**larger), resized(mark, visited)


def without_rounds(st: State) -> State:
    """Let go of what only rounds of refinement need: on the full grid none come."""
    first = _first_arrays(int(st.grid.tables[0]))
    return st._replace(below=st.below[:0].copy(), crowd=first.crowd, board=first.board)


def at_rest(st: State) -> State:
    """Copy the state without what only further layers need; the mesh, and what others may lean on, stays.

    What is kept is as long as it needs to be: a file may have thousands of isovalues.
    """
    n, counters = int(st.grid.tables[0]), st.counters
    return without_rounds(st)._replace(
        known=_trimmed(st.known), mesh=_trimmed(st.mesh), vertex=_shorter(st.vertex, int(counters.vertices)),
        leaf=_shorter(st.leaf, int(counters.leaves)), active=st.active[:0].copy(),
        path=st.path[:0].copy(), near=st.near[:0].copy(), stack=st.stack[:0].copy(), soft=no_store(n), lean=no_lean(n),
        truth=np.zeros((0, 0, 0), np.bool_), chosen=_first_arrays(n).chosen,
    )


def _trimmed(store: Store) -> Store:
    """The store with no more pages than it has filled: a copy, unless it has no others."""
    used = int(store.head[PAGES])
    return store if used == len(store.pages) else Store(store.head, store.table, store.pages[:used].copy())


class _First(NamedTuple):
    """Arrays that are empty before the first layer, and not written after the last one: all tubes can share them."""

    crowd: Store
    board: Store
    chosen: Chosen


@cache
def _first_arrays(n: int) -> _First:
    return _First(_trimmed(new_counts(n)), _trimmed(new_board(n)), every_vertex((0,) * n))


def filled(kernel: Callable[[NDArray[np.int64]], int]) -> NDArray[np.int64]:
    """Output of a kernel that fills an array as far as it goes, and returns how much it has."""
    out = np.empty(1024, np.int64)
    count = kernel(out)
    if count > len(out):
        out = np.empty(count, np.int64)
        kernel(out)
    return out[:count]


def wider(array: NDArray, size: int) -> NDArray:
    """Extend an array to ``size`` rows, of which the new ones are arbitrary; the array itself if it has as many."""
    if size == len(array):
        return array
    out = np.empty((size, *array.shape[1:]), array.dtype)
    out[: len(array)] = array
    return out


def _shorter(array: NDArray, size: int) -> NDArray:
    """A copy of the first ``size`` rows; the array itself if it has no others."""
    return array if size == len(array) else array[:size].copy()


def _rows(width: int, most: int) -> NDArray[np.int32]:
    """An array that begins with some rows: small files need no more; never longer than the limit ``most``."""
    return np.empty((min(ROWS, most), width), np.int32)


def _length(array: NDArray, needed: int, most: int) -> int:
    """Rows that the array has, or a good deal more where it has no place for ``needed``; at most the limit ``most``."""
    if needed <= len(array):
        return len(array)
    return max(min(len(array) + spare(array.nbytes, len(array)), most), needed)
