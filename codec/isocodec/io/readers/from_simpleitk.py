"""SimpleITK reads NRRD, MetaImage and DICOM, and images that are in memory; all in coordinates right, front and up."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, plain
from ...extras import optional
from ...field.placement import Placement
from .detached import meta_files, nrrd_files
from .opened import IN_MEMORY, Choice, Format, Opened, numbers
from .place_of_samples import EVEN, SLICE, placed, to_right_front_up
from .reading import reading
from .slices import Slices
from .source import InputFile, is_dicom
from .volumes import is_series_of_volumes, single, squeezed

Array = NDArray[Any]
_META, _NRRD = (".mha", ".mhd"), (".nrrd", ".nhdr")
_LISTED = 20


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


class _Dicom(Opened):
    """A series of slices of DICOM in a folder, or one file, rescaled as they state; axes i, j, k."""

    def _open(self, choice: Choice) -> None:
        with reading("DICOM"):
            self._names, self._size, self._matrix = _dicom_series(self._source, choice.key)
            sitk = _sitk("DICOM")
            first = sitk.ImageFileReader()
            first.SetImageIO("GDCMImageIO")
            first.SetFileName(self._names[0])
            first.ReadImageInformation()
            self.dtype = _dtype_of(first.GetPixelIDValue())
        self.shape = squeezed(self._size)

    def _values(self, frame: int | None) -> Array:
        with reading("DICOM"):
            sitk, names = _sitk("DICOM"), self._names
            reader = sitk.ImageSeriesReader() if len(names) > 1 else sitk.ImageFileReader()
            reader.SetImageIO("GDCMImageIO")
            reader.SetFileNames(names) if len(names) > 1 else reader.SetFileName(names[0])
            image = reader.Execute()
            if image.GetNumberOfComponentsPerPixel() > 1:
                raise InputError("is a picture in colours", code="colour", remedy="save one of its channels alone")
            values = sitk.GetArrayFromImage(image).T
            if values.size != math.prod(self._size):
                raise InputError("holds slices of different sizes", code="shape")
            return single(values, frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        return placed(to_right_front_up(self._matrix), n) if n == 3 else Placement(remark=SLICE)


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


def is_dicom_series(path: Path) -> bool:
    """Whether a folder holds files of DICOM."""
    return path.is_dir() and any(map(is_dicom, sorted(path.iterdir())))


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
    stored = (meta_files if of_meta else nrrd_files)(source)
    reader = sitk.ImageFileReader()
    # left to itself it tries all formats that it knows, and some of these name files, too
    reader.SetImageIO("MetaImageIO" if of_meta else "NrrdImageIO")
    reader.SetFileName(str(source.path))
    reader.ReadImageInformation()
    count = source.check_count(math.prod(reader.GetSize()) * reader.GetNumberOfComponents())
    # such as "16-bit signed integer", or "vector of 32-bit float"
    bits = sitk.GetPixelIDValueAsString(reader.GetPixelIDValue()).partition("-bit")[0].split()[-1]
    if bits.isdigit():
        stored.check(source, count * int(bits) // 8)
    return reader


def _dicom_series(source: InputFile, key: str | None) -> tuple[list[str], tuple[int, ...], NDArray[np.float64]]:
    """Files in the order of their slices, the size of all, and the matrix in ITK's coordinates."""
    sitk = _sitk("DICOM")
    names = [str(source.path)]
    if source.path.is_dir():
        found = sitk.ImageSeriesReader.GetGDCMSeriesIDs(str(source.path))
        if key is None and len(found) > 1:
            listed = ", ".join(plain(name) for name in found[:_LISTED])
            raise InputError(f"holds {len(found)} series: {listed}", code="key", remedy="choose one with --key")
        if key is not None and key not in found:
            raise InputError(f"holds no series '{plain(key)}'", code="key")
        names = [*sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(source.path), key or found[0])]
        for name in names:
            if not source.follow and Path(name).resolve().parent != source.path.resolve():
                raise source.refused(Path(name).name, "which links to another folder")
    corners, first = [], None
    for name in names:
        reader = sitk.ImageFileReader()
        reader.SetImageIO("GDCMImageIO")
        reader.SetFileName(name)
        reader.ReadImageInformation()
        size, about = reader.GetSize(), (reader.GetSpacing(), reader.GetDirection())
        source.check_count(math.prod(size) * len(names) * reader.GetNumberOfComponents())
        first = first or (size, about)
        if first[0] != size or not np.allclose(np.concatenate(first[1]), np.concatenate(about), rtol=0, atol=1e-4):
            raise InputError("holds slices of different sizes or directions", code="shape",
                             remedy="keep those of one series in a folder")
        corners.append(np.array(reader.GetOrigin()[:3]))
    assert first is not None
    size, (spacing, direction) = first
    matrix = np.zeros((3, 4))
    n = len(size)
    matrix[:, :n] = (np.reshape(direction, (n, n)) * spacing)[:3, :3] if n == 3 else np.eye(3)[:, :n] * spacing
    matrix[:, 3] = np.pad(corners[0], (0, 3 - len(corners[0])))
    if len(names) > 1:
        if size[-1] > 1 and n > 2:
            raise InputError("holds several volumes", code="shape", remedy="read one of its files")
        steps = np.diff(corners, axis=0)
        step = (corners[-1] - corners[0]) / (len(corners) - 1)
        length = float(np.linalg.norm(step))
        uneven = np.flatnonzero(np.linalg.norm(steps - step, axis=1) > EVEN * length)
        if length == 0 or len(uneven):
            where = int(uneven[0]) if len(uneven) else 0
            raise InputError(
                f"holds slices at uneven steps: {np.linalg.norm(steps[where]):g} mm behind slice {where}, "
                f"{length:g} in the mean", code="slices", remedy="are some of them missing?",
            )
        matrix[:, 2] = step
        size = (*size[:2], len(names))
    return names, tuple(size), matrix


FORMATS = (
    Format("NRRD", _NRRD, _Volume, extra="itk", signatures=((0, b"NRRD", ".nrrd"),), confined="SimpleITK"),
    Format(
        "MetaImage", _META, _Volume, extra="itk", confined="SimpleITK",
        signatures=((0, b"ObjectType", ".mha"), (0, b"NDims", ".mha")),
    ),
    Format("DICOM", (".dcm",), _Dicom, extra="itk", signatures=((128, b"DICM", ".dcm"),), keyed=True),
)
DICOM_FOLDER = Format("DICOM", (), _Dicom, extra="itk", keyed=True, folder=True)
