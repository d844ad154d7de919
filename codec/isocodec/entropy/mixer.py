"""The main profile's models: a trained network and two adaptive probabilities, mixed (spec clause 7.11).

A pass lists what it sees around a symbol as rows of its network. A row is ``HIDDEN`` weights; rows are summed, sums
below 0 count as 0, and their weighted sum is the first opinion on the symbol, in the logistic domain. The second one is
the adaptive probability of the baseline profile's context, the third that of the class of the first opinion: it learns
where the network is too sure or not sure enough. They are mixed by weights that adapt.
"""

from __future__ import annotations

import numpy as np

from isospec.tables import HIDDEN, KINDS, MOST_LOGIT, STARTS

from ..kernel import inlined
from .network import weighed
from .panel import ON, corrected, listened
from .range_coder import ONE, adapt, emit, logit_of

OUT_SHIFT = 8
MIX_SHIFT = 16
MOST_MIX = 1 << 22
RATE = 40
RATE_SHIFT = 20
BUCKET = 7
BUCKETS = (2 * MOST_LOGIT >> BUCKET) + 1
"""Classes of opinions, of ``2**BUCKET`` logits each."""
EITHER = 2
"""Encoder: a symbol that may be either; the more probable one is taken."""


@inlined
def mixing(cd):
    """Whether the profile is the main one."""
    return len(cd.blend.weight) > 0


@inlined
def clear(cd):
    """Begin a list of rows."""
    cd.blend.row[0] = 0


@inlined
def see(cd, row):
    """One more row."""
    rows = cd.blend.row
    count = rows[0] + 1
    rows[0] = count
    rows[np.uint64(count)] = row


@inlined
def _opinion(bl, net):
    """Logit of a 1 by the network."""
    out = bl.out[np.uint64(net)]
    total = np.int64(out[HIDDEN]) + weighed(bl.row, bl.weight, out)
    return min(max(total >> OUT_SHIFT, -MOST_LOGIT), MOST_LOGIT)


@inlined
def stretched(cd, ctx):
    """Logit of an adaptive probability, shrunk as long as few symbols have trained it."""
    at = np.uint64(ctx)
    return logit_of(cd, cd.prob[at], cd.seen[at])


@inlined
def _trace(bl, net, bit):
    """Training: a line with the symbol and its rows."""
    line = bl.trace[0, 0]
    count = bl.row[0]
    if line + 1 < len(bl.trace):
        bl.trace[0, 0] = line + 1
        bl.trace[line + 1, 0] = bit
        bl.trace[line + 1, 1] = net
        bl.trace[line + 1, 2] = count
        for i in range(count):
            bl.trace[line + 1, 3 + i] = bl.row[1 + i]


@inlined
def _learn(mix, i, step):
    """Move a mixing weight, within bounds that no stream can drive sums beyond."""
    mix[i] = min(max(mix[i] + (step >> RATE_SHIFT), -MOST_MIX), MOST_MIX)


@inlined
def blended(cd, net, flip, kind, ctx, bit):
    """Code one symbol by all opinions; as ``code``.

    The rows listed give the probability of a 1, or of a 0 if ``flip``. ``kind`` chooses the weights.
    """
    bl = cd.blend
    opinion = _opinion(bl, net)
    if flip:
        opinion = -opinion
    # the adaptive probabilities of classes of opinions are the last ones that may be trained
    place = STARTS + (kind - KINDS) * BUCKETS + ((opinion + MOST_LOGIT) >> BUCKET)
    own = stretched(cd, ctx)
    mapped = stretched(cd, place)
    mix = bl.mix[np.uint64(kind)]
    total = mix[0] * opinion + mix[1] * own + mix[2] * mapped + (mix[3] << 8)
    heard = bl.panel.about[ON]
    if heard:
        total += listened(cd, opinion)
        bl.panel.about[ON] = 0
    total = min(max(total >> MIX_SHIFT, -MOST_LOGIT), MOST_LOGIT)
    p = np.int64(bl.squash[np.uint64(total + MOST_LOGIT)])
    if bit == EITHER:
        bit = np.int64(2 * p > ONE)
    bit = emit(cd, p, bit)
    if bit < 0:
        return bit
    if len(bl.trace) > 0:
        _trace(bl, net, bit != flip)
    error = ((bit << 16) - p) * RATE
    _learn(mix, 0, error * opinion)
    _learn(mix, 1, error * own)
    _learn(mix, 2, error * mapped)
    _learn(mix, 3, error << 8)
    if heard:
        corrected(cd, error, bit)
    adapt(cd, ctx, bit)
    adapt(cd, place, bit)
    return bit


@inlined
def counted(cd, ctx, bit):
    """Code one symbol that has no network, by its context and the panel; as ``code``."""
    bl = cd.blend
    own = stretched(cd, ctx)
    total = (own << MIX_SHIFT) + listened(cd, own)
    bl.panel.about[ON] = 0
    total = min(max(total >> MIX_SHIFT, -MOST_LOGIT), MOST_LOGIT)
    p = np.int64(bl.squash[np.uint64(total + MOST_LOGIT)])
    bit = emit(cd, p, bit)
    if bit < 0:
        return bit
    corrected(cd, ((bit << 16) - p) * RATE, bit)
    adapt(cd, ctx, bit)
    return bit
