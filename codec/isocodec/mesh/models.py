"""Contexts and mixing weights of explicit domains, and how they start (spec clause 10.4.1)."""

from __future__ import annotations

from ..entropy.context_layout import Layout, opinion_coder
from ..entropy.guesses import DEPTHS
from ..entropy.range_coder import Coder
from .before import AGREED, RINGS
from .growth import CANDIDATES, NEAR

CLASSES = 8
"""Classes of how sure an estimate is."""
PASTS = 64
"""Last symbols, six of them."""
CROSSINGS = 4
"""Classes of what is known about where an edge is crossed; as many more where the frame before knows, too."""
NUMBERS = 4
"""Classes of what is known about a value at a vertex; as many more where the frame before knows, too."""
TURNED = 4
"""Numbers of vertices of a ring whose signs are others than in the frame before: so many or more are one class."""
SHARES = 18
"""Classes of the share of what is around that lies above: none known, 0 to 16."""
RING_COUNTS = 81
"""Numbers of vertices around, and of those above: up to 8 each."""
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
    "LEVEL_RING": (2 * SHARES, 0.5, 0),
    "LEVEL_COUNT": (RING_COUNTS, 0.5, 0),
    "LEVEL_PAST": (4 * SHARES, 0.5, 0),
    "LEVEL_THEN": (3 * AGREED * TURNED * 5, 0.5, 0),
    "LEVEL_THEN_SHARE": (3 * AGREED * SHARES, 0.5, 0),
    "NEW": (16, 0.1, 1),
    "NEW_THEN": (TURNED, 0.5, 0),
    "OFFSET": (2 * CROSSINGS * 4 * DEPTHS, 0.5, 0),
    "VALUE": (2 * NUMBERS * 4 * DEPTHS, 0.5, 0),
})
COMPONENT, FIRST = CONTEXT.firsts("COMPONENT", "FIRST")
SIGN_SURE, SIGN_RING, SIGN_PAST, SIGN_BOTH = CONTEXT.firsts("SIGN_SURE", "SIGN_RING", "SIGN_PAST", "SIGN_BOTH")
SIGN_THEN, SIGN_THEN_SURE = CONTEXT.firsts("SIGN_THEN", "SIGN_THEN_SURE")
COARSE, COARSE_THEN, NEW, NEW_THEN = CONTEXT.firsts("COARSE", "COARSE_THEN", "NEW", "NEW_THEN")
LEVEL_THEN, LEVEL_THEN_SHARE = CONTEXT.firsts("LEVEL_THEN", "LEVEL_THEN_SHARE")
LEVEL_RING, LEVEL_COUNT, LEVEL_PAST = CONTEXT.firsts("LEVEL_RING", "LEVEL_COUNT", "LEVEL_PAST")
OFFSET, VALUE = CONTEXT.firsts("OFFSET", "VALUE")
MIX_SIGN = 0
MIX_OFFSET = MIX_SIGN + CLASSES
MIX_VALUE = MIX_OFFSET + 2 * CROSSINGS * DEPTHS
MIX_LEVEL = MIX_VALUE + 2 * NUMBERS * DEPTHS
MIXES = MIX_LEVEL + SHARES // 2
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
"""Mixing weight that every opinion starts with, of 2**16."""


def new_coder() -> Coder:
    """A coder for all runs of an isovalue."""
    return opinion_coder(CONTEXT, MIXES, WEIGHT)


def coder_of_meshes() -> Coder:
    """A coder for the run of a mesh."""
    return opinion_coder(_MESH, _MESH_MIXES, WEIGHT)
