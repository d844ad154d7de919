"""Volumes: images of SimpleITK and nibabel, and files of MetaImage, NRRD and NIfTI, which these read."""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OptionError, plain
from ..field.framed import Frames
from ..field.placement import FRAME_STEP, Placement
from ..field.sampled import Field
from .libraries import choose, library, reading
from .placing import by_matrix, in_body, kept_axes

__all__ = ["InTurn", "is_itk", "is_nibabel", "of_frames", "of_itk", "of_nibabel", "open_", "placed_field", "scaled"]

Array = NDArray[Any]
_HEADER = 1 << 16
"""Bytes of a header that are looked at."""
_TIMES = {"sec": "s", "msec": "ms", "usec": "µs"}
"""Units of time, as nibabel calls them and as they are written."""


class InTurn:
    """Fields of a series, each read when it is asked for.

    Attributes
    ----------
    whole : tuple of int
        Shape of the array that the source holds, with the axis that counts the frames.
    remarks : tuple of str
        What the source states and the fields leave out.
    """

    def __init__(
        self, count: int, at: Callable[[int], Field], whole: Sequence[int], remarks: Sequence[str] = ()
    ) -> None:
        self.whole, self.remarks = tuple(whole), tuple(remarks)
        self._count, self._at = count, at

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Field]:
        return map(self._at, range(self._count))

    def __getitem__(self, number: int) -> Field:
        return self._at(range(self._count)[number])


def of_frames(
    at: Callable[[int], Field], whole: Sequence[int], frame: int | None, frames: bool, differ: str = "",
    remarks: Sequence[str] = (),
) -> Field | Frames:
    """Give one of several fields, or all in turn.

    Parameters
    ----------
    at : callable
        Reads the field of a number.
    whole : sequence of int
        Shape of the whole, whose last axis counts the fields.
    differ : str
        By what they differ, for the error.

    Raises
    ------
    InputError
        If none is chosen.
    OptionError
        If there is no such field.
    """
    if frames:
        return Frames(InTurn(whole[-1], at, whole, remarks))
    if frame is None:
        raise InputError(f"holds a series, of shape {(*whole,)}" + f", which differ by {differ}" * bool(differ),
                         code="shape", remedy=f"take one with --frame 0 to {whole[-1] - 1}, or all with --frames")
    check_frame(frame, whole[-1])
    return at(frame)


def check_frame(frame: int | None, count: int) -> None:
    """Raise `OptionError` for a frame that a series of that many, 0 if it is none, does not have."""
    if frame is not None and not 0 <= frame < count:
        there = f"the series has {count}, counted from 0" if count else "this is not a series"
        raise OptionError(f"there is no frame {frame}: {there}", code="frame")


def component(count: int, band: int | None) -> int:
    """Choose one of so many components or colours, counted from 1; return it counted from 0."""
    if band is None and count > 1:
        raise InputError(f"is a picture of {count} channels, colours or components", code="colour",
                         remedy=f"take one with --band 1 to {count}")
    if band is not None and not 1 <= band <= count:
        raise OptionError(f"there is no band {band}: there are {count}, counted from 1", code="channel")
    return (band or 1) - 1


def placed_field(
    values: Array, mask: Array | None, place: Placement | None, remarks: Sequence[str] = (), **more: Any
) -> Field:
    """Make a field of samples, contiguous and native; a placement that is no such thing becomes a remark."""
    values = np.ascontiguousarray(values, values.dtype.newbyteorder("="))
    gone = None if mask is None or not mask.any() else np.ascontiguousarray(mask)
    said = (*remarks, *filter(None, [place and place.remark]))
    try:
        return Field(values, gone, place if place and place.placed else None, remarks=said, **more)
    except OptionError as error:
        return Field(values, gone, remarks=(*said, f"its coordinates are ignored: {error.message}"), **more)


def scaled(raw: Array, slope: float, intercept: float) -> Array:
    """Rescale samples: integers by whole numbers to int32 or int64, others to float64; unscaled ones stay."""
    if (slope, intercept) == (1.0, 0.0):
        return raw
    if raw.dtype.kind in "iu" and slope.is_integer() and intercept.is_integer():
        limits = np.iinfo(raw.dtype)
        ends = [int(end) * int(slope) + int(intercept) for end in (limits.min, limits.max)] + [int(slope)]
        for kind in (np.int32, np.int64):
            if np.iinfo(kind).min <= min(ends) and max(ends) <= np.iinfo(kind).max:
                values: Array = raw.astype(kind)
                values *= int(slope)
                values += int(intercept)
                return values
    return raw * np.float64(slope) + np.float64(intercept)


def open_(
    path: Path, frame: int | None = None, frames: bool = False, band: int | None = None, key: str | None = None
) -> Field | Frames:
    """Read MetaImage and NRRD by SimpleITK, NIfTI and Analyze by nibabel; parameters as of `of_itk`."""
    path = Path(path)
    if path.suffix.lower() not in (".mha", ".mhd", ".nrrd", ".nhdr"):
        nibabel = library("nibabel", extra="volumes", purpose="reading NIfTI")
        with reading("NIfTI volume"):
            return of_nibabel(nibabel.load(path), frame, frames, band)
    sitk = library("SimpleITK", extra="volumes", purpose="reading volumes")
    with path.open("rb") as file:
        header = file.read(_HEADER)
    remedy = "check it, and that the files that its header names lie beside it"
    if header.startswith(b"NRRD"):
        remedy += "; an axis of volumes has no direction and the kind 'list'"
    with reading("volume", remedy):
        reader = sitk.ImageFileReader()
        reader.SetImageIO("NrrdImageIO" if header.startswith(b"NRRD") else "MetaImageIO")
        reader.SetFileName(str(path))
        image = reader.Execute()
        if re.search(rb"^CompressedData\s*=\s*True", header, re.M | re.I):
            _check_packed(path, header, sitk.GetArrayViewFromImage(image))
    # ITK does not give it
    stated = re.search(rb"^space units:(.*)$", header, re.M | re.I)
    unit = " ".join(dict.fromkeys(stated[1].decode("latin-1").replace('"', " ").split())) if stated else None
    return _of_itk(image, frame, frames, band, key, unit)


def _check_packed(path: Path, header: bytes, values: Array) -> None:
    """Hold samples against the sum at the end of the packed ones: ITK takes damaged ones as far as they go."""
    found = re.search(rb"^ElementDataFile\s*=\s*([^\r\n]*)\r?\n?", header, re.M)
    size = re.search(rb"^CompressedDataSize\s*=\s*(\d+)", header, re.M)
    if found is None or size is None:
        return
    inside = found[1].strip().upper() == b"LOCAL"
    with (path if inside else path.parent / found[1].strip().decode()).open("rb") as file:
        file.seek(found.end() * inside + int(size[1]) - 4)
        total = int.from_bytes(file.read(4), "big")
    swapped = re.search(rb"^(BinaryData|Element)ByteOrderMSB\s*=\s*True", header, re.M | re.I)
    if total != zlib.adler32(values.byteswap() if swapped else values):
        raise InputError("is damaged: its packed samples do not have the sum that it states", code="unreadable")


# ---- SimpleITK -------------------------------------------------------------------------------------------------------


def is_itk(thing: Any) -> bool:
    """Whether this is an image of SimpleITK."""
    return all(hasattr(thing, name) for name in ("GetSpacing", "GetDirection", "GetPixelIDTypeAsString"))


def of_itk(
    image: Any, frame: int | None = None, frames: bool = False, band: int | None = None, key: str | None = None
) -> Field | Frames:
    """Read an image of SimpleITK of two to four axes.

    Parameters
    ----------
    image : SimpleITK.Image
        Its coordinates, in mm, run to the left, back and top of a body, unless it is of an NRRD of another space.
    frame : int, optional
        Volume of a fourth axis, or of the components of a list in an NRRD, counted from 0.
    frames : bool
        Give all of these.
    band : int, optional
        Component of vectors and colours, counted from 1.
    key : str, optional
        Segment of a segmentation of 3D Slicer, by its name or number.

    Returns
    -------
    Field or Frames
        Axes i, j (, k), without those of one sample.

    Raises
    ------
    InputError, OptionError, MissingExtraError
    """
    return _of_itk(image, frame, frames, band, key, None)


def _of_itk(
    image: Any, frame: int | None, frames: bool, band: int | None, key: str | None, unit: str | None
) -> Field | Frames:
    sitk = library("SimpleITK", extra="volumes", purpose="reading volumes")
    known = {name: image.GetMetaData(name) for name in image.GetMetaDataKeys()}
    size, count = image.GetDimension(), image.GetNumberOfComponentsPerPixel()
    values: Array = sitk.GetArrayViewFromImage(image).T
    steps = np.reshape(image.GetDirection(), (size, size)) * image.GetSpacing()
    matrix, remarks = np.column_stack([steps, image.GetOrigin()]), []
    if count > 1:  # they are the first axis now
        values = np.moveaxis(values, 0, -1) if known.get("NRRD_kinds[pixel]") == "list" and band is None else values[
            component(count, band)]
    elif band is not None:
        component(1, band)
    if size > 3:
        kinds = [known.get(f"NRRD_kinds[{axis}]", "domain") for axis in range(size)]
        apart = next((axis for axis, kind in enumerate(kinds) if kind not in ("domain", "space")), 3)
        values = np.moveaxis(values, apart, -1)
        if tuple(matrix[apart, [apart, size]]) != (1, 0):
            remarks.append("the start and the step of its fourth axis are left out, as their unit is not known")
        matrix = np.delete(np.delete(matrix, apart, axis=0), apart, axis=1)
    while values.ndim > 3 and values.shape[-1] == 1:
        values = values[..., 0]
    if values.ndim > 4:
        raise InputError(f"holds an array of shape {values.shape}", code="shape", remedy="give one of four axes")
    axes, space = kept_axes(values.shape[:3]), known.get("NRRD_space", "left-posterior")
    shape = [values.shape[axis] for axis in axes]
    unit = unit or known.get("NRRD_units[0]") or "mm"
    place: Placement | None
    if size < 3:
        place = by_matrix(matrix, unit=unit)
    elif not space.startswith("left-posterior"):
        place = by_matrix(matrix, axes, unit=unit)
        remarks.append(f"its space '{plain(space)}' does not state the sides of a body: its coordinates are in none")
    elif "NRRD_space" not in known and "ITK_InputFilterName" in known and (matrix == np.eye(3, 4)).all():
        place = None  # what ITK has where an NRRD states nothing
    else:
        place = in_body(matrix, axes, lps=True, unit=unit)
    segments = _segments(known)

    def at(number: int | None, label: int | None = None, _: Any = image) -> Field:  # the view needs the image
        part = values if number is None else values[..., number]
        part = np.array(part.reshape(shape), order="C")
        return placed_field(part if label is None else np.where(part == label, part, 0), None, place, remarks)

    series = values.ndim > 3
    if key is not None:
        layer, number = segments[choose([*segments], key, "segments")]
        return at(layer if series else None, number)
    if not series:
        check_frame(frame, 0)
        return at(None)
    if frame is None and not frames and segments:
        choose([*segments], None, "segments in layers")
    return of_frames(at, [*shape, values.shape[-1]], frame, frames, remarks=remarks)


def _segments(known: dict[str, str]) -> dict[str, tuple[int, int]]:
    """Layer and label of each segment of 3D Slicer, by name and by number."""
    found = {}
    for each in (name[:-2] for name in known if re.fullmatch("Segment[0-9]+_ID", name)):
        where = int(known.get(f"{each}Layer", 0)), int(known.get(f"{each}LabelValue", 1))
        found |= dict.fromkeys((known.get(f"{each}Name", known[f"{each}ID"]), known[f"{each}ID"]), where)
    return found


# ---- nibabel ---------------------------------------------------------------------------------------------------------


def is_nibabel(thing: Any) -> bool:
    """Whether this is an image of nibabel with an affine matrix."""
    return all(hasattr(thing, name) for name in ("affine", "dataobj", "header"))


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
    proxy, header, remarks = image.dataobj, image.header, []
    slope, intercept = float(getattr(proxy, "slope", 1.0)), float(getattr(proxy, "inter", 0.0))
    raw = proxy
    if hasattr(proxy, "slope"):
        # the file stays open: of a packed one the next volume is then read without unpacking all before it
        raw = type(proxy)(proxy.file_like, (proxy.shape, proxy.dtype, proxy.offset, 1.0, 0.0), keep_file_open=True)
    colours = proxy.dtype.names or ()
    channel = component(len(colours) or 1, band)
    whole = tuple(map(int, proxy.shape))
    while len(whole) > 3 and whole[-1] == 1:
        whole = whole[:-1]
    if len(whole) > 4:
        raise InputError(f"holds an array of shape {whole}", code="shape", remedy="give one of four axes")
    unit, time = "mm", ""
    if hasattr(header, "get_xyzt_units"):
        try:
            unit, time = header.get_xyzt_units()
        except KeyError:
            remarks.append(f"its units, {int(header['xyzt_units'])}, are unknown: its coordinates are taken for mm")
    elif not hasattr(header, "get_vox2ras"):
        remarks.append("Analyze files do not state left and right: x runs as nibabel takes it")
    axes = kept_axes(whole[:3])
    place = in_body(np.asarray(image.affine), axes, lps=False, unit="mm" if unit == "unknown" else unit)
    step, notes = float(header.get_zooms()[3]) if len(whole) > 3 and len(header.get_zooms()) > 3 else 0.0, {}
    if time in _TIMES and step > 0 and math.isfinite(step):
        notes[FRAME_STEP] = f"{step:g} {_TIMES[time]}"

    def at(number: int | None) -> Field:
        with reading("NIfTI volume"):
            part = np.asarray(raw[...] if number is None else raw[..., number])
        part = part.reshape([whole[axis] for axis in axes])
        part = part[colours[channel]] if colours else part
        return placed_field(scaled(part, slope, intercept), None, place, remarks, notes=notes)

    if len(whole) > 3:
        return of_frames(at, [*(whole[axis] for axis in axes), whole[3]], frame, frames, remarks=remarks)
    check_frame(frame, 0)
    return at(None)
