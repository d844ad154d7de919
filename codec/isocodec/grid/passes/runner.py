"""Runs the passes over one isovalue's tubular neighbourhood: order of layers, what they leave behind.

A layer is begun and then advanced; ``advance`` comes back when the layer is complete or when the coder
needs bytes. Encoder and decoder use it alike: they differ in the mode of the coder, and the encoder has the truth.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from copy import copy

import numpy as np
from numpy.typing import NDArray

from ...entropy.context_layout import put_away
from ...entropy.mixer import mixing
from ...entropy.range_coder import Coder
from ...errors import FormatError, LimitError
from ...kernel import BAD, DONE, GROW, NEED, SPENT
from ...limits import Budget, Limits
from ..lattice.order import COUNTS, in_order
from ..lattice.store import PAGES, copied, get, new_store, size_of
from ..lattice.tables import cube_exponent
from ..lattice.vertex_set import IN, Chosen, finest_level
from ..tube.capacity import (
    NOTHING,
    at_rest,
    first_state,
    no_numbers,
    no_store,
    state_bytes,
    wider_state,
    without_rounds,
)
from ..tube.holes import Holes
from ..tube.leaf_list import one_by_one
from ..tube.ranks import Ranks
from ..tube.softened import softened
from ..tube.state import (
    FRAME,
    KNOWN,
    OUT_OF_STEPS,
    State,
    numbers_bytes,
)
from ..tube.truth import Truth
from . import base as base_pass
from . import new_components, refinement
from .geometry import Estimates

_SEED, _MIDDLE = 200, 36
"""Most bytes that sorting takes of a leaf at which a base begins, and of a middle."""
_SHARED, _FEW = {2: 3, 3: 6}, 64
"""Leaves that nearly always share a middle, in halves; middles that there is room for in any case."""
_REASONS = {
    base_pass.NO_START: ("5.3.2", "a component starts in a simplex that does not exist or was visited before"),
    base_pass.NOT_CROSSED: ("5.3.3", "a component starts in a simplex that the curve does not cross"),
    new_components.UNPLACED: ("5.5", "a new component could not be placed"),
    refinement.TORN: ("5.4.3", "two diamonds give a corner different signs"),
}
"""Clause and message of each error of a pass."""


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
    lean : Tube, optional
        That of an earlier isovalue of the same field, which this one leans on (spec clause 5.9), or of an earlier frame
        (5.11).
    shift : (int, int), optional
        How many steps above that isovalue this one lies, rounded down and up; None if values of the one do not bound
        the other.
    side : int
        1 if it lies above that isovalue, -1 if below; ``FRAME`` if that is one of an earlier frame.
    holes : Holes, optional
        The mask of missing samples, complete (spec clause 5.10).
    budget : Budget, optional
        To which the memory of the state is counted; one without a limit if not given.
    shares : bool
        Whether the models are those of another tube, which counts their memory.
    """

    def __init__(
        self, shape: tuple[int, ...], coder: Coder, limits: Limits, truth: Truth | None = None, *,
        lean: Tube | None = None, shift: tuple[int, int] | None = None, side: int = 0, holes: Holes | None = None,
        budget: Budget | None = None, shares: bool = False,
    ) -> None:
        self.shape = shape
        self.n = n = len(shape)
        self.k = cube_exponent(shape)
        self.coder = coder
        self.limits = limits
        self.truth = truth
        earlier = lean.state if lean else None
        signs, hole = truth.padded if truth else None, holes.lean if holes else None
        self.state: State = first_state(shape, limits, signs, earlier, shift or (0, 0), side, hole)
        self.lean = lean
        self.holes = holes
        self._shares = shares
        self._shift = shift
        self._mark = new_store(n)
        self._order = NOTHING
        self._seeds = np.zeros((0, 5), np.int32)
        self._births = False
        self._finest = -1
        self._items = NOTHING
        self._running = ""
        told = (lean.estimates, lambda: lean.state) if lean and side != FRAME else None
        self.budget = budget or Budget(sys.maxsize)
        self.estimates: Estimates = Estimates(shape, truth, told, shift, self.budget)
        self._hold(state_bytes(self.state, self._mark), 0)

    # -- queries of the state ------------------------------------------------------------------------------------

    @property
    def level(self) -> int:
        """Level up to which the mesh is uniform; -1 before a base."""
        return int(self.state.counters.uniform) if self.begun else -1

    @property
    def full_level(self) -> int:
        """Level at which every sample is a vertex."""
        return self.n * self.k

    @property
    def vertices(self) -> int:
        """Known vertices."""
        return int(self.state.counters.vertices)

    @property
    def numbers(self) -> Ranks:
        """Numbers of the vertices known now, for isovalues that lean on this one."""
        return self.estimates.numbers(self.state)

    @property
    def origin_above(self) -> bool | None:
        """Sign of the first sample, if it is known."""
        entry = get(self.state.known, 0, 0, 0)
        return bool(entry & 1) if entry else None

    @property
    def simplices(self) -> int:
        """Leaves of the mesh."""
        return int(self.state.counters.held)

    @property
    def steps(self) -> int:
        """Steps of inference (spec clause 11.2)."""
        return int(self.state.counters.work)

    @property
    def running(self) -> str:
        """Name of the pass that is not complete, or the empty string."""
        return self._running

    @property
    def settled(self) -> bool:
        """Whether the mesh stays as it is: no base or round is running."""
        return self._running in ("", "values", "offsets")

    @property
    def full(self) -> bool:
        """Whether the mesh is the full grid."""
        return self._running not in ("base",) and self.level == self.full_level

    @property
    def begun(self) -> bool:
        """Whether a base has begun."""
        return bool(self.state.counters.edge)

    @property
    def follows(self) -> bool:
        """Whether nothing has come yet of an isovalue that leans on one of the frame before."""
        return self.lean is not None and self.state.counters.side == FRAME and not self.begun

    def tally(self) -> NDArray[np.int64]:
        """Symbols by syntax element so far, then predictions and right ones."""
        return self.state.tally.copy()

    # -- layers --------------------------------------------------------------------------------------------------

    def choose(self, chosen: Chosen) -> None:
        """Encoder: the mesh that the next adaptive layer leads to; those of earlier layers are parts of it."""
        self.state = self.state._replace(chosen=chosen)
        self._finest = finest_level(chosen, self.k, self.n)

    def begin_base(self, level: int, adaptive: bool = False) -> None:
        """Begin a base at a uniform level, 0 to ``full_level``, or an adaptive one that has at least that level."""
        if self.follows and mixing(self.coder):
            self._hold(state_bytes(self.state, self._mark), size_of(self.state.lean.known).bytes(self.state.lean.known))
            self.state = self.state._replace(soft=softened(self.state.lean))
        counters = self.state.counters
        counters.level = counters.base_level = counters.uniform = level
        counters.finest = self.full_level if adaptive else level
        counters.adapted = adaptive
        counters.edge = 1 << (self.k - level // self.n)
        if self.truth:
            self._order = self.truth.mixed_leaves(self.state, self.full_level if adaptive else level)
        self._running = "base"

    def begin_leaf_base(self) -> None:
        """Begin a base on the mesh of the isovalue that this one leans on, at its leaves."""
        assert self.lean is not None
        earlier = self.lean.state
        counters = self.state.counters
        mesh = size_of(earlier.mesh).bytes(earlier.mesh)
        self._hold(state_bytes(self.state, self._mark) + mesh, _SEED * self.lean.simplices)
        self.state = self.state._replace(mesh=copied(earlier.mesh, IN))
        counters.told = counters.seeded = 1
        self._seeds = in_order_of_middles(earlier, one_by_one(earlier))
        self.begin_base(self.lean.level, adaptive=bool(earlier.counters.adapted))

    def begin_round(self) -> None:
        """Begin a uniform round of refinement: all leaves of the uniform level are bisected."""
        self.state.counters.asks = 0
        self._births = True
        self._begin_significance()

    def begin_adapt(self, births: bool) -> None:
        """Begin an adaptive layer of refinement; with ``births`` new components may come in it."""
        st = self.state
        st.counters.asks = st.counters.adapted = 1
        st.mesh.pages[: st.mesh.head[PAGES]] &= IN
        self._births = births
        self._begin_question()

    def _begin_question(self) -> None:
        self._fresh()
        self._running = "continue"

    def _begin_significance(self) -> None:
        self._fresh()
        if self.truth:
            self._items = self.truth.new_components(self.state)
        self._running = "significance"

    def value_bits(self) -> tuple[int, int]:
        """Encoder: bits that the numbers of the present vertices need, above and below the isovalue."""
        return self.estimates.value_bits(self.state, self.full)

    def begin_values(self, plane: int) -> None:
        """Begin a layer of geometry by values, down to ``plane`` missing bits."""
        self.estimates.begin_values(self.state, self.full, plane)
        self._fresh()
        self._running = "values"

    def begin_offsets(self, parts: int, unit: int) -> None:
        """Begin a layer of offsets, to at least ``parts`` parts in ``2**unit`` samples of an edge."""
        self.estimates.begin_offsets(self.state, self.full, parts, unit)
        self._fresh()
        self._running = "offsets"

    def _fresh(self) -> None:
        st = self.state
        for walk in (st.refinement, st.tree, st.value, st.digit):
            walk.clear()
        for array in (st.trail, st.candidates, st.window):
            array[:] = 0
        self._items = NOTHING

    def advance(self) -> int:
        """Go on with the layer begun: ``DONE``, ``NEED`` (bytes or room for them) or ``SPENT``."""
        if self.lean is not None:
            earlier, told = self.lean, self.lean.estimates
            known = self._shift is not None and told.has_values
            sent, left = (told.number, told.left) if known else (NOTHING, NOTHING)
            self.state = self.state._replace(lean=self.state.lean._replace(
                known=earlier.state.known, mesh=earlier.state.mesh, number=sent, left=left,
                numbers=earlier.numbers if known else no_numbers(self.n),
            ))
        while True:
            status = self._kernel()
            counters = self.state.counters
            if status in (NEED, SPENT):
                counters.work = counters.step_work
            counters.step_work = counters.work
            number = int(counters.error)
            tired = self.lean is not None and self.lean.state.counters.work >= self.limits.steps
            if tired or (status == BAD and number == OUT_OF_STEPS):
                raise out_of_steps(self.limits)
            if status == GROW:
                self._grow()
            elif status == BAD:
                clause, reason = _REASONS[number]
                raise FormatError(reason, code="stream", clause=clause)
            elif status == DONE:
                if self._finish():
                    return DONE
            else:
                if status != SPENT and self.coder.reg.over:
                    raise FormatError("symbols go on past the end of their run", code="overrun", clause="6.3")
                return int(status)

    def _kernel(self) -> int:
        match self._running:
            case "base":
                return self._call(base_pass.base, self._mark, self._order, self._seeds)
            case "continue":
                return self._call(refinement.go_on, np.int64(self.truth is not None and self._more()))
            case "significance":
                return self._call(new_components.significance, self._items)
            case "refinement":
                return self._call(refinement.refine)
            case "values":
                return self.estimates.code_values(self.state, self.coder)
            case "offsets":
                return self.estimates.code_offsets(self.state, self.coder)
            case other:
                raise AssertionError(f"no kernel for the pass {other!r}")

    def _call(self, kernel: Callable[..., int], *further: object) -> int:
        return kernel(self.state, self.coder, *further)

    def _more(self) -> bool:
        """Encoder: whether an adaptive layer has anything to do on this level or a finer one."""
        counters = self.state.counters
        return bool(self._births and counters.level <= self._finest) or refinement.pending(self.state)

    def _finish(self) -> bool:
        """End of a pass; False if the layer has another one."""
        counters = self.state.counters
        match self._running:
            case "base":
                self._mark = new_store(self.n)
                self._order = NOTHING
                self._seeds = self._seeds[:0]
                counters.told = counters.seeded = 0
                counters.held = counters.leaves
                self._end_mesh()
            case "continue":
                if self.state.refinement.more:
                    if self._births:
                        self._begin_significance()
                    else:
                        self._begin_refinement()
                    return False
                self._end_adapt()
            case "significance":
                self._begin_refinement()
                return False
                self._end_mesh()
                self._running = ""
                self._hold(state_bytes(self.state, self._mark), 0)
            case "refinement":
                self._take_list()
                self._set_level(int(counters.level) + 1)
                if not counters.asks:
                    counters.uniform = counters.level
                    self._end_mesh()
                elif counters.level < self.full_level:
                    self._begin_question()
                    return False
                else:
                    self._end_adapt()
        self._running = ""
        return True

    def _begin_refinement(self) -> None:
        """The middles of all leaves of the level become active."""
        self._fresh()
        st = self.state
        found = -(int(st.counters.held) * 2 // _SHARED[self.n] + _FEW)
        place = np.empty(COUNTS, np.int64)
        while found < 0:
            self._hold(state_bytes(st, self._mark), -_MIDDLE * found)
            key = np.empty((2, -found), np.int64)
            found = refinement.list_middles(st, key, place)
        st.counters.active = found
        self.state = st._replace(active=np.empty((found, 5), np.int32))
        refinement.enter_middles(self.state, key, self.state.active)
        self._hold(state_bytes(self.state, self._mark), 0)
        self._running = "refinement"

    def _take_list(self) -> None:
        """The simplices that a layer has made replace those that were there before."""
        st, counters = self.state, self.state.counters
        self.state = st._replace(leaf=st.below, below=st.leaf, active=st.active[:0].copy())
        counters.leaves, counters.held = counters.next, counters.mixed
        counters.next = counters.mixed = counters.done_leaves = 0
        counters.active = counters.coded = counters.bisected = 0

    def drawn_state(self) -> State:
        """The state with the leaves as they are drawn: in the midst of a round the diamonds coded so far are bisected.

        Bisected is a copy: their corners become known at the end of the round only (clauses 5.4.3, 9.1).
        """
        st = self.state
        if self._running != "refinement":
            return st
        count = int(st.counters.coded)
        st = st._replace(
            counters=copy(st.counters), known=copied(st.known, KNOWN | 1), vertex=st.vertex.copy(),
            below=st.below.copy(),
        )
        while (status := int(refinement.corners(st))) != DONE:
            if status == GROW:
                st, _ = wider_state(st, self._mark, False, self.limits, self._hold)
            else:
                st.counters.bisected += 1
        self._hold(state_bytes(self.state, self._mark), 0)
        # those that stay may have been taken over already
        done_leaves = int(st.counters.done_leaves)
        st = st._replace(leaf=st.leaf[done_leaves:])
        st.counters.leaves -= done_leaves
        rows = one_by_one(st)
        here = rows[:, 4] == st.counters.level
        place = np.empty((np.count_nonzero(here), 6), np.int64)
        refinement.places(st, rows[here], place)
        active = st.active[:count]
        done = active[active[:, 3] >= 0, :3]
        _, name = np.unique(np.concatenate([done, place[:, :3]]), axis=0, return_inverse=True)
        stays = np.ones(len(rows), np.bool_)
        stays[here] = ~np.isin(name[len(done) :], name[: len(done)])
        rows = rows[stays]
        st.counters.leaves = st.counters.held = len(rows)
        return st._replace(leaf=rows)

    def _set_level(self, level: int) -> None:
        self.state.counters.level = level
        self.state.counters.edge = 1 << (self.k - level // self.n)

    def _end_adapt(self) -> None:
        self.state.counters.asks = 0
        self._set_level(self.level)
        self._end_mesh()

    def _end_mesh(self) -> None:
        self.state.counters.meshes += 1
        if self.full:
            self.state = without_rounds(self.state)
            self._hold(state_bytes(self.state, self._mark), 0)

    def _grow(self) -> None:
        self.state, self._mark = wider_state(
            self.state, self._mark, self._running == "base", self.limits, self._hold
        )

    def _hold(self, size: int, passing: int) -> None:
        """Count the memory of the state; that of the models beside it, but for what all isovalues share."""
        panel = self.coder.blend.panel
        if self.lean is not None:
            size += numbers_bytes(self.lean.state)
        models = (self.coder.prob, self.coder.seen, self.coder.blend.mix, panel.prob, panel.seen)
        self.budget.hold(self, size + (0 if self._shares else sum(array.nbytes for array in models)), passing)

    def rest(self) -> None:
        """No further layer will come: only what is drawn, and what other isovalues may lean on, is kept."""
        self.lean = self.truth = None
        # the models of one that has no layers may be those of others
        self.coder = put_away(self.coder) if self.begun else self.coder
        # first: what is kept of the state is copied
        self.estimates.rest()
        self.state = at_rest(self.state)
        self._mark = no_store(self.n)
        self._hold(state_bytes(self.state, self._mark), 0)


def in_order_of_middles(st: State, rows: NDArray[np.int32]) -> NDArray[np.int32]:
    """Sort leaves as the seeds of a base (clause 5.9.4): by level, by the order of their middles, by their vertices."""
    n = int(st.grid.tables[0])
    place = np.empty((len(rows), 6), np.int64)
    refinement.places(st, rows, place)
    middle, vertices = place[:, :n], place[:, 3 : 3 + n]
    full = n * int(st.grid.exponent)
    out = []
    for level in np.unique(rows[:, 4]):
        here = np.flatnonzero(rows[:, 4] == level)
        # of unit cells the lowest corner
        at = middle[here] >> int(level == full)
        out.append(here[in_order(at, vertices[here])])
    return rows[np.concatenate(out)] if out else rows


def out_of_steps(limits: Limits) -> LimitError:
    """Error to raise when the steps allowed are used up."""
    return LimitError(
        f"inferring signs and ancestors takes more than {limits.steps} steps", code="limit-steps", clause="11.2"
    )
