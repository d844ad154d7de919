"""Nibabel reads NIfTI, and images that are in memory."""

from __future__ import annotations

import gzip
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...extras import optional
from ...field.placement import Placement
from .from_rasterio import HEADER, IMAGE
from .opened import Choice, Format
from .place_of_samples import placed_volume
from .reading import channel_of, check_frame, reading
from .source import InputFile, beginning
from .volumes import OpenedVolumes, scaled, single, squeezed

Array = NDArray[Any]
_HEADER = 1 << 26
"""Bytes before the samples of a NIfTI file at most, extensions among them."""
PAIRED = HEADER, IMAGE
"""Suffixes of pairs of files."""
_UNITS = {"sec": "s", "msec": "ms", "usec": "µs"}
"""Units of time, as nibabel calls them and as they are written."""


class OpenedNibabel(OpenedVolumes):
    """A NIfTI file or an image in memory; volumes of a series are read one at a time, integers stay integers."""

    def _open(self, choice: Choice) -> None:
        nibabel = optional("nibabel", extra="nifti", purpose="reading NIfTI")
        with reading("NIfTI volume"):
            self._image = image = _image(self._source, nibabel) if self._given is None else self._given
            stored = self._raw = image.dataobj
            self._colours = stored.dtype.names or ()
            self._channel = channel_of(len(self._colours) or 1, choice.channel)
            kind = stored.dtype[self._channel] if self._colours else stored.dtype
            self._scaling, self._whole = (1.0, 0.0), tuple(map(int, stored.shape))
            if hasattr(stored, "slope"):
                self._scaling = float(stored.slope), float(stored.inter)
                # the file stays open: of a packed one the next volume is then read without unpacking all before it
                spec = (stored.shape, stored.dtype, stored.offset, 1.0, 0.0)
                self._raw = type(stored)(stored.file_like, spec, keep_file_open=True)
            found = scaled(np.zeros(0, kind), *self._scaling)
            if self._given is None and not hasattr(image.header, "get_qform"):
                self.remarks = ("Analyze files do not state left and right: x runs as nibabel takes it",)
            if self._several and hasattr(image.header, "get_xyzt_units"):
                number, unit = image.header.get_zooms()[-1], _UNITS.get(image.header.get_xyzt_units()[1])
                self._step = f"{number:g} {unit}" if unit and math.isfinite(number) and number > 0 else ""
        self.shape, self.dtype = squeezed(self._whole), np.dtype(np.float64) if found is None else found.dtype

    def _values(self, frame: int | None) -> Array:
        stored = self._image.dataobj
        at: Any = ...
        with reading("NIfTI volume"):
            if frame is not None and self._several:
                check_frame(frame, self._whole[3])
                at, frame = (..., frame), None
            elif self._given is None:
                self._source.check_count(math.prod(stored.shape) * (len(self._colours) or 1))
            raw = np.asarray(self._raw[at])
            volume = scaled(raw[self._colours[self._channel]] if self._colours else raw, *self._scaling)
            return single(np.asarray(stored[at]) if volume is None else volume, frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        # without a unit, coordinates are millimetres by custom
        header = self._image.header
        unit = header.get_xyzt_units()[0] if hasattr(header, "get_xyzt_units") else "mm"
        return placed_volume(self._image.affine, self._whole, n, unit="mm" if unit == "unknown" else unit)


def is_nibabel(thing: Any) -> bool:
    """Whether this is an image of nibabel with an affine matrix."""
    return all(hasattr(thing, name) for name in ("affine", "dataobj", "header"))


class _Beginning:
    """The beginning of a file, for a reader that takes as many bytes for extensions as the file states."""

    def __init__(self, file: Any) -> None:
        self._file, self._left = file, _HEADER

    def read(self, count: int) -> bytes:
        if not 0 <= count <= self._left:
            raise InputError(f"states more than {_HEADER >> 20} MiB before its samples", code="unreadable")
        self._left -= count
        return bytes(self._file.read(count))

    def tell(self) -> int:
        return _HEADER - self._left


def _image(source: InputFile, nibabel: Any) -> Any:
    """A NIfTI image whose samples are not read yet; checks that they are there, and that one volume may be read."""
    packed, pair = source.named(".gz"), source.named(*PAIRED)
    samples, path = (source.partner(IMAGE), source.partner(HEADER)) if pair else (source.path, source.path)
    with gzip.open(path) if packed else path.open("rb") as file:
        first = file.read(4)
        file.seek(0)
        # 348 bytes of header are those of version 1, 540 of version 2
        of_two = 540 in (int.from_bytes(first, "little"), int.from_bytes(first, "big"))
        (nibabel.Nifti2Header if of_two else nibabel.Nifti1Header).from_fileobj(_Beginning(file), check=False)
    image = nibabel.load(source.path)
    stored = image.dataobj
    colours = len(stored.dtype.names or ())
    source.check_array((*stored.shape[:3], colours or 1), stored.dtype[0] if colours else stored.dtype)
    if not 0 <= stored.offset <= _HEADER:
        raise InputError(f"states {stored.offset} bytes before its samples", code="unreadable")
    stated = stored.offset + math.prod(stored.shape) * stored.dtype.itemsize
    if packed:
        source.check_deflated(stated)
    else:
        source.check_bytes(stated, samples.stat().st_size)
    return image


def is_pair(path: Path) -> bool:
    """Whether a file is one of a pair of NIfTI or Analyze 7.5, by the first bytes of the header."""
    headers = [each for each in (path.with_suffix(HEADER), path.with_suffix(HEADER.upper())) if each.is_file()]
    first = beginning(headers[0], 4) if headers and path.suffix.lower() in PAIRED else b""
    return 348 in (int.from_bytes(first, "little"), int.from_bytes(first, "big"))


FORMATS = (
    Format(
        "NIfTI", (".nii", ".nii.gz"), OpenedNibabel, extra="nifti", channels=True,
        signatures=((344, b"n+1\0", ".nii"), (4, b"n+2\0", ".nii"), (0, b"\x1f\x8b", ".nii.gz")),
    ),
)
PAIR = replace(FORMATS[0], suffixes=(), signatures=())
