"""Kinds of layers, by the names that plans, events and JSON use."""

from __future__ import annotations

from enum import Enum

from isospec.container import Operation


class LayerKind(str, Enum):
    """Kinds of layers, by what they add (spec clause 3.6). Members are strings: ``LayerKind.BASE == "base"``."""

    BASE = "base"
    ADAPTIVE_BASE = "adaptive_base"
    LEAF_BASE = "leaf_base"
    REFINE = "refine"
    ADAPT = "adapt"
    VALUES = "values"
    OFFSETS = "offsets"

    __str__ = str.__str__
    __format__ = str.__format__  # type: ignore[assignment]

    @property
    def operation(self) -> Operation:
        """The operation of a layer program that gives layers of this kind."""
        return Operation[self.name]


BASES = (LayerKind.BASE, LayerKind.ADAPTIVE_BASE, LayerKind.LEAF_BASE)
"""Kinds that begin an isovalue."""
ADAPTIVE = (LayerKind.ADAPTIVE_BASE, LayerKind.ADAPT)
"""Kinds that lead to a mesh chosen by the writer."""
GEOMETRY = (LayerKind.VALUES, LayerKind.OFFSETS)
"""Kinds that store where within a cell the curve lies."""
