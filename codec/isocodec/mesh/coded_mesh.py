"""A mesh in the file: for each open face, whether a cell lies across it, and which vertex it adds (clause 10.10)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..entropy.guesses import DEPTHS, FINE, clear_opinions, decided, hear, near_guess
from ..entropy.range_coder import DECODE, Coder, code
from ..kernel import BAD, DONE, GROW, SPENT, inlined, inner, kernel, record
from ..kernel.types import IntMatrix, IntVector
from .complex import Complex, assembled
from .expected import expect, learn_miss
from .growth import (
    BORDER,
    CANDIDATES,
    NEAR,
    OPEN,
    Growth,
    attach,
    borders,
    face_size,
    list_candidates,
    near_class,
)
from .models import (
    AGAIN,
    CLOSED,
    CLOSED_PAST,
    FAR,
    KNOWN,
    KNOWN_COUNT,
    MIX_CLOSED,
    MIX_KNOWN,
    MIX_PLACE,
    PLACE,
    WHICH,
)
from .walk import uniform

LEAST = 1 << (FINE - 2)
"""Least width of a predicted position."""
TOO_MANY, NO_COMPLEX = 1, 2
REASONS = {
    TOO_MANY: ("more vertices or cells than stated", "10.10.1"),
    NO_COMPLEX: ("the cells form no complex", "10.10.2"),
}
"""Message and clause of each error."""


@record
class Original(NamedTuple):
    """The encoder's mesh, empty for a decoder.

    ``position`` (V, d), ``cell`` and ``neighbour`` (T, n + 1) as of `CellArrays`; ``vertex`` (V,) and
    ``place`` (T,): the coded number of each vertex and cell, or -1; ``source`` (T,): the inverse of ``place``.
    """

    position: IntMatrix
    cell: IntMatrix
    neighbour: IntMatrix
    vertex: IntVector
    place: IntVector
    source: IntVector


@inner
def _code_place(g, cd, origin, face, truth):
    """Code the position of a new vertex: across a face, or anywhere."""
    v = np.int64(g.reg.vertices)
    if v >= g.reg.all_vertices:
        g.reg.error = TOO_MANY
        return BAD
    for k in range(g.position.shape[1]):
        case = 3 + k if face >= 0 else k
        if face >= 0:
            guess = g.aim[g.reg.chosen, k]
        elif v > 0:
            guess = g.position[v - 1, k]
        else:
            guess = g.extent[k] >> 1
        width = g.spread[case]
        if width == 0:
            width = max((g.extent[k] << FINE) >> (5 if face >= 0 else 3), LEAST)
        g.bells[0], g.bells[1] = (guess << FINE) + (1 << (FINE - 1)), width
        want = origin.position[truth, k] if truth >= 0 else np.int64(0)
        found = near_guess(
            cd, MIX_PLACE + DEPTHS * case, PLACE + 4 * DEPTHS * case, g.extent[k], g.bells, want
        )
        if found < 0:
            return found
        wrong = abs(found - guess) << FINE
        g.spread[case] = max(width + ((wrong - width) >> 5), LEAST)
        g.position[v, k] = found
        if face >= 0:
            learn_miss(g, k, found, FINE)
    g.reg.vertices += 1
    if truth >= 0:
        origin.vertex[truth] = v
    return v


@inner
def _code_new_or_far(g, cd, origin, face, truth):
    """Code a vertex that is not a candidate: an existing one, or a new one."""
    want = origin.vertex[truth] if truth >= 0 else np.int64(-1)
    bit = np.int64(0)
    if g.reg.vertices > 0:
        bit = code(cd, FAR if face >= 0 else AGAIN, np.int64(want >= 0))
        if bit < 0:
            return bit
    if bit:
        return uniform(cd, np.int64(0), np.int64(g.reg.vertices), want)
    return _code_place(g, cd, origin, face, truth)


@inner
def _code_candidate(g, cd, count, want):
    """Code which candidate the vertex is; -9 if none."""
    hit = np.int64(-1)
    for m in range(count):
        if g.candidate[m] == want:
            hit = np.int64(m)
    near = near_class(g.candidate[CANDIDATES])
    second = near_class(g.candidate[CANDIDATES + 1]) if count > 1 else NEAR - 1
    clear_opinions(cd)
    hear(cd, KNOWN + 4 * near + second // 3)
    hear(cd, KNOWN_COUNT + 4 * near + count - 1)
    bit = decided(cd, MIX_KNOWN, np.int64(hit >= 0))
    if bit < 0:
        return bit
    if bit == 0:
        return NONE
    m = 0
    while m < count - 1:
        here, there = g.candidate[CANDIDATES + m], g.candidate[CANDIDATES + m + 1]
        clear_opinions(cd)
        hear(cd, WHICH + 4 * (NEAR * m + near_class(here)) + min(4 * there // (here + 1) - 4, 3) * (there > here))
        bit = decided(cd, MIX_KNOWN + 1 + m, np.int64(hit == m))
        if bit < 0:
            return bit
        if bit:
            break
        m += 1
    return g.candidate[m]


NONE = -9
"""No candidate."""


@inlined
def _behind(g, origin, t, o):
    """Encoder: the original cell across face o of cell t, -1 at the boundary, and its vertex."""
    corners = g.cell.shape[1]
    source = origin.source[t]
    found = np.int64(-1)
    for i in range(corners):
        if origin.vertex[origin.cell[source, i]] == g.cell[t, o]:
            found = origin.neighbour[source, i]
    apex = np.int64(-1)
    if found >= 0:
        for i in range(corners):
            if origin.neighbour[found, i] == source:
                apex = origin.cell[found, i]
    return found, apex


@inner
def _take(g, origin, truth):
    """Add the cell that has just been written."""
    new = g.reg.cells
    if truth >= 0:
        origin.place[truth] = new
        origin.source[new] = truth
    if attach(g):
        return DONE
    g.reg.error = NO_COMPLEX
    return BAD


@inner
def _code_face(g, cd, origin, face):
    """Code whether a cell lies across an open face, and its vertex."""
    corners = g.cell.shape[1]
    t = face // corners
    o = face - t * corners
    truth, apex = np.int64(-1), np.int64(-1)
    if cd.reg.mode != DECODE:
        truth, apex = _behind(g, origin, t, o)
    expect(g, t, o)
    count = list_candidates(g, t, o, face_size(g, t, o))
    near = near_class(g.candidate[CANDIDATES]) if count > 0 else NEAR - 1
    edge = borders(g, t)
    clear_opinions(cd)
    hear(cd, CLOSED + 4 * near + edge)
    hear(cd, CLOSED_PAST + 16 * edge + (g.reg.past & 15))
    bit = decided(cd, MIX_CLOSED + edge, np.int64(truth < 0))
    if bit < 0:
        return bit
    g.reg.past = (g.reg.past << 1 | bit) & 15
    if bit:
        g.neighbour[t, o] = BORDER
        return DONE
    if g.reg.cells >= g.reg.all_cells:
        g.reg.error = TOO_MANY
        return BAD
    v = np.int64(NONE)
    if count > 0:
        v = _code_candidate(g, cd, count, origin.vertex[apex] if truth >= 0 else np.int64(-1))
    if v == NONE:
        v = _code_new_or_far(g, cd, origin, face, apex)
    if v < 0:
        return v
    new = g.reg.cells
    g.cell[new, 0] = v
    k = 1
    for i in range(corners):
        if i != o:
            g.cell[new, k] = g.cell[t, i]
            k += 1
    return _take(g, origin, truth)


@inner
def _code_seed(g, cd, origin, seed):
    """Code the first cell of a piece."""
    truth = seed if cd.reg.mode != DECODE else np.int64(-1)
    for i in range(g.cell.shape[1]):
        v = _code_new_or_far(g, cd, origin, np.int64(-1), origin.cell[truth, i] if truth >= 0 else np.int64(-1))
        if v < 0:
            return v
        g.cell[g.reg.cells, i] = v
    return _take(g, origin, truth)


@kernel
def code_mesh(g: Growth, origin: Original, cd: Coder) -> int:
    """Code a mesh: the encoder's original, or the decoder's from the run.

    Returns GROW if there is no room for the next cell, SPENT if too many cells were visited; it can resume from there.
    """
    corners = g.cell.shape[1]
    seed = np.int64(0)
    while g.reg.cells < g.reg.all_cells:
        if g.reg.work + g.reg.granted - cd.reg.left > g.reg.most:
            return SPENT
        if g.reg.cells == len(g.cell) or g.reg.vertices + corners > len(g.position):
            return GROW
        status = DONE
        if g.reg.first < g.reg.last:
            face = g.queue[g.reg.first]
            g.reg.first += 1
            t = face // corners
            if g.neighbour[t, face - t * corners] == OPEN:
                status = _code_face(g, cd, origin, face)
        else:
            if cd.reg.mode != DECODE:
                while origin.place[seed] >= 0:
                    seed += 1
            status = _code_seed(g, cd, origin, seed)
        if status != DONE:
            return status
    return DONE


def original_of(domain: Complex | None, d: int, corners: int) -> Original:
    """Original mesh to code; empty for a decoder."""
    if domain is None:
        nothing, none = np.zeros((0, corners), np.int64), np.zeros(0, np.int64)
        return Original(np.zeros((0, d), np.int64), nothing, nothing, none, none, none)
    mesh = domain.mesh
    vertices, cells = len(mesh.position), len(mesh.cell)
    return Original(
        mesh.position, mesh.cell, mesh.neighbour, np.full(vertices, -1, np.int64), np.full(cells, -1, np.int64),
        np.full(cells, -1, np.int64),
    )


def grown(g: Growth, unit: float) -> Complex:
    """The complex of a mesh that is complete."""
    position = g.position[: g.reg.vertices]
    return assembled(position, g.cell, unit, np.where(g.neighbour < 0, -1, g.neighbour))
