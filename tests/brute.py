"""What several tests measure the codec against: the mesh by recursive bisection, and fields to encode.

Nothing here uses the codec's tables; the mesh comes from the root cube by Maubach's rule alone.
"""

from __future__ import annotations

import os
from functools import cache, lru_cache
from itertools import permutations

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isoconform.meshes import Mesh, closed, exponent, parents
from isoconform.plain import interpreted

INTERPRETED = interpreted()


HEAVY = bool(os.environ.get("ISOCODEC_HEAVY"))
"""Whether tests try as hard as `make heavy` does."""
SHARE = 6
"""Otherwise they try so many times fewer examples."""


def examples(count: int) -> settings:
    """Settings with ``count`` examples: a sixth of them unless tests are heavy, a few where kernels are interpreted."""
    return settings(max_examples=min(count, 3) if INTERPRETED else count if HEAVY else -(-count // SHARE))


@cache
def simplices(n: int, k: int, level: int) -> NDArray[np.int64]:
    """All simplices (M, n + 1, n) of a uniform level of the root cube [0, 2**k]**n, unclamped, x0 first."""
    if level == 0:
        paths = []
        for order in permutations(range(n)):
            steps = np.vstack([np.zeros(n, np.int64), np.eye(n, dtype=np.int64)[list(order)]])
            paths.append(np.cumsum(steps, axis=0) << k)
        return np.array(paths)
    s = simplices(n, k, level - 1)
    tag = n - (level - 1) % n
    z = (s[:, :1] + s[:, tag : tag + 1]) // 2
    first = np.concatenate([s[:, :tag], z, s[:, tag + 1 :]], axis=1)
    second = np.concatenate([s[:, 1 : tag + 1], z, s[:, tag + 1 :]], axis=1)
    return np.stack([first, second], axis=1).reshape(-1, n + 1, n)


def volumes(s: NDArray[np.int64]) -> NDArray[np.int64]:
    """n! times the signed volume of each simplex."""
    a = s[:, 1:] - s[:, :1]
    if a.shape[1] == 2:
        return a[:, 0, 0] * a[:, 1, 1] - a[:, 0, 1] * a[:, 1, 0]
    return np.einsum("si,si->s", a[:, 0], np.cross(a[:, 1], a[:, 2]))


@lru_cache(256)
def clamped(shape: tuple[int, ...], level: int) -> NDArray[np.int64]:
    """Simplices of a level with a volume after clamping onto the box of samples."""
    s = np.minimum(simplices(len(shape), exponent(shape), level), np.array(shape) - 1)
    return s[volumes(s) != 0]


@lru_cache(256)
def lattice(shape: tuple[int, ...], level: int) -> NDArray[np.bool_]:
    """Which samples are vertices of a level."""
    out = np.zeros(shape, bool)
    out[tuple(np.moveaxis(clamped(shape, level), -1, 0))] = True
    return out


def mixed(above: NDArray[np.bool_], level: int) -> NDArray[np.int64]:
    """Simplices of a level that are crossed, as (M, n + 1, n) positions."""
    s = clamped(above.shape, level)
    signs = above[tuple(np.moveaxis(s, -1, 0))]
    return s[signs.any(axis=1) & ~signs.all(axis=1)]


def crossing_edges(above: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Grid edges whose ends differ in sign: lower ends (E, n) and axes (E,)."""
    ends, axes = [], []
    for axis in range(above.ndim):
        found = np.argwhere(np.diff(above.astype(np.int8), axis=axis) != 0)
        ends.append(found)
        axes.append(np.full(len(found), axis))
    return np.concatenate(ends), np.concatenate(axes)


def crossing_points(field: NDArray, isovalue: float) -> NDArray[np.float64]:
    """Points of marching squares or cubes: linear interpolation on grid edges with exactly one end above."""
    field = np.asarray(field)
    low, axis = crossing_edges(field > isovalue)
    high = low.copy()
    high[np.arange(len(low)), axis] += 1
    f0, f1 = field[tuple(low.T)].astype(float), field[tuple(high.T)].astype(float)
    points = low.astype(float)
    points[np.arange(len(low)), axis] += (isovalue - f0) / (f1 - f0)
    return points


def smooth(shape: tuple[int, ...], seed: int, waves: int = 4) -> NDArray[np.float64]:
    """A sum of a few random cosines, about -1 to 1."""
    rng = np.random.default_rng(seed)
    grid = np.indices(shape).astype(float)
    out = np.zeros(shape)
    for _ in range(waves):
        k = rng.normal(0, 3 / max(shape), len(shape))
        out += np.cos(2 * np.pi * np.tensordot(k, grid, 1) + rng.uniform(0, 2 * np.pi))
    return out / waves


def noise(shape: tuple[int, ...], seed: int = 0, rim_below: bool = False) -> NDArray[np.float64]:
    """Independent normal samples; with ``rim_below`` all those on the border are -1."""
    field = np.random.default_rng(seed).normal(size=shape)
    if rim_below:
        field[border(shape)] = -1.0
    return field


def border(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Samples on the border of the box."""
    on = np.ones(shape, dtype=bool)
    on[(slice(1, -1),) * len(shape)] = False
    return on


def ball(shape: tuple[int, ...], centre: tuple[float, ...], radius: float) -> NDArray[np.float64]:
    """How far samples lie inside a ball."""
    axes = np.meshgrid(*(np.arange(s, dtype=float) for s in shape), indexing="ij")
    return np.asarray(radius - np.sqrt(sum((x - c) ** 2 for x, c in zip(axes, centre, strict=True))))


def blobs(shape: tuple[int, ...], seed: int) -> NDArray[np.bool_]:
    """A few filled balls."""
    rng = np.random.default_rng(seed)
    grid = np.indices(shape).astype(float)
    out = np.zeros(shape, bool)
    for _ in range(rng.integers(1, 5)):
        centre = rng.uniform(0, np.array(shape) - 1).reshape(-1, *(1,) * len(shape))
        out |= ((grid - centre) ** 2).sum(axis=0) < rng.uniform(0.3, max(shape) / 3) ** 2
    return out


@st.composite
def sign_fields(draw, n: int, most: int, longest: int | None = None) -> NDArray[np.bool_]:
    """Fields of signs: constants, noise of any density, blobs, smooth ones, stripes; square, odd or elongated."""
    shape = tuple(draw(st.lists(st.integers(2, most), min_size=n, max_size=n)))
    if longest is not None and draw(st.integers(0, 4)) == 0:
        long = draw(st.integers(0, n - 1))
        shape = tuple(draw(st.integers(most, longest)) if a == long else min(s, 4) for a, s in enumerate(shape))
    seed = draw(st.integers(0, 1 << 32))
    rng = np.random.default_rng(seed)
    kind = draw(st.sampled_from(["constant", "noise", "blobs", "smooth", "stripes"]))
    if kind == "constant":
        return np.full(shape, draw(st.booleans()))
    if kind == "noise":
        return rng.random(shape) < draw(st.sampled_from([0.01, 0.1, 0.5, 0.9, 0.99]))
    if kind == "blobs":
        return blobs(shape, seed) ^ draw(st.booleans())
    if kind == "smooth":
        return smooth(shape, seed) > draw(st.sampled_from([-0.3, 0.0, 0.3]))
    return np.indices(shape).sum(axis=0) % draw(st.integers(2, 4)) == 0


# -- meshes between the root and the full grid -----------------------------------------------------------------------


def mesh_leaves(shape: tuple[int, ...], mesh: Mesh) -> list[tuple[int, NDArray[np.int64]]]:
    """Leaf simplices of a mesh with a volume, as (level, clamped positions)."""
    n, k = len(shape), exponent(shape)
    last = np.array(shape) - 1
    found = []
    stack = [(0, x) for x in simplices(n, k, 0)]
    while stack:
        level, x = stack.pop()
        tag = n - level % n
        z = (x[0] + x[tag]) // 2
        if level < n * k and tuple(map(int, z)) in mesh:
            stack.append((level + 1, np.concatenate([x[:tag], [z], x[tag + 1 :]])))
            stack.append((level + 1, np.concatenate([x[1 : tag + 1], [z], x[tag + 1 :]])))
            continue
        x = np.minimum(x, last)
        if volumes(x[None])[0] != 0:
            found.append((level, x))
    return found


def mixed_leaves(above: NDArray[np.bool_], mesh: Mesh) -> set[tuple[int, bytes]]:
    """Those that are crossed, by level and positions."""
    out = set()
    for level, x in mesh_leaves(above.shape, mesh):
        signs = above[tuple(x.T)]
        if signs.any() and not signs.all():
            out.add((level, x.astype(np.int64).tobytes()))
    return out


@st.composite
def meshes(draw, shape: tuple[int, ...], inside: Mesh = frozenset()) -> Mesh:
    """A closed set of vertices: some picked at random, and their ancestors; all of ``inside`` among them."""
    every = sorted(parents(shape))
    seed = draw(st.integers(0, 1 << 32))
    share = draw(st.sampled_from([0.0, 0.02, 0.1, 0.4, 1.0]))
    rng = np.random.default_rng(seed)
    return closed(shape, [w for w in every if rng.random() < share]) | inside
