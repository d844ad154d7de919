"""Tifffile knows stacks of TIFF, and the sizes of pixels that microscopes write; GDAL unpacks them."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, plain
from ...extras import optional
from ...field.placement import Placement
from .from_rasterio import TIFF, Raster, RasterWindows
from .opened import Choice, Format, Opened
from .place_of_samples import in_steps
from .reading import channel_of, pick_frame, reading
from .source import InputFile

_ORIENTATION, _NODATA, _DEFLATE = 274, 42113, (8, 32946)
_GEOGRAPHY = (33550, 33922, 34264)
"""Tags of scale, tie points and transformation."""


def _tiff(source: InputFile, choice: Choice) -> Opened:
    """Open a stack, or else a raster or picture."""
    if source.virtual:
        return Raster(source, choice)
    with reading("TIFF"), _opened(source) as tiff:
        page = tiff.pages[0]
        parts = [part for part in zip(page.dataoffsets, page.databytecounts, strict=True) if part[1]]
        # a tile is unpacked as a whole, however small the picture
        source.check_count(math.prod(page.chunks))
        source.check_bytes(max(map(sum, parts), default=0))
        if not parts:
            raise InputError("states a size, but holds no samples", code="unreadable")
        for each in tiff.pages if choice.bbox is None else []:
            _check_deflated(each)
        turn = page.tags.valueof(_ORIENTATION)
        several = len(tiff.pages) == 1 and math.prod(tiff.series[0].shape) != math.prod(page.shape)
        if choice.key is None and (tiff.is_ome or tiff.is_imagej or several):
            return _Stack(source, choice)
    raster = Raster(source, choice)
    if choice.key is not None or not raster.pages:
        return raster.turned(turn)
    with raster:
        return _Stack(source, choice)


def _check_deflated(page: Any) -> None:
    """Check parts that Deflate packs: GDAL stops at the last sample, before the checksum."""
    if page.compression not in _DEFLATE:
        return
    most = math.prod(page.chunks) * page.dtype.itemsize
    for start, count in zip(page.dataoffsets, page.databytecounts, strict=True):
        page.parent.filehandle.seek(start)
        if len(zlib.decompressobj().decompress(page.parent.filehandle.read(count), most + 1) if count else b"") > most:
            raise InputError("holds packed samples that unpack to more than its header states", code="unreadable")


class _Stack(Opened):
    """The stack of a TIFF file, or one of its channels."""

    def _open(self, choice: Choice) -> None:
        with reading("TIFF"):
            self._tiff = self.hold(_opened(self._source))
            self._tags, every = self._tiff.pages[0].tags, self._tiff.series
            if len(every) != 1:
                shapes = ", ".join(str(each.shape) for each in every[:20])
                raise InputError(
                    f"holds {len(every)} pictures of different kinds: {shapes}", code="series",
                    remedy="choose a page with --key, counted from 1",
                )
            (self._stack,) = every
            if every[0].keyframe.photometric == 3 and not choice.labels:
                raise InputError("holds indices of a palette, not samples", code="palette",
                                 remedy="--label (labels= in Python) takes them as labels; or save it as grey")
            self._source.check_array(every[0].shape, every[0].dtype)
            axes = str(every[0].axes)
            try:
                self.nodata = float(str(self._tags[_NODATA].value).strip(" \0"))
            except (KeyError, ValueError):
                self.nodata = None
        colour = next((axes.index(letter) for letter in "SC" if letter in axes), None)
        self._colour, self._inner = colour, "S" in axes
        self._channel = channel_of(1 if colour is None else every[0].shape[colour], choice.channel)
        self.shape = tuple(count for axis, count in enumerate(every[0].shape) if axis != colour)
        self.dtype = np.dtype(np.uint8 if every[0].dtype.kind == "b" else every[0].dtype)

    def _values(self, frame: int | None) -> NDArray[Any]:
        series = self._stack
        with reading("TIFF"):
            if series.dataoffset is not None:
                self._source.check_bytes(series.dataoffset + math.prod(series.shape) * self.dtype.itemsize)
                picture = np.asarray(series.asarray())
            else:
                picture = np.stack([self._page(page) for page in series.pages]).astype(self.dtype, casting="same_kind")
                picture = picture.reshape(self.shape if self._inner else series.shape)
        if self._colour is not None and picture.ndim > len(self.shape):
            picture = np.take(picture, self._channel, axis=self._colour)
        return pick_frame(picture, frame)

    def _page(self, page: Any) -> NDArray[Any]:
        if page is None:
            raise InputError("lacks some of the pages that it states", code="unreadable")
        source = replace(self._source, path=Path(page.parent.filehandle.path))
        choice = Choice(str(page.index + 1), self._channel if self._inner else 0)
        with closing(RasterWindows(source, ("GTiff",), choice)) as band:
            return np.asarray(band[:, :].data)

    def _place(self, n: int, frame: int | None) -> Placement:
        with reading("TIFF"):
            if any(tag in self._tags for tag in _GEOGRAPHY):
                return Placement(remark="the coordinates of a stack of pages are ignored; take a page with --key")
            return _of_microscope(self._tiff, n)


@contextmanager
def _opened(source: InputFile) -> Iterator[Any]:
    """A TIFF as tifffile has it, which may go on in files beside it, and elsewhere if these are to be followed."""
    tifffile = optional("tifffile", extra="raster", purpose=f"reading {source.path.suffix}")
    # the index of an NDTiff is another file, which names further ones
    whole = {} if source.follow else {"is_ndtiff": False}
    with tifffile.TiffFile(source.path, **whole) as tiff:
        if tiff.pages and tiff.ome_metadata:
            _check_companions(source, tiff.ome_metadata)
        yield tiff


def _check_companions(source: InputFile, notes: str) -> None:
    """Check that the files of an OME series are those that may be read."""
    try:
        elements = [*ElementTree.fromstring(notes).iter()]
    except ElementTree.ParseError:  # nor does tifffile know more of it then
        return
    names = dict.fromkeys(e.attrib["FileName"] for e in elements if "FileName" in e.attrib)
    for name in names:
        if name.lower() != source.path.name.lower():
            source.beside(name)


def _of_microscope(tiff: Any, n: int) -> Placement:
    """Sizes of pixels or voxels, as OME and ImageJ have them; these may be damaged in any way."""
    try:
        sizes, unit = _ome_sizes(tiff.ome_metadata) if tiff.ome_metadata else _imagej_sizes(tiff)
    except Exception:
        return Placement()
    if not sizes:
        return Placement()
    series = tiff.series[0]
    letters = [a for a, count in zip(series.axes, series.shape, strict=True) if count > 1 and a not in "SC"][-n:]
    if letters != [*"ZYX"[-n:]] or not set(letters) <= sizes.keys():
        axes = f"its axes are {plain(', '.join(letters))}, and {', '.join(sizes)} have sizes"
        return Placement(remark=f"the sizes of its pixels are ignored: {axes}; set them with --spacing")
    return in_steps([(sizes[letter], 0.0) for letter in letters], unit)


def _ome_sizes(text: str) -> tuple[dict[str, float], str | None]:
    pixels = next(e for e in ElementTree.fromstring(text).iter() if e.tag.endswith("Pixels"))
    sizes = {a: float(pixels.attrib[f"PhysicalSize{a}"]) for a in "XYZ" if f"PhysicalSize{a}" in pixels.attrib}
    units = {pixels.get(f"PhysicalSize{a}Unit", "µm") for a in sizes}
    return (sizes, units.pop()) if len(units) == 1 else ({}, None)


def _imagej_sizes(tiff: Any) -> tuple[dict[str, float], str | None]:
    notes, tags = tiff.imagej_metadata or {}, tiff.pages[0].tags
    unit = notes.get("unit") or None
    if unit in (None, "pixel") and "spacing" not in notes:
        return {}, None
    resolutions = {a: tags[f"{a}Resolution"].value for a in "XY" if f"{a}Resolution" in tags}
    sizes = {a: below / above for a, (above, below) in resolutions.items()}
    return sizes | ({"Z": float(notes["spacing"])} if "spacing" in notes else {}), unit


FORMATS = (
    Format(
        "TIFF", TIFF, _tiff, extra="raster", channels=True, keyed=True,
        signatures=tuple((0, sign, TIFF[0]) for sign in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")),
    ),
)
