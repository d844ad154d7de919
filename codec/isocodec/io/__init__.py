"""Readers and writers of other people's formats: fields in, curves and surfaces out."""

from __future__ import annotations

from ..storage.atomic import check_target, write_bytes
from .readers.reader import read
from .readers.registry import FIELD_SUFFIXES, read_mesh
from .writers.write import CURVE_SUFFIXES, check_suffix, render_contour, write_contour

__all__ = [
    "CURVE_SUFFIXES",
    "FIELD_SUFFIXES",
    "check_suffix",
    "check_target",
    "read",
    "read_mesh",
    "render_contour",
    "write_bytes",
    "write_contour",
]
