"""DICOM: a series of slices in a folder, or one file, as volumes in coordinates right, front and up."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, plain
from ...extras import optional
from .reading import reading
from .source import Source, is_dicom
from .volume import single

DICOM_SUFFIXES = (".dcm",)
EVEN = 0.01
"""How far slices may be from even steps, in steps."""
_LISTED = 20


def is_series(path: Path) -> bool:
    """Whether a folder holds files of DICOM."""
    return path.is_dir() and any(map(is_dicom, sorted(path.iterdir())))


def read_dicom(source: Source, key: str | None, frame: int | None) -> NDArray[Any]:
    """Samples, rescaled as their files say, axes i, j, k; ``key`` names one of several series of a folder.

    Raises
    ------
    InputError
        If the folder holds several series, or slices are missing or overlap.
    LimitError, MissingExtraError
    """
    with reading("DICOM"):
        names, size, _ = _series(source, key)
        sitk = _sitk()
        reader = sitk.ImageSeriesReader() if len(names) > 1 else sitk.ImageFileReader()
        reader.SetImageIO("GDCMImageIO")
        reader.SetFileNames(names) if len(names) > 1 else reader.SetFileName(names[0])
        image = reader.Execute()
        if image.GetNumberOfComponentsPerPixel() > 1:
            raise InputError("is a picture in colours", code="colour", remedy="save one of its channels alone")
        values = sitk.GetArrayFromImage(image).T
        if values.size != math.prod(size):
            raise InputError("holds slices of different sizes", code="shape")
        return single(values, frame)


def dicom_matrix(source: Source, key: str | None) -> NDArray[np.float64]:
    """Where the samples lie, (3, 4): x to the right, y to the front, z up, in millimetres."""
    with reading("DICOM"):
        matrix = _series(source, key)[2]
        return np.diag([-1.0, -1.0, 1.0]) @ matrix


def _sitk() -> Any:
    return optional("SimpleITK", extra="itk", purpose="reading DICOM")


def _series(source: Source, key: str | None) -> tuple[list[str], tuple[int, ...], NDArray[np.float64]]:
    """Files in the order of their slices, the size of all, and the matrix in ITK's coordinates."""
    sitk = _sitk()
    names = [str(source.path)]
    if source.path.is_dir():
        found = sitk.ImageSeriesReader.GetGDCMSeriesIDs(str(source.path))
        if key is None and len(found) > 1:
            listed = ", ".join(plain(name) for name in found[:_LISTED])
            raise InputError(f"holds {len(found)} series: {listed}", code="key", remedy="choose one with --key")
        if key is not None and key not in found:
            raise InputError(f"holds no series '{plain(key)}'", code="key")
        names = [*sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(source.path), key or found[0])]
        for name in names:
            if not source.follow and Path(name).resolve().parent != source.path.resolve():
                raise source.refused(Path(name).name, "which links to another folder")
    corners, first = [], None
    for name in names:
        reader = sitk.ImageFileReader()
        reader.SetImageIO("GDCMImageIO")
        reader.SetFileName(name)
        reader.ReadImageInformation()
        size, about = reader.GetSize(), (reader.GetSpacing(), reader.GetDirection())
        source.check_count(math.prod(size) * len(names) * reader.GetNumberOfComponents())
        first = first or (size, about)
        if first[0] != size or not np.allclose(np.concatenate(first[1]), np.concatenate(about), rtol=0, atol=1e-4):
            raise InputError("holds slices of different sizes or directions", code="shape",
                             remedy="keep those of one series in a folder")
        corners.append(np.array(reader.GetOrigin()[:3]))
    assert first is not None
    size, (spacing, direction) = first
    matrix = np.zeros((3, 4))
    n = len(size)
    matrix[:, :n] = (np.reshape(direction, (n, n)) * spacing)[:3, :3] if n == 3 else np.eye(3)[:, :n] * spacing
    matrix[:, 3] = np.pad(corners[0], (0, 3 - len(corners[0])))
    if len(names) > 1:
        if size[-1] > 1 and n > 2:
            raise InputError("holds several volumes", code="shape", remedy="read one of its files")
        steps = np.diff(corners, axis=0)
        step = (corners[-1] - corners[0]) / (len(corners) - 1)
        length = float(np.linalg.norm(step))
        uneven = np.flatnonzero(np.linalg.norm(steps - step, axis=1) > EVEN * length)
        if length == 0 or len(uneven):
            where = int(uneven[0]) if len(uneven) else 0
            raise InputError(
                f"holds slices at uneven steps: {np.linalg.norm(steps[where]):g} mm behind slice {where}, "
                f"{length:g} in the mean", code="slices", remedy="are some of them missing?",
            )
        matrix[:, 2] = step
        size = (*size[:2], len(names))
    return names, tuple(size), matrix
