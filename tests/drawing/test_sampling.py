"""Other values at the points of contours, held against scipy's and VTK's interpolation."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import explicit_meshes
import grids
import isocodec
from isocodec import Field, Mesh
from isocodec.errors import InputError, OptionError
from isocodec.field.placement import Placement
from libraries import Late
from tables import looped

pyvista = Late("pyvista")
RegularGridInterpolator = Late("scipy.interpolate.RegularGridInterpolator")
LinearNDInterpolator = Late("scipy.interpolate.LinearNDInterpolator")
gaussian_filter = Late("scipy.ndimage.gaussian_filter")
map_coordinates = Late("scipy.ndimage.map_coordinates")

SHAPES = (31, 42), (15, 18, 22)
FILES: dict[str, dict[str, Any]] = {
    "exact": {"precision": "exact"}, "signs": {"precision": "signs"}, "layered": {"precision": "2,0.25"},
    "coarse": {"layers": "distortion=0.9", "precision": 1e-4},
}
VIEWS: dict[str, dict[str, Any]] = {
    "whole": {}, "layers": {"layers": 3}, "smooth": {"smooth": True}, "window": {"window": [(4, 9)] * 3},
}
TURNED = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0], [0.48, 0.64, 0.6]])


@cache
def rough(shape: tuple[int, ...], seed: int) -> np.ndarray:
    return np.rint(gaussian_filter(np.random.default_rng(seed).normal(size=shape), 1.5) * 1000).astype(np.int32)


@cache
def encoded(shape: tuple[int, ...], file: str) -> isocodec.IsoFile:
    return isocodec.open(isocodec.encode(rough(shape, 1), 20.5, **FILES[file]))


def drawn(shape: tuple[int, ...], **more: Any) -> isocodec.Contour:
    return isocodec.decode(isocodec.encode(Field(rough(shape, 1), **more), 20.5, precision="exact"))


def by_scipy(values: np.ndarray, points: np.ndarray) -> np.ndarray:
    return RegularGridInterpolator([np.arange(size) for size in values.shape], values)(points)


def edges(contour: isocodec.Contour) -> np.ndarray:
    """Along how many axes the edge of each point runs."""
    return (abs(contour.points - np.rint(contour.points)) > 1e-6).sum(axis=1)


@looped("shape, file, view", [(s, f, v) for s in SHAPES for f in FILES for v in VIEWS])
def test_values_along_edges(shape: tuple[int, ...], file: str, view: str) -> None:
    """As scipy has them along the axes, and everywhere of a field that is linear."""
    views = {name: value[: len(shape)] if name == "window" else value for name, value in VIEWS[view].items()}
    contour = encoded(shape, file).contour(**views)
    assert len(contour.points)
    linear = sum(number * axis for number, axis in zip((3, -2, 0.5), np.indices(shape), strict=False)) + 7.0
    assert np.allclose(contour.sample(linear), by_scipy(linear, contour.points), rtol=0, atol=1e-9)
    other = rough(shape, 2)
    found, axes = contour.sample(other), edges(contour) < 2
    assert found.dtype == np.float64 and axes.any() and (file != "coarse" or not axes.all())
    wanted = map_coordinates(other.astype(float), contour.points.T, order=1)
    assert np.allclose(found[axes], wanted[axes], rtol=0, atol=1e-9)
    both = contour.sample(np.stack([other, linear], axis=-1))
    assert np.array_equal(both, np.stack([found, contour.sample(linear)], axis=1))
    if (file, view) == ("exact", "whole"):
        assert np.allclose(contour.sample(rough(shape, 1)), 20.5, rtol=0, atol=1e-9)


@looped("shape", SHAPES)
def test_values_along_diagonals_of_a_coarse_mesh(shape: tuple[int, ...]) -> None:
    """The field has the isovalue there, as along the axes, where the file draws the crossing; multilinear ones do not.
    """
    field = rough(shape, 1).astype(float)
    contour = isocodec.decode(isocodec.encode(field, 20.5, **FILES["coarse"]))
    off, count = abs(contour.sample(field) - 20.5), edges(contour)
    for runs in range(2, len(shape) + 1):
        multilinear = abs(map_coordinates(field, contour.points.T, order=1) - 20.5)
        assert (count == runs).sum() > 20
        assert np.median(off[count == runs]) < min(4 * np.median(off[count == 1]),
                                                   np.median(multilinear[count == runs]) / 5)


def test_tiles_have_the_values_of_the_whole(tmp_path: Any) -> None:
    field = np.rint(gaussian_filter(np.random.default_rng(3).normal(size=(90, 110)), 2) * 1000).astype(np.int32)
    isocodec.save(tmp_path / "a.iso", field, 20.5, tile=32, precision="exact")
    file = isocodec.open(tmp_path / "a.iso")
    for view in ({}, {"window": [(20, 50), (40, 90)]}):
        assert np.allclose(file.contour(**view).sample(field), 20.5, rtol=0, atol=1e-9)


@looped("n, kind", [(n, kind) for n in (2, 3) for kind in ("same", "other", "part")])
def test_fields_of_another_grid_are_sampled_in_their_place(n: int, kind: str) -> None:
    """Uneven steps, turned axes: against VTK's probe. A part of the same grid needs no rounding to be found."""
    shape, own = SHAPES[n - 2], TURNED[:n, :n] * [0.7, 1.1, 2.5][:n]
    if n == 2:
        own = np.array([[0.6, -0.8], [0.8, 0.6]]) * [0.7, 1.1]
    contour = drawn(shape, placement=np.column_stack([own, [5e5, 4e6, 30][:n]]))
    values = rough(shape, 2).astype(float)
    if kind == "same":  # in other places by less than any rounding of a file format
        field = Field(values, placement=np.column_stack([own, np.array([5e5, 4e6, 30][:n]) + 1e-6]))
        assert np.array_equal(contour.sample(field), contour.sample(values))
        return
    other = own if kind == "part" else own @ (TURNED[:n, :n] if n == 3 else np.array([[0, -1.0], [1, 0]])) * 0.8
    first = np.array([5e5, 4e6, 30][:n]) + own @ ([4, 5, 6][:n] if kind == "part" else [13, 4, 9][:n])
    field = Field(values, placement=np.column_stack([other, first]))
    steps = np.linalg.norm(other, axis=0)
    image = pyvista.ImageData(dimensions=[*shape, 1][:3], spacing=[*steps, 1][:3], origin=[*first, 0][:3])
    turn = np.eye(3)
    turn[:n, :n] = other / steps
    image.direction_matrix = turn
    image.point_data["values"] = values.ravel(order="F")
    probed = pyvista.PolyData(np.pad(contour.placed, ((0, 0), (0, 3 - n)))).sample(image)
    inside, found = np.asarray(probed["vtkValidPointMask"], bool), contour.sample(field)
    assert 0.1 < inside.mean() < 1
    assert np.array_equal(np.isnan(found), ~inside)
    assert np.allclose(found[inside], probed["values"][inside], rtol=0, atol=1e-5)


@looped("grid", [grids.rotated_pole, grids.polar, grids.elliptic, grids.cylinder])
def test_mapped_and_periodic_grids_are_sampled_by_their_samples(grid: Callable[[], Any]) -> None:
    values, arrays = grid()
    field = grids.placed(values, arrays)
    other = np.sin(np.indices(values.shape).sum(axis=0) / 3.0)
    contour = isocodec.decode(isocodec.encode(field, 0.1, precision=0.001))
    wanted = map_coordinates(other, contour.points.T, order=1, mode="grid-wrap")
    axes = edges(contour) < 2
    for given in (other, Field(other, placement=field.placement)):
        assert np.allclose(contour.sample(given)[axes], wanted[axes], rtol=0, atol=1e-9)
    assert abs(contour.sample(values) - 0.1).max() < 0.02


def test_periodic_axes_are_closed() -> None:
    field = np.cos(np.indices((20, 24))[1] * np.pi / 12 + 0.3) * 100
    around = Placement(coordinates=grids.polar(20, 24)[1], periodic=1)
    contour = isocodec.decode(isocodec.encode(Field(field, placement=around), 20.5, precision=1e-4))
    last = contour.points[:, 1] > 23
    other = field + np.arange(20)[:, None]
    assert contour.shape == (20, 25) and np.allclose(contour.sample(field), 20.5, atol=0.01)
    joined = contour.with_values(a=other).joined
    assert len(joined.points) <= len(contour.points) and np.array_equal(joined.at_points["a"], joined.sample(other))
    assert last.any() or not np.isnan(contour.sample(other)).any()


@looped("shape, how", [(shape, how) for shape in SHAPES for how in ("nan", "mask", "masked array")])
def test_points_next_to_missing_samples_have_no_value(shape: tuple[int, ...], how: str) -> None:
    contour, values = drawn(shape), rough(shape, 2)
    gone = np.random.default_rng(4).random(shape) < 0.1
    axes = edges(contour) < 2
    beside = np.array([gone[tuple(np.floor(p).astype(int))] | gone[tuple(np.ceil(p).astype(int))]
                       for p in contour.points])
    given: Any = {
        "nan": np.where(gone, np.nan, values), "mask": Field(values, gone),
        "masked array": np.ma.masked_array(values, gone),
    }[how]
    found = contour.sample(given)
    assert np.array_equal(np.isnan(found)[axes], beside[axes]) and np.isnan(found).any()
    known = ~np.isnan(found)
    assert np.array_equal(found[known], contour.sample(values)[known])


MESHES = explicit_meshes.plane(2), explicit_meshes.space(2), explicit_meshes.torus()


@looped("mesh, stored", [(mesh, stored) for mesh in MESHES for stored in ("known", "coded", "whole")])
def test_meshes_are_sampled_in_their_cells(mesh: explicit_meshes.Mesh, stored: Any) -> None:
    """Values that are linear in space, everywhere; others, where nothing is rounded, along the edge."""
    points, cells = mesh
    values = points @ [1.0, 2, 3][: points.shape[1]]
    data = isocodec.encode(Mesh(points, cells, values, stored=stored), float(np.median(values)) + 1e-3, precision=1e-4)
    contour = isocodec.open(data, mesh=(points, cells) if stored == "known" else None).contour()
    error = 1e-3 if stored == "known" else 0.2
    found = contour.sample(Mesh(points, cells, values))
    assert len(found) == len(contour.points) > 5 and np.allclose(found, contour.isovalue, atol=error)
    frames = contour.sample(Mesh(points, cells, np.stack([values, -values])))
    assert np.array_equal(frames, np.stack([found, -found], axis=1))
    if stored == "known":
        noise = np.random.default_rng(5).normal(size=len(points))
        ends = explicit_meshes.crossings(mesh, values, contour.isovalue)
        there, other = contour.points, contour.sample(Mesh(points, cells, noise))
        for (a, b), place in ends.items():
            nearest = np.linalg.norm(there - place, axis=1).argmin()
            share = np.linalg.norm(there[nearest] - points[a]) / np.linalg.norm(points[b] - points[a])
            assert other[nearest] == pytest.approx(noise[a] * (1 - share) + noise[b] * share, abs=1e-6)
    assert np.isnan(contour.sample(Mesh(points + 1000, cells, values))).all()


WRONG: dict[str, tuple[Callable[[], Any], type[Exception], str]] = {
    "shape": (lambda: np.zeros((31, 41)), InputError, r"shape \(31, 41\), the grid of the contour \(31, 42\)"),
    "axes": (lambda: np.zeros((31, 42, 2, 2)), InputError, "shape"),
    "type": (lambda: np.full((31, 42), "a"), InputError, "cannot be interpolated"),
    "series": (lambda: isocodec.Frames([np.zeros((31, 42))]), InputError, "series"),
    "system": (lambda: Field(np.zeros((31, 42)), placement=[1, 1], crs="EPSG:32632"), InputError, "reference systems"),
    "space": (lambda: Field(np.zeros((4, 4, 4)), placement=[1, 1, 1]), InputError, "3 coordinates"),
    "points": (lambda: Mesh([[0, 0], [1, 0], [0, 1]], None, [1, 2, 3]), InputError, "cells"),
    "bare mesh": (lambda: Mesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]]), InputError, "values"),
    "values": (lambda: Mesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], [1, 2]), InputError, "2 values on 3 points"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_sampled(case: str) -> None:
    give, kind, words = WRONG[case]
    with pytest.raises(kind, match=words):
        drawn((31, 42), placement=Placement([[0, 1, 0], [1, 0, 0]], crs="EPSG:32631")).sample(give())


def test_values_go_where_points_go() -> None:
    """With windows, simplified lines and the other side; a table has their mean along each line."""
    from isocodec.drawing.simplifying import simplified
    from isocodec.drawing.window import clipped

    other = rough(SHAPES[0], 2)
    contour = drawn(SHAPES[0]).with_values(a=other, b=other * 2.0)
    for part in (clipped(contour, [(4, 9), (0, 20)]), simplified([contour], 0.5).contours[0], contour.flip()):
        assert np.array_equal(part.at_points["a"], part.sample(other)) and [*part.at_points] == ["a", "b"]
    table, whole = contour.to_geodataframe(), contour.joined
    for row, walk in zip(table.a, whole.walks, strict=True):
        values, places = contour.at_points["a"][walk], whole.along(walk)
        along = np.append(0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
        assert row == pytest.approx(np.trapezoid(values, along) / along[-1])
    with pytest.raises(OptionError, match="not vectors"):
        contour.with_values(v=np.stack([other, other], axis=-1)).to_geodataframe()


def test_values_of_surfaces_as_objects() -> None:
    """Caps have none."""
    ball = drawn(SHAPES[1]).with_values(a=rough(SHAPES[1], 2))
    assert np.array_equal(ball.to_pyvista().point_data["a"], ball.at_points["a"])
    assert np.array_equal(ball.to_trimesh().vertex_attributes["a"], ball.at_points["a"])
    assert np.array_equal(ball.to_xarray()["a"], ball.at_points["a"])
    assert np.array_equal(ball.to_napari()[0][2], ball.at_points["a"])
    assert ball.capped().at_points == {}
