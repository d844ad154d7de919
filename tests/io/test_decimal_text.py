"""Decimal text of many numbers, against Python's formatting of one."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np

from isocodec.io.writers.decimal_text import millionths, pair_texts


def numbers() -> np.ndarray:
    rng = np.random.default_rng(5)
    some = rng.uniform(-1, 1, 20000) * 10.0 ** rng.integers(-8, 9, 20000)
    ties = rng.integers(-(1 << 20), 1 << 20, 4000) / 128
    near = np.concatenate([np.nextafter(ties, np.inf), np.nextafter(ties, -np.inf)])
    halves = (rng.integers(-(10**9), 10**9, 4000) + 0.5) / 1e6
    ends = [0.0, -0.0, 1e-7, -1e-7, 5e-7, -5e-7, 0.9999995, 999.9999999, 1 << 24, -(1 << 24) - 0.5]
    return np.concatenate([some, ties, near, halves, ends])


def test_millionths_round_as_python_does():
    given = numbers()
    assert millionths(given).tolist() == [int(f"{one:.6f}".replace(".", "")) for one in given.tolist()]


def test_pairs_are_written_as_python_does():
    given = numbers()[: len(numbers()) // 2 * 2].reshape(-1, 2)
    text, ends = pair_texts(millionths(given))
    one_by_one = [text[start:stop].decode() for start, stop in pairwise(ends.tolist())]
    wanted = [f"{x:.6f},{y:.6f} ".replace("-0.000000", "0.000000") for x, y in given.tolist()]
    assert one_by_one == [re.sub(r"\.?0+(?=[ ,])", "", each) for each in wanted]


def test_no_pairs():
    text, ends = pair_texts(np.zeros((0, 2), np.int64))
    assert text == b"" and ends.tolist() == [0]
