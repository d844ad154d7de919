"""Meshes that no one would make, for the rules of the rounds in which vertices go (clauses 10.8.1, 10.8.2)."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from .explicit_dump import Mesh
from .fields import random_numbers

_SIDE = 60
"""Positions of a piece are below this."""
_NEAR = 9
"""Two vertices of a piece lie so near to one another along each axis."""
_TRIES = 200


def piece(n: int, seed: int) -> Mesh:
    """Grow random triangles or tetrahedra in space on free faces, folded as it comes; two vertices are close by."""
    numbers = iter(random_numbers(seed, 4000, 16))
    vertices, most = 6 + n - 1 + seed % 3, 7 + n + seed % 11
    points = [[next(numbers) % _SIDE for _ in range(3)] for _ in range(vertices)]
    points[-1] = [max(c + next(numbers) % _NEAR - _NEAR // 2, 0) for c in points[-2]]
    cells: list[list[int]] = []
    cells_at: dict[frozenset[int], int] = {}
    wanted = [vertices - 1, vertices - 2, *range(n - 1)]
    for _ in range(_TRIES):
        faces = [frozenset(face) for face in combinations(wanted, n)]
        fits = len(set(wanted)) == n + 1 and sorted(wanted) not in [sorted(cell) for cell in cells]
        if fits and all(cells_at.get(face, 0) < 2 for face in faces) and _has_volume([points[v] for v in wanted]):
            cells.append(wanted)
            cells_at.update({face: cells_at.get(face, 0) + 1 for face in faces})
        free = [sorted(face) for face, count in cells_at.items() if count == 1]
        if len(cells) == most or not free:
            break
        wanted = [*free[next(numbers) % len(free)], next(numbers) % vertices]
    return np.array(points), np.array(cells)


def _has_volume(corners: list[list[int]]) -> bool:
    """Whether a cell is not flat."""
    sides = [[a - b for a, b in zip(corner, corners[0], strict=True)] for corner in corners[1:]]
    (a, b, c), (d, e, f) = sides[:2]
    across = [b * f - c * e, c * d - a * f, a * e - b * d]
    return any(across) if len(sides) == 2 else sum(x * y for x, y in zip(across, sides[2], strict=True)) != 0


def simplex(n: int) -> Mesh:
    """All triangles of four points in space, or tetrahedra of five: two are close by, and nothing is around."""
    points = [[10, 10, 10], [12, 11, 9], [60, 0, 5], [0, 60, 3], [5, 5, 60]][: n + 2]
    return np.array(points), np.array([*combinations(range(n + 2), n + 1)])


def pinched(touching: int = 6, apart: int = 60) -> Mesh:
    """Two fans of tetrahedra that have some sides of a long edge in common, and nothing else."""
    count = 2 * apart + touching + 1
    middle = 5 * count
    axis = [[10 * i, 100, 100] for i in range(count)]
    rims = [[middle, 0, 60], [middle, 0, 140], [middle, 180, 140], [middle, 180, 60]]
    long = [[i, i + 1, count, count + 1] for i in range(count - 1)]
    short = [[i, i + 1, count + 2, count + 3] for i in range(apart, apart + touching)]
    return np.array(axis + rims), np.array(long + short)


def beside(*meshes: Mesh) -> Mesh:
    """Meshes next to one another."""
    points, cells, count, along = [], [], 0, 0
    for position, cell in meshes:
        points.append(position + np.array([along, 0, 0]))
        cells.append(cell + count)
        count += len(position)
        along += int(position[:, 0].max()) + _SIDE
    return np.concatenate(points), np.concatenate(cells)
