"""Measure speed, first use and memory of the codec.

Speed is measured in process and warm, in coded symbols per second, the best of several runs. Machines differ, and one
machine differs from hour to hour: beside each figure stands its ratio to the range coder alone, coding pseudo-random
symbols in 64 contexts at the same time (``calibration``, which needs numba).

    python tools/bench_speed.py                              the data of the demonstration
    python tools/bench_speed.py terrain.npy:500.5 head.npz   other arrays, .npy or .npz; without an isovalue: the median
    python tools/bench_speed.py --rings 400                  areas of 400 x 400 rings, beside those of contourpy
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import isocodec
from isocodec.kernel.execution import SETTING

DATA = Path(__file__).resolve().parent.parent / "demo" / "data"
DEMO = (
    "jacksboro_fault_dem.npz:500.5", "coins.npz:107.5", "camera.npz:128.5",
    "ct_headsq_quarter.npz:500.5", "ct_headsq_quarter.npz:1150.5",
)
MODES: dict[str, dict[str, Any]] = {
    "exact": {"precision": "exact"}, "default": {}, "signs only": {"precision": "signs"},
}


def best(repeat: int, work: Callable[[], Any]) -> tuple[float, Any]:
    """Shortest of several times in seconds, and the last result."""
    shortest = float("inf")
    result = None
    for _ in range(repeat):
        started = time.perf_counter()
        result = work()
        shortest = min(shortest, time.perf_counter() - started)
    return shortest, result


# ---- Calibration ----------------------------------------------------------------------------------------------------


class Calibration:
    """The range coder alone: symbols per second, either way."""

    def __init__(self) -> None:
        program = Path(__file__).with_name("calibration.py")
        self._process = subprocess.Popen(
            [sys.executable, str(program)], text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={**os.environ, SETTING: "numba", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        self.best = {"encode": 0.0, "decode": 0.0}
        for way in self.best:
            self.measure(way)

    def measure(self, way: str) -> float:
        """Encoded or decoded symbols per second."""
        assert self._process.stdin and self._process.stdout
        print(way, file=self._process.stdin, flush=True)
        answer = self._process.stdout.readline()
        if not answer:
            raise SystemExit("the calibration failed, see above")
        self.best[way] = max(self.best[way], float(answer))
        return float(answer)

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


# ---- Speed ----------------------------------------------------------------------------------------------------------


def load(argument: str) -> tuple[str, NDArray[Any], float]:
    """Name, array and isovalue of ``path[:isovalue]``."""
    name, _, number = argument.rpartition(":")
    try:
        path, isovalue = Path(name), float(number)
    except ValueError:
        path, isovalue = Path(argument), None
    found = np.load(path)
    if not isinstance(found, np.ndarray):
        found = found["values"] if "values" in found else found[found.files[0]]
    if isovalue is None:
        isovalue = float(np.floor(np.median(found))) + 0.5
    return path.stem, found, isovalue


def decoded(data: bytes) -> isocodec.Decoder:
    """A decoder that has taken a whole file; nothing is drawn."""
    decoder = isocodec.Decoder()
    decoder.feed(data)
    for _ in decoder:
        pass
    decoder.close()
    return decoder


def speed(argument: str, profile: str, repeat: int, calibration: Calibration) -> list[dict[str, Any]]:
    """Rows of one field, one for each mode that fits it."""
    name, field, isovalue = load(argument)
    rows = []
    for mode, more in MODES.items():
        if mode == "exact" and field.dtype.kind == "f":
            continue
        options = {"profile": profile, **more}
        isocodec.decode(isocodec.encode(field, isovalue, **options))
        alone = {"encode": 0.0, "decode": 0.0}
        seconds = {"encode": float("inf"), "decode": float("inf"), "draw": float("inf")}
        data, decoder = b"", None
        # In turns, so that a slow moment of the machine meets all of them.
        for _ in range(repeat):
            alone["encode"] = max(alone["encode"], calibration.measure("encode"))
            took, data = best(1, lambda: isocodec.encode(field, isovalue, **options))  # noqa: B023
            seconds["encode"] = min(seconds["encode"], took)
            alone["decode"] = max(alone["decode"], calibration.measure("decode"))
            took, decoder = best(1, lambda: decoded(data))  # noqa: B023
            seconds["decode"] = min(seconds["decode"], took)
            took, _ = best(1, decoder.drawn)
            seconds["draw"] = min(seconds["draw"], took)
        assert decoder is not None
        symbols = sum(decoder.symbols.values())
        row = {
            "field": name, "shape": list(field.shape), "isovalue": isovalue, "mode": mode, "bytes": len(data),
            "symbols": symbols, "draw_s": seconds["draw"],
        }
        for way in ("encode", "decode"):
            row[f"{way}_s"] = seconds[way]
            row[f"{way}_symbols_per_s"] = symbols / seconds[way]
            row[f"{way}_ratio"] = symbols / seconds[way] / alone[way]
        rows.append(row)
    return rows


# ---- Fresh processes ------------------------------------------------------------------------------------------------


def fresh(program: str, *arguments: str) -> tuple[float, str]:
    """Wall-clock seconds of a Python program in a process of its own, and what it printed."""
    started = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program), *arguments],
        check=True, capture_output=True, text=True, stdin=subprocess.DEVNULL,
    )
    return time.perf_counter() - started, done.stdout


USE = """
    import time
    started = time.perf_counter()
    import numpy as np
    import isocodec
    for shape in ((40, 40), (20, 20, 20)):
        field = (np.indices(shape).astype(float) ** 2).sum(axis=0).astype(np.int64)
        for options in ({}, {"precision": "exact"}):
            isocodec.decode(isocodec.encode(field, 150.5, **options))
        print(time.perf_counter() - started)
"""


def first_use(repeat: int) -> dict[str, float]:
    """Seconds until a new process has encoded and decoded a curve, and a surface too, and until it has ended."""
    process, printed = min(fresh(USE) for _ in range(repeat))
    curve, both = map(float, printed.split())
    return {"first_use_curve_s": curve, "first_use_both_s": both, "first_use_process_s": process}


def info(repeat: int) -> dict[str, float]:
    """Seconds of ``isocodec info`` as a process."""
    field = np.load(DATA / "jacksboro_fault_dem.npz")["values"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "terrain.iso")
        path.write_bytes(isocodec.encode(field, 500.5))
        command = [sys.executable, "-m", "isocodec", "info", str(path)]
        seconds, _ = best(repeat, lambda: subprocess.run(command, check=True, capture_output=True))
    return {"info_s": seconds}


CIRCLE = """
    import sys
    import numpy as np
    import isocodec
    side, path = int(sys.argv[1]), sys.argv[2]
    # Untouched memory is not there: the field takes no more than the circle, its signs a byte a sample.
    field = np.zeros((side, side), np.uint8)
    at = side // 3
    y, x = np.ogrid[-128:128, -128:128]
    field[at - 128 : at + 128, at - 128 : at + 128] = np.clip(128 + 8 * (100 - np.hypot(y, x)), 0, 255)
    with open(path, "wb") as file:
        file.write(isocodec.encode(field, 127.5))
"""

DECODE_CIRCLE = """
    import sys, time
    import numpy as np
    import isocodec

    def highest():
        with open("/proc/self/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024

    isocodec.Decoder
    imported = highest()
    small = open(sys.argv[1], "rb").read()
    large = open(sys.argv[2], "rb").read()
    isocodec.decode(small)
    loaded = highest()
    started = time.perf_counter()
    contour = isocodec.decode(large)
    seconds = time.perf_counter() - started
    print(imported, loaded, highest(), seconds, len(contour.points))
"""


def circle(side: int) -> dict[str, Any]:
    """Memory and time of decoding a circle 200 cells across in a large domain; the encoder takes a byte a sample."""
    with tempfile.TemporaryDirectory() as folder:
        small, large = str(Path(folder, "small.iso")), str(Path(folder, "large.iso"))
        fresh(CIRCLE, "800", small)
        fresh(CIRCLE, str(side), large)
        _, printed = fresh(DECODE_CIRCLE, small, large)
        size = Path(large).stat().st_size
    imported, loaded, decoded_at, seconds, points = map(float, printed.split())
    return {
        "circle_side": side, "circle_bytes": size, "circle_points": int(points), "circle_decode_s": seconds,
        "circle_imports_mb": imported, "circle_kernels_mb": loaded - imported, "circle_decode_mb": decoded_at - loaded,
    }


def rings(side: int, repeat: int) -> dict[str, float]:
    """Seconds until areas above and below a curve of ``side**2`` rings are made, and contourpy's for those below."""
    import contourpy

    field = np.zeros((4 * side, 4 * side), np.uint8)
    field[1::4, 1::4] = 9
    contour = isocodec.decode(isocodec.encode(field, 4.5, precision="exact"))
    report: dict[str, float] = {"rings": len(contour.lines)}
    for name, above in (("areas_above_s", True), ("areas_below_s", False)):
        # a new object each time: the lines of one are kept
        report[name], _ = best(repeat, lambda: replace(contour).areas(above=above))  # noqa: B023
    peer = contourpy.contour_generator(z=field.astype(float), fill_type="OuterOffset")
    report["contourpy_below_s"], _ = best(repeat, lambda: peer.filled(-1, 4.5))
    return report


# ---- Report ---------------------------------------------------------------------------------------------------------


def show(report: dict[str, Any]) -> None:
    """Print a report for people."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console()
    alone = report["calibration"]
    console.print(
        "range coder alone: "
        + ", ".join(f"{way} {alone[way] / 1e6:.1f} million symbols/s" for way in ("encode", "decode"))
    )
    title = "million coded symbols a second, ratio to the range coder alone"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    for heading in ("field", "mode", "symbols", "encode", "ratio", "decode", "ratio", "draw"):
        table.add_column(heading, justify="left" if heading in ("field", "mode") else "right")
    for row in report["speed"]:
        speeds = []
        for way in ("encode", "decode"):
            speeds += [f"{row[f'{way}_symbols_per_s'] / 1e6:.2f}", f"{row[f'{way}_ratio']:.3f}"]
        field = f"{row['field']} {row['isovalue']:g}"
        table.add_row(field, row["mode"], f"{row['symbols']:,}", *speeds, f"{row['draw_s'] * 1e3:.0f} ms")
    console.print(table)
    for group in ("first_use", "info", "circle"):
        for name, value in report.get(group, {}).items():
            console.print(f"{name:24} {value:.3f}" if isinstance(value, float) else f"{name:24} {value}")


def main() -> None:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fields", nargs="*", metavar="ARRAY[:ISOVALUE]", help="fields to measure speed on")
    parser.add_argument("--profile", choices=("main", "baseline"), default="main", help="of the files")
    parser.add_argument("--repeat", type=int, default=5, metavar="N", help="runs of which the best counts")
    parser.add_argument(
        "--side", type=int, default=20_000, metavar="N",
        help="samples along a side of the domain in which a circle is decoded, 0 for none; encoding takes N * N bytes",
    )
    parser.add_argument("--rings", type=int, metavar="N", help="measure only the areas of N * N rings")
    parser.add_argument("--speed-only", action="store_true", help="no first use, no info, no circle")
    parser.add_argument("--json", action="store_true", help="print an object for programs")
    chosen = parser.parse_args()

    if chosen.rings:
        print(json.dumps(rings(chosen.rings, chosen.repeat)))
        return
    calibration = Calibration()
    report: dict[str, Any] = {"speed": []}
    for argument in chosen.fields or [str(DATA / name) for name in DEMO]:
        report["speed"] += speed(argument, chosen.profile, chosen.repeat, calibration)
    calibration.close()
    report["calibration"] = calibration.best
    if not chosen.speed_only:
        report["first_use"] = first_use(chosen.repeat)
        report["info"] = info(chosen.repeat)
        if chosen.side and sys.platform == "linux":
            report["circle"] = circle(chosen.side)
    if chosen.json:
        print(json.dumps(report))
    else:
        show(report)


if __name__ == "__main__":
    main()
