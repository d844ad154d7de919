"""Criteria by which a mesh is coarsened (rows C2-crossing, -uniform, -curvature, -topology), as of grids."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_hierarchy import Replay

import isocodec
from commands import fails, ok
from explicit_meshes import Mesh, components, euler, plane, space, torus
from isocodec.errors import OptionError
from isocodec.mesh.complex import complex_of
from isocodec.mesh.hierarchy import hierarchy_of
from tables import looped

ISOVALUE = 0.1
MESHES = {"plane": lambda: plane(1, 500, 0.97), "surface": lambda: torus(30, 16), "space": lambda: space(1, 300, 1.0)}


@cache
def case(kind: str) -> tuple[Mesh, np.ndarray]:
    """A mesh, and smooth values."""
    mesh = MESHES[kind]()
    return mesh, np.sin(mesh[0] / (np.ptp(mesh[0]) / 7)).sum(axis=1)


def coded(mesh: Mesh, values: np.ndarray, isovalue: float = ISOVALUE, stored: Any = "known",
          **options: Any) -> isocodec.IsoFile:
    data = isocodec.encode(isocodec.Mesh(*mesh, values, stored=stored), isovalue, **options)
    return isocodec.open(data, mesh=mesh if stored == "known" else None)


def mixed(cells: np.ndarray, above: np.ndarray) -> set[frozenset[int]]:
    return {frozenset(cell) for cell in cells.tolist() if 0 < above[cell].sum() < len(cell)}


def places(contour: isocodec.Contour) -> np.ndarray:
    return np.unique(contour.points.round(6), axis=0)


@pytest.mark.cover(2)
@pytest.mark.parametrize("precision", [None, "signs", "step=0.01"])
@pytest.mark.parametrize("stored", ["known", "whole"])
@pytest.mark.parametrize("kind", MESHES)
def test_crossing_keeps_the_curve_and_its_cells(kind: str, stored: str, precision: Any) -> None:
    mesh, values = case(kind)
    file = coded(mesh, values, stored=stored, layers="crossing", precision=precision)
    plain = coded(mesh, values, stored=stored, precision=precision)
    assert np.array_equal(places(file.contour()), places(plain.contour()))
    there, whole = (each.mesh(whole=True) for each in (file, plain))
    assert mixed(there.cells, there.above) == mixed(whole.cells, whole.above)
    assert len(there.cells) < len(whole.cells)


@looped("kind", MESHES)
def test_levels_are_those_of_the_hierarchy(kind: str) -> None:
    """Level by level, from all rounds of collapses to none, against cells as sets of vertices."""
    mesh, values = case(kind)
    hierarchy = hierarchy_of(complex_of(*mesh)[0])
    replay, sizes = Replay(hierarchy), [len(each.vertex) for each in hierarchy.rounds]
    assert len(sizes) >= 2
    for level in range(len(sizes) + 1):
        gone = sum(sizes[: len(sizes) - level])
        wanted = [cell for cell in replay.cut({*range(gone, len(replay.nodes))}) if replay.apex not in cell]
        crossed = {cell for cell in wanted if 0 < sum(values[v] > ISOVALUE for v in cell) < len(cell)}
        found = coded(mesh, values, layers=f"level={level}", precision="signs").mesh()
        assert {frozenset(cell) for cell in found.cells.tolist()} == crossed
    with pytest.raises(OptionError, match=f"up to that of the whole mesh, {len(sizes)}"):
        coded(mesh, values, layers=f"level={len(sizes) + 1}")


@looped("kind", MESHES)
@looped("criterion", ["topology", "level=0", "curvature=1e9"])
def test_topology_stays_if_it_is_asked_for(kind: str, criterion: str) -> None:
    mesh, values = case(kind)
    file = coded(mesh, values, layers=criterion, keep_topology=criterion != "topology", precision="signs")
    one, other = file.contour(), coded(mesh, values, precision="signs").contour()
    assert len(one.points) < len(other.points)
    for count in (components, euler):
        assert count(len(one.points), one.cells) == count(len(other.points), other.cells)


def test_bent_parts_stay_fine() -> None:
    """An ellipse of half axes 8 and 2: its curvature is 2 at the ends, where points stay, and 1/32 at the sides."""
    points, cells = plane(1, 4000, 1.0)
    points = (points - 50) / 5
    values = np.hypot(points[:, 0] / 8, points[:, 1] / 2)
    whole = places(coded((points, cells), values, 1.0).contour())
    bent = places(coded((points, cells), values, 1.0, layers="curvature=0.5").contour())
    kept = (abs(whole[:, None] - bent[None]).max(axis=2) < 1e-5).any(axis=1)
    assert len(bent) < 0.7 * len(whole)
    assert kept[abs(whole[:, 0]) > 7.6].mean() > 0.9 > 0.4 > kept[abs(whole[:, 0]) < 6].mean()
    same, least = (coded((points, cells), values, 1.0, layers=f"curvature={number}") for number in (0, 1e9))
    assert np.array_equal(places(same.contour()), whole) and len(least.contour().points) < 0.2 * len(whole)


def test_bent_parts_of_curves_and_surfaces_in_space() -> None:
    """Circles around a tube of radius 1, and a ball: all of it stays below its curvature, nearly nothing above."""
    points, cells = torus(60, 40)
    ball = space(2, 3000, 1.0)
    far = np.linalg.norm(ball[0] - 50, axis=1)
    for mesh, values, isovalue, size in (((points, cells), np.arctan2(points[:, 1], points[:, 0]), 0.51, 1.0),
                                         (ball, far, 30.0, 1 / 30)):
        whole = places(coded(mesh, values, isovalue).contour())
        low, high = (places(coded(mesh, values, isovalue, layers=f"curvature={size * part}").contour())
                     for part in (0.2, 20))
        assert len(low) > 0.9 * len(whole) and len(high) < 0.5 * len(whole)


def test_series_and_several_isovalues() -> None:
    (points, cells), values = case("plane")
    frames = np.stack([values, values + 0.2])
    file = coded((points, cells), frames, [0.1, 0.4], layers="crossing", precision="signs")
    plain = coded((points, cells), frames, [0.1, 0.4], precision="signs")
    for frame in (0, 1):
        for one, other in zip(file.contours(frame=frame), plain.contours(frame=frame), strict=True):
            assert np.array_equal(places(one), places(other))


def test_distances_are_promised_where_the_curve_is_the_same(tmp_path: Path) -> None:
    mesh, values = case("plane")
    for layers, promised in (("crossing", True), ("level=1", False)):
        file = coded(mesh, values, layers=layers, precision=0.5)
        (found,) = file.verify(isocodec.Mesh(*mesh, values))
        assert (file.promise is not None) == promised and found.kept is (True if promised else None)
    np.savez(tmp_path / "m.npz", points=mesh[0], cells=mesh[1], values=values)
    ok("encode", tmp_path / "m.npz", "-o", tmp_path / "m.iso", "--isovalue", ISOVALUE, "--layers", "curvature=0.1")
    ok("decode", tmp_path / "m.iso", "--mesh", tmp_path / "m.npz", "-o", tmp_path / "curve.npz")
    assert "precision=1 keeps" in fails(2, "encode", tmp_path / "m.npz", "-o", tmp_path / "no.iso", "--isovalue", 0.1,
                                        "--layers", "distortion=1")


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "distance": ({"layers": "distortion=2"}, "precision=2"),
    "plan": ({"layers": [("base", 0)]}, "does not apply to meshes"),
    "base": ({"layers": 3}, "does not apply to meshes"), "no level": ({"layers": "level"}, "needs a number"),
    "no number": ({"layers": "crossing=1"}, "takes no number"), "part": ({"layers": "level=0.5"}, "not an integer"),
    "steps": ({"layers": "crossing", "precision": [4, 1]}, "cannot be combined"),
}


@looped("wrong", WRONG)
def test_criteria_that_meshes_do_not_have(wrong: str) -> None:
    options, words = WRONG[wrong]
    mesh, values = case("plane")
    with pytest.raises(OptionError, match=words):
        coded(mesh, values, **options)
    with pytest.raises(OptionError, match="needs progressive signs"):
        isocodec.encode(isocodec.Mesh(*mesh, values, progressive=False), ISOVALUE, layers="crossing")
