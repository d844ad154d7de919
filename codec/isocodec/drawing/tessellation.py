"""The mesh itself: simplices with their levels, vertices with their signs; the whole mesh, or only its crossed part.

The mesh of a decoded state consists of the uniform mesh of a level and a set of more vertices, closed under parents
(spec clause 4.7). It is reconstructed by bisecting from the root cube (clauses 4.1, 4.2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..field.placement import Placement
from ..mesh.complex import volumes

_KEY_BITS = 63
"""Number of bits of the key of a lattice point, divided equally among its coordinates."""
_SIMPLEX = 300
"""Most memory for bisecting, inferring signs and the mesh itself, in bytes per simplex."""


@dataclass(frozen=True, eq=False)
class Tessellation:
    """A conforming mesh of triangles (n = 2) or tetrahedra (n = 3).

    Attributes
    ----------
    points : (V, n) int64 or float64
        Vertices as sample indices, inside the grid; on a mesh or a surface, their coordinates.
    cells : (M, n + 1) int64
        Indices into ``points``; in index coordinates, all simplices have positive volume.
    levels : (M,) int64
        Level of each simplex; n bisections halve its cube.
    above : (V,) bool
        Whether the value at a vertex is greater than the isovalue.
    isovalue : float
    shape : tuple of int
        Samples along each axis of the grid.
    complete : bool
        False if the file had not arrived completely.
    placement : Placement or None
        As for `Contour`.
    metadata : dict of str to str
    """

    points: NDArray[Any]
    cells: NDArray[np.int64]
    levels: NDArray[np.int64]
    above: NDArray[np.bool_]
    isovalue: float
    shape: tuple[int, ...]
    complete: bool = True
    placement: Placement | None = None
    metadata: dict[str, str] = field(default_factory=dict)


def tessellated(
    shape: tuple[int, ...], exponent: int, level: int, explicit: NDArray[np.int64], check: Callable[[int], object]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Make vertices (V, n) in lexicographic order, simplices (M, n + 1) and levels (M,) of a mesh that fills the grid.

    The root cube has the edge ``2**exponent``. The mesh is uniform up to ``level``; ``explicit`` (W, n) are the
    unclamped positions of the vertices beyond. ``check`` is called with the bytes of the mesh so far, and raises an
    error if they are too many.
    """
    n = len(shape)
    inside = np.sort(_keys(explicit))
    last = np.array(shape) - 1
    growing = _roots(n, exponent)
    done: list[tuple[NDArray[np.int64], int]] = []
    count = 0
    for here in range(n * exponent + 1):
        check(_SIMPLEX * (count + 2 * len(growing)))
        tag = n - here % n
        middles = (growing[:, 0] + growing[:, tag]) // 2
        split = np.full(len(growing), here < level) | _found(_keys(middles), inside)
        split &= here < n * exponent
        done.append((np.minimum(growing[~split], last), here))
        count += len(done[-1][0])
        growing, middle = growing[split], middles[split, None]
        growing = np.concatenate(
            [
                np.concatenate([growing[:, :tag], middle, growing[:, tag + 1 :]], axis=1),
                np.concatenate([growing[:, 1 : tag + 1], middle, growing[:, tag + 1 :]], axis=1),
            ]
        )
        # simplices without volume inside the grid have no parts with volume (clause 4.6)
        growing = growing[volumes(np.minimum(growing, last)) != 0]
    corners = np.concatenate([simplices for simplices, _ in done])
    levels = np.concatenate([np.full(len(simplices), here) for simplices, here in done])
    keys, cells = np.unique(_keys(corners.reshape(-1, n)), return_inverse=True)
    bits = _KEY_BITS // n
    points = np.stack([keys >> bits * (n - 1 - a) & ((1 << bits) - 1) for a in range(n)], axis=1)
    return points, oriented(points, cells.reshape(-1, n + 1)), levels


def compact(
    position: NDArray[np.int64], above: NDArray[np.bool_], simplices: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:
    """Find the vertices of simplices and their signs, and orient the simplices."""
    used, cells = np.unique(simplices, return_inverse=True)
    return position[used], above[used], oriented(position[used], cells.reshape(simplices.shape))


def oriented(points: NDArray[np.int64], cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Exchange the last two vertices of simplices with negative volume."""
    out = cells.copy()
    turned = volumes(points[cells]) < 0
    out[turned, -2:] = out[turned, :-3:-1]
    return out


def inferred(
    points: NDArray[np.int64], cells: NDArray[np.int64], known: NDArray[np.int64], above: NDArray[np.bool_],
    origin_above: bool,
) -> NDArray[np.bool_]:
    """Infer the signs of all vertices of a mesh from the known ones (spec clause 5.5.4).

    All simplices that the curve crosses have known vertices, so that the vertices of any other simplex have one sign.
    ``points`` (V, n) are in lexicographic order; ``known`` (K, n) are the positions of the known vertices, ``above``
    (K,) their signs. If nothing is known, all have the sign of the origin.
    """
    keys = _keys(points)
    sign = np.full(len(points), -1, np.int8)
    place = np.minimum(np.searchsorted(keys, _keys(known)), max(len(keys) - 1, 0))
    there = keys[place] == _keys(known) if len(keys) else np.zeros(len(known), bool)
    sign[place[there]] = above[there]
    while len(cells):
        of = sign[cells]
        told = of.max(axis=1)
        touched = (told >= 0) & (of.min(axis=1) < 0)
        if not touched.any():
            break
        sign[cells[touched]] = np.where(of[touched] < 0, told[touched, None], of[touched])
        cells = cells[of.min(axis=1) < 0]
    sign[sign < 0] = origin_above
    return sign == 1


def _roots(n: int, exponent: int) -> NDArray[np.int64]:
    """The Kuhn simplices of the root cube (n!, n + 1, n), x0 first."""
    paths = []
    for order in permutations(range(n)):
        steps = np.zeros((n + 1, n), np.int64)
        steps[range(1, n + 1), order] = 1
        paths.append(np.cumsum(steps, axis=0) << exponent)
    return np.array(paths)


def _keys(position: NDArray[np.int64]) -> NDArray[np.int64]:
    """Compute a key for each lattice point; keys have lexicographic order."""
    n = position.shape[1]
    key = np.zeros(len(position), np.int64)
    for a in range(n):
        key |= position[:, a] << _KEY_BITS // n * (n - 1 - a)
    return key


def _found(keys: NDArray[np.int64], among: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Find which keys are among other, sorted keys."""
    if not len(among):
        return np.zeros(len(keys), bool)
    return np.asarray(among[np.minimum(np.searchsorted(among, keys), len(among) - 1)] == keys)
