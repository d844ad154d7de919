"""Encoders of values on meshes (explicit domains; spec clause 10)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import ChunkType, MeshLayer, Profile

from ..errors import InputError, OptionError
from ..field.meshed import Mesh, valued
from ..field.placement import COORDINATE_UNIT, CRS
from ..field.samples import Samples, isovalue_of
from ..field.stretch import in_unit
from ..field.times import time_texts
from ..field.units import distance_of
from ..format.chunks import Promises, payload_of, write_chunk, write_promises
from ..format.domain import MOST_STEP, MeshLayerHead, read_domain, read_mesh_layer, write_mesh_layer
from ..format.frames import FRAME_BEFORE
from ..format.header import Header
from ..mesh.coded_points import triangulated
from ..mesh.complex import complex_of
from ..mesh.cut import CellHistory, history_of
from ..mesh.hierarchy import Hierarchy, has_hierarchy, hierarchy_of
from ..mesh.isovalue import MeshIsovalue
from ..mesh.positions import STEPS, active_vertices, parts_of
from ..mesh.quantised import refitted
from ..search.mesh_cuts import KeptCut, contour_on, far_apart
from .container import ContainerEncoder, beginning
from .cut_plan import Cut, CutPlan, check_cuts, cut_promise_of, cut_under
from .decoder import Decoder
from .grid_file import Report
from .leaning import chain
from .mesh_contents import code_layer, coordinates_of
from .mesh_file import NEEDED, StoredMesh, known_mesh, mesh_of_cells, mesh_of_points, stored_kind
from .options import BEST, LEVELS, SEARCHED, Options
from .promises import PROMISE
from .series import Series

FINER = 8
"""Growth of the number of known vertices from one layer of signs to the next, about."""
EDGE_SHARE = 0.05
"""Default tolerance of contour points, as a fraction of the median edge length."""
MESH_SHARE = 0.05
"""Without an option, vertices of a mesh in the file lie as near to theirs as this share of the median edge."""
TOLERANCE_SHARE = 0.125
"""Share of a tolerance that they may take, if one is given: it holds for mesh and points of contours together."""
SHORTER = 50
"""Signs come along a walk, unless levels are asked for, where that saves more than such a part of an isovalue."""
SMALL = 1000
"""Such walks are for isovalues of fewer bytes: the first bytes of larger ones draw the whole curve."""
MEASURED = 10
"""Distances of levels are measured to a hundredth of so many median edges."""
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
        asked = options.precision.text
        if options.precision.world:
            options = _in_unit(options, mesh)
        else:
            asked = ""
        self._report, self._tried = report, 0
        self.options, self.series = options, series
        stored, points, values = stored_kind(mesh, complete), mesh.points, mesh.values
        if values is None:
            raise InputError("the mesh has no values", code="values",
                             remedy="give a value for each point; of a file choose an array: --key")
        self._scattered: NDArray[Any] | None = None
        self._there: NDArray[np.bool_] | None = None
        if mesh.cells is None:
            points, self._there = np.asarray(points), valued(points, values)
            if self._there is not None:
                gone = int((~self._there).sum())
                warnings.warn(f"{gone:,} points without a value (NaN) are left out", stacklevel=6)
                points, values = points[self._there], np.asarray(values)[..., self._there]
            self._scattered = points
            joined = triangulated(points, values)
            self._given, places, values = joined.domain, joined.points, joined.values
        else:
            self._given, places = complex_of(points, mesh.cells)
        self._source = np.arange(len(places))
        self.given = first = _frames_of(values)
        for each in first:
            self.options.check_data(self._fields(each)[0].integer)
        cells = self._given.mesh.cell
        self._edge = float(np.median(np.sqrt(((places[cells[:, 1]] - places[cells[:, 0]]) ** 2).sum(axis=1))))
        known, promise, self._criterion = stored == "known", cut_promise_of(options), options.layers.criterion
        stepwise = promise is not None and promise.stepwise
        if stepwise or self._criterion:
            check_cuts(self._given, options, mesh.progressive, known)
        self._asked = promise.distances if promise is not None and self._criterion in (None, "crossing") else ()
        self._shared = mesh.error is None and not known
        self._stored = known_mesh(self._given, places) if known else self._in_file(places, mesh.error, stored in NEEDED)
        self.domain, self._source, off = self._stored.domain, self._stored.source, self._stored.off
        self._step = self._offset_step()
        # a distance holds for the positions of a mesh in the file and for the curve on it together
        self._of_cuts = promise if promise is None or not self._shared else replace(
            promise, distances=tuple(each - off for each in self._asked)
        )
        self._stated = [each and each + (0.0 if self._shared else off) for each in self._asked]
        if self._stated and self._stated[-1]:
            self._stated[-1] = max(self._stated[-1], off + self._step * self.domain.unit / STEPS / 2)
        self._asked_levels = mesh.progressive
        wanted = mesh.progressive or stepwise or (mesh.progressive is None and known and has_hierarchy(self.domain))
        self._hierarchy = hierarchy_of(self.domain) if wanted else None
        step = options.precision.step
        self.header = Header((), self._fields(first[0])[0].isovalue, step, Profile.MAIN, cells=self.domain.n)
        self._metadata = {**mesh.metadata, **options.metadata}
        if self._asked:
            self._metadata[PROMISE] = self._note(asked)
        self._before: list[MeshIsovalue] = []
        self.cuts: Cuts | None = None

    @cached_property
    def _history(self) -> CellHistory:
        """All cells that the mesh has in all rounds."""
        return history_of(self._hierarchy or hierarchy_of(self.domain))

    @cached_property
    def _places(self) -> NDArray[np.float64]:
        """Coordinates of the vertices as decoders have them, (V, d)."""
        head, _ = read_domain(self._stored.payload, self.domain.n, 0)
        return self._stored.points if head.digest else coordinates_of(self.domain, head)

    def resume(self, decoder: Decoder) -> None:
        """Continue a file after its last frame, which has been decoded."""
        self.series.frame = decoder.frame
        strands = map(decoder.on_mesh.strand, range(len(self.series.isovalues)))
        self._before = [strand for strand in strands if strand]

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
        with self.series.next_frame():
            begun = self.beginning() if self.series.frame == 0 else ()
            strands: list[MeshIsovalue] = []
            out = [*begun, *self._frame(fields, strands)]
        self._before = strands
        return out

    def beginning(self) -> list[bytes]:
        """Write the header, and the chunks that concern the whole file."""
        domain = write_chunk(ChunkType.DOMAIN, self._stored.payload)
        return beginning(self.header, self._metadata, [domain], self.series.interval)

    def _frame(self, fields: Sequence[Samples], strands: list[MeshIsovalue]) -> Iterator[bytes]:
        """Yield the chunks of all isovalues of a frame, and collect their states."""
        series, cuts = self.series, self._cuts_of(fields)
        for number, value in enumerate(series.isovalues):
            lean = series.choose(number)
            series.leans[number:] = [lean]
            yield from series.opening(number)
            earlier = [strands[one] for one in chain(series.leans, number)]
            then = self._before[number] if lean == FRAME_BEFORE else None
            begun = partial(MeshIsovalue, self.domain, value, self.options.precision.step, earlier, then)
            if cuts[number]:
                strand = begun()
                layers, within = self._on_cuts(strand, fields[number], cuts[number])
            else:
                strand, layers = self._shorter(begun, fields[number])
                within = self._measured(fields[number], layers)
            strands.append(strand)
            yield from self._promises(within)
            yield from layers

    def _fields(self, values: NDArray[Any]) -> list[Samples]:
        """Prepare the values of a frame at the vertices of the mesh, for each isovalue."""
        step, mesh = self.options.precision.step, self._given.mesh
        if values.dtype.kind == "f" and np.isnan(values).any() and values.shape == (len(mesh.position),):
            used = np.zeros(len(values), np.bool_)
            used[mesh.cell] = True
            # no cell asks for the others
            values = np.where(used, values, values.dtype.type(0))
        found = [vertex_field(values, len(mesh.position), len(mesh.cell), one, step) for one in self.series.isovalues]
        return [replace(one, values=one.values[self._source], signs=one.signs[self._source]) for one in found]

    def _in_file(self, points: NDArray[np.float64], error: float | None, few: bool) -> StoredMesh:
        """Store the mesh; ``few``: only what contours of the given frames need."""
        if error is not None and not (math.isfinite(error) and error > 0):
            raise OptionError(f"the error of the mesh is {error}; it must be greater than 0", code="mesh-error")
        off = error or MESH_SHARE * self._edge
        if error is None and self._asked:
            off = min(off, TOLERANCE_SHARE * self._asked[-1])
        # for each frame, how many isovalues the value of each vertex exceeds
        exceeded: list[NDArray[np.uint16]] = [
            np.sum([one.signs for one in self._fields(frame)], axis=0, dtype=np.uint16)
            for frame in (self.given if few else ())
        ]

        def crossed(cells: NDArray[np.int64]) -> NDArray[np.bool_]:
            found = np.full(len(cells), not few)
            for count in exceeded:
                found |= (count[cells[:, 1:]] != count[cells[:, :1]]).any(axis=1)
            return found

        if self._scattered is not None:
            return mesh_of_points(self._given, points, crossed, not few, off, self._shared)
        return mesh_of_cells(self._given, points, crossed, off)

    def _offset_step(self) -> int:
        """Compute the longest part of an edge, in steps of offsets; 0 without offsets."""
        precision = self.options.precision
        if precision.exact or precision.signs or precision.step is not None or 0.0 in self._asked:
            return 0
        tolerance = self._asked[-1] if self._asked else EDGE_SHARE * self._edge
        if self._asked and self._shared:
            tolerance -= self._stored.off
        return int(min(max(2 * tolerance / self.domain.unit * STEPS, 1), MOST_STEP))

    def _note(self, asked: str) -> str:
        """The note of a promise: distances as they were asked for, longer where a mesh in the file is off beside."""
        texts = asked.split(",") if asked else [f"{each:.12g}" for each in self._asked]
        out = []
        for text, distance, stated in zip(texts, self._asked, self._stated, strict=True):
            number, unit = distance_of(text) if distance else (0.0, "")
            out.append(f"{number * stated / distance:.12g}{unit}" if distance else "exact")
        return ",".join(out)

    def _promises(self, within: Mapping[int, float]) -> Iterator[bytes]:
        """Yield the chunk with the distances that layers keep, in the unit of the points, and the topology."""
        topology = self.options.keep_topology
        if within or topology:
            of_positions = {layer: distance / self.domain.unit for layer, distance in within.items()}
            yield write_chunk(ChunkType.PROMISES, write_promises(Promises(of_positions, topology)), ancillary=True)

    def _measured(self, field: Samples, layers: Sequence[bytes]) -> dict[int, float]:
        """The distance of the last layer as it was asked for, and those of levels before as they are, by number."""
        if not self._asked:
            return {}
        original = contour_on(self.domain.mesh.cell, self._stored.points, field)
        within = {}
        for number, layer in enumerate(layers[:-1], 1):
            head, _ = read_mesh_layer(payload_of(layer), 0)
            if head.kind == MeshLayer.LEVELS and self._hierarchy is not None:
                drawn = contour_on(self._hierarchy.cells(head.rounds), self._places, field, middles=True)
                within[number] = far_apart(drawn, original, MEASURED * self._edge)
        within[len(layers)] = self._stated[-1]
        return {number: far for number, far in within.items() if math.isfinite(far)}

    def _cuts_of(self, fields: Sequence[Samples]) -> list[list[Cut]]:
        """Choose cuts of the mesh for each isovalue of a frame; none where signs of the whole mesh take fewer bytes."""
        if self.cuts is not None:
            return [list(self.cuts(self._history, field)) for field in fields]
        if self._criterion is not None:
            if self._hierarchy is None:
                self._hierarchy = hierarchy_of(self.domain)
            return [[cut_under(self.options, self.domain, self._stored.points, self._hierarchy, self._history, field)]
                    for field in fields]
        promise = self._of_cuts
        least = SEARCHED * self._edge
        small = promise is not None and not promise.stepwise and promise.distances[-1] < least
        if promise is None or small or self._hierarchy is None or (self._asked_levels and not promise.stepwise):
            return [[] for _ in fields]

        def whole(field: Samples) -> int:
            return sum(map(len, self._shorter(partial(MeshIsovalue, self.domain, field.isovalue), field)[1]))

        plan = CutPlan(self.domain, self._places, self._history, promise, least, self._try)
        return plan.cuts(fields, whole, self._step)

    def _try(self) -> None:
        """Report that a cut is tried."""
        self._tried += 1
        if self._report is not None:
            self._report(self._tried, 0)

    def _on_cuts(
        self, strand: MeshIsovalue, field: Samples, cuts: Sequence[Cut]
    ) -> tuple[list[bytes], dict[int, float]]:
        """Code an isovalue on cuts of the mesh, each with its geometry, the last one as it is asked for.

        Returns the chunks of its layers, and the distances of those that complete a cut, by number.
        """
        layers, within = list[bytes](), dict[int, float]()
        for number, cut in enumerate(cuts, 1):
            inside = cut.inside if isinstance(cut, KeptCut) else cut
            layers.append(self._layer(strand, MeshLayerHead(MeshLayer.CUT), field.signs, inside))
            if isinstance(cut, KeptCut) and cut.step and strand.edges is not None and len(strand.edges):
                numbers = cut.numbers(self.domain.mesh, strand.edges[:, :2])
                layers.append(self._layer(strand, MeshLayerHead(MeshLayer.OFFSETS, step=cut.step), numbers))
            elif number == len(cuts) and not isinstance(cut, KeptCut):
                layers += self._geometry(strand, field)
            if self.cuts is None and number <= len(self._stated) and self._stated[number - 1]:
                within[len(layers)] = self._stated[number - 1]
        return layers, within

    def _shorter(self, begun: Callable[[], MeshIsovalue], field: Samples) -> tuple[MeshIsovalue, list[bytes]]:
        """Code an isovalue level by level, or along a walk where that is much shorter; return it, and its chunks."""
        strand = begun()
        heads = [MeshLayerHead(MeshLayer.SIGNS)] if self._hierarchy is None else level_heads(self._hierarchy)
        signs = [self._layer(strand, head, field.signs) for head in heads]
        found = [*signs, *self._geometry(strand, field)]
        whole = sum(map(len, found))
        if self._hierarchy is not None and self._asked_levels is None and whole < SMALL:
            other = begun()
            walk = self._layer(other, MeshLayerHead(MeshLayer.SIGNS), field.signs)
            if SHORTER * (sum(map(len, signs)) - len(walk)) > whole:
                return other, [walk, *self._geometry(other, field)]
        return strand, found

    def _layer(
        self, strand: MeshIsovalue, head: MeshLayerHead, truth: NDArray[Any], wanted: NDArray[np.bool_] | None = None
    ) -> bytes:
        """Code a layer: the signs of all vertices, of a cut with the nodes ``wanted``, or numbers; return its chunk."""
        run = strand.write()
        code_layer(strand, head, lambda: self._hierarchy, lambda: self._history, truth, wanted)
        return write_chunk(ChunkType.LAYERS, write_mesh_layer(head) + run.end())

    def _geometry(self, strand: MeshIsovalue, field: Samples) -> list[bytes]:
        """Code where within cells the curve lies; return the chunk, if there is any."""
        assert strand.edges is not None
        if self.options.precision.signs or not len(strand.edges):
            return []
        if self._step:
            head = MeshLayerHead(MeshLayer.OFFSETS, step=self._step)
            return [self._layer(strand, head, self._offsets(strand.edges, field))]
        active = active_vertices(strand.edges)[:, 0]
        steps = field.numbers(active[:, None], field.signs[active])
        bits = [max((int(n).bit_length() for n in steps[field.signs[active] == s]), default=0) for s in (0, 1)]
        return [self._layer(strand, MeshLayerHead(MeshLayer.VALUES, bits=(bits[0], bits[1])), steps)]

    def _offsets(self, edges: NDArray[np.int64], field: Samples) -> NDArray[np.int64]:
        """Find the part of each crossed edge in which the curve lies."""
        where, mesh = field.along(edges[:, :2]), self._stored
        if mesh.rounded is not None:
            above = field.values.astype(np.float64) - field.isovalue
            where = refitted(self.domain, mesh.points, mesh.rounded, edges[:, :2], above, where, mesh.off)
        parts = parts_of(self.domain.mesh, edges, self._step)
        return np.clip(np.floor(where * parts), 0, parts - 1).astype(np.int64)


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
        self.frames = MeshFrames(mesh, Series(isovalues, interval, options.independent), options, report=report)
        self._times = time_texts(mesh.times, len(self.frames.given))
        self.header = self.frames.header

    def _chunks(self) -> Iterator[bytes]:
        for values, time in zip(self.frames.given, self._times, strict=True):
            self.frames.series.time = time
            yield from self.frames.merged_chunks(values)


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
    precision, criterion = options.precision, options.layers.criterion
    if criterion == "distortion":
        raise OptionError("distortion does not apply to meshes", code="layers",
                          remedy=f"precision={options.layers.parameter:g} keeps that distance on the coarsest mesh")
    options.check_unused("meshes", {
        "layers": not options.layers.default and criterion is None,
        f"profile {options.profile!r}": options.entropy != Profile.MAIN,
        f"order {options.order!r}": options.order == LEVELS, f"precision {precision.text!r}": precision.smooth,
        "effort": options.effort == BEST,
    })
    tolerance = precision.tolerance
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance > 0):
        raise OptionError(f"the precision is {tolerance}; it must be greater than 0", code="tolerance")


def _in_unit(options: Options, mesh: Mesh) -> Options:
    """The options with a distance in the unit of the points of a mesh."""
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
