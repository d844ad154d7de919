"""A part of the domain: what lies around some places."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MOST_CUBES = 1 << 22


@dataclass(frozen=True)
class Around:
    """Cubes of ``size`` cells of the domain; ``mask`` says which of them are meant."""

    size: float
    mask: NDArray[np.bool_]

    @classmethod
    def of(cls, places: NDArray[np.float64], shape: tuple[int, ...], size: float) -> Around:
        """The cubes, of about a size, that hold places (P, n)."""
        while math.prod(int(s / size) + 1 for s in shape) > MOST_CUBES:
            size *= 2
        out = cls(size, np.zeros([int(s / size) + 1 for s in shape], np.bool_))
        out.mask[out._cubes(places)] = True
        return out

    def wider(self, reach: float) -> Around:
        """All cubes within a reach, in cells, along the axes, or less."""
        mask = self.mask.copy()
        rings = math.ceil(reach / self.size)
        for axis in range(mask.ndim):
            lines = np.moveaxis(mask, axis, 0)
            before = lines.copy()
            for ring in range(1, min(rings, len(lines) - 1) + 1):
                lines[ring:] |= before[:-ring]
                lines[:-ring] |= before[ring:]
        return Around(self.size, mask)

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of some points (P, n) lie there."""
        return self.mask[self._cubes(points)]

    def touches(self, points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of the cells (M, n) with a corner there."""
        return np.flatnonzero(self.holds(points)[cells].any(axis=1))

    def _cubes(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], ...]:
        last = np.array(self.mask.shape) - 1
        return tuple(np.clip((points / self.size).astype(np.int64), 0, last).T)
