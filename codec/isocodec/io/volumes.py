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
from ..field.labelling import about
from ..field.placement import Placement
from ..field.sampled import Field
from ..field.times import Time
from ..verbs import Choice
from .arrays import channel_of, numbers, of_array
from .in_turn import InTurn, check_frame, placed_field
from .libraries import library, reading
from .places import as_integers, by_matrix, in_body, kept_axes

Array = NDArray[Any]
_ITK = {".mha": "MetaImageIO", ".mhd": "MetaImageIO", ".nrrd": "NrrdImageIO", ".nhdr": "NrrdImageIO"}
"""Readers of ITK by suffix: left to itself it tries all formats that it knows."""
SUFFIXES = (*_ITK, ".nii", ".nii.gz")
_HEADER = 1 << 16
"""Bytes of a header that are looked at."""
_TIMES = {"sec": "s", "msec": "ms", "usec": "µs"}
"""Units of time, as nibabel calls them and as they are written."""


def of_frames(
    at: Callable[[int], Field], count: int, choice: Choice, differ: str = "", times: Sequence[Time] | None = None
) -> Field | Frames:
    """Read one of ``count`` volumes, or give all as a series, or the slices of one.

    ``differ`` names what distinguishes them, for the error, and ``times`` are theirs, if they are known. Raises
    `InputError` if none of several is chosen, and `OptionError` if there is no such frame.
    """
    frame = choice.frame
    if frame is not None:
        check_frame(frame, count if count > 1 else 0)
    elif count > 1 and not choice.frames:
        raise InputError(f"holds a series of {count}" + f", which differ by {differ}" * bool(differ), code="shape",
                         remedy=f"take one with --frame 0 to {count - 1}, or all with --frames")
    first = at(frame or 0)
    if not choice.frames:
        return first
    if frame is None and count > 1:
        return Frames(InTurn(count, at, (*first.shape, count), first.remarks), times=times)
    values = first.values if first.mask is None else np.ma.masked_array(first.values, first.mask)
    remarks = *first.remarks, "the position of a slice in space is ignored"
    return of_array(values, Choice(frames=True), remarks=remarks, name=first.name, unit=first.unit)


def squeezed(values: Array, place: Placement | None, remarks: Sequence[str] = (), **more: Any) -> Field:
    """Make a field of samples, which may be masked, without axes of one."""
    values = numbers(values.reshape([values.shape[axis] for axis in kept_axes(values.shape)]))
    return placed_field(values, None, place, remarks, **more)


def open_(path: Path, choice: Choice) -> Field | Frames:
    """Read MetaImage and NRRD by SimpleITK, NIfTI and Analyze by nibabel."""
    if choice.key is not None:
        raise InputError(f"holds no parts named '{plain(choice.key)}'", code="key",
                         remedy="of segments in layers choose a layer by --frame")
    if path.suffix.lower() not in _ITK:
        nibabel = library("nibabel", extra="volumes", purpose="reading NIfTI")
        with reading("NIfTI volume"):
            # of a packed file that stays open the next volume is read without unpacking all before it
            return of_nibabel(nibabel.load(path, keep_file_open=True), choice)
    sitk = library("SimpleITK", extra="volumes", purpose="reading volumes")
    with path.open("rb") as file:
        header = file.read(_HEADER)
    with reading("volume", "check that the files that its header names lie beside it, and that an axis of volumes has "
                 "the kind 'list'"):
        if re.search(rb"^ElementDataFile *=.*%.* -\d+\s*$|^NDims *=(?! *[2-5]\s)", header, re.M):  # ITK crashes
            raise InputError("names files by falling numbers, or has other than two to five axes", code="unreadable",
                             remedy="list the files: ElementDataFile = LIST")
        packed = re.search(rb"^CompressedData *= *True[^\0]*?^ElementDataFile *= *([^\r\n]*)\r?\n", header, re.M)
        if packed:  # of damaged samples ITK takes what there is
            name = packed[1].strip().decode()
            zlib.decompress(path.read_bytes()[packed.end() :] if name == "LOCAL" else (path.parent / name).read_bytes())
        image = sitk.ReadImage(path, imageIO=_ITK[path.suffix.lower()])
        # ITK does not give it
        units = re.search(rb"^space units:(.*)$", header, re.M | re.I)
        unit = " ".join(dict.fromkeys(units[1].decode("latin-1").replace('"', " ").split())) if units else None
        return of_itk(image, choice, unit)


def of_itk(image: Any, choice: Choice, unit: str | None = None) -> Field | Frames:
    """Read an image of SimpleITK of two to four axes: i, j (, k), without those of one sample.

    Its coordinates run to the left, back and top of a body, unless it is of an NRRD of another space. Frames are the
    volumes of a fourth axis, or the components of a list in an NRRD; others are bands. Without ``unit`` it is that of
    an NRRD, or mm.
    """
    sitk = library("SimpleITK", extra="volumes", purpose="reading volumes")
    known = {name: image.GetMetaData(name) for name in image.GetMetaDataKeys()}
    count, remarks = image.GetNumberOfComponentsPerPixel(), list[str]()
    listed = choice.band is None and known.get("NRRD_kinds[pixel]") == "list"
    if count > 1 and not listed:
        image = sitk.VectorIndexSelectionCast(image, channel_of(count, choice.band))
    elif not listed:
        channel_of(1, choice.band)
    apart, several = None, count if listed else 1
    if image.GetDimension() > 3:
        kinds = [known.get(f"NRRD_kinds[{axis}]", "domain") for axis in range(4)]
        apart = next((axis for axis, kind in enumerate(kinds) if kind not in ("domain", "space")), 3)
        several = image.GetSize()[apart]
        remarks.append("start and step of its fourth axis are left out, as their unit is not known")
    space = known.get("NRRD_space", "" if known.get("ITK_InputFilterName") == "NrrdImageIO" else "left-posterior")
    body = space.startswith("left-posterior")
    unit = unit or known.get("NRRD_units[0]") or ("mm" if space else None)
    if image.GetDimension() > 2 and not body:
        remarks.append(f"its coordinates are of no body: its space is '{plain(space)}'")

    def named(number: int) -> dict[str, str]:
        """Names and colours of segments, as 3D Slicer writes them; of a series of layers there are several."""
        notes: dict[str, str] = {}
        for key in known if several == 1 or not choice.frames else ():
            segment = key.removesuffix("_ID")
            if re.fullmatch(r"Segment\d+_ID", key) and int(known.get(f"{segment}_Layer", 0)) == number:
                colour = [float(part) for part in known.get(f"{segment}_Color", "").split()]
                notes |= about(float(known.get(f"{segment}_LabelValue", 1)), known.get(f"{segment}_Name"),
                               colour or None)
        return notes

    def at(number: int) -> Field:
        part = image
        if apart is not None:
            part = image[tuple(number if axis == apart else slice(None) for axis in range(4))]
        elif several > 1:
            part = sitk.VectorIndexSelectionCast(image, number)
        size, axes = part.GetDimension(), kept_axes(part.GetSize())
        steps = np.reshape(part.GetDirection(), (size, size)) * part.GetSpacing()
        matrix = np.column_stack([steps, part.GetOrigin()])
        in_space = in_body(matrix, axes, lps=True, unit=unit or "mm") if size > 2 and body else None
        return squeezed(sitk.GetArrayFromImage(part).T, in_space or by_matrix(matrix, axes, unit=unit), remarks,
                        notes=named(number))

    return of_frames(at, several, choice)


def of_nibabel(image: Any, choice: Choice) -> Field | Frames:
    """Read an image of nibabel of up to four axes, of a series one volume at a time.

    Its coordinates run to the right, front and top of a body, in its unit or mm. It is scaled as it states; integers
    stay integers if that is by whole numbers.
    """
    samples, header, whole = image.dataobj, image.header, tuple(map(int, image.shape))
    several = whole[3] if len(whole) > 3 else 1
    scaling = np.array([getattr(samples, "slope", 1), getattr(samples, "inter", 0)], float)
    channel_of(1, choice.band)
    unit, time, remarks, times = "unknown", "", [], None
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
    if choice.frame is None and several > 1 and time in _TIMES and 0 < step < np.inf:
        times = [f"{number * float(f'{step:g}'):.12g} {_TIMES[time]}" for number in range(several)]

    def at(number: int) -> Field:
        with reading("NIfTI volume"):
            part = np.asarray(samples[..., number] if several > 1 else samples)
        if not (scaling % 1).any() and samples.dtype.kind in "iu":
            part = as_integers(part)
        return squeezed(part.reshape(whole[:3]), place, remarks)

    return of_frames(at, several, choice, times=times)
