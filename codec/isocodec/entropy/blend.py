"""The main profile's models: a trained network and two adaptive probabilities, mixed (spec clause 7.11).

A pass lists what it sees around a symbol as rows of its network. A row is ``HIDDEN`` weights; rows are summed, sums
below 0 count as 0, and their weighted sum is the first opinion on the symbol, in the logistic domain. The second one is
the adaptive probability of the baseline profile's context, the third that of the class of the first opinion: it learns
where the network is too sure or not sure enough. They are mixed by weights that adapt.
"""

from __future__ import annotations

import numpy as np

from ..jit import inner, kernel
from .coder import ONE, adapt, emit
from .main import (
    BUCKET,
    BUCKETS,
    HIDDEN,
    MAP,
    MIX_SHIFT,
    MOST_LOGIT,
    MOST_MIX,
    OUT_SHIFT,
    RATE,
    RATE_SHIFT,
    STRETCH_SHIFT,
    TRUST_SHIFT,
)

EITHER = 2
"""Encoder: a symbol that may be either; the more probable one is taken."""


@inner
def mixing(cd):
    """Whether the profile is the main one."""
    return len(cd.blend.weight) > 0


@inner
def clear(cd):
    """Begin a list of rows."""
    cd.blend.row[0] = 0


@inner
def see(cd, row):
    """One more row."""
    bl = cd.blend
    bl.row[0] += 1
    bl.row[bl.row[0]] = row


@kernel
def _opinion(row, table, hidden, out):
    """What the network says of a 1, in the logistic domain."""
    # lengths are not constants here: loops that are unrolled before they are seen to be sums of arrays stay slow
    for j in range(len(hidden)):
        hidden[j] = 0
    count = row[0]
    i = 1
    while i + 7 <= count:
        # eight at a time: the sums are read and written less often
        a, b = table[np.uint64(row[np.uint64(i)])], table[np.uint64(row[np.uint64(i + 1)])]
        c, d = table[np.uint64(row[np.uint64(i + 2)])], table[np.uint64(row[np.uint64(i + 3)])]
        e, f = table[np.uint64(row[np.uint64(i + 4)])], table[np.uint64(row[np.uint64(i + 5)])]
        g, h = table[np.uint64(row[np.uint64(i + 6)])], table[np.uint64(row[np.uint64(i + 7)])]
        for j in range(len(hidden)):
            hidden[j] += ((a[j] + b[j]) + (c[j] + d[j])) + ((e[j] + f[j]) + (g[j] + h[j]))
        i += 8
    while i <= count:
        a = table[np.uint64(row[np.uint64(i)])]
        for j in range(len(hidden)):
            hidden[j] += a[j]
        i += 1
    total = np.int64(out[HIDDEN])
    for j in range(len(hidden)):
        total += np.int64(max(hidden[j], np.int32(0))) * np.int64(out[j])
    return min(max(total >> OUT_SHIFT, -MOST_LOGIT), MOST_LOGIT)


@inner
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


@inner
def _learn(mix, kind, i, step):
    """Move a mixing weight, within bounds that no stream can drive sums beyond."""
    mix[kind, i] = min(max(mix[kind, i] + (step >> RATE_SHIFT), -MOST_MIX), MOST_MIX)


@inner
def blended(cd, net, flip, kind, ctx, bit):
    """Code one symbol by all opinions; as ``code``.

    The rows listed say how likely a 1 is, or a 0 if ``flip``. ``kind`` chooses the weights.
    """
    bl = cd.blend
    # a call, not inlined: in a small function more of it is vectorised
    opinion = _opinion(bl.row, bl.weight, bl.hidden, bl.out[net])
    if flip:
        opinion = -opinion
    place = MAP + kind * BUCKETS + ((opinion + MOST_LOGIT) >> BUCKET)
    own = (bl.stretch[cd.prob[ctx] >> STRETCH_SHIFT] * bl.trust[cd.seen[ctx]]) >> TRUST_SHIFT
    mapped = (bl.stretch[cd.prob[place] >> STRETCH_SHIFT] * bl.trust[cd.seen[place]]) >> TRUST_SHIFT
    mix = bl.mix
    total = mix[kind, 0] * opinion + mix[kind, 1] * own + mix[kind, 2] * mapped + (mix[kind, 3] << 8)
    total = min(max(total >> MIX_SHIFT, -MOST_LOGIT), MOST_LOGIT)
    p = bl.squash[total + MOST_LOGIT]
    if bit == EITHER:
        bit = np.int64(2 * p > ONE)
    bit = emit(cd, p, bit)
    if bit < 0:
        return bit
    if len(bl.trace) > 0:
        _trace(bl, net, bit != flip)
    error = ((bit << 16) - p) * RATE
    _learn(mix, kind, 0, error * opinion)
    _learn(mix, kind, 1, error * own)
    _learn(mix, kind, 2, error * mapped)
    _learn(mix, kind, 3, error << 8)
    adapt(cd, ctx, bit)
    adapt(cd, place, bit)
    return bit
