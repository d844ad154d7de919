"""Meshes for tests of explicit domains, and their contours by brute force. Nothing here uses the codec."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from libraries import Late

Delaunay = Late("scipy.spatial.Delaunay")

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]


def plane(seed: int, count: int = 40, kept: float = 0.9) -> Mesh:
    """A triangulation of random points of which some triangles are left out: holes, pieces, points without cells."""
    rng = np.random.default_rng(seed)
    points = rng.random((count, 2)) * 100
    cells = Delaunay(points).simplices.astype(np.int64)
    cells = cells[rng.random(len(cells)) < kept]
    turned = rng.random(len(cells)) < 0.5
    cells[turned] = cells[turned][:, [1, 0, 2]]
    return points, cells[rng.permutation(len(cells))]


def space(seed: int, count: int = 30, kept: float = 0.9) -> Mesh:
    """Tetrahedra of random points, likewise."""
    rng = np.random.default_rng(seed)
    points = rng.random((count, 3)) * 100
    cells = Delaunay(points).simplices.astype(np.int64)
    return points, cells[rng.random(len(cells)) < kept]


def torus(around: int = 12, across: int = 8) -> Mesh:
    """Triangles of a torus in space: a surface with a handle and no border."""
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    u, v = 2 * np.pi * i / around, 2 * np.pi * j / across
    points = np.stack([(3 + np.cos(v)) * np.cos(u), (3 + np.cos(v)) * np.sin(u), np.sin(v)], axis=-1).reshape(-1, 3)

    def number(a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
        return ((a % around) * across + b % across).ravel()

    first = np.stack([number(i, j), number(i + 1, j), number(i + 1, j + 1)], axis=1)
    second = np.stack([number(i, j), number(i + 1, j + 1), number(i, j + 1)], axis=1)
    return points, np.concatenate([first, second])


def crossings(mesh: Mesh, values: NDArray, isovalue: float) -> dict[tuple[int, int], NDArray[np.float64]]:
    """The point of each edge of the mesh whose ends lie on both sides, by linear interpolation."""
    points, cells = mesh
    out = {}
    for cell in cells.tolist():
        for a, b in combinations(sorted(cell), 2):
            if (values[a] > isovalue) != (values[b] > isovalue):
                s = (isovalue - float(values[a])) / (float(values[b]) - float(values[a]))
                out[a, b] = points[a] + s * (points[b] - points[a])
    return out


def pieces(mesh: Mesh, values: NDArray, isovalue: float) -> list[set[tuple[int, int]]]:
    """For each crossed cell the edges that it is crossed on."""
    out = []
    for cell in mesh[1].tolist():
        edges = {
            (a, b) for a, b in combinations(sorted(cell), 2) if (values[a] > isovalue) != (values[b] > isovalue)
        }
        if edges:
            out.append(edges)
    return out


def euler(points: int, cells: NDArray[np.int64]) -> int:
    """Euler characteristic of a curve or surface of which all points are used."""
    edges = {tuple(sorted(pair)) for cell in cells.tolist() for pair in combinations(cell, 2)}
    return points - len(edges) + (len(cells) if cells.shape[1] == 3 else 0)


def components(points: int, cells: NDArray[np.int64]) -> int:
    """Connected pieces, points that no cell has counted too."""
    root = list(range(points))

    def find(x: int) -> int:
        while root[x] != x:
            root[x] = root[root[x]]
            x = root[x]
        return x

    for cell in cells.tolist():
        for other in cell[1:]:
            root[find(other)] = find(cell[0])
    return len({find(x) for x in range(points)})
