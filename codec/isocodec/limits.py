"""What a decoder may use (spec clause 11.2)."""

from __future__ import annotations

from dataclasses import dataclass

FIELD_SAMPLES = 1 << 30
"""Samples that are read of an input file unless more are asked for.

Volumes of 1024 samples a side and terrains of 32,768 pass, the largest that are common: 8.6 GB in double precision. A
file that only claims to hold more is refused before anything is allocated for it.
"""


@dataclass(frozen=True)
class Limits:
    """What a decoder may use of one file, checked before it is used (spec clause 11).

    Attributes
    ----------
    vertices : int
        Vertices of the tubular neighbourhood, all levels together.
    simplices : int
        Mixed simplices of the mesh at any moment.
    steps : int
        Steps of the walk back to known vertices, in all; ancestors of vertices to be added count as several.
    bytes : int
        Size of a file.
    layers : int
        Layers of a file.
    samples : int
        Samples of a mask: only where one is asked for, a byte each.
    """

    vertices: int = 1 << 27
    simplices: int = 1 << 28
    steps: int = 1 << 27
    bytes: int = 1 << 33
    layers: int = 4096
    samples: int = 1 << 31
