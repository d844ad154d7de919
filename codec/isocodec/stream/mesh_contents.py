"""Chunks of a file of values on a mesh (the mesh and its layers), and their drawings (spec clause 10)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import LAYER_LIMIT, ChunkType, DomainKind, MeshLayer

from ..drawing.contour import Contour
from ..drawing.explicit import crossed_cells, crossed_edges, draw_cells
from ..drawing.separation import apart
from ..drawing.tessellation import Tessellation
from ..errors import FormatError, InputError, LimitError, OptionError, TruncatedError
from ..field.placement import own_placement
from ..field.samples import interval_value
from ..format.chunks import Envelope
from ..format.domain import DomainHead, MeshLayerHead, read_mesh_layer
from ..format.events import ChunkSkipped, DomainRead, Event, FrameRead, IsovalueRead, MeshLayerComplete
from ..format.header import Header
from ..mesh.before import spread_signs
from ..mesh.coded_points import BYTES_PER_POINT, decoded_points
from ..mesh.complex import Complex, complex_of
from ..mesh.cut import CellHistory, history_of
from ..mesh.hierarchy import Hierarchy, hierarchy_of
from ..mesh.isovalue import MeshIsovalue
from ..mesh.mesh_run import decoded_mesh
from .leaning import chain
from .session import Session

HIERARCHY_PER_CELL = 500
"""Bytes that the hierarchy of a mesh takes for a cell, about."""
HISTORY_PER_CORNER = 40
"""Bytes that the history of cells takes for each of their corners while it is made, about."""
OPEN = 1e-6
"""Least share of its area that a surface which is not closed faces to one side more than to the other."""
ELEMENTS = 64
"""Number of vertices and cells that count as a unit of work when an isovalue begins or a round ends."""
PER_CELL = 200
"""Approximate memory, in bytes, for checking a known mesh and drawing it, per cell."""


def coordinates_of(domain: Complex, head: DomainHead) -> NDArray[np.float64]:
    """Compute the coordinates of the vertices of a coded mesh, (V, d) float64; infinite if beyond all floats."""
    places = (domain.mesh.position + np.array(head.origin, np.int64)).astype(np.float64)
    with np.errstate(over="ignore"):
        return np.asarray(np.ldexp(places * head.multiple, head.exponent))


def code_layer(
    strand: MeshIsovalue, head: MeshLayerHead, hierarchy: Callable[[], Any], history: Callable[[], CellHistory],
    truth: NDArray[Any] | None = None, wanted: NDArray[np.bool_] | None = None,
) -> None:
    """Code a layer, which has been begun by `MeshIsovalue.read` or `MeshIsovalue.write`.

    Parameters
    ----------
    strand : MeshIsovalue
    head : MeshLayerHead
    hierarchy, history : callable
        Make the rounds of collapses of the mesh, and the cells in all rounds.
    truth, wanted : array, optional
        The encoder's signs or numbers, and nodes of a cut.
    """
    match head.kind:
        case MeshLayer.SIGNS:
            strand.code_signs(truth)
        case MeshLayer.LEVELS:
            strand.code_levels(hierarchy(), head.rounds, truth)
        case MeshLayer.CUT:
            strand.code_cut(history(), wanted, truth)
        case MeshLayer.OFFSETS:
            strand.code_offsets(head.step, truth)
        case MeshLayer.VALUES:
            strand.code_values(head.bits, truth)


class MeshContents:
    """Decodes the chunks of a file of values on a mesh; draws isovalues, by number, up to the events taken so far.

    Parameters
    ----------
    session : Session
    header : Header
    mesh : (points, cells), optional
        The mesh that the file was made on, if the file does not store it: (V, d) coordinates and (T, n + 1) vertices.

    Attributes
    ----------
    outline : Outline
    """

    kind = "mesh"

    def __init__(self, session: Session, header: Header, mesh: tuple[ArrayLike, ArrayLike] | None = None) -> None:
        self.outline = session.outline
        self._session, self._header, self._budget, self._account = session, header, session.budget, session.account
        self.limits = session.limits
        self._mesh = mesh
        self._domain: Complex | None = None
        self._points: NDArray[np.float64] | None = None
        self._strands: list[MeshIsovalue | None] = []
        self._leans: list[int | None] = []
        self._before: list[MeshIsovalue | None] = []
        self._layers = 0

    @property
    def head(self) -> DomainHead | None:
        """Head of the domain chunk, once it has been read."""
        return self.outline.domain

    def strand(self, number: int = 0, *, before: bool = False) -> MeshIsovalue | None:
        """State of an isovalue, by number; None before it is read, or if it is skipped.

        ``before``: that of the previous frame, while the next one begins.
        """
        if number < 0:
            raise OptionError(f"isovalue number {number}; they are counted from 0", code="isovalue")
        strands = self._before if before else self._strands
        return strands[number] if number < len(strands) else None

    @property
    def domain(self) -> Complex | None:
        """The complex, once it is known."""
        return self._domain

    @property
    def hierarchy(self) -> Hierarchy | None:
        """The rounds of collapses of the mesh, once a layer has needed them."""
        return self.__dict__.get("_hierarchy")

    def contour(
        self, number: int = 0, *, smooth: bool | None = None, through_holes: bool = False, before: bool = False
    ) -> Contour:
        """Draw the curve or surface of an isovalue, by number, up to the events taken so far.

        ``before``: that of the previous frame, while the next one begins.
        """
        if smooth:
            raise OptionError("smooth applies to grids only", code="smooth", remedy="leave it out")
        n, notes = self._header.n, self.outline.notes(before)
        found, points = self.strand(number, before=before), self._points
        if found is None or points is None or not _begun(found):
            d = n if self.head is None else self.head.d
            return Contour(np.zeros((0, d)), np.zeros((0, n), np.int64), float("nan"), (), False,
                           own_placement(notes, d), metadata=notes)
        (cells, mirrored), above = self._cells(found), found.strand.sign == 1
        if found.edges is None:
            crossed = np.flatnonzero(crossed_cells(cells, above))
            edges = crossed_edges(cells[crossed], above)
            ratio = np.full(len(edges), 0.5)
        else:
            crossed, edges, ratio = found.leaves, found.edges[:, :2], self._ratio(found)
        drawn, pieces = draw_cells(points, cells[crossed], mirrored[crossed], above, edges, ratio)
        complete = found.edges is not None and (before or self._session.whole(self.outline.wanted))
        return Contour(drawn, pieces, found.value, (), complete, own_placement(notes, drawn.shape[1]), metadata=notes)

    def _cells(self, found: MeshIsovalue) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Cells that an isovalue lies on, (T, n + 1), and which are mirrored.

        Without all levels, those that remain after some rounds of removal.
        """
        assert self._points is not None and self._domain is not None
        if found.edges is not None or found.rounds is None:
            return found.domain.mesh.cell, found.domain.mirrored
        cells, source = self._hierarchy.remaining(found.rounds)
        flat = self._points.shape[1] == self._domain.n
        return cells, np.zeros(len(cells), np.bool_) if flat else self._domain.mirrored[source]

    def above(self, number: int = 0, *, before: bool = False) -> NDArray[np.bool_]:
        """Find which vertices lie above an isovalue, by number, (V,).

        Raises
        ------
        TruncatedError
            If its signs are not complete.
        OptionError
            If the isovalue is coded on a cut of the mesh.
        """
        found = self.strand(number, before=before)
        if found is not None and found.cut is not None and not found.cut.all():
            raise OptionError("the mesh of the contour is coarser than that of the file", code="above",
                              remedy="take the signs of the vertices that it has: mesh()")
        return self._above(number, before=before)

    def _above(self, number: int, *, before: bool = False) -> NDArray[np.bool_]:
        """Signs of vertices, (V,); one that has not come back into a cut has that of the vertex it collapsed into."""
        found = self.strand(number, before=before)
        if found is None or found.edges is None or self._domain is None:
            raise TruncatedError("the file ends before its signs are complete", code="truncated")
        sign = found.strand.sign.copy()
        if found.cut is not None:
            vertex, target = self._history.vertex, self._history.target
            for i in np.flatnonzero(~found.cut)[::-1]:
                sign[vertex[i]] = sign[target[i]]
        spread_signs(self._domain.mesh, sign, np.zeros(len(sign), np.int64))
        # vertices without a cell have none
        return np.asarray(sign == 1)

    def mesh(self, number: int = 0, whole: bool = True) -> Tessellation:
        """The mesh, with signs of its vertices at an isovalue, by number: the whole mesh, or only the crossed cells.

        Of an isovalue that is coded on a cut of the mesh, the cells are those of the cut; while levels are missing,
        those that remain without them.

        Raises
        ------
        TruncatedError
            If that has not been received yet.
        """
        found = self.strand(number)
        if found is None or self._points is None or not _begun(found):
            raise TruncatedError("the file ends before its mesh and signs are complete", code="truncated")
        cells = self._wound(*self._cells(found))
        if found.edges is None:
            above = found.strand.sign == 1
            crossed = np.flatnonzero(crossed_cells(cells, above))
        else:
            above, crossed = self._above(number), found.leaves
        if not whole:
            cells = cells[crossed]
        return Tessellation(
            self._points, cells.astype(np.int64), np.zeros(len(cells), np.int64), above, found.value,
            (), self._session.whole(self.outline.wanted), own_placement(self.outline.metadata, self._points.shape[1]),
            self.outline.notes(),
        )

    def _wound(self, cells: NDArray[np.int64], mirrored: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Cells, some of them mirrored, that all run the same way round.

        That is as the axes do, or on a surface in space as in the given mesh. A file does not keep the latter.
        Triangles then run so that what they enclose has a positive volume, and if they enclose nothing,
        counter-clockwise for a viewer against the axis that most cells face.
        """
        assert self._points is not None
        n = cells.shape[1] - 1
        in_space = self._points.shape[1] > n
        if in_space and self.head is not None and self.head.kind == DomainKind.KNOWN:
            return cells
        cells = np.where(mirrored[:, None], cells[:, [*range(n - 1), n, n - 1]], cells)
        if not in_space:
            return cells
        a, b, c = (self._points[cells[:, i]] - self._points[cells].mean(axis=(0, 1)) for i in range(3))
        across = np.cross(b - a, c - a)
        facing = across.sum(axis=0)[np.abs(across.sum(axis=0)).argmax()]
        size = facing if abs(facing) > OPEN * np.abs(across).sum() else (a * across).sum()
        return cells[:, [0, 2, 1]] if size < 0 else cells

    def _ratio(self, found: MeshIsovalue) -> NDArray[np.float64]:
        """Positions of crossings on edges, measured from the lower vertex."""
        assert found.edges is not None
        if found.active is not None and found.steps is not None:
            value = np.zeros(len(found.strand.sign))
            above = found.strand.sign[found.active[:, 0]] == 1
            value[found.active[:, 0]] = interval_value(found.value, found.scale, found.steps, above) - found.value
            low, high = value[found.edges[:, 0]], value[found.edges[:, 1]]
            with np.errstate(all="ignore"):
                ratio = low / (low - high)
            return apart(np.where(np.isfinite(ratio), ratio, 0.5))
        if found.parts is not None and found.number is not None:
            return apart((2 * found.number + 1) / (2 * found.parts))
        return np.full(len(found.edges), 0.5)

    # -- chunks ---------------------------------------------------------------------------------------------------

    def arrive(self, chunk: Envelope, at: int) -> tuple[Event | None, bool]:
        """See `Contents.arrive`: a layer is decoded once it is complete."""
        return None, True

    def take(self, chunk: Envelope, at: int, behind: int) -> Event:
        """See `Contents.take`."""
        payload = bytes(self._session.data[chunk.start : chunk.end])
        if chunk.type == ChunkType.LAYERS:
            return self._read_layer(payload, chunk.start, behind)
        if chunk.type == ChunkType.INDEX:
            return ChunkSkipped(behind, chunk.type, len(payload))
        event = self.outline.read(chunk, payload, behind)
        if isinstance(event, IsovalueRead):
            self._begin(event.number, event.lean)
        if isinstance(event, FrameRead) and not self.outline.past:
            if event.number == 0:
                self._before, self._strands, self._leans, self._layers = self._strands, [], [], 0
            self._begin(event.number, event.lean, event.before)
        if isinstance(event, DomainRead):
            self._begin_domain(payload, chunk.start)
        return event

    def drop(self) -> None:
        """See `Contents.drop`."""
        self._strands, self._before, self._domain, self._points = [], [], None, None
        for name in ("_hierarchy", "_history"):
            self.__dict__.pop(name, None)
        self._budget.release(self)

    def _begin_domain(self, payload: bytes, start: int) -> None:
        """Handle the domain chunk, which has been read."""
        assert self.head is not None
        n, head = self._header.n, self.head
        if head.vertices > self.limits.vertices or head.cells > self.limits.simplices:
            raise LimitError("more vertices or cells than the limits allow", code="limit-vertices", clause="11.2")
        self._budget.check(PER_CELL * (head.vertices + head.cells))
        if head.kind == DomainKind.KNOWN:
            self._domain, self._points = self._known_mesh(head, n)
        else:
            run, unit = self.outline.run_of_domain, head.unit
            size, data, hold = (head.vertices, head.cells), payload[run:], partial(self._budget.hold, self)
            if head.kind == DomainKind.DELAUNAY:
                self._budget.check(BYTES_PER_POINT * head.vertices)
                self._domain = decoded_points(data, start + run, size, head.extent, unit, self._account, hold)
            else:
                self._domain = decoded_mesh(data, start + run, size, n + 1, head.extent, unit, self._account, hold)
            self._points = coordinates_of(self._domain, head)
        self._begin(0, None)

    def _known_mesh(self, head: DomainHead, n: int) -> tuple[Complex, NDArray[np.float64]]:
        """Return the mesh that was given, after checking that it is the file's."""
        if self._mesh is None:
            raise InputError(
                f"the file was made on a mesh of {head.vertices} points and {head.cells} cells, which it does not "
                "store",
                code="mesh", remedy="give that mesh (mesh=, --mesh)",
            )
        points, cells = np.asarray(self._mesh[0]), np.asarray(self._mesh[1])
        shapes = (head.vertices, head.d), (head.cells, n + 1)
        if (points.shape, cells.shape) != shapes:
            raise InputError(
                f"the mesh has points {points.shape} and cells {cells.shape}, the file's {shapes[0]} and {shapes[1]}",
                code="mesh", remedy="give the mesh that the file was made on",
            )
        domain, coordinates = complex_of(points, cells, head.exponent)
        if domain.digest != head.digest:
            raise InputError(
                f"the mesh has the SHA-256 {domain.digest.hex()}.., the file's has {head.digest.hex()}..", code="mesh",
                remedy="give the mesh that the file was made on, with points and cells in the same order",
            )
        return domain, coordinates

    def _begin(self, number: int, lean: int | None, before: bool = False) -> None:
        """Begin an isovalue; with ``before``, it is predicted from the previous frame."""
        assert self._domain is not None
        if number >= self.limits.isovalues:
            raise LimitError(f"more than {self.limits.isovalues} isovalues", code="limit-isovalues", clause="11.2")
        self._leans.append(None if before else lean)
        if not self.outline.needs(number):
            self._strands.append(None)
            return
        earlier = []
        for one in chain(self._leans, number):
            strand = self._strands[one]
            if strand is None:
                raise OptionError(f"isovalue {number} is predicted from isovalue {one}, which is not decoded",
                                  code="only")
            earlier.append(strand)
        self._work_off(self._domain)
        self._hold(1, 0)
        isovalue, then = self.outline.isovalues[number], self._before[number] if before else None
        self._strands.append(MeshIsovalue(self._domain, isovalue, self._header.scale, earlier, then))

    def _hold(self, more: int, cuts: int) -> None:
        """Make room for ``more`` isovalues, and first layers of cuts."""
        assert self._domain is not None
        there = [one for one in [*self._before, *self._strands] if one is not None]
        size = (len(there) + more) * MeshIsovalue.bytes_for(self._domain)
        cuts += sum(one.cut is not None for one in there)
        if cuts:
            size += cuts * MeshIsovalue.bytes_of_cut(self._domain) + self._history.bytes
        self._budget.hold(self, size)

    def _work_off(self, domain: Complex, more: int = 0) -> None:
        """Count the work of visiting all vertices and cells once, and ``more``."""
        self._account.read = self._session.at
        self._account.spend((len(domain.mesh.position) + len(domain.mesh.cell) + more) // ELEMENTS)

    def _begin_cut(self, present: MeshIsovalue) -> None:
        """Count what a layer of a cut takes."""
        assert self._domain is not None
        self._hold(0, present.cut is None)
        self._budget.check(PER_CELL * len(self._domain.mesh.cell))
        self._work_off(self._domain, len(self._history.cell))

    def _read_layer(self, payload: bytes, start: int, behind: int) -> Event:
        present = self._strands[-1] if self.outline.needs(self.outline.number) else None
        self._layers += 1
        if self._layers > LAYER_LIMIT:
            raise FormatError(f"more than {LAYER_LIMIT:,} layers", code="layers", offset=start, clause="11.1")
        if self._layers > self.limits.layers:
            raise LimitError(f"more than {self.limits.layers} layers", code="limit-layers", clause="11.2")
        head, at = read_mesh_layer(payload, start)
        if present is None:
            return ChunkSkipped(behind, ChunkType.LAYERS, len(payload))
        if not self._fits(head, present):
            raise FormatError("a layer appears twice, or too early", code="layer", offset=start, clause="10.1.3")
        if head.kind == MeshLayer.CUT:
            self._begin_cut(present)
        run = present.read(payload[at:], start + at, self._account)
        code_layer(present, head, lambda: self._hierarchy, lambda: self._history)
        if head.kind == MeshLayer.CUT:
            run.spend(len(present.domain.mesh.cell))
        run.end()
        return MeshLayerComplete(behind, self._layers, head.kind.name.lower(), len(payload) - at)

    def _fits(self, head: MeshLayerHead, present: MeshIsovalue) -> bool:
        """Whether a layer may follow."""
        match head.kind:
            case MeshLayer.SIGNS:
                return present.rounds is None and present.edges is None
            case MeshLayer.LEVELS if present.edges is None:
                most = len(self._hierarchy.rounds) if present.rounds is None else present.rounds - 1
                return head.rounds <= most
            case MeshLayer.CUT:
                return present.cut is not None or (present.rounds is None and present.edges is None)
            case MeshLayer.OFFSETS:
                return present.edges is not None and present.parts is None
            case MeshLayer.VALUES:
                return present.edges is not None and present.active is None
        return False

    @cached_property
    def _hierarchy(self) -> Hierarchy:
        """Rounds of collapses of the mesh."""
        assert self._domain is not None
        usual = HIERARCHY_PER_CELL * len(self._domain.mesh.cell)
        self._budget.check(usual)

        def watch(work: int, held: int) -> None:
            self._budget.check(max(usual, 2 * held))
            self._account.read = self._session.at
            self._account.spend(work // ELEMENTS)

        try:
            return hierarchy_of(self._domain, watch)
        except OptionError as error:
            text = f"a layer of levels or of a cut, but {error.message}"
            raise FormatError(text, code="layer", offset=self._session.at, clause="10.8.1") from None

    @cached_property
    def _history(self) -> CellHistory:
        """All cells that the mesh has in all rounds."""
        cells, corners = self._hierarchy.cell.shape
        faces = sum(len(each.face) for each in self._hierarchy.rounds)
        # the cells of the mesh, at most as many at its border as they have faces, and those of patches
        self._budget.check(HISTORY_PER_CORNER * corners * (cells + faces))
        return history_of(self._hierarchy)


def _begun(found: MeshIsovalue) -> bool:
    """Whether some signs of an isovalue are known, of all vertices or of those of a level."""
    return found.edges is not None or found.rounds is not None
