"""Pillow reads PNG and JPEG."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...extras import optional
from ...field.placement import Placement
from .from_rasterio import place_beside
from .opened import Choice, Format, Opened
from .reading import channel_of, pick_frame, reading, upright

_PNG, _JPEG = b"\x89PNG", b"\xff\xd8\xff"
_PLUGINS = {_PNG: ("PIL.PngImagePlugin", "PngImageFile"), _JPEG: ("PIL.JpegImagePlugin", "JpegImageFile")}
"""Who reads a picture, by its first bytes."""
_ORIENTATION = 274


class _Picture(Opened):
    """The first picture of a file; further ones are frames of an animated PNG, or previews in a camera's JPEG."""

    def _open(self, choice: Choice) -> None:
        # the plugins themselves: pillow's own limit on sizes is one for the whole process
        with self._source.path.open("rb") as file:
            self._head = head = file.read(26)
        purpose = f"reading {self._source.path.suffix}"
        optional("PIL", extra="image", purpose=purpose)
        module, name = next((m for s, m in _PLUGINS.items() if head.startswith(s)), ("", ""))
        if not name:
            raise InputError("is neither PNG nor JPEG", code="unreadable")
        plugin = getattr(optional(module, extra="image", purpose=purpose), name)
        with reading("picture"):
            # checksums of a PNG, which pillow leaves out when it unpacks samples
            with plugin(self._source.path) as checked:
                checked.verify()
            image = self._image = self.hold(plugin(self._source.path))
            self._coloured = image.mode == "P" and not choice.labels
            self._mode = image.palette.mode if self._coloured else image.mode
            self._bands = len(self._mode) if self._coloured else len(image.getbands())
            kind = optional("PIL.ImageMode", extra="image", purpose=purpose).getmode(self._mode).typestr
        # 32 bits are what older versions make of 16-bit grey
        self.dtype = np.dtype(np.uint16 if self._mode == "I" else np.uint8 if kind == "|b1" else kind)
        self._source.check_packed(self._source.check_count(math.prod(image.size) * self._bands))
        # signature, then IHDR with width, height, bit depth: pillow silently halves 16-bit colour to 8 bits
        if self._bands > 1 and head.startswith(_PNG) and head[24] == 16 and self.dtype.itemsize == 1:
            raise InputError(
                "is a colour picture of 16 bits per channel, which the PNG reader cannot keep", code="depth",
                remedy="save it as 16-bit grey PNG, or as TIFF",
            )
        self._channel = channel_of(self._bands, 0 if self._mode == "LA" and choice.channel is None else choice.channel)
        # of grey below 8 bits the transparent shade is one of the file, not of the samples, which are stretched
        self._stretch = 255 // ((1 << head[24]) - 1) if self._mode == "L" and head.startswith(_PNG) else 1
        # coordinates beside a picture are those of the picture as it is stored
        self._turn = 1 if self._place(2, None).placed else image.getexif().get(_ORIENTATION)
        self.shape = upright(np.broadcast_to(0, image.size[::-1]), self._turn).shape

    def _values(self, frame: int | None) -> NDArray[Any]:
        with reading("picture"):
            image = self._image
            stored = np.asarray(image)
            picture = np.asarray(image.convert("RGBA")) if self._coloured else stored
        gone = self._transparent(stored)
        if self._mode == "I":
            picture = picture.astype(np.uint16)
        picture = picture if picture.ndim == 2 else picture[..., self._channel]
        picture = np.ma.masked_array(picture, gone) if gone.any() else picture
        return pick_frame(upright(picture, self._turn), frame)

    def values(self, frame: int | None = None) -> NDArray[Any]:
        """Read the samples; a value of missing samples takes the place of no alpha (see `Opened.values`)."""
        return self._known(frame)

    def _transparent(self, stored: NDArray[Any]) -> NDArray[np.bool_]:
        """Find the samples that cannot be seen at all, unless alpha itself is read: (rows, columns) bool."""
        clear, alpha = self._image.info.get("transparency"), self._mode.endswith("A")
        if stored.dtype.kind == "b" or self._mode == "P":  # labels are known
            clear = None if self._mode == "P" or clear is None else bool(clear)
        if alpha and self._channel < self._bands - 1:
            return np.asarray(stored[..., -1] == 0)
        if clear is None or alpha:
            return np.zeros(stored.shape[:2], np.bool_)
        if isinstance(clear, bytes):  # of colours of a palette
            return np.isin(stored, np.flatnonzero(np.frombuffer(clear, np.uint8) == 0))
        return np.asarray((stored == np.multiply(clear, self._stretch)).reshape(*stored.shape[:2], -1).all(-1))

    def _place(self, n: int, frame: int | None) -> Placement:
        path = self._source.path
        kind = path.suffix[1:]
        beside = (f".{kind[0]}{kind[-1]}w", f".{kind}w", ".wld", f"{path.suffix}.aux.xml")
        if not any(path.with_suffix(each).exists() for each in beside):
            return Placement()
        return place_beside(self._source, self._image.format)


FORMATS = (
    Format("PNG", (".png",), _Picture, extra="image", channels=True, signatures=((0, _PNG, ".png"),)),
    Format("JPEG", (".jpg", ".jpeg"), _Picture, extra="image", channels=True, signatures=((0, _JPEG, ".jpg"),)),
)
