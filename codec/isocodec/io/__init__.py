"""Readers and writers of other people's formats: fields in, curves and surfaces out."""

from __future__ import annotations

from .atomic import check_target, write_bytes
from .place import read_placement
from .read import read_field
from .write import CURVE_SUFFIXES, check_suffix, render_contour, write_contour

__all__ = [
    "CURVE_SUFFIXES",
    "check_suffix",
    "check_target",
    "read_field",
    "read_placement",
    "render_contour",
    "write_bytes",
    "write_contour",
]
