"""The state that every pass works on: the known vertices and the tubular neighbourhood (spec clause 5.1)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from isospec.elements import ELEMENTS

from ...kernel import inlined, record
from ...kernel.types import BoolVolume, Int8Vector, Int32Matrix, IntMatrix, IntVector, Registers
from ..lattice.access import vertex
from ..lattice.grid import Grid, clamped, position
from ..lattice.store import Bytes, Flags, Store, full, get, spot
from ..lattice.vertex_set import Chosen
from .ranks import Ranks, bytes_to_number, numbered

GATE = 7
"""A gate on the stack: class, block and level of the simplex of equal level behind it, the vertex opposite, the leaf
it was left from."""
MOST_ANCESTORS = 4096
"""Rows of ``State.path``; a vertex with more ancestors to be added is barred (spec clause 4.7(6))."""
# Syntax elements, in the order of isospec (spec clause 5.2).
(
    ORIGIN, COMPONENT, LOCATION, BASE_SIGN, SIGNIFICANCE, REFINEMENT_SIGN, VALUE_BIT, OFFSET_BIT,
    LEVEL_SYMBOL, SPLIT, CONTINUE,
) = range(len(ELEMENTS))
PREDICTED, PREDICTED_RIGHT = len(ELEMENTS), len(ELEMENTS) + 1

ALWAYS, MOSTLY, AGREED_SHIFT = 4096, 3584, 5
"""Score of what has always been so, the score to begin with, and the shift by which it changes."""


KNOWN = 2
"""Bit of an entry of ``State.known``; below it is the sign."""
FRAME = 2
"""In State.counters.side: the isovalue leans on an earlier frame's."""


class Counters(Registers):
    """Counters, and the progress of coding.

    Attributes
    ----------
    level, edge : int
        Level that is worked on, and the edge of its cubes.
    vertices, leaves, next : int
        Rows of ``vertex``, ``leaf`` and ``below`` in use.
    active, coded, bisected : int
        Rows of ``active`` in use; those that a round has coded, and those whose diamonds it has bisected.
    done_leaves : int
        Rows of ``leaf`` of which a round has taken over what stays.
    mixed, held, most_mixed : int
        Simplices in the rows that a round makes, in those of the last mesh, and most that may be there.
    base_level, uniform, finest : int
        Level of the base; middles of levels below ``uniform`` are in the mesh, those of ``finest`` and above are not.
    error : int
        Why a pass gave up: see ``ERRORS``.
    work, step_work, most_work : int
        Steps of inference so far, before the step that is being taken, and most that are allowed.
    asks, adapted : int
        Whether a round asks for each subdivision edge; whether an adaptive layer has begun (5.8).
    room : int
        Pages that the store of the mesh lacks.
    side : int
        Whether the isovalue lies above (1) or below (-1) the earlier one that it leans on; ``FRAME`` if that is one of
        an earlier frame, from which no sign follows (5.11).
    down, up : int
        How many steps it lies above that one, rounded down and up.
    told, seeded : int
        Whether the mesh is known from the start; whether the base begins at the leaves of the earlier isovalue.
    meshes : int
        Meshes that have been completed.
    births, counted : int
        New components so far; vertices known before the round, which are those that count in the crowd (7.13).
    boarded, board_edge : int
        Vertices on the board, and the edge that it is made for.
    agreed : int
        How often signs have been those of the earlier isovalue (7.12).
    masked : int
        Whether a mask marks missing samples (5.10).
    """

    level: int
    edge: int
    vertices: int
    leaves: int
    next: int
    active: int
    coded: int
    bisected: int
    done_leaves: int
    mixed: int
    held: int
    most_mixed: int
    base_level: int
    uniform: int
    finest: int
    error: int
    work: int
    step_work: int
    most_work: int
    asks: int
    adapted: int
    room: int
    side: int
    down: int
    up: int
    told: int
    seeded: int
    meshes: int
    births: int
    counted: int
    boarded: int
    board_edge: int
    agreed: int
    masked: int


class BaseWalk(Registers):
    """Progress of a base: its phase, the present simplex, the gates, the points of the curve, the leaf behind.

    ``before`` are the last answers on the mesh, ``history`` whether the last two guesses were right.
    """

    phase: int
    depth: int
    cls: int
    b0: int
    b1: int
    b2: int
    tight: int
    corner: int
    gates: int
    points: int
    early_points: int
    branch: int
    item: int
    before: int
    history: int
    last_root: int
    seed: int
    behind_level: int
    behind_cls: int
    behind_b0: int
    behind_b1: int
    behind_b2: int
    behind_opposite: int


class RefinementWalk(Registers):
    """Cont/Stop."""

    more: int


class TreeWalk(Registers):
    """Progress of the tree of new components.

    Frames of the stack in use, the next item of the encoder's list, whether the root was coded, whether the slot before
    the next one is being added.
    """

    frames: int
    item: int
    started: int
    adding: int


class ValueWalk(Registers):
    """The next item of the list of values, its row on the full grid, and the symbol before."""

    item: int
    row: int
    before: int


class DigitWalk(Registers):
    """Progress of offsets: the next edge, of its digit the parts that are left and how often they were halved.

    Further what ``find_candidates`` returns.
    """

    item: int
    low: int
    high: int
    halved: int
    span: int


OUT_OF_STEPS = 5
"""In State.counters.error."""
STEP_VERTICES = 16
"""Most vertices (and pages) that one step of a pass adds."""
STEP_LEAVES = 24
"""Most simplices that one step adds."""
STEP_CELLS = 26
"""Most pages of the crowd that one step adds."""
MOST_NEAR = 20480
"""Entries of ``State.near``."""


@record
class Lean(NamedTuple):
    """Knowledge of an earlier isovalue: its mesh, its vertices, and their values as far as sent (clause 5.9).

    The same of the mask, which has no values and whose isovalue lies between missing and valid (clause 5.10).
    """

    grid: Grid
    counters: Counters
    value_bits: IntVector
    known: Flags
    mesh: Flags
    number: IntVector
    left: IntVector
    numbers: Ranks


@record
class State(NamedTuple):
    """Arrays of one isovalue's decoding; the kernels read and write them in place.

    An entry of ``known`` is 0 for an unknown vertex, else ``KNOWN + sign``; vertices are numbered as they become
    known. ``leaf`` lists the mixed simplices, in order, ``below`` those that a round of refinement makes, while it goes
    on: see ``tube.leaf_list``.
    """

    grid: Grid
    counters: Counters
    tally: IntVector  # symbols by element, then predictions and right ones
    calm: (
        IntVector  # how often signs have been as predicted, on edges that are not crossed and on those that are (7.12)
    )
    value_bits: IntVector  # of numbers below the isovalue, and above
    known: Flags
    vertex: Int32Matrix  # (V, 4) position and sign
    leaf: Int32Matrix  # (M, 5)
    below: Int32Matrix  # (M, 5)
    active: Int32Matrix  # (A, 5) active middles of a round in order, in units of g, and what was seen of their diamonds
    mesh: Flags
    crowd: Store  # main profile: counts of vertices and new components in cells of all sizes
    censuses: IntVector  # main profile: vertices counted in the crowd's cells of each size
    board: Bytes  # main profile: what is known on the lattice of the present level, see passes.around
    path: IntMatrix  # (P, 4) positions and levels of vertices to be added
    chosen: Chosen  # encoder: the mesh that an adaptive layer leads to
    lean: Lean  # of an earlier isovalue, or empty
    hole: Lean  # of the mask, or empty
    soft: Store  # the signs of the frame before, see tube.softened, or empty
    truth: BoolVolume  # encoder: the signs of the whole field; decoder: empty
    base: BaseWalk
    refinement: RefinementWalk
    tree: TreeWalk
    value: ValueWalk
    digit: DigitWalk
    turns: IntVector  # of the last component's path, one for each level
    trail: IntVector  # last points of the curve, two numbers a point
    early: IntVector  # first points of the component, likewise
    candidates: IntVector  # for a crossing, see models.crossing_candidates
    window: IntVector  # main profile: which part of the board is copied, see models.neighbourhood
    near: Int8Vector  # that part
    scratch: IntVector  # a step's intermediate results
    stack: IntVector  # of the running pass


def numbers_of(st: State) -> Ranks:
    """Number the vertices known now."""
    return numbered(st.known, st.vertex[: st.counters.vertices])


def numbers_bytes(st: State) -> int:
    """Bytes that `numbers_of` takes."""
    return bytes_to_number(st.known, int(st.counters.vertices))


@inlined
def entry(st, x, y, z):
    """Store entry of the vertex at unclamped (x, y, z)."""
    x, y, z = clamped(st.grid, x, y, z)
    return get(st.known, x, y, z)


@inlined
def truth(st, x, y, z):
    """Encoder: the sign of the vertex at unclamped (x, y, z)."""
    x, y, z = clamped(st.grid, x, y, z)
    return np.int64(st.truth[x, y, z])


@inlined
def corner_entry(st, edge, r, cls, b0, b1, b2, j):
    """Store entry of vertex j of a simplex whose cubes have the edge ``edge``."""
    x, y, z = position(edge, b0, b1, b2, vertex(st.grid.tables, r, cls, j))
    return entry(st, x, y, z)


@inlined
def corner_truth(st, edge, r, cls, b0, b1, b2, j):
    """Encoder: the sign of vertex j of a simplex."""
    x, y, z = position(edge, b0, b1, b2, vertex(st.grid.tables, r, cls, j))
    return truth(st, x, y, z)


@inlined
def learn(st, x, y, z, sign):
    """Make the vertex at unclamped (x, y, z) known."""
    x, y, z = clamped(st.grid, x, y, z)
    page, cell = spot(st.known, x, y, z)
    learn_at(st, page, cell, x, y, z, sign)


@inlined
def learn_at(st, page, cell, x, y, z, sign):
    """Make the vertex at (x, y, z), which the store has there, known."""
    v = st.counters.vertices
    row = st.vertex[np.uint64(v)]
    row[0] = x
    row[1] = y
    row[2] = z
    row[3] = sign
    st.known.pages[np.uint64(page), np.uint64(cell)] = KNOWN + sign
    st.counters.vertices = v + 1


@inlined
def crowded(st):
    """Whether some array may overflow in one more step."""
    return crowded_by(st, STEP_VERTICES, STEP_LEAVES)


@inlined
def crowded_by(st, vertices, leaves):
    """Whether some array may overflow by so many vertices, on the pages of a step, and so many simplices."""
    counters = st.counters
    return (
        counters.vertices + vertices > len(st.vertex)
        or counters.leaves + leaves > len(st.leaf)
        or counters.next + leaves > len(st.below)
        or counters.mixed + leaves > counters.most_mixed
        or full(st.known, STEP_VERTICES)
        or full(st.mesh, STEP_VERTICES)
        or full(st.crowd, STEP_CELLS)
    )


@inlined
def tired(st):
    """Before a step of a pass: whether those that a decoder allows are used up; the reason is left in the state."""
    st.counters.step_work = st.counters.work
    if st.counters.work < st.counters.most_work:
        return False
    st.counters.error = OUT_OF_STEPS
    return True
