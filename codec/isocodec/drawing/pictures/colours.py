"""Colours of isovalues: by value from dark violet to yellow, as in the viewer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...extras import optional

_SCALE = "viridis"
_SEEN = (0.0, 8 / 9)
"""Part of the scale that can be seen on white."""
_SHADED = (0.3, 0.9)
"""Part of the scale of which shades can be seen."""


def places_of(isovalues: Sequence[float]) -> NDArray[np.float64]:
    """Places of isovalues between the lowest, 0, and the highest, 1.

    They are spaced by value, or by rank if some values are so close to others that their colours would look the same.
    """
    values = np.asarray(isovalues, np.float64)
    rising, rank = np.unique(values, return_inverse=True)
    if len(rising) < 2:
        return np.zeros(len(values))
    count, span = len(rising) - 1, rising[-1] - rising[0]
    if np.diff(rising).min() * count < span / 4:
        return np.asarray(rank / count)
    return (values - rising[0]) / span


def colours_of(isovalues: Sequence[float], solid: bool = False) -> NDArray[np.float64]:
    """Colours of isovalues, (V, 3) in 0 .. 1, of lines or of ``solid`` surfaces.

    Raises
    ------
    MissingExtraError
        If matplotlib is missing.
    """
    matplotlib = optional("matplotlib", extra="plot", purpose="drawing a picture")
    low, high = _SHADED if solid else _SEEN
    return np.asarray(matplotlib.colormaps[_SCALE](low + places_of(isovalues) * (high - low))[:, :3])
