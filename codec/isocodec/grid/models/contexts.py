"""The baseline profile: where each syntax element's contexts lie and how they start (spec clause 7).

Contexts are numbered once, here; a pass adds what it knows to the first number of its element.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...entropy.context_layout import Layout
from ...entropy.range_coder import ONE
from ...kernel import inlined
from .corner_patterns import PATTERNS

PLANES = 52
DEPTHS = 25
LEVELS = 64
NEARNESS = 5
CURVE = 4 * 2 * 2 * 3 * 2
SURFACE = 3 * 4 * 4 * 4
BANKS = 7
"""Banks of contexts of refinement signs: one without an earlier isovalue, six by its sign and the corners' there."""
NEAR = 8
"""Classes of how far a guessed value or crossing lies from the middle of what is left, to either side."""
CURVE_STARTS = (
    (7, 11, 9, 10, 11, 10), (7, 11, 9, 10, 11, 10),
    (6, 8, 7, 10, 10, 5), (10, 12, 7, 12, 8, 7),
    (10, 12, 11, 7, 10, 8), (12, 12, 8, 12, 9, 7),
    (10, 15, 8, 8, 10, 8), (14, 15, 6, 10, 11, 5),
)
"""Probabilities, of 16, that the stiff parabola is right at the start.

A row for each of its cases without and with the free one's consent; by the vertices beside and beyond (clause 7.1).
"""
# element: (contexts, probability of a 1 at the start, weight of that start in symbols)
_LAYOUT = Layout({
    "ORIGIN": (3, 0.5, 1),
    "COMPONENT": (1, 0.8, 1),
    "ROOT": (1, 0.5, 1),
    "PATH": (2, 0.5, 4),
    "FIRST": (3 * 8, 0.5, 1),
    "BASE_CURVE": (3 * CURVE, 0.5, 6),
    "BASE_SURFACE": (3 * SURFACE, 0.8, 4),
    "SIGNIFICANT": (DEPTHS * 3, 0.5, 1),
    "SIGNIFICANT_LEAF": (4 * NEARNESS * 3, 0.2, 2),
    "SIGN": (BANKS * PATTERNS, 0.2, 4),
    "SIGN_CROSSED": (BANKS * PATTERNS, 0.8, 4),
    "VALUE": (PLANES * 2 * 3, 0.5, 2),
    "OFFSET": (2 * 8 * 9, 0.5, 2),
    "LEVEL": (3 * 2 * 4, 0.5, 2),
    "LEVEL_PATH": (LEVELS, 0.8, 2),
    "SPLIT": (3 * 2 * 4 * 8, 0.5, 2),
    "CONTINUE": (1, 0.8, 2),
    "SEED": (2 * 4 * 2, 0.5, 2),
    "OFFSET_LEAN": (8 * 16, 0.5, 2),
    "CONTRARY": (1, 0.02, 2),
    "VALUE_NEAR": (16 * 2 * 2 * NEAR, 0.5, 0),
    "OFFSET_NEAR": (2 * 4 * 2 * 2 * NEAR, 0.5, 0),
})
CONTEXTS = _LAYOUT.count
ORIGIN = _LAYOUT["ORIGIN"]
COMPONENT = _LAYOUT["COMPONENT"]
ROOT = _LAYOUT["ROOT"]
PATH = _LAYOUT["PATH"]
FIRST = _LAYOUT["FIRST"]
BASE_CURVE = _LAYOUT["BASE_CURVE"]
BASE_SURFACE = _LAYOUT["BASE_SURFACE"]
SIGNIFICANT = _LAYOUT["SIGNIFICANT"]
SIGNIFICANT_LEAF = _LAYOUT["SIGNIFICANT_LEAF"]
SIGN = _LAYOUT["SIGN"]
SIGN_CROSSED = _LAYOUT["SIGN_CROSSED"]
VALUE = _LAYOUT["VALUE"]
OFFSET = _LAYOUT["OFFSET"]
LEVEL = _LAYOUT["LEVEL"]
LEVEL_PATH = _LAYOUT["LEVEL_PATH"]
SPLIT = _LAYOUT["SPLIT"]
CONTINUE = _LAYOUT["CONTINUE"]
SEED = _LAYOUT["SEED"]
OFFSET_LEAN = _LAYOUT["OFFSET_LEAN"]
CONTRARY = _LAYOUT["CONTRARY"]
VALUE_NEAR = _LAYOUT["VALUE_NEAR"]
OFFSET_NEAR = _LAYOUT["OFFSET_NEAR"]


@inlined
def near_class(far):
    """Class of how far a guess lies from the middle of what is left, from 0 to ``2 * NEAR - 1``."""
    return NEAR + min(max(far, -NEAR), NEAR - 1)


def models() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Probability of a 1 and number of symbols seen, for all contexts, before the first symbol of a file."""
    prob, seen = _LAYOUT.begun()
    # whatever the third vertex and the bank are
    prob[BASE_CURVE : BASE_CURVE + 3 * CURVE] = np.tile(np.repeat(np.ravel(CURVE_STARTS) * (ONE >> 4), 2), 3)
    _gaussian(prob)
    return prob, seen


def _gaussian(prob: NDArray[np.int64]) -> None:
    """Value bits start from a bell around the isovalue: the farther half of the nearest interval is rare."""
    for plane in range(PLANES):
        far = round(ONE * (0.4 if plane == 0 else 0.25 if plane < 3 else 0.1))
        prob[VALUE + plane * 6 : VALUE + plane * 6 + 3] = far
