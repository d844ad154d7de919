"""Servers that do anything but what they are asked for: what is read is right, or an error says what is wrong, soon.

The table lists kinds of servers, each with what reading a window of a tiled file from it comes to.
"""

from __future__ import annotations

import http.server
import resource
import threading
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from brute import INTERPRETED
from commands import fails
from isocodec.errors import InputError, IsoError
from isocodec.format.header import HEAD_BYTES
from isocodec.storage.ranges import SLACK, together
from isocodec.storage.web import LANES, Range
from tables import heavy, looped
from tiled import encoded, hilly, pieces, tiled_of

pytestmark = pytest.mark.skipif(INTERPRETED, reason="slow in Python, and the same")
BOX = [(300, 330), (400, 430)]
RIGHT = ""
"""The window is read as it is."""
MOST_SENT, SECONDS, MEMORY = 64 << 20, 10, 128 << 20
"""Of a server without end: what a reader takes, 8 MB, and what the buffers of both sockets hold, which counts as sent
(36 MB where the kernel lets them grow so far); a reader that goes on takes as much in a tenth of a second."""


@pytest.fixture(scope="module")
def noise(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    field = np.random.default_rng(1).integers(0, 100, (600, 600))
    return encoded(tmp_path_factory.mktemp("noise"), field, 50.5, precision="exact")


class Server(http.server.BaseHTTPRequestHandler):
    """Answers ranges of `data`; a kind of server changes one thing."""

    protocol_version = "HTTP/1.1"
    kind: Callable[[Server], None]
    data: bytes
    seen: Counter[str]
    sent: list[int]
    held: threading.Event

    def log_message(self, *_: object) -> None:
        pass

    def do_GET(self) -> None:
        self.seen["requests"] += 1
        # what the process beside sends is not ours
        self.close_connection = True
        with suppress(OSError):
            type(self).kind(self)

    @property
    def asked(self) -> tuple[int, int]:
        """The range that is asked for, or all."""
        text = self.headers.get("Range", f"bytes=0-{len(self.data) - 1}")
        first, last = text.removeprefix("bytes=").split("-")
        return int(first), min(int(last) + 1, len(self.data))

    def answer(self, status: int, headers: dict[str, str], body: bytes = b"") -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        if "Content-Length" not in headers and "Transfer-Encoding" not in headers:
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.give(body)

    def give(self, body: bytes) -> None:
        # counted first: who has the answer may look at once
        self.sent.append(len(body))
        try:
            self.wfile.write(body)
        except OSError:
            self.sent.pop()
            raise

    def part(self, *, shift: int = 0, cut: int = 0, body: bytes | None = None, **headers: str) -> None:
        """Answer the range; headers have underscores."""
        start, end = self.asked
        if start >= end:
            self.answer(416, {})
            return
        given = {"Content_Range": f"bytes {start + shift}-{end - 1 - cut + shift}/{len(self.data)}", **headers}
        named = {name.replace("_", "-"): value for name, value in given.items() if value}
        self.answer(206, named, self.data[start : end - cut] if body is None else body)


def right(server: Server) -> None:
    server.part()


def ends_at_once(server: Server) -> None:
    pass


def never_ends(server: Server) -> None:
    start, end = server.asked
    server.answer(206, {"Transfer-Encoding": "chunked", "Content-Range": f"bytes {start}-{end - 1}/{len(server.data)}"})
    while True:
        server.give(b"100000\r\n" + bytes(1 << 20) + b"\r\n")


def never_ends_as_a_whole(server: Server) -> None:
    server.answer(200, {"Transfer-Encoding": "chunked"})
    while True:
        server.give(b"100000\r\n" + b"\x89IST" + bytes((1 << 20) - 4) + b"\r\n")


PACKER = zlib.compressobj(9, zlib.DEFLATED, 31)
BOMB = b"".join(PACKER.compress(bytes(1 << 20)) for _ in range(300)) + PACKER.flush()


def packs(server: Server) -> None:
    server.part(body=BOMB, Content_Encoding="gzip")


def other_bytes(server: Server) -> None:
    start, end = server.asked
    server.part(body=bytes(b ^ (start > 0) for b in server.data[start:end]))


def several_parts(server: Server) -> None:
    start, end = server.asked
    body = b"--x\r\nContent-Range: bytes\r\n\r\n" + server.data[start:end] + b"\r\n--x--\r\n"
    server.part(body=body, Content_Range="", Content_Type="multipart/byteranges; boundary=x")


def changes(name: str) -> Callable[[Server], None]:
    return lambda server: server.part(**{name: f'"{server.seen["requests"]}"'})


def busy(status: int, times: int, **headers: str) -> Callable[[Server], None]:
    """Busy for the first of some requests, or for all."""
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return lambda server: server.answer(status, named) if server.seen["requests"] <= times else server.part()


def hangs(server: Server) -> None:
    server.held.wait(20)


def hangs_later(server: Server) -> None:
    if server.asked[0]:
        server.held.wait(20)
    server.part()


def hangs_in_the_middle(server: Server) -> None:
    start, end = server.asked
    server.part(body=server.data[start : start + 99], Content_Length=str(end - start))
    server.held.wait(20)


def drips(server: Server) -> None:
    start, end = server.asked
    server.part(body=b"", Content_Length=str(end - start))
    for byte in server.data[start:end]:
        server.give(bytes([byte]))
        server.wfile.flush()
        if server.held.wait(0.05):
            return


def drips_headers(server: Server) -> None:
    while not server.held.wait(0.05):
        server.give(b"HTTP/1.1 200 OK\r\n" if not server.sent else b"A: b\r\n")
        server.wfile.flush()


def endless_headers(server: Server) -> None:
    server.give(b"HTTP/1.1 206 Partial Content\r\n")
    while True:
        server.give(b"A: " + b"b" * 8000 + b"\r\n")


def no_http(server: Server) -> None:
    server.give(b"\x89IST" * 1000)


def breaks(times: int) -> Callable[[Server], None]:
    def answer(server: Server) -> None:
        start, end = server.asked
        broken = start > 0 and server.seen["requests"] <= times
        server.part(body=server.data[start : (start + end) // 2 if broken else end], Content_Length=str(end - start))

    return answer


def sends_more(server: Server) -> None:
    start, end = server.asked
    server.part(body=server.data[start:end] + b"more")


def redirects(where: str) -> Callable[[Server], None]:
    def answer(server: Server) -> None:
        if server.path.startswith("/there"):
            server.part()
        else:
            server.answer(302, {"Location": where})

    return answer


def at_the_end(server: Server) -> None:
    """Ranges are cut where the file ends, and no total is stated."""
    start, end = server.asked
    server.part(Content_Range=f"bytes {start}-{end - 1}/*")


ALWAYS = 1 << 30
KINDS: dict[str, tuple[Callable[[Server], None], str]] = {
    "right": (right, RIGHT),
    "no total": (at_the_end, RIGHT),
    "redirects": (redirects("/there.iso"), RIGHT),
    "busy twice": (busy(503, 2), RIGHT),
    "too many requests": (busy(429, 1, Retry_After="1"), RIGHT),
    "breaks off once": (breaks(2), RIGHT),
    "busy": (busy(503, ALWAYS), "answers 503 Service Unavailable"),
    "busy for an hour": (busy(429, ALWAYS, Retry_After="3600"), "answers 429 Too Many Requests: try again in 3,600 s"),
    "wrong": (busy(500, ALWAYS), "answers 500 Internal Server Error"),
    "forbidden": (busy(403, ALWAYS), "answers 403 Forbidden"),
    "gone": (busy(404, ALWAYS), "no such file"),
    "nothing there": (busy(416, ALWAYS), "the file is empty"),
    "no status that is known": (busy(299, ALWAYS), "answers 299"),
    "body without end": (never_ends, "more than the 16,384 bytes"),
    "gzip bomb": (packs, "compresses what it sends .gzip."),
    "other bytes": (other_bytes, "checksum"),
    "another range": (lambda server: server.part(shift=1), "other bytes than the requested"),
    "less than the range": (lambda server: server.part(cut=9), "other bytes than the requested"),
    "no range stated": (lambda server: server.part(Content_Range=""), "other bytes than the requested"),
    "nonsense stated": (lambda server: server.part(Content_Range="bytes x-y/z"), "other bytes than the requested"),
    "several parts": (several_parts, "other bytes than the requested"),
    "another file by its tag": (changes("ETag"), "has changed"),
    "another file by its date": (changes("Last_Modified"), "has changed"),
    "ends at once": (ends_at_once, "cannot be read"),
    "hangs": (hangs, "not answered within"),
    "hangs later": (hangs_later, "not answered within"),
    "hangs in the middle": (hangs_in_the_middle, "not answered within"),
    "drips": (drips, "not answered within"),
    "drips headers": (drips_headers, "not answered within"),
    "headers without end": (endless_headers, "cannot be read"),
    "no http": (no_http, "cannot be read"),
    "breaks off": (breaks(ALWAYS), "cannot be read"),
    "sends more": (sends_more, "more than the 16,384 bytes"),
    "circles": (redirects("/again.iso"), "cannot be read"),
    "redirects to a file": (redirects("file:///etc/passwd"), "cannot be read"),
    "redirects to nowhere": (redirects("http://"), "cannot be read"),
    "whole without end": (never_ends_as_a_whole, "more than 8,388,608 bytes"),
}

SLOW = ("hangs later", "hangs in the middle", "drips headers")
"""Kinds that take as long as `hangs` and `drips`, at other places."""


@contextmanager
def serving(data: bytes, kind: Callable[[Server], None]) -> Iterator[tuple[str, type[Server]]]:
    own: Any = type("Own", (Server,), {
        "data": data, "kind": kind, "seen": Counter(), "sent": [], "held": threading.Event(),
    })
    server = http.server.ThreadingHTTPServer(("localhost", 0), own)
    server.daemon_threads, server.handle_error = True, lambda *_: None  # type: ignore[method-assign]
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    try:
        yield f"http://localhost:{server.server_port}/field.iso", own
    finally:
        own.held.set()
        server.shutdown()
        server.server_close()


@pytest.mark.filterwarnings("ignore:the server sends the whole file")
@pytest.mark.parametrize("name", [*(sorted(KINDS.keys() - SLOW)), *heavy(*SLOW)])
def test_kinds_of_servers(noise: bytes, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kind, wanted = KINDS[name]
    if wanted:
        monkeypatch.setenv("ISOCODEC_TIMEOUT", "2")
    before, started = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
    with serving(noise, kind) as (url, server):
        limits = isocodec.Limits(bytes=8 << 20)
        if not wanted:
            found = isocodec.open(url, limits=limits).contour(window=BOX)
            assert pieces(found) == pieces(tiled_of(noise).window(BOX))
        else:
            with pytest.raises((IsoError, OSError), match=wanted):
                isocodec.open(url, limits=limits).contour(window=BOX)
        assert time.monotonic() - started < SECONDS
        assert sum(server.sent) < MOST_SENT
        assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) << 10 < MEMORY
        if wanted and "within" not in wanted and kind is not never_ends_as_a_whole:
            code = {"checksum": 4, "the file is empty": 5}.get(wanted, 3)
            line = fails(code, "decode", url, "-o", tmp_path / "x.npz", "--window", "300:330,400:430")
            assert line.split(": ", 2)[2].strip() and not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", [16, 600])
def test_a_server_without_ranges_is_said_so(size: int, noise: bytes, tmp_path: Path) -> None:
    """Of files in tiles and of others, which are read whole."""
    data = noise if size == 600 else isocodec.encode(hilly(), 30.5)
    with (
        serving(data, lambda server: server.answer(200, {}, server.data)) as (url, _),
        pytest.warns(UserWarning, match="sends the whole file"),
    ):
        assert pieces(isocodec.open(url).contour()) == pieces(isocodec.decode(data))


def grows(server: Server) -> None:
    server.part(ETag=f'"{len(server.data)}"')


def without_ranges(server: Server) -> None:
    server.answer(200, {}, server.data)


@pytest.mark.filterwarnings("ignore:the server sends the whole file")
@looped("kind", [grows, without_ranges])
def test_a_series_that_grows(kind: Callable[[Server], None]) -> None:
    """A reader has each frame as soon as all of its bytes are there, and reads less than a frame and 64 bytes again."""
    encoder, frames = isocodec.Encoder(20.5, precision="exact"), [hilly((60, 70)) + 9 * t for t in range(6)]
    pieces = [encoder.add(frame, t / 4) for t, frame in enumerate(frames)]
    pieces[-1] += encoder.finish()
    data, ends = b"".join(pieces), np.cumsum([*map(len, pieces)])
    drawn = list(isocodec.open(data).each_frame())
    with serving(pieces[0], kind) as (url, server):
        file, seen = isocodec.open(url), 0
        for size in [*range(len(pieces[0]), len(data), len(data) // 20), len(data)]:
            server.data = data[:size]
            server.sent.clear()
            read, file = file.size, file.refreshed()
            assert file.frames == np.searchsorted(ends, size, "right") and file.complete == (size == len(data))
            assert kind is without_ranges or sum(server.sent) <= size - read + max(map(len, pieces)) + 64
            for one, in file.each_frame(start=seen, partial=True):
                assert np.array_equal(one.points, drawn[seen][0].points) and one.complete
                seen += 1
            assert seen == file.frames
        assert file.data == data and file.frame_at(0.8) == 3
        server.data = pieces[0]
        file = isocodec.open(url)
        for other in (bytes(len(data)), data[:30]):
            server.data = other
            with pytest.raises(InputError, match="not the one"):
                file.refreshed()


@looped("side", [30, 200, 580])
@looped("kind", ["noise", "rough"])
def test_a_window_reads_at_most_twice_what_it_needs(noise: bytes, kind: str, side: int, tmp_path: Path) -> None:
    """As counted by the server, beside the head of the file and a little slack; in at most eight requests."""
    rough = np.random.default_rng(2).normal(size=(900, 900)).cumsum(axis=0)
    data = noise if kind == "noise" else encoded(tmp_path, rough, 0.5, tile=64)
    needed = list[int]()

    def bare(ranges: Iterable[Range]) -> list[Range]:
        found = list(ranges)
        needed.append(len({byte for start, end in found for byte in range(start, end)}))
        return together(found)

    with serving(data, right) as (url, server), pytest.MonkeyPatch.context() as patch:
        patch.setattr("isocodec.storage.ranges.together", bare)
        isocodec.open(url).contour(window=[(10, 10 + side), (10, 10 + side)])
        assert 0 < sum(needed) < len(data)
        assert sum(server.sent) <= HEAD_BYTES + sum(max(2 * one, one + SLACK) for one in needed)
        assert server.seen["requests"] <= 8


@pytest.mark.heavy
def test_requests_of_many_isovalues(tmp_path: Path) -> None:
    """A window of 21 isovalues at first sight: as few requests as of one, several at a time; as from the file."""
    data = encoded(tmp_path, hilly((600, 600)), [20.5 + 3 * i for i in range(21)], tile=64)
    now, most = [0], [0]

    def slow(server: Server) -> None:
        now[0] += 1
        most[0] = max(most[0], now[0])
        time.sleep(0.05)
        now[0] -= 1
        server.part()

    with serving(data, slow) as (url, server):
        file = isocodec.open(url)
        found = file.contours(window=[(100, 300), (200, 400)])
        assert server.seen["requests"] == file.tiled.requests <= 6 and most[0] <= LANES  # type: ignore[union-attr]
        wanted = tiled_of(data)
        for one, isovalue in zip(found, file.isovalues, strict=True):
            assert pieces(one) == pieces(wanted.window([(100, 300), (200, 400)], isovalue=isovalue))
        before = server.seen["requests"]
        file.contours(window=[(100, 300), (200, 400)])
        assert server.seen["requests"] == before
