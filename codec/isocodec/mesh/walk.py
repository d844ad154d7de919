"""The base of an explicit domain: components, first signs, the walk through gates (spec clause 10.3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..entropy.guesses import clear_opinions, decided, hear
from ..entropy.range_coder import DECODE, ONE, Coder, code, emit
from ..kernel import BAD, DONE, inlined, inner, kernel, record
from ..kernel.types import BoolVector, Int8Vector, IntVector, Registers
from .affine import beyond
from .before import RINGS, UNKNOWN, learn_agreement, sign_before, spread, surplus
from .complex import CellArrays
from .models import (
    CLASSES,
    COMPONENT,
    FIRST,
    MIX_SIGN,
    SIGN_BOTH,
    SIGN_PAST,
    SIGN_RING,
    SIGN_SURE,
    SIGN_THEN,
    SIGN_THEN_SURE,
)

ESTIMATE = 1 << 10
"""Initial estimate of the distance of a vertex from the isovalue."""
LEAST, MOST = ESTIMATE * 3 // 10, ESTIMATE * 2
"""Bounds of later estimates."""
VISITED, NOT_MIXED = 1, 2
REASONS = {
    VISITED: ("a component starts in a cell that was visited before", "10.3.1"),
    NOT_MIXED: ("a component starts in a cell that the curve does not cross", "10.3.1"),
}
"""Message and clause of each error."""


class WalkRegisters(Registers):
    """Progress of the walk.

    Attributes
    ----------
    leaves, known : int
        Crossed cells and known vertices so far.
    past : int
        Last symbols of the walk as bits, the latest lowest.
    leans : int
        1 if there is a frame before, else 0.
    agreed : int
        Whether the last signs were those of the frame before, as bits, the latest lowest.
    error : int
        One of ``REASONS``, where a kernel returned BAD.
    """

    leaves: int
    known: int
    past: int
    leans: int
    agreed: int
    error: int


@record
class WalkState(NamedTuple):
    """State of an isovalue on a complex of V vertices and T cells.

    ``sign`` (V,): 1, 0, or -1 if not known; ``given`` (V,): the signs that follow from earlier isovalues; ``truth``
    (V,): the encoder's signs; ``estimate`` (V,): how far vertices may lie above; ``visited`` (T,); ``leaf`` (T,): the
    crossed cells in their order; ``stack``: gates, as cell times (n + 1) plus face; ``spread`` (2 NUMBERS,): how far
    guesses of values have been wrong; ``before`` (V,): signs of the frame before, or -1; ``bells`` (4,): as of
    `near_guess`; ``drift`` (2,): by how much places or numbers have moved since the frame before, and how far that has
    been wrong.
    """

    sign: Int8Vector
    given: Int8Vector
    truth: Int8Vector
    estimate: IntVector
    visited: BoolVector
    leaf: IntVector
    stack: IntVector
    spread: IntVector
    before: Int8Vector
    bells: IntVector
    drift: IntVector
    reg: WalkRegisters


@inlined
def _learn(st, v, sign, estimate):
    """Enter the sign and the estimate of a vertex."""
    st.sign[v] = sign
    st.estimate[v] = estimate if sign else -estimate
    st.reg.known += 1


@inlined
def mixed(mesh, st, t):
    """Whether a cell whose signs are all known has both."""
    above = np.int64(0)
    for i in range(mesh.cell.shape[1]):
        above += st.sign[mesh.cell[t, i]]
    return 0 < above < mesh.cell.shape[1]


@inner
def _next_start(mesh, st, least):
    """Encoder: first crossed cell from ``least`` on that was not visited, or -1."""
    for t in range(least, len(mesh.cell)):
        if not st.visited[t]:
            first = st.truth[mesh.cell[t, 0]]
            for i in range(1, mesh.cell.shape[1]):
                if st.truth[mesh.cell[t, i]] != first:
                    return t
    return -1


@inner
def uniform(cd, low, high, number):
    """Code a number from ``low`` to ``high - 1``, all equally likely."""
    while high - low > 1:
        middle = (low + high) >> 1
        bit = emit(cd, ONE >> 1, np.int64(number >= middle))
        if bit < 0:
            return bit
        if bit:
            low = middle
        else:
            high = middle
    return low


@inner
def _first_signs(mesh, st, cd, t):
    """Code the signs of the first cell of a component."""
    last = mesh.cell.shape[1] - 1
    for i in range(last + 1):
        v = mesh.cell[t, i]
        if st.sign[v] != UNKNOWN:
            continue
        bit = np.int64(st.given[v])
        if bit == UNKNOWN:
            seen = np.int64(0)
            above = np.int64(0)
            for j in range(last + 1):
                sign = st.sign[mesh.cell[t, j]]
                if sign != UNKNOWN:
                    seen += 1
                    above += sign
            if seen == last and (above == 0 or above == last):
                bit = np.int64(above == 0)
            else:
                bit = code(cd, FIRST + 4 * seen + above, np.int64(st.truth[v]))
                if bit < 0:
                    return bit
        _learn(st, v, bit, ESTIMATE)
    return DONE


@inlined
def _visit(mesh, st, t):
    """Take a crossed cell as a leaf and push its gates."""
    corners = mesh.cell.shape[1]
    st.visited[t] = True
    st.leaf[st.reg.leaves] = t
    st.reg.leaves += 1
    count = st.stack[0]
    for i in range(corners):
        other = mesh.neighbour[t, i]
        if other < 0 or st.visited[other]:
            continue
        above = np.int64(0)
        for j in range(corners):
            if j != i:
                above += st.sign[mesh.cell[t, j]]
        if above > 0 and above < corners - 1:
            count += 1
            st.stack[count] = t * corners + i
    st.stack[0] = count


@inner
def _apex_sign(mesh, st, cd, t, o, v):
    """Code the sign of the vertex v across face o of the leaf t."""
    guess = beyond(mesh, st.estimate, t, o, v)
    above = np.int64(guess > 0)
    size = min(abs(guess), MOST)
    if st.given[v] != UNKNOWN:
        bit = np.int64(st.given[v] == above)
    else:
        more = surplus(mesh, st.sign, v)
        ring = (more if above else -more) + RINGS // 2
        sure = min((size * CLASSES) // (2 * ESTIMATE), CLASSES - 1)
        left = np.int64(st.sign[mesh.cell[t, o]])
        past = st.reg.past
        turned = past & 7 if above else 7 - (past & 7)
        clear_opinions(cd)
        hear(cd, SIGN_SURE + 3 * sure + (2 if ring > RINGS // 2 else np.int64(ring == RINGS // 2)))
        hear(cd, SIGN_RING + RINGS * sure + ring)
        hear(cd, SIGN_PAST + 2 * (past & 63) + above)
        hear(cd, SIGN_BOTH + 3 * (8 * ring + turned) + (2 if sure > 3 else np.int64(left == above)))
        if st.reg.leans:
            more = surplus(mesh, st.before, v)
            seen = 3 * ((more if above else -more) + RINGS // 2) + sign_before(st, v, above)
            hear(cd, SIGN_THEN + 27 * st.reg.agreed + seen)
            hear(cd, SIGN_THEN_SURE + 27 * sure + seen)
        bit = decided(cd, MIX_SIGN + sure, np.int64(st.truth[v] == above))
        if bit < 0:
            return bit
    sign = above if bit else 1 - above
    st.reg.past = (st.reg.past << 1 | sign) & 63
    learn_agreement(st, v, sign)
    _learn(st, v, sign, max(size, LEAST) if bit else LEAST)
    return DONE


@inner
def _walk(mesh, st, cd):
    """Follow all gates of the stack."""
    corners = mesh.cell.shape[1]
    while st.stack[0] > 0:
        gate = st.stack[st.stack[0]]
        st.stack[0] -= 1
        left = gate // corners
        face = gate - left * corners
        t = mesh.neighbour[left, face]
        if st.visited[t]:
            continue
        apex = np.int64(0)
        for i in range(corners):
            if mesh.neighbour[t, i] == left:
                apex = mesh.cell[t, i]
        if st.sign[apex] == UNKNOWN:
            status = _apex_sign(mesh, st, cd, left, face, apex)
            if status < 0:
                return status
        _visit(mesh, st, t)
    return DONE


@kernel
def trace(mesh: CellArrays, st: WalkState, cd: Coder) -> None:
    """List the leaves in the order of a walk, once all signs are known."""
    for t in range(len(mesh.cell)):
        if st.visited[t] or not mixed(mesh, st, t):
            continue
        st.stack[0] = 0
        _visit(mesh, st, t)
        _walk(mesh, st, cd)


@kernel
def code_base(mesh: CellArrays, st: WalkState, cd: Coder) -> int:
    """Code all components: the encoder's from ``truth``, the decoder's from the run."""
    least = 0
    while least < len(mesh.cell):
        start = np.int64(-1)
        if cd.reg.mode != DECODE:
            start = np.int64(_next_start(mesh, st, least))
        bit = code(cd, COMPONENT, np.int64(start >= 0))
        if bit < 0:
            return bit
        if bit == 0:
            return DONE
        t = uniform(cd, np.int64(least), np.int64(len(mesh.cell)), start)
        if t < 0:
            return t
        if st.visited[t]:
            st.reg.error = VISITED
            return BAD
        status = _first_signs(mesh, st, cd, t)
        if status < 0:
            return status
        if not mixed(mesh, st, t):
            st.reg.error = NOT_MIXED
            return BAD
        st.stack[0] = 0
        _visit(mesh, st, t)
        status = _walk(mesh, st, cd)
        if status < 0:
            return status
        least = t + 1
    return DONE


@kernel
def code_parts(mesh: CellArrays, st: WalkState, cd: Coder, sign: Int8Vector, queue: IntVector) -> int:
    """Code the signs of connected parts of the mesh that no curve enters.

    ``sign`` (V,) are the signs that follow from the components (`spread_signs`); ``queue`` (V,) is scratch space.
    """
    for seed in range(len(sign)):
        if sign[seed] != UNKNOWN or mesh.first[seed] == mesh.first[seed + 1]:
            continue
        bit = np.int64(st.given[seed])
        if bit == UNKNOWN:
            bit = code(cd, FIRST, np.int64(st.truth[seed]))
            if bit < 0:
                return bit
        st.sign[seed] = sign[seed] = bit
        queue[0] = seed
        spread(mesh, sign, queue, np.int64(1))
    return DONE
