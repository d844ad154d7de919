"""Where fields, contours and files lie, for assertions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def matrix(placed: Any) -> NDArray[np.float64]:
    """The matrix of the placement of a field, contour or file; without entries if there is none."""
    found = None if placed.placement is None else placed.placement.matrix
    return np.zeros((0, 0)) if found is None else np.asarray(found)


def on_nodes(placed: Any) -> bool:
    """Whether samples have coordinates one by one."""
    return placed.placement is not None and placed.placement.coordinates is not None
