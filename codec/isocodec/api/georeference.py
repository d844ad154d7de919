"""Placement of samples by what a user states: steps, an origin, a reference system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..errors import OptionError
from ..field.placement import Placement, matrix_of, unplaced
from ..field.reference_system import named_system

__all__ = ["NOWHERE", "Georeference", "named_system"]


@dataclass(frozen=True, kw_only=True)
class Georeference:
    """Numbers that place samples, instead of what an input states.

    Attributes
    ----------
    spacing : sequence of float, optional
        Distances of samples along the axes of the array.
    origin : sequence of float, optional
        Coordinates x, y (, z) of the first sample.
    crs : str, optional
        Reference system.
    """

    spacing: Sequence[float] | None = None
    origin: Sequence[float] | None = None
    crs: str | None = None

    @property
    def places(self) -> bool:
        """Whether these replace the steps or the origin that an input states."""
        return not self.spacing is self.origin is None

    def placement(self, stated: Placement | None, shape: Sequence[int]) -> Placement | None:
        """Place the samples of a field of that shape, whose input states a placement or none.

        Raises
        ------
        OptionError
            If these are not numbers for so many axes, or the input has coordinates in uneven steps where an origin
            alone is given.
        """
        system = self.crs if self.crs is not None else stated.crs if stated is not None else None
        if self.places:
            unit = stated.unit if stated is not None and self.crs is None else None
            return Placement(matrix_of(self._matrix(stated, shape), len(shape)), crs=system, unit=unit)
        return stated if stated is None or self.crs is None else replace(stated, crs=system)

    def _matrix(self, stated: Placement | None, shape: Sequence[int]) -> NDArray[np.float64]:
        n = len(shape)
        if self.spacing is not None:
            matrix = matrix_of(_numbers("spacing", self.spacing, n), n)
        elif stated is not None and stated.coordinates is not None:
            raise OptionError("an origin moves a field with even steps", code="origin", remedy="give a spacing, too")
        else:
            matrix = unplaced(n) if stated is None or stated.matrix is None else matrix_of(stated.matrix, n).copy()
        if self.origin is not None:
            matrix[:, n] = _numbers("origin", self.origin, n)
        return matrix


def _numbers(name: str, given: Sequence[float], count: int) -> NDArray[np.float64]:
    if len(given) != count:
        raise OptionError(f"the {name} has {len(given)} numbers; give {count}", code=name)
    return np.array(given, np.float64)


NOWHERE = Georeference()
"""States nothing."""
