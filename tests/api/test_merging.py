"""Windows of one grid in one file, and frames one after the other: held against the field, and the files by shapely."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import ok
from files import picture
from isocodec import Field, Frames, IsoFile, Mesh
from isocodec.errors import InputError, IsoError, LimitError, OptionError
from isocodec.field.placement import Placement
from libraries import Late
from tables import looped

shapely = Late("shapely")

PLANE = np.rint(100 * picture((41, 53), 5)).astype(np.int64)
SPACE = np.rint(10 * np.sqrt(((np.mgrid[:11, :9, :10] - 4.3) ** 2).sum(axis=0))).astype(np.int64)
VALUES = {2: (50.5, 60.5), 3: (31.5, 45.5)}
PLACES: dict[str, Any] = {
    "indices": None, "down": [[0, 30, 5e5], [-30, 0, 4e6]], "up": [[0, 0.1, 7.3], [0.1, 0, 51.7]],
    "turned": [[3.0, 20.0, 500.0], [-7.0, 1.0, -40.0]],
}
CUTS: dict[str, list[tuple[slice, slice]]] = {
    "two": [(slice(0, 41), slice(0, 21)), (slice(0, 41), slice(20, 53))],
    "four": [*product((slice(0, 19), slice(18, 41)), (slice(0, 31), slice(30, 53)))],
    "corner": [(slice(0, 19), slice(0, 31)), (slice(0, 19), slice(30, 53)), (slice(18, 41), slice(30, 53))],
    "deep": [(slice(0, 41), slice(0, 29)), (slice(0, 41), slice(20, 53))],
    "odd": [(slice(0, 36), slice(0, 31)), (slice(5, 41), slice(7, 53))],
}
PRECISIONS: list[Any] = ["exact", "signs", None, 0.2, "step=0.7", "4,1,exact"]


def placed(values: Any, start: tuple[int, ...], place: Any) -> Field:
    """A window of a field that begins at a sample of the whole one."""
    n = values.ndim
    if place is None:
        matrix = np.column_stack([np.eye(n)[::-1] if n == 2 else np.eye(n), np.zeros(n)])
    else:
        matrix = np.array(place, np.float64)
    matrix = np.column_stack([matrix[:, :n], matrix[:, n] + matrix[:, :n] @ start])
    return Field(values, placement=Placement(matrix, crs=None if place is None else "EPSG:32631"))


def segments(contours: list[isocodec.Contour], starts: Any = ((0, 0, 0),)) -> set[Any]:
    """Cells by where their corners lie, wherever they are stored, in samples of the whole field."""
    out = set()
    for contour, start in zip(contours, starts, strict=True):
        corners = (contour.points + np.array(start)[: contour.n]).round(9)[contour.cells].tolist()
        out |= {frozenset(map(tuple, cell)) for cell in corners}
    return out


@pytest.mark.cover(2)
@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("precision", PRECISIONS, ids=str)
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", ["grid", "series", "tiles", "edited"])
@pytest.mark.parametrize("holes", [False, True])
def test_windows_of_one_grid(cut: str, precision: Any, place: str, kind: str, holes: bool, tmp_path: Any) -> None:
    field: Any = PLANE * 1.0 if precision == "step=0.7" else PLANE
    mask = np.zeros(field.shape, np.bool_)
    mask[15:22, 25:33], mask[3, 40] = holes, holes
    field = np.ma.masked_array(field, mask=mask) if holes else field
    if kind == "tiles" and "," in str(precision):
        return
    if kind == "edited" and cut == "odd":  # edit rounds starts down
        return
    files: list[IsoFile] = []
    whole = isocodec.open(isocodec.encode(placed(field, (0, 0), PLACES[place]), VALUES[2], precision=precision))
    for number, window in enumerate(CUTS[cut]):
        one = placed(field[window], tuple(span.start for span in window), PLACES[place])
        if kind == "tiles":
            isocodec.save(tmp_path / f"{number}.iso", one, VALUES[2], tile=32, precision=precision)
            files.append(isocodec.open(tmp_path / f"{number}.iso"))
            continue
        what = Frames([one, Field(field[window] + 3, placement=one.placement)]) if kind == "series" else one
        files.append(isocodec.open(
            whole.edited(window=[(span.start, span.stop - 1) for span in window]) if kind == "edited"
            else isocodec.encode(what, VALUES[2], precision=precision)
        ))
    # in whatever order they come
    merged = isocodec.open(isocodec.merge([file.data for file in files[::-1]]))
    starts = [tuple(span.start for span in window) for window in CUTS[cut]]
    low = np.min(starts, axis=0)
    assert merged.shape == tuple(np.max([[s.stop for s in window] for window in CUTS[cut]], axis=0) - low)
    assert merged.frames == (2 if kind == "series" else 1)
    valid = np.zeros(field.shape, np.bool_)
    for window in CUTS[cut]:
        valid[window] = ~mask[window]
    inside = tuple(slice(a, a + size) for a, size in zip(low, merged.shape, strict=True))
    assert (merged.valid() == valid[inside]).all()
    if place != "indices":
        assert merged.placement is not None
        (found,) = merged.placement.place(np.array([[2.0, 5.0]]))
        assert found == pytest.approx(np.array(PLACES[place]) @ [2 + low[0], 5 + low[1], 1])
    for value, frame in product(VALUES[2], range(merged.frames)):
        above = np.ma.getdata(field) + 3 * frame > value
        assert (merged.above(value, frame=frame) == above[inside])[valid[inside]].all()
        found = segments([merged.contour(value, frame=frame)], [low])
        wanted = segments([file.contour(value, frame=frame) for file in files], starts)
        if precision != 0.2:
            assert found == wanted and found
            continue
        # cells that touch a shared edge may end where the other file has them, and there alone
        corners = {point for cell in found for point in cell}
        assert len(found) >= len(wanted & found) > 0.8 * len(found)
        assert corners <= {point for cell in wanted for point in cell}
    if precision in ("exact", "signs") and kind == "grid" and cut in ("two", "four", "deep") and place == "down":
        assert merged.data == whole.data


@looped("cut, place, kind", [
    *product(["two", "deep"], ["down"], ["grid", "series", "tiles"]), ("four", "turned", "grid"),
    ("corner", "turned", "series"), ("odd", "turned", "grid"), ("four", "turned", "tiles"),
])
def test_windows_of_labels(cut: str, place: str, kind: str, tmp_path: Any) -> None:
    """Each window has its own labels, one of them a hole; the whole has all labels, names and types."""
    frames = [PLANE // 400 % 4 * 7 + shift for shift in (0, 7)][: 2 if kind == "series" else 1]
    mask = np.zeros(PLANE.shape, np.bool_)
    mask[15:22, 25:33] = True
    files = []
    for window in CUTS[cut]:
        each = [placed(np.ma.masked_array(values[window], mask[window]).astype(np.int32),
                       tuple(span.start for span in window), PLACES[place]) for values in frames]
        names = {f"label {label}": f"class {label}" for label in np.unique(frames)}
        there = {*np.unique([values[window][~mask[window]] for values in frames]).tolist()} - {0}
        each = [replace(one, labels=[*there], notes=names) for one in each]
        if kind == "tiles":
            isocodec.save(tmp_path / "a.iso", each[0], tile=32)
        else:
            isocodec.save(tmp_path / "a.iso", Frames(each, times=[3, 8]) if kind == "series" else each[0])
        files.append((tmp_path / "a.iso").read_bytes())
    merged = isocodec.open(isocodec.merge(files))
    valid = np.zeros(PLANE.shape, np.bool_)
    for window in CUTS[cut]:
        valid[window] = ~mask[window]
    assert np.array_equal(merged.valid(), valid) and {*merged.isovalues} == {*np.unique(frames)} - {0}
    assert all(merged.metadata[f"label {each:g}"] == f"class {each:g}" for each in merged.isovalues)
    assert [*([] if merged.times is None else merged.times)] == [3, 8] * (kind == "series")
    low = np.min([[span.start for span in window] for window in CUTS[cut]], axis=0)
    assert merged.placement is not None and merged.crs == "EPSG:32631"
    (found,) = merged.placement.place(np.array([[2.0, 5.0]]) - low)
    assert found == pytest.approx(np.array(PLACES[place]) @ [2, 5, 1])
    for frame, values in enumerate(frames):
        found = merged.labels(frame=frame)
        assert found.dtype == np.int32 and np.array_equal(found[valid], values[valid])
    other = placed(frames[0][CUTS[cut][0]] + 7, tuple(span.start for span in CUTS[cut][0]), PLACES[place])
    with pytest.raises(InputError, match="frames" if kind == "series" else "labels at sample|missing samples"):
        isocodec.merge([*files[1:], isocodec.encode(replace(other, labels="all"))])


def test_seams_join_and_promises_hold() -> None:
    """No line ends at a seam, and the distance that is promised is kept, verified by the field."""
    files = [isocodec.encode(placed(PLANE[w], tuple(s.start for s in w), PLACES["down"]), 50.5, precision=0.2)
             for w in CUTS["four"]]
    merged = isocodec.open(isocodec.merge(files))
    contour = merged.contour()
    counts = np.bincount(contour.cells.ravel(), minlength=len(contour.points))
    ends = contour.points[counts == 1]
    assert ((ends == 0) | (ends == np.array(merged.shape) - 1)).any(axis=1).all()
    (found,) = merged.verify(placed(PLANE, (0, 0), PLACES["down"]))
    assert found.kept and found.promised is not None and 0.2 <= found.promised < 0.2 + 2 / 3 + 1e-3
    lines = shapely.MultiLineString([line for data in files for line in isocodec.decode(data).to_shapely().geoms])
    assert shapely.hausdorff_distance(contour.to_shapely(), lines) <= 20  # two thirds of a cell of 30 m


@looped("axis", range(3))
@looped("precision", ["exact", "signs", None])
def test_windows_of_a_volume(axis: int, precision: Any) -> None:
    whole = isocodec.encode(placed(SPACE, (0, 0, 0), None), VALUES[3], precision=precision)
    spans: list[list[slice]] = [[slice(None)] * 3, [slice(None)] * 3]
    spans[0][axis], spans[1][axis] = slice(0, 5), slice(4, None)
    files = []
    for one in spans:
        start = tuple(span.start or 0 for span in one)
        files.append(isocodec.encode(placed(SPACE[tuple(one)], start, None), VALUES[3], precision=precision))
    merged = isocodec.open(isocodec.merge(files))
    for value in VALUES[3]:
        assert segments([merged.contour(value)]) == segments([isocodec.decode(whole, value)])


def window(
    rows: slice, columns: slice, values: tuple[float, ...] = (50.5,), precision: Any = None, change: Any = None,
    **more: Any,
) -> bytes:
    field = PLANE[rows, columns].copy()
    if change is not None:
        field[change] = 100 - field[change]
    one = placed(field, (rows.start, columns.start), PLACES["down"])
    return isocodec.encode(one, list(values), precision=precision, **more)


LEFT, RIGHT, ALL = slice(0, 21), slice(20, 53), slice(0, 41)
WRONG: list[tuple[str, list[bytes], type[IsoError]]] = [
    ("signs at 50.5 at sample (11, 20)", [window(ALL, LEFT), window(ALL, RIGHT, change=(11, 0))], InputError),
    ("values at 50.5 at sample", [window(ALL, LEFT, precision="exact"),
                                  isocodec.encode(placed(2 * PLANE[ALL, RIGHT] - 50, (0, 20), PLACES["down"]), 50.5,
                                                  precision="exact")], InputError),
    ("without sharing samples", [window(ALL, slice(0, 20)), window(ALL, RIGHT)], InputError),
    ("other diagonals", [window(ALL, LEFT), window(ALL, slice(19, 53))], InputError),
    ("differ in isovalues: 60.5", [window(ALL, LEFT), window(ALL, RIGHT, values=(50.5, 60.5))], InputError),
    ("another precision", [window(ALL, LEFT), window(ALL, RIGHT, precision="exact")], InputError),
    ("another precision", [window(ALL, LEFT, precision="signs"), window(ALL, RIGHT)], InputError),
    ("differs from the first in placement", [window(ALL, LEFT), isocodec.encode(
        Field(PLANE[ALL, RIGHT], placement=Placement([[0, 30, 500607.5], [-30, 0, 4e6]], crs="EPSG:32631")), 50.5)],
     InputError),
    ("differs from the first in placement", [window(ALL, LEFT), isocodec.encode(
        Field(PLANE[ALL, RIGHT], placement=Placement([[0, 30.01, 500600], [-30, 0, 4e6]], crs="EPSG:32631")), 50.5)],
     InputError),
    ("differs from the first in crs", [window(ALL, LEFT), isocodec.encode(
        Field(PLANE[ALL, RIGHT], placement=Placement([[0, 30, 500600], [-30, 0, 4e6]], crs="EPSG:32632")), 50.5)],
     InputError),
    ("missing samples at sample", [window(ALL, LEFT), isocodec.encode(
        Field(np.ma.masked_less(PLANE[ALL, RIGHT], 45), placement=placed(PLANE[ALL, RIGHT], (0, 20), PLACES["down"])
              .placement), 50.5)], InputError),
    ("reach every sample|coarser", [window(ALL, LEFT), window(ALL, RIGHT, layers="topology")], OptionError),
    ("more than the limit", [window(ALL, LEFT), isocodec.encode(
        placed(PLANE, (0, 1 << 27), PLACES["down"]), 50.5)], LimitError),
]


@pytest.mark.parametrize("number", range(len(WRONG)))
def test_windows_that_do_not_fit(number: int) -> None:
    message, files, error = WRONG[number]
    for some in (files, files[::-1]) if 2 <= number < 7 else (files,):
        with pytest.raises(error) as caught:
            isocodec.merge(some)
        assert any(part in str(caught.value) for part in message.split("|")), caught.value


# ---- Frames ---------------------------------------------------------------------------------------------------------


@cache
def frame(number: int) -> np.ndarray:
    return np.hypot(*(np.mgrid[:21, :19] - 9.3 - 0.9 * number)) + picture((21, 19), number)


@pytest.mark.cover(2)
@pytest.mark.parametrize("intervals", [(0, 0), (4, 4), (4, 0), (0, 4), (3, 5)], ids=str)
@pytest.mark.parametrize("counts", [(4, 4), (5, 6), (1, 3), (3, 0), (0, 3), (2, 1, 2)], ids=str)
@pytest.mark.parametrize("isovalues", [(5.0,), (5.0, 8.0)], ids=str)
@pytest.mark.parametrize("precision", [None, "step=0.01", "signs", 1.0], ids=str)
@pytest.mark.parametrize("profiles", [("main", "main"), ("main", "baseline"), ("baseline", "main")], ids=str)
def test_frames_one_after_the_other(
    intervals: tuple[int, int], counts: tuple[int, ...], isovalues: tuple[float, ...], precision: Any,
    profiles: tuple[str, str],
) -> None:
    """All points of all frames, which can be asked for one by one; 0 stands for a file of a single field."""
    if precision == 1.0 and (len(set(profiles)) > 1 or intervals not in ((0, 0), (4, 4)) or counts != (4, 4)):
        return  # what does not fit as it is must reach every sample
    files, done = [], 0
    for number, count in enumerate(counts):
        how: Any = {"precision": precision, "profile": profiles[min(number, 1)]}
        what: Any = frame(done)
        if count:
            what = Frames([frame(done + i) for i in range(count)])
            how["interval"] = intervals[min(number, 1)]
        files.append(isocodec.encode(what, list(isovalues), **how))
        done += max(count, 1)
    merged = isocodec.open(isocodec.merge(files))
    first = next(isocodec.open(file).info for file in files if isocodec.open(file).info.interval is not None)
    assert (merged.frames, merged.info.interval, merged.info.profile) == (done, first.interval, first.profile)
    wanted = [contours for file in files for contours in isocodec.open(file).each_frame()]
    for number, (found, those) in enumerate(zip(merged.each_frame(), wanted, strict=True)):
        for one, other in zip(found, those, strict=True):
            assert segments([one]) == segments([other])
            assert segments([merged.contour(one.isovalue, frame=number)]) == segments([other])


def test_frames_of_other_kinds(tmp_path: Any) -> None:
    points = np.random.default_rng(0).random((300, 2)) * 10
    values = [np.hypot(*(points - 5 - 0.3 * k).T) for k in range(6)]

    def on_mesh(some: list[np.ndarray], interval: int = 0) -> bytes:
        return isocodec.encode(Mesh(points, None, np.stack(some), stored="whole"), 3.0, interval=interval)

    made = isocodec.open(isocodec.merge([on_mesh(values[:3]), on_mesh(values[3:])]))
    whole = isocodec.open(on_mesh(values))
    for one, other in zip(made.each_frame(), whole.each_frame(), strict=True):
        assert segments(one) == segments(other)
    with pytest.raises(OptionError, match="a key frame is due within file 2"):
        isocodec.merge([on_mesh(values[:3], 2), on_mesh(values[3:], 2)])
    labels = [Field(PLANE // 40 % 3 + number % 2, labels=(1, 2)) for number in range(4)]
    made = isocodec.open(isocodec.merge([isocodec.encode(Frames(some)) for some in (labels[:1], labels[1:])]))
    for number, one in enumerate(labels):
        assert (made.labels(frame=number) == np.where(one.values > 2, 0, one.values)).all()
    with pytest.raises(InputError, match="shape"):
        isocodec.merge([isocodec.encode(Frames([one[:, :15], one]) if one is None else Frames([one]), 5.0)
                        for one in (frame(0), frame(1)[:, :15])])
    with pytest.raises(OptionError, match="in two of the files"):
        isocodec.merge([isocodec.encode(frame(0), 5.0)] * 2)


@pytest.mark.parametrize("interval", [0, 2, 16])
@pytest.mark.parametrize("profile", ["main", "baseline"])
def test_times_stay_however_frames_are_merged(profile: Any, interval: int) -> None:
    """Of series and of single frames, whose chunks are copied or which are coded again."""
    fields = [np.add.outer(np.sin(np.arange(20) / 4 + t), np.arange(24) / 20.0) for t in range(6)]
    series = [isocodec.encode(isocodec.Frames(fields[i : i + 2], times=[i, i + 1]), 0.5, interval=interval)
              for i in (0, 3)]
    single = [isocodec.encode(isocodec.Field(fields[i], notes={"time": str(i)}), 0.5, profile=profile) for i in (2, 5)]
    for order in ([series[0], single[0], series[1], single[1]], [single[0], series[1]]):
        merged = isocodec.open(isocodec.merge(order))
        first = 6 - merged.frames if merged.frames == 6 else 2
        assert merged.times is not None and [*merged.times] == [*range(first, first + merged.frames)]
        assert "time" not in merged.metadata


def test_commands(tmp_path: Any) -> None:
    for number, span in enumerate((LEFT, RIGHT)):
        (tmp_path / f"{number}.iso").write_bytes(window(ALL, span))
        (tmp_path / f"s{number}.iso").write_bytes(isocodec.encode(Frames([frame(number)] * 2), 5.0))
    ok("edit", tmp_path / "0.iso", tmp_path / "1.iso", "-o", tmp_path / "all.iso")
    assert isocodec.open(tmp_path / "all.iso").shape == PLANE.shape
    ok("edit", tmp_path / "s0.iso", tmp_path / "s1.iso", "-o", tmp_path / "s.iso")
    assert isocodec.open(tmp_path / "s.iso").frames == 4
