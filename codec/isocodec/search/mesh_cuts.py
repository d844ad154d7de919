"""Cuts of the hierarchy of a mesh that keep the contour within a distance (row C2-distortion; docs/encoders.md, 6).

Each cell that there is at any time has a piece of contour with its points where a decoder would have them. Nodes in
whose patch a piece is too far from the contour of the whole mesh have to come back. What of that contour is then too
far from the cut's is mended, by nodes that bring back cells there, until both directions are proven.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, count

import numpy as np
from numpy.typing import NDArray

from ..drawing.explicit import crossed_cells, crossed_edges, draw_cells
from ..drawing.simplices import simplex_table
from ..field.samples import Samples
from ..format.domain import MOST_STEP
from ..mesh.complex import CellArrays, Complex
from ..mesh.cut import CellHistory
from ..mesh.isovalue import MeshIsovalue
from ..mesh.positions import STEPS, parts_of
from .piece import TOUCH
from .proof import Target, hausdorff

PITCHES = (0.0, 0.5, 0.7, 1.0, 1.4)
"""Longest parts of edges that are tried, in distances; 0 for the middles of edges, without offsets."""
LAYER = 5
"""Bytes of a layer beside its run, about."""
SHARE = 64
"""One part in so many of the cells that would come back is brought back at a time, the last that went first."""
MOST_MENDED = 512
"""So many times cells are brought back; then all of the mesh is."""
SOME = 1 << 20
"""Places that are looked at at a time."""
SURE = 1 - 1e-6
"""Share of the distance that is proven, so that rounding is no matter."""

Curve = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Points and pieces."""


@dataclass(frozen=True)
class CellPieces:
    """Pieces of contour in cells.

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
        As decoded, in units of the distance.
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
    field : Samples
        Values of the vertices.
    distance : float
        In the unit of the coordinates, greater than 0.
    watch : callable, optional
        Called whenever a cut is held against the contour.
    """

    def __init__(
        self, domain: Complex, history: CellHistory, points: NDArray[np.float64], field: Samples, distance: float,
        watch: Callable[[], object] | None = None,
    ) -> None:
        self.domain, self.history, self.distance, self._watch = domain, history, distance, watch
        self.above = above = field.signs
        # distances are proven in units of the one that is kept
        self.points = (points - points.min(axis=0)) / distance
        apex = len(points)
        real = np.flatnonzero((history.cell < apex).all(axis=1))
        ups = above[history.cell[real]].sum(axis=1)
        self.mixed = real[(ups > 0) & (ups < history.cell.shape[1])]
        self.edges = crossed_edges(history.cell[self.mixed], above)
        self._whole = history.breaker[self.mixed] < 0
        own = crossed_edges(history.cell[self.mixed[self._whole]], above)
        # of edges of the mesh itself it is known where they are crossed
        self._own = np.searchsorted(self._key(self.edges), self._key(own))
        exact = np.full(len(self.edges), 0.5)
        exact[self._own] = field.along(own)
        self._exact = exact
        self._rows = self._table()
        self.original = self._drawn(exact, self._whole)

    @cached_property
    def target(self) -> Target:
        """The contour, to measure distances from."""
        return Target(self.original.points, self.original.pieces, SURE)

    def _key(self, edges: NDArray[np.int64]) -> NDArray[np.int64]:
        return edges[:, 0] * np.int64(len(self.points)) + edges[:, 1]

    def _table(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Pieces of all mixed cells: their edges (M, n) and cells (M,)."""
        cells = self.history.cell[self.mixed]
        pattern = self.above[cells] @ (1 << np.arange(cells.shape[1]))
        ends, owner = simplex_table(cells.shape[1] - 1).lookup(pattern, cells, np.zeros(len(cells), np.bool_))
        ends.sort(axis=2)
        return np.searchsorted(self._key(self.edges), self._key(ends.reshape(-1, 2))).reshape(ends.shape[:2]), owner

    def _drawn(self, ratio: NDArray[np.float64], some: NDArray[np.bool_]) -> CellPieces:
        """Pieces in some of the mixed cells (a bool each), with the crossings of all edges at these ratios."""
        rows, owner = self._rows
        rows, owner = rows[some[owner]], self.mixed[owner[some[owner]]]
        used, pieces = np.unique(rows, return_inverse=True)
        low, high = self.points[self.edges[used, 0]], self.points[self.edges[used, 1]]
        at = ratio[used][:, None]
        return CellPieces(low * (1 - at) + high * at, pieces.reshape(rows.shape), owner)

    def whole(self, step: int) -> Curve:
        """The contour of the whole mesh as it is decoded with these offsets, in units of the distance."""
        drawn = self._drawn(_middles(self._exact, parts_of(self.domain.mesh, self.edges, step)), self._whole)
        return drawn.points, drawn.pieces

    def uncut(self) -> KeptCut | None:
        """The whole mesh, with offsets that keep the distance without a search; None if there are no such offsets."""
        step = self._step(PITCHES[-1])
        if step * self.domain.unit > 2 * self.distance * STEPS:
            return None
        ratio = _middles(self._exact, parts_of(self.domain.mesh, self.edges, step))
        return KeptCut(np.ones(len(self.history.vertex), np.bool_), step, self.edges, ratio, self.whole(step))

    def places(self, step: int) -> NDArray[np.float64]:
        """Middles of those parts of edges, as a layer of offsets has them, in or next to which the contour lies; (E,).

        Edges of the mesh itself are crossed in one; of others it is the one that is nearest to the contour. ``step`` as
        in `parts_of`; without offsets, 0, the middles of edges.
        """
        if not step:
            return np.full(len(self.edges), 0.5)
        parts = parts_of(self.domain.mesh, self.edges, step)
        found = _middles(self._exact, parts)
        others = np.setdiff1d(np.arange(len(parts)), self._own)
        ends = np.cumsum(parts[others])
        start = 0
        while start < len(others):
            end = max(int(np.searchsorted(ends, ends[start] + SOME)), start + 1)
            some = others[start:end]
            found[some] = self._nearest_middles(some, parts[some])
            start = end
        return found

    def _nearest_middles(self, edges: NDArray[np.int64], parts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Middles of parts of some edges that are nearest to the contour, (L,); ``parts`` (L,) of each."""
        first = np.cumsum(parts) - parts
        edge = np.repeat(np.arange(len(edges)), parts)
        ratio = (np.arange(len(edge)) - first[edge] + 0.5) / parts[edge]
        low, high = self.points[self.edges[edges[edge], 0]], self.points[self.edges[edges[edge], 1]]
        far = self._far(low * (1 - ratio[:, None]) + high * ratio[:, None])
        return np.asarray(ratio[np.lexsort((far, edge))[first]])

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
        for turn in count():
            if self._watch is not None:
                self._watch()
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
                return KeptCut(inside, step, self.edges, ratio, (every.points, every.pieces[now]))
            if inside.all():
                return None
            more = self._back(np.unique(source[missed]), inside)
            todo, wanted = missed, inside
            wanted[more if len(more) and turn < MOST_MENDED else slice(None)] = True
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

    def _back(self, cells: NDArray[np.int64], inside: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Nodes that bring back mixed cells that cells of the mesh became: those of all that went last."""
        source, maker = self._going
        some = np.isin(source, cells) & ~inside[maker]
        source, maker = source[some], maker[some]
        last = np.unique(maker[source != np.append(source[1:], -1)])
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
        """The step of offsets, as in `parts_of`, for parts of ``pitch`` distances; 0 without."""
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
    """Leave out cuts whose curves cross or touch those of other isovalues, on their cuts or on the whole mesh."""
    kept = list(found)
    while True:
        curves = [other if one is None else one.curve for one, other in zip(kept, whole, strict=True)]
        targets = [Target(*curve, TOUCH) for curve in curves]
        close: set[int] = set()
        for i, j in combinations(range(len(curves)), 2):
            touching = any((targets[a].nearest(curves[b][0])[0] >= 0).any() for a, b in ((i, j), (j, i)))
            if touching or len(targets[i].crossed(*curves[j]).cells):
                close |= {i, j}
        if not any(kept[i] is not None for i in close):
            return kept
        for i in close:
            kept[i] = None


def contour_on(
    cells: NDArray[np.int64], points: NDArray[np.float64], field: Samples, middles: bool = False
) -> Curve:
    """The contour of values of the vertices on some cells (T, n + 1); or, as without geometry, in middles of edges."""
    cells = cells[crossed_cells(cells, field.signs)]
    edges = crossed_edges(cells, field.signs)
    ratio = np.full(len(edges), 0.5) if middles else field.along(edges)
    return draw_cells(points, cells, np.zeros(len(cells), np.bool_), field.signs, edges, ratio)


def far_apart(one: Curve, other: Curve, size: float) -> float:
    """Upper bound of how far two curves lie from each other, both ways: at most 0.01 ``size`` above the truth."""
    (points, pieces), (others, theirs) = one, other
    return max(hausdorff(points / size, pieces, others / size, theirs)) * size / SURE


def _middles(ratio: NDArray[np.float64], parts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Middles of the parts of edges, (E,), in which ratios lie."""
    return (np.minimum(ratio * parts, parts - 1).astype(np.int64) + 0.5) / parts
