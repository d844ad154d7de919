"""Decimal numbers as text, all of an array at once."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

PLACES = 6
_UNITS = 10**PLACES
_GROUP = 1000
"""Digits are taken from a table, three at a time."""
_HALVES = 128
"""Multiples of 1/128 are the only numbers that lie halfway between two millionths; scaling them is exact."""


class _Groups(NamedTuple):
    """The numbers from 0 to 999: their three digits, and how many zeros they end with."""

    digits: NDArray[np.uint8]
    zeros: NDArray[np.int64]


@cache
def _groups() -> _Groups:
    number = np.arange(_GROUP)
    digits = np.stack([number // 100, number // 10 % 10, number % 10], axis=1).astype(np.uint8) + ord("0")
    zeros = np.sum([number % each == 0 for each in (10, 100, _GROUP)], axis=0)
    return _Groups(digits, zeros)


def _enter(numbers: NDArray[np.int64], out: NDArray[np.uint8]) -> None:
    """Write numbers from 0 to 999 with three digits, one digit of all after the other: numpy is quicker at that."""
    for place, digits in enumerate(_groups().digits.T):
        out[..., place] = digits[numbers]


def millionths(numbers: NDArray[np.float64]) -> NDArray[np.int64]:
    """Round to millionths as ``"%.6f"`` does: the exact value of the float, ties to even.

    Numbers are below 2**32.
    """
    scaled = numbers * _UNITS
    found = np.rint(scaled)
    close = np.abs(np.abs(scaled - found) - 0.5) <= 2 * np.spacing(np.abs(scaled))
    close &= numbers * _HALVES != np.rint(numbers * _HALVES)
    out = found.astype(np.int64)
    for place in np.argwhere(close):
        at = tuple(place)
        out[at] = int(f"{numbers[at]:.{PLACES}f}".replace(".", ""))
    return out


def pair_texts(pairs: NDArray[np.int64]) -> tuple[bytes, NDArray[np.int64]]:
    """Write pairs of millionths as ``x,y`` and a space, without zeros at the end of decimals.

    Parameters
    ----------
    pairs : (N, 2) int64
        Numbers, of which the absolute values are below 10**15.

    Returns
    -------
    bytes
        The texts of all pairs, one after another.
    (N + 1,) int64
        Where they begin and end.
    """
    groups = _groups()
    size = np.abs(pairs)
    whole, part = np.divmod(size, _UNITS)
    high, low = np.divmod(part, _GROUP)
    count = len(pairs)
    width = max(len(str(int(whole.max(initial=0)))), 1)
    steps = -(-width // 3)
    text = np.empty((count, 2, 1 + 3 * steps + 1 + PLACES + 1), np.uint8)
    used = np.empty(text.shape, np.bool_)
    text[..., 0], used[..., 0] = ord("-"), pairs < 0
    rest = whole
    for step in range(steps):
        end = 1 + 3 * (steps - step)
        rest, group = np.divmod(rest, _GROUP) if step < steps - 1 else (rest, rest)
        _enter(group, text[..., end - 3 : end])
        for place in range(3):
            power = 10 ** (3 * step + place)
            used[..., end - 1 - place] = whole >= power if power > 1 else True
    dot = 1 + 3 * steps
    text[..., dot] = ord(".")
    _enter(high, text[..., dot + 1 : dot + 4])
    _enter(low, text[..., dot + 4 : dot + 7])
    decimals = PLACES - np.where(low == 0, 3 + groups.zeros[high], groups.zeros[low])
    used[..., dot] = decimals > 0
    for place in range(PLACES):
        used[..., dot + 1 + place] = decimals > place
    text[:, 0, -1], text[:, 1, -1], used[..., -1] = ord(","), ord(" "), True
    ends = np.cumsum(np.count_nonzero(used, axis=(1, 2)))
    return text[used].tobytes(), np.concatenate([[0], ends])
