"""The main profile: its networks, the kinds of symbols that are mixed, and their trained states (spec clause 7.10)."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from isospec.tables import HIDDEN, KINDS, MOST_LOGIT, ROWS, Tables, shipped, unpacked

from .baseline import CONTEXTS, RATES
from .baseline import models as baseline_models
from .coder import ONE, Blend

OUT_SHIFT = 12
MIX_SHIFT = 16
MOST_MIX = 1 << 22
RATE = 40
RATE_SHIFT = 20
STRETCH_SHIFT = 4
"""Probabilities are looked up in ``stretch`` without these last bits."""
TRUST_SHIFT = 8
BUCKET = 7
BUCKETS = (2 * MOST_LOGIT >> BUCKET) + 1
"""Classes of opinions, of ``2**BUCKET`` logits each."""
MAP = CONTEXTS
"""The adaptive probabilities of classes of opinions follow those of the baseline profile."""
STATES = CONTEXTS + KINDS * BUCKETS
MOST_ROWS = 256

# Kinds of symbols that are mixed; each has weights and classes of opinions of its own.
REFINE_KIND = 0
"""By phase, whether the edge is crossed; the same where an earlier isovalue has something to say."""
TREE_KIND = 12
"""Nodes, cubes, slots; the same where the isovalue leans on another one."""
OFFSET_KIND = 18
"""By how often the part was halved, of edges told for the first time or again; the same off the full grid."""
LEAN_KIND = 30
"""By how often the part was halved, where the edge is crossed at an earlier isovalue, too, on and off the full grid."""
VALUE_KIND = 36
"""By bits of the number told so far: none that is 1, one, more."""
MESH_KIND = 39
"""By what is asked: on a path, of a simplex that may be coarser or finer, whether to split a leaf."""
BASE_KIND = 43
"""By phase, of the signs behind gates; the same where an earlier isovalue has something to say."""

# Networks, in the order of their rows.
SIGN_NET, TREE_NET, OFFSET_NET, LEAF_NET, VALUE_NET, MESH_NET, BASE_NET = np.array([0, 3, 4, 5, 6, 7, 8])
"""Of signs there is one for each phase; n = 2 leaves the third without rows. Of offsets, on and off the full grid."""

AROUND = {2: 96, 3: 112}
"""Vertices around a middle that a sign's network sees."""
MANNER_ROWS = 38
"""Of these, what kind of curve it has been so far."""
EARLIER_ROWS = 60
"""Of these, what an earlier isovalue says."""
AROUND_ROW = 10
"""First of their rows in its network."""
SIGN_ROWS = {n: AROUND_ROW + 2 * AROUND[n] + MANNER_ROWS + EARLIER_ROWS for n in AROUND}
CELLS = {2: 24, 3: 26}
"""Cells around a node of the tree that its network sees."""
CELL_CLASSES, BIRTH_CLASSES = 5, 4
"""Classes of the number of vertices in a cell, and of that of new components."""
CELL_ROWS = CELL_CLASSES + BIRTH_CLASSES
CELL_ROW = 94
"""First of their rows in the tree's network."""
TREE_ROWS = {n: CELL_ROW + CELL_ROWS * CELLS[n] for n in AROUND}
TREE_ROW = {n: n * SIGN_ROWS[n] for n in AROUND}
"""First row of the tree's network."""
OFFSET_ROW = {n: TREE_ROW[n] + TREE_ROWS[n] for n in AROUND}
OFFSET_ROWS, LEAF_ROWS = 720, {2: 514, 3: 775}
VALUE_SLOTS = {2: 9, 3: 14}
"""Candidates for a value."""
VALUE_ROW = {n: OFFSET_ROW[n] + OFFSET_ROWS + LEAF_ROWS[n] for n in AROUND}
VALUE_ROWS = {n: 52 * VALUE_SLOTS[n] + 32 for n in AROUND}
MESH_AROUND = 24
"""Vertices around a middle that the network of the mesh sees."""
MESH_ROW = {n: VALUE_ROW[n] + VALUE_ROWS[n] for n in AROUND}
MESH_ROWS = {n: 44 + 4 * MESH_AROUND * n for n in AROUND}
BEHIND = {2: 48, 3: 62}
"""Vertices around the one behind a gate that the network of base signs sees."""
BASE_ROW = {n: MESH_ROW[n] + MESH_ROWS[n] for n in AROUND}
BASE_ROWS = {n: 18 + 2 * BEHIND[n] * n * (n + 1) for n in AROUND}

# Several rows of a list are one where their sums are made beforehand. These follow the rows of all networks.
GROUP = 4
"""Vertices around a middle, one after the other, that have one row together."""
PATTERNS = 3**GROUP
"""Of each of them 0 stands for no row, 1 and 2 for its first and second; the first of the group counts once, the next
three times, and so on."""
AROUND_SUMS = {n: AROUND[n] // GROUP * PATTERNS for n in AROUND}
AROUND_SUM = ROWS
"""First of the rows for what is known around middles: for each phase those of each group."""
CELL_SUMS = CELL_CLASSES * BIRTH_CLASSES
CELL_SUM = {n: AROUND_SUM[n] + n * AROUND_SUMS[n] for n in AROUND}
"""First of the rows for cells: for each cell those of its classes of new components, for each class of vertices."""
_LINE = 64
"""Bytes of a line of the processor's cache: rows that begin with one are read faster."""


@cache
def _shipped() -> tuple[NDArray[np.int64], dict[int, Tables]]:
    return unpacked(shipped())


def members(n: int) -> NDArray[np.int16]:
    """Rows of the networks that each row stands for, the sums included; -1 for none."""
    found = np.full((CELL_SUM[n] + CELL_SUMS * CELLS[n], GROUP), -1, np.int16)
    found[: ROWS[n], 0] = np.arange(ROWS[n])
    number = np.arange(AROUND[n]).reshape(-1, 1, GROUP)
    case = np.arange(PATTERNS)[:, None] // 3 ** np.arange(GROUP) % 3
    for phase in range(n):
        rows = np.where(case > 0, phase * SIGN_ROWS[n] + AROUND_ROW + 2 * number + case - 1, -1)
        found[AROUND_SUM[n] + phase * AROUND_SUMS[n] :][: AROUND_SUMS[n]] = rows.reshape(-1, GROUP)
    first = TREE_ROW[n] + CELL_ROW + CELL_ROWS * np.arange(CELLS[n])
    vertices, births = np.divmod(np.arange(CELL_SUMS), BIRTH_CLASSES)
    found[CELL_SUM[n] :, 0] = (first[:, None] + vertices).ravel()
    found[CELL_SUM[n] :, 1] = (first[:, None] + CELL_CLASSES + births).ravel()
    return found


def with_sums(n: int, weight: NDArray[np.int16]) -> NDArray[np.int32]:
    """Weights of all rows, the sums included."""
    found = members(n)
    padded = np.concatenate([weight, np.zeros((1, HIDDEN), np.int16)])
    whole = np.zeros(len(found) * HIDDEN + _LINE // 4, np.int32)
    place = -whole.ctypes.data % _LINE // 4
    sums = whole[place : place + len(found) * HIDDEN].reshape(-1, HIDDEN)
    for rows in found.T:
        sums += padded[rows]
    return sums


def no_blend() -> Blend:
    """What a coder of the baseline profile has."""
    whole = np.zeros(0, np.int64)
    table, short = np.zeros((0, 1), np.int64), np.zeros((0, 1), np.int32)
    return Blend(short, short, table, whole, whole, whole, whole, short)


def models(n: int, squash: NDArray[np.int64], t: Tables) -> tuple[NDArray[np.int64], NDArray[np.int64], Blend]:
    """Probabilities of a 1, symbols seen, and the rest, as a file begins with them."""
    prob = np.empty(STATES, np.int64)
    seen = np.zeros(STATES, np.int64)
    prob[:CONTEXTS], seen[:CONTEXTS] = baseline_models()
    middles = (np.arange(BUCKETS) << BUCKET) + (1 << BUCKET >> 1)
    prob[MAP:] = np.tile(squash[np.minimum(middles, 2 * MOST_LOGIT)], KINDS)
    prob[t.state[:, 0]], seen[t.state[:, 0]] = t.state[:, 1], t.state[:, 2]
    # the least logit that reaches the middle of each class of probabilities
    half = 1 << STRETCH_SHIFT >> 1
    middles = (np.arange(ONE >> STRETCH_SHIFT) << STRETCH_SHIFT) + half
    stretch = np.minimum(np.searchsorted(squash, middles), 2 * MOST_LOGIT) - MOST_LOGIT
    count = np.arange(RATES)
    trust = (2 * count << TRUST_SHIFT) // (2 * count + 3)
    blend = Blend(
        with_sums(n, t.weight), t.out.astype(np.int32), t.mix.copy(), squash, stretch, trust,
        np.zeros(MOST_ROWS, np.int64), np.zeros((0, 0), np.int32),
    )  # fmt: skip
    return prob, seen, blend


@cache
def _begun(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Blend]:
    squash, found = _shipped()
    return models(n, squash, found[n])


def shipped_models(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Blend]:
    """The same, of the normative tables; what a file changes is its own."""
    prob, seen, blend = _begun(n)
    blend = blend._replace(mix=blend.mix.copy(), row=blend.row.copy())
    return prob.copy(), seen.copy(), blend
