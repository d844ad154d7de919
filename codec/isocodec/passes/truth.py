"""What the encoder knows and the decoder does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Truth:
    """What the encoder knows: the field's signs, and the numbers that geometry sends.

    ``number(positions, above)`` gives the distances from the isovalue's side in steps, int64;
    ``crossing(low, high)`` the places of crossings between positions as 30-bit binary fractions, int64.
    """

    signs: NDArray[np.bool_]
    number: Callable[..., NDArray[np.int64]]
    crossing: Callable[..., NDArray[np.int64]]
