"""Measure how time and memory grow with the size of what is coded, and fit exponents.

Each row of a table is one size, encoded and decoded in a process of its own: processor seconds, and peak memory in MB
beyond what was in use before. Exponents are fitted by least squares on logarithms, over the sizes at which the quantity
is at least ``CLEAR`` times that of an empty run.

    python tools/growth.py                         all tables; `make growth` does this
    python tools/growth.py length boxes --most 1e7 --plot growth.png
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ONE = 1.05
"""Exponents above this are marked."""
CLEAR = 4.0
"""Quantities below this many times the least one are constant costs, and are not fitted."""
VERTICES_A_SAMPLE = 0.2
"""Of the waves that curve lengths are measured on."""
BOX = 256
"""Rows and columns of the curve in the boxes, and rows of these."""


def waves(side: int) -> NDArray[np.int16]:
    """A field (side, side) whose contour at 0.5 has about as many vertices as a fifth of its samples."""
    rng = np.random.default_rng(7)
    out = np.empty((side, side), np.int16)
    across = np.arange(side)
    for first in range(0, side, 256):
        down = np.arange(first, min(first + 256, side))[:, None]
        rows = 90 * (np.sin(down / 2.9 + across / 11) + np.cos(across / 3.3 - down / 13))
        out[first : first + 256] = rows + rng.integers(-9, 10, rows.shape)
    return out


def hill(side: int) -> NDArray[np.int64]:
    """A smooth field (side, side) of whole values between 0 and 2**20."""
    y, x = np.mgrid[:side, :side] / side
    field = np.sin(5 * x + 2 * y) + np.cos(4 * y - x) + 0.3 * np.sin(17 * x * y)
    return np.rint((field - field.min()) / np.ptp(field) * (1 << 20)).astype(np.int64)


@dataclass(frozen=True)
class Table:
    """One quantity that grows.

    Attributes
    ----------
    title : str
    sizes : tuple of int
    made : callable
        From a size to what is encoded, the isovalue or isovalues, and the options of ``encode``.
    """

    title: str
    sizes: tuple[int, ...]
    made: Callable[[int], tuple[Any, Any, dict[str, Any]]]


def _length(options: dict[str, Any]) -> Callable[[int], tuple[Any, Any, dict[str, Any]]]:
    return lambda size: (waves(max(int(math.sqrt(size / VERTICES_A_SAMPLE)), 8)), 0.5, options)


def _box(size: int) -> tuple[Any, Any, dict[str, Any]]:
    field = np.zeros((BOX, size), np.int16)
    field[:, :BOX] = waves(BOX)
    field[:, BOX - 1] = 0
    return field, 0.5, {"precision": "exact"}


def _isovalues(size: int) -> tuple[Any, Any, dict[str, Any]]:
    return hill(128), [round((k + 0.5) / size * (1 << 20)) + 0.5 for k in range(size)], {"precision": "signs"}


def _layers(size: int) -> tuple[Any, Any, dict[str, Any]]:
    return hill(512), 524288.5, {"layers": "base 18\n" + "offsets 3\n" * (size - 1)}


def _frames(size: int) -> tuple[Any, Any, dict[str, Any]]:
    import isocodec

    field = hill(96)
    return isocodec.Frames([np.roll(field, k, 0) for k in range(size)]), 524288.5, {"precision": "signs"}


def powers(base: int, first: int, last: float) -> tuple[int, ...]:
    """Powers of a base, up to ``last``."""
    return tuple(base**k for k in range(first, 64) if base**k <= last)


def tables(most: float) -> dict[str, Table]:
    """All tables by name; curves have at most ``most`` vertices."""
    lengths = tuple(int(10 ** (k / 2)) for k in range(6, 40) if 10 ** (k / 2) <= most * 1.001)
    return {
        "length": Table("vertices of a curve, exact", lengths, _length({"precision": "exact"})),
        "signs": Table("vertices of a curve, signs, baseline", lengths,
                       _length({"precision": "signs", "profile": "baseline"})),
        "boxes": Table("samples along an axis, the same curve", powers(4, 5, 1 << 20), _box),
        "isovalues": Table("isovalues", powers(4, 0, 4096), _isovalues),
        "layers": Table("layers", (1, 2, 4, 8, 12, 14), _layers),
        "frames": Table("frames", powers(4, 0, 256), _frames),
    }


# ---- In a process of its own ----------------------------------------------------------------------------------------


def taken(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """The result of some work, its processor seconds, and the MB that it needs beyond those in use."""
    import time

    from bench.measure import _reset_peak, _status

    before = _reset_peak()
    started = time.process_time()
    result = work()
    seconds = time.process_time() - started
    return result, seconds, math.nan if before is None else max(_status("VmHWM") - before, 0) / 1024


def measured(name: str, size: int, way: str, path: Path) -> dict[str, float]:
    """Encode one size of a table to a file, or decode that file; all kernels are loaded before."""
    import isocodec

    table = tables(size if name in ("length", "signs") else 0)[name]
    small, isovalue, options = table.made(table.sizes[0] if name != "boxes" else BOX)
    isocodec.decode(isocodec.encode(small, isovalue, **options))
    if way == "encode":
        what, isovalue, options = table.made(size)
        data, seconds, megabytes = taken(lambda: isocodec.encode(what, isovalue, **options))
        path.write_bytes(data)
        return {"bytes": len(data), "encode_s": seconds, "encode_mb": megabytes}
    data = path.read_bytes()

    def decoded() -> int:
        file = isocodec.open(data)
        return sum(len(each.points) for contours in file.each_frame() for each in contours)

    vertices, seconds, megabytes = taken(decoded)
    return {"vertices": vertices, "decode_s": seconds, "decode_mb": megabytes}


def row(name: str, size: int) -> dict[str, float]:
    """Both ways of one size."""
    out: dict[str, float] = {"size": size}
    with tempfile.TemporaryDirectory() as folder:
        for way in ("encode", "decode"):
            command = [sys.executable, __file__, "--one", name, str(size), way, str(Path(folder, "a.iso"))]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                raise SystemExit(f"{name} {size}, {way}: {done.stderr.strip().splitlines()[-1]}")
            out |= json.loads(done.stdout)
    return out


# ---- Report ---------------------------------------------------------------------------------------------------------

QUANTITIES = ("encode_s", "encode_mb", "decode_s", "decode_mb")


def exponent(sizes: list[float], values: list[float]) -> float:
    """The exponent of growth; not a number of what hardly grows."""
    least = min((value for value in values if value > 0), default=math.nan)
    clear = [(s, v) for s, v in zip(sizes, values, strict=True) if v >= CLEAR * least]
    if len(clear) < 2:
        return math.nan
    return float(np.polyfit(*np.log(np.array(clear)).T, 1)[0])


def lines(table: Table, rows: list[dict[str, float]], fits: dict[str, float]) -> Iterator[str]:
    """The table of one quantity as text, with its exponents; those above ``ONE`` have a star."""
    yield f"\n{table.title}"
    yield f"{'size':>12}{'vertices':>12}{'bytes':>12}" + "".join(f"{name:>12}" for name in QUANTITIES)
    for each in rows:
        counts = "".join(f"{int(each[name]):12,}" for name in ("size", "vertices", "bytes"))
        yield counts + "".join(f"{each[name]:12.3f}" for name in QUANTITIES)
    shown = [f"{'constant':>12}" if math.isnan(fit) else f"{fit:11.2f}{'*' * (fit > ONE):1}" for fit in fits.values()]
    yield f"{'exponent':>36}" + "".join(shown)


def plot(found: dict[str, list[dict[str, float]]], path: Path, titles: dict[str, str]) -> None:
    """Draw time and memory against size, a panel each, both axes logarithmic."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4 * len(found), 6), layout="constrained")
    axes = figure.subplots(2, len(found), squeeze=False)
    for column, (name, rows) in enumerate(found.items()):
        for line, unit in enumerate(("s", "mb")):
            for way in ("encode", "decode"):
                axes[line][column].loglog([each["size"] for each in rows],
                                          [max(each[f"{way}_{unit}"], 1e-4) for each in rows], "o-", label=way)
            axes[line][column].set_ylabel({"s": "processor seconds", "mb": "MB"}[unit])
        axes[0][column].set_title(titles[name])
        axes[1][column].set_xlabel("size")
    axes[0][0].legend()
    figure.savefig(path)


def main() -> None:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="TABLE", help=f"tables: {', '.join(tables(0))}; otherwise all")
    parser.add_argument("--most", type=float, default=1e6, metavar="N", help="vertices of the longest curve (1e6)")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="also draw the tables, by matplotlib")
    parser.add_argument("--json", action="store_true", help="print an object for programs")
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.one:
        name, size, way, path = chosen.one
        print(json.dumps(measured(name, int(size), way, Path(path))))
        return
    known = tables(chosen.most)
    if unknown := [name for name in chosen.names if name not in known]:
        parser.error(f"no table {', '.join(unknown)}: choose from {', '.join(known)}")
    found: dict[str, list[dict[str, float]]] = {}
    fits: dict[str, dict[str, float]] = {}
    for name in chosen.names or known:
        found[name] = [row(name, size) for size in known[name].sizes]
        sizes = [each["size"] for each in found[name]]
        fits[name] = {each: exponent(sizes, [row[each] for row in found[name]]) for each in QUANTITIES}
        if not chosen.json:
            print("\n".join(lines(known[name], found[name], fits[name])), flush=True)
    if chosen.json:
        print(json.dumps({"rows": found, "exponents": fits}))
    if chosen.plot:
        plot(found, chosen.plot, {name: table.title for name, table in known.items()})


if __name__ == "__main__":
    main()
