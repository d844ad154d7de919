"""Tifffile reads TIFF: pictures, stacks, GeoTIFF and what microscopes write."""

from __future__ import annotations

import lzma
import math
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, MissingExtraError, plain
from ...extras import optional
from ...field.placement import Placement
from .from_rasterio import RasterWindows
from .opened import Choice, Format, Opened
from .place_of_samples import in_steps, placed
from .reading import channel_of, pick_frame, reading, said
from .source import InputFile
from .tile_sizes import LERC, PICTURES, stated_samples, unpacked_lerc

_UNPACKERS: dict[int, Any] = {8: zlib.decompressobj, 32946: zlib.decompressobj, 34925: lzma.LZMADecompressor}
"""Compressions of a TIFF that tifffile undoes without a bound: Deflate by its two numbers, LZMA."""
_RATIO = 1 << 13
"""Bytes that come out of a byte of these at most."""
_BOUNDED = frozenset((1, 2, 3, 4, 5, 32771, 32773, 50000))
"""Compressions whose decoders fill no more than the room made for them: none, CCITT, LZW, PackBits, Zstandard."""
_LERC_PARAMETERS = 50674
"""Tag of a TIFF file: what packs LERC parts once more."""
_SMALL = 1 << 26
_NODATA = 42113
"""Tag of a TIFF file: the number as text."""
_SCALE, _TIEPOINT, _TRANSFORMATION = 33550, 33922, 34264
# Values of GeoKeys.
_GEOGRAPHIC = 2
_IS_POINT = 2
"""Raster type whose coordinates are those of the samples; otherwise samples are half a pixel further on."""
_EPSG = range(1024, 32767)
"""Numbers of systems that the EPSG registry has."""


class _Tiff(Opened):
    """The only picture or stack of a TIFF file, or one of its channels."""

    def _open(self, choice: Choice) -> None:
        self._chosen = choice.channel
        with reading("TIFF"):
            self._tiff = self.hold(_opened(self._source))
            self._first = self._tiff.pages[0]
            try:
                self.nodata = float(str(self._first.tags[_NODATA].value).strip(" \0"))
            except (KeyError, ValueError):
                self.nodata = None

    @cached_property
    def _picture(self) -> tuple[Any, int | None, int]:
        """The series, the axis of its channels or None, and which channel to take."""
        tifffile = optional("tifffile", extra="image", purpose=f"reading {self._source.path.suffix}")
        with reading("TIFF"):
            series = self._tiff.series
            if not series:
                raise InputError("holds no picture", code="unreadable")
            if len(series) != 1:
                shapes = ", ".join(str(each.shape) for each in series[:20])
                raise InputError(
                    f"holds {len(series)} pictures of different kinds: {shapes}", code="series",
                    remedy="save the one you want as a separate file",
                )
            if series[0].keyframe.photometric == tifffile.PHOTOMETRIC.PALETTE:
                raise InputError("holds indices of a palette, not samples", code="palette", remedy="save it as grey")
            _check_series(self._source, series[0])
            axes = str(series[0].axes)
        colour = next((axes.index(letter) for letter in "SC" if letter in axes), None)
        return series[0], colour, channel_of(1 if colour is None else series[0].shape[colour], self._chosen)

    @cached_property
    def shape(self) -> tuple[int, ...]:  # type: ignore[override]
        """Samples along each axis."""
        series, colour, _ = self._picture
        return tuple(count for axis, count in enumerate(series.shape) if axis != colour)

    @cached_property
    def dtype(self) -> np.dtype[Any]:  # type: ignore[override]
        """Type of the samples."""
        return np.dtype(self._picture[0].dtype)

    def _values(self, frame: int | None) -> NDArray[Any]:
        series, colour, channel = self._picture
        with reading("TIFF"):
            picture = _samples(series)
        return pick_frame(picture if colour is None else np.take(picture, channel, axis=colour), frame)

    def _place(self, n: int, frame: int | None) -> Placement:
        with reading("TIFF"):
            place = _of_picture(self._first, n)
            return _of_microscope(self._tiff, n) if not place.placed and not place.remark else place

    def _windows(self) -> RasterWindows:
        with reading("TIFF"):
            return RasterWindows(self._source.path)


def _samples(series: Any) -> NDArray[Any]:
    try:
        return np.asarray(series.asarray())
    except (ValueError, ImportError) as exc:
        # without the library some compressions raise an error that names it, others one of a missing module
        if isinstance(exc, ValueError) and "imagecodecs" not in str(exc):
            raise
        raise MissingExtraError(
            f"reading this TIFF needs another library ({said(exc)})", code="missing-extra",
            remedy="pip install 'isocodec[image]', or save it without compression",
        ) from exc


@contextmanager
def _opened(source: InputFile) -> Iterator[Any]:
    """A TIFF as tifffile has it, which may go on in files beside it, and elsewhere if these are to be followed."""
    tifffile = optional("tifffile", extra="image", purpose=f"reading {source.path.suffix}")
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


def _check_series(source: InputFile, series: Any) -> None:
    """Check that the samples of a series may be read, and no part of it unpacks to more than they take."""
    size = source.check_array(series.shape, series.dtype)
    source.check_packed(size)
    if series.dataoffset is not None:
        source.check_bytes(series.dataoffset + size)
    page = series.keyframe
    # a tile is unpacked as a whole, however small the picture
    tile = source.check_count(math.prod(page.chunks)) * page.dtype.itemsize
    if page.compression in _UNPACKERS:
        for packed in _parts(series):
            if len(packed) * _RATIO <= _SMALL:
                continue
            unpacker = _UNPACKERS[page.compression]()
            if len(unpacker.decompress(packed, 2 * tile + _SMALL)) > tile + _SMALL:
                raise InputError("holds packed samples that unpack to more than its header states", code="unreadable")
    elif page.compression in PICTURES:
        tag = page.tags.get(_LERC_PARAMETERS)
        most = math.prod(page.chunks)
        for packed in _parts(series):
            part = unpacked_lerc(packed, tag and tag.value, most) if page.compression in LERC else packed
            stated = stated_samples(part, int(page.compression))
            if stated is None or stated > most:
                raise InputError("holds a part whose own header states another size", code="unreadable")
    elif page.compression not in _BOUNDED:
        raise InputError(
            f"is a TIFF of compression {plain(str(getattr(page.compression, 'name', page.compression)))}, which is "
            "not read", code="compression", remedy="save it with LZW, Deflate or Zstandard",
        )


def _parts(series: Any) -> Iterator[bytes]:
    """Strips and tiles of all pages of a series, as they are stored."""
    for one in series.pages:
        for offset, count in () if one is None else zip(one.dataoffsets, one.databytecounts, strict=True):
            if count:
                file = one.parent.filehandle
                file.seek(offset)
                yield file.read(count)


def _of_microscope(tiff: Any, n: int) -> Placement:
    """Sizes of pixels or voxels, as OME and ImageJ have them; these may be damaged in any way."""
    try:
        sizes = _ome_sizes(tiff.ome_metadata) if tiff.ome_metadata else _imagej_sizes(tiff)
    except Exception:
        return Placement()
    if not sizes:
        return Placement()
    series = tiff.series[0]
    letters = [a for a, count in zip(series.axes, series.shape, strict=True) if count > 1 and a not in "SC"][-n:]
    if letters != [*"ZYX"[-n:]] or not set(letters) <= sizes.keys():
        said = f"its axes are {plain(', '.join(letters))}, and {', '.join(sizes)} have sizes"
        return Placement(remark=f"the sizes of its pixels are ignored: {said}; set them with --spacing")
    return in_steps([(sizes[letter], 0.0) for letter in letters])


def _ome_sizes(text: str) -> dict[str, float]:
    pixels = next(e for e in ElementTree.fromstring(text).iter() if e.tag.endswith("Pixels"))
    sizes = {a: pixels.attrib[f"PhysicalSize{a}"] for a in "XYZ" if f"PhysicalSize{a}" in pixels.attrib}
    units = {pixels.get(f"PhysicalSize{a}Unit", "µm") for a in sizes}
    return {a: float(size) for a, size in sizes.items()} if len(units) == 1 else {}


def _imagej_sizes(tiff: Any) -> dict[str, float]:
    notes = tiff.imagej_metadata or {}
    if notes.get("unit", "pixel") in ("", "pixel") and "spacing" not in notes:
        return {}
    tags = tiff.pages[0].tags
    resolutions = {a: tags[f"{a}Resolution"].value for a in "XY" if f"{a}Resolution" in tags}
    sizes = {a: below / above for a, (above, below) in resolutions.items()}
    return sizes | ({"Z": float(notes["spacing"])} if "spacing" in notes else {})


def _of_picture(page: Any, n: int) -> Placement:
    """Read the tags of a GeoTIFF, which may have any type and any number of values."""
    scale, tiepoint, matrix = (_numbers(page, tag) for tag in (_SCALE, _TIEPOINT, _TRANSFORMATION))
    if not (len(scale) or len(tiepoint) or len(matrix)):
        return Placement()
    if n != 2:
        return Placement(remark="the coordinates of a stack of pages are ignored")
    try:
        keys = dict(page.geotiff_tags or {})
    except Exception:  # of any kind, where the tag is damaged
        keys = {}
    # numbers may be of any size
    with np.errstate(all="ignore"):
        if len(matrix) == 16 and matrix.any():
            across, down, start = matrix.reshape(4, 4)[:2, [0, 1, 3]].T
        elif len(scale) >= 2 and len(tiepoint) >= 6:
            across, down = np.array([scale[0], 0.0]), np.array([0.0, -scale[1]])
            start = tiepoint[3:5] - tiepoint[0] * across - tiepoint[1] * down
        else:
            return Placement(remark="its coordinates are ignored: it has single points only, no steps between pixels")
        if keys.get("GTRasterTypeGeoKey") != _IS_POINT:
            start = start + (across + down) / 2
    place = placed(np.column_stack([down, across, start]), n)
    if not place.placed or not keys:
        return place
    crs = _system(keys)
    remark = "" if crs else "its reference system is ignored, as it has no EPSG number"
    return replace(place, crs=crs, remark=remark)


def _numbers(page: Any, tag: int) -> NDArray[np.float64]:
    """Values of a tag; none if it is not there or holds none."""
    try:
        return np.atleast_1d(np.asarray(page.tags[tag].value, np.float64))
    except (KeyError, TypeError, ValueError):
        return np.zeros(0)


def _system(keys: Mapping[str, Any]) -> str | None:
    """The reference system that GeoKeys name: of the model that they state, or the one that is there."""
    names = ["ProjectedCSTypeGeoKey", "GeographicTypeGeoKey"]
    if keys.get("GTModelTypeGeoKey") == _GEOGRAPHIC:
        names.reverse()
    numbers = [keys.get(name) for name in names]
    number = next((number for number in numbers if isinstance(number, int) and number > 0), 0)
    return f"EPSG:{int(number)}" if number in _EPSG else None


FORMATS = (
    Format(
        "TIFF", (".tif", ".tiff"), _Tiff, extra="image", channels=True,
        signatures=tuple((0, sign, ".tif") for sign in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")),
    ),
)
