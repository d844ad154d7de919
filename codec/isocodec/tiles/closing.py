"""Close gaps between tiles that are drawn up to different stages, in the face that they share.

Both meshes contain the corners of the coarser mesh's cubes in the face, with the same signs. So in each square of the
face (in 2-D, on each of its edges), the drawings of both tiles are closed to loops by parts of the square's border, and
these loops bound the area to be filled. A part of a border ends at every point that any tile has there, so that
squares, and faces that meet at an edge of tiles, agree on it. Squares next to missing samples, where curves end, are
left open.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.gaps import filled, loops_of
from ..drawing.leaves import WholeCells
from .layout import Index

Line = tuple[int, Index]
"""A line of the grid: its axis, and its first sample, which is 0 along that axis."""
Edge = tuple[int, int]


@dataclass(frozen=True)
class TilePart:
    """The drawing of a tile.

    Attributes
    ----------
    index : tuple of int
    stage, cube : int
        Stage up to which the tile is drawn, and the edge length of its cubes in samples.
    origin, size : tuple of int
    contour : Contour
        Contour in coordinates of the tile.
    ends : (E, 2, n) int64
        Samples of the tile between which the first points lie; other points lie inside cells.
    whole : function of (C, n) int64 to (C,) bool, or None
        Finds which unit cells of the tile, by their lowest corners, have no missing corner; None if no sample is
        missing.
    """

    index: Index
    stage: int
    cube: int
    origin: Index
    size: Index
    contour: Contour
    ends: NDArray[np.int64]
    whole: WholeCells | None

    @property
    def nbytes(self) -> int:
        """Size of the drawing in memory."""
        return self.contour.points.nbytes + self.contour.cells.nbytes + self.ends.nbytes


@dataclass(frozen=True)
class Square:
    """Gaps to close in a square of a face, or on an edge in 2-D.

    Attributes
    ----------
    axis : int
        Axis across the face.
    edges : list of pairs
        Pairs of points, with the direction that the filling needs for the two tiles.
    border : list of pairs, each with a bool
        Parts of the border, each with whether the square begins there.
    """

    axis: int
    edges: list[Edge]
    border: list[tuple[Edge, bool]]


class Closing:
    """The segments or triangles that close all gaps between tiles.

    ``points`` are those of all parts, and ``numbers`` the indices of the points of each part among them.
    """

    def __init__(
        self, parts: Sequence[TilePart], numbers: Sequence[NDArray[np.int64]], points: NDArray[np.float64]
    ) -> None:
        self._parts, self._numbers, self._points = parts, numbers, points
        self._ends = [part.ends + np.array(part.origin) for part in parts]
        self._n = points.shape[1]
        self._last = [{p.origin[a] + p.size[a] - 1 for p in parts} for a in range(self._n)]
        self._lines: dict[Line, list[tuple[float, int, int]]] = {}
        self._line_of: dict[int, tuple[Line, int]] = {}

    def cells(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return additional points, (Q, n), and segments or triangles, (M, n)."""
        squares = list(self._squares())
        if self._n == 2:
            segments = [edge for square in squares for edge, _ in square.border]
            return np.zeros((0, 2)), np.array(segments, np.int64).reshape(-1, 2)
        points = np.concatenate([self._points, self._apart(squares)])
        more: list[NDArray[np.float64]] = []
        out: list[tuple[int, int, int]] = []
        for square in squares:
            border = [edge for edge, _ in square.border]
            for loop in loops_of([*square.edges, *border]):
                count = len(points) + len(more)
                triangles, middle = filled(loop, points, square.axis, set(map(frozenset, border)), count)
                out += triangles
                more += middle
        added = [points[len(self._points) :], np.array(more).reshape(-1, 3)]
        return np.concatenate(added), np.array(out, np.int64).reshape(-1, 3)

    def _squares(self) -> Iterator[Square]:
        """Collect the gaps to close, square by square."""
        faces = list(self._faces())
        if faces:
            self._note_lines()
        for i, j, axis in faces:
            cube = max(self._parts[i].cube, self._parts[j].cube)
            for low, edges in self._gaps(i, j, axis, cube).items():
                border = self._border(low, edges, axis, cube)
                if border is not None and self._is_whole(i, j, axis, low, cube):
                    yield Square(axis, edges, border)

    def _apart(self, squares: Sequence[Square]) -> NDArray[np.float64]:
        """Middles, (Q, 3), of parts of borders that have all four faces around an edge of tiles filled.

        The faces are then joined in pairs, around the tiles in front and those behind; the latter pair gets the middle.
        """
        counts = Counter(frozenset(edge) for square in squares for edge, _ in square.border)
        middles: dict[frozenset[int], int] = {}
        found: list[NDArray[np.float64]] = []
        for square in squares:
            border = []
            for (a, b), behind in square.border:
                pair = frozenset((a, b))
                if counts[pair] <= 2 or not behind:
                    border.append(((a, b), behind))
                    continue
                if pair not in middles:
                    middles[pair] = len(self._points) + len(found)
                    found.append((self._points[a] + self._points[b]) / 2)
                border += [((a, middles[pair]), behind), ((middles[pair], b), behind)]
            square.border[:] = border
        return np.array(found).reshape(-1, 3)

    def _faces(self) -> Iterator[tuple[int, int, int]]:
        """Find neighbours that are drawn up to different stages: both tiles, and the axis across their face."""
        where = {part.index: i for i, part in enumerate(self._parts)}
        for i, part in enumerate(self._parts):
            for axis in range(self._n):
                behind = tuple(k + (a == axis) for a, k in enumerate(part.index))
                j = where.get(behind)
                if j is not None and self._parts[j].stage != part.stage:
                    yield i, j, axis

    def _is_whole(self, i: int, j: int, axis: int, low: Index, cube: int) -> bool:
        """Whether no sample is missing next to a square of the face of two tiles, on either side."""
        for part, place in ((self._parts[i], self._parts[i].size[axis] - 2), (self._parts[j], 0)):
            if part.whole is None:
                continue
            first = [at - from_ for at, from_ in zip(low, part.origin, strict=True)]
            ranges = [range(at, min(at + cube, size - 1)) for at, size in zip(first, part.size, strict=True)]
            ranges[axis] = range(place, place + 1)
            cells = np.array(list(product(*ranges)), np.int64).reshape(-1, self._n)
            if not part.whole(cells).all():
                return False
        return True

    def _note_lines(self) -> None:
        """Find the points on grid lines in faces, in order."""
        held: dict[Line, set[tuple[float, int, int]]] = defaultdict(set)
        for part, ends, numbers in zip(self._parts, self._ends, self._numbers, strict=True):
            last = np.array(part.origin) + np.array(part.size) - 1
            on_face = ((ends == part.origin).all(axis=1) | (ends == last).all(axis=1)).any(axis=1)
            apart = ends[:, 0] != ends[:, 1]
            some = np.flatnonzero(on_face & (apart.sum(axis=1) == 1))
            axes, own = np.argmax(apart[some], axis=1), numbers[some]
            lows = ends[some].min(axis=1)
            starts, places = lows[np.arange(len(some)), axes], self._points[own, axes]
            lows[np.arange(len(some)), axes] = 0
            listed = (axes, lows, starts, places, own)
            for axis, low, at, place, number in zip(*(each.tolist() for each in listed), strict=True):
                line = axis, tuple(low)
                held[line].add((place, at, number))
                self._line_of[number] = line, at
        self._lines = {line: sorted(points) for line, points in held.items()}

    def _gaps(self, i: int, j: int, axis: int, cube: int) -> dict[Index, list[Edge]]:
        """Find the edges to fill in each square of a face, by the square's first sample, as both tiles need them.

        In 2-D, each is a point where a line of a tile ends, (-1, point), or begins, (point, -1).
        """
        found: dict[Index, list[Edge]] = defaultdict(list)
        for part in (i, j):
            ends, cells, numbers = self._ends[part], self._parts[part].contour.cells, self._numbers[part]
            there = np.zeros(len(numbers), np.bool_)
            there[: len(ends)] = (ends[:, :, axis] == self._parts[j].origin[axis]).all(axis=1)
            if self._n == 2:
                points = cells[there[cells]]
                lows = ends[points].min(axis=1) // cube * cube
                edges = np.full((len(points), 2), -1)
                # rows of points that lines begin with, and end with
                edges[np.arange(len(points)), np.nonzero(there[cells])[1]] = numbers[points]
            else:
                turned = np.concatenate([cells[:, [1, 0]], cells[:, [2, 1]], cells[:, [0, 2]]])
                turned = turned[there[turned].all(axis=1)]
                lows = ends[turned].min(axis=(1, 2)) // cube * cube
                edges = numbers[turned]
            lows[:, axis] = self._parts[j].origin[axis]
            for low, (a, b) in zip(map(tuple, lows.tolist()), edges.tolist(), strict=True):
                # nothing has to be filled where both tiles draw the same
                if (b, a) in found[low]:
                    found[low].remove((b, a))
                else:
                    found[low].append((a, b))
        return {low: edges for low, edges in found.items() if edges}

    def _border(
        self, low: Index, edges: Sequence[Edge], axis: int, cube: int
    ) -> list[tuple[Edge, bool]] | None:
        """Parts of a square's (or an edge's) border that close open curves, each with whether the curve begins there.

        None if no part closes them, as happens near missing samples.
        """
        more: dict[int, int] = defaultdict(int)
        for a, b in edges:
            more[a] += 1
            more[b] -= 1
        more.pop(-1, None)
        by_line: dict[Line, list[int]] = defaultdict(list)
        for number, balance in more.items():
            if balance:
                if number not in self._line_of:
                    return None
                by_line[self._line_of[number][0]].append(number)
        out: list[tuple[Edge, bool]] = []
        for line, own in by_line.items():
            along, fixed = line
            # across the face and along the line, any position is accepted; squares may be cut off at the end of a field
            across = [a for a in range(self._n) if a not in (along, axis)]
            if any((fixed[a] - low[a]) % cube and fixed[a] not in self._last[a] for a in across):
                return None
            begins = all(fixed[a] == low[a] for a in across)
            order = self._lines[line]
            rank = {
                number: bisect_left(order, (float(self._points[number, along]), self._line_of[number][1], number))
                for number in own
            }
            own.sort(key=rank.__getitem__)
            flow, before = 0, -1
            for number in own:
                here = rank[number]
                steps = [(order[k][2], order[k + 1][2]) for k in range(before, here)] if flow else []
                out += [(step if flow > 0 else step[::-1], begins) for step in steps] * abs(flow)
                flow, before = flow - more[number], here
            if flow:
                return None
        return out
