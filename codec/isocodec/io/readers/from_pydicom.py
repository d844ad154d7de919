"""Pydicom reads DICOM: slices, files of many frames, segmentations; all in coordinates right, front and up."""

from __future__ import annotations

import math
import os
import re
import warnings
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...errors import InputError, LimitError, one_line, plain
from ...extras import optional
from ...field.placement import Placement
from .opened import Choice, Format
from .place_of_samples import EVEN, SLICE, placed, placed_volume, to_right_front_up
from .reading import channel_of, check_frame, named, reading
from .source import InputFile, is_dicom
from .volumes import OpenedVolumes, of_a_series, scaled, single, squeezed

Array = NDArray[Any]
_LONG = 1 << 16
"""Bytes of elements that are not read with the header."""
_STACKS = 1000
_ALIKE, _TOGETHER = 1e-4, 1e-3
"""Differences of directions and steps within a stack; distance in mm of slices that lie in one place."""
_PIXELS, _FLOATS = 0x7FE00010, (0x7FE00008, 0x7FE00009)
_OF_FRAMES = "PerFrameFunctionalGroupsSequence"
_SPACINGS = ("PixelSpacing", "ImagerPixelSpacing", "NominalScannedPixelSpacing")
_PADDING = ("PixelPadding", "FloatPixelPadding", "DoubleFloatPixelPadding")
_SHOWING = {"LOCALIZER", "SCOUT"}
_CINE = ("FrameTime", "FrameTimeVector", "CineRate")
_FILMED = ("US", "IVUS", "XA", "RF", "ES")
"""Modalities whose frames without positions follow in time."""
_TIMES = (
    "TemporalPositionIndex", "TemporalPositionIdentifier", "NominalCardiacTriggerDelayTime", "TriggerTime",
    "EffectiveEchoTime", "EchoTime", "EchoNumbers", "DiffusionBValue", "InversionTime", "FrameReferenceTime",
    "AcquisitionNumber", "AcquisitionDateTime", "FrameAcquisitionDateTime", "AcquisitionTime", "ContentTime",
    "ComplexImageComponent", "FrameType", "ImageType",
)
"""Attributes by which volumes in one place differ."""


@dataclass(frozen=True, eq=False)
class _Plane:
    """A frame of a file."""

    path: Path
    number: int
    header: Any

    @cached_property
    def _datasets(self) -> list[Any]:
        """Attributes of the frame, then those of all frames, then the file's."""
        own, shared = self.header.get(_OF_FRAMES), self.header.get("SharedFunctionalGroupsSequence")
        groups = [*([own[self.number]] if own else []), *(shared or [])[:1]]
        nested = [
            each.value[0] for group in groups for each in group
            if each.VR == "SQ" and each.value and not each.tag.is_private
        ]
        return [*nested, *(self.header.get("DetectorInformationSequence") or [])[:1], self.header]

    def get(self, *names: str) -> Any:
        """The first of these attributes that has a value."""
        values = (each.get(name) for name in names for each in self._datasets)
        return next((value for value in values if value is not None and value != ""), None)

    @property
    def name(self) -> str:
        return f"frame {self.number} of " * (_frames(self.header) > 1) + plain(self.path.name)

    @property
    def size(self) -> tuple[int, int]:
        return int(self.header.Rows), int(self.header.Columns)

    @cached_property
    def axes(self) -> NDArray[np.float64]:
        """Steps along a row and a column and the unit normal, as columns; without a direction all zero."""
        between = self.get(*_SPACINGS) or (1.0, 1.0)
        row, column = np.array(self.get("ImageOrientationPatient") or np.zeros(6), np.float64).reshape(2, 3)
        return np.array([row * float(between[1]), column * float(between[0]), np.cross(row, column)]).T

    @cached_property
    def corner(self) -> NDArray[np.float64] | None:
        """Position of the first sample."""
        found, offset = self.get("ImagePositionPatient"), 0.0
        if not found or not self.axes[:, 2].any():
            return None
        if not self.header.get(_OF_FRAMES) and _frames(self.header) > 1:
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
    def direction(self) -> str:
        """Name of its stack."""
        names = "sagittal", "coronal", "axial"
        return str(self.get("StackID") or names[np.abs(self.axes[:, 2]).argmax()])

    @property
    def rescaling(self) -> tuple[float, float] | None:
        """Slope and intercept; None if values are taken from a table."""
        if self.header.get("ModalityLUTSequence"):
            return None
        slope = self.get("RescaleSlope", "DoseGridScaling", "RealWorldValueSlope")
        return float(slope or 1), float(self.get("RescaleIntercept", "RealWorldValueIntercept") or 0)

    def padded(self, raw: Array) -> Array | bool:
        """Find the stored samples that only fill the picture."""
        ends = [self.get(*(f"{name}{end}" for name in _PADDING)) for end in ("Value", "RangeLimit")]
        if ends[0] is None:
            return False
        low, high = sorted(np.array([end for end in ends if end is not None] * 2)[:2].astype(raw.dtype))
        return np.asarray((low <= raw) & (raw <= high))

    def used(self, raw: Array) -> Array:
        """Stored samples without what other bits of their words hold, and with their sign."""
        bits, most = int(self.header.get("BitsStored") or 0), 8 * raw.itemsize
        left = most - 1 - int(self.header.get("HighBit") or bits - 1)
        return raw << left >> most - bits if raw.dtype.kind in "iu" and 8 <= bits < most and left >= 0 else raw


Volume = list[list[_Plane]]
"""Frames of each slice: one, or of segmentations those of some segments."""


class _Dicom(OpenedVolumes):
    """Slices of a folder, or the frames of a file; axes i, j, k, and a last one of volumes in one place."""

    def _open(self, choice: Choice) -> None:
        self._pixels = optional("pydicom.pixels", extra="dicom", purpose="reading DICOM")
        remarks: list[str] = []
        with reading("DICOM"):
            series, key = _series(_headers(self._source, remarks), choice.key)
            planes = [_Plane(path, number, header) for path, header in series for number in range(_frames(header))]
            self._segments, self._segment = planes[0].header.get("SegmentationType"), None
            if self._segments:
                planes, self._segment, key = _of_segment(planes, key)
            planes = _stack(planes, key, remarks)
            self._first = planes[0]
            self._palette = "PALETTE" in planes[0].header.PhotometricInterpretation and not self._segments
            colours = 3 if self._palette else int(planes[0].header.SamplesPerPixel)
            self._channel = channel_of(colours, choice.channel) if colours > 1 or choice.channel else None
            self.dtype = self._type(planes)
            arranged = _segmented if self._segments else _arranged
            self._volumes, self._matrix, self._by = arranged(planes, choice.slice_tolerance, remarks)
            shape = (*self._first.size[::-1], len(self._volumes[0]), len(self._volumes))
            self._source.check_count(math.prod(shape) * colours)
        self.shape, self._whole, self.remarks = squeezed(shape), shape, tuple(remarks)
        unit = None if self._segments or colours > 1 else self._first.get("RescaleType", "Units", "DoseUnits")
        self.unit = None if unit in (None, "US") else one_line(str(unit))

    def _type(self, planes: list[_Plane]) -> np.dtype[Any]:
        if self._segments == "BINARY":
            return np.min_scalar_type(max(int(each.get("ReferencedSegmentNumber")) for each in planes))
        found = []
        for plane in {(id(each.header), each.rescaling): each for each in planes}.values():
            stored = self._pixels.utils.pixel_dtype(plane.header, _PIXELS not in plane.header).newbyteorder("=")
            one = np.zeros((1, 1, 3)[: 2 + (plane.header.SamplesPerPixel > 1)], stored)
            found.append(stored if self._segments else self._rescaled(plane, one).dtype)
        return np.result_type(*found)

    def _values(self, frame: int | None) -> Array:
        if frame is None and self._several:
            raise of_a_series(self._whole, self._by)
        if frame is not None:
            check_frame(frame, len(self._volumes) if self._several else 0)
        volume = self._volumes[frame or 0]
        whole = np.zeros((len(volume), *self._first.size), self.dtype)
        gone = np.zeros(whole.shape, np.bool_)
        with reading("DICOM"):
            for number, plane, raw in self._decoded(volume):
                if self._segments:
                    self._mark(whole[number], plane, raw)
                else:
                    gone[number] = self._channel is None and plane.padded(raw)
                    whole[number] = self._rescaled(plane, raw)
        return single(np.ma.MaskedArray(whole, gone).T if gone.any() else whole.T, None)

    def _decoded(self, volume: Volume) -> Iterator[tuple[int, _Plane, Array]]:
        """Frames as they are stored, each with the number of its slice; each file is opened once."""
        every = [(number, plane) for number, planes in enumerate(volume) for plane in planes]
        with warnings.catch_warnings():
            warnings.filterwarnings("error", message="The end of the encapsulated pixel data")
            for path, group in groupby(sorted(every, key=lambda each: each[1].path), lambda each: each[1].path):
                some = [*group]
                header = some[0][1].header
                whole = header.file_meta.TransferSyntaxUID.is_deflated or not header.preamble
                frames = self._pixels.iter_pixels(header if whole else path, indices=[each.number for _, each in some])
                for (number, plane), raw in zip(some, frames, strict=True):
                    yield number, plane, raw

    def _rescaled(self, plane: _Plane, raw: Array) -> Array:
        if self._palette:
            raw = self._pixels.apply_color_lut(raw, plane.header)
        if self._channel is not None:
            return np.asarray(raw[..., self._channel])
        raw, rescaling = plane.used(raw), plane.rescaling
        if rescaling is None:
            return np.asarray(self._pixels.apply_modality_lut(raw, plane.header))
        whole = scaled(raw, *rescaling)
        return raw * np.float64(rescaling[0]) + rescaling[1] if whole is None else whole

    def _mark(self, labels: Array, plane: _Plane, raw: Array) -> None:
        """Give the samples of a segment the number of the segment."""
        if self._segments == "LABELMAP":
            labels[...] = raw if self._segment is None else np.where(raw == self._segment, raw, 0)
            return
        number, inside = int(plane.get("ReferencedSegmentNumber")), raw != 0
        other = labels[inside & (labels != 0) & (labels != number)]
        if other.size:
            raise InputError(f"segments {other[0]} and {number} overlap in {plane.name}", code="labels",
                             remedy=f"choose one with --key {number}")
        labels[inside] = number

    def _place(self, n: int, frame: int | None) -> Placement:
        if self._matrix is not None:
            whole = placed_volume(to_right_front_up(self._matrix), self._whole, n)
            if whole.placed or n == 3:
                return whole
        remark = SLICE if self._first.corner is not None else "the positions of its slices are unknown" * (n == 3)
        within, between = self._first.get(*_SPACINGS), self._first.get("SpacingBetweenSlices")
        if within is None or (n == 3 and between is None):
            return Placement(remark=remark)
        steps = [float(step) for step in (within[1], within[0], between)[:n]]
        return replace(placed(np.diag(steps) @ np.eye(n, n + 1), n, unit="mm"), remark=remark)


# ---- Files and series ------------------------------------------------------------------------------------------------


def dicom_files(source: InputFile) -> Iterator[Path]:
    """Find the DICOM files in a folder and those below it, or give the only file."""
    if not source.path.is_dir():
        yield source.path
        return
    root, seen = os.path.realpath(source.path), {os.path.realpath(source.path)}
    for folder, below, files in os.walk(root, followlinks=source.follow):
        real = {name: os.path.realpath(os.path.join(folder, name)) for name in sorted(below, key=_counted)}
        below[:] = [name for name in real if real[name] not in seen]
        seen.update(real.values())
        for path in (Path(folder, name) for name in sorted(files, key=_counted)):
            if is_dicom(path) or path.suffix.lower() == ".dcm":
                if not source.follow and not os.path.realpath(path).startswith(os.path.join(root, "")):
                    raise source.refused(path.name, "which links to another folder")
                yield path


def _counted(name: str) -> list[str | int]:
    """Key of names whose numbers are counted: IM2 before IM10."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]


def is_dicom_series(path: Path) -> bool:
    """Whether a folder holds DICOM files."""
    return path.is_dir() and any(True for _ in dicom_files(InputFile(path, follow=True)))


def _frames(header: Any) -> int:
    return int(header.get("NumberOfFrames") or 1)


def _headers(source: InputFile, remarks: list[str]) -> list[tuple[Path, Any]]:
    """Headers of the files that hold samples, checked against the limits and the bytes that are there."""
    pydicom, others, count = optional("pydicom", extra="dicom", purpose="reading DICOM"), list[str](), 0
    found: list[tuple[Path, Any]] = []
    for path in dicom_files(source):
        long = None if _packed(source, path, pydicom) else _LONG
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", message=".*[Uu]nexpected end of file")
            header = pydicom.dcmread(path, defer_size=long, force=True)
        uid = header.get("SOPClassUID") or header.file_meta.get("MediaStorageSOPClassUID", "")
        name = plain(pydicom.uid.UID(uid).name)
        if "Rows" in header and any(tag in header for tag in (_PIXELS, *_FLOATS)):
            count = source.check_count(count + _checked(source, path, header, pydicom))
            found.append((path, header))
        elif "Rows" in header or "Image Storage" in name:
            raise InputError(f"is cut short: {plain(path.name)} has no samples", code="unreadable")
        elif name != "Media Storage Directory Storage":
            others.append(name)
    named = ", ".join(sorted({*others})) or "no file of DICOM"
    if not found:
        raise InputError(f"holds no samples ({named})", code="unreadable", remedy="give a file or folder of slices")
    if others:
        remarks.append(f"files without samples are left out: {len(others)} ({named})")
    return found


def _packed(source: InputFile, path: Path, pydicom: Any) -> bool:
    """Whether a file is packed as a whole; if so, check that it does not unpack to more than the limit."""
    with path.open("rb") as file:
        first = file.read(_LONG)
    if first[128:132] != b"DICM":
        if pydicom.uid.DeflatedExplicitVRLittleEndian.encode() in first:
            raise InputError(f"is packed as a whole, without a preamble: {plain(path.name)}", code="unreadable")
        return False
    meta = pydicom.filereader.read_file_meta_info(path)
    if meta.get("TransferSyntaxUID") != pydicom.uid.DeflatedExplicitVRLittleEndian:
        return False
    with path.open("rb") as file:
        file.seek(144 + int(meta.get("FileMetaInformationGroupLength", 0)))
        most = 8 * source.samples + _LONG
        if len(zlib.decompressobj(-zlib.MAX_WBITS).decompress(file.read(), most + 1)) > most:
            raise LimitError(f"unpacks to more than {most:,} bytes", code="limit-samples")
    return True


def _checked(source: InputFile, path: Path, header: Any, pydicom: Any) -> int:
    """Count the samples of a file; check that it holds as many as it states, and that they can be decoded."""
    # by its name it would be read
    pixels = next(element for tag, element in header.items() if tag in (_PIXELS, *_FLOATS))
    frames, colours = _frames(header), int(header.get("SamplesPerPixel") or 1)
    header.SamplesPerPixel, header.PhotometricInterpretation = colours, header.get("PhotometricInterpretation") or ""
    count = int(header.Rows) * int(header.Columns) * frames * colours
    if "TransferSyntaxUID" not in header.file_meta:
        implicit, little = header.original_encoding
        order = "Implicit" if implicit else "Explicit"
        header.file_meta.TransferSyntaxUID = getattr(pydicom.uid, f"{order}VR{'Little' if little else 'Big'}Endian")
    syntax, held = header.file_meta.TransferSyntaxUID, path.stat().st_size
    if "TotalPixelMatrixRows" in header:
        raise InputError("is a picture of tiles, such as of a slide", code="shape", remedy="export it as TIFF")
    described = len(header.get(_OF_FRAMES) or "") or frames
    if frames != described or count < 1:
        raise InputError(f"states {frames} frames of {header.Rows} x {header.Columns} samples, and the places of "
                         f"{described}", code="shape")
    if not syntax.is_encapsulated:
        bits = count * int(header.BitsAllocated) // (1.5 if "422" in header.PhotometricInterpretation else 1)
        there = len(pixels.value) if pixels.value else min(pixels.length, held - pixels.value_tell)
        source.check_bytes(int(-(-bits // 8)), there)
        return count
    densest = count * int(header.BitsAllocated) // 512 if syntax == pydicom.uid.RLELossless else 0
    source.check_bytes(max(8 * frames, densest), held)
    decoder = pydicom.pixels.get_decoder(syntax)
    if not decoder.is_available:
        raise InputError(f"is compressed as {syntax.name}, for which a decoder is missing", code="missing-decoder",
                         remedy=f"install one: {'; '.join(decoder.missing_dependencies)}")
    return count


def _series(files: list[tuple[Path, Any]], key: str | None) -> tuple[list[tuple[Path, Any]], str | None]:
    """The files of one series, and the key if it does not name a series."""
    series: dict[str, list[tuple[Path, Any]]] = {}
    for path, header in files:
        series.setdefault(str(header.get("SeriesInstanceUID", "")), []).append((path, header))
    names = {}
    for uid, some in series.items():
        first = some[0][1]
        known = [str(first.get(name)) for name in ("SeriesNumber", "SeriesDescription") if first.get(name)]
        slices = sum(_frames(header) for _, header in some)
        names[uid] = [uid, *known, f"{' '.join([*known, ''])}({first.get('Modality', '?')}, {slices} slices, {uid})"]
    if len(series) > 1 or key in next(iter(names.values())):
        return series[named("series", names, key)], None
    return next(iter(series.values())), key


def _of_segment(planes: list[_Plane], key: str | None) -> tuple[list[_Plane], int | None, str | None]:
    """The frames of the segment that a key names by its number or label, and its number; or all."""
    header = planes[0].header
    if header.SegmentationType == "FRACTIONAL":
        raise InputError("is a FRACTIONAL segmentation, of probabilities or shares; only BINARY and LABELMAP are read",
                         code="labels", remedy="convert it to a BINARY one")
    if key is None:
        return planes, None, None
    labels = {int(each.SegmentNumber): str(each.get("SegmentLabel", "")) for each in header.SegmentSequence}
    number = named("segments", {n: (str(n), label, f"{n} '{label}'") for n, label in labels.items()}, key)
    own = [each for each in planes if each.get("ReferencedSegmentNumber") in (None, number)]
    if not own:
        raise InputError(f"holds no samples of segment '{plain(key)}'", code="key")
    return own, number, None


def _stack(planes: list[_Plane], key: str | None, remarks: list[str]) -> list[_Plane]:
    """The frames of one size and direction; localizers and copies are left out."""
    names = "SOPInstanceUID", "InstanceNumber", "ImagePositionPatient"
    every = {(each.number, *(str(each.get(name) or each.path) for name in names)): each for each in planes[::-1]}
    once = [*every.values()][::-1]
    if len(once) < len(planes):
        remarks.append(f"copies of other slices are left out: {len(planes) - len(once)}")
    kept = [each for each in once if not _SHOWING & {*(each.get("ImageType") or ())}] if key is None else once
    stacks: dict[str, list[_Plane]] = {}
    for plane in kept or once:
        found = next((some for some in stacks.values() if plane.follows(some[0])), None)
        if found is None:
            alike = sum(name.partition("-")[0] == plane.direction for name in stacks)
            found = stacks.setdefault(f"{plane.direction}-{alike + 1}" if alike else plane.direction, [])
        found.append(plane)
        if len(stacks) > _STACKS:
            raise InputError(f"holds slices of more than {_STACKS} sizes or directions", code="shape")
    counts = sorted(map(len, stacks.values()))
    if key is None and counts[-1] > 2 and all(count == 1 for count in counts[:-1]):
        stacks = {name: some for name, some in stacks.items() if len(some) == counts[-1]}
    chosen = stacks[named("stacks of different sizes or directions", {
        name: (name, f"'{name}' of {len(some)}") for name, some in stacks.items()
    }, key)]
    if key is None and len(chosen) < len(once):
        remarks.append(f"localizers, or slices of other sizes or directions, are left out: {len(once) - len(chosen)}")
    return chosen


# ---- Places of slices ------------------------------------------------------------------------------------------------


Arranged = tuple[list[Volume], Array | None, str]


def _arranged(planes: list[_Plane], tolerance: float | None, remarks: list[str]) -> Arranged:
    """Slices of each volume in their order, the matrix in LPS coordinates, and by what volumes in one place differ."""
    if planes[0].corner is None:
        if len(planes) > 1 and (planes[0].get(*_CINE) is not None or planes[0].get("Modality") in _FILMED):
            return [[[each]] for each in planes], None, "time"
        return [[[each] for each in sorted(planes, key=lambda each: int(each.get("InstanceNumber") or 0))]], None, ""
    planes, where = _sorted(planes)
    by, groups = _times(planes, where)
    for some in groups:
        if lost := {*where} - {*where[some]}:
            near = planes[int(np.flatnonzero(where == min(lost))[0])]
            raise InputError(f"holds volumes (by {by}) of different slices: not all have slice {min(lost)}, as "
                             f"{near.name} is", code="slices", remedy="add the missing slices")
    first = [planes[each] for each in groups[0]]
    matrix = np.column_stack([first[0].axes[:, :2], _step(first, tolerance, remarks), np.asarray(first[0].corner)])
    return [[[planes[each]] for each in some] for some in groups], matrix, by


def _sorted(planes: list[_Plane]) -> tuple[list[_Plane], NDArray[np.int64]]:
    """Frames in their order along the normal, and the number of the slice of each."""
    along = np.array([each.corner for each in planes]) @ planes[0].axes[:, 2]
    order = np.argsort(along, kind="stable")
    return [planes[each] for each in order], np.cumsum(np.diff(along[order], prepend=along[order[0]]) > _TOGETHER)


def _times(planes: list[_Plane], where: NDArray[np.int64]) -> tuple[str, list[list[int]]]:
    """The attribute by which frames in one place differ, and the frames of each volume."""
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


def _step(slices: Sequence[_Plane], tolerance: float | None, remarks: list[str]) -> Array:
    """The step from slice to slice, if their steps are even, but for a tolerance in mm."""
    if len(slices) == 1:
        thick = slices[0].get("SpacingBetweenSlices", "SliceThickness") or 1
        return np.asarray(slices[0].axes[:, 2] * abs(float(thick)))
    corners = np.array([each.corner for each in slices])
    step = np.asarray((corners[-1] - corners[0]) / (len(slices) - 1))
    off = float(np.linalg.norm(corners - corners[0] - step * np.arange(len(slices))[:, None], axis=1).max())
    if off <= max(EVEN * float(np.linalg.norm(step)), tolerance or 0):
        if off > EVEN * float(np.linalg.norm(step)):
            remarks.append(f"its slices lie up to {off:.3g} mm from even steps")
        return step
    gaps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    usual = float(np.median(gaps))
    at = int(np.abs(gaps - usual).argmax())
    lost = round(float(gaps[at]) / usual) - 1
    raise InputError(
        f"holds slices {'with a gap' if lost > 0 else 'at uneven steps'}: {gaps[at]:g} mm between slices {at} and "
        f"{at + 1} ({slices[at].name}, {slices[at + 1].name}), {usual:g} mm between others", code="slices",
        remedy=f"add the missing {lost}; or " * (lost > 0) + f"--slice-tolerance {np.ceil(off * 100) / 100:g} accepts "
        "slices that lie so many mm from even steps",
    )


def _segmented(planes: list[_Plane], tolerance: float | None, remarks: list[str]) -> Arranged:
    """Slices of a segmentation, which leaves out empty ones: those between others, and one more at both ends."""
    if planes[0].corner is None:
        if len(planes) > len(planes[0].header.SegmentSequence):
            raise InputError("is a segmentation of slices without positions", code="slices")
        return [[planes]], None, ""
    planes, where = _sorted(planes)
    corners = np.array([planes[at].corner for at in np.unique(where, return_index=True)[1]])
    gaps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    least = [gaps.min(), gaps.min()] if len(gaps) else [planes[0].get("SliceThickness"), 1.0]
    for distance in (float(each) for each in (planes[0].get("SpacingBetweenSlices"), *least) if each):
        skips = np.rint(gaps / distance)
        if np.abs(gaps - skips * distance).max(initial=0) <= max(EVEN * distance, tolerance or 0):
            break
    else:
        raise InputError("holds slices at uneven steps", code="slices")
    slices = np.concatenate([[1], 1 + np.cumsum(skips)]).astype(np.int64)
    step = (corners[-1] - corners[0]) / (slices[-1] - 1) if len(gaps) else planes[0].axes[:, 2] * distance
    if slices[-1] > _LONG:
        raise LimitError(f"states {slices[-1]:,} slices", code="limit-samples")
    volume: Volume = [[] for _ in range(slices[-1] + 2)]
    for plane, number in zip(planes, where, strict=True):
        volume[slices[number]].append(plane)
    return [volume], np.column_stack([planes[0].axes[:, :2], step, corners[0] - step]), ""


FORMATS = (
    Format("DICOM", (".dcm",), _Dicom, extra="dicom", signatures=((128, b"DICM", ".dcm"),), keyed=True, channels=True),
)
DICOM_FOLDER = replace(FORMATS[0], suffixes=(), signatures=(), folder=True)
