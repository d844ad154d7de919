"""Encoders of values on meshes (explicit domains; spec clause 10)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Collection, Iterator, Sequence
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
    MOST_OF_BYTE,
    MOST_STEP,
    DomainHead,
    MeshLayerHead,
    read_domain,
    write_domain,
    write_mesh_layer,
)
from ..format.frames import as_last, write_frame, write_interval
from ..format.header import Header
from ..mesh.coded_points import delaunay_complex, encoded_points, triangulated
from ..mesh.complex import EXTENT_BITS, Complex, complex_of, neighbours
from ..mesh.cut import CellHistory, history_of
from ..mesh.hierarchy import Hierarchy, has_hierarchy, hierarchy_of
from ..mesh.isovalue import MeshIsovalue
from ..mesh.mesh_run import encoded_mesh
from ..mesh.positions import STEPS, active_vertices, parts_of
from ..mesh.quantised import Quantised, quantised, refitted, rounded_apart
from ..search.mesh_cuts import KeptCut
from ..tin.rank import by_rank
from .container import ContainerEncoder, beginning
from .cut_plan import Cut, CutPlan, check_cuts, cut_promise_of
from .mesh_contents import coordinates_of
from .options import LEVELS, Options
from .promises import PROMISE
from .series import Series

FINER = 8
"""Factor by which the number of known vertices grows from one layer of signs to the next, about."""
EDGE_SHARE = 0.05
"""Default tolerance of contour points, as a fraction of the median edge length."""
MESH_SHARE = 0.05
"""Without an option, vertices of a mesh in the file lie as near to theirs as this share of the median edge."""
TOLERANCE_SHARE = 0.125
"""Share of a tolerance that they may take, if one is given: it holds for mesh and points of contours together."""
CLOSER = 3**0.5
CLOSER_TRIED = 11
"""So many times scattered points are rounded, by that factor more finely each time, until contours cross the same
triangles as of the points themselves."""
SHORTER = 50
"""Signs come along a walk, unless levels are asked for, where that saves more than such a part of an isovalue."""
CELL_KINDS, POINT_KINDS = ("known", "coded", "whole"), ("delaunay", "whole")
"""Ways to store a mesh with cells, and scattered points."""
KINDS = (*CELL_KINDS, "delaunay")
NEEDED = ("coded", "delaunay")
"""Ways to store only what the contours of all frames need."""
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

    def __init__(self, mesh: Mesh, series: Series, options: Options, *, complete: bool = True) -> None:
        _check_options(options)
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
            points, cells, values = triangulated(points, values)
            cells = without_slivers(points, cells)
        self.domain, self._points = complex_of(points, cells)
        self._cells = self.domain.mesh.cell
        self._size = len(self.domain.mesh.position), len(self._cells)
        self._source = np.arange(self._size[0])
        self.given = first = _frames_of(values)
        for each in first:
            self.options.check_data(self._fields(each)[0].integer)
        self._edge = self._median_edge()
        self._rounded: NDArray[np.float64] | None = None
        self._off, self._same, self._shared = 0.0, True, False
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
        if options.precision.tolerance is not None and self._same:
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
            values = triangulated(self._scattered, values)[2]
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
        if self._scattered is None:
            return self._of_cells()
        # trials with all points take long, and are of use only for a promise
        once = error is not None or not (self._exceeded or self.options.precision.tolerance)
        return self._of_points(1 if once else CLOSER_TRIED)

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

    def _of_points(self, trials: int) -> bytes:
        """Write the payload for scattered points: all of them, or the vertices of the triangles that the file needs.

        The points are rounded so finely that contours cross the same triangles as before, if that is reached within a
        number of trials; otherwise as in the first one. Origin and extent are those of all points, so that ties are
        decided as among all of them (annex G.5).
        """
        given, cells = self._points, self.domain.mesh.cell
        crossed = self._crossed(cells)
        wanted = _vertex_sets(cells[crossed])
        kept = np.unique(cells[_one_at_least(crossed)]) if self._exceeded else np.arange(len(given))
        found: list[tuple[Quantised, float]] = []
        error = self._off
        for _ in range(trials):
            try:
                found.append(rounded_apart(given, error, kept))
            except InputError:
                if found:
                    break
                raise
            places = found[-1][0]
            order = by_rank(*places.position.T)
            if self._crossed_alike(kept[order], delaunay_complex(places.position[order], places.unit), wanted):
                found[0] = found[-1]
                break
            error /= CLOSER
        places, error = found[0]
        payload, self.domain, order = self._with_points(places)
        while len(self.domain.mesh.position) + len(self.domain.mesh.cell) > MOST_OF_BYTE * len(payload):
            # points that fill a lattice take so few bytes that readers would not believe their number
            self._off /= CLOSER
            places, error = rounded_apart(given, self._off, kept, exact=False)
            payload, self.domain, order = self._with_points(places)
        self._off, self._source = error, kept[order]
        self._points = given[self._source]
        self._same = self._crossed_alike(self._source, self.domain, wanted)
        return payload

    def _crossed_alike(
        self, source: NDArray[np.int64], domain: Complex, wanted: Collection[tuple[int, ...]]
    ) -> bool:
        """Check that contours cross these cells of a complex of given points, and no others."""
        cells = source[domain.mesh.cell]
        return _vertex_sets(cells[self._crossed(cells)]) == wanted

    def _with_points(self, places: Quantised) -> tuple[bytes, Complex, NDArray[np.int64]]:
        """Write the payload for points in these places; also the complex and the order of the points in it."""
        run, domain, order = encoded_points(places.position, places.extent, places.unit)
        return self._head(DomainKind.DELAUNAY, places, domain) + run, domain, order

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
        if promise is None or self._hierarchy is None or (self._asked_levels and not promise.stepwise):
            return [[] for _ in fields]

        def whole(field: Samples) -> int:
            return sum(map(len, self._shorter(partial(MeshIsovalue, self.domain, field.isovalue), field)[1]))

        return CutPlan(self.domain, self._points, self._history, promise).cuts(fields, whole, self._step)

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
            if self._asked_levels is None:
                other = begun()
                walk = self._signs(other, field, MeshLayerHead(MeshLayer.SIGNS))
                if SHORTER * (sum(map(len, signs)) - len(walk)) > sum(map(len, found)):
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
            where = refitted(self.domain, self._points, self._rounded, strand.edges[:, :2], above, where)
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

    Raises
    ------
    InputError, OptionError
        As for `MeshFrames`.
    """

    def __init__(self, mesh: Mesh, isovalues: Sequence[float], options: Options) -> None:
        interval = options.interval if np.ndim(mesh.values) == 2 else None  # type: ignore[arg-type]
        self.frames = MeshFrames(mesh, Series(isovalues, interval), options)
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


def _vertex_sets(cells: NDArray[np.int64]) -> set[tuple[int, ...]]:
    """The vertices of each cell, whatever their order."""
    return set(map(tuple, np.sort(cells, axis=1).tolist()))


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

def without_slivers(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Leave out triangles at the border that are too flat for positions of a mesh, where points lie in a line but for
    rounding."""
    unit = float(np.ptp(points, axis=0).max()) * 2.0 ** (1 - EXTENT_BITS[2])
    while True:
        corners = points[cells]
        sides = corners[:, [1, 2, 0]] - corners
        area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
        flat = area <= 2 * unit * np.sqrt((sides**2).sum(axis=2)).max(axis=1)
        outside = flat & (neighbours(cells) < 0).any(axis=1) if flat.any() else flat
        if not outside.any() or outside.all():
            return cells
        cells = cells[~outside]


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
