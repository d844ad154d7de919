"""Output of a network of the main profile for a symbol (spec clause 7.11): the sum of rows, weighed.

Much of the profile's time goes here: compiled, ``vectors`` takes its place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from isospec.tables import HIDDEN

from ..kernel import EXECUTION, Execution


def weighed(row: NDArray[np.int64], table: NDArray[np.int16], out: NDArray[np.int32]) -> int:
    """Sum of ``HIDDEN`` sums of rows, those below 0 counted as 0, each times a weight.

    Parameters
    ----------
    row : (R,) int64
        Number of rows, then which.
    table : (T, HIDDEN) int16, contiguous
        Sums of the rows listed are numbers of 16 bits, too.
    out : (HIDDEN,) int32 or longer, contiguous
        The result is a number of 32 bits.
    """
    sums = table[row[1 : row[0] + 1]].astype(np.int64).sum(axis=0)
    return int(np.maximum(sums, 0) @ out[:HIDDEN].astype(np.int64))


if EXECUTION is Execution.NUMBA:
    from . import vectors

    vectors.instead_of(weighed)
