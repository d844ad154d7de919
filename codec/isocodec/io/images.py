"""Pictures of Pillow, and stacks of TIFF with the sizes that microscopes write, by tifffile."""

from __future__ import annotations

from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, plain
from ..field.framed import Frames
from ..field.missing import missing_samples
from ..field.placement import Placement
from ..field.sampled import Field
from . import rasters
from .arrays import channel_of, numbers, of_array
from .in_turn import check_frame, placed_field
from .libraries import library, reading

FORMATS = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG", ".bmp": "BMP", ".gif": "GIF", ".pgm": "PPM", ".ppm": "PPM",
           ".webp": "WEBP"}
"""Formats of Pillow by suffix; others start programs."""
_ORIENTATION, _NODATA, _PALETTE = 274, 42113, 3
_GEOGRAPHY = (33550, 33922, 34264)
"""Tags of scale, tie points and transformation."""
_INDICES = InputError("holds indices of a palette, not samples", code="palette",
                      remedy="band=1 (--band 1) takes the indices; or save it as grey")


def is_picture(thing: object) -> bool:
    """Whether this is an image of Pillow."""
    return hasattr(thing, "getbands") and hasattr(thing, "getexif")


def of_picture(image: Any, band: int | None = None, frame: int | None = None, turn: bool = True) -> Field:
    """A picture of Pillow, turned upright; samples that cannot be seen at all are missing.

    Parameters
    ----------
    image : PIL.Image.Image
    band : int, optional
        Channel, counted from 1; of a picture with a palette 1 takes the indices.
    frame : int, optional
        Of several pictures, the number of one, counted from 0.
    turn : bool
        Whether to turn it by its orientation.

    Raises
    ------
    InputError
        If it has several channels, a palette, or more bits than Pillow keeps.
    OptionError
        If there is no such channel or picture.
    """
    several = int(getattr(image, "n_frames", 1))
    if frame is not None:
        check_frame(frame, several if several > 1 else 0)
        image.seek(frame)
    bands, mode = image.getbands(), image.mode
    if mode == "P" and band is None:
        raise _INDICES
    if len(bands) > 1 and any(";16" in str(part) for part in getattr(image, "tile", ())):
        raise InputError("is a colour picture of 16 bits per channel, of which Pillow keeps 8", code="depth",
                         remedy="save it as 16-bit grey, or as TIFF")
    channel = channel_of(len(bands), 1 if mode == "LA" and band is None else band)
    # of grey below 8 bits the transparent shade is one of the file, not of the samples, which are stretched
    raw = str(image.tile[0][3]) if mode == "L" and getattr(image, "tile", ()) else ""
    stretch = {"L;1": 255, "L;2": 85, "L;4": 17}.get(raw, 1)
    orientation = image.getexif().get(_ORIENTATION, 1)
    if image.format == "TIFF" and orientation > 4 and any(each[0] == "raw" for each in image.tile):
        raise InputError("is a TIFF that lies on its side, whose samples Pillow scrambles", code="orientation",
                         remedy="give its path")
    with reading("picture", "check that the file is complete"):
        image.load()
        orientation = orientation if turn and image.format != "TIFF" else 1  # loading has turned a TIFF
        stored = np.asarray(image)
    gone = _transparent(image, stored, channel, stretch)
    values = stored if stored.ndim == 2 else stored[..., channel]
    if mode == "I" and image.format == "PNG":  # 32 bits are what older versions make of 16-bit grey
        values = values.astype(np.uint16)
    remarks = [f"holds {several} pictures, of which the first is read"] if several > 1 and frame is None else []
    return Field(numbers(_upright(values, orientation)), _upright(gone, orientation) if gone.any() else None,
                 remarks=remarks)


def open_(path: Path, band: int | None = None, frame: int | None = None) -> Field:
    """Read a picture; world files and notes of GDAL beside it place it as it is stored.

    Raises
    ------
    OSError, InputError, OptionError, MissingExtraError
    """
    kind, suffix = FORMATS[path.suffix.lower()], path.suffix
    library("PIL", extra="pictures", purpose=f"reading {suffix}")
    pillow = library("PIL.Image", extra="pictures", purpose=f"reading {suffix}")
    with reading("picture", "check that the file is complete") as said:
        with pillow.open(path, formats=[kind]) as checked:
            checked.verify()  # checksums of a PNG, which are left out when samples are unpacked
        image = pillow.open(path, formats=[kind])
    beside = (f".{suffix[1]}{suffix[-1]}w", f"{suffix}w", ".wld", f"{suffix}.aux.xml")
    where: Placement | None = None
    if any(path.with_suffix(each).exists() for each in beside):
        with closing(rasters.open_(str(path), drivers=(kind,))) as file:
            where, remark = rasters.place_of(file)
            said += [remark] if remark else []
    with image:
        found = of_picture(image, band, frame, where is None)
    return placed_field(found.values, found.mask, where, (*found.remarks, *said))


def open_tiff(
    path: str, key: str | None = None, band: int | None = None, frame: int | None = None, frames: bool = False,
    nodata: float | None = None,
) -> Field | Frames:
    """Read a TIFF: a raster, whose samples stay in the file, or a stack of pages.

    Parameters
    ----------
    path : str
    key : str, optional
        Number of a page, counted from 1.
    band, frame, frames, nodata
        As of `isocodec.read`.

    Raises
    ------
    OSError, InputError, OptionError, MissingExtraError
    """
    if path.startswith("/vsi"):
        return _raster(rasters.open_(path, key), band, nodata, frame, frames)
    tifffile = library("tifffile", extra="raster", purpose="reading TIFF")
    with reading("TIFF", "check that the file is complete"):
        tiff = tifffile.TiffFile(path, is_ndtiff=False)  # the index of an NDTiff names further files
    with tiff:
        with reading("TIFF", "check that the file is complete"):
            page = tiff.pages[0]
            turn = page.tags.valueof(_ORIENTATION)
            several = len(tiff.pages) == 1 and np.prod(tiff.series[0].shape) != np.prod(page.shape)
        if key is not None or not (tiff.is_ome or tiff.is_imagej or several):
            try:
                file = rasters.open_(path, key)
            except InputError:
                if key is not None or len(tiff.pages) == 1:
                    raise
                return _stack(tiff, band, frame, frames, nodata)
            if key is not None or not file.subdatasets:
                found = _raster(file, band, nodata, frame, frames)
                if turn in (None, 1) or found.placement is not None:
                    return found
                samples: Any = found.values[:, :]
                return replace(found, values=_upright(samples.data, turn), mask=_upright(samples.mask, turn))
        return _stack(tiff, band, frame, frames, nodata)


def _raster(file: Any, band: int | None, nodata: float | None, frame: int | None, frames: bool) -> Field:
    if frames or frame is not None:
        check_frame(frame or 0, 0)
    return rasters.of_dataset(file, band, nodata)


def _stack(
    tiff: Any, band: int | None, frame: int | None, frames: bool, nodata: float | None
) -> Field | Frames:
    with reading("TIFF", "check that it is complete; some compressions need imagecodecs"):
        if len(tiff.series) != 1:
            shapes = ", ".join(str(each.shape) for each in tiff.series[:20])
            raise InputError(f"holds {len(tiff.series)} pictures of different kinds: {shapes}", code="series",
                             remedy="choose a page with --key, counted from 1")
        (series,) = tiff.series
        axes = str(series.axes)
        if series.keyframe.photometric == _PALETTE and band is None:
            raise _INDICES
        colour = next((axes.index(letter) for letter in "SC" if letter in axes), None)
        channel = channel_of(1 if colour is None else series.shape[colour], band)
        if None in series.pages:
            raise InputError("lacks some of the pages that it states", code="unreadable",
                             remedy="check that the file is complete")
        values = numbers(series.asarray())
    if colour is not None:
        values, axes = values.take(channel, colour), axes.replace(axes[colour], "")
    marked = tiff.pages[0].tags.valueof(_NODATA) if nodata is None else None
    gone = None
    with suppress(ValueError):
        gone = None if marked is None else missing_samples(values, float(str(marked).strip(" \0")))
    n = values.ndim - (frames or frame is not None) - (frames and frame is not None)
    where, remark = _place(tiff, axes, values.shape, n)
    return of_array(np.ma.masked_array(values, gone) if gone is not None and gone.any() else values, frame, frames,
                    where, remarks=(remark,) if remark else ())


def _place(tiff: Any, axes: str, shape: tuple[int, ...], n: int) -> tuple[Placement | None, str]:
    """Sizes of pixels or voxels, as OME and ImageJ have them, along the last n axes."""
    if any(tag in tiff.pages[0].tags for tag in _GEOGRAPHY):
        return None, "the coordinates of a stack of pages are ignored; take a page with --key"
    try:
        sizes = _of_ome(tiff.ome_metadata) if tiff.ome_metadata else _of_imagej(tiff)
    except (ElementTree.ParseError, ValueError, StopIteration, ZeroDivisionError):
        return None, "the sizes of its pixels are ignored: they are damaged"
    letters = [axis for axis, count in zip(axes, shape, strict=True) if count > 1][-n:]
    if not sizes:
        return None, ""
    if letters != [*"ZYX"[-n:]] or not {*letters} <= sizes.keys():
        return None, (f"the sizes of its pixels are ignored: its axes are {plain(', '.join(letters))}, and "
                      f"{', '.join(sizes)} have sizes; set them with --spacing")
    matrix = np.zeros((n, n + 1))
    for axis, letter in enumerate(letters):
        matrix[n - 1 - axis, axis] = sizes[letter][0]
    units = [sizes[letter][1] for letter in reversed(letters)]
    unit = units[0] if len({*units}) == 1 else " ".join("_".join(each.split()) for each in units)
    return Placement(matrix, unit=unit or None), ""


def _of_ome(text: str) -> dict[str, tuple[float, str]]:
    pixels = next(each for each in ElementTree.fromstring(text).iter() if each.tag.endswith("Pixels"))
    return {axis: (float(pixels.attrib[f"PhysicalSize{axis}"]), pixels.get(f"PhysicalSize{axis}Unit", "µm"))
            for axis in "XYZ" if f"PhysicalSize{axis}" in pixels.attrib}


def _of_imagej(tiff: Any) -> dict[str, tuple[float, str]]:
    notes, tags = tiff.imagej_metadata or {}, tiff.pages[0].tags
    unit = str(notes.get("unit") or "").replace("\\u00B5", "µ")
    if unit in ("", "pixel") and "spacing" not in notes:
        return {}
    sizes = {axis: tags[f"{axis}Resolution"].value for axis in "XY" if f"{axis}Resolution" in tags}
    out = {axis: (below / above, unit) for axis, (above, below) in sizes.items()}
    return {**out, "Z": (float(notes["spacing"]), unit)} if "spacing" in notes else out


def _transparent(image: Any, stored: NDArray[Any], channel: int, stretch: int) -> NDArray[np.bool_]:
    """Find the samples that cannot be seen at all, unless alpha itself is read: (rows, columns) bool."""
    bands, clear = image.getbands(), image.info.get("transparency")
    if bands[-1] == "A":
        return np.asarray(stored[..., -1] == 0) if channel < len(bands) - 1 else np.zeros(stored.shape[:2], np.bool_)
    if clear is None or image.mode == "P":  # indices are known
        return np.zeros(stored.shape[:2], np.bool_)
    clear = bool(clear) if stored.dtype.kind == "b" else np.multiply(clear, stretch)
    return np.asarray((stored == clear).reshape(*stored.shape[:2], -1).all(-1))


def _upright(picture: Any, orientation: Any) -> Any:
    """Turn a picture of an orientation, 1 to 8 as EXIF and TIFF count them, as it is meant to be seen."""
    picture = picture.T if orientation in (5, 6, 7, 8) else picture
    return picture[:: -1 if orientation in (3, 4, 7, 8) else 1, :: -1 if orientation in (2, 3, 6, 7) else 1]
