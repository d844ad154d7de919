"""Missing samples: which they are, and what may be taken instead of holes.

NaN is missing, and so is the value that a GeoTIFF or an array of NetCDF says stands for it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...extras import optional
from .engines import is_labelled_file
from .hdf5 import HDF5_SUFFIXES, dataset, fill_value, is_packed
from .raster import TIFF_SUFFIXES, opened_tiff
from .reading import reading
from .source import source_of

Field = NDArray[Any]

WAYS = ("below", "above", "nearest")
_NODATA = 42113
"""Tag of a TIFF file: the number as text."""


def read_nodata(path: str | os.PathLike[str], key: str | None = None, *, follow: bool = False) -> float | None:
    """The value that stands for missing samples in what ``read_field`` has read with that key; None if there is none.

    GeoTIFF has it, and NetCDF; arrays of NetCDF that were unpacked have NaN instead.

    Raises
    ------
    OSError, InputError, MissingExtraError
        As `read_field`.
    """
    source = source_of(path, follow=follow)
    if is_labelled_file(source):
        return None  # they are NaN already
    if source.named(*HDF5_SUFFIXES):
        with dataset(source, key) as stored:
            return None if is_packed(stored) else fill_value(stored)
    if not source.named(*TIFF_SUFFIXES):
        return None
    with reading("TIFF"), opened_tiff(source) as tiff:
        try:
            return float(str(tiff.pages[0].tags[_NODATA].value).strip(" \0"))
        except (KeyError, ValueError):
            return None


def missing_samples(field: Field, nodata: float | None) -> NDArray[np.bool_]:
    """Where a field has NaN or the value ``nodata``, which is rounded to the type of the samples."""
    gone = np.isnan(field) if field.dtype.kind == "f" else np.zeros(field.shape, np.bool_)
    if nodata is None or math.isnan(nodata):
        return gone
    if field.dtype.kind == "f":
        with np.errstate(over="ignore"):
            gone |= field == np.asarray(nodata).astype(field.dtype)
    elif nodata.is_integer() and np.iinfo(field.dtype).min <= nodata <= np.iinfo(field.dtype).max:
        gone |= field == int(nodata)
    return gone


def filled(field: Field, gone: NDArray[np.bool_], way: str, isovalues: Sequence[float]) -> Field:
    """The field with something else where samples are missing.

    Parameters
    ----------
    field : (s0, .., sn-1) array of integers or floats
    gone : likewise, bool
        Which samples are missing.
    way : str
        ``"below"``: the least value there is, or less, so that they lie below all isovalues, ``"above"`` likewise: the
        curve runs around them; ``"nearest"``: the value of the nearest sample that is not missing.
    isovalues : sequence of float

    Returns
    -------
    (s0, .., sn-1) array
        Of the same type.

    Raises
    ------
    InputError
        If all samples are missing, or the type has no value that lies beyond the isovalues.
    MissingExtraError
        If scipy is not installed, for ``"nearest"``.
    """
    if not gone.any():
        return field
    if gone.all():
        raise InputError("all samples are missing", code="missing")
    if way == "nearest":
        ndimage = optional("scipy.ndimage", extra="geo", purpose="filling missing samples")
        nearest = ndimage.distance_transform_edt(gone, return_distances=False, return_indices=True)
        return np.asarray(field[tuple(nearest)])
    there = field[~gone]
    value = min(there.min(), _just(field, min(isovalues), way)) if way == "below" else (
        max(there.max(), _just(field, max(isovalues), way))
    )
    out = field.copy()
    out[gone] = value
    return out


def _just(field: Field, isovalue: float, way: str) -> Any:
    """The value of the field's type next to an isovalue, on the way there."""
    if field.dtype.kind == "f":
        value = field.dtype.type(isovalue)
        return value if way == "below" else np.nextafter(value, field.dtype.type(np.inf))
    whole = math.floor(isovalue) + (way == "above")
    info = np.iinfo(field.dtype)
    if not info.min <= whole <= info.max:
        raise InputError(f"{field.dtype} has no value {way} the isovalue {isovalue:g}", code="missing")
    return field.dtype.type(whole)
