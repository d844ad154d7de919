"""Samples that equal the isovalue: no line without length, no triangle without area, the pieces of a curve above.

Cells of the table are a field, an isovalue, a precision and an output; shapely, trimesh, contourpy, scikit-image and
scipy say what is right.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples
from isocodec import Contour
from isocodec.drawing.separation import NEAR_END, single
from libraries import Late

ndimage = Late("scipy.ndimage")
shapely = Late("shapely")
shape_of = Late("shapely.geometry.shape")
measure = Late("skimage.measure")
trimesh = Late("trimesh")

Fields = dict[str, Any]


def _with(shape: tuple[int, ...], around: int, *at: tuple[Any, int]) -> Any:
    field = np.full(shape, around, np.int16)
    for where, value in at:
        field[where] = value
    return field


def _fields(n: int) -> Fields:
    """Fields of which samples equal 2: at a vertex, along an edge, in whole faces, in saddles, at the border."""
    shape, mid, some = (9, 8, 7)[:n], (4,) * n, slice(3, 6)
    thick = (slice(3, 5),) * n
    out = {
        "lone sample, below": _with(shape, 3, (mid, 2)),
        "lone sample, above": _with(shape, 2, (mid, 3)),
        "edge": _with(shape, 3, ((some, *mid[1:]), 2)),
        "edge, above": _with(shape, 2, ((some, *mid[1:]), 3)),
        "face": _with(shape, 3, ((some, some, *mid[2:]), 2)),
        "block": _with(shape, 3, (thick, 2)),
        "block, deeper": _with(shape, 3, ((slice(2, 7),) * n, 2), (thick, 0)),
        "step": _with(shape, 2, ((slice(4, None),), 5)),
        "row": _with(shape, 3, ((4,), 2)),
        "last row": _with(shape, 3, ((-1,), 2)),
        "corner": _with(shape, 3, ((0,) * n, 2), ((-1,) * n, 2)),
        "border": _with(shape, 2, ((slice(1, -1),) * n, 3)),
        "border, sample": _with(shape, 3, ((0, *mid[1:]), 2)),
        "all equal": _with(shape, 2),
        "saddle": _with(shape, 2, ((3, 3, *mid[2:]), 3), ((4, 4, *mid[2:]), 3)),
        "saddle of equals": _with(shape, 3, ((3, 3, *mid[2:]), 2), ((4, 4, *mid[2:]), 2)),
        "saddle at the border": _with(shape, 3, ((0, 3, *mid[2:]), 2), ((1, 4, *mid[2:]), 2)),
        "chequered": 2 + np.indices(shape).sum(axis=0).astype(np.int16) % 2,
        "slope": np.indices(shape).sum(axis=0).astype(np.int16) - 6,
        "ridges": np.abs(np.indices(shape)[0].astype(np.int16) - 4),
    }
    for seed in range(6):
        out[f"random {seed}"] = np.random.default_rng(seed).integers(0, 5, shape).astype(np.int16)
    return out


PLANE, SPACE = _fields(2), _fields(3)
PRECISIONS: dict[str, dict[str, Any]] = {
    "exact": {"precision": "exact"}, "default": {}, "layers": {"precision": [1, "exact"]},
    "baseline": {"precision": "exact", "profile": "baseline"},
}


def contour_of(field: Any, precision: str, isovalue: float = 2, **options: Any) -> Contour:
    return isocodec.decode(isocodec.encode(field, isovalue, **PRECISIONS[precision]), **options)


def pieces(contour: Contour) -> int:
    """Connected pieces, by scipy."""
    if not len(contour.cells):
        return 0
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b = contour.cells[:, 0], contour.cells[:, 1:].ravel(order="F")
    a = np.tile(a, contour.n - 1)
    count = len(contour.points)
    graph = coo_array((np.ones(len(a)), (a, b)), (count, count))
    return len(np.unique(connected_components(graph, directed=False)[1][contour.cells]))


def apart(points: Any) -> bool:
    return len(np.unique(points, axis=0)) == len(points)


@pytest.mark.cover(1)
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", PLANE)
def test_lines_and_areas(name: str, precision: str) -> None:
    field, saddles = PLANE[name], "saddle" in name or "random" in name or name == "chequered"
    contour = contour_of(field, precision)
    lines = shapely.get_parts(contour.to_shapely())
    assert shapely.is_valid(lines).all() and (shapely.length(lines) > 0).all()
    assert all(len(np.unique(line, axis=0)) == len(line) - (line[0] == line[-1]).all() for line in contour.lines)
    assert not any(a.crosses(b) or a.touches(b) for i, a in enumerate(lines) for b in lines[:i])
    table = contour.to_geodataframe().geometry
    assert table.is_valid.all() and (table.length > 0).all() and len(table) == len(lines)
    # the curve slightly above has the same pieces, and so have its areas
    if precision != "default":
        assert len(lines) == len(contour_of(field, precision, 2.5).lines)
        if not saddles:
            assert len(lines) == len(measure.find_contours(field, 2 + 1e-6))
    sides = [shape_of(contour.areas(above=side)) for side in (True, False)]
    assert all(side.is_valid for side in sides)
    assert sum(side.area for side in sides) == pytest.approx(np.prod(np.subtract(field.shape, 1)))
    _check_samples(sides, field > 2)
    if precision == "exact" and not saddles and (field > 2).any():
        assert sides[0].area == pytest.approx(shapely.area(filled(field, 2)).sum(), abs=1e-4)


def filled(field: Any, isovalue: float) -> Any:
    """Areas above, by contourpy; it decides saddles otherwise."""
    contourpy = pytest.importorskip("contourpy")
    found = contourpy.contour_generator(z=field.astype(float), fill_type="OuterOffset").filled(isovalue, 1e9)
    return np.array([
        shapely.Polygon(rings[0], rings[1:])
        for points, offsets in zip(*found, strict=True)
        for rings in [[points[a:b] for a, b in pairwise(offsets)]]
    ])


def _check_samples(sides: list[Any], above: Any) -> None:
    rows, columns = np.indices(above.shape)
    for side, inside in zip(sides, (above, ~above), strict=True):
        assert np.array_equal(shapely.intersects(side, shapely.points(columns, rows)), inside)


@pytest.mark.cover(1)
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", SPACE)
def test_surfaces(name: str, precision: str) -> None:
    contour = contour_of(SPACE[name], precision)
    assert apart(contour.points)
    for mesh in (contour.to_trimesh(), *([contour.capped().to_trimesh()] if precision != "default" else [])):
        assert (mesh.area_faces > 0).all()
        _, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
        assert (count <= 2).all()
    if precision != "default" and (SPACE[name] > 2).any():
        assert mesh.is_watertight
        assert pieces(contour) == pieces(contour_of(SPACE[name], precision, 2.5))


SUFFIXES = (".ply", ".stl", ".glb", ".obj", ".off", ".3mf")
PLACEMENTS = {
    "none": None, "small": [0.02] * 3, "far": [[30, 0, 0, 500_000], [0, 30, 0, 4_649_776], [0, 0, 10, 100]],
}


@pytest.mark.cover(1)
@pytest.mark.parametrize("placement", PLACEMENTS)
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", ["lone sample, below", "block", "face", "saddle of equals", "random 0"])
def test_files_of_surfaces(name: str, suffix: str, placement: str, tmp_path: Path) -> None:
    """Single precision in some; as trimesh reads them, vertices merged."""
    field = isocodec.Field(np.pad(SPACE[name], 1, constant_values=5), placement=PLACEMENTS[placement])
    contour = contour_of(field, "exact")
    isocodec.save(tmp_path / f"surface{suffix}", contour)
    mesh = trimesh.load(tmp_path / f"surface{suffix}", force="mesh")
    assert (mesh.area_faces > 0).all() and len(mesh.faces) == len(contour.cells)
    assert mesh.is_watertight and mesh.body_count == pieces(contour)


@pytest.mark.parametrize("n", [2, 3])
def test_points_move_by_no_more_than_is_said(n: int) -> None:
    """On the edges of their samples, at most ``2**-21`` from where linear interpolation puts them."""
    field = (PLANE, SPACE)[n - 2]["random 2"]
    contour = contour_of(field, "exact")
    low, high = np.floor(contour.points).astype(int), np.ceil(contour.points).astype(int)
    on = np.count_nonzero(low != high, axis=1) == 1
    a, b = (field[tuple(end[on].T)].astype(float) for end in (low, high))
    wanted = low[on] + ((2 - a) / (b - a))[:, None] * (high - low)[on]
    moved = np.abs(contour.points[on] - wanted).max(axis=1)
    assert np.allclose(moved, np.where((a == 2) | (b == 2), NEAR_END, 0), atol=1e-12)


@pytest.mark.parametrize("n", [2, 3])
def test_meshes_and_surfaces_with_values(n: int) -> None:
    """Vertices of triangles and tetrahedra that equal the isovalue."""
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(n)
    points = rng.uniform(0, 10, (60, n))
    values = rng.integers(0, 4, 60).astype(float)
    mesh = isocodec.Mesh(points, Delaunay(points).simplices, values.astype(int), stored="whole")
    contour = isocodec.decode(isocodec.encode(mesh, 2, precision="exact"))
    assert len(contour.points) > 30 and apart(contour.points)
    corners = contour.points[contour.cells]
    sides = corners[:, 1:] - corners[:, :1]
    assert (np.linalg.norm(sides[:, 0], axis=1) > 0).all()
    assert n == 2 or (np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) > 0).all()
    if n == 2:
        tin = isocodec.thin(isocodec.Mesh(points, None, values), error=1e-9)
        lines = shapely.get_parts(isocodec.decode(isocodec.encode(tin), 2).to_shapely())
        assert len(lines) and shapely.is_valid(lines).all() and (shapely.length(lines) > 0).all()


# ---- Areas of many rings ----


def rebuilt(contour: Contour, above: bool) -> Any:
    """The areas as shapely makes them: faces between lines and border, those kept that hold samples of the side."""
    far = np.subtract(contour.shape, 1)
    box = shapely.box(0, 0, *far[::-1])
    lines = shapely.union_all([box.exterior, *[shapely.LineString(line[:, ::-1]) for line in contour.lines]])
    faces = shapely.get_parts(shapely.polygonize([lines]))
    chosen = shape_of(contour.areas(above=above))
    inside = shapely.contains(chosen, shapely.point_on_surface(faces))
    return shapely.union_all(faces[inside]), chosen, int(inside.sum())


@given(st.tuples(st.integers(2, 22), st.integers(2, 22)), st.integers(0, 2**32 - 1), st.integers(0, 2),
       st.sampled_from(["exact", "default"]), st.booleans())
@examples(150)
def test_rings_are_nested_as_shapely_nests_them(
    shape: tuple[int, int], seed: int, blur: int, precision: str, above: bool
) -> None:
    field = np.random.default_rng(seed).integers(0, 100, shape)
    field = ndimage.uniform_filter(field, 1 + blur) // 20
    contour = contour_of(field, precision)
    if precision == "exact" and seed % 2:
        contour = isocodec.decode(isocodec.encode(field, 2, precision="signs"), smooth=True)
    wanted, chosen, faces = rebuilt(contour, above)
    assert chosen.is_valid and len(chosen.geoms) == faces
    assert chosen.symmetric_difference(wanted).area < 1e-6
    # every face belongs to one side
    other = shape_of(contour.areas(above=not above))
    assert chosen.area + other.area == pytest.approx(np.prod(np.subtract(shape, 1)))


# ---- Single precision ----


@given(st.integers(0, 2**32 - 1), st.integers(2, 3), st.sampled_from([0.0, 1e3, 5e6]), st.floats(1e-9, 1e-3))
@examples(100)
def test_rounding_keeps_points_apart(seed: int, d: int, far: float, near: float) -> None:
    """Clusters, of which some are smaller than a step; points that are alone are rounded as numpy does it."""
    rng = np.random.default_rng(seed)
    middles = rng.uniform(0, 100, (40, d)) + far
    points = np.concatenate([middles + near * rng.normal(size=(40, d)) for _ in range(5)])
    found = single(points)
    assert found.dtype == np.float32 and apart(found)
    step = np.spacing(np.float32(np.abs(points).max()))
    assert np.abs(found - points).max() <= 40 * step
    lone = rng.permutation(1000)[:, None] * np.ones(d)
    assert np.array_equal(single(lone + 0.3), (lone + 0.3).astype(np.float32))
