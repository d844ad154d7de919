"""Fields in tiles: directories, seams, windows (spec clause 12)."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import INTERPRETED
from commands import fails, ok, run
from isocodec.field.samples import check_field
from isocodec.search.promise import Promise
from isocodec.storage.ranges import GAP, MOST_PIECES, SLACK, together
from isocodec.tiles import tiled
from isocodec.tiles.closing import TilePart
from isocodec.tiles.layout import TileGrid, in_order, morton
from isocodec.tiles.shared_limits import Shared
from isocodec.tiles.structure import groups_of
from libraries import Late
from tables import heavy, looped
from tiled import encoded, hilly, holed, pieces, tiled_of

gaussian_filter = Late("scipy.ndimage.gaussian_filter")

FIELDS = {2: 2, 3: 1}
"""Random fields, by number of axes."""
MANY = {2: 200, 3: 60}


def random_field(n: int, seed: int, integers: bool) -> np.ndarray:
    rng = np.random.default_rng(seed)
    small, large = ((20, 60) if INTERPRETED else (20, 150)) if n == 2 else ((20, 36) if INTERPRETED else (20, 50))
    field = gaussian_filter(rng.normal(size=rng.integers(small, large, n)), rng.choice([0.7, 1.5, 3, 6]))
    field /= field.std()
    return np.rint(field * 20).astype(np.int16) if integers else field


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


@given(st.lists(st.tuples(st.integers(0, 60), st.integers(0, 40)).map(lambda r: (r[0] << 11, (r[0] + r[1]) << 11)),
                max_size=12))
def test_joined_ranges_have_every_byte_that_is_asked_for(ranges: list[tuple[int, int]]) -> None:
    """However they overlap: each lies within one, none touches another, and no more is read in vain than asked for."""
    found = together(ranges)
    asked = {byte for start, end in ranges for byte in range(start >> 11, end >> 11)}
    read = [byte for start, end in found for byte in range(start >> 11, end >> 11)]
    assert asked <= set(read) and len(read) == len(set(read))
    room = max(len(asked), SLACK >> 11) - (len(read) - len(asked))
    gaps = [(b[0] - a[1]) for a, b in pairwise(found)]
    assert room >= 0 and all(gap > GAP or gap >> 11 > room for gap in gaps)
    assert len(found) <= MOST_PIECES or min(gaps) >> 11 > room
    assert {found[0][0], found[-1][1]} == {min(asked) << 11, (max(asked) + 1) << 11} if asked else not found


# -- seams ---------------------------------------------------------------------------------------------------------


@pytest.mark.cover(1)
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
        if seed % 2:
            field = holed(field, seed)
        isovalue = 0.5 if integers and seed % 3 else 0
        options: list[dict[str, object]] = [
            {"precision": "signs"}, {}, {"precision": "exact"} if integers else {"precision": "step=0.05"},
        ]
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
    file = tiled_of(data)
    grid = file.head.grid
    if holes:
        return
    for stage in range(len(file.head.stages)):
        drawn = {
            tile.index: next(file._all_drawn([tile], [0], Shared(file.limits)))[1][0] if tile.numbers else None
            for tile in file.tiles(np.ndindex(*grid.counts), 0, stage)
        }
        for index, axis in ((i, a) for i in drawn for a in range(grid.n) if i[a] + 1 < grid.counts[a]):
            here = in_face(drawn[index], axis, 1 << grid.exponent)
            assert here == in_face(drawn[grid.neighbour(index, axis)], axis, 0), (index, axis, stage)


def in_face(part: TilePart | None, axis: int, at: int) -> list[tuple[float, ...]]:
    if part is None:
        return []
    there = (part.ends[:, :, axis] == at).all(axis=1)
    points = part.contour.points[: len(part.ends)][there]
    return sorted(map(tuple, np.delete(points, axis, axis=1).round(9).tolist()))


@pytest.mark.skipif(INTERPRETED, reason="searches would be slow")
@looped("seed", [0, *heavy(1, 2, 3, 4, 5)])
def test_tolerances_are_kept_without_seams(tmp_path: Path, seed: int) -> None:
    """Meshes are searched tile by tile: all of the curve lies within the tolerance, both ways, and goes on."""
    field = random_field(2, seed, seed % 2 == 0)
    tolerance = [1.0, 0.3, 3.0][seed % 3]
    data = encoded(tmp_path, field, 0.5, tile=[32, 64][seed // 3], precision=tolerance)
    check_faces(data, False)
    contour = isocodec.decode(data)
    assert not len(Promise(check_field(field, 0.5)).excess(contour, tolerance))
    last = np.array(field.shape) - 1
    ends = [line[[0, -1]] for line in contour.lines if not np.array_equal(line[0], line[-1])]
    assert all(((each == 0) | (each == last)).any(axis=1).all() for each in ends)


def test_windows_are_parts_of_the_whole(tmp_path: Path) -> None:
    file = tiled_of(encoded(tmp_path, hilly(), [30.5, 60.5], tile=32))
    rng = np.random.default_rng(1)
    for isovalue in (30.5, 60.5):
        for layer in range(4):
            whole = file.window(isovalue=isovalue, layer=layer)
            for _ in range(2):
                low = rng.integers(0, 100, 2)
                high = low + rng.integers(1, 60, 2)
                part = file.window(np.stack([low, high], axis=1).tolist(), isovalue=isovalue, layer=layer)
                corners = whole.points[whole.cells]
                there = (corners.min(axis=1) < high) & (corners.max(axis=1) > low)
                wanted = whole.cells[there.all(axis=1)]
                assert pieces(part) == sorted(
                    tuple(sorted(map(tuple, (whole.points[cell].round(7) + 0.0).tolist()))) for cell in wanted
                )


def test_directories_that_are_kept_have_a_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is room for none, none is kept, and windows are the same."""
    data = encoded(tmp_path, hilly(), 30.5, precision="signs")
    file, wanted = tiled_of(data), tiled_of(data).window()
    monkeypatch.setattr(tiled, "KEPT", 0)
    assert pieces(file.window()) == pieces(wanted) and not file._leaves


def test_a_tile_is_a_file(tmp_path: Path) -> None:
    field = hilly()
    file = tiled_of(encoded(tmp_path, field, 30.5, precision="signs"))
    window = field[file.head.grid.window((1, 2))]
    assert np.array_equal(isocodec.open(file.plain((1, 2))).above(), window > 30.5)


def test_small_and_empty_fields(tmp_path: Path) -> None:
    for field in (np.zeros((3, 40)), np.ones((70, 5)), np.full((40, 40), np.nan)):
        contour = isocodec.decode(encoded(tmp_path, field, 0.5, precision="signs"))
        assert len(contour.points) == 0 and contour.shape == field.shape


# -- files and the command line ------------------------------------------------------------------------------------


def test_literal_head(tmp_path: Path) -> None:
    """The bytes of clause 12.3, read by hand."""
    data = encoded(tmp_path, np.zeros((40, 50), np.uint8), 0.5, metadata={"a": "b"})
    assert data[:4] == b"\x89IST" and data[4] == 0x11 and data[5] == 1
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
    facts = json.loads(
        ok("encode", field, "-o", tiled, "--isovalue", 30.5, "--isovalue", 50.5, "--tile", 32, "--json")
    )
    assert facts["tiles"] == 20 and facts["bytes"] == tiled.stat().st_size
    told = json.loads(ok("info", tiled, "--json"))
    assert told["kind"] == "tiles" and told["shape"] == [150, 140]
    assert sum(each["bytes"] for each in told["layers"]) + told["overhead_bytes"] == told["bytes"]
    assert "5 x 4 of 32 samples" in ok("info", tiled)
    ok("decode", tiled, "-o", tmp_path / "w.geojson", "--window", "10:60,20:70", "--layers", 3)
    features = json.loads((tmp_path / "w.geojson").read_text())["features"]
    assert {each["properties"]["isovalue"] for each in features} == {30.5, 50.5}
    ok("decode", tiled, "-o", tmp_path / "w.npz", "--within", 4)
    ok("decode", "--what", "above", tiled, "-o", tmp_path / "m.npy")
    assert np.array_equal(np.load(tmp_path / "m.npy"), hilly((150, 140)) > 30.5)
    wrong: list[list[str]] = [["--window", "1"], ["--window", "1:2"], ["--smooth"], ["--within", "4", "--layers", "1"]]
    for options in wrong:
        assert run("decode", tiled, "-o", tmp_path / "x.npz", *options).exit_code == 2
    assert run("encode", field, "-o", tmp_path / "x.iso", "--isovalue", 1, "--tile", 33).exit_code == 2
    fails(3, "encode", "--tile", 1024, tmp_path / "none.npy", "-o", tmp_path / "x.iso", "--isovalue", 1)


def test_boxes_need_the_tiles_of_their_cells_alone() -> None:
    """A box that ends at the row that two tiles share needs the first; one without cells, the tile behind it."""
    grid = TileGrid((129, 129), 5)
    for low, high, tiles in ((0, 32, range(1)), (0, 33, range(2)), (32, 32, range(1, 2)), (31, 64, range(2)),
                             (120, 128, range(3, 4))):
        assert grid.touching(np.full(2, low), np.full(2, high)) == (tiles, tiles)
