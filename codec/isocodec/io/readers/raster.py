"""Pictures: PNG, JPEG and TIFF."""

from __future__ import annotations

import lzma
import math
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, MissingExtraError, OptionError, plain
from ...extras import optional
from .reading import reading, said
from .source import Source
from .tile_sizes import LERC, PICTURES, stated_samples, unpacked_lerc

Field = NDArray[Any]

TIFF_SUFFIXES = (".tif", ".tiff")

_PLUGINS = {
    b"\x89PNG": ("PIL.PngImagePlugin", "PngImageFile"),
    b"\xff\xd8\xff": ("PIL.JpegImagePlugin", "JpegImageFile"),
}
"""Who reads a picture, by its first bytes."""
_UNPACKERS: dict[int, Any] = {8: zlib.decompressobj, 32946: zlib.decompressobj, 34925: lzma.LZMADecompressor}
"""Compressions of a TIFF that tifffile undoes without a bound: Deflate by its two numbers, LZMA."""
_RATIO = 1 << 13
"""Bytes that come out of a byte of these at most."""
_BOUNDED = frozenset((1, 2, 3, 4, 5, 32771, 32773, 50000))
"""Compressions of which no more comes out than room was made for: none, CCITT, LZW, PackBits, Zstandard."""
_LERC_PARAMETERS = 50674
"""Tag of a TIFF file: what packs LERC parts once more."""
_SMALL = 1 << 26


def read_picture(source: Source) -> tuple[Field, int | None]:
    """PNG or JPEG: the samples, and which axis is that of the colour channels."""
    # the plugins themselves: pillow's own limit on sizes is one for the whole process
    with source.path.open("rb") as file:
        head = file.read(26)
    purpose = f"reading {source.path.suffix}"
    optional("PIL", extra="image", purpose=purpose)
    module, name = next((m for s, m in _PLUGINS.items() if head.startswith(s)), ("", ""))
    if not name:
        raise InputError("is neither PNG nor JPEG", code="unreadable")
    plugin = getattr(optional(module, extra="image", purpose=purpose), name)
    # The first picture: the rest of an animated PNG or of a camera's JPEG are previews and further frames.
    with reading("picture"), plugin(source.path) as image:
        bands = len(image.palette.mode) if image.mode == "P" else len(image.getbands())
        source.check_count(math.prod(image.size) * bands)
        if image.mode == "P":
            image = image.convert(image.palette.mode)
        picture = np.asarray(image)
        if image.mode == "I":  # what older versions make of 16-bit grey
            picture = picture.astype(np.uint16)
        if picture.ndim == 2:
            return picture, None
        # Signature, then IHDR with width, height, bit depth: pillow silently halves 16-bit colour to 8 bits.
        if head.startswith(b"\x89PNG") and head[24] == 16 and picture.dtype.itemsize == 1:
            raise InputError(
                "is a colour picture of 16 bits per channel, which the PNG reader cannot keep",
                code="depth",
                remedy="save it as 16-bit grey PNG, or as TIFF",
            )
        return picture, picture.ndim - 1


@contextmanager
def opened_tiff(source: Source) -> Iterator[Any]:
    """A TIFF as tifffile has it, which may go on in files beside it, and elsewhere if these are to be followed."""
    tifffile = optional("tifffile", extra="image", purpose=f"reading {source.path.suffix}")
    # the index of an NDTiff is another file, which names further ones
    whole = {} if source.follow else {"is_ndtiff": False}
    with tifffile.TiffFile(source.path, **whole) as tiff:
        if tiff.pages and tiff.ome_metadata:
            _check_companions(source, tiff.ome_metadata)
        yield tiff


def _check_companions(source: Source, notes: str) -> None:
    """That the files of an OME series are those that may be read."""
    try:
        elements = [*ElementTree.fromstring(notes).iter()]
    except ElementTree.ParseError:  # nor does tifffile know more of it then
        return
    names = dict.fromkeys(e.attrib["FileName"] for e in elements if "FileName" in e.attrib)
    for name in names:
        if name.lower() != source.path.name.lower():
            source.beside(name)


def read_tiff(source: Source) -> tuple[Field, int | None]:
    """TIFF: the samples, and which axis is that of the colour channels."""
    tifffile = optional("tifffile", extra="image", purpose=f"reading {source.path.suffix}")
    with reading("TIFF"), opened_tiff(source) as tiff:
        if not tiff.series:
            raise InputError("holds no picture", code="unreadable")
        if len(tiff.series) != 1:
            shapes = ", ".join(str(series.shape) for series in tiff.series[:20])
            raise InputError(
                f"holds {len(tiff.series)} pictures of different kinds: {shapes}",
                code="series",
                remedy="save the one you want as a separate file",
            )
        series = tiff.series[0]
        if series.keyframe.photometric == tifffile.PHOTOMETRIC.PALETTE:
            raise InputError("holds indices of a palette, not samples", code="palette", remedy="save it as grey")
        _check_series(source, series)
        axes = str(series.axes)
        colour = next((axes.index(letter) for letter in "SC" if letter in axes), None)
        try:
            picture = series.asarray()
        except (ValueError, ImportError) as exc:
            # without the library some compressions are said to need it, and of others a module is not found
            if isinstance(exc, ValueError) and "imagecodecs" not in str(exc):
                raise
            raise MissingExtraError(
                f"reading this TIFF needs another library ({said(exc)})", code="missing-extra",
                remedy="pip install 'isocodec[image]', or save it without compression",
            ) from exc
        return np.asarray(picture), colour


def _check_series(source: Source, series: Any) -> None:
    """That the samples of a series may be read, and no part of it unpacks to more than they take."""
    size = source.check_array(series.shape, series.dtype)
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


def pick_channel(picture: Field, colour: int | None, channel: int | None) -> Field:
    count = 1 if colour is None else picture.shape[colour]
    if channel is not None and not 0 <= channel < count:
        raise OptionError(f"there is no channel {channel}: the picture has {count}, counted from 0", code="channel")
    if colour is None:
        return picture
    if channel is None:
        if count > 1:
            raise InputError(
                f"is a picture of {count} channels, colours or bands",
                code="colour",
                remedy=f"take one with --channel 0 to {count - 1}, or convert it to one",
            )
        channel = 0
    return np.take(picture, channel, axis=colour)
