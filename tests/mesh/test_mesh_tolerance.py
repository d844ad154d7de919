"""Distances and topology that files on meshes keep, measured by VTK (docs/encoders.md, 6)."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray
from test_hierarchy import surface

import isocodec
from brute import HEAVY, INTERPRETED
from explicit_meshes import Mesh, components, euler, plane, space, torus
from isocodec import Mesh as Valued
from isocodec.errors import OptionError
from isocodec.search.mesh_cuts import MeshContour
from libraries import Late
from tables import heavy, looped

pyvista = Late("pyvista")
pytestmark = pytest.mark.skipif(INTERPRETED, reason="slow in Python, and the same")


def dented(seed: int) -> Mesh:
    """A torus with dents, of which some triangles are missing."""
    points, cells = torus(48, 24)
    rng = np.random.default_rng(seed)
    return points + rng.normal(size=points.shape) * 0.01, cells[rng.random(len(cells)) < 0.98]


MESHES = {
    "plane": lambda seed: plane(seed, 1000, 0.995), "surface": dented, "space": lambda seed: space(seed, 700, 0.995),
}
VALUE = -0.5
EDGES = (0.3, 1.0, 4.0)
"""Distances in median edges."""


def hills(points: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """Smooth values, with detail of the size of a few cells."""
    rng = np.random.default_rng(seed)
    size = np.ptp(points, axis=0).max()
    ways = rng.normal(size=(8, points.shape[1])) * np.repeat([2, 4, 8, 16], 2)[:, None] / size
    return (np.cos(points @ ways.T + rng.random(8) * 6) / np.repeat([1, 2, 4, 8], 2)).sum(axis=1)


def edge_of(mesh: Mesh) -> float:
    side = mesh[0][mesh[1][:, 1]] - mesh[0][mesh[1][:, 0]]
    return float(np.median(np.sqrt((side**2).sum(axis=1))))


def drawn(contour: isocodec.Contour) -> pyvista.PolyData:
    points = np.zeros((len(contour.points), 3))
    points[:, : contour.points.shape[1]] = contour.points
    cells = np.insert(contour.cells, 0, contour.cells.shape[1], axis=1).ravel()
    return pyvista.PolyData(points, lines=cells) if contour.cells.shape[1] == 2 else pyvista.PolyData(points, cells)


def sampled(contour: isocodec.Contour, parts: int = 4) -> NDArray[np.float64]:
    """Points all over the pieces."""
    corners = contour.cells.shape[1]
    weights = [w for w in np.ndindex(*(parts + 1,) * corners) if sum(w) == parts]
    points = np.einsum("wc,mcd->wmd", np.array(weights) / parts, contour.points[contour.cells])
    out = np.zeros((points.shape[0] * points.shape[1], 3))
    out[:, : contour.points.shape[1]] = points.reshape(-1, contour.points.shape[1])
    return out


def farthest(one: isocodec.Contour, other: isocodec.Contour) -> float:
    """Largest distance of points of one contour from another."""
    points = sampled(one)
    closest = drawn(other).find_closest_cell(points, return_closest_point=True)[1]
    return float(np.sqrt(((closest - points) ** 2).sum(axis=1)).max())


def whole_of(mesh: Mesh, values: NDArray[np.float64], isovalue: float) -> isocodec.Contour:
    """The contour of the whole mesh, very exactly."""
    data = isocodec.encode(Valued(*mesh, values, progressive=False), isovalue, precision=edge_of(mesh) / 1e6)
    return isocodec.open(data, mesh=mesh).contour()


@pytest.mark.parametrize("kind", ["plane", "surface", *heavy("space")])
def test_small_distances_are_kept_without_a_search(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Below a tenth of the median edge, alone and in steps; above, the search reports what it tries."""
    mesh = MESHES[kind](3)
    values, edge = hills(mesh[0], 3), edge_of(mesh)
    mesh, edge = (mesh[0] / edge, mesh[1]), 1.0
    whole, tried = whole_of(mesh, values, VALUE), list[tuple[int, int]]()

    def encoded(precision: float | str) -> isocodec.IsoFile:
        data = isocodec.encode(Valued(*mesh, values), VALUE, precision=precision,
                               progress=lambda *done: tried.append(done))
        return isocodec.open(data, mesh=mesh)

    encoded(0.3 * edge)
    assert tried and all(total == 0 for _, total in tried)
    tried.clear()
    monkeypatch.setattr(MeshContour, "cut", None)
    for distance in (0.099 * edge, 1e-3 * edge, 1e-5 * edge):
        contour = encoded(distance).contour()
        assert max(farthest(contour, whole), farthest(whole, contour)) <= distance + 2e-6 * edge
    file = encoded("0.09,0.02,0.002")
    ends = [number for number, layer in enumerate(file.info.layers, 1) if layer.kind == "offsets"]
    for distance, layers in zip((0.09, 0.02, 0.002), ends, strict=True):
        contour = file.contour(layers=layers)
        assert max(farthest(contour, whole), farthest(whole, contour)) <= distance + 2e-6 * edge
    within = [layer.within for layer in file.info.layers if layer.within is not None]
    assert not tried and np.allclose(within, [0.09, 0.02, 0.002], atol=1e-6)


@pytest.mark.cover(1)
@pytest.mark.parametrize("edges", EDGES)
@pytest.mark.parametrize("kind", MESHES)
def test_distances_are_kept(kind: str, edges: float) -> None:
    """Both ways; a file of signs and offsets of the whole mesh takes no fewer bytes."""
    smaller, seeds = 0, 3 if HEAVY else 1
    for seed in range(seeds):
        mesh = MESHES[kind](seed)
        values, distance = hills(mesh[0], seed), edges * edge_of(mesh)
        data = isocodec.encode(Valued(*mesh, values), VALUE, precision=distance)
        contour, original = isocodec.open(data, mesh=mesh).contour(), whole_of(mesh, values, VALUE)
        assert farthest(contour, original) <= distance * (1 + 1e-6)
        assert farthest(original, contour) <= distance * (1 + 1e-6)
        (found,) = isocodec.open(data, mesh=mesh).verify(Valued(*mesh, values))
        assert found.kept and found.wrong in (None, 0)
        whole = isocodec.encode(Valued(*mesh, values, progressive=False), VALUE, precision=distance)
        size, most = (sum(layer.bytes for layer in isocodec.open(one).info.layers) for one in (data, whole))
        assert size <= most + 8
        smaller += size < most
    assert smaller == seeds or edges < 4


@pytest.mark.cover(1)
@pytest.mark.parametrize("topology", [False, True])
@pytest.mark.parametrize("kind", MESHES)
def test_steps_that_end_in_exact_values(kind: str, topology: bool) -> None:
    """Layers before the last keep their distance; then points are bit for bit those of exact values alone."""
    mesh = MESHES[kind](5)
    values, edge = np.rint(1000 * hills(mesh[0], 5)).astype(np.int32), edge_of(mesh)
    isovalues, steps = [1000 * VALUE + 0.5, 1000 * VALUE + 40.5], (8 * edge, 3 * edge)
    given = Valued(*mesh, values)
    data = isocodec.encode(given, isovalues, precision=[*steps, "exact"], keep_topology=topology)
    file = isocodec.open(data, mesh=mesh)
    exact = isocodec.open(isocodec.encode(given, isovalues, precision="exact"), mesh=mesh)
    for found, wanted in zip(file.contours(), exact.contours(), strict=True):
        assert len(found.cells) and found.cells.shape == wanted.cells.shape
        assert np.array_equal(np.unique(found.points, axis=0), np.unique(wanted.points, axis=0))
    assert file.promise is not None and file.promise.endswith("all values exactly")
    for one in file.verify(given):
        assert one.kept and one.promised == 0
    chunks = [chunk for chunk in file.info.chunks if chunk.type == "layers"]
    kinds = [layer.kind for layer in file.info.layers]
    begins = [chunk.offset for chunk, layer in zip(chunks, kinds, strict=True) if layer == "cut"]
    assert kinds.count("cut") == 6 and kinds.count("values") == 2
    original = whole_of(mesh, values, isovalues[0])
    for step, end in zip(steps, begins[1:3], strict=True):
        contour = isocodec.open(data[:end], mesh=mesh).contour(partial=True)
        assert max(farthest(contour, original), farthest(original, contour)) <= step * (1 + 1e-6)
    with pytest.raises(OptionError, match="holds floats"):
        isocodec.encode(Valued(*mesh, hills(mesh[0], 5)), VALUE, precision=[*steps, "exact"])


def of_vtk(mesh: Mesh, values: NDArray[np.float64], isovalue: float) -> isocodec.Contour:
    """The contour of values on a mesh by VTK."""
    points, cells = np.zeros((len(mesh[0]), 3)), mesh[1]
    points[:, : mesh[0].shape[1]] = mesh[0]
    kind = pyvista.CellType.TRIANGLE if cells.shape[1] == 3 else pyvista.CellType.TETRA
    grid = pyvista.UnstructuredGrid({kind: cells}, points)
    found = grid.contour([isovalue], np.asarray(values, np.float64), compute_normals=False)
    pieces = found.lines.reshape(-1, 3) if cells.shape[1] == 3 else found.faces.reshape(-1, 4)
    return isocodec.Contour(np.asarray(found.points, np.float64), pieces[:, 1:], isovalue, ())


STORED = {
    "known": {}, "walk": {"progressive": False}, "coded": {"stored": "coded"},
    "levels in the file": {"stored": "coded", "progressive": True}, "whole": {"stored": "whole", "progressive": True},
    "whole, error": {"stored": "whole", "error": 0.2}, "points": {"stored": "delaunay"},
}
PRECISIONS = {
    "signs": "signs", "coarse": 3.0, "offsets": 0.05, "steps": "8,2,0.4", "fine steps": "4,0.3,0.15",
    "values": "6,2,exact", "exact": "exact",
}


@pytest.mark.cover(2)
@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("topology", [False, True])
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("stored", STORED)
@pytest.mark.parametrize("kind", MESHES)
def test_each_layer_keeps_what_it_states(kind: str, stored: str, precision: str, topology: bool, count: int) -> None:
    """Both ways, as the first layers alone are verified, too; the file that is cut there states the same of it."""
    how, text, whole = STORED[stored], PRECISIONS[precision], precision in ("values", "exact")
    stepwise = topology or "," in text if isinstance(text, str) else topology
    if (stored == "points" and kind != "plane") or (stored == "walk" and stepwise):
        pytest.skip("refused")
    points, cells = MESHES[kind](7)
    points = points / edge_of((points, cells))
    if stored == "points":
        points, cells = plane(7, 1000, 1.0)
        points = points / edge_of((points, cells))
    values = hills(points, 7)
    values = np.rint(1000 * values).astype(np.int32) if whole else values
    isovalues = [1000 * VALUE + 0.5, 1000 * VALUE + 90.5][:count] if whole else [VALUE, VALUE + 0.09][:count]
    given = Valued(points, None if stored == "points" else cells, values, unit="mm", **how)
    if precision == "values" and how.get("stored"):
        with pytest.raises(OptionError, match="both sides"):
            isocodec.encode(given, isovalues, precision=text, keep_topology=topology)
        return
    data = isocodec.encode(given, isovalues, precision=text, keep_topology=topology)
    known = None if how.get("stored") else (points, cells)
    info = isocodec.open(data, mesh=known).info
    assert info.topology == [topology] * count
    extra = 0.2 if "error" in how else 0.0
    asked = [] if precision in ("signs", "exact") else [float(x) + extra for x in str(text).split(",") if x != "exact"]
    originals = [of_vtk((points, cells), values, isovalue) for isovalue in isovalues]
    for number in range(count):
        own = [layer for layer in info.layers if layer.isovalue == number]
        stated = [layer.within for layer in own if layer.within and layer.kind != "levels"]
        assert np.allclose(stated, asked, atol=1e-3)
        if asked or (whole and known and not topology):
            assert own[-1].within == pytest.approx(0.0 if whole else asked[-1], abs=1e-3)
    for layers in range(1, len(info.layers) + 1):
        part = isocodec.open(isocodec.open(data, mesh=known).edited(layers=layers), mesh=known)
        layer, number = info.layers[layers - 1], info.layers[layers - 1].isovalue
        contour = part.contours(partial=True)[number]
        if layer.within is None:
            # nothing is drawn of a level that the curve does not cross
            assert layer.kind != "levels" or not asked or not len(contour.cells)
            continue
        # only the whole file states that values on a cut are exact
        assert part.info.layers[-1].within in (layer.within, None if layer.within == 0 else layer.within)
        assert len(contour.cells)
        far = max(farthest(contour, originals[number]), farthest(originals[number], contour))
        assert far <= layer.within + 2e-6, (layers, layer)
        verified = part.verify(Valued(points, cells, values))[number]
        assert verified.kept or (layer.within == 0 and verified.kept is None)
        assert max(verified.there, verified.back) <= layer.within + 1e-6 or layer.within == 0


def shape_of(contour: isocodec.Contour) -> tuple[int, int, int]:
    """Components, Euler characteristic, and ends or edges at the border."""
    cells = contour.cells
    sides = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(cells.shape[1])]), axis=1)
    _, count = np.unique(sides, axis=0, return_counts=True)
    return components(len(contour.points), cells), euler(len(contour.points), cells), int((count == 1).sum() > 0)


@pytest.mark.cover(1)
@pytest.mark.parametrize("precision", ["signs", "distance", "steps"])
@pytest.mark.parametrize("kind", ["plane", "surface", "space"])
def test_topology_is_kept(kind: str, precision: str) -> None:
    """In every layer, on meshes with borders and noise of the size of a cell."""
    makers = {"plane": lambda s: plane(s, 120, 0.93), "surface": surface, "space": lambda s: space(s, 80, 0.95)}
    for seed in range(300 if HEAVY else 4):
        mesh = makers[kind](seed)
        rng = np.random.default_rng(seed)
        values = hills(mesh[0], seed) + rng.normal(size=len(mesh[0])) * (0.5 if seed % 3 else 3)
        edge = edge_of(mesh)
        asked = {"signs": "signs", "distance": 2 * edge, "steps": (5 * edge, 2 * edge)}[precision]
        data = isocodec.encode(Valued(*mesh, values), VALUE, precision=asked, keep_topology=True)
        wanted = shape_of(whole_of(mesh, values, VALUE))
        chunks = [chunk for chunk in isocodec.open(data, mesh=mesh).info.chunks if chunk.type == "layers"]
        for chunk in chunks:
            contour = isocodec.open(data[: chunk.offset + chunk.bytes], mesh=mesh).contour(partial=True)
            assert shape_of(contour) == wanted


def test_curves_of_a_map_do_not_cross() -> None:
    mesh = plane(2, 1500, 0.99)
    values = hills(mesh[0], 2)
    isovalues = np.quantile(values, np.linspace(0.1, 0.9, 9)).tolist()
    data = isocodec.encode(Valued(*mesh, values), isovalues, precision=2 * edge_of(mesh))
    curves = [one.points[one.cells] for one in isocodec.open(data, mesh=mesh).contours()]
    assert not any(cross(one, other) for one, other in combinations(curves, 2))


def cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether segments (M, 2, 2) and others cross; to touch is not to cross."""

    def side(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.float64]:
        return (b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0]

    a, b, c, d = one[:, None, 0], one[:, None, 1], other[None, :, 0], other[None, :, 1]
    small = -1e-9
    return bool(((side(a, b, c) * side(a, b, d) < small) & (side(c, d, a) * side(c, d, b) < small)).any())


REFUSED = {
    "along the curve, steps": ({"progressive": False}, {"precision": (4.0, 1.0)}, "progressive"),
    "along the curve, topology": ({"progressive": False}, {"keep_topology": True}, "progressive"),
    "coded mesh, exact at last": ({"stored": "coded"}, {"precision": (4.0, "exact")}, "both sides"),
    "growing steps": ({}, {"precision": (1.0, 4.0)}, "decrease"),
}


@looped("name", REFUSED)
def test_refused(name: str) -> None:
    how, options, wanted = REFUSED[name]
    mesh = plane(1, 200)
    with pytest.raises(OptionError, match=wanted) as error:
        isocodec.encode(Valued(*mesh, np.rint(100 * hills(mesh[0], 1)).astype(int), **how), 10.5, **options)
    assert error.value.remedy
