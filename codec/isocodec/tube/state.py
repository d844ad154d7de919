"""The state that every pass works on: the known vertices and the tubular neighbourhood (spec clause 5.1)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from isospec.elements import ELEMENTS

from ..kernel import inlined, record
from ..kernel.types import BoolVolume, Int32Matrix, IntMatrix, IntVector
from ..mesh.access import vertex
from ..mesh.grid import Grid, clamped, position
from ..mesh.store import Bytes, Store, full, get, put
from ..mesh.vertex_set import Chosen

GATE = 7
"""A gate on the stack: class, block and level of the simplex of equal level behind it, the vertex opposite, the leaf
it was left from."""
MOST_ANCESTORS = 4096
"""Rows of ``State.path``; a vertex with more ancestors to be added is barred (spec clause 11.1)."""
# Counters in State.at.
LEVEL, EDGE, VERTICES, LEAVES, DONE_LEAVES, NEXT, BASE_LEVEL, ERROR, WORK, BEFORE_ROUND, MOST_WORK = range(11)
UNIFORM, FINEST, ASKS, ROOM = range(12, 16)
"""Middles of levels below UNIFORM are in the mesh, those of FINEST and above are not; whether a round asks for each
subdivision edge; pages that the store of the mesh lacks."""
TALLY = 20
"""Symbols by element, in State.at; then predictions and right ones."""
(
    SIDE, SHIFT, TOLD, SEEDED, BITS, _, MESHES, ADAPTED, COUNTED, BIRTHS, BOARD_EDGE, BOARDED, AGREED, COUNTED_SIZE,
    COUNTING, CALM,
) = range(40, 56)  # fmt: skip
"""Whether the isovalue lies above (1) or below (-1) the earlier one that it leans on, by how many whole steps; whether
the mesh is told from the start; whether the base begins at the leaves of the earlier one; bits of values below the
isovalue and, next to it, above; how many meshes have been completed; whether an adaptive layer has begun
(5.8); vertices counted in the crowd, and new components found so far (7.13); the edge that the board is made for, and
the vertices on it; how often signs have been those of the earlier isovalue (7.12); of a census that goes on the cells'
size and the next vertex; how often signs have been as predicted, on edges that are not crossed and, next to it, on
those that are (7.12)."""
STEP_WORK = 57
"""WORK before the step that is being taken: one that lacks bytes is taken anew."""
CHILD, MIXED, HELD, MOST_MIXED = range(58, 62)
"""Children of the row ``DONE_LEAVES`` that are done; simplices in the rows that a round makes, in those of the last
mesh, and most that may be there."""
COUNTERS = 62
ALWAYS, MOSTLY, AGREED_SHIFT = 4096, 3584, 5
"""AGREED and CALM if it has always been so, what they begin with, and how fast they change."""
# Syntax elements, in the order of isospec (spec clause 5.2).
(
    ORIGIN, COMPONENT, LOCATION, BASE_SIGN, SIGNIFICANCE, REFINEMENT_SIGN, VALUE_BIT, OFFSET_BIT,
    LEVEL_SYMBOL, SPLIT, CONTINUE,
) = range(len(ELEMENTS))  # fmt: skip
PREDICTED, PREDICTED_RIGHT = len(ELEMENTS), len(ELEMENTS) + 1
SCRATCH = 256
"""Room for a step's intermediate results, in State.walk."""
TRAIL = 384
"""Last points of the curve, two numbers a point, in State.walk."""
EARLY = TRAIL + 40
"""First points of the component, likewise."""
WINDOW = EARLY + 40
"""The pages of the board around the last middle, in State.walk, see passes.around."""
WALK = WINDOW + 12
OUT_OF_STEPS = 5
"""In State.at[ERROR]."""
STEP_VERTICES = 16
"""Most vertices (and pages) that one step of a pass adds."""
STEP_LEAVES = 24
"""Most simplices that one step adds."""
STEP_CELLS = 26
"""Most pages of the crowd that one step adds."""


@record
class Lean(NamedTuple):
    """What is known of an earlier isovalue: its mesh, its vertices, and their values as far as sent (clause 5.9)."""

    grid: Grid
    at: IntVector
    known: Store
    mesh: Store
    number: IntVector
    left: IntVector


@record
class State(NamedTuple):
    """Arrays of one isovalue's decoding; the kernels read and write them in place.

    A store entry is 0 for an unknown vertex, else ``2 * (number + 1) + sign``; vertices are numbered as they become
    known. ``leaf`` lists the mixed simplices, in order, ``below`` those that a round of refinement makes, while it goes
    on: see ``tube.leaf_list``.
    """

    grid: Grid
    at: IntVector  # counters
    known: Store
    vertex: Int32Matrix  # (V, 4) position and sign
    leaf: Int32Matrix  # (M, 5)
    below: Int32Matrix  # (M, 5)
    mesh: Store
    crowd: Store  # main profile: counts of vertices and new components in cells of all sizes
    board: Bytes  # main profile: what is known on the lattice of the present level, see passes.around
    path: IntMatrix  # (P, 4) positions and levels of vertices to be added
    chosen: Chosen  # encoder: the mesh that an adaptive layer leads to
    lean: Lean  # of an earlier isovalue, or empty
    truth: BoolVolume  # encoder: the signs of the whole field; decoder: empty
    walk: IntVector  # registers of the running pass
    stack: IntVector  # its stack


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
    v = st.at[VERTICES]
    x, y, z = clamped(st.grid, x, y, z)
    row = st.vertex[np.uint64(v)]
    row[0] = x
    row[1] = y
    row[2] = z
    row[3] = sign
    put(st.known, x, y, z, 2 * (v + 1) + sign)
    st.at[VERTICES] = v + 1


@inlined
def crowded(st):
    """Whether some array may overflow in one more step."""
    at = st.at
    return (
        at[VERTICES] + STEP_VERTICES > len(st.vertex)
        or at[LEAVES] + STEP_LEAVES > len(st.leaf)
        or at[NEXT] + STEP_LEAVES > len(st.below)
        or at[MIXED] + STEP_LEAVES > at[MOST_MIXED]
        or full(st.known, STEP_VERTICES)
        or full(st.mesh, STEP_VERTICES)
        or full(st.crowd, STEP_CELLS)
    )


@inlined
def tired(st):
    """Before a step of a pass: whether those that a decoder allows are used up; the reason is left in the state."""
    st.at[STEP_WORK] = st.at[WORK]
    if st.at[WORK] < st.at[MOST_WORK]:
        return False
    st.at[ERROR] = OUT_OF_STEPS
    return True
