"""The mask of a file as decoders read it: its chunk, and the holes that follow from it (spec clauses 3.5.6, 5.10)."""

from __future__ import annotations

from ..entropy.run import Account
from ..format.chunks import Envelope
from ..format.header import Header
from ..grid.layers.beginning import mask_tube
from ..grid.layers.layer_reader import MaskReader
from ..grid.passes.runner import Tube
from ..grid.tube.holes import Holes
from ..limits import Budget, Limits

_ROOM = 4096


class MaskStrand:
    """State of the mask while it is decoded.

    Parameters
    ----------
    limits : Limits
    data : bytearray
        The file as far as it has arrived; it grows.
    budget : Budget
    account : Account
    tubes : list of Tube or None
        Tubes of the isovalues.

    Attributes
    ----------
    tubes : list of Tube or None
        The tube of the mask, if its chunk has begun.
    holes : Holes or None
        The holes that the mask describes, if it is complete.
    """

    def __init__(
        self, limits: Limits, data: bytearray, budget: Budget, account: Account, tubes: list[Tube | None]
    ) -> None:
        self.tubes: list[Tube | None] = []
        self.holes: Holes | None = None
        self._limits = limits
        self._data = data
        self._budget = budget
        self._account = account
        self._others = tubes
        self._reader: MaskReader | None = None

    @property
    def tube(self) -> Tube | None:
        """The tube of the mask, if its chunk has begun and it was not dropped."""
        return self.tubes[0] if self.tubes else None

    @property
    def coming(self) -> bool:
        """Whether the chunk of the mask is being read."""
        return self._reader is not None

    def begin(self, header: Header, left: Limits) -> None:
        """Begin the chunk of the mask; ``left`` are the limits for its tube."""
        tube = mask_tube(header, _ROOM, left, budget=self._budget)
        self.tubes.append(tube)
        self._reader = MaskReader(self._limits, self._data, tube, self._others, self._account)

    def go_on(self, chunk: Envelope, chunk_start: int) -> bool:
        """Continue with the chunk; returns whether it has been read completely."""
        return self._reader is None or self._reader.read(chunk, chunk_start)

    def end(self) -> None:
        """Finish the chunk, which has been read and verified."""
        tube = self.tube
        assert tube is not None
        tube.rest()
        self._reader, self.holes = None, Holes(tube.state)

    def drop(self) -> None:
        """Release everything."""
        if self.tube is not None:
            self._budget.release(self.tube, self.tube.estimates)
        self.tubes.clear()
        self.holes = None
