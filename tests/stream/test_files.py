"""Files: any way of cutting the bytes, prefixes, truncation, errors, what they say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

import isocodec
from brute import HEAVY, INTERPRETED
from files import NAMES, fed, files, same_drawing, whole
from isocodec import Decoder
from isocodec.drawing.snapshot import state_of
from isocodec.errors import FormatError, OptionError, TruncatedError
from isocodec.format.chunks import read_envelope
from isocodec.format.events import ChunkSkipped, End, HeaderRead, LayerComplete
from isocodec.format.header import read_header
from isocodec.format.kinds import BASES
from isocodec.stream.encoder import encoder_of
from isocodec.stream.inspect import inspect
from isospec.container import ChunkType
from tables import heavy, looped

# --- cutting the bytes ----------------------------------------------------------------------------------------------


SOME = ["exact", "offsets", "several runs", "empty", *heavy("signs", "step", "single rate", "deep values")]


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
        contour = self.decoder.contour()
        assert same_drawing(contour, self.decoder.contour())
        assert contour.complete == self.decoder.complete

    @invariant()
    def counts_only_grow(self):
        if hasattr(self, "decoder"):
            now = self.decoder.symbols
            total = whole(self.name)[1]
            assert all(self.before.get(name, 0) <= now.get(name, 0) <= total[name] for name in total)
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
        assert state_of(self.decoder.grid._tube).lines() == decoded.lines()
        assert same_drawing(self.decoder.contour(), contour)


TestFeeding = Feeding.TestCase
TestFeeding.settings = settings(max_examples=5 if INTERPRETED else 150 if HEAVY else 25, stateful_step_count=40)


@looped("name", NAMES)
def test_order_of_events(name):
    """Header first, base, then as many layers as are announced; offsets ascend; the end is the file's."""
    events = whole(name)[0]
    assert isinstance(events[0], HeaderRead)
    layers = [event for event in events if isinstance(event, LayerComplete)]
    assert layers[0].layer.kind in BASES
    assert [event.number for event in layers] == list(range(1, len(layers) + 1))
    offsets = [event.offset for event in events]
    assert offsets == sorted(offsets)
    symbols = whole(name)[1]
    assert {k: sum(e.symbols.get(k, 0) for e in layers) for k in symbols} == symbols
    assert isinstance(events[-1], End) and events[-1].offset == len(files()[name])
    skipped = [event.type for event in events if isinstance(event, ChunkSkipped)]
    assert skipped == ([ChunkType.INDEX] if name == "several runs" else [])


@looped("name", SOME)
def test_prefixes(name):
    """Any prefix: symbols are the first ones of the file's, a drawing works, and only close() complains."""
    data, (_, total, _, _) = files()[name], whole(name)
    before = dict.fromkeys(total, 0)
    for length in range(0, len(data), 1 if HEAVY else 3):
        decoder = Decoder()
        decoder.feed(data[:length])
        events = list(decoder)
        assert events == whole(name)[0][: len(events)]
        assert all(before[k] <= v <= total[k] for k, v in decoder.symbols.items())
        before |= decoder.symbols
        contour = decoder.contour()
        assert not contour.complete and not decoder.complete
        if len(contour.points):
            assert np.isfinite(contour.points).all()
            assert (contour.points >= 0).all() and (contour.points <= np.array(contour.shape) - 1).all()
            assert contour.cells.max() < len(contour.points)
        for _ in range(2):
            with pytest.raises(TruncatedError) as caught:
                decoder.close()
            assert caught.value.code == "truncated" and caught.value.offset == length
        assert same_drawing(decoder.contour(), contour)
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
    for call in (lambda: list(decoder), lambda: decoder.feed(bytes(10)), decoder.contour, decoder.close):
        with pytest.raises(FormatError) as again:
            call()
        assert str(again.value) == str(first.value) and again.value.code == first.value.code


# --- truncation -----------------------------------------------------------------------------------------------------


@looped("name", SOME)
def test_truncate_to_layers(name):
    """The first layers alone are a valid file, which draws what the file draws after them."""
    data = files()[name]
    count = sum(isinstance(event, LayerComplete) for event in whole(name)[0])
    for layers in range(1, count + 1):
        short = isocodec.open(data).edited(layers=layers)
        contour = isocodec.decode(short)
        assert contour.complete
        assert same_drawing(contour, isocodec.decode(data, layers=layers))
        info = isocodec.open(short).info
        assert info.complete and len(info.layers) == layers
        assert isocodec.open(short).edited(layers=layers) == short
        # It may be longer than the bytes up to there by a length that takes a byte more, and a program of its own.
        assert len(short) <= len(data) + 8
    assert isocodec.open(data).edited(layers=count + 1) == data
    with pytest.raises(OptionError):
        isocodec.open(data).edited(layers=0)


@looped("name", SOME)
def test_truncate_to_bytes(name):
    """As many whole layers as fit."""
    data = files()[name]
    count = sum(isinstance(event, LayerComplete) for event in whole(name)[0])
    shorter = [isocodec.open(data).edited(layers=layers) for layers in range(1, count + 1)]
    for size in range(1 if HEAVY else 1 + (len(data) - 1) % 11, len(data) + 1, 1 if HEAVY else 11):
        fits = [each for each in shorter if len(each) <= size]
        if not fits:
            with pytest.raises(OptionError, match="too few for the first layer"):
                isocodec.open(data).edited(size=size)
            continue
        short = isocodec.open(data).edited(size=size)
        assert short == (data if len(data) <= size else fits[-1]) and fed(short).complete
        assert isocodec.open(short).edited(size=len(short)) == short
    assert isocodec.open(data).edited(size=len(data) + 5) == data
    for none in (0, -1):
        with pytest.raises(OptionError):
            isocodec.open(data).edited(size=none)


def test_truncate_what_was_cut_off():
    """A file that was cut off anywhere can be made whole again, in layers or in bytes."""
    data = files()["exact"]
    for length in range(0, len(data), 1 if HEAVY else 3):
        decoder = Decoder()
        decoder.feed(data[:length])
        events = [event for event in decoder if isinstance(event, LayerComplete)]
        if events:
            short = isocodec.open(data[:length]).edited(layers=len(events))
            assert same_drawing(isocodec.decode(short), isocodec.decode(data, layers=len(events)))
        # there are fewer layers, or the file ends before its first isovalue
        expected, code = (OptionError, "layers") if decoder.isovalues else (TruncatedError, "truncated")
        with pytest.raises(expected) as caught:
            isocodec.open(data[:length]).edited(layers=len(events) + 1)
        assert caught.value.code == code


@pytest.mark.parametrize("data", ["terrain.iso", 7, None, [1, 2]])
def test_what_is_not_the_bytes_of_a_file(data):
    whole_files = (inspect, Decoder().feed)
    # a text is a path to what opens files
    for call in whole_files if isinstance(data, str) else (isocodec.decode, isocodec.open, *whole_files):
        with pytest.raises(OptionError, match="read_bytes"):
            call(data)


@pytest.mark.parametrize("options", [{"layers": 2.5}, {"layers": 0}, {"max_bytes": 1e3}, {"max_bytes": -1}])
def test_numbers_of_layers_and_bytes_are_whole(options):
    with pytest.raises(OptionError, match="must be an integer"):
        isocodec.decode(files()["exact"], **options)


def test_truncation_does_not_make_damage_valid():
    """A chunk with a checksum of its own, in a file that is cut off behind it."""
    data = files()["several runs"]
    checked = next(envelope for envelope in envelopes(data) if envelope.checked and envelope.end > 60)
    cut = bytearray(data[: checked.end + 6])
    cut[checked.end - 3] ^= 16
    for options in ({"layers": 1}, {"size": checked.end - 6}):
        with pytest.raises(FormatError, match="chunk's checksum"):
            isocodec.open(bytes(cut)).edited(**options)
    with pytest.raises(FormatError, match="chunk's checksum"):
        _ = isocodec.open(bytes(cut)).info


def envelopes(data):
    """All chunks of a file."""
    at = read_header(data)[1]
    while at < len(data):
        envelope = read_envelope(data, at)
        yield envelope
        at = envelope.end + 4 * (envelope.checked + envelope.last)


# --- what a file says of itself -------------------------------------------------------------------------------------


@looped("name", NAMES)
def test_inspect(name):
    """Structure without decoding agrees with the decoder; chunks cover the file behind its header."""
    data = files()[name]
    info = inspect(data, symbols=True)
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
        index = isocodec.open(data).info.layers
        assert [x.symbols for x in index] == [e.symbols for e in layers]
        assert [x.bytes for x in index] == [e.bytes for e in layers]


def test_encoder_yields_as_it_goes():
    """Pieces come run by run, and progress counts the layers."""
    seen = []
    noise = np.random.default_rng(1).integers(0, 99, (420, 420))
    source = encoder_of(noise, 49, precision="exact", progress=lambda done, total: seen.append((done, total)))
    pieces = list(source)
    assert len(pieces) > 3  # header, two runs of 2**16 bytes or more, checksum
    assert max(map(len, pieces)) < sum(map(len, pieces)) * 0.9
    assert [done for done, _ in seen] == list(range(1, len(source.frame.layers) + 1))
    fed(b"".join(pieces))


def test_a_search_says_that_it_goes_on():
    """Curves that are tried are counted, of unknown total, before there are layers to count."""
    seen = []
    field = np.add.outer(np.arange(40) ** 2, np.arange(40) ** 2)
    source = encoder_of(field, 700.5, precision=1, progress=lambda done, total: seen.append((done, total)))
    tried = len(seen)
    assert tried > 1 and seen == [(i + 1, 0) for i in range(tried)]
    assert list(source) and seen[tried:] == [(i + 1, len(source.frame.layers)) for i in range(len(source.frame.layers))]


def test_an_encoder_is_iterated_once():
    """A second pass over the same state would write nonsense; it is refused."""
    encoder = encoder_of(np.add.outer(np.arange(5), np.arange(6)), 4.5)
    assert b"".join(encoder)
    with pytest.raises(OptionError, match="once"):
        b"".join(encoder)


def test_isovalues_are_counted_from_0():
    decoder = Decoder()
    decoder.feed(files()["exact"])
    decoder.take()
    assert len(decoder.contour(0).points) and not len(decoder.contour(1).points)
    for ask in (decoder.contour, decoder.grid.ends, decoder.grid.state, decoder.grid.mesh):
        with pytest.raises(OptionError, match="counted from 0"):
            ask(-1)


@pytest.mark.parametrize("wrap", [bytearray, memoryview, lambda data: np.frombuffer(data, np.uint8)])
def test_any_buffer_of_bytes(wrap):
    data = files()["exact"]
    assert isocodec.open(wrap(data)).edited(layers=1) == isocodec.open(data).edited(layers=1)
    assert same_drawing(isocodec.decode(wrap(data)), isocodec.decode(data))
    assert same_drawing(isocodec.decode(wrap(data), max_bytes=60), isocodec.decode(data, max_bytes=60))
    assert isocodec.open(wrap(data)).info.complete
