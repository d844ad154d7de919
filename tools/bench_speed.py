"""Measure speed, first use and memory of the codec.

Speed is measured in process and warm, in coded symbols per second, the best of several runs. Machines differ, and one
machine differs from hour to hour: beside each figure stands its ratio to the range coder alone, coding pseudo-random
symbols in 64 contexts at the same time (``calibration``, which needs numba).

    python tools/bench_speed.py                              the data of the demonstration
    python tools/bench_speed.py terrain.npy:500.5 head.npz   other arrays, .npy or .npz; without an isovalue: the median
    python tools/bench_speed.py --rings 400                  areas of 400 x 400 rings, beside those of contourpy
    python tools/bench_speed.py --peers-only                 ratios to what a user would pick instead

These are JBIG1 (jbigkit's library), Draco (DracoPy) and marching cubes (scikit-image), as far as they are installed.
Ratios are of processor times, the shortest of several turns in one process.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import isocodec
from bench.measure import library
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
            took, _ = best(1, decoder.contour)
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
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
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


COMMANDS = {
    "version_s": ["--version"], "info_s": ["info", "{}/terrain.iso"],
    "decode_svg_s": ["decode", "{}/terrain.iso", "-o", "{}/terrain.svg"],
}


def commands(repeat: int) -> dict[str, float]:
    """Processor seconds of commands as processes; before the first, Python compiles what it has not compiled yet."""
    field = np.load(DATA / "camera.npz")["values"]
    report = {}
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "terrain.iso").write_bytes(isocodec.encode(field, 128.5))
        # as an installed package, which lies there compiled
        environment = {**os.environ, "PYTHONPYCACHEPREFIX": folder}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        for name, words in COMMANDS.items():
            command = [sys.executable, "-m", "isocodec", *(word.format(folder) for word in words)]
            report[name] = min(_processor_seconds(command, environment) for _ in range(repeat + 1))
    return report


def _processor_seconds(command: list[str], environment: dict[str, str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


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


# ---- Beside what a user would pick instead -------------------------------------------------------------------------

PICTURES = ("camera.npz:128.5", "coins.npz:107.5", "jacksboro_fault_dem.npz:500.5")
SURFACE = "ct_headsq_quarter.npz:500.5"
PROFILES = ("baseline", "main")
Work = Callable[[], Any]


def in_turns(repeat: int, works: dict[str, Work]) -> dict[str, float]:
    """Shortest processor seconds of each piece of work; they take turns, so that a slow moment meets all of them."""
    out = dict.fromkeys(works, float("inf"))
    for turn in range(repeat + 1):
        for name, work in works.items():
            started = time.process_time()
            work()
            # the first turn loads what is missing
            if turn:
                out[name] = min(out[name], time.process_time() - started)
    return out


def beside_jbig(repeat: int) -> list[dict[str, Any]]:
    """Signs of pictures, and the camera's picture exactly, beside JBIG1's whole pictures of signs."""
    jbig = library("jbigkit")
    if jbig is None:
        return [{"what": "pictures beside JBIG1", "missing": "jbigkit"}]
    sums: dict[str, float] = {}
    rows = []
    for place in PICTURES:
        _, field, isovalue = load(str(DATA / place))
        mask = field > isovalue
        coded = jbig.encode(mask)
        works: dict[str, Work] = {"encode jbig": lambda: jbig.encode(mask), "decode jbig": lambda: jbig.decode(coded)}  # noqa: B023
        for profile in PROFILES:
            options: dict[str, Any] = {"profile": profile, "precision": "signs"}
            data = isocodec.encode(field, isovalue, **options)
            exact = isocodec.encode(field, isovalue, profile=profile, precision="exact")
            works[f"encode {profile}"] = partial(isocodec.encode, field, isovalue, **options)
            works[f"decode {profile}"] = partial(decoded, data)
            if place == PICTURES[0]:
                works[f"exact {profile}"] = partial(decoded, exact)
        took_s = in_turns(repeat, works)
        for name, seconds in took_s.items():
            sums[name] = sums.get(name, 0.0) + seconds
        rows += [
            {"what": f"exact, camera, decode, {profile}", "ours_s": took_s[f"exact {profile}"],
             "peer": "JBIG1 of signs", "peer_s": took_s["decode jbig"]}
            for profile in PROFILES if place == PICTURES[0]
        ]
    return [
        {"what": f"signs of pictures, {way}, {profile}", "ours_s": sums[f"{way} {profile}"], "peer": "JBIG1",
         "peer_s": sums[f"{way} jbig"]}
        for way in ("decode", "encode") for profile in PROFILES
    ] + rows


def beside_meshes(repeat: int) -> list[dict[str, Any]]:
    """A surface decoded to a mesh beside Draco, and encoded and decoded exactly beside marching cubes."""
    _, field, isovalue = load(str(DATA / SURFACE))
    works: dict[str, Work] = {}
    for profile in PROFILES:
        works[f"mesh {profile}"] = partial(isocodec.decode, isocodec.encode(field, isovalue, profile=profile))
        works[f"exact {profile}"] = lambda profile=profile: isocodec.decode(
            isocodec.encode(field, isovalue, profile=profile, precision="exact"))
    if (draco := library("DracoPy")) is not None:
        surface = isocodec.decode(isocodec.encode(field, isovalue))
        coded = draco.encode(surface.points.astype(np.float32), surface.cells.astype(np.uint32), quantization_bits=10,
                             compression_level=10)
        works["draco"] = partial(draco.decode, coded)
    if (skimage := library("skimage.measure")) is not None:
        works["cubes"] = partial(skimage.marching_cubes, field.astype(np.float32), isovalue)
    seconds = in_turns(repeat, works)
    rows: list[dict[str, Any]] = []
    for kind, what, peer, name, needs in (
        ("mesh", "CT surface, default, decode to a mesh", "Draco, level 10", "draco", "DracoPy"),
        ("exact", "CT surface, encode and decode exactly", "marching cubes", "cubes", "scikit-image"),
    ):
        if name not in seconds:
            rows.append({"what": what, "missing": needs})
            continue
        rows += [{"what": f"{what}, {profile}", "ours_s": seconds[f"{kind} {profile}"], "peer": peer,
                  "peer_s": seconds[name]} for profile in PROFILES]
    return rows


DECODE_BEYOND = """
    import sys
    import numpy as np
    from bench.measure import took
    import isocodec
    small, large = (open(path, "rb").read() for path in sys.argv[1:])
    isocodec.decode(small)
    contour, spent = took(lambda: isocodec.decode(large), 1)
    print((spent.megabytes or 0) - (contour.points.nbytes + contour.cells.nbytes) / 2**20)
"""
FLOATS = """
    import sys
    import numpy as np
    from bench.measure import took
    import isocodec
    small = np.linspace(-1, 1, 12)
    small = (np.add.outer(np.add.outer(small**2, small**2), small**2)).astype(np.float32)
    isocodec.decode(isocodec.encode(small, 0.5))
    side = int(sys.argv[1])
    x = np.arange(side, dtype=np.float32) * np.float32(0.125)
    wave, other = np.sin(x), np.cos(x)
    field = (wave[:, None, None] * other[None, :, None] + wave[None, :, None] * other[None, None, :]
             + wave[None, None, :] * other[:, None, None])
    data, encoding = took(lambda: isocodec.encode(field, 0.1), 1)
    limits = isocodec.Limits(memory=1 << 34)
    contour, decoding = took(lambda: isocodec.decode(data, limits=limits), 1)
    print(encoding.seconds, encoding.megabytes, decoding.seconds, decoding.megabytes, len(contour.points))
    try:
        from skimage.measure import marching_cubes
        _, cubes = took(lambda: marching_cubes(field, 0.1), 1)
        print(cubes.seconds, cubes.megabytes)
    except ImportError:
        pass
"""


def memory(side: int) -> list[dict[str, Any]]:
    """Memory of decoders beyond the curve that they give, and what floats (side, side, side) take."""
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        small, large = Path(folder, "small.iso"), Path(folder, "large.iso")
        for place in (PICTURES[0], SURFACE):
            name, field, isovalue = load(str(DATA / place))
            for path, part in ((small, field[(slice(0, 24),) * field.ndim]), (large, field)):
                path.write_bytes(isocodec.encode(part, isovalue, precision="exact"))
            _, printed = fresh(DECODE_BEYOND, str(small), str(large))
            rows.append({"what": f"decoder beyond its output, {name} {' x '.join(map(str, field.shape))}, exact",
                         "ours_mb": float(printed)})
    if side:
        _, printed = fresh(FLOATS, str(side))
        ours, *peer = (list(map(float, line.split())) for line in printed.splitlines())
        what = f"{side}^3 floats, {int(ours[4]):,} vertices"
        cubes = {"peer": "marching cubes", "peer_s": peer[0][0], "peer_mb": peer[0][1]} if peer else {}
        rows += [{"what": f"{what}, encode", "ours_s": ours[0], "ours_mb": ours[1], **cubes},
                 {"what": f"{what}, decode", "ours_s": ours[2], "ours_mb": ours[3], **cubes}]
    return rows


def beside(repeat: int, side: int) -> list[dict[str, Any]]:
    """All rows beside what a user would pick instead, and memory."""
    return [*beside_jbig(repeat), *beside_meshes(repeat), *memory(side)]


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
    for group in ("first_use", "circle"):
        for name, value in report.get(group, {}).items():
            console.print(f"{name:24} {value:.3f}" if isinstance(value, float) else f"{name:24} {value}")


def show_beside(rows: list[dict[str, Any]], seconds: dict[str, float]) -> None:
    """Print the rows beside peers, and the processor seconds of commands."""
    print(f"\n{'':64}{'ours s':>9}{'peer s':>9}{'ratio':>8}{'ours MB':>9}{'peer MB':>9}")
    for row in rows:
        numbers = [row.get(name) for name in ("ours_s", "peer_s")]
        numbers.append(row["ours_s"] / row["peer_s"] if "peer_s" in row else None)
        numbers += [row.get(name) for name in ("ours_mb", "peer_mb")]
        cells = [" " * wide if number is None else f"{number:{wide}.{digits}f}"
                 for number, wide, digits in zip(numbers, (9, 9, 8, 9, 9), (4, 4, 2, 1, 1), strict=True)]
        after = f"  not installed: {row['missing']}" if "missing" in row else f"  {row.get('peer', '')}"
        print(f"{row['what']:64}{''.join(cells)}{after}".rstrip())
    for name, value in seconds.items():
        print(f"{f'command, processor time: {name}':64}{value:9.3f}")


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
    parser.add_argument("--speed-only", action="store_true", help="no first use, no circle, nothing beside peers")
    parser.add_argument("--peers-only", action="store_true", help="only what is beside peers, memory and commands")
    parser.add_argument("--floats", type=int, default=256, metavar="N",
                        help="samples along a side of a volume of floats, 0 for none")
    parser.add_argument("--json", action="store_true", help="print an object for programs")
    chosen = parser.parse_args()

    if chosen.rings:
        print(json.dumps(rings(chosen.rings, chosen.repeat)))
        return
    if chosen.peers_only:
        rows, seconds = beside(chosen.repeat, chosen.floats), commands(chosen.repeat)
        print(json.dumps({"beside": rows, "commands": seconds})) if chosen.json else show_beside(rows, seconds)
        return
    calibration = Calibration()
    report: dict[str, Any] = {"speed": []}
    for argument in chosen.fields or [str(DATA / name) for name in DEMO]:
        report["speed"] += speed(argument, chosen.profile, chosen.repeat, calibration)
    calibration.close()
    report["calibration"] = calibration.best
    if not chosen.speed_only:
        report["first_use"] = first_use(chosen.repeat)
        report["beside"] = beside(chosen.repeat, chosen.floats)
        report["commands"] = commands(chosen.repeat)
        if chosen.side and sys.platform == "linux":
            report["circle"] = circle(chosen.side)
    if chosen.json:
        print(json.dumps(report))
    else:
        show(report)
        show_beside(report.get("beside", []), report.get("commands", {}))


if __name__ == "__main__":
    main()
