"""``isocodec serve``: files in the viewer, in a browser of this computer."""

from __future__ import annotations

import errno
import json
import os
import re
import sys
from functools import partial
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote, unquote, urlsplit

import click

from ..errors import InputError, OptionError
from ..verbs import Serve
from .parameters import Call, command
from .report import concerning

BUILT = Path(__file__).parent / "viewer", Path(__file__).parents[3] / "build" / "viewer"
"""Folders of the viewer: in a wheel, and as a checkout builds it."""
TABLES = "main.bin", "plane.bin"
"""Files of the page that are, or begin, the tables of the profile ``main``, which isocodec has anyway."""
FILES = "/files/"
"""Beginning of the paths of files; other paths are of the page."""
TYPES = {".html": "text/html; charset=utf-8", ".css": "text/css", ".js": "text/javascript", ".wasm": "application/wasm"}
_PIECE = 1 << 16


class Server(ThreadingHTTPServer):
    """Serves the page and the files on the loopback interface."""

    daemon_threads = True
    allow_reuse_address = sys.platform != "win32"  # there it would take a port that is in use

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore browsers that hang up."""


class Handler(BaseHTTPRequestHandler):
    """Answers requests of one connection: the page, the list of files, and files or ranges of their bytes."""

    protocol_version = "HTTP/1.1"

    def __init__(self, source: Path, viewer: Path, *connection: object) -> None:
        self.source, self.viewer = source.resolve(), viewer
        super().__init__(*connection)  # type: ignore[arg-type]

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing."""

    def do_GET(self) -> None:
        """Answer a request. Refuses host names of other sites, which might be made to lead here."""
        path = unquote(urlsplit(self.path).path)
        host = self.headers.get("Host", "").partition(":")[0]
        if host not in ("localhost", "127.0.0.1"):
            return self.send_error(403)
        if path == "/" and self.source.is_file():
            return self._answer(302, b"", {"Location": f"index.html#file={quote(FILES + self.source.name)}"})
        if path == "/":
            return self._answer(200, self._listing(), {"Content-Type": TYPES[".html"]})
        try:
            found = self._found(path)
            file = None if found is None else found.open("rb")
        except (OSError, ValueError):
            found = file = None
        if found is None or file is None:
            return self.send_error(404)
        with file:
            self._send(file, TYPES.get(found.suffix, "application/octet-stream"))

    do_HEAD = do_GET

    def _found(self, path: str) -> Path | None:
        if not path.startswith(FILES):
            name = path[1:]
            if name in TABLES and (spec := find_spec("isospec")) is not None and spec.origin:
                return Path(spec.origin).with_name("main.bin")
            page = self.viewer / name
            return page if "/" not in name and page.suffix in TYPES and page.is_file() else None
        if self.source.is_file():
            return self.source if path == FILES + self.source.name else None
        file = (self.source / path[len(FILES):]).resolve()
        return file if file.is_relative_to(self.source) and file.suffix == ".iso" and file.is_file() else None

    def _listing(self) -> bytes:
        names = sorted(path.relative_to(self.source).as_posix() for path in self.source.rglob("*.iso"))
        links = [f'<li><a href="index.html#file={quote(FILES + name)}">{escape(name)}</a>\n' for name in names
                 if self._found(FILES + name)]
        title = f'<!doctype html><meta charset="utf-8"><title>{escape(self.source.name)}</title>\n'
        return (title + (f"<ul>\n{''.join(links)}</ul>\n" if links else "<p>No .iso files.\n")).encode()

    def _send(self, file: BinaryIO, kind: str) -> None:
        size, headers = os.fstat(file.fileno()).st_size, {"Content-Type": kind}
        first, stop, status = 0, size, 200
        given = re.fullmatch(r"bytes=(\d*)-(\d*)", self.headers.get("Range", ""))
        if given and given[0] != "bytes=-":
            first, stop = ((int(given[1]), min(size, int(given[2] or size) + 1)) if given[1]
                           else (max(0, size - int(given[2])), size))
            if first >= stop:
                return self._answer(416, b"", {"Content-Range": f"bytes */{size}"})
            status, headers["Content-Range"] = 206, f"bytes {first}-{stop - 1}/{size}"
        file.seek(first)
        self._begin(status, stop - first, {**headers, "Accept-Ranges": "bytes"})
        while first < stop and self.command == "GET" and (piece := file.read(min(_PIECE, stop - first))):
            self.wfile.write(piece)
            first += len(piece)

    def _answer(self, status: int, body: bytes, headers: dict[str, str]) -> None:
        self._begin(status, len(body), headers)
        if self.command == "GET":
            self.wfile.write(body)

    def _begin(self, status: int, length: int, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, text in {**headers, "Content-Length": str(length), "Cache-Control": "no-cache"}.items():
            self.send_header(name, text)
        self.end_headers()


@command("serve", Serve, "Look at files in a browser.", "FILE|FOLDER")
def serve_command(call: Call, options: Serve) -> None:
    """Serve the viewer with a file, or with a list of the .iso files in a folder and its subfolders.

    Only this computer can connect. Files in tiles are read in ranges. The command ends with Ctrl-C.
    """
    options.check()
    source = Path(call.source)
    viewer = options.viewer or next((each for each in BUILT if each.is_dir()), BUILT[-1])
    if not source.is_dir():
        call.opened()
        if not source.is_file():
            raise OptionError("serve takes a file or a folder on this computer", code="input")
    with concerning(viewer):
        if not (viewer / "index.html").is_file():
            raise InputError("does not hold the viewer", code="viewer",
                             remedy="build it in a checkout by make view, and give its folder with --viewer")
    with concerning(f"localhost:{options.port}"):
        try:
            server = Server(("127.0.0.1", options.port), partial(Handler, source, viewer))
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            raise InputError("the port is in use", code="port",
                             remedy="choose another one with --port, or 0 for any") from None
    address = f"http://localhost:{server.server_port}/"
    click.echo(json.dumps({"address": address}) if call.as_json else f"{source}: {address} (Ctrl-C ends)")
    sys.stdout.flush()
    with server:
        server.serve_forever()
