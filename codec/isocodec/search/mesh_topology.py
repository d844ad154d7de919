"""Nodes of the hierarchy of a mesh that may go without a change of topology (row C2-topology; docs/encoders.md, 6).

In the cells around the vertex that goes, the contour is a copy of the part of the link with the other sign than the
vertex; in the cells that take their place, of the part with the other sign than its target. If both have the same sign,
nothing changes. Otherwise these are the two parts of a sphere that the contour's rims cut it into, which agree if there
is one rim: if both signs form one part each; at the border of the mesh, on the border of the link, too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernel import inlined, inner, kernel
from ..kernel.types import BoolVector, IntMatrix, IntVector
from ..mesh.complex import holds
from ..mesh.cut import CellHistory


@inlined
def _root(parent, v):
    """The vertex that a part is known by."""
    while parent[v] != v:
        v = parent[v]
    return v


@inlined
def _more(parts, above, count):
    """So many parts more of a sign."""
    return (parts[0], parts[1] + count) if above else (parts[0] + count, parts[1])


@inner
def _parts(cell, star, above, v, apex, rim, parent, seen):
    """Parts of each sign, (below, above), of the link of v without the apex, or of its rim; ``seen`` is room."""
    corners = cell.shape[1]
    count = np.int64(0)
    parts = (np.int64(0), np.int64(0))
    for k in star:
        if rim and not holds(cell, k, apex):
            continue
        for i in range(corners):
            a = cell[k, i]
            if a in (v, apex):
                continue
            if parent[a] < 0:
                parent[a] = a
                seen[count] = a
                count += 1
                parts = _more(parts, above[a], 1)
            for j in range(i):
                b = cell[k, j]
                if b in (v, apex) or above[a] != above[b]:
                    continue
                one, other = _root(parent, a), _root(parent, b)
                if one != other:
                    parent[one] = other
                    parts = _more(parts, above[b], -1)
    for i in range(count):
        parent[seen[i]] = -1
    return parts


@kernel
def find_safe(
    cell: IntMatrix, first: IntVector, star: IntVector, vertex: IntVector, target: IntVector, above: BoolVector,
    room: IntMatrix, out: BoolVector,
) -> None:
    """Mark the safe nodes; ``room`` is (2, V + 1), all -1."""
    parent, seen = room[0], room[1]
    apex = np.int64(len(above))
    for i in range(len(vertex)):
        v = vertex[i]
        if above[v] == above[target[i]]:
            out[i] = True
            continue
        around = star[first[i] : first[i + 1]]
        below, over = _parts(cell, around, above, v, apex, False, parent, seen)
        out[i] = below == 1 and over == 1
        border = False
        for k in around:
            border = border or holds(cell, k, apex)
        if out[i] and border:
            below, over = _parts(cell, around, above, v, apex, True, parent, seen)
            out[i] = below == 1 and over == 1


def safe_nodes(history: CellHistory, above: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Find nodes that may go, (N,), if vertices (V,) lie above or below: the contour keeps parts, rims and handles."""
    out = np.zeros(len(history.vertex), np.bool_)
    room = np.full((2, len(above) + 1), -1)
    find_safe(history.cell, history.star_first, history.star, history.vertex, history.target, above, room, out)
    return out
