"""Fields in tiles: directories, seams, whoever encodes, and what goes wrong (spec clause 12)."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from skimage.measure import find_contours

import isocodec
from brute import INTERPRETED
from commands import fails, ok, run
from isocodec.errors import FormatError, InputError, IsoError, OptionError, TruncatedError
from isocodec.field.samples import check_field
from isocodec.search.promise import Promise
from isocodec.search.tile_mesh import face_vertices
from isocodec.stream.options import Options
from isocodec.tiled_api import tiled_of
from isocodec.tiles.container import Kind, groups_of
from isocodec.tiles.encoding import Tiling
from isocodec.tiles.fetching import together
from isocodec.tiles.grid import TileGrid, in_order, morton
from isocodec.tiles.merging import grid_of
from isocodec.tiles.spool import Spool

FIELDS = {2: 2, 3: 1} if INTERPRETED else {2: 14, 3: 4}
"""Random fields, by number of axes."""
MANY = {2: 200, 3: 60}


def random_field(n: int, seed: int, integers: bool) -> np.ndarray:
    rng = np.random.default_rng(seed)
    small, large = ((20, 60) if INTERPRETED else (20, 150)) if n == 2 else ((20, 36) if INTERPRETED else (20, 75))
    field = gaussian_filter(rng.normal(size=rng.integers(small, large, n)), rng.choice([0.7, 1.5, 3, 6]))
    field /= field.std()
    return np.rint(field * 20).astype(np.int16) if integers else field


def hilly(shape: tuple[int, ...] = (150, 210)) -> np.ndarray:
    x, y = np.meshgrid(*map(np.arange, shape), indexing="ij")
    return np.rint(100 * np.sin(x / 17) * np.cos(y / 11) + x / 3).astype(np.int16)


def encoded(tmp_path: Path, field: np.ndarray, isovalue: object, tile: int = 32, **options: object) -> bytes:
    path = tmp_path / "tiled.iso"
    isocodec.encode_tiles(field, isovalue, path, tile=tile, **options)  # type: ignore[arg-type]
    return path.read_bytes()


def pieces(contour: isocodec.Contour) -> list[tuple[tuple[float, ...], ...]]:
    """Cells as what they are made of, wherever they stand."""
    points = contour.points.round(7) + 0.0
    return sorted(tuple(sorted(map(tuple, points[cell].tolist()))) for cell in contour.cells)


def holed(field: np.ndarray, seed: int) -> np.ndarray:
    gone = gaussian_filter((np.random.default_rng(seed).random(field.shape) < 0.02).astype(float), 1) > 0.05
    return np.ma.masked_array(field, mask=gone)


# -- geometry of tiles ---------------------------------------------------------------------------------------------


def test_morton_order() -> None:
    assert in_order((2, 3)).tolist() == [[0, 0], [0, 1], [1, 0], [1, 1], [0, 2], [1, 2]]
    assert morton(np.array([[1, 2, 3]])).tolist() == [0b011_101 | 0]  # bits 1: 0 1 1, bits 0: 1 0 1
    assert np.array_equal(np.sort(morton(in_order((5, 7)))), np.unique(morton(in_order((5, 7)))))


@given(st.lists(st.integers(1, 400), min_size=2, max_size=3), st.integers(5, 7))
def test_tiles_cover_every_cell_once(shape: list[int], exponent: int) -> None:
    grid = TileGrid(tuple(shape), exponent, 1)
    for axis, count in enumerate(grid.counts):
        windows = [grid.window(tuple(i if a == axis else 0 for a in range(len(shape))))[axis] for i in range(count)]
        assert windows[0].start == 0 and windows[-1].stop == shape[axis]
        assert all(a.stop - 1 == b.start for a, b in pairwise(windows))
        # none is narrower than a cube of the first stage, and none wider than one more
        assert all(w.stop - w.start > 17 or count == 1 for w in windows)
        assert all(w.stop - w.start <= (1 << exponent) + 17 for w in windows)
    listed = [tuple(i) for block in grid.all_blocks() for i in grid.members(block).tolist()]
    assert sorted(listed) == sorted(np.ndindex(*grid.counts))


def test_groups_have_a_thousand_bytes() -> None:
    assert groups_of(np.array([10, 1000, 14, 1, 2000, 0])).tolist() == [0, 3, 5]
    assert groups_of(np.array([10, 20])).tolist() == [0, 2]
    assert groups_of(np.zeros(3, np.int64)).tolist() == [0]


def test_ranges_are_joined_over_small_gaps() -> None:
    assert together([(5, 9), (0, 5), (20, 30)]) == [(0, 9), (20, 30)]
    many = [(100 * i, 100 * i + 10) for i in range(20)]
    assert len(together(many)) == 5
    assert len(together([(i << 30, (i << 30) + 10) for i in range(20)])) == 20


# -- seams ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("integers", [True, False])
def test_the_union_is_the_whole(tmp_path: Path, n: int, integers: bool) -> None:
    """Exact and signs only: point for point and piece for piece; by default as many, within the tolerance."""
    check_union(tmp_path, n, integers, FIELDS[n])


@pytest.mark.heavy
@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("integers", [True, False])
def test_the_union_of_many_is_the_whole(tmp_path: Path, n: int, integers: bool) -> None:
    check_union(tmp_path, n, integers, MANY[n])


def check_union(tmp_path: Path, n: int, integers: bool, count: int) -> None:
    for seed in range(count):
        field = random_field(n, seed, integers)
        if seed % 4 == 3:
            field = holed(field, seed)
        isovalue = 0.5 if integers and seed % 3 else 0
        options: list[dict[str, object]] = [{"signs_only": True}, {}, {"exact": True} if integers else {"step": 0.05}]
        for each in options:
            tiled = isocodec.decode(encoded(tmp_path, field, isovalue, **each))
            whole = isocodec.decode(isocodec.encode(field, isovalue, **each))  # type: ignore[arg-type]
            assert tiled.shape == whole.shape and tiled.origin_above in (whole.origin_above, None)
            if each:
                assert pieces(tiled) == pieces(whole)
            else:
                assert len(tiled.points) == len(whole.points) and len(tiled.cells) == len(whole.cells)
            if n == 2:
                assert len(tiled.lines) == len(whole.lines)
            check_faces(encoded(tmp_path, field, isovalue, **each), np.ma.is_masked(field))


def check_faces(data: bytes, holes: bool) -> None:
    """At the end of each stage, points in a shared face are the same from both sides, where no sample is missing."""
    file = tiled_of(data)._file
    grid = file.head.grid
    if holes:
        return
    for stage in range(len(file.head.stages)):
        drawn = {
            index: file.drawn(index, 0, mask, segments) if kind == Kind.CODED else None
            for index, kind, mask, segments in file.tiles(list(np.ndindex(*grid.counts)), 0, stage)
        }
        for index, axis in ((i, a) for i in drawn for a in range(grid.n) if i[a] + 1 < grid.counts[a]):
            here = in_face(drawn[index], axis, 1 << grid.exponent)
            assert here == in_face(drawn[grid.neighbour(index, axis)], axis, 0), (index, axis, stage)


def in_face(drawn: tuple[isocodec.Contour, np.ndarray | None] | None, axis: int, at: int) -> list[tuple[float, ...]]:
    if drawn is None:
        return []
    contour, ends = drawn
    assert ends is not None
    there = (ends[:, :, axis] == at).all(axis=1)
    return sorted(map(tuple, np.delete(contour.points[: len(ends)][there], axis, axis=1).round(9).tolist()))


@pytest.mark.skipif(INTERPRETED, reason="searches would be slow")
@pytest.mark.parametrize("seed", range(6))
def test_tolerances_are_kept_without_seams(tmp_path: Path, seed: int) -> None:
    """Meshes are searched tile by tile: all of the curve lies within the tolerance, both ways, and goes on."""
    field = random_field(2, seed, seed % 2 == 0)
    tolerance = [1.0, 0.3, 3.0][seed % 3]
    data = encoded(tmp_path, field, 0.5, tile=[32, 64][seed // 3], tolerance=tolerance)
    check_faces(data, False)
    contour = isocodec.decode(data)
    assert not len(Promise(check_field(field, 0.5)).excess(contour, tolerance))
    last = np.array(field.shape) - 1
    ends = [line[[0, -1]] for line in contour.lines if not np.array_equal(line[0], line[-1])]
    assert all(((each == 0) | (each == last)).any(axis=1).all() for each in ends)


@given(seed=st.integers(0, 1000), k=st.integers(1, 5))
def test_levels_of_samples_on_sides(seed: int, k: int) -> None:
    """By hand: a sample is a middle of the level at which bisection comes to it."""
    side = (1 << k) + 1
    signs = np.random.default_rng(seed).random((side, side)) < 0.5
    position, level = face_vertices(signs, np.ones((2, 2), np.bool_))
    for (x, y, _), own in zip(position.tolist(), level.tolist(), strict=True):
        step = 1 << (k - 1)
        while x % step or y % step:
            step //= 2
        both = (x // step) % 2 and (y // step) % 2
        assert own == 2 * (k - 1 - step.bit_length() + 1) + (0 if both else 1)
    row = signs[0]
    wanted = {(0, y) for y in range(side) if (row[y] != row[y - 1] and y) or (y + 1 < side and row[y] != row[y + 1])}
    assert {(x, y) for x, y, _ in position.tolist() if x == 0} >= wanted - {(0, 0), (0, side - 1)}


def test_against_find_contours(tmp_path: Path) -> None:
    """Exact values: the points of scikit-image."""
    field = hilly()
    tiled = isocodec.decode(encoded(tmp_path, field, 30.5, exact=True))
    theirs = np.unique(np.concatenate(find_contours(field.astype(float), 30.5)).round(6), axis=0)
    assert np.array_equal(np.unique(tiled.points.round(6), axis=0), theirs)


def test_windows_are_parts_of_the_whole(tmp_path: Path) -> None:
    file = tiled_of(encoded(tmp_path, hilly(), [30.5, 60.5], tile=32))
    rng = np.random.default_rng(1)
    for isovalue in (30.5, 60.5):
        for layer in range(4):
            whole = file.window(isovalue=isovalue, layer=layer)
            for _ in range(4):
                low = rng.integers(0, 100, 2)
                high = low + rng.integers(1, 60, 2)
                part = file.window(np.stack([low, high], axis=1).tolist(), isovalue=isovalue, layer=layer)
                corners = whole.points[whole.cells]
                there = (corners.min(axis=1) < high) & (corners.max(axis=1) > low)
                wanted = whole.cells[there.all(axis=1)]
                assert pieces(part) == sorted(
                    tuple(sorted(map(tuple, (whole.points[cell].round(7) + 0.0).tolist()))) for cell in wanted
                )


def test_a_tile_is_a_file(tmp_path: Path) -> None:
    field = hilly()
    file = tiled_of(encoded(tmp_path, field, 30.5, signs_only=True))
    window = field[file.head.grid.window((1, 2))]
    assert np.array_equal(isocodec.decode_mask(file.tile((1, 2))), window > 30.5)


def test_small_and_empty_fields(tmp_path: Path) -> None:
    for field in (np.zeros((3, 40)), np.ones((70, 5)), np.full((40, 40), np.nan)):
        contour = isocodec.decode(encoded(tmp_path, field, 0.5, signs_only=True))
        assert len(contour.points) == 0 and contour.shape == field.shape


# -- who encodes ---------------------------------------------------------------------------------------------------


class Shuffled(Executor):
    """Does what it is given in any order, when it has enough of it."""

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


def test_the_same_bytes_whoever_encodes(tmp_path: Path) -> None:
    field = hilly((180, 150))
    alone = encoded(tmp_path, field, 30.5)
    with ThreadPoolExecutor(3) as threads:
        assert encoded(tmp_path, field, 30.5, engine=threads) == alone
    assert encoded(tmp_path, field, 30.5, engine=Shuffled(), workers=2) == alone
    if not INTERPRETED:
        with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as processes:
            assert encoded(tmp_path, field, 30.5, engine=processes) == alone


def test_the_same_bytes_from_other_arrays(tmp_path: Path) -> None:
    zarr, array = pytest.importorskip("zarr"), pytest.importorskip("dask.array")
    xarray = pytest.importorskip("xarray")
    field = hilly((90, 100))
    alone = encoded(tmp_path, field, 30.5)
    np.save(tmp_path / "field.npy", field)
    stored = zarr.open(str(tmp_path / "field.zarr"), mode="w", shape=field.shape, chunks=(37, 23), dtype=field.dtype)
    stored[:] = field
    for other in (
        np.load(tmp_path / "field.npy", mmap_mode="r"), stored, array.from_array(field, chunks=(13, 77)),
        xarray.DataArray(field),
    ):  # fmt: skip
        assert encoded(tmp_path, other, 30.5) == alone


@pytest.mark.skipif(INTERPRETED, reason="workers would be slow")
def test_the_same_bytes_of_a_dask_cluster(tmp_path: Path) -> None:
    distributed, array = pytest.importorskip("distributed"), pytest.importorskip("dask.array")
    field = hilly((180, 150))
    alone = encoded(tmp_path, field, 30.5)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=tmp_path
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert encoded(tmp_path, field, 30.5, engine=client) == alone
        assert encoded(tmp_path, array.from_array(field, chunks=50), 30.5, engine=client) == alone


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
            isocodec.encode_tiles(source, 30.5, path, tile=32)
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
    for _ in range(12):
        with pytest.raises(OSError, match="gone"):
            isocodec.encode_tiles(Stopping(field, 12), 30.5, path, tile=32, spool=spool)
        for name in ("journal", "segments"):
            data = bytearray((spool / name).read_bytes())
            at = dice.randrange(len(data) // 2, len(data))
            if dice.random() < 0.5:
                del data[at:]
            else:
                data[at] ^= 1 << dice.randrange(8)
            (spool / name).write_bytes(data)
        isocodec.encode_tiles(field, 30.5, path, tile=32, spool=spool)
        assert path.read_bytes() == wanted
        path.unlink()


def test_a_spool_of_something_else(tmp_path: Path) -> None:
    field = hilly()
    with pytest.raises(OSError, match="gone"):
        isocodec.encode_tiles(Stopping(field, 3), 30.5, tmp_path / "a.iso", tile=32)
    with pytest.raises(OptionError, match="other options"):
        isocodec.encode_tiles(field, 31.5, tmp_path / "a.iso", tile=32)
    tiling = Tiling(grid_of(field.shape, 5), (30.5,), Options(), "<i2")
    with (
        Spool(tmp_path / "a.iso.tiles", tiling),
        pytest.raises(OptionError, match="another process"),
    ):
        isocodec.encode_tiles(field, 30.5, tmp_path / "a.iso", tile=32)


class Changing(Stopping):
    """A field that is another one after some time."""

    def __getitem__(self, window: tuple[slice, ...]) -> np.ndarray:
        self.times -= 1
        return self.field[window] + (self.times < 0)


def test_a_field_that_changes(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"tiles \(\d, \d\) and \(\d, \d\) had other samples"):
        isocodec.encode_tiles(Changing(hilly(), 9), 30.5, tmp_path / "a.iso", tile=32)
    assert not (tmp_path / "a.iso").exists()


def test_errors_name_the_tile(tmp_path: Path) -> None:
    field = hilly().astype(float)
    field[96:112] = np.inf
    with pytest.raises(InputError, match=r"tile \(\d, \d\)"):
        isocodec.encode_tiles(field, 30.5, tmp_path / "a.iso", tile=32, step=0.1)
    for wrong in ({"tile": 100}, {"tile": 16}, {"exact": True}, {"step": 1.0, "exact": True}):
        with pytest.raises(OptionError):
            isocodec.encode_tiles(hilly().astype(float), 30.5, tmp_path / "b.iso", **wrong)  # type: ignore[arg-type]
    for thing in ([[1, 2]], np.zeros(5), np.zeros((3, 1)), np.zeros((3, 3), complex)):
        with pytest.raises(InputError):
            isocodec.encode_tiles(thing, 30.5, tmp_path / "b.iso")
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
    with pytest.raises(TruncatedError):
        isocodec.decode(data[:-1])
    with pytest.raises(FormatError, match="in tiles"):
        isocodec.inspect(data)


# -- files and the command line ------------------------------------------------------------------------------------


def test_literal_head(tmp_path: Path) -> None:
    """The bytes of clause 12.3, read by hand."""
    data = encoded(tmp_path, np.zeros((40, 50), np.uint8), 0.5, metadata={"a": "b"})
    assert data[:4] == b"\x89IST" and data[4] == 0 and data[5] == 1
    length = int.from_bytes(data[6:8], "big")
    assert length == len(data) - 1  # a leaf of one run
    assert data[8:13] == bytes([40, 50, 5, 5, 4])
    assert data[13:17] == bytes([4, 2, 0, 0x80])
    assert data[17:20] == bytes([1, 0, 2])  # one isovalue, of halves: 1, in zigzag form 2
    assert data[20:30] == b'\x09{"a":"b"}'
    assert data[30] == 1 and data[35:39] == bytes(4)
    assert data[length:] == bytes([(2 - 1) << 2])  # two tiles, below


def test_command_line(tmp_path: Path) -> None:
    field, tiled = tmp_path / "f.npy", tmp_path / "t.iso"
    np.save(field, hilly((150, 140)))
    facts = json.loads(ok("tile", field, "-o", tiled, "--isovalue", 30.5, "--isovalue", 50.5, "--tile", 32, "--json"))
    assert facts["tiles"] == 20 and facts["bytes"] == tiled.stat().st_size
    told = json.loads(ok("info", tiled, "--json"))
    assert told["tiled"] and told["shape"] == [150, 140]
    assert sum(each["bytes"] for each in told["layers"]) + told["directories"] == told["bytes"]
    assert "5 x 4 of 32 samples" in ok("info", tiled)
    ok("decode", tiled, "-o", tmp_path / "w.geojson", "--window", "10:60,20:70", "--layers", 3)
    features = json.loads((tmp_path / "w.geojson").read_text())["features"]
    assert {each["properties"]["isovalue"] for each in features} == {30.5, 50.5}
    ok("decode", tiled, "-o", tmp_path / "w.npz", "--within", 4)
    fails(4, "mask", tiled, "-o", tmp_path / "m.npy")
    wrong: list[list[str]] = [["--window", "1"], ["--window", "1:2"], ["--smooth"], ["--within", "4", "--layers", "1"]]
    for options in wrong:
        assert run("decode", tiled, "-o", tmp_path / "x.npz", *options).exit_code == 2
    assert run("tile", field, "-o", tmp_path / "x.iso", "--isovalue", 1, "--tile", 33).exit_code == 2
    fails(3, "tile", tmp_path / "none.npy", "-o", tmp_path / "x.iso", "--isovalue", 1)


@pytest.mark.skipif(INTERPRETED, reason="a process of its own would be slow")
def test_killed_and_run_again(tmp_path: Path) -> None:
    """The whole process is killed, five times at any moment: the same command goes on; the bytes are the same."""
    field = np.tile(hilly((512, 512)), (2, 2))
    np.save(tmp_path / "f.npy", field)
    wanted = encoded(tmp_path, field, 30.5, tile=64)
    path = tmp_path / "killed.iso"
    command = [sys.executable, "-m", "isocodec", "tile", str(tmp_path / "f.npy"), "-o", str(path), "--isovalue", "30.5"]
    dice = random.Random(1)
    for _ in range(5):
        child = subprocess.Popen([*command, "--tile", "64"])
        time.sleep(0.4 + dice.random())
        child.send_signal(signal.SIGKILL)
        child.wait()
        assert not path.exists() or path.read_bytes() == wanted
    subprocess.run([*command, "--tile", "64"], check=True)
    assert path.read_bytes() == wanted


@pytest.mark.skipif(INTERPRETED, reason="a process of its own would be slow")
def test_a_worker_that_dies(tmp_path: Path) -> None:
    field = hilly()
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as processes:
        processes.submit(os.getpid).result()
        (worker,) = processes._processes  # type: ignore[misc]
        os.kill(worker, signal.SIGKILL)
        with pytest.raises(InputError, match="worker"):
            isocodec.encode_tiles(field, 30.5, tmp_path / "a.iso", tile=32, engine=processes)
    isocodec.encode_tiles(field, 30.5, tmp_path / "a.iso", tile=32)
    assert (tmp_path / "a.iso").read_bytes() == encoded(tmp_path, field, 30.5)
