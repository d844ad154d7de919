"""Fields in tiles, for tests: a few fields, and files of them."""

from __future__ import annotations

import http.server
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

import isocodec
from isocodec.storage.ranges import ranges_of
from isocodec.tiles.tiled import TiledFile


def hilly(shape: tuple[int, ...] = (150, 210)) -> np.ndarray:
    x, y = np.meshgrid(*map(np.arange, shape), indexing="ij")
    return np.rint(100 * np.sin(x / 17) * np.cos(y / 11) + x / 3).astype(np.int16)


def encoded(
    tmp_path: Path, field: np.ndarray | isocodec.Field, isovalue: object, tile: int = 32, **options: object
) -> bytes:
    path = tmp_path / "tiled.iso"
    isocodec.save(path, field, isovalue, tile=tile, **options)  # type: ignore[arg-type]
    return path.read_bytes()


def tiled_of(data: bytes, limits: isocodec.Limits | None = None) -> TiledFile:
    """What reads a file in tiles, piece by piece, of bytes that are all there."""
    view = memoryview(data)
    return TiledFile(ranges_of(data), limits)


def pieces(contour: isocodec.Contour) -> list[tuple[tuple[float, ...], ...]]:
    """Cells as what they are made of, wherever they stand."""
    points = contour.points.round(7) + 0.0
    return sorted(tuple(sorted(map(tuple, points[cell].tolist()))) for cell in contour.cells)


def holed(field: np.ndarray, seed: int) -> np.ndarray:
    gone = gaussian_filter((np.random.default_rng(seed).random(field.shape) < 0.02).astype(float), 1) > 0.05
    return np.ma.masked_array(field, mask=gone)


@contextmanager
def served(data: bytes, how: str = "parts") -> Iterator[tuple[str, list[int]]]:
    """A URL of a file, whose server gives parts, or does something else: the whole at once, another address, nothing
    at all, too little; and how many bytes went each time.
    """
    held = threading.Event()
    sent: list[int] = []

    class Server(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if how == "hangs" or (how == "hangs later" and "bytes=0-" not in self.headers.get("Range", "bytes=0-")):
                held.wait(20)
                return
            if how == "redirects" and not self.path.startswith("/there"):
                self.send_response(302)
                self.send_header("Location", "/there.iso")
                self.end_headers()
                return
            if how == "circles":
                self.send_response(302)
                self.send_header("Location", "/again.iso")
                self.end_headers()
                return
            if how == "fails":
                self.send_error(503)
                return
            asked = self.headers.get("Range", "") if how != "whole" else ""
            start, end = (int(n) for n in asked[6:].split("-")) if asked else (0, len(data) - 1)
            part = data[start : end + 1]
            if not part:
                self.send_error(416)
                return
            sent.append(len(part))
            self.send_response(206 if asked else 200)
            self.send_header("Content-Length", str(len(part)))
            if asked:
                self.send_header("Content-Range", f"bytes {start}-{start + len(part) - 1}/{len(data)}")
            self.end_headers()
            if how == "breaks" and start > 0:
                part = part[: len(part) // 2]
            elif how == "other bytes" and start > 0:
                part = bytes(b ^ 1 for b in part)
            self.wfile.write(part)

        def do_HEAD(self) -> None:
            self.send_response(200)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("localhost", 0), Server)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://localhost:{server.server_port}/field.iso", sent
    finally:
        held.set()
        server.shutdown()
        server.server_close()
