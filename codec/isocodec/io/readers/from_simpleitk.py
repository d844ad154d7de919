"""SimpleITK reads NRRD and MetaImage, and images that are in memory; all in coordinates right, front and up."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...extras import optional
from ...field.placement import Placement
from .detached import meta_files, nrrd_files
from .opened import IN_MEMORY, Choice, Format, Opened, numbers
from .place_of_samples import SLICE, placed, to_right_front_up
from .reading import reading
from .slices import Slices
from .source import InputFile
from .volumes import is_series_of_volumes, single, squeezed

Array = NDArray[Any]
_META, _NRRD = (".mha", ".mhd"), (".nrrd", ".nhdr")


class _Volume(Opened):
    """NRRD or MetaImage: axes i, j, k, and a last one of a series if there are four."""

    def _open(self, choice: Choice) -> None:
        with reading("volume"):
            self._reader = _header_of(self._source)
            channels = self._reader.GetNumberOfComponents()
            if channels > 1:
                raise InputError(f"is a volume of {channels} channels", code="colour", remedy="save one of them alone")
            self.shape = squeezed(self._reader.GetSize())
            self.dtype = _dtype_of(self._reader.GetPixelIDValue())

    def _whole(self) -> Array:
        found: Array = _sitk("volumes").GetArrayFromImage(self._reader.Execute()).T
        return found

    def _values(self, frame: int | None) -> Array:
        with reading(f"{self._source.path.suffix} volume"):
            return single(self._whole(), frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        return _of_image(self._reader, n)

    def _series(self) -> Slices | None:
        with reading("volume"):
            return _volumes(self._whole()) if is_series_of_volumes(self._reader.GetSize()) else None


class OpenedItk(Opened):
    """An image of SimpleITK in memory."""

    def __init__(self, image: Any) -> None:
        self._image = image
        super().__init__(IN_MEMORY, Choice())

    def _open(self, choice: Choice) -> None:
        self.shape, self.dtype = squeezed(self._image.GetSize()), _dtype_of(self._image.GetPixelIDValue())

    def _values(self, frame: int | None) -> Array:
        with reading("image of SimpleITK"):
            return single(_sitk("an image of SimpleITK").GetArrayFromImage(self._image).T, frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        return _of_image(self._image, n)

    def _series(self) -> Slices | None:
        if not is_series_of_volumes(self._image.GetSize()):
            return None
        with reading("image of SimpleITK"):
            return _volumes(_sitk("an image of SimpleITK").GetArrayFromImage(self._image).T)


def is_itk(thing: Any) -> bool:
    """Whether this is an image of SimpleITK."""
    return all(hasattr(thing, name) for name in ("GetSpacing", "GetDirection", "GetPixelIDTypeAsString"))


def _sitk(what: str) -> Any:
    return optional("SimpleITK", extra="itk", purpose=f"reading {what}")


def _dtype_of(pixels: int) -> np.dtype[Any]:
    """Type of samples by the number that SimpleITK has for it, of vectors that of their components."""
    # such as "16-bit signed integer", or "vector of 32-bit float"
    words = _sitk("volumes").GetPixelIDValueAsString(pixels).removeprefix("vector of ")
    bits = words.partition("-bit")[0]
    kind = "f" if "float" in words else "u" if "unsigned" in words else "i"
    return np.dtype(f"{kind}{int(bits) // 8}") if bits.isdigit() else np.dtype(np.void)


def _volumes(whole: Array) -> Slices:
    return Slices(whole.shape, 3, lambda number: numbers(single(whole, number)), squeezed(whole.shape[:3]))


def _of_image(reader: Any, n: int) -> Placement:
    """Placement by ITK of a volume, or of each of a series, whose x runs to the left and y to the back."""
    size = reader.GetDimension()
    if n != 3 or size < 3:
        return Placement(remark=SLICE)
    directions = (np.reshape(reader.GetDirection(), (size, size)) * reader.GetSpacing())[:3, :3]
    matrix = np.column_stack([directions, reader.GetOrigin()[:3]])
    if np.array_equal(matrix, np.eye(3, 4)):  # what ITK has where a file states nothing
        return Placement()
    return placed(to_right_front_up(matrix), n)


def _header_of(source: InputFile) -> Any:
    """A reader of SimpleITK that knows a file's header, its samples known to be allowed; within `reading`."""
    sitk = optional("SimpleITK", extra="itk", purpose=f"reading {source.path.suffix}")
    of_meta = source.named(*_META)
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


FORMATS = (
    Format("NRRD", _NRRD, _Volume, extra="itk", signatures=((0, b"NRRD", ".nrrd"),)),
    Format("MetaImage", _META, _Volume, extra="itk", signatures=((0, b"ObjectType", ".mha"), (0, b"NDims", ".mha"))),
)
