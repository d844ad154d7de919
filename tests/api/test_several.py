"""Several isovalues of one field: multiples of an interval in, all of them out in one file of another tool."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails, ok, run
from isocodec.errors import OptionError, TruncatedError
from isocodec.verbs import values_of
from libraries import Late
from tables import looped

shapely = Late("shapely")

ISOVALUES = [60.5, 100.5, 80.5]


@pytest.fixture(scope="module")
def data() -> bytes:
    return isocodec.encode(isocodec.Field(HILLS, placement=(-2.0, 2.0)), ISOVALUES, metadata={"crs": "EPSG:32613"})


@pytest.fixture
def several(tmp_path: Path, data: bytes) -> Path:
    path = tmp_path / "several.iso"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("smooth", [False, True])
def test_all_isovalues_are_those_one_by_one(data: bytes, smooth: bool) -> None:
    contours = isocodec.open(data).contours(smooth=smooth)
    assert [contour.isovalue for contour in contours] == ISOVALUES
    for contour in contours:
        alone = isocodec.decode(data, isovalue=contour.isovalue, smooth=smooth)
        assert np.array_equal(contour.points, alone.points) and np.array_equal(contour.cells, alone.cells)
        assert contour.complete and contour.placement is not None and alone.placement is not None
        assert np.array_equal(contour.placement.matrix, alone.placement.matrix)
        assert contour.placement.crs == alone.placement.crs == "EPSG:32613"


def test_the_first_bytes_hold_the_isovalues_that_begin_in_them(data: bytes) -> None:
    counts = []
    for size in range(20, len(data) + 1, 25):
        contours = isocodec.open(data).contours(max_bytes=size)
        decoder = isocodec.Decoder()
        decoder.feed(data[:size])
        decoder.take()
        for number, contour in enumerate(contours):
            assert np.array_equal(contour.points, decoder.contour(number).points)
        counts.append(len(contours))
    assert counts == sorted(counts) and {1, 3} <= set(counts) <= {1, 2, 3}
    with pytest.raises(TruncatedError):
        isocodec.open(data[:-1]).contours()
    for size in (4, len(data[:5])):
        with pytest.raises(TruncatedError, match="before its curve begins"):
            isocodec.open(data).contours(max_bytes=size)
    with pytest.raises(OptionError):
        isocodec.open(data).contours(max_bytes=0)


def test_damage_behind_the_first_isovalue(several: Path, data: bytes, tmp_path: Path) -> None:
    several.write_bytes(data[: len(data) * 2 // 3])
    out = tmp_path / "cut.geojson"
    assert "--partial" in fails(5, "decode", several, "-o", out)
    assert not out.exists()
    assert "as far as possible" in run("decode", several, "-o", out, "--partial").stderr
    features = json.loads(out.read_text())["features"]
    assert [feature["properties"]["complete"] for feature in features] == [False] * len(features)
    several.write_bytes(b"")
    assert "is empty" in fails(5, "decode", several, "-o", out, "--partial")


def multiples(field: np.ndarray, interval: object, tmp_path: Path, *options: object) -> list[float]:
    np.save(tmp_path / "field.npy", field)
    args = ("encode", tmp_path / "field.npy", "-o", tmp_path / "i.iso", "--interval", interval, "--json", *options)
    return list(json.loads(ok(*args))["isovalues"])


def test_multiples_of_an_interval(tmp_path: Path) -> None:
    """Those that divide the samples: the greatest lies above none, the least, if it is a sample, below others."""
    assert multiples(HILLS, 20, tmp_path) == list(range(-(-int(HILLS.min()) // 20) * 20, int(HILLS.max()), 20))
    ramp = np.tile(np.linspace(-0.3, 0.4, 8), (4, 1))
    assert multiples(ramp, 0.1, tmp_path)[1:] == [-0.2, -0.1, 0.0, 0.1, 0.2, 0.3]
    assert multiples(np.array([[-4, 4], [0, 4]]), 4, tmp_path) == [-4, 0]
    assert multiples(np.array([[-4, 4], [0, 4]]), "4,0.5", tmp_path) == [-3.5, 0.5]
    holed = HILLS.astype(np.float32)
    holed[3:5, 7] = np.nan
    assert multiples(holed, 20, tmp_path, "--missing", "nearest") == multiples(HILLS, 20, tmp_path)


RANGES = {
    "40,60.5": [40, 60.5], "40:80:20": [40, 60, 80], "40:79:20": [40, 60], "80:40:-20": [80, 60, 40],
    "0.1:0.3:0.1": [0.1, 0.2, 0.3], "-0.1:0.1:0.1": [-0.1, 0.0, 0.1], "40:40:1": [40], "1e1:2e1:5": [10, 15, 20],
    "9007199254740991:9007199254740992:1": [2**53 - 1, 2**53], "5,40:60:20,1.5": [5, 40, 60, 1.5],
}


@pytest.mark.parametrize("text", RANGES)
def test_lists_and_ranges(text: str) -> None:
    """In decimal, as they are written, and as Python's own arithmetic of fractions has them."""
    found = values_of(text)
    assert [*found] == RANGES[text] and all(isinstance(one, int) == ("." not in repr(one)) for one in found)


@looped("text", ["1:2", "1:2:0", "1:2:nan", "inf:inf:1", "0:1:inf", "a:b:c", "1:2:3:4", ":2:1", "5:1:1", "1:5:-1",
                 "0:1e9:1", "0:1e400:1", "0:1:1e-400", "sNaN:1:1", "0:4096:1", "", "1,,2", "1,2,"])
def test_ranges_that_are_none(text: str) -> None:
    with pytest.raises(OptionError):
        values_of(text)
    assert len(values_of("0:4095:1")) == 4096


def test_every_command_takes_lists_and_ranges(tmp_path: Path) -> None:
    path, iso = tmp_path / "hills.npy", tmp_path / "all.iso"
    np.save(path, HILLS)
    some = ["--isovalue", "40", "--isovalue", "60:80:20"]

    def isovalues(*arguments: object) -> list[float]:
        return list(json.loads(ok(*arguments, *some, "--json"))["isovalues"])

    assert isovalues("encode", path, "-o", tmp_path / "some.iso") == [40, 60, 80]
    assert isovalues("encode", path, "-o", tmp_path / "some.gpkg") == [40, 60, 80]
    assert isovalues("plot", path, "-o", tmp_path / "some.svg", "--map") == [40, 60, 80]
    ok("encode", path, "-o", iso, "--isovalue", "20:100:20")
    assert isovalues("edit", iso, "-o", tmp_path / "some.iso") == [40, 60, 80]
    for options in ([], ["--simplify", 1], ["--within", 4], ["--layers", 3], ["--what", "bands"]):
        assert isovalues("decode", iso, "-o", tmp_path / "some.geojson", *options) == [40, 60, 80]
    assert "one isovalue" in fails(2, "decode", iso, "-o", tmp_path / "above.npy", "--what", "above", *some)
    assert "several contours" in fails(2, "decode", iso, "-o", tmp_path / "some.npz", *some)
    assert "several isovalues need --map" in fails(2, "plot", iso, "-o", tmp_path / "some.svg", *some)
    ok("thin", path, "-o", tmp_path / "tin.iso", "--tolerance", 2, *some)
    assert "contours of 40, 60, 80" in (isocodec.open(tmp_path / "tin.iso").promise or "")
    shown = ok("encode", path, "-o", tmp_path / "labels.iso", "--label", f"{HILLS[0, 0]},{HILLS[12, 12]}")
    assert "2 labels" in shown


@looped("given", [range(40, 81, 20), np.arange(40, 81, 20), np.arange(40.0, 81, 20), (40, 60, 80), [40.0, 60, 80]])
def test_sequences_in_python(given: Any) -> None:
    file = isocodec.open(isocodec.encode(HILLS, given))
    assert file.isovalues == (40, 60, 80)
    assert isocodec.open(file.edited(isovalues=given[1:])).isovalues == (60, 80)


def test_intervals_that_fit_no_file(tmp_path: Path) -> None:
    path, out = tmp_path / "hills.npy", tmp_path / "out.iso"
    np.save(path, HILLS)
    for wrong in ("0", "-1", "nan", "inf"):
        assert "greater than 0" in fails(2, "encode", path, "-o", out, "--interval", wrong)
    assert "cannot be combined" in fails(2, "encode", path, "-o", out, "--interval", 20, "--isovalue", 30)
    assert "a file holds at most 4,096" in fails(3, "encode", path, "-o", out, "--interval", 0.01)
    np.save(path, HILLS + 1)
    assert "no multiple" in fails(3, "encode", path, "-o", out, "--interval", 1000)
    np.save(path, np.full((9, 9), 7.5))
    assert fails(3, "encode", path, "-o", out, "--interval", 2).endswith("the data are all 7.5: they have no contours")
    np.save(path, np.array([[0.0, np.inf], [1.0, 2.0]]))
    assert "infinite" in fails(3, "encode", path, "-o", out, "--interval", 1)
    np.save(path, np.full((3, 3), np.nan))
    assert "missing" in fails(3, "encode", path, "-o", out, "--interval", 1, "--missing", "below")
    assert not out.exists()
