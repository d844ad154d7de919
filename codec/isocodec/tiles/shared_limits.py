"""Limits of a decoder that hold for all tiles of a file together (spec clause 11.2)."""

from __future__ import annotations

from dataclasses import replace

from ..errors import LimitError
from ..limits import WORK_PER_BYTE, WORK_STEPS, Budget, Limits
from ..stream.decoder import Decoder
from ..stream.grid_contents import GridContents


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
        decoder = Decoder(replace(limits, memory=max(limits.memory - self.budget.held, 0)))
        try:
            decoder.feed(data)
            decoder.close()
        except LimitError as error:
            name = error.code.removeprefix("limit-")
            if limits == self._whole or not hasattr(limits, name):
                raise
            raise LimitError(f"all tiles together exceed the limit of {getattr(self._whole, name):,} for {name}",
                             code=error.code, clause="11.2", remedy=error.remedy) from None
        account, tubes = decoder.account, [tube for tube in (*decoder.grid.tubes, decoder.grid.mask_tube) if tube]
        work = account.units + account.steps // WORK_STEPS - WORK_PER_BYTE * account.read
        taken = {name: sum(getattr(tube, name) for tube in tubes) for name in ("vertices", "simplices", "steps")}
        taken |= {"symbols": account.symbols, "work": max(work, 0)}
        self._left = replace(limits, **{name: max(getattr(limits, name) - n, 0) for name, n in taken.items()})
        return decoder.grid
