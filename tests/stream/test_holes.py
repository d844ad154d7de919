"""Missing samples: curves and surfaces end at unit cells with a missing corner; the mask is a strand of its own."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import isocodec
from commands import HILLS
from isocodec.errors import InputError
from libraries import Late
from tables import looped

shapely = Late("shapely")
cKDTree = Late("scipy.spatial.cKDTree")
find_contours = Late("skimage.measure.find_contours")

FLOATS = HILLS.astype(np.float64) + 0.3 * np.sin(np.arange(HILLS.size)).reshape(HILLS.shape)
HOLE = np.zeros(HILLS.shape, np.bool_)
HOLE[8:14, 10:20] = HOLE[0, 0] = HOLE[30:, 38:] = HOLE[20, 5] = True


def close(ours: np.ndarray, theirs: np.ndarray, within: float) -> bool:
    """Whether two sets of points are the same."""
    if not len(ours) or not len(theirs):
        return len(ours) == len(theirs)
    there, back = cKDTree(theirs).query(ours)[0].max(), cKDTree(ours).query(theirs)[0].max()
    return bool(max(there, back) <= within)


def crossings_of_whole_cells(field: np.ndarray, gone: np.ndarray, isovalue: float) -> np.ndarray:
    """Points on all grid edges that some unit cell without missing corners has, by brute force."""
    n = field.ndim
    missing = np.zeros([s - 1 for s in field.shape], bool)
    for corner in product((0, 1), repeat=n):
        missing |= gone[tuple(slice(c, c + s - 1) for c, s in zip(corner, field.shape, strict=True))]
    points = []
    for axis in range(n):
        for low in np.argwhere(np.ones([s - (a == axis) for a, s in enumerate(field.shape)])):
            high = low + (np.arange(n) == axis)
            beside = [low - np.array(step) for step in product((0, 1), repeat=n) if step[axis] == 0]
            inside = [c for c in beside if (c >= 0).all() and (c < missing.shape).all()]
            if all(missing[tuple(c)] for c in inside):
                continue
            a, b = field[tuple(low)], field[tuple(high)]
            if (a > isovalue) != (b > isovalue):
                points.append(low + (isovalue - a) / (b - a) * (high - low))
    return np.array(points).reshape(-1, n)


def blobs(shape: tuple[int, ...], seed: int, share: float) -> tuple[np.ndarray, np.ndarray]:
    """A rough field, and some of its samples."""
    rng = np.random.default_rng(seed)
    waves = [np.sin(rng.uniform(0.2, 1.5) * g + rng.uniform(0, 6)) for g in np.indices(shape)]
    field = sum(waves) + rng.normal(0, 0.3, shape)
    return field, rng.random(shape) < share


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(st.integers(2, 20), st.integers(2, 20)),
    st.integers(0, 1000),
    st.sampled_from([0.02, 0.2, 0.6]),
    st.sampled_from([None, 0, 2, 3]),
)
def test_random_masks_in_the_plane(shape: tuple[int, int], seed: int, share: float, base: int | None) -> None:
    field, gone = blobs(shape, seed, share)
    if gone.all():
        return
    field[gone] = np.nan
    base = None if base is None else min(base, 2 * (max(shape) - 2).bit_length())
    data = isocodec.encode(field, 0.1, precision="step=1e-7", layers=base, profile="baseline")
    theirs = find_contours(field, 0.1)
    assert close(isocodec.decode(data).points, np.concatenate(theirs) if theirs else np.zeros((0, 2)), 1e-5)
    assert np.array_equal(isocodec.open(data).valid(), ~gone)
    assert np.array_equal(isocodec.open(data).above()[~gone], field[~gone] > 0.1)


@settings(max_examples=12, deadline=None)
@given(
    st.tuples(*[st.integers(2, 8)] * 3),
    st.integers(0, 1000),
    st.sampled_from([0.02, 0.1, 0.4]),
    st.sampled_from(["baseline", "main"]),
)
def test_random_masks_in_space(shape: tuple[int, int, int], seed: int, share: float, profile: str) -> None:
    field, gone = blobs(shape, seed, share)
    if gone.all():
        return
    data = isocodec.encode(isocodec.Field(field, mask=gone), 0.1, precision="step=1e-7", profile=profile)
    contour = isocodec.decode(data)
    # without those in the middles of cells
    on_edges = (np.abs(contour.points - np.rint(contour.points)) > 1e-9).sum(axis=1) <= 1
    assert close(contour.points[on_edges], crossings_of_whole_cells(field, gone, 0.1), 1e-5)
    assert np.array_equal(isocodec.open(data).valid(), ~gone)


def test_masked_arrays_masks_and_nan_are_the_same() -> None:
    """A mask counts besides NaN; what lies under it does not matter."""
    data = isocodec.encode(np.where(HOLE, np.nan, FLOATS), 80.5)
    assert isocodec.encode(np.ma.masked_array(FLOATS, HOLE), 80.5) == data
    assert isocodec.encode(isocodec.Field(np.where(HOLE, 1e30, FLOATS), mask=HOLE), 80.5) == data
    part = np.where(HOLE & (np.arange(HILLS.shape[1]) < 15), np.nan, FLOATS)
    assert isocodec.encode(isocodec.Field(part, mask=HOLE), 80.5) == data


@pytest.mark.parametrize("mask", [HOLE[1:], HOLE.astype(int), np.zeros((3, 3, 3), bool)])
def test_masks_of_another_shape_or_type(mask: np.ndarray) -> None:
    with pytest.raises(InputError, match="the mask has") as caught:
        isocodec.encode(isocodec.Field(HILLS, mask=mask), 80.5)
    assert caught.value.code == "mask"


def test_areas_are_not_closed_along_holes() -> None:
    data = isocodec.encode(isocodec.Field(FLOATS, mask=HOLE), 80.5)
    with pytest.raises(isocodec.errors.OptionError, match="samples are missing"):
        isocodec.decode(data).areas()
    with pytest.raises(isocodec.errors.OptionError, match="valid has shape"):
        isocodec.decode(data, through_holes=True).areas(valid=np.ones((3, 3), bool))


@pytest.mark.parametrize("options", [{}, {"precision": "exact"}, {"precision": "signs"}, {"precision": 1.0}])
def test_areas_closed_along_holes(options: dict[str, object]) -> None:
    """Both sides together are the whole cells, and valid samples lie in the area of their side."""
    shapely = pytest.importorskip("shapely")
    data = isocodec.encode(isocodec.Field(HILLS, mask=HOLE), 80.5, **options)
    contour, valid = isocodec.decode(data, through_holes=True), isocodec.open(data).valid()
    sides = [shapely.geometry.shape(contour.areas(above=side, valid=valid)) for side in (True, False)]
    whole = valid[:-1, :-1] & valid[1:, :-1] & valid[:-1, 1:] & valid[1:, 1:]
    assert sides[0].area + sides[1].area == pytest.approx(whole.sum())
    assert sides[0].intersection(sides[1]).area == pytest.approx(0, abs=1e-9)
    middles = np.argwhere(~whole) + 0.5
    for side in sides:
        assert not shapely.intersects(side, shapely.points(middles[:, 1], middles[:, 0])).any()
    # a sample on no whole cell lies in neither
    seen = np.zeros(HILLS.shape, np.bool_)
    for i, j in np.argwhere(whole):
        seen[i : i + 2, j : j + 2] = True
    if options.get("precision") != 1.0:
        here = np.argwhere(seen)
        inside = shapely.intersects(sides[0].buffer(1e-9), shapely.points(here[:, 1], here[:, 0]))
        assert np.array_equal(inside, HILLS[seen] > 80.5)


@looped("options", [
    {"precision": 0.5}, {"precision": 1.0, "keep_topology": True}, {"precision": (2.0, 0.5)},
    {"layers": "distortion=0.5"},
])
@looped("n", [2, 3])
def test_promises_hold_for_what_is_left(options: dict[str, object], n: int) -> None:
    """Distances both ways, between the curves as they end at holes."""
    field = FLOATS if n == 2 else FLOATS[::4, ::4, None] + 6.0 * np.arange(8)
    gone = HOLE if n == 2 else np.random.default_rng(3).random(field.shape) < 0.02
    contour = isocodec.decode(isocodec.encode(isocodec.Field(field, mask=gone), 100.5, **options))  # type: ignore[arg-type]
    whole = isocodec.decode(isocodec.encode(isocodec.Field(field, mask=gone), 100.5, precision="step=1e-7"))
    tolerance = 1.0 if options.get("precision") == 1.0 else 0.5
    assert_within(contour, whole, tolerance + 1e-6)
    middles = contour.points[contour.cells].mean(axis=1)
    cell = np.floor(middles).astype(int)
    for corner in product((0, 1), repeat=n):
        place = np.minimum(cell + corner, np.array(field.shape) - 1)
        inner = (middles != cell).all(axis=1)
        assert not gone[tuple(place[inner].T)].any()


def assert_within(one: isocodec.Contour, other: isocodec.Contour, tolerance: float) -> None:
    from isocodec.search.proof import Target

    for a, b in ((one, other), (other, one)):
        assert not len(Target(a.points, a.cells, tolerance).exceeded(b.points, b.cells).places)


def test_truncated_files_keep_their_mask() -> None:
    data = isocodec.encode(np.where(HOLE, np.nan, FLOATS), 80.5, layers=0)
    for kept in (isocodec.open(data).edited(layers=9), isocodec.open(data).edited(size=len(data) - 40)):
        assert isocodec.open(kept).info.mask_bytes == isocodec.open(data).info.mask_bytes
        assert np.array_equal(isocodec.open(kept).valid(), ~HOLE)


@pytest.mark.parametrize("seed", [0, 4, 20, 22])
def test_pieces_that_are_cut_lie_on_the_curve_through_holes(seed: int) -> None:
    """Of coarse meshes, whose segments lie in many unit cells: parts of one are joined, parts of two are not."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:40, :44]
    field = np.hypot(rows - 20 - rng.random(), columns - 21 - rng.random())
    holed = np.ma.masked_array(field, rng.random(field.shape) < 0.02)
    for distance in (1.0, 3.0):
        file = isocodec.open(isocodec.encode(holed, 12.2, precision=distance))
        cut, whole = file.contour(), file.contour(through_holes=True)
        middles = cut.points[cut.cells].mean(axis=1)
        curve = shapely.multilinestrings(whole.points[whole.cells])
        assert shapely.distance(shapely.points(middles), curve).max() < 1e-6
