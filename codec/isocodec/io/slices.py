"""DICOM: slices, files of many frames and segmentations, by pydicom; volumes of highdicom.

All lie in coordinates to the right, front and top of the body; axes are columns, rows, slices.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
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
from .libraries import choose, library, reading
from .places import EVEN, by_matrix, in_body, kept_axes
from .volumes import component, of_frames, placed_field, scaled

Array = NDArray[Any]
_LONG = 1 << 16
"""Bytes of elements that are not read with the header."""
_CUT = ".*[Uu]nexpected end of file|The end of the encapsulated pixel data"
"""Warnings of pydicom about files that are cut short, of which it then takes what there is."""
_ALIKE, _TOGETHER = 1e-4, 1e-3
"""Differences of directions and steps within a stack; distance in mm of slices that lie in one place."""
_SAMPLES = 0x7FE00008, 0x7FE00009, 0x7FE00010
"""Tags of samples."""
_SPACINGS = "PixelSpacing", "ImagerPixelSpacing", "NominalScannedPixelSpacing"
_PADDING = "PixelPadding", "FloatPixelPadding", "DoubleFloatPixelPadding"
_CINE = "FrameTime", "FrameTimeVector", "CineRate"
_FILMED = "US", "IVUS", "XA", "RF", "ES"
"""Modalities whose frames without positions follow in time."""
_TIMES = (
    "TemporalPositionIndex", "TemporalPositionIdentifier", "NominalCardiacTriggerDelayTime", "TriggerTime",
    "EffectiveEchoTime", "EchoTime", "EchoNumbers", "DiffusionBValue", "InversionTime", "FrameReferenceTime",
    "AcquisitionNumber", "AcquisitionDateTime", "FrameAcquisitionDateTime", "AcquisitionTime", "ContentTime",
    "ComplexImageComponent", "FrameType", "ImageType",
)
"""Attributes by which volumes in one place differ."""


def _pydicom(module: str = "") -> Any:
    return library(f"pydicom{module}", extra="dicom", purpose="reading DICOM")


@dataclass(frozen=True, eq=False)
class _Plane:
    """A frame of a file."""

    path: Path
    number: int
    header: Any

    @cached_property
    def _datasets(self) -> list[Any]:
        """Attributes of the frame, then those of all frames, then the file's."""
        own, shared = (self.header.get(f"{name}FunctionalGroupsSequence") for name in ("PerFrame", "Shared"))
        groups = [*([own[self.number]] if own else []), *(shared or [])[:1]]
        nested = [each.value[0] for group in groups for each in group
                  if each.VR == "SQ" and each.value and not each.tag.is_private]
        return [*nested, *(self.header.get("DetectorInformationSequence") or [])[:1], self.header]

    def get(self, *names: str) -> Any:
        """Give the first of these attributes that has a value."""
        values = (each.get(name) for name in names for each in self._datasets)
        return next((value for value in values if value is not None and value != ""), None)

    def __str__(self) -> str:
        return f"frame {self.number} of " * ("NumberOfFrames" in self.header) + plain(self.path.name)

    @property
    def size(self) -> tuple[int, int]:
        return int(self.header.Rows), int(self.header.Columns)

    @property
    def order(self) -> int:
        return int(self.get("InstanceNumber") or 0)

    @cached_property
    def axes(self) -> Array:
        """Steps along a row and a column and the unit normal, as columns; without a direction all zero."""
        between = self.get(*_SPACINGS) or (1.0, 1.0)
        row, column = np.array(self.get("ImageOrientationPatient") or np.zeros(6), np.float64).reshape(2, 3)
        return np.array([row * float(between[1]), column * float(between[0]), np.cross(row, column)]).T

    @cached_property
    def corner(self) -> Array | None:
        """Position of the first sample."""
        found, step, offset = self.get("ImagePositionPatient"), self.get("SpacingBetweenSlices"), 0.0
        if not found or not self.axes.any():
            return None
        if "PerFrameFunctionalGroupsSequence" not in self.header and _frames(self.header) > 1:
            offsets = self.get("GridFrameOffsetVector")
            if offsets is None and step is None:
                return None
            offset = float(step) * self.number if offsets is None else float(offsets[self.number] - offsets[0])
        return np.array(found, np.float64) + self.axes[:, 2] * offset

    @property
    def scaling(self) -> tuple[float, float]:
        """Slope and intercept."""
        slope = self.get("RescaleSlope", "DoseGridScaling", "RealWorldValueSlope")
        return float(slope or 1), float(self.get("RescaleIntercept", "RealWorldValueIntercept") or 0)

    def values(self, raw: Array, channel: int, segment: int | None) -> Array:
        """Rescale stored samples, without what other bits of their words hold, and with their sign."""
        kind, bits, most = self.get("SegmentationType"), int(self.get("BitsStored") or 0), 8 * raw.itemsize
        left = most - 1 - int(self.get("HighBit") or bits - 1)
        if kind == "BINARY":
            number = int(self.get("ReferencedSegmentNumber"))
            return np.where(raw, number, 0).astype(np.min_scalar_type(number))
        if kind == "LABELMAP":
            return raw if segment is None else np.where(raw == segment, raw, 0)
        if kind == "FRACTIONAL":
            return raw / float(self.get("MaximumFractionalValue"))
        if "PALETTE" in self.get("PhotometricInterpretation"):
            raw = _pydicom(".pixels").apply_color_lut(raw, self.header)
        if raw.ndim > 2:
            return raw[..., channel]
        if raw.dtype.kind in "iu" and 8 <= bits < most and left >= 0:
            raw = raw << left >> most - bits
        if self.get("ModalityLUTSequence"):
            return np.asarray(_pydicom(".pixels").apply_modality_lut(raw, self.header))
        return scaled(raw, *self.scaling)

    def padded(self, raw: Array) -> Array | bool:
        """Find stored samples that only fill the picture."""
        ends = [self.get(*(f"{name}{end}" for name in _PADDING)) for end in ("Value", "RangeLimit")]
        if ends[0] is None or raw.ndim > 2 or self.get("SegmentationType"):
            return False
        low, high = sorted(np.array([end for end in ends if end is not None] * 2)[:2].astype(raw.dtype))
        return np.asarray((low <= raw) & (raw <= high))


_Volume = list[list[_Plane]]
"""Frames of each slice: one, or of segmentations those of some segments."""
_Arranged = tuple[list[_Volume], Array | None, str]
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
        number or label. Without a key all segments are read, as labels.
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
        headers, key = _series(_headers(path, remarks), key)
        planes = [_Plane(one, number, header) for one, header in headers for number in range(_frames(header))]
        first, segment = planes[0], None
        if of_segments := bool(first.get("SegmentationType")):
            segments = first.get("SegmentSequence")
            labels = {int(each.SegmentNumber): str(each.get("SegmentLabel", "")) for each in segments}
            if key is not None or (first.get("SegmentationType") == "FRACTIONAL" and len(labels) > 1):
                segment = _named("segments", {n: (str(n), label, f"{n} '{label}'") for n, label in labels.items()}, key)
                planes = [each for each in planes if each.get("ReferencedSegmentNumber") in (None, segment)]
                if not planes:
                    raise InputError(f"holds no samples of segment {segment}", code="key")
                key = None
        planes = _stack(planes, key, remarks)
        first = planes[0]
        colours = 3 if "PALETTE" in first.get("PhotometricInterpretation") else int(first.get("SamplesPerPixel") or 1)
        channel = component(colours, band)
        volumes, matrix, differ = (_segmented if of_segments else _arranged)(planes)
    whole = (*first.size[::-1], len(volumes[0]))
    axes = kept_axes(whole)
    place = None if matrix is None else in_body(matrix, axes, lps=True)
    if matrix is None and first.get(*_SPACINGS) and (2 not in axes or first.get("SpacingBetweenSlices")):
        between = [float(each) for each in (*first.get(*_SPACINGS), first.get("SpacingBetweenSlices") or 1)]
        place = by_matrix(np.diag([between[1], between[0], between[2]])[: len(axes)] @ np.eye(3, 4), axes, unit="mm")
    if matrix is None and 2 in axes:
        remarks.append("the positions of its slices are unknown")
    unit = None if of_segments or colours > 1 else first.get("RescaleType", "Units", "DoseUnits")
    unit = None if unit in (None, "US") else one_line(str(unit))

    mixed = len(volumes) > 1 and len({each.scaling for each in planes}) > 1

    def at(number: int) -> Field:
        with reading("DICOM"):
            warnings.filterwarnings("error", _CUT)
            values, gone = _read(volumes[number], channel, segment)
            values = values.astype(np.float64) if mixed else values  # all volumes have one type
        shape = [whole[axis] for axis in axes]
        return placed_field(values.reshape(shape), gone.reshape(shape), place, remarks, unit=unit)

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
    return placed_field(values.reshape([values.shape[axis] for axis in axes]), None, place)


# ---- files and series ------------------------------------------------------------------------------------------------


def _frames(header: Any) -> int:
    return int(header.get("NumberOfFrames") or 1)


def _counted(path: Path) -> list[str | int]:
    """Key of names whose numbers are counted: IM2 before IM10."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", str(path))]


def _headers(path: Path, remarks: list[str]) -> list[tuple[Path, Any]]:
    """Headers of the files that hold samples."""
    pydicom, found, others = _pydicom(), list[tuple[Path, Any]](), list[str]()
    files = [Path(folder, name) for folder, _, names in os.walk(path) for name in names] or [path]
    for one in sorted(files, key=_counted):
        try:
            header = pydicom.dcmread(one, defer_size=_LONG, force=True)
            kind = plain(header.SOPClassUID.name)
        except Exception:
            if one == path or pydicom.misc.is_dicom(one) or one.suffix.lower() == ".dcm":
                raise
            continue  # beside slices lie texts, pictures, ..
        if "TransferSyntaxUID" not in header.file_meta:
            implicit, little = header.original_encoding
            name = f"{'Implicit' if implicit else 'Explicit'}VR{'Little' if little else 'Big'}Endian"
            header.file_meta.TransferSyntaxUID = getattr(pydicom.uid, name)
        described = len(header.get("PerFrameFunctionalGroupsSequence") or "") or _frames(header)
        if "TotalPixelMatrixRows" in header or described != _frames(header):
            raise InputError(f"is a picture of tiles, or states {_frames(header)} frames and the places of {described}",
                             code="shape")
        held, syntax = [each for tag, each in header.items() if tag in _SAMPLES], header.file_meta.TransferSyntaxUID
        packed = syntax.is_encapsulated or syntax.is_deflated
        if held and (packed or held[0].value_tell + held[0].length <= one.stat().st_size):
            header.PhotometricInterpretation = header.get("PhotometricInterpretation") or ""
            found.append((one, header))
        elif "Rows" in header or "Image Storage" in kind:
            raise InputError(f"is cut short: {plain(one.name)} does not have all samples", code="unreadable")
        elif "Directory" not in kind:
            others.append(kind)
    named = ", ".join(sorted({*others})) or "no file of DICOM"
    if not found:
        raise InputError(f"holds no samples ({named})", code="unreadable", remedy="give a file or folder of slices")
    if others:
        remarks.append(f"files without samples are left out: {len(others)} ({named})")
    return found


def _named(what: str, names: Mapping[Any, Sequence[str]], key: str | None) -> Any:
    """Choose the only one that has a name; errors list the last name of each."""
    found = [each for each, known in names.items() if key is None or key in known]
    if len(found) == 1:
        return found[0]
    return choose([known[-1] for known in names.values()], None if found else key, what)


def _series(files: list[tuple[Path, Any]], key: str | None) -> tuple[list[tuple[Path, Any]], str | None]:
    """Files of one series, and the key if it does not name a series."""
    series: dict[str, list[tuple[Path, Any]]] = {}
    for path, header in files:
        series.setdefault(str(header.get("SeriesInstanceUID")), []).append((path, header))
    names = {}
    for uid, some in series.items():
        first, slices = some[0][1], sum(_frames(header) for _, header in some)
        known = [str(first.get(name)) for name in ("SeriesNumber", "SeriesDescription") if first.get(name)]
        names[uid] = [uid, *known, f"{' '.join([*known, ''])}({first.get('Modality', '?')}, {slices} slices, {uid})"]
    if len(series) > 1 or key in next(iter(names.values())):
        return series[_named("series", names, key)], None
    return files, key


def _stack(planes: list[_Plane], key: str | None, remarks: list[str]) -> list[_Plane]:
    """Frames of one size and direction; localizers and copies are left out."""
    names = "SOPInstanceUID", "InstanceNumber", "ImagePositionPatient"
    once = {(each.number, *(str(each.get(name) or each.path) for name in names)): each for each in planes[::-1]}
    if len(once) < len(planes):
        remarks.append(f"copies of other slices are left out: {len(planes) - len(once)}")
    shown = {"LOCALIZER", "SCOUT"}
    kept = [each for each in once.values() if key or not shown & {*(each.get("ImageType") or ())}] or once.values()
    stacks: list[list[_Plane]] = []
    for plane in reversed([*kept]):
        for some in stacks:
            if (
                plane.size == some[0].size and plane.get("StackID") == some[0].get("StackID")
                and (plane.corner is None) == (some[0].corner is None)
                and np.allclose(plane.axes, some[0].axes, rtol=0, atol=_ALIKE)
            ):
                some.append(plane)
                break
        else:
            stacks.append([plane])
    if key is None and max(map(len, stacks)) > 2 and sum(len(some) > 1 for some in stacks) == 1:
        stacks = [max(stacks, key=len)]
    called = dict[int, tuple[str, str]]()
    for number, some in enumerate(stacks):
        way = ("sagittal", "coronal", "axial")[np.abs(some[0].axes[:, 2]).argmax()]
        name = str(some[0].get("StackID") or way)
        name += f"-{number}" * any(name in known for known in called.values())
        called[number] = name, f"'{name}' of {len(some)}"
    chosen = stacks[_named("stacks of different sizes or directions", called, key)]
    if key is None and len(chosen) < len(once):
        remarks.append(f"localizers, or slices of other sizes or directions, are left out: {len(once) - len(chosen)}")
    return chosen


def _decoded(volume: _Volume) -> Iterator[tuple[int, _Plane, Array]]:
    """Frames as they are stored, each with the number of its slice; each file is opened once."""
    every = [(number, plane) for number, planes in enumerate(volume) for plane in planes]
    for path, group in groupby(sorted(every, key=lambda each: each[1].path), lambda each: each[1].path):
        some = [*group]
        header = some[0][1].header
        whole = header.file_meta.TransferSyntaxUID.is_deflated or not header.preamble
        frames = _pydicom(".pixels").iter_pixels(header if whole else path, indices=[each.number for _, each in some])
        for (number, plane), raw in zip(some, frames, strict=True):
            yield number, plane, raw


def _read(volume: _Volume, channel: int, segment: int | None) -> tuple[Array, Array]:
    """Values and what is missing of them, with the axes columns, rows, slices."""
    found, gone, size = [np.zeros((), np.uint8)] * len(volume), [np.array(False)] * len(volume), (0, 0)
    for number, plane, raw in _decoded(volume):
        values, before, size = plane.values(raw, channel, segment), found[number], plane.size
        if before.any() and (both := values[(values != 0) & (before != 0) & (values != before)]).size:
            raise InputError(f"segments overlap in {plane}: {both[0]} and another", code="labels",
                             remedy=f"choose one with --key {both[0]}")
        found[number] = np.maximum(before, values) if before.any() else values
        gone[number] = np.asarray(plane.padded(raw))
    values, missing = (np.stack([np.broadcast_to(each, size).T for each in some], -1) for some in (found, gone))
    return values, missing


# ---- places of slices ------------------------------------------------------------------------------------------------


def _arranged(planes: list[_Plane]) -> _Arranged:
    """Slices of each volume in their order, which have to lie at even steps."""
    if planes[0].corner is None:
        if len(planes) > 1 and (planes[0].get(*_CINE) is not None or planes[0].get("Modality") in _FILMED):
            return [[[each]] for each in planes], None, "time"
        return [[[each] for each in sorted(planes, key=lambda each: each.order)]], None, ""
    planes, where = _sorted(planes)
    differ, groups = _times(planes, where)
    for some in groups:
        if absent := {*where} - {*where[some]}:
            near = planes[int(np.flatnonzero(where == min(absent))[0])]
            raise InputError(f"holds volumes (by {differ}) of different slices: not all have slice {min(absent)}, as "
                             f"{near} is", code="slices", remedy="add the missing slices")
    first = [planes[each] for each in groups[0]]
    corners = np.array([each.corner for each in first])
    if len(first) == 1:
        step = first[0].axes[:, 2] * abs(float(first[0].get("SpacingBetweenSlices", "SliceThickness") or 1))
    else:
        step = (corners[-1] - corners[0]) / (len(first) - 1)
        off = np.linalg.norm(corners - corners[0] - step * np.arange(len(first))[:, None], axis=1).max()
        if off > EVEN * np.linalg.norm(step):
            gaps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
            usual = np.median(gaps)
            at = int(np.abs(gaps - usual).argmax())
            lost = round(float(gaps[at] / usual)) - 1
            raise InputError(
                f"holds slices {'with a gap' if lost > 0 else 'at uneven steps'}: {gaps[at]:g} mm between slices {at} "
                f"and {at + 1} ({first[at]}, {first[at + 1]}), {usual:g} mm between others", code="slices",
                remedy=f"add the missing {lost}" if lost > 0 else "resample them at even steps, as dcm2niix does")
    matrix = np.column_stack([first[0].axes[:, :2], step, corners[0]])
    return [[[planes[each]] for each in some] for some in groups], matrix, differ


def _sorted(planes: list[_Plane]) -> tuple[list[_Plane], NDArray[np.int64]]:
    """Frames in their order along the normal, and the number of the slice of each."""
    along = np.array([each.corner for each in planes]) @ planes[0].axes[:, 2]
    order = np.argsort(along, kind="stable")
    return [planes[each] for each in order], np.cumsum(np.diff(along[order], prepend=along[order[0]]) > _TOGETHER)


def _times(planes: list[_Plane], where: NDArray[np.int64]) -> tuple[str, list[list[int]]]:
    """Find the attribute by which frames in one place differ, and the frames of each volume."""
    count = np.bincount(where)
    if count.max() == 1:
        return "", [[*range(len(planes))]]
    for name in _TIMES:
        values = [each.get(name) for each in planes]
        values = [value if isinstance(value, str | int | float | None) else tuple(value) for value in values]
        if None in values or len({*values}) != count.max():
            continue
        groups = [[n for n, value in enumerate(values) if value == each] for each in sorted({*values})]
        if all(len({*where[some]}) == len(some) for some in groups):
            return name, groups
    keys = [(each.order, each.number) for each in planes]
    if len({*count}) == 1 and len({*keys}) == len(keys):
        order = np.array(sorted(range(len(keys)), key=keys.__getitem__))
        # volume after volume, or slice after slice; any other order could mix them
        for volumes in (order.reshape(count[0], -1), order.reshape(-1, count[0]).T):
            if (where[volumes] == where[volumes[0]]).all() and len({*where[volumes[0]]}) == len(count):
                return "InstanceNumber", [sorted(some, key=where.__getitem__) for some in volumes.tolist()]
    slice = int(np.argmax(count > 1))
    one, other = (planes[each] for each in np.flatnonzero(where == slice)[:2])
    raise InputError(f"holds several slices in one place: {one} and {other} (slice {slice})", code="slices",
                     remedy="keep one of them, or those of one volume, in a folder")


def _segmented(planes: list[_Plane]) -> _Arranged:
    """Slices of a segmentation, which leaves out empty ones: those between others, and one more at both ends."""
    if planes[0].corner is None:
        if len(planes) > len(planes[0].get("SegmentSequence")):
            raise InputError("is a segmentation of slices without positions", code="slices")
        return [[planes]], None, ""
    planes, where = _sorted(planes)
    corners = np.array([planes[at].corner for at in np.unique(where, return_index=True)[1]])
    gaps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    # what a file states may be the thickness of its slices
    stated = planes[0].get("SpacingBetweenSlices"), gaps.min() if len(gaps) else planes[0].get("SliceThickness"), 1.0
    for distance in (float(each) for each in stated if each):
        skips = np.rint(gaps / distance)
        if np.abs(gaps - skips * distance).max(initial=0) <= EVEN * distance:
            break
    else:
        raise InputError("holds slices at uneven steps", code="slices", remedy="resample them at even steps")
    slices = np.cumsum([1, *skips]).astype(np.int64)
    step = (corners[-1] - corners[0]) / (slices[-1] - 1) if len(gaps) else planes[0].axes[:, 2] * distance
    volume: _Volume = [[] for _ in range(slices[-1] + 2)]
    for plane, number in zip(planes, where, strict=True):
        volume[slices[number]].append(plane)
    return [volume], np.column_stack([planes[0].axes[:, :2], step, corners[0] - step]), ""
