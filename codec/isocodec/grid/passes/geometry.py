"""Geometry decoded so far: numbers of the values at vertices, or parts of crossed edges (clauses 5.6, 5.7, 5.9)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...entropy.range_coder import Coder
from ...limits import Budget
from ..lattice.implied import implied_edges
from ..lattice.order import EDGE_BLOCK, in_order
from ..models.crossing_candidates import Crossings
from ..models.crossings_nearby import beside_grid, beside_leaves, nothing_beside
from ..models.value_bits import Nearby
from ..models.value_rows import counted, no_rows, rows_bytes, rows_of_list
from ..tube.capacity import NOTHING, no_numbers
from ..tube.leaf_vertices import drawn, drawn_bytes
from ..tube.ranks import Ranks, enter_numbers_at
from ..tube.state import State, numbers_bytes, numbers_of
from ..tube.truth import Truth
from . import carriers, values
from .offsets import offsets

_VALUES, _VALUES_TAKEN = 96, 240
"""Bytes that listing values takes at most for each vertex, and where an earlier isovalue has some."""
_EDGES_GRID, _LEAVES = 240, {2: 480, 3: 480}
"""Bytes that listing offsets takes at most for each edge of the full grid, and for each leaf elsewhere."""
UNBOUNDED = np.int64(1 << 62)
"""No number is as large."""
_ALL = slice(None)
OfEdges = Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.int64]]
"""A number for each edge, by the positions of its ends, both (E, n)."""
_PIECE = 1 << 16
"""Edges that are looked at at a time."""
MOST_TAKEN = 1 << 53
"""Numbers of this size and more are not taken over from another isovalue: many isovalues in a row could make any."""


class Estimates:
    """Geometry of one isovalue from its layers so far.

    Parameters
    ----------
    shape : tuple of int
    truth : Truth or None
        For the encoder.
    lean : tuple of Estimates and a function that returns a State, or None
        Those of the earlier isovalue, as they are at any time.
    shift : (int, int) or None
        How many steps above that isovalue this one lies, rounded down and up; None if values of the one do not bound
        the other.

    Attributes
    ----------
    has_values : bool
    bits : tuple of int
        Bits of the numbers of values above and below the isovalue.
    number, left : (V,) int64
        For each vertex, as far as values have come: its number so far, and the bits that are missing.
    edges : (E, 2) int64
        Vertices at the lower and upper ends of the edges that carry offsets.
    parts, offset : (E,) int64
        Parts of each, and the number of the one that holds the crossing.
    place : function of (E, n) int64, (E, n) int64 to (E,) int64, or None
        Encoder: where edges are to be crossed, instead of where the field crosses them (``Truth.crossing``).
    slack : function like ``place``, or None
        Encoder: how far from there the next layer of offsets may place the crossings, in the same unit.
    """

    def __init__(
        self, shape: tuple[int, ...], truth: Truth | None, lean: tuple[Estimates, Callable[[], State]] | None,
        shift: tuple[int, int] | None, budget: Budget,
    ) -> None:
        self.shape = shape
        self.n = len(shape)
        self.truth = truth
        self.place: OfEdges | None = truth.crossing if truth else None
        self.slack: OfEdges | None = None
        self.has_values = False
        self.bits = (0, 0)
        self.number = NOTHING
        self.left = NOTHING
        self._least = self._most = NOTHING
        self.edges = np.zeros((0, 2), np.int64)
        self.parts = NOTHING
        self.offset = NOTHING
        self._lean = lean
        self._shift = shift
        self._active = NOTHING
        self._active_mesh = self._edges_mesh = self._leaves_mesh = -1
        self._leaves = np.zeros((0, self.n + 1), np.int64), NOTHING
        self._full = False
        self._wanted = NOTHING
        self._rows = no_rows()
        self._told = NOTHING
        self._length = NOTHING
        self._rising = np.zeros(0, np.bool_)
        self._earlier = np.zeros((0, 2), np.int64)
        self._target = self._slack = NOTHING
        self._plane = 0
        self._numbers = no_numbers(self.n)
        self._beside = nothing_beside(self.n)
        self._pitch = (1, 0)
        self._budget = budget

    def rest(self) -> None:
        """Let go of what only further layers need: the layers decoded stay."""
        self.truth = self.place = self.slack = self._lean = None
        self._wanted = NOTHING
        self._rows = no_rows()
        self._active = self._told = self._least = self._most = NOTHING
        self._length = self._target = self._slack = NOTHING
        self._rising = np.zeros(0, np.bool_)
        self._earlier = np.zeros((0, 2), np.int64)
        self._beside = nothing_beside(self.n)
        self._active_mesh = self._edges_mesh = self._leaves_mesh = -1
        self._leaves = np.zeros((0, self.n + 1), np.int64), NOTHING
        self._hold(0)

    def _hold(self, passing: int) -> None:
        """Count the memory of the lists, and what making the next ones takes for a moment."""
        lists: list[NDArray[Any]] = [*self._leaves, *self._beside, *self._rows]
        lists += [self._numbers.first, self._numbers.vertex]
        lists += [v for v in vars(self).values() if isinstance(v, np.ndarray)]
        self._budget.hold(self, sum(array.nbytes for array in lists), passing)

    def numbers(self, st: State) -> Ranks:
        """Number the vertices known now: for geometry, for drawings, and for isovalues that lean on this one."""
        # vertices only become more, and in a copy of the store each has its place
        if len(self._numbers.vertex) != st.counters.vertices:
            self._numbers = numbers_of(st)._replace(known=self._numbers.known)
        return self._numbers._replace(known=st.known)

    def _numbers_bytes(self, st: State) -> int:
        """Bytes that numbers take of the vertices, and of those of the earlier isovalue."""
        return numbers_bytes(st) + (numbers_bytes(self._lean[1]()) if self._lean else 0)

    def bytes_to_list(self, st: State) -> int:
        """Bytes that `leaves` takes, 0 if they are listed already."""
        return drawn_bytes(st) if st.counters.meshes != self._leaves_mesh else 0

    def leaves(self, st: State) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Vertex numbers of the leaves of a mesh that is settled (``Tube.settled``), and their levels."""
        if st.counters.meshes != self._leaves_mesh:
            self._hold(drawn_bytes(st))
            self._leaves = drawn(st)
            self._leaves_mesh = int(st.counters.meshes)
            self._hold(0)
        return self._leaves

    def _activate(self, st: State, full: bool) -> None:
        """Find the vertices that geometry by values refines now, and the encoder's numbers for them."""
        count = int(st.counters.vertices)
        if full:
            order, active = in_order(st.vertex[:count, : self.n]), np.empty(count, np.int64)
            self._active = active[: carriers.grid_ends(st, carriers.linked(st, self.numbers(st)), order, active)].copy()
        else:
            active = np.unique(self.leaves(st)[0])
            self._active = active[in_order(st.vertex[active, : self.n])]
        self._active_mesh = int(st.counters.meshes)
        self._rows = no_rows()
        self._wanted = np.zeros(count if self.truth else 0, np.int64)
        if self.truth:
            above = st.vertex[self._active, 3] != 0
            self._wanted[self._active] = self.truth.number(st.vertex[self._active, : self.n], above)

    def value_bits(self, st: State, full: bool) -> tuple[int, int]:
        """Encoder: bits that the numbers of the present vertices need, above and below the isovalue."""
        self._activate(st, full)
        above = st.vertex[self._active, 3] != 0
        numbers = self._wanted[self._active]
        bits = [int(numbers[side].max(initial=0)).bit_length() for side in (above, ~above)]
        return bits[0], bits[1]

    def begin_values(self, st: State, full: bool, plane: int) -> None:
        """Begin a layer of geometry by values, down to ``plane`` missing bits."""
        count = int(st.counters.vertices)
        old = len(self.number)
        self._hold((_VALUES_TAKEN if self._lean else _VALUES) * count + self._numbers_bytes(st))
        if st.counters.meshes != self._active_mesh:
            self._activate(st, full)
        self._full = full
        if count > old:
            self.number = np.concatenate([self.number, np.zeros(count - old, np.int64)])
            bits = np.where(st.vertex[old:count, 3] != 0, *self.bits).astype(np.int64)
            self.left = np.concatenate([self.left, bits])
            self._take_values(st, old, count)
        if not self.has_values:
            # values place the crossings better than offsets did
            self.edges, self.parts, self.offset = np.zeros((0, 2), np.int64), NOTHING, NOTHING
        self.has_values = True
        st.value_bits[:] = self.bits[::-1]
        self._plane = plane
        self._hold(0)

    def _take_values(self, st: State, first: int, end: int) -> None:
        """Take what the earlier isovalue knows of the values of vertices ``first`` to ``end`` (spec clause 5.9.5)."""
        if self._lean is None or self._shift is None or not len(self._lean[0].number):
            return
        earlier, other = self._lean[0], self._lean[1]()
        vertex = np.empty(end - first, np.int64)
        enter_numbers_at(earlier.numbers(other), st.vertex[first:end, :3].astype(np.int64), vertex)
        known = np.flatnonzero((vertex >= 0) & (vertex < len(earlier.number)))
        stated = np.where(other.vertex[vertex[known], 3] != 0, *earlier.bits)
        known = known[earlier.left[vertex[known]] < stated]
        left = earlier.left[vertex[known]]
        low = earlier.number[vertex[known]] << left
        high = low + (1 << left) - 1
        # steps between the earlier isovalue and the value, then numbers on this one's side
        above = other.vertex[vertex[known], 3] != 0
        low, high = np.where(above, low + 1, -high), np.where(above, high + 1, -low)
        down, up = self._shift
        above = st.vertex[first + known, 3] != 0
        low, high = np.where(above, low - up - 1, down - high), np.where(above, high - down - 1, up - low)
        possible = np.maximum(np.abs(low), np.abs(high)) < MOST_TAKEN
        known, left, low, high = known[possible], left[possible], low[possible], high[possible]
        whole = (left == 0) & (low == high)
        self.number[first + known[whole]] = low[whole]
        self.left[first + known[whole]] = 0
        # the earlier isovalue may have had no values when the vertices before got their numbers
        fresh = end - len(self._least)
        self._least = np.concatenate([self._least, np.zeros(fresh, np.int64)])
        self._most = np.concatenate([self._most, np.full(fresh, UNBOUNDED)])
        self._least[first + known], self._most[first + known] = low, high

    def code_values(self, st: State, cd: Coder) -> int:
        """Go on with a layer of values."""
        if self._full and not len(self._rows.first):
            rows, blocks = counted(st, self._active)
            self._hold(rows_bytes(self.n, rows, blocks) + 8 * len(self._active))
            self._rows = rows_of_list(st, self._active, rows, blocks)
            self._told = np.empty(len(self._active) + 1, np.int64)
            values.enter_told(st, self._active, self.number, self.left, self._told)
            self._hold(0)
        nearby = Nearby(self._rows, self._told, self._least, self._most)
        return int(values.values(st, cd, nearby, self._active, self.number, self.left, self._plane, self._wanted))

    def begin_offsets(self, st: State, full: bool, parts: int, unit: int) -> None:
        """Begin a layer of offsets, to at least ``parts`` parts in ``2**unit`` samples of an edge."""
        self._pitch = (parts, unit)
        if st.counters.meshes != self._edges_mesh:
            self._list_edges(st, full)
        self._slack = self._at_edges(st, self.slack) if self.slack else np.zeros(len(self._target), np.int64)
        self._hold(0)

    def code_offsets(self, st: State, cd: Coder) -> int:
        """Go on with a layer of offsets."""
        crossings = Crossings(self.edges, self.offset, self.parts, self._length, self._rising, self._earlier)
        return int(offsets(st, cd, self._beside, crossings, *self._pitch, self._target, self._slack))

    def _list_edges(self, st: State, full: bool) -> None:
        """Make the list of edges that carry offsets anew; those that stay keep theirs."""
        count = int(st.counters.vertices)
        if full:
            self._hold((24 * self.n + 1) * count + self._numbers_bytes(st))
            order = in_order(st.vertex[:count, : self.n], block=EDGE_BLOCK[self.n])
            room = np.empty((self.n * count, 2), np.int64)
            links = carriers.linked(st, self.numbers(st))
            # a copy: the rest of the room is let go of
            edges = room[: carriers.grid_edges(st, links, order, room)].copy()
            del room, order
            self._hold(_EDGES_GRID * len(edges) + 16 * count + self._numbers_bytes(st))
        else:
            self._hold(_LEAVES[self.n] * len(self.leaves(st)[0]) + 64 * count + self._numbers_bytes(st))
            rows = self._leaf_rows(st)
            edges = self._leaf_edges(st, rows)
            edges = edges[in_order(*(st.vertex[edges[:, i], : self.n] for i in (0, 1)), block=EDGE_BLOCK[self.n])]
        parts, offset = np.ones(len(edges), np.int64), np.zeros(len(edges), np.int64)
        if len(self.edges):
            keys, old = edges @ (count, 1), self.edges @ (count, 1)
            order = np.argsort(old)
            there = order[np.minimum(np.searchsorted(old[order], keys), len(old) - 1)]
            same = old[there] == keys
            parts[same], offset[same] = self.parts[there[same]], self.offset[there[same]]
        self.edges, self.parts, self.offset = edges, parts, offset
        self._edges_mesh = int(st.counters.meshes)
        self._rising = st.vertex[edges[:, 1], 3] != 0
        if full:
            self._length = np.ones(len(edges), np.int64)
            self._beside = beside_grid(edges, links, offset, parts, self.n)
        else:
            self._length = np.abs(np.subtract(*self._ends(st))).max(axis=1, initial=0)
            self._beside = beside_leaves(st, self.numbers(st), rows, edges, offset, parts, self._length, self.n)
        self._earlier = self._earlier_offsets(st)
        self._target = self._at_edges(st, self.place) if self.place else NOTHING

    def _ends(self, st: State, some: slice = _ALL) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Positions of both ends of the edges."""
        low, high = (st.vertex[self.edges[some, i], : self.n].astype(np.int64) for i in (0, 1))
        return low, high

    def _at_edges(self, st: State, what: OfEdges) -> NDArray[np.int64]:
        """Make a number for each edge, for some edges at a time: it takes much memory for a moment."""
        out = np.empty(len(self.edges), np.int64)
        for first in range(0, len(out), _PIECE):
            some = slice(first, first + _PIECE)
            out[some] = what(*self._ends(st, some))
        return out

    def _earlier_offsets(self, st: State) -> NDArray[np.int64]:
        """Numbers and parts at the earlier isovalue, of edges between neighbouring samples; 0 parts where it has none.

        On longer edges the order of crossings is not certain: each isovalue may have several.
        """
        if self._lean is None or not len(self._lean[0].edges):
            return np.zeros((0, 2), np.int64)
        out = np.zeros((len(self.edges), 2), np.int64)
        earlier, other = self._lean[0], self._lean[1]()
        ends = np.empty((2, len(self.edges)), np.int64)
        numbers = earlier.numbers(other)
        for i in (0, 1):
            enter_numbers_at(numbers, st.vertex[self.edges[:, i], :3].astype(np.int64), ends[i])
        count = int(other.counters.vertices)
        wanted = np.where((ends >= 0).all(axis=0) & (self._length == 1), count * ends[0] + ends[1], -1)
        keys = earlier.edges @ (count, 1)
        order = np.argsort(keys)
        place = order[np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)]
        same = (keys[place] == wanted) & (earlier.parts[place] > 1)
        out[same, 0], out[same, 1] = earlier.offset[place[same]], earlier.parts[place[same]]
        return out

    def _leaf_rows(self, st: State) -> NDArray[np.int64]:
        """Crossed edges of the leaves, those with the lower sum of vertices first."""
        numbers, _ = self.leaves(st)
        total = st.vertex[numbers, : self.n].astype(np.int64).sum(axis=1)
        numbers = numbers[np.lexsort(total.T[::-1])]
        rows = np.empty((len(numbers) * (2 if self.n == 2 else 4), 2), np.int64)
        return rows[: carriers.leaf_edges(st, numbers, rows)]

    def _leaf_edges(self, st: State, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Each of them once, but for those that follow from others."""
        _, first = np.unique(rows @ (int(st.counters.vertices), 1), return_index=True)
        edges = rows[first]
        numbers, levels = self.leaves(st)
        position = st.vertex[: st.counters.vertices, : self.n].astype(np.int64)
        rank = np.ravel_multi_index(tuple(position.T), self.shape)
        above = st.vertex[: st.counters.vertices, 3] != 0
        implied = [i.edges for i in implied_edges(rank, position, above, numbers, levels)]
        if implied:
            weights = (int(st.counters.vertices), 1)
            edges = edges[~np.isin(edges @ weights, np.concatenate(implied) @ weights)]
        return edges
