"""Pictures of Pillow, and stacks of TIFF with the sizes that microscopes write, by tifffile."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..errors import InputError, one_line
from ..field.framed import Frames
from ..field.missing import missing_samples
from ..field.placement import Placement
from ..field.sampled import Field
from ..verbs import Choice
from . import rasters
from .arrays import channel_of, indices, numbers, of_array
from .in_turn import check_frame
from .libraries import library, reading

FORMATS = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG", ".bmp": "BMP", ".gif": "GIF", ".pgm": "PPM", ".ppm": "PPM",
           ".webp": "WEBP"}
"""Formats of Pillow by suffix; others start programs."""
_ORIENTATION, _NODATA, _PALETTE = 274, 42113, 3
_GEOGRAPHY = {33550, 33922, 34264}
"""Tags of scale, tie points and transformation."""


def of_picture(image: Any, choice: Choice) -> Field:
    """Read a channel of a picture of Pillow, turned upright; samples that alpha hides are missing.

    Of a picture with a palette, band 1 takes the indices. Raises `InputError` if a choice is left open, or there are
    more bits than Pillow keeps; `OptionError` if there is no such channel.
    """
    band, several = choice.band, int(getattr(image, "n_frames", 1))
    bands, mode = image.getbands(), image.mode
    if mode == "P" and band is None:
        raise indices()
    if len(bands) > 1 and ";16" in str(getattr(image, "tile", "")):
        raise InputError("is a colour picture of 16 bits per channel, of which Pillow keeps 8", code="depth",
                         remedy="save it as 16-bit grey, or as TIFF")
    if image.format == "TIFF" and image.getexif().get(_ORIENTATION, 1) > 4:
        raise InputError("is a TIFF that lies on its side, whose samples Pillow scrambles", code="orientation",
                         remedy="give its path")
    channel = channel_of(len(bands), 1 if mode == "LA" and band is None else band)
    with reading("picture", "check that the file is complete"):
        stored = np.asarray(library("PIL.ImageOps", extra="pictures", purpose="reading pictures").exif_transpose(image))
    values = stored[..., channel] if len(bands) > 1 else stored
    hidden = stored[..., -1] == 0 if bands[-1] == "A" and channel < len(bands) - 1 else None
    remarks = [f"holds {several} pictures, of which the first is read"] * (several > 1)
    if "transparency" in image.info and mode != "P":
        remarks.append(f"its transparent shade is kept: {image.info['transparency']}; --nodata marks it as missing")
    return Field(numbers(values), hidden, remarks=remarks)


def open_(path: Path, choice: Choice) -> Field:
    """Read a picture; one that a world file or notes of GDAL beside it place is a raster, as it is stored."""
    suffix = path.suffix
    beside = (f".{suffix[1]}{suffix[-1]}w", f"{suffix}w", ".wld", f"{suffix}.aux.xml")
    if any(path.with_suffix(each).exists() for each in beside):
        return rasters.read(path, choice)
    pillow = library("PIL.Image", extra="pictures", purpose=f"reading {suffix}")
    with reading("picture", "check that the file is complete") as said:
        with pillow.open(path, formats=[FORMATS[suffix.lower()]]) as checked:
            checked.verify()  # checksums of a PNG, which are left out when samples are unpacked
        with pillow.open(path, formats=[FORMATS[suffix.lower()]]) as image:
            found = of_picture(image, choice)
    return replace(found, remarks=(*found.remarks, *said))


def open_tiff(path: Any, choice: Choice) -> Field | Frames:
    """Read a TIFF: a raster, or a page of it, whose samples stay in the file; or a stack of pages."""
    turned = False
    if not str(path).startswith("/vsi"):
        tifffile = library("tifffile", extra="raster", purpose="reading TIFF")
        # the index of an NDTiff names other files
        with (reading("TIFF", "check that the file is complete; some compressions need imagecodecs"),
              tifffile.TiffFile(path, is_ndtiff=False) as tiff):
            if choice.key is None and _is_stack(tiff, str(path)):
                return _stack(tiff, choice)
            turned = tiff.pages[0].tags.valueof(_ORIENTATION, 1) != 1
    if choice.frames or choice.frame is not None:
        check_frame(choice.frame or 0, 0)
    found = rasters.read(path, choice)
    if found.placement is None and turned:
        raise InputError("is a picture that lies on its side or is mirrored", code="orientation",
                         remedy="turn it first: convert -auto-orient IN OUT")
    return found


def _is_stack(tiff: Any, path: str) -> bool:
    """Whether a TIFF has several pages, or one with several planes, besides overviews and masks, which GDAL knows."""
    if tiff.is_ome or tiff.is_imagej or len(tiff.pages) == 1:
        return tiff.is_ome or tiff.is_imagej or np.prod(tiff.series[0].shape) != np.prod(tiff.pages[0].shape)
    try:
        return bool(rasters.open_(path).subdatasets)
    except InputError:
        return True


def _stack(tiff: Any, choice: Choice) -> Field | Frames:
    """Read one page, or all, of a stack with axes such as TZYX."""
    if len(tiff.series) != 1:
        raise InputError(f"holds {len(tiff.series)} pictures of different kinds", code="series",
                         remedy="choose a page with --key, counted from 1")
    (series,) = tiff.series
    axes = str(series.axes)
    if series.keyframe.photometric == _PALETTE and choice.band is None:
        raise indices()
    if None in series.pages:
        raise InputError("lacks some of the pages that it states", code="unreadable",
                         remedy="check that the file is complete")
    colour = next((axes.index(letter) for letter in "SC" if letter in axes), None)
    channel = channel_of(1 if colour is None else series.shape[colour], choice.band)
    values = numbers(series.asarray())
    if colour is not None:
        values, axes = values.take(channel, colour), axes.replace(axes[colour], "")
    marked = tiff.pages[0].tags.valueof(_NODATA) if choice.nodata is None else choice.nodata
    with suppress(TypeError, ValueError):
        values = np.ma.masked_array(values, missing_samples(values, float(str(marked).strip(" \0"))))
    letters = [axis for axis, count in zip(axes, values.shape, strict=True) if count > 1]
    where, remarks = None, list[str]()
    try:
        sizes = _sizes(tiff)
        where = _place(sizes, letters[(choice.frame is not None) + choice.frames :]) if sizes else None
    except (ElementTree.ParseError, AttributeError, KeyError, ValueError, ZeroDivisionError) as error:
        remarks = [f"the sizes of its pixels are ignored: {one_line(str(error))}; set them with --spacing"]
    if any(tag in tiff.pages[0].tags for tag in _GEOGRAPHY):
        where, remarks = None, ["the coordinates of a stack of pages are ignored; take a page with --key"]
    return of_array(values, choice, where, remarks=remarks)


def _sizes(tiff: Any) -> dict[str, tuple[float, str]]:
    """Find sizes of pixels or voxels and their units by axis, as OME and ImageJ have them."""
    if tiff.ome_metadata:
        pixels: Any = ElementTree.fromstring(tiff.ome_metadata).find(".//{*}Pixels")
        return {axis: (float(size), pixels.get(f"PhysicalSize{axis}Unit", "µm"))
                for axis in "XYZ" if (size := pixels.get(f"PhysicalSize{axis}"))}
    tags, notes = tiff.pages[0].tags, tiff.imagej_metadata or {}
    unit = str(notes.get("unit") or "").replace("\\u00B5", "µ")
    if unit in ("", "pixel") and "spacing" not in notes:
        return {}
    sizes = {axis: (found[1] / found[0], unit) for axis in "XY" if (found := tags.valueof(f"{axis}Resolution"))}
    return {**sizes, "Z": (float(notes["spacing"]), unit)} if "spacing" in notes else sizes


def _place(sizes: Mapping[str, tuple[float, str]], letters: list[str]) -> Placement:
    n = len(letters)
    if letters != [*"ZYX"[-n:]]:
        raise ValueError(f"its axes are {', '.join(letters)}")
    steps, units = zip(*(sizes[axis] for axis in reversed(letters)), strict=True)
    each = ["_".join(unit.split()) for unit in units]
    matrix = np.pad(np.fliplr(np.diag(steps)), ((0, 0), (0, 1)))
    return Placement(matrix, unit=" ".join(each if len({*each}) > 1 else each[:1]) or None)
