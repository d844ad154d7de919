"""Which format a file has, by its name or its first bytes."""

from __future__ import annotations

from pathlib import PurePosixPath

from ...storage.content import SuffixOf
from .read import FIELD_SUFFIXES

_SIGNATURES: tuple[tuple[int, bytes, str], ...] = (
    (0, b"\x93NUMPY", ".npy"), (0, b"PK\x03\x04", ".npz"), (0, b"\x89HDF\r\n\x1a\n", ".h5"), (0, b"\x89PNG", ".png"),
    (0, b"\xff\xd8\xff", ".jpg"), (0, b"II*\0", ".tif"), (0, b"MM\0*", ".tif"), (0, b"II+\0", ".tif"),
    (0, b"MM\0+", ".tif"), (344, b"n+1\0", ".nii"), (4, b"n+2\0", ".nii"), (0, b"\x1f\x8b", ".nii.gz"),
    (0, b"NRRD", ".nrrd"), (0, b"CDF\x01", ".nc"), (0, b"CDF\x02", ".nc"), (0, b"CDF\x05", ".nc"),
    (0, b"GRIB", ".grib"), (128, b"DICM", ".dcm"), (0, b"<VTKFile", ".vti"), (0, b"<?xml", ".vti"),
    (0, b"ObjectType", ".mha"), (0, b"NDims", ".mha"),
)
"""Where files of each kind have which bytes."""


def recognised(name: str, first: bytes) -> str | None:
    """The suffix of a format that the name ends in, or else that of the first bytes; None if neither is known."""
    lower = PurePosixPath(name).name.lower()
    named = (suffix for suffix in sorted(FIELD_SUFFIXES, key=len, reverse=True) if lower.endswith(suffix))
    signed = (suffix for at, sign, suffix in _SIGNATURES if first[at : at + len(sign)] == sign)
    return next(named, None) or next(signed, None)


def of_kind(kind: str | None) -> SuffixOf:
    """`recognised`, unless the kind is known."""
    return recognised if kind is None else lambda name, first: kind
