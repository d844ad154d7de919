"""Opinions in the lanes of a vector: the same numbers as one by one, the largest that there are included."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from brute import examples
from isocodec.entropy.context_layout import opinion_coder
from isocodec.entropy.guesses import LEARNING
from isocodec.entropy.lanes import LANES, LOGIT, MODEL, PLACE, ROOM, SEEN, adapt_together, hear_at, learn_together
from isocodec.entropy.mixer import MOST_MIX, RATE_SHIFT
from isocodec.entropy.range_coder import FLOOR, ONE, adapted, logit_of
from isocodec.grid.passes.raster import CONTEXT
from isospec.tables import MOST_LOGIT

PROBABILITIES = st.sampled_from([FLOOR, FLOOR + 1, ONE // 2, ONE - FLOOR - 1, ONE - FLOOR]) | st.integers(
    FLOOR, ONE - FLOOR
)
CODER = opinion_coder(CONTEXT, 0, 0)
MODELS = st.lists(st.tuples(PROBABILITIES, st.integers(0, len(CODER.rate) - 1)), min_size=1, max_size=LANES)


@examples(100)
@given(MODELS, st.booleans())
def test_models_adapt_as_one_by_one(models: list[tuple[int, int]], bit: bool) -> None:
    lane, table = np.zeros(ROOM, np.int32), np.array([p | seen << SEEN for p, seen in models], np.int32)
    for i, (p, seen) in enumerate(models):
        assert hear_at(CODER, lane, i, table, i) == seen
        assert lane[PLACE + i] == i and lane[LOGIT + i] == logit_of(CODER, p, seen)
    with np.errstate(over="raise"):
        adapt_together(lane, int(bit), len(CODER.rate) - 1)
    for i, (p, seen) in enumerate(models):
        p, seen = adapted(CODER, np.int64(p), np.int64(seen), int(bit))
        assert lane[MODEL + i] == p | seen << SEEN


LOGITS = st.sampled_from([-MOST_LOGIT, -1, 0, 1, MOST_LOGIT]) | st.integers(-MOST_LOGIT, MOST_LOGIT)
WEIGHTS = st.sampled_from([-MOST_MIX, 0, MOST_MIX]) | st.integers(-MOST_MIX, MOST_MIX)


@examples(100)
@given(
    st.lists(LOGITS, min_size=LANES, max_size=LANES), st.lists(WEIGHTS, min_size=LANES, max_size=LANES),
    st.sampled_from([-ONE, ONE]) | st.integers(-ONE, ONE),
)
def test_weights_learn_as_one_by_one(logits: list[int], weights: list[int], error: int) -> None:
    lane, mix = np.zeros(ROOM, np.int32), np.array(weights, np.int32)
    lane[LOGIT : LOGIT + LANES] = logits
    with np.errstate(over="raise"):
        learn_together(lane, mix, error)
    for weight, logit, found in zip(weights, logits, mix, strict=True):
        assert found == min(max(weight + (error * LEARNING * logit >> RATE_SHIFT), -MOST_MIX), MOST_MIX)
