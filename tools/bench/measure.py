"""Seconds and memory of a piece of work, and the codecs that do it."""

from __future__ import annotations

import contextlib
import ctypes
import ctypes.util
import importlib
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from . import jbig

ONCE = 1.0
"""Work that takes longer than this many seconds is not repeated."""


@dataclass(frozen=True)
class Codec:
    """A peer, ready for one item.

    Attributes
    ----------
    name : str
    needs : str
        The libraries without which it is missing, blanks between: modules, ``jbigkit``, ``jbig2``.
    encode : callable () -> bytes
    decode : callable (bytes) -> whatever was encoded
    progressive : bool
        Cut short, the file still gives a coarse version of the whole.
    note : str
        Settings, and how the file is made where that is not told by the name.
    """

    name: str
    needs: str
    encode: Callable[[], bytes]
    decode: Callable[[bytes], Any]
    progressive: bool = False
    note: str = ""

    @property
    def lacks(self) -> list[str]:
        """Those libraries that are not installed."""
        return [name for name in self.needs.split() if library(name) is None]


@cache
def library(name: str) -> Any:
    """A library by name, or None if it is not installed."""
    if name == "jbigkit":
        return jbig if jbig.library() is not None else None
    if name == "jbig2":
        return None  # decoders are common, a kept library of an encoder is not: sizes come from the reference
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def absent(*_: bytes) -> bytes:
    """Encoder and decoder of peers for which there is no library, so that they are always missing."""
    raise ModuleNotFoundError("there is no library of this peer")


def need(name: str) -> ModuleType:
    """A library that is known to be there."""
    found = library(name)
    if found is None:
        raise ModuleNotFoundError(f"{name} is not installed; pip install '.[bench]'")
    return found


@dataclass(frozen=True)
class Took:
    """Shortest seconds of all runs, peak memory of the first one in MB beyond what was there (None: not known)."""

    seconds: float
    megabytes: float | None


def took(work: Callable[[], Any], repeat: int = 3) -> tuple[Any, Took]:
    """The result of some work, and what it took."""
    before = _reset_peak()
    started = time.perf_counter()
    result = work()
    seconds = time.perf_counter() - started
    peak = None if before is None else max(_status("VmHWM") - before, 0) / 1024
    for _ in range(repeat - 1 if seconds < ONCE else 0):
        started = time.perf_counter()
        work()
        seconds = min(seconds, time.perf_counter() - started)
    return result, Took(seconds, peak)


def _reset_peak() -> int | None:
    """Give free memory back, set the peak to what is in use and return that in kB; None where there is no way."""
    if not sys.platform.startswith("linux"):
        return None
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
    try:
        Path("/proc/self/clear_refs").write_text("5")
        return _status("VmRSS")
    except OSError:
        return None


def _status(field: str) -> int:
    """A line of the kernel's report on this process, in kB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field):
            return int(line.split()[1])
    raise OSError(f"no {field}")
