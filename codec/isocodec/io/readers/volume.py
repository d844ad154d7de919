"""Volumes: NIfTI, and what ITK reads."""

from __future__ import annotations

import gzip
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...extras import optional
from .detached import meta_files, nrrd_files
from .reading import check_frame, reading
from .source import Source

Field = NDArray[Any]

NIFTI_SUFFIXES = (".nii", ".nii.gz")
ITK_SUFFIXES = (".nrrd", ".nhdr", ".mha", ".mhd")

_HEADER = 1 << 26
"""Bytes before the samples of a NIfTI file, extensions among them."""
_UNITS = {"sec": "s", "msec": "ms", "usec": "µs"}
"""Units of time, as nibabel calls them and as they are written."""


class _Beginning:
    """The beginning of a file, for a reader that would take any number of bytes that the file states."""

    def __init__(self, file: Any) -> None:
        self._file = file
        self._left = _HEADER

    def read(self, count: int) -> bytes:
        if not 0 <= count <= self._left:
            raise InputError(f"states more than {_HEADER >> 20} MiB before its samples", code="unreadable")
        self._left -= count
        return bytes(self._file.read(count))

    def tell(self) -> int:
        return _HEADER - self._left


def open_nifti(source: Source) -> Any:
    """A NIfTI image as nibabel has it, its samples not read yet but known to be there; within `reading`.

    Each volume of a series is known to be allowed, not all of them together.
    """
    nibabel = optional("nibabel", extra="nifti", purpose="reading NIfTI")
    packed = source.named(".gz")
    with gzip.open(source.path) if packed else source.path.open("rb") as file:
        first = file.read(4)
        file.seek(0)
        # 348 bytes of header are those of version 1, 540 of version 2
        of_two = 540 in (int.from_bytes(first, "little"), int.from_bytes(first, "big"))
        kind = nibabel.Nifti2Header if of_two else nibabel.Nifti1Header
        kind.from_fileobj(_Beginning(file), check=False)
    image = nibabel.load(source.path)
    stored = image.dataobj
    source.check_array(stored.shape[:3], stored.dtype)
    if not 0 <= stored.offset <= _HEADER:
        raise InputError(f"states {stored.offset} bytes before its samples", code="unreadable")
    if not packed:
        source.check_bytes(stored.offset + math.prod(stored.shape) * stored.dtype.itemsize)
    return image


class NiftiVolumes:
    """The volumes of a NIfTI file with four axes, each read when it is asked for.

    Attributes
    ----------
    shape : tuple of int
        That of the file; its last axis counts the volumes.
    step : str
        Time from one volume to the next, with its unit, if the file says so; else empty.
    """

    def __init__(self, source: Source) -> None:
        nibabel = optional("nibabel", extra="nifti", purpose="reading NIfTI")
        image = open_nifti(source)
        stored = self._stored = image.dataobj
        self.shape: tuple[int, ...] = tuple(map(int, stored.shape))
        # the file stays open: of a packed one the next volume is then read without unpacking those before it again
        spec = (stored.shape, stored.dtype, stored.offset, 1.0, 0.0)
        self._raw = nibabel.arrayproxy.ArrayProxy(str(source.path), spec, keep_file_open=True)
        number, unit = image.header.get_zooms()[-1], image.header.get_xyzt_units()[1]
        known = unit in _UNITS and math.isfinite(number) and number > 0
        self.step = f"{number:g} {_UNITS[unit]}" if known else ""

    def __len__(self) -> int:
        return self.shape[-1]

    def __getitem__(self, number: int) -> Field:
        """One volume, as `read_nifti` has it."""
        check_frame(number, len(self))
        with reading("NIfTI volume"):
            raw = np.asarray(self._raw[..., number])
            volume = scaled(raw, float(self._stored.slope), float(self._stored.inter))
            return single(np.asarray(self._stored[..., number]) if volume is None else volume, None)


def scaled(raw: Field, slope: float, inter: float) -> Field | None:
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


def read_nifti(source: Source, frame: int | None) -> Field:
    with reading("NIfTI volume"):
        stored = open_nifti(source).dataobj
        if frame is not None and is_series_of_volumes(stored.shape):
            return NiftiVolumes(source)[frame]
        source.check_array(stored.shape, stored.dtype)
        volume = scaled(np.asarray(stored.get_unscaled()), float(stored.slope), float(stored.inter))
        if volume is None:
            volume = np.asarray(stored)
    return single(volume, frame)


def single(volume: Field, frame: int | None) -> Field:
    """Headers have at least three axes; a picture, or one volume of a series, ends in axes of length 1."""
    volume = _without_ones(volume)
    if frame is not None:
        check_frame(frame, volume.shape[-1] if volume.ndim > 3 else 0)
        volume = _without_ones(volume[..., frame])
    if volume.ndim > 3:
        raise InputError(
            f"holds a series of volumes, of shape {volume.shape}", code="shape",
            remedy=f"take one with --frame 0 to {volume.shape[-1] - 1}",
        )
    return volume


def is_series_of_volumes(shape: Sequence[int]) -> bool:
    """Whether the axes of a volume file count volumes, too, by the fourth and last of them."""
    return len(shape) == 4 and shape[3] > 1


def _without_ones(volume: Field) -> Field:
    while volume.ndim > 2 and volume.shape[-1] == 1:
        volume = volume[..., 0]
    return volume


def itk_reader(source: Source) -> Any:
    """A reader of SimpleITK that knows a file's header, its samples known to be allowed; within `reading`."""
    sitk = optional("SimpleITK", extra="itk", purpose=f"reading {source.path.suffix}")
    of_meta = source.named(".mha", ".mhd")
    files, plainly = (meta_files if of_meta else nrrd_files)(source)
    reader = sitk.ImageFileReader()
    # left to itself it tries all formats that it knows, and some of these name files, too
    reader.SetImageIO("MetaImageIO" if of_meta else "NrrdImageIO")
    reader.SetFileName(str(source.path))
    reader.ReadImageInformation()
    count = source.check_count(math.prod(reader.GetSize()) * reader.GetNumberOfComponents())
    # such as "16-bit signed integer", or "vector of 32-bit float"
    bits = sitk.GetPixelIDValueAsString(reader.GetPixelIDValue()).partition("-bit")[0].split()[-1]
    if plainly and bits.isdigit():
        source.check_bytes(count * int(bits) // 8, sum(path.stat().st_size for path in files))
    return reader


def read_itk(source: Source, frame: int | None) -> Field:
    """NRRD and MetaImage: axes i, j, k as NIfTI has them."""
    with reading(f"{source.path.suffix} volume"):
        return single(itk_array(source), frame)


def itk_array(source: Source) -> Field:
    """All axes of NRRD and MetaImage, the last one that of a series if there are four; within `reading`."""
    sitk = optional("SimpleITK", extra="itk", purpose=f"reading {source.path.suffix}")
    reader = itk_reader(source)
    channels = reader.GetNumberOfComponents()
    if channels > 1:
        raise InputError(f"is a volume of {channels} channels", code="colour", remedy="save one of them alone")
    found: Field = sitk.GetArrayFromImage(reader.Execute()).T
    return found
