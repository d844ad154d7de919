"""Reads damaged and hostile files in a process of its own, and reports what they did: run by `test_foreign_files`.

Arguments: folder, name of a file in its folder ``files``, how many edits, seed, number of the first one, samples that
may be read.
"""

from __future__ import annotations

import ctypes
import faulthandler
import json
import os
import random
import re
import resource
import shutil
import socket
import sys
import threading
import warnings
from pathlib import Path

SECONDS = 10.0
MOST = 64 << 20
"""Bytes beyond what is allowed that memory may grow by."""
AUDIT = """
import os, sys
log = os.open(os.environ["FOREIGN_LOG"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
fine = os.environ["FOREIGN_FINE"].split(os.pathsep)
fine = (*fine, sys.prefix, sys.base_prefix, "/proc", "/dev", "/sys", "/etc", "/usr/share")
def look(event, about):
    if event in ("socket.connect", "socket.getaddrinfo", "os.system", "os.exec", "os.posix_spawn"):
        os.write(log, f"{event} {about!r}\\n".encode())
    elif event == "open" and isinstance(about[0], (str, bytes)):
        path = os.path.abspath(os.fsdecode(about[0]))
        if not path.startswith(fine):
            os.write(log, f"open {path}\\n".encode())
sys.addaudithook(look)
"""
"""Module that Python loads at the start of each process: notes which files and servers are asked for."""
_TEXT, _NUMBER = re.compile(rb"[ -~]{4,60}"), re.compile(rb"[0-9]+")
_EXTREME = (b"\0" * 8, b"\xff" * 8, b"\xff\xff\xff\x7f" * 2, b"\0\0\0\x80" * 2, b"\x7f\xff\xff\xff\xff\xff\xff\xff")
_NUMBERS = (b"0", b"-1", b"4294967295", b"2147483648", b"99999999999999999999", b"1e308", b"nan")


class Watch:
    """Counts openings of a file, and connections to a server, by any process."""

    def __init__(self, folder: Path) -> None:
        libc = ctypes.CDLL(None)
        self._file = libc.inotify_init1(os.O_NONBLOCK)
        libc.inotify_add_watch(self._file, os.fsencode(folder), 0x20)  # IN_OPEN
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self.connections = 0
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            self._server.accept()[0].close()
            self.connections += 1

    def touched(self) -> bool:
        """Whether anything was touched since this was last asked."""
        try:
            events = os.read(self._file, 1 << 16)
        except BlockingIOError:
            events = b""
        count, self.connections = self.connections, 0
        return bool(events) or count > 0


def edited(data: bytes, chance: random.Random, names: list[bytes]) -> bytes:
    """A file, cut or changed in one to three places."""
    if chance.random() < 0.2:
        return data[: chance.randrange(len(data) + 1)]
    out = bytearray(data)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        # headers are small, and matter
        at = chance.randrange(min(len(out), chance.choice((400, 4000, 1 << 30)))) if out else 0
        kind = chance.randrange(7)
        if kind == 0 and out:
            out[at] ^= 1 << chance.randrange(8)
        elif kind == 1 and out:
            out[at] = chance.choice((0, 1, 127, 128, 255))
        elif kind == 2:
            size = chance.choice((1, 2, 4, 8))
            out[at : at + size] = chance.choice(_EXTREME)[:size]
        elif kind == 3:
            del out[at : at + chance.choice((1, 8, 100))]
        elif kind == 4:
            out[at:at] = out[at : at + chance.choice((1, 8, 100))]
        else:
            found = [*(_NUMBER if kind == 5 else _TEXT).finditer(out)]
            if found:
                one = chance.choice(found[:200])
                new = chance.choice(_NUMBERS if kind == 5 else names)
                out[one.start() : one.end()] = new if chance.random() < 0.7 else new[: len(one[0])].ljust(len(one[0]))
    return bytes(out)


def keep_processes() -> None:
    """Use one process for all files that a library reads, as long as it lives: to start it takes longest."""
    from isocodec.io.readers import confined

    kept: dict[str, confined.ReadingProcess] = {}
    made = confined.ReadingProcess

    def process(library: str, extra: str, source: confined.InputFile) -> confined.ReadingProcess:
        if library not in kept or kept[library]._process.poll() is not None:
            kept[library] = made(library, extra, source)
        kept[library]._size = confined._size_of(source.path)
        return kept[library]

    made.__exit__ = lambda *_: None  # type: ignore[method-assign,assignment]
    confined.ReadingProcess = process  # type: ignore[misc,assignment]


def processor_time() -> float:
    """Seconds of this process, and of those that it started and that have ended: others may run beside them."""
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in both)


def read(path: Path, samples: int, watch: Watch) -> dict[str, object]:
    """Read a file; what was wrong with how that went."""
    import isocodec

    out: dict[str, object] = {}
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = processor_time()
    faulthandler.dump_traceback_later(12 * SECONDS, exit=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            isocodec.read(path, samples=samples)
            out["result"] = "read"
        except isocodec.IsoError as error:
            out["result"] = type(error).__name__
            if "\n" in str(error):
                out["lines"] = str(error)
        except BaseException as error:
            out["result"] = "raised"
            out["raised"] = repr(error)[:300]
    faulthandler.cancel_dump_traceback_later()
    seconds = processor_time() - began
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) << 10
    if seconds > SECONDS:
        out["seconds"] = seconds
    if grown > MOST + 24 * samples:
        out["grown"] = grown >> 20
    if watch.touched():
        out["touched"] = True
    return out


def main(folder: Path, name: str, count: int, seed: int, first: int, samples: int) -> None:
    """Read a file as it is, or that many edits of it, with others beside it; print a line of JSON for each."""
    secret, place, path = folder / "secret", folder / "edited", folder / "files" / name
    watch = Watch(secret)
    names = [os.fsencode(secret / "key"), b"../secret/key", f"http://127.0.0.1:{watch.port}/key".encode(),
             f"/vsicurl/http://127.0.0.1:{watch.port}/key".encode()]
    if count:
        # libraries are loaded, and their tables made, before memory is looked at
        read(path, samples, watch)
        keep_processes()
    for number in range(first, max(count, 1)):
        target = path
        if count:
            shutil.rmtree(place, ignore_errors=True)
            shutil.copytree(path.parent, place)
            target = place / name
            chance = random.Random(f"{name} {seed} {number}")
            inner = [each for each in target.rglob("*") if each.is_file()] if path.is_dir() else [target]
            one = chance.choice(sorted(inner))
            one.write_bytes(edited(one.read_bytes(), chance, names))
        print(json.dumps({"file": name, "number": number}), flush=True)
        print(json.dumps({"file": name, "number": number, **read(target, samples, watch)}), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], *map(int, sys.argv[3:]))
