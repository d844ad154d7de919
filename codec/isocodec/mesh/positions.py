"""Crossings on the edges of an explicit domain, and values at vertices (spec clause 10.6)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..entropy.guesses import DEPTHS, FINE, near_guess
from ..entropy.range_coder import Coder, code
from ..kernel import DONE, inlined, inner, kernel
from ..kernel.types import IntMatrix, IntVector
from .affine import beyond
from .complex import CellArrays
from .models import CROSSINGS, HIGHER, MIX_OFFSET, MIX_VALUE, NUMBERS, OFFSET, VALUE
from .walk import WalkState

LARGE, SMALL = 1 << 24, 1 << 4
"""Bounds of the estimated distance of vertices from the isovalue."""
START = 1 << 14
"""Size of the estimate for the first vertex of a component."""
PLACE = 16
"""Places on an edge are multiples of ``2**-PLACE`` of it."""
MOST_PARTS = 1 << 24
STEPS = 256
"""Steps of offsets per unit of positions."""
LARGEST, WIDEST = 1 << 44, 1 << 48
"""Upper bounds of numbers, and of errors of guesses in parts, where others are predicted from them."""
HALF = 1 << (FINE - 1)


def crossed_edges(mesh: CellArrays, leaf: NDArray[np.int64], sign: NDArray[np.int8]) -> NDArray[np.int64]:
    """Edges of the leaves whose ends differ in sign, each once, in the order of the leaves: (E, 3) int64.

    The lower vertex, the other one, and the leaf that has it first, as its place in the list.
    """
    cells = mesh.cell[leaf]
    corners = cells.shape[1]
    pairs = [(i, j) for i in range(corners) for j in range(i + 1, corners)]
    ends = np.stack([np.sort(cells[:, pair], axis=1) for pair in pairs], axis=1).reshape(-1, 2)
    owner = np.repeat(np.arange(len(leaf)), len(pairs))
    crossed = sign[ends[:, 0]] != sign[ends[:, 1]]
    ends, owner = ends[crossed], owner[crossed]
    _, first = np.unique(ends[:, 0] * np.int64(len(sign)) + ends[:, 1], return_index=True)
    first.sort()
    return np.column_stack([ends[first], owner[first]])


def parts_of(mesh: CellArrays, edges: NDArray[np.int64], step: int) -> NDArray[np.int64]:
    """Number of equal parts of each edge, none longer than ``step`` / ``STEPS`` units of positions."""
    side = mesh.position[edges[:, 1]] - mesh.position[edges[:, 0]]
    largest = np.abs(side).max(axis=1, initial=1)
    # so that the sum of three squares, of differences in steps, is below 2**63
    shift = np.maximum(np.frexp(largest.astype(np.float64))[1] - 22, 0).astype(np.int64)
    square = ((side >> shift[:, None]) ** 2).sum(axis=1) * STEPS**2
    length = np.sqrt(square.astype(np.float64)).astype(np.int64)
    length += (length + 1) ** 2 <= square
    length -= length**2 > square
    return np.clip(-(-((length + 1) << shift) // step), 1, MOST_PARTS)


@inlined
def _bounded(value, sign):
    """A value on the side of its sign, within bounds."""
    size = min(max(value if sign else -value, SMALL), LARGE)
    return size if sign else -size


@inner
def _guessed(mesh, st, t, v):
    """Extrapolate the value of vertex v of cell t from the cell across the opposite face; 0 if that is not known."""
    corners = mesh.cell.shape[1]
    for i in range(corners):
        if mesh.cell[t, i] != v:
            continue
        other = mesh.neighbour[t, i]
        if other < 0:
            return np.int64(0)
        o = np.int64(0)
        for j in range(corners):
            if st.estimate[mesh.cell[other, j]] == 0:
                return np.int64(0)
            if mesh.neighbour[other, j] == t:
                o = np.int64(j)
        return beyond(mesh, st.estimate, other, o, v)
    return np.int64(0)


@inlined
def _expect_then(st, place, upwards, known):
    """Set the second guess: the previous frame's value plus the drift of others; none if it is unknown."""
    st.bells[2] = place + (st.drift[0] if upwards else -st.drift[0])
    st.bells[3] = (st.drift[1] if st.drift[1] > 0 else st.bells[1]) if known else np.int64(0)


@inlined
def _learn_width(width, kind, wrong):
    """Record by how much a guess has been wrong."""
    if width[kind] == 0:
        width[kind] = wrong
    width[kind] = max(width[kind] + ((wrong - width[kind]) >> 4), 1 << (FINE - 2))


@inlined
def _learn_drift(st, moved, upwards):
    """Record by how much a place or number has moved, towards the upper side if ``upwards``."""
    step = moved if upwards else -moved
    _learn_width(st.drift, 1, abs(step - st.drift[0]))
    st.drift[0] += (step - st.drift[0]) >> 3


@inlined
def _span(st, near, a, b):
    """Difference between the values of both ends of an edge at another isovalue; 0 if unknown, or of the wrong sign."""
    span = near[b] - near[a]
    return span if near[a] != 0 and near[b] != 0 and (span > 0) == (st.sign[b] == 1) else np.int64(0)


@inlined
def _expect_shift(st, near, shift, a, b, span, then, count):
    """Guess a crossing from the values at another isovalue; the guess so far becomes the second one.

    Returns the class of the guess, or -1, and no second guess, without one.
    """
    st.bells[3] = 0
    by = shift[a] if shift[a] != 0 else shift[b]
    if span == 0 or by == 0:
        return -1
    if shift[b] != 0:
        by = (by + shift[b]) >> 1
    kind = 0 if then > 0 else 1
    place = then + by // span if then > 0 else (by - (near[a] << PLACE)) // span
    st.bells[2], st.bells[3] = st.bells[0], st.bells[1]
    st.bells[0] = min(max(place, 0), 1 << PLACE) * count >> (PLACE - FINE)
    if st.drift[kind] > 0:
        st.bells[1] = st.drift[kind]
    return kind


@inlined
def _learn_shift(near, shift, a, b, span, then, place):
    """Record how far this isovalue lies above the other one at both ends of an edge that it crosses at ``place``."""
    by = (place - then) * span if then > 0 else place * span + (near[a] << PLACE)
    shift[a] = shift[a] + ((by - shift[a]) >> 2) if shift[a] != 0 else by
    shift[b] = shift[b] + ((by - shift[b]) >> 2) if shift[b] != 0 else by


@kernel
def code_offsets(
    mesh: CellArrays, st: WalkState, cd: Coder, edges: IntMatrix, parts: IntVector, number: IntVector, then: IntVector,
    near: IntVector, shift: IntVector
) -> int:
    """Code which part of each edge is crossed, counted from its lower vertex.

    ``st.estimate``, 0 at first, receives values that are right up to a factor. ``then`` (E,) is where the edge was
    crossed in the previous frame, in ``2**-PLACE`` of it; 0 where it was not. Or it is the same of another isovalue,
    with the values ``near`` (V,) there, which are empty otherwise; ``shift`` (V,), 0 at first, receives how far this
    isovalue lies above that one, in such values times ``2**PLACE``.
    """
    leans = len(near) > 0
    for k in range(len(edges)):
        a, b = edges[k, 0], edges[k, 1]
        t = st.leaf[edges[k, 2]]
        if st.estimate[a] == 0 and st.estimate[b] == 0:
            st.estimate[a] = START if st.sign[a] else -START
        case = 0
        va = st.estimate[a]
        vb = st.estimate[b]
        if va != 0 and vb != 0:
            case = 1
        elif vb == 0:
            vb = _guessed(mesh, st, t, b)
            if vb != 0:
                case = 2 if (vb > 0) == (st.sign[b] == 1) else 3
        else:
            va = _guessed(mesh, st, t, a)
            if va != 0:
                case = 2 if (va > 0) == (st.sign[a] == 1) else 3
        guess = np.int64(1) << (PLACE - 1)
        if case > 0:
            va = _bounded(va, st.sign[a])
            vb = _bounded(vb, st.sign[b])
            guess = (va << PLACE) // (va - vb)
        width = parts[k] << FINE
        width = width >> (1 if case == 0 else 3)
        count = parts[k]
        middle = (guess * count) >> (PLACE - FINE)
        st.bells[0], st.bells[1] = middle, max(width, 1 << (FINE - 2))
        span, kind = np.int64(0), -1
        if leans:
            span = _span(st, near, a, b)
            kind = _expect_shift(st, near, shift, a, b, span, then[k], count)
            if kind >= 0:
                case = CROSSINGS + kind
        else:
            if then[k] > 0:
                case += CROSSINGS
            _expect_then(st, then[k] * count >> (PLACE - FINE), st.sign[b] == 1, then[k] > 0)
        found = near_guess(
            cd, MIX_OFFSET + DEPTHS * case, OFFSET + 4 * DEPTHS * case, count, st.bells, number[k]
        )
        if found < 0:
            return found
        number[k] = found
        if kind >= 0:
            _learn_width(st.drift, kind, abs((found << FINE) + HALF - st.bells[0]))
        if then[k] > 0 and not leans:
            _learn_drift(st, (found << FINE) + HALF - (then[k] * count >> (PLACE - FINE)), st.sign[b] == 1)
        # the middle of the part, as a place on the edge
        place = ((2 * found + 1) << PLACE) // (2 * count)
        place = min(max(place, 1), (1 << PLACE) - 1)
        if span != 0:
            _learn_shift(near, shift, a, b, span, then[k], place)
        if st.estimate[b] == 0:
            st.estimate[b] = _bounded(st.estimate[a] - (st.estimate[a] << PLACE) // place, st.sign[b])
        elif st.estimate[a] == 0:
            st.estimate[a] = _bounded(-(st.estimate[b] * place) // ((1 << PLACE) - place), st.sign[a])
    return DONE


def active_vertices(edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """List the ends of crossed edges, each once, in order, with the leaf where each first occurs: (A, 2) int64."""
    ends = edges[:, :2].ravel()
    _, first = np.unique(ends, return_index=True)
    first.sort()
    return np.column_stack([ends[first], np.repeat(edges[:, 2], 2)[first]])


@inlined
def _mean_around(mesh, st, v):
    """Mean size of the values that are known around a vertex; 0 if none is."""
    total = 0
    count = 0
    for k in range(mesh.first[v], mesh.first[v + 1]):
        for i in range(mesh.cell.shape[1]):
            value = st.estimate[mesh.cell[mesh.star[k], i]]
            if value != 0:
                total += abs(value) >> 8
                count += 1
    return (total // count) << 8 if count else np.int64(0)


@kernel
def code_values(
    mesh: CellArrays, st: WalkState, cd: Coder, active: IntMatrix, bits: IntVector, number: IntVector, then: IntVector,
    least: IntVector, higher: IntVector
) -> int:
    """Code the numbers of active vertices, of ``bits[sign]`` bits.

    ``st.estimate``, 0 at first, receives twice the numbers plus 1, with the sign of their side. ``then`` (A,) is the
    same for the previous frame, 0 where unknown. ``least`` (A,) are numbers that follow from other isovalues, else -1;
    where ``higher`` (A,) is not negative, the number may be greater by 1, and that is the class of the context.
    """
    spread = st.spread
    for k in range(len(active)):
        v = active[k, 0]
        sign = np.int64(st.sign[v])
        if least[k] >= 0:
            bit = 1 - sign
            if higher[k] >= 0:
                bit = code(cd, HIGHER + higher[k], np.int64((number[k] > least[k]) == (sign == 1)))
                if bit < 0:
                    return bit
            number[k] = least[k] + (1 if bit == sign else 0)
        else:
            case = 0
            guess = _guessed(mesh, st, st.leaf[active[k, 1]], v)
            if guess != 0 and (guess > 0) == (sign == 1):
                case = 2
            else:
                opposite = guess != 0
                guess = _mean_around(mesh, st, v)
                if guess != 0:
                    case = 3 if opposite else 1
                    guess = guess >> 1 if opposite else guess
            size = min(abs(guess) >> 1, LARGEST)
            count = np.int64(1) << bits[sign]
            if spread[case] == 0:
                spread[case] = max((count >> 3) << FINE, 1 << FINE) if bits[sign] < 40 else WIDEST
            st.bells[0], st.bells[1] = (size << FINE) + HALF, spread[case]
            near = then[k] if sign else -then[k]
            _expect_then(st, near << (FINE - 1), sign == 1, then[k] != 0)
            kind = case + NUMBERS * np.int64(then[k] != 0)
            found = near_guess(
                cd, MIX_VALUE + DEPTHS * kind, VALUE + 4 * DEPTHS * kind, count, st.bells, number[k]
            )
            if found < 0:
                return found
            number[k] = found
            if then[k] != 0:
                _learn_drift(st, (min(found, LARGEST) << FINE) + HALF - (near << (FINE - 1)), sign == 1)
            wrong = min(abs(found - size), LARGEST) << FINE
            spread[case] = min(max(spread[case] + ((wrong - spread[case]) >> 4), 1 << (FINE - 2)), WIDEST)
        twice = 2 * min(number[k], LARGEST) + 1
        st.estimate[v] = twice if sign else -twice
    return DONE
