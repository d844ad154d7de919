"""Readers and writers of other people's formats: fields in, curves and surfaces out."""

from __future__ import annotations

from .readers.input_formats import FIELD_SUFFIXES, read_mesh
from .readers.load import read

__all__ = ["FIELD_SUFFIXES", "read", "read_mesh"]
