"""The range coder: runs that can be checked by hand, an exact coder in big integers, cuts and ends; parabolas."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brute import examples
from isocodec.entropy.context_layout import no_blend, rates
from isocodec.entropy.range_coder import (
    BEYOND,
    DECODE,
    ENCODE,
    FLOOR,
    ONE,
    Coder,
    CoderRegisters,
    code,
    cut,
    finish,
    start,
)
from isocodec.grid.models.parabola import FREE, MOST, ONWARD, STIFFNESS, beside_the_gate, through_the_gate
from tables import looped

HALF = ONE // 2
ADAPTIVE = rates()
FIXED = np.zeros(1, np.int64)
"""A step of nothing: probabilities stay as they are."""


def coder(mode, probabilities, rate=ADAPTIVE, room=1 << 14):
    """A coder whose context i starts with probability ``probabilities[i]`` (of 2**16) of a 1."""
    prob = np.array(probabilities, np.int64)
    cd = Coder(CoderRegisters(), np.zeros(room, np.uint8), prob, np.zeros(len(prob), np.int64), rate, no_blend())
    start(cd.reg, mode)
    return cd


def encoded(symbols, probabilities, rate=ADAPTIVE):
    """Run of (context, bit) pairs."""
    cd = coder(ENCODE, probabilities, rate)
    for ctx, bit in symbols:
        assert code(cd, ctx, bit) == bit
    return finish(cd)


def feed(cd, data, final):
    """Hand all of ``data`` over; a prefix of it may have been handed over before."""
    cd.buf[: len(data)] = np.frombuffer(data, np.uint8)
    cd.reg.end = len(data)
    cd.reg.final = final


def decoded(data, contexts, probabilities, rate=ADAPTIVE, final=True):
    """Bits that ``data`` decodes to in a sequence of contexts, as far as it goes."""
    cd = coder(DECODE, probabilities, rate)
    feed(cd, data, final)
    out = []
    for ctx in contexts:
        bit = code(cd, ctx, 0)
        if bit < 0:
            break
        out.append(int(bit))
    return out


# --- by hand --------------------------------------------------------------------------------------------------------


@looped(
    "bits, run",
    [
        ("", ""),  # [0, 1): no byte, read as 0
        ("1", ""),  # a 1 takes the lower half, [0, 1/2)
        ("0", "80"),  # [1/2, 1): 0x80 = 1/2
        ("00", "c0"),  # [3/4, 1)
        ("10", "40"),  # [1/4, 1/2)
        ("01010101", "aa"),  # eight halvings are the complement of a byte
        ("00000000", "ff"),
        ("11111110", "01"),  # [1/256, 2/256)
        ("11111111", ""),  # [0, 1/256)
        ("111111111", "00"),  # the ninth symbol shifts a byte out, and what is out stays
        ("0101010100001111", "aaf0"),
        ("010101011111111110", "aa0040"),  # 10101010 00000000 01
    ],
)
def test_halvings(bits, run):
    """With a fixed probability of 1/2 a run is the complement of its bits; the ending drops zero bytes."""
    symbols = [(0, int(b)) for b in bits]
    assert encoded(symbols, [HALF], FIXED).hex() == run
    assert decoded(bytes.fromhex(run), [0] * len(bits), [HALF], FIXED) == [int(b) for b in bits]


@looped(
    "bits, run",
    [
        ("1", ""),  # [0, 3/4)
        ("0", "c0"),  # [3/4, 1)
        ("10", "90"),  # [9/16, 3/4): 9/16 = 0x90; 0x90 is the first multiple of 1/256 in it
        ("110", "6c"),  # [27/64, 9/16): 27/64 = 108/256
        ("01", "c0"),  # [3/4, 15/16)
        ("00", "f0"),  # [15/16, 1)
    ],
)
def test_three_quarters(bits, run):
    """With a fixed probability of 3/4 the intervals are products of 3/4 and 1/4."""
    symbols = [(0, int(b)) for b in bits]
    assert encoded(symbols, [ONE * 3 // 4], FIXED).hex() == run
    assert decoded(bytes.fromhex(run), [0] * len(bits), [ONE * 3 // 4], FIXED) == [int(b) for b in bits]


def test_adaptation_by_hand():
    """The first step is 1/2: after a 1 the probability goes from 1/2 to 3/4, after a 0 to 1/4."""
    for bit, after in ((1, ONE * 3 // 4), (0, ONE // 4)):
        cd = coder(ENCODE, [HALF])
        code(cd, 0, bit)
        assert (cd.prob[0], cd.seen[0]) == (after, 1)


def test_probabilities_keep_from_certainty():
    """Thousands of equal symbols bring a model to its floor, and no further."""
    for bit, end in ((1, ONE - FLOOR), (0, FLOOR)):
        cd = coder(ENCODE, [HALF], room=1 << 16)
        for _ in range(4000):
            code(cd, 0, bit)
        assert abs(int(cd.prob[0]) - end) <= len(ADAPTIVE)  # the last step's rounding: a 160th of the rest is lost
        assert FLOOR <= cd.prob[0] <= ONE - FLOOR


# --- against exact arithmetic ---------------------------------------------------------------------------------------


class Exact:
    """The coder in integers without bound: no carries, no window."""

    def __init__(self, probabilities, rate):
        self.low, self.width, self.shifts = 0, 1 << 32, 0
        self.p, self.seen, self.rate = list(probabilities), [0] * len(probabilities), [int(r) for r in rate]

    def code(self, ctx, bit):
        p, step = self.p[ctx], self.rate[self.seen[ctx]]
        bound = self.width * p >> 16
        if bit:
            self.width = bound
        else:
            self.low, self.width = self.low + bound, self.width - bound
        p = p + ((ONE - p) * step >> 16) if bit else p - (p * step >> 16)
        self.p[ctx] = max(FLOOR, min(ONE - FLOOR, p))
        self.seen[ctx] = min(self.seen[ctx] + 1, len(self.rate) - 1)
        while self.width < 1 << 24:
            self.low, self.width, self.shifts = self.low << 8, self.width << 8, self.shifts + 1

    def ending(self):
        """The interval is [low, low + width) in units of 256**-(shifts + 4)."""
        for length in range(self.shifts, self.shifts + 5):
            unit = 256 ** (self.shifts + 4 - length)
            value = -(-self.low // unit)
            if value * unit < self.low + self.width:
                return value.to_bytes(length, "big")
        raise AssertionError


CONTEXTS_USED = 4
probabilities_ = st.lists(
    st.one_of(st.sampled_from([FLOOR, HALF, ONE - FLOOR]), st.integers(FLOOR, ONE - FLOOR)),
    min_size=CONTEXTS_USED, max_size=CONTEXTS_USED,
)
rates_ = st.sampled_from([ADAPTIVE, FIXED])


@st.composite
def symbols_(draw, most=400):
    """Symbols in random contexts: noise of any skew, all equal, alternating, or a rare one among many."""
    count = draw(st.integers(0, most))
    rng = np.random.default_rng(draw(st.integers(0, 1 << 32)))
    contexts = rng.integers(0, draw(st.integers(1, CONTEXTS_USED)), count)
    kind = draw(st.sampled_from(["noise", "equal", "alternating", "rare"]))
    if kind == "noise":
        bits = rng.random(count) < draw(st.sampled_from([0.02, 0.3, 0.5, 0.9, 0.999]))
    elif kind == "equal":
        bits = np.full(count, draw(st.booleans()))
    elif kind == "alternating":
        bits = np.arange(count) % 2 == draw(st.integers(0, 1))
    else:
        bits = np.zeros(count, bool)
        bits[rng.integers(0, max(count, 1), min(count, 2))] = True
    return [(int(c), int(b)) for c, b in zip(contexts, bits, strict=True)]


@examples(300)
@given(symbols_(), probabilities_, rates_)
def test_bytes_are_those_of_exact_arithmetic(symbols, probabilities, rate):
    """Carries, windows and the shortest ending give what unbounded integers give; and it decodes."""
    exact = Exact(probabilities, rate)
    for ctx, bit in symbols:
        exact.code(ctx, bit)
    run = encoded(symbols, probabilities, rate)
    assert run == exact.ending()
    assert decoded(run, [c for c, _ in symbols], probabilities, rate) == [b for _, b in symbols]


def test_carry_runs_through_many_bytes():
    """A carry through 0xff bytes: the interval straddles a byte boundary until a 0 tips it over.

    Probability 85/256, 1/3 nearly: after a 0 the interval is [85/256, 1); symbols are chosen so that the interval
    keeps the point 1/2 inside, which in bytes is 0x7fff.. from below and 0x8000.. from above.
    """
    exact, p = Exact([85 << 8], FIXED), [85 << 8]
    symbols = []
    while exact.shifts < 12:
        goal = 1 << (8 * exact.shifts + 31)
        bound = exact.width * p[0] >> 16
        symbols.append((0, int(goal < exact.low + bound)))
        exact.code(*symbols[-1])
    below, above = exact.low, exact.low + exact.width
    assert below < 1 << (8 * exact.shifts + 31) < above  # the run's bytes so far are 7f ff ff .., or end in 80 00 ..
    outcomes = set()
    for tail in ([1] * 40, [0] * 40):
        run = encoded(symbols + [(0, b) for b in tail], p, FIXED)
        assert decoded(run, [0] * (len(symbols) + 40), p, FIXED) == [b for _, b in symbols] + tail
        outcomes.add(run[:8].hex())
    assert outcomes == {"7f" + "ff" * 7, "80" + "00" * 7}


@examples(100)
@given(symbols_(200), probabilities_)
def test_no_ending_is_shorter(symbols, probabilities):
    """Dropping the last byte of a run, whatever the one before becomes, loses a symbol; only zeros are ever free."""
    run = encoded(symbols, probabilities)
    contexts, bits = [c for c, _ in symbols], [b for _, b in symbols]
    exact = Exact(probabilities, ADAPTIVE)
    for ctx, bit in symbols:
        exact.code(ctx, bit)
    if len(run) == exact.shifts:
        return
    shorter = int.from_bytes(run[:-1], "big")
    for value in (shorter - 1, shorter, shorter + 1):
        if 0 <= value < 256 ** (len(run) - 1):
            assert decoded(value.to_bytes(len(run) - 1, "big"), contexts, probabilities) != bits


# --- bytes that come one by one -------------------------------------------------------------------------------------


@examples(150)
@given(symbols_(150), probabilities_, st.randoms(use_true_random=False))
def test_a_symbol_is_received_iff_all_continuations_agree(symbols, probabilities, random):
    """What a prefix decodes to, every continuation does; and where it stops, two continuations differ."""
    run = encoded(symbols, probabilities)
    contexts, bits = [c for c, _ in symbols], [b for _, b in symbols]
    patient = coder(DECODE, probabilities)
    got = []
    for length in range(len(run) + 1):
        feed(patient, run[:length], False)
        while len(got) < len(bits):
            bit = code(patient, contexts[len(got)], 0)
            if bit < 0:
                break
            got.append(int(bit))
        assert got == decoded(run[:length], contexts, probabilities, final=False)
        lowest = decoded(run[:length] + bytes(len(bits) + 8), contexts, probabilities)
        highest = decoded(run[:length] + b"\xff" * (len(bits) + 8), contexts, probabilities)
        wild = decoded(run[:length] + random.randbytes(len(bits) + 8), contexts, probabilities)
        assert got == lowest[: len(got)] == highest[: len(got)] == wild[: len(got)] == bits[: len(got)]
        if len(got) < len(bits):
            assert lowest[len(got)] != highest[len(got)]
    feed(patient, run, True)
    while len(got) < len(bits):
        got.append(int(code(patient, contexts[len(got)], 0)))
    assert got == bits


def test_nothing_changes_when_bytes_are_missing():
    """A refused symbol leaves registers and models as they were."""
    cd = coder(DECODE, [HALF])
    feed(cd, b"", False)
    arrays = [cd.reg.values, *cd[1:-1]]
    before = [array.copy() for array in arrays]
    assert code(cd, 0, 0) == -1
    assert all(np.array_equal(a, b) for a, b in zip(before, arrays, strict=True))


def test_encoder_asks_for_room():
    """With a buffer that is too small the encoder says so and can go on in a larger one."""
    small, p = coder(ENCODE, [HALF], FIXED, room=20), [HALF]
    bits = [i % 3 == 0 for i in range(200)]
    for bit in bits:
        while code(small, 0, bit) == -1:
            wider = np.zeros(2 * len(small.buf), np.uint8)
            wider[: len(small.buf)] = small.buf
            small = small._replace(buf=wider)
    assert len(small.buf) > 20
    assert finish(small) == encoded([(0, b) for b in bits], p, FIXED)


# --- ends -----------------------------------------------------------------------------------------------------------


def test_end_of_a_run_by_hand():
    """An empty run at 1/2: 4 + ``BEYOND`` - 4 bytes of zeros, so 8 halvings and the one that shifts; then no more."""
    cd = coder(DECODE, [HALF], FIXED)
    feed(cd, b"", True)
    assert [code(cd, 0, 0) for _ in range(8 * (BEYOND - 4) + 9)] == [1] * 9
    assert cd.reg.over == 0
    assert code(cd, 0, 0) == -1
    assert cd.reg.over == 1


@examples(60)
@given(st.binary(max_size=20), probabilities_)
def test_a_run_is_never_read_far_past_its_end(data, probabilities):
    """Decoding on and on ends in a refusal: at most 2**16 / FLOOR * 8 ln 2 symbols a byte, 11,357, rounded up."""
    cd = coder(DECODE, probabilities)
    feed(cd, data, True)
    for count in range(12_000 * (len(data) + BEYOND + 1)):
        if code(cd, count % CONTEXTS_USED, 0) < 0:
            break
    assert cd.reg.over == 1


def test_a_coder_stops_after_the_symbols_granted():
    """It says -2, not -1, when they are done."""
    cd = coder(DECODE, [HALF], FIXED)
    feed(cd, b"\xaa", True)
    cd.reg.left = 3
    assert [code(cd, 0, 0) for _ in range(5)] == [0, 1, 0, -2, -2]


@examples(200)
@given(symbols_(200), probabilities_, st.data())
def test_cut_ends_a_run_anew(symbols, probabilities, data):
    """After any symbol of any prefix: the same symbols from no more bytes than were fed."""
    run = encoded(symbols, probabilities)
    contexts, bits = [c for c, _ in symbols], [b for _, b in symbols]
    fed = run[: data.draw(st.integers(0, len(run)))]
    final = len(fed) == len(run) and data.draw(st.booleans())
    stop = data.draw(st.integers(0, len(bits)))
    cd = coder(DECODE, probabilities)
    feed(cd, fed, final)
    got = 0
    while got < stop and code(cd, contexts[got], 0) >= 0:
        got += 1
    short = cut(cd)
    assert decoded(short, contexts[:got], probabilities) == bits[:got]
    assert len(short) <= len(fed)
    if got == len(bits):
        assert len(short) <= len(run)


# --- the parabolas --------------------------------------------------------------------------------------------------


def test_extrapolation_from_twenty_points():
    """C2-arith: the largest denominator and weights, on which the bounds of the integers rest."""
    denominator, weights = through_the_gate(20)
    assert (denominator, sum(map(abs, weights))) == (79_332_435, 11_755_498)


@looped("points", range(1, MOST + 1))
def test_onward_is_least_squares_through_the_gate(points):
    """C2-arith, F-80: b t + c t**2 with the least sum of squares, bending weighed.

    The oracle is ``numpy.linalg.lstsq`` with a row for the bending.
    """
    denominator, weights = through_the_gate(points)
    assert list(ONWARD[points, : points + 1]) == [denominator, *weights]
    t = np.arange(-points, 0)
    rows = np.vstack([np.column_stack([t, t**2]), [0, np.sqrt(STIFFNESS)]])
    y = np.random.default_rng(points).normal(size=points)
    b, c = np.linalg.lstsq(rows, np.append(y, 0), rcond=None)[0]
    assert np.dot(weights, y) / denominator == pytest.approx(b + c, abs=1e-6)


@looped("points", range(2, MOST + 1))
def test_free_is_the_published_parabola(points):
    """C2-arith, F-80: the least sum of squares over the last 20 points, the gate's among them, by ``numpy.polyfit``."""
    denominator, weights = beside_the_gate(points)
    assert list(FREE[points, : points + 1]) == [denominator, *weights]
    fitted = min(points + 1, MOST)
    y = np.append(np.random.default_rng(points).normal(size=points), 0)
    onward = np.polyval(np.polyfit(np.arange(fitted), y[-fitted:], 2), fitted)
    assert np.dot(weights, y[:-1]) / denominator == pytest.approx(onward, abs=1e-6)


def solved(rows, right):
    """Solution of a square system in fractions, by elimination."""
    rows = [[*map(Fraction, row), Fraction(value)] for row, value in zip(rows, right, strict=True)]
    for i in range(len(rows)):
        pivot = next(j for j in range(i, len(rows)) if rows[j][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for j in range(len(rows)):
            if j != i:
                rows[j] = [a - rows[j][i] * b for a, b in zip(rows[j], rows[i], strict=True)]
    return [row[-1] for row in rows]


def onward(points, powers, bending):
    """The value at 1 of the sum of some powers of t that comes nearest to (t, f) by least squares, in fractions.

    ``bending`` times the square of the coefficient of t**2 is added to the sum of squares.
    """
    rows = [[sum(t ** (p + q) for t, _ in points) + bending * (p == q == 2) for q in powers] for p in powers]
    return sum(solved(rows, [sum(t**p * f for t, f in points) for p in powers]))
