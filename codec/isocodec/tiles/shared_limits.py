"""Limits of a decoder that hold for all tiles of a file together (spec clause 11.2)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from ..errors import LimitError
from ..limits import WORK_PER_BYTE, WORK_STEPS, Budget, Limits
from ..stream.decoder import Decoder
from ..stream.grid_contents import GridContents

Made = TypeVar("Made")


class Shared:
    """Limits that several files share, less what these have taken so far.

    `budget` is the memory held by directories and drawings.
    """

    def __init__(self, limits: Limits) -> None:
        self.budget = Budget(limits.memory)
        self._whole = self._left = limits
        self._kept = 0

    def keep(self, size: int) -> None:
        """Count bytes that are held until the end of the call."""
        self._kept += size
        self.budget.hold(self, self._kept)

    def decoded(self, data: bytes) -> GridContents:
        """Decode the file of a grid within what is left of the limits; raises `FormatError` or `LimitError`."""
        limits = self._left
        try:
            decoder = _decoder(data, replace(limits, memory=max(limits.memory - self.budget.held, 0)))
        except LimitError as error:
            name = error.code.removeprefix("limit-")
            if limits == self._whole or not hasattr(limits, name):
                raise
            raise LimitError(f"all tiles together exceed the limit of {getattr(self._whole, name):,} for {name}",
                             code=error.code, clause="11.2", remedy=error.remedy) from None
        self._left = _less(limits, _taken(decoder))
        return decoder.grid

    def each(self, files: Sequence[bytes], made: Callable[[int, GridContents], Made], threads: int) -> list[Made]:
        """Make something of each decoded file, by its number; the same in threads as one after the other.

        Threads share the memory that is left. Where a limit is exceeded, all are decoded anew, one after the other.
        """
        if threads > 1 and len(files) > 1:
            own = replace(self._left, memory=max(self._left.memory - self.budget.held, 0) // threads)

            def one(number: int) -> tuple[Made, Counter[str]]:
                decoder = _decoder(files[number], own)
                return made(number, decoder.grid), _taken(decoder)

            with suppress(LimitError), ThreadPoolExecutor(threads) as pool:
                found = [*pool.map(one, range(len(files)))]
                taken = sum((each for _, each in found), Counter[str]())
                if all(count <= getattr(self._left, name) for name, count in taken.items()):
                    self._left = _less(self._left, taken)
                    return [each for each, _ in found]
        return [made(number, self.decoded(data)) for number, data in enumerate(files)]


def _decoder(data: bytes, limits: Limits) -> Decoder:
    decoder = Decoder(limits)
    decoder.feed(data)
    decoder.close()
    return decoder


def _taken(decoder: Decoder) -> Counter[str]:
    """Count how much of the limits decoding a file of a grid took."""
    account, tubes = decoder.account, [tube for tube in (*decoder.grid.tubes, decoder.grid.mask_tube) if tube]
    work = account.units + account.steps // WORK_STEPS - WORK_PER_BYTE * account.read
    counts = {name: sum(getattr(tube, name) for tube in tubes) for name in ("vertices", "simplices", "steps")}
    return Counter(counts | {"symbols": account.symbols, "work": max(work, 0)})


def _less(limits: Limits, taken: Counter[str]) -> Limits:
    return replace(limits, **{name: max(getattr(limits, name) - count, 0) for name, count in taken.items()})
