"""Cuts of the hierarchy of a mesh that keep the contour within a distance (row C2-distortion; spec annex G.6).

Each cell that there is at any time has a piece of contour with its points where a decoder would have them. Nodes in
whose patch a piece is too far from the contour of the whole mesh have to come back. What of that contour is then too
far from the cut's is mended, by nodes that bring back cells there, until both directions are proven.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..drawing.explicit import crossed_edges
from ..drawing.simplices import simplex_table
from ..format.domain import MOST_STEP
from ..mesh.complex import CellArrays, Complex
from ..mesh.cut import CellHistory
from ..mesh.isovalue import MeshIsovalue
from ..mesh.positions import STEPS, parts_of
from .piece import TOUCH
from .proof import Target

PITCHES = (0.0, 0.5, 0.7, 1.0, 1.4)
"""Longest parts of edges that are tried, in distances; 0 for the middles of edges, without offsets."""
LAYER = 5
"""Bytes of a layer beside its run, about."""
SHARE = 64
"""One part in so many of the cells that would come back is brought back at a time, the last that went first."""
MOST_MENDED, PATIENCE = 512, 384
"""So many times cells are brought back; behind the second number, those of the mesh itself."""
SOME = 1 << 20
"""Places that are looked at at a time."""
SURE = 1 - 1e-6
"""Share of the distance that is proven, so that rounding is no matter."""

Curve = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Points and pieces."""


@dataclass(frozen=True)
class CellPieces:
    """CellPieces of contour in cells.

    Attributes
    ----------
    points : (P, d) float64
    pieces : (M, n) int64
    owner : (M,) int64
        Number of the cell of each.
    """

    points: NDArray[np.float64]
    pieces: NDArray[np.int64]
    owner: NDArray[np.int64]


@dataclass(frozen=True)
class KeptCut:
    """A cut of a mesh that an isovalue is coded on.

    Attributes
    ----------
    inside : (N,) bool
        Its nodes.
    step : int
        Of its offsets, as in `parts_of`; 0 without.
    edges : (E, 2) int64
        Crossed edges of all cells that there are at any time, the lower vertex first, sorted.
    ratio : (E,) float64
        Where they are crossed, as decoded.
    curve : Curve
        As decoded.
    """

    inside: NDArray[np.bool_]
    step: int
    edges: NDArray[np.int64]
    ratio: NDArray[np.float64]
    curve: Curve

    def numbers(self, mesh: CellArrays, edges: NDArray[np.int64]) -> NDArray[np.int64]:
        """Crossed parts of edges (L, 2) of the cut, (L,), as a layer of offsets has them."""
        vertices = np.int64(len(mesh.position))
        at = np.searchsorted(self.edges @ np.array([vertices, 1]), edges @ np.array([vertices, 1]))
        return (self.ratio[at] * parts_of(mesh, edges, self.step)).astype(np.int64)


class MeshContour:
    """The contour of the whole mesh, which cuts are held against.

    Parameters
    ----------
    domain : Complex
    history : CellHistory
    points : (V, d) float64
        Coordinates of the vertices.
    above : (V,) bool
    edges : (C, 2) int64
        Crossed edges of the mesh, the lower vertex first.
    ratio : (C,) float64
        Where the contour crosses them, from 0 at the lower vertex to 1 at the other.
    distance : float
        In the unit of the coordinates, greater than 0.
    """

    def __init__(
        self, domain: Complex, history: CellHistory, points: NDArray[np.float64], above: NDArray[np.bool_],
        edges: NDArray[np.int64], ratio: NDArray[np.float64], distance: float,
    ) -> None:
        self.domain, self.history, self.above, self.distance = domain, history, above, distance
        # distances are proven in units of the one that is kept
        self.points = (points - points.min(axis=0)) / distance
        apex = len(points)
        real = np.flatnonzero((history.cell < apex).all(axis=1))
        count = above[history.cell[real]].sum(axis=1)
        self.mixed = real[(count > 0) & (count < history.cell.shape[1])]
        self._number = np.full(len(history.cell), -1)
        self._number[self.mixed] = np.arange(len(self.mixed))
        self.edges = crossed_edges(history.cell[self.mixed], above)
        at = np.searchsorted(self._key(self.edges), self._key(edges))
        exact = np.full(len(self.edges), 0.5)
        exact[at] = ratio
        self._exact, self._whole = exact, history.breaker[self.mixed] < 0
        self._rows = self._table()
        self.original = self._drawn(exact, self._whole)
        self.target = Target(self.original.points, self.original.pieces, SURE)

    def _key(self, edges: NDArray[np.int64]) -> NDArray[np.int64]:
        return edges[:, 0] * np.int64(len(self.points)) + edges[:, 1]

    def _table(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """CellPieces of all mixed cells: their edges (M, n) and cells (M,)."""
        cells = self.history.cell[self.mixed]
        pattern = self.above[cells] @ (1 << np.arange(cells.shape[1]))
        ends, owner = simplex_table(cells.shape[1] - 1).lookup(pattern, cells, np.zeros(len(cells), np.bool_))
        ends.sort(axis=2)
        return np.searchsorted(self._key(self.edges), self._key(ends.reshape(-1, 2))).reshape(ends.shape[:2]), owner

    def _drawn(self, ratio: NDArray[np.float64], some: NDArray[np.bool_]) -> CellPieces:
        """CellPieces in some of the mixed cells (a bool each), with the crossings of all edges at these ratios."""
        rows, owner = self._rows
        rows, owner = rows[some[owner]], self.mixed[owner[some[owner]]]
        used, pieces = np.unique(rows, return_inverse=True)
        low, high = self.points[self.edges[used, 0]], self.points[self.edges[used, 1]]
        at = ratio[used][:, None]
        return CellPieces(low * (1 - at) + high * at, pieces.reshape(rows.shape), owner)

    def whole(self, step: int) -> Curve:
        """The contour of the whole mesh as it is decoded with these offsets."""
        parts = parts_of(self.domain.mesh, self.edges, step)
        drawn = self._drawn((np.minimum(self._exact * parts, parts - 1).astype(np.int64) + 0.5) / parts, self._whole)
        return drawn.points * self.distance, drawn.pieces

    def places(self, step: int) -> NDArray[np.float64]:
        """Middles of those parts of edges, as a layer of offsets has them, that are nearest to the contour; (E,).

        ``step`` as in `parts_of`; without offsets, 0, the middles of edges.
        """
        found = np.full(len(self.edges), 0.5)
        if not step:
            return found
        parts = parts_of(self.domain.mesh, self.edges, step)
        ends = np.cumsum(parts)
        start = 0
        while start < len(parts):
            end = max(int(np.searchsorted(ends, ends[start] + SOME)), start + 1)
            edge = np.repeat(np.arange(start, end), parts[start:end])
            first = (ends - parts)[edge]
            number = np.arange(len(edge)) + (ends - parts)[start] - first
            ratio = (2 * number + 1) / (2 * parts[edge])
            low, high = self.points[self.edges[edge, 0]], self.points[self.edges[edge, 1]]
            far = self._far(low * (1 - ratio[:, None]) + high * ratio[:, None])
            order = np.lexsort((far, edge))
            best = order[np.searchsorted(edge[order], np.arange(start, end))]
            found[start:end] = ratio[best]
            start = end
        return found

    def _far(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances of places from the contour, infinite beyond the limit."""
        piece, weight = self.target.nearest(places)
        corner = self.original.points[self.original.pieces[piece]]
        far = np.sqrt((((weight[..., None] * corner).sum(axis=1) - places) ** 2).sum(axis=1))
        return np.where(piece < 0, np.inf, far)

    @cached_property
    def _going(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Mixed cells that go at some time: the cell of the mesh that each came from, and the node; those by both."""
        source, maker = self.history.source[self.mixed], self.history.maker[self.mixed]
        some = np.flatnonzero(maker >= 0)
        order = some[np.lexsort((maker[some], source[some]))]
        return source[order], maker[order]

    def cut(self, step: int, also: NDArray[np.bool_]) -> KeptCut | None:
        """Find a cut whose contour with these offsets keeps the distance both ways; None if that cannot be.

        Parameters
        ----------
        step : int
            As in `places`.
        also : (N,) bool
            Nodes that are in the cut anyway.
        """
        history = self.history
        ratio = self.places(step)
        every = self._drawn(ratio, np.ones(len(self.mixed), np.bool_))
        far = np.zeros(len(history.cell), np.bool_)
        far[every.owner[self.target.exceeded(every.points, every.pieces).cells]] = True
        source, wanted = history.source[self.original.owner], also.copy()
        todo: NDArray[np.int64] | None = None
        for turn in range(MOST_MENDED):
            inside = self._near(wanted, far)
            if inside is None:
                return None
            there = np.zeros(len(history.cell), np.bool_)
            there[history.there(inside)] = True
            now = there[every.owner]
            drawn = Target(every.points, every.pieces[now], SURE)
            missed = drawn.exceeded(self.original.points, self.original.pieces, todo).cells
            if not len(missed) and todo is not None:
                # what is new may have drawn the curve away from other places
                missed = drawn.exceeded(self.original.points, self.original.pieces).cells
            if not len(missed):
                return KeptCut(inside, step, self.edges, ratio, (every.points * self.distance, every.pieces[now]))
            more = self._back(np.unique(source[missed]), inside, turn >= PATIENCE)
            if not len(more):
                return None
            todo, wanted = missed, inside
            wanted[more] = True
        return None

    def _near(self, wanted: NDArray[np.bool_], far: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
        """The least cut with some nodes in which no cell is too far; None if one of the mesh itself is."""
        while True:
            inside = self.history.closure(wanted)
            there = self.history.there(inside)
            breaker = self.history.breaker[there[far[there]]]
            if not len(breaker):
                return inside
            if (breaker < 0).any():
                return None
            wanted = inside
            wanted[breaker] = True

    def _back(self, cells: NDArray[np.int64], inside: NDArray[np.bool_], whole: bool) -> NDArray[np.int64]:
        """Nodes that bring back mixed cells that cells of the mesh became: the last that went, or these themselves."""
        source, maker = self._going
        some = np.isin(source, cells) & ~inside[maker]
        source, maker = source[some], maker[some]
        if not len(maker):
            return maker
        differs = source[1:] != source[:-1]
        if whole:
            return np.unique(maker[np.insert(differs, 0, True)])
        last = np.unique(maker[np.append(differs, True)])
        return last[-max(len(last) // SHARE, 1) :]

    def shortest(self, also: NDArray[np.bool_], begun: Callable[[], MeshIsovalue]) -> tuple[KeptCut | None, float]:
        """Choose the cut that takes the fewest bytes with its offsets: it, and how many; or None, and infinity."""
        best, least = None, float("inf")
        for pitch in PITCHES:
            kept = self.cut(self._step(pitch), also)
            if kept is None:
                continue
            size = self._size(kept, begun()) + LAYER * (1 + (kept.step > 0))
            if size < least:
                best, least = kept, size
        return best, least

    def coarsest(self, also: NDArray[np.bool_]) -> KeptCut | None:
        """A cut with the coarsest offsets that do, best without any; None if none do."""
        for pitch in sorted(PITCHES, key=lambda pitch: -pitch if pitch else -np.inf):
            kept = self.cut(self._step(pitch), also)
            if kept is not None:
                return kept
        return None

    def _step(self, pitch: float) -> int:
        """The step of offsets, as in `parts_of`, for parts of so many distances; 0 without."""
        return int(min(max(pitch * self.distance / self.domain.unit * STEPS, pitch > 0), MOST_STEP))

    def _size(self, kept: KeptCut, strand: MeshIsovalue) -> int:
        """Bytes of the runs of a cut and its offsets."""
        run = strand.write()
        strand.code_cut(self.history, kept.inside, self.above)
        size = len(run.end())
        if kept.step and strand.edges is not None and len(strand.edges):
            run = strand.write()
            strand.code_offsets(kept.step, kept.numbers(self.domain.mesh, strand.edges[:, :2]))
            size += len(run.end())
        return size


def without_crossings(found: Sequence[KeptCut | None], whole: Sequence[Curve]) -> list[KeptCut | None]:
    """Leave out cuts whose curves cross those of other isovalues, on their cuts or on the whole mesh."""
    kept = list(found)
    while True:
        curves = [other if one is None else one.curve for one, other in zip(kept, whole, strict=True)]
        close = {k for i in range(len(curves)) for j in range(i) if _meet(curves[i], curves[j]) for k in (i, j)}
        if not any(kept[i] is not None for i in close):
            return kept
        for i in close:
            kept[i] = None


def _meet(one: Curve, other: Curve) -> bool:
    """Whether two curves cross or touch."""
    first, second = Target(*one, TOUCH), Target(*other, TOUCH)
    return bool(
        len(first.crossed(*other).cells) or (first.nearest(other[0])[0] >= 0).any()
        or (second.nearest(one[0])[0] >= 0).any()
    )
