"""Arrays of a growing mesh, in proportion to the cells decoded so far."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .growth import CANDIDATES, Growth, GrowthRegisters

ROOM = 1024
"""Initial room, in cells."""


def growth_of(vertices: int, cells: int, corners: int, extent: NDArray[np.int64]) -> Growth:
    """Make an empty mesh, to which ``vertices`` and ``cells`` will be added, without room for any."""
    d = len(extent)
    reg = GrowthRegisters()
    reg.all_vertices, reg.all_cells = vertices, cells
    nothing, none = np.zeros((0, corners), np.int64), np.zeros(0, np.int64)
    return Growth(
        np.zeros((0, d), np.int64), extent, nothing, nothing, none, none, none, np.zeros(2 * CANDIDATES, np.int64),
        np.zeros(6, np.int64), np.zeros((2, d), np.int64), np.zeros(2, np.int64), np.zeros(4, np.int64), reg,
    )


def rows_for(g: Growth, vertices: int, cells: int) -> dict[str, int]:
    """Rows that the growing arrays need for some numbers of vertices and cells."""
    corners = g.cell.shape[1]
    # the vertices of a first cell are coded before the next look at the room
    vertices += corners
    return {
        "position": vertices, "head": vertices, "cell": cells, "neighbour": cells, "link": cells * corners,
        "queue": cells * corners,
    }


def whole_growth(vertices: int, cells: int, corners: int, extent: NDArray[np.int64]) -> Growth:
    """Make an empty mesh with room for all of it."""
    g = growth_of(vertices, cells, corners, extent)
    for name, size in rows_for(g, vertices, cells).items():
        g = longer(g, name, size)
    return g


def more_rows(g: Growth) -> dict[str, int]:
    """Rows for the next cells, in proportion to those so far."""
    reg = g.reg
    more = max(ROOM, int(reg.cells))
    return rows_for(
        g, min(int(reg.vertices) + more, int(reg.all_vertices)), min(int(reg.cells) + more, int(reg.all_cells))
    )


def bytes_of(g: Growth, rows: dict[str, int] | None = None) -> list[int]:
    """Bytes of each growing array, now or with these rows."""
    rows = rows or {name: len(getattr(g, name)) for name in rows_for(g, 0, 0)}
    return [8 * count * math.prod(getattr(g, name).shape[1:]) for name, count in rows.items()]


def longer(g: Growth, name: str, size: int) -> Growth:
    """Lengthen an array of a mesh to ``size`` rows."""
    array = getattr(g, name)
    out = np.zeros((size, *array.shape[1:]), np.int64)
    out[: len(array)] = array
    if name == "head":
        out[len(array) :] = -1
    changed: dict[str, Any] = {name: out}
    return g._replace(**changed)
