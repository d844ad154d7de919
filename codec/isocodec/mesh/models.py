"""Contexts and mixing weights of explicit domains, and how they start (spec clause 10.4.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..entropy.guesses import DEPTHS, MOST_OPINIONS
from ..entropy.panel import no_panel
from ..entropy.range_coder import ONE, Blend, Coder, CoderRegisters
from ..grid.models.contexts import rates
from ..grid.models.trained import shipped_models
from .before import AGREED, RINGS

CLASSES = 8
"""Classes of how sure an estimate is."""
PASTS = 64
"""Last symbols, six of them."""
CROSSINGS = 4
"""Classes of what is known about where an edge is crossed; as many more where the frame before knows, too."""
NUMBERS = 4
"""The same of values at vertices."""
TURNED = 4
"""Numbers of vertices of a ring whose signs are others than in the frame before: so many or more are one class."""
SHARES = 18
"""Classes of the share of what is around that lies above: none known, 0 to 16."""
RING_COUNTS = 81
"""Numbers of vertices around, and of those above: up to 8 each."""
# element: (contexts, probability of a 1 at the start, weight of that start in symbols)
_LAYOUT = {
    "COMPONENT": (1, 0.8, 1),
    "FIRST": (16, 0.5, 0),
    "SIGN_SURE": (CLASSES * 3, 0.7, 2),
    "SIGN_RING": (CLASSES * RINGS, 0.7, 1),
    "SIGN_PAST": (PASTS * 2, 0.7, 1),
    "SIGN_BOTH": (RINGS * 8 * 3, 0.7, 1),
    "SIGN_THEN": (AGREED * RINGS * 3, 0.7, 1),
    "SIGN_THEN_SURE": (CLASSES * RINGS * 3, 0.7, 1),
    "COARSE": (8 * SHARES, 0.5, 0),
    "COARSE_THEN": (3 * AGREED * SHARES, 0.5, 0),
    "LEVEL_RING": (2 * SHARES, 0.5, 0),
    "LEVEL_COUNT": (RING_COUNTS, 0.5, 0),
    "LEVEL_PAST": (4 * SHARES, 0.5, 0),
    "LEVEL_THEN": (3 * AGREED * TURNED * 5, 0.5, 0),
    "LEVEL_THEN_SHARE": (3 * AGREED * SHARES, 0.5, 0),
    "NEW": (16, 0.1, 1),
    "NEW_THEN": (TURNED, 0.5, 0),
    "OFFSET": (2 * CROSSINGS * 4 * DEPTHS, 0.5, 0),
    "VALUE": (2 * NUMBERS * 4 * DEPTHS, 0.5, 0),
}
CONTEXT: dict[str, int] = {}
CONTEXTS = 0
for _name, (_count, _p, _weight) in _LAYOUT.items():
    CONTEXT[_name] = CONTEXTS
    CONTEXTS += _count
COMPONENT, FIRST = CONTEXT["COMPONENT"], CONTEXT["FIRST"]
SIGN_SURE, SIGN_RING = CONTEXT["SIGN_SURE"], CONTEXT["SIGN_RING"]
SIGN_PAST, SIGN_BOTH = CONTEXT["SIGN_PAST"], CONTEXT["SIGN_BOTH"]
SIGN_THEN, SIGN_THEN_SURE = CONTEXT["SIGN_THEN"], CONTEXT["SIGN_THEN_SURE"]
COARSE, COARSE_THEN, NEW, NEW_THEN = (CONTEXT[name] for name in ("COARSE", "COARSE_THEN", "NEW", "NEW_THEN"))
LEVEL_THEN, LEVEL_THEN_SHARE = CONTEXT["LEVEL_THEN"], CONTEXT["LEVEL_THEN_SHARE"]
LEVEL_RING, LEVEL_COUNT, LEVEL_PAST = CONTEXT["LEVEL_RING"], CONTEXT["LEVEL_COUNT"], CONTEXT["LEVEL_PAST"]
OFFSET, VALUE = CONTEXT["OFFSET"], CONTEXT["VALUE"]
MIX_SIGN = 0
MIX_OFFSET = MIX_SIGN + CLASSES
MIX_VALUE = MIX_OFFSET + 2 * CROSSINGS * DEPTHS
MIX_LEVEL = MIX_VALUE + 2 * NUMBERS * DEPTHS
MIXES = MIX_LEVEL + SHARES // 2
WEIGHT = 22000
"""Mixing weight that every opinion starts with, of 2**16."""


def begun() -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Probabilities of a 1, symbols seen, and mixing weights, as a file begins with them."""
    prob, seen = np.empty(CONTEXTS, np.int64), np.empty(CONTEXTS, np.int64)
    for name, (count, p, weight) in _LAYOUT.items():
        prob[CONTEXT[name] : CONTEXT[name] + count] = round(p * ONE)
        seen[CONTEXT[name] : CONTEXT[name] + count] = weight
    return prob, seen, np.full((MIXES, MOST_OPINIONS), WEIGHT, np.int64)


def coder_of(prob: NDArray[np.int64], seen: NDArray[np.int64], mix: NDArray[np.int64]) -> Coder:
    """A coder with these models; ``range_coder.start`` and its ``buf`` begin a run."""
    tables = shipped_models(2)[2]
    short = np.zeros((0, 0), np.int32)
    blend = Blend(
        np.zeros((0, 0), np.int16), short, mix, tables.squash, tables.stretch, tables.trust,
        np.zeros(2 * MOST_OPINIONS + 1, np.int64), short, no_panel(),
    )
    return Coder(CoderRegisters(), np.zeros(0, np.uint8), prob, seen, rates(), blend)


def new_coder() -> Coder:
    """A coder for all runs of an isovalue."""
    return coder_of(*begun())
