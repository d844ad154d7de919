"""Scattered points of which a file holds those next to contours alone: the curves of all points (docs/encoders.md)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from test_delaunay import by_definition

import isocodec
from brute import examples
from explicit_meshes import crossings
from files import fed
from home import ROOT
from isocodec import Contour, Encoder, Mesh
from isocodec.errors import InputError, OptionError
from isocodec.tin.rank import by_rank
from libraries import Late

matplotlib = Late("matplotlib")
Figure = Late("matplotlib.figure.Figure")
Delaunay = Late("scipy.spatial.Delaunay")
shapely = Late("shapely")

Triangles = set[frozenset[tuple[float, ...]]]
CIRCLE = [(x, y) for x in range(-25, 26) for y in range(-25, 26) if x * x + y * y == 625]
DEM = np.load(ROOT / "demo/data/jacksboro_fault_dem.npz")["values"].astype(float)


@st.composite
def lattices(draw: st.DrawFn) -> NDArray[np.int64]:
    """Distinct points with integer coordinates that do not all lie on a line; often many on a circle."""
    kind = draw(st.sampled_from(["tiny", "grid", "few places", "circles", "spread"]))
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    if kind == "tiny":
        points = rng.integers(0, 4, (draw(st.integers(3, 6)), 2))
    elif kind == "grid":
        points = np.argwhere(np.ones((draw(st.integers(2, 5)), draw(st.integers(2, 6)))))
    elif kind == "few places":
        points = rng.integers(0, 7, (22, 2))
    elif kind == "circles":
        points = np.concatenate([CIRCLE, 3 * np.array(CIRCLE[::3]), [[1, 0]]])
    else:
        points = rng.integers(0, 1000, (24, 2))
    points = np.unique(points * draw(st.sampled_from([1, 2, 3])) + rng.integers(-50, 50, 2), axis=0)
    if np.linalg.matrix_rank(points - points[0]) < 2:
        points = np.concatenate([points, points[:1] + np.array([[5, 1], [1, 7]])])
    return rng.permutation(np.unique(points, axis=0))


def values_at(points: NDArray[Any], seed: int) -> NDArray[np.int64]:
    """A slope, noise, or a single point above the others."""
    rng = np.random.default_rng(seed)
    if seed % 3 == 0:
        return np.asarray(points @ rng.integers(-3, 4, 2) + 50)
    if seed % 3 == 1:
        return rng.integers(0, 60, len(points))
    return np.where(np.arange(len(points)) == seed % len(points), 55, 5)


def crossed_in(data: bytes, number: int, points: NDArray[Any]) -> Triangles:
    """Triangles of a file that an isovalue crosses, by the given points nearest to their vertices."""
    on_mesh = fed(data).on_mesh
    mesh = on_mesh.mesh(number, whole=False)
    given = np.asarray(points, np.float64)
    nearest = np.abs(mesh.points[:, None] - given[None]).sum(axis=2).argmin(axis=1)
    assert len(np.unique(nearest)) == len(nearest)
    # the whole mesh has no other triangles with both signs
    whole = on_mesh.mesh(number)
    mixed = whole.above[whole.cells].any(axis=1) & ~whole.above[whole.cells].all(axis=1)
    assert mixed.sum() == len(mesh.cells)
    return {frozenset(tuple(given[nearest[v]].tolist()) for v in cell) for cell in mesh.cells}


def crossed_of(points: NDArray[Any], cells: NDArray[Any], values: NDArray[Any], isovalue: float) -> Triangles:
    above = values > isovalue
    some = cells[above[cells].any(axis=1) & ~above[cells].all(axis=1)]
    return {frozenset(tuple(map(float, points[v])) for v in cell) for cell in some}


def same(a: Contour, b: Contour) -> bool:
    return np.array_equal(a.points, b.points) and np.array_equal(a.cells, b.cells)


@examples(90)
@given(
    points=lattices(), seed=st.integers(0, 99), precision=st.sampled_from(["signs", "exact", 0.3, None]),
    isovalues=st.sampled_from([[20.5], [20.5, 40.5, 30], [1000.5], [-1000.5, 30.5]]), progressive=st.booleans(),
)
def test_ties_are_those_of_all_points(
    points: NDArray[np.int64], seed: int, precision: Any, isovalues: list[float], progressive: bool
) -> None:
    """Bit for bit the curves of all points; their triangles are those of a triangulation by definition."""
    values = values_at(points, seed)
    few, all_ = (
        isocodec.encode(
            Mesh(points, None, values, progressive=progressive, error=0.5, stored=stored), isovalues,
            precision=precision,
        )
        for stored in ("delaunay", "whole")
    )
    heads = [isocodec.open(data).info.domain for data in (few, all_)]
    assert heads[0] is not None and heads[1] is not None
    if (heads[0].exponent, heads[0].multiple) == (heads[1].exponent, heads[1].multiple):
        # a few points that fill all of a lattice are stored in a larger one
        assert heads[0].origin == heads[1].origin
        pairs = zip(isocodec.open(few).contours(), isocodec.open(all_).contours(), strict=True)
        assert all(same(a, b) for a, b in pairs)
    else:
        # all points would take too few bytes on the lattice
        assert heads[1].vertices == len(points)
    assert heads[0].vertices <= heads[1].vertices == len(points)
    if len(points) > 18:
        return
    unit = 2.0 ** heads[0].exponent
    assert heads[0].multiple == 1
    at = np.rint(points / unit).astype(int) - np.array(heads[0].origin)
    order = by_rank(at[:, 0], at[:, 1])
    cells = np.array(sorted(by_definition([tuple(p) for p in at[order].tolist()])))
    for number, isovalue in enumerate(isovalues):
        assert crossed_in(few, number, points) == crossed_of(points[order], cells, values[order], isovalue)


@examples(40)
@given(
    seed=st.integers(0, 999), count=st.integers(4, 150), isovalues=st.sampled_from([[0.5], [0.2, 0.9, 1.4]]),
    precision=st.sampled_from([None, 0.01, "signs"]), error=st.booleans(),
)
def test_the_triangles_of_another_library(
    seed: int, count: int, isovalues: list[float], precision: Any, error: bool
) -> None:
    """Random points: contours cross the triangles that they cross among all points."""
    rng = np.random.default_rng(seed)
    points = rng.random((count, 2)) * [3, 1] + [500, -7]
    values = np.sin(5 * points[:, 0]) + points[:, 1] + 7 + rng.normal(size=count) * 0.1
    # an error that leaves the triangles as they are
    mesh = Mesh(points, None, values, error=1e-6 if error else None)
    data = isocodec.encode(mesh, isovalues, precision=precision)
    cells = Delaunay(points).simplices
    needed = set()
    for number, isovalue in enumerate(isovalues):
        wanted = crossed_of(points, cells, values, isovalue)
        # of points that are moved another may be the nearest one
        crossed = crossed_in(data, number, points)
        assert len(crossed) == len(wanted) and (crossed == wanted or not error)
        needed |= {point for triangle in wanted for point in triangle}
        contour = isocodec.open(data).contours()[number]
        found = crossings((points, cells), values, isovalue)
        assert len(contour.points) == len(found)
        if precision == 0.01 and found:
            far = np.abs(contour.points[:, None] - np.array(list(found.values()))[None]).sum(axis=2)
            assert max(far.min(axis=1).max(), far.min(axis=0).max()) < 0.02
    domain = isocodec.open(data).info.domain
    assert domain is not None and domain.vertices == max(len(needed), 3)


def survey(count: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Soundings of a terrain."""
    rng = np.random.default_rng(seed)
    points = np.round(rng.random((count, 2)) * (np.array(DEM.shape) - 1) * 64) / 64
    points = np.unique(points, axis=0)
    low = np.minimum(points.astype(int), np.array(DEM.shape) - 2)
    s, t = (points - low).T
    (i, j) = low.T
    values = (DEM[i, j] * (1 - s) + DEM[i + 1, j] * s) * (1 - t) + (DEM[i, j + 1] * (1 - s) + DEM[i + 1, j + 1] * s) * t
    return points, values


def test_the_order_of_points_does_not_matter() -> None:
    for points, values in (survey(300), (np.argwhere(np.ones((9, 9))) * 1.0, np.arange(81.0) % 10)):
        order = np.random.default_rng(1).permutation(len(points))
        isovalues = [float(np.median(values)), float(np.quantile(values, 0.8))]
        assert isocodec.encode(Mesh(points, None, values), isovalues) == isocodec.encode(
            Mesh(points[order], None, values[order]), isovalues
        )


def test_series() -> None:
    """A file has what the contours of all frames need; where frames come one by one, it has all points."""
    points, values = survey(400)
    frames = np.array([values, values + 40, values - 90])
    levels = [350.0, 420.0]
    few, all_ = (isocodec.open(isocodec.encode(Mesh(points, None, frames, stored=stored, error=0.01), levels,
                                                precision="step=0.5"))
                 for stored in ("delaunay", "whole"))
    assert few.info.domain and all_.info.domain
    assert few.info.domain.vertices < all_.info.domain.vertices == len(points)
    single = isocodec.open(isocodec.encode(Mesh(points, None, values), levels)).info.domain
    assert single and single.vertices < few.info.domain.vertices
    for a, b in zip(few.each_frame(), all_.each_frame(), strict=True):
        assert all(same(one, other) and len(one.cells) for one, other in zip(a, b, strict=True))
    promised = isocodec.open(isocodec.encode(Mesh(points, None, frames), levels, precision=0.5))
    for frame, each in enumerate(frames):
        assert [one.kept for one in promised.verify(Mesh(points, None, each), frame=frame)] == [True, True]
    encoder = Encoder(levels, precision="signs")
    data = encoder.add(Mesh(points, None, values)) + encoder.add(values + 200) + encoder.finish()
    domain = isocodec.open(data).info.domain
    assert domain and domain.vertices == len(points)
    with pytest.raises(OptionError, match="whole"):
        Encoder(levels).add(Mesh(points, None, values, stored="delaunay"))


def test_operations() -> None:
    """What works on files of all points works on these, or is refused with the remedy."""
    points, values = survey(500)
    mesh, levels = Mesh(points, None, values), [350.0, 420.0]
    data = isocodec.encode(mesh, levels, order="independent")
    file = isocodec.open(data)
    assert file.kind == "mesh" and file.info.complete and file.info.domain
    assert file.info.domain.vertices < len(points)
    one = isocodec.open(file.edited(isovalues=[420.0]))
    assert same(one.contour(), file.contour(420.0))
    assert isocodec.open(file.edited(precision="signs")).contour(420.0).cells.shape == file.contour(420.0).cells.shape
    assert len(isocodec.open(file.edited(layers=1)).contour(350.0).cells) == len(file.contour(350.0).cells)
    assert isocodec.open(file.edited(size=len(data))).data == data
    for level in levels:
        # vertices of the file lie near to given points, on the same side
        found = file.mesh(level, whole=True)
        nearest = np.abs(found.points[:, None] - points[None]).sum(axis=2).argmin(axis=1)
        assert np.array_equal(file.above(level), values[nearest] > level)
        assert np.array_equal(found.above, file.above(level))
    assert file.valid().all() and len(file.valid()) == file.info.domain.vertices
    assert [layer.kind for layer in file.statistics().layers] == ["signs", "offsets"] * 2
    whole = file.contour(350.0)
    assert 0 < len(file.contour(350.0, window=[(0, float(whole.points[0, 0])), (0, 1e4)]).cells) < len(whole.cells)
    other = isocodec.encode(mesh, 500.0)
    with pytest.raises(InputError, match="stored whole"):
        isocodec.merge([data, other])
    files = [isocodec.encode(Mesh(points, None, values, stored="whole"), level) for level in (*levels, 500.0)]
    assert isocodec.open(isocodec.merge(files)).isovalues == (*levels, 500.0)
    with pytest.raises(OptionError, match="known"):
        isocodec.encode(Mesh(points, None, values, stored="known"), 350.0)


def test_no_contour() -> None:
    """A file has a triangle at least."""
    points, values = survey(100)
    for isovalue in (1e6, -1e6):
        file = isocodec.open(isocodec.encode(Mesh(points, None, values), isovalue))
        assert not len(file.contour().cells) and file.info.domain and file.info.domain.vertices == 3


def test_points_without_values() -> None:
    points, values = survey(200)
    values[::7] = np.nan
    there = ~np.isnan(values)
    with pytest.warns(UserWarning, match="without a value"):
        data = isocodec.encode(Mesh(points, None, values), 400.0)
    assert data == isocodec.encode(Mesh(points[there], None, values[there]), 400.0)


@pytest.mark.parametrize("options", [{}, {"error": 0.71}, {"precision": 0.1}])
def test_points_that_fill_a_lattice(options: dict[str, Any]) -> None:
    """Their positions take so few bytes that readers would refuse the number of points: they are stored otherwise."""
    points = np.argwhere(np.ones((60, 90)))
    values = np.hypot(*(points - 35.25).T)
    error, precision = options.get("error"), options.get("precision", "signs")
    for stored in ("whole", "delaunay"):
        data = isocodec.encode(Mesh(points, None, values, error=error, stored=stored), 20.0, precision=precision)
        file = isocodec.open(data)
        assert len(file.contour().cells) > 100 and file.info.domain
        assert stored == "delaunay" or file.info.domain.vertices == len(points)
        assert {one.kept for one in file.verify(Mesh(points, None, values))} <= {True, None}
