"""Memory that writing takes, counted before the work begins."""

from __future__ import annotations

from ..deferred import dataclass


@dataclass(frozen=True)
class Cost:
    """Most memory, in bytes, that writing takes: for each point, for each cell, and in any case.

    ``kept`` bytes for each point are held until the file is complete; all of them if None.
    """

    point: int
    cell: int
    fixed: int = 0
    kept: int | None = None

    def peak(self, points: int, cells: int) -> int:
        """Memory while one drawing is written."""
        return self.point * points + self.cell * cells + self.fixed

    def after(self, points: int, cells: int) -> int:
        """Memory after a drawing has been written, while others follow."""
        return self.point * points + self.cell * cells if self.kept is None else self.kept * points


COST = Cost(300, 240, 1 << 24, kept=150)
"""Memory of the writers, that of the most expensive ones."""
