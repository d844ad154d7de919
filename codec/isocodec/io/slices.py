"""DICOM: slices and files of many frames, by pydicom; segmentations and volumes, by highdicom.

All lie in coordinates to the right, front and top of the body; axes are columns, rows, slices.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..errors import InputError, one_line, plain
from ..field.framed import Frames
from ..field.sampled import Field
from .arrays import channel_of
from .libraries import choose, library, reading
from .places import EVEN, by_matrix, in_body, kept_axes
from .volumes import of_frames, scaled, squeezed

Array = NDArray[Any]
_LONG = 1 << 18
"""Bytes of elements that are not read with the header."""
_CUT = ".*[Uu]nexpected end of file|The end of the encapsulated pixel data"
"""Warnings of pydicom about files that are cut short, of which it then takes what there is."""
_ALIKE, _TOGETHER = 1e-4, 1e-3
"""Differences of directions and steps within a stack; distance in mm of slices that lie in one place."""
_SAMPLES = 0x7FE00008, 0x7FE00009, 0x7FE00010
"""Tags of samples."""
_SPACINGS = "PixelSpacing", "ImagerPixelSpacing", "NominalScannedPixelSpacing"
_PADDING = "PixelPadding", "FloatPixelPadding", "DoubleFloatPixelPadding"
_FILMED = "FrameTime", "FrameTimeVector", "CineRate"
"""Attributes of files whose frames without positions follow in time."""
_TIMES = (
    "TemporalPositionIndex", "TemporalPositionIdentifier", "NominalCardiacTriggerDelayTime", "TriggerTime",
    "EffectiveEchoTime", "EchoTime", "EchoNumbers", "DiffusionBValue", "InversionTime", "FrameReferenceTime",
    "AcquisitionNumber", "AcquisitionDateTime", "FrameAcquisitionDateTime", "AcquisitionTime", "ContentTime",
    "ComplexImageComponent", "FrameType", "ImageType",
)
"""Attributes by which volumes in one place differ."""


def _library(name: str) -> Any:
    return library(name, extra="dicom", purpose="reading DICOM")


@dataclass(frozen=True, eq=False)
class _Plane:
    """A frame of a file; its header holds the attributes of the frame before those of all frames."""

    path: Path
    number: int
    header: Any

    def get(self, *names: str) -> Any:
        """Give the first of these attributes that has a value."""
        return next((value for name in names if (value := self.header.get(name)) not in (None, "")), None)

    def __str__(self) -> str:
        return f"frame {self.number} of " * ("NumberOfFrames" in self.header) + plain(self.path.name)

    @cached_property
    def axes(self) -> Array:
        """Steps along a row and a column and the unit normal, as columns."""
        down, right = map(float, self.get(*_SPACINGS) or (1, 1))
        row, column = np.reshape(self.get("ImageOrientationPatient") or (1, 0, 0, 0, 1, 0), (2, 3)).astype(np.float64)
        return np.array([row * right, column * down, np.cross(row, column)]).T

    @cached_property
    def corner(self) -> Array | None:
        """Position of the first sample, if it is known."""
        found, offsets = self.get("ImagePositionPatient"), self.get("GridFrameOffsetVector")
        count = int(self.get("NumberOfFrames") or 1)
        if count == 1 or "PerFrameFunctionalGroupsSequence" in self.header:
            offsets = [0.0] * count
        if not found or not self.get("ImageOrientationPatient") or offsets is None:
            return None
        return np.array(found, np.float64) + self.axes[:, 2] * float(offsets[self.number] - offsets[0])

    @property
    def kind(self) -> tuple[Any, ...]:
        """Attributes that slices of a volume have in common."""
        return self.header.Rows, self.header.Columns, self.get("StackID"), self.corner is None

    @property
    def scaling(self) -> tuple[float, float]:
        """Slope and intercept."""
        slope = self.get("RescaleSlope", "DoseGridScaling", "RealWorldValueSlope")
        return float(slope or 1), float(self.get("RescaleIntercept", "RealWorldValueIntercept") or 0)

    def values(self, raw: Array, channel: int) -> Array:
        """Choose a colour of stored samples, or rescale them and mask those that only fill the picture."""
        pixels = _library("pydicom.pixels")
        if self.get("PhotometricInterpretation") == "PALETTE COLOR":
            raw = pixels.apply_color_lut(raw, self.header)
        if raw.ndim > 2:
            return raw[..., channel]
        table = "ModalityLUTSequence" in self.header
        found = np.ma.asarray(pixels.apply_modality_lut(raw, self.header) if table else scaled(raw, *self.scaling))
        low, high = (self.get(*(f"{name}{end}" for name in _PADDING)) for end in ("Value", "RangeLimit"))
        if low is not None:
            low, high = sorted(np.array([low, low if high is None else high]).astype(raw.dtype))
            found[(low <= raw) & (raw <= high)] = np.ma.masked
        return found


_Arranged = tuple[list[list[_Plane]], Array, str]
"""Volumes in one place, the matrix of their samples to the left, back and top, and by what they differ."""


def open_(
    path: Path, key: str | None = None, frame: int | None = None, frames: bool = False, band: int | None = None
) -> Field | Frames:
    """Read a file of DICOM, or the series in a folder and those below it.

    Parameters
    ----------
    path : path
    key : str, optional
        Series, by number, description or UID; stack of slices of a direction; or segment of a segmentation, by its
        number or label, which has 1 within. Without a key all segments are read, as labels.
    frame : int, optional
        Volume of several in one place, counted from 0.
    frames : bool
        Give all of these.
    band : int, optional
        Colour, counted from 1.

    Returns
    -------
    Field or Frames
        With axes i, j (, k) and values rescaled as each slice states; integers stay integers if all do so by whole
        numbers. Fractions of a segment are from 0 to 1. Padding is missing.

    Raises
    ------
    InputError
        If slices are missing, lie in one place or at uneven steps, or a choice is left open.
    OptionError, MissingExtraError
    """
    remarks = list[str]()
    with reading("DICOM"):
        warnings.filterwarnings("error", _CUT)
        planes, key = _series(_planes(path, remarks), key)
        if "SegmentationType" in planes[0].header:
            field, _ = _segmentation(planes, key), channel_of(1, band)
            return of_frames(lambda number: field, 1, frame, frames)
        planes = _stack(planes, key, remarks)
        first = planes[0]
        palette = first.get("PhotometricInterpretation") == "PALETTE COLOR"
        colours = 3 if palette else int(first.get("SamplesPerPixel") or 1)
        channel = channel_of(colours, band)
        volumes, matrix, differ = _arranged(planes)
    axes = kept_axes((first.header.Columns, first.header.Rows, len(volumes[0])))
    if first.corner is not None:
        place = in_body(matrix, axes, lps=True)
    else:
        place = by_matrix(matrix[: len(axes)], axes, unit="mm")
        remarks += ["the positions of its slices are unknown"] * (2 in axes)
    needed = [first.get(*_SPACINGS), first.get("SpacingBetweenSlices")]
    known = first.corner is not None or all(needed[: len(axes) - 1])
    unit = first.get("RescaleType", "Units", "DoseUnits") if colours == 1 else None
    unit = None if unit in (None, "US") else one_line(str(unit))
    mixed = len(volumes) > 1 and len({each.scaling for each in planes}) > 1

    def at(number: int) -> Field:
        values = list[Array]()
        with reading("DICOM"):
            warnings.filterwarnings("error", _CUT)
            for file, some in groupby(volumes[number], lambda each: each.path):
                planes = [*some]
                found = _library("pydicom.pixels").iter_pixels(file, indices=[each.number for each in planes])
                values += [plane.values(raw, channel).T for plane, raw in zip(planes, found, strict=True)]
            samples: Array = np.ma.stack(values, -1)
        # all volumes have one type
        samples = samples.astype(np.float64) if mixed else samples
        return squeezed(samples, place if known else None, remarks, unit=unit)

    return of_frames(at, len(volumes), frame, frames, differ)


def is_volume(thing: Any) -> bool:
    """Whether this is a Volume of highdicom."""
    return hasattr(thing, "affine") and hasattr(thing, "coordinate_system")


def of_volume(volume: Any) -> Field:
    """Read a Volume of highdicom: values as it has them, with the axes columns, rows, slices.

    Raises
    ------
    InputError
        If it has channels.
    """
    values = np.asarray(volume.array).T
    if values.ndim > 3:
        raise InputError(f"holds channels, an array of shape {values.shape[::-1]}", code="colour",
                         remedy="choose one: volume.with_array(volume.array[..., 0])")
    axes, matrix = kept_axes(values.shape), np.asarray(volume.affine)[:3, [2, 1, 0, 3]]
    body = volume.coordinate_system.name == "PATIENT"
    place = in_body(matrix, axes, lps=True) if body else by_matrix(matrix, axes, unit="mm")
    return squeezed(values, place)


# ---- files and series ------------------------------------------------------------------------------------------------


def _planes(path: Path, remarks: list[str]) -> list[_Plane]:
    """Frames of all files that hold samples."""
    pydicom, found, others = _library("pydicom"), list[_Plane](), list[str]()
    for one in [each for each in sorted(path.rglob("*")) if each.is_file()] or [path]:
        if one != path and one.suffix.lower() != ".dcm" and not pydicom.misc.is_dicom(one):
            others.append("not DICOM")
            continue
        header = pydicom.dcmread(one, defer_size=_LONG)
        count, syntax = int(header.get("NumberOfFrames") or 1), header.file_meta.TransferSyntaxUID
        described = len(header.get("PerFrameFunctionalGroupsSequence") or range(count))
        if "TotalPixelMatrixRows" in header or described != count:
            raise InputError(f"is a picture of tiles, or states {count} frames and the places of {described}",
                             code="shape")
        if syntax.is_deflated or int(header.get("HighBit") or 0) >= int(header.get("BitsStored") or 64):
            raise InputError("is deflated as a whole, or has samples in high bits of words", code="unreadable",
                             remedy="write it in another way first, as by dcmconv +te IN OUT")
        if any(tag in header for tag in _SAMPLES):
            found += [_Plane(one, number, _flat(header, number)) for number in range(count)]
        elif "Rows" in header or "Image Storage" in header.SOPClassUID.name:
            raise InputError(f"is cut short: {plain(one.name)} does not have all samples", code="unreadable")
        else:
            others.append(plain(header.SOPClassUID.name))
    named = ", ".join(sorted({*others}))
    if not found:
        raise InputError(f"holds no samples ({named})", code="unreadable", remedy="give a file or folder of slices")
    if others:
        remarks.append(f"files without samples are left out: {len(others)} ({named})")
    return found


def _flat(header: Any, number: int) -> Any:
    """Header with what its sequences state of one frame, which comes first."""
    groups = [some[number % len(some)] for name in ("Shared", "PerFrame")
              if (some := header.get(f"{name}FunctionalGroupsSequence"))]
    nested = [each.value[0] for group in groups for each in group
              if each.VR == "SQ" and each.value and not each.tag.is_private]
    flat = _library("pydicom").Dataset() if nested else header
    for each in [header, *nested] * bool(nested):
        flat.update(each)
    return flat


def _named(what: str, names: Mapping[Any, Sequence[str]], key: str | None) -> Any:
    """Choose the only one that has a name; errors list the last name of each."""
    found = [each for each, known in names.items() if key is None or key in known]
    if len(found) == 1:
        return found[0]
    return choose([known[-1] for known in names.values()], None if found else key, what)


def _series(planes: list[_Plane], key: str | None) -> tuple[list[_Plane], str | None]:
    """Frames of one series, and the key if it does not name a series."""
    series, names = dict[str, list[_Plane]](), dict[str, list[str]]()
    for plane in planes:
        series.setdefault(str(plane.get("SeriesInstanceUID")), []).append(plane)
    for uid, some in series.items():
        known = [str(name) for name in map(some[0].get, ("SeriesNumber", "SeriesDescription")) if name]
        about = f"({some[0].get('Modality')}, {len(some)} slices, {uid})"
        names[uid] = [uid, *known, " ".join([*known, about])]
    # a number names a segment rather than the series
    if len(series) > 1 or (key in names[uid] and not planes[0].get("SegmentSequence")):
        return series[_named("series", names, key)], None
    return planes, key


def _stack(planes: list[_Plane], key: str | None, remarks: list[str]) -> list[_Plane]:
    """Frames of one size and direction; localizers and copies are left out."""
    names = "SOPInstanceUID", "InstanceNumber", "ImagePositionPatient"
    once = {(each.number, *(str(each.get(name) or each.path) for name in names)): each for each in planes[::-1]}
    if len(once) < len(planes):
        remarks.append(f"copies of other slices are left out: {len(planes) - len(once)}")
    stacks = list[list[_Plane]]()
    for plane in reversed(once.values()):
        some = next((each for each in stacks if each[0].kind == plane.kind
                     and np.allclose(each[0].axes, plane.axes, rtol=0, atol=_ALIKE)), [])
        stacks += [some] * (not some)
        some.append(plane)
    larger = [some for some in stacks if len(some) > 1]
    if key is None and len(larger) == 1 and len(larger[0]) > 2:
        stacks = larger
    called = dict[int, tuple[str, ...]]()
    for number, some in enumerate(stacks):
        way = ("sagittal", "coronal", "axial")[np.abs(some[0].axes[:, 2]).argmax()]
        name = some[0].get("StackID") or way
        called[number] = name, f"{name}-{number}", f"'{name}-{number}' of {len(some)}"
    chosen = stacks[_named("stacks of different sizes or directions", called, key)]
    if key is None and len(chosen) < len(once):
        remarks.append(f"localizers, or slices of other sizes or directions, are left out: {len(once) - len(chosen)}")
    return chosen


def _segmentation(planes: list[_Plane], key: str | None) -> Field:
    """Labels of all segments, 1 within one, or fractions of it; with a further empty slice at both ends."""
    header, paths = planes[0].header, {each.path for each in planes}
    if len(paths) > 1:
        raise InputError(f"holds {len(paths)} segmentations", code="key", remedy="give the file of one")
    labels = {int(each.SegmentNumber): str(each.SegmentLabel) for each in header.SegmentSequence}
    names = {number: (str(number), label, f"{number} '{label}'") for number, label in labels.items()}
    one = key is not None or header.SegmentationType == "FRACTIONAL"
    chosen = [_named("segments", names, key)] if one else None
    read = _library("highdicom").seg.segread(planes[0].path)
    volume = read.get_volume(segment_numbers=chosen, combine_segments=not one)
    return of_volume(volume.squeeze_channel().pad([(1, 1), (0, 0), (0, 0)])[::-1])


# ---- places of slices ------------------------------------------------------------------------------------------------


def _arranged(planes: list[_Plane]) -> _Arranged:
    """Slices of each volume in their order, which have to lie at even steps if their places are known."""
    first, differ = planes[0], ""
    between = abs(float(first.get("SpacingBetweenSlices", "SliceThickness") or 1))
    if first.corner is None:
        numbers = {(each.get("InstanceNumber"), each.number): each for each in planes}
        if len(numbers) < len(planes):
            raise InputError("holds slices without positions or numbers", code="slices", remedy="number them")
        planes = [numbers[each] for each in sorted(numbers)]
        film = len(planes) > 1 and first.get(*_FILMED) is not None
        volumes = [[each] for each in planes] if film else [planes]
        return volumes, np.column_stack([first.axes * [1, 1, between], np.zeros(3)]), "time" * film
    along = np.array([each.corner for each in planes]) @ first.axes[:, 2]
    order = np.argsort(along, kind="stable")
    where = np.cumsum(np.diff(along[order], prepend=along[order[0]]) > _TOGETHER)
    planes = [planes[each] for each in order]
    differ, groups = _times(planes, where)
    for some in groups:
        if {*where} - {*where[some]}:
            raise InputError(f"holds volumes (by {differ}) of different slices", code="slices",
                             remedy="add those that are missing")
    volumes = [[planes[each] for each in some] for some in groups]
    first, corners = volumes[0][0], np.array([each.corner for each in volumes[0]])
    last = len(corners) - 1
    step = (corners[-1] - corners[0]) / last if last else first.axes[:, 2] * between
    off = np.linalg.norm(corners - corners[0] - step * np.arange(len(corners))[:, None], axis=1)
    if off.max() > EVEN * np.linalg.norm(step):
        near = volumes[0][int(off.argmax())]
        raise InputError(f"holds slices with a gap or at uneven steps: {near} lies {off.max():g} mm off", code="slices",
                         remedy="add the missing slices, or resample them at even steps, as dcm2niix does")
    return volumes, np.column_stack([first.axes[:, :2], step, corners[0]]), differ


def _times(planes: list[_Plane], where: Array) -> tuple[str, list[list[int]]]:
    """Find the attribute by which frames in one place differ, and the frames of each volume."""
    count = np.bincount(where)
    if count.max() == 1:
        return "", [[*range(len(planes))]]
    for name in _TIMES:
        values = [each.get(name) for each in planes]
        values = [str(value) if isinstance(value, Sequence) else value for value in values]
        if None in values or len({*values}) != count.max():
            continue
        groups = [[n for n, value in enumerate(values) if value == each] for each in sorted({*values})]
        if all(len({*where[some]}) == len(some) for some in groups):
            return name, groups
    one, other = (planes[each] for each in np.flatnonzero(where == np.argmax(count > 1))[:2])
    raise InputError(f"holds several slices in one place: {one} and {other}", code="slices",
                     remedy="keep those of one volume in a folder, or convert them by dcm2niix")
