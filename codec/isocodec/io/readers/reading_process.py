"""A process that reads a file for another one, which started it, until that ends it; see `confined`."""

from __future__ import annotations

import importlib
import io
import math
import os
import signal
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

from ...errors import InputError, IsoError, LimitError
from .input_formats import format_of, mesh_format_of
from .mesh_formats import MeshRead
from .messages import receive, send
from .opened import Choice, Opened
from .slices import Slices
from .source import InputFile

_WRITTEN = 1 << 20
"""Bytes of a file that may be written here, of complaints for example."""
_STATE = [name for name in Opened.__annotations__ if name != "label"]


class Answers:
    """Answers about one file: a result, and of fields the attributes of what is open."""

    def __init__(self) -> None:
        self._opened: Any = None
        self._slices: Any = None

    def opened(self, source: InputFile, choice: Choice) -> Any:
        """Open a field, instead of that which is open."""
        if self._opened:
            self._opened.close()
        found = format_of(source.path)
        assert found is not None
        self._opened = found.open(source, choice)
        return self._with(None)

    def mesh(self, source: InputFile, choice: Choice) -> MeshRead:
        """Read a mesh."""
        found = mesh_format_of(source)
        assert found is not None
        return found.read(source, choice)

    def of_opened(self, name: str, about: tuple[Any, ...], more: dict[str, Any]) -> Any:
        """Call a method of what is open, or read a frame of the last series."""
        found = (self._slices.frame if name == "frame" else getattr(self._opened, name))(*about, **more)
        if isinstance(found, Slices):
            self._slices, found = found, replace(found, frame=None)  # type: ignore[arg-type]  # functions stay here
        return self._with(found)

    def _with(self, found: Any) -> Any:
        return found, {name: getattr(self._opened, name) for name in _STATE}


def limit(memory: int, seconds: int) -> None:
    """Limit what this process may take from now on, where the system can."""
    with suppress(ImportError, OSError, ValueError, StopIteration):
        import resource

        used = resource.getrusage(resource.RUSAGE_SELF)
        most = math.ceil(used.ru_utime + used.ru_stime) + seconds
        resource.setrlimit(resource.RLIMIT_CPU, (most, resource.RLIM_INFINITY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (_WRITTEN, _WRITTEN))
        status = Path("/proc/self/status").read_text()
        held = next(int(line.split()[1]) << 10 for line in status.split("\n") if line.startswith("VmData"))
        resource.setrlimit(resource.RLIMIT_DATA, (held + memory, resource.RLIM_INFINITY))


def answer_to(answers: Answers, memory: int, seconds: int, what: str, about: tuple[Any, ...]) -> Any:
    """Give an answer with the texts of warnings, or the error that it ends with."""
    limit(memory, seconds)
    printed = io.StringIO()
    try:
        with warnings.catch_warnings(record=True) as caught, redirect_stdout(printed), redirect_stderr(printed):
            warnings.simplefilter("always")
            # GRIB needs no data of PROJ, which pyproj misses once eccodes is loaded
            warnings.filterwarnings("ignore", "pyproj unable")
            found = getattr(answers, what)(*about)
    except IsoError as exc:
        return exc
    except OSError as exc:
        return OSError(exc.errno, exc.strerror or str(exc))
    except MemoryError:
        return LimitError("not enough memory to read it", code="memory")
    except Exception as exc:
        return InputError(f"cannot be read ({type(exc).__name__}: {exc})", code="unreadable")
    return found, [*filter(None, dict.fromkeys([*(str(each.message) for each in caught), printed.getvalue().strip()]))]


def main(library: str, file: IO[bytes]) -> None:
    """Answer requests that come in by the standard input, until it ends."""
    importlib.import_module(library)
    send(file, (None, []))
    answers = Answers()
    with suppress(EOFError):
        while True:
            send(file, answer_to(answers, *receive(sys.stdin.buffer)))


if __name__ == "__main__":
    # the process that started this one decides on its end
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # answers go out where nothing that a library prints gets in between
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    main(sys.argv[1], out)
    out.flush()
    os._exit(0)
