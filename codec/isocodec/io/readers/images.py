"""Volumes that other libraries hold in memory: images of nibabel and of SimpleITK."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...extras import optional
from ...field.sampled import Field
from .place import Place, of_itk, usable
from .reading import reading
from .volume import scaled, single


def is_nibabel(thing: Any) -> bool:
    """Whether this is an image of nibabel with an affine matrix."""
    return all(hasattr(thing, name) for name in ("affine", "dataobj", "header"))


def is_itk(thing: Any) -> bool:
    """Whether this is an image of SimpleITK."""
    return all(hasattr(thing, name) for name in ("GetSpacing", "GetDirection", "GetPixelIDTypeAsString"))


def nibabel_field(image: Any, frame: int | None) -> Field:
    """The volume of an image of nibabel, placed by its affine matrix; integers stay integers where they can."""
    stored = image.dataobj
    values = None
    with reading("image of nibabel"):
        if hasattr(stored, "get_unscaled"):
            values = scaled(np.asarray(stored.get_unscaled()), float(stored.slope), float(stored.inter))
        values = single(np.asarray(stored) if values is None else values, frame)
    place = usable(image.affine, 3) if values.ndim == 3 else Place(remark="the position of a slice in space is ignored")
    placement = None if place.placement is None else place.record
    return Field(values, placement=placement, remarks=(place.remark,) if place.remark else ())


def itk_field(image: Any, frame: int | None) -> Field:
    """The volume of an image of SimpleITK, axes i, j, k, in coordinates right, front and up."""
    sitk = optional("SimpleITK", extra="itk", purpose="reading an image of SimpleITK")
    with reading("image of SimpleITK"):
        values = single(sitk.GetArrayFromImage(image).T, frame)
    place = of_itk(image, values.ndim)
    placement = None if place.placement is None else place.record
    return Field(values, placement=placement, remarks=(place.remark,) if place.remark else ())
