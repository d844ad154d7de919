"""Files from strangers: limits of a decoder, and bytes of any kind."""

from __future__ import annotations

import random
import time
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hurtful
import isocodec
from brute import HEAVY, INTERPRETED, examples
from files import HEADER, NAMES, fed, files, layers_file, picture, with_checksum
from hurtful import BASES, GRID, decoded, empty_series, isovalues, measured, mutants, stated_mesh
from isocodec import Decoder, IsoError, Limits
from isocodec.drawing.snapshot import state_of
from isocodec.errors import FormatError, LimitError, OptionError
from isocodec.format.events import MetadataRead
from isocodec.format.header import Header, write_header
from isocodec.grid.passes.runner import Tube
from isoconform import strategies
from isoconform.streams import Chunk, File
from isospec.container import ChunkType, DomainKind, Profile, write_varint
from tables import heavy, looped

# --- limits ---------------------------------------------------------------------------------------------------------


def limited(data, **limits):
    decoder = Decoder(Limits(**limits))
    with pytest.raises(LimitError) as caught:
        decoder.feed(data)
        list(decoder)
    return decoder, caught.value.code


def test_limits(monkeypatch):
    """Each limit is an error of its own before the memory is taken."""
    tubes = []
    begin = Tube.begin_base

    def noted(tube, *arguments):
        if tube.truth is None:
            tubes.append(tube)
        begin(tube, *arguments)

    monkeypatch.setattr(Tube, "begin_base", noted)
    data = isocodec.encode(picture((60, 60), 8, noise=0.5), 0, layers=0)
    decoder, code = limited(data, vertices=500)
    assert code == "limit-vertices"
    assert 0 < tubes[-1].state.counters.vertices <= 500 and len(tubes[-1].state.vertex) <= 2 * 500
    decoder, code = limited(data, simplices=700)
    assert code == "limit-simplices"
    assert max(len(tubes[-1].state.leaf), len(tubes[-1].state.below)) <= 2 * 700
    decoder, code = limited(data, bytes=len(data) - 1)
    assert code == "limit-bytes" and len(decoder.data) == 0
    Decoder(Limits(bytes=len(data))).feed(data)
    speck = np.zeros((40, 40), int)
    speck[21, 19] = 1
    _, code = limited(isocodec.encode(speck, 0, layers=0), steps=0)
    assert code == "limit-steps"


def test_limits_hold_for_all_isovalues_together():
    field = picture((24, 26), 9)
    levels = [-20.5 + 4 * i for i in range(10)]
    data = isocodec.encode(field, levels, precision="exact", order="independent")
    decoder = fed(data)
    counts = [len(decoder.grid.state(number).position) for number in range(10)]
    assert sum(counts) > 2 * max(counts)
    isocodec.decode(data, limits=Limits(vertices=sum(counts) + 32), isovalue=levels[-1])
    decoder, code = limited(data, vertices=max(counts) + 32)
    assert code == "limit-vertices" and 1 < len(decoder.isovalues) < 10
    assert sum(counts[: len(decoder.isovalues) - 1]) <= max(counts) + 32


def test_ancestors_count_as_steps():
    """In the largest cube few vertices, far apart, have many ancestors; how the bytes come in changes nothing."""
    program = bytes([0x80 | 5 << 4, 0x80 | 6 << 4 | 1, 6 << 4 | 1])
    head = write_header(Header((1 << 20,) * 3, 0.5, None, Profile.MAIN))
    for seed in range(20):  # what random bytes decode to follows the tables of main
        data = layers_file(program + random.Random(seed).randbytes(304), head=head)
        with suppress(FormatError):
            decoder, code = limited(data, steps=20_000)
            if decoder.symbols["significance"] > 10:
                break
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
    count = len(isocodec.open(data).info.layers)
    fed(data, Limits(layers=count))
    limited(data, layers=count - 1)


def test_memory_follows_the_curve_not_the_header():
    """A header that claims 2**24 x 2**24 samples costs nothing by itself."""
    head = write_header(Header((1 << 24, 1 << 24), 0.5))
    decoder = Decoder()
    decoder.feed(head)
    assert len(list(decoder)) == 1
    assert sum(a.nbytes for a in decoder.grid._tube.state if isinstance(a, np.ndarray)) < 1 << 20


# --- small files that ask for much -----------------------------------------------------------------------------------


def refused(data, **limits):
    """The decoder after a file that it refuses, and the error."""
    decoder = Decoder(Limits(**limits))
    decoder.feed(data)
    with pytest.raises(IsoError) as caught:
        decoder.close()
    return decoder, caught.value


@looped("run", [b"\xff" * 2000, bytes(2000), b"\x5a" * 2000])
@looped(("kind", "n"), [(DomainKind.CODED, 2), (DomainKind.CODED, 3), (DomainKind.DELAUNAY, 2)])
def test_meshes_that_claim_to_be_large(kind, n, run):
    """Memory is taken for what has come of a mesh, and counted as work before it is, whatever the file states."""
    data = stated_mesh(kind, n, run, 4096 if kind == DomainKind.CODED else 1 << 24)
    decoder, error = refused(data, work=1 << 18)
    allowed = (1 << 18) + 512 * len(data)
    # the last that was asked for may have been too much, and was not taken
    assert decoder.budget.peak <= 8 * allowed and decoder.account.units <= 2 * allowed
    assert decoder.memory == 0 or not isinstance(error, LimitError)
    stated = isocodec.Decoder(Limits(memory=1 << 22))
    stated.feed(data)
    with pytest.raises(IsoError):
        stated.close()


@pytest.mark.parametrize("profile", Profile)
def test_isovalues_without_layers_take_no_memory(profile):
    """Nothing is allocated for an isovalue, of any frame, before its first layer."""
    decoder = fed(empty_series(300, 3, profile))
    assert decoder.budget.peak == 0 and len(decoder.isovalues) == 300
    assert {id(tube) for tube in decoder.grid.tubes} == {id(decoder.grid.tubes[0])}
    assert len(decoder.contour(299).points) == 0


def test_events_have_the_notes_of_their_chunks():
    """Not all that came before: what thousands of chunks take would grow with the square of their number."""
    notes = [Chunk(ChunkType.METADATA, b'{"k%d":"v"}' % i, ancillary=True) for i in range(3000)]
    decoder = Decoder()
    decoder.feed(bytes(File(HEADER, tuple(notes))))
    found = [event.metadata for event in decoder if isinstance(event, MetadataRead)]
    assert found == [{f"k{i}": "v"} for i in range(3000)]
    assert len(decoder.metadata) == 3000


@pytest.mark.heavy
def test_turns_of_thousands_of_isovalues():
    """Each takes next to no time, however many isovalues it names."""
    turn = Chunk(ChunkType.TURN, write_varint(0) + write_varint(4096))
    seconds, _ = measured(lambda: decoded(bytes(File(GRID, (*isovalues(4095), *[turn] * 2_000)))))
    assert INTERPRETED or seconds < SECONDS / 4


@pytest.mark.heavy
@pytest.mark.parametrize("kind", BASES)
def test_mutants_stay_within_bounds(kind):
    """Each takes some seconds and some memory at most, with the limits by default."""
    decoded(next(mutants(kind, 1)))
    for number, data in enumerate(mutants(kind, 5000)):
        seconds, memory = measured(lambda: decoded(data))  # noqa: B023 - called at once
        assert seconds < hurtful.SECONDS and memory < hurtful.BYTES, number


@pytest.mark.heavy
@pytest.mark.parametrize("make", [
    lambda: stated_mesh(DomainKind.CODED, 2, b"\xff" * 20_000),
    lambda: stated_mesh(DomainKind.CODED, 3, b"\xff" * 20_000),
    lambda: stated_mesh(DomainKind.DELAUNAY, 2, bytes(20_000), 1 << 24),
    lambda: empty_series(4096, 2, Profile.MAIN),
    lambda: bytes(File(GRID, tuple(Chunk(ChunkType.METADATA, b'{"k%d":"v"}' % i, True) for i in range(40_000)))),
])
def test_small_files_stay_within_bounds(make):
    data = make()
    decoded(GRID)
    seconds, memory = measured(lambda: decoded(data))
    assert seconds < hurtful.SECONDS and memory < hurtful.BYTES


# --- hostile bytes --------------------------------------------------------------------------------------------------

SECONDS = 20
"""Far more than any file of a few hundred bytes takes (some ms); far less than a loop that depends on the header."""


def survive(data, limits=None):
    """Whole and byte by byte a decoder succeeds or raises the same IsoError, in time."""
    began = time.monotonic()
    outcomes = []
    for step in (len(data), 7):
        decoder = Decoder(limits or Limits(vertices=1 << 17, simplices=1 << 18, steps=1 << 22, samples=1 << 20))
        try:
            for i in range(0, len(data), max(step, 1)):
                decoder.feed(data[i : i + step])
                list(decoder)
                decoder.contour()
            decoder.close()
            decoder.contour()
            with suppress(OptionError, LimitError):
                assert decoder.grid.above().shape == decoder.header.shape
            outcomes.append(state_of(decoder.grid._tube).lines())
        except IsoError as error:
            outcomes.append((type(error), error.code, error.offset))
    assert outcomes[0] == outcomes[1]
    assert INTERPRETED or time.monotonic() - began < SECONDS
    return outcomes[0]


@pytest.mark.parametrize("name", ["offsets", *heavy("several runs")])
def test_every_flipped_bit_is_found(name):
    """No single wrong bit goes unnoticed: the file's checksum covers every byte before it, and one bit says mesh."""
    data = files()[name]
    for place in range(0, 8 * len(data), 1 if HEAVY else 5):
        wrong = bytearray(data)
        wrong[place // 8] ^= 128 >> place % 8
        with pytest.raises((FormatError, LimitError, OptionError)):
            fed(wrong, Limits(vertices=1 << 17))


@examples(90)
@given(st.one_of(strategies.files(), strategies.damaged_files()))
def test_any_files(data):
    """Files of the syntax that no encoder writes, noise where coded data should be, and damage behind checksums."""
    survive(data)


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
