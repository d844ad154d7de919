"""SimpleITK reads NRRD and MetaImage, and images that are in memory; all in coordinates right, front and up."""

from __future__ import annotations

import math
import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...extras import optional
from ...field.placement import Placement
from .detached import listed, meta_files, nrrd_files
from .opened import IN_MEMORY, Choice, Format, Opened, numbers
from .place_of_samples import placed, placed_volume, to_right_front_up
from .reading import channel_of, named, reading
from .slices import Slices
from .source import InputFile
from .volumes import is_series_of_volumes, single, squeezed

Array = NDArray[Any]
_NRRD_IO = "NrrdImageIO"
_HEADER = 1 << 16
"""Bytes of a header that are looked at."""
_META, _NRRD = (".mha", ".mhd"), (".nrrd", ".nhdr")


class _OfItk(Opened):
    """An image with axes i, j, k, and a last one of a series: a fourth axis, or a list of components."""

    _image: Any
    _segment: tuple[int, int] | None = None
    _unit = "mm"

    def _describe(self, channel: int | None, of_list: bool) -> None:
        """Take shape and type of an image, whose components are a series or channels."""
        pixel = self._image.GetPixelIDValue()
        several = getattr(self._image, "GetNumberOfComponentsPerPixel", None) or self._image.GetNumberOfComponents
        self._components = count = several()
        self._channel = channel_of(count, channel) if (count > 1 and not of_list) or channel else None
        self._shape = (*self._image.GetSize(), *((count,) if of_list and count > 1 else ()))
        self.shape, self.dtype = squeezed(self._shape), _dtype_of(pixel)

    def _whole(self) -> Array:
        with reading("volume"):
            image = self._image.Execute() if hasattr(self._image, "Execute") else self._image
            whole: Array = _sitk("volumes").GetArrayFromImage(image).T
        if self._channel is not None and self._components > 1:
            return whole[self._channel]
        return np.moveaxis(whole, 0, -1) if self._components > 1 else whole

    def _values(self, frame: int | None) -> Array:
        whole = self._whole()
        if self._segment is None:
            return single(whole, frame)
        layer, label = self._segment
        return np.where((whole := single(whole, layer if len(self._shape) > 3 else None)) == label, whole, 0)

    def _place(self, n: int, frame: int | None) -> Placement:
        return _of_image(self._image, n, self._unit)

    def _series(self) -> Slices | None:
        if not is_series_of_volumes(self._shape) or self._segment is not None:
            return None
        whole = self._whole()
        return Slices(whole.shape, 3, lambda number: numbers(single(whole, number)), squeezed(whole.shape[:3]))


class _Volume(_OfItk):
    """NRRD or MetaImage; of a segmentation of 3D Slicer all labels, those of a layer, or a segment."""

    def _open(self, choice: Choice) -> None:
        with reading("volume"):
            self._image = _header_of(self._source, Path(self.hold(TemporaryDirectory())))
            known = {name: self._image.GetMetaData(name) for name in self._image.GetMetaDataKeys()}
            if self._source.named(*_NRRD):
                self._unit = _nrrd_unit(self._source)
            self._describe(choice.channel, known.get("NRRD_kinds[pixel]") == "list")
            self._segments = {}
            for number, each in enumerate(name[:-2] for name in known if re.fullmatch("Segment[0-9]+_ID", name)):
                where = int(known.get(f"{each}Layer", number)), int(known.get(f"{each}LabelValue", 1))
                self._segments[where] = [known[f"{each}ID"], known.get(f"{each}Name", known[f"{each}ID"])]
        if choice.key is not None:
            self._segment, self.shape = named("segments", self._segments, choice.key), self.shape[:3]

    def _values(self, frame: int | None) -> Array:
        if frame is None and self._segment is None and self._segments and is_series_of_volumes(self._shape):
            named("segments in layers", self._segments, None)
        return super()._values(frame)


class OpenedItk(_OfItk):
    """An image of SimpleITK in memory."""

    def __init__(self, image: Any) -> None:
        self._image = image
        super().__init__(IN_MEMORY, Choice())

    def _open(self, choice: Choice) -> None:
        self._describe(None, False)


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


def _nrrd_unit(source: InputFile) -> str:
    """Unit of the coordinates of an NRRD, which ITK does not give; without one they are millimetres by custom."""
    with source.path.open("rb") as file:
        found = re.search(r"^space units:(.*)$", file.read(_HEADER).decode("latin-1"), re.M | re.I)
    return " ".join(dict.fromkeys(found[1].replace('"', " ").split())) if found else "mm"


def _of_image(reader: Any, n: int, unit: str) -> Placement:
    """Placement by ITK of a volume, or of each of a series, whose x runs to the left and y to the back.

    ITK takes an NRRD that names no space for one of that kind. An image of two axes lies nowhere in a body: x runs
    along the first of its axes.
    """
    size = reader.GetDimension()
    directions = (np.reshape(reader.GetDirection(), (size, size)) * reader.GetSpacing())[:3, :3]
    matrix = np.column_stack([directions, reader.GetOrigin()[:3]])
    if size < 3:
        return placed(matrix, n, unit=unit)
    stated = {key: reader.GetMetaData(key) for key in reader.GetMetaDataKeys()}
    if stated.get("ITK_InputFilterName") == _NRRD_IO and "NRRD_space" not in stated and (matrix == np.eye(3, 4)).all():
        return Placement()  # what ITK has where a file states nothing
    return placed_volume(to_right_front_up(matrix), reader.GetSize(), n, unit=unit)


def _header_of(source: InputFile, folder: Path) -> Any:
    """A reader of SimpleITK that knows a file's header, its samples known to be allowed; within `reading`."""
    sitk, of_meta, path = _sitk(source.path.suffix), source.named(*_META), source.path
    stored = (meta_files if of_meta else nrrd_files)(source)
    if not of_meta and (header := listed(source, stored.files)):
        path = folder / "a.nhdr"
        (folder / "samples").symlink_to(stored.files[0].resolve())
        path.write_bytes(header)
    reader = sitk.ImageFileReader()
    # left to itself it tries all formats that it knows, and some of these name files, too
    reader.SetImageIO("MetaImageIO" if of_meta else _NRRD_IO)
    reader.SetFileName(str(path))
    reader.ReadImageInformation()
    count = source.check_count(math.prod(reader.GetSize()) * reader.GetNumberOfComponents())
    # such as "16-bit signed integer", or "vector of 32-bit float"
    bits = sitk.GetPixelIDValueAsString(reader.GetPixelIDValue()).partition("-bit")[0].split()[-1]
    if bits.isdigit():
        stored.check(source, count * int(bits) // 8)
    return reader


FORMATS = (
    Format("NRRD", _NRRD, _Volume, "itk", ((0, b"NRRD", ".nrrd"),), keyed=True, channels=True, confined="SimpleITK"),
    Format(
        "MetaImage", _META, _Volume, "itk", ((0, b"ObjectType", ".mha"), (0, b"NDims", ".mha")), channels=True,
        confined="SimpleITK",
    ),
)
