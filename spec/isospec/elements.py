"""Syntax elements, by name and number (spec clause 5.2)."""

from __future__ import annotations

ELEMENTS = (
    "origin", "component", "location", "base_sign", "significance", "refinement_sign", "value_bit", "offset_bit",
)  # fmt: skip

BY_LAYER = {
    "base": ("origin", "component", "location", "base_sign"),
    "refine": ("significance", "refinement_sign"),
    "values": ("value_bit",),
    "offsets": ("offset_bit",),
}
"""Elements that a layer of a kind holds."""
