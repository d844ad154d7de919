"""Corners of the container and the stream: sizes and counts just at a limit, several isovalues, odd chunks."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest

import isocodec
from brute import smooth
from files import HEADER, chunk, files, layers_file, picture, refused, same_drawing, with_checksum
from isocodec import Decoder
from isocodec.errors import FormatError, OptionError, TruncatedError
from isocodec.format.chunks import read_envelope, read_index, write_chunk
from isocodec.format.events import ChunkSkipped, IsovalueRead, LayerComplete, MetadataRead
from isocodec.format.header import read_header
from isocodec.format.program import Progress, read_program
from isocodec.grid.layers import layer_writer
from isocodec.stream.inspect import inspect
from isospec.container import CHECKED_CHUNK, LAYER_LIMIT, ChunkType
from tables import looped

CHECKED = 0b0100_0000


def closed(data, **options):
    """A decoder that has taken a whole file."""
    decoder = Decoder(**options)
    decoder.feed(data)
    decoder.close()
    return decoder


def chunks(data):
    """Each chunk's offset, envelope, and bytes with its own checksum."""
    at, out = read_header(data)[1], []
    while at < len(data) - 4:
        envelope = read_envelope(data, at)
        behind = envelope.end + 4 * envelope.checked
        out.append((at, envelope, data[at:behind]))
        at = behind
    return out


# --- chunks of 2**14 bytes -------------------------------------------------------------------------------------------


def test_a_payload_of_exactly_2_to_the_14():
    """It has a checksum of its own; one byte less has none."""
    for size in (CHECKED_CHUNK - 1, CHECKED_CHUNK, CHECKED_CHUNK + 1):
        written = write_chunk(ChunkType.METADATA, bytes(size), ancillary=True)
        expected = chunk(ChunkType.METADATA, bytes(size), ancillary=True, checked=size >= 16384)
        assert written == expected
    note = "x" * (CHECKED_CHUNK - len('{"a":""}'))
    data = isocodec.encode(picture((9, 9), 1), 0, metadata={"a": note})
    at, envelope, whole = chunks(data)[0]
    assert envelope.end - envelope.start == CHECKED_CHUNK and data[at] & CHECKED
    assert closed(data).metadata == {"a": note}
    wrong = bytearray(data[: at + len(whole)])
    wrong[envelope.end - 3] ^= 1
    decoder = Decoder()
    decoder.feed(wrong)
    with pytest.raises(FormatError, match="a chunk's checksum"):
        list(decoder)


# --- counts ---------------------------------------------------------------------------------------------------------


@pytest.mark.heavy
def test_many_layers():
    """Some thousands, of which all but two tell nothing; more than a file may have are refused, by writers too."""
    field = np.zeros((5, 4), np.int64)
    field[2, 2] = 1
    plan = [("base", None), ("values", None)] + [("values", 0)] * 5000
    data = isocodec.encode(field, 0.5, layers=plan)
    assert len(isocodec.open(data).info.layers) == 5002
    decoder = Decoder()
    decoder.feed(data)
    assert sum(isinstance(event, LayerComplete) for event in decoder) == 5002
    assert decoder.complete and len(decoder.contour().points) == 4
    with pytest.raises(OptionError, match="131,072"):
        isocodec.encode(field, 0.5, layers=[*plan, *[("values", 0)] * (LAYER_LIMIT - 5001)])
    many = bytes([0x8F, 0xAF, 0x00]) + b"\xa0" * (LAYER_LIMIT - 2) + b"\x20"  # base, values without bits, again ..
    refused(layers_file(many + bytes(8)), "layers", len(HEADER) + 4 + LAYER_LIMIT - 2 + 3)
    fewer = many[:-2] + b"\x20"
    layers, at = read_program(fewer, 0, len(fewer), Progress(4))
    assert len(layers) == LAYER_LIMIT and at == len(fewer)


def test_layers_of_all_isovalues_count():
    """131,072 in the file, not for each isovalue."""
    field = picture((6, 6), 1)
    half = [("base", None)] + [("values", None)] + [("values", 0)] * 2048
    with patch.object(layer_writer, "LAYER_LIMIT", 4096), pytest.raises(OptionError, match="4,096"):
        isocodec.encode(field, [0.5, 1.5], layers=half)


# --- the index ------------------------------------------------------------------------------------------------------


def test_an_index_with_bytes_behind_it():
    """It does not fit the layers: the file is valid, and says nothing of their sizes."""
    data = files()["several runs"]
    found = chunks(data)
    assert found[-1][1].type == ChunkType.INDEX
    at, envelope, _ = found[-1]
    payload = data[envelope.start : envelope.end]
    layers = closed(data).grid.layers
    assert len(read_index(payload, layers)) == len(layers)
    assert read_index(payload + b"\0", layers) == read_index(payload[:-1], layers) == []
    longer = with_checksum(data[:at] + chunk(ChunkType.INDEX, payload + b"\0", ancillary=True, last=True))
    assert same_drawing(isocodec.decode(longer), isocodec.decode(data))
    assert all(layer.bytes is not None for layer in isocodec.open(data).info.layers)
    assert all(layer.bytes is None and layer.symbols is None for layer in isocodec.open(longer).info.layers)


@pytest.mark.parametrize("isovalues", [[0, 5], [5, 0]])
def test_the_share_of_an_index_is_of_all_isovalues(isovalues):
    """One of them takes 20,000 bytes, the other, above all samples, a few: at most a hundredth of both is an index."""
    field = np.random.default_rng(0).integers(0, 2, (400, 400))
    data = isocodec.encode(field, isovalues, order="isovalues", precision="signs")
    _, envelope, _ = chunks(data)[-1]
    assert envelope.type == ChunkType.INDEX
    stated, counted = isocodec.open(data).info.layers, inspect(data, symbols=True).layers
    assert [(x.isovalue, x.bytes, x.symbols) for x in stated] == [(x.isovalue, x.bytes, x.symbols) for x in counted]
    assert {layer.isovalue for layer in stated} == {0, 1}
    small = isocodec.encode(field[:60, :60], isovalues, order="isovalues", precision="signs")
    run_bytes = sum(layer.bytes for layer in inspect(small, symbols=True).layers)
    assert chunks(small)[-1][1].type != ChunkType.INDEX and run_bytes < 100 * (envelope.end - envelope.start)


# --- chunks that are skipped, and come twice ------------------------------------------------------------------------


def test_two_chunks_of_metadata():
    """The later one's notes are added, and go before those of the same name."""
    data = files()["exact"]
    head = read_header(data)[1]
    ((_, _, layers),) = chunks(data)
    first = chunk(ChunkType.METADATA, b'{"name":"hill","unit":"m"}', ancillary=True)
    second = chunk(ChunkType.METADATA, b'{"unit":"km","source":"survey"}', ancillary=True)
    notes = {"name": "hill", "unit": "km", "source": "survey"}
    for order in (first + second + layers, first + layers[:1] + layers[1:]):
        decoder = closed(with_checksum(data[:head] + order))
        expected = notes if second in order else {"name": "hill", "unit": "m"}
        assert decoder.metadata == expected == isocodec.open(with_checksum(data[:head] + order)).info.metadata
    decoder = Decoder()
    decoder.feed(with_checksum(data[:head] + first + second + layers))
    read = [event.metadata for event in decoder if isinstance(event, MetadataRead)]
    assert read == [{"name": "hill", "unit": "m"}, {"unit": "km", "source": "survey"}]
    assert decoder.contour().metadata == notes


@pytest.fixture(scope="module")
def three():
    """Isovalues 0 and 2 stand alone as far as 1 goes."""
    field = np.rint(smooth((30, 30), 1) * 100).astype(np.int64)
    return isocodec.encode(field, [0.5, 20.5, -20.5], order="independent")


@looped("only", [{0}, {1}, {2}, {0, 2}, {1, 2}])
def test_skipped_isovalues(three, only):
    """Their chunks of layers are passed over, each an event; what is left is as if all were decoded."""
    whole = closed(three)
    expected = []
    number = 0
    for at, envelope, text in chunks(three):
        if envelope.type == ChunkType.ISOVALUE:
            number += 1
        elif number not in only:
            behind = at + len(text) + 4 * envelope.last
            expected.append((envelope.type, envelope.end - envelope.start, behind))
    for step in (1, len(three)):
        decoder, events = Decoder(only=only), []
        for i in range(0, len(three), step):
            decoder.feed(three[i : i + step])
            events += decoder
        decoder.close()
        assert [(e.type, e.length, e.offset) for e in events if isinstance(e, ChunkSkipped)] == expected
        assert {e.number for e in events if isinstance(e, IsovalueRead)} == {1, 2}
        assert decoder.isovalues == whole.isovalues
        for number in range(3):
            if number in only:
                assert same_drawing(decoder.contour(number), whole.contour(number))
                assert decoder.grid.state(number).lines() == whole.grid.state(number).lines()
            else:
                assert decoder.grid.state(number) is None and not len(decoder.contour(number).points)
        layers = [e for e in events if isinstance(e, LayerComplete)]
        assert [e.number for e in layers] == list(range(1, len(decoder.grid.layers) + 1))


def test_damage_in_a_skipped_chunk_is_found(three):
    at = next(at for at, envelope, _ in chunks(three) if envelope.type == ChunkType.ISOVALUE) - 9
    wrong = bytearray(three)
    wrong[at] ^= 1
    with pytest.raises(FormatError, match="file's checksum"):
        closed(bytes(wrong), only={1, 2})
    cut = Decoder(only={1})
    cut.feed(three[:at])
    with pytest.raises(TruncatedError):
        cut.close()


# --- what is asked of the encoder, and what is drawn ----------------------------------------------------------------


@pytest.mark.parametrize("turned", [False, True])
def test_an_infinite_estimate_says_nothing(turned):
    """Half a step above the isovalue no float is left, half a step below there is: points stay half-way."""
    field = np.zeros((4, 5))
    field[2:] = 1.6e308
    field = field[::-1] if turned else field
    data = isocodec.encode(field, 1.5e308, precision="step=1.7e308")
    points = isocodec.decode(data).points
    assert len(points) == 5
    assert np.array_equal(points[:, 0], np.full(5, 1.5))
