"""Periodic axes and every option that searches for a mesh: no seam, distances, topology (spec clause 9.9(4)).

Distances are measured against scikit-image on the field continued beyond its ends, topology by brute force on a
cylinder or torus: crossed simplices of all unit cells, joined at the ends, once more where the field goes round twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import combinations, pairwise, permutations, product
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import grids
import isocodec
from brute import HEAVY, examples
from isocodec.errors import OptionError
from isocodec.field.placement import Placement
from isocodec.grid.lattice.vertex_set import every_vertex
from isocodec.stream.options import CriterionName
from libraries import Late
from planned import plan
from tables import heavy, looped

pyvista = Late("pyvista")
coo_array = Late("scipy.sparse.coo_array")
connected_components = Late("scipy.sparse.csgraph.connected_components")
shapely = Late("shapely")
find_contours = Late("skimage.measure.find_contours")
marching_cubes = Late("skimage.measure.marching_cubes")

Array = NDArray[np.float64]
BEYOND = 3
"""Samples that the field is continued by."""

AXES: dict[str, tuple[tuple[int, ...], tuple[int, ...], int]] = {
    "cylinder": ((29, 40), (1,), 5), "upright": ((40, 23), (0,), 5), "torus": ((27, 34), (0, 1), 5),
    "pipe": ((8, 12, 9), (1,), 2), "tori": ((10, 9, 11), (0, 2), 14), "all round": ((9, 10, 8), (0, 1, 2), 23),
}
"""Samples along each axis, the periodic ones, and seeds of fields that are smooth enough for other libraries."""
LEVEL = 40.5
CUBES = 0.35
"""Cells that marching cubes differ by at most on these fields: cubes can be triangulated in several ways."""
NUMBERS = {"curvature": 0.1, "distortion": 0.7, "level": 5}
"""Parameters of criteria."""
PRECISIONS: dict[str, tuple[Any, float | None]] = {
    "0.3": (0.3, 0.3), "1.2": (1.2, 1.2), "2,0.5": ("2,0.5", 0.5), "1,exact": ("1,exact", 0.0),
    "signs": ("signs", None),
}
"""Precisions, and what the whole curve keeps to, in cells."""
WAYS: dict[str, tuple[dict[str, Any], float | None]] = {
    **{f"precision {name}": ({"precision": given}, within) for name, (given, within) in PRECISIONS.items()},
    **{name: ({"layers": f"{name}={NUMBERS[name]}" if name in NUMBERS else name}, None) for name in
       get_args(CriterionName)},
    "distortion": ({"layers": "distortion=0.7"}, 0.7),
    "plan": ({"layers": plan("adaptive-base distortion=1.5\nvalues 6\nadapt curvature=0.3\nvalues 0")}, None),
    "plan of distances": (
        {"layers": plan("base 2\nadapt distortion=1.5\noffsets 3\nadapt distortion=1\noffsets 3")}, 1.0,
    ),
    "uniform plan": ({"layers": plan("base 6\noffsets 5")}, None),
}


def waves(shape: Sequence[int], periodic: Sequence[int], seed: int, most: int = 2) -> NDArray[Any]:
    """A field that goes round, of whole numbers, with so many waves along an axis at most."""
    rng = np.random.default_rng(seed)
    at = np.meshgrid(*(np.arange(size) / size for size in shape), indexing="ij")
    field = np.zeros(shape)
    for _ in range(8):
        turns = [rng.integers(-most, most + 1) if axis in periodic else rng.uniform(-most, most)
                 for axis in range(len(shape))]
        phase = 2 * np.pi * sum(turn * x for turn, x in zip(turns, at, strict=True))
        field += rng.normal() * np.cos(phase + rng.uniform(0, 7))
    return np.rint(300 * field).astype(np.int32)


def around(field: NDArray[Any], periodic: Sequence[int], **where: Any) -> isocodec.Field:
    return isocodec.Field(field, placement=Placement(periodic=periodic, **where))


# -- one point at both ends ----------------------------------------------------------------------------------------


def glued(contour: isocodec.Contour, periodic: Sequence[int], turns: int = 1) -> tuple[Array, NDArray[np.int64]]:
    """Points and cells of a contour that goes round some times, its ends joined by where they are."""
    periods = np.array([contour.shape[a] - 1 if a in periodic else 0 for a in range(len(contour.shape))])
    points, cells = [], []
    for number, turn in enumerate(product(*(range(turns if period else 1) for period in periods))):
        points.append(contour.points + periods * np.array(turn))
        cells.append(contour.cells + number * len(contour.points))
    places = np.concatenate(points)
    for axis in periodic:
        places[places[:, axis] == turns * periods[axis], axis] = 0
    places, number = np.unique(places, axis=0, return_inverse=True)
    return places, number.reshape(-1)[np.concatenate(cells)]


def open_ends(contour: isocodec.Contour, periodic: Sequence[int]) -> int:
    """Ends of curves, or sides of single triangles, that lie on no side of the grid where it has an end."""
    points, cells = glued(contour, periodic)
    n = points.shape[1]
    sides = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(n)]), axis=1)
    sides, count = np.unique(sides, axis=0, return_counts=True)
    single = points[sides[count % 2 == 1]]
    last = np.array(contour.shape) - 1
    free = np.array([axis not in periodic for axis in range(n)])
    outside = ((single == 0) | (single == last)).all(axis=1)[:, free].any(axis=1)
    return int((~outside).sum())


# -- distances -----------------------------------------------------------------------------------------------------


def theirs(field: NDArray[Any], periodic: Sequence[int], isovalue: float) -> tuple[Array, NDArray[np.int64]]:
    """Points and pieces of the curve of another library, on the field continued beyond the ends of periodic axes."""
    extra = [(BEYOND, BEYOND + 1) if axis in periodic else (0, 0) for axis in range(field.ndim)]
    wide = np.pad(field.astype(float), extra, mode="wrap")
    if field.ndim == 2:
        lines = find_contours(wide, isovalue)
        starts = np.cumsum([0, *map(len, lines)])
        cells = np.concatenate([np.arange(a, b - 1)[:, None] + (0, 1) for a, b in pairwise(starts)])
        points = np.concatenate(lines)
    else:
        points, cells, *_ = marching_cubes(wide, isovalue)
    return points - np.array([before for before, _ in extra]), cells.astype(np.int64)


def continued(contour: isocodec.Contour, periodic: Sequence[int]) -> tuple[Array, NDArray[np.int64]]:
    """Points and pieces of a contour with copies of it on either side."""
    periods = np.array([contour.shape[a] - 1 if a in periodic else 0 for a in range(len(contour.shape))])
    shifts = list(product(*((-1, 0, 1) if period else (0,) for period in periods)))
    points = np.concatenate([contour.points + periods * np.array(shift) for shift in shifts])
    cells = np.concatenate([contour.cells + number * len(contour.points) for number in range(len(shifts))])
    near = ((points >= -BEYOND) & (points < np.array(contour.shape) + BEYOND)).all(axis=1)
    return points, cells[near[cells].any(axis=1)]


def farthest(one: tuple[Array, NDArray[np.int64]], other: tuple[Array, NDArray[np.int64]], last: Array) -> float:
    """Largest distance from the one curve, between the ends of the grid, to the other one."""
    dense = spread(*one)
    dense = dense[((dense >= 0) & (dense <= last)).all(axis=1)]
    if len(last) == 2:
        return float(shapely.distance(shapely.points(dense), shapely.MultiLineString(list(other[0][other[1]]))).max())
    faces = np.insert(other[1], 0, 3, axis=1).ravel()
    surface = pyvista.PolyData(other[0].astype(float), faces)
    return float(np.abs(pyvista.PolyData(dense).compute_implicit_distance(surface)["implicit_distance"]).max())


def spread(points: Array, cells: NDArray[np.int64], parts: int = 4) -> Array:
    """Points all over segments or triangles."""
    weights = np.array([w for w in product(range(parts + 1), repeat=cells.shape[1]) if sum(w) == parts]) / parts
    return np.unique(np.einsum("wn,cnd->cwd", weights, points[cells]).reshape(-1, points.shape[1]), axis=0)


def apart(contour: isocodec.Contour, field: NDArray[Any], periodic: Sequence[int], isovalue: float) -> float:
    """Largest distance between the curves, from either to the other, both continued beyond the ends."""
    last = np.array(contour.shape) - 1.0
    ours, found = continued(contour, periodic), theirs(field, periodic, isovalue)
    return max(farthest(ours, found, last), farthest(found, ours, last))


# -- topology ------------------------------------------------------------------------------------------------------


def counted(first: Sequence[NDArray[np.int64]], count: int) -> tuple[int, NDArray[np.int64]]:
    """Number of components of a graph of so many nodes, from pairs of nodes, and that of each node."""
    pairs = np.concatenate([np.reshape(each, (-1, 2)) for each in first])
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    number, label = connected_components(graph, directed=False)
    return int(number), label


def drawn_topology(contour: isocodec.Contour, periodic: Sequence[int], turns: int) -> tuple[int, int]:
    """Components, and Euler characteristic, of a contour that goes round some times."""
    points, cells = glued(contour, periodic, turns)
    number, _ = counted([cells[:, [i, i + 1]] for i in range(cells.shape[1] - 1)], len(points))
    if points.shape[1] == 2:
        return number, len(points) - len(cells)
    sides = np.unique(np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(3)]), axis=1), axis=0)
    return number, len(points) - len(sides) + len(cells)


def true_topology(signs: NDArray[np.bool_], periodic: Sequence[int], turns: int) -> tuple[int, int]:
    """The same by brute force, from the signs of all samples of the field as it is given."""
    n = signs.ndim
    shape = np.array(signs.shape)
    goes = np.array([axis in periodic for axis in range(n)])
    lattice = np.where(goes, turns * shape, shape)
    lower = np.stack(np.meshgrid(*(np.arange(size - (not g)) for size, g in zip(lattice, goes, strict=True)),
                                 indexing="ij"), -1).reshape(-1, n)
    # the diagonal of a cell begins at its corner with even indices, which are counted anew each time round
    odd = lower % shape % 2
    paths = []
    for order in permutations(range(n)):
        here = np.zeros((len(lower), n), np.int64)
        path = [lower + (odd ^ here)]
        for axis in order:
            here[:, axis] = 1
            path.append(lower + (odd ^ here))
        paths.append(np.stack(path, axis=1))
    corner = np.concatenate(paths) % lattice
    name = np.ravel_multi_index(tuple(np.moveaxis(corner, -1, 0)), tuple(lattice))
    above = signs[tuple(np.moveaxis(corner % shape, -1, 0))]
    mixed = above.any(axis=1) & ~above.all(axis=1)
    name, above = name[mixed], above[mixed]
    edges: list[NDArray[np.int64]] = []
    links: list[NDArray[np.int64]] = []
    for i, j in combinations(range(n + 1), 2):
        crossed = above[:, i] != above[:, j]
        ends = np.sort(name[:, [i, j]], axis=1)
        edges.append(np.where(crossed, ends[:, 0] * lattice.prod() + ends[:, 1], -1))
    crossings, number = np.unique(np.stack(edges, axis=1), return_inverse=True)
    number = number.reshape(len(name), -1)
    none = crossings[0] == -1 if len(crossings) else False
    for i, j in combinations(range(number.shape[1]), 2):
        both = (number[:, i] > 0) & (number[:, j] > 0) if none else np.ones(len(number), np.bool_)
        links.append(number[both][:, [i, j]])
    total, _ = counted(links, len(crossings))
    euler = len(crossings) - int(none)
    if n == 3:
        faces = np.sort(np.concatenate([np.delete(name, i, axis=1) for i in range(4)]), axis=1)
        sides = np.concatenate([np.delete(above, i, axis=1) for i in range(4)])
        euler += len(name) - len(np.unique(faces[sides.any(axis=1) & ~sides.all(axis=1)], axis=0))
    else:
        euler -= len(name)
    return total - int(none), euler


def layers_of(data: bytes) -> Iterator[isocodec.Contour]:
    file = isocodec.open(data)
    for number in range(1, len(file.info.layers) + 1):
        yield file.contour(layers=number)


# -- the matrix ----------------------------------------------------------------------------------------------------


@cache
def known(where: str) -> NDArray[np.int32]:
    shape, periodic, seed = AXES[where]
    return waves(shape, periodic, seed, 4 - len(shape))


@cache
def other_cubes(where: str) -> float:
    """How far the exact curve lies from that of the other library."""
    field, periodic = known(where), AXES[where][1]
    whole = isocodec.decode(isocodec.encode(around(field, periodic), LEVEL, precision="exact"))
    found = apart(whole, field, periodic, LEVEL)
    assert found < (1e-6 if field.ndim == 2 else CUBES)
    return found


@cache
def known_topology(where: str) -> tuple[int, int]:
    """Of the field that goes round twice, where what winds around differs from what does not."""
    return true_topology(known(where) > LEVEL, AXES[where][1], 2)


@pytest.mark.cover(2)
@pytest.mark.parametrize("topology", [False, True])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("where", AXES if HEAVY else ["torus", "pipe"])
def test_every_way_on_every_axis(where: str, way: str, topology: bool) -> None:
    _, periodic, _ = AXES[where]
    options, within = WAYS[way]
    if topology and "plan" in way:
        with pytest.raises(OptionError, match="a plan and keep_topology cannot be combined"):
            isocodec.encode(np.eye(9), 0.5, keep_topology=True, **options)
        return
    field = known(where)
    data = isocodec.encode(around(field, periodic), LEVEL, keep_topology=topology, **options)
    contour = isocodec.decode(data)
    assert contour.placement is not None and contour.placement.periodic == periodic and len(contour.cells) > 5
    assert open_ends(contour, periodic) == 0
    if within is not None:
        assert apart(contour, field, periodic, LEVEL) <= within + other_cubes(where) + 1e-6
        (found,) = isocodec.open(data).verify(around(field, periodic), within=within or None)
        assert found.kept
    if topology or way == "topology":
        truth = known_topology(where)
        drawn = layers_of(data) if topology else [contour]
        assert {drawn_topology(one, periodic, 2) for one in drawn} == {truth}


@examples(60)
@given(st.data())
def test_rough_fields_on_small_grids(data: st.DataObject) -> None:
    """Grids of 3 samples and more, where all is ambiguous: no seam, and the topology where it is kept."""
    n = data.draw(st.sampled_from([2, 2, 3]))
    least, most = (9, 20) if n == 2 else (5, 6)
    # one that is long enough for the levels that are asked for
    others = data.draw(st.lists(st.integers(3, most), min_size=n - 1, max_size=n - 1))
    shape = data.draw(st.integers(least, most)), *others
    periodic = tuple(sorted(data.draw(st.sets(st.integers(0, n - 1), min_size=1))))
    rng = np.random.default_rng(data.draw(st.integers(0, 1 << 20)))
    rough = data.draw(st.integers(1, 400))
    field = waves(shape, periodic, int(rng.integers(1 << 20)), 3) + rng.integers(0, rough, shape)
    way = data.draw(st.sampled_from([way for way in WAYS if way != "plan of distances"]))
    topology = "plan" not in way and data.draw(st.booleans())
    file = isocodec.encode(around(field, periodic), LEVEL, keep_topology=topology, **WAYS[way][0])
    for contour in layers_of(file) if topology else [isocodec.decode(file)]:
        assert open_ends(contour, periodic) == 0
        for turns in (1, 2) if topology else ():
            assert drawn_topology(contour, periodic, turns) == true_topology(field > LEVEL, periodic, turns)


# -- what else a file may have -------------------------------------------------------------------------------------


SEARCHED = {"precision 1.2": {"precision": 1.2}, "precision 2,0.5": {"precision": "2,0.5"},
            "criterion": {"layers": "distortion=1"}, "topology": {"precision": 1.2, "keep_topology": True}}


def at_ends(contour: isocodec.Contour, axis: int) -> list[set[tuple[float, ...]]]:
    """Places of the points at either end of an axis."""
    points = contour.points.round(9)
    return [set(map(tuple, np.delete(points[points[:, axis] == end], axis, axis=1).tolist()))
            for end in (0, contour.shape[axis] - 1)]


@looped("way", SEARCHED)
@looped("where", ["torus", *heavy("pipe")])
def test_several_isovalues(where: str, way: str) -> None:
    """They go on across the seam, and do not cross one another."""
    _, periodic, _ = AXES[where]
    field = known(where)
    isovalues = [40.5, 60.5, -200.5]
    file = isocodec.open(isocodec.encode(around(field, periodic), isovalues, **SEARCHED[way]))
    contours = file.contours()
    assert all(len(one.cells) and open_ends(one, periodic) == 0 for one in contours)
    assert all(one.kept is not False for one in file.verify(around(field, periodic)))
    if field.ndim == 2 and way == "precision 1.2":
        lines = [shapely.MultiLineString(list(one.points[one.cells])) for one in contours]
        assert not any(shapely.crosses(one, other) for i, one in enumerate(lines) for other in lines[:i])


@looped("way", SEARCHED)
@looped("where", ["torus", "all round"])
def test_missing_samples(where: str, way: str) -> None:
    """At the seam, too: curves end there at both ends alike."""
    shape, periodic, seed = AXES[where]
    field = known(where)
    axis = periodic[0]
    at, beside = (np.indices(shape) + 3)[[axis, axis - 1]] % np.array(shape)[([axis, axis - 1], *[None] * len(shape))]
    # those on one side of the seam as those on the other: else what lies in it may belong to one end alone
    gone = np.where(at < 6, beside < 4, np.random.default_rng(seed).random(shape) < 0.04)
    placed = isocodec.Field(field, mask=gone, placement=Placement(periodic=periodic))
    file = isocodec.open(isocodec.encode(placed, LEVEL, **SEARCHED[way]))
    assert len(file.contour().cells)
    one, other = at_ends(file.contour(), axis)
    assert one == other and one
    assert all(one.kept is not False for one in file.verify(placed))


# -- mapped grids --------------------------------------------------------------------------------------------------


MAPPED: dict[str, Callable[[], tuple[Array, list[Array]]]] = {
    "radial": grids.polar, "elliptic": grids.elliptic,
}


@looped(("cells", "topology"), [(0.4, False), (1.5, False), (1.5, True)])
@looped("grid", MAPPED)
def test_distances_on_mapped_grids(grid: str, cells: float, topology: bool) -> None:
    """In the world, both ways, against the curve of scikit-image put there by scipy; smaller than on the full grid."""
    field, arrays = MAPPED[grid]()
    arrays_ = [closed(a) for a in arrays]
    step = max(np.hypot(*(np.diff(a, axis=axis) for a in arrays_)).max() for axis in (0, 1))
    distance = cells * step
    placed = grids.placed(field, arrays, periodic=1, unit="m")
    data = isocodec.encode(placed, 0.003, precision=f"{distance:.9f}m", keep_topology=topology)
    contour = isocodec.decode(data)
    lines = [contour.place(shapely.get_coordinates(shapely.segmentize(shapely.LineString(line), 0.1)))
             for line in contour.lines]
    dense = [shapely.get_coordinates(shapely.segmentize(shapely.LineString(line), 0.1))
             for line in find_contours(closed(field), 0.003)]
    whole = [np.stack([grids.interpolated(a, line) for a in arrays_], 1) for line in dense]
    ours, found = shapely.MultiLineString(lines), shapely.MultiLineString(whole)
    for one, other in ((ours, found), (found, ours)):
        points = shapely.points(shapely.get_coordinates(one))
        assert shapely.distance(points, other).max() <= distance + 1e-9
    rings = contour.__geo_interface__["coordinates"]
    assert rings and all(ring[0] == ring[-1] for ring in rings)
    areas = [shapely.geometry.shape(contour.areas(above=side)) for side in (True, False)]
    assert all(area.is_valid for area in areas)
    sides = [shapely.Polygon(np.stack([a[row] for a in arrays], 1)) for row in (0, -1)]
    assert sum(area.area for area in areas) == pytest.approx(sides[1].area - sides[0].area, rel=1e-3)
    assert len(data) < len(isocodec.encode(placed, 0.003, precision=f"{0.05 * step:.9f}m"))


def closed(field: Array) -> Array:
    return np.concatenate([field, field[:, :1]], axis=1)


# -- what is refused -----------------------------------------------------------------------------------------------


OPEN: dict[str, Any] = {
    "cells that are no squares": plan("base 5\noffsets 3"), "rounds that end between squares": plan("base 4\nrefine 1"),
    "leaves of another isovalue": {40.5: plan("base 4"), 60.5: plan("leaf-base")},
    "a mesh that is given": [("adaptive_base", 0, every_vertex((30, 41)))],
}
"""Plans whose last mesh may differ at the ends."""
CLOSED: dict[str, Any] = {
    "leaves on the full grid": {40.5: plan("base 4\nrefine"), 60.5: plan("leaf-base\noffsets 3")},
    "more rounds": plan("base 5\nrefine 1\noffsets 3"),
    "a criterion and rounds": plan("base 2\nadapt topology\nrefine\noffsets 3"),
}


@pytest.mark.parametrize("name", OPEN)
def test_plans_that_could_leave_a_seam(name: str) -> None:
    """Refused with a remedy; where coordinates alone show that the axis is periodic, it stays open, with a warning."""
    shape, periodic, seed = AXES["cylinder"]
    field = waves(shape, periodic, seed)
    isovalue = list(OPEN[name]) if isinstance(OPEN[name], dict) else LEVEL
    with pytest.raises(OptionError, match="periodic axes and this plan cannot be combined") as caught:
        isocodec.encode(around(field, periodic), isovalue, layers=OPEN[name])
    assert "full grid" in str(caught.value) and "multiple of 2" in str(caught.value)
    if name == "a mesh that is given":
        return
    placed = grids.placed(field, [np.arange(29.0), np.arange(40) * 9.0], periodic=1, periods=(360.0, 0), inferred=True)
    with pytest.warns(UserWarning, match="axis 1 is not treated as periodic, because the last mesh of the plan"):
        data = isocodec.encode(placed, isovalue, layers=OPEN[name])
    assert isocodec.open(data).info.shape == shape


@pytest.mark.parametrize("name", CLOSED)
def test_plans_that_leave_none(name: str) -> None:
    shape, periodic, seed = AXES["cylinder"]
    isovalue = list(CLOSED[name]) if isinstance(CLOSED[name], dict) else LEVEL
    file = isocodec.open(isocodec.encode(around(waves(shape, periodic, seed), periodic), isovalue, layers=CLOSED[name]))
    assert all(len(one.cells) and open_ends(one, periodic) == 0 for one in file.contours())
