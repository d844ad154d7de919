"""Rows of the networks and kinds of symbols of the main profile: where each model has its own (spec clause 7.10)."""

from __future__ import annotations

import numpy as np

from isospec.tables import KINDS, ROWS

from ...entropy.mixer import BUCKETS
from .contexts import CONTEXTS
from .corner_patterns import CLASSES

MAP = CONTEXTS
"""The adaptive probabilities of classes of opinions follow those of the baseline profile."""
AROUND_VALUE = MAP + KINDS * BUCKETS
"""Then come those of value bits: lists of contexts, each of four candidates."""
VALUE_LISTS, VALUE_LIST = 4, 8**4
STATES = AROUND_VALUE + VALUE_LISTS * VALUE_LIST
MOST_ROWS = 256
# Kinds of symbols that are mixed; each has separate weights and classes of opinions.
REFINE_KIND = 0
"""Rows by phase, for whether the edge is crossed; the same where an earlier isovalue predicts it."""
TREE_KIND = 12
"""Nodes, cubes, slots; the same where the isovalue leans on another one."""
OFFSET_KIND = 18
"""Rows by how often the part was halved, of edges coded for the first time or again; the same off the full grid."""
LEAN_KIND = 30
"""Rows by how often the part was halved, where an earlier isovalue crosses the edge, too, on and off the full grid."""
MESH_KIND = 36
"""Rows by question: on a path, of a simplex that may be coarser or finer, whether to split a leaf."""
BASE_KIND = 40
"""Rows by phase, for the signs behind gates; the same where an earlier isovalue predicts them."""
VALUE_MIX, VALUE_MIXES = KINDS, 4
"""First set of the weights of value bits, behind those of all kinds, and how many: by bits of the number so far."""
VALUE_WEIGHT = 1 << 14
"""Weight that their opinions begin with, of ``2**16``."""
# Networks, in the order of their rows.
SIGN_NET, TREE_NET, OFFSET_NET, LEAF_NET, MESH_NET, BASE_NET = np.array([0, 3, 4, 5, 6, 7])
"""Signs have one for each phase; n = 2 leaves the third without rows. Offsets have one on and one off the full grid."""
AROUND = {2: 96, 3: 112}
"""Vertices around a middle that a sign's network sees."""
MANNER_ROWS = 38
"""Rows of these for the kind of curve that it has been so far."""
EARLIER_ROWS = 60
"""Rows of these for what an earlier isovalue predicts."""
SIGN_ROWS = {n: [2 * AROUND[n] + MANNER_ROWS + EARLIER_ROWS + 2 * classes for classes in CLASSES[n]] for n in AROUND}
"""Rows by phase: what is around comes first, the classes of corners last."""
SIGN_ROW = {n: [sum(SIGN_ROWS[n][:phase]) for phase in range(n)] for n in AROUND}
"""First of them."""
CELLS = {2: 24, 3: 26}
"""Cells around a node of the tree that its network sees."""
CELL_CLASSES, BIRTH_CLASSES = 5, 4
"""Classes of the number of vertices in a cell, and of that of new components."""
CELL_ROWS = CELL_CLASSES + BIRTH_CLASSES
CELL_ROW = 94
"""First of their rows in the tree's network."""
TREE_ROWS = {n: CELL_ROW + CELL_ROWS * CELLS[n] for n in AROUND}
TREE_ROW = {n: sum(SIGN_ROWS[n]) for n in AROUND}
"""First row of the tree's network."""
OFFSET_ROW = {n: TREE_ROW[n] + TREE_ROWS[n] for n in AROUND}
OFFSET_ROWS, LEAF_ROWS = 720, {2: 514, 3: 775}
MESH_AROUND = 24
"""Vertices around a middle that the network of the mesh sees."""
MESH_ROW = {n: OFFSET_ROW[n] + OFFSET_ROWS + LEAF_ROWS[n] for n in AROUND}
MESH_ROWS = {n: 44 + 4 * MESH_AROUND * n for n in AROUND}
BEHIND = {2: 48, 3: 62}
"""Vertices around the one behind a gate that the network of base signs sees."""
BASE_ROW = {n: MESH_ROW[n] + MESH_ROWS[n] for n in AROUND}
BASE_ROWS = {n: 18 + 2 * BEHIND[n] * n * (n + 1) for n in AROUND}
# Several rows of a list are one where their sums are made beforehand. These follow the rows of all networks.
GROUP = 4
"""Vertices around a middle, one after the other, that have one row together."""
PATTERNS = 3**GROUP
"""For each of them 0 is no row, 1 and 2 are its first and second; the first of the group counts once, the next
three times, and so on."""
AROUND_SUMS = {n: AROUND[n] // GROUP * PATTERNS for n in AROUND}
AROUND_SUM = ROWS
"""First of the rows for what is known around middles: for each phase those of each group."""
CELL_SUMS = CELL_CLASSES * BIRTH_CLASSES
CELL_SUM = {n: AROUND_SUM[n] + n * AROUND_SUMS[n] for n in AROUND}
"""First of the rows for cells: for each cell those of its classes of new components, for each class of vertices."""
