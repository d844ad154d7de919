"""Limits of a decoder (spec clause 11.2), and the account of the memory that it holds."""

from __future__ import annotations

import os
from dataclasses import dataclass

from .errors import LimitError, OptionError

WORK_PER_BYTE = 512
"""Work allowed for each byte read, on top of `Limits.work`: real files have at most some hundred symbols a byte."""
WORK_STEPS = 16
"""Steps of inference that count as one unit of work."""
WORK_LIST = 4
"""Vertices and simplices listed by a layer that count as one unit of work."""
ISOVALUES = 4096
"""Most isovalues of a file (spec clause 11.1)."""
FIELD_SAMPLES = 1 << 30
"""Samples that are read of an input file unless more are asked for.

Volumes of 1024 samples a side and terrains of 32,768 pass, the largest that are common: 8.6 GB in double precision. A
file that only claims to hold more is refused before anything is allocated for it.
"""
TIMEOUT = "ISOCODEC_TIMEOUT"
"""Environment variable with a timeout in seconds, instead of `PATIENCE`."""
PATIENCE = 8.0
"""Default timeout in seconds, for servers and for libraries that read files in another process."""
RATE = 1 << 20
"""Bytes for which the timeout is extended by one second."""


def patience(size: int = 0) -> float:
    """Compute the timeout, in seconds, for an answer of ``size`` bytes.

    Raises `OptionError` if the environment variable `TIMEOUT` is not a number of seconds.
    """
    asked = os.environ.get(TIMEOUT, "")
    try:
        seconds = float(asked) if asked else PATIENCE
    except ValueError:
        seconds = 0.0
    if not 0 < seconds < 1e9:
        raise OptionError(f"{TIMEOUT}={asked!r} is not a number of seconds", code="timeout", remedy="for example 60")
    return seconds + size / RATE


@dataclass(frozen=True)
class Limits:
    """Limits of a decoder for one file, checked before anything is used (spec clause 11.2).

    Attributes
    ----------
    vertices : int
        Vertices of the tubular neighbourhood, of all levels and isovalues together.
    simplices : int
        Mixed simplices of the mesh at any moment, of all isovalues together.
    symbols : int
        Coded symbols.
    steps : int
        Steps of the walk back to known vertices, in all; ancestors of vertices to be added count as several.
    isovalues : int
        Isovalues of a file.
    layers : int
        Layers of a file, of a series of a frame.
    bytes : int
        Size of a file.
    samples : int
        Samples of a mask: only where one is asked for, a byte each.
    memory : int
        Bytes that all isovalues of a decoder hold together, and that drawing them takes for a moment. The file itself,
        the drawings and some 2 MB of tables come on top.
    work : int
        Time, in units of about a symbol (some 0.3 microseconds), on top of 512 units for each byte of the file.
    """

    vertices: int = 1 << 27
    simplices: int = 1 << 28
    symbols: int = 1 << 40
    steps: int = 1 << 27
    isovalues: int = ISOVALUES
    layers: int = 1 << 17
    bytes: int = 1 << 33
    samples: int = 1 << 28
    memory: int = 1 << 31
    work: int = 1 << 23

    @classmethod
    def tier(cls, number: int) -> Limits:
        """The counts that every decoder of a tier of conformance has to be able to do (spec clause 11.3).

        Raises
        ------
        OptionError
            If there is no such tier.
        """
        if number not in TIERS:
            raise OptionError(f"there is no tier {number}", code="tier", remedy="tiers are 0 and 1")
        vertices, simplices, symbols, steps, isovalues = TIERS[number]
        # room for a step is asked for before it is known to be needed
        return cls(
            vertices=vertices + _STEP, simplices=simplices + _STEP, symbols=symbols + 1, steps=steps + 1,
            isovalues=isovalues,
        )


TIERS = {
    0: (1 << 14, 1 << 15, 1 << 20, 1 << 20, 4),
    1: (1 << 19, 1 << 20, 1 << 23, 1 << 24, ISOVALUES),
}
"""Vertices, simplices, symbols, steps and isovalues (spec clause 11.3)."""
BLOCKS = {0: 1 << 10, 1: 1 << 15}
"""Most blocks of an encoder; a decoder's memory is limited in bytes instead."""
_STEP = 32
"""More vertices and simplices than a step of any pass adds."""


class Budget:
    """Account of the bytes held, by holder, with an upper bound; ``peak`` includes bytes held for a moment.

    Sizes are those of the arrays, whether their pages have been touched or not, so that a file needs the same on every
    machine, however it arrives.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self.peak = 0
        self._held: dict[int, int] = {}
        self._all = 0

    @property
    def held(self) -> int:
        """Bytes held in total."""
        return self._all

    def hold(self, holder: object, size: int, passing: int = 0) -> None:
        """Set the bytes of a holder to ``size``, with ``passing`` more for a moment.

        Raises `LimitError`, and changes nothing, if that exceeds the bound.
        """
        others = self._all - self._held.get(id(holder), 0)
        if others + size + passing > self._most:
            raise _over(self._most)
        self.peak = max(self.peak, others + size + passing)
        self._held[id(holder)] = size
        self._all = others + size

    def release(self, *holders: object) -> None:
        """Remove holders from the account."""
        for holder in holders:
            self._all -= self._held.pop(id(holder), 0)

    def check(self, passing: int) -> None:
        """Raise `LimitError` unless there is room for ``passing`` more bytes."""
        if self.held + passing > self._most:
            raise _over(self._most)


def _over(most: int) -> LimitError:
    return LimitError(
        f"needs more than {in_units(most)} of memory", code="limit-memory", clause="11.2",
        remedy="raise Limits.memory (--limits memory=..) if the file is trusted",
    )


def in_units(size: int) -> str:
    """Format a number of bytes for people."""
    for unit, shift in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if size >= 1 << shift:
            return f"{size / (1 << shift):.4g} {unit}"
    return f"{size} bytes"
