"""Runs the passes over one isovalue's tubular neighbourhood: growth of arrays, order of layers, what they leave behind.

A layer is begun and then advanced; ``advance`` comes back when the layer is complete or when the coder
needs bytes. Encoder and decoder use it alike: they differ in the mode of the coder, and the encoder has the truth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..contour.leaves import Leaves
from ..entropy.coder import OVER, Coder
from ..errors import FormatError, LimitError
from ..jit import BAD, CUT, DONE, GROW
from ..limits import Limits
from ..mesh.store import grown, new_store
from ..mesh.tables import AXES, cube_exponent, mesh_tables
from . import base as base_pass
from . import geometry, leaves, refine, seek, significance
from .decoded import Decoded
from .state import (
    BASE_LEVEL,
    BEFORE_ROUND,
    COUNTERS,
    DONE_LEAVES,
    EDGE,
    ELEMENTS,
    ERROR,
    LAST,
    LEAVES,
    LEVEL,
    MOST_WORK,
    NEXT,
    SIZE,
    STEP_LEAVES,
    STEP_VERTICES,
    TALLY,
    VERTICES,
    State,
)  # fmt: skip

NOTHING = np.zeros(0, np.int64)
STACK = 4096
OUT_OF_STEPS = 5

_CLAUSES = {1: "5.3.2", 3: "5.3.3", 4: "5.5"}
_REASONS = {
    1: "a component starts in a simplex that does not exist or was visited before",
    3: "a component starts in a simplex that the curve does not cross",
    4: "a new component could not be placed",
}


@dataclass(frozen=True)
class Truth:
    """What the encoder knows: the field's signs, and the numbers that geometry sends.

    ``number(positions, above)`` gives the distances from the isovalue's side in steps, int64;
    ``crossing(positions, axis)`` the offsets of crossings as 30-bit binary fractions, int64.
    """

    signs: NDArray[np.bool_]
    number: Callable[..., NDArray[np.int64]]
    crossing: Callable[..., NDArray[np.int64]]


class Tube:
    """The tubular neighbourhood of one isovalue and all that is known of it.

    Parameters
    ----------
    shape : tuple of int
        Samples along each axis, 2 or 3 axes.
    coder : Coder
        Its mode decides the direction.
    limits : Limits
    truth : Truth, optional
        For the encoder.
    """

    def __init__(self, shape: tuple[int, ...], coder: Coder, limits: Limits, truth: Truth | None = None) -> None:
        self.shape = shape
        self.n = n = len(shape)
        self.k = cube_exponent(shape)
        self.coder = coder
        self.limits = limits
        self.truth = truth
        counters = np.zeros(COUNTERS, np.int64)
        counters[SIZE] = self.k
        counters[MOST_WORK] = limits.steps
        counters[LAST : LAST + n] = np.array(shape) - 1
        signs = truth.signs.reshape(truth.signs.shape + (1,) * (AXES - n)) if truth else np.zeros((0, 0, 0), np.bool_)
        self.state = State(
            mesh_tables(n), counters, new_store(n), np.zeros((64, 4), np.int32), np.zeros((64, 4), np.int32),
            np.zeros((64, 4), np.int32), signs, base_pass.registers(), np.zeros(STACK, np.int64),
        )  # fmt: skip
        self._mark = new_store(n)
        self._pyramid = (np.zeros(1, np.uint8), np.zeros((1, 4), np.int64))
        self._items = NOTHING
        self._busy = _busy(signs) if truth else np.zeros((1, 1, 1), np.bool_)
        self._running = ""
        self._plane = 0
        self._active = NOTHING
        self._active_level = -1
        self.has_values = False
        self.number = NOTHING
        self.left = NOTHING
        self._wanted = NOTHING
        self.bits_above = self.bits_below = 0
        self.edges = np.zeros((0, 2), np.int64)
        self.parts = 1
        self._radix = 1
        self._offset_layers = 0
        self.offset = NOTHING
        self._target = NOTHING

    # -- what the state says -------------------------------------------------------------------------------------

    @property
    def level(self) -> int:
        """Uniform level of the mesh; -1 before a base."""
        return int(self.state.at[LEVEL]) if self._begun else -1

    @property
    def full_level(self) -> int:
        """Level at which every sample is a vertex."""
        return self.n * self.k

    @property
    def running(self) -> str:
        """Name of the pass that is not complete, or the empty string."""
        return self._running

    @property
    def _begun(self) -> bool:
        return bool(self.state.at[EDGE])

    def tally(self) -> NDArray[np.int64]:
        """Symbols by syntax element so far, then predictions and right ones."""
        return self.state.at[TALLY : TALLY + len(ELEMENTS) + 2].copy()

    # -- layers --------------------------------------------------------------------------------------------------

    def begin_base(self, level: int) -> None:
        """Begin the base at a uniform level, 0 to ``full_level``."""
        st = self.state
        st.at[LEVEL] = st.at[BASE_LEVEL] = level
        st.at[EDGE] = 1 << (self.k - level // self.n)
        if self.truth:
            self._pyramid = seek.build_pyramid(st.truth, st.at[LAST : LAST + AXES], self.k, level, self.n)
        self._running = "base"

    def begin_round(self) -> None:
        """Begin a round of refinement, to the next level."""
        self._fresh()
        if self.truth:
            found = np.empty(1024, np.int64)
            count = significance.find(self.state, self._busy, found)
            if count > len(found):
                found = np.empty(count, np.int64)
                significance.find(self.state, self._busy, found)
            self._items = np.sort(found[:count])
        self._running = "significance"

    def _activate(self) -> None:
        """Find the vertices that geometry by values refines now, and the encoder's numbers for them."""
        st = self.state
        count = int(st.at[VERTICES])
        active = np.empty(count, np.int64)
        used = geometry.active_vertices(st, np.zeros(count, np.uint8), self.level == self.full_level, active)
        self._active = active[:used]
        self._active_level = self.level
        self._wanted = np.zeros(count if self.truth else 0, np.int64)
        if self.truth:
            above = st.vertex[self._active, 3] != 0
            self._wanted[self._active] = self.truth.number(st.vertex[self._active, : self.n], above)

    def value_bits(self) -> tuple[int, int]:
        """Encoder: bits that the numbers of the present vertices need, above and below the isovalue."""
        self._activate()
        above = self.state.vertex[self._active, 3] != 0
        numbers = self._wanted[self._active]
        bits = [int(numbers[side].max(initial=0)).bit_length() for side in (above, ~above)]
        return bits[0], bits[1]

    def begin_values(self, plane: int) -> None:
        """Begin a layer of geometry by values, down to ``plane`` missing bits."""
        st = self.state
        count = int(st.at[VERTICES])
        old = len(self.number)
        if self.level != self._active_level:
            self._activate()
        if count > old:
            self.number = np.concatenate([self.number, np.zeros(count - old, np.int64)])
            bits = np.where(st.vertex[old:count, 3] != 0, self.bits_above, self.bits_below).astype(np.int64)
            self.left = np.concatenate([self.left, bits])
        self.has_values = True
        self._plane = plane
        self._fresh()
        self._running = "values"

    def begin_offsets(self, parts: int) -> None:
        """Begin a layer of offsets, to ``parts`` parts of an edge; the mesh is the full grid."""
        st = self.state
        self._radix = parts // self.parts
        if self._offset_layers == 0:
            count = int(st.at[VERTICES])
            edges = np.empty((self.n * count, 2), np.int64)
            used = geometry.crossed_edges(st, np.zeros(count, np.uint8), edges)
            self.edges = edges[:used]
            self.offset = np.zeros(len(self.edges), np.int64)
            if self.truth:
                positions = st.vertex[self.edges[:, 0], : self.n]
                self._target = self.truth.crossing(positions, self.edges[:, 1])
        self._fresh()
        self._running = "offsets"

    def _fresh(self) -> None:
        self.state.walk[:] = 0
        self._items = NOTHING

    def advance(self) -> int:
        """Go on with the layer begun: ``DONE``, ``NEED`` (bytes or room for them) or ``CUT``."""
        while True:
            status = self._kernel()
            if status == GROW:
                self._grow()
            elif status == BAD:
                number = int(self.state.at[ERROR])
                if number == OUT_OF_STEPS:
                    raise LimitError(
                        f"inferring signs takes more than {self.limits.steps} steps", code="limit-steps", clause="11.2"
                    )
                raise FormatError(_REASONS[number], code="stream", clause=_CLAUSES[number])
            elif status == DONE:
                if self._finish():
                    return DONE
            else:
                if status != CUT and self.coder.reg[OVER]:
                    raise FormatError("symbols go on past the end of their run", code="overrun", clause="6.3")
                return int(status)

    def _kernel(self) -> int:
        st, cd = self.state, self.coder
        match self._running:
            case "base":
                return base_pass.base(st, cd, self._mark, *self._pyramid)
            case "significance":
                return significance.significance(st, cd, self._items)
            case "refinement":
                return refine.refine(st, cd)
            case "values":
                return geometry.values(st, cd, self._active, self.number, self.left, self._plane, self._wanted)
            case _:
                return geometry.offsets(
                    st, cd, self.offset, self._offset_layers, self.parts, self._radix, self._target
                )

    def _finish(self) -> bool:
        """End of a pass; False if the layer has another one."""
        at = self.state.at
        match self._running:
            case "base":
                self._mark = new_store(self.n)
                at[BEFORE_ROUND] = at[VERTICES]
            case "significance":
                self._fresh()
                self._running = "refinement"
                return False
            case "refinement":
                st = self.state
                self.state = st._replace(leaf=st.below, below=st.leaf)
                at[LEAVES] = at[NEXT]
                at[NEXT] = at[DONE_LEAVES] = 0
                at[BEFORE_ROUND] = at[VERTICES]
                at[LEVEL] += 1
                at[EDGE] = 1 << (self.k - int(at[LEVEL]) // self.n)
            case "offsets":
                self.parts *= self._radix
                self._offset_layers += 1
        self._running = ""
        return True

    def _grow(self) -> None:
        st = self.state
        at = st.at
        if at[VERTICES] + STEP_VERTICES > self.limits.vertices:
            raise LimitError(
                f"more than {self.limits.vertices} vertices", code="limit-vertices", clause="11.2",
                remedy="raise Limits.vertices if the file is trusted",
            )  # fmt: skip
        if max(at[LEAVES], at[NEXT]) + STEP_LEAVES > self.limits.simplices:
            raise LimitError(
                f"more than {self.limits.simplices} simplices", code="limit-simplices", clause="11.2",
                remedy="raise Limits.simplices if the file is trusted",
            )  # fmt: skip
        stack = st.stack
        if self._running == "base":
            self._mark = grown(self._mark, STEP_VERTICES)
            if (self.state.walk[base_pass.GATES] + 128) * base_pass.GATE > len(stack):
                stack = _wider(stack, 2 * len(stack))
        self.state = st._replace(
            known=grown(st.known, STEP_VERTICES),
            vertex=_room(st.vertex, int(at[VERTICES]) + STEP_VERTICES),
            leaf=_room(st.leaf, int(at[LEAVES]) + STEP_LEAVES),
            below=_room(st.below, int(at[NEXT]) + STEP_LEAVES),
            stack=stack,
        )

    # -- the state and the drawing -------------------------------------------------------------------------------

    def _edge_parts(self) -> NDArray[np.int64]:
        """Parts that each edge is divided into."""
        parts = np.full(len(self.edges), self.parts)
        if self._running == "offsets":
            parts[: int(self.state.walk[geometry.ITEM])] *= self._radix
        return parts

    def decoded(self) -> Decoded:
        """All that is known, in canonical order."""
        st = self.state
        count = int(st.at[VERTICES])
        position = st.vertex[:count, : self.n].astype(np.int64)
        order = np.lexsort(position.T[::-1])
        missing = np.full(count, -1, np.int64)
        number = np.zeros(count, np.int64)
        missing[: len(self.left)] = self.left
        number[: len(self.number)] = self.number
        ends, axis = position[self.edges[:, 0]], self.edges[:, 1]
        edge_order = np.lexsort((axis, *ends.T[::-1]))
        parts = self._edge_parts()
        sent = edge_order[parts[edge_order] > 1]
        return Decoded(
            self.shape, -1 if self._running == "base" else self.level, position[order], st.vertex[order, 3] != 0,
            missing[order], number[order], ends[sent], axis[sent], parts[sent], self.offset[sent],
        )  # fmt: skip

    def leaves(self, isovalue: float, value_of: Callable[..., NDArray[np.float64]]) -> Leaves:
        """All that the drawing needs; ``value_of(number, above)`` turns numbers of steps into field values."""
        st = self.state
        at = st.at
        count = int(at[VERTICES])
        rows = np.empty((int(at[LEAVES]) + int(at[NEXT]), self.n + 1), np.int64)
        used = 0
        if self._begun:
            used = leaves.vertex_numbers(st, st.leaf, at[DONE_LEAVES], at[LEAVES], 0, rows)
            used += leaves.vertex_numbers(st, st.below, 0, at[NEXT], 1, rows[used:])
        above = st.vertex[:count, 3] != 0
        value = None
        if self.has_values:
            value = np.full(count, np.nan)
            known = len(self.number)
            some = self.left < np.where(above[:known], self.bits_above, self.bits_below)
            some |= self.left == 0
            middle = np.ldexp(self.number + 0.5, self.left) - 0.5
            value[:known] = np.where(some, value_of(middle, above[:known]), np.nan)
        full = self._begun and self._running != "base" and self.level == self.full_level
        parts = self._edge_parts()
        sent = parts > 1
        return Leaves(
            shape=self.shape,
            isovalue=isovalue,
            position=st.vertex[:count, : self.n].astype(np.int64),
            above=above,
            value=value,
            simplices=rows[:used],
            full=full,
            edge_vertex=self.edges[sent, 0],
            edge_axis=self.edges[sent, 1],
            edge_offset=(self.offset[sent] + 0.5) / parts[sent],
        )


def _busy(signs: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Blocks of the field that the curve passes, with their neighbours."""
    blocks = tuple(((s - 1) >> significance.BLOCK) + 1 for s in signs.shape)
    busy = np.zeros(blocks, np.bool_)
    significance.busy_blocks(signs, np.zeros(blocks, np.uint8), busy)
    return busy


def _room(array: NDArray, needed: int) -> NDArray:
    return array if needed <= len(array) else _wider(array, max(2 * len(array), needed))


def _wider(array: NDArray, size: int) -> NDArray:
    out = np.zeros((size, *array.shape[1:]), array.dtype)
    out[: len(array)] = array
    return out
