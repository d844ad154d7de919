"""Contexts and mixing weights of explicit domains, and how they start (spec clause 10.4.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..entropy.context_layout import Layout, opinion_coder
from ..entropy.guesses import DEPTHS
from ..entropy.range_coder import ONE, Coder
from .before import AGREED, RINGS
from .growth import CANDIDATES, NEAR

CLASSES = 8
"""Classes of the certainty of an estimate."""
PASTS = 64
"""Patterns of the last six symbols."""
CROSSINGS = 4
"""Classes of the knowledge of a crossing; twice as many with that of the previous frame or of another isovalue."""
NUMBERS = 4
"""Classes of the knowledge of a value at a vertex; twice as many with that of the previous frame."""
SHIFTS = 16
"""Classes of the part of a step, beyond whole ones, by which an isovalue lies above another one."""
CHANGED = 4
"""Classes of the number of vertices of a ring whose signs changed since the previous frame."""
SHARES = 18
"""Classes of the share of the surroundings that lies above: unknown, 0 to 16."""
PARTS = 16
"""Classes of the share of a ring's weight with a sign."""
TILTS = 12
"""Classes of the tilt of the signs around a ring."""
MOST_COUNT = 30
"""Number of vertices of a ring, or of those with a sign, from which on all are one class."""
MIXED_FACES = 6
"""Classes of half the number of faces of a ring that have both signs."""
FIT_BOUNDS = (2, 5, 10, 16, 26, 38, 54, 77, 109, 160)
"""Lower bounds of the classes of fits after the first, in 1/64 of the mean distance."""
SIZES = len(FIT_BOUNDS) + 1
# element: (contexts, probability of a 1 at the start, weight of that start in symbols)
CONTEXT = Layout({
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
    "LEVEL_FIT": (8 * SIZES, 0.5, 4),
    "LEVEL_RING": (TILTS * PARTS, 0.5, 4),
    "LEVEL_SHARE": (2 * PARTS * SIZES, 0.5, 4),
    "LEVEL_TILT": (TILTS * SIZES, 0.5, 4),
    "LEVEL_COUNT": ((MOST_COUNT + 1) ** 2, 0.5, 4),
    "LEVEL_PAST": (16 * SIZES, 0.5, 4),
    "LEVEL_SLOPE": (24 * SIZES, 0.5, 4),
    "LEVEL_THEN": (3 * AGREED * CHANGED * 4, 0.5, 0),
    "LEVEL_THEN_SHARE": (3 * AGREED * (PARTS + 1), 0.5, 0),
    "NEW": (16, 0.1, 1),
    "NEW_THEN": (CHANGED, 0.5, 0),
    "UNASKED": (16, 0.1, 1),
    "SPLIT": (4 * MIXED_FACES, 0.5, 0),
    "OFFSET": (2 * CROSSINGS * 4 * DEPTHS, 0.5, 0),
    "VALUE": (2 * NUMBERS * 4 * DEPTHS, 0.5, 0),
    "HIGHER": (SHIFTS, 0.5, 0),
})
COMPONENT, FIRST = CONTEXT.firsts("COMPONENT", "FIRST")
SIGN_SURE, SIGN_RING, SIGN_PAST, SIGN_BOTH = CONTEXT.firsts("SIGN_SURE", "SIGN_RING", "SIGN_PAST", "SIGN_BOTH")
SIGN_THEN, SIGN_THEN_SURE = CONTEXT.firsts("SIGN_THEN", "SIGN_THEN_SURE")
COARSE, COARSE_THEN, NEW, NEW_THEN = CONTEXT.firsts("COARSE", "COARSE_THEN", "NEW", "NEW_THEN")
UNASKED, SPLIT = CONTEXT.firsts("UNASKED", "SPLIT")
LEVEL_THEN, LEVEL_THEN_SHARE = CONTEXT.firsts("LEVEL_THEN", "LEVEL_THEN_SHARE")
LEVEL_FIT, LEVEL_RING, LEVEL_SHARE = CONTEXT.firsts("LEVEL_FIT", "LEVEL_RING", "LEVEL_SHARE")
LEVEL_TILT, LEVEL_COUNT = CONTEXT.firsts("LEVEL_TILT", "LEVEL_COUNT")
LEVEL_PAST, LEVEL_SLOPE = CONTEXT.firsts("LEVEL_PAST", "LEVEL_SLOPE")
OFFSET, VALUE, HIGHER = CONTEXT.firsts("OFFSET", "VALUE", "HIGHER")
MIX_SIGN = 0
MIX_OFFSET = MIX_SIGN + CLASSES
MIX_VALUE = MIX_OFFSET + 2 * CROSSINGS * DEPTHS
MIX_LEVEL = MIX_VALUE + 2 * NUMBERS * DEPTHS
MIXES = MIX_LEVEL + SIZES
# For the run of a mesh (spec clause 10.10): the same.
_MESH = Layout({
    "CLOSED": (4 * NEAR, 0.5, 0),
    "CLOSED_PAST": (64, 0.5, 0),
    "KNOWN": (4 * NEAR, 0.5, 0),
    "KNOWN_COUNT": (4 * NEAR, 0.5, 0),
    "WHICH": (4 * NEAR * CANDIDATES, 0.5, 0),
    "FAR": (1, 0.5, 0),
    "AGAIN": (1, 0.5, 0),
    "PLACE": (2 * 3 * 4 * DEPTHS, 0.5, 0),
})
CLOSED, CLOSED_PAST, KNOWN, KNOWN_COUNT = _MESH.firsts("CLOSED", "CLOSED_PAST", "KNOWN", "KNOWN_COUNT")
WHICH, FAR, AGAIN, PLACE = _MESH.firsts("WHICH", "FAR", "AGAIN", "PLACE")
MIX_CLOSED = 0
MIX_KNOWN = MIX_CLOSED + 4
MIX_PLACE = MIX_KNOWN + 1 + CANDIDATES
_MESH_MIXES = MIX_PLACE + 2 * 3 * DEPTHS
WEIGHT = 22000
"""Initial mixing weight of every opinion, out of 2**16."""
LEVEL_WEIGHT = 11000
"""Initial mixing weight of opinions on signs of returning vertices."""
BY_SIZE = (51, 57, 64, 74, 85, 94, 98, 99, 99, 97, 91)
BY_SHARE = (46, 46, 51, 55, 60, 60, 62, 65, 68, 72, 79, 84, 90, 95, 98, 99)
BY_TILT = (61, 72, 73, 74, 78, 82, 85, 87, 91, 93, 95, 95)
"""Hundredths of fits with the right sign: by the class of their size, the share of their ring with that sign, and how
far signs around lean towards it."""


def _level_starts() -> dict[int, NDArray[np.int64]]:
    """Sums of two beginnings, in hundredths, of the contexts of signs of vertices that come back, by the first one."""
    size, share, tilt = (np.array(each) for each in (BY_SIZE, BY_SHARE, BY_TILT))
    k, a = np.divmod(np.arange((MOST_COUNT + 1) ** 2), MOST_COUNT + 1)
    counted = share[np.minimum(a * PARTS // np.maximum(k, 1), PARTS - 1)]
    return {
        LEVEL_FIT: np.repeat(2 * size, 8), LEVEL_RING: (share[:, None] + tilt).ravel(),
        LEVEL_SHARE: np.repeat((size[:, None] + share).ravel(), 2), LEVEL_TILT: (size[:, None] + tilt).ravel(),
        LEVEL_COUNT: 2 * counted, LEVEL_PAST: np.repeat(2 * size, 16), LEVEL_SLOPE: np.repeat(2 * size, 24),
    }


def new_coder() -> Coder:
    """A coder for all runs of an isovalue."""
    coder = opinion_coder(CONTEXT, MIXES, WEIGHT)
    for first, sums in _level_starts().items():
        coder.prob[first : first + len(sums)] = np.rint(sums * (ONE / 200))
    coder.blend.mix[MIX_LEVEL:] = LEVEL_WEIGHT
    return coder


def coder_of_meshes() -> Coder:
    """A coder for the run of a mesh."""
    return opinion_coder(_MESH, _MESH_MIXES, WEIGHT)
