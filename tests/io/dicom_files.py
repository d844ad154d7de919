"""Small files of DICOM: slices in a folder, frames in one file, segmentations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydicom import Dataset
from pydicom.dataset import FileMetaDataset
from pydicom.uid import (
    CTImageStorage,
    EnhancedCTImageStorage,
    ExplicitVRLittleEndian,
    PositronEmissionTomographyImageStorage,
    SegmentationStorage,
    generate_uid,
)

SHAPE = (5, 6, 7)
"""Slices, rows, columns."""
AXIAL = (1.0, 0, 0, 0, 1, 0)
CORNER, BETWEEN, STEP = (-10.0, -20.0, 30.0), (0.75, 1.25), (0.0, 0.0, 2.5)
Change = Callable[[Dataset, int], object]


def stored(shape: Sequence[int] = SHAPE, dtype: str = "u2") -> Any:
    """Stored samples, all different in small volumes."""
    return (np.arange(int(np.prod(shape))) * 7 % 4093).reshape(shape).astype(dtype)


def header(storage: str, rows: int, columns: int, dtype: np.dtype[Any]) -> Dataset:
    """What files of all kinds have."""
    made = Dataset()
    meta = made.file_meta = FileMetaDataset()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    meta.MediaStorageSOPClassUID = made.SOPClassUID = storage
    meta.MediaStorageSOPInstanceUID = made.SOPInstanceUID = generate_uid()
    made.SeriesInstanceUID, made.StudyInstanceUID, made.FrameOfReferenceUID = "1.2.3", "1.2.4", "1.2.5"
    made.Modality, made.PatientID, made.PatientName = "CT", "", ""
    made.Rows, made.Columns, made.SamplesPerPixel, made.PhotometricInterpretation = rows, columns, 1, "MONOCHROME2"
    made.BitsAllocated = made.BitsStored = 8 * dtype.itemsize
    made.HighBit, made.PixelRepresentation = made.BitsStored - 1, int(dtype.kind == "i")
    return made


def pixels(made: Dataset, samples: Any) -> None:
    """Put samples into a file."""
    made.PixelData = np.ascontiguousarray(samples).tobytes() + b"\0" * (samples.nbytes % 2)
    made["PixelData"].VR = "OW" if samples.itemsize > 1 else "OB"


def corner(number: float, step: Sequence[float] = STEP) -> list[float]:
    """Position of a slice."""
    return [round(a + number * b, 6) for a, b in zip(CORNER, step, strict=True)]


def slices(
    folder: Path, samples: Any, change: Change = lambda made, number: None, *, turned: Sequence[float] = AXIAL,
    step: Sequence[float] = STEP, order: Sequence[int] | None = None, storage: str = CTImageStorage,
) -> Path:
    """Write a folder of slices; each is changed before it is written."""
    folder.mkdir(exist_ok=True)
    for number, one in enumerate(samples):
        made = header(storage, *one.shape[:2], one.dtype)
        made.InstanceNumber, made.PixelSpacing, made.SliceThickness = number + 1, [*BETWEEN], 2
        made.ImageOrientationPatient, made.ImagePositionPatient = [*turned], corner(number, step)
        made.RescaleSlope, made.RescaleIntercept = 1, 0
        if storage == PositronEmissionTomographyImageStorage:
            made.Modality, made.Units = "PT", "BQML"
        pixels(made, one)
        change(made, number)
        name = number if order is None else order[number]
        made.save_as(folder / f"{name:03d}.dcm", enforce_file_format=True)
    return folder


def enhanced(
    path: Path, samples: Any, change: Change = lambda made, number: None, *, turned: Sequence[float] = AXIAL,
    step: Sequence[float] = STEP, order: Sequence[int] | None = None,
) -> Path:
    """Write the same in one file; the attributes of each frame are changed before they are sorted into groups."""
    made = header(EnhancedCTImageStorage, *samples.shape[1:3], samples.dtype)
    made.ImageType, made.NumberOfFrames = ["ORIGINAL", "PRIMARY", "VOLUME", "NONE"], len(samples)
    frames = []
    for number in range(len(samples)) if order is None else order:
        flat = Dataset()
        flat.PixelSpacing, flat.ImageOrientationPatient, flat.ImagePositionPatient = (
            [*BETWEEN], [*turned], corner(number, step))
        flat.RescaleSlope, flat.RescaleIntercept, flat.StackID, flat.InStackPositionNumber = 1, 0, "1", number + 1
        flat.PixelData = samples[number].tobytes()
        change(flat, number)
        frames.append(flat)
    made.PixelData = b"".join(flat.PixelData for flat in frames)
    made["PixelData"].VR = "OW"
    made.PerFrameFunctionalGroupsSequence = [_grouped(flat, OF_FRAME) for flat in frames]
    made.SharedFunctionalGroupsSequence = [_grouped(frames[0], SHARED)]
    for flat in frames:
        sorted_out = {*OF_FRAME, *SHARED, "PixelData"}
        made.update({element.tag: element for element in flat if element.keyword not in sorted_out})
    made.save_as(path, enforce_file_format=True)
    return path


OF_FRAME = {
    "ImagePositionPatient": "PlanePositionSequence", "ImageOrientationPatient": "PlaneOrientationSequence",
    "RescaleSlope": "PixelValueTransformationSequence", "RescaleIntercept": "PixelValueTransformationSequence",
    "RescaleType": "PixelValueTransformationSequence", "RealWorldValueSlope": "RealWorldValueMappingSequence",
    "RealWorldValueIntercept": "RealWorldValueMappingSequence", "StackID": "FrameContentSequence",
    "InStackPositionNumber": "FrameContentSequence", "TemporalPositionIndex": "FrameContentSequence",
    "ReferencedSegmentNumber": "SegmentIdentificationSequence",
}
SHARED = {"PixelSpacing": "PixelMeasuresSequence", "SliceThickness": "PixelMeasuresSequence",
          "SpacingBetweenSlices": "PixelMeasuresSequence"}


def _grouped(flat: Dataset, groups: dict[str, str]) -> Dataset:
    made = Dataset()
    for name, sequence in groups.items():
        if name in flat:
            if sequence not in made:
                setattr(made, sequence, [Dataset()])
            made[sequence].value[0][name] = flat[name]
    return made


def segmentation(
    path: Path, labels: Any, how: str = "BINARY", *, step: Sequence[float] = STEP,
    change: Change = lambda made, number: None,
) -> Path:
    """Write a segmentation of labels (slices, rows, columns), without frames that would be empty."""
    made = header(SegmentationStorage, *labels.shape[1:], np.dtype("u1"))
    made.Modality, made.SegmentationType, made.InstanceNumber = "SEG", how, 1
    numbers = [int(each) for each in np.unique(labels) if each]
    made.SegmentSequence = []
    for number in numbers:
        one = Dataset()
        one.SegmentNumber, one.SegmentLabel = number, f"organ {number}"
        made.SegmentSequence.append(one)
    frames = []
    for number in range(len(labels)):
        for segment in numbers if how != "LABELMAP" else [None]:
            inside = labels[number] == segment if segment else labels[number]
            if inside.any():
                flat = Dataset()
                flat.PixelSpacing, flat.SliceThickness, flat.SpacingBetweenSlices = [*BETWEEN], 2.5, 2.5
                flat.ImageOrientationPatient, flat.ImagePositionPatient = [*AXIAL], corner(number, step)
                if segment:
                    flat.ReferencedSegmentNumber = segment
                frames.append((flat, inside))
    made.NumberOfFrames = len(frames)
    every = np.array([inside for _, inside in frames])
    if how == "BINARY":
        made.BitsAllocated = made.BitsStored = 1
        made.HighBit = 0
        packed = np.packbits(every.reshape(-1), bitorder="little")
        pixels(made, packed)
    else:
        pixels(made, every.astype("u1"))
    made.PerFrameFunctionalGroupsSequence = [_grouped(flat, OF_FRAME) for flat, _ in frames]
    made.SharedFunctionalGroupsSequence = [_grouped(frames[0][0], SHARED)]
    change(made, 0)
    made.save_as(path, enforce_file_format=True)
    return path
