"""Small files of DICOM: slices in a folder, frames in one file, segmentations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from libraries import Late

Dataset = Late("pydicom.Dataset")
FileMetaDataset = Late("pydicom.dataset.FileMetaDataset")
CTImageStorage = "1.2.840.10008.5.1.4.1.1.2"
EnhancedCTImageStorage = "1.2.840.10008.5.1.4.1.1.2.1"
ExplicitVRLittleEndian = "1.2.840.10008.1.2.1"
generate_uid = Late("pydicom.uid.generate_uid")
PositronEmissionTomographyImageStorage = "1.2.840.10008.5.1.4.1.1.128"

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
    path: Path, labels: Any, how: str = "BINARY", *, step: Sequence[float] = STEP, most: int = 255,
) -> Path:
    """Write a segmentation of labels (slices, rows, columns), without frames that would be empty.

    Fractions are a quarter where labels are.
    """
    import highdicom
    from pydicom import dcmread
    from pydicom.sr.codedict import codes

    def named(made: Dataset, number: int) -> None:
        for name in ("PatientBirthDate", "PatientSex", "StudyDate", "StudyTime", "AccessionNumber", "StudyID",
                     "ReferringPhysicianName", "PositionReferenceIndicator", "Manufacturer"):
            setattr(made, name, "")

    folder = slices(path.parent / f"{path.stem}-source", stored(labels.shape), named, step=step)
    numbers = [int(each) for each in np.unique(labels) if each]
    described = [
        highdicom.seg.SegmentDescription(number, f"organ {number}", codes.SCT.Tissue, codes.SCT.Bone, "MANUAL")
        for number in (numbers if how == "LABELMAP" else range(1, max(numbers) + 1))]
    fractions = np.stack([labels == number for number in range(1, max(numbers) + 1)], -1) / 4
    highdicom.seg.Segmentation(
        [dcmread(each) for each in sorted(folder.iterdir())], fractions if how == "FRACTIONAL" else labels, how,
        described, "1.2.9", 2, "1.2.10", 1, "m", "n", "1", "1", max_fractional_value=most).save_as(path)
    return path
