"""The trained tables of the main profile, as data (spec clause 7.10).

``main.bin`` holds numbers of 16 and 32 bits, the most significant byte first. First the logistic function: 16 bits,
unsigned, for the logits from -MOST_LOGIT to MOST_LOGIT. Then for n = 2, and likewise for n = 3:

1. the weights of the networks' rows, ``HIDDEN`` a row, 16 bits, signed;
2. for each network ``HIDDEN`` output weights and a bias, 32 bits, signed;
3. for each kind of symbols ``INPUTS`` mixing weights, 32 bits, signed;
4. the number of contexts whose start is trained, 16 bits, then for each its number, its probability of a 1 and the
   symbols that it counts as, 16 bits, unsigned.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

HIDDEN = 48
"""Weights of a row."""
INPUTS = 4
"""Opinions that are mixed, the bias among them."""
MOST_LOGIT = 2047
"""Logits are multiples of 1/256, at most this many of them."""
NETS = 9
KINDS = 49
ROWS = {2: 3474, 3: 5417}
"""Rows of all networks (clause 7.10)."""


@dataclass(frozen=True)
class Tables:
    """Of one dimension."""

    weight: NDArray[np.int16]  # (ROWS, HIDDEN)
    out: NDArray[np.int64]  # (NETS, HIDDEN + 1)
    mix: NDArray[np.int64]  # (KINDS, INPUTS)
    state: NDArray[np.int64]  # (S, 3): context, probability of a 1 of 2**16, symbols


def unpacked(data: bytes) -> tuple[NDArray[np.int64], dict[int, Tables]]:
    """The logistic function and the tables by dimension, from the bytes of ``main.bin``."""
    place = 0

    def take(kind: str, *shape: int) -> NDArray[np.int64]:
        nonlocal place
        count = int(np.prod(shape))
        found = np.frombuffer(data, kind, count, place).reshape(shape)
        place += found.nbytes
        return found.astype(np.int64)

    squash = take(">u2", 2 * MOST_LOGIT + 1)
    found = {}
    for n, rows in ROWS.items():
        weight = take(">i2", rows, HIDDEN).astype(np.int16)
        out, mix = take(">i4", NETS, HIDDEN + 1), take(">i4", KINDS, INPUTS)
        found[n] = Tables(weight, out, mix, take(">u2", int(take(">u2", 1)[0]), 3))
    return squash, found


def packed(squash: NDArray[np.int64], found: dict[int, Tables]) -> bytes:
    """The reverse of ``unpacked``."""
    parts = [squash.astype(">u2")]
    for n in ROWS:
        t = found[n]
        parts += [t.weight.astype(">i2"), t.out.astype(">i4"), t.mix.astype(">i4")]
        parts += [np.array([len(t.state)], ">u2"), t.state.astype(">u2")]
    return b"".join(part.tobytes() for part in parts)


def shipped() -> bytes:
    """The bytes of ``main.bin``."""
    return files("isospec").joinpath("main.bin").read_bytes()
