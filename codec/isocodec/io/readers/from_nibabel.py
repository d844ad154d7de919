"""Nibabel reads NIfTI, and images that are in memory."""

from __future__ import annotations

import gzip
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...extras import optional
from ...field.placement import Placement
from .opened import IN_MEMORY, Choice, Format, Opened, numbers
from .place_of_samples import placed_volume
from .reading import check_frame, reading
from .slices import Slices
from .source import InputFile
from .volumes import is_series_of_volumes, scaled, single, squeezed

Array = NDArray[Any]

_HEADER = 1 << 26
"""Bytes before the samples of a NIfTI file, extensions among them."""
_UNITS = {"sec": "s", "msec": "ms", "usec": "µs"}
"""Units of time, as nibabel calls them and as they are written."""


class _Nifti(Opened):
    """A volume of NIfTI or a series of volumes, read one at a time."""

    def _open(self, choice: Choice) -> None:
        with reading("NIfTI volume"):
            image = self._image = _image(self._source)
            stored = self._stored = image.dataobj
            self._scaling = float(stored.slope), float(stored.inter)
            found = scaled(np.zeros(0, stored.dtype), *self._scaling)
        self.shape = squeezed(stored.shape)
        self.dtype = np.dtype(np.float64) if found is None else found.dtype

    def _values(self, frame: int | None) -> Array:
        stored = self._stored
        if frame is not None and is_series_of_volumes(stored.shape):
            return _NiftiVolumes(self._source, self._image)[frame]
        with reading("NIfTI volume"):
            self._source.check_array(stored.shape, stored.dtype)
            volume = scaled(np.asarray(stored.get_unscaled()), *self._scaling)
            return single(np.asarray(stored) if volume is None else volume, frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        return _placed(self._image, n)

    def _series(self) -> Slices | None:
        if not is_series_of_volumes(self._stored.shape):
            return None
        volumes = _NiftiVolumes(self._source, self._image)
        return Slices(
            volumes.shape, 3, lambda number: numbers(volumes[number]), squeezed(volumes.shape[:3]), step=volumes.step
        )


class _NiftiVolumes:
    """The volumes of a NIfTI file of four axes, each read when it is asked for.

    Attributes
    ----------
    shape : tuple of int
        That of the file; its last axis counts the volumes.
    step : str
        Time from one volume to the next, with its unit, if the file states it; else empty.
    """

    def __init__(self, source: InputFile, image: Any) -> None:
        nibabel = optional("nibabel", extra="nifti", purpose="reading NIfTI")
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

    def __getitem__(self, number: int) -> Array:
        """Read one volume."""
        check_frame(number, len(self))
        with reading("NIfTI volume"):
            raw = np.asarray(self._raw[..., number])
            volume = scaled(raw, float(self._stored.slope), float(self._stored.inter))
            return single(np.asarray(self._stored[..., number]) if volume is None else volume, None)


class OpenedNibabel(Opened):
    """An image of nibabel in memory: integers stay integers where they can."""

    def __init__(self, image: Any) -> None:
        self._image = image
        super().__init__(IN_MEMORY, Choice())

    def _open(self, choice: Choice) -> None:
        self.shape, self.dtype = squeezed(self._image.shape), np.dtype(self._image.dataobj.dtype)

    def _values(self, frame: int | None) -> Array:
        stored = self._image.dataobj
        values = None
        with reading("image of nibabel"):
            if hasattr(stored, "get_unscaled"):
                values = scaled(np.asarray(stored.get_unscaled()), float(stored.slope), float(stored.inter))
            return single(np.asarray(stored) if values is None else values, frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        return _placed(self._image, n)

    def _series(self) -> Slices | None:
        shape = tuple(map(int, self._image.shape))
        if not is_series_of_volumes(shape):
            return None
        return Slices(shape, 3, lambda number: numbers(self._values(number)), squeezed(shape[:3]))


def _placed(image: Any, n: int) -> Placement:
    """Placement by the affine matrix of an image; coordinates without a unit are millimetres by custom."""
    unit = image.header.get_xyzt_units()[0] if hasattr(image.header, "get_xyzt_units") else "mm"
    return placed_volume(image.affine, image.shape, n, unit="mm" if unit == "unknown" else unit)


def is_nibabel(thing: Any) -> bool:
    """Whether this is an image of nibabel with an affine matrix."""
    return all(hasattr(thing, name) for name in ("affine", "dataobj", "header"))


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


def _image(source: InputFile) -> Any:
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
    stated = stored.offset + math.prod(stored.shape) * stored.dtype.itemsize
    (source.check_deflated if packed else source.check_bytes)(stated)
    return image


FORMATS = (
    Format(
        "NIfTI", (".nii", ".nii.gz"), _Nifti, extra="nifti",
        signatures=((344, b"n+1\0", ".nii"), (4, b"n+2\0", ".nii"), (0, b"\x1f\x8b", ".nii.gz")),
    ),
)
