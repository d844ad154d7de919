"""Fields for the vectors, by integer arithmetic alone: every platform makes the same ones."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product

import numpy as np
from numpy.typing import NDArray

Shape = tuple[int, ...]
Integers = NDArray[np.int64]


def random_numbers(seed: int, count: int, bits: int) -> list[int]:
    """Numbers of up to 16 bits, from a linear congruential generator of 32 bits (constants of Numerical Recipes)."""
    out = []
    state = (seed * 2654435761 + 12345) & 0xFFFFFFFF
    for _ in range(count):
        state = (1664525 * state + 1013904223) & 0xFFFFFFFF
        out.append(state >> (32 - bits))
    return out


def noise(shape: Shape, seed: int, bits: int = 8) -> Integers:
    """Every sample independent of all others."""
    return np.array(random_numbers(seed, int(np.prod(shape)), bits), np.int64).reshape(shape)


def _squares(shape: Shape, centre: Iterable[int], scale: int = 1) -> Integers:
    """Squared distance to a point, both in units of 1 / scale of a sample."""
    axes = np.meshgrid(*(np.arange(s, dtype=np.int64) * scale for s in shape), indexing="ij")
    total = np.zeros(shape, np.int64)
    for axis, c in zip(axes, centre, strict=True):
        total += (axis - c) ** 2
    return total


def balls(shape: Shape, parts: Iterable[tuple[tuple[int, ...], int]]) -> Integers:
    """Positive within balls: the largest of radius**2 - distance**2, in half samples; centres and radii likewise."""
    return np.max([radius**2 - _squares(shape, centre, 2) for centre, radius in parts], axis=0)


def torus(shape: Shape, ring: int, tube: int) -> Integers:
    """Positive within a torus around the middle and the last axis; radii in half samples."""
    axes = np.meshgrid(*(2 * np.arange(s, dtype=np.int64) - (s - 1) for s in shape), indexing="ij")
    flat = axes[0] ** 2 + axes[1] ** 2
    return 4 * ring**2 * flat - (flat + axes[2] ** 2 + ring**2 - tube**2) ** 2


def waves(shape: Shape, high: int, seed: int = 1) -> Integers:
    """Smooth hills between 0 and ``high``: products of triangle waves of three periods."""
    periods = [7 + n for n in random_numbers(seed, 3 * len(shape), 4)]
    total = np.zeros(shape, np.int64)
    for i in range(3):
        term = np.ones(shape, np.int64)
        for a, size in enumerate(shape):
            p = periods[3 * a + i]
            wave = np.abs((np.arange(size, dtype=np.int64) * 3 + 5 * i) % (2 * p) - p) * 64 // p
            term *= wave.reshape([-1 if b == a else 1 for b in range(len(shape))])
        total += term >> (6 * (len(shape) - 1))
    return total * high // 192


def salt(shape: Shape, points: Iterable[tuple[int, ...]]) -> Integers:
    """Zero but for single samples of one."""
    out = np.zeros(shape, np.int64)
    for point in points:
        out[point] = 1
    return out


def sprinkled(shape: Shape, seed: int, one_in: int) -> Integers:
    """About one sample of ``one_in`` is one, the others zero."""
    return (noise(shape, seed, 16) % one_in == 0).astype(np.int64)


def checkers(shape: Shape) -> Integers:
    """Neighbours along an axis differ: as many components as there can be."""
    return np.array([sum(p) % 2 for p in product(*map(range, shape))], np.int64).reshape(shape)
