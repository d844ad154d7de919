"""A process that reads a file for another one, which started it, until that ends it; see `confined`."""

from __future__ import annotations

import importlib
import io
import os
import signal
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import IO, Any

from ...errors import InputError, IsoError, LimitError
from .input_formats import open_here, read_here
from .mesh_formats import MeshRead
from .messages import receive, send
from .opened import Choice, Opened
from .source import InputFile
from .windows import Windows

_WRITTEN = 1 << 20
"""Bytes of a file that may be written here, of complaints for example."""


class Answers:
    """Answers about one file."""

    def __init__(self) -> None:
        self._opened: Any = None
        self._slices: Any = None
        self._windows: Any = None

    def field(self, source: InputFile, choice: Choice) -> dict[str, Any]:
        """Open a field, instead of that which is open."""
        if self._opened:
            self._opened.close()
        self._opened = open_here(source, choice)
        return self._with(None)

    def mesh(self, source: InputFile, choice: Choice) -> MeshRead:
        """Read a mesh."""
        return read_here(source, choice)

    def hook(self, name: str, *about: Any) -> dict[str, Any]:
        """Read samples, or where they lie."""
        return self._with(getattr(self._opened, name)(*about))

    def series(self) -> dict[str, Any]:
        """Describe the frames of a format that states which axis counts them."""
        found = self._slices = self._opened._series()
        names = ("shape", "axis", "frame_shape", "place", "step")
        return self._with(found and {name: getattr(found, name) for name in names})

    def frame(self, number: int) -> dict[str, Any]:
        """Read one of these."""
        return self._with(self._slices.frame(number))

    def windowed(self) -> dict[str, Any]:
        """Whether windows can be read alone."""
        self._windows = self._opened.windows()
        return self._with(isinstance(self._windows, Windows))

    def window(self, ranges: list[list[int]]) -> dict[str, Any]:
        """Read a window."""
        if self._windows is None:
            self.windowed()
        return self._with(self._windows[tuple(slice(*each) for each in ranges)])

    def _with(self, found: Any) -> dict[str, Any]:
        names = (name for name in Opened.__annotations__ if name != "label")
        return {"found": found, "state": {name: getattr(self._opened, name) for name in names}}


def limit(memory: int, seconds: int) -> None:
    """Limit what this process may take from now on, where the system can."""
    try:
        import resource

        used = resource.getrusage(resource.RUSAGE_SELF)
        most = int(used.ru_utime + used.ru_stime) + seconds + 1
        resource.setrlimit(resource.RLIMIT_CPU, (most, resource.RLIM_INFINITY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (_WRITTEN, _WRITTEN))
        status = Path("/proc/self/status").read_text()
        held = next(int(line.split()[1]) << 10 for line in status.split("\n") if line.startswith("VmData"))
        resource.setrlimit(resource.RLIMIT_DATA, (held + memory, resource.RLIM_INFINITY))
    except (ImportError, OSError, ValueError, StopIteration):
        return


def answer_to(answers: Answers, request: dict[str, Any]) -> dict[str, Any]:
    """Give the answer to a request, or the error that it ends with."""
    limit(request["memory"], request["seconds"])
    printed = io.StringIO()
    try:
        with warnings.catch_warnings(record=True) as caught, redirect_stdout(printed), redirect_stderr(printed):
            warnings.simplefilter("always")
            found = getattr(answers, request["ask"])(*request["about"])
    except IsoError as exc:
        names = ("message", "code", "offset", "clause", "remedy")
        return {"error": {"kind": type(exc).__name__, **{name: getattr(exc, name) for name in names}}}
    except OSError as exc:
        return {"error": {"errno": exc.errno, "message": exc.strerror or str(exc)}}
    except MemoryError:
        return {"error": {"kind": LimitError.__name__, "message": "not enough memory to read it", "code": "memory"}}
    except Exception as exc:
        text = f"cannot be read ({type(exc).__name__}: {exc})"
        return {"error": {"kind": InputError.__name__, "message": text, "code": "unreadable"}}
    texts = [printed.getvalue().strip()] if printed.getvalue().strip() else []
    return {"answer": found, "warnings": list(dict.fromkeys([str(each.message) for each in caught] + texts))}


def main(library: str, file: IO[bytes]) -> None:
    """Answer requests that come in by the standard input, until it ends."""
    importlib.import_module(library)
    send(file, {"answer": None, "warnings": []})
    answers = Answers()
    while True:
        try:
            request = receive(sys.stdin.buffer)
        except EOFError:
            return
        try:
            send(file, answer_to(answers, request))
        except InputError as exc:
            send(file, {"error": {"kind": "InputError", "message": exc.message, "code": exc.code}})


if __name__ == "__main__":
    # the process that started this one decides on its end
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # answers go out where nothing that a library prints gets in between
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    main(sys.argv[1], out)
    out.flush()
    os._exit(0)
