"""Opinions of counts beside those of a network, on symbols of frames that lean on the one before (spec clause 7.18).

What is seen around such a symbol comes to one context of each of several lists; the adaptive probability of each is one
more opinion, mixed with the others by weights that adapt. Nothing of it is trained.
"""

from __future__ import annotations

import numpy as np

from ..kernel import inlined
from .range_coder import ONE, Panel, adapt_in, logit_of

KINDS = 10
"""Kinds of symbols; each has separate weights."""
STEPS, LEVELS, OPINIONS = 19, 33, 16
"""Classes of a margin, of a level, and of the logit without the panel."""
ON, KIND, MARGIN, WIDE_MARGIN, LEVEL, WIDE_LEVEL = range(6)
"""Places in ``Panel.about``: whether the symbol has further opinions, its kind, and what is seen."""
_SIZES = (
    KINDS * STEPS * STEPS, KINDS * LEVELS, 2 * STEPS * OPINIONS, 2 * STEPS * (LEVELS // 4 + 1) * STEPS,
    2 * LEVELS * OPINIONS, 2 * STEPS * OPINIONS, STEPS * LEVELS,
)
"""Contexts of each list."""
VOICES = len(_SIZES)
_FIRST = np.concatenate([[0], np.cumsum(_SIZES)]).astype(np.int64)
_COUNT = int(_FIRST[-1])
_FIRST_WEIGHT = 1 << 12
"""Weight that a further opinion begins with, of 2**16."""
_MOST = 1 << 22
_SHIFT = 21
"""Weights of the panel move half as fast as the others."""


def no_panel() -> Panel:
    """Panel of isovalues that lean on none of the frame before."""
    nothing = np.zeros(0, np.int64)
    return Panel(nothing, nothing, np.zeros((0, VOICES), np.int64), np.zeros(6, np.int64), nothing, nothing)


def new_panel() -> Panel:
    """Panel for the first frame that leans on one before."""
    return Panel(
        np.full(_COUNT, ONE >> 1, np.int64), np.zeros(_COUNT, np.int64),
        np.full((KINDS, VOICES), _FIRST_WEIGHT, np.int64), np.zeros(6, np.int64), np.zeros(VOICES, np.int64),
        np.zeros(VOICES, np.int64),
    )


def panel_after(panel: Panel) -> Panel:
    """Panel for a frame that leans on one with ``panel``."""
    if not len(panel.prob):
        return new_panel()
    return panel._replace(prob=panel.prob.copy(), seen=panel.seen.copy(), mix=panel.mix.copy())


@inlined
def listened(cd, opinion):
    """Sum that the panel adds for a symbol, in 2**16 logits; ``opinion`` is the logit without it."""
    panel = cd.blend.panel
    a, place, said = panel.about, panel.place, panel.said
    kind, near, wide, level, wide_level = a[KIND], a[MARGIN], a[WIDE_MARGIN], a[LEVEL], a[WIDE_LEVEL]
    half = kind & 1
    claim = min((opinion + 2048) >> 8, OPINIONS - 1)
    place[0] = (kind * STEPS + near) * STEPS + wide
    place[1] = _FIRST[1] + kind * LEVELS + level
    place[2] = _FIRST[2] + (near * OPINIONS + claim) * 2 + half
    place[3] = _FIRST[3] + ((near * (LEVELS // 4 + 1) + (level >> 2)) * STEPS + wide) * 2 + half
    place[4] = _FIRST[4] + (level * OPINIONS + claim) * 2 + half
    place[5] = _FIRST[5] + (wide * OPINIONS + claim) * 2 + half
    place[6] = _FIRST[6] + wide * LEVELS + wide_level
    total = np.int64(0)
    for i in range(VOICES):
        at = np.uint64(place[i])
        said[i] = logit_of(cd, panel.prob[at], panel.seen[at])
        total += panel.mix[kind, i] * said[i]
    return total


@inlined
def corrected(cd, error, bit):
    """Move the panel's weights with the error of the mixed probability, and its models."""
    panel = cd.blend.panel
    kind = panel.about[KIND]
    for i in range(VOICES):
        step = (error * panel.said[i]) >> _SHIFT
        panel.mix[kind, i] = min(max(panel.mix[kind, i] + step, -_MOST), _MOST)
        adapt_in(cd, panel.prob, panel.seen, panel.place[i], bit)
