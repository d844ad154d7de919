"""Containers byte by byte: numbers, headers, programs, chunks."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples
from files import HEADER, chunk, files, layers_file, picture, refused, same_drawing, whole, with_checksum
from isocodec import Decoder
from isocodec.errors import FormatError, OptionError
from isocodec.format import chunks
from isocodec.format.chunks import CRITICAL, read_metadata
from isocodec.format.events import ChunkSkipped, MetadataRead
from isocodec.format.header import Header, read_header, write_header, write_isovalue
from isocodec.format.kinds import LayerKind
from isocodec.format.program import Layer, Progress, read_program, write_program
from isocodec.stream.encoder import encoder_of
from isocodec.stream.outline import READERS
from isospec.container import (
    LAYER_LIMIT,
    MAX_SIDE,
    READ_VERSION,
    ChunkType,
    IsovalueKind,
    Operation,
    VarintError,
    read_varint,
    unzigzag,
    write_varint,
    zigzag,
)
from isospec.elements import BY_LAYER
from tables import looped

# --- numbers --------------------------------------------------------------------------------------------------------


@looped(
    "value, encoding",
    [(0, "00"), (1, "01"), (127, "7f"), (128, "8100"), (300, "822c"), (16383, "ff7f"), (16384, "818000"),
     ((1 << 63) - 1, "ff" * 8 + "7f")],
)
def test_varint(value, encoding):
    """Seven bits a byte, the highest first: 300 = 2 * 128 + 44."""
    data = bytes.fromhex(encoding)
    assert write_varint(value) == data
    assert read_varint(b"\xaa" + data + b"\xbb", 1, len(data) + 2) == (value, 1 + len(data))
    assert all(read_varint(data, 0, end) is None for end in range(len(data)))


@looped("encoding", ["8000", "8001", "80", "ff" * 9, "81" + "80" * 9])
def test_varint_refused(encoding):
    """Leading zero groups, and more than 9 bytes, are refused as soon as they can be seen."""
    with pytest.raises(VarintError):
        read_varint(bytes.fromhex(encoding), 0, len(encoding) // 2)


def test_zigzag():
    """0, -1, 1, -2, 2 are 0 to 4."""
    assert [zigzag(v) for v in (0, -1, 1, -2, 2)] == [0, 1, 2, 3, 4]
    assert all(unzigzag(zigzag(v)) == v for v in (*range(-300, 300), (1 << 50) - 1, -(1 << 50)))


# --- headers --------------------------------------------------------------------------------------------------------


@looped(
    "header, encoding",
    [
        # signature; versions; flags 0 equal scaled kind kind axes profile profile; shape, one size if equal; isovalue
        (Header((5, 4), 0.5), "8949534f 11 00 05 04 02"),  # zigzag(2 * 0.5) = 2
        (Header((5, 4), -0.5), "8949534f 11 00 05 04 01"),
        (Header((300, 2), 128.0), "8949534f 11 00 822c 02 8400"),  # zigzag(256) = 512 = 4 * 128
        (Header((2, 3, 4), 0.0), "8949534f 11 04 02 03 04 00"),
        (Header((300, 300), 0.5), "8949534f 11 40 822c 02"),
        (Header((3, 3, 3), 0.5), "8949534f 11 44 03 02"),
        (Header((2, 3), 0.25), "8949534f 11 18 02 03 02 32"),  # 25 / 10**2; zigzag(25) = 50
        (Header((2, 3), 0.1), "8949534f 11 18 02 03 01 02"),
        (Header((2, 3), -0.1), "8949534f 11 18 02 03 01 01"),
        (Header((2, 3), 2.0**-60), "8949534f 11 08 02 03 21800000"),  # in IEEE single
        (Header((2, 3), 1 / 3), "8949534f 11 10 02 03 3fd5555555555555"),
        (Header((2, 3), 0.0, 0.25), "8949534f 11 20 02 03 00 fe"),  # scale 2**-2
        # exponents of a byte reach from -127 to 127; 0x80, which would be -128, says that eight bytes follow
        (Header((2, 3), 0.0, 2.0**127), "8949534f 11 20 02 03 00 7f"),
        (Header((2, 3), 0.0, 2.0**-127), "8949534f 11 20 02 03 00 81"),
        (Header((2, 3), 0.0, 2.0**-128), "8949534f 11 20 02 03 00 80 37f0000000000000"),
        (Header((2, 3), 0.0, 2.0**128), "8949534f 11 20 02 03 00 80 47f0000000000000"),
        (Header((2, 3), 0.0, 3.0), "8949534f 11 20 02 03 00 80 4008000000000000"),
    ],
)
def test_header(header, encoding):
    """The fixed head, byte by byte."""
    data = bytes.fromhex(encoding.replace(" ", ""))
    assert write_header(header) == data
    assert read_header(data + b"\x21") == (header, len(data))
    assert all(read_header(data[:end]) is None for end in range(len(data)))


def test_equal_sides_told_one_by_one():
    """Readers accept what writers do not write."""
    assert read_header(bytes.fromhex("8949534f1100050502")) == (Header((5, 5), 0.5), 9)


@looped(
    "encoding, code, offset",
    [
        ("8949534e", "signature", 0),
        ("89495350 00 00 05 04 02", "signature", 0),
        ("50", "signature", 0),  # seen in the first byte
        (f"8949534f 1{READ_VERSION + 1} 00 05 04 02", "version", 4),
        ("8949534f 10 00 05 04 02", "version", 4),
        ("8949534f 1f 00 05 04 02", "version", 4),
        ("8949534f 11 80 05 04 02", "domain", 5),
        ("8949534f 11 c0 05 02", "domain", 5),
        ("8949534f 11 03 05 04 02", "profile", 5),
        ("8949534f 11 18 05 04 00 02", "isovalue", 8),  # a decimal without places
        ("8949534f 11 18 05 04 10 02", "isovalue", 8),  # with 16
        ("8949534f 11 18 05 04 01 a080808080808000", "isovalue", 8),  # of 2**53
        ("8949534f 11 18 05 04 01 9fffffffffffff7f", "isovalue", 8),  # of -2**53
        ("8949534f 11 00 00 04 02", "shape", 6),
        ("8949534f 11 44 00 02", "shape", 6),
        ("8949534f 11 44 c08001 02", "shape", 6),  # 2**20 + 1
        ("8949534f 11 00 05 00 02", "shape", 7),
        ("8949534f 11 00 88808001 04 02", "shape", 6),  # 2**24 + 1
        ("8949534f 11 04 04 04 c08001 02", "shape", 8),  # 2**20 + 1
        ("8949534f 11 00 ffffffffffffffff7f 04 02", "shape", 6),
        ("8949534f 11 00 8005 04 02", "varint", 6),
        ("8949534f 11 08 05 04 7f800000", "isovalue", 8),  # infinite
        ("8949534f 11 10 05 04 7ff8000000000000", "isovalue", 8),  # NaN
        ("8949534f 11 20 05 04 02 80 0000000000000000", "scale", 9),
        ("8949534f 11 20 05 04 02 80 bff0000000000000", "scale", 9),  # -1
        ("8949534f 11 20 05 04 02 80 7ff0000000000000", "scale", 9),
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


@looped(
    "encoding, layers",
    [
        ("02", [BASE_2]),  # operation 0, argument 2
        ("0f", [("base", 4, 0)]),  # as far as it goes
        ("0e 02", [BASE_2]),  # the number follows
        ("82 11", [BASE_2, REFINE_3]),  # more; operation 1, one round
        ("82 1f", [BASE_2, REFINE_3, REFINE_4]),
        ("42", [BASE_2, REFINE_3, REFINE_4]),  # operation 4: base and all rounds
        ("8f 34", [("base", 4, 0), ("offsets", 4, 5)]),  # 4 + 1 parts
        ("8f 31", [("base", 4, 0), ("offsets", 4, 2)]),
        ("8f 3e 20", [("base", 4, 0), ("offsets", 4, 33)]),
        ("8f 3e 3e", [("base", 4, 0), ("offsets", 4, 63)]),
        ("8f b2 33", [("base", 4, 0), ("offsets", 4, 3), ("offsets", 4, 12)]),
        ("8f 2f 12", [("base", 4, 0), ("values", 4, 1), ("values", 4, 0)]),  # 1 bit above, 2 below
        ("8f 21 12", [("base", 4, 0), ("values", 4, 1)]),
        ("82 a1 03 91 21", [BASE_2, ("values", 2, 2), REFINE_3, ("values", 3, 1)]),  # bits are stated once
        ("8f 21 f2 10", [("base", 4, 0), ("values", 4, 15)]),  # 16 bits above: an escape and a number
        ("51", [("adaptive_base", 1, 0)]),
        ("d1 e0 61", [("adaptive_base", 1, 0), ("adapt", 1, 0), ("adapt", 1, 0)]),
        ("8f b2 21 11", [("base", 4, 0), ("offsets", 4, 3), ("values", 4, 0)]),
        ("82 32 02", [BASE_2, ("offsets", 2, 3)]),  # parts of 2**2 samples
        ("82 b2 02 9f 33", [BASE_2, ("offsets", 2, 3), REFINE_3, REFINE_4, ("offsets", 4, 4)]),
        ("8f 2f 00", [("base", 4, 0), ("values", 4, 0)]),  # no bits: values are exact at once
    ],
)
def test_program(encoding, layers):
    """Bytes are: one bit more, three of the operation, four of its argument."""
    assert program(encoding) == layers


@looped(
    "encoding, offset",
    [
        ("05", 0),  # base beyond the full grid, level 4
        ("82 02", 1),  # a second base
        ("82 42", 1),
        ("11", 0),  # before the base
        ("21 11", 0),
        ("31", 0),
        ("82 13", 1),  # three rounds from level 2
        ("10", 0),  # no rounds
        ("82 10", 1),
        ("82 9f 11", 2),  # one more than there are
        ("82 31 19", 1),  # offsets in parts of 2**25 samples
        ("8f 3f", 1),
        ("8f 30", 1),  # in one part
        ("82 30 02", 1),
        ("8f 3e 3f", 1),  # in 64 parts
        ("8f be 3e be 3e be 3e be 3e 31", 9),  # in 63**4 = 15,752,961 parts, and each of those in 2: more than 2**24
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
)
def test_program_refused(encoding, offset):
    """What cannot follow on what was there before."""
    data = bytes.fromhex(encoding.replace(" ", ""))
    with pytest.raises(FormatError) as caught:
        read_program(data, 0, len(data), Progress(4))
    assert caught.value.code == "program" and caught.value.offset == offset
    # the chunk's two bytes come before it
    refused(layers_file(data), "program", len(HEADER) + 2 + offset)


@pytest.mark.heavy
def test_programs_with_too_many_layers_or_bits():
    """131,072 layers, and 52 bits of values."""
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
        for radix in draw(st.lists(st.integers(2, 63), max_size=4)):
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
    (one,) = isocodec.open(data).info.chunks
    envelope = chunks.read_envelope(data, one.offset)
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
    assert [c.type for c in isocodec.open(data).info.chunks] == ["unknown 20", "unknown 31", "layers", "unknown 21"]


def test_chunks_refused():
    """Unknown critical chunks, layers that call themselves ancillary, lengths that are not the shortest."""
    head, payload = split_file("exact")
    layers = chunk(ChunkType.LAYERS, payload, last=True)
    for kind in range(32):
        known = kind in CRITICAL
        refused(with_checksum(head + chunk(kind, payload, ancillary=known) + layers), "chunk", len(head))
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


def test_run_with_bytes_left_over_or_missing():
    """A run is neither longer nor shorter than its symbols need."""
    head, payload = split_file("exact")
    for extra in (bytes(8), b"\xff" * 8):
        refused(layers_file(payload + extra, head=head), "leftover")
    with pytest.raises(FormatError):
        isocodec.decode(layers_file(payload[: len(payload) // 2], head=head))


@looped("payload", [b"", b"[]", b"{", b"\xff", b"[" * 5000, b'{"a": 1}'])
def test_metadata_that_is_none(payload):
    """An ancillary chunk never spoils a file."""
    head, layers = split_file("exact")
    note = chunk(ChunkType.METADATA, payload, ancillary=True)
    data = with_checksum(head + note + chunk(ChunkType.LAYERS, layers, last=True))
    assert same_drawing(isocodec.decode(data), whole("exact")[2])
    assert isocodec.open(data).info.metadata == {}


def test_metadata():
    """Strings by name, any Unicode, in the event and in the file's structure."""
    note = {"name": "Zürich ▲", "empty": ""}
    data = isocodec.encode(picture((9, 9), 1), 0, metadata=note)
    assert isocodec.open(data).info.metadata == note
    decoder = Decoder()
    decoder.feed(data)
    assert [e.metadata for e in decoder if isinstance(e, MetadataRead)] == [note]


def test_metadata_keeps_the_strings_among_members_of_one_name():
    assert read_metadata(b'{"a":"x","a":1,"b":{"c":"y"},"d":null,"e":"z"}') == {"a": "x", "e": "z"}
    assert read_metadata(b'["a"]') == read_metadata(b'"a"') == read_metadata(b"\xff") == {}


def test_largest_isovalues_of_single_precision():
    for value in (1.5 * 2.0**127, (2 - 2.0**-23) * 2.0**127, -1.5 * 2.0**127):
        assert write_isovalue(value) == (IsovalueKind.FLOAT32, struct.pack(">f", value))
    for value in (2.0**128, 1.7 * 2.0**127 + 2.0**90):
        assert write_isovalue(value)[0] == IsovalueKind.FLOAT64


@pytest.mark.parametrize("metadata", [{"a": 3}, {"a": b"x"}, {1: "x"}, {"a": "\udcff"}])
def test_metadata_that_is_no_text(metadata):
    with pytest.raises(OptionError, match="text"):
        encoder_of(np.eye(4), 0.5, metadata=metadata)


def test_every_chunk_type_has_one_reader_and_every_kind_of_layer_its_symbols():
    assert {*READERS} | {ChunkType.LAYERS, ChunkType.MASK} == {*ChunkType} and ChunkType.LAYERS not in READERS
    assert {*LayerKind} == {*BY_LAYER} and {kind.operation for kind in LayerKind} < {*Operation}


def test_kinds_of_layers_are_strings():
    info = isocodec.open(
        b"".join(encoder_of(np.eye(4), 0.5, layers=[(LayerKind.BASE, None), ("values", None)], precision="step=0.5"))
    ).info
    assert [layer.kind for layer in info.layers][:2] == ["base", "values"]
    assert json.loads(json.dumps(info.as_dict()))["layers"][0]["kind"] == "base"
