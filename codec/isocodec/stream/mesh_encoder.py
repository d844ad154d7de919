"""Encoders of values on meshes (explicit domains; spec clause 10)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import ChunkType, DomainKind, MeshLayer, Profile

from ..errors import InputError, OptionError
from ..field.meshed import Mesh, valued
from ..field.placement import COORDINATE_UNIT, CRS
from ..field.samples import Samples, isovalue_of
from ..field.stretch import in_unit
from ..field.units import distance_of
from ..format.chunks import write_chunk, write_further
from ..format.domain import (
    MOST_STEP,
    DomainHead,
    MeshLayerHead,
    read_domain,
    write_domain,
    write_mesh_layer,
)
from ..format.frames import as_last, write_frame, write_interval
from ..format.header import Header
from ..mesh.coded_points import triangulated
from ..mesh.complex import Complex, complex_of
from ..mesh.cut import CellHistory, history_of
from ..mesh.hierarchy import Hierarchy, has_hierarchy, hierarchy_of
from ..mesh.isovalue import MeshIsovalue
from ..mesh.mesh_run import encoded_mesh
from ..mesh.point_lattice import WantedTriangles, placements
from ..mesh.positions import STEPS, active_vertices, parts_of
from ..mesh.quantised import Quantised, quantised, refitted
from ..search.mesh_cuts import KeptCut
from ..search.tolerance import EXACT
from .container import ContainerEncoder, beginning
from .cut_plan import Cut, CutPlan, check_cuts, cut_promise_of
from .mesh_contents import coordinates_of
from .options import BEST, LEVELS, SEARCHED, Options
from .promise_note import PROMISE
from .series import Series

FINER = 8
"""Factor by which the number of known vertices grows from one layer of signs to the next, about."""
EDGE_SHARE = 0.05
"""Default tolerance of contour points, as a fraction of the median edge length."""
MESH_SHARE = 0.05
"""Without an option, vertices of a mesh in the file lie as near to theirs as this share of the median edge."""
TOLERANCE_SHARE = 0.125
"""Share of a tolerance that they may take, if one is given: it holds for mesh and points of contours together."""
REACH = 2
"""Scattered points may be moved so many times as far as they are rounded, where their triangles would change."""
SHORTER = 50
"""Signs come along a walk, unless levels are asked for, where that saves more than such a part of an isovalue."""
SMALL = 1000
"""Such walks are for isovalues of fewer bytes: the first bytes of larger ones draw the whole curve."""
CELL_KINDS, POINT_KINDS = ("known", "coded", "whole"), ("delaunay", "whole")
"""Ways to store a mesh with cells, and scattered points."""
KINDS = (*CELL_KINDS, "delaunay")
NEEDED = ("coded", "delaunay")
"""Ways to store only what the contours of all frames need."""
Report = Callable[[int, int], object]
Cuts = Callable[[CellHistory, Samples], Sequence[Cut]]
"""Chooses for an isovalue, from the values there, the cuts of its layers; none for other layers."""


class MeshFrames:
    """Encodes frames of values on one mesh as they come.

    Parameters
    ----------
    mesh : Mesh
        A mesh with the values of the first frame, or of all frames, (F, V).
    series : Series
    options : Options
    complete : bool
        Whether the mesh has the values of all frames. Otherwise the file stores all of the mesh, if it stores any.
    report : callable, optional
        Called with the number of cuts of the mesh that have been tried, and 0.

    Attributes
    ----------
    given : (F, V) array
        Values of the given frames, at distinct points.
    cuts : Cuts or None
        Codes isovalues on cuts of the mesh.

    Raises
    ------
    InputError
        If the mesh, the values or the isovalue cannot be encoded.
    OptionError
        If options do not apply to meshes or are out of range.
    """

    def __init__(
        self, mesh: Mesh, series: Series, options: Options, *, complete: bool = True, report: Report | None = None
    ) -> None:
        _check_options(options)
        self._report, self._tried = report, 0
        self._asked = options.precision.text if options.precision.world else ""
        options = _in_unit(options, mesh)
        self.options, self.series = options, series
        stored = _stored(mesh, complete)
        points, cells, values = mesh.points, mesh.cells, mesh.values
        if values is None:
            raise InputError("the mesh has no values", code="values", remedy="give a value for each point")
        self._scattered: NDArray[Any] | None = None
        self._there: NDArray[np.bool_] | None = None
        if cells is None:
            points, self._there = np.asarray(points), valued(points, values)
            if self._there is not None:
                gone = int((~self._there).sum())
                warnings.warn(f"{gone:,} points without a value (NaN) are left out", stacklevel=6)
                points, values = points[self._there], np.asarray(values)[..., self._there]
            self._scattered = points
            joined = triangulated(points, values)
            self.domain, self._points, values = joined.domain, joined.points, joined.values
        else:
            self.domain, self._points = complex_of(points, cells)
        self._cells = self.domain.mesh.cell
        self._size = len(self.domain.mesh.position), len(self._cells)
        self._source = np.arange(self._size[0])
        self.given = first = _frames_of(values)
        for each in first:
            self.options.check_data(self._fields(each)[0].integer)
        self._edge = self._median_edge()
        self._rounded: NDArray[np.float64] | None = None
        self._off, self._shared = 0.0, False
        self._exceeded = self._count_exceeded() if stored in NEEDED else []
        self._shared_mesh = stored == "known"
        if (asked := cut_promise_of(options)) is not None and asked.stepwise:
            check_cuts(self.domain, options, mesh.progressive, self._shared_mesh)
        self._domain_chunk = self._known() if stored == "known" else self._in_file(mesh.error)
        self._step = self._offset_step()
        self._asked_levels = mesh.progressive
        wanted = mesh.progressive or (mesh.progressive is None and stored == "known" and has_hierarchy(self.domain))
        self._hierarchy = hierarchy_of(self.domain) if wanted else None
        step = options.precision.step
        self.header = Header((), self._fields(first[0])[0].isovalue, step, Profile.MAIN, cells=self.domain.n)
        self._metadata = {**mesh.metadata, **options.metadata}
        if options.precision.tolerance is not None:
            self._metadata[PROMISE] = self._promise(options.precision.tolerance)
        if options.precision.steps is not None:
            self._metadata[PROMISE] = self._asked or options.precision.text
        self._strands: list[MeshIsovalue] = []
        self.cuts: Cuts | None = None

    @cached_property
    def _history(self) -> CellHistory:
        """All cells that the mesh has in all rounds."""
        return history_of(self._hierarchy or hierarchy_of(self.domain))

    def chunks(self, values: ArrayLike) -> list[bytes]:
        """Return the chunks of a frame, the first with the header; if an error is raised, earlier frames are kept.

        Parameters
        ----------
        values : (V,) array_like

        Raises
        ------
        InputError
            If the values cannot be encoded.
        """
        if self._scattered is not None:
            values = np.asarray(values) if self._there is None else np.asarray(values)[..., self._there]
            values = triangulated(self._scattered, values).values
        return self.merged_chunks(np.asarray(values))

    def merged_chunks(self, values: NDArray[Any]) -> list[bytes]:
        """Encode values at distinct points."""
        fields = self._fields(values)
        self.options.check_data(fields[0].integer)
        if self.series.number >= 0:
            self.series.next_frame()
        try:
            begun = self._beginning() if self.series.frame == 0 else ()
            before = self._strands
            self._strands = []
            return [*begun, *self._frame(fields, before)]
        except BaseException:
            self._strands = before
            self.series.forget_frame()
            raise

    def _beginning(self) -> Iterator[bytes]:
        """Chunks for the whole file."""
        yield from beginning(self.header, self._metadata)
        yield write_chunk(ChunkType.DOMAIN, self._domain_chunk)
        if self.series.interval is not None:
            yield write_chunk(ChunkType.SERIES, write_interval(self.series.interval))

    def _frame(self, fields: Sequence[Samples], before: Sequence[MeshIsovalue]) -> Iterator[bytes]:
        """Yield the chunks of all isovalues of a frame."""
        series, strands = self.series, self._strands
        frame = series.frame
        cuts = self._cuts_of(fields)
        for number, value in enumerate(series.isovalues):
            lean = series.choose(number, self.options.independent)
            series.add(lean)
            coded = None if lean is None else lean.coded
            if frame:
                yield write_chunk(ChunkType.FRAME, write_frame(number, coded, series.is_key(frame)))
            elif number:
                yield write_chunk(ChunkType.ISOVALUE, write_further(number, value, coded))
            earlier = []
            then = before[number] if lean is not None and lean.before else None
            while lean is not None and not lean.before:
                earlier.append(strands[lean.number])
                lean = series.lean(lean.number, frame)
            begun = partial(MeshIsovalue, self.domain, value, self.options.precision.step, earlier, then)
            if cuts[number]:
                strands.append(begun())
                yield from self._on_cuts(strands[-1], fields[number], cuts[number])
            else:
                strand, chunks = self._shorter(begun, fields[number])
                strands.append(strand)
                yield from chunks

    def _fields(self, values: NDArray[Any]) -> list[Samples]:
        """Prepare the values of a frame at the vertices of the mesh, for each isovalue."""
        step = self.options.precision.step
        if values.dtype.kind == "f" and np.isnan(values).any() and values.shape == self._size[:1]:
            used = np.zeros(len(values), np.bool_)
            used[self._cells] = True
            # no cell asks for the others
            values = np.where(used, values, values.dtype.type(0))
        found = [vertex_field(values, *self._size, one, step) for one in self.series.isovalues]
        return [replace(one, values=one.values[self._source], signs=one.signs[self._source]) for one in found]

    def _median_edge(self) -> float:
        """Median edge length of the mesh."""
        cells = self.domain.mesh.cell
        side = self._points[cells[:, 1]] - self._points[cells[:, 0]]
        return float(np.median(np.sqrt((side**2).sum(axis=1))))

    def _known(self) -> bytes:
        """Write the domain chunk of a mesh that encoder and decoder both have."""
        mesh = self.domain.mesh
        exponent = math.frexp(self.domain.unit)[1] - 1
        size = len(mesh.position), len(mesh.cell)
        head = DomainHead(DomainKind.KNOWN, mesh.position.shape[1], exponent, *size, self.domain.digest)
        return write_domain(head, self.domain.n)

    def _in_file(self, error: float | None) -> bytes:
        """Write the domain chunk of a stored mesh; from now on, the encoder uses the decoders' version of the mesh."""
        if error is not None and not (math.isfinite(error) and error > 0):
            raise OptionError(f"the error of the mesh is {error}; it must be greater than 0", code="mesh-error")
        usual = MESH_SHARE * self._edge
        if self.options.precision.tolerance is not None:
            usual = min(usual, TOLERANCE_SHARE * self.options.precision.tolerance)
        self._off, self._shared = error or usual, error is None
        return self._of_cells() if self._scattered is None else self._of_points()

    def _count_exceeded(self) -> list[NDArray[np.uint16]]:
        """Count for each frame how many isovalues the value of each vertex exceeds, (V,)."""
        fields = (self._fields(frame) for frame in self.given)
        return [np.sum([one.signs for one in each], axis=0, dtype=np.uint16) for each in fields]

    def _crossed(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Find which cells (T, n + 1) of given vertices a contour of any frame crosses; all if the file stores all."""
        crossed = np.full(len(cells), not self._exceeded)
        for count in self._exceeded:
            crossed |= (count[cells[:, 1:]] != count[cells[:, :1]]).any(axis=1)
        return crossed

    def _of_cells(self) -> bytes:
        """Write the payload for the cells of a mesh that the file needs."""
        cells = self.domain.mesh.cell
        cells = cells[_one_at_least(self._crossed(cells))]
        used, numbers = np.unique(cells, return_inverse=True)
        points = self._points[used]
        places, domain = quantised(points, numbers.reshape(cells.shape), self._off)
        run, self.domain, order = encoded_mesh(domain, places.extent, places.unit)
        self._points = points[order]
        self._source = used[order]
        head = self._head(DomainKind.CODED, places, self.domain)
        self._rounded = coordinates_of(self.domain, read_domain(head + run, self.domain.n, 0)[0])
        return head + run

    def _of_points(self) -> bytes:
        """Write the payload for scattered points: all of them, or the vertices of the triangles that the file needs.

        Their triangulation has the cells that contours cross among the given points, and no others that they cross. If
        the first lattice does not give that, the cells themselves are stored where this takes fewer bytes.
        """
        cells = self.domain.mesh.cell
        kept = np.unique(cells[_one_at_least(self._crossed(cells))]) if self._exceeded else np.arange(len(self._points))
        wanted = WantedTriangles(self._points, self.domain.mesh.position, cells, kept, self._crossed)
        trials = placements(wanted, self._off, REACH * self._off if self._shared else self._off)
        placed = next(trials)
        if placed is None:
            given, points, payload = self.domain, self._points, b""
            with suppress(InputError):
                payload = self._of_cells()
            placed = next(filter(None, trials), None)
            if placed is None and not payload:
                raise InputError(
                    "some triangles of the points are too thin for positions in a file", code="mesh-error",
                    remedy="scale the coordinates, so that points spread alike along both axes, or leave out points "
                           "that nearly coincide",
                )
            if placed is None or len(placed.run) >= len(payload) > 0:
                return payload
            self.domain, self._points = given, points
        self.domain, self._source, self._off = placed.domain, placed.source, placed.off
        self._points, self._rounded = self._points[self._source], None
        return self._head(DomainKind.DELAUNAY, placed.places, self.domain) + placed.run

    def _head(self, kind: DomainKind, places: Quantised, domain: Complex) -> bytes:
        """Write the head of the domain chunk of a mesh with positions in the file's units."""
        size = len(domain.mesh.position), len(domain.mesh.cell)
        head = DomainHead(
            kind, len(places.extent), places.exponent, *size, b"", places.multiple, places.origin, places.extent
        )
        return write_domain(head, domain.n)

    def _offset_step(self) -> int:
        """Compute the longest part of an edge, in steps of offsets; 0 without offsets."""
        precision = self.options.precision
        if precision.exact or precision.signs or precision.step is not None:
            return 0
        tolerance = precision.tolerance or EDGE_SHARE * self._edge
        if precision.steps is not None:
            tolerance = precision.steps[-1]
            if tolerance == EXACT:
                return 0
        if precision.tolerance is not None and self._shared:
            tolerance -= self._off
        return int(min(max(2 * tolerance / self.domain.unit * STEPS, 1), MOST_STEP))

    def _promise(self, tolerance: float) -> str:
        """The note of a promise: points are within the tolerance, and a mesh in the file may be off, too."""
        off = max(self._off + self._step * self.domain.unit / STEPS / 2, tolerance)
        if not self._asked:
            return f"{off:.12g}"
        number, unit = distance_of(self._asked)
        return f"{number * off / tolerance:.12g}{unit}"

    def _cuts_of(self, fields: Sequence[Samples]) -> list[list[Cut]]:
        """Choose cuts of the mesh for each isovalue of a frame; none where signs of the whole mesh take fewer bytes."""
        if self.cuts is not None:
            return [list(self.cuts(self._history, field)) for field in fields]
        promise = cut_promise_of(self.options) if self._shared_mesh else None
        least = SEARCHED * self._edge
        small = promise is not None and not promise.stepwise and promise.distances[-1] < least
        if promise is None or small or self._hierarchy is None or (self._asked_levels and not promise.stepwise):
            return [[] for _ in fields]

        def whole(field: Samples) -> int:
            return sum(map(len, self._shorter(partial(MeshIsovalue, self.domain, field.isovalue), field)[1]))

        plan = CutPlan(self.domain, self._points, self._history, promise, least, self._try)
        return plan.cuts(fields, whole, self._step)

    def _try(self) -> None:
        """Report that a cut is tried."""
        self._tried += 1
        if self._report is not None:
            self._report(self._tried, 0)

    def _on_cuts(self, strand: MeshIsovalue, field: Samples, cuts: Sequence[Cut]) -> Iterator[bytes]:
        """Yield the chunks of an isovalue on cuts of the mesh, each with its geometry; the last one as it is asked for.
        """
        for number, cut in enumerate(cuts, 1):
            inside = cut.inside if isinstance(cut, KeptCut) else cut
            yield self._signs(strand, field, MeshLayerHead(MeshLayer.CUT), inside)
            if isinstance(cut, KeptCut) and cut.step and strand.edges is not None and len(strand.edges):
                run = strand.write()
                strand.code_offsets(cut.step, cut.numbers(self.domain.mesh, strand.edges[:, :2]))
                head = MeshLayerHead(MeshLayer.OFFSETS, step=cut.step)
                yield write_chunk(ChunkType.LAYERS, write_mesh_layer(head) + run.end())
            elif number == len(cuts) and not isinstance(cut, KeptCut):
                yield from self._layer_of_places(strand, field)

    def _shorter(self, begun: Callable[[], MeshIsovalue], field: Samples) -> tuple[MeshIsovalue, list[bytes]]:
        """Code an isovalue level by level, or along a walk where that is much shorter; return it, and its chunks."""
        strand = begun()
        if self._hierarchy is None:
            found = [self._signs(strand, field, MeshLayerHead(MeshLayer.SIGNS)), *self._layer_of_places(strand, field)]
        else:
            signs = [self._signs(strand, field, head) for head in level_heads(self._hierarchy)]
            found = [*signs, *self._layer_of_places(strand, field)]
            whole = sum(map(len, found))
            if self._asked_levels is None and whole < SMALL:
                other = begun()
                walk = self._signs(other, field, MeshLayerHead(MeshLayer.SIGNS))
                if SHORTER * (sum(map(len, signs)) - len(walk)) > whole:
                    strand, found = other, [walk, *self._layer_of_places(other, field)]
        return strand, found

    def _signs(
        self, strand: MeshIsovalue, field: Samples, head: MeshLayerHead, wanted: NDArray[np.bool_] | None = None
    ) -> bytes:
        """Code a layer of signs, of a cut with the nodes ``wanted``; return its chunk."""
        run = strand.write()
        if head.kind == MeshLayer.CUT:
            strand.code_cut(self._history, wanted, field.signs)
        elif head.kind == MeshLayer.LEVELS:
            assert self._hierarchy is not None
            strand.code_levels(self._hierarchy, head.rounds, field.signs)
        else:
            strand.code_signs(field.signs)
        return write_chunk(ChunkType.LAYERS, write_mesh_layer(head) + run.end())

    def _layer_of_places(self, strand: MeshIsovalue, field: Samples) -> list[bytes]:
        """Code where within cells the curve lies; return the chunk, if there is any."""
        geometry = self._geometry()
        assert strand.edges is not None
        if geometry is None or not len(strand.edges):
            return []
        run = strand.write()
        if geometry == MeshLayer.OFFSETS:
            number_of = self._offsets(strand, field)
            head = MeshLayerHead(geometry, step=self._step)
            strand.code_offsets(self._step, number_of)
        else:
            active = active_vertices(strand.edges)[:, 0]
            steps = field.numbers(active[:, None], field.signs[active])
            bits = [max((int(n).bit_length() for n in steps[field.signs[active] == s]), default=0) for s in (0, 1)]
            head = MeshLayerHead(geometry, bits=(bits[0], bits[1]))
            strand.code_values(head.bits, steps)
        return [write_chunk(ChunkType.LAYERS, write_mesh_layer(head) + run.end())]

    def _offsets(self, strand: MeshIsovalue, field: Samples) -> NDArray[np.int64]:
        """Find the part of each crossed edge in which the curve lies."""
        assert strand.edges is not None
        where = field.along(strand.edges[:, :2])
        if self._rounded is not None:
            above = field.values.astype(np.float64) - field.isovalue
            edges = strand.edges[:, :2]
            where = refitted(self.domain, self._points, self._rounded, edges, above, where, self._off)
        parts = parts_of(self.domain.mesh, strand.edges, self._step)
        return np.clip(np.floor(where * parts), 0, parts - 1).astype(np.int64)

    def _geometry(self) -> MeshLayer | None:
        """Yield the layers that code where within cells the curve lies."""
        if self.options.precision.signs:
            return None
        return MeshLayer.OFFSETS if self._step else MeshLayer.VALUES


class MeshEncoder(ContainerEncoder):
    """Encodes isocontours of values on a mesh; iterating, which is possible once, yields the bytes of the file.

    Parameters
    ----------
    mesh : Mesh
        If its values have two axes, the file holds a series.
    isovalues : sequence of float
    options : Options
    report : callable, optional
        As of `MeshFrames`.

    Raises
    ------
    InputError, OptionError
        As for `MeshFrames`.
    """

    def __init__(
        self, mesh: Mesh, isovalues: Sequence[float], options: Options, report: Report | None = None
    ) -> None:
        interval = options.interval if np.ndim(mesh.values) == 2 else None  # type: ignore[arg-type]
        self.frames = MeshFrames(mesh, Series(isovalues, interval), options, report=report)
        self.header = self.frames.header
        self.isovalues = self.frames.series.isovalues

    def _pieces(self) -> Iterator[bytes]:
        """Yield the pieces of the file without its checksum."""
        waiting = b""
        for values in self.frames.given:
            for chunk in self.frames.merged_chunks(values):
                if waiting:
                    yield waiting
                waiting = chunk
        yield as_last(waiting)


def _stored(mesh: Mesh, complete: bool) -> str:
    """Choose how a mesh is stored, if it does not state that; ``complete`` as of `MeshFrames`."""
    scattered = mesh.cells is None
    stored = mesh.stored or ("known" if not scattered else "delaunay" if complete else "whole")
    if stored not in KINDS:
        raise OptionError(f"a mesh cannot be stored as {stored!r}", code="mesh",
                          remedy=f"choose one of: {', '.join(KINDS)}")
    if stored not in (POINT_KINDS if scattered else CELL_KINDS):
        raise OptionError(
            f"a mesh {'without' if scattered else 'with'} cells cannot be stored as {stored!r}", code="mesh",
            remedy=f"choose one of: {', '.join(POINT_KINDS)}" if scattered else "leave the cells out: a Delaunay "
                                                                                 "triangulation is made from points",
        )
    if not complete and stored in NEEDED:
        raise OptionError(
            f"the {'points' if scattered else 'cells'} that contours need are known only once all frames are",
            code="mesh", remedy='give stored="whole", or encode a Mesh with values of all frames',
        )
    return stored


def _one_at_least(crossed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the first cell if none is crossed: a file has at least one."""
    crossed[0] |= not crossed.any()
    return crossed


def level_heads(hierarchy: Hierarchy) -> list[MeshLayerHead]:
    """Heads of the layers that code signs level by level, each finer than the one before by about the same factor."""
    sizes = np.array([len(each.vertex) for each in hierarchy.rounds], np.int64)
    # vertices that are there before each round, and after the last
    there = hierarchy.left + np.append(np.cumsum(sizes[::-1])[::-1], 0)
    count = max(round(math.log(there[0] / there[-1], FINER)), 1)
    wanted = there[-1] * (there[0] / there[-1]) ** (np.arange(1, count) / count)
    rounds = {int(np.abs(there - each).argmin()) for each in wanted} | {0, len(sizes)}
    return [MeshLayerHead(MeshLayer.LEVELS, rounds=each) for each in sorted(rounds, reverse=True)]


def _check_options(options: Options) -> None:
    """Refuse options that do not apply to meshes."""
    precision = options.precision
    for name, given in (
        ("layers", not options.layers.default),
        (f"profile {options.profile!r}", options.entropy != Profile.MAIN),
        (f"order {options.order!r}", options.order == LEVELS),
        ("effort", options.effort == BEST),
        (f"precision {precision.text!r}", precision.smooth),
    ):
        if given:
            raise OptionError(f"{name} does not apply to meshes", code=name.split()[0], remedy="leave it out")
    tolerance = precision.tolerance
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance > 0):
        raise OptionError(f"the precision is {tolerance}; it must be greater than 0", code="tolerance")


def _in_unit(options: Options, mesh: Mesh) -> Options:
    """The options with a distance in the unit of the points of a mesh."""
    if not options.precision.world:
        return options
    notes, points = {**mesh.metadata, **options.metadata}, np.asarray(mesh.points)

    def number(text: str) -> float:
        return in_unit(text, points, notes.get(COORDINATE_UNIT), notes.get(CRS))

    return replace(options, precision=options.precision.in_cells(number))


def _frames_of(values: ArrayLike) -> NDArray[Any]:
    """Values of all frames, (F, V); without a series, F is 1."""
    found = np.asarray(values)
    if found.ndim == 2 and not len(found):
        raise InputError("a series without frames", code="frames", remedy="give at least one")
    return found if found.ndim == 2 else found[None]


def vertex_field(values: NDArray[Any], vertices: int, cells: int, isovalue: float, step: float | None) -> Samples:
    """Check values at the vertices of a mesh, and make a field of them; raises `InputError` if they are not valid."""
    found = values
    if found.dtype.kind not in "biuf":
        raise InputError(
            f"the values are of type {found.dtype}", code="dtype", remedy="convert them to integers or floats"
        )
    if found.shape == (cells,) and cells != vertices:
        raise InputError(
            "one value per cell given, but one per point is required", code="values",
            remedy="average the cells around each point, or encode the dual mesh",
        )
    if found.shape != (vertices,):
        raise InputError(f"the values have shape {found.shape}, but must have ({vertices},)", code="values")
    if found.dtype.kind == "b":
        found = found.view(np.uint8)
    if found.dtype.kind == "f":
        if np.isnan(found).any():
            bad = np.flatnonzero(np.isnan(found))[:5].tolist()
            raise InputError(
                f"values are missing (NaN): points {', '.join(map(str, bad))} ..", code="missing",
                remedy="leave out the cells with missing values",
            )
        signs = found > np.float64(isovalue)
    else:
        signs = found > math.floor(isovalue)
        if step is not None:
            raise OptionError("a step is for floating-point data; integers are stored exactly",
                              code="step", remedy="use exact")
    if step is not None and not (math.isfinite(step) and step > 0):
        raise OptionError(f"the step {step} is not a positive number", code="step")
    return Samples(found, isovalue_of(isovalue), signs, step)
