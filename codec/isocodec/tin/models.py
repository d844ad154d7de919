"""Contexts and mixing weights of coded points and their values, and how they start (spec clause 10.9.2)."""

from __future__ import annotations

from ..entropy.context_layout import Layout, opinion_coder
from ..entropy.range_coder import Coder

AREAS = 16
"""Classes of the size of a cell: bits of the positions in it."""
NEAR = 9
"""Classes of the number of the eight surrounding cells that have points."""
OPEN = 4
"""Classes of the number of those that may have points, up to 3."""
STATES = 81
"""States of the four adjacent cells, each empty, not empty or unknown."""
WIDE = 25
"""Classes of the number of the 24 cells around the halved cell that have points."""
SPREADS = 12
"""Classes of the differences of values."""
MISSES = 9
"""Classes of the errors of predictions nearby."""
REACHES = 14
"""Classes of the size of triangles."""
PARTS = 4
"""Classes of the fraction of a prediction."""
EXPONENTS = 18
# element: (contexts, probability of a 1 at the start, weight of that start in symbols)
CONTEXT = Layout({
    "NEAR": (2 * AREAS * NEAR * OPEN, 0.5, 0),
    "SIDES": (2 * 4 * STATES, 0.5, 0),
    "WIDE": (2 * AREAS * WIDE, 0.5, 0),
    "PAST": (2 * AREAS * 2 * 8, 0.5, 0),
    "RAW": (EXPONENTS * 2, 0.5, 0),
    "ZERO_SPREAD": (SPREADS * MISSES, 0.5, 0),
    "ZERO_REACH": (REACHES * MISSES, 0.5, 0),
    "ZERO_PART": (SPREADS * PARTS * 3, 0.5, 0),
    "ZERO_NEXT": (3 * SPREADS * 3, 0.5, 0),
    "SIGN_PART": (PARTS * SPREADS, 0.5, 0),
    "SIGN_NEXT": (3 * MISSES, 0.5, 0),
    "SIGN_PAST": (9 * 3, 0.5, 0),
    "SIZE_MISS": (EXPONENTS * MISSES, 0.5, 0),
    "SIZE_SPREAD": (EXPONENTS * SPREADS, 0.5, 0),
    "SIZE_REACH": (EXPONENTS * REACHES, 0.5, 0),
    "DIGIT": (EXPONENTS * 4, 0.5, 0),
})
MIX_CELL = 0
MIX_ZERO = MIX_CELL + 2 * AREAS
MIX_SIGN = MIX_ZERO + 3
MIX_SIZE = MIX_SIGN + 1
MIXES = MIX_SIZE + EXPONENTS
WEIGHT = 24000
"""Initial mixing weight of every opinion, out of 2**16."""


def new_coder() -> Coder:
    """Make a coder of points and values."""
    return opinion_coder(CONTEXT, MIXES, WEIGHT)
