"""A part of the domain: what lies around some places."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..kernel import kernel
from ..kernel.types import BoolVector, BoolVolume, IntMatrix

MOST_CUBES = 1 << 22


@dataclass(frozen=True)
class Around:
    """Cubes of ``size`` cells of the domain, those in ``mask``."""

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

    def covering(self, points: NDArray[np.float64], cells: NDArray[np.int64], reach: float) -> Around:
        """All cubes that come within a reach of some pieces' bounding boxes, or a little more.

        Parameters
        ----------
        points : (P, n) float64
        cells : (M, k) int64
        reach : float
            In cells.
        """
        mask = self.mask.copy()
        mark(*self._boxes(points, cells, reach), _in_space(mask))
        return Around(self.size, mask)

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Find which of some points (P, n) lie there."""
        return self.mask[self._cubes(points)]

    def meets(self, points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of the pieces (M, k) whose bounding boxes come there."""
        found = np.zeros(len(cells), np.bool_)
        meet(*self._boxes(points, cells, 0.0), _in_space(self.mask), found)
        return np.flatnonzero(found)

    def _cubes(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], ...]:
        last = np.array(self.mask.shape) - 1
        return tuple(np.clip((points / self.size).astype(np.int64), 0, last).T)

    def _boxes(
        self, points: NDArray[np.float64], cells: NDArray[np.int64], reach: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First cubes, and those behind the last ones, that bounding boxes come into with a reach; (M, 3) each."""
        n = points.shape[1]
        low, high = np.zeros((len(cells), 3), np.int64), np.ones((len(cells), 3), np.int64)
        corners = points[cells]
        shape = np.array(self.mask.shape)
        low[:, :n] = np.clip(np.floor((corners.min(axis=1) - reach) / self.size), 0, shape - 1)
        high[:, :n] = np.clip(np.floor((corners.max(axis=1) + reach) / self.size), 0, shape - 1) + 1
        return low, high


def _in_space(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return mask.reshape(mask.shape + (1,) * (3 - mask.ndim))


@kernel
def mark(low: IntMatrix, high: IntMatrix, mask: BoolVolume) -> None:
    """Mark all cubes of boxes, from ``low`` up to those before ``high``."""
    for i in range(len(low)):
        for x in range(low[i, 0], high[i, 0]):
            for y in range(low[i, 1], high[i, 1]):
                for z in range(low[i, 2], high[i, 2]):
                    mask[x, y, z] = True


@kernel
def meet(low: IntMatrix, high: IntMatrix, mask: BoolVolume, found: BoolVector) -> None:
    """Find which boxes hold a marked cube."""
    for i in range(len(low)):
        for x in range(low[i, 0], high[i, 0]):
            for y in range(low[i, 1], high[i, 1]):
                for z in range(low[i, 2], high[i, 2]):
                    found[i] = found[i] or mask[x, y, z]
