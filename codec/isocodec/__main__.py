"""The command ``isocodec``, also run as ``python -m isocodec``: the command line, and its reaction to signals."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import NoReturn

from .storage.atomic import undo_all

SIGNALS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "terminated"}
"""Signals by name (a system may lack some of them), and the message for each."""


def main() -> None:
    """Run the command line; on a signal, print one line, leave no files behind and exit with the code of a shell.

    Signals are those of the process: called in another thread than the main one, it leaves them as they are.
    """
    _occupy_streams()
    for name in SIGNALS:
        number = getattr(signal, name, None)
        # signals ignored from the start (nohup, background jobs of a shell) stay ignored
        if number is not None and signal.getsignal(number) != signal.SIG_IGN:
            _handle(number, _end)
    # importing modules makes many objects and no garbage: looking for it takes a tenth of `--version` and of `info`
    gc.disable()
    # numpy would start threads for linear algebra, which nothing here needs: that takes longer than a small file
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from .cli import main as program

    try:
        program(prog_name="isocodec")
    finally:
        # what is left when the process ends is no garbage, either
        gc.freeze()
        # Python removes the handlers while it shuts down; a signal then must not undo a finished result
        _ignore()


def _end(number: int, _: FrameType | None) -> NoReturn:
    """End the process at once.

    An exception could be lost in a callback of the compiler, or interrupt the compiler half-way. There is nothing to
    wait for: files are renamed into place only when they are complete.
    """
    _ignore()
    undo_all()
    with suppress(OSError):  # the terminal may be gone
        # bypasses Python's buffer, which the signal may have interrupted; a terminal shows ^C at the start of the line
        echoed = number == signal.SIGINT and os.isatty(2)
        os.write(2, f"{os.linesep if echoed else ''}isocodec: {SIGNALS[signal.Signals(number).name]}\n".encode())
    os._exit(128 + number)


def _ignore() -> None:
    for name in SIGNALS:
        if hasattr(signal, name):
            _handle(getattr(signal, name), signal.SIG_IGN)


def _handle(number: int, handler: Callable[[int, FrameType | None], object] | signal.Handlers) -> None:
    with suppress(ValueError):  # only the main thread has handlers
        signal.signal(number, handler)


def _occupy_streams() -> None:
    """Keep the numbers of standard streams that are closed from the files opened next; errors are then lost."""
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        if stream is None:
            os.open(os.devnull, os.O_RDWR)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115 - as long as the process


if __name__ == "__main__":
    main()
