"""Parts of fields in tiles as files of their own: windows in one piece, first layers (spec clause 12)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from test_tiles import random_field

import isocodec
from brute import HEAVY, INTERPRETED
from commands import fails, ok, run
from isocodec.errors import FormatError, LimitError, OptionError
from isocodec.tiles.first_stages import first_stages
from places import matrix
from tables import heavy
from tiled import encoded, hilly, holed, pieces, tiled_of

COUNT = {2: 2, 3: 1} if INTERPRETED else {2: 16, 3: 5} if HEAVY else {2: 4, 3: 1}


def grown(box: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, tuple[slice, ...]]:
    """Where the file of a box begins, and its samples."""
    low = np.minimum(np.floor(box[:, 0]), np.array(shape) - 2).astype(int) // 2 * 2
    high = np.maximum(np.ceil(box[:, 1]).astype(int), low + 1)
    return low, tuple(slice(a, b + 1) for a, b in zip(low.tolist(), high.tolist(), strict=True))


def some_box(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    ends = np.stack([rng.uniform(0, s - 1, 2) for s in shape])
    return np.sort(ends, axis=1)


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("integers", [True, False])
def test_a_window_in_one_piece(tmp_path: Path, n: int, integers: bool) -> None:
    """Against the samples themselves, cut out and encoded; with an offset, against the curve of the tiles."""
    for seed in range(COUNT[n]):
        rng = np.random.default_rng(seed)
        field = random_field(n, seed, integers)
        if seed % 4 == 3:
            field = holed(field, seed)
        box = some_box(rng, field.shape)
        low, window = grown(box, field.shape)
        options: list[dict[str, object]] = [
            {"precision": "signs"}, {}, {"precision": "exact"} if integers else {"precision": "step=0.05"},
        ]
        for each in options:
            data = encoded(tmp_path, field, 0.5, **each)
            part = isocodec.decode(isocodec.open(data).edited(window=box.tolist()))
            assert part.shape == field[window].shape
            assert np.allclose(matrix(part), [[0, 1, low[1]], [1, 0, low[0]]] if n == 2 else np.c_[np.eye(3), low])
            if each:
                theirs = isocodec.decode(isocodec.encode(field[window], 0.5, **each))  # type: ignore[arg-type]
                assert pieces(part) == pieces(theirs)
            else:
                whole = isocodec.decode(data)
                corners = whole.points[whole.cells]
                high = low + np.array(part.shape) - 1
                inside = whole.cells[((corners >= low) & (corners <= high)).all(axis=(1, 2))]
                moved = [tuple(sorted(map(tuple, (whole.points[c] - low).round(7) + 0.0))) for c in inside]
                ours, theirs_ = (np.array(x).reshape(-1, n * n) for x in (pieces(part), sorted(moved)))
                assert ours.shape == theirs_.shape and np.allclose(ours, theirs_, atol=2e-7)


def test_a_tile_as_it_is(tmp_path: Path) -> None:
    """Its bytes are those of the tiled file, also of several isovalues and beside missing samples."""
    for field in (hilly(), holed(hilly(), 1)):
        placed = isocodec.Field(field, placement=[[0, 2, 5], [3, 0, 7]])
        data = encoded(tmp_path, placed, [30.5, 60.5], metadata={"unit": "m"})
        file = tiled_of(data)
        index = (2, 3)
        window = file.head.grid.window(index)
        made = isocodec.open(data).edited(window=[(w.start, w.stop - 1) for w in window])
        for number, isovalue in enumerate((30.5, 60.5)):
            found = file.tiles([index], number, 3)[0]
            mask, segments = found.mask, found.of(number)
            assert mask in made and all(segment in made for segment in segments)
            tile = isocodec.decode(file.plain(index, isovalue), isovalue=isovalue)
            assert pieces(isocodec.decode(made, isovalue=isovalue)) == pieces(tile) and len(tile.cells)
        part = isocodec.decode(made)
        assert part.metadata["unit"] == "m"
        assert np.array_equal(matrix(part), [[0, 2, 2 * 96 + 5], [3, 0, 3 * 64 + 7]])


@pytest.mark.skipif(INTERPRETED, reason="searches would be slow")
def test_what_cannot_be_taken_out(tmp_path: Path) -> None:
    field = hilly((100, 130))
    data = encoded(tmp_path, field, 30.5, precision=1.0)
    coarse = isocodec.open(data)
    with pytest.raises(OptionError, match="one tile"):
        coarse.edited(window=[(0, 60), (0, 60)])
    tile = coarse.edited(window=[(32, 64), (64, 96)])
    assert pieces(isocodec.decode(tile)) == pieces(isocodec.decode(tiled_of(data).plain((1, 2))))
    file = isocodec.open(encoded(tmp_path, field, 30.5))
    for box in ([(200, 210), (0, 3)], [(0, 3)], [(3, 0), (0, 3)]):
        with pytest.raises(OptionError):
            file.edited(window=box)
    with pytest.raises(OptionError, match="no isovalue"):
        file.edited(window=[(0, 9), (0, 9)], isovalues=[3])
    small = isocodec.open(encoded(tmp_path, field, 30.5), limits=isocodec.Limits(samples=100))
    with pytest.raises(LimitError):
        small.edited(window=[(0, 20), (0, 20)])
    assert len(file.edited(window=[(0, 60), (0, 60)], size=300)) <= 300
    # a point, and the field's last corner
    assert isocodec.decode(file.edited(window=[(4, 4), (6, 6)])).shape == (2, 2)
    assert isocodec.decode(file.edited(window=[(99, 99), (129, 129)])).shape == (2, 2)


@pytest.mark.parametrize("options", [{}, *heavy({"precision": "signs"}, {"precision": "exact"})])
def test_first_layers(tmp_path: Path, options: dict[str, object]) -> None:
    """What is drawn is what the whole file has at that layer; segments are the same bytes."""
    field = holed(hilly((50, 112)), 2)
    data = encoded(tmp_path, field, [30.5, 60.5], metadata={"unit": "m"}, **options)
    file = tiled_of(data)
    stages = len(file.head.stages)
    for count in range(1, stages + 2):
        made = isocodec.open(data).edited(layers=count)
        short = tiled_of(made)
        left = {} if count < stages else {"promise"} & set(file.metadata)  # what was promised holds for all layers
        assert {**short.metadata} == {key: file.metadata[key] for key in {"unit", *left}}
        assert len(short.head.stages) == min(count, stages)
        assert len(made) == short.root.total and (made == data) == (count >= stages)
        behind = made[int(short.root.leaves[-1]) :]
        at = int(file.root.leaves[-1])
        assert behind == data[at : at + len(behind)]
        for isovalue in file.isovalues:
            wanted = file.window(isovalue=isovalue, layer=min(count, stages) - 1)
            assert pieces(short.window(isovalue=isovalue)) == pieces(wanted)
    with pytest.raises(OptionError):
        next(first_stages(file, 0))


def test_damage_is_not_sealed(tmp_path: Path) -> None:
    """A segment with another bit keeps the checksum that finds it; a leaf is refused; what is missing, too."""
    data = encoded(tmp_path, hilly(), 30.5)
    file = tiled_of(data)
    bad = bytearray(data)
    bad[int(file.root.leaves[-1]) + 9] ^= 1
    with pytest.raises(FormatError):
        isocodec.decode(b"".join(first_stages(tiled_of(bytes(bad)), 2)))
    bad = bytearray(data)
    bad[int(file.root.leaves[0]) + 3] ^= 1
    with pytest.raises(FormatError, match="checksum"):
        b"".join(first_stages(tiled_of(bytes(bad)), 2))
    with pytest.raises(FormatError, match="ends"):
        b"".join(first_stages(tiled_of(data[: int(file.root.leaves[-1]) + 9]), 2))


def test_command_line(tmp_path: Path) -> None:
    field = hilly()
    (tmp_path / "t.iso").write_bytes(encoded(tmp_path, field, [30.5, 60.5]))
    tiled, out = tmp_path / "t.iso", tmp_path / "o.iso"
    facts = json.loads(ok("edit", tiled, "-o", out, "--window", "10:60,20:70", "--json"))
    assert facts["bytes"] == out.stat().st_size and facts["read"] <= facts["input_bytes"]
    assert json.loads(ok("info", out, "--json"))["isovalues"] == [30.5, 60.5]
    ok("edit", tiled, "-o", out, "--window", "10:60,20:70", "--isovalue", 60.5)
    assert json.loads(ok("info", out, "--json"))["isovalues"] == [60.5]
    facts = json.loads(ok("edit", tiled, "-o", out, "--layers", 2, "--json"))
    assert len(isocodec.open(out).info.layers) == 2 * 2 and facts["bytes"] == out.stat().st_size < tiled.stat().st_size
    assert json.loads(ok("info", out, "--json"))["kind"] == "tiles"
    for wrong in (["--size", 200], ["--window", "1"], ["--window", "900:910,0:4"]):
        fails(2, "edit", tiled, "-o", out, *wrong)
    ok("edit", tiled, "-o", out, "--profile", "baseline")
    assert json.loads(ok("info", out, "--json"))["kind"] == "grid"
    cut = tmp_path / "cut.iso"
    cut.write_bytes(tiled.read_bytes()[:-1])
    assert not json.loads(ok("info", cut, "--json"))["complete"] and "ends before" in run("info", cut).stderr
    assert "ends before" in run("decode", cut, "--partial", "-o", tmp_path / "c.npz").stderr
