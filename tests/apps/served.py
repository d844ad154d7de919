"""A server on this machine that answers ranges of the files of a folder, and counts the bytes that it sends."""

from __future__ import annotations

import http.server
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class Server(http.server.ThreadingHTTPServer):
    """``url`` of the folder; ``sent`` bytes so far."""

    def __init__(self, folder: Path) -> None:
        super().__init__(("localhost", 0), Ranges)
        self.folder, self.sent = folder, 0
        self.url = f"http://localhost:{self.server_address[1]}"


class Ranges(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Server

    def log_message(self, *_: object) -> None:
        pass

    def do_GET(self) -> None:
        path = self.server.folder / self.path.lstrip("/")
        if not path.is_file():
            self.send_error(404)
            return
        data = path.read_bytes()
        start, end, status = 0, len(data), 200
        if asked := self.headers.get("Range"):
            first, last = asked.removeprefix("bytes=").split("-")
            start, end, status = int(first), min(int(last or end) + 1, end), 206
        self.send_response(status)
        if asked:
            self.send_header("Content-Range", f"bytes {start}-{end - 1}/{len(data)}")
        self.send_header("Accept-Ranges", "bytes")
        self.send_header("Content-Length", str(end - start))
        self.end_headers()
        if self.command == "GET":
            self.server.sent += end - start
            self.wfile.write(data[start:end])

    do_HEAD = do_GET


@contextmanager
def served(folder: Path) -> Iterator[Server]:
    """Serve a folder until the end of the block."""
    with Server(folder) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()
