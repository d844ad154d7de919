"""``isocodec serve``: ranges, listings, and nothing beyond the folder or this computer."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path

import pytest

import isocodec
from commands import HILLS, fails
from isospec.tables import shipped


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with two files, something else, and a link that leads out of it; beside it a viewer."""
    for name in ("files/h.iso", "files/more/a b.iso", "outside.iso"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        isocodec.save(tmp_path / name, HILLS, 80.5)
    (tmp_path / "files/notes.txt").write_text("notes")
    (tmp_path / "files/out.iso").symlink_to(tmp_path / "outside.iso")
    (tmp_path / "viewer").mkdir()
    (tmp_path / "viewer/index.html").write_text("the viewer")
    return tmp_path / "files"


class Served:
    """A command that is running, and what it answers."""

    def __init__(self, source: Path, viewer: Path) -> None:
        words = ["serve", source, "--viewer", viewer, "--port", "0", "--json"]
        self.process = subprocess.Popen([sys.executable, "-m", "isocodec", *words], text=True,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert self.process.stdout is not None
        self.port = int(json.loads(self.process.stdout.readline())["address"].rstrip("/").rpartition(":")[2])

    def get(self, path: str, method: str = "GET", **headers: str) -> tuple[HTTPResponse, bytes]:
        connection = HTTPConnection("127.0.0.1", self.port, timeout=20)
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer, answer.read()


@pytest.fixture
def served(folder: Path) -> Iterator[Served]:
    found = Served(folder, folder.parent / "viewer")
    yield found
    found.process.kill()
    found.process.communicate()


def test_page_listing_and_ranges(served: Served, folder: Path) -> None:
    whole = (folder / "h.iso").read_bytes()
    assert served.get("/index.html")[1] == b"the viewer"
    links = re.findall('href="index.html#file=([^"]+)"', served.get("/")[1].decode())
    assert links == ["/files/h.iso", "/files/more/a%20b.iso"]
    assert served.get("/main.bin")[1] == served.get("/plane.bin")[1] == shipped()
    assert served.get(links[1])[1] == (folder / "more/a b.iso").read_bytes()
    for asked, part in {"0-9": slice(0, 10), "7-7": slice(7, 8), "20-": slice(20, None), "-5": slice(-5, None),
                        "3-999999": slice(3, None), "-999999": slice(None)}.items():
        answer, body = served.get(links[0], Range=f"bytes={asked}")
        first, stop, _ = part.indices(len(whole))
        assert (answer.status, body) == (206, whole[part]), asked
        assert answer.headers["Content-Range"] == f"bytes {first}-{stop - 1}/{len(whole)}"
    for asked in ("999999-", "9-3", "-0"):
        assert served.get(links[0], Range=f"bytes={asked}")[0].status == 416, asked
    for asked in ("bytes=0-1,4-5", "bytes=-", "lines=1-2"):
        assert served.get(links[0], Range=asked)[1] == whole, asked
    answer, body = served.get(links[0], "HEAD")
    assert (answer.headers["Content-Length"], body) == (str(len(whole)), b"")


def test_nothing_else_is_served(served: Served, folder: Path) -> None:
    away = f"{folder.parent}/outside.iso"
    for path in ("/files/missing.iso", "/files/notes.txt", "/files/../outside.iso", "/files/%2e%2e/outside.iso",
                 "/files/", "/files/out.iso", f"/files/{away}", f"/files//{away}", "/../files/h.iso",
                 "/..%2ffiles%2fnotes.txt", "/viewer.js", "/files/a%00.iso", "//etc/passwd"):
        assert served.get(path)[0].status == 404, path
    assert served.get("/files/h.iso", Host="example.org")[0].status == 403
    viewer = "--viewer", folder.parent / "viewer"
    with pytest.raises(ConnectionRefusedError):  # another address of this computer
        socket.create_connection(("127.0.0.2", served.port), timeout=5)
    assert "the port is in use" in fails(3, "serve", folder, *viewer, "--port", served.port)
    served.process.send_signal(signal.SIGINT)
    assert served.process.wait(20) == 130


def test_one_file(folder: Path) -> None:
    one = Served(folder / "more/a b.iso", folder.parent / "viewer")
    try:
        answer, _ = one.get("/")
        assert (answer.status, answer.headers["Location"]) == (302, "index.html#file=/files/a%20b.iso")
        assert one.get("/files/a%20b.iso")[1] == (folder / "more/a b.iso").read_bytes()
        assert one.get("/files/h.iso")[0].status == 404
    finally:
        one.process.kill()
        one.process.communicate()


def test_wrong_sources(folder: Path) -> None:
    viewer = folder.parent / "viewer"
    fails(3, "serve", folder / "missing.iso", "--viewer", viewer)
    fails(4, "serve", folder / "notes.txt", "--viewer", viewer)
    fails(2, "serve", folder, "--viewer", viewer, "--port", 65536)
    assert "make view" in fails(3, "serve", folder, "--viewer", folder)
