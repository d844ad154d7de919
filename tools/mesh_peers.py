"""Contours on meshes against what else there is: python tools/mesh_peers.py merimbula.npz | tetrahedra

Curves: matplotlib's tricontour as TWKB with brotli. Surfaces: VTK's contour as Draco. Errors are mean distances of
points along one curve or surface from the other, both ways; files of ours are made with the error of the peer's or
less.
"""

from __future__ import annotations

import sys
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import isocodec

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]
DEPTHS = [-8, -5, -3, -2, -1, -0.5, -0.25, 0]
"""Eight isovalues of the lake."""
SAMPLES = 200
"""Points along a curve for each median edge of the mesh, in hundredths; points of surfaces for each triangle."""


def varint(number: int) -> bytes:
    """As of TWKB: zigzag, the lowest seven bits first."""
    u = (number << 1) ^ (number >> 63)
    out = bytearray()
    while u > 127:
        out.append(u & 127 | 128)
        u >>= 7
    return bytes([*out, u])


def twkb(lines: list[NDArray[np.float64]], unit: float) -> tuple[bytes, list[NDArray[np.float64]]]:
    """Lines rounded to a unit as a multi-line TWKB with brotli, and as they are then."""
    import brotli

    out = bytearray([5, 0]) + varint(len(lines))
    before = np.zeros(2, np.int64)
    rounded = []
    for line in lines:
        places = np.rint(line / unit).astype(np.int64)
        places = places[np.r_[True, np.any(places[1:] != places[:-1], axis=1)]]
        rounded.append(places * unit)
        out += varint(len(places))
        for step in np.diff(places, axis=0, prepend=before[None]).ravel().tolist():
            out += varint(step)
        before = places[-1]
    return brotli.compress(bytes(out)), rounded


def tricontour(mesh: Mesh, values: NDArray[np.float64], isovalue: float) -> list[NDArray[np.float64]]:
    """Lines of matplotlib."""
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation

    drawn = Figure().add_subplot().tricontour(Triangulation(*mesh[0].T, mesh[1]), values, levels=[isovalue])
    return [part.vertices for path in drawn.get_paths() for part in path._iter_connected_components()]


def along(lines: list[NDArray[np.float64]], step: float) -> NDArray[np.float64]:
    """Points along lines."""
    out = []
    for line in lines:
        for a, b in pairwise(line):
            count = int(np.ceil(np.linalg.norm(b - a) / step)) + 1
            out.append(a + np.linspace(0, 1, count)[:, None] * (b - a))
    return np.concatenate(out)


def over(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Points over triangles: corners, and some within, the same ones of all."""
    share = np.random.default_rng(0).dirichlet([1, 1, 1], 12)
    return np.concatenate([points, np.einsum("sk,mkd->msd", share, points[cells]).reshape(-1, 3)])


def apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Mean distance, both ways."""
    return float((cKDTree(a).query(b)[0].mean() + cKDTree(b).query(a)[0].mean()) / 2)


def plane(path: str, isovalues: list[float]) -> None:
    """Curves on a triangulation of the plane: each alone with the mesh known, and all with the mesh in the file."""
    arrays = np.load(path)
    mesh, values = (arrays["points"], arrays["cells"].astype(np.int64)), arrays["values"]
    corners = mesh[0][mesh[1]]
    edge = float(np.median(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)))
    lines = [tricontour(mesh, values, isovalue) for isovalue in isovalues]
    exact = [along(each, edge / SAMPLES) for each in lines]
    unit = edge / 35
    peers = [twkb(each, unit) for each in lines]
    errors = [apart(along(rounded, edge / SAMPLES), curve) for (_, rounded), curve in zip(peers, exact, strict=True)]
    for isovalue, (data, _), error, curve in zip(isovalues, peers, errors, exact, strict=True):
        for walk in (False, True):
            ours, found = nearest(mesh, values, [isovalue], [curve], error, edge, progressive=not walk)
            name = "along the curve" if walk else "level by level"
            print(
                f"{isovalue:8g} known, {name}: {len(ours)} bytes at {found:.3f}, peer {len(data)} at {error:.3f}: "
                f"{len(ours) / len(data):.3f}"
            )
    total, mean = sum(len(data) for data, _ in peers), float(np.mean(errors))
    for share in (0.035, 0.05, 0.052, 0.07):
        ours, found = nearest(mesh, values, isovalues, exact, mean, edge, mesh="coded", mesh_error=share * edge)
        print(
            f"{len(isovalues)} isovalues, mesh coded to {share} edges: {len(ours)} bytes at {found:.3f}, "
            f"peers {total} at {mean:.3f}: {len(ours) / total:.3f}"
        )


def nearest(
    given: Mesh, values: NDArray[np.float64], isovalues: list[float], exact: list[NDArray[np.float64]], error: float,
    edge: float, **options: object,
) -> tuple[bytes, float]:
    """The smallest of our files that has the error, and its error; that of the least tolerance if none has."""
    for tolerance in error * np.array([4, 3.4, 2.9, 2.5, 2.3, 2.1, 1.95, 1.8, 1.65, 1.5, 1.2, 0.9, 0.6, 0.3]):
        data = isocodec.encode(isocodec.Mesh(*given, values), isovalues, precision=tolerance, **options)  # type: ignore[arg-type]
        drawn = isocodec.open(data, mesh=given).contours()
        if given[1].shape[1] == 3:
            places = [along(contour.lines, edge / SAMPLES) for contour in drawn]
        else:
            places = [over(contour.points, contour.cells) for contour in drawn]
        found = float(np.mean([apart(a, b) for a, b in zip(places, exact, strict=True)]))
        if found <= error:
            break
    return data, found


def tetrahedra(side: int = 33) -> None:
    """A smooth solution on some 200,000 tetrahedra of moved grid points."""
    import DracoPy
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).astype(float)
    inner = grid[1:-1, 1:-1, 1:-1]
    inner += rng.uniform(-0.2, 0.2, inner.shape)
    points = grid.reshape(-1, 3)
    corner = np.arange(side**3).reshape(side, side, side)[:-1, :-1, :-1].ravel()
    steps = np.array([side * side, side, 1])
    cells = np.concatenate([
        np.stack([corner, corner + steps[a], corner + steps[a] + steps[b], corner + steps.sum()], axis=1)
        for a, b in ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
    ])
    x = points / (side - 1) * 2 - 1
    values = (x**2).sum(axis=1) + 0.3 * np.sin(4 * x[:, 0]) * np.cos(5 * x[:, 1]) * np.sin(3 * x[:, 2])
    mesh = points, cells.astype(np.int64)
    block = vtk.vtkUnstructuredGrid()
    places = vtk.vtkPoints()
    places.SetData(numpy_to_vtk(points, deep=True))
    block.SetPoints(places)
    table = vtk.vtkCellArray()
    offsets = np.arange(0, 4 * len(cells) + 1, 4)
    table.SetData(numpy_to_vtkIdTypeArray(offsets, deep=True), numpy_to_vtkIdTypeArray(mesh[1].ravel(), deep=True))
    block.SetCells(vtk.VTK_TETRA, table)
    scalars = numpy_to_vtk(values, deep=True)
    scalars.SetName("f")
    block.GetPointData().SetScalars(scalars)
    contour = vtk.vtkContourFilter()
    contour.SetInputData(block)
    contour.SetValue(0, 0.5)
    contour.Update()
    surface = contour.GetOutput()
    drawn = vtk_to_numpy(surface.GetPoints().GetData()).astype(float)
    triangles = vtk_to_numpy(surface.GetPolys().GetData()).reshape(-1, 4)[:, 1:].astype(np.int64)
    exact = over(drawn, triangles)
    print(f"{len(cells)} tetrahedra, {len(drawn)} points, {len(triangles)} triangles")
    for bits in (9, 10, 11):
        data = DracoPy.encode(drawn.astype(np.float32), triangles.astype(np.uint32), quantization_bits=bits,
                              compression_level=10)
        back = DracoPy.decode(data)
        error = apart(over(np.asarray(back.points, float), np.asarray(back.faces, np.int64)), exact)
        for kind in ("known", "coded"):
            options = {} if kind == "known" else {"mesh": "coded", "mesh_error": 0.05}
            ours, found = nearest(mesh, values, [0.5], [exact], error, 1.0, **options)
            domain = isocodec.open(ours).info.chunks[0].bytes
            print(
                f"{bits} bits, {kind}: {len(ours)} bytes ({domain} of the domain) at {found:.4f}, "
                f"Draco {len(data)} at {error:.4f}: {len(ours) / len(data):.3f}"
            )


if __name__ == "__main__":
    if sys.argv[1] == "tetrahedra":
        tetrahedra()
    else:
        plane(sys.argv[1], list(map(float, sys.argv[2:])) or DEPTHS)
