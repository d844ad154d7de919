"""State of an isovalue on an explicit complex, and the layers that code it (spec clause 10.1.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..entropy.context_layout import take_over
from ..entropy.run import Account, ReadingRun, Run, WritingRun, whole_run
from ..field.samples import MAX_NUMBER, steps_above
from .before import UNKNOWN, spread_signs
from .complex import Complex, part_of
from .cut import CellHistory, cut_of, wanted_by
from .cut_signs import Cut, code_cut
from .hierarchy import Hierarchy
from .levels import coarse_signs, code_round, estimates_of
from .models import NUMBERS, SHIFTS, new_coder
from .positions import (
    LARGEST,
    PLACE,
    active_vertices,
    code_offsets,
    code_values,
    crossed_edges,
    parts_of,
)
from .ring_fit import RingEstimates
from .walk import REASONS, WalkRegisters, WalkState, code_base, code_parts, trace


class _Then(NamedTuple):
    """Geometry of the frame before, or of another isovalue.

    ``key``, ``place`` (E,): crossed edges, ascending, lower vertex times V and the other one, and where they were
    crossed; ``number`` (V,): twice the numbers of vertices, and 1, negative below, 0 if not known; or empty.
    """

    key: NDArray[np.int64]
    place: NDArray[np.int64]
    number: NDArray[np.int64]

    def places(self, edges: NDArray[np.int64], vertices: int) -> NDArray[np.int64]:
        """Crossings of edges, (E,); 0 for those that were not crossed."""
        if not len(self.key):
            return np.zeros(len(edges), np.int64)
        wanted = edges[:, 0] * np.int64(vertices) + edges[:, 1]
        at = np.minimum(np.searchsorted(self.key, wanted), len(self.key) - 1)
        return np.where(self.key[at] == wanted, self.place[at], np.int64(0))

    def numbers(self, vertices: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of vertices; 0 where unknown."""
        return self.number[vertices] if len(self.number) else np.zeros(len(vertices), np.int64)


def _then_of(before: MeshIsovalue, vertices: int) -> _Then:
    """Geometry of an isovalue, for predicting the next frame, or another isovalue."""
    key = place = number = np.zeros(0, np.int64)
    if before.edges is not None and before.parts is not None and before.number is not None:
        key = before.edges[:, 0] * np.int64(vertices) + before.edges[:, 1]
        order = np.argsort(key)
        place = np.clip(((2 * before.number + 1) << PLACE) // (2 * before.parts), 1, (1 << PLACE) - 1)
        key, place = key[order], place[order]
    if before.active is not None and before.steps is not None:
        number = np.zeros(vertices, np.int64)
        twice = 2 * np.minimum(before.steps, LARGEST) + 1
        number[before.active[:, 0]] = np.where(before.strand.sign[before.active[:, 0]] == 1, twice, -twice)
    return _Then(key, place, number)


class MeshIsovalue:
    """State of an isovalue.

    Parameters
    ----------
    domain : Complex
        The whole mesh.
    value : float
    scale : float or None
        Step of numbers of values; None for integers.
    earlier : sequence of MeshIsovalue
        Isovalues that it is predicted from, the nearest first.
    before : MeshIsovalue, optional
        Instead of these, the same isovalue of the previous frame.

    Attributes
    ----------
    domain : Complex
        The mesh that the curve lies on, or the cells of a cut of it.
    strand : WalkState
    run : Run
        Run of the current layer, from `read` or `write`.
    rounds : int or None
        Rounds of the hierarchy that are still collapsed, for signs coded level by level.
    cut : (N,) bool or None
        Nodes of the hierarchy that have come back, in layers of a cut.
    edges : (E, 3) int64 or None
        Crossed edges, when the signs are known: both ends, and the leaf that has it first.
    parts, number : (E,) int64 or None
        Offsets: parts of the edges, and the crossed ones.
    near : (V,) int64 or None
        Offsets: values at vertices, right up to a factor; 0 where unknown.
    active, steps : (A, 2), (A,) int64 or None
        Values: vertices with the leaf of each, and their numbers.
    """

    def __init__(
        self, domain: Complex, value: float, scale: float | None = None, earlier: Sequence[MeshIsovalue] = (),
        before: MeshIsovalue | None = None,
    ) -> None:
        self.domain, self.value, self.scale = domain, value, scale
        self._earlier = earlier
        leant = before or (earlier[0] if earlier else None)
        self._coder = new_coder()
        if leant is not None:
            take_over(self._coder, leant._coder)
        self.run: Run
        mesh = domain.mesh
        vertices, (cells, corners) = len(mesh.position), mesh.cell.shape
        unknown = np.full(vertices, UNKNOWN, np.int8)
        self.strand = WalkState(
            unknown, _implied(unknown, value, earlier), unknown.copy(), np.zeros(vertices, np.int64),
            np.zeros(cells, np.bool_), np.zeros(cells, np.int64), np.zeros((corners - 1) * cells + 8, np.int64),
            np.zeros(NUMBERS, np.int64), unknown.copy(), np.zeros(4, np.int64), np.zeros(2, np.int64), WalkRegisters(),
        )
        self.rounds: int | None = None
        self._whole = domain
        self._cut: Cut | None = None
        self._estimates: RingEstimates | None = None
        self.edges: NDArray[np.int64] | None = None
        self.parts: NDArray[np.int64] | None = None
        self.number: NDArray[np.int64] | None = None
        self.near: NDArray[np.int64] | None = None
        self.active: NDArray[np.int64] | None = None
        self.steps: NDArray[np.int64] | None = None
        self._then = _Then(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64))
        if before is not None:
            self.strand.reg.leans = 1
            if before.edges is not None:
                self.strand.before[:] = before.strand.sign
                if before.cut is None:
                    spread_signs(mesh, self.strand.before, np.zeros(vertices, np.int64))
                self._then = _then_of(before, vertices)

    @staticmethod
    def bytes_for(domain: Complex) -> int:
        """Memory of an isovalue, in bytes."""
        vertices, (cells, corners) = len(domain.mesh.position), domain.mesh.cell.shape
        return vertices * 68 + cells * (9 + 8 * (corners - 1))

    @staticmethod
    def bytes_of_cut(domain: Complex) -> int:
        """Additional memory of an isovalue with a layer of a cut, in bytes."""
        vertices, (cells, corners) = len(domain.mesh.position), domain.mesh.cell.shape
        return 80 * vertices + 32 * corners * cells

    @property
    def cut(self) -> NDArray[np.bool_] | None:
        """See the class."""
        return None if self._cut is None else self._cut.inside

    @property
    def leaves(self) -> NDArray[np.int64]:
        """Crossed cells in their order."""
        return self.strand.leaf[: self.strand.reg.leaves]

    def read(self, data: bytes, at: int, account: Account) -> ReadingRun:
        """Begin to decode a layer, whose run is ``data`` and lies at ``at`` in the file; `ReadingRun.end` ends it.

        Raises
        ------
        LimitError
            If the account allows no more symbols.
        """
        self.run = run = whole_run(self._coder, data, account, at)
        return run

    def write(self) -> WritingRun:
        """Begin to encode a layer; `WritingRun.end` gives its bytes."""
        self.run = run = WritingRun(self._coder)
        return run

    def code_signs(self, truth: NDArray[np.bool_] | None = None) -> None:
        """Code which vertices lie above; ``truth`` (V,) is the encoder's."""
        mesh = self.domain.mesh
        if truth is not None:
            self.strand.truth[:] = truth
        self.run.room(2 * len(mesh.position) + 2 * len(mesh.cell))
        status = code_base(mesh, self.strand, self.run.coder)
        self.run.check(status, REASONS, self.strand.reg.error)
        sign, queue = self.strand.sign.copy(), np.zeros(len(mesh.position), np.int64)
        spread_signs(mesh, sign, queue)
        self.run.check(code_parts(mesh, self.strand, self.run.coder, sign, queue))
        self.edges = crossed_edges(mesh, self.leaves, self.strand.sign)

    def code_levels(self, hierarchy: Hierarchy, rounds: int, truth: NDArray[np.bool_] | None = None) -> None:
        """Code which vertices lie above, among those present while ``rounds`` rounds are still collapsed.

        Vertices of earlier layers are known. ``truth`` as in `code_signs`.
        """
        mesh, run = self.domain.mesh, self.run
        if truth is not None:
            self.strand.truth[:] = truth
        run.room(4 * len(mesh.position) + 64)
        if self.rounds is None or self._estimates is None:
            self._estimates = estimates_of(hierarchy.position, hierarchy.cell.shape[1])
            run.check(coarse_signs(hierarchy.cells(rounds), self._estimates, self.strand, run.coder))
        else:
            for back in reversed(hierarchy.rounds[rounds : self.rounds]):
                room = np.zeros((3, len(back.vertex) + 128), np.int64)
                run.check(code_round(self._estimates, self.strand, run.coder, back.vertex, back.target, back.first,
                                     back.face, room))
        self.rounds = rounds
        if rounds == 0:
            self._estimates = None
            trace(mesh, self.strand, run.coder)
            self.edges = crossed_edges(mesh, self.leaves, self.strand.sign)

    def code_cut(
        self, history: CellHistory, wanted: NDArray[np.bool_] | None = None, truth: NDArray[np.bool_] | None = None
    ) -> None:
        """Code which vertices return to a cut, and their signs; in the first layer also the signs of the coarsest mesh.

        An encoder gives the nodes ``wanted`` (N,) in the cut, to which those they need are added, while those that
        neither change the contour nor are needed stay out; and ``truth`` (V,) as in `code_signs`.
        """
        run, st = self.run, self.strand
        if truth is not None:
            st.truth[:] = truth
        run.room(6 * len(st.sign) + 64)
        if self._cut is None or self._estimates is None:
            self._cut = cut_of(history)
            self._estimates = estimates_of(history.position, history.cell.shape[1])
            left = history.real(self._cut.inside)[0]
            run.check(coarse_signs(left, self._estimates, st, run.coder))
        if wanted is not None and truth is not None:
            wanted_by(history, self._cut, wanted, truth)
        run.check(code_cut(self._estimates, st, run.coder, self._cut))
        self.domain = mesh = part_of(self._whole, *history.real(self._cut.inside))
        st.visited[:] = False
        st.reg.leaves = 0
        trace(mesh.mesh, st, run.coder)
        self.edges = crossed_edges(mesh.mesh, self.leaves, st.sign)
        # the geometry of the cut before
        self.parts = self.number = self.near = self.active = self.steps = None

    def code_offsets(self, step: int, number: NDArray[np.int64] | None = None) -> None:
        """Code which part of each edge is crossed."""
        assert self.edges is not None
        parts = parts_of(self.domain.mesh, self.edges, step)
        found = np.zeros(len(parts), np.int64) if number is None else number.copy()
        vertices, first = len(self.strand.sign), self.edges[:, 0]
        then = self._then.places(self.edges, vertices)
        then[self.strand.before[first] != self.strand.sign[first]] = 0
        near = shift = np.zeros(0, np.int64)
        for one in self._earlier:
            if one.near is not None:
                near, shift = one.near, np.zeros(vertices, np.int64)
                then = _then_of(one, vertices).places(self.edges, vertices)
                break
        self.strand.estimate[:] = 0
        self.strand.drift[:] = 0
        self.run.room(25 * len(parts))
        self.run.check(code_offsets(
            self.domain.mesh, self.strand, self.run.coder, self.edges, parts, found, then, near, shift
        ))
        self.parts, self.number, self.near = parts, found, self.strand.estimate.copy()

    def code_values(self, bits: tuple[int, int], number: NDArray[np.int64] | None = None) -> None:
        """Code the numbers of the vertices next to the curve, with ``bits`` below and above."""
        assert self.edges is not None
        active = active_vertices(self.edges)
        found = np.zeros(len(active), np.int64) if number is None else number.copy()
        least, higher = self._bounds()
        self.strand.estimate[:] = 0
        self.strand.spread[:] = 0
        self.strand.drift[:] = 0
        self.run.room(52 * len(active))
        self.run.check(code_values(
            self.domain.mesh, self.strand, self.run.coder, active, np.array(bits, np.int64), found,
            self._then.numbers(active[:, 0]), least[active[:, 0]], higher[active[:, 0]],
        ))
        self.active, self.steps = active, found

    def _bounds(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Bound the numbers of vertices by those at earlier isovalues.

        Returns the least possible number of each vertex, (V,), -1 where nothing is known; and where the number may also
        be greater by 1, the class of the part of a step between both isovalues, else -1.
        """
        sign = self.strand.sign
        least, most = np.full(len(sign), -1, np.int64), np.full(len(sign), MAX_NUMBER, np.int64)
        higher = np.zeros(len(sign), np.int64)
        for one in self._earlier:
            steps = steps_above(self.value, one.value, self.scale)
            if one.active is None or one.steps is None or abs(steps) > MAX_NUMBER - 1:
                continue
            down, up = math.floor(steps), math.ceil(steps)
            v = one.active[:, 0]
            end = np.where(one.strand.sign[v] == 1, one.steps + 1, -one.steps)
            above = sign[v] == 1
            low = np.clip(np.where(above, end - up - 1, down - end), 0, MAX_NUMBER - 1)
            high = np.clip(np.where(above, end - down - 1, up - end), 0, MAX_NUMBER - 1)
            apart = (high < least[v]) | (low > most[v])
            higher[v] = np.where(apart | (least[v] < 0), math.floor((steps - down) * SHIFTS), higher[v])
            least[v] = np.where(apart, low, np.maximum(low, least[v]))
            most[v] = np.where(apart, high, np.minimum(high, most[v]))
        higher[least == most] = -1
        return least, higher


def _implied(unknown: NDArray[np.int8], value: float, earlier: Sequence[MeshIsovalue]) -> NDArray[np.int8]:
    """Signs that follow from the order of isovalues."""
    given = unknown.copy()
    for one in earlier:
        sign = one.strand.sign
        if one.value > value:
            given[sign == 1] = 1
        else:
            given[sign == 0] = 0
    return given
