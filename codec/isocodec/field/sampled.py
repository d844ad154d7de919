"""A sampled field with all that its source says of it: values, missing samples, where they lie, names and units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .placement import CRS

NAME, UNIT = "name", "unit"
"""Names of the notes of a file that say what its values are, and in which unit."""


@dataclass(frozen=True, eq=False)
class Field:
    """Samples on a grid, and what is known of them.

    Attributes
    ----------
    values : (s0, .., sn-1) array of bool, integers or floats
    mask : (s0, .., sn-1) array of bool, or None
        True where a sample is missing; NaN is missing as well.
    placement : (n, n + 1) float64, or None
        Where samples lie: a row for each coordinate x, y (, z), with what a step along each axis of the array adds to
        it, and what it is at sample 0.
    coordinates : tuple of arrays, or None
        Where samples lie whose steps are not even, instead of a placement: x, y (, z) as arrays of n axes that
        broadcast to the shape of the values.
    crs : str or None
        Reference system of the coordinates, as ``EPSG:32631``.
    unit : str or None
        Unit of the values.
    name : str or None
        What the values are.
    missing : str
        What an encoder does with missing samples: ``"hole"`` leaves them out, ``"below"``, ``"above"`` and
        ``"nearest"`` fill them, as `isocodec.field.missing.filled` does.
    notes : mapping of str to str
        What else the source says in words or single numbers: the time of a map, the height of a slice.
    remarks : tuple of str
        What the source says and is left out, and why.
    """

    values: NDArray[Any]
    mask: NDArray[np.bool_] | None = None
    placement: NDArray[np.float64] | None = None
    coordinates: tuple[NDArray[np.float64], ...] | None = None
    crs: str | None = None
    unit: str | None = None
    name: str | None = None
    missing: str = "hole"
    notes: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        said = [f"shape={self.values.shape}", f"dtype={self.values.dtype}"]
        said += [f"{name}={value!r}" for name in ("name", "unit", "crs") if (value := getattr(self, name)) is not None]
        if self.mask is not None:
            said.append(f"{int(self.mask.sum())} missing")
        said += ["placed"] * (self.placement is not None) + ["with coordinates"] * (self.coordinates is not None)
        return f"Field({', '.join(said)})"

    @property
    def shape(self) -> tuple[int, ...]:
        """Samples along each axis."""
        return tuple(self.values.shape)

    @property
    def metadata(self) -> dict[str, str]:
        """The notes that a file of this field gets, but for its placement."""
        said = {NAME: self.name, UNIT: self.unit, CRS: self.crs}
        return {**self.notes, **{key: text for key, text in said.items() if text}}


def check_bare(field: object) -> None:
    """Refuse what carries coordinates beside its samples, which would be lost.

    Raises
    ------
    InputError
    """
    if isinstance(field, Field) or (hasattr(field, "coords") and hasattr(field, "dims")):
        raise InputError(
            f"a {type(field).__name__} has coordinates that an encoder does not take by itself", code="coordinates",
            remedy="use isocodec.encode, or give the bare samples (.values) and placement=, metadata=, mask=",
        )
