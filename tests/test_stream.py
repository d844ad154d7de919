"""Files: any way of cutting the bytes, prefixes, truncation, errors, limits, hostile bytes, what they say."""

from __future__ import annotations

import random
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

import isocodec
from brute import INTERPRETED, examples
from files import HEADER, NAMES, files, layers_file, picture, same_drawing, whole, with_checksum
from isocodec import Decoder, Encoder, FormatError, IsoError, LimitError, Limits, OptionError, TruncatedError
from isocodec.passes.snapshot import state_of
from isocodec.stream.container import read_envelope
from isocodec.stream.events import BaseComplete, ChunkSkipped, End, HeaderRead, LayerComplete
from isocodec.stream.header import Header, read_header, write_header
from isospec.container import (
    ChunkType,
    Profile,
    write_varint,
)  # fmt: skip

# --- cutting the bytes ----------------------------------------------------------------------------------------------


class Feeding(RuleBasedStateMachine):
    """Pieces of any size, events taken one by one or all at once, drawings in between: nothing changes the result."""

    @initialize(name=st.sampled_from(NAMES))
    def begin(self, name):
        self.name, self.data = name, files()[name]
        self.decoder, self.fed, self.events, self.before = Decoder(), 0, [], {}

    @rule(size=st.one_of(st.integers(0, 3), st.integers(0, 60)), kind=st.sampled_from([bytes, bytearray, memoryview]))
    def feed(self, size, kind):
        self.decoder.feed(kind(self.data[self.fed : self.fed + size]))
        self.fed = min(self.fed + size, len(self.data))

    @rule()
    def all_events(self):
        self.events += list(self.decoder)

    @rule()
    def one_event(self):
        self.events += [event for _, event in zip(range(1), self.decoder, strict=False)]

    @rule()
    def draw(self):
        self.events += list(self.decoder)  # a snapshot takes what is due
        contour = self.decoder.snapshot()
        assert same_drawing(contour, self.decoder.drawn())
        assert contour.complete == self.decoder.complete

    @invariant()
    def counts_only_grow(self):
        if hasattr(self, "decoder"):
            now = self.decoder.symbols
            total = whole(self.name)[1]
            assert all(self.before.get(name, 0) <= now[name] <= total[name] for name in total)
            self.before = now

    def teardown(self):
        if not hasattr(self, "decoder"):
            return
        self.decoder.feed(self.data[self.fed :])
        self.events += list(self.decoder)
        self.decoder.close()
        events, symbols, contour, decoded = whole(self.name)
        assert self.events == events
        assert self.decoder.symbols == symbols
        assert state_of(self.decoder._tube).lines() == decoded.lines()
        assert same_drawing(self.decoder.snapshot(), contour)


TestFeeding = Feeding.TestCase
TestFeeding.settings = settings(max_examples=5 if INTERPRETED else 150, stateful_step_count=40)


@pytest.mark.parametrize("name", NAMES)
def test_byte_by_byte(name):
    """Events, with their offsets, come when their last byte is there, and are those of the whole file."""
    decoder, events = Decoder(), []
    for i, byte in enumerate(files()[name]):
        decoder.feed(bytes([byte]))
        fresh = list(decoder)
        # A symbol may be certain before the coder's window of four bytes is full; the offset counts the window.
        # Two checksums may follow on a chunk.
        assert all(i + 1 - 8 <= event.offset <= i + 1 + 4 for event in fresh)
        events += fresh
    decoder.close()
    assert events == whole(name)[0]
    assert same_drawing(decoder.snapshot(), whole(name)[2])


@pytest.mark.parametrize("name", NAMES)
def test_order_of_events(name):
    """Header first, base, then as many layers as are announced; offsets ascend; the end is the file's."""
    events = whole(name)[0]
    assert isinstance(events[0], HeaderRead)
    layers = [event for event in events if isinstance(event, LayerComplete)]
    assert isinstance(layers[0], BaseComplete)
    assert [event.number for event in layers] == list(range(1, len(layers) + 1))
    offsets = [event.offset for event in events]
    assert offsets == sorted(offsets)
    symbols = whole(name)[1]
    assert {k: sum(e.symbols.get(k, 0) for e in layers) for k in symbols} == symbols
    assert isinstance(events[-1], End) and events[-1].offset == len(files()[name])
    skipped = [event.type for event in events if isinstance(event, ChunkSkipped)]
    assert skipped == ([ChunkType.INDEX] if name == "several runs" else [])


@pytest.mark.parametrize("name", NAMES)
def test_prefixes(name):
    """Any prefix: symbols are the first ones of the file's, a drawing works, and only close() complains."""
    data, (_, total, _, _) = files()[name], whole(name)
    before = dict.fromkeys(total, 0)
    for length in range(len(data)):
        decoder = Decoder()
        decoder.feed(data[:length])
        events = list(decoder)
        assert events == whole(name)[0][: len(events)]
        assert all(before[k] <= v <= total[k] for k, v in decoder.symbols.items())
        before = decoder.symbols
        contour = decoder.snapshot()
        assert not contour.complete and not decoder.complete
        if len(contour.points):
            assert np.isfinite(contour.points).all()
            assert (contour.points >= 0).all() and (contour.points <= np.array(contour.shape) - 1).all()
            assert contour.cells.max() < len(contour.points)
        for _ in range(2):
            with pytest.raises(TruncatedError) as caught:
                decoder.close()
            assert caught.value.code == "truncated" and caught.value.offset == length
        assert same_drawing(decoder.snapshot(), contour)
        if decoder.isovalues:
            assert same_drawing(isocodec.decode(data, max_bytes=length), contour)
        else:
            with pytest.raises(TruncatedError, match="before its curve begins"):
                isocodec.decode(data, max_bytes=max(length, 1))


def test_feed_after_close():
    """Closed is closed, after a whole file too."""
    for length in (0, 9, None):
        decoder = Decoder()
        decoder.feed(files()["exact"][:length])
        if length is None:
            decoder.close()
        else:
            with pytest.raises(TruncatedError):
                decoder.close()
        with pytest.raises(TruncatedError) as caught:
            decoder.feed(b"\0")
        assert caught.value.code == "closed"


def test_errors_are_sticky():
    """After an error every later call raises the same one, however many bytes follow."""
    data = bytearray(files()["exact"])
    data[5] = 0xC0
    decoder = Decoder()
    decoder.feed(data[:3])
    assert list(decoder) == []
    decoder.feed(data[3:])
    with pytest.raises(FormatError) as first:
        list(decoder)
    for call in (lambda: list(decoder), lambda: decoder.feed(bytes(10)), decoder.snapshot, decoder.close):
        with pytest.raises(FormatError) as again:
            call()
        assert again.value is first.value


# --- truncation -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_truncate_to_layers(name):
    """The first layers alone are a valid file, which draws what the file draws after them."""
    data = files()[name]
    count = sum(isinstance(event, LayerComplete) for event in whole(name)[0])
    for layers in range(1, count + 1):
        short = isocodec.truncate(data, layers=layers)
        contour = isocodec.decode(short)
        assert contour.complete
        assert same_drawing(contour, isocodec.decode(data, layers=layers))
        info = isocodec.inspect(short)
        assert info.complete and len(info.layers) == layers
        assert isocodec.truncate(short, layers=layers) == short
        # It may be longer than the bytes up to there by a length that takes a byte more, and a program of its own.
        assert len(short) <= len(data) + 8
    assert isocodec.truncate(data, layers=count + 1) == data
    with pytest.raises(OptionError):
        isocodec.truncate(data, layers=0)


@pytest.mark.parametrize("name", NAMES)
def test_truncate_to_bytes(name):
    """As many symbols as fit: a valid file, not too long, which draws what some prefix near that length does."""
    data = files()[name]
    prefixes = []
    for length in range(len(data) + 1):
        decoder = Decoder()
        decoder.feed(data[:length])
        prefixes.append((decoder.snapshot(), decoder.symbols))
    fits = False
    for size in range(1, len(data) + 1):
        try:
            short = isocodec.truncate(data, max_bytes=size)
        except OptionError:
            assert not fits, "a smaller size was enough"
            continue
        fits = True
        assert len(short) <= size
        decoder = Decoder()
        decoder.feed(short)
        contour = decoder.snapshot()
        decoder.close()
        assert contour.complete
        # The checksum, the chunk's length and the number of symbols have to fit too: 4 + 1 + 3 and some.
        near = range(size, max(size - 24, 0), -1)
        assert any(prefixes[i][1] == decoder.symbols and same_drawing(prefixes[i][0], contour) for i in near)
        assert isocodec.truncate(short, max_bytes=len(short)) == short
    assert fits and isocodec.truncate(data, max_bytes=len(data) + 5) == data


def test_truncate_what_was_cut_off():
    """A file that was cut off anywhere can be made whole again, in layers or in bytes."""
    data = files()["exact"]
    for length in range(len(data)):
        decoder = Decoder()
        decoder.feed(data[:length])
        events = [event for event in decoder if isinstance(event, LayerComplete)]
        if events:
            short = isocodec.truncate(data[:length], layers=len(events))
            assert same_drawing(isocodec.decode(short), isocodec.decode(data, layers=len(events)))
        with pytest.raises((OptionError, TruncatedError)):
            isocodec.truncate(data[:length], layers=len(events) + 1)


@pytest.mark.parametrize("data", ["terrain.iso", 7, None, [1, 2]])
def test_what_is_not_the_bytes_of_a_file(data):
    for call in (isocodec.decode, isocodec.inspect, lambda x: isocodec.truncate(x, layers=1), Decoder().feed):
        with pytest.raises(OptionError, match="read_bytes"):
            call(data)


@pytest.mark.parametrize("options", [{"layers": 2.5}, {"layers": 0}, {"max_bytes": 1e3}, {"max_bytes": -1}])
def test_numbers_of_layers_and_bytes_are_whole(options):
    with pytest.raises(OptionError, match="whole number"):
        isocodec.decode(files()["exact"], **options)


def test_truncation_does_not_make_damage_valid():
    """A chunk with a checksum of its own, in a file that is cut off behind it."""
    data = files()["several runs"]
    checked = next(envelope for envelope in envelopes(data) if envelope.checked and envelope.end > 60)
    cut = bytearray(data[: checked.end + 6])
    cut[checked.end - 3] ^= 16
    for options in ({"layers": 1}, {"max_bytes": checked.end - 6}):
        with pytest.raises(FormatError, match="chunk's checksum"):
            isocodec.truncate(bytes(cut), **options)
    with pytest.raises(FormatError, match="chunk's checksum"):
        isocodec.inspect(bytes(cut))


def envelopes(data):
    """All chunks of a file."""
    at = read_header(data)[1]
    while at < len(data):
        envelope = read_envelope(data, at)
        yield envelope
        at = envelope.end + 4 * (envelope.checked + envelope.last)


# --- limits ---------------------------------------------------------------------------------------------------------


def limited(data, **limits):
    decoder = Decoder(Limits(**limits))
    with pytest.raises(LimitError) as caught:
        decoder.feed(data)
        list(decoder)
    return decoder, caught.value.code


def test_limits():
    """Each limit is an error of its own before the memory is taken."""
    data = isocodec.encode(picture((60, 60), 8, noise=0.5), 0, base_level=0)
    decoder, code = limited(data, vertices=500)
    assert code == "limit-vertices"
    assert decoder._tube.state.at[2] <= 500 and len(decoder._tube.state.vertex) <= 2 * 500
    decoder, code = limited(data, simplices=700)
    assert code == "limit-simplices"
    assert max(len(decoder._tube.state.leaf), len(decoder._tube.state.below)) <= 2 * 700
    decoder, code = limited(data, bytes=len(data) - 1)
    assert code == "limit-bytes" and len(decoder._data) == 0
    Decoder(Limits(bytes=len(data))).feed(data)
    speck = np.zeros((40, 40), int)
    speck[21, 19] = 1
    _, code = limited(isocodec.encode(speck, 0, base_level=0), steps=0)
    assert code == "limit-steps"


def test_limits_of_whole_files():
    data = files()["exact"]
    with pytest.raises(LimitError):
        isocodec.decode(data, limits=Limits(vertices=10))
    assert same_drawing(isocodec.decode(data, limits=Limits(vertices=1 << 17)), isocodec.decode(data))


def test_isovalues_are_counted_from_0():
    decoder = Decoder()
    decoder.feed(files()["exact"])
    assert len(decoder.snapshot(0).points) and not len(decoder.snapshot(1).points)
    for ask in (decoder.snapshot, decoder.drawn, decoder.state, decoder.mesh):
        with pytest.raises(OptionError, match="counted from 0"):
            ask(-1)


@pytest.mark.parametrize("wrap", [bytearray, memoryview, lambda data: np.frombuffer(data, np.uint8)])
def test_any_buffer_of_bytes(wrap):
    data = files()["exact"]
    assert isocodec.truncate(wrap(data), layers=1) == isocodec.truncate(data, layers=1)
    assert same_drawing(isocodec.decode(wrap(data)), isocodec.decode(data))
    assert same_drawing(isocodec.decode(wrap(data), max_bytes=60), isocodec.decode(data, max_bytes=60))
    assert isocodec.inspect(wrap(data)).complete


def test_limits_hold_for_all_isovalues_together():
    field = picture((24, 26), 9)
    levels = [-20.5 + 4 * i for i in range(10)]
    data = isocodec.encode(field, levels, exact=True, leaning=False)
    decoder = Decoder()
    decoder.feed(data)
    decoder.close()
    counts = [len(decoder.state(number).position) for number in range(10)]
    assert sum(counts) > 2 * max(counts)
    isocodec.decode(data, limits=Limits(vertices=sum(counts) + 32), isovalue=levels[-1])
    decoder, code = limited(data, vertices=max(counts) + 32)
    assert code == "limit-vertices"
    assert sum(len(decoder.state(number).position) for number in range(len(decoder.isovalues))) <= max(counts) + 32


def test_ancestors_count_as_steps():
    """In the largest cube few vertices, far apart, have many ancestors; how the bytes come in changes nothing."""
    program = bytes([0x80 | 5 << 4, 0x80 | 6 << 4 | 1, 6 << 4 | 1])
    run = random.Random(2644832001).randbytes(304)
    data = layers_file(program + run, head=write_header(Header((1 << 20,) * 3, 0.5, None, Profile.MAIN)))
    decoder, code = limited(data, steps=20_000)
    assert code == "limit-steps" and decoder.symbols["significance"] > 10
    bytewise = Decoder(Limits(steps=20_000))
    with pytest.raises(LimitError, match="steps") as caught:
        for i in range(len(data)):
            bytewise.feed(data[i : i + 1])
            list(bytewise)
    assert caught.value.offset == decoder._error.offset
    assert bytewise.symbols == decoder.symbols


def test_limit_of_layers():
    """More layers announced than the limit allows are refused; as many are not."""
    data = files()["exact"]
    count = len(isocodec.inspect(data).layers)
    decoder = Decoder(Limits(layers=count))
    decoder.feed(data)
    decoder.close()
    limited(data, layers=count - 1)


def test_memory_follows_the_curve_not_the_header():
    """A header that claims 2**24 x 2**24 samples costs nothing by itself."""
    head = write_header(Header((1 << 24, 1 << 24), 0.5))
    decoder = Decoder()
    decoder.feed(head)
    assert len(list(decoder)) == 1
    assert sum(a.nbytes for a in decoder._tube.state if isinstance(a, np.ndarray)) < 1 << 20


# --- hostile bytes --------------------------------------------------------------------------------------------------

SECONDS = 20
"""Far more than any file of a few hundred bytes takes (some ms); far less than a loop that depends on the header."""


def survive(data, limits=None):
    """Whole and byte by byte a decoder succeeds or raises the same IsoError, in time."""
    began = time.monotonic()
    outcomes = []
    for step in (len(data), 7):
        decoder = Decoder(limits or Limits(vertices=1 << 17, simplices=1 << 18, steps=1 << 22))
        try:
            for i in range(0, len(data), max(step, 1)):
                decoder.feed(data[i : i + step])
                list(decoder)
                decoder.drawn()
            decoder.close()
            decoder.snapshot()
            outcomes.append(state_of(decoder._tube).lines())
        except IsoError as error:
            outcomes.append((type(error), error.code, error.offset))
    assert outcomes[0] == outcomes[1]
    assert INTERPRETED or time.monotonic() - began < SECONDS
    return outcomes[0]


@pytest.mark.parametrize("name", ["offsets", "several runs"])
def test_every_flipped_bit_is_found(name):
    """No single wrong bit goes unnoticed: the file's checksum covers every byte before it."""
    data = files()[name]
    for place in range(8 * len(data)):
        wrong = bytearray(data)
        wrong[place // 8] ^= 128 >> place % 8
        with pytest.raises(IsoError):
            decoder = Decoder(Limits(vertices=1 << 17))
            decoder.feed(wrong)
            decoder.close()


shapes_ = st.one_of(
    st.lists(st.integers(1, 40), min_size=2, max_size=3),
    st.sampled_from([[1 << 24, 1 << 24], [1 << 20] * 3, [1, 1], [1, 1, 1], [2, 1 << 24], [3, 2, 1 << 20], [257] * 3]),
).map(tuple)


@st.composite
def programs_(draw, shape):
    """A program that is valid for a shape, more or less."""
    full = len(shape) * max(max(shape) - 2, 0).bit_length()
    level = draw(st.integers(0, min(full, draw(st.sampled_from([4, 12, 60])))))
    out = [b"\x0e" + write_varint(level)]
    if level < full and draw(st.booleans()):
        out.append(b"\x1e" + write_varint(draw(st.integers(1, min(full - level, 12)))))
    if level == full and draw(st.booleans()):
        out.append(bytes([0x30 + draw(st.integers(1, 13))]))
    elif draw(st.booleans()):
        out.append(bytes([0x2F, draw(st.integers(0, 14)) << 4 | draw(st.integers(0, 14))]))
    return b"".join(bytes([step[0] | (0x80 if i < len(out) - 1 else 0)]) + step[1:] for i, step in enumerate(out))


@examples(300)
@given(st.data())
def test_random_runs(data):
    """Noise where entropy-coded data should be, behind a header and a program that are valid."""
    shape = data.draw(shapes_)
    program = data.draw(programs_(shape))
    noise = st.binary(max_size=60) | st.integers(0, 40).map(bytes) | st.integers(0, 40).map(lambda n: b"\xff" * n)
    payload = program + data.draw(noise)
    kind = ChunkType.LAYERS
    if data.draw(st.booleans()):
        kind, payload = ChunkType.CUT_LAYERS, write_varint(data.draw(st.integers(0, 300))) + payload
    survive(layers_file(payload, kind, write_header(Header(shape, 0.5))))


@examples(300)
@given(st.binary(max_size=80))
def test_random_chunks(noise):
    """Noise behind a header, with and without a checksum that fits."""
    survive(HEADER + noise)
    survive(with_checksum(HEADER + noise))


@examples(300)
@given(st.sampled_from(NAMES), st.data())
def test_mutations_with_a_right_checksum(name, data):
    """Bytes changed, dropped, doubled, and the checksum made to fit: the passes see hostile symbols."""
    body = bytearray(files()[name][:-4])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(body) - 1))
        what = data.draw(st.sampled_from(["set", "flip", "drop", "insert"]))
        if what == "set":
            body[at] = data.draw(st.integers(0, 255))
        elif what == "flip":
            body[at] ^= 1 << data.draw(st.integers(0, 7))
        elif what == "drop" and len(body) > 1:
            del body[at]
        else:
            body.insert(at, data.draw(st.integers(0, 255)))
    survive(with_checksum(bytes(body)))


# --- what a file says of itself -------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape, seed", [((30, 40), 1), ((127, 100), 2), ((9, 8, 10), 3), ((16, 16, 16), 4)])
@pytest.mark.parametrize("isovalue", [3, -7.5])
def test_overhead(shape, seed, isovalue):
    """Small integer files, exact: at most 24 bytes are not entropy-coded data."""
    data = isocodec.encode(picture(shape, seed), isovalue, exact=True)
    assert len(data) < 4096
    assert isocodec.inspect(data).overhead_bytes <= 24


@pytest.mark.parametrize("name", NAMES)
def test_inspect(name):
    """Structure without decoding agrees with the decoder; chunks cover the file behind its header."""
    data = files()[name]
    info = isocodec.inspect(data, symbols=True)
    layers = [event for event in whole(name)[0] if isinstance(event, LayerComplete)]
    stated = [(e.layer.kind, e.layer.level, e.layer.plane) for e in layers]
    assert [(x.kind, x.level, x.plane) for x in info.layers] == stated
    assert [x.symbols for x in info.layers] == [e.symbols for e in layers]
    assert info.complete and info.bytes == len(data)
    assert info.chunks[0].offset == read_header(data)[1]
    assert sum(c.bytes for c in info.chunks) == len(data) - info.chunks[0].offset
    assert info.overhead_bytes == len(data) - sum(e.bytes for e in layers)
    if name == "several runs":
        assert len(info.chunks) > 3
        index = isocodec.inspect(data).layers
        assert [x.symbols for x in index] == [e.symbols for e in layers]
        assert [x.bytes for x in index] == [e.bytes for e in layers]


def test_encoder_yields_as_it_goes():
    """Pieces come run by run, and progress counts the layers."""
    seen = []
    noise = np.random.default_rng(1).integers(0, 99, (420, 420))
    source = Encoder(noise, 49, exact=True, progress=lambda done, total: seen.append((done, total)))
    pieces = list(source)
    assert len(pieces) > 3  # header, two runs of 2**16 bytes or more, checksum
    assert max(map(len, pieces)) < sum(map(len, pieces)) * 0.9
    assert [done for done, _ in seen] == list(range(1, len(source.layers) + 1))
    decoder = Decoder()
    decoder.feed(b"".join(pieces))
    decoder.close()


def test_a_search_says_that_it_goes_on():
    """Curves that are tried are counted, of unknown total, before there are layers to count."""
    seen = []
    field = np.add.outer(np.arange(40) ** 2, np.arange(40) ** 2)
    source = Encoder(field, 700.5, tolerance=1, progress=lambda done, total: seen.append((done, total)))
    tried = len(seen)
    assert tried > 3 and seen == [(i + 1, 0) for i in range(tried)]
    assert list(source) and seen[tried:] == [(i + 1, len(source.layers)) for i in range(len(source.layers))]


def test_an_encoder_is_iterated_once():
    """A second pass over the same state would write nonsense; it is refused."""
    encoder = Encoder(np.add.outer(np.arange(5), np.arange(6)), 4.5)
    assert b"".join(encoder)
    with pytest.raises(OptionError, match="once"):
        b"".join(encoder)
