"""The command ``isocodec``, also as ``python -m isocodec``: the command line, and how signals end it."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from types import FrameType
from typing import NoReturn

from .storage.atomic import undo_all

SIGNALS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "terminated"}
"""Signals by name, of which a system may lack some, and the message of each."""


def main() -> None:
    """The command line, which a signal ends with one line, nothing left behind and an exit code as shells have it."""
    for name in SIGNALS:
        number = getattr(signal, name, None)
        # what is ignored from the start (nohup, a shell's background) stays so
        if number is not None and signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _end)
    from .cli import main as program

    try:
        program(prog_name="isocodec")
    finally:
        # Python would take the handlers away while it shuts down; what is done stays done
        _ignore()


def _end(number: int, _: FrameType | None) -> NoReturn:
    """End the process at once.

    An exception would get lost in a callback of the compiler's, or leave it in the middle of its work; nor is there
    anything to wait for: what is written is renamed when it is whole.
    """
    _ignore()
    undo_all()
    with suppress(OSError):  # the terminal may be gone
        # past Python's buffer, which the signal may have interrupted; a terminal shows ^C where the line begins
        echoed = number == signal.SIGINT and os.isatty(2)
        os.write(2, f"{os.linesep if echoed else ''}isocodec: {SIGNALS[signal.Signals(number).name]}\n".encode())
    os._exit(128 + number)


def _ignore() -> None:
    for name in SIGNALS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


if __name__ == "__main__":
    main()
