"""The main profile: its tables, its arithmetic against a plain rendering of the specification, whole files."""

from __future__ import annotations

import bisect
import functools
import itertools
from collections.abc import Sequence
from decimal import ROUND_HALF_EVEN, Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import isocodec
from brute import examples, sign_fields
from isocodec.entropy.context_layout import rates
from isocodec.entropy.mixer import MOST_MIX, blended, clear, see
from isocodec.entropy.network import weighed
from isocodec.entropy.range_coder import DECODE, ENCODE, Coder, CoderRegisters, finish, start
from isocodec.grid.lattice.tables import cube_exponent
from isocodec.grid.models.contexts import CONTEXTS, OFFSET, VALUE
from isocodec.grid.models.network_rows import (
    AROUND,
    AROUND_VALUE,
    BASE_NET,
    BASE_ROW,
    BASE_ROWS,
    BEHIND,
    CELLS,
    LEAF_ROWS,
    MAP,
    MESH_AROUND,
    MESH_NET,
    MESH_ROWS,
    OFFSET_ROWS,
    SIGN_ROWS,
    STATES,
    TREE_NET,
    TREE_ROWS,
    VALUE_MIX,
)
from isocodec.grid.models.trained import shipped_models
from isocodec.search.strategy import grid_plan
from isocodec.stream.encoder import encoder_of
from isospec.tables import (
    HIDDEN,
    INPUTS,
    KINDS,
    MOST_LOGIT,
    NET_ROWS,
    NETS,
    ROWS,
    packed,
    shipped,
    unpacked,
)
from tables import looped

# -- tables ----------------------------------------------------------------------------------------------------------


def test_tables_are_what_the_specification_states():
    squash, found = unpacked(shipped())
    with localcontext() as context:
        context.prec = 40
        for x in range(-MOST_LOGIT, MOST_LOGIT + 1):
            exact = (65536 / (1 + (Decimal(-x) / 256).exp())).to_integral_value(ROUND_HALF_EVEN)
            assert squash[x + MOST_LOGIT] == min(max(int(exact), 32), 65504)
    for n, t in found.items():
        assert t.weight.shape == (ROWS[n], HIDDEN) and BASE_ROW[n] + BASE_ROWS[n] == ROWS[n]
        assert t.state[:, 0].max() < STATES and len(set(t.state[:, 0])) == len(t.state)
        assert ((t.state[:, 1] >= 32) & (t.state[:, 1] <= 65504)).all()
        assert (t.state[:, 2] <= 158).all()
        assert np.abs(t.mix).max() <= MOST_MIX
        assert list(NET_ROWS[n]) == [
            *SIGN_ROWS[n], *[0] * (3 - n), TREE_ROWS[n], OFFSET_ROWS, LEAF_ROWS[n], MESH_ROWS[n], BASE_ROWS[n],
        ]
    assert packed(squash, found) == shipped()
    assert len(shipped()) < 150_000


@pytest.mark.parametrize("n", [2, 3])
def test_sums_fit_their_numbers(n):
    """Sums of a list's rows are numbers of 16 bits, and what the output weights make of them one of 32 bits."""
    t = unpacked(shipped())[1][n]
    # of each vertex around there is at most one row, of each cell there are two; other lists have fewer than 32
    most = {TREE_NET: 2 * CELLS[n] + 8, MESH_NET: 2 * MESH_AROUND + 8, BASE_NET: 2 * BEHIND[n] + 8}
    first = 0
    for net, rows in enumerate(NET_ROWS[n]):
        own = t.weight[first : first + rows].astype(np.int64)
        first += rows
        listed = AROUND[n] + 8 if net < TREE_NET else most.get(net, 32)
        high = listed * np.maximum(own, 0).max(axis=0, initial=0)
        low = listed * np.minimum(own, 0).min(axis=0, initial=0)
        assert high.max() < 1 << 15 and low.min() >= -(1 << 15)
        assert np.abs(t.out[net, :HIDDEN]) @ high + abs(t.out[net, HIDDEN]) < 1 << 31


# -- arithmetic --------------------------------------------------------------------------------------------------------


def _code(cd, net, flip, kind, ctx, rows, bit):
    clear(cd)
    for row in rows:
        see(cd, row)
    return blended(cd, net, flip, kind, ctx, bit)


def coder(mode: int, n: int, room: int = 1 << 15) -> Coder:
    prob, seen, blend = shipped_models(n)
    cd = Coder(CoderRegisters(), np.zeros(room, np.uint8), prob, seen, rates(), blend)
    start(cd.reg, mode)
    return cd


class Plain:
    """Clause 7.11 in plain Python: probabilities of the same symbols."""

    def __init__(self, n: int) -> None:
        squash, found = unpacked(shipped())
        self.squash = [int(x) for x in squash]
        self.t = found[n]
        self.mix = [[int(x) for x in row] for row in self.t.mix]
        prob, seen, _ = shipped_models(n)
        self.p = [int(x) for x in prob]
        self.seen = [int(x) for x in seen]

    def stretch(self, p: int) -> int:
        return min(bisect.bisect_left(self.squash, 16 * (p >> 4) + 8) - 2047, 2047)

    def opinions(self, net: int, flip: bool, kind: int, ctx: int, rows: list[int]) -> tuple[list[int], int]:
        h = [sum(int(self.t.weight[row, j]) for row in rows) for j in range(48)]
        t = int(self.t.out[net, 48]) + sum(int(self.t.out[net, j]) * h[j] for j in range(48) if h[j] > 0)
        a = min(max(t >> 8, -2047), 2047)
        a = -a if flip else a
        place = CONTEXTS + 32 * kind + ((a + 2047) >> 7)
        adaptive = [
            (self.stretch(self.p[c]) * ((512 * self.seen[c]) // (2 * self.seen[c] + 3))) >> 8 for c in (ctx, place)
        ]
        return [a, *adaptive, 256], place

    def probability(self, kind: int, opinions: list[int]) -> int:
        x = sum(m * o for m, o in zip(self.mix[kind], opinions, strict=True)) >> 16
        return self.squash[min(max(x, -2047), 2047) + 2047]

    def update(self, kind: int, opinions: list[int], contexts: Sequence[int], p: int, bit: int) -> None:
        e = 40 * (65536 * bit - p)
        for i, o in enumerate(opinions):
            self.mix[kind][i] = min(max(self.mix[kind][i] + ((e * o) >> 20), -(1 << 22)), 1 << 22)
        for c in contexts:
            step = 65536 // (self.seen[c] + 2)
            p = self.p[c] + (((65536 - self.p[c]) * step) >> 16) if bit else self.p[c] - ((self.p[c] * step) >> 16)
            self.p[c] = min(max(p, 32), 65504)
            self.seen[c] = min(self.seen[c] + 1, 158)


symbols = st.tuples(
    st.integers(0, NETS - 1), st.booleans(), st.integers(0, KINDS - 1), st.integers(0, CONTEXTS - 1),
    st.lists(st.integers(0, min(ROWS.values()) - 1), min_size=1, max_size=20), st.integers(0, 1),
)


@examples(60)
@given(rows=st.lists(st.integers(0, 6), max_size=60), seed=st.integers(0, 99))
def test_rows_are_weighed(rows, seed):
    """As plain numbers are: sums of any sign, up to the ends of 16 bits, a total up to those of 32."""
    rng = np.random.default_rng(seed)
    most = (1 << 15) // max(len(rows), 1)
    table = rng.integers(-most, most, (7, HIDDEN)).astype(np.int16)
    bound = ((1 << 31) - 1) // (HIDDEN * (1 << 15))
    out = rng.integers(-bound, bound + 1, HIDDEN + 1).astype(np.int32)
    expected = sum(max(sum(int(table[row, j]) for row in rows), 0) * int(out[j]) for j in range(HIDDEN))
    row = np.array([len(rows), *rows, 5, 5])
    assert weighed(row, table, out) == expected


@examples(60)
@given(n=st.sampled_from([2, 3]), found=st.lists(symbols, max_size=40), again=st.integers(1, 4))
def test_mixing_is_that_of_the_specification(n, found, again):
    """All states agree with plain Python after every symbol, and the bytes decode to the symbols."""
    cd, plain = coder(ENCODE, n), Plain(n)
    for net, flip, kind, ctx, rows, bit in found * again:
        opinions, place = plain.opinions(net, flip, kind, ctx, rows)
        plain.update(kind, opinions, (ctx, place), plain.probability(kind, opinions), bit)
        assert _code(cd, net, flip, kind, ctx, np.array(rows), bit) == bit
        assert [int(cd.prob[c]) for c in (ctx, place)] == [plain.p[c] for c in (ctx, place)]
        assert cd.blend.mix[kind, :INPUTS].tolist() == plain.mix[kind]
    data = finish(cd)
    back = coder(DECODE, n)
    back.buf[: len(data)] = np.frombuffer(data, np.uint8)
    back.reg.end, back.reg.final = len(data), 1
    for net, flip, kind, ctx, rows, bit in found * again:
        assert _code(back, net, flip, kind, ctx, np.array(rows), 0) == bit


@pytest.mark.parametrize("pattern", ["zeros", "ones", "alternating", "random"])
def test_extremes(pattern):
    """Models at their ends: weights stay within their bounds, and everything comes back."""
    rng = np.random.default_rng(8)
    count = 3000
    bits = {
        "zeros": np.zeros(count, int), "ones": np.ones(count, int), "alternating": np.arange(count) % 2,
        "random": rng.integers(0, 2, count),
    }[pattern]
    rows = rng.integers(0, ROWS[2], (count, 5))
    cd = coder(ENCODE, 2)
    for bit, row in zip(bits, rows, strict=True):
        assert _code(cd, 4, False, 3, 700, row, int(bit)) == bit
    assert np.abs(cd.blend.mix).max() <= MOST_MIX and cd.prob[MAP:].min() >= 32
    data = finish(cd)
    if pattern in ("zeros", "ones"):
        assert len(data) < count / 40
    back = coder(DECODE, 2)
    back.buf[: len(data)] = np.frombuffer(data, np.uint8)
    back.reg.end, back.reg.final = len(data), 1
    assert [_code(back, 4, False, 3, 700, row, 0) for row in rows] == bits.tolist()


def clip(x: int, low: int, high: int) -> int:
    return min(max(x, low), high)


class Values(Plain):
    """Clause 7.15 in plain Python: bits of the numbers of a small field, coded one by one."""

    def __init__(self, field: NDArray[np.int64]) -> None:
        """A layer for each bit, at the isovalue 0.5."""
        super().__init__(field.ndim)
        n, above = field.ndim, field > 0
        self.n, self.mix = n, [[16384] * (n + 7) for _ in range(4)]
        active = np.zeros(field.shape, np.bool_)
        for a in range(n):
            crossed = np.diff(above.astype(int), axis=a) != 0
            for k in (0, 1):
                width = [(1 - k, k) if i == a else (0, 0) for i in range(n)]
                active |= np.pad(crossed, width)
        whole = np.where(above, field - 1, -field)
        bits = [int((whole * (active & (above == side))).max()).bit_length() for side in (False, True)]
        order = [tuple(v) for v in np.argwhere(active).tolist()]
        self.above = {v: bool(above[v]) for v in order}
        self.number = dict.fromkeys(order, 0)
        self.missing = {v: bits[self.above[v]] for v in order}
        for plane in reversed(range(max(bits))):
            self.before = 0
            for v in order:
                if self.missing[v] > plane:
                    bit = int(whole[v]) >> plane & 1
                    self.code(v, plane, bit)
                    self.number[v], self.missing[v] = 2 * self.number[v] + bit, plane

    def near(self, v: tuple[int, ...], step: dict[int, int]) -> int | None:
        at = tuple(x + step.get(a, 0) for a, x in enumerate(v))
        if at not in self.number:
            return None
        value = (2 * self.number[at] + 1) << self.missing[at]
        return value if self.above[at] == self.above[v] else -value

    def candidates(self, v: tuple[int, ...]) -> dict[str, list[int | None]]:
        n = self.n
        near = functools.partial(self.near, v)
        beside = [x for a in range(n) for way in (-1, 1) if (x := near({a: way})) is not None]
        same, other = [x for x in beside if x > 0], [x for x in beside if x <= 0]
        found: dict[str, list[int | None]] = {
            "SAME": [sum(same) // len(same) if same else None], "OTHER": [sum(other) // len(other) if other else None],
            "LINE": [], "BEYOND": [], "ACROSS": [],
        }
        for a in range(n):
            back, on, back_2, on_2 = (near({a: way}) for way in (-1, 1, -2, 2))
            found["LINE"].append(None if back is None or on is None else (back + on) // 2)
            for one, two in ((back, back_2), (on, on_2)):
                found["BEYOND"].append(None if one is None or two is None else 2 * one - two)
        for a, b in itertools.combinations(range(n), 2):
            planes = []
            for i, j in itertools.product((-1, 1), repeat=2):
                x, y, z = near({a: i}), near({b: j}), near({a: i, b: j})
                if x is not None and y is not None and z is not None:
                    planes.append(x + y - z)
            found["ACROSS"].append(sum(planes) // len(planes) if planes else None)
        return found

    def code(self, v: tuple[int, ...], plane: int, bit: int) -> None:
        number, n = self.number[v], self.n
        half = 2 ** (plane + 1)
        cut = (2 * number + 1) * half
        candidates = self.candidates(v)
        leans = {
            name: [0 if x is None else (clip(x - cut, -half, half - 1) * 256) >> (plane + 1) for x in places]
            for name, places in candidates.items()
        }
        cases = {
            name: [0 if x is None else 1 + ((7 * (y + 256)) >> 9) for x, y in zip(places, leans[name], strict=True)]
            for name, places in candidates.items()
        }
        (same,), _, lines, beyond, across = cases.values()
        lists = [[lines[a], *beyond[2 * a : 2 * a + 2], same] for a in range(n)]
        lists += [[]] * (3 - n) + [[*across, same]]
        contexts = [VALUE + 6 * plane + 3 * (number != 0) + self.before]
        for i, digits in enumerate(lists):
            if digits:
                contexts.append(AROUND_VALUE + 4096 * i + int("".join(map(str, digits)), 8))
        said = [(self.stretch(self.p[c]) * ((512 * self.seen[c]) // (2 * self.seen[c] + 3))) >> 8 for c in contexts]
        said += [sum(of_name) for of_name in leans.values()]
        kind = min(number.bit_length(), 3)
        t = clip(sum(w * x for w, x in zip(self.mix[kind], said, strict=True)) >> 16, -2047, 2047)
        error = ((bit << 16) - self.squash[t + 2047]) * 40
        self.mix[kind] = [
            clip(w + ((error * x) >> 20), -(1 << 22), 1 << 22) for w, x in zip(self.mix[kind], said, strict=True)
        ]
        self.update(kind, [], contexts, 0, bit)
        self.before = 1 + bit


@looped("n", [2, 3])
@examples(20)
@given(seed=st.integers(0, 1 << 32), size=st.sampled_from([2, 9, 300, 1 << 40]))
def test_values_are_those_of_the_specification(n, seed, size):
    """Models and weights agree with plain Python after layers of values."""
    rng = np.random.default_rng(seed)
    field = rng.integers(-size, size, (7, 9) if n == 2 else (4, 5, 4))
    slope = np.indices(field.shape).sum(axis=0)
    field = np.where(rng.random() < 0.5, field // 8, field) + (slope - 6) * (size // 3)
    field.flat[0], field.flat[-1] = -size, size
    full = n * cube_exponent(field.shape)
    encoder = encoder_of(field, 0.5, profile="main", layers=[*grid_plan(n, full, None), ("values", None)])
    for _ in encoder:
        pass
    cd, plain = encoder.frame.strands[0].tube.coder, Values(field)
    for first, end in ((VALUE, OFFSET), (AROUND_VALUE, STATES)):
        assert cd.prob[first:end].tolist() == plain.p[first:end]
        assert cd.seen[first:end].tolist() == plain.seen[first:end]
    assert [sorted(mix[: n + 7]) for mix in cd.blend.mix[VALUE_MIX:].tolist()] == [sorted(mix) for mix in plain.mix]


# -- files -------------------------------------------------------------------------------------------------------------


def drawn(data: bytes, cut: int | None = None) -> list[bytes]:
    """Points and cells of every isovalue, fed whole or in pieces of so many bytes."""
    decoder = isocodec.Decoder()
    for i in range(0, len(data), cut or len(data)):
        decoder.feed(data[i : i + (cut or len(data))])
        for _ in decoder:
            pass
    decoder.close()
    contours = [decoder.contour(i) for i in range(len(decoder.isovalues))]
    return [x.tobytes() for c in contours for x in (c.points, c.cells)]


def pieces(contour: isocodec.Contour) -> list[list[list[float]]]:
    """Segments or triangles by their points, in an order that no numbering of the points changes."""
    return sorted(sorted(cell) for cell in contour.points[contour.cells].tolist())


@pytest.mark.parametrize("n", [2, 3])
@examples(25)
@given(data=st.data())
def test_both_profiles_decode_to_the_same(n, data):
    """Another entropy coder, the same curve: signs of any field, values, offsets, bases at any level."""
    above = data.draw(sign_fields(n, 12 if n == 2 else 6, 40))
    full = n * cube_exponent(above.shape)
    rng = np.random.default_rng(data.draw(st.integers(0, 1 << 32)))
    field = np.where(above, 1, -1) * rng.integers(1, data.draw(st.sampled_from([2, 200])), above.shape)
    rest = grid_plan(n, full, 0)[1:]
    options = data.draw(st.sampled_from([
        {"precision": "signs"}, {"precision": "signs", "layers": 0}, {"precision": "signs", "layers": full},
        {"precision": "exact"}, {"layers": [("base", 0), ("values", None), *rest, ("values", None)]},
        {"layers": [*grid_plan(n, full, 0), ("offsets", 11)]},
        {"layers": [*grid_plan(n, full, None), ("offsets", 3), ("offsets", 15)]},
        {"layers": "crossing", "precision": 0.2},
    ]))
    isovalues = data.draw(st.sampled_from([0.5, (0.5, 20.5)]))
    files = [isocodec.encode(field, isovalues, profile=profile, **options) for profile in ("baseline", "main")]
    found = drawn(files[1], data.draw(st.sampled_from([None, 1, 7])))
    baseline, main = (isocodec.open(file).contours() for file in files)
    assert found == [x.tobytes() for c in main for x in (c.points, c.cells)]
    # Which layers a further isovalue has depends on its bytes, and the order of points on the layers.
    plans = [[(x.kind, x.level, x.plane, x.isovalue) for x in isocodec.open(file).info.layers] for file in files]
    if plans[0] == plans[1]:
        assert found == drawn(files[0])
    assert [pieces(c) for c in main] == [pieces(c) for c in baseline]
