"""The trained tables of the main profile, and the models that a file begins with (spec clause 7.10)."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from isospec.tables import HIDDEN, INPUTS, KINDS, ROWS, Tables

from ...entropy.context_layout import logistic, shipped_tables
from ...entropy.guesses import MOST_OPINIONS
from ...entropy.mixer import BUCKET, BUCKETS
from ...entropy.panel import no_panel
from ...entropy.range_coder import ONE, Blend
from .contexts import CONTEXTS
from .contexts import models as baseline_models
from .network_rows import (
    AROUND,
    AROUND_SUM,
    AROUND_SUMS,
    AROUND_VALUE,
    BIRTH_CLASSES,
    CELL_CLASSES,
    CELL_ROW,
    CELL_ROWS,
    CELL_SUM,
    CELL_SUMS,
    CELLS,
    GROUP,
    MAP,
    MOST_ROWS,
    PATTERNS,
    SIGN_ROW,
    STATES,
    TREE_ROW,
    VALUE_MIXES,
    VALUE_WEIGHT,
)

_LINE = 64
"""Bytes of a line of the processor's cache: rows that begin with one are read faster."""


def members(n: int) -> NDArray[np.int16]:
    """Rows of the networks that each row adds up, the sums included; -1 for none."""
    found = np.full((CELL_SUM[n] + CELL_SUMS * CELLS[n], GROUP), -1, np.int16)
    found[: ROWS[n], 0] = np.arange(ROWS[n])
    number = np.arange(AROUND[n]).reshape(-1, 1, GROUP)
    case = np.arange(PATTERNS)[:, None] // 3 ** np.arange(GROUP) % 3
    for phase in range(n):
        rows = np.where(case > 0, SIGN_ROW[n][phase] + 2 * number + case - 1, -1)
        found[AROUND_SUM[n] + phase * AROUND_SUMS[n] :][: AROUND_SUMS[n]] = rows.reshape(-1, GROUP)
    first = TREE_ROW[n] + CELL_ROW + CELL_ROWS * np.arange(CELLS[n])
    vertices, births = np.divmod(np.arange(CELL_SUMS), BIRTH_CLASSES)
    found[CELL_SUM[n] :, 0] = (first[:, None] + vertices).ravel()
    found[CELL_SUM[n] :, 1] = (first[:, None] + CELL_CLASSES + births).ravel()
    return found


def with_sums(n: int, weight: NDArray[np.int16]) -> NDArray[np.int16]:
    """Weights of all rows, the sums included."""
    found = members(n)
    padded = np.concatenate([weight, np.zeros((1, HIDDEN), np.int16)])
    whole = np.zeros(len(found) * HIDDEN + _LINE // 2, np.int16)
    place = -whole.ctypes.data % _LINE // 2
    sums = whole[place : place + len(found) * HIDDEN].reshape(-1, HIDDEN)
    for rows in found.T:
        sums += padded[rows]
    return sums


def models(n: int, squash: NDArray[np.int64], t: Tables) -> tuple[NDArray[np.int64], NDArray[np.int64], Blend]:
    """Probabilities of a 1, symbols seen, and the rest, as a file begins with them."""
    prob = np.empty(STATES, np.int64)
    seen = np.zeros(STATES, np.int64)
    begun = baseline_models()
    for mine, of_baseline in zip((prob, seen), begun, strict=True):
        mine[:CONTEXTS] = of_baseline
    middles = (np.arange(BUCKETS) << BUCKET) + (1 << BUCKET >> 1)
    prob[MAP:AROUND_VALUE] = np.tile(squash[middles], KINDS)
    prob[AROUND_VALUE:] = ONE >> 1
    prob[t.state[:, 0]], seen[t.state[:, 0]] = t.state[:, 1], t.state[:, 2]
    mix = np.full((KINDS + VALUE_MIXES, MOST_OPINIONS), VALUE_WEIGHT, np.int64)
    mix[:KINDS, :INPUTS] = t.mix
    blend = Blend(
        with_sums(n, t.weight), t.out.astype(np.int32), mix, *logistic(squash),
        np.zeros(MOST_ROWS, np.int64), np.zeros((0, 0), np.int32), no_panel(),
    )
    return prob, seen, blend


@cache
def _begun(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Blend]:
    squash, found = shipped_tables()
    return models(n, squash, found[n])


def shipped_models(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Blend]:
    """Make the models from the normative tables; copies, which a file may change."""
    prob, seen, blend = _begun(n)
    blend = blend._replace(mix=blend.mix.copy(), row=blend.row.copy(), panel=no_panel())
    return prob.copy(), seen.copy(), blend
