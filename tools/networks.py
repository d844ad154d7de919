"""Training of the main profile's networks (``train.py``): stochastic gradient descent, in the end on rounded weights.

A row's weights are told in few bits. So the second half of the passes goes on with weights as they will be told: the
gradient is taken at these, and moves the exact ones behind them. Numbers are added up in a fixed order, without
functions that differ between machines.
"""

from __future__ import annotations

from itertools import permutations, product
from typing import NamedTuple

import numba
import numpy as np
from numba import njit
from numpy.typing import NDArray

from isocodec.entropy.mixer import OUT_SHIFT
from isocodec.grid.models import network_rows as layout
from isocodec.grid.models.neighbourhood import nearest_vertices
from isospec.tables import BITS, COLUMNS, HIDDEN, MOST_EXPONENT, NET_ROWS

# eight sums side by side are a vector then; each is added up as before
numba.config.SLP_VECTORIZE = 1

BATCH, STEP = 256, 0.005
SYMBOLS = 40_000_000
"""That a network is trained on, in 20 to 40 passes over its data."""
EXACT = 0.5
"""The part of the passes before weights are rounded."""
LEAST, MOST = -(1 << BITS - 1), (1 << BITS - 1) - 1
"""Of a weight before it is shifted."""
LOGIT = 256 << OUT_SHIFT
"""The natural logit 1, as the sum of a network says it."""
PITCHES = tuple(2.0 ** (i / 4) for i in range(-12, 5))
"""Units of weights that are tried, as parts of the one that the largest weight needs."""

Vector = NDArray[np.float32]
Matrix = NDArray[np.float32]


def first_row(n: int, net: int) -> int:
    """Of a network."""
    return sum(NET_ROWS[n][:net])


def symmetries(n: int, net: int) -> NDArray[np.int32]:
    """Rows of a network in all orders that mean the same field, turned or mirrored."""
    same = np.arange(NET_ROWS[n][net], dtype=np.int32)
    if net >= layout.TREE_NET:
        return same[None]
    around = [tuple(d) for d in nearest_vertices(n, net).tolist()]
    place = {d: i for i, d in enumerate(around)}
    odd = n - net
    found = []
    for front in permutations(range(odd)):
        for back in permutations(range(odd, n)):
            for mirror in product((1, -1), repeat=net):
                moved = [
                    tuple([d[i] for i in front] + [d[i] * m for i, m in zip(back, mirror, strict=True)]) for d in around
                ]
                order = same.copy()
                for i, d in enumerate(moved):
                    # a vertex at the rim whose image is not in the list stays where it is
                    j = place.get(d, i)
                    order[2 * i], order[2 * i + 1] = 2 * j, 2 * j + 1
                found.append(order)
    return np.array(found)


@njit
def logistic(x):
    """By repeated squaring: the same everywhere."""
    y = 1.0 - min(max(x, -15.0), 15.0) / 4096.0
    for _ in range(12):
        y *= y
    return 1.0 / (1.0 + y)


@njit(error_model="numpy")
def summed(weight, place, count, hidden):
    """Sums of so many rows, which begin at places, those below 0 as 0; eight columns at a time."""
    zero = np.float32(0)
    for j in range(0, len(hidden), 8):
        a = b = c = d = e = f = g = h = zero
        for i in range(count):
            p = place[np.uint64(i)] + np.uint64(j)
            a += weight[p]
            b += weight[p + np.uint64(1)]
            c += weight[p + np.uint64(2)]
            d += weight[p + np.uint64(3)]
            e += weight[p + np.uint64(4)]
            f += weight[p + np.uint64(5)]
            g += weight[p + np.uint64(6)]
            h += weight[p + np.uint64(7)]
        hidden[j + 0] = max(a, zero)
        hidden[j + 1] = max(b, zero)
        hidden[j + 2] = max(c, zero)
        hidden[j + 3] = max(d, zero)
        hidden[j + 4] = max(e, zero)
        hidden[j + 5] = max(f, zero)
        hidden[j + 6] = max(g, zero)
        hidden[j + 7] = max(h, zero)


@njit(error_model="numpy")
def spread(gradient, place, count, back):
    """Add a vector to so many rows, which begin at places; eight columns at a time."""
    for j in range(0, len(back), 8):
        a, b, c, d, e, f, g, h = (
            back[j], back[j + 1], back[j + 2], back[j + 3], back[j + 4], back[j + 5], back[j + 6], back[j + 7],
        )
        for i in range(count):
            p = place[np.uint64(i)] + np.uint64(j)
            gradient[p] += a
            gradient[p + np.uint64(1)] += b
            gradient[p + np.uint64(2)] += c
            gradient[p + np.uint64(3)] += d
            gradient[p + np.uint64(4)] += e
            gradient[p + np.uint64(5)] += f
            gradient[p + np.uint64(6)] += g
            gradient[p + np.uint64(7)] += h


@njit(error_model="numpy")
def moved(value, gradient, moments, rate, fade, slow):
    """A step of Adam."""
    tenth, thousandth, tiny = np.float32(0.1), np.float32(0.001), np.float32(1e-8)
    mean, square = moments
    for a in range(len(value)):
        g = gradient[a]
        mean[a] += tenth * (g - mean[a])
        square[a] += thousandth * (g * g - square[a])
        value[a] -= rate * (mean[a] * fade) / (np.sqrt(square[a] * slow) + tiny)


@njit(error_model="numpy")
def rounded(weight, unit, told):
    """Weights as they will be told: multiples of their row's unit; all as they are if there are no units."""
    if len(unit) == 0:
        told[:] = weight
        return
    columns = len(weight) // len(unit)
    for a in range(len(unit)):
        one, parts = unit[a], np.float32(1) / unit[a]
        for j in range(a * columns, (a + 1) * columns):
            whole = np.floor(weight[j] * parts + np.float32(0.5))
            told[j] = one * min(max(whole, np.float32(LEAST)), np.float32(MOST))


@njit(error_model="numpy")
def descend(row, count, symbol, order, orders, weight, told, unit, out, moments, moments_out, passed, total, fades):
    """One pass over the data in batches; returns how many symbols were guessed wrong, and batches so far."""
    columns = len(out) - 1
    hidden, back = np.zeros(columns, np.float32), np.zeros(columns, np.float32)
    gradient, gradient_out = np.zeros(len(weight), np.float32), np.zeros(columns + 1, np.float32)
    place = np.zeros(row.shape[1], np.uint64)
    wrong = 0.0
    share = np.float32(1) / np.float32(BATCH)
    for start in range(0, len(order) - BATCH + 1, BATCH):
        gradient[:] = np.float32(0)
        gradient_out[:] = np.float32(0)
        for s in order[start : start + BATCH]:
            turned = orders[(s * 7919 + passed) % len(orders)]
            for i in range(count[s]):
                place[i] = np.uint64(turned[row[s, i]]) * np.uint64(columns)
            summed(told, place, np.int64(count[s]), hidden)
            x = out[columns]
            for j in range(columns):
                x += hidden[j] * out[j]
            p = logistic(np.float64(x))
            # the loss is counted without a logarithm that may differ: as a share of wrong guesses
            wrong += 1.0 - p if symbol[s] else p
            e = np.float32(p - symbol[s]) * share
            gradient_out[columns] += e
            for j in range(columns):
                gradient_out[j] += e * hidden[j]
                back[j] = e * out[j] if hidden[j] > np.float32(0) else np.float32(0)
            spread(gradient, place, np.int64(count[s]), back)
        passed += 1
        rate = np.float32(STEP * min(1.0, 1.5 * (total - passed) / total))
        fades[0] *= 0.9
        fades[1] *= 0.999
        fade, slow = np.float32(1.0 / (1.0 - fades[0])), np.float32(1.0 / (1.0 - fades[1]))
        moved(weight, gradient, moments, rate, fade, slow)
        moved(out, gradient_out, moments_out, rate, fade, slow)
        rounded(weight, unit, told)
    return wrong / max(len(order), 1), passed


def level(weight: Matrix, out: Vector, moments: NDArray[np.float32], moments_out: NDArray[np.float32],
          seen: NDArray[np.int64]) -> None:
    """Let all columns be equally large, as only their products with the output weights matter."""
    columns = weight.shape[1]
    size = np.sqrt(seen @ weight.astype(np.float64) ** 2 / max(seen.sum(), 1)) + 1e-9
    # powers of two: nothing is rounded
    factor = np.ldexp(np.float32(1), -np.frexp(size)[1]).astype(np.float32)
    weight *= factor
    out[:columns] /= factor
    moments[0] *= factor
    moments[1] *= factor * factor
    moments_out[0, :columns] *= factor
    moments_out[1, :columns] *= factor * factor


def missed(weight: Matrix, unit: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """For each row the exponent that tells it best in a unit, and the squares that are missed."""
    squares = []
    for exponent in range(MOST_EXPONENT + 1):
        told = np.zeros_like(weight)
        rounded(weight.ravel(), np.full(len(weight), unit * 2.0**exponent, np.float32), told.ravel())
        squares.append(((told - weight).astype(np.float64) ** 2).sum(axis=1))
    return np.argmin(squares, axis=0), np.min(squares, axis=0)


def best_unit(weight: Matrix, seen: NDArray[np.int64]) -> float:
    """A unit of weights; rows that are seen often count more."""
    whole = float(np.abs(weight).max()) / (MOST << MOST_EXPONENT)
    return whole * min(PITCHES, key=lambda pitch: float(missed(weight, whole * pitch)[1] @ np.sqrt(seen + 1.0)))


class Listed(NamedTuple):
    """What is listed around the symbols of a network."""

    row: NDArray[np.int16]  # (S, R), counted from the network's first
    count: NDArray[np.int16]  # (S,), how many of them
    symbol: NDArray[np.int8]  # (S,)


def gathered(lines: list[NDArray[np.int16]], first: int) -> Listed:
    """The symbols of all files; of each (S, 2 + R): symbol, number of rows, rows."""
    if not sum(map(len, lines)):
        return Listed(np.zeros((0, 0), np.int16), np.zeros(0, np.int16), np.zeros(0, np.int8))
    count = np.concatenate([x[:, 1] for x in lines])
    row = np.zeros((len(count), int(count.max())), np.int16)
    place = 0
    for x in lines:
        row[place : place + len(x), : x.shape[1] - 2] = x[:, 2:] - np.int16(first)
        place += len(x)
    return Listed(row, count, np.concatenate([x[:, 0] for x in lines]).astype(np.int8))


def network(listed: Listed, n: int, net: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Weights of one network's rows, and its output weights, from what was listed around its symbols.

    Parameters
    ----------
    listed : Listed
    n, net : int

    Returns
    -------
    weight : (rows, HIDDEN) int64
    out : (HIDDEN + 1,) int64
    """
    columns, rows = COLUMNS[net], NET_ROWS[n][net]
    weight, out = np.zeros((rows, HIDDEN), np.int64), np.zeros(HIDDEN + 1, np.int64)
    row, count, symbol = listed
    if not len(row):
        return weight, out
    seen = np.zeros(rows, np.int64)
    for i in range(row.shape[1]):
        seen += np.bincount(row[count > i, i], minlength=rows)
    rng = np.random.default_rng(net)
    exact = (rng.integers(-1000, 1001, (rows, columns)) * 1e-4).astype(np.float32)
    opinion = (rng.integers(-1000, 1001, columns + 1) * 2e-4).astype(np.float32)
    moments, moments_out = np.zeros((2, rows, columns), np.float32), np.zeros((2, columns + 1), np.float32)
    told, unit, step = exact.copy(), np.zeros(0, np.float32), 0.0
    epochs = min(max(SYMBOLS // len(row), 20), 40)
    passed, total, fades, orders = 0, epochs * (len(row) // BATCH), np.ones(2), symmetries(n, net)
    for epoch in range(epochs):
        if epoch >= EXACT * epochs:
            if not step:
                level(exact, opinion, moments, moments_out, seen)
                step = best_unit(exact, seen)
            unit = (step * 2.0 ** missed(exact, step)[0]).astype(np.float32)
            rounded(exact.ravel(), unit, told.ravel())
        wrong, passed = descend(
            row, count, symbol, rng.permutation(len(row)), orders, exact.ravel(), told.ravel(), unit, opinion,
            moments.reshape(2, -1), moments_out, passed, total, fades,
        )
        print(f"n = {n}, network {net}, {len(row)} symbols, pass {epoch + 1}: {wrong:.5f} wrong", flush=True)
    weight[:, :columns] = np.rint(told / np.float32(step))
    out[:columns] = np.clip(np.rint(opinion[:columns].astype(np.float64) * (step * LOGIT)), -32768, 32767)
    out[HIDDEN] = np.rint(float(opinion[columns]) * LOGIT)
    return weight, out
