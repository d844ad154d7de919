"""Missing samples by the mask: of vertices, of edges, of unit cells (spec clause 5.10).

The mask is the tubular neighbourhood of an isovalue between missing (0) and valid (1), on the full grid. Its sparse
state yields for any sample which it is, by inference, in as many steps as there are levels: its base is coarse.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, inner, kernel
from ...kernel.types import BoolVector, IntMatrix
from ..lattice.access import dimension
from ..lattice.tables import AXES
from .capacity import no_lean
from .inference import infer
from .state import Counters, Lean, State

_NO_LIMIT = 1 << 62


@inlined
def missing_at(hole, x, y, z):
    """Whether the sample at (x, y, z) is missing; such steps of inference are few and not counted."""
    hole.counters.work = 0
    return infer(hole, x, y, z) == 0


@inlined
def whole_cell(hole, x, y, z):
    """Whether the unit cell with the lowest corner (x, y, z) lies in the box and none of its corners is missing."""
    grid = hole.grid
    deep = dimension(grid.tables) == 3
    if min(x, y, z) < 0 or x >= grid.last0 or y >= grid.last1 or (deep and z >= grid.last2):
        return False
    for corner in range(8 if deep else 4):
        if missing_at(hole, x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)):
            return False
    return True


@inner
def on_whole_cell(st, x, y, z, axis):
    """Whether some unit cell without missing corners has the grid edge from (x, y, z) upwards along an axis."""
    if st.counters.masked == 0:
        return True
    deep = dimension(st.grid.tables) == 3
    for side in range(8 if deep else 4):
        if side >> axis & 1 == 0 and whole_cell(st.hole, x - (side & 1), y - (side >> 1 & 1), z - (side >> 2)):
            return True
    return False


@kernel
def _whole_cells(hole: Lean, low: IntMatrix, out: BoolVector) -> None:
    """Enter which unit cells, by their lowest corners on three axes, are whole."""
    for i in range(len(low)):
        out[i] = whole_cell(hole, low[i, 0], low[i, 1], low[i, 2])


class Holes:
    """Missing samples by a complete mask.

    Parameters
    ----------
    state : State
        That of the mask, complete.

    Attributes
    ----------
    lean : Lean
        What kernels see of it.
    """

    def __init__(self, state: State) -> None:
        counters = Counters()
        counters.base_level, counters.most_work = state.counters.base_level, _NO_LIMIT
        nothing = no_lean(int(state.grid.tables[0]))
        self.lean = nothing._replace(grid=state.grid, counters=counters, known=state.known, mesh=state.mesh)

    def whole_cells(self, low: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether unit cells, by their lowest corners (C, n), lie in the box without a missing corner, (C,) bool."""
        padded = np.zeros((len(low), AXES), np.int64)
        padded[:, : low.shape[1]] = low
        out = np.empty(len(low), np.bool_)
        _whole_cells(self.lean, padded, out)
        return out


def whole_cells_of(gone: NDArray[np.bool_], low: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Find whole cells as `Holes.whole_cells` does, from all samples: ``gone`` is where they are missing."""
    inside: NDArray[np.bool_] = np.asarray(((low >= 0) & (low < np.array(gone.shape) - 1)).all(axis=1))
    place = np.where(inside[:, None], low, 0)
    for corner in product((0, 1), repeat=gone.ndim):
        inside &= ~gone[tuple((place + corner).T)]
    return inside
