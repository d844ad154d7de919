"""Small files of every kind for tests, and the means to put files together by hand."""

from __future__ import annotations

import zlib
from functools import cache

import numpy as np
import pytest

import isocodec
from brute import smooth
from isocodec import Decoder
from isocodec.drawing.snapshot import state_of
from isocodec.errors import FormatError
from isocodec.format import chunks
from isocodec.grid.layers import layer_writer as writer
from isocodec.stream import grid_encoder
from isospec.container import (
    ChunkType,
    write_varint,
)


def picture(shape, seed, span=40.0, noise=0.1):
    """Integers: a smooth field with some noise."""
    rng = np.random.default_rng(seed)
    return np.rint(span * (smooth(shape, seed) + noise * rng.normal(size=shape))).astype(np.int64)


@cache
def files():
    """Small files of every kind of layer and chunk, by name."""
    volume = picture((5, 7, 6), 2)
    made = {
        "exact": isocodec.encode(picture((14, 11), 1), 3, precision="exact", layers=2),
        "offsets": isocodec.encode(volume, 0.5, precision=0.1),
        "signs": isocodec.encode(picture((12, 20), 3, noise=0.4), 0, precision="signs", layers=0),
        "step": isocodec.encode(
            smooth((9, 13), 4), 0.123, precision="step=0.01", metadata={"name": "wave", "unit": "m"},
        ),
        "single rate": isocodec.encode(picture((11, 11), 5), 0, precision=0.3, layers=8),
        "deep values": isocodec.encode(picture((6, 5), 7, span=1e6), 0.5, precision="exact"),
        "empty": isocodec.encode(np.zeros((8, 5), int), 0),
    }
    # Small limits in the encoder make a short file with all that a long one has: runs, checksums, an index.
    saved = writer.RUN_BYTES, grid_encoder.INDEX_SHARE, chunks.CHECKED_CHUNK
    writer.RUN_BYTES, grid_encoder.INDEX_SHARE, chunks.CHECKED_CHUNK = 24, 0, 16
    try:
        made["several runs"] = isocodec.encode(picture((13, 16), 6), 2, precision="exact", layers=1)
    finally:
        writer.RUN_BYTES, grid_encoder.INDEX_SHARE, chunks.CHECKED_CHUNK = saved
    return made


NAMES = ["exact", "offsets", "signs", "step", "single rate", "deep values", "empty", "several runs"]


@cache
def whole(name):
    """Events, symbols and drawing of a whole file."""
    decoder = Decoder()
    decoder.feed(files()[name])
    events = list(decoder)
    assert decoder.complete
    return events, decoder.symbols, decoder.contour(), state_of(decoder.grid._tube)


def fed(data, limits=None, **options):
    """A decoder that has taken a whole file."""
    decoder = Decoder(limits, **options)
    decoder.feed(data)
    decoder.close()
    return decoder


def same_drawing(a, b):
    return (
        np.array_equal(a.points, b.points) and np.array_equal(a.cells, b.cells)
        and np.array_equal(a.isovalue, b.isovalue, equal_nan=True) and a.shape == b.shape
    )


def with_checksum(body):
    """A file out of all of its bytes but the last four."""
    return body + zlib.crc32(body).to_bytes(4, "big")


def chunk(kind, payload, *, ancillary=False, checked=False, last=False):
    """A chunk as clause 3.5 has it: ancillary, checked, last, five bits of type; length; payload; checksum."""
    out = bytes([ancillary << 7 | checked << 6 | last << 5 | kind]) + write_varint(len(payload)) + payload
    return out + zlib.crc32(out).to_bytes(4, "big") if checked else out


HEADER = bytes.fromhex("8949534f 11 00 05 04 02".replace(" ", ""))
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


def same(field: np.ndarray, expected: np.ndarray) -> bool:
    """Whether two arrays are equal, of the same kind and shape."""
    return field.dtype == expected.dtype and field.shape == expected.shape and bool((field == expected).all())
