"""Readers and writers of other people's formats: fields in, curves and surfaces out."""

from __future__ import annotations

from .readers.place import Place, read_place
from .readers.read import FIELD_SUFFIXES, read_field

__all__ = [
    "FIELD_SUFFIXES",
    "Place",
    "read_field",
    "read_place",
]
