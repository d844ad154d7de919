"""Files: any way of cutting the bytes, prefixes, truncation, errors, limits, hostile bytes; containers byte by byte."""

from __future__ import annotations

import time
import zlib
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

import isocodec
from brute import INTERPRETED, examples, smooth
from isocodec import Decoder, Encoder, FormatError, IsoError, LimitError, Limits, OptionError, TruncatedError
from isocodec.passes.snapshot import state_of
from isocodec.stream import container, encoder, strand
from isocodec.stream.events import BaseComplete, ChunkSkipped, End, HeaderRead, LayerComplete, MetadataRead
from isocodec.stream.header import Header, read_header, write_header
from isocodec.stream.program import Layer, Progress, read_program, write_program
from isospec.container import (
    CHECKED_CHUNK,
    LAYER_LIMIT,
    MAX_SIDE,
    WRITER_VERSION,
    ChunkType,
    VarintError,
    read_varint,
    unzigzag,
    write_varint,
    zigzag,
)  # fmt: skip

# --- files to work on -----------------------------------------------------------------------------------------------


def picture(shape, seed, span=40.0, noise=0.1):
    """Integers: a smooth field with some noise."""
    rng = np.random.default_rng(seed)
    return np.rint(span * (smooth(shape, seed) + noise * rng.normal(size=shape))).astype(np.int64)


@cache
def files():
    """Small files of every kind of layer and chunk, by name."""
    volume = picture((5, 7, 6), 2)
    made = {
        "exact": isocodec.encode(picture((14, 11), 1), 3, exact=True, base_level=2),
        "offsets": isocodec.encode(volume, 0.5, tolerance=0.1),
        "signs": isocodec.encode(picture((12, 20), 3, noise=0.4), 0, signs_only=True, base_level=0),
        "step": isocodec.encode(smooth((9, 13), 4), 0.123, step=0.01, metadata={"name": "wave", "unit": "m"}),
        "single rate": isocodec.encode(picture((11, 11), 5), 0, tolerance=0.3, base_level=8),
        "deep values": isocodec.encode(picture((6, 5), 7, span=1e6), 0.5, exact=True),
        "empty": isocodec.encode(np.zeros((8, 5), int), 0),
    }
    # Small limits in the encoder make a short file with all that a long one has: runs, checksums, an index.
    saved = strand.RUN_BYTES, encoder.INDEX_SHARE, container.CHECKED_CHUNK
    strand.RUN_BYTES, encoder.INDEX_SHARE, container.CHECKED_CHUNK = 24, 0, 16
    try:
        made["several runs"] = isocodec.encode(picture((13, 16), 6), 2, exact=True, base_level=1)
    finally:
        strand.RUN_BYTES, encoder.INDEX_SHARE, container.CHECKED_CHUNK = saved
    return made


NAMES = ["exact", "offsets", "signs", "step", "single rate", "deep values", "empty", "several runs"]


@cache
def whole(name):
    """Events, symbols and drawing of a whole file."""
    decoder = Decoder()
    decoder.feed(files()[name])
    events = list(decoder)
    assert decoder.complete
    return events, decoder.symbols, decoder.snapshot(), state_of(decoder._tube)


def same_drawing(a, b):
    return (
        np.array_equal(a.points, b.points) and np.array_equal(a.cells, b.cells)
        and np.array_equal(a.isovalue, b.isovalue, equal_nan=True) and a.shape == b.shape
    )  # fmt: skip


def with_checksum(body):
    """A file out of all of its bytes but the last four."""
    return body + zlib.crc32(body).to_bytes(4, "big")


def chunk(kind, payload, *, ancillary=False, checked=False, last=False):
    """A chunk as clause 3.5 has it: ancillary, checked, last, five bits of type; length; payload; checksum."""
    out = bytes([ancillary << 7 | checked << 6 | last << 5 | kind]) + write_varint(len(payload)) + payload
    return out + zlib.crc32(out).to_bytes(4, "big") if checked else out


HEADER = bytes.fromhex("8949534f 00 00 05 04 02".replace(" ", ""))
"""5 x 4 samples, isovalue 1/2: root cube of edge 4, so the full grid is level 4."""


def layers_file(payload, kind=ChunkType.LAYERS, head=HEADER):
    """A file of one chunk of layers."""
    return with_checksum(head + chunk(kind, payload, last=True))


def refused(data, code, offset=None):
    """Decoding fails with this code, and ``offset`` is where."""
    with pytest.raises(FormatError) as caught:
        isocodec.decode(data)
    assert caught.value.code == code
    assert caught.value.clause is not None
    if offset is not None:
        assert caught.value.offset == offset


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
        assert same_drawing(isocodec.decode(data, max_bytes=length), contour) if length else True


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


# --- numbers --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "value, encoding",
    [(0, "00"), (1, "01"), (127, "7f"), (128, "8100"), (300, "822c"), (16383, "ff7f"), (16384, "818000"),
     ((1 << 63) - 1, "ff" * 8 + "7f")],
)  # fmt: skip
def test_varint(value, encoding):
    """Seven bits a byte, the highest first: 300 = 2 * 128 + 44."""
    data = bytes.fromhex(encoding)
    assert write_varint(value) == data
    assert read_varint(b"\xaa" + data + b"\xbb", 1, len(data) + 2) == (value, 1 + len(data))
    assert all(read_varint(data, 0, end) is None for end in range(len(data)))


@pytest.mark.parametrize("encoding", ["8000", "8001", "80", "ff" * 9, "81" + "80" * 9])
def test_varint_refused(encoding):
    """Leading zero groups, and more than 9 bytes, are refused as soon as they can be seen."""
    with pytest.raises(VarintError):
        read_varint(bytes.fromhex(encoding), 0, len(encoding) // 2)


def test_zigzag():
    """0, -1, 1, -2, 2 are 0 to 4."""
    assert [zigzag(v) for v in (0, -1, 1, -2, 2)] == [0, 1, 2, 3, 4]
    assert all(unzigzag(zigzag(v)) == v for v in (*range(-300, 300), (1 << 50) - 1, -(1 << 50)))


# --- headers --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "header, encoding",
    [
        # signature; versions; flags 00 scaled kind kind axes profile profile; shape; isovalue
        (Header((5, 4), 0.5), "8949534f 00 00 05 04 02"),  # zigzag(2 * 0.5) = 2
        (Header((5, 4), -0.5), "8949534f 00 00 05 04 01"),
        (Header((300, 2), 128.0), "8949534f 00 00 822c 02 8400"),  # zigzag(256) = 512 = 4 * 128
        (Header((2, 3, 4), 0.0), "8949534f 00 04 02 03 04 00"),
        (Header((2, 2), 0.25), "8949534f 00 08 02 02 3e800000"),  # 2**-2 in IEEE single
        (Header((2, 2), 0.1), "8949534f 00 10 02 02 3fb999999999999a"),
        (Header((2, 2), 0.0, 0.25), "8949534f 00 20 02 02 00 fe"),  # scale 2**-2
        (Header((2, 2), 0.0, 3.0), "8949534f 00 20 02 02 00 80 4008000000000000"),
    ],
)
def test_header(header, encoding):
    """The fixed head, byte by byte."""
    data = bytes.fromhex(encoding.replace(" ", ""))
    assert write_header(header) == data
    assert read_header(data + b"\x21") == (header, len(data))
    assert all(read_header(data[:end]) is None for end in range(len(data)))


@pytest.mark.parametrize(
    "encoding, code, offset",
    [
        ("8949534e", "signature", 0),
        ("89495350 00 00 05 04 02", "signature", 0),
        ("50", "signature", 0),  # seen in the first byte
        (f"8949534f 0{WRITER_VERSION + 1} 00 05 04 02", "version", 4),
        ("8949534f 0f 00 05 04 02", "version", 4),
        ("8949534f 00 80 05 04 02", "reserved", 5),
        ("8949534f 00 40 05 04 02", "reserved", 5),
        ("8949534f 00 03 05 04 02", "profile", 5),
        ("8949534f 00 18 05 04 02", "isovalue", 5),
        ("8949534f 00 00 00 04 02", "shape", 6),
        ("8949534f 00 00 05 00 02", "shape", 7),
        ("8949534f 00 00 88808001 04 02", "shape", 6),  # 2**24 + 1
        ("8949534f 00 04 04 04 c08001 02", "shape", 8),  # 2**20 + 1
        ("8949534f 00 00 ffffffffffffffff7f 04 02", "shape", 6),
        ("8949534f 00 00 8005 04 02", "varint", 6),
        ("8949534f 00 08 05 04 7f800000", "isovalue", 8),  # infinite
        ("8949534f 00 10 05 04 7ff8000000000000", "isovalue", 8),  # NaN
        ("8949534f 00 20 05 04 02 80 0000000000000000", "scale", 9),
        ("8949534f 00 20 05 04 02 80 bff0000000000000", "scale", 9),  # -1
        ("8949534f 00 20 05 04 02 80 7ff0000000000000", "scale", 9),
    ],
)
def test_header_refused(encoding, code, offset):
    """What a header must not say, and where it says so."""
    refused(bytes.fromhex(encoding.replace(" ", "")), code, offset)


def test_largest_header():
    """The largest shapes are allowed, by this reader at least."""
    for n, side in MAX_SIDE.items():
        header = Header((side,) * n, 0.0)
        assert read_header(write_header(header)) == (header, len(write_header(header)))


@examples(200)
@given(
    st.lists(st.integers(1, 1 << 20), min_size=2, max_size=3),
    st.floats(allow_nan=False, allow_infinity=False),
    st.none() | st.floats(min_value=0, exclude_min=True, allow_infinity=False),
)
def test_headers_return(shape, isovalue, scale):
    """Any isovalue and scale survive to the last bit, but for the sign of zero."""
    header = Header(tuple(shape), isovalue, scale)
    data = write_header(header)
    assert read_header(data) == (header, len(data))


# --- programs -------------------------------------------------------------------------------------------------------


def program(encoding, full=4):
    """Layers of a program of a file whose full grid is level ``full``, as (kind, level, plane or parts)."""
    data = bytes.fromhex(encoding.replace(" ", ""))
    found = read_program(data, 0, len(data), Progress(full))
    assert all(read_program(data, 0, end, Progress(full)) is None for end in range(len(data)))
    layers, at = found
    assert at == len(data)
    return [(layer.kind, layer.level, layer.plane or layer.parts) for layer in layers]


BASE_2, REFINE_3, REFINE_4 = ("base", 2, 0), ("refine", 3, 0), ("refine", 4, 0)


@pytest.mark.parametrize(
    "encoding, layers",
    [
        ("02", [BASE_2]),  # operation 0, argument 2
        ("0f", [("base", 4, 0)]),  # as far as it goes
        ("0e 02", [BASE_2]),  # the number follows
        ("82 11", [BASE_2, REFINE_3]),  # more; operation 1, one round
        ("82 1f", [BASE_2, REFINE_3, REFINE_4]),
        ("42", [BASE_2, REFINE_3, REFINE_4]),  # operation 4: base and all rounds
        ("8f 32", [("base", 4, 0), ("offsets", 4, 5)]),  # 2 * 2 + 1 parts
        ("8f 3e 10", [("base", 4, 0), ("offsets", 4, 33)]),
        ("8f b1 32", [("base", 4, 0), ("offsets", 4, 3), ("offsets", 4, 15)]),
        ("8f 2f 12", [("base", 4, 0), ("values", 4, 1), ("values", 4, 0)]),  # 1 bit above, 2 below
        ("8f 21 12", [("base", 4, 0), ("values", 4, 1)]),
        ("82 a1 03 91 21", [BASE_2, ("values", 2, 2), REFINE_3, ("values", 3, 1)]),  # bits are stated once
        ("8f 21 f2 10", [("base", 4, 0), ("values", 4, 15)]),  # 16 bits above: an escape and a number
        ("51", [("adaptive_base", 1, 0)]),
        ("d1 e0 61", [("adaptive_base", 1, 0), ("adapt", 1, 0), ("adapt", 1, 0)]),
        ("8f b1 21 11", [("base", 4, 0), ("offsets", 4, 3), ("values", 4, 0)]),
        ("82 31 02", [BASE_2, ("offsets", 2, 3)]),  # parts of 2**2 samples
        ("82 b1 02 9f 30", [BASE_2, ("offsets", 2, 3), REFINE_3, REFINE_4, ("offsets", 4, 1)]),
        ("8f 30", [("base", 4, 0), ("offsets", 4, 1)]),  # in one part: nothing to be told
        ("8f 2f 00", [("base", 4, 0), ("values", 4, 0)]),  # no bits: values are exact at once
    ],
)
def test_program(encoding, layers):
    """Bytes are: one bit more, three of the operation, four of its argument."""
    assert program(encoding) == layers


@pytest.mark.parametrize(
    "encoding, offset",
    [
        ("05", 0),  # base beyond the full grid, level 4
        ("82 02", 1),  # a second base
        ("82 42", 1),
        ("11", 0),  # before the base
        ("21 11", 0),
        ("31", 0),
        ("82 13", 1),  # three rounds from level 2
        ("82 10", 1),  # none
        ("82 9f 11", 2),  # one more than there are
        ("82 31 19", 1),  # offsets in parts of 2**25 samples
        ("8f 3f", 1),
        ("8f 3e 20", 1),  # in 65 parts
        ("8f be 1f be 1f be 1f be 1f 31", 9),  # in 63**4 = 15,752,961 parts, and each of those in 3: more than 2**24
        ("8f b1 11", 2),  # refinement beyond the full grid
        ("8f a1 11 31", 3),  # offsets after values
        ("8f 23 12", 1),  # three planes of two
        ("55", 0),  # an adaptive base that has more than there is
        ("82 50", 1),
        ("60", 0),  # adaptive refinement before the base
        ("82 62", 1),  # of an unknown kind
        ("82 6f", 1),
        ("8f 60", 1),  # of the full grid
        ("70", 0),  # a base from the leaves of no other isovalue
    ],
)  # fmt: skip
def test_program_refused(encoding, offset):
    """What cannot follow on what was there before."""
    data = bytes.fromhex(encoding.replace(" ", ""))
    with pytest.raises(FormatError) as caught:
        read_program(data, 0, len(data), Progress(4))
    assert caught.value.code == "program" and caught.value.offset == offset
    # the chunk's two bytes come before it
    refused(layers_file(data), "program", len(HEADER) + 2 + offset)


def test_programs_with_too_many_layers_or_bits():
    """4096 layers, and 52 bits of values."""
    many = bytes([0x8F, 0xAF, 0x11]) + b"\xa0" * (LAYER_LIMIT - 2) + b"\x20"
    refused(layers_file(many), "layers")
    refused(layers_file(bytes([0x8F, 0x21, 0xF2, 0x35])), "bits")  # 53 bits
    refused(layers_file(bytes([0x8F, 0x21, 0xF2, 0x0E])), "bits")  # 14 bits fit the nibble
    refused(layers_file(b"\x82"), "program", len(HEADER) + 3)  # more, but there is none
    refused(layers_file(b""), "program")


@st.composite
def layer_lists_(draw):
    """Full level, bits, and layers in any allowed order."""
    full = draw(st.integers(0, 20))
    bits = (draw(st.integers(0, 52)), draw(st.integers(0, 52)))
    layers = [Layer("base", draw(st.integers(0, full)))]
    plane = max(bits)
    use_values = draw(st.booleans())
    for _ in range(draw(st.integers(0, 30))):
        if layers[-1].level < full and draw(st.booleans()):
            layers.append(Layer("refine", layers[-1].level + 1))
        elif use_values and plane > 0:
            plane -= 1
            layers.append(Layer("values", layers[-1].level, plane))
    if not use_values and layers[-1].level == full:
        for radix in draw(st.lists(st.integers(1, 31).map(lambda half: 2 * half + 1), max_size=4)):
            layers.append(Layer("offsets", full, 0, max(layers[-1].parts, 1) * radix))
    return full, bits, layers


@examples(300)
@given(layer_lists_(), st.data())
def test_programs_return(case, data):
    """Any layers, split over any chunks, are read as written."""
    full, bits, layers = case
    split = data.draw(st.integers(0, len(layers)))
    written, read, found = Progress(full), Progress(full), []
    for part in (layers[:split], layers[split:]):
        if part:
            encoding = write_program(part, written, bits)
            fresh, at = read_program(encoding, 0, len(encoding), read)
            assert at == len(encoding)
            found += fresh
    assert found == layers
    assert read == written


# --- chunks ---------------------------------------------------------------------------------------------------------


def split_file(name):
    """Header, and payload of the one chunk, of a file that has no other."""
    data = files()[name]
    head = read_header(data)[1]
    (one,) = isocodec.inspect(data).chunks
    envelope = container.read_envelope(data, one.offset)
    return data[:head], data[envelope.start : envelope.end]


def test_a_file_is_header_chunk_checksum():
    """The container around a run, put together by hand."""
    head, payload = split_file("exact")
    assert with_checksum(head + chunk(ChunkType.LAYERS, payload, last=True)) == files()["exact"]


def test_unknown_ancillary_chunks_are_skipped():
    """Anywhere; checked ones too. The result is the same, and the event says what was left out."""
    head, payload = split_file("exact")
    extra = chunk(20, b"hello", ancillary=True), chunk(31, bytes(300), ancillary=True, checked=True)
    tail = chunk(21, b"", ancillary=True, last=True)
    data = with_checksum(head + extra[0] + extra[1] + chunk(ChunkType.LAYERS, payload) + tail)
    assert same_drawing(isocodec.decode(data), whole("exact")[2])
    decoder = Decoder()
    decoder.feed(data)
    skipped = [(e.type, e.length) for e in decoder if isinstance(e, ChunkSkipped)]
    assert skipped == [(20, 5), (31, 300), (21, 0)]
    assert decoder.complete
    assert [c.type for c in isocodec.inspect(data).chunks] == ["unknown 20", "unknown 31", "layers", "unknown 21"]


def test_chunks_refused():
    """Unknown critical chunks, layers that call themselves ancillary, lengths that are not the shortest."""
    head, payload = split_file("exact")
    layers = chunk(ChunkType.LAYERS, payload, last=True)
    refused(with_checksum(head + chunk(9, b"x") + layers), "chunk", len(head))
    refused(with_checksum(head + chunk(ChunkType.METADATA, b"{}") + layers), "chunk", len(head))
    refused(with_checksum(head + chunk(ChunkType.LAYERS, payload, ancillary=True, last=True)), "chunk", len(head))
    refused(with_checksum(head + b"\x21\x80\x05"), "varint", len(head) + 1)


def test_checksums():
    """A chunk's own, the file's, and bytes behind it."""
    head, payload = split_file("exact")
    good = with_checksum(head + chunk(ChunkType.LAYERS, payload, checked=True, last=True))
    assert same_drawing(isocodec.decode(good), whole("exact")[2])
    wrong = bytearray(good[:-4])
    wrong[-1] ^= 1
    refused(with_checksum(bytes(wrong)), "checksum", len(good) - 8)
    refused(good[:-1] + bytes([good[-1] ^ 1]), "checksum", len(good) - 4)
    refused(good + b"\0", "trailing", len(good))
    refused(files()["exact"] + files()["exact"], "trailing", len(files()["exact"]))


def test_large_chunks_have_a_checksum_of_their_own():
    """From 2**14 bytes on, so that damage is found before the end."""
    noise = np.random.default_rng(0).integers(0, 2, (400, 400))  # about a bit a sample: 20,000 bytes
    data = isocodec.encode(noise, 0, signs_only=True)
    first = isocodec.inspect(data).chunks[0]
    assert first.bytes > CHECKED_CHUNK
    assert data[first.offset] & 0b0101_1111 == 0b0100_0001  # checked; layers
    assert np.array_equal(np.sort(isocodec.decode(data).points, axis=0), np.sort(_midpoints(noise), axis=0))


def _midpoints(field):
    points = []
    for axis in (0, 1):
        low = np.argwhere(np.diff(field, axis=axis) != 0).astype(float)
        low[:, axis] += 0.5
        points.append(low)
    return np.concatenate(points)


def test_run_with_bytes_left_over_or_missing():
    """A run is neither longer nor shorter than its symbols need."""
    head, payload = split_file("exact")
    for extra in (bytes(8), b"\xff" * 8):
        refused(layers_file(payload + extra, head=head), "leftover")
    with pytest.raises(FormatError):
        isocodec.decode(layers_file(payload[: len(payload) // 2], head=head))


def test_nothing_follows_a_cut_run():
    """Layers after a run that was cut have nothing to build on."""
    data = files()["exact"]
    short = isocodec.truncate(data, max_bytes=len(data) * 2 // 3)
    head = read_header(short)[1]
    (one,) = isocodec.inspect(short).chunks
    assert one.type == "cut_layers"
    envelope = container.read_envelope(short, one.offset)
    first = chunk(ChunkType.CUT_LAYERS, short[envelope.start : envelope.end])
    more = chunk(ChunkType.LAYERS, b"\x11", last=True)
    refused(with_checksum(short[:head] + first + more), "cut", head + len(first))


@pytest.mark.parametrize("payload", [b"", b"[]", b"{", b"\xff", b"[" * 5000, b'{"a": 1}'])
def test_metadata_that_is_none(payload):
    """An ancillary chunk never spoils a file."""
    head, layers = split_file("exact")
    note = chunk(ChunkType.METADATA, payload, ancillary=True)
    data = with_checksum(head + note + chunk(ChunkType.LAYERS, layers, last=True))
    assert same_drawing(isocodec.decode(data), whole("exact")[2])
    assert isocodec.inspect(data).metadata == {}


def test_metadata():
    """Strings by name, any Unicode, in the event and in the file's structure."""
    note = {"name": "Zürich ▲", "empty": ""}
    data = isocodec.encode(picture((9, 9), 1), 0, metadata=note)
    assert isocodec.inspect(data).metadata == note
    decoder = Decoder()
    decoder.feed(data)
    assert [e.metadata for e in decoder if isinstance(e, MetadataRead)] == [note]


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


def test_an_encoder_is_iterated_once():
    """A second pass over the same state would write nonsense; it is refused."""
    encoder = Encoder(np.add.outer(np.arange(5), np.arange(6)), 4.5)
    assert b"".join(encoder)
    with pytest.raises(OptionError, match="once"):
        b"".join(encoder)
