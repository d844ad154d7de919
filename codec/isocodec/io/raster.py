"""Pictures: PNG, JPEG and TIFF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, MissingExtraError, OptionError
from .extras import optional
from .reading import one_line, reading

Field = NDArray[Any]


def read_picture(path: Path) -> tuple[Field, int | None]:
    """PNG or JPEG: the samples, and which axis is that of the colour channels."""
    imageio = optional("imageio.v3", extra="image", purpose=f"reading {path.suffix}")
    with reading("picture"):
        # The first picture: the rest of an animated PNG or of a camera's JPEG are previews and further frames.
        picture = np.asarray(imageio.imread(path, plugin="pillow", index=0))
        if picture.ndim == 2:
            return picture, None
        with path.open("rb") as file:
            head = file.read(26)
        # Signature, then IHDR with width, height, bit depth: pillow silently halves 16-bit colour to 8 bits.
        if head.startswith(b"\x89PNG") and head[24] == 16 and picture.dtype.itemsize == 1:
            raise InputError(
                "is a colour picture of 16 bits per channel, which the PNG reader cannot keep",
                code="depth",
                remedy="save it as 16-bit grey PNG, or as TIFF",
            )
        return picture, picture.ndim - 1


def read_tiff(path: Path) -> tuple[Field, int | None]:
    """TIFF: the samples, and which axis is that of the colour channels."""
    tifffile = optional("tifffile", extra="image", purpose=f"reading {path.suffix}")
    with reading("TIFF"), tifffile.TiffFile(path) as tiff:
        if not tiff.series:
            raise InputError("holds no picture", code="unreadable")
        if len(tiff.series) != 1:
            shapes = ", ".join(str(series.shape) for series in tiff.series[:20])
            raise InputError(
                f"holds {len(tiff.series)} pictures of different kinds: {shapes}",
                code="series",
                remedy="save the one you mean as a file of its own",
            )
        series = tiff.series[0]
        if series.keyframe.photometric == tifffile.PHOTOMETRIC.PALETTE:
            raise InputError("holds indices of a palette, not samples", code="palette", remedy="save it as grey")
        axes = str(series.axes)
        colour = next((axes.index(letter) for letter in "SC" if letter in axes), None)
        try:
            picture = series.asarray()
        except (ValueError, ImportError) as exc:
            # without the library some compressions are said to need it, and of others a module is not found
            if isinstance(exc, ValueError) and "imagecodecs" not in str(exc):
                raise
            picture = _read_compressed(path, series.shape, series.dtype, exc)
        return np.asarray(picture), colour


def _read_compressed(path: Path, shape: tuple[int, ...], dtype: np.dtype[Any], reason: Exception) -> Field:
    """Pictures packed in a way that tifffile leaves to a large extra library; pillow often knows it, too."""
    imageio = optional("imageio.v3", extra="image", purpose="reading a compressed TIFF")
    missing = MissingExtraError(
        f"reading this TIFF needs another library ({one_line(reason)})", code="missing-extra",
        remedy="pip install imagecodecs, or save it without compression",
    )  # fmt: skip
    try:
        picture = np.asarray(imageio.imread(path, plugin="pillow", index=0))
    except Exception:
        raise missing from None
    # Pillow has fewer sample types than TIFF; what it would have converted is not what is stored.
    if picture.shape != tuple(shape) or picture.dtype != dtype.newbyteorder("="):
        raise missing
    return picture


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
