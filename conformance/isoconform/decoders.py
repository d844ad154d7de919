"""Decoders under test: the reference in this process, a command run for each file, a command that takes many files.

A command of the last kind follows the *batch protocol*. It reads requests on standard input, a line each: the name of a
file and, behind tabs, what is asked beyond decoding it: ``layers=N`` to stop when N layers are complete, ``bytes=N`` to
take the first N bytes of the file for all there is, ``piece=N`` to take the bytes N at a time. It answers on standard
output, at once and in order: a line with the exit code that the file stands for and the length of the canonical text in
bytes, then the text. To a request of a kind that it does not know it answers ``-``. It ends with its input.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, BinaryIO, Protocol

from .dump_file import dump_file

TIMEOUT = 20.0
"""Seconds that a decoder has for a file."""
UNKNOWN = b"-"
"""Answer to a request of a kind that is not known."""


@dataclass(frozen=True)
class Request:
    """What a decoder is asked.

    Attributes
    ----------
    path : Path
    layers : int
        Stop when that many layers are complete; 0: all.
    size : int or None
        Take that many bytes of the file for all there is.
    piece : int
        Feed that many bytes at a time; 0: all at once.
    """

    path: Path
    layers: int = 0
    size: int | None = None
    piece: int = 0


@dataclass(frozen=True)
class Answer:
    """Exit code and canonical text; or what became of the decoder, if it did not come to that."""

    code: int = 0
    text: str = ""
    trouble: str = ""


class Decoder(Protocol):
    """Asked and answering in the same order; more than one question may be open."""

    def ask(self, request: Request) -> None:
        """Put a question."""

    def answer(self) -> Answer | None:
        """To the oldest open question; None if the decoder does not know its kind."""

    def close(self) -> None:
        """End all processes."""


class Reference:
    """The reference decoder, in this process."""

    def __init__(self) -> None:
        self._open: deque[Request] = deque()

    def ask(self, request: Request) -> None:
        """As `Decoder`."""
        self._open.append(request)

    def answer(self) -> Answer:
        """As `Decoder`; any exception but its own is trouble."""
        request = self._open.popleft()
        try:
            output = dump_file(request.path, request.size, layers=request.layers, piece=request.piece)
        except Exception as bug:
            return Answer(trouble=f"crash: {type(bug).__name__}: {bug}")
        return Answer(output.exit_code, output.text + output.coordinates * bool(output.text))

    def close(self) -> None:
        """As `Decoder`."""


def filled(template: str, request: Request) -> list[str]:
    """Words of a command, with what stands in braces filled in."""
    names = {"{file}": str(request.path), "{layers}": str(request.layers), "{piece}": str(request.piece),
             "{python}": sys.executable}
    words = shlex.split(template)
    for name, value in names.items():
        words = [word.replace(name, value) for word in words]
    return words


class Command:
    """A command that is run for each file.

    Parameters
    ----------
    template : str
        Split into words as a shell does; ``{file}`` stands for the file, ``{layers}`` for the number of layers to
        decode (0: all), ``{piece}`` for the bytes to be taken at a time (0: all), ``{python}`` for this interpreter.
    memory : int, optional
        Bytes of address space that its process may take (POSIX).
    timeout : float, optional
        Seconds that it has for a file.

    Raises
    ------
    ValueError
        If there is no ``{file}`` in it.
    """

    def __init__(self, template: str, *, memory: int | None = None, timeout: float | None = None) -> None:
        if not any("{file}" in word for word in shlex.split(template)):
            raise ValueError("the command does not say where the {file} goes")
        self._template, self._limit, self._timeout = template, address_space(memory), timeout or TIMEOUT
        self._open: deque[Request] = deque()

    def ask(self, request: Request) -> None:
        """As `Decoder`."""
        self._open.append(request)

    def answer(self) -> Answer | None:
        """As `Decoder`."""
        request = self._open.popleft()
        for name, asked in (("{layers}", request.layers), ("{piece}", request.piece)):
            if asked and name not in self._template:
                return None
        start = None
        if request.size is not None:
            start = request.path.with_suffix(".start")
            start.write_bytes(request.path.read_bytes()[: request.size])
            request = Request(start, request.layers, None, request.piece)
        try:
            done = subprocess.run(
                filled(self._template, request), stdin=subprocess.DEVNULL, capture_output=True, timeout=self._timeout,
                check=False, preexec_fn=self._limit,
            )
        except subprocess.TimeoutExpired:
            return Answer(trouble=f"hang: no answer within {self._timeout:g} s")
        finally:
            if start is not None:
                start.unlink()
        return _ended(done.returncode, done.stdout)

    def close(self) -> None:
        """As `Decoder`."""


def _ended(code: int, output: bytes) -> Answer:
    if code < 0 or code > 127:
        return Answer(code, trouble=f"crash: ended by exit code {code}")
    return Answer(code, output.decode("ascii", "replace").replace("\r\n", "\n"))


class Batch:
    """A command that follows the batch protocol; if it dies, it is started again for the next file.

    Parameters
    ----------
    template : str
        Split into words as a shell does; ``{python}`` stands for this interpreter.
    memory, timeout : as `Command`
    """

    def __init__(self, template: str, *, memory: int | None = None, timeout: float | None = None) -> None:
        self._template, self._limit, self._timeout = template, address_space(memory), timeout or TIMEOUT
        self._process: subprocess.Popen[bytes] | None = None
        self._open: deque[Request] = deque()

    def ask(self, request: Request) -> None:
        """As `Decoder`."""
        self._open.append(request)
        self._send([request])

    def answer(self) -> Answer | None:
        """As `Decoder`."""
        process = self._started()
        late = threading.Event()

        def stop() -> None:
            late.set()
            process.kill()

        alarm = threading.Timer(self._timeout, stop)
        alarm.daemon = True
        alarm.start()
        try:
            assert process.stdout is not None
            found = _read_answer(process.stdout)
        finally:
            alarm.cancel()
        self._open.popleft()
        if found is not None:
            return found if isinstance(found, Answer) else None
        code = self._stop(kill=True)
        if late.is_set():
            return Answer(trouble=f"hang: no answer within {self._timeout:g} s")
        return Answer(code, trouble=f"crash: the process ended with exit code {code}")

    def close(self) -> None:
        """As `Decoder`."""
        if self._process is not None:
            self._stop(kill=bool(self._open))

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            self._process = subprocess.Popen(
                filled(self._template, Request(Path())), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, preexec_fn=self._limit,
            )
            self._send(self._open)
        return self._process

    def _send(self, requests: Iterable[Request]) -> None:
        if self._process is None:
            self._started()
            return
        assert self._process.stdin is not None
        try:
            for request in requests:
                self._process.stdin.write(_line(request))
            self._process.stdin.flush()
        except BrokenPipeError:
            # it is dead: whoever waits for its answer will see
            pass

    def _stop(self, *, kill: bool) -> int:
        """End the process, by the end of its input if it has nothing left to do."""
        assert self._process is not None
        process, self._process = self._process, None
        if kill and process.poll() is None:
            # what died says so a moment after it has closed its output
            try:
                process.wait(0.2)
            except subprocess.TimeoutExpired:
                process.kill()
        try:
            process.communicate(timeout=self._timeout)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        return process.returncode


def _line(request: Request) -> bytes:
    asked = {"layers": request.layers or None, "bytes": request.size, "piece": request.piece or None}
    words = [str(request.path), *(f"{name}={number}" for name, number in asked.items() if number is not None)]
    return "\t".join(words).encode() + b"\n"


def _read_answer(stream: IO[bytes]) -> Answer | bytes | None:
    """The answer, or that the request is not known; None if there is no proper one."""
    line = stream.readline()
    words = line.split()
    if words == [UNKNOWN] and line.endswith(b"\n"):
        return UNKNOWN
    if len(words) != 2 or not line.endswith(b"\n"):
        return None
    try:
        code, length = map(int, words)
    except ValueError:
        return None
    text = stream.read(length) if length >= 0 else b""
    return Answer(code, text.decode("ascii", "replace")) if len(text) == length else None


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer requests of the batch protocol with the reference decoder, until they end."""
    for line in requests:
        request = _request(line)
        if request is None:
            answers.write(UNKNOWN + b"\n")
        else:
            output = dump_file(request.path, request.size, layers=request.layers, piece=request.piece)
            text = output.text.encode("ascii")
            answers.write(b"%d %d\n%b" % (output.exit_code, len(text), text))
        answers.flush()


def _request(line: bytes) -> Request | None:
    name, *fields = line.decode().rstrip("\r\n").split("\t")
    numbers: dict[str, int] = {}
    for word in fields:
        key, _, number = word.partition("=")
        if key not in ("layers", "bytes", "piece") or not number.isdecimal():
            return None
        numbers[key] = int(number)
    return Request(Path(name), numbers.get("layers", 0), numbers.get("bytes"), numbers.get("piece", 0))


def address_space(memory: int | None) -> Callable[[], None] | None:
    """What a process does before it becomes the decoder, if its memory is to be limited.

    Raises
    ------
    ValueError
        If the system has no such limits.
    """
    if memory is None:
        return None
    try:
        import resource
    except ImportError:
        raise ValueError("this system cannot limit a process's memory") from None
    return lambda: resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
