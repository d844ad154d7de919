"""What libraries say of their own accord while they read or write: never raw on the terminal, but as one warning of
ours."""

from __future__ import annotations

import io
import logging
import os
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import one_line
from ..storage.atomic import undoing
from .report import STANDARD, warn, write_output

if TYPE_CHECKING:
    from ..io.writers.output_formats import OutputOptions
    from ..io.writers.write import Written

_SHOWN = 3
_KEPT = 1 << 16
"""Bytes that are looked at of what a library prints."""


class _Notes(logging.Handler):
    """Messages of loggers, one after the other."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())


@contextmanager
def one_warning(path: Path, doing: str = "reading") -> Iterator[None]:
    """What libraries warn of, log or print within becomes one line about ``path``; nothing if an error ends it.

    The error then says what is to be said. Not for anything that is to be shown in the meantime: both streams of the
    process are taken away from it.
    """
    notes, printed = _Notes(), io.StringIO()
    loggers = [logging.getLogger(name) for name in [*logging.root.manager.loggerDict]]
    handlers = [(logger, logger.handlers) for logger in (logging.root, *loggers)]
    for logger, _ in handlers:
        logger.handlers = []
    logging.root.handlers = [notes]
    raw: list[str] = []
    try:
        with (
            warnings.catch_warnings(record=True) as caught, redirect_stdout(printed), redirect_stderr(printed),
            _streams(raw),
        ):
            warnings.simplefilter("always")
            yield
    finally:
        for logger, before in handlers:
            logger.handlers = before
    texts = [*(str(one.message) for one in caught), *notes.texts, *printed.getvalue().splitlines(), *raw]
    lines = [*dict.fromkeys(line for text in texts if (line := one_line(text)))]
    if lines:
        more = f", and {len(lines) - _SHOWN} more" if len(lines) > _SHOWN else ""
        warn(path, f"messages while {doing} it: {'; '.join(lines[:_SHOWN])}{more}")


def written(output: Path, what: Any, options: OutputOptions) -> Written:
    """Write something to a file, or to standard output when its streams are back."""
    from ..io.writers.write import write

    buffer = io.BytesIO()
    with one_warning(output, "writing"):
        done = write(buffer if str(output) == STANDARD else output, what, options=options)
    if str(output) == STANDARD:
        write_output(output, buffer.getvalue())
    return done


@contextmanager
def _streams(lines: list[str]) -> Iterator[None]:
    """Lines that are printed past Python, by libraries of C and C++, while this lasts."""
    with tempfile.TemporaryFile() as file:
        saved: dict[int, int] = {}

        def back() -> None:
            for number, before in saved.items():
                os.dup2(before, number)

        for stream in (sys.__stdout__, sys.__stderr__):
            if stream is not None and not stream.closed:
                stream.flush()
        try:
            # a signal that ends the process has something to say
            with undoing(back):
                for number in (1, 2):
                    try:
                        saved[number] = os.dup(number)
                    except OSError:  # a process may have been started without them
                        continue
                    os.dup2(file.fileno(), number)
                yield
        finally:
            back()
            for before in saved.values():
                os.close(before)
        file.seek(0)
        lines += file.read(_KEPT).decode(errors="replace").splitlines()
