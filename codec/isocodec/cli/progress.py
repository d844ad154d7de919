"""A progress bar for what takes more than a second."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ..storage.atomic import undoing

# Shorter work is over before a bar is read.
PATIENCE = 1.0


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int], None] | None]:
    """A function ``(done, total)`` to report with, or None if the error stream is not a terminal.

    The bar appears after a second, and goes when the work is done. A total of 0 is one that nobody knows: of a search.
    """
    if not sys.stderr.isatty():
        yield None
        return
    started = time.monotonic()
    bar: Any = None
    task: Any = None

    def report(done: int, total: int) -> None:
        nonlocal bar, task
        if bar is None:
            if time.monotonic() - started < PATIENCE:
                return
            from rich.console import Console
            from rich.progress import Progress

            bar = Progress(console=Console(stderr=True), transient=True)
            task = bar.add_task("", total=None)
            bar.start()
        if total:
            bar.update(task, description=label, completed=done, total=total)
        else:
            bar.update(task, description=f"searching ({done} tried)")

    def clear() -> None:
        # past rich, whose locks may be held where a signal comes: the line is emptied, the cursor is shown
        if bar is not None:
            os.write(2, b"\r\x1b[2K\x1b[?25h")

    try:
        with undoing(clear):
            yield report
    finally:
        if bar is not None:
            bar.stop()
