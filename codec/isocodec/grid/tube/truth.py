"""Knowledge of an encoder that it hands to a tube; a decoder has to be sent it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .state import State

Place = Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.int64]]
"""Where edges between positions are to be crossed, as 30-bit fractions; or how far from there crossings may be
placed."""


class Truth(Protocol):
    """Knowledge of the encoder about a field at an isovalue: see ``search.ground_truth``."""

    @property
    def padded(self) -> NDArray[np.bool_]:
        """Signs of all samples, on three axes."""

    @property
    def number(self) -> Numbers:
        """Distances of samples from the isovalue's side, in steps."""

    @property
    def crossing(self) -> Place:
        """Places of crossings between positions, as 30-bit binary fractions."""

    def mixed_leaves(self, state: State, level: int) -> NDArray[np.int64]:
        """The mixed leaves of the mesh that a base is to have, as paths in the order of the forest."""

    def new_components(self, state: State) -> NDArray[np.int64]:
        """The new components of a round, as sorted numbers of slots."""


class Numbers(Protocol):
    def __call__(self, positions: NDArray[np.integer], above: NDArray[np.bool_]) -> NDArray[np.int64]: ...
