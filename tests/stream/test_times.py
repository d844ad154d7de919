"""Times of the frames of a series: kept in every form, through every change of a file, and found again."""

from __future__ import annotations

import json
from datetime import date, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import ok
from isocodec import Encoder, Frames, Mesh
from isocodec.errors import InputError, OptionError
from tables import looped

COUNT = 4
FRAMES = [np.hypot(*(np.mgrid[:9, :9] - 4)) + t / 4 for t in range(COUNT)]
DAYS = np.array(["2024-02-28T12", "2024-02-29T00", "2024-02-29T06", "2024-03-01T00"], "M8[s]")
EAST = timezone(timedelta(hours=3))
GIVEN: dict[str, tuple[list[Any], Any, list[str]]] = {
    "even": ([0, 1, 2, 3], np.arange(4.0), ["0", "1", "2", "3"]),
    "uneven": ([-1.5, 0.1, 0.25, 1e30], np.array([-1.5, 0.1, 0.25, 1e30]), ["-1.5", "0.1", "0.25", "1e+30"]),
    "numpy": ([*np.float32([0, 0.5, 1, 2])], np.array([0, 0.5, 1, 2]), ["0", "0.5", "1", "2"]),
    "unit": (["0 s", "6 s", "12.5 s", "20 s"], np.array([0, 6, 12.5, 20]), ["0 s", "6 s", "12.5 s", "20 s"]),
    "falling": ([3, 2, 1, -2], np.array([3.0, 2, 1, -2]), ["3", "2", "1", "-2"]),
    "datetime64": ([*DAYS], DAYS, ["2024-02-28T12:00", "2024-02-29", "2024-02-29T06:00", "2024-03-01"]),
    "nanoseconds": ([*DAYS.astype("M8[ns]")], DAYS, ["2024-02-28T12:00", "2024-02-29", "2024-02-29T06:00",
                                                     "2024-03-01"]),
    "datetime": ([datetime(2024, 2, 28, 15, tzinfo=EAST), datetime(2024, 2, 29), datetime(2024, 2, 29, 6),
                  date(2024, 3, 1)], DAYS, ["2024-02-28T12:00", "2024-02-29", "2024-02-29T06:00", "2024-03-01"]),
    "texts": (["2024-02-28T12", "2024-02-29", "2024-02-29T06:00:00.0", "2024-03"], DAYS,
              ["2024-02-28T12", "2024-02-29", "2024-02-29T06:00:00.0", "2024-03"]),
}


@looped("name", GIVEN)
def test_times_are_kept(name: str, tmp_path: Path):
    given, wanted, texts = GIVEN[name]
    encoder = Encoder([3.0, 4.0], precision="signs")
    grown = b"".join(map(encoder.add, FRAMES, given)) + encoder.finish()
    data = isocodec.encode(Frames(FRAMES, times=given), [3.0, 4.0], precision="signs")
    path = tmp_path / "run.iso"
    path.write_bytes(data)
    files = [file := isocodec.open(path), isocodec.open(grown)]
    if name in ("uneven", "datetime"):
        points = np.argwhere(np.ones((9, 9)))
        on_mesh = isocodec.encode(Mesh(points, None, np.reshape(FRAMES, (COUNT, -1)), times=given), [3.0, 4.0])
        other = isocodec.encode(Frames(FRAMES, times=given), 2.0, precision="signs")
        changes: Any = ({"isovalues": [3.0]}, {"window": [(2, 8), (0, 8)]}, {"precision": 0.5}, {"profile": "baseline"})
        made = [on_mesh, isocodec.merge([data, other]), isocodec.open(on_mesh).edited(isovalues=[3.0])]
        files += map(isocodec.open, made + [file.edited(**change) for change in changes])
    for each in files:
        assert each.times.dtype.kind == wanted.dtype.kind and (each.times == wanted).all()
        assert [frame.time for frame in each.info.frames] == texts and "time" not in each.metadata
        assert [each.contour(frame=number).metadata["time"] for number in (0, 2)] == texts[::2]
        assert [one[0].metadata["time"] for one in each.each_frame()] == texts
        for number, one in enumerate(given):
            assert each.frame_at(one) == each.frame_at(texts[number]) == number
    step = np.timedelta64(1, "m") if wanted.dtype.kind == "M" else 1e-3
    for number in range(COUNT - 1):
        middle = wanted[number] + (wanted[number + 1] - wanted[number]) / 2
        nearer = step if wanted[number + 1] > wanted[number] else -step
        if name != "uneven" or number < 2:
            assert (file.frame_at(middle - nearer), file.frame_at(middle + nearer)) == (number, number + 1)
    shorter = isocodec.open(file.edited(size=len(data) // 2))
    assert [frame.time for frame in shorter.info.frames] == texts[: len(shorter.info.frames)]
    if name in ("uneven", "datetime"):
        assert [frame["time"] for frame in json.loads(ok("info", path, "--json"))["frames"]] == texts
        assert all(text in ok("info", path) for text in texts)


@looped("time", [float("nan"), float("inf"), True, "now", "", "12 ", "1e999", "2024-02-30", "NaT", np.datetime64("NaT"),
                 b"1", None, [1], "3s"])
def test_no_times(time: Any):
    if time is not None:
        with pytest.raises(OptionError, match="neither"):
            Encoder(3.0).add(FRAMES[0], time)
    file = isocodec.open(isocodec.encode(Frames(FRAMES, times=[0, 1, 2, 3]), 3.0))
    with pytest.raises(OptionError, match="neither"):
        file.frame_at(time)


@looped("first, second", [(0, None), (None, 0), (0, "1 s"), ("0 s", "1 min"), (0, date(2024, 1, 1))])
def test_times_of_other_kinds(first: Any, second: Any):
    encoder = Encoder(3.0)
    data = encoder.add(FRAMES[0], first)
    with pytest.raises(InputError, match="frame 1 has"):
        encoder.add(FRAMES[1], second)
    data += encoder.add(FRAMES[1], first) + encoder.finish()
    file = isocodec.open(data)
    assert file.frames == 2
    if first is None:
        assert file.times is None and "time" not in file.contour(frame=1).metadata
        with pytest.raises(OptionError, match="does not state"):
            file.frame_at(0)
    with pytest.raises(InputError, match="times for"):
        isocodec.encode(Frames(FRAMES, times=[0, 1]), 3.0)
    with pytest.raises(InputError, match="times for"):
        isocodec.encode(Frames(FRAMES[:1], times=[0, 1]), 3.0)
    with pytest.raises(InputError, match="times"):
        isocodec.merge([isocodec.encode(Frames(FRAMES[:1], times=[one]), level) for one, level in ((0, 3.0), (1, 4.0))])


def test_dates_and_numbers_are_not_compared():
    for times, other in ((GIVEN["even"][0], "2024-01-01"), (GIVEN["texts"][0], 1.5)):
        with pytest.raises(OptionError, match="cannot be compared"):
            isocodec.open(isocodec.encode(Frames(FRAMES, times=times), 3.0)).frame_at(other)
    with pytest.raises(OptionError, match="does not state"):
        isocodec.open(isocodec.encode(FRAMES[0], 3.0)).frame_at(0)
