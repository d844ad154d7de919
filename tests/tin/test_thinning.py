"""Adaptive thinning: the published example, brute force, and what users see of it."""

from __future__ import annotations

import numpy as np
import pytest

import isocodec
from commands import fails
from isocodec.errors import InputError, OptionError
from tables import looped

LINE = np.array([(i, 0) for i in range(1, 8)] + [(1, 1)])
VALUES = np.array([5, -1, 0, -3, 0, -1.1, 2.5, 0])
EXAMPLE = {
    "inf": [(3, 2.00), (5, 2.05), (4, 1.95), (6, 3.40)],
    "AT1": [(3, 2.00), (5, 2.05), (6, 1.77), (2, 3.33)],
    "AT2": [(3, 2.00), (5, 2.05), (6, 1.77), (2, 3.33)],
    "AT3": [(3, 2.00), (5, 2.05), (6, 1.77), (2, 3.33)],
    "l2": [(3, 4.00), (4, 3.56), (5, -1.55), (6, 15.26)],
}
"""Points (counted from 1) and anticipated errors: worked out with a triangulation by another library at every step."""
CRITERIA = [*EXAMPLE, "NAT"]


def terrain(count: int = 400, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Scattered points of a smooth surface with a cliff."""
    rng = np.random.default_rng(seed)
    points = np.unique(rng.integers(0, 200, (count, 2)), axis=0)
    x, y = points.T / 40
    return points, np.rint(100 * (np.sin(x) + np.cos(1.3 * y) + (x > 2.5)))


def interpolated(tin: isocodec.Tin, points: np.ndarray) -> np.ndarray:
    """The surface at points, by another library's barycentric weights on our triangles."""
    from matplotlib.tri import LinearTriInterpolator, Triangulation

    x, y = tin.points.T
    return np.asarray(LinearTriInterpolator(Triangulation(x, y, tin.triangles), tin.values)(*points.T))


@looped("criterion", EXAMPLE)
def test_published_example(criterion: str):
    found = isocodec.thin(isocodec.Mesh(LINE, None, VALUES), criterion=criterion, to=4)
    assert (found.order[:4] + 1).tolist() == [point for point, _ in EXAMPLE[criterion]]
    assert found.anticipated[:4].round(2).tolist() == [error for _, error in EXAMPLE[criterion]]


@looped("criterion", CRITERIA)
def test_errors_are_those_of_the_surface(criterion: str):
    points, values = terrain()
    found = isocodec.thin(isocodec.Mesh(points, None, values), criterion=criterion, to=40)
    for count in (40, 100, 250):
        tin = found.at(count)
        missed = np.abs(interpolated(tin, points) - values)
        at = len(points) - count - 1
        assert found.errors[at] == pytest.approx(missed.max(), abs=1e-9)


@pytest.mark.heavy
def test_keys_are_what_brute_force_finds():
    """AT1, AT2 and l2 take the vertex with the least of what any removal would lead to, from scratch each time."""
    points, values = terrain(60)
    for criterion in ("AT2", "l2"):
        found = isocodec.thin(isocodec.Mesh(points, None, values), criterion=criterion, to=30)
        left = np.arange(len(points))
        before = 0.0
        for step in range(25):
            costs = {}
            for v in left.tolist():
                some = left[left != v]
                tin = isocodec.thin(
                    isocodec.Mesh(points[some], None, values[some]), criterion="AT1", to=len(some),
                )
                missed = np.ma.masked_invalid(interpolated(tin, points)) - values
                if np.ma.is_masked(missed):
                    continue  # a corner of the hull: without it, not all points are covered
                costs[v] = abs(missed[v]) if criterion == "AT2" else float((missed**2).sum()) - before
            best = min(costs.values())
            assert found.anticipated[step] == pytest.approx(best, abs=1e-6)
            v = int(found.order[step])
            assert costs[v] == pytest.approx(best, abs=1e-6)
            left = left[left != v]
            tin = isocodec.thin(isocodec.Mesh(points[left], None, values[left]), criterion="AT1", to=len(left))
            before = float(((interpolated(tin, points) - values) ** 2).sum())


@looped("criterion", CRITERIA)
def test_order_of_points_does_not_matter(criterion: str):
    points, values = terrain()
    mixed = np.random.default_rng(3).permutation(len(points))
    first = isocodec.thin(isocodec.Mesh(points, None, values), criterion=criterion, to=30)
    second = isocodec.thin(isocodec.Mesh(points[mixed], None, values[mixed]), criterion=criterion, to=30)
    assert np.array_equal(first.order, mixed[second.order])
    assert np.array_equal(first.errors, second.errors)
    assert np.array_equal(first.points[first.triangles], second.points[second.triangles])


@looped("criterion", CRITERIA)
def test_error_is_kept(criterion: str):
    points, values = terrain()
    found = isocodec.thin(isocodec.Mesh(points, None, values), criterion=criterion, error=6)
    missed = np.abs(interpolated(found, points) - values)
    assert missed.max() <= 6 + 1e-9
    assert len(found) < len(points)


def test_a_field_and_its_samples_are_alike():
    y, x = np.mgrid[:24, :31]
    field = np.hypot(y - 10.0, x - 12.0)
    found = isocodec.thin(field, criterion="l2", to=60)
    same = isocodec.thin(isocodec.Mesh(np.argwhere(np.ones(field.shape)), None, field.ravel()), criterion="l2", to=60)
    assert np.array_equal(found.order, same.order)
    # the border is straight: only its corners have to stay
    assert np.isin([0, 30, 23 * 31, 24 * 31 - 1], found.kept).all()


def test_a_plane_needs_its_corners_only():
    y, x = np.mgrid[:20, :20]
    found = isocodec.thin(3 * x - 2 * y + 7, criterion="AT1", error=0)
    assert found.kept.tolist() == [0, 19, 380, 399]


def test_points_that_coincide():
    points = np.array([(0, 0), (9, 0), (0, 9), (9, 9), (4, 4), (4, 4), (4, 4)])
    found = isocodec.thin(isocodec.Mesh(points, None, np.array([0, 0, 0, 0, 1.0, 2.0, 6.0])), criterion="AT1", to=5)
    assert found.merged == 2
    assert found.kept.tolist() == [0, 1, 2, 3, 4]
    assert sorted(found.values.tolist()) == [0, 0, 0, 0, 3.0]


def test_floating_point_positions():
    """Those that a fine grid holds stay as they are; others are rounded to a part in 2**24 of the extent."""
    rng = np.random.default_rng(0)
    exact = rng.integers(0, 1 << 20, (50, 2)) / 1024 + 500000
    assert np.isin(
        isocodec.thin(isocodec.Mesh(exact, None, np.zeros(50)), criterion="AT1", to=50).points, exact,
    ).all()
    rough = rng.normal(size=(50, 2)) * 1e-9
    tin = isocodec.thin(isocodec.Mesh(rough, None, np.zeros(50)), criterion="AT1", to=50)
    found = tin.points[np.lexsort(tin.points.T)]
    assert np.abs(found - rough[np.lexsort(rough.T)]).max() < np.ptp(rough) / 2**23


@looped(
    ("points", "values", "code"),
    [
        (LINE[:7], VALUES[:7], "collinear"),
        (LINE[:2], VALUES[:2], "points"),
        (LINE[:0], VALUES[:0], "points"),
        (LINE, np.full(8, np.nan), "missing"),
        (np.full((8, 2), np.inf), VALUES, "missing"),
        (LINE[:, :1], VALUES, "shape"),
        (LINE, VALUES[:3], "shape"),
        (LINE, VALUES.astype(str), "dtype"),
        (LINE * 2**40, VALUES, "range"),
        (np.zeros((3, 3, 3)), None, "axes"),
    ],
)
def test_input_that_cannot_be_thinned(points: np.ndarray, values: np.ndarray | None, code: str):
    with pytest.raises(InputError) as caught, np.errstate(all="ignore"):
        isocodec.thin(points if values is None else isocodec.Mesh(points, None, values), criterion="AT1", to=3)
    assert caught.value.code == code


@looped(
    "options", [{}, {"to": 5, "error": 1.0}, {"to": 2}, {"error": -1.0}, {"error": np.nan}, {"to": 4, "criterion": "X"}]
)
def test_options_that_make_no_sense(options: dict):
    with pytest.raises(OptionError):
        isocodec.thin(isocodec.Mesh(LINE, None, VALUES), **{"criterion": "AT1", **options})


def test_surfaces_that_there_are():
    found = isocodec.thin(isocodec.Mesh(LINE, None, VALUES), criterion="AT1", to=4)
    assert len(found.at(8).points) == 8
    for count in (3, 9, 4.5):
        with pytest.raises(OptionError):
            found.at(count)  # type: ignore[arg-type]


# ---- Command line ---------------------------------------------------------------------------------------------------


@pytest.mark.cover(2)
@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("told", ["nan", "mask", "masked array"])
def test_numbers_of_points_are_those_of_samples(criterion: str, told: str):
    """Whichever are missing, and however that is told."""
    y, x = np.mgrid[:9, :11]
    field = np.hypot(y - 3.3, 2 * x - 7.1)
    gone = (x + 2 * y) % 5 == 0
    gone[0, 0] = True
    given = {
        "nan": np.where(gone, np.nan, field), "mask": isocodec.Field(field, mask=gone),
        "masked array": np.ma.array(field, mask=gone),
    }[told]
    found = isocodec.thin(given, criterion=criterion, to=20)
    there = np.flatnonzero(~gone)
    assert sorted([*found.order.tolist(), *found.kept.tolist()]) == there.tolist()
    assert np.array_equal(found.values, field[tuple(found.points.astype(int).T)])
    assert np.array_equal(np.sort(np.ravel_multi_index(found.points.astype(int).T, field.shape)), found.kept)
    alone = isocodec.thin(isocodec.Mesh(np.argwhere(~gone), None, field[~gone]), criterion=criterion, to=20)
    assert np.array_equal(found.order, there[alone.order]) and np.array_equal(found.errors, alone.errors)


@pytest.mark.parametrize("distance", ["1", "10m", "abc"])
def test_contours_of_points_are_not_kept_by_thinning(tmp_path, distance: str):
    points, values = terrain()
    np.savetxt(tmp_path / "points.csv", np.c_[points, values], delimiter=",", header="x,y,z", comments="")
    line = fails(2, "thin", tmp_path / "points.csv", "-o", tmp_path / "a.iso", "--isovalue", 50.5,
                 "--tolerance", distance)
    assert "of a field only" in line and "--precision" in line


def triangulated(points: np.ndarray) -> set[tuple[int, ...]]:
    """The Delaunay triangles of points without ties, by another library."""
    from scipy.spatial import Delaunay

    return {tuple(sorted(cell)) for cell in Delaunay(points).simplices.tolist()}


@looped("layers", [1, 4])
@looped("criterion", CRITERIA)
def test_points_of_any_criterion_can_be_coded(criterion: str, layers: int):
    """The file has the points that are left and what they had, and another library's triangles of these."""
    rng = np.random.default_rng(8)
    points = rng.integers(0, 10**6, (300, 2)).astype(float)
    values = np.rint(100 * np.sin(points[:, 0] / 2e5) + (points[:, 1] > 4e5) * 50)
    kept = isocodec.thin(isocodec.Mesh(points, None, values), criterion=criterion, to=70).kept
    tin = isocodec.thin(isocodec.Mesh(points, None, values), criterion=criterion, to=70, layers=layers)
    assert np.array_equal(tin.kept, kept) and len(tin.order) == 230
    read = isocodec.open(isocodec.encode(tin)).surface()
    found, heights, cells = read.points, read.values, read.triangles
    wanted = np.c_[points[kept], values[kept]]
    have = np.c_[found, heights]
    assert np.array_equal(have[np.lexsort(have.T)], wanted[np.lexsort(wanted.T)])
    assert {tuple(sorted(cell)) for cell in cells.tolist()} == triangulated(found)


def test_values_in_steps_of_points_of_a_criterion(tmp_path):
    points, values = terrain()
    given = isocodec.Mesh(points, None, values + 0.3)
    tin = isocodec.thin(given, criterion="AT2", to=60, step=0.5)
    file = isocodec.open(isocodec.encode(tin)).surface()
    assert np.array_equal(file.values, tin.values)
    plain = isocodec.thin(given, criterion="AT2", to=60)
    assert 0 < np.abs(tin.values - plain.values).max() <= 0.25 or np.array_equal(tin.values, plain.values)
    for options in ({"size": 500}, {"layers": 0}, {"layers": 65}, {"step": 0.0}, {"contours": [3]}):
        with pytest.raises(OptionError):
            isocodec.thin(given, criterion="AT2", **({"to": 60} | options))
    np.save(tmp_path / "f.npy", np.hypot(*np.mgrid[:9, :9]))
    line = fails(2, "thin", tmp_path / "f.npy", "-o", tmp_path / "a.iso", "--criterion", "l2", "--size", 300)
    assert "a criterion and size cannot be combined" in line
