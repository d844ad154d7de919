"""Contexts and mixing weights of coded points and their values, and how they start (spec clause 10.9.2)."""

from __future__ import annotations

import numpy as np

from ..entropy.guesses import MOST_OPINIONS
from ..entropy.panel import no_panel
from ..entropy.range_coder import ONE, Blend, Coder, CoderRegisters
from ..grid.models.contexts import rates
from ..grid.models.trained import shipped_models

AREAS = 16
"""Classes of the size of a cell: binary digits of the positions in it."""
NEAR = 9
"""How many of the eight cells around have points."""
OPEN = 4
"""How many of them may have, counted up to 3."""
STATES = 81
"""What is known of the four cells beside: each empty, not empty, or not known."""
WIDE = 25
"""How many of the 24 cells around the cell that was halved have points."""
SPREADS = 12
"""Classes of the differences of values."""
MISSES = 9
"""Classes of the errors of predictions nearby."""
REACHES = 14
"""Classes of the size of triangles."""
PARTS = 4
"""Classes of the fraction of a prediction."""
EXPONENTS = 18
_LAYOUT = {
    "NEAR": 2 * AREAS * NEAR * OPEN,
    "SIDES": 2 * 4 * STATES,
    "WIDE": 2 * AREAS * WIDE,
    "PAST": 2 * AREAS * 2 * 8,
    "RAW": EXPONENTS * 2,
    "ZERO_SPREAD": SPREADS * MISSES,
    "ZERO_REACH": REACHES * MISSES,
    "ZERO_PART": SPREADS * PARTS * 3,
    "ZERO_NEXT": 3 * SPREADS * 3,
    "SIGN_PART": PARTS * SPREADS,
    "SIGN_NEXT": 3 * MISSES,
    "SIGN_PAST": 9 * 3,
    "SIZE_MISS": EXPONENTS * MISSES,
    "SIZE_SPREAD": EXPONENTS * SPREADS,
    "SIZE_REACH": EXPONENTS * REACHES,
    "DIGIT": EXPONENTS * 4,
}
CONTEXT: dict[str, int] = {}
CONTEXTS = 0
for _name, _count in _LAYOUT.items():
    CONTEXT[_name] = CONTEXTS
    CONTEXTS += _count
MIX_CELL = 0
MIX_ZERO = MIX_CELL + 2 * AREAS
MIX_SIGN = MIX_ZERO + 3
MIX_SIZE = MIX_SIGN + 1
MIXES = MIX_SIZE + EXPONENTS
WEIGHT = 24000
"""Mixing weight that every opinion starts with, of 2**16."""


def new_coder() -> Coder:
    """A coder of points and values; ``range_coder.start`` and its ``buf`` begin a run."""
    tables = shipped_models(2)[2]
    short = np.zeros((0, 0), np.int32)
    mix = np.full((MIXES, MOST_OPINIONS), WEIGHT, np.int64)
    blend = Blend(
        np.zeros((0, 0), np.int16), short, mix, tables.squash, tables.stretch, tables.trust,
        np.zeros(2 * MOST_OPINIONS + 1, np.int64), short, no_panel(),
    )
    prob = np.full(CONTEXTS, ONE // 2, np.int64)
    return Coder(CoderRegisters(), np.zeros(0, np.uint8), prob, np.zeros(CONTEXTS, np.int64), rates(), blend)
