"""Coordinates of the samples: the payload of their chunk (spec clause 3.7.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from isospec.container import Double, write_varint

from ..errors import FormatError
from ..field.coordinates import MOST_PERIOD
from ..field.mapped import Coordinate
from .header import varint

DENSEST = 1 << 14
"""Largest number of nodes per byte of a run."""
_HEAD = 17
"""Number of bytes of a coordinate before its period: axes, origin and unit."""
_WRAPS = 8


@dataclass(frozen=True)
class CoordinatesRecord:
    """Contents of a chunk of coordinates.

    Attributes
    ----------
    periodic : tuple of int
        Axes whose last plane of samples repeats the first one.
    coordinates : tuple of Coordinate
        x, y (, z).
    run : bytes
        The coded values of the coordinates.
    """

    periodic: tuple[int, ...]
    coordinates: tuple[Coordinate, ...]
    run: bytes


def write_coordinates(record: CoordinatesRecord) -> bytes:
    """Write the payload of a chunk of coordinates."""
    out = bytes([_bits(record.periodic)])
    for one in record.coordinates:
        out += bytes([_bits(one.axes) | (_WRAPS if one.period else 0)]) + Double.build(one.origin)
        out += Double.build(one.unit) + (write_varint(one.period) if one.period else b"")
    return out + record.run


def read_coordinates(payload: bytes, shape: Sequence[int]) -> CoordinatesRecord | None:
    """Inverse of ``write_coordinates``, given the header's shape; None if malformed, as the chunk is ancillary."""
    n = len(shape)
    # a file on a mesh has no grid
    if n == 0 or not payload or payload[0] >= 1 << n:
        return None
    at = 1
    coordinates = []
    for _ in range(n):
        if at + _HEAD > len(payload):
            return None
        axes, wraps = payload[at] & (_WRAPS - 1), payload[at] & _WRAPS
        if payload[at] > _WRAPS * 2 - 1 or not 0 < axes < 1 << n:
            return None
        origin, unit = Double.parse(payload[at + 1 : at + 9]), Double.parse(payload[at + 9 : at + _HEAD])
        at += _HEAD
        if not (math.isfinite(origin) and math.isfinite(unit) and unit > 0):
            return None
        period = 0
        if wraps:
            found = _number(payload, at)
            if found is None or not 0 < found[0] < MOST_PERIOD:
                return None
            period, at = found
        coordinates.append(Coordinate(_axes(axes), origin, unit, period))
    run = payload[at:]
    if sum(math.prod(one.counts(shape)) for one in coordinates) > DENSEST * (len(run) + 1):
        return None
    return CoordinatesRecord(_axes(payload[0]), tuple(coordinates), run)


def _number(payload: bytes, at: int) -> tuple[int, int] | None:
    try:
        return varint(payload, at, len(payload), "3.7.4")
    except FormatError:
        return None


def _bits(axes: Sequence[int]) -> int:
    return sum(1 << axis for axis in axes)


def _axes(bits: int) -> tuple[int, ...]:
    return tuple(axis for axis in range(3) if bits >> axis & 1)
