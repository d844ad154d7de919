"""Sides of a grid whose samples are there twice: those that tiles share, and the two ends of periodic axes.

A mesh describes both alike if all crossed edges in them are those of the full grid, and nothing in them has slack or is
fitted (spec 9.9(4), 12.7): which crossings there are, and where, then follows from the samples in the side alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.depth import levels_of
from ..grid.lattice.tables import AXES, cube_exponent
from ..grid.lattice.vertex_set import Chosen
from .coarsening import Reduction, mark
from .reduced import NEEDED, number_of


class SharedSides:
    """Some of the sides of a grid.

    Parameters
    ----------
    shape : sequence of int
        Samples along each axis.
    shared : (n, 2) bool
        Across each axis the low and the high side.
    """

    def __init__(self, shape: Sequence[int], shared: NDArray[np.bool_]) -> None:
        last = np.array(shape, np.int64) - 1
        self._low = np.where(shared[:, 0], 0, -1)
        self._high = np.where(shared[:, 1], last, -1)
        self._planes = [(axis, int(last[axis]) if side else 0) for axis, side in np.argwhere(shared).tolist()]

    @classmethod
    def of_axes(cls, shape: Sequence[int], periodic: Sequence[int]) -> SharedSides:
        """Both ends of periodic axes; ``shape`` includes the planes that close them."""
        shared = np.zeros((len(shape), 2), np.bool_)
        shared[list(periodic)] = True
        return cls(shape, shared)

    def holds(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Find edges that lie in one of the sides, by the positions of their ends (E, n), (E,) bool."""
        return ((low == high) & ((low == self._low) | (low == self._high))).any(axis=1)

    def vertices(self, signs: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Samples of the unit edges and squares in the sides that the curve crosses.

        With these and their ancestors in the mesh, all that is crossed in a side is as on the full grid.

        Parameters
        ----------
        signs : (s0, .., sn-1) bool

        Returns
        -------
        (V, 3) int64, (V,) int64
            Positions, padded to three axes, and levels.
        """
        n = signs.ndim
        found = [np.zeros((0, n), np.int64)]
        for axis, place in self._planes:
            beside = np.argwhere(_crossed_corners(np.take(signs, [place], axis)))
            beside[:, axis] = place
            found.append(beside)
        position = np.unique(np.concatenate(found), axis=0)
        level = levels_of(position, cube_exponent(signs.shape))
        # corners of the root cube are always there
        inner = level >= 0
        return np.pad(position[inner], ((0, 0), (0, AXES - n))), level[inner]


def _crossed_corners(signs: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Samples of a side that are corners of one of its unit cells with both signs."""
    ways = product(*((0, 1) if size > 1 else (0,) for size in signs.shape))
    cells = [tuple(slice(d, max(size - 1, 1) + d) for d, size in zip(way, signs.shape, strict=True)) for way in ways]
    corners = [signs[cell] for cell in cells]
    crossed = np.logical_or.reduce(corners) & ~np.logical_and.reduce(corners)
    out = np.zeros(signs.shape, np.bool_)
    for cell in cells:
        out[cell] |= crossed
    return out


class JoinedReduction(Reduction):
    """A reduction in which the vertices of shared sides stay, with their ancestors.

    Parameters
    ----------
    signs, phi, points, start, busy
        As of `Reduction`.
    vertices, levels
        As from `SharedSides.vertices`.
    """

    def __init__(
        self, signs: NDArray[np.bool_], phi: NDArray[np.float32], points: NDArray[np.float64], start: Chosen | None,
        busy: NDArray[np.bool_] | None, vertices: NDArray[np.int64], levels: NDArray[np.int64],
    ) -> None:
        super().__init__(signs, phi, points, start, busy)
        self._vertices, self._levels = vertices, levels
        self._keys = np.asarray(number_of(self.n, *vertices.T), np.int64)

    def reduce(self, **criteria: Any) -> None:
        """Take vertices away as `Reduction.reduce` does, but for those of the sides."""
        mark(self.domain, self._keys, NEEDED)
        super().reduce(**criteria)
        # a level takes all finer vertices away
        self.add(self._vertices, self._levels)
