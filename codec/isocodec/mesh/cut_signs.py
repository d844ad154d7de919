"""Layers of a cut: which vertices of a mesh come back, one by one, and their signs (spec clause 10.8.7)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..entropy.range_coder import Coder, code
from ..kernel import DONE, inner, kernel, record
from ..kernel.types import BoolVector, IntMatrix, IntVector
from .before import UNKNOWN
from .complex import holds
from .levels import OPEN, code_list, comes_back, flip
from .models import MIXED_FACES, SPLIT, UNASKED
from .ring_fit import RingEstimates
from .walk import WalkState


@record
class Cut(NamedTuple):
    """A cut of a history of C cells and N nodes that grows.

    ``cell`` (C, n + 1), ``maker`` (C,), ``first`` (N + 1,), ``patch``, ``star_first`` (N + 1,), ``vertex``,
    ``target`` (N,): as of the history; ``around`` (S, n + 1): cells of the stars; ``inside`` (N,): nodes of the cut;
    ``wanted`` (N,): the encoder's; ``unasked`` (N,): nodes that come without a question, the encoder's at first;
    ``listed``, ``prefix``, ``stack``: room.
    """

    cell: IntMatrix
    maker: IntVector
    first: IntVector
    patch: IntVector
    star_first: IntVector
    around: IntMatrix
    vertex: IntVector
    target: IntVector
    inside: BoolVector
    wanted: BoolVector
    unasked: BoolVector
    listed: IntVector
    prefix: IntVector
    stack: IntVector


@inner
def _missing(c, i):
    """Find the node that collapsed last among those a node needs and the cut lacks, or -1."""
    last = np.int64(-1)
    for k in range(c.first[i], c.first[i + 1]):
        maker = c.maker[c.patch[k]]
        if maker > last and not c.inside[maker]:
            last = maker
    return last


@inner
def _sides(cell, t, but, sign):
    """Signs of the vertices of a cell: 1 for some below, 2 for some above, 3 for both; one vertex does not count."""
    sides = np.int64(0)
    apex = len(sign)
    for j in range(cell.shape[1]):
        u = cell[t, j]
        if u not in (but, apex) and sign[u] != UNKNOWN:
            sides |= np.int64(1) << np.int64(sign[u])
    return sides


@inner
def _crossed(c, sign, i):
    """Whether the cut has a mixed real cell of a node's patch."""
    apex = len(sign)
    for k in range(c.first[i], c.first[i + 1]):
        t = c.patch[k]
        if c.maker[t] >= 0 and not c.inside[c.maker[t]]:
            continue
        if not holds(c.cell, t, apex) and _sides(c.cell, t, apex, sign) == 3:
            return True
    return False


@inner
def _question(c, sign, i):
    """Class of the context of a node that may come back."""
    mixed = np.int64(0)
    apex = len(sign)
    for k in range(c.star_first[i], c.star_first[i + 1]):
        if not holds(c.around, k, apex) and _sides(c.around, k, c.vertex[i], sign) == 3:
            mixed += 1
    return 2 * min(mixed >> 1, np.int64(MIXED_FACES - 1)) + np.int64(_missing(c, i) >= 0)


@inner
def _insert(g, st, cd, c, node):
    """Add a node to the cut, after all that it needs."""
    c.stack[0] = node
    top = np.int64(1)
    while top > 0:
        i = c.stack[top - 1]
        needed = _missing(c, i)
        if needed >= 0:
            c.stack[top] = needed
            top += 1
            continue
        top -= 1
        v = c.vertex[i]
        status = comes_back(g, st, cd, v, c.target[i], c.around, c.star_first[i], c.star_first[i + 1])
        if status < 0:
            return status
        if status == OPEN and c.unasked[i]:
            flip(st, g, v)
        c.inside[i] = True
    return np.int64(DONE)


@kernel
def code_cut(g: RingEstimates, st: WalkState, cd: Coder, c: Cut) -> int:
    """Code which nodes come into a cut, and the signs of their vertices."""
    count = np.int64(0)
    c.prefix[0] = 0
    for i in range(len(c.vertex) - 1, -1, -1):
        if not c.inside[i]:
            c.listed[count] = i
            count += 1
            c.prefix[count] = c.prefix[count - 1] + np.int64(c.unasked[i])
    found = code_list(cd, UNASKED, c.listed, count, c.prefix, c.stack)
    c.unasked[:] = False
    for k in range(found):
        c.unasked[c.listed[k]] = True
    if found < 0:
        return found
    last = np.int64(0)
    for i in range(len(c.vertex) - 1, -1, -1):
        if c.inside[i]:
            continue
        comes = c.unasked[i]
        if not comes and _crossed(c, st.sign, i):
            last = code(cd, SPLIT + 2 * _question(c, st.sign, i) + last, np.int64(c.wanted[i]))
            if last < 0:
                return last
            comes = last == 1
        if comes:
            status = _insert(g, st, cd, c, np.int64(i))
            if status < 0:
                return status
    return DONE
