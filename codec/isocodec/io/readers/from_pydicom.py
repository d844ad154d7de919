"""Pydicom reads DICOM: slices, files of many frames, segmentations; all in coordinates right, front and up."""

from __future__ import annotations

import os
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, LimitError, plain
from ...extras import optional
from ...field.placement import Placement
from .opened import Choice, Format, Opened, numbers
from .place_of_samples import EVEN, SLICE, placed, to_right_front_up
from .reading import channel_of, check_frame, reading
from .slices import Slices
from .source import InputFile, is_dicom
from .volumes import of_a_series, scaled, squeezed

Array = NDArray[Any]
_LONG = 1 << 16
"""Bytes of elements that are not read with the header."""
_LISTED, _STACKS = 20, 1000
_ALIKE, _TOGETHER = 1e-4, 1e-3
"""Differences of directions and steps within a stack; distance in mm of slices that lie in one place."""
_PIXELS = {0x7FE00010: "PixelData", 0x7FE00008: "FloatPixelData", 0x7FE00009: "DoubleFloatPixelData"}
_OF_FRAMES = "PerFrameFunctionalGroupsSequence"
_SPACINGS = ("PixelSpacing", "ImagerPixelSpacing", "NominalScannedPixelSpacing")
_PADDING = ("PixelPadding", "FloatPixelPadding", "DoubleFloatPixelPadding")
_CINE = ("FrameTime", "FrameTimeVector", "CineRate")
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
        groups = [*([own[self.number]] if own else []), *(shared or [])[:1], self.header]
        nested = [
            each.value[0] for group in groups for each in group
            if each.VR == "SQ" and each.value and not each.tag.is_private
            and (group is not self.header or each.keyword == "DetectorInformationSequence")
        ]
        return [*nested, self.header]

    def get(self, *names: str) -> Any:
        """The first of these attributes that has a value."""
        values = (each.get(name) for name in names for each in self._datasets)
        return next((value for value in values if value is not None and value != ""), None)

    @property
    def name(self) -> str:
        several = (self.header.get("NumberOfFrames") or 1) > 1
        return f"frame {self.number} of " * several + plain(self.path.name)

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
        if not self.header.get(_OF_FRAMES) and (self.header.get("NumberOfFrames") or 1) > 1:
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
        normal = np.abs(self.axes[:, 2])
        return str(self.get("StackID") or ("sagittal", "coronal", "axial")[normal.argmax()] if normal.any() else "plane")

    @property
    def rescaling(self) -> tuple[float, float] | None:
        """Slope and intercept; None if values are taken from a table."""
        if self.header.get("ModalityLUTSequence"):
            return None
        return float(self.get("RescaleSlope", "DoseGridScaling") or 1), float(self.get("RescaleIntercept") or 0)

    def padded(self, raw: Array) -> Array | None:
        """The stored samples that only fill the picture."""
        ends = self.get(*(f"{name}Value" for name in _PADDING)), self.get(*(f"{name}RangeLimit" for name in _PADDING))
        if ends[0] is None:
            return None
        low, high = sorted(np.array([end for end in ends if end is not None] * 2)[:2].astype(raw.dtype))
        return np.asarray((raw >= low) & (raw <= high))

    def used(self, raw: Array) -> Array:
        """Stored samples without what other bits of their words hold, and with their sign."""
        bits, most = int(self.header.get("BitsStored") or 0), 8 * raw.itemsize
        left = most - 1 - int(self.header.get("HighBit") or bits - 1)
        return raw << left >> most - bits if raw.dtype.kind in "iu" and 8 <= bits < most and left >= 0 else raw


Volume = list[list[_Plane]]
"""Frames of each slice: one, or of segmentations those of some segments."""


class _Dicom(Opened):
    """Slices of a folder, or the frames of a file; axes i, j, k, and a last one of volumes in one place."""

    def _open(self, choice: Choice) -> None:
        self._pixels = optional("pydicom.pixels", extra="dicom", purpose="reading DICOM")
        remarks: list[str] = []
        with reading("DICOM"):
            series, key = _series(_headers(self._source, remarks), choice.key)
            planes = [_Plane(*file[:1], n, file[1]) for file in series for n in range(_frames(file[1]))]
            header = planes[0].header
            self._segments = header.get("SegmentationType")
            self._segment = None
            if self._segments:
                planes, self._segment, key = _of_segment(planes, key)
            planes = _stack(planes, key, remarks)
            self._first = planes[0]
            self._palette = header.PhotometricInterpretation == "PALETTE COLOR" and not self._segments
            colours = 3 if self._palette else int(header.SamplesPerPixel)
            self._channel = channel_of(colours, choice.channel) if colours > 1 else None
            self.dtype = self._type(planes)
            self._by = ""
            arranged = _segmented if self._segments else _arranged
            self._volumes, self._matrix, self._by = arranged(planes, choice.slice_tolerance, remarks)
            (rows, columns), count = self._first.size, len(self._volumes[0])
            self._source.check_count(rows * columns * count * len(self._volumes) * colours)
        self.shape = squeezed((columns, rows, count, len(self._volumes)))
        unit = None if self._segments or colours > 1 else self._first.get("RescaleType", "Units", "DoseUnits")
        self.unit, self.remarks = None if unit == "US" else unit, tuple(remarks)

    def _type(self, planes: list[_Plane]) -> np.dtype[Any]:
        header = self._first.header
        if self._segments == "BINARY":
            return np.min_scalar_type(max(int(each.get("ReferencedSegmentNumber") or 0) for each in planes))
        if self._palette:
            return np.dtype(f"u{header.RedPaletteColorLookupTableDescriptor[2] // 8}")
        of_type = self._pixels.utils.pixel_dtype
        stored = np.result_type(*{of_type(each.header, 0x7FE00010 not in each.header) for each in planes})
        stored, rescaling = stored.newbyteorder("="), {each.rescaling for each in planes}
        if self._segments or self._channel is not None or rescaling == {(1.0, 0.0)}:
            return stored
        if rescaling == {None}:
            return np.dtype(f"u{-(-header.ModalityLUTSequence[0].LUTDescriptor[2] // 8)}")
        only = rescaling.pop()
        whole = None if rescaling or only is None else scaled(np.zeros(0, stored), *only)
        return np.dtype(np.float64) if whole is None else whole.dtype

    def _values(self, frame: int | None) -> Array:
        if frame is None and len(self._volumes) > 1:
            raise of_a_series(self.shape, self._by)
        if frame is not None:
            check_frame(frame, len(self._volumes) if len(self._volumes) > 1 else 0)
        volume = self._volumes[frame or 0]
        whole, gone = np.zeros((len(volume), *self._first.size), self.dtype), None
        with reading("DICOM"):
            for number, plane, raw in self._decoded(volume):
                if self._segments:
                    self._mark(whole[number], plane, raw)
                    continue
                padded = None if self._channel is not None else plane.padded(raw)
                if padded is not None and padded.any():
                    gone = np.zeros(whole.shape, np.bool_) if gone is None else gone
                    gone[number] = padded
                whole[number] = self._rescaled(plane, raw)
        values = whole.T.reshape(self.shape[:2] if len(volume) == 1 else whole.T.shape)
        return values if gone is None else np.ma.MaskedArray(values, gone.T.reshape(values.shape))

    def _decoded(self, volume: Volume) -> Iterator[tuple[int, _Plane, Array]]:
        """Frames as they are stored, each with the number of its slice; each file is opened once."""
        every = [(number, plane) for number, planes in enumerate(volume) for plane in planes]
        with warnings.catch_warnings():
            warnings.filterwarnings("error", message="The end of the encapsulated pixel data")
            for path, group in groupby(sorted(every, key=lambda each: each[1].path), lambda each: each[1].path):
                some = [*group]
                frames = self._pixels.iter_pixels(path, indices=[plane.number for _, plane in some])
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
        whole = scaled(raw, *rescaling) if self.dtype.kind in "iu" else None
        return raw * np.float64(rescaling[0]) + rescaling[1] if whole is None and rescaling != (1, 0) else raw if (
            whole is None) else whole

    def _mark(self, labels: Array, plane: _Plane, raw: Array) -> None:
        """Give the samples of a segment its number."""
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
        if n == 3 and self._matrix is not None:
            return placed(to_right_front_up(self._matrix), n)
        between = self._first.get(*_SPACINGS)
        if n != 2 or between is None:
            return Placement(remark="the positions of its slices are unknown" if n == 3 else SLICE)
        flat = placed((float(between[1]), float(between[0])), 2)
        return Placement(flat.matrix, remark=flat.remark or SLICE)

    def _series(self) -> Slices | None:
        if len(self._volumes) == 1:
            return None
        shape = (*self._first.size[::-1], len(self._volumes[0]), len(self._volumes))
        return Slices(shape, 3, lambda number: numbers(self._values(number)), squeezed(shape[:3]))


# ---- Which files and series --------------------------------------------------------------------------------------------


def dicom_files(source: InputFile) -> Iterator[Path]:
    """Find the files of DICOM in a folder and those below it, or give the only file."""
    if not source.path.is_dir():
        yield source.path
        return
    seen, root = set[str](), os.path.realpath(source.path)
    for folder, below, files in os.walk(source.path, followlinks=source.follow):
        below[:] = sorted(name for name in below if os.path.realpath(os.path.join(folder, name)) not in seen)
        seen.update(os.path.realpath(os.path.join(folder, name)) for name in below)
        for path in (Path(folder, name) for name in sorted(files)):
            if not is_dicom(path):
                continue
            if not source.follow and not os.path.realpath(path).startswith(os.path.join(root, "")):
                raise source.refused(path.name, "which links to another folder")
            yield path


def is_dicom_series(path: Path) -> bool:
    """Whether a folder holds files of DICOM."""
    return path.is_dir() and any(True for _ in dicom_files(InputFile(path, follow=True)))


def _frames(header: Any) -> int:
    return int(header.get("NumberOfFrames") or 1)


def _headers(source: InputFile, remarks: list[str]) -> list[tuple[Path, Any]]:
    """Headers of the files with samples, which are known to be allowed and to be there."""
    pydicom, found, others, count = optional("pydicom", extra="dicom", purpose="reading DICOM"), [], [], 0
    for path in dicom_files(source):
        meta = _meta(source, path, pydicom)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", message=".*[Uu]nexpected end of file")
            header = pydicom.dcmread(path, defer_size=None if meta else _LONG, force=True)
        name = plain(pydicom.uid.UID(header.get("SOPClassUID", "")).name)
        if "Rows" in header and any(tag in header for tag in _PIXELS):
            count += _checked(source, path, header)
            source.check_count(count)
            found.append((path, header))
        elif "Rows" in header or "Image Storage" in name:
            raise InputError(f"is cut short: {plain(path.name)} has no samples", code="unreadable")
        elif "DICOMDIR" not in path.name:
            others.append(name)
    if not found:
        raise InputError(f"holds no samples but {', '.join(sorted({*others})) or 'nothing'}", code="unreadable")
    if others:
        remarks.append(f"{len(others)} files without samples are left out ({', '.join(sorted({*others}))})")
    return found


def _meta(source: InputFile, path: Path, pydicom: Any) -> bool:
    """Whether a file is packed as a whole; what it holds is allowed then."""
    with path.open("rb") as file:
        if file.read(132)[128:] != b"DICM":
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


def _checked(source: InputFile, path: Path, header: Any) -> int:
    """Count the samples of a file; its pixels are as many as it states, and can be decoded."""
    pixels = next(element for tag, element in header.items() if tag in _PIXELS)  # not read, as it would be by its name
    frames, colours = _frames(header), int(header.get("SamplesPerPixel") or 1)
    header.SamplesPerPixel, header.PhotometricInterpretation = colours, header.get("PhotometricInterpretation", "")
    count = int(header.Rows) * int(header.Columns) * frames * colours
    syntax, held = header.file_meta.get("TransferSyntaxUID"), path.stat().st_size
    if "TotalPixelMatrixRows" in header:
        raise InputError("is a picture of tiles, such as of a slide", code="shape", remedy="export it as TIFF")
    if frames < 1 or not count or (header.get(_OF_FRAMES) and len(header[_OF_FRAMES].value) != frames):
        raise InputError(f"states {frames} frames of {header.Rows} x {header.Columns}, which cannot be", code="shape")
    if syntax is None or not syntax.is_compressed or syntax.is_deflated:
        bits = count * int(header.BitsAllocated) // (1 if "422" not in header.PhotometricInterpretation else 1.5)
        there = pixels.length if isinstance(pixels.value, bytes) else min(pixels.length, held - pixels.value_tell)
        source.check_bytes(int(-(-bits // 8)), there)
        return count
    source.check_bytes(8 * frames, held)
    decoder = optional("pydicom.pixels", extra="dicom", purpose="reading DICOM").get_decoder(syntax)
    if not decoder.is_available:
        raise InputError(f"is compressed as {syntax.name}, for which a decoder is missing", code="missing-decoder",
                         remedy=f"install one: {'; '.join(decoder.missing_dependencies)}")
    return count


def _series(files: list[tuple[Path, Any]], key: str | None) -> tuple[list[tuple[Path, Any]], str | None]:
    """The files of one series, and the key if it does not name a series."""
    series: dict[str, list[tuple[Path, Any]]] = {}
    for path, header in files:
        series.setdefault(str(header.get("SeriesInstanceUID", "")), []).append((path, header))
    names = {
        uid: [str(some[0][1].get(name)) for name in ("SeriesNumber", "SeriesDescription") if some[0][1].get(name)]
        for uid, some in series.items()
    }
    chosen = [uid for uid in series if key is None or key in (uid, *names[uid])]
    if len(chosen) != 1 and len(series) > 1:
        listed = "; ".join(
            f"{plain(' '.join(names[uid]))} ({plain(str(series[uid][0][1].get('Modality', '?')))}, "
            f"{sum(_frames(header) for _, header in series[uid])} slices, {plain(uid)})"
            for uid in [*(chosen or series)][:_LISTED]
        )
        which = f"{len(series)} series" if key is None else f"{len(chosen) or 'no'} series '{plain(key)}'"
        raise InputError(f"holds {which}: {listed}", code="key",
                         remedy="choose one with --key: its number, description or UID")
    return series[(chosen or [*series])[0]], None if chosen else key


def _of_segment(planes: list[_Plane], key: str | None) -> tuple[list[_Plane], int | None, str | None]:
    """The frames of the segment that a key names by its number or label, or all; and the key if it names none."""
    header = planes[0].header
    if header.SegmentationType == "FRACTIONAL":
        raise InputError("is a FRACTIONAL segmentation, of probabilities or shares; only BINARY and LABELMAP are read",
                         code="labels", remedy="convert it to a BINARY one")
    segments = {int(each.SegmentNumber): str(each.get("SegmentLabel", "")) for each in header.SegmentSequence}
    chosen = [number for number, label in segments.items() if key in (str(number), label)]
    if key is not None and len(chosen) != 1:
        listed = ", ".join(f"{number} '{plain(label)}'" for number, label in [*segments.items()][:_LISTED])
        raise InputError(f"holds no segment '{plain(key)}': {listed}", code="key", remedy="choose one with --key")
    if not chosen or key is None:
        return planes, None, None
    own = [each for each in planes if each.get("ReferencedSegmentNumber") in (None, chosen[0])]
    if not own:
        raise InputError(f"holds no samples of segment '{plain(key)}'", code="key")
    return own, chosen[0], None


def _stack(planes: list[_Plane], key: str | None, remarks: list[str]) -> list[_Plane]:
    """The frames of one size and direction; localizers and copies are left out."""
    copies = Counter((each.header.get("SOPInstanceUID", each.path), each.number) for each in planes)
    once = [*{(each.header.get("SOPInstanceUID", each.path), each.number): each for each in reversed(planes)}.values()]
    if len(copies) < len(planes):
        remarks.append(f"{len(planes) - len(copies)} copies of other slices are left out")
    proper = [each for each in once if not {"LOCALIZER", "SCOUT"} & {*(each.get("ImageType") or ())}]
    left = once if key is not None or not proper else proper
    stacks: dict[str, list[_Plane]] = {}
    for plane in reversed(left):
        found = next((some for some in stacks.values() if plane.follows(some[0])), None)
        if found is None:
            alike = sum(name.partition("-")[0] == plane.direction for name in stacks)
            found = stacks.setdefault(f"{plane.direction}-{alike + 1}" if alike else plane.direction, [])
        found.append(plane)
        if len(stacks) > _STACKS:
            raise InputError("holds slices of more than 1000 sizes or directions", code="shape")
    largest = max(stacks, key=lambda name: len(stacks[name]))
    if key is None and all(len(some) == 1 < len(stacks[largest]) - 1 for some in stacks.values() if len(some) > 1):
        left, stacks = stacks[largest], {largest: stacks[largest]}
    if key is None and len(left) < len(once):
        remarks.append(f"{len(once) - len(left)} localizers, slices of other sizes or directions, are left out")
    if key not in stacks and (key is not None or len(stacks) > 1):
        listed = ", ".join(f"'{plain(name)}' of {len(some)}" for name, some in stacks.items())
        raise InputError(f"holds stacks of slices of different sizes or directions: {listed}" if key is None else
                         f"holds no series or stack '{plain(key)}'; its stacks: {listed}",
                         code="shape" if key is None else "key", remedy="choose one with --key")
    return stacks[largest if key is None else key]


# ---- Where slices lie ------------------------------------------------------------------------------------------------


Arranged = tuple[list[Volume], Array | None, str]


def _arranged(planes: list[_Plane], tolerance: float | None, remarks: list[str]) -> Arranged:
    """Slices of each volume in their order, the matrix in LPS coordinates, and by what volumes in one place differ."""
    if planes[0].corner is None:
        if len(planes) > 1 and any(planes[0].get(name) is not None for name in _CINE):
            return [[[each]] for each in planes], None, "time"
        return [[[each] for each in sorted(planes, key=lambda each: int(each.get("InstanceNumber") or 0))]], None, ""
    planes, where = _sorted(planes)
    count, by = int(np.bincount(where).max()), ""
    groups = [[*range(len(planes))]]
    if count > 1:
        by, groups = _times(planes, where, count)
    first = [planes[each] for each in groups[0]]
    for some in groups[1:]:
        if {*where[some]} != {*where[groups[0]]}:
            lost = min({*where[some]} ^ {*where[groups[0]]})
            near = planes[int(np.flatnonzero(where == lost)[0])]
            raise InputError(f"holds volumes (by {by}) of different slices: not all have slice {lost} ({near.name})",
                             code="slices", remedy="add the missing slices")
    step = _step(first, tolerance, remarks)
    return [[[planes[each]] for each in some] for some in groups], np.column_stack(
        [first[0].axes[:, :2], step, first[0].corner]
    ), by


def _sorted(planes: list[_Plane]) -> tuple[list[_Plane], NDArray[np.int64]]:
    """Frames in their order along the normal, and the number of the slice of each."""
    along = np.array([each.corner for each in planes]) @ planes[0].axes[:, 2]
    order = np.argsort(along, kind="stable")
    return [planes[each] for each in order], np.cumsum(np.diff(along[order], prepend=along[order[0]]) > _TOGETHER)


def _times(planes: list[_Plane], where: NDArray[np.int64], count: int) -> tuple[str, list[list[int]]]:
    """The attribute by which frames in one place differ, and the frames of each volume."""
    for name in _TIMES:
        values = [each.get(name) for each in planes]
        values = [value if isinstance(value, str | int | float) or value is None else tuple(value) for value in values]
        if None in values or len({*values}) != count:
            continue
        groups = [[n for n, value in enumerate(values) if value == each] for each in sorted({*values})]
        if all(len({*where[some]}) == len(some) for some in groups):
            return name, groups
    slice = int(np.argmax(np.bincount(where) > 1))
    both = [planes[each].name for each in np.flatnonzero(where == slice)[:2]]
    raise InputError(f"holds several slices in one place: {both[0]} and {both[1]} (slice {slice})", code="slices",
                     remedy="keep one of them, or those of one volume, in a folder")


def _step(slices: Sequence[_Plane], tolerance: float | None, remarks: list[str]) -> Array:
    """The step from slice to slice, if their steps are even, but for a tolerance in mm."""
    if len(slices) == 1:
        thick = slices[0].get("SpacingBetweenSlices", "SliceThickness")
        return np.asarray(slices[0].axes[:, 2] * (abs(float(thick or 1)) or 1))
    corners = np.array([each.corner for each in slices])
    step = (corners[-1] - corners[0]) / (len(slices) - 1)
    off = float(np.linalg.norm(corners - corners[0] - step * np.arange(len(slices))[:, None], axis=1).max())
    if off <= EVEN * np.linalg.norm(step):
        return np.asarray(step)
    if tolerance is not None and off <= tolerance:
        remarks.append(f"its slices lie up to {off:.3g} mm from even steps")
        return np.asarray(step)
    gaps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    usual = float(np.median(gaps))
    at = int(np.abs(gaps - usual).argmax())
    between = f"{gaps[at]:g} mm between slices {at} and {at + 1} ({slices[at].name}, {slices[at + 1].name})"
    remedy = f"--slice-tolerance {np.ceil(off * 100) / 100:g} accepts slices that lie so many mm from even steps"
    if (lost := round(float(gaps[at]) / usual) - 1 if usual else 0) > 0:
        raise InputError(f"holds slices with a gap: {between}, {usual:g} mm between others", code="slices",
                         remedy=f"add the missing {lost}; or {remedy}")
    raise InputError(f"holds slices at uneven steps: {between}, {usual:g} mm between others", code="slices",
                     remedy=remedy)


def _segmented(planes: list[_Plane], tolerance: float | None, remarks: list[str]) -> Arranged:
    """Slices of a segmentation, which leaves out those without segments: also one before and one behind the others."""
    if planes[0].corner is None:
        if len(planes) > len(planes[0].header.SegmentSequence):
            raise InputError("is a segmentation of slices without positions", code="slices")
        return [[planes]], None, ""
    planes, where = _sorted(planes)
    first = [planes[int(np.flatnonzero(where == slice)[0])] for slice in range(int(where[-1]) + 1)]
    corners = np.array([each.corner for each in first])
    stated = planes[0].get("SpacingBetweenSlices", "SliceThickness")
    gaps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    distances = [abs(float(stated or 1)) or 1.0, *gaps[: 1 if len(gaps) else 0] * 0 + (gaps.min() if len(gaps) else 0)]
    distance, numbers_of = distances[0], np.zeros(1, np.int64)
    for distance in distances:
        exact = np.concatenate([[0], np.cumsum(gaps)]) / distance
        numbers_of = np.rint(exact).astype(np.int64)
        if (np.abs(exact - numbers_of) * distance).max() <= max(tolerance or 0, EVEN * distance):
            break
    else:
        raise InputError("holds slices at uneven steps", code="slices")
    count = int(numbers_of[-1]) + 3
    step = (corners[-1] - corners[0]) / (count - 3) if count > 3 else planes[0].axes[:, 2] * distance
    if count > _LONG:
        raise LimitError(f"states {count:,} slices", code="limit-samples")
    volume: Volume = [[] for _ in range(count)]
    for plane, slice in zip(planes, where, strict=True):
        volume[numbers_of[slice] + 1].append(plane)
    return [volume], np.column_stack([planes[0].axes[:, :2], step, corners[0] - step]), ""


FORMATS = (
    Format("DICOM", (".dcm",), _Dicom, extra="dicom", signatures=((128, b"DICM", ".dcm"),), keyed=True, channels=True),
)
DICOM_FOLDER = Format("DICOM", (), _Dicom, extra="dicom", keyed=True, channels=True, folder=True)
