"""Where the samples of a file lie, on the decoder's side: its chunk of coordinates (spec clauses 3.7.4, 9.9)."""

from __future__ import annotations

from ..entropy.run import Account
from ..errors import LimitError
from ..field.mapped import Mapped
from ..format.coordinates import CoordinatesRecord
from ..grid.passes.node_run import NodeGrid, decode_run
from ..limits import Budget, Limits


class World:
    """The coordinates of a file, decoded when something is drawn in them.

    Parameters
    ----------
    budget : Budget
    limits : Limits
        What its run may take, beside all other runs of the file: it is decoded when somebody draws, and what comes
        later must not depend on that.
    """

    def __init__(self, budget: Budget, limits: Limits) -> None:
        self._budget = budget
        self._limits = limits
        self._record: CoordinatesRecord | None = None
        self._mapped: Mapped | None = None

    def mapped(self, record: CoordinatesRecord | None, shape: tuple[int, ...]) -> Mapped | None:
        """What a chunk says; None if there is none, or its run is malformed: it is ignored then.

        Raises
        ------
        LimitError
            If it takes more than the limits allow; nothing is held of it then.
        """
        if record is not self._record:
            self.drop()
            if record is not None:
                grids = [NodeGrid(one.counts(shape), one.period) for one in record.coordinates]
                self._budget.hold(self, 8 * sum(grid.nodes for grid in grids))
                try:
                    values = decode_run(record.run, grids, Account(self._limits.symbols, self._limits.work))
                except LimitError:
                    self._budget.release(self)
                    raise
                if values is None:
                    self._budget.release(self)
                else:
                    self._mapped = Mapped(shape, record.coordinates, tuple(values), record.periodic)
            self._record = record
        return self._mapped

    def drop(self) -> None:
        """Keep nothing of it."""
        self._record = self._mapped = None
        self._budget.release(self)
