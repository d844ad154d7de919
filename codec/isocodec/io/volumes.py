"""Volumes: images of SimpleITK and nibabel, and files of MetaImage, NRRD and NIfTI, which these read."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, plain
from ..field.framed import Frames
from ..field.placement import FRAME_STEP, Placement
from ..field.sampled import Field
from .arrays import channel_of, numbers, of_array
from .in_turn import InTurn, check_frame, placed_field
from .libraries import library, reading
from .places import by_matrix, in_body, kept_axes

Array = NDArray[Any]
_NRRD = "NrrdImageIO"
_HEADER = 1 << 16
"""Bytes of a header that are looked at."""
_TIMES = {"sec": "s", "msec": "ms", "usec": "µs"}
"""Units of time, as nibabel calls them and as they are written."""


def of_frames(
    at: Callable[[int], Field], count: int, frame: int | None, frames: bool, differ: str = ""
) -> Field | Frames:
    """Give the only volume or one of several, or as a series all of them, or the slices of one.

    Parameters
    ----------
    at : callable
        Reads the field of a number.
    count : int
        How many there are.
    frame, frames
        As of `isocodec.read`.
    differ : str
        By what they differ, for the error.

    Raises
    ------
    InputError
        If none of several is chosen.
    OptionError
        If there is no such frame.
    """
    if frame is not None:
        check_frame(frame, count if count > 1 else 0)
    elif count > 1 and not frames:
        raise InputError(f"holds a series of {count}" + f", which differ by {differ}" * bool(differ), code="shape",
                         remedy=f"take one with --frame 0 to {count - 1}, or all with --frames")
    if frame is None and count > 1:
        first = at(0)
        return Frames(InTurn(count, at, (*first.shape, count), first.remarks))
    first = at(frame or 0)
    if not frames:
        return first
    values = first.values if first.mask is None else np.ma.masked_array(first.values, first.mask)
    remarks = *first.remarks, "the position of a slice in space is ignored"
    return of_array(values, frames=True, remarks=remarks, name=first.name, unit=first.unit)


def squeezed(values: Array, place: Placement | None, remarks: Sequence[str] = (), **more: Any) -> Field:
    """Make a field of samples, which may be masked, without axes of one."""
    values = numbers(values.reshape([values.shape[axis] for axis in kept_axes(values.shape)]))
    return placed_field(values, None, place, remarks, **more)


def scaled(raw: Array, slope: float, intercept: float) -> Array:
    """Rescale samples: integers by whole numbers to int32 or int64, others to float64; unscaled ones stay."""
    if (slope, intercept) == (1.0, 0.0):
        return raw
    most = 2.0 ** (8 * raw.itemsize) * abs(slope) + abs(intercept)
    if raw.dtype.kind in "iu" and slope.is_integer() and intercept.is_integer() and most < 2.0**63:
        values: Array = raw.astype(np.int32 if most < 2.0**31 else np.int64)
        values *= int(slope)
        values += int(intercept)
        return values
    return raw * np.float64(slope) + np.float64(intercept)


def open_(
    path: Path, frame: int | None = None, frames: bool = False, band: int | None = None, key: str | None = None
) -> Field | Frames:
    """Read MetaImage and NRRD by SimpleITK, NIfTI and Analyze by nibabel; parameters as of `of_itk`."""
    kind = path.suffix.lower()
    if key is not None:
        raise InputError(f"holds no parts named '{plain(key)}'", code="key",
                         remedy="of segments in layers choose a layer by --frame")
    if kind not in (".mha", ".mhd", ".nrrd", ".nhdr"):
        nibabel = library("nibabel", extra="volumes", purpose="reading NIfTI")
        with reading("NIfTI volume"):
            return of_nibabel(nibabel.load(path), frame, frames, band)
    sitk = library("SimpleITK", extra="volumes", purpose="reading volumes")
    with path.open("rb") as file:
        header = file.read(_HEADER)
    packed = re.search(rb"^CompressedData *= *True[^\0]*?^ElementDataFile *= *([^\r\n]*)\r?\n", header, re.M)
    with reading("volume", "check that the files that its header names lie beside it, and that an axis of volumes has "
                 "the kind 'list'"):
        if re.search(rb"^ElementDataFile *=.*%.* -\d+\s*$", header, re.M):
            raise InputError("names files by falling numbers, which ITK does not read", code="unreadable",
                             remedy="list them: ElementDataFile = LIST")
        if packed:  # of damaged samples ITK takes what there is
            name = packed[1].strip().decode()
            zlib.decompress(path.read_bytes()[packed.end() :] if name == "LOCAL" else (path.parent / name).read_bytes())
        # left to itself ITK tries all formats that it knows
        image = sitk.ReadImage(path, imageIO=_NRRD if kind[1] == "n" else "MetaImageIO")
    # ITK does not give it
    units = re.search(rb"^space units:(.*)$", header, re.M | re.I)
    unit = " ".join(dict.fromkeys(units[1].decode("latin-1").replace('"', " ").split())) if units else None
    return of_itk(image, frame, frames, band, unit)


def is_itk(thing: Any) -> bool:
    """Whether this is an image of SimpleITK."""
    return hasattr(thing, "GetSpacing") and hasattr(thing, "GetPixelIDTypeAsString")


def of_itk(
    image: Any, frame: int | None = None, frames: bool = False, band: int | None = None, unit: str | None = None
) -> Field | Frames:
    """Read an image of SimpleITK of two to four axes.

    Parameters
    ----------
    image : SimpleITK.Image
        Its coordinates run to the left, back and top of a body, unless it is of an NRRD of another space.
    frame : int, optional
        Volume of a fourth axis, or of the components of a list in an NRRD, counted from 0.
    frames : bool
        Give all of these.
    band : int, optional
        Component of vectors and colours, counted from 1.
    unit : str, optional
        Unit of the coordinates; without it that of an NRRD, or mm.

    Returns
    -------
    Field or Frames
        Axes i, j (, k), without those of one sample.

    Raises
    ------
    InputError, OptionError, MissingExtraError
    """
    sitk = library("SimpleITK", extra="volumes", purpose="reading volumes")
    known = {name: image.GetMetaData(name) for name in image.GetMetaDataKeys()}
    size, count = image.GetDimension(), image.GetNumberOfComponentsPerPixel()
    values: Array = sitk.GetArrayViewFromImage(image).T
    matrix = np.column_stack([np.reshape(image.GetDirection(), (size, size)) * image.GetSpacing(), image.GetOrigin()])
    remarks = list[str]()
    if band is not None or known.get("NRRD_kinds[pixel]") != "list":
        channel = channel_of(count, band)
        values = values[channel] if count > 1 else values
    elif count > 1:  # they are the first axis now
        values = np.moveaxis(values, 0, -1)
    if size > 3:
        kinds = [known.get(f"NRRD_kinds[{axis}]", "domain") for axis in range(4)]
        apart = next((axis for axis, kind in enumerate(kinds) if kind not in ("domain", "space")), 3)
        values = np.moveaxis(values, apart, -1)
        remarks.append("start and step of its fourth axis are left out, as their unit is not known")
        matrix = np.delete(np.delete(matrix, apart, 0), apart, 1)
    several = values.shape[3] if values.ndim > 3 else 1
    axes = kept_axes(values.shape[:3])
    space = known.get("NRRD_space", "" if known.get("ITK_InputFilterName") == _NRRD else "left-posterior")
    unit = unit or known.get("NRRD_units[0]")
    if size > 2 and space.startswith("left-posterior"):
        place = in_body(matrix, axes, lps=True, unit=unit or "mm")
    else:
        place = by_matrix(matrix, axes, unit=unit or ("mm" if space else None))
        remarks += [f"its coordinates are of no body: its space is '{plain(space)}'"] * (size > 2)

    def at(number: int, _: Any = image) -> Field:  # the view needs the image
        part = np.array(values[..., number] if several > 1 else values, order="C")
        return squeezed(part, place, remarks)

    return of_frames(at, several, frame, frames)


def is_nibabel(thing: Any) -> bool:
    """Whether this is an image of nibabel with an affine matrix."""
    return hasattr(thing, "affine") and hasattr(thing, "dataobj")


def of_nibabel(
    image: Any, frame: int | None = None, frames: bool = False, band: int | None = None
) -> Field | Frames:
    """Read an image of nibabel; of a series one volume at a time.

    Parameters
    ----------
    image : SpatialImage
        Of up to four axes. Its coordinates run to the right, front and top of a body, in its unit or mm.
    frame, frames, band
        As of `of_itk`.

    Returns
    -------
    Field or Frames
        Scaled as the image states; integers stay integers if that is by whole numbers.

    Raises
    ------
    InputError, OptionError
    """
    proxy, header, whole = image.dataobj, image.header, tuple(map(int, image.shape))
    several = whole[3] if len(whole) > 3 else 1
    raw, scaling = proxy, (1.0, 0.0)
    if hasattr(proxy, "slope"):
        scaling = float(proxy.slope), float(proxy.inter)
        # the file stays open: of a packed one the next volume is then read without unpacking all before it
        raw = type(proxy)(proxy.file_like, (proxy.shape, proxy.dtype, proxy.offset, 1.0, 0.0), keep_file_open=True)
    channel_of(1, band)
    unit, time, remarks, notes = "unknown", "", [], {}
    if hasattr(header, "get_xyzt_units"):
        try:
            unit, time = header.get_xyzt_units()
        except KeyError:
            remarks.append(f"its units, {int(header['xyzt_units'])}, are not known: its coordinates are taken for mm")
    elif "Analyze" in type(header).__name__:
        remarks.append("Analyze files do not state left and right: x runs as nibabel takes it")
    axes = kept_axes(whole[:3])
    place = in_body(np.asarray(image.affine), axes, lps=False, unit="mm" if unit == "unknown" else unit)
    step = float(header.get_zooms()[-1])
    if frame is None and several > 1 and time in _TIMES and 0 < step < np.inf:
        notes[FRAME_STEP] = f"{step:g} {_TIMES[time]}"

    def at(number: int) -> Field:
        with reading("NIfTI volume"):
            part = np.asarray(raw[:, :, :, number] if several > 1 else raw[...]).reshape(whole[:3])
        return squeezed(scaled(part, *scaling), place, remarks, notes=notes)

    return of_frames(at, several, frame, frames)
