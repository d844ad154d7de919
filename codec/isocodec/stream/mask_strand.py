"""The mask of a file, on the decoder's side: its chunk, and the holes that follow (spec clauses 3.5.6, 5.10)."""

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
    """State of the mask.

    Parameters
    ----------
    limits : Limits
    data : bytearray
        The file as far as it has come; it grows.
    budget : Budget
    account : Account
    tubes : list of Tube or None
        Those of the isovalues.

    Attributes
    ----------
    tubes : list of Tube or None
        That of the mask, if its chunk has begun.
    holes : Holes or None
        The holes that it describes, if it is complete.
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
        """Whether its chunk is being read."""
        return self._reader is not None

    def begin(self, header: Header, left: Limits) -> None:
        """Its chunk begins; ``left`` is what its tube may have."""
        tube = mask_tube(header, _ROOM, left, budget=self._budget)
        self.tubes.append(tube)
        self._reader = MaskReader(self._limits, self._data, tube, self._others, self._account)

    def go_on(self, chunk: Envelope, chunk_start: int) -> bool:
        """Go on with its chunk; whether all has come, and where another chunk comes, too."""
        return self._reader is None or self._reader.read(chunk, chunk_start)

    def end(self) -> None:
        """Its chunk has been read and verified."""
        tube = self.tube
        assert tube is not None
        tube.rest()
        self._reader, self.holes = None, Holes(tube.state)

    def drop(self) -> None:
        """Keep nothing of it."""
        if self.tube is not None:
            self._budget.release(self.tube, self.tube.estimates)
        self.tubes.clear()
        self.holes = None
