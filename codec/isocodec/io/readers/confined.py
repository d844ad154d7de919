"""Libraries that a few bytes of a file can crash, hang or fill with memory, called in a process apart.

A format is read so if its record names the library as ``confined``. The process loads the library, is then limited in
memory and time by what the file holds and its header states, reads, and ends with what was opened.

What it costs, on an idle core of 2020: 0.15 s to start Python with NumPy, beside the library itself (0.2 s for
SimpleITK, 0.1 s for meshio, 0.5 s for PyVista), which this process then does not load; 3 ms for each MB of samples; and
while these are handed over the memory that they take twice. Where there is no ``resource`` (Windows), or no ``/proc``
(macOS), time is limited, and memory is not.
"""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import warnings
import weakref
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ...errors import InputError, IsoError, LimitError, MissingExtraError, one_line
from ...extras import remedy_of
from ...field.placement import Placement
from ...field.sampled import Field
from ...limits import TIMEOUT, patience
from .mesh_formats import MeshFormat, MeshRead
from .messages import receive, send
from .opened import Choice, Format, Opened
from .reading import about
from .slices import Slices
from .source import InputFile

_ROOM = 1 << 28
"""Bytes that a library may take beside what follows from the file."""
_TEXT = 64
"""Bytes that a byte of a file becomes at most for a moment, where it is text."""
_COPIES = 4
"""Copies of the samples that a library and its reader hold at most, and of packed bytes that a mesh is made of."""
_PACKED = 1032
"""Bytes that a byte of deflated data becomes at most."""
_OF_A_SAMPLE = 64
"""Bytes that a point or a cell takes at most, values included."""
_SMALL = 1 << 20
"""Bytes of a file that is damaged if reading it does not end."""
_OUTPUT = 1 << 16
"""Characters of a library's complaints that are looked at."""
_NO_MEMORY = re.compile(r"bad_alloc|out of memory|cannot allocate|failed to allocate|MemoryError", re.IGNORECASE)
_SINGLE = dict.fromkeys((
    "ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS",
    "VTK_SMP_MAX_THREADS", "MALLOC_ARENA_MAX",
), "1")
"""Each thread takes memory, and files are read by one."""

_BUSY = 4
"""Time by the clock that a library may take, as a multiple of processor time."""
_HARMLESS = re.compile(r"XDMF Error in \S+ line \d+ \(Unknown Attribute Type None\)")
"""Complaint of VTK's reader about what VTK's own writer has written."""


class ReadingProcess:
    """A process that reads one file with a library, which an extra of this package brings; a context manager."""

    def __init__(self, library: str, extra: str, source: InputFile) -> None:
        # the library is not loaded here; a name that is None in sys.modules has no spec
        if find_spec(library.partition(".")[0]) is None:
            raise MissingExtraError(
                f"reading {source.path.suffix} needs {library}", code="missing-extra",
                remedy=remedy_of(extra),
            )
        self._library, self._size, self._late = library, _size_of(source.path), False
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115  # closed in __exit__
        paths = [os.path.abspath(each) for each in sys.path if each] + [str(Path(__file__).parents[3])]
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", f"{__package__}.reading_process", library],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._complaints,
            env={**os.environ, **_SINGLE, "PYTHONPATH": os.pathsep.join(dict.fromkeys(paths))},
        )
        weakref.finalize(self, _end, self._process)
        self._answer()

    def __enter__(self) -> ReadingProcess:
        return self

    def __exit__(self, *_: object) -> None:
        _end(self._process)
        self._complaints.close()

    def ask(self, what: str, *about: Any, stated: int = 0, most: int = sys.maxsize) -> Any:
        """Have something read: a method of `reading_process.Answers`, and what it takes.

        The samples take as many bytes as ``stated`` by the file's header, and at ``most`` that many in all.

        Raises
        ------
        InputError
            If the library crashes, complains or refuses the file.
        LimitError
            If it takes longer, or more memory, than such a file can need.
        IsoError, OSError
            As its reader.
        """
        stated = min(stated, _PACKED * self._size)
        memory = _ROOM + min(most, _TEXT * self._size + _COPIES * stated)
        seconds = patience(max(self._size, stated))
        # where the system can limit processor time, that counts: on a busy machine the clock says little
        timer = threading.Timer(seconds * (_BUSY if find_spec("resource") else 1), self._too_late)
        timer.start()
        try:
            assert self._process.stdin is not None
            send(self._process.stdin, (memory, max(1, int(seconds) - 1), what, about))
            return self._answer()
        except BrokenPipeError:
            raise self._ended() from None
        finally:
            timer.cancel()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        try:
            answer = receive(self._process.stdout)
        except Exception:  # whatever half of an answer leads to
            raise self._ended() from None
        if isinstance(answer, Exception):
            raise answer
        if text := self._output():
            raise InputError(f"is damaged: {self._library} complains ({one_line(text)})", code="unreadable")
        found, remarks = answer
        for text in remarks:
            warnings.warn(text, stacklevel=2)
        return found

    def _too_late(self) -> None:
        self._late = True
        self._process.kill()

    def _output(self) -> str:
        """Text that the library has written since the last call."""
        self._complaints.seek(0)
        text = self._complaints.read(_OUTPUT).decode("utf-8", "replace").strip()
        self._complaints.seek(0)
        self._complaints.truncate()
        return _HARMLESS.sub("", text).strip()

    def _ended(self) -> IsoError:
        """The error for the process' end."""
        _end(self._process)
        number, text = -self._process.returncode, self._output()
        remedy = f"if you trust the file, read it with {self._library}, and encode the array"
        if self._late or number == getattr(signal, "SIGXCPU", None):
            # no sound file of this size takes so long
            kind = InputError if self._size < _SMALL else LimitError
            return kind(f"takes {self._library} longer than a file of its size can need", code="timeout",
                        remedy=f"{remedy}; or raise {TIMEOUT}")
        # the system ends a process in this way that takes more than there is
        if number == getattr(signal, "SIGKILL", None) or _NO_MEMORY.search(text):
            return LimitError(f"takes {self._library} more memory than a file of its size can need", code="memory",
                              remedy=remedy)
        how = f"signal {number}" if number > 0 else f"exit code {-number}"
        return InputError(f"crashes {self._library} ({how})", code="unreadable", remedy="is it damaged?")


class ConfinedOpened(Opened):
    """An input that another process has opened, which answers for it."""

    def __init__(self, format: Format, source: InputFile, choice: Choice) -> None:
        self._format = format
        super().__init__(source, choice)

    def _open(self, choice: Choice) -> None:
        self._process = self.hold(ReadingProcess(self._format.confined, self._format.extra, self._source))
        self._asked("opened", self._source, choice)

    def _asked(self, what: str, *asked: Any, stated: int = 0) -> Any:
        """An answer; attributes of what is open there become those here."""
        with about(self.label):
            found, state = self._process.ask(what, *asked, stated=stated)
        vars(self).update(state)
        return found

    def _read(self, what: str, *asked: Any, **more: Any) -> Any:
        stated = self._source.check_count(math.prod(self.shape)) * self.dtype.itemsize
        return self._asked("of_opened", what, asked, more, stated=stated)

    def field(self, frame: int | None = None, *, nodata: float | None = None) -> Field:
        """Read a field; see `Opened.field`."""
        found: Field = self._read("field", frame, nodata=nodata)
        return found

    def frames(self, axis: int | None = None, frame: int | None = None, *, placed: bool = True) -> Slices:
        """Give the samples as a series; see `Opened.frames`."""
        found = self._read("frames", axis, frame, placed=placed)
        return replace(found, frame=lambda number: self._read("frame", number))

    def _values(self, frame: int | None) -> NDArray[Any]:
        found: NDArray[Any] = self._read("_known", frame)
        return found

    def _place(self, n: int, frame: int | None) -> Placement:
        found: Placement = self._read("_place", n, frame)
        return found


def mesh_by(format: MeshFormat, source: InputFile, choice: Choice) -> MeshRead:
    """Read a mesh here, or in a process apart."""
    if not format.confined:
        return format.read(source, choice)
    with ReadingProcess(format.confined, format.extra, source) as process:
        found: MeshRead = process.ask("mesh", source, choice, stated=sys.maxsize, most=_OF_A_SAMPLE * source.samples)
        return found


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    for pipe in (process.stdin, process.stdout):
        with suppress(OSError):  # what is not sent yet
            pipe.close()  # type: ignore[union-attr]
    process.wait()


def _size_of(path: Path) -> int:
    """Bytes of a file, or of those in a folder."""
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(each.stat().st_size for each in files if each.exists())
