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
)
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
    }
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


def segments(shape: tuple[int, ...], ends: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Distance of samples from the nearest of some strokes, as far as ``reach``; ends are (S, 4): y, x, y, x."""
    far = np.full(shape, float(reach))
    for y0, x0, y1, x1 in ends:
        top, left = max(int(min(y0, y1)) - reach, 0), max(int(min(x0, x1)) - reach, 0)
        y, x = np.indices(far[top : int(max(y0, y1)) + reach, left : int(max(x0, x1)) + reach].shape).astype(float)
        y, x = y + top - y0, x + left - x0
        way = (y1 - y0, x1 - x0)
        along = np.clip((y * way[0] + x * way[1]) / max(way[0] ** 2 + way[1] ** 2, 1e-9), 0, 1)
        away = np.sqrt((y - along * way[0]) ** 2 + (x - along * way[1]) ** 2)
        part = far[top : top + y.shape[0], left : left + y.shape[1]]
        np.minimum(part, away, out=part)
    return far


def scribble(shape: tuple[int, ...], seed: int, length: int) -> NDArray[np.float64]:
    """Strokes that bend as a hand draws them; ``length`` in samples."""
    rng = np.random.default_rng(seed)
    ends = []
    for _ in range(shape[0] * shape[1] // (30 * length)):
        place = rng.integers(0, 1000, 2) * 0.001 * np.array(shape)
        way, turn = rng.integers(-100, 101, 2) * 0.02, rng.integers(-20, 21) * 0.01
        for _ in range(max(length // 2, 4)):
            there = place + way
            ends.append((*place, *there))
            turn += rng.integers(-10, 11) * 0.005
            # a turn without sines, then again as long as before
            way = way + turn * np.array([-way[1], way[0]])
            way *= 2.0 / max(np.sqrt(way @ way), 0.1)
            place = there
    return segments(shape, np.array(ends), 6)


def hatching(shape: tuple[int, ...], seed: int, pitch: float) -> NDArray[np.float64]:
    """Regions of parallel lines, crossed lines, dots and bricks, each at a slant of its own, and what lies between."""
    rng = np.random.default_rng(seed)
    y, x = np.indices(shape).astype(float)
    far = np.full(shape, 9.0)
    for kind in range(4):
        way = rng.integers(-100, 101, 2) * 0.01
        way /= max(np.sqrt(way @ way), 0.1)
        apart = pitch * (1 + 0.2 * kind)
        u, v = y * way[0] + x * way[1], x * way[0] - y * way[1]
        row = np.floor(u / apart)
        across = np.abs(u / apart - row - 0.5) * apart
        shift = 0.5 * (row % 2) if kind == 3 else 0.0
        along = np.abs((v / (2 * apart) + shift) % 1.0 - 0.5) * 2 * apart
        lines = (across, np.minimum(across, along), np.maximum(np.sqrt(across**2 + along**2) - pitch / 4, 0.0),
                 np.minimum(across, along))[kind]
        inside = balls(shape, 50 * seed + kind, 2)
        far = np.where(inside < 0, lines, np.minimum(far, np.abs(inside)))
    return far


def plan(shape: tuple[int, ...], seed: int, rooms: int) -> NDArray[np.float64]:
    """Walls of a building with doors, a little turned, as lines or pairs of lines."""
    rng = np.random.default_rng(seed)
    ends = []
    high, wide = shape
    for _ in range(rooms):
        top, left = rng.integers(5, 80, 2) * 0.01 * np.array(shape)
        bottom, right = top + rng.integers(8, 40) * 0.01 * high, left + rng.integers(8, 40) * 0.01 * wide
        door = left + 0.3 * (right - left)
        for gap in (0.0, 4.0) if seed % 2 else (0.0,):
            ends += [(top + gap, left, top + gap, door), (top + gap, door + 9, top + gap, right),
                     (bottom + gap, left, bottom + gap, right), (top, left + gap, bottom, left + gap),
                     (top, right + gap, bottom, right + gap)]
    slant = (0.0, 0.01, -0.03, 0.2)[seed % 4]
    turned = np.array(ends) @ np.array([[1, slant, 0, 0], [-slant, 1, 0, 0], [0, 0, 1, slant], [0, 0, -slant, 1]])
    return segments(shape, turned, 6)


def part(shape: tuple[int, ...], seed: int, holes: int) -> NDArray[np.float64]:
    """A cut through a machined part: plates with round and square holes and slots; below 0 inside."""
    rng = np.random.default_rng(seed)
    y, x = np.indices(shape).astype(float)
    slant = (0.0, 0.13, 0.4, -0.07)[seed % 4]
    u, v = y + slant * x, x - slant * y

    def box(low: int, high: int) -> NDArray[np.float64]:
        """A rectangle, its sides in hundredths of the shape."""
        centre = rng.integers(15, 86, 2) * 0.01 * np.array(shape)
        half = rng.integers(low, high, 2) * 0.005 * np.array(shape)
        a = u - centre[0] - slant * centre[1]
        b = v - centre[1] + slant * centre[0]
        return np.maximum(np.abs(a) - half[0], np.abs(b) - half[1])

    out = np.minimum(np.minimum(box(30, 90), box(30, 90)), box(20, 60))
    for i in range(holes):
        if i % 3:
            centre, radius = rng.integers(5, 96, 2) * 0.01 * np.array(shape), int(rng.integers(3, 20))
            out = np.maximum(out, radius - np.sqrt((y - centre[0]) ** 2 + (x - centre[1]) ** 2))
        else:
            out = np.maximum(out, -box(2, 20))
    return out


def inked(far: NDArray[np.float64], seed: int, thick: float, noise: int) -> NDArray[np.float64]:
    """A drawing on paper as a scanner sees it, strokes as thick as that."""
    rng = np.random.default_rng(seed)
    page = 200 + 15 * waves(far.shape, seed, 0.3) / 1000 - 140 * np.clip(thick + 0.5 - far, 0, 1)
    return np.floor(blurred(page) + blurred(rng.integers(-noise, noise + 1, far.shape).astype(float)))


def skewed(page: NDArray[np.float64], slant: int) -> NDArray[np.float64]:
    """A page whose lines rise by a sample every ``slant`` columns."""
    return np.stack([np.roll(column, i // slant) for i, column in enumerate(page.T)], axis=1)


def drawings(shape: tuple[int, ...]) -> Iterator[Item]:
    """Line drawings, hatching, plans, machined parts, and written pages that lie askew."""
    for seed in range(4):
        noise, thick = (0, 8, 20, 4)[seed], (0.6, 1.0, 1.6, 2.4)[seed]
        for far in (scribble(shape, seed, 20 * (1 + seed)), hatching(shape, seed, (5, 7, 11, 16)[seed]),
                    plan(shape, seed, (4, 8, 16, 30)[seed]) - 0.5):
            yield Item("drawing", inked(far, seed, thick, noise), 130.5)
        yield Item("part", part(shape, seed, (4, 12, 25, 50)[seed]), 0.003)
        yield Item("writing", skewed(writing(shape, 20 + seed, (10, 14, 9, 17)[seed]), (25, -40, 60, -15)[seed]), 130.5)


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
    if plane:
        yield from drawings(shape)
