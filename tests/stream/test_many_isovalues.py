"""Files of many isovalues: how they are written, what they cost in time and memory, and that each one is right."""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import isocodec
from files import fed
from isocodec import Decoder, Limits
from isocodec.errors import FormatError, LimitError
from isocodec.format.chunks import write_chunk, write_further
from isocodec.format.header import Header, read_header, read_isovalue, write_header, write_isovalue
from isocodec.stream.leaning import nearest_before
from isospec.container import LAYER_LIMIT, MAX_ISOVALUES, ChunkType, IsovalueKind
from tables import heavy, looped

ROWS, COLUMNS = np.mgrid[:65, :65]
BOWL = np.hypot(ROWS - 30.25, COLUMNS - 28.75)
"""A smooth field from 0 to some 50, whose levels are circles."""


def evenly(count: int) -> list[float]:
    """So many isovalues within the bowl, multiples of a decimal."""
    step = 0.01 if count > 400 else 0.1 if count > 40 else 1
    return [round((k + 1) * step, 2) for k in range(count)]


# -- how isovalues are written ---------------------------------------------------------------------------------------


def forms(value: float) -> dict[IsovalueKind, bytes]:
    """All forms of an isovalue that read back as it, by exact arithmetic and `struct`."""
    out = {IsovalueKind.FLOAT64: struct.pack(">d", value)}
    single = struct.unpack(">f", struct.pack(">f", value))[0] if abs(value) < 3e38 else None
    if single == value:
        out[IsovalueKind.FLOAT32] = struct.pack(">f", value)
    for places in range(1, 16):
        unit = round(Fraction(value) * 10**places)
        if abs(unit) < 1 << 53 and float(Fraction(unit, 10**places)) == value:
            zigzag = 2 * unit if unit >= 0 else -2 * unit - 1
            digits = [zigzag & 127]
            while zigzag := zigzag >> 7:
                digits.insert(0, zigzag & 127 | 128)
            out[IsovalueKind.DECIMAL] = bytes([places, *digits])
            break
    return out


@looped("value", [
    0.1, 0.2, 0.30000000000000004, -0.1, 1e-15, -1e-15, 1e-16, 12.25, 0.75, 1 / 3, 1234.5678, float(np.float32(0.1)),
    2.0**60, 9007199254740991e-15, 9007199254740993e-15, 1e300, -5e-324, 123456789012.3, 90071992547409.91,
    0.1 + 2.0**40,
])
def test_the_shortest_form_is_written(value: float) -> None:
    kind, coded = write_isovalue(value)
    assert read_isovalue(coded, 0, len(coded), kind) == (value, len(coded))
    possible = forms(value)
    assert possible[kind] == coded
    assert (len(coded), kind) == min((len(form), kind) for kind, form in possible.items())
    data = write_header(Header((5, 4), value))
    assert read_header(data) == (Header((5, 4), value), len(data))
    for size in range(len(data)):
        assert read_header(data[:size]) is None


def test_many_decimals_are_read_as_python_reads_them() -> None:
    random = np.random.default_rng(5)
    for places in range(1, 16):
        for unit in random.integers(-(1 << 53) + 1, 1 << 53, 200).tolist():
            value = float(f"{unit}e-{places}")
            zigzag = 2 * unit if unit >= 0 else -2 * unit - 1
            digits = [zigzag >> shift & 127 | 128 * bool(shift) for shift in range(56, -1, -7)]
            while digits[0] == 128:
                digits.pop(0)
            coded = bytes([places, *digits])
            assert read_isovalue(coded, 0, len(coded), IsovalueKind.DECIMAL) == (value, len(coded))


def test_the_nearest_of_the_earlier_ones() -> None:
    random = np.random.default_rng(7)
    for count in (1, 2, 3, 50):
        values = random.choice(np.arange(200) / 8, count, replace=False).tolist()
        by_hand = [min(range(i), key=lambda j: abs(values[j] - values[i])) if i else -1 for i in range(count)]
        assert nearest_before(values) == by_hand


# -- what is decoded --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [65, *heavy(64, 130, 450)])
def test_each_of_many_isovalues_is_right(count: int, tmp_path: Path) -> None:
    """Signs are those of the field, and curves those of a file with one isovalue."""
    values = evenly(count)
    file = isocodec.open(isocodec.encode(BOWL, values, precision="signs"))
    assert file.isovalues == tuple(values) and file.info.leans[1:] == [*range(count - 1)]
    drawn = file.contours()
    for number in {0, 1, 62, 63, min(64, count - 1), count // 2, count - 2}:
        assert np.array_equal(file.above(values[number]), values[number] < BOWL)
        alone = isocodec.decode(isocodec.encode(BOWL, values[number], precision="signs"))
        for found in (drawn[number], file.contour(values[number])):
            assert {*map(tuple, found.points.tolist())} == {*map(tuple, alone.points.tolist())}


@pytest.mark.parametrize("order", [0, *heavy(1, -1)])
def test_isovalues_in_any_order(order: int) -> None:
    values = evenly(24)
    given = values[::order] if order else np.random.default_rng(3).permutation(values).tolist()
    file = isocodec.open(isocodec.encode(BOWL, given, precision="signs"))
    assert file.isovalues == tuple(given)
    for value in given[::5]:
        assert np.array_equal(file.above(value), value < BOWL)


# -- what it costs ----------------------------------------------------------------------------------------------------


def held(data: bytes) -> int:
    decoder = fed(data)
    return decoder.memory


@pytest.mark.heavy
def test_memory_is_linear() -> None:
    """An isovalue more takes what is decoded of it, and its models."""
    sizes = {
        count: held(isocodec.encode(BOWL, evenly(180)[:count], precision="signs", order="isovalues"))
        for count in (20, 60, 180)
    }
    each = (sizes[180] - sizes[60]) / 120
    assert each < 100_000
    assert (sizes[60] - sizes[20]) / 40 == pytest.approx(each, rel=0.5)


@pytest.mark.parametrize("profile", ["baseline", "main"])
def test_isovalues_of_which_nothing_is_coded_take_little(profile: str) -> None:
    """The most isovalues, in 25 kB: not a megabyte each."""
    first = isocodec.encode(BOWL > 20, precision="signs", profile=profile)
    header, _ = read_header(first) or (None, 0)
    assert header is not None
    begun = write_header(Header(header.shape, 0.0, profile=header.profile))
    chunks = [write_chunk(ChunkType.ISOVALUE, write_further(i, i / 10, i - 1)) for i in range(1, MAX_ISOVALUES)]
    decoder = Decoder()
    decoder.feed(begun + b"".join(chunks))
    for _ in decoder:
        pass
    assert len(decoder.isovalues) == MAX_ISOVALUES and decoder.memory < MAX_ISOVALUES * 60_000
    decoder.feed(write_chunk(ChunkType.ISOVALUE, write_further(MAX_ISOVALUES, 0.05, None)))
    with pytest.raises(FormatError, match="more than 4,096 isovalues"):
        list(decoder)


def test_a_limit_below_that_of_the_format() -> None:
    data = isocodec.encode(BOWL, evenly(20), precision="signs")
    assert len(isocodec.open(data, limits=Limits(isovalues=20)).contours()) == 20
    with pytest.raises(LimitError):
        isocodec.open(data, limits=Limits(isovalues=19)).contours()
    assert Limits().isovalues == MAX_ISOVALUES and Limits().layers == LAYER_LIMIT
