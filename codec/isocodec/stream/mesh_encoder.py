"""The encoder of isovalues on explicit domains (spec clause 10)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import ChunkType, DomainKind, MeshLayer, Profile

from ..errors import InputError, OptionError
from ..field.samples import Samples, isovalue_of
from ..format.chunks import write_chunk, write_further
from ..format.domain import MOST_STEP, DomainHead, MeshLayerHead, read_domain, write_domain, write_mesh_layer
from ..format.frames import FRAME_BEFORE, is_key, write_frame, write_interval
from ..format.header import Header
from ..mesh.coded_points import encoded_points, triangulated
from ..mesh.complex import complex_of
from ..mesh.history import has_levels, history_of
from ..mesh.isovalue import MeshIsovalue
from ..mesh.mesh_run import encoded_mesh
from ..mesh.positions import STEPS, active_vertices, parts_of
from ..mesh.quantised import Quantised, quantised, refitted, rounded_apart
from .mesh_decoder import coordinates_of
from .names import Isovalues, MeshName
from .options import Options, check_interval, isovalues_of, nearest_before
from .session import ContainerEncoder, beginning

FINER = 3
"""How many times as many vertices are told after a layer of signs than before it, at least."""
EDGE_SHARE = 0.05
"""Without an option, points lie as near to the contour as this share of the median edge."""
MESH_SHARE = 0.05
"""Without an option, vertices of a mesh in the file lie as near to theirs as this share of the median edge."""
KINDS = ("known", "coded", "whole", "delaunay")


class MeshEncoder(ContainerEncoder):
    """Encodes isocontours of values at the vertices of a mesh; iterating, once, yields the bytes of the file.

    Parameters
    ----------
    points, cells, values, isovalue, mesh, mesh_error, exact, step, tolerance, signs_only, leaning, progressive, \
    interval, metadata
        As in `encode_mesh`.

    Raises
    ------
    InputError
        If the mesh, the values or the isovalue cannot be encoded.
    OptionError
        If options contradict one another or are out of range.
    """

    def __init__(
        self,
        points: ArrayLike,
        cells: ArrayLike | None,
        values: ArrayLike,
        isovalue: Isovalues,
        *,
        mesh: MeshName | None = None,
        mesh_error: float | None = None,
        exact: bool = False,
        step: float | None = None,
        tolerance: float | None = None,
        signs_only: bool = False,
        leaning: bool = True,
        progressive: bool | None = None,
        interval: int = 0,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        if mesh is None:
            mesh = "delaunay" if cells is None else "known"
        if mesh not in KINDS:
            raise OptionError(f"the mesh is {mesh!r}", code="mesh", remedy=f"choose one of: {', '.join(KINDS)}")
        if (cells is None) != (mesh == "delaunay"):
            raise OptionError(
                f"cells are {'not ' * (cells is None)}given, and the mesh is {mesh!r}", code="mesh",
                remedy="a Delaunay triangulation follows from points alone; any other mesh has cells",
            )
        if cells is None:
            points, cells, values = triangulated(points, values)
        self.options = Options(
            exact=exact, step=step, tolerance=tolerance, signs_only=signs_only, leaning=leaning, metadata=metadata
        )
        self.isovalues = isovalues_of(isovalue)
        self.domain, self._points = complex_of(points, cells)
        self._frames = _frames_of(values)
        self._series = np.ndim(values) == 2
        self._interval = check_interval(interval)
        self._size = len(self.domain.mesh.position), len(self.domain.mesh.cell)
        self._source = np.arange(self._size[0])
        for frame in range(len(self._frames)):
            self.options.check_data(self._fields(frame)[0].integer)
        self._edge = self._median_edge()
        self._rounded: NDArray[np.float64] | None = None
        self._domain_chunk = self._known() if mesh == "known" else self._coded(mesh, mesh_error)
        self._step = self._offset_step()
        if progressive is None:
            progressive = mesh == "known" and has_levels(self.domain)
        self._history = history_of(self.domain) if progressive else None
        self.header = Header((), self._fields(0)[0].isovalue, self.options.step, Profile.MAIN, cells=self.domain.n)
        self.strands: list[MeshIsovalue] = []

    def _fields(self, frame: int) -> list[Samples]:
        """The values of a frame at the vertices of the domain, for each isovalue."""
        values = self._frames[frame]
        found = [vertex_field(values, *self._size, one, self.options.step) for one in self.isovalues]
        return [replace(one, values=one.values[self._source], signs=one.signs[self._source]) for one in found]

    def _median_edge(self) -> float:
        """Length of an edge of the mesh."""
        cells = self.domain.mesh.cell
        side = self._points[cells[:, 1]] - self._points[cells[:, 0]]
        return float(np.median(np.sqrt((side**2).sum(axis=1))))

    def _known(self) -> bytes:
        """Payload of the chunk of a domain that both sides have."""
        mesh = self.domain.mesh
        exponent = math.frexp(self.domain.unit)[1] - 1
        size = len(mesh.position), len(mesh.cell)
        head = DomainHead(DomainKind.KNOWN, mesh.position.shape[1], exponent, *size, self.domain.digest)
        return write_domain(head, self.domain.n)

    def _coded(self, mesh: str, error: float | None) -> bytes:
        """Payload of the chunk of a mesh in the file; from now on the domain is what decoders have."""
        if error is not None and not (math.isfinite(error) and error > 0):
            raise OptionError(f"the error of the mesh is {error}; it must be greater than 0", code="mesh-error")
        error = error or MESH_SHARE * self._edge
        if mesh == "delaunay":
            places = rounded_apart(self._points, error)
            run, self.domain, self._source = encoded_points(places.position, places.extent, places.unit)
            self._points = self._points[self._source]
            return self._in_file(DomainKind.DELAUNAY, places) + run
        cells = self.domain.mesh.cell
        if mesh == "coded":
            crossed = np.zeros(len(cells), np.bool_)
            for frame in range(len(self._frames)):
                for field in self._fields(frame):
                    signs = field.signs[cells]
                    crossed |= signs.any(axis=1) & ~signs.all(axis=1)
            # a file has a cell at least
            crossed[0] |= not crossed.any()
            cells = cells[crossed]
        used, numbers = np.unique(cells, return_inverse=True)
        points = self._points[used]
        places, domain = quantised(points, numbers.reshape(cells.shape), error)
        run, self.domain, order = encoded_mesh(domain, places.extent, places.unit)
        self._points = points[order]
        self._source = used[order]
        head = self._in_file(DomainKind.CODED, places)
        self._rounded = coordinates_of(self.domain, read_domain(head + run, self.domain.n, 0)[0])
        return head + run

    def _in_file(self, kind: DomainKind, places: Quantised) -> bytes:
        """The head of the domain as it goes into the file, with its positions."""
        size = len(self.domain.mesh.position), len(self.domain.mesh.cell)
        head = DomainHead(
            kind, len(places.extent), places.exponent, *size, b"", places.multiple, places.origin, places.extent
        )
        return write_domain(head, self.domain.n)

    def _offset_step(self) -> int:
        """The longest part of an edge, in steps of offsets; 0 without offsets."""
        o = self.options
        if o.exact or o.signs_only or o.step is not None:
            return 0
        tolerance = o.tolerance or EDGE_SHARE * self._edge
        return int(min(max(2 * tolerance / self.domain.unit * STEPS, 1), MOST_STEP))

    def _pieces(self) -> Iterator[bytes]:
        """The file but for its checksum."""
        yield from beginning(self.header, self.options.metadata)
        yield write_chunk(ChunkType.DOMAIN, self._domain_chunk)
        if self._series:
            yield write_chunk(ChunkType.FRAME, write_interval(self._interval))
        for frame in range(len(self._frames)):
            yield from self._frame(frame)

    def _frame(self, frame: int) -> Iterator[bytes]:
        """Chunks of a frame."""
        key = is_key(frame, self._interval)
        before = [] if key or not self.options.leaning else self.strands
        self.strands = []
        leans: list[int | None] = []
        fields = self._fields(frame)
        for number, value in enumerate(self.isovalues):
            then = before[number] if before else None
            lean = nearest_before(self.isovalues, number) if number and self.options.leaning and not then else None
            leans.append(lean)
            if frame:
                yield write_chunk(ChunkType.FRAME, write_frame(FRAME_BEFORE if then else lean, key))
            elif number:
                yield write_chunk(ChunkType.ISOVALUE, write_further(value, lean))
            earlier = []
            while lean is not None:
                earlier.append(self.strands[lean])
                lean = leans[lean]
            self.strands.append(MeshIsovalue(self.domain, value, self.options.step, earlier, then))
            ends = frame == len(self._frames) - 1 and number == len(self.isovalues) - 1
            yield from self._layers(self.strands[number], fields[number], ends)

    def _layers(self, strand: MeshIsovalue, field: Samples, ends: bool) -> Iterator[bytes]:
        """Chunks of the layers of an isovalue; ``ends`` if it is the last of the file."""
        geometry = self._geometry()
        for head in self._sign_layers():
            strand.run.begin(None)
            if self._history is None:
                strand.code_signs(field.signs)
            else:
                strand.code_levels(self._history, head.rounds, field.signs)
            empty = strand.edges is not None and not len(strand.edges)
            last = ends and head.rounds == 0 and (empty or geometry is None)
            yield write_chunk(ChunkType.LAYERS, write_mesh_layer(head) + strand.run.end(), last=last)
        assert strand.edges is not None
        if geometry is None or empty:
            return
        strand.run.begin(None)
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
        yield write_chunk(ChunkType.LAYERS, write_mesh_layer(head) + strand.run.end(), last=ends)

    def _offsets(self, strand: MeshIsovalue, field: Samples) -> NDArray[np.int64]:
        """Parts of the crossed edges that the curve lies in."""
        assert strand.edges is not None
        where = crossing_places(field, strand.edges)
        if self._rounded is not None:
            above = field.values.astype(np.float64) - field.isovalue
            where = refitted(self.domain, self._points, self._rounded, strand.edges[:, :2], above, where)
        parts = parts_of(self.domain.mesh, strand.edges, self._step)
        return np.clip(np.floor(where * parts), 0, parts - 1).astype(np.int64)

    def _sign_layers(self) -> list[MeshLayerHead]:
        """Layers that tell the signs: one, or one for every few rounds."""
        if self._history is None:
            return [MeshLayerHead(MeshLayer.SIGNS)]
        rounds = len(self._history.rounds)
        out, there, told = [rounds], self._history.left, self._history.left
        while rounds:
            rounds -= 1
            there += len(self._history.rounds[rounds].vertex)
            if there >= FINER * told or rounds == 0:
                out.append(rounds)
                told = there
        return [MeshLayerHead(MeshLayer.LEVELS, rounds=each) for each in out]

    def _geometry(self) -> MeshLayer | None:
        """What tells where within cells the curve lies."""
        if self.options.signs_only:
            return None
        return MeshLayer.OFFSETS if self._step else MeshLayer.VALUES


def _frames_of(values: ArrayLike) -> NDArray[Any]:
    """Values of all frames, (F, V): those of the one frame of a file that is no series."""
    found = np.asarray(values)
    if found.ndim == 2 and not len(found):
        raise InputError("a series without frames", code="frames", remedy="give at least one")
    return found if found.ndim == 2 else found[None]


def vertex_field(values: NDArray[Any], vertices: int, cells: int, isovalue: float, step: float | None) -> Samples:
    """Values at the vertices of a mesh as a field; raises `InputError` if they are none."""
    found = values
    if found.dtype.kind not in "biuf":
        raise InputError(
            f"the values are of type {found.dtype}", code="dtype", remedy="convert them to integers or floats"
        )
    if found.shape == (cells,) and cells != vertices:
        raise InputError(
            "a value for each cell, needed is one for each point", code="values",
            remedy="average the cells around each point, or encode the dual mesh",
        )
    if found.shape != (vertices,):
        raise InputError(f"the values have shape {found.shape}, needed is ({vertices},)", code="values")
    if found.dtype.kind == "b":
        found = found.view(np.uint8)
    if found.dtype.kind == "f":
        if np.isnan(found).any():
            bad = np.flatnonzero(np.isnan(found))[:5].tolist()
            raise InputError(
                f"values are missing (NaN): points {', '.join(map(str, bad))} ..", code="missing",
                remedy="leave out the cells that have them",
            )
        signs = found > np.float64(isovalue)
    else:
        signs = found > math.floor(isovalue)
        if step is not None:
            raise OptionError("a step is for float data; integers are sent exactly", code="step", remedy="use exact")
    if step is not None and not (math.isfinite(step) and step > 0):
        raise OptionError(f"the step is {step}, needed is a positive number", code="step")
    return Samples(found, isovalue_of(isovalue), signs, step)


def crossing_places(field: Samples, edges: NDArray[np.int64]) -> NDArray[np.float64]:
    """Where edges are crossed, from 0 to 1 from their lower vertices, by linear interpolation."""
    low, high = (field.values[edges[:, i]].astype(np.float64) for i in (0, 1))
    with np.errstate(all="ignore"):
        # as of fields: no overflow, and all bits of tiny numbers
        exponent = np.frexp(np.maximum(np.abs(low), np.abs(high)))[1]
        at, start, end = (np.ldexp(x, -exponent) for x in (field.isovalue, low, high))
        where = np.nan_to_num((at - start) / (end - start), nan=0.5)
    return np.asarray(np.clip(where, 0.0, 1.0))
