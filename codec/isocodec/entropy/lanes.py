"""Several adaptive probabilities at a time: the opinions on a symbol, in the lanes of a vector (spec clause 5.12).

Compiled, ``lane_vectors`` takes the place of what is done with all lanes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernel import EXECUTION, Execution, inlined
from .guesses import LEARNING
from .mixer import MOST_MIX, RATE_SHIFT
from .range_coder import FLOOR, ONE, logit_of

LANES = 8
"""Opinions at most: as many as a vector has numbers of 32 bits."""
SEEN = 16
"""Bits of a model's probability, below how many symbols it has seen."""
PLACE, MODEL, LOGIT, STEP = range(0, 4 * LANES, LANES)
"""First lanes of the models' places, of the models, of their logits, and of their steps of adaptation."""
ROOM = 4 * LANES
_SAME = 4
"""Bits by which both the rate of learning and the shift are less, so that products have 32 bits."""
_RATE, _SHIFT = LEARNING >> _SAME, RATE_SHIFT - _SAME
assert _RATE << _SAME == LEARNING


@inlined
def hear_at(cd, lane, i, models, at):
    """List the model at a place as number i; how many symbols it has seen."""
    model = models[np.uint64(at)]
    seen = np.int64(model) >> SEEN
    lane[PLACE + i], lane[MODEL + i] = np.int32(at), model
    lane[LOGIT + i] = np.int32(logit_of(cd, np.int64(model) & ONE - 1, seen))
    lane[STEP + i] = np.int32(cd.rate[np.uint64(seen)])
    return seen


def learn_together(lane: NDArray[np.int32], mix: NDArray[np.int32], error: int) -> None:
    """Let all weights learn from an error of a probability, as ``guesses.decided``."""
    step = np.int32(error * _RATE) * lane[LOGIT : LOGIT + LANES] >> _SHIFT
    mix[:] = np.clip(mix + step, -MOST_MIX, MOST_MIX)


def adapt_together(lane: NDArray[np.int32], bit: int, most: int) -> None:
    """Adapt all models to a symbol, as ``range_coder.adapt``; ``most`` symbols count as seen at most."""
    model = lane[MODEL : MODEL + LANES]
    p, seen = model & ONE - 1, model >> SEEN
    moved = (ONE - p if bit else p) * lane[STEP : STEP + LANES] >> 16
    p = np.clip(p + moved if bit else p - moved, FLOOR, ONE - FLOOR)
    model[:] = p | np.minimum(seen + 1, most) << SEEN


if EXECUTION is Execution.NUMBA:
    from . import lane_vectors

    rules = lane_vectors.Rules(LANES, MODEL, LOGIT, STEP, SEEN, ONE, FLOOR, MOST_MIX, _RATE, _SHIFT)
    lane_vectors.instead_of(learn_together, adapt_together, rules)
