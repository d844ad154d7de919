"""Readers and writers of other people's formats: fields in, curves and surfaces out."""

from __future__ import annotations

from .readers.reader import read
from .readers.registry import FIELD_SUFFIXES, read_mesh

__all__ = ["FIELD_SUFFIXES", "read", "read_mesh"]
