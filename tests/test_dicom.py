"""DICOM: kinds of files by attributes, against pydicom, SimpleITK (GDCM) and highdicom."""

from __future__ import annotations

import shutil
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import highdicom
import numpy as np
import pydicom
import pytest
import SimpleITK
from pydicom.pixels import apply_modality_lut
from pydicom.uid import (
    DeflatedExplicitVRLittleEndian,
    ExplicitVRBigEndian,
    ImplicitVRLittleEndian,
    JPEG2000Lossless,
    JPEGLosslessSV1,
    JPEGLSLossless,
    PositronEmissionTomographyImageStorage,
    RLELossless,
)

import isocodec
from commands import ok
from dicom_files import AXIAL, BETWEEN, SHAPE, STEP, corner, enhanced, header, pixels, segmentation, slices, stored
from isocodec.errors import InputError, LimitError, OptionError

RAW = stored()
SIGNED = stored(dtype="i2") - 2000
RAS = np.diag([-1.0, -1, 1])
TILT = (1.0, 0, 0, 0, np.cos(0.3), np.sin(0.3))
OBLIQUE = tuple(np.round(np.linalg.qr(np.array([[1, 0.3, 0.2], [-0.2, 1, 0.4], [0.1, 0.2, 1]]))[0][:2].ravel(), 12))
NORMAL = np.cross(OBLIQUE[:3], OBLIQUE[3:])


def setter(**attributes: Any) -> Callable[[Any, int], None]:
    """Give all slices attributes; a function makes that of a number."""

    def change(made: Any, number: int) -> None:
        for name, value in attributes.items():
            setattr(made, name, value(number) if callable(value) else value)

    return change


VALUES: dict[str, tuple[Any, Callable[[Any, int], None]]] = {
    "as stored": (RAW, setter()),
    "signed": (SIGNED, setter()),
    "bytes": (RAW.astype("u1"), setter()),
    "whole intercept": (RAW, setter(RescaleIntercept=-1024)),
    "whole slope": (SIGNED, setter(RescaleSlope=3, RescaleIntercept=-7)),
    "fraction": (RAW, setter(RescaleSlope="0.0015", RescaleIntercept="0.25")),
    "fraction of one": (SIGNED, setter(RescaleSlope="1", RescaleIntercept="0.5")),
    "slopes of slices": (RAW, setter(RescaleSlope=lambda n: f"{0.5 + n / 10:g}")),
    "one other slope": (RAW, setter(RescaleSlope=lambda n: 2 if n == 3 else 1)),
    "intercepts of slices": (RAW, setter(RescaleIntercept=lambda n: 0 if n == 0 else -1024)),
    "inverted": (RAW, setter(PhotometricInterpretation="MONOCHROME1")),
}
PLACES: dict[str, dict[str, Any]] = {
    "axial": {}, "reversed": {"order": (4, 3, 2, 1, 0)}, "shuffled": {"order": (2, 0, 4, 1, 3)},
    "downwards": {"step": (0, 0, -2.5)}, "coronal": {"turned": (1, 0, 0, 0, 0, -1), "step": (0, 2, 0)},
    "sagittal": {"turned": (0, 1, 0, 0, 0, -1), "step": (-3, 0, 0)},
    "mirrored": {"turned": (-1, 0, 0, 0, 1, 0)}, "oblique": {"turned": OBLIQUE, "step": tuple(2 * NORMAL)},
    "tilted": {"turned": TILT},
}


def truth(samples: Any, change: Callable[[Any, int], None]) -> Any:
    """Values by pydicom, slice by slice, (i, j, k)."""
    out = []
    for number, one in enumerate(samples):
        made = pydicom.Dataset()
        made.RescaleSlope, made.RescaleIntercept = 1, 0
        change(made, number)
        out.append(apply_modality_lut(one, made))
    return np.array(out).T


def in_order(turned: Any = AXIAL, step: Any = STEP, **_: Any) -> bool:
    """Whether the slices follow one another along their normal."""
    return float(np.dot(np.cross(turned[:3], turned[3:]), step)) > 0


def matrix(turned: Any = AXIAL, step: Any = STEP, **_: Any) -> Any:
    """Placement by the tags, for slices in their order."""
    first = corner(0, step) if in_order(turned, step) else corner(SHAPE[0] - 1, step)
    step = np.array(step) * (1 if in_order(turned, step) else -1)
    return RAS @ np.column_stack([np.array(turned[:3]) * BETWEEN[1], np.array(turned[3:]) * BETWEEN[0], step, first])


@pytest.mark.parametrize("kind", ["folder", "PET", "enhanced", "one slice"])
@pytest.mark.parametrize("name", VALUES)
def test_values(tmp_path: Path, name: str, kind: str) -> None:
    samples, change = VALUES[name]
    storage = {"storage": PositronEmissionTomographyImageStorage} if kind == "PET" else {}
    if kind == "enhanced":
        path = enhanced(tmp_path / "a.dcm", samples, change)
    else:
        path = slices(tmp_path / "a", samples[:1] if kind == "one slice" else samples, change, **storage)
    found = isocodec.read(path)
    right = truth(samples[:1] if kind == "one slice" else samples, change)
    right = right[..., 0] if kind == "one slice" else right
    assert np.array_equal(found.values, right)
    whole = name in ("as stored", "signed", "bytes", "whole intercept", "whole slope", "inverted")
    of_one = kind == "one slice" and name in ("intercepts of slices", "one other slope")
    assert found.values.dtype.kind in "iu" if whole or of_one else found.values.dtype == np.float64
    assert found.mask is None


@pytest.mark.parametrize("kind", ["folder", "enhanced", "enhanced in a folder"])
@pytest.mark.parametrize("name", PLACES)
def test_places(tmp_path: Path, name: str, kind: str) -> None:
    """Against the tags, GDCM of folders, and highdicom of volumes that it takes."""
    where = PLACES[name]
    if kind == "folder":
        path = slices(tmp_path / "a", RAW, **where)
    else:
        path = enhanced(tmp_path / "a.dcm", RAW, **where)
        path = path if kind == "enhanced" else tmp_path
    found = isocodec.read(path)
    assert np.array_equal(found.values, RAW.T if in_order(**where) else RAW.T[..., ::-1])
    assert np.allclose(found.placement.matrix, matrix(**where), atol=1e-9)
    if kind == "folder" and name != "tilted":  # GDCM has no shear
        reader = SimpleITK.ImageSeriesReader()
        reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(path)))
        image = reader.Execute()
        ends = [image.TransformIndexToPhysicalPoint(index) for index in ((0, 0, 0), (6, 5, 4))]
        assert np.allclose(found.placement.place(np.array([[0, 0, 0], [6, 5, 4.0]])), ends @ RAS, atol=1e-6)
    if kind != "folder" and name not in ("tilted",):
        volume = highdicom.imread(next(tmp_path.glob("*.dcm"))).get_volume()
        corners = np.array([[0, 0, 0, 1], [4, 0, 0, 1], [4, 5, 6, 1.0]])
        theirs = (volume.affine @ corners.T)[:3].T @ RAS
        mine = found.placement.place(corners[:, [2, 1, 0]])
        back = found.placement.place((corners[:, [2, 1, 0]] * [1, 1, -1]) + [0, 0, 4])
        assert np.allclose(mine, theirs, atol=1e-6) or np.allclose(back, theirs, atol=1e-6)
