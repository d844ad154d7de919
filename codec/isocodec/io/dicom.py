"""DICOM: slices and files of many frames, by pydicom; segmentations, volumes and encapsulated STL, by highdicom.

All lie in coordinates to the right, front and top of the body; axes are columns, rows, slices.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.separation import single
from ..errors import InputError, OptionError, one_line, plain
from ..field.framed import Frames
from ..field.labelling import PROBABILITY, about, colour_of, name_of
from ..field.missing import missing_samples
from ..field.placement import LPS, Placement
from ..field.sampled import Field
from ..verbs import Choice
from .arrays import channel_of
from .libraries import choose, library, reading
from .masks import volume_matrix
from .places import BODY_TURN, EVEN, as_integers, by_matrix, in_body, kept_axes
from .volumes import of_frames, squeezed

SUFFIXES = (".dcm", ".dicom", ".ima")
Array = NDArray[Any]
_LONG = 1 << 18
"""Bytes of elements that are not read with the header."""
_CUT = ".*[Uu]nexpected end of file|The end of the encapsulated pixel data"
"""Warnings of pydicom about files that are cut short, whose beginning it reads."""
_ALIKE, _TOGETHER = 1e-4, 1e-3
"""Differences of directions and steps within a stack; distance in mm of slices that lie in one place."""
_FILMED = "FrameTime", "FrameTimeVector", "CineRate"
"""Attributes of files whose frames without positions follow in time."""
_SERIES = "SeriesNumber", "SeriesDescription", "SeriesInstanceUID"
_SAMPLES = 0x7FE00008, 0x7FE00009, 0x7FE00010
"""Tags of samples."""
_SPACINGS = "PixelSpacing", "ImagerPixelSpacing", "NominalScannedPixelSpacing"
_PADDING = "PixelPadding", "FloatPixelPadding", "DoubleFloatPixelPadding"
_TIMES = (
    "TemporalPositionIndex", "TemporalPositionIdentifier", "NominalCardiacTriggerDelayTime", "TriggerTime",
    "EffectiveEchoTime", "EchoTime", "EchoNumbers", "DiffusionBValue", "InversionTime", "FrameReferenceTime",
    "AcquisitionNumber", "AcquisitionDateTime", "FrameAcquisitionDateTime", "AcquisitionTime", "ContentTime",
    "ComplexImageComponent", "FrameType", "ImageType",
)
"""Attributes that distinguish volumes in one place."""
_STL = "1.2.840.10008.5.1.4.1.1.104.3"
"""Class of files of an encapsulated STL."""
_MOST_LABEL = 65535
_MOST_LETTERS = 64
"""Characters of a name (VR LO)."""
_UTF_8 = "ISO_IR 192"


def _library(name: str) -> Any:
    return library(name, extra="dicom", purpose="reading DICOM")


@dataclass(frozen=True, eq=False)
class _Plane:
    """A frame of a file; its header holds the attributes of the frame before those of all frames."""

    path: Path
    number: int
    header: Any

    def get(self, *names: str) -> Any:
        """Return the first of these attributes that has a value."""
        return next((value for name in names if (value := self.header.get(name)) not in (None, "")), None)

    def __str__(self) -> str:
        return f"frame {self.number} of {plain(self.path.name)}"

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
        if not found or not self.get("ImageOrientationPatient"):
            return None
        if offsets is not None:
            return np.array(found, np.float64) + self.axes[:, 2] * float(offsets[self.number] - offsets[0])
        alone = int(self.get("NumberOfFrames") or 1) == 1 or "PerFrameFunctionalGroupsSequence" in self.header
        return np.array(found, np.float64) if alone else None

    def values(self, raw: Array, channel: int, nodata: float | None) -> Array:
        """Choose a colour of stored samples, or rescale them and mask those that only fill the picture."""
        if raw.ndim > 2:
            return raw[..., channel]
        low, high = (self.get(*(f"{name}{end}" for name in _PADDING)) for end in ("Value", "RangeLimit"))
        gone = missing_samples(raw, nodata)
        if low is not None and nodata is None:
            low, high = sorted(np.array([low, low if high is None else high]).astype(raw.dtype))
            gone = (low <= raw) & (raw <= high)
        slope = float(self.get("RescaleSlope", "DoseGridScaling", "RealWorldValueSlope") or 1)
        intercept = float(self.get("RescaleIntercept", "RealWorldValueIntercept") or 0)
        whole = raw.dtype.kind in "iu" and slope.is_integer() and intercept.is_integer()
        if "ModalityLUTSequence" in self.header:
            raw = _library("pydicom.pixels").apply_modality_lut(raw, self.header)
        elif (slope, intercept) != (1, 0):
            raw = raw * np.float64(slope) + intercept
            raw = as_integers(raw) if whole else raw
        return np.ma.masked_array(raw, gone)


def open_(path: Path, choice: Choice) -> Field | Frames:
    """Read a file of DICOM, or the series in a folder and those below it.

    The key is a series by number, description or UID, or a segment of a segmentation by its number or label, which has
    1 within; without a key all segments are read, as labels. Of several volumes in one place, ``frame`` takes one, and
    ``frames`` gives all. Axes are i, j (, k), and values are rescaled as each slice states; integers stay integers if
    all do so by whole numbers. Fractions of a segment are a field from 0 to 1. Padding is missing.

    Raises `InputError` if slices are missing, lie in one place or at uneven steps, or a choice is left open.
    """
    remarks, series = list[str](), dict[tuple[str, ...], list[_Plane]]()
    with reading("DICOM"):
        warnings.filterwarnings("error", _CUT)
        for plane in _planes(path, remarks):
            series.setdefault(tuple(str(plane.get(name) or "") for name in _SERIES), []).append(plane)
        segmented = len(series) == 1 and "SegmentationType" in plane.header
        planes = _named("series", series, None if segmented else choice.key)
        first = planes[0]
        if "SegmentationType" in first.header:
            field = _segmentation(planes, choice if segmented else replace(choice, key=None))
            return of_frames(lambda number: field, 1, choice)
        colours = int(first.get("SamplesPerPixel") or 1)
        channel = channel_of(colours, choice.band)
        volumes, matrix, differ = _arranged(_stack(planes, remarks))
    first = volumes[0][0]
    axes = kept_axes((first.header.Columns, first.header.Rows, len(volumes[0])))
    place = None
    if first.corner is not None:
        place = in_body(matrix, axes, lps=True)
    else:
        remarks += ["the positions of its slices are unknown"] * (2 in axes)
        if first.get(*_SPACINGS) and (2 not in axes or first.get("SpacingBetweenSlices")):
            place = by_matrix(matrix[: len(axes)], axes, unit="mm")
    unit = str(first.get("RescaleType", "Units", "DoseUnits") or "US")

    def at(number: int) -> Field:
        values = list[Array]()
        with reading("DICOM"):
            warnings.filterwarnings("error", _CUT)
            for file, some in groupby(volumes[number], lambda each: each.path):
                parts = [*some]
                found = _library("pydicom.pixels").iter_pixels(file, indices=[each.number for each in parts])
                values += [part.values(raw, channel, choice.nodata).T for part, raw in zip(parts, found, strict=True)]
            return squeezed(np.ma.stack(values, -1), place, remarks,
                            unit=None if unit == "US" or colours > 1 else one_line(unit))

    return of_frames(at, len(volumes), choice, differ)


def of_volume(volume: Any, _: Choice) -> Field:
    """Read a Volume of highdicom without channels: values as it has them, with the axes columns, rows, slices."""
    values = np.asarray(volume.array).T
    if values.ndim > 3:
        raise InputError(f"holds channels, an array of shape {values.shape[::-1]}", code="colour",
                         remedy="choose one: volume.with_array(volume.array[..., 0])")
    axes, matrix = kept_axes(values.shape), np.asarray(volume.affine)[:3, [2, 1, 0, 3]]
    body = volume.coordinate_system.name == "PATIENT"
    return squeezed(values, in_body(matrix, axes, lps=True) if body else by_matrix(matrix, axes, unit="mm"))


# ---- files and series ------------------------------------------------------------------------------------------------


def _planes(path: Path, remarks: list[str]) -> list[_Plane]:
    """Find the frames of all files that hold samples."""
    pydicom, found, others = _library("pydicom"), list[_Plane](), list[str]()
    for one in [each for each in sorted(path.rglob("*")) if each.is_file()] if path.is_dir() else [path]:
        if one != path and not pydicom.misc.is_dicom(one):
            others.append("not DICOM")
            continue
        header = pydicom.dcmread(one, defer_size=_LONG)
        if not any(tag in header for tag in _SAMPLES):
            others.append(plain(header.SOPClassUID.name))
            continue
        count = int(header.get("NumberOfFrames") or 1)
        odd = {
            "holds indices of a palette, not samples": header.get("PhotometricInterpretation") == "PALETTE COLOR",
            "is a picture of tiles": "TotalPixelMatrixRows" in header,
            f"describes other frames than its {count}":
                len(header.get("PerFrameFunctionalGroupsSequence") or range(count)) != count,
            "is deflated as a whole": header.file_meta.TransferSyntaxUID.is_deflated,
            "has samples in high bits of words": int(header.get("HighBit") or 0) >= int(header.get("BitsStored") or 64),
        }
        for words in (each for each, holds in odd.items() if holds):
            raise InputError(words, code="unreadable",
                             remedy="convert it first, by dcmconv +te IN OUT, dcm2niix or highdicom")
        found += [_Plane(one, number, _flat(header, number)) for number in range(count)]
    named = ", ".join(sorted({*others}))
    if not found:
        raise InputError("holds no samples" + f" ({named})" * bool(named), code="unreadable",
                         remedy="give a file or folder of slices that are complete")
    remarks += [f"files without samples are left out: {len(others)} ({named})"] * bool(others)
    return found


def _flat(header: Any, number: int) -> Any:
    """Collect the attributes of a frame; its own in sequences take precedence over those of all frames."""
    groups = [some[number % len(some)] for name in ("Shared", "PerFrame")
              if (some := header.get(f"{name}FunctionalGroupsSequence"))]
    if not groups:
        return header
    flat = _library("pydicom").Dataset()
    flat.update(header)
    for group in groups:
        for each in group:
            if each.VR == "SQ" and each.value and not each.tag.is_private:
                flat.update(each.value[0])
    return flat


def _named(what: str, found: Mapping[Any, Any], key: str | None) -> Any:
    """Choose what has a name among others, or the only one; errors list all names."""
    named = [each for names, each in found.items() if key is None or key in names]
    if len(named) != 1:
        choose([" ".join(filter(None, names)) for names in found], None if named else key, what)
    return named[0]


def _stack(planes: list[_Plane], remarks: list[str]) -> list[_Plane]:
    """Find the frames of one size and direction; localizers and copies are left out."""
    names = "SOPInstanceUID", "InstanceNumber", "ImagePositionPatient"
    once = {(each.number, *(str(each.get(name) or each.path) for name in names)): each for each in planes[::-1]}
    stacks = list[tuple[Any, list[_Plane]]]()
    for plane in reversed(once.values()):
        kind = plane.header.Rows, plane.header.Columns, plane.get("StackID"), plane.corner is None
        some = next((each for known, each in stacks if known == kind
                     and np.allclose(each[0].axes, plane.axes, rtol=0, atol=_ALIKE)), [])
        stacks += [(kind, some)] * (not some)
        some.append(plane)
    sizes = sorted(len(some) for _, some in stacks)
    if len(sizes) > 1 and (sizes[-1] < 3 or sizes[-2] > 1):
        raise InputError(f"holds stacks of different sizes or directions, of {', '.join(map(str, sizes))} slices",
                         code="slices", remedy="keep one of them in a folder, or convert them by dcm2niix")
    for what, count in (("copies of other slices", len(planes) - len(once)),
                        ("localizers, or slices of other sizes or directions,", sum(sizes[:-1]))):
        remarks += [f"{what} are left out: {count}"] * bool(count)
    return max((some for _, some in stacks), key=len)


def _segmentation(planes: list[_Plane], choice: Choice) -> Field:
    """Read labels of all segments, 1 within one, or the probability of one; with an empty slice added at both ends."""
    header, paths = planes[0].header, {each.path for each in planes}
    if len(paths) > 1:
        raise InputError(f"holds {len(paths)} segmentations", code="key", remedy="give the file of one")
    numbers = {(str(each.SegmentNumber), str(each.SegmentLabel)): int(each.SegmentNumber)
               for each in header.SegmentSequence}
    share = header.SegmentationType == "FRACTIONAL"
    one = choice.key is not None or share
    chosen = [_named("segments", numbers, choice.key)] if one else None
    highdicom = _library("highdicom")
    read = highdicom.seg.segread(planes[0].path)
    volume = read.get_volume(segment_numbers=chosen, combine_segments=not one).squeeze_channel()
    field = of_volume(volume.pad([(1, 1), (0, 0), (0, 0)])[::-1], choice)
    channel_of(1, choice.band)
    segments = [each for each in header.SegmentSequence if chosen is None or int(each.SegmentNumber) in chosen]
    if share:
        unit = str(header.get("SegmentationFractionalType") or PROBABILITY).lower()
        return replace(field, name=str(segments[0].SegmentLabel), unit=unit)
    notes: dict[str, str] = {}
    for each in segments:
        colour = each.get("RecommendedDisplayCIELabValue")
        shown = colour and np.array(highdicom.color.CIELabColor.from_dicom_value(colour).to_rgb()) / 255
        notes |= about(1 if one else int(each.SegmentNumber), str(each.SegmentLabel), shown)
    return replace(field, notes=notes)


# ---- places of slices ------------------------------------------------------------------------------------------------


def _arranged(planes: list[_Plane]) -> tuple[list[list[_Plane]], Array, str]:
    """Arrange slices as volumes in one place; with the matrix of their samples, and what distinguishes them."""
    first = planes[0]
    between = abs(float(first.get("SpacingBetweenSlices", "SliceThickness") or 1))
    if first.corner is None:
        numbers = {(each.get("InstanceNumber"), each.number): each for each in planes}
        if len(numbers) < len(planes):
            raise InputError("holds slices without positions or numbers", code="slices", remedy="number them")
        planes = [numbers[each] for each in sorted(numbers)]
        matrix = np.column_stack([first.axes * [1, 1, between], np.zeros(3)])
        film = len(planes) > 1 and first.get(*_FILMED) is not None
        return ([[each] for each in planes], matrix, "time") if film else ([planes], matrix, "")
    along = {plane: float(plane.corner @ first.axes[:, 2]) for plane in planes if plane.corner is not None}
    heaps = list[list[_Plane]]()
    for plane in sorted(along, key=along.__getitem__):
        heaps += [[]] * (not heaps or along[plane] - along[heaps[-1][-1]] > _TOGETHER)
        heaps[-1].append(plane)
    differ, volumes = _times(heaps)
    corners = np.array([each.corner for each in volumes[0]])
    last = len(corners) - 1
    step = (corners[-1] - corners[0]) / last if last else first.axes[:, 2] * between
    off = np.linalg.norm(corners - corners[0] - step * np.arange(len(corners))[:, None], axis=1)
    if off.max() > EVEN * np.linalg.norm(step):
        near = volumes[0][int(off.argmax())]
        raise InputError(f"holds slices with a gap or at uneven steps: {near} lies {off.max():g} mm off", code="slices",
                         remedy="add the missing slices, or resample them at even steps, as dcm2niix does")
    return volumes, np.column_stack([volumes[0][0].axes[:, :2], step, corners[0]]), differ


def _times(heaps: list[list[_Plane]]) -> tuple[str, list[list[_Plane]]]:
    """Find the attribute that distinguishes frames in one place, and the frames of each volume."""
    more = [heap for heap in heaps if len(heap) > 1]
    if not more:
        return "", [[plane for (plane,) in heaps]]
    for name in _TIMES:
        found = [{_sortable(plane.get(name)): plane for plane in heap} for heap in heaps]
        whole = all(len(each) == len(heap) for each, heap in zip(found, heaps, strict=True))
        if whole and None not in found[0] and all(each.keys() == found[0].keys() for each in found):
            return name, [[each[value] for each in found] for value in sorted(found[0])]
    raise InputError(
        f"holds several slices in one place, {more[0][0]} and {more[0][1]}, that differ by nothing, or lack others",
        code="slices", remedy="keep those of one volume in a folder, or convert them by dcm2niix")


def _sortable(value: Any) -> Any:
    return str(value) if isinstance(value, Sequence) else value


# ---- writing ---------------------------------------------------------------------------------------------------------


def write_segmentation(
    values: Array, place: Placement | None, path: Path, series: list[Any], notes: Mapping[str, str]
) -> None:
    """Write a mask (s0, s1, s2) of uint8, or labels, as a segmentation of a body, which lies where its samples do.

    ``series`` are headers of the patient in the same frame of reference, by `series_of`. Segments have the numbers of
    the labels, and the names and colours that ``notes`` gives them; they are BINARY where the numbers are 1, 2, ..
    without a gap, and else a LABELMAP. Raises `OptionError` if the samples do not lie in a body, if nothing is marked,
    or if labels are not integers from 1 to 65535.
    """
    highdicom, codes = _library("highdicom"), _library("pydicom.sr.codedict").codes
    numbers, matrix = np.unique(values[values != 0]), _in_lps(place)
    if not len(numbers):
        raise OptionError("no sample is marked, and a segmentation cannot hold that", code="empty")
    if (numbers % 1).any() or numbers[0] < 1 or numbers[-1] > _MOST_LABEL:
        raise OptionError(f"labels of a segmentation are integers from 1 to {_MOST_LABEL}", code="labels",
                          remedy="write .nrrd")
    how = highdicom.AlgorithmIdentificationSequence("isocodec", codes.DCM.EdgeDetection, "1")
    tissue = codes.SCT.Tissue
    names = [(name_of(number, notes) or f"label {number:.0f}").replace("\\", "/")[:_MOST_LETTERS] for number in numbers]
    segments = [
        highdicom.seg.SegmentDescription(int(number), name, tissue, tissue, "SEMIAUTOMATIC", how,
                                         display_color=_lab(colour_of(number, notes)))
        for number, name in zip(numbers, names, strict=True)
    ]
    volume = highdicom.Volume(np.ascontiguousarray(values.T).astype(np.uint16), matrix[:, [2, 1, 0, 3]], "PATIENT")
    binary = np.array_equal(numbers, np.arange(1, len(numbers) + 1))
    made = highdicom.seg.Segmentation(
        series, volume, "BINARY" if binary else "LABELMAP", segments, series_instance_uid=highdicom.UID(),
        series_number=1, sop_instance_uid=highdicom.UID(), instance_number=1,
        **({} if "".join(names).isascii() else {"specific_character_set": _UTF_8}), **_MAKER,
    )
    made.save_as(path)


def write_stl(contours: Any, path: Path, series: list[Any]) -> None:
    """Write a surface in a body as an encapsulated STL, in mm to the left, back and top, in single precision.

    ``series`` is as of `write_segmentation`. Raises `OptionError` if the surface does not lie in a body, or is empty.
    """
    highdicom = _library("highdicom")
    contour: Contour
    (contour,) = contours
    _in_lps(contour.placement)
    if not len(contour.cells):
        raise OptionError("there are no cells, and the format cannot hold that", code="empty",
                          remedy="choose an isovalue within the data, or write .vtp")
    mesh, first = contour.to_trimesh(), series[0]
    turn = np.eye(3) if contour.placement is not None and contour.placement.crs == LPS else BODY_TURN
    mesh.vertices = single(mesh.vertices @ turn)
    data = mesh.export(file_type="stl")
    made = highdicom.SOPClass(
        first.StudyInstanceUID, highdicom.UID(), 1, highdicom.UID(), _STL, 1, "M3D",
        transfer_syntax_uid="1.2.840.10008.1.2.1", specific_character_set=first.get("SpecificCharacterSet"),
        **{name: first[attribute].value or None for name, attribute in _PATIENT.items()}, **_MAKER,
    )
    made.FrameOfReferenceUID, made.PositionReferenceIndicator = first.FrameOfReferenceUID, ""
    made.AcquisitionDateTime, made.BurnedInAnnotation, made.DocumentTitle = "", "NO", ""
    made.ConceptNameCodeSequence, made.ModelModification, made.ModelMirroring = [], "NO", "NO"
    made.MeasurementUnitsCodeSequence = [highdicom.sr.CodedConcept("mm", "UCUM", "millimeter")]
    made.MIMETypeOfEncapsulatedDocument = "model/stl"
    made.EncapsulatedDocument, made.EncapsulatedDocumentLength = data + b"\0" * (len(data) % 2), len(data)
    made.save_as(path)


def _lab(colour: str | None) -> Any:
    """Convert ``#rrggbb`` to a colour of DICOM; None stays None."""
    return colour and _library("highdicom").color.CIELabColor.from_rgb(*bytes.fromhex(colour[1:]))


_MAKER = {"manufacturer": "isocodec", "manufacturer_model_name": "isocodec", "software_versions": "1",
          "device_serial_number": "1"}
_PATIENT = {
    "patient_id": "PatientID", "patient_name": "PatientName", "patient_birth_date": "PatientBirthDate",
    "patient_sex": "PatientSex", "accession_number": "AccessionNumber", "study_id": "StudyID",
    "study_date": "StudyDate", "study_time": "StudyTime", "referring_physician_name": "ReferringPhysicianName",
}
"""Attributes of patient and study, by the names that highdicom has for them; a file may lack any."""


def series_of(like: str) -> list[Any]:
    """Read the headers of a series; raises `InputError` if a folder holds several, or they have no frame of reference.
    """
    pydicom, path = _library("pydicom"), Path(like)
    if not path.exists():
        raise InputError(f"there is no file or folder {plain(like)}", code="like", remedy="give a DICOM series")
    with reading("DICOM"):
        found = {plane.path: plane for plane in _planes(path, [])}
        if len({plane.header.SeriesInstanceUID for plane in found.values()}) > 1:
            raise InputError(f"{plain(like)} holds several series", code="like", remedy="give a folder of one")
        headers = [pydicom.dcmread(each, stop_before_pixels=True) for each in found]
        if not headers[0].get("FrameOfReferenceUID"):
            raise InputError(f"{plain(like)} has no frame of reference", code="like", remedy="give a series that has")
    for header in headers:
        for attribute in {*_PATIENT.values()} - {*header.dir()}:
            setattr(header, attribute, "")
    return headers


def _in_lps(place: Placement | None) -> Array:
    """Matrix (4, 4) of samples to the left, back and top; raises `OptionError` if they do not lie in a body."""
    if place is None or place.space is None or place.matrix is None:
        raise OptionError("DICOM needs samples in a body, in even steps", code="placement",
                          remedy="encode DICOM, NIfTI or NRRD, or with --crs right-anterior-superior")
    matrix = volume_matrix(place)
    assert matrix is not None
    return np.asarray(np.diag([*np.diag(BODY_TURN), 1]) @ matrix)
