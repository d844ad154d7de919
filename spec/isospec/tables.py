"""The trained tables of the main profile, as data (spec clause 7.10).

``main.bin`` begins with the logistic function: a byte for each logit from 1 to MOST_LOGIT, by how much its probability
exceeds that of the logit before. Then for n = 2, and likewise for n = 3:

1. for each network its rows: for each row two bits, its exponent; then ``COLUMNS`` weights a row, ``BITS`` bits each,
   signed, to be shifted to the left by the row's exponent. Both parts begin with a byte;
2. for each network ``COLUMNS`` output weights, 16 bits, and a bias, 32 bits, all signed;
3. for each kind of symbols ``INPUTS`` mixing weights, 32 bits, signed;
4. a bit for each context: whether its start is trained;
5. for each that is, a byte for the probability of a 1, one of ``starts``, and one for the symbols that it counts as.

The most significant bit and byte come first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HIDDEN = 48
"""Weights of a row; from the network's number of columns on they are 0."""
COLUMNS = (48, 48, 48, 48, 32, 24, 16, 24)
"""Weights of each network's rows that are told."""
BITS = 4
"""Bits of a weight, and..."""
MOST_EXPONENT = 3
"""...how far it may be shifted."""
INPUTS = 4
"""Opinions that are mixed, the bias among them."""
MOST_LOGIT = 2047
"""Logits are multiples of 1/256, at most this many of them."""
NETS = 8
KINDS = 46
NET_ROWS = {
    2: (296, 296, 0, 310, 720, 514, 236, 594),
    3: (362, 340, 424, 328, 720, 775, 332, 1506),
}
"""Rows of each network (clause 7.10)."""
ROWS = {n: sum(rows) for n, rows in NET_ROWS.items()}
STARTS = 5272
"""Contexts of the main profile that may be trained."""


@dataclass(frozen=True)
class Tables:
    """Of one dimension."""

    weight: NDArray[np.int16]  # (ROWS, HIDDEN)
    out: NDArray[np.int64]  # (NETS, HIDDEN + 1)
    mix: NDArray[np.int64]  # (KINDS, INPUTS)
    state: NDArray[np.int64]  # (S, 3): context, probability of a 1 of 2**16, symbols


def starts(squash: NDArray[np.int64]) -> NDArray[np.int64]:
    """Probabilities of a 1 that a context may start with: those of logits that lie 1/16 apart."""
    return squash[7 : 7 + 16 * 256 : 16]


def _bits(data: bytes, place: int, count: int, width: int) -> tuple[NDArray[np.int64], int]:
    """So many numbers of ``width`` bits, unsigned, and where the bytes that hold them end."""
    end = place + (count * width + 7 >> 3)
    bits = np.unpackbits(np.frombuffer(data, np.uint8, end - place, place), count=count * width).reshape(count, width)
    found = np.zeros(count, np.int64)
    for each in bits.T:
        found = found << 1 | each
    return found, end


def _packed_bits(numbers: NDArray[np.int64], width: int) -> bytes:
    """The reverse of ``_bits``; of negative numbers the last bits."""
    return np.packbits((numbers.reshape(-1, 1) >> np.arange(width)[::-1] & 1).astype(np.uint8)).tobytes()


def unpacked(data: bytes) -> tuple[NDArray[np.int64], dict[int, Tables]]:
    """The logistic function and the tables by dimension, from the bytes of ``main.bin``."""
    place = 0

    def take(kind: str, *shape: int) -> NDArray[np.int64]:
        nonlocal place
        count = int(np.prod(shape))
        found = np.frombuffer(data, kind, count, place).reshape(shape)
        place += found.nbytes
        return found.astype(np.int64)

    above = 32768 + np.cumsum(take(">u1", MOST_LOGIT))
    squash = np.concatenate([65536 - above[::-1], [32768], above])
    found = {}
    for n, net_rows in NET_ROWS.items():
        parts = []
        for rows, columns in zip(net_rows, COLUMNS, strict=True):
            exponent, place = _bits(data, place, rows, 2)
            told, place = _bits(data, place, rows * columns, BITS)
            weight = np.zeros((rows, HIDDEN), np.int16)
            # the first of its bits counts negatively
            signed = (told ^ 1 << BITS - 1) - (1 << BITS - 1)
            weight[:, :columns] = signed.reshape(rows, columns) << exponent[:, None]
            parts.append(weight)
        out = np.zeros((NETS, HIDDEN + 1), np.int64)
        for net, columns in enumerate(COLUMNS):
            out[net, :columns], out[net, HIDDEN:] = take(">i2", columns), take(">i4", 1)
        mix = take(">i4", KINDS, INPUTS)
        trained, place = _bits(data, place, STARTS, 1)
        context = np.flatnonzero(trained)
        told = take(">u1", len(context), 2)
        state = np.stack([context, starts(squash)[told[:, 0]], told[:, 1]], 1)
        found[n] = Tables(np.concatenate(parts), out, mix, state)
    return squash, found


def packed(squash: NDArray[np.int64], found: dict[int, Tables]) -> bytes:
    """The reverse of ``unpacked``, of numbers that can be told so."""
    parts = [np.diff(squash[MOST_LOGIT:]).astype(">u1").tobytes()]
    for n, net_rows in NET_ROWS.items():
        t = found[n]
        first = 0
        for rows, columns in zip(net_rows, COLUMNS, strict=True):
            weight = t.weight[first : first + rows, :columns].astype(np.int64)
            first += rows
            exponent = np.zeros(rows, np.int64)
            for _ in range(MOST_EXPONENT):
                wide = (weight >> exponent[:, None]).max(1, initial=0) >= 1 << BITS - 1
                wide |= (weight >> exponent[:, None]).min(1, initial=0) < -1 << BITS - 1
                exponent += wide
            parts += [_packed_bits(exponent, 2), _packed_bits(weight >> exponent[:, None], BITS)]
        for out, columns in zip(t.out, COLUMNS, strict=True):
            parts += [out[:columns].astype(">i2").tobytes(), out[HIDDEN:].astype(">i4").tobytes()]
        trained = np.zeros(STARTS, np.int64)
        trained[t.state[:, 0]] = 1
        told = np.stack([np.searchsorted(starts(squash), t.state[:, 1]), t.state[:, 2]], 1)
        parts += [t.mix.astype(">i4").tobytes(), _packed_bits(trained, 1), told.astype(">u1").tobytes()]
    return b"".join(parts)


@cache
def shipped() -> bytes:
    """The bytes of ``main.bin``."""
    loader: Any = __spec__.loader  # the package may lie in an archive on the path
    return bytes(loader.get_data(str(Path(__file__).with_name("main.bin"))))
