"""Writes ``goldens.json``: digests of the files that the present encoder makes of some generated integer fields.

    python tests/make_goldens.py            after a change of the format, which belongs in the change list
    python tests/make_goldens.py --print    to look, or to compare another machine or interpreter

The tests only read the file. The fields come from integer arithmetic alone, so that they are the same everywhere.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import isocodec
from isocodec.drawing.snapshot import state_of

PATH = Path(__file__).with_name("goldens.json")


def noise(shape: tuple[int, ...], seed: int, span: int) -> NDArray[np.int64]:
    """Integers from 0 to ``span - 1``: the high bits of a multiplicative congruential generator modulo 2**31 - 1."""
    state, out = seed, []
    for _ in range(int(np.prod(shape))):
        state = state * 48271 % 2147483647
        out.append(state * span // 2147483647)
    return np.array(out, np.int64).reshape(shape)


def hill(shape: tuple[int, ...], height: int) -> NDArray[np.int64]:
    """A paraboloid around a point near the middle."""
    grid = np.indices(shape, np.int64)
    centre = np.array([s * 3 // 7 for s in shape]).reshape(-1, *(1,) * len(shape))
    return height - 3 * ((grid - centre) ** 2).sum(axis=0)


Case = tuple[NDArray[np.int64], float, dict]

CASES: dict[str, Case] = {
    "plane exact": (hill((45, 60), 900) + noise((45, 60), 1, 40), 300.5, {"precision": "exact"}),
    "plane tolerance": (hill((45, 60), 900), 300, {"precision": 0.01}),
    "plane noise": (noise((40, 33), 2, 10), 4, {"precision": "signs", "layers": 0}),
    "plane single rate": (hill((33, 33), 500) + noise((33, 33), 3, 9), 120, {"precision": "exact", "layers": 10}),
    "space exact": (hill((17, 20, 23), 400) + noise((17, 20, 23), 4, 30), 200.5, {"precision": "exact"}),
    "space tolerance": (hill((17, 20, 23), 400), 200, {"precision": 0.1}),
    "space noise": (noise((9, 7, 12), 5, 10), 7, {"precision": "signs", "layers": 0}),
    "plane small": (hill((9, 12), 60) + noise((9, 12), 6, 9), 20.5, {"precision": "exact", "layers": 1}),
    "space small": (hill((4, 5, 6), 30) + noise((4, 5, 6), 7, 9), 12, {"precision": 0.2, "layers": 0}),
    "plane mesh small": (
        hill((14, 17), 150) + noise((14, 17), 9, 5),
        40.5,
        {"layers": "distortion=0.6", "precision": 0.3},
    ),
    "space mesh small": (hill((5, 7, 6), 40), 12.5, {"layers": "crossing", "precision": 0.3}),
    "long small": (noise((3, 30), 8, 3), 0, {"precision": "signs", "layers": 3}),
}
SMALL = [name for name in CASES if name.endswith("small")]
"""Those that an interpreter without compiled kernels does in a second or so."""


def digests(name: str) -> dict[str, int | str]:
    """Length and SHA-256 of a case's file, and SHA-256 of the state that it decodes to."""
    field, isovalue, options = CASES[name]
    data = isocodec.encode(field, isovalue, **options)
    decoder = isocodec.Decoder()
    decoder.feed(data)
    decoder.close()
    state = "\n".join(state_of(decoder.grid._tube).lines())
    return {
        "length": len(data),
        "file": hashlib.sha256(data).hexdigest(),
        "state": hashlib.sha256(state.encode()).hexdigest(),
    }


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description="Write tests/goldens.json")
    parser.add_argument("--print", action="store_true", help="print instead of writing")
    parser.add_argument("names", nargs="*", default=list(CASES), help="cases (with --print)")
    arguments = parser.parse_args()
    text = json.dumps({name: digests(name) for name in arguments.names}, indent=1) + "\n"
    if arguments.print:
        print(text, end="")
    elif set(arguments.names) != set(CASES):
        parser.error("the file holds all cases: names are for --print")
    else:
        PATH.write_text(text)


if __name__ == "__main__":
    main()
