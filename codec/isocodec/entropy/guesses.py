"""Opinions without a network, mixed; and whole numbers that lie near a guess (spec clauses 7.11, 10.4.3).

A pass lists opinions: adaptive probabilities by context, or logits that it works out. A list is mixed by weights that
adapt, as in the main profile. A number of a known range is coded by halving the range; how likely each half is follows
from bells of several widths around the guess.
"""

from __future__ import annotations

import numpy as np

from isospec.tables import MOST_LOGIT

from ..kernel import inlined, inner
from .mixer import MIX_SHIFT, MOST_MIX, RATE, RATE_SHIFT, stretched
from .range_coder import adapt, emit

MOST_OPINIONS = 12
"""Opinions on a symbol at most."""
FINE = 8
"""Guesses and widths count in parts of a whole number: ``2**FINE`` of them."""
DEPTHS = 8
"""Classes of how wide a range is, as against the width of the bell."""
REACH = 1 << 40
"""Distances from a guess beyond this count as this."""


@inlined
def clear_opinions(cd):
    """Begin a list of opinions."""
    cd.blend.row[0] = 0


@inlined
def hear(cd, ctx):
    """One more opinion: an adaptive probability."""
    _list(cd, ctx, stretched(cd, ctx))


@inlined
def say(cd, logit):
    """One more opinion: a logit, in units of 1/256."""
    _list(cd, -1, min(max(logit, -MOST_LOGIT), MOST_LOGIT))


@inlined
def _list(cd, ctx, logit):
    """Enter an opinion, behind the number of them: its context, -1 without one, and its logit."""
    row = cd.blend.row
    k = row[0]
    # unsigned: no test whether it counts from the end
    row[np.uint64(1 + 2 * k)], row[np.uint64(2 + 2 * k)] = ctx, logit
    row[0] = k + 1


@inner
def decided(cd, kind, bit):
    """Code one symbol by the opinions listed, with the mixing weights of ``kind``; as ``range_coder.code``."""
    row = cd.blend.row
    mix = cd.blend.mix[np.uint64(kind)]
    count = np.uint64(row[0])
    total = 0
    for k in range(count):
        total += mix[k] * row[np.uint64(2) + np.uint64(2) * k]
    total = min(max(total >> MIX_SHIFT, -MOST_LOGIT), MOST_LOGIT)
    p = np.int64(cd.blend.squash[np.uint64(total + MOST_LOGIT)])
    bit = emit(cd, p, bit)
    if bit < 0:
        return bit
    error = ((bit << 16) - p) * RATE
    for k in range(count):
        ctx, logit = row[np.uint64(1) + np.uint64(2) * k], row[np.uint64(2) + np.uint64(2) * k]
        mix[k] = min(max(mix[k] + ((error * logit) >> RATE_SHIFT), -MOST_MIX), MOST_MIX)
        if ctx >= 0:
            adapt(cd, ctx, bit)
    return bit


@inlined
def _share(cd, far, width):
    """Share of a bell, of 2**16, that lies below a place ``far`` beyond its centre."""
    bounded = min(max(far, -REACH), REACH)
    logit = min(max((bounded << 8) // width, -MOST_LOGIT), MOST_LOGIT)
    return np.int64(cd.blend.squash[logit + MOST_LOGIT])


@inlined
def _half(cd, guess, width, low, centre, high):
    """Logit for the number to lie in the upper half, by a bell around the guess."""
    below = _share(cd, (low << FINE) - guess, width)
    at = _share(cd, (centre << FINE) - guess, width)
    above = _share(cd, (high << FINE) - guess, width)
    p = ((above - at + 1) << 16) // (above - below + 2)
    return np.int64(cd.blend.stretch[min(max(p, 0), 65535) >> 4])


@inner
def near_guess(cd, kind, ctx, count, bells, number):
    """Code a number from 0 to ``count - 1`` that lies near a guess.

    ``bells`` (4,) holds the guess and its width, which count in the same parts, and a second guess with its width,
    0 without one. ``kind`` is the first of ``DEPTHS`` mixing classes, ``ctx`` the first of ``4 * DEPTHS``
    contexts. Returns the number, or what is negative if the coder stops.
    """
    guess, width = bells[0], bells[1]
    low = np.int64(0)
    high = np.int64(count)
    while high - low > 1:
        centre = (low + high) >> 1
        deep = 0
        while deep < DEPTHS - 1 and (high - low) << FINE < (width << 3) >> deep:
            deep += 1
        clear_opinions(cd)
        say(cd, _half(cd, guess, max(width >> 2, 1), low, centre, high))
        say(cd, _half(cd, guess, max(width, 1), low, centre, high))
        say(cd, _half(cd, guess, width << 2, low, centre, high))
        if bells[3] > 0:
            say(cd, _half(cd, bells[2], max(bells[3] >> 1, 1), low, centre, high))
            say(cd, _half(cd, bells[2], bells[3] << 1, low, centre, high))
        side = 0
        if (centre << FINE) < guess - (width >> 1):
            side = 1
        if (centre << FINE) > guess + (width >> 1):
            side = 2
        if low << FINE > guess or high << FINE < guess:
            side = 3
        hear(cd, ctx + 4 * deep + side)
        bit = decided(cd, kind + deep, np.int64(number >= centre))
        if bit < 0:
            return bit
        if bit:
            low = centre
        else:
            high = centre
    return low
