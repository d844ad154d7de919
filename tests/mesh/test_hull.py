"""Contours of scattered points, up to the hull: those of the given points' triangulation, however a file stores them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import isocodec
from explicit_meshes import crossings, pieces
from isocodec import Encoder, Mesh
from isocodec.errors import InputError
from isocodec.mesh.coded_points import triangulated
from libraries import Late
from tables import looped

cKDTree = Late("scipy.spatial.cKDTree")
Delaunay = Late("scipy.spatial.Delaunay")
shapely = Late("shapely")

Points = NDArray[np.float64]
ISOVALUE = 0.3


def squares(rng: np.random.Generator, size: int = 14) -> Points:
    return np.argwhere(np.ones((size, size))) * 1.0


def disc(rng: np.random.Generator, size: int = 200) -> Points:
    angle, radius = rng.random(size) * 2 * np.pi, 8 * np.sqrt(rng.random(size))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def circle(rng: np.random.Generator) -> Points:
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    return np.concatenate([0.95 * disc(rng, 120), 8 * np.stack([np.cos(angle), np.sin(angle)], axis=1)])


def lines(rng: np.random.Generator) -> Points:
    """Lines of a ship."""
    along = np.arange(0, 30, 0.25)
    return np.concatenate([
        np.stack([along + rng.normal(size=120) * 0.02, 3.0 * k + rng.normal(size=120) * 0.05], axis=1)
        for k in range(5)
    ])


def turned(points: Points) -> Points:
    return points @ np.array([[0.9, 0.45], [-0.45, 0.9]])


CLEAR: dict[str, Callable[[np.random.Generator], Points]] = {
    "anywhere": lambda rng: rng.random((250, 2)) * 16,
    "disc": disc,
    "circle": circle,
    "grid that shakes": lambda rng: squares(rng) + rng.normal(size=(196, 2)) * 0.1,
    "grid that hardly shakes": lambda rng: squares(rng) + rng.normal(size=(196, 2)) * 0.003,
    "turned grid that shakes": lambda rng: turned(squares(rng)) + 5000 + rng.normal(size=(196, 2)) * 0.02,
    "lines": lines,
    "turned lines": lambda rng: turned(lines(rng)),
}
"""Kinds of points with one triangulation."""
TIED: dict[str, Callable[[np.random.Generator], Points]] = {
    "grid": squares,
    "turned grid": lambda rng: turned(squares(rng)),
    "turned grid in a table": lambda rng: np.round(turned(squares(rng)) * 1.1 + 700, 2),
    "integers": lambda rng: np.unique(rng.integers(0, 40, (200, 2)), axis=0) * 1.0,
}
"""Kinds with points on circles, which may be joined in several ways, and on lines."""


def values_at(points: Points, rng: np.random.Generator) -> NDArray[np.float64]:
    x, y = (points - points.mean(axis=0)).T
    return 2 * np.sin(0.35 * x) + np.cos(0.3 * y) + rng.normal(size=len(points)) * 0.1


def drawn(points: Points, cells: NDArray[Any], values: NDArray[Any]) -> Any:
    """The contour of a triangulation, triangle by triangle."""
    found, crossed = (of((points, cells), values, ISOVALUE) for of in (crossings, pieces))
    return shapely.multilinestrings([shapely.linestrings([found[edge] for edge in edges]) for edges in crossed])


def apart(data: bytes, wanted: Any) -> float:
    """How far the contour of a file and another one are apart, there or back."""
    contour = isocodec.open(data).contour()
    found = shapely.multilinestrings([shapely.linestrings(piece) for piece in contour.points[contour.cells]])
    return float(max(shapely.hausdorff_distance(a, b, densify=0.1) for a, b in ((found, wanted), (wanted, found))))


def triangles_of(points: Points, cells: NDArray[Any]) -> set[frozenset[tuple[float, ...]]]:
    return {frozenset(map(tuple, points[cell].tolist())) for cell in cells}


@pytest.mark.cover(1)
@pytest.mark.parametrize("precision", [None, 0.4, 0.05, "step=1e-4"])
@pytest.mark.parametrize("stored", ["whole", "delaunay"])
@pytest.mark.parametrize("kind", [*CLEAR, *TIED])
def test_the_contour_of_the_given_points(kind: str, stored: Any, precision: Any) -> None:
    rng = np.random.default_rng(1)
    points = {**CLEAR, **TIED}[kind](rng)
    values = values_at(points, rng)
    mesh = Mesh(points, None, values, stored=stored)
    if kind in CLEAR:
        cells = Delaunay(points).simplices
    else:
        points, cells, values = triangulated(points, values)[:3]
    edge = float(np.median(np.linalg.norm(points[cells[:, 0]] - points[cells[:, 1]], axis=1)))
    wanted, data = drawn(points, cells, values), isocodec.encode(mesh, ISOVALUE, precision=precision)
    if precision is None:
        within = 3 * 0.05 * edge
    else:
        within = precision if isinstance(precision, float) else 0.11 * edge
    assert apart(data, wanted) <= within
    file = isocodec.open(data)
    if isinstance(precision, float):
        assert file.promise is not None and file.promise.startswith(f"within {precision}")
        assert file.verify(mesh)[0].kept
    if stored == "whole":
        assert file.info.domain is not None and file.info.domain.vertices == len(points)


@looped("kind", [*CLEAR, *TIED])
def test_the_triangulation(kind: str) -> None:
    """Another library's where there is but one; else none of its circles holds a point."""
    points = {**CLEAR, **TIED}[kind](np.random.default_rng(3))
    joined = triangulated(points, np.zeros(len(points)))
    if kind in CLEAR:
        assert triangles_of(joined.points, joined.cells) == triangles_of(points, Delaunay(points).simplices)
        return
    a, b, c = joined.points[joined.cells].transpose(1, 0, 2)
    u, v = b - a, c - a
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    square = np.stack([(u**2).sum(axis=1), (v**2).sum(axis=1)])
    middle = a + np.stack([v[:, 1] * square[0] - u[:, 1] * square[1], u[:, 0] * square[1] - v[:, 0] * square[0]],
                          axis=1) / (2 * area)[:, None]
    radius = np.linalg.norm(middle - a, axis=1)
    nearest = cKDTree(joined.points).query(middle)[0]
    assert (nearest >= radius * (1 - 1e-6)).all()
    assert np.isclose(area.sum() / 2, shapely.convex_hull(shapely.multipoints(points)).area, rtol=1e-6)


def test_files_of_all_points_have_one_mesh() -> None:
    """Whatever their isovalues, so that they can be merged; frames that come one by one, too."""
    for kind in ("grid that shakes", "turned grid", "grid that hardly shakes"):
        rng = np.random.default_rng(5)
        points = {**CLEAR, **TIED}[kind](rng)
        values = values_at(points, rng)
        mesh = Mesh(points, None, values, stored="whole")
        files = [isocodec.encode(mesh, level) for level in (-0.5, 0.3)]
        both = isocodec.open(isocodec.merge(files))
        for data, level in zip(files, (-0.5, 0.3), strict=True):
            assert np.array_equal(isocodec.open(data).contour().points, both.contour(level).points)
        encoder = Encoder([0.3])
        series = isocodec.open(encoder.add(Mesh(points, None, values)) + encoder.add(values + 0.2) + encoder.finish())
        assert np.array_equal(series.contour(frame=0).points, both.contour(0.3).points)


def test_errors_that_are_asked_for() -> None:
    """Points lie within them, whether they are moved for the triangles or not."""
    for kind in ("lines", "turned grid"):
        rng = np.random.default_rng(7)
        points = {**CLEAR, **TIED}[kind](rng)
        values = values_at(points, rng)
        for error in (0.2, 0.0004):
            for stored in ("whole", "delaunay"):
                file = isocodec.open(isocodec.encode(
                    Mesh(points, None, values, error=error, stored=stored), ISOVALUE, precision="signs"
                ))
                far = cKDTree(points).query(file.mesh(whole=True).points)[0]
                assert far.max() <= error * (1 + 1e-9)


def test_triangles_that_are_too_thin() -> None:
    points = np.random.default_rng(0).random((200, 2)) * [1000, 0.003]
    with pytest.raises(InputError, match="too thin") as error:
        isocodec.encode(Mesh(points, None, points[:, 0], stored="whole"), 500.0)
    assert "scale" in str(error.value.remedy)
    file = isocodec.open(isocodec.encode(Mesh(points * [1, 1e6], None, points[:, 0], stored="whole"), 500.0))
    assert np.allclose(file.contour().points[:, 0], 500, atol=20)
