"""Readers and writers of other people's formats: fields in, curves and surfaces out."""

from __future__ import annotations

from ..storage.atomic import check_target, write_bytes
from .readers.place import Place, read_place
from .readers.read import FIELD_SUFFIXES, read_field
from .writers.write import CURVE_SUFFIXES, check_suffix, render_contour, write_contour

__all__ = [
    "CURVE_SUFFIXES",
    "FIELD_SUFFIXES",
    "Place",
    "check_suffix",
    "check_target",
    "read_field",
    "read_place",
    "render_contour",
    "write_bytes",
    "write_contour",
]
