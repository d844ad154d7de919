"""What a decoder may use: memory is counted before it is taken, time by work, and nothing outlives an error."""

from __future__ import annotations

import gc
import tracemalloc
import warnings
import weakref
from unittest import mock

import numpy as np
import pytest

import isocodec
from brute import INTERPRETED
from commands import fails, ok
from files import fed, picture
from isocodec import Decoder, IsoError, Limits
from isocodec import limits as module
from isocodec.entropy import run
from isocodec.errors import LimitError, OptionError
from isocodec.grid.passes.runner import Tube
from isocodec.io import cost
from isocodec.io.formats import Areas
from isocodec.limits import Budget
from isocodec.stream.inspect import inspect
from isoconform import hostile
from isospec.container import MAX_ISOVALUES
from written import rendered

MIB = 1 << 20


def field(n, size, rough, seed=3):
    """Noise or hills, of integers."""
    rng = np.random.default_rng(seed)
    grid = np.meshgrid(*[np.linspace(0, 9, size)] * n, indexing="ij")
    hills = sum(np.sin(axis * (i + 1) + i) for i, axis in enumerate(grid))
    return (1000 * (rough * rng.standard_normal((size,) * n) + (1 - rough) * hills)).astype(np.int32)


# --- the account ------------------------------------------------------------------------------------------------------


def test_tiers():
    # with room for the step that is asked for before it is known to be needed
    assert 1 << 14 <= Limits.tier(0).vertices < (1 << 14) + 100
    assert Limits.tier(1).isovalues == MAX_ISOVALUES == Limits().isovalues
    assert all(a <= b for a, b in zip(*(module.TIERS[i] for i in (0, 1)), strict=True))
    with pytest.raises(OptionError):
        Limits.tier(2)


# --- memory -----------------------------------------------------------------------------------------------------------


class Traced(Budget):
    """A budget that knows the most that was asked of it."""

    most = 0

    def hold(self, holder, size, passing=0):
        super().hold(holder, size, passing)
        Traced.most = max(Traced.most, self.held + passing)

    def check(self, passing):
        super().check(passing)
        Traced.most = max(Traced.most, self.held + passing)


WAYS = {
    "signs": {"precision": "signs"}, "offsets": {}, "values": {"precision": "exact"},
    "reduced": {"layers": "crossing", "precision": 0.2}, "reduced values": {"layers": "crossing", "precision": "exact"},
}


@pytest.mark.skipif(INTERPRETED, reason="memory of kernels that are not compiled is another")
@pytest.mark.cover(1)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("n, size, rough", [
    (2, 150, 1), pytest.param(2, 300, 0, marks=pytest.mark.heavy), (3, 24, 1),
    pytest.param(3, 50, 0, marks=pytest.mark.heavy),
])
def test_decoding_and_drawing_take_no_more_than_is_counted(n, size, rough, way, monkeypatch):
    """What is really allocated, against the account: as good as all of it, and never more."""
    monkeypatch.setattr("isocodec.stream.session.Budget", Traced)
    isovalues = [0.5, 120.5] if way in ("offsets", "values") else [0.5]
    data = isocodec.encode(field(n, size, rough), isovalues, **WAYS[way])

    def decode():
        decoder = Decoder()
        decoder.feed(data)
        list(decoder)
        for number in range(len(isovalues)):
            decoder.contour(number)

    decode()  # what is loaded at the first time is not what a file takes
    Traced.most = 0
    gc.collect()
    tracemalloc.start()
    decode()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # the file itself, twice, and small things
    assert 0.4 * Traced.most < peak < Traced.most + 3 * len(data) + MIB / 4


def test_the_encoder_warns_of_files_that_default_limits_refuse(monkeypatch):
    """From a limit on that decoding takes, and not far below it."""
    values = field(3, 24, 1)
    data = isocodec.encode(values, 0.5)
    kept = Limits.__init__.__defaults__

    def with_memory(memory):
        place = list(Limits.__dataclass_fields__).index("memory")
        monkeypatch.setattr(Limits.__init__, "__defaults__", (*kept[:place], memory, *kept[place + 1 :]))

    for memory in (1 << 18, 1 << 20, 1 << 21, 1 << 22, 1 << 23, 1 << 26):
        with_memory(memory)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            assert isocodec.encode(values, 0.5) == data
        try:
            isocodec.decode(data)
            refused = False
        except LimitError:
            refused = True
        assert bool(caught) or not refused
        assert all("--limits memory=" in str(each.message) for each in caught)
    assert not caught and not refused


@pytest.mark.skipif(INTERPRETED, reason="takes long")
@pytest.mark.parametrize("n, suffix", [
    (2, ".geojson"), (2, "areas"), (3, ".ply"),
    *(pytest.param(n, suffix, marks=pytest.mark.heavy) for n, suffix in (
        (2, ".svg"), (2, ".pmtiles"), (2, ".png"), (3, ".obj"), (3, ".png"))),
])
@pytest.mark.parametrize("rough", [1, pytest.param(0, marks=pytest.mark.heavy)])
def test_writing_takes_no_more_than_is_counted(n, suffix, rough):
    size = (300 if n == 2 else 48) >> rough
    # coordinates with many digits
    placement = np.column_stack([np.eye(n) * 12.345, np.full(n, 1e6 / 3)])
    crs = {"crs": "EPSG:3857"} if suffix == ".pmtiles" else None
    contour = isocodec.decode(
        isocodec.encode(isocodec.Field(field(n, size, rough), placement=placement), 0.5, metadata=crs)
    )
    small = isocodec.decode(isocodec.encode(isocodec.Field(field(n, 6, 1), placement=placement), 0.5, metadata=crs))

    what, suffix = (lambda one: Areas([one], "above"), ".geojson") if suffix == "areas" else (lambda one: one, suffix)
    rendered(what(small), suffix)
    gc.collect()
    tracemalloc.start()
    rendered(what(contour), suffix)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < cost.peak(len(contour.points), len(contour.cells))


@pytest.mark.skipif(INTERPRETED, reason="takes long")
def test_lone_vertices_are_refused_at_the_same_symbol_however_they_come():
    """Before their memory is taken; the decoder holds nothing after that, and says why."""
    ends = []
    lone = bytes(next(draft.data for draft in hostile.drafts() if draft.name == "space_main_lone_vertices"))
    for step in (len(lone), 9):
        decoder = Decoder(Limits(memory=40 * MIB))
        gc.collect()
        tracemalloc.start()
        with pytest.raises(LimitError) as caught:
            for at in range(0, len(lone), step):
                decoder.feed(lone[at : at + step])
                list(decoder)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 41 * MIB and caught.value.code == "limit-memory" and "--limits memory=" in str(caught.value)
        assert decoder.memory == 0
        ends.append((caught.value.offset, decoder.symbols))
        with pytest.raises(LimitError):
            decoder.contour()
    assert ends[0] == ends[1] and sum(ends[0][1].values()) > 1000


@pytest.mark.skipif(INTERPRETED, reason="takes long")
def test_drawing_has_a_limit_of_its_own():
    """The decoder can still be used, and so can a smaller drawing."""
    data = isocodec.encode(field(3, 40, 1), 0.5, precision="signs")
    decoder = fed(data)
    # as much as decoding takes in passing: lists of a round, which are gone at its end
    tight = fed(data, Limits(memory=decoder.budget.peak))
    with pytest.raises(LimitError) as caught:
        tight.contour()
    assert caught.value.code == "limit-memory"
    assert np.array_equal(tight.grid.state().position, decoder.grid.state().position)
    assert tight.grid.above().shape == (40, 40, 40)


def test_earlier_isovalues_keep_only_what_is_needed_of_them():
    """Sixteen isovalues hold far less than sixteen times what the encoder of one has at its disposal."""
    data = isocodec.encode(field(2, 200, 0), [100.0 * i + 0.5 for i in range(-8, 8)])
    decoder = Decoder()
    decoder.feed(data)
    held = []
    for event in decoder:
        if isinstance(event, isocodec.format.events.IsovalueRead):
            held.append(decoder.memory)
    assert len(held) == 15 and max(np.diff(held)) < 2 * MIB
    before = decoder.memory
    contour = decoder.contour(3)
    decoder.discard(3)
    assert decoder.memory < before and len(contour.points)
    assert not len(decoder.contour(3).points) and len(decoder.contour(4).points)


# --- time -------------------------------------------------------------------------------------------------------------


def test_work_is_limited_by_what_has_been_read():
    """More symbols than that are refused, at the same one however the bytes come; the limit grows with the file."""
    data = isocodec.encode(picture((90, 90), 2, noise=0.3), 0, precision="signs")
    symbols = sum(s for layer in inspect(data, symbols=True).layers for s in layer.symbols.values())
    with mock.patch.object(run, "SLICE", 64):
        ends = []
        for step in (len(data), 3):
            decoder = Decoder(Limits(work=symbols // 4))
            with (
                mock.patch.object(run, "WORK_PER_BYTE", 0),
                pytest.raises(LimitError) as caught,
            ):
                for at in range(0, len(data), step):
                    decoder.feed(data[at : at + step])
                    list(decoder)
            ends.append((caught.value.code, caught.value.offset, sum(decoder.symbols.values())))
        assert ends[0] == ends[1]
        code, _, done = ends[0]
        assert code == "limit-work" and symbols // 8 < done <= symbols // 4
        # 512 symbols a byte are more than it takes
        isocodec.decode(data, limits=Limits(work=1))


@pytest.mark.parametrize("symbols", [1, 63, 64, 65, 200])
def test_slices_change_nothing(symbols, monkeypatch):
    """Whole files and cut runs are decoded alike, wherever the limits are asked."""
    data = isocodec.encode(picture((60, 60), 2, noise=0.4), 0, precision="exact")
    cuts = [isocodec.open(data).edited(size=n) for n in (60, 200)]
    expected = [isocodec.decode(one).points for one in (data, *cuts)]
    monkeypatch.setattr(run, "SLICE", symbols)
    assert [isocodec.open(data).edited(size=n) for n in (60, 200)] == cuts
    assert all(np.array_equal(isocodec.decode(one).points, e) for one, e in zip((data, *cuts), expected, strict=True))


# --- after an error ---------------------------------------------------------------------------------------------------


def test_errors_keep_nothing_alive():
    """Somebody may keep many errors: what was decoded before them goes all the same."""
    good = isocodec.encode(picture((40, 40), 3), 0)
    damaged = good[:-1] + bytes([good[-1] ^ 1])
    tubes = []
    make = Tube.__init__

    def noted(tube, *arguments, **options):
        make(tube, *arguments, **options)
        tubes.append(weakref.ref(tube))

    kept = []
    with mock.patch.object(Tube, "__init__", noted):
        for data, limits in ((damaged, None), (good[:-5], None), (good, Limits(vertices=60))):
            with pytest.raises(IsoError) as caught:
                isocodec.decode(data, limits=limits)
            kept.append(caught.value)
    del caught
    # two for each decoder: one for isovalues without layers
    assert len(tubes) == 6 and all(ref() is None for ref in tubes), "without the garbage collector's help"


@pytest.mark.parametrize(
    "where", ["isocodec.grid.passes.runner.wider_state", "isocodec.stream.grid_contents.leaves_of"]
)
def test_memory_that_ends_is_an_error_of_ours(where):
    """Whatever the limits say: the machine may have less."""
    data = isocodec.encode(field(2, 150, 1), 0.5)

    def ends(*_, **__):
        raise MemoryError

    with mock.patch(where, ends), pytest.raises(LimitError) as caught:
        isocodec.decode(data)
    assert caught.value.code == "memory" and caught.value.exit_code == 6
    assert caught.value.__context__ is None


def test_memory_that_ends_for_a_mask():
    data = isocodec.encode(picture((40, 40), 3), 0)
    whole = mock.patch("isocodec.drawing.sample_mask.MaskRows.whole", side_effect=MemoryError)
    with whole, pytest.raises(LimitError) as caught:
        isocodec.open(data).above()
    assert caught.value.code == "memory"


# --- the command line -------------------------------------------------------------------------------------------------


def test_large_masks_are_written_when_asked_for(tmp_path):
    """By rows: a mask of 2**26 samples takes no more than a few of them."""
    source = tmp_path / "in.iso"
    step = np.zeros((64, 64), np.uint8)
    step[:, 40:] = 9
    large = isocodec.encode(np.repeat(np.repeat(step, 64, 0), 64, 1), 4, precision="signs")
    source.write_bytes(large)
    samples = 4096 * 4096
    assert "--limits samples=" in fails(
        6, "decode", "--what", "above", source, "-o", tmp_path / "m.npy", "--limits", f"samples={samples - 1}",
    )
    assert not (tmp_path / "m.npy").exists()
    decoder = fed(large)
    gc.collect()
    tracemalloc.start()
    above = sum(int(rows.sum()) for rows in decoder.grid.mask_rows())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert above == samples * 24 // 64 and peak < samples / 2
    ok("decode", "--what", "above", source, "-o", tmp_path / "m.npy", "--limits", f"samples={samples}")
    assert np.array_equal(np.load(tmp_path / "m.npy")[:, ::64], np.repeat(step, 64, 0) > 4)
