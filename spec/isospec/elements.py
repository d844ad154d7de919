"""Syntax elements, by name and number (spec clause 5.2)."""

from __future__ import annotations

ELEMENTS = (
    "origin", "component", "location", "base_sign", "significance", "refinement_sign", "value_bit", "offset_bit",
    "level", "split", "continue",
)

BY_LAYER = {
    "base": ("origin", "component", "location", "base_sign"),
    "adaptive_base": ("origin", "component", "location", "base_sign", "level"),
    "leaf_base": ("origin", "component", "location", "base_sign"),
    "refine": ("significance", "refinement_sign"),
    "adapt": ("significance", "refinement_sign", "split", "continue"),
    "values": ("value_bit",),
    "offsets": ("offset_bit",),
}
"""Elements that a layer of a kind holds."""
