"""Tables of the full grid: the pieces in a unit cell for each pattern of the signs of its corners.

A cell is seen from x0: bit a of corner c is set if the corner differs from x0 along axis a, so that x0 is
corner 0 and xn the last one. The n! simplices of the cell are the paths from the first to the last, one axis at a
time. All tables are generated from these.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .crossing import Edge, PatternTable
from .simplices import simplex_pieces

Piece = tuple[Edge, ...]


@dataclass(frozen=True)
class CubeTable:
    """Instructions for drawing a cell that is not mirrored.

    Attributes
    ----------
    cells : PatternTable
        Segments or triangles between points on grid edges.
    fans : PatternTable
        n = 3: sides, in pairs of edges, of the one polygon of a cell that needs a point in its middle.
    mixed : (patterns,) int64
        Number of mixed simplices of the cell.
    needed : (patterns,) int64
        Corners of these simplices, as bits.
    """

    cells: PatternTable
    fans: PatternTable
    mixed: NDArray[np.int64]
    needed: NDArray[np.int64]


@cache
def cube_table(n: int) -> CubeTable:
    """Table over the ``2 ** 2 ** n`` sign patterns; bit c of a pattern is set if corner c is above."""
    cells: list[list[Piece]] = []
    fans: list[list[Piece]] = []
    paths = [_path(axes) for axes in itertools.permutations(range(n))]
    mixed, needed = [], []
    for pattern in range(2 ** (2**n)):
        pieces = _pieces(n, pattern)
        cut = [path for path in paths if len({pattern >> corner & 1 for corner in path}) == 2]
        mixed.append(len(cut))
        needed.append(sum(1 << corner for corner in set().union(*cut)))
        drawn, fan = (_chains(pieces), []) if n == 2 else _surfaces(pieces)
        cells.append(drawn)
        fans.append(fan)
    return CubeTable(
        PatternTable.build(cells, n), PatternTable.build(fans, 2), np.array(mixed, np.int64), np.array(needed, np.int64)
    )


def _path(axes: tuple[int, ...]) -> list[int]:
    """Corners of the simplex that goes along these axes one after the other."""
    return [0, *itertools.accumulate(1 << a for a in axes)]


def _pieces(n: int, pattern: int) -> list[Piece]:
    """Oriented pieces in the simplices of a cell."""
    pieces = []
    for axes in itertools.permutations(range(n)):
        path = _path(axes)
        cut = _simplex_pieces(n, sum((pattern >> corner & 1) << i for i, corner in enumerate(path)))
        # The determinant of a path is the sign of its permutation.
        odd = sum(a > b for a, b in itertools.combinations(axes, 2)) % 2
        for piece in cut:
            points = [(min(path[i], path[j]), max(path[i], path[j])) for i, j in piece]
            if odd:
                points[:2] = points[1::-1]
            pieces.append(tuple(points))
    return pieces


_simplex_pieces = cache(simplex_pieces)


def _on_grid(point: Edge) -> bool:
    return (point[0] ^ point[1]).bit_count() == 1


def _chains(pieces: list[Piece]) -> list[Piece]:
    """Join segments at the diagonal, whose point is left out."""
    following: dict[Edge, Edge] = {piece[0]: piece[1] for piece in pieces}
    drawn: list[Piece] = []
    for start in filter(_on_grid, following):
        end = following[start]
        drawn.append((start, end if _on_grid(end) else following[end]))
    return drawn


def _surfaces(pieces: list[Piece]) -> tuple[list[Piece], list[Piece]]:
    """Triangles, and the sides of a fan, that replace the pieces of a cell without its diagonals' points."""
    drawn: list[Piece] = []
    fan: list[Piece] = []
    for component in _components(pieces):
        loops = _loops(component)
        if len(loops) == 2:
            drawn += _annulus(*loops)
            continue
        (loop,) = loops
        triangles = _disc(loop)
        if triangles is None:
            # At most one per cell: such a loop takes nine of the twelve grid edges.
            fan = list(zip(loop, loop[1:] + loop[:1], strict=True))
        else:
            drawn += triangles
    return drawn, fan


def _components(pieces: list[Piece]) -> list[list[Piece]]:
    """Sort triangles by connected component."""
    components: list[tuple[set[Edge], list[Piece]]] = []
    for piece in pieces:
        points, members = set(piece), [piece]
        apart = []
        for other in components:
            if points.isdisjoint(other[0]):
                apart.append(other)
            else:
                points |= other[0]
                members = other[1] + members
        components = [*apart, (points, members)]
    return [members for _, members in components]


def _loops(triangles: list[Piece]) -> list[list[Edge]]:
    """Boundary of a component: loops of points on grid edges, in the direction of the triangles."""
    sides = {(t[i], t[i - 2]) for t in triangles for i in range(3)}
    following = {a: b for a, b in sorted(sides) if (b, a) not in sides}
    loops = []
    while following:
        loop = [next(iter(following))]
        while loop[-1] in following:
            loop.append(following.pop(loop[-1]))
        loops.append([point for point in loop[:-1] if _on_grid(point)])
    return loops


def _chord(p: Edge, q: Edge) -> int | None:
    """Squared length of a chord, in half cells and from middle to middle of the edges; None inside a cube's face.

    The neighbour across the face may have the same chord, and then four triangles would meet in it.
    """
    squared = 0
    for axis in range(3):
        at_p = (p[0] >> axis & 1) + (p[1] >> axis & 1)
        at_q = (q[0] >> axis & 1) + (q[1] >> axis & 1)
        if at_p == at_q != 1:
            return None
        squared += (at_p - at_q) ** 2
    return squared


def _disc(loop: list[Edge]) -> list[Piece] | None:
    """Triangles inside a loop with the shortest permitted chords; None if chords in faces cannot be avoided."""

    @cache
    def best(i: int, j: int) -> tuple[int, list[Piece]] | None:
        """Cheapest triangulation of the points i to j, the side from i to j included in the cost."""
        if j - i == 1:
            return 0, []
        side = 0 if j - i == len(loop) - 1 else _chord(loop[i], loop[j])
        if side is None:
            return None
        found: tuple[int, list[Piece]] | None = None
        for k in range(i + 1, j):
            left = best(i, k)
            right = best(k, j) if left else None
            if left and right and (found is None or side + left[0] + right[0] < found[0]):
                found = side + left[0] + right[0], [*left[1], *right[1], (loop[i], loop[k], loop[j])]
        return found

    whole = best(0, len(loop) - 1)
    return whole[1] if whole else None


def _annulus(one: list[Edge], two: list[Edge]) -> list[Piece]:
    """Triangles between the two loops of a tunnel, which run in opposite directions, with the shortest chords."""
    found: tuple[int, list[Piece]] | None = None
    steps = len(one) + len(two)
    for start in range(len(two)):
        for ups in itertools.combinations(range(steps), len(one)):
            i, j, cost = 0, start, 0
            triangles: list[Piece] = []
            for step in range(steps):
                if step in ups:
                    triangles.append((one[i], one[(i + 1) % len(one)], two[j]))
                    i = (i + 1) % len(one)
                else:
                    triangles.append((two[j - 1], two[j], one[i]))
                    j = (j - 1) % len(two)
                chord = _chord(one[i], two[j])
                if chord is None:
                    break
                cost += chord
            else:
                if found is None or cost < found[0]:
                    found = cost, triangles
    assert found is not None, "both loops turn around opposite corners and share no face"
    return found[1]
