"""Drawings that tests share: leaves of uniform meshes over sampled fields, and what has to hold of a contour."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np

from isocodec.drawing.leaves import Leaves


def mesh(shape, size=1, bisections=0):
    """Simplices (M, n + 1, n) of reflected Kuhn cubes of edge `size`, bisected by Maubach's rule, clamped onto the box.

    Cubes of odd index along an axis are mirrored, so that x0 has even coordinates and xn odd ones (in units of `size`).
    """
    n = len(shape)
    cubes = np.moveaxis(np.indices([-(-(s - 1) // size) for s in shape]), 0, -1).reshape(-1, n)
    even, step = cubes + (cubes & 1), 1 - 2 * (cubes & 1)
    paths = [np.cumsum(np.eye(n, dtype=np.int64)[list(axes)], axis=0) for axes in itertools.permutations(range(n))]
    # Axes: permutations, cubes, x0 .. xn, coordinates.
    steps = np.pad(np.stack(paths), ((0, 0), (1, 0), (0, 0)))[:, None] * step[None, :, None]
    s = (even[None, :, None] + steps).reshape(-1, n + 1, n) * size
    for level in range(bisections):
        d = n - level % n
        z = (s[:, :1] + s[:, d : d + 1]) // 2
        s = np.concatenate(
            [np.concatenate([s[:, :d], z, s[:, d + 1 :]], 1), np.concatenate([s[:, 1 : d + 1], z, s[:, d + 1 :]], 1)]
        )
    s = np.minimum(s, np.array(shape) - 1)
    return s[np.abs(np.linalg.det((s[:, 1:] - s[:, :1]).astype(float))) > 0.5]


def rows_of(position, above):
    """Rows of vertices as `Leaves.vertex` has them."""
    rows = np.zeros((len(above), 4), np.int32)
    rows[:, : np.shape(position)[-1]] = position
    rows[:, 3] = above
    return rows


def leaves_of(field, isovalue=0.0, *, size=1, bisections=0, values=True, above=None):
    """Mixed leaves of a uniform mesh over a sampled field."""
    field = np.asarray(field)
    above = field > isovalue if above is None else above
    simplices = mesh(field.shape, size, bisections)
    signs = above[tuple(np.moveaxis(simplices, -1, 0))]
    simplices = simplices[signs.any(1) & ~signs.all(1)]
    flat = np.ravel_multi_index(tuple(np.moveaxis(simplices, -1, 0)), field.shape)
    used, index = np.unique(flat, return_inverse=True)
    return Leaves(
        shape=field.shape,
        isovalue=isovalue,
        vertex=rows_of(np.stack(np.unravel_index(used, field.shape), axis=-1), above.ravel()[used]),
        value=field.ravel()[used].astype(np.float64) if values else None,
        simplices=index.reshape(-1, field.ndim + 1),
        levels=np.full(len(simplices), bisections),
        full=bisections == field.ndim * (size.bit_length() - 1),
        edges=np.zeros((0, 2), np.int64),
        edge_offset=np.empty(0),
        edge_parts=np.empty(0, np.int64),
    )


def as_set(points, digits):
    return set(map(tuple, (np.round(np.asarray(points), digits) + 0.0).tolist()))


def check_manifold(contour):
    """Every point (n = 2) or side of a triangle (n = 3) has one cell on each hand, or lies on the border of the box."""
    n = len(contour.shape)
    cells = contour.cells
    assert set(cells.ravel().tolist()) == set(range(len(contour.points)))
    if n == 2:
        starts, ends = Counter(cells[:, :1].ravel().tolist()), Counter(cells[:, 1:].ravel().tolist())
        assert max([0, *starts.values(), *ends.values()]) <= 1
        open_sides: list[tuple[int, ...]] = [(p,) for p in starts.keys() ^ ends.keys()]
    else:
        assert (cells[:, [0, 1, 2]] != cells[:, [1, 2, 0]]).all()
        sides = Counter((t[i], t[i - 2]) for t in cells.tolist() for i in range(3))
        assert max([0, *sides.values()]) <= 1, "a side is used twice in one direction"
        open_sides = [(a, b) for a, b in sides if (b, a) not in sides]
    last = np.array(contour.shape) - 1.0
    for side in open_sides:
        ends_at = contour.points[list(side)]
        assert ((ends_at == 0).all(0) | (ends_at == last).all(0)).any(), "a gap that is not on the border"


def winding(contour, at):
    """How often a closed contour winds around each of the points, positive if higher values are inside."""
    corner = contour.points[contour.cells][None] - np.asarray(at, dtype=float)[:, None, None]
    if len(contour.shape) == 2:
        a, b = corner[..., 0, :], corner[..., 1, :]
        turn = np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(-1))
        return turn.sum(1) / (2 * np.pi)
    # Solid angle of a triangle: Van Oosterom and Strackee 1983.
    length = np.linalg.norm(corner, axis=-1)
    a, b, c = np.moveaxis(corner, -2, 0)
    below = length.prod(-1)
    for (p, q), r in (((a, b), 2), ((b, c), 0), ((c, a), 1)):
        below = below + (p * q).sum(-1) * length[..., r]
    return np.arctan2(np.linalg.det(corner), below).sum(1) / (2 * np.pi)


def check_winding(contour, leaves):
    assert np.allclose(winding(contour, leaves.position), leaves.above, atol=1e-6)


def euler(cells):
    sides = {frozenset(pair) for t in cells.tolist() for pair in itertools.combinations(t, 2)}
    return len(np.unique(cells)) - len(sides) + len(cells)


def torus():
    x, y, z = np.meshgrid(*(np.arange(s) - (s - 1) / 2 + 0.013 for s in (27, 26, 13)), indexing="ij")
    return 3.7 - np.hypot(np.hypot(x, y) - 7.9, z)
