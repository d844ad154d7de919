"""DICOM: slices, files of many frames and segmentations, by pydicom; volumes of highdicom.

All lie in coordinates to the right, front and top of the body; axes are columns, rows, slices.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..errors import InputError, one_line, plain
from ..field.framed import Frames
from ..field.placement import Placement
from ..field.sampled import Field
from .libraries import choose, library, reading
from .placing import EVEN, by_matrix, in_body, kept_axes
from .volumes import check_frame, component, of_frames, placed_field, scaled

__all__ = ["is_volume", "of_volume", "open_"]

Array = NDArray[Any]
_LONG = 1 << 16
"""Bytes of elements that are not read with the header; most slices of a segmentation."""
_ALIKE, _TOGETHER = 1e-4, 1e-3
"""Differences of directions and steps within a stack; distance in mm of slices that lie in one place."""
_SAMPLES = "PixelData", "FloatPixelData", "DoubleFloatPixelData"
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
        own, shared = (self.header.get(f"{name}FunctionalGroupsSequence") or [] for name in ("PerFrame", "Shared"))
        groups = [*own[self.number : self.number + 1], *shared[:1]]
        nested = [each.value[0] for group in groups for each in group
                  if each.VR == "SQ" and each.value and not each.tag.is_private]
        return [*nested, *(self.header.get("DetectorInformationSequence") or [])[:1], self.header]

    def get(self, *names: str) -> Any:
        """Give the first of these attributes that has a value."""
        values = (each.get(name) for name in names for each in self._datasets)
        return next((value for value in values if value is not None and value != ""), None)

    @property
    def name(self) -> str:
        return f"frame {self.number} of " * (_frames(self.header) > 1) + plain(self.path.name)

    @property
    def size(self) -> tuple[int, int]:
        return int(self.header.Rows), int(self.header.Columns)

    @cached_property
    def axes(self) -> Array:
        """Steps along a row and a column and the unit normal, as columns; without a direction all zero."""
        between = self.get(*_SPACINGS) or (1.0, 1.0)
        row, column = np.array(self.get("ImageOrientationPatient") or np.zeros(6), np.float64).reshape(2, 3)
        return np.array([row * float(between[1]), column * float(between[0]), np.cross(row, column)]).T

    @cached_property
    def corner(self) -> Array | None:
        """Position of the first sample."""
        found, offset = self.get("ImagePositionPatient"), 0.0
        if not found or not self.axes[:, 2].any():
            return None
        if "PerFrameFunctionalGroupsSequence" not in self.header and _frames(self.header) > 1:
            offsets, step = self.get("GridFrameOffsetVector"), self.get("SpacingBetweenSlices")
            if offsets is None and step is None:
                return None
            offset = float(step) * self.number if offsets is None else float(offsets[self.number]) - float(offsets[0])
        return np.array(found, np.float64) + self.axes[:, 2] * offset

    def follows(self, other: _Plane) -> bool:
        """Whether two belong to one stack."""
        return (
            self.size == other.size and self.get("StackID") == other.get("StackID")
            and (self.corner is None) == (other.corner is None)
            and np.allclose(self.axes, other.axes, rtol=0, atol=_ALIKE)
        )

    @property
    def rescaling(self) -> tuple[float, float] | None:
        """Slope and intercept; None if values are taken from a table."""
        if self.header.get("ModalityLUTSequence"):
            return None
        if self.header.get("SegmentationType") == "FRACTIONAL":
            return 1 / float(self.header.MaximumFractionalValue), 0.0
        slope = self.get("RescaleSlope", "DoseGridScaling", "RealWorldValueSlope")
        return float(slope or 1), float(self.get("RescaleIntercept", "RealWorldValueIntercept") or 0)

    def values(self, raw: Array, channel: int) -> Array:
        """Rescale stored samples, without what other bits of their words hold, and with their sign."""
        if "PALETTE" in self.header.PhotometricInterpretation and raw.size:
            raw = _pydicom(".pixels").apply_color_lut(raw, self.header)
        if raw.ndim > 2:
            return np.asarray(raw[..., channel])
        bits, most = int(self.header.get("BitsStored") or 0), 8 * raw.itemsize
        left = most - 1 - int(self.header.get("HighBit") or bits - 1)
        if raw.dtype.kind in "iu" and 8 <= bits < most and left >= 0:
            raw = raw << left >> most - bits
        if self.rescaling is None:
            return np.asarray(_pydicom(".pixels").apply_modality_lut(raw, self.header))
        return scaled(raw, *self.rescaling)

    def padded(self, raw: Array) -> Array | bool:
        """Find stored samples that only fill the picture."""
        ends = [self.get(*(f"{name}{end}" for name in _PADDING)) for end in ("Value", "RangeLimit")]
        if ends[0] is None or raw.ndim > 2:
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
    """Read a file of DICOM, or the series in a folder and those below it; slices are read one at a time.

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
        numbers. Padding is missing.

    Raises
    ------
    InputError
        If slices are missing, lie in one place or at uneven steps, or a choice is left open.
    OptionError, MissingExtraError
    """
    path, remarks = Path(path), list[str]()
    with reading("DICOM"):
        headers, key = _series(_headers(path, remarks), key)
        planes = [_Plane(one, number, header) for one, header in headers for number in range(_frames(header))]
        kind = planes[0].header.get("SegmentationType")
        segment = None
        if kind:
            planes, segment, key = _of_segment(planes, kind, key)
        planes = _stack(planes, key, remarks)
        first = planes[0]
        palette = "PALETTE" in first.header.PhotometricInterpretation
        colours = 3 if palette else int(first.header.get("SamplesPerPixel") or 1)
        channel = component(colours, band)
        dtype = _type_of(planes, kind, colours)
        volumes, matrix, differ = (_segmented if kind else _arranged)(planes, remarks)
    whole = (*first.size[::-1], len(volumes[0]))
    axes = kept_axes(whole)
    place = _place_of(first, matrix, axes)
    unit = None if kind or colours > 1 else first.get("RescaleType", "Units", "DoseUnits")
    unit = None if unit in (None, "US") else one_line(str(unit))

    def at(number: int) -> Field:
        values = np.zeros(whole[::-1], dtype)
        gone = np.zeros(values.shape, np.bool_)
        with reading("DICOM"):
            for where, plane, raw in _decoded(volumes[number]):
                if kind in ("BINARY", "LABELMAP"):
                    _mark(values[where], plane, raw, kind, segment)
                else:
                    gone[where] = plane.padded(raw)
                    values[where] = plane.values(raw, channel)
        shape = [whole[axis] for axis in axes]
        return placed_field(values.T.reshape(shape), gone.T.reshape(shape), place, remarks, unit=unit)

    if len(volumes) == 1:
        check_frame(frame, 0)
        return at(0)
    return of_frames(at, [*(whole[axis] for axis in axes), len(volumes)], frame, frames, differ, remarks)


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
    values = np.asarray(volume.array)
    if values.ndim > 3:
        raise InputError(f"holds an array of shape {values.shape}, with channels", code="colour",
                         remedy="choose one: volume.with_array(volume.array[..., 0])")
    axes, matrix = kept_axes(values.T.shape), np.asarray(volume.affine)[:3, [2, 1, 0, 3]]
    body = volume.coordinate_system.name == "PATIENT"
    place = in_body(matrix, axes, lps=True) if body else by_matrix(matrix, axes, unit="mm")
    return placed_field(values.T.reshape([values.T.shape[axis] for axis in axes]), None, place)


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
            if "SOPClassUID" not in header and "Rows" not in header:
                raise ValueError("no header of DICOM")
        except Exception:
            if one == path or pydicom.misc.is_dicom(one) or one.suffix.lower() == ".dcm":
                raise
            continue  # beside slices lie texts, pictures, ..
        if not hasattr(header.file_meta, "TransferSyntaxUID"):
            implicit, little = header.original_encoding
            name = f"{'Implicit' if implicit else 'Explicit'}VR{'Little' if little else 'Big'}Endian"
            header.file_meta.TransferSyntaxUID = getattr(pydicom.uid, name)
        kind = plain(pydicom.uid.UID(header.get("SOPClassUID", "")).name)
        if "TotalPixelMatrixRows" in header:
            raise InputError("is a picture of tiles, such as of a slide", code="shape", remedy="export it as TIFF")
        if "Rows" in header and any(name in header for name in _SAMPLES):
            header.PhotometricInterpretation = header.get("PhotometricInterpretation") or ""
            described = len(header.get("PerFrameFunctionalGroupsSequence") or "") or _frames(header)
            if described != _frames(header):
                raise InputError(f"states {_frames(header)} frames, and the places of {described}", code="shape")
            found.append((one, header))
        elif "Rows" in header or "Image Storage" in kind:
            raise InputError(f"is cut short: {plain(one.name)} has no samples", code="unreadable")
        elif kind != "Media Storage Directory Storage":
            others.append(kind)
    named = ", ".join(sorted({*others})) or "no file of DICOM"
    if not found:
        raise InputError(f"holds no samples ({named})", code="unreadable", remedy="give a file or folder of slices")
    if others:
        remarks.append(f"files without samples are left out: {len(others)} ({named})")
    return found


def _named(what: str, names: dict[Any, Sequence[str]], key: str | None) -> Any:
    """Choose what a key names by one of several names; errors list the last of each."""
    known = {name: each for each, some in names.items() for name in some if name}
    if key in known:
        return known[key]
    return known[choose([some[-1] for some in names.values()], key, what)]


def _series(files: list[tuple[Path, Any]], key: str | None) -> tuple[list[tuple[Path, Any]], str | None]:
    """Files of one series, and the key if it does not name a series."""
    series: dict[str, list[tuple[Path, Any]]] = {}
    for path, header in files:
        series.setdefault(str(header.get("SeriesInstanceUID", "")), []).append((path, header))
    names: dict[Any, Sequence[str]] = {}
    for uid, some in series.items():
        first, slices = some[0][1], sum(_frames(header) for _, header in some)
        known = [str(first.get(name)) for name in ("SeriesNumber", "SeriesDescription") if first.get(name)]
        names[uid] = [uid, *known, f"{' '.join([*known, ''])}({first.get('Modality', '?')}, {slices} slices, {uid})"]
    if len(series) > 1 or key in next(iter(names.values())):
        return series[_named("series", names, key)], None
    return files, key


def _of_segment(planes: list[_Plane], kind: str, key: str | None) -> tuple[list[_Plane], int | None, str | None]:
    """Frames of the segment that a key names by its number or label, and its number; or all."""
    labels = {int(each.SegmentNumber): str(each.get("SegmentLabel", "")) for each in planes[0].header.SegmentSequence}
    if key is None and (kind != "FRACTIONAL" or len(labels) == 1):
        return planes, None, None
    number = _named("segments", {n: (str(n), label, f"{n} '{label}'") for n, label in labels.items()}, key)
    own = [each for each in planes if each.get("ReferencedSegmentNumber") in (None, number)]
    if not own:
        raise InputError(f"holds no samples of segment {number}", code="key")
    return own, number, None


def _stack(planes: list[_Plane], key: str | None, remarks: list[str]) -> list[_Plane]:
    """Frames of one size and direction; localizers and copies are left out."""
    names = "SOPInstanceUID", "InstanceNumber", "ImagePositionPatient"
    every = {(each.number, *(str(each.get(name) or each.path) for name in names)): each for each in planes[::-1]}
    once = [*every.values()][::-1]
    if len(once) < len(planes):
        remarks.append(f"copies of other slices are left out: {len(planes) - len(once)}")
    kept = [each for each in once if key or not {"LOCALIZER", "SCOUT"} & {*(each.get("ImageType") or ())}]
    stacks: dict[str, list[_Plane]] = {}
    for plane in kept or once:
        found = next((some for some in stacks.values() if plane.follows(some[0])), None)
        if found is None:
            name = str(plane.get("StackID") or ("sagittal", "coronal", "axial")[np.abs(plane.axes[:, 2]).argmax()])
            alike = sum(other.partition("-")[0] == name for other in stacks)
            found = stacks.setdefault(f"{name}-{alike + 1}" if alike else name, [])
        found.append(plane)
    counts = sorted(map(len, stacks.values()))
    if key is None and counts[-1] > 2 and all(count == 1 for count in counts[:-1]):
        stacks = {name: some for name, some in stacks.items() if len(some) == counts[-1]}
    chosen = stacks[_named("stacks of different sizes or directions", {
        name: (name, f"'{name}' of {len(some)}") for name, some in stacks.items()}, key)]
    if key is None and len(chosen) < len(once):
        remarks.append(f"localizers, or slices of other sizes or directions, are left out: {len(once) - len(chosen)}")
    return chosen


# ---- samples ---------------------------------------------------------------------------------------------------------


def _type_of(planes: list[_Plane], kind: str | None, colours: int) -> np.dtype[Any]:
    """Type that holds the values of all frames."""
    if kind == "BINARY":
        return np.min_scalar_type(max(int(each.get("ReferencedSegmentNumber")) for each in planes))
    types = set()
    for plane in {(id(each.header), each.rescaling): each for each in planes}.values():
        stored = _pydicom(".pixels.utils").pixel_dtype(plane.header, "PixelData" not in plane.header).newbyteorder("=")
        if "PALETTE" in plane.header.PhotometricInterpretation:
            stored = np.dtype(f"u{int(plane.header.RedPaletteColorLookupTableDescriptor[2]) // 8}")
        one = np.zeros((1, 1, 3)[: 2 + (colours > 1)], stored)
        types.add(stored if kind == "LABELMAP" else plane.values(one, 0).dtype)
    return np.result_type(*types)


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


def _mark(labels: Array, plane: _Plane, raw: Array, kind: str, segment: int | None) -> None:
    """Give the samples of a segment the number of the segment."""
    if kind == "LABELMAP":
        labels[...] = raw if segment is None else np.where(raw == segment, raw, 0)
        return
    number, inside = int(plane.get("ReferencedSegmentNumber")), raw != 0
    other = labels[inside & (labels != 0) & (labels != number)]
    if other.size:
        raise InputError(f"segments {other[0]} and {number} overlap in {plane.name}", code="labels",
                         remedy=f"choose one with --key {number}")
    labels[inside] = number


# ---- places of slices ------------------------------------------------------------------------------------------------


def _place_of(first: _Plane, matrix: Array | None, axes: Sequence[int]) -> Placement:
    """Place the samples in the body, or by the spacing between them alone, with a remark."""
    if matrix is not None:
        return in_body(matrix, axes, lps=True)
    within, between = first.get(*_SPACINGS), first.get("SpacingBetweenSlices")
    remark = "the positions of its slices are unknown" if 2 in axes else ""
    if within is None or (2 in axes and between is None):
        return Placement(remark=remark)
    steps = np.diag([float(step) for step in (within[1], within[0], between or 1)])
    return by_matrix(np.eye(len(axes), 3) @ steps @ np.eye(3, 4), axes, unit="mm", remark=remark)


def _arranged(planes: list[_Plane], remarks: list[str]) -> _Arranged:
    """Slices of each volume in their order."""
    if planes[0].corner is None:
        if len(planes) > 1 and (planes[0].get(*_CINE) is not None or planes[0].get("Modality") in _FILMED):
            return [[[each]] for each in planes], None, "time"
        return [[[each] for each in sorted(planes, key=lambda each: int(each.get("InstanceNumber") or 0))]], None, ""
    planes, where = _sorted(planes)
    differ, groups = _times(planes, where)
    for some in groups:
        if lost := {*where} - {*where[some]}:
            near = planes[int(np.flatnonzero(where == min(lost))[0])]
            raise InputError(f"holds volumes (by {differ}) of different slices: not all have slice {min(lost)}, as "
                             f"{near.name} is", code="slices", remedy="add the missing slices")
    first = [planes[each] for each in groups[0]]
    matrix = np.column_stack([first[0].axes[:, :2], _step(first), np.asarray(first[0].corner)])
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
    keys = [(int(each.get("InstanceNumber") or 0), each.number) for each in planes]
    if (count == count.max()).all() and len({*keys}) == len(keys):
        order = np.array(sorted(range(len(keys)), key=keys.__getitem__))
        # volume after volume, or slice after slice; any other order could mix them
        for volumes in (order.reshape(count.max(), -1), order.reshape(-1, count.max()).T):
            if (where[volumes] == where[volumes[0]]).all() and len({*where[volumes[0]]}) == len(count):
                return "InstanceNumber", [sorted(some, key=where.__getitem__) for some in volumes.tolist()]
    slice = int(np.argmax(count > 1))
    one, other = (planes[each].name for each in np.flatnonzero(where == slice)[:2])
    raise InputError(f"holds several slices in one place: {one} and {other} (slice {slice})", code="slices",
                     remedy="keep one of them, or those of one volume, in a folder")


def _step(slices: Sequence[_Plane]) -> Array:
    """Find the step from slice to slice, which has to be even."""
    if len(slices) == 1:
        thick = slices[0].get("SpacingBetweenSlices", "SliceThickness") or 1
        return np.asarray(slices[0].axes[:, 2] * abs(float(thick)))
    corners = np.array([each.corner for each in slices])
    step = np.asarray((corners[-1] - corners[0]) / (len(slices) - 1))
    off = np.linalg.norm(corners - corners[0] - step * np.arange(len(slices))[:, None], axis=1).max()
    if off <= EVEN * np.linalg.norm(step):
        return step
    gaps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    usual = float(np.median(gaps))
    at = int(np.abs(gaps - usual).argmax())
    lost = round(float(gaps[at]) / usual) - 1
    raise InputError(
        f"holds slices {'with a gap' if lost > 0 else 'at uneven steps'}: {gaps[at]:g} mm between slices {at} and "
        f"{at + 1} ({slices[at].name}, {slices[at + 1].name}), {usual:g} mm between others", code="slices",
        remedy=f"add the missing {lost}" if lost > 0 else "resample it at even steps (dcm2niix does)",
    )


def _segmented(planes: list[_Plane], remarks: list[str]) -> _Arranged:
    """Slices of a segmentation, which leaves out empty ones: those between others, and one more at both ends."""
    if planes[0].corner is None:
        if len(planes) > len(planes[0].header.SegmentSequence):
            raise InputError("is a segmentation of slices without positions", code="slices")
        return [[planes]], None, ""
    planes, where = _sorted(planes)
    corners = np.array([planes[at].corner for at in np.unique(where, return_index=True)[1]])
    gaps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    least = [gaps.min()] if len(gaps) else [planes[0].get("SliceThickness"), 1.0]
    for distance in (float(each) for each in (planes[0].get("SpacingBetweenSlices"), *least) if each):
        skips = np.rint(gaps / distance)
        if np.abs(gaps - skips * distance).max(initial=0) <= EVEN * distance:
            break
    else:
        raise InputError("holds slices at uneven steps", code="slices")
    slices = np.concatenate([[1], 1 + np.cumsum(skips)]).astype(np.int64)
    step = (corners[-1] - corners[0]) / (slices[-1] - 1) if len(gaps) else planes[0].axes[:, 2] * distance
    if slices[-1] > _LONG:
        raise InputError(f"states {slices[-1]:,} slices", code="slices")
    volume: _Volume = [[] for _ in range(slices[-1] + 2)]
    for plane, number in zip(planes, where, strict=True):
        volume[slices[number]].append(plane)
    return [volume], np.column_stack([planes[0].axes[:, :2], step, corners[0] - step]), ""
