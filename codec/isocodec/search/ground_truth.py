"""Knowledge of the encoder that the decoder lacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..field.samples import Samples
from ..grid.lattice.tables import AXES, cube_exponent
from ..grid.tube.capacity import filled
from ..grid.tube.state import State
from .component_search import busy_of, find
from .mixed_leaves import build_pyramid, mixed_leaves

Pyramid = tuple[NDArray[np.uint8], NDArray[np.int64]]


@dataclass(frozen=True)
class GroundTruth:
    """Knowledge of the encoder: the field's signs, and the numbers that geometry sends.

    ``number(positions, above)`` gives the distances from the isovalue's side in steps, int64;
    ``crossing(low, high)`` the places of crossings between positions as 30-bit binary fractions, int64. Surveys of the
    whole domain are made when they are first asked for, and kept: many trials may share them.
    """

    signs: NDArray[np.bool_]
    number: Callable[..., NDArray[np.int64]]
    crossing: Callable[..., NDArray[np.int64]]
    _pyramids: dict[int, Pyramid] = field(default_factory=dict, init=False, repr=False)

    @property
    def padded(self) -> NDArray[np.bool_]:
        """The signs on three axes."""
        return self.signs.reshape(self.signs.shape + (1,) * (AXES - len(self.signs.shape)))

    @cached_property
    def busy(self) -> NDArray[np.bool_]:
        """Blocks that the curve passes: `component_search.busy_of`."""
        return busy_of(self.padded)

    def pyramid(self, level: int) -> Pyramid:
        """Cubes with both signs in them, down to a level: `base_order.build_pyramid`."""
        if level not in self._pyramids:
            shape = self.signs.shape
            last = np.array(self.padded.shape) - 1
            self._pyramids[level] = build_pyramid(self.padded, last, cube_exponent(shape), level, len(shape))
        return self._pyramids[level]

    def mixed_leaves(self, state: State, level: int) -> NDArray[np.int64]:
        """The mixed leaves of the mesh that a base is to have, down to a level, as paths in the order of the forest."""
        pyramid = self.pyramid(level)
        return filled(lambda out: mixed_leaves(state, *pyramid, out))

    def new_components(self, state: State) -> NDArray[np.int64]:
        """The new components of a round, as sorted numbers of slots."""
        return np.sort(filled(lambda out: find(state, self.busy, out)))


def truth_of(field: Samples) -> GroundTruth:
    """Make the ground truth for tubes of a field."""
    return GroundTruth(field.signs, field.numbers, field.crossings)
