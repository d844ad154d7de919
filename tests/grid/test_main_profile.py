"""The main profile: its tables, its arithmetic against a plain rendering of the specification, whole files."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples, sign_fields
from isocodec.entropy.context_layout import rates
from isocodec.entropy.mixer import MOST_MIX, blended, clear, see
from isocodec.entropy.network import weighed
from isocodec.entropy.range_coder import DECODE, ENCODE, Coder, CoderRegisters, finish, start
from isocodec.grid.lattice.tables import cube_exponent
from isocodec.grid.models.contexts import CONTEXTS
from isocodec.grid.models.network_rows import (
    AROUND,
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
    VALUE_ROWS,
)
from isocodec.grid.models.trained import shipped_models
from isocodec.search.strategy import grid_plan
from isospec.tables import (
    HIDDEN,
    KINDS,
    MOST_LOGIT,
    NET_ROWS,
    NETS,
    ROWS,
    packed,
    shipped,
    unpacked,
)

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
            *SIGN_ROWS[n], *[0] * (3 - n), TREE_ROWS[n], OFFSET_ROWS, LEAF_ROWS[n], VALUE_ROWS[n], MESH_ROWS[n],
            BASE_ROWS[n],
        ]
    assert packed(squash, found) == shipped()
    assert len(shipped()) < 180_000


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
        wanted = 16 * (p >> 4) + 8
        return next((x for x in range(-2047, 2048) if self.squash[x + 2047] >= wanted), 2047)

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

    def update(self, kind: int, opinions: list[int], contexts: tuple[int, int], p: int, bit: int) -> None:
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
        assert cd.blend.mix[kind].tolist() == plain.mix[kind]
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
