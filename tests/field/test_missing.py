"""Missing samples: which they are, and that the rest of the field stays as it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails, ok, run
from isocodec.errors import InputError
from isocodec.field.missing import filled, missing_samples
from isocodec.field.samples import missing_of
from libraries import Late
from tables import looped

tifffile = Late("tifffile")

HOLE = np.zeros(HILLS.shape, np.bool_)
HOLE[8:14, 10:20] = HOLE[0, 0] = HOLE[30:, 38:] = True


def tiff(path: Path, field: np.ndarray, nodata: str | None) -> Path:
    tags: list[Any] = [] if nodata is None else [(42113, "s", 0, nodata, False)]
    tifffile.imwrite(path, field, extratags=tags)
    return path


@pytest.mark.parametrize(("dtype", "nodata", "gone"), [
    ("int64", -(2.0**63), [0]), ("int64", 2.0**63, []), ("int64", 2.0**62, [3]), ("uint64", 2.0**63, []),
])
def test_the_largest_values_that_stand_for_missing_samples(dtype: str, nodata: float, gone: list[int]) -> None:
    """2^63 is one more than the largest of 64 bits with a sign."""
    least = np.iinfo(dtype).min
    field = np.array([least, 0, np.iinfo(dtype).max, 2**62], dtype)
    assert np.flatnonzero(missing_samples(field, nodata)).tolist() == gone


def test_below_the_lowest_of_several_isovalues() -> None:
    """Where all samples lie above it, so that none of them could stand for what is missing."""
    for dtype in ("uint8", "float32"):
        field = np.full((6, 6), 50, dtype)
        field[2:4, 2:4] = 90
        gone = field == 90
        for isovalues in ([20, 60], [60, 20], [20.5]):
            below, above = (filled(field, gone, way, isovalues)[gone] for way in ("below", "above"))
            assert (below <= min(isovalues)).all() and (above > max(isovalues)).all()


@pytest.mark.parametrize(("dtype", "nodata"), [("uint8", 256.0), ("uint8", -1.0), ("int16", 0.5), ("int16", np.nan)])
def test_values_that_no_sample_can_have(dtype: str, nodata: float) -> None:
    assert not missing_samples(np.arange(-3, 9).astype(dtype), nodata).any()


def test_the_ends_of_a_type_stand_for_missing_samples() -> None:
    for nodata in (0.0, 255.0):
        assert missing_samples(np.array([0, 7, 255], np.uint8), nodata).tolist() == [nodata == 0, False, nodata == 255]


@looped("dtype", ["uint8", "int32", "float32", "float64"])
@looped("isovalues", [[80.5], [80], [20.25, 300]])
def test_missing_samples_lie_where_they_are_said_to(dtype: str, isovalues: list[float]) -> None:
    field = HILLS.astype(dtype)
    if dtype == "uint8" and max(isovalues) > 255:
        with pytest.raises(InputError, match="uint8 has no value above"):
            filled(field, HOLE, "above", isovalues)
        return
    for way, above in (("below", False), ("above", True)):
        out = filled(field, HOLE, way, isovalues)
        assert out.dtype == field.dtype and np.array_equal(out[~HOLE], field[~HOLE])
        for isovalue in isovalues:
            assert (isocodec.open(isocodec.encode(out, isovalue)).above()[HOLE] == above).all()
    assert np.array_equal(field, HILLS), "the field itself stays"


def test_the_nearest_sample_stands_in() -> None:
    out = filled(HILLS, HOLE, "nearest", [80.5])
    assert np.array_equal(out[~HOLE], HILLS[~HOLE])
    there = np.argwhere(~HOLE)
    for place in np.argwhere(HOLE):
        distance = ((there - place) ** 2).sum(axis=1)
        near = there[distance == distance.min()]
        assert out[tuple(place)] in HILLS[tuple(near.T)]
    volume = np.arange(60.0).reshape(3, 4, 5)
    gone = volume == 22
    assert abs(filled(volume, gone, "nearest", [1.0])[gone][0] - 22) in (1, 5, 20)


def test_nothing_but_missing_samples() -> None:
    with pytest.raises(InputError, match="all samples are missing"):
        filled(HILLS, np.ones_like(HOLE), "below", [1.0])


def test_on_the_command_line(tmp_path: Path) -> None:
    field = HILLS.astype(np.float32)
    field[HOLE] = -9999
    dem, out = tiff(tmp_path / "dem.tif", field, "-9999"), tmp_path / "out.iso"
    result = run("encode", dem, "-o", out, "--isovalue", 80.5)
    assert result.exit_code == 0 and "missing" not in result.stderr
    assert out.read_bytes() == isocodec.encode(isocodec.Field(field, mask=HOLE), 80.5)
    for way in ("below", "above", "nearest"):
        result = run("encode", dem, "-o", out, "--isovalue", 80.5, "--missing", way)
        assert result.exit_code == 0 and "missing" not in result.stderr
        assert out.read_bytes() == isocodec.encode(filled(field, HOLE, way, [80.5]), 80.5)
    np.save(tmp_path / "dem.npy", field)
    ok("encode", tmp_path / "dem.npy", "-o", out, "--isovalue", 80.5, "--missing", "nearest", "--nodata", "-9999")
    assert out.read_bytes() == isocodec.encode(filled(field, HOLE, "nearest", [80.5]), 80.5)
    assert "all samples" in fails(
        3, "encode", tiff(tmp_path / "sea.tif", np.zeros((4, 4)), "0"), "-o", out, "--isovalue", 1, "--missing", "below"
    )


MASKS = {"none": None, "nothing": np.zeros(HILLS.shape, np.bool_), "some": HOLE, "other": np.roll(HOLE, 5, axis=1)}


@pytest.mark.cover(2)
@pytest.mark.parametrize("hidden", MASKS)
@pytest.mark.parametrize("mask", MASKS)
@pytest.mark.parametrize("lost", [False, True])
def test_masks_and_masked_arrays_and_nan_add_up(hidden: str, mask: str, lost: bool) -> None:
    """A sample is missing if any of them says so."""
    values: Any = HILLS.astype(np.float32)
    if lost:
        values[20:24, 3:9] = np.nan
    gone = np.isnan(values)
    for one in (MASKS[hidden], MASKS[mask]):
        gone |= False if one is None else one
    given = values if MASKS[hidden] is None else np.ma.array(values, mask=MASKS[hidden])
    field = isocodec.Field(given, mask=MASKS[mask])
    valid = isocodec.open(isocodec.encode(field, 80.5, precision="signs")).valid()
    assert np.array_equal(valid, ~gone)
    more, _, _ = isocodec.Field(given).combined(mask=MASKS[mask])
    assert np.array_equal(missing_of(values, more), gone)
