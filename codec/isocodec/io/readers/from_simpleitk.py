"""SimpleITK reads NRRD and MetaImage, and images that are in memory; all in coordinates right, front and up."""

from __future__ import annotations

import math
import re
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...extras import optional
from ...field.placement import Placement
from .detached import listed, meta_files, nrrd_files
from .opened import Choice, Format
from .place_of_samples import placed, placed_volume, to_right_front_up
from .reading import channel_of, named, reading
from .source import InputFile
from .volumes import OpenedVolumes, single, squeezed

Array = NDArray[Any]
_NRRD_IO = "NrrdImageIO"
_HEADER = 1 << 16
"""Bytes of a header that are looked at."""
_META, _NRRD = (".mha", ".mhd"), (".nrrd", ".nhdr")


class OpenedItk(OpenedVolumes):
    """An image with axes i, j, k, and a last one of a series: a fourth axis, or a list of components.

    In memory, or in an NRRD or MetaImage; of a segmentation of 3D Slicer all labels, those of a layer, or a segment.
    """

    def _open(self, choice: Choice) -> None:
        self._image: Any = self._given
        self._unit, of_file = "mm", self._given is None
        with reading("volume"):
            if of_file:
                self._image = _header_of(self._source, Path(self.hold(TemporaryDirectory())))
                self._unit = _nrrd_unit(self._source) if self._source.named(*_NRRD) else "mm"
            image = self._image
            known = {name: image.GetMetaData(name) for name in image.GetMetaDataKeys()} if of_file else {}
        self._components = count = (image.GetNumberOfComponents if of_file else image.GetNumberOfComponentsPerPixel)()
        of_list = count > 1 and known.get("NRRD_kinds[pixel]") == "list"
        self._channel = channel_of(count, choice.channel) if (count > 1 and not of_list) or choice.channel else None
        self._whole = (*image.GetSize(), *[count] * of_list)
        self.shape, self.dtype = squeezed(self._whole), _dtype_of(image)
        self._segments, self._segment = {}, None
        for number, each in enumerate(name[:-2] for name in known if re.fullmatch("Segment[0-9]+_ID", name)):
            where = int(known.get(f"{each}Layer", number)), int(known.get(f"{each}LabelValue", 1))
            self._segments[where] = [known[f"{each}ID"], known.get(f"{each}Name", known[f"{each}ID"])]
        if choice.key is not None:
            self._segment = named("segments", self._segments, choice.key)
            self._layers, self._whole = self._whole, self._whole[:3]
            self.shape = squeezed(self._whole)

    @cached_property
    def _array(self) -> Array:
        """All samples with the axes of ``_whole``, and all layers."""
        with reading("volume"):
            image = self._image.Execute() if hasattr(self._image, "Execute") else self._image
            whole: Array = _sitk("volumes").GetArrayFromImage(image).T
        if self._components == 1:
            return whole
        return np.moveaxis(whole, 0, -1) if self._channel is None else whole[self._channel]

    def _values(self, frame: int | None) -> Array:
        if self._segment is not None:
            layer, label = self._segment
            labels = single(self._array, layer if len(self._layers) > 3 else None)
            return np.where(labels == label, labels, 0)
        if frame is None and self._segments and self._several:
            named("segments in layers", self._segments, None)
        return single(self._array, frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        return _of_image(self._image, n, self._unit)


def is_itk(thing: Any) -> bool:
    """Whether this is an image of SimpleITK."""
    return all(hasattr(thing, name) for name in ("GetSpacing", "GetDirection", "GetPixelIDTypeAsString"))


def _sitk(what: str) -> Any:
    return optional("SimpleITK", extra="itk", purpose=f"reading {what}")


def _dtype_of(image: Any) -> np.dtype[Any]:
    """Type of the samples of an image, or of a reader that knows its header; of vectors that of their components."""
    # such as "16-bit signed integer", or "vector of 32-bit float"
    words = _sitk("volumes").GetPixelIDValueAsString(image.GetPixelIDValue()).removeprefix("vector of ")
    bits = words.partition("-bit")[0]
    kind = "f" if "float" in words else "u" if "unsigned" in words else "i"
    return np.dtype(f"{kind}{int(bits) // 8}") if bits.isdigit() else np.dtype(np.void)


def _nrrd_unit(source: InputFile) -> str:
    """Unit of the coordinates of an NRRD, which ITK does not give; without one they are millimetres by custom."""
    with source.path.open("rb") as file:
        found = re.search(r"^space units:(.*)$", file.read(_HEADER).decode("latin-1"), re.M | re.I)
    return " ".join(dict.fromkeys(found[1].replace('"', " ").split())) if found else "mm"


def _of_image(image: Any, n: int, unit: str) -> Placement:
    """Placement by ITK of a volume, or of each of a series, whose x runs to the left and y to the back.

    ITK takes an NRRD that names no space for one of that kind. An image of two axes lies nowhere in a body: x runs
    along the first of its axes.
    """
    size = image.GetDimension()
    directions = (np.reshape(image.GetDirection(), (size, size)) * image.GetSpacing())[:3, :3]
    matrix = np.column_stack([directions, image.GetOrigin()[:3]])
    if size < 3:
        return placed(matrix, n, unit=unit)
    stated = {key: image.GetMetaData(key) for key in image.GetMetaDataKeys()}
    if stated.get("ITK_InputFilterName") == _NRRD_IO and "NRRD_space" not in stated and (matrix == np.eye(3, 4)).all():
        return Placement()  # what ITK has where a file states nothing
    return placed_volume(to_right_front_up(matrix), image.GetSize(), n, unit=unit)


def _header_of(source: InputFile, folder: Path) -> Any:
    """A reader of SimpleITK that has read a file's header, checked against the limits and the bytes that are there."""
    of_meta, path = source.named(*_META), source.path
    stored = (meta_files if of_meta else nrrd_files)(source)
    if not of_meta and (header := listed(source, stored.files)):
        path = folder / "a.nhdr"
        (folder / "samples").symlink_to(stored.files[0].resolve())
        path.write_bytes(header)
    reader = _sitk(source.path.suffix).ImageFileReader()
    # left to itself it tries all formats that it knows, and some of these name files, too
    reader.SetImageIO("MetaImageIO" if of_meta else _NRRD_IO)
    reader.SetFileName(str(path))
    reader.ReadImageInformation()
    count = source.check_count(math.prod(reader.GetSize()) * reader.GetNumberOfComponents())
    stored.check(source, count * _dtype_of(reader).itemsize)
    return reader


FORMATS = (
    Format("NRRD", _NRRD, OpenedItk, "itk", ((0, b"NRRD", ".nrrd"),), keyed=True, channels=True, confined="SimpleITK"),
    Format(
        "MetaImage", _META, OpenedItk, "itk", ((0, b"ObjectType", ".mha"), (0, b"NDims", ".mha")), channels=True,
        confined="SimpleITK",
    ),
)
