"""Volumes: NIfTI, and what ITK reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .extras import optional
from .reading import check_frame, reading

Field = NDArray[Any]

ITK_SUFFIXES = (".nrrd", ".nhdr", ".mha", ".mhd")


def _scaled(raw: Field, slope: float, inter: float) -> Field | None:
    """Samples that need no floats: those of a volume without scaling, or integers by whole numbers; else None."""
    if (slope, inter) == (1.0, 0.0):
        return raw
    if raw.dtype.kind not in "iu" or not (slope.is_integer() and inter.is_integer()):
        return None
    info = np.iinfo(raw.dtype)
    ends = [int(end) * int(slope) + int(inter) for end in (info.min, info.max)]
    for kind in ("int32", "int64"):
        if np.iinfo(kind).min <= min(*ends, int(slope)) and max(*ends, int(slope)) <= np.iinfo(kind).max:
            scaled: Field = raw.astype(kind)
            scaled *= int(slope)
            scaled += int(inter)
            return scaled
    return None


def read_nifti(path: Path, frame: int | None) -> Field:
    nibabel = optional("nibabel", extra="nifti", purpose="reading NIfTI")
    with reading("NIfTI volume"):
        stored = nibabel.load(path).dataobj
        volume = _scaled(np.asarray(stored.get_unscaled()), float(stored.slope), float(stored.inter))
        if volume is None:
            volume = np.asarray(stored)
    return _single(volume, frame)


def _single(volume: Field, frame: int | None) -> Field:
    """Headers have at least three axes; a picture, or one volume of a series, ends in axes of length 1."""
    volume = _without_ones(volume)
    if frame is not None:
        check_frame(frame, volume.shape[-1] if volume.ndim > 3 else 0)
        volume = _without_ones(volume[..., frame])
    if volume.ndim > 3:
        raise InputError(
            f"holds a series of volumes, of shape {volume.shape}", code="shape",
            remedy=f"take one with --frame 0 to {volume.shape[-1] - 1}",
        )  # fmt: skip
    return volume


def _without_ones(volume: Field) -> Field:
    while volume.ndim > 2 and volume.shape[-1] == 1:
        volume = volume[..., 0]
    return volume


def itk_reader(path: Path) -> Any:
    """A reader of SimpleITK that knows a file's header; `reading` has to be around its use."""
    sitk = optional("SimpleITK", extra="itk", purpose=f"reading {path.suffix}")
    sitk.ProcessObject.SetGlobalWarningDisplay(False)
    reader = sitk.ImageFileReader()
    reader.SetFileName(str(path))
    reader.ReadImageInformation()
    return reader


def read_itk(path: Path, frame: int | None) -> Field:
    """NRRD and MetaImage: axes i, j, k as NIfTI has them."""
    sitk = optional("SimpleITK", extra="itk", purpose=f"reading {path.suffix}")
    with reading(f"{path.suffix} volume"):
        reader = itk_reader(path)
        channels = reader.GetNumberOfComponents()
        if channels > 1:
            raise InputError(f"is a volume of {channels} channels", code="colour", remedy="save one of them alone")
        return _single(sitk.GetArrayFromImage(reader.Execute()).T, frame)
