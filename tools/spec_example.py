"""Write the example of annex C (``spec/example.md``) anew: ``ISOCODEC_KERNELS=python python tools/spec_example.py``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "conformance"))

import isocodec
from isoconform.trace import Symbol, Tracer

SPEC = Path(__file__).resolve().parent.parent / "spec" / "example.md"
BEGIN, END = "<!-- example: tools/spec_example.py -->\n", "<!-- end of example -->\n"
FIELD = np.array([[1, 2, 2, 1], [2, 6, 7, 2], [1, 5, 8, 3], [0, 2, 3, 1]])
ISOVALUE = 4.5
RUN = 13
"""Byte at which the run begins."""


def example() -> bytes:
    """The file that annex C explains."""
    return isocodec.encode(FIELD, ISOVALUE, precision="exact", layers=2, profile="baseline")


def rows(run: bytes, symbols: list[Symbol]) -> Iterator[str]:
    """A row of the table for each symbol, with the state of the range coder before it (clause 6.2)."""
    width, code, shifts = 1 << 32, int.from_bytes(run[:4], "big"), 0
    for number, symbol in enumerate(symbols, 1):
        bound = width * symbol.probability >> 16
        assert (width, int(code < bound)) == (symbol.width, symbol.bit)
        says = "; ".join(symbol.says).replace(", 1 bits missing", ", 1 bit missing")
        yield (
            f"| {number} | {symbol.element} | {symbol.context} | {symbol.probability} | {width:08x} | {code:08x} | "
            f"{bound:08x} | {symbol.bit} | {says} |"
        )
        width, code = (bound, code) if symbol.bit else (width - bound, code - bound)
        while width < 1 << 24:
            code = code << 8 | (run[shifts + 4] if shifts + 4 < len(run) else 0)
            width, shifts = width << 8, shifts + 1


def text() -> str:
    """Bytes and symbols, as the annex shows them."""
    data = example()
    heads = ("no.", "element", "context", "p", "range", "code", "bound", "bit", "what it says")
    lines = [f"{len(data)} bytes: `{data.hex(' ')}`", "", f"| {' | '.join(heads)} |", "| --- " * len(heads) + "|"]
    return "\n".join([*lines, *rows(data[RUN:-4], Tracer(data).symbols)]) + "\n"


def main() -> None:
    spec = SPEC.read_text(encoding="utf-8")
    before, rest = spec.split(BEGIN)
    SPEC.write_text(before + BEGIN + "\n" + text() + "\n" + END + rest.split(END)[1], encoding="utf-8")


if __name__ == "__main__":
    main()
