"""Registers of a base, in ``State.walk``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .state import WALK

PHASE, DEPTH, CLASS, B0, B1, B2, TIGHT, CORNER, GATES, HISTORY, FRESH, BRANCH, ITEM, BEFORE, LAST_ROOT, SEED = range(16)
RESOLVED = 16
"""The leaf behind the gate on top: its level, class, block and the vertex opposite."""
PATH = 32
"""One side per level of the last component's path."""


def registers() -> NDArray[np.int64]:
    """Registers at the start of a base."""
    walk = np.zeros(WALK, np.int64)
    walk[LAST_ROOT] = -1
    return walk
