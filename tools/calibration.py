"""The range coder alone: pseudo-random symbols of a few contexts, for figures to be compared with.

    ISOCODEC_KERNELS=numba python tools/calibration.py

answers each line ``encode`` or ``decode`` of its input with the symbols that it coded in a second. It is a process of
its own, since no library has a kernel that does but this: numba compiles one.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from isocodec.entropy.context_layout import context_coder
from isocodec.entropy.range_coder import DECODE, ENCODE, ONE, Coder, code, finish, start
from isocodec.kernel import kernel
from isocodec.kernel.types import IntVector

CONTEXTS = 64
SYMBOLS = 2_000_000
PROBABILITY = 0.2
"""Of a 1."""


@kernel
def code_all(cd: Coder, context: IntVector, bits: IntVector) -> None:
    """Code symbols, or put those that are decoded in their place."""
    for i in range(len(bits)):
        bits[i] = code(cd, context[i], bits[i])


def coder(room: int) -> Coder:
    """A coder of the baseline profile."""
    prob = np.full(CONTEXTS, ONE // 2, np.int64)
    return context_coder(prob, np.ones(CONTEXTS, np.int64), room)


def encode(context: IntVector, bits: IntVector) -> tuple[float, bytes]:
    """Seconds that encoding takes, and the bytes."""
    cd = coder(SYMBOLS)
    start(cd.reg, ENCODE)
    given = bits.copy()
    started = time.perf_counter()
    code_all(cd, context, given)
    return time.perf_counter() - started, finish(cd)


def decode(context: IntVector, bits: IntVector, run: bytes) -> float:
    """Seconds that decoding takes; the symbols are compared."""
    cd = coder(len(run))
    cd.buf[:] = np.frombuffer(run, np.uint8)
    start(cd.reg, DECODE)
    cd.reg.end, cd.reg.final = len(run), 1
    found = np.zeros(SYMBOLS, np.int64)
    started = time.perf_counter()
    code_all(cd, context, found)
    seconds = time.perf_counter() - started
    if not np.array_equal(found, bits):
        raise SystemExit("the range coder did not decode what it encoded")
    return seconds


def main() -> None:
    """Answer until there are no more questions."""
    generator = np.random.default_rng(1)
    context = generator.integers(0, CONTEXTS, SYMBOLS)
    bits = (generator.random(SYMBOLS) < PROBABILITY).astype(np.int64)
    _, run = encode(context, bits)
    for line in sys.stdin:
        seconds = decode(context, bits, run) if line.strip() == "decode" else encode(context, bits)[0]
        print(SYMBOLS / seconds, flush=True)


if __name__ == "__main__":
    main()
