"""Fields in tiles: whoever encodes them, and what goes wrong (spec clause 12)."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_servers import right, serving

import isocodec
from brute import HEAVY, INTERPRETED
from isocodec.errors import FormatError, InputError, IsoError, OptionError, TruncatedError
from isocodec.stream.options import Options
from isocodec.tiles.assembly import grid_of
from isocodec.tiles.head import write_head
from isocodec.tiles.spool import Spool, about
from isocodec.tiles.tile_encoder import Tiling
from isocodec.tiles.writing import tiling_of
from tables import heavy
from tiled import encoded, hilly, holed, pieces, tiled_of

# -- who encodes ---------------------------------------------------------------------------------------------------


class Shuffled(Executor):
    """Does what it is given in any order, when it has enough of it."""

    _max_workers = 2

    def __init__(self) -> None:
        self.waiting: list[tuple[Future[object], object, tuple[object, ...]]] = []
        self.dice = random.Random(5)

    def submit(self, function: object, /, *args: object, **_: object) -> Future[object]:  # type: ignore[override]
        future: Future[object] = Future()
        self.waiting.append((future, function, args))
        if len(self.waiting) >= 6:
            self.flush()
        return future

    def flush(self) -> None:
        self.dice.shuffle(self.waiting)
        for future, function, args in self.waiting:
            future.set_result(function(*args))  # type: ignore[operator]
        self.waiting.clear()


@pytest.fixture(scope="module")
def processes() -> Iterator[ProcessPoolExecutor]:
    """Workers, which take a second to begin."""
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as found:
        yield found


def test_the_same_bytes_whoever_encodes(tmp_path: Path) -> None:
    field = hilly((180, 150))
    alone = encoded(tmp_path, field, 30.5)
    with ThreadPoolExecutor(3) as threads:
        assert encoded(tmp_path, field, 30.5, engine=threads) == alone
    assert encoded(tmp_path, field, 30.5, engine=Shuffled()) == alone


class Here:
    """A field that notes which process reads it, and goes to others in few bytes."""

    def __init__(self, field: np.ndarray, notes: Path, ballast: int = 0) -> None:
        np.save(notes.with_suffix(".npy"), field)
        self.notes, self.ballast = notes, bytes(ballast)
        self.shape, self.dtype = field.shape, field.dtype

    def __getitem__(self, window: tuple[slice, ...]) -> np.ndarray:
        with self.notes.open("a") as file:
            file.write(f"{os.getpid()}\n")
        return np.load(self.notes.with_suffix(".npy"))[window]


@pytest.mark.skipif(INTERPRETED, reason="workers would be slow")
@pytest.mark.parametrize("ballast", [0, *heavy(1 << 20)])
def test_workers_read_what_is_handed_over_in_few_bytes(
    tmp_path: Path, processes: ProcessPoolExecutor, ballast: int
) -> None:
    field = hilly((90, 150))
    alone = encoded(tmp_path, field, 30.5)
    assert encoded(tmp_path, field, 30.5, engine=processes) == alone
    assert encoded(tmp_path, Here(field, tmp_path / "notes", ballast), 30.5, engine=processes) == alone
    readers = set(map(int, (tmp_path / "notes").read_text().split()))
    assert (os.getpid() in readers) == (ballast > 0)


# -- what goes wrong -----------------------------------------------------------------------------------------------


class Stopping:
    """A field whose samples can be read so many times, then not."""

    def __init__(self, field: np.ndarray, times: int) -> None:
        self.field, self.times = field, times
        self.shape, self.dtype = field.shape, field.dtype

    def __getitem__(self, window: tuple[slice, ...]) -> np.ndarray:
        self.times -= 1
        if self.times < 0:
            raise OSError("the disk is gone")
        return self.field[window]


def test_work_goes_on_where_it_stopped(tmp_path: Path) -> None:
    field = hilly()
    wanted = encoded(tmp_path, field, 30.5)
    path = tmp_path / "again.iso"
    total = grid_of(field.shape, 5).total
    tries = 0
    while True:
        tries += 1
        source = Stopping(field, 7)
        try:
            isocodec.save(path, source, 30.5, tile=32)
            break
        except OSError:
            assert not path.exists()
    assert tries == -(-total // 7)
    assert path.read_bytes() == wanted
    assert not (tmp_path / "again.iso.tiles").exists()


def test_a_harmed_spool_is_mended(tmp_path: Path) -> None:
    """A torn journal, a torn segment, a segment with another bit: what is harmed is encoded again."""
    field = hilly()
    wanted = encoded(tmp_path, field, 30.5)
    path, spool = tmp_path / "again.iso", tmp_path / "spool"
    dice = random.Random(3)
    for _ in range(12 if HEAVY else 2):
        with pytest.raises(OSError, match="gone"):
            isocodec.save(path, Stopping(field, 12), 30.5, tile=32, spool=spool)
        for name in ("journal", "segments"):
            data = bytearray((spool / name).read_bytes())
            at = dice.randrange(len(data) // 2, len(data))
            if dice.random() < 0.5:
                del data[at:]
            else:
                data[at] ^= 1 << dice.randrange(8)
            (spool / name).write_bytes(data)
        isocodec.save(path, field, 30.5, tile=32, spool=spool)
        assert path.read_bytes() == wanted
        path.unlink()


def test_a_spool_of_something_else(tmp_path: Path) -> None:
    field = hilly()
    with pytest.raises(OSError, match="gone"):
        isocodec.save(tmp_path / "a.iso", Stopping(field, 3), 30.5, tile=32)
    for other, isovalue in ((field, 31.5), (field.astype(np.int32), 30.5)):
        with pytest.raises(OptionError, match="different options"):
            isocodec.save(tmp_path / "a.iso", other, isovalue, tile=32)
    tiling = Tiling(grid_of(field.shape, 5), (30.5,), Options(), "<i2")
    with (
        Spool(tmp_path / "a.iso.tiles", tiling),
        pytest.raises(OptionError, match="another process"),
    ):
        isocodec.save(tmp_path / "a.iso", field, 30.5, tile=32)


class Changing(Stopping):
    """A field that is another one after some time."""

    def __getitem__(self, window: tuple[slice, ...]) -> np.ndarray:
        self.times -= 1
        return self.field[window] + (self.times < 0)


def test_a_field_that_changes(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"tiles \(\d, \d\) and \(\d, \d\) disagree on the samples"):
        isocodec.save(tmp_path / "a.iso", Changing(hilly(), 9), 30.5, tile=32)
    assert not (tmp_path / "a.iso").exists()


def test_errors_name_the_tile(tmp_path: Path) -> None:
    field = hilly().astype(float)
    field[96:112] = np.inf
    with pytest.raises(InputError, match=r"tile \(\d, \d\)"):
        isocodec.save(tmp_path / "a.iso", field, 30.5, tile=32, precision="step=0.1")
    for wrong in ({"tile": 100}, {"tile": 16}, {"precision": "exact"}, {"keep_topology": True}):
        with pytest.raises(OptionError):
            isocodec.save(tmp_path / "b.iso", hilly().astype(float), 30.5, **{"tile": 32, **wrong})  # type: ignore[arg-type]
    for thing in ([[1, 2]], np.zeros(5), np.zeros((3, 1)), np.zeros((3, 3), complex)):
        with pytest.raises(InputError):
            isocodec.save(tmp_path / "b.iso", thing, 30.5, tile=1024)
    with pytest.raises(OptionError, match="pairs"):
        tiled_of(encoded(tmp_path, hilly(), 30.5)).window([(0, 1)])


@settings(max_examples=10 if INTERPRETED else 150)
@given(data=st.data())
def test_harmed_files(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    """One byte changed, or an end cut off: an error of ours, or the same curve."""
    good = harmless(tmp_path_factory)
    bad = bytearray(good)
    at = data.draw(st.integers(0, len(good) - 1))
    if data.draw(st.booleans()):
        bad[at] ^= data.draw(st.integers(1, 255))
    else:
        del bad[at:]
    try:
        found = isocodec.decode(bytes(bad))
    except IsoError:
        return
    assert pieces(found) == pieces(isocodec.decode(good))


_GOOD: list[bytes] = []


def harmless(folders: pytest.TempPathFactory) -> bytes:
    if not _GOOD:
        _GOOD.append(encoded(folders.mktemp("good"), holed(hilly((90, 80)), 1), 30.5))
    return _GOOD[0]


def test_cut_files(tmp_path: Path) -> None:
    data = encoded(tmp_path, hilly(), 30.5)
    for end in (0, 3, 7, 20, 60, len(data) - 1):
        with pytest.raises(FormatError):
            isocodec.open(data[:end]).contour()
    for end in (*range(4, 30), len(data) - 1):
        with pytest.raises(TruncatedError):
            isocodec.open(data[:end]).contour()
    with pytest.raises(TruncatedError):
        isocodec.decode(data[:-1])
    # where it ends, whoever reads it
    for end in range(len(data) // 2, len(data), len(data) // 9):
        (tmp_path / "cut.iso").write_bytes(data[:end])
        for source in (data[:end], tmp_path / "cut.iso", f"file://{tmp_path / 'cut.iso'}"):
            with pytest.raises(TruncatedError) as caught:
                isocodec.open(source).contour()
            assert caught.value.offset == end and f"{end:,}" in str(caught.value)
    # sums that no file has room for
    head = tiled_of(data).head
    with pytest.raises(TruncatedError, match="than any file can hold"):
        isocodec.open(write_head(head, [(b"", [1 << 62] * head.areas)]))
    decoder = isocodec.Decoder()
    decoder.feed(data)
    with pytest.raises(FormatError, match="tiled file"):
        decoder.take()


# -- elsewhere -----------------------------------------------------------------------------------------------------


def test_a_window_of_a_url(tmp_path: Path) -> None:
    """Few requests, and few bytes; what is there already is not fetched again."""
    noise = np.random.default_rng(1).integers(0, 100, (300, 320))
    data = encoded(tmp_path, noise, 50.5, precision="exact")
    with serving(data, right) as (url, server):
        file = isocodec.open(url)
        assert file.kind == "tiles" and len(server.sent) == 1
        part = file.contour(window=[(100, 130), (200, 230)])
        assert pieces(part) == pieces(tiled_of(data).window([(100, 130), (200, 230)]))
        assert len(server.sent) <= 6 and sum(server.sent) < len(data) // 2
        assert file.complete
    with serving(data[:-9], right) as (url, _):
        assert not isocodec.open(url).complete


def test_options_that_mean_nothing(tmp_path: Path) -> None:
    data = encoded(tmp_path, hilly(), 30.5)
    file = isocodec.open(data)
    for option in ({"smooth": True}, {"frame": 1}, {"frame": -1}, {"max_bytes": 0}, {"through_holes": True}):
        for asked in (file.contour, file.contours, file.above, file.mesh):
            with pytest.raises(OptionError, match=next(iter(option))):
                asked(**option)  # type: ignore[operator]
    for option in ({"max_bytes": len(data)}, {"within": 2}):
        for asked in (file.above, file.mesh):
            with pytest.raises(OptionError, match=next(iter(option))):
                asked(**option)  # type: ignore[operator]
    with pytest.raises(OptionError, match="smooth"):
        list(file.each_frame(smooth=True))
    # a file of one frame has a frame 0, and all of its bytes are a beginning
    for option in ({"frame": 0}, {"max_bytes": len(data)}):
        assert pieces(file.contour(**option)) == pieces(isocodec.decode(data))  # type: ignore[arg-type]


# -- killed --------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(INTERPRETED, reason="a process of its own would be slow")
def test_killed_and_run_again(tmp_path: Path) -> None:
    """The whole process is killed, twice at any moment: the same command goes on; the bytes are the same."""
    field = np.tile(hilly((512, 512)), (2, 1))
    np.save(tmp_path / "f.npy", field)
    wanted = encoded(tmp_path, field, 30.5, tile=64)
    path = tmp_path / "killed.iso"
    command = [
        sys.executable, "-m", "isocodec", "encode", str(tmp_path / "f.npy"), "-o", str(path), "--isovalue", "30.5",
        "--tile", "64",
    ]
    dice = random.Random(1)
    for _ in range(2):
        child = subprocess.Popen(command)
        time.sleep(0.4 + dice.random())
        child.send_signal(signal.SIGKILL)
        child.wait()
        assert not path.exists() or path.read_bytes() == wanted
    subprocess.run(command, check=True)
    assert path.read_bytes() == wanted


@pytest.mark.skipif(INTERPRETED, reason="a process of its own would be slow")
def test_a_worker_that_dies(tmp_path: Path) -> None:
    field = hilly()
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as processes:
        processes.submit(os.getpid).result()
        (worker,) = processes._processes  # type: ignore[misc]
        os.kill(worker, signal.SIGKILL)
        with pytest.raises(InputError, match="worker"):
            isocodec.save(tmp_path / "a.iso", field, 30.5, tile=32, engine=processes)
    isocodec.save(tmp_path / "a.iso", field, 30.5, tile=32)
    assert (tmp_path / "a.iso").read_bytes() == encoded(tmp_path, field, 30.5)


def test_every_option_is_part_of_what_tiles_have_in_common() -> None:
    """A spool goes on only with the tiles of a call with the same options, whichever options there are."""
    tiling = tiling_of(hilly(), 30.5, 32, Options())
    assert {each.name for each in fields(Options)} <= set(json.loads(about(tiling)))
