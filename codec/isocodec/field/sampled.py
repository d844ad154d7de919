"""Sampled fields: values, missing samples, placement, names and units."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import OptionError
from .labelling import ALL, labels_in, notes_with
from .missing import HOLE, WAYS
from .placement import CRS, PLACEMENT, Placement, placement_of

NAME, UNIT = "name", "unit"
"""Names of the notes of a file that name its quantity and its unit."""
MISSING = (HOLE, *WAYS)
"""Ways to treat missing samples."""


@dataclass(frozen=True, eq=False, init=False)
class Field:
    """Samples on a grid, together with what is known about them.

    Attributes
    ----------
    values : (s0, .., sn-1) array of bool, integers or floats
        The mask of a numpy masked array is moved to ``mask``. For tiles, these may also be the windows of a file
        (`isocodec.field.cropping.PartWindows`).
    mask : (s0, .., sn-1) array of bool, or None
        True where a sample is missing; NaN is missing as well.
    placement : Placement or None
        Where the samples lie. Numbers are converted to a Placement: the sample spacing along each axis, or a matrix
        with a row for each coordinate x, y (, z), as `isocodec.field.placement.matrix_of` takes them.
    crs : str or None
        Reference system of the coordinates, such as ``EPSG:32631``; if None, that of the placement.
    unit : str or None
        Unit of the values.
    name : str or None
        Name of the quantity.
    labels : tuple of numbers, or None
        The values are labels of a segmentation, and these labels are encoded; ``"all"`` takes all but 0.
    missing : str
        What an encoder does with missing samples: ``"hole"`` keeps them missing; ``"below"``, ``"above"`` and
        ``"nearest"`` fill them, as `isocodec.field.missing.filled` does. With labels, ``"below"`` means that missing
        samples have no label.
    notes : mapping of str to str
        Further facts from the source, as texts or single numbers: the time of a map, the height of a slice; names and
        colours of labels, ``{"label 3": "liver", "colour 3": "#dd8265"}``.
    remarks : tuple of str
        Statements of the source that were not kept, and why.

    Raises
    ------
    OptionError
        If the placement does not fit the number of axes, or ``missing`` is unknown.
    """

    values: NDArray[Any]
    mask: NDArray[np.bool_] | None
    placement: Placement | None
    crs: str | None
    unit: str | None
    name: str | None
    labels: tuple[float, ...] | None
    missing: str
    notes: Mapping[str, str]
    remarks: tuple[str, ...]

    def __init__(
        self, values: ArrayLike, mask: ArrayLike | None = None, placement: Placement | ArrayLike | None = None, *,
        crs: str | None = None, unit: str | None = None, name: str | None = None,
        labels: Sequence[float] | str | None = None, missing: str = HOLE, notes: Mapping[str, str] | None = None,
        remarks: Sequence[str] = (),
    ) -> None:
        if missing not in MISSING:
            raise OptionError(f"missing is {missing!r}", code="missing", remedy="one of " + ", ".join(MISSING))
        array: Any = values if getattr(values, "windowed", False) else np.asarray(values)
        gone = None if mask is None else np.asarray(mask)
        if "numpy.ma" in sys.modules and np.ma.is_masked(values):
            hidden = np.ma.getmaskarray(np.ma.asanyarray(values))
            gone = hidden if gone is None else hidden | gone
        if isinstance(labels, str):
            if labels != ALL:
                raise OptionError(f"labels are {labels!r}", code="labels", remedy='give numbers, or "all"')
            labels = labels_in(array, gone)
        where = placement_of(placement, array.ndim)
        if where is not None and crs is not None:
            where = replace(where, crs=crs)
        given: dict[str, Any] = {
            "values": array, "mask": gone, "placement": where, "crs": crs if where is None else where.crs,
            "unit": unit, "name": name, "labels": None if labels is None else tuple(labels), "missing": missing,
            "notes": dict(notes or {}), "remarks": tuple(remarks),
        }
        for attribute, value in given.items():
            object.__setattr__(self, attribute, value)

    def __repr__(self) -> str:
        parts = [f"shape={self.values.shape}", f"dtype={self.values.dtype}"]
        parts += [f"{name}={value!r}" for name in ("name", "unit", "crs") if (value := getattr(self, name)) is not None]
        if self.mask is not None:
            parts.append(f"{int(self.mask.sum())} missing")
        if self.placement is not None and self.placement.placed:
            parts.append("placed" if self.placement.coordinates is None else "with coordinates")
        return f"Field({', '.join(parts)})"

    @property
    def shape(self) -> tuple[int, ...]:
        """Samples along each axis."""
        return tuple(self.values.shape)

    @property
    def metadata(self) -> dict[str, str]:
        """Notes for a file of this field, except for the matrix of its placement, and of labels not encoded."""
        own = {NAME: self.name, UNIT: self.unit, CRS: self.crs}
        return {**notes_with(self.notes, self.labels), **{key: text for key, text in own.items() if text}}

    def combined(
        self, mask: ArrayLike | None = None, placement: Placement | ArrayLike | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> tuple[NDArray[np.bool_] | None, Placement | None, dict[str, str]]:
        """Combine the mask, placement and notes of this field with others.

        A mask adds missing samples; a placement, or a note of that name, replaces that of the field.
        """
        notes = {**self.metadata, **(metadata or {})}
        gone = self.mask
        if mask is not None:
            gone = np.asarray(mask, np.bool_) if gone is None else gone | np.asarray(mask, np.bool_)
        if placement is not None:
            return gone, placement_of(placement, self.values.ndim), notes
        return gone, None if PLACEMENT in notes else self.placement, notes


class SpatialImage(Protocol):
    """An image of nibabel."""

    @property
    def affine(self) -> Any:
        """Matrix of the placement of samples."""

    @property
    def dataobj(self) -> Any:
        """The samples."""
