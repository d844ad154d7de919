"""A field of 40,000 x 40,000 samples that is never in memory, in tiles: ``tile_scale.py [SIDE] [WORKERS]``.

Prints seconds, memory of workers and of the process that writes the file, what is fetched of the whole curve within 20
samples and of a window at full precision from a server that answers ranges, and how long a directory of 10^5 tiles
takes to open.
"""

from __future__ import annotations

import http.server
import multiprocessing
import re
import resource
import sys
import tempfile
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import isocodec
from isocodec.stream.options import Options
from isocodec.tiles.assembly import Tiles, grid_of, merged
from isocodec.tiles.structure import Kind
from isocodec.tiles.tile_encoder import Tiling

WINDOW = 0.3, 0.6
"""Where a window of 1000 x 1000 samples begins, as parts of the side."""


class Terrain:
    """Heights by a formula, waves of 70 to 9,000 samples; slices are computed when they are asked for."""

    def __init__(self, side: int) -> None:
        self.shape = side, side
        self.dtype = np.dtype(np.float32)

    def __getitem__(self, window: tuple[slice, slice]) -> np.ndarray[Any, Any]:
        x, y = (np.arange(each.start, each.stop, dtype=np.float64) for each in window)
        total = np.zeros((len(x), len(y)), np.float32)
        for number, length in enumerate((9000, 4100, 1900, 870, 390, 170, 70)):
            a, b = 2 * np.pi / length * np.cos(number), 2 * np.pi / length * np.sin(number)
            phase_x, phase_y = a * x + 2 * np.sin(x / (3 * length)), b * y + 2 * np.cos(y / (2 * length))
            # sin(p + q) of a sum of a row's part and a column's
            wave = np.outer(np.sin(phase_x), np.cos(phase_y)) + np.outer(np.cos(phase_x), np.sin(phase_y))
            total += (length**0.5 * wave).astype(np.float32)
        return total


class Ranges(http.server.BaseHTTPRequestHandler):
    """Answers ranges of one file, and counts."""

    data: ClassVar[bytes] = b""
    asked: ClassVar[list[int]] = []

    def do_GET(self) -> None:
        found = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        start, end = (int(found[1]), int(found[2]) + 1) if found else (0, len(self.data))
        part = self.data[start:end]
        self.asked.append(len(part))
        self.send_response(206 if found else 200)
        self.send_header("Content-Length", str(len(part)))
        self.send_header("Content-Range", f"bytes {start}-{start + len(part) - 1}/{len(self.data)}")
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, *_: object) -> None:
        pass


def peak(who: int) -> float:
    """Megabytes."""
    return resource.getrusage(who).ru_maxrss / 1024


def fetched(path: Path) -> None:
    """Windows from a server."""
    Ranges.data = path.read_bytes()
    server = http.server.ThreadingHTTPServer(("localhost", 0), Ranges)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    file = isocodec.open(f"http://localhost:{server.server_port}/field.iso")
    assert file.kind == "tiles"
    whole = file.contour(within=20)
    print(f"whole curve within 20 samples: {len(Ranges.asked)} requests, {sum(Ranges.asked):,} bytes, "
          f"{len(whole.points):,} points")
    before = len(Ranges.asked)
    part = file.contour(window=[(int(at * file.shape[0]), int(at * file.shape[0]) + 1000) for at in WINDOW])
    later = Ranges.asked[before:]
    print(f"a window of 1000 x 1000 at full precision: {len(later)} requests, {sum(later):,} bytes, "
          f"{len(part.points):,} points")
    server.shutdown()


def directory(side: int = 316) -> None:
    """Opening a file of 10^5 tiles."""
    shape = (side * 32 + 1, side * 32 + 1)
    tiling = Tiling(grid_of(shape, 5), (0.5,), Options.of(precision="signs"), "<f4")
    tiles = Tiles(tiling)
    tiles.kinds[1], tiles.place[:] = Kind.CODED, 0
    tiles.lengths[1:] = 200
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "many.iso"
        path.write_bytes(b"".join(merged(tiles, lambda place, length: bytes(length))))
        isocodec.open(path)
        begun = time.perf_counter()
        isocodec.open(path)
        print(f"{tiling.grid.total:,} tiles, {path.stat().st_size:,} bytes: opened in "
              f"{1000 * (time.perf_counter() - begun):.1f} ms")


def main() -> None:
    """Encode, then read."""
    side = int(sys.argv[1]) if len(sys.argv) > 1 else 40_000
    workers = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    directory()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "field.iso"
        begun = time.perf_counter()
        with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as engine:
            isocodec.save(path, Terrain(side), 0.0, tile=1024, engine=engine)
        took = time.perf_counter() - begun
        print(f"{side} x {side} samples, {workers} workers: {path.stat().st_size:,} bytes, {took:.0f} s, "
              f"{side * side / took / 1e6:.1f} million samples a second; most memory of a worker "
              f"{peak(resource.RUSAGE_CHILDREN):.0f} MB, of the one that merges {peak(resource.RUSAGE_SELF):.0f} MB",
              flush=True)
        fetched(path)


if __name__ == "__main__":
    main()
