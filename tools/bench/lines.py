"""Polylines as users store them: TWKB, GeoJSON and TopoJSON, whole files before a general compressor.

TWKB is written here, since no kept Python library writes it; TopoJSON by `topojson`, Douglas-Peucker is that of GEOS.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence

import contourpy
import numpy as np
from numpy.typing import NDArray

from .measure import need

Lines = Sequence[NDArray[np.float64]]
"""Polylines (K, 2) in array index coordinates; files hold x, y, that is column, row."""

MULTI_LINE_STRING = 5


def isolines(values: NDArray[np.float64], isovalue: float) -> list[NDArray[np.float64]]:
    """Those of marching squares, by contourpy."""
    found = contourpy.contour_generator(z=values).lines(isovalue)
    return [np.asarray(line)[:, ::-1] for line in found]


def quantised(line: NDArray[np.float64], parts: int) -> NDArray[np.int64]:
    """x and y in parts of a cell, points that fall together told once."""
    q = np.round(line[:, ::-1] * parts).astype(np.int64)
    keep = np.concatenate([[True], (np.diff(q, axis=0) != 0).any(axis=1)])
    return q[keep] if keep.sum() > 1 else q[:2]


def to_twkb(lines: Lines, parts: int) -> bytes:
    """A TWKB multi-line string, precision 0, in units of 1 / parts of a cell."""
    out = bytearray([MULTI_LINE_STRING, 0])
    _varints(out, [len(lines)])
    last = np.zeros((1, 2), np.int64)
    for line in lines:
        q = quantised(line, parts)
        _varints(out, [len(q)])
        steps = np.diff(np.concatenate([last, q]), axis=0).ravel()
        _varints(out, ((steps << 1) ^ (steps >> 63)).tolist())
        last = q[-1:]
    return bytes(out)


def from_twkb(data: bytes, parts: int) -> list[NDArray[np.float64]]:
    """The polylines of such a file."""
    octets = np.frombuffer(data, np.uint8)[2:]
    ends = np.flatnonzero(octets < 128)
    begins = np.concatenate([[0], ends[:-1] + 1])
    place = np.arange(len(octets)) - np.repeat(begins, ends - begins + 1)
    numbers = np.add.reduceat((octets & 127).astype(np.int64) << (7 * place), begins)
    signed = (numbers >> 1) ^ -(numbers & 1)
    lines, at, last = [], 1, np.zeros(2, np.int64)
    for _ in range(numbers[0]):
        count = int(numbers[at])
        q = last + np.cumsum(signed[at + 1 : at + 1 + 2 * count].reshape(-1, 2), axis=0)
        at, last = at + 1 + 2 * count, q[-1]
        lines.append(q[:, ::-1] / parts)
    return lines


def _varints(out: bytearray, numbers: Iterable[int]) -> None:
    for number in numbers:
        while number > 127:
            out.append(number & 127 | 128)
            number >>= 7
        out.append(number)


def to_geojson(lines: Lines, decimals: int) -> bytes:
    """A GeoJSON geometry."""
    coordinates = [np.round(line[:, ::-1], decimals).tolist() for line in lines]
    shape = {"type": "MultiLineString", "coordinates": coordinates}
    return json.dumps(shape, separators=(",", ":")).encode()


def from_geojson(data: bytes) -> list[NDArray[np.float64]]:
    """The polylines of such a file."""
    return [np.array(line)[:, ::-1] for line in json.loads(data)["coordinates"]]


def to_topojson(lines: Lines, parts: int) -> bytes:
    """A TopoJSON topology on a grid of 1 / parts of a cell; isolines share no arcs."""
    shapely = need("shapely")
    shape = shapely.MultiLineString([line[:, ::-1] for line in lines])
    grid = {"scale": [1 / parts, 1 / parts], "translate": [0, 0]}
    return need("topojson").Topology(shape, topology=False, prequantize=False, topoquantize=grid).to_json().encode()


def from_topojson(data: bytes) -> list[NDArray[np.float64]]:
    """The polylines of such a file."""
    topology = json.loads(data)
    scale = np.array(topology["transform"]["scale"])
    return [(np.cumsum(np.array(arc), axis=0) * scale)[:, ::-1] for arc in topology["arcs"]]


def simplified(lines: Lines, tolerance: float) -> list[NDArray[np.float64]]:
    """Douglas-Peucker by GEOS; lines that vanish are left out."""
    shapely = need("shapely")
    if not len(lines):
        return []
    found = shapely.simplify([shapely.LineString(line) for line in lines], tolerance, preserve_topology=False)
    return [shapely.get_coordinates(line) for line in found if not line.is_empty]
