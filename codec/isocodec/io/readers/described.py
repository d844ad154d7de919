"""Normalise user input: a field to its samples and options."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...field.placement import PLACEMENT
from ...field.sampled import Field
from .anything import is_described, read

_DEGREES, _TURN = "EPSG:4326", 360.0
"""Reference system in which x is a longitude, and after how much it is the same."""


class SpatialImage(Protocol):
    """An image of nibabel."""

    @property
    def affine(self) -> Any:
        """Where the samples lie."""

    @property
    def dataobj(self) -> Any:
        """The samples."""


def described(
    field: ArrayLike | Field | SpatialImage, mask: ArrayLike | None = None, placement: ArrayLike | None = None,
    metadata: Mapping[str, str] | None = None, coordinates: Sequence[ArrayLike] | None = None,
    period: float | Sequence[float] | None = None,
) -> tuple[ArrayLike, dict[str, Any]]:
    """The samples of a field, and these options with what it says itself.

    Raises
    ------
    InputError
        As `isocodec.read`.
    """
    options: dict[str, Any] = {
        "mask": mask, "placement": placement, "metadata": metadata, "coordinates": coordinates, "period": period,
    }
    if not is_described(field):
        return field, options  # type: ignore[return-value]
    known = read(field)
    notes = {**known.metadata, **(metadata or {})}
    options["metadata"] = notes
    if mask is None:
        options["mask"] = known.mask
    elif known.mask is not None:
        options["mask"] = known.mask | np.asarray(mask, np.bool_)
    if placement is coordinates is None and PLACEMENT not in notes:
        options["placement"], options["coordinates"] = known.placement, known.coordinates
        if known.coordinates is not None and period is None and known.crs == _DEGREES:
            options["period"] = _TURN
    return known.values, options
