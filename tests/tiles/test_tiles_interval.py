"""Multiples of an interval as isovalues of a file in tiles: sought in a field that need not be in memory."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import fails, ok, run
from isocodec.stream.options import Options
from isocodec.tiles.writing import sample_range, tiling_of
from tables import looped
from tiled import hilly, pieces


def floats() -> np.ndarray:
    """With missing samples, one tile of which has nothing else."""
    field = hilly((100, 130)) / 10
    field[:33, :33] = np.nan
    field[50, 60] = np.nan
    return field


@pytest.mark.parametrize(
    ("field", "options"),
    [(hilly((40, 70)), ("40,0.5",)), (floats(), (5,)),
     (hilly((40, 36))[:, :, None] + np.arange(34, dtype=np.int16), (80,))],
    ids=["shifted", "holed", "space"],
)
def test_the_isovalues_of_encode(tmp_path: Path, field: np.ndarray, options: tuple[object, ...]) -> None:
    """As ``encode --interval`` finds them of the whole field; and the curves are those of these isovalues."""
    np.save(tmp_path / "f.npy", field)
    told = []
    for name, more in (
        ("whole", ("--precision", "signs")), ("tiles", ("--tile", 32, "--precision", "signs")),
    ):
        out = tmp_path / f"{name}.iso"
        ok("encode", tmp_path / "f.npy", "-o", out, "--interval", *options, *more)
        told.append(isocodec.open(out).isovalues)
    whole, tiles = told
    assert whole == tiles and len(tiles) > 2
    low, high = np.nanmin(field), np.nanmax(field)
    assert low <= tiles[0] and tiles[-1] < high and tiles[-1] + float(str(options[0]).split(",")[0]) >= high
    for isovalue in tiles:
        both = [isocodec.open(tmp_path / f"{name}.iso").contour(isovalue) for name in ("whole", "tiles")]
        assert pieces(both[0]) == pieces(both[1])


class Made:
    """A field whose windows are made when they are asked for."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape, self.dtype = shape, np.dtype(np.float64)
        self.asked = 0

    def __getitem__(self, window: tuple[slice, slice]) -> np.ndarray:
        self.asked += 1
        rows, columns = (np.arange(each.start, each.stop) for each in window)
        return rows[:, None] + columns / 2.0


def test_memory_is_that_of_a_tile() -> None:
    """A field of 2 GB, whose range is known."""
    field = Made((16_000, 16_000))
    grid = tiling_of(field, 0, None, Options()).grid
    seen: list[tuple[int, int]] = []
    tracemalloc.start()
    found = sample_range(field, grid, lambda done, total: seen.append((done, total)))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found == (0.0, 15_999 + 15_999 / 2)
    assert peak < 5 * 8 * 1025**2
    assert seen == [(done, grid.total) for done in range(1, grid.total + 1)] and field.asked == grid.total


@looped(
    ("options", "code", "said"),
    [
        ([], 2, "give one of --isovalue, --interval or --label"),
        (["--isovalue", 3, "--interval", 5], 2, "--isovalue and --interval cannot be combined"),
        (["--interval", "5,1,1"], 2, "a finite start"),
        (["--interval", -5], 2, "greater than 0"),
        (["--interval", "5,nan"], 2, "finite"),
        (["--interval", 1e-9], 3, "choose a larger interval"),
        (["--interval", "1e9,5e8"], 3, "choose a smaller interval"),
    ],
)
def test_what_cannot_be_asked(tmp_path: Path, options: list[Any], code: int, said: str) -> None:
    np.save(tmp_path / "f.npy", hilly((40, 40)) + 1)
    assert said in fails(code, "encode", "--tile", 32, tmp_path / "f.npy", "-o", tmp_path / "o.iso", *options)
    assert not (tmp_path / "o.iso").exists() and not (tmp_path / "o.iso.tiles").exists()


def test_wrong_options_are_found_before_a_sample_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.save(tmp_path / "f.npy", floats())

    def read(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr("isocodec.tiles.writing.sample_range", read)
    result = run(
        "encode", "--tile", 32, tmp_path / "f.npy", "-o", tmp_path / "o.iso", "--interval", 5, "--precision", "exact",
    )
    assert result.exit_code != 1 and "exact" in result.stderr
