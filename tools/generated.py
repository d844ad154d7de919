"""Generated fields that the tables of the main profile are trained on (``train.py``): of random numbers and splines.

Everything is computed without functions that differ between machines.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from acceptance import Item


def waves(shape: tuple[int, ...], seed: int, fall: float) -> NDArray[np.float64]:
    """A random field, smooth or rough: a sum of splines, each with cells half as large and ``fall`` times as high."""
    rng = np.random.default_rng(seed)
    out = np.zeros(shape)
    size, height = 2, 1.0
    while size < max(shape):
        grid = rng.integers(-1000, 1001, (size + 3,) * len(shape)).astype(float)
        for axis, count in enumerate(shape):
            # quadratic splines: no function that differs between machines
            at = np.arange(count) * (size / max(shape))
            whole = np.floor(at).astype(int)
            part = at - whole
            weight = (0.5 * (1 - part) ** 2, 0.5 + part - part**2, 0.5 * part**2)
            rows = np.moveaxis(grid, axis, 0)
            back = (-1,) + (1,) * (len(shape) - 1)
            grid = np.moveaxis(sum(rows[whole + i] * weight[i].reshape(back) for i in range(3)), 0, axis)
        out += grid * height
        size, height = 2 * size, height * fall
    return out


def balls(shape: tuple[int, ...], seed: int, count: int) -> NDArray[np.float64]:
    """Distance to the nearest of some ellipsoids, roughly."""
    rng = np.random.default_rng(seed)
    n = len(shape)
    grid = np.indices(shape).astype(float)
    out = np.full(shape, np.inf)
    for _ in range(count):
        centre = rng.integers(15, 86, n) * 0.01 * np.array(shape)
        turn = rng.integers(-100, 101, (n, n)) * 0.01 + np.eye(n)
        size = rng.integers(4, 28) * 0.01 * max(shape)
        squares = sum(sum(turn[i, j] * (grid[j] - centre[j]) for j in range(n)) ** 2 for i in range(n))
        out = np.minimum(out, np.sqrt(squares) - size)
    return out


def blurred(field: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means of three samples along every axis."""
    for axis in range(field.ndim):
        padded = np.moveaxis(np.pad(field, 1, mode="edge"), axis, 0)
        inner = tuple(slice(1, -1) for _ in range(field.ndim - 1))
        field = np.moveaxis(((padded[:-2] + padded[1:-1] + padded[2:]) / 3)[(slice(None), *inner)], 0, axis)
    return field


def scene(shape: tuple[int, ...], seed: int, noise: int) -> NDArray[np.float64]:
    """Bodies with soft edges and a texture, as a camera or scanner sees them: blurred, noisy, in whole steps."""
    rng = np.random.default_rng(seed)
    out = 40 * waves(shape, seed, 0.35) / 1000
    for i in range(12):
        out += int(rng.integers(-60, 61)) * np.clip(balls(shape, 100 * seed + i, 1), -1.5, 1.5)
    out = blurred(out + 0.0) + blurred(rng.integers(-noise, noise + 1, shape).astype(float))
    return np.floor(out)


LETTERS = (
    "l", "i.", "lo", "ok", "po", "inj", "iuj", "cn-", "o", "\\/", "i~", "cu", "injnq", "l/", "l~-", "k-l", "~/_", "n-u",
)  # fmt: skip
"""What letters are made of: stems on the left (i) and right (j, q), with ascender (l, k) or descender (p), bowls and
halves of bowls (o, c, n, u), bars (~, -, _), diagonals and dots."""


def letter(parts: str, height: int, width: int, thick: float) -> NDArray[np.float64]:
    """Ink of a letter between 0 and 1, its body ``height`` samples high, as much room above and below."""
    y, x = np.indices((3 * height, width + 2 * height)).astype(float)
    y, x = y - height, x - height // 2
    far = np.full(y.shape, np.inf)
    h, w = float(height), float(width)
    strokes = {
        "i": (0, 0, h, 0), "j": (0, w, h, w), "q": (0, 2 * w, h, 2 * w), "l": (-0.5 * h, 0, h, 0),
        "k": (-0.5 * h, w, h, w), "p": (0, 0, 1.5 * h, 0), "~": (0, 0, 0, w), "-": (h / 2, 0, h / 2, w),
        "_": (h, 0, h, w), "/": (0, w, h, w / 2), "\\": (0, 0, h, w / 2), ".": (-0.4 * h, 0, -0.4 * h, 0),
    }  # fmt: skip
    for part in parts:
        if part in strokes:
            top, left, bottom, right = strokes[part]
            way = (bottom - top, right - left)
            along = ((y - top) * way[0] + (x - left) * way[1]) / max(way[0] ** 2 + way[1] ** 2, 1e-9)
            along = np.clip(along, 0, 1)
            away = np.sqrt((y - top - along * way[0]) ** 2 + (x - left - along * way[1]) ** 2)
        else:
            round_ = np.sqrt(((y - h / 2) / (h / 2)) ** 2 + ((x - w / 2) / (w / 2)) ** 2)
            away = np.abs(round_ - 1) * min(h, w) / 2
            outside = {"c": x > 0.7 * w, "n": y > 0.5 * h, "u": y < 0.5 * h}.get(part)
            away = away if outside is None else np.where(outside, np.inf, away)
        far = np.minimum(far, away)
    return np.clip(thick + 0.5 - far, 0, 1)


def writing(shape: tuple[int, ...], seed: int, height: int) -> NDArray[np.float64]:
    """Lines of letters on a page that is unevenly lit, here and there hardly brighter than they are."""
    rng = np.random.default_rng(seed)
    noise, light = (12, 6, 3, 20)[seed % 4], (20, 60, 5)[seed % 3]
    page = 190 + light * waves(shape, seed, 0.3) / 1000
    thick = height * (0.07 + 0.02 * (seed % 4))
    for top in range(0, shape[0] - 3 * height, 2 * height):
        left = 2
        while left < shape[1] - 3 * height:
            width = height * int(rng.integers(4, 9)) // 8
            if rng.integers(0, 6):
                ink = letter(LETTERS[int(rng.integers(0, len(LETTERS)))], height, width, thick)
                page[top : top + ink.shape[0], left : left + ink.shape[1]] -= 120 * ink
            left += width + 2 + height // 3
    return np.floor(blurred(page) + blurred(rng.integers(-noise, noise + 1, shape).astype(float)))


def rough(shape: tuple[int, ...], seed: int, fall: float) -> Iterator[NDArray[np.float64]]:
    """Fields with ridges, and fields that are rough here and smooth there."""
    yield -np.abs(waves(shape, seed, fall)) + 0.3 * waves(shape, seed + 1, 0.35)
    where = np.clip(waves(shape, seed + 2, 0.25) / 1000 + 1.0, 0.1, 2.0)
    yield waves(shape, seed + 3, 0.3) + where * (waves(shape, seed + 4, fall) - waves(shape, seed + 4, 0.2))


def generated(n: int) -> Iterator[Item]:
    """Fields of all kinds between smooth and rough; many smooth ones, since they have few symbols."""
    plane = n == 2
    shape = (300, 360) if plane else (88, 80, 96)

    def cut(name: str, field: NDArray[np.float64], *shares: int) -> Iterator[Item]:
        """At the values below which so many hundredths of the samples lie."""
        order = np.sort(field, axis=None)
        for share in shares:
            yield Item(name, field, float(order[field.size * share // 100]) + (0.5 if name == "scene" else 0.001))

    for seed, fall in enumerate((0.2, 0.35, 0.5, 0.6, 0.7) if plane else (0.15, 0.25, 0.35, 0.45)):
        yield from cut("waves", waves(shape, seed, fall), 50, 75)
    for seed, fall in enumerate((0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4) * 4 if plane else (0.1, 0.2, 0.3)):
        yield from cut("waves", waves(shape, 200 + seed, fall), 20, 45, 80)
    for seed, fall in enumerate((0.4, 0.45, 0.5, 0.55, 0.6, 0.65) if plane else ()):
        for field in rough(shape, 400 + 5 * seed, fall):
            yield from cut("rough", field, 40, 70)
    for seed, count in enumerate((1, 2, 3, 5, 8, 20) * (4 if plane else 2)):
        yield Item("balls", balls(shape, seed, count), 0.003)
    for seed, noise in enumerate((1, 4, 12, 30, 0, 0, 1, 2, 4, 0) if plane else (0, 0, 1, 4, 12, 0, 1)):
        yield from cut("scene", scene(shape, seed, noise), 40, 70)
    for seed, height in enumerate((9, 12, 16, 24, 8, 10, 11, 13, 14, 18, 20) if plane else ()):
        yield Item("writing", writing(shape, seed, height), 130.5)
