"""Units of distances and of coordinates: what a text such as ``0.2mm`` means, and what a coordinate is counted in."""

from __future__ import annotations

import math
import re

from ..errors import OptionError

DEGREE = "deg"
"""Unit of longitudes and latitudes."""
METRES = {
    "m": 1.0, "km": 1000.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": 0.0254, "ft": 0.3048,
    "us-ft": 1200 / 3937, "yd": 0.9144, "mi": 1609.344, "nmi": 1852.0,
}
"""Metres of each unit of length."""
_NAMES = {
    "m": "metre meter metres meters", "km": "kilometre kilometer kilometres kilometers",
    "dm": "decimetre decimeter decimetres decimeters", "cm": "centimetre centimeter centimetres centimeters",
    "mm": "millimetre millimeter millimetres millimeters",
    "um": "\u00b5m \u03bcm micron microns micrometre micrometer micrometres micrometers",
    "nm": "nanometre nanometer nanometres nanometers", "in": "inch inches", "ft": "foot feet international_foot",
    "us-ft": "ftus us_ft usft us_survey_foot us_survey_feet", "yd": "yard yards", "mi": "mile miles statute_mile",
    "nmi": "nautical_mile nautical_miles",
    DEGREE: "\u00b0 degree degrees degs degrees_east degree_east degrees_e degree_e degreee degreese degrees_west "
    "degrees_north degree_north degrees_n degree_n degreen degreesn degrees_south",
}
_KNOWN = {name: unit for unit, names in _NAMES.items() for name in (unit, *names.split())}
_SYMBOL = 3
"""Most letters of a symbol; names are longer."""
_DISTANCE = re.compile(r"\s*([+-]?[0-9.]+(?:[eE][-+]?[0-9]+)?|[+-]?(?:inf|nan))\s*([^\s0-9.,][^0-9.,]*?)?\s*", re.I)


def unit_of(text: str | None) -> str | None:
    """A unit as the package names it, from ``mm``, ``micron``, ``degrees_east`` ..; None if it is unknown."""
    name = "_".join((text or "").split()).rstrip(".")
    # symbols are told apart by case: Mm is no millimetre
    return _KNOWN.get(name) or (_KNOWN.get(name.lower()) if len(name) > _SYMBOL else None)


def units_of(text: str | None, n: int) -> list[str | None]:
    """Units of n coordinates x, y (, z) from the text of a placement: one for all, or one for each, spaces between."""
    whole = unit_of(text)
    parts = (text or "").split()
    if whole is not None or len(parts) < 2:
        return [whole] * n
    found = [unit_of(part) for part in parts[:n]]
    return found + [None] * (n - len(found))


def distance_of(text: str) -> tuple[float, str]:
    """Split a distance (``0.5``, ``15km``, ``200um``, ``0.001deg``) into a number and the name of a unit.

    The name is that of `unit_of`, and empty for a distance in cells, which has no unit.
    """
    found = _DISTANCE.fullmatch(text)
    try:
        number, name = float(found[1] if found else ""), (found[2] if found else None) or ""
    except ValueError:
        raise OptionError(
            f"{text!r} is not a distance", code="tolerance", remedy="a number of cells, or one with a unit: 100m"
        ) from None
    unit = unit_of(name) if name else ""
    if unit is None:
        raise OptionError(
            f"unknown unit {name!r} in {text!r}", code="unit", remedy=f"one of {', '.join((*METRES, DEGREE))}"
        )
    if unit and not (math.isfinite(number) and number > 0):
        raise OptionError(f"the distance {text!r} is not a positive number", code="tolerance")
    return number, unit


def converted(distance: str, unit: str | None, of: str) -> float:
    """A distance with a unit in another unit; a number alone as it is.

    ``of`` names what is counted in it, for the error: ``the points of the mesh``.
    """
    number, given = distance_of(distance)
    if not given or given == unit:
        return number
    if unit is None:
        raise OptionError(f"a distance of {distance} needs the unit of {of}, which is unknown", code="unit",
                          remedy="give a number without a unit")
    if given not in METRES or unit not in METRES:
        raise OptionError(f"a distance of {distance} cannot be converted: the unit of {of} is {unit}", code="unit",
                          remedy="give a number without a unit")
    return number * METRES[given] / METRES[unit]
