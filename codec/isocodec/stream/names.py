"""Types of options: which names there are, so that type checkers know them, too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, SupportsFloat, TypeAlias

ProfileName: TypeAlias = Literal["main", "baseline"]
"""How symbols become bytes."""
CriterionName: TypeAlias = Literal["crossing", "topology", "curvature", "distortion", "level"]
"""Criteria that a mesh is reduced under."""
Distance: TypeAlias = float | Literal["exact"]
"""What a step promises: a distance in cells, or all values."""
MeshName: TypeAlias = Literal["known", "coded", "whole", "delaunay"]
"""What a file holds of an explicit mesh."""
ThinningName: TypeAlias = Literal["AT1", "AT2", "AT3", "inf", "l2", "NAT"]
"""Which point of a triangulation matters least."""
Isovalues: TypeAlias = SupportsFloat | Sequence[SupportsFloat]
"""One number, of Python's, numpy's, a fraction or a decimal; or several, also as an array."""
