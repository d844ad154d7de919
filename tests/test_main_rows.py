"""The main profile: what networks see of what has been decoded, against plain renderings (7.12, 7.13, 7.15 to 7.17)."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest

from brute import smooth
from isocodec.entropy.context_layout import rates
from isocodec.entropy.mixer import clear
from isocodec.entropy.range_coder import ENCODE, Coder, CoderRegisters, start
from isocodec.field.samples import check_field
from isocodec.grid.lattice.access import dimension, vertex
from isocodec.grid.lattice.diamond import diamond_at
from isocodec.grid.lattice.simplex import Simplex
from isocodec.grid.lattice.store import get
from isocodec.grid.lattice.tables import cube_exponent
from isocodec.grid.lattice.vertex_set import IN, KEPT, OUT
from isocodec.grid.models.base_signs import see_behind
from isocodec.grid.models.corner_patterns import CLASSES
from isocodec.grid.models.mesh_questions import Question, see_mesh
from isocodec.grid.models.neighbourhood import nearest_vertices, survey
from isocodec.grid.models.network_rows import AROUND, BASE_ROW, MESH_ROW, MOST_ROWS, SIGN_ROW, TREE_ROW, VALUE_ROW
from isocodec.grid.models.refinement_signs import Before, Expected, see_middle
from isocodec.grid.models.significance import CUBE, NODE, SLOT, Node, count_cells, see_crowd
from isocodec.grid.models.trained import members, shipped_models
from isocodec.grid.models.value_bits import Nearby, see_nearby
from isocodec.grid.models.value_rows import counted, go_to_row, rows_of_list
from isocodec.grid.passes.bisection import look
from isocodec.grid.passes.values import enter_told
from isocodec.grid.tube.capacity import NOTHING
from isocodec.kernel import DONE
from isocodec.search.promise import Promise
from isocodec.search.strategy import grid_plan, reduced
from isocodec.stream.encoder import encoder_of
from tables import looped

SHAPES = [(34, 29), (13, 12, 14)]


def _mesh(st, cd, what, history, level, x, y, z):
    clear(cd)
    see_mesh(st, cd, Question(what, history, level, x, y, z))


def _behind(st, cd, level, cls, b0, b1, b2, opp, guess, case, other):
    clear(cd)
    see_behind(st, cd, Simplex(level, cls, b0, b1, b2), opp, guess, case, other)


def _sign(st, cd, w0, w1, w2, crossed, row):
    survey(st)
    r = st.counters.level % dimension(st.grid.tables)
    diamond = diamond_at(st.grid, np.int64(st.counters.edge), np.int64(r), w0, w1, w2)
    see_middle(st, cd, diamond, look(st, diamond), Expected(crossed, *ints(1, 0, row)), Before(*ints(-1, 0)))


def _crowd(st, cd, what, shift, x, y, z, hits, child, nearness):
    clear(cd)
    size = shift + bits(st.counters.edge) - 1
    if size <= st.grid.exponent:
        assert count_cells(st, size) == DONE
    see_crowd(st, cd, Node(what, shift, x, y, z, hits, child, nearness), size)


def coder(n):
    prob, seen, blend = shipped_models(n)
    cd = Coder(CoderRegisters(), np.zeros(64, np.uint8), prob, seen, rates(), blend)
    start(cd.reg, ENCODE)
    return cd


def listed(n, rows):
    """Rows of the networks that listed rows stand for."""
    found = members(n)[rows]
    return found[found >= 0].tolist()


def rows_of(cd, n, first):
    """The rows listed, from a network's first on."""
    return sorted(row - first for row in listed(n, cd.blend.row[1 : cd.blend.row[0] + 1]))


def bits(x):
    return int(x).bit_length()


def ints(*numbers):
    return [np.int64(x) for x in numbers]


def known(state, n):
    """Signs of the known vertices by position."""
    return {tuple(map(int, v[:n])): int(v[3]) for v in state.vertex[: state.counters.vertices]}


def clamped(position, shape):
    return tuple(min(max(int(x), 0), size - 1) for x, size in zip(position, shape, strict=True))


@looped("shape", [*SHAPES, (70, 140), (3, 67), (9, 17, 135)])
@looped("planes", [1, 4])
def test_rows_of_values_nearby(shape, planes):
    """Half of the vertices told as far as ``p``, the others one bit less; within blocks of the order and across them.
    """
    n = len(shape)
    field = np.rint(smooth(shape, 5) * 200).astype(np.int64)
    encoder = encoder_of(field, 20.5, layers=[*grid_plan(n, n * cube_exponent(shape), None), ("values", planes)])
    assert b"".join(encoder)
    tube = encoder.frame.strands[0].tube
    state, active = tube.state, tube.estimates._active
    rows = rows_of_list(state, active, *counted(state, active))
    number, left = tube.estimates.number.copy(), tube.estimates.left.copy()
    p = int(left[active].max())
    rng = np.random.default_rng(planes)
    for v in active[rng.random(len(active)) < 0.5]:
        number[v], left[v] = number[v] >> 1, left[v] + 1
    told = np.empty(len(active) + 1, np.int64)
    enter_told(state, active, number, left, told)
    place = {tuple(map(int, state.vertex[v, :n])): v for v in active}
    slots = {2: 9, 3: 14}[n]
    cd = coder(n)
    for i in rng.choice(len(active), 400):
        v = active[i]
        if left[v] != p + 1:
            continue
        state.value.row = go_to_row(rows, 0, i)
        see_nearby(state, cd, Nearby(rows, told, NOTHING, NOTHING), number, *ints(v, p))
        here = np.array(state.vertex[v, :n], np.int64)

        def near_value(*step, here=here, v=v):
            u = place.get(tuple((here + step).tolist()))
            if u is None:
                return None
            middle = int(2 * number[u] + 1) << int(left[u])
            return (middle if state.vertex[u, 3] == state.vertex[v, 3] else -middle), left[u] <= p

        def combined(parts, rule):
            if not parts or None in parts:
                return None
            return rule(*[x for x, _ in parts]), all(fine for _, fine in parts)

        def mean(*x):
            return sum(x) // len(x)

        unit = np.eye(n, dtype=np.int64)
        beside = [x for a in range(n) for way in (-1, 1) if (x := near_value(*(way * unit[a]))) is not None]
        candidates = [combined([x for x in beside if x[0] > 0], mean), combined([x for x in beside if x[0] < 0], mean)]
        for a in range(n):
            y, yy, z, zz = (near_value(*(step * unit[a])) for step in (-1, -2, 1, 2))
            candidates += [
                combined([y, z], mean), combined([y, yy], lambda s, t: 2 * s - t),
                combined([z, zz], lambda s, t: 2 * s - t),
            ]
        for a, b in combinations(range(n), 2):
            across = []
            for s, t in product((-1, 1), repeat=2):
                three = [
                    near_value(*(s * unit[a])),
                    near_value(*(t * unit[b])),
                    near_value(*(s * unit[a] + t * unit[b])),
                ]
                across.append(combined(three, lambda x, y, z: x + y - z))
            candidates.append(combined([x for x in across if x is not None], mean))
        bound = int(2 * number[v] + 1) << (p + 1)
        expected = [52 * slots + min(p, 15), 52 * slots + 16 + min(bits(number[v]), 7)]
        expected.append(52 * slots + 24 + sum(fine for _, fine in beside))
        for slot, candidate in enumerate(candidates):
            if candidate is not None:
                c, fine = candidate
                size = min(bits(abs(c - bound) * 8 // 2 ** (p + 1)), 12)
                expected.append(52 * slot + 26 * bool(fine) + size + 13 * (c < bound))
        assert len(candidates) == slots
        assert rows_of(cd, n, VALUE_ROW[n]) == sorted(expected)


def adapted(shape, steps):
    """A tube on an adaptive mesh, after a base or after a further layer."""
    field = smooth(shape, 5)
    promise = Promise(check_field(field, 0.1))
    (_, _, mesh), *_ = reduced(promise, "distortion", 0.3, False)
    plan = [("adaptive_base", 0, mesh)] if steps == 1 else [("base", len(shape)), ("adapt", 1, mesh)]
    encoder = encoder_of(field, 0.1, layers=plan)
    assert b"".join(encoder)
    return encoder.frame.strands[0].tube


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("steps", [1, 2])
def test_rows_of_the_mesh(shape, steps):
    n, k = len(shape), cube_exponent(shape)
    tube = adapted(shape, steps)
    state, signs, cd = tube.state, known(tube.state, n), coder(n)
    rng = np.random.default_rng(steps)
    tried = marks = 0
    for _ in range(3000):
        level = int(rng.integers(0, n * k))
        g = (1 << (k - level // n)) // 2
        w = rng.integers(0, (1 << k) // g + 1, n)
        odd = [a for a in range(n) if w[a] % 2]
        if len(odd) != n - level % n:
            continue
        way = [(-1 if w[a] % 4 == 3 else 1) for a in range(n)]
        order = odd + [a for a in range(n) if a not in odd]
        end = clamped([(w[a] - way[a] * (a in odd)) * g for a in range(n)], shape)
        what, history = int(rng.integers(4)), int(rng.integers(8))
        _mesh(state, cd, *ints(what, history, level, *(w * g), *([0] * (3 - n))))
        expected = [3 * what + level % n, 12 + min(n * k - level, 23), 36 + history]
        first = 44 + 96 * (level % n)
        for i, d in enumerate(nearest_vertices(n, level % n)[:24]):
            at = np.array(w)
            for step, a in zip(d, order, strict=True):
                at[a] += step * (way[a] if a in odd else 1)
            at = at * g
            if (at >= 0).all() and (at <= 1 << k).all():
                mark = int(get(state.mesh, *ints(*at, *([0] * (3 - n)))))
                if mark & (IN | OUT | KEPT):
                    expected.append(first + 2 * i + bool(mark & IN))
                    marks += 1
            sign = signs.get(clamped(at, shape))
            if sign is not None:
                expected.append(first + 48 + 2 * i + (sign == signs.get(end, 0)))
        assert rows_of(cd, n, MESH_ROW[n]) == sorted(expected)
        tried += 1
    assert tried > 50 and marks > 50


@pytest.mark.parametrize("shape", SHAPES)
def test_rows_behind_a_gate(shape):
    n, k = len(shape), cube_exponent(shape)
    tube = adapted(shape, 1)
    state, signs, cd = tube.state, known(tube.state, n), coder(n)
    steps = [d for d in product(range(-3, 4), repeat=n) if any(d) and (n == 2 or sum(map(abs, d)) <= 3)]
    rng = np.random.default_rng(1)
    for i in rng.choice(int(state.counters.leaves), 80):
        cls, *block, level = (int(x) for x in state.leaf[i])
        edge = 1 << (k - level // n)
        corners = [vertex(state.grid.tables, *ints(level % n, cls, j)) for j in range(n + 1)]
        corners = [np.array([(4 * block[a] + int(c[a])) * edge // 2 for a in range(n)]) for c in corners]
        opp, guess, case, other = (int(x) for x in rng.integers([0, 0, 0, -1], [n + 1, 2, 48, 2]))
        _behind(state, cd, *ints(level, cls, *block, opp, guess, case, other))
        origin = corners[opp]
        others = [c - origin for j, c in enumerate(corners) if j != opp]
        expected = [case % 16] + ([16 + (other == guess)] if other >= 0 else [])
        first = 18 + 2 * len(steps) * (level % n * (n + 1) + opp)
        for number, d in enumerate(steps):
            sign = signs.get(clamped(origin + sum(x * e for x, e in zip(d, others, strict=True)), shape))
            if sign is not None:
                expected.append(first + 2 * number + (sign == guess))
        assert rows_of(cd, n, BASE_ROW[n]) == sorted(expected) and len(expected) > n


def noisy(shape, back):
    """The tube of an encoder of random signs that has decoded all rounds but the last ``back``."""
    n = len(shape)
    field = np.random.default_rng(back).integers(0, 2, shape) + smooth(shape, 5)
    full = n * cube_exponent(shape)
    encoder = encoder_of(field, 0.5, layers=[("base", 0), ("refine", full - back)])
    assert b"".join(encoder)
    tube = encoder.frame.strands[0].tube
    tube._grow()
    return tube


def rarity(state):
    q = (int(state.counters.vertices) + 1) // (int(state.counters.births) + 1)
    return min(bits(q) - 1, 12) if q else 0


@looped("shape", [(70, 81), (19, 17, 21)])
@looped("back", [1, 2, 5])
def test_rows_of_the_manner(shape, back):
    """The length of edges, how rare new components are, and how often predictions were right."""
    n = len(shape)
    tube = noisy(shape, back)
    state, first = tube.state, 2 * AROUND[n]
    cd = coder(n)
    level = int(state.counters.level)
    edge = 1 << tube.k - level // n
    assert state.counters.edge == edge and state.counters.births > 0
    w = [3 if axis < n - level % n else 2 for axis in range(n)] + [0] * (3 - n)
    for births in (0, int(state.counters.births), 10 * int(state.counters.vertices)):
        for calm in ((3584, 0), (255, 4065), (256, 511)):
            state.counters.births, state.calm[0], state.calm[1] = births, *calm
            for crossed in range(2):
                _sign(state, cd, *ints(*w, crossed, 4))
                own = SIGN_ROW[n][level % n] + first
                found = [row for row in rows_of(cd, n, own) if row >= 0]
                assert found == [min(bits(edge) - 1, 8), 9 + rarity(state), 22 + calm[crossed] // 256, 38 + 60 + 4]


@pytest.mark.parametrize("shape", [(40, 43), (12, 13, 11)])
def test_calm_follows_what_was_predicted(shape):
    """Where the ends of an edge have one sign it is the predicted one; where they differ it is only seen to move."""
    n = len(shape)
    crossed_calm = []
    for field in (smooth(shape, 3), np.random.default_rng(2).integers(0, 2, shape) - 0.4):
        encoder = encoder_of(field, 0.1, precision="signs", layers=n)
        tube = encoder.frame.strands[0].tube
        trace = np.zeros((20000, 3 + MOST_ROWS), np.int32)
        tube.coder = tube.coder._replace(blend=tube.coder.blend._replace(trace=trace))
        assert b"".join(encoder)
        calm = 3584
        manner = 2 * AROUND[n] + 22
        corners = manner + 16 + 60
        for symbol, net, count, *rows in trace[1 : trace[0, 0] + 1].tolist():
            if net >= n:
                continue
            own = [row - SIGN_ROW[n][net] for row in listed(n, rows[:count])]
            if own[-1] < corners + CLASSES[n][net]:
                assert [row for row in own if manner <= row < manner + 16] == [manner + calm // 256]
                calm += (4096 * symbol - calm) >> 5
        assert tube.state.calm[0] == calm != 3584
        crossed_calm.append(tube.state.calm[1])
    assert crossed_calm[0] > crossed_calm[1]


@looped("shape", [(70, 81), (19, 17, 21), (3, 40)])
@looped("back", [1, 3])
def test_rows_of_the_crowd(shape, back):
    """At nodes in the box and at its border, of cells as large as the box, too."""
    n = len(shape)
    tube = noisy(shape, back)
    state = tube.state
    counted = state.vertex[: state.counters.counted, :n].astype(np.int64)
    unit = bits(state.counters.edge) - 1
    cd = coder(n)
    rng = np.random.default_rng(back)

    def numbers(size, cell):
        """Of vertices, counted here, and of new components, as the store has them (tested elsewhere)."""
        vertices = int((counted >> size == cell).all(axis=1).sum())
        x, y, z = map(np.int64, (*cell, 0)[:3])
        stored = get(state.crowd, x + (4 << tube.k - size), y, z) if min(cell) >= 0 else 0
        return vertices, int(stored) >> 20

    def kind(x):
        return x if x < 4 else min(bits(x) - 1, 9) + 2

    reach = 2 if n == 2 else 1
    around = [step for step in product(range(-reach, reach + 1), repeat=n) if any(step)]
    for _ in range(150):
        what = (NODE, CUBE, SLOT)[rng.integers(3)]
        shift = int(rng.integers(1, tube.k + 1)) if what == NODE else 0
        size = unit + shift
        cell = [int(rng.integers(0, (length - 1 >> size) + 1)) for length in shape]
        hits, child, nearness = (int(rng.integers(first, 4)) for first in (0, -1, 0))
        _crowd(state, cd, *ints(what, shift, *(*cell, 0)[:3], hits, child, nearness))
        expected = [3 * (8 if what == SLOT else min(shift, 7)) + int(state.counters.level) % n]
        expected += [51 + (5 if what == NODE else nearness), 81 + rarity(state)]
        expected += [27 + 8 * min(hits, 2) + child] if child >= 0 else []
        if size <= tube.k:
            v, u = numbers(size, cell)
            expected += [57 + kind(v), 69 + kind(u)]
            for i, step in enumerate(around):
                v, u = numbers(size, [c + s for c, s in zip(cell, step, strict=True)])
                expected += [94 + 9 * i + min(v, 4), 99 + 9 * i + min(u, 3)]
        assert rows_of(cd, n, TREE_ROW[n]) == sorted(expected)
