"""The incremental encoder: a field in, bytes out as layers get done (spec clause 8.1)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import ChunkType, Profile

from ..errors import FormatError, OptionError
from ..field.placement import Placement, closed, placement_of
from ..field.sampled import Field, check_bare
from ..field.samples import Samples, check_field, mask_field, without_holes
from ..format.chunks import (
    LayerRecord,
    Promises,
    write_chunk,
    write_further,
    write_index,
    write_promises,
)
from ..format.frames import FRAME_BEFORE
from ..format.header import Header
from ..format.kinds import LayerKind
from ..format.program import Layer, Progress, write_program
from ..grid.lattice.tables import cube_exponent
from ..grid.layers.plan import Entry
from ..grid.layers.writer import LayerWriter, encoded_mask, field_tube
from ..grid.passes.runner import Tube
from ..grid.tube.holes import Holes
from ..search import strategy
from ..search.ground_truth import truth_of
from ..search.promise import Promise
from ..search.reduced import LINEAR_POINTS
from ..search.steps import stepwise
from ..search.tolerance import NO_OFFSETS, grid_offsets, radices
from .names import CriterionName, Distance, Isovalues, ProfileName
from .options import DEFAULT_TOLERANCE, SEARCHED, Options, isovalues_of, nearest_before
from .placing import check_axes, coordinates_payload
from .plan_meshes import with_meshes
from .session import ContainerEncoder, beginning


@dataclass(frozen=True)
class Earlier:
    """What an isovalue leans on.

    Attributes
    ----------
    strand : LayerWriter
    isovalue : float
    number : int
        Its number in its frame, or ``FRAME_BEFORE`` if it is the same isovalue of the frame before.
    """

    strand: LayerWriter
    isovalue: float
    number: int

    @property
    def in_frame_before(self) -> bool:
        """Whether it belongs to the frame before."""
        return self.number == FRAME_BEFORE


FINE_SHARE = 0.25
"""Under the criterion distortion crossings are told within this share of its distance, or more finely."""
LEVELS_WORTH = 0.95
"""A frame begins at the leaves of the one before if that takes less than this share of what levels would take."""
INDEX_SHARE = 100
"""A level index is written if it takes at most this fraction of the data."""


class Encoder(ContainerEncoder):
    """Encodes isocontours of a field; iterating, once, yields the bytes of the file, chunk by chunk.

    Parameters
    ----------
    field : (s0, s1) or (s0, s1, s2) array_like of bool, integers or floats
    isovalue : number or sequence of numbers
        One isovalue, or several of the same field, in the order in which the file has them: finite numbers of Python's
        or numpy's, fractions or decimals. Files hold double precision; whole numbers beyond it are refused.
    exact, tolerance, signs_only, step, base_level, preserve_topology, steps, criterion, parameter, leaning, mask, \
    plan, profile, metadata, placement
        As in `encode`.
    progress : callable, optional
        Called with the layers done and their total; before, while a mesh is searched for, with the number of curves
        tried and 0.

    Attributes
    ----------
    options : Options
        What was asked for, numbers of any kind as Python's own.
    isovalues : list of float
    header : Header

    Raises
    ------
    InputError
        If the field or the isovalue cannot be encoded.
    OptionError
        If options contradict one another or are out of range.
    """

    def __init__(
        self,
        field: ArrayLike,
        isovalue: Isovalues,
        *,
        exact: bool = False,
        tolerance: float | str | None = None,
        signs_only: bool = False,
        step: float | None = None,
        base_level: int | None = None,
        preserve_topology: bool = False,
        steps: Sequence[Distance] | None = None,
        criterion: CriterionName | None = None,
        parameter: float | None = None,
        leaning: bool = True,
        mask: ArrayLike | None = None,
        plan: Sequence[Entry] | Mapping[float, Sequence[Entry]] | None = None,
        profile: ProfileName = "main",
        metadata: Mapping[str, str] | None = None,
        placement: Placement | ArrayLike | None = None,
        progress: Callable[[int, int], object] | None = None,
    ) -> None:
        values: Any = field
        if isinstance(field, Field):
            values = field.values
            mask, placement, metadata = field.combined(mask, placement, metadata)
        check_bare(values)
        values, gone = without_holes(values, mask)
        if isinstance(tolerance, str):
            where = placement_of(placement, values.ndim) or Placement()
            tolerance = where.cells_of(tolerance, values.shape, gone)
        self.options = Options(
            exact=exact, tolerance=tolerance, signs_only=signs_only, step=step, base_level=base_level,
            preserve_topology=preserve_topology, steps=steps, criterion=criterion, parameter=parameter,
            leaning=leaning, plan=plan, profile=profile, metadata=metadata, placement=placement,
        )
        self._placement = self._placed(values.ndim)
        self.isovalues = isovalues_of(isovalue)
        self._fields, gone = self._sampled(values, gone)
        self._truths = [truth_of(one) for one in self._fields]
        first = self._fields[0]
        self.options.check_data(first.integer)
        self._metadata = self.options.notes(first.values.ndim)
        self._coordinates = coordinates_payload(self._placement, first.values.shape, gone)
        self._report = progress
        self._tried = 0
        self.header = Header(first.values.shape, first.isovalue, self.options.step, Profile[profile.upper()])
        self._mask_run, self._holes = self._encoded_mask(gone)
        self._begin_strands()

    def _placed(self, n: int) -> Placement | None:
        """Where the samples lie; ends that would meet by their coordinates alone stay open if the mesh is searched."""
        placement = placement_of(self.options.placement, n) if n in (2, 3) else None
        if placement is None or not (placement.inferred and placement.periodic and self.options.chooses_mesh):
            return placement
        warnings.warn(
            f"ends along axis {placement.periodic[0]} are not joined, as {self.options.chooses_mesh} chooses a mesh",
            stacklevel=4,
        )
        return replace(placement, periodic=())

    @property
    def _periodic(self) -> tuple[int, ...]:
        return () if self._placement is None else self._placement.periodic

    def _sampled(
        self, values: NDArray[Any], gone: NDArray[np.bool_] | None
    ) -> tuple[list[Samples], NDArray[np.bool_] | None]:
        """The field at each isovalue, and which samples are missing, both with periodic axes closed."""
        check_axes(self._periodic, values.shape)
        values = closed(values, self._periodic)
        gone = None if gone is None else closed(gone, self._periodic)
        return [check_field(values, value, self.options.step, gone) for value in self.isovalues], gone

    def _begin_strands(self) -> None:
        """Get the first isovalue ready to be encoded."""
        self._strands: list[LayerWriter] = []
        strand, self._lean_of_first = self._strand(0, Progress(self._full_level))
        self._strands.append(strand)

    def _encoded_mask(self, gone: NDArray[np.bool_] | None) -> tuple[bytes, Holes | None]:
        """The run of the mask, and what it says, if any samples are missing."""
        if gone is None:
            return b"", None
        mask = mask_field(gone)
        return encoded_mask(self.header, mask, truth_of(mask))

    @property
    def layers(self) -> list[Layer]:
        """Layers known so far, of all isovalues."""
        return [layer for strand in self._strands for layer in strand.layers]

    @property
    def records(self) -> list[LayerRecord]:
        """What the layers that are done took."""
        return [record for strand in self._strands for record in strand.records]

    @property
    def _full_level(self) -> int:
        return len(self.header.shape) * cube_exponent(self.header.shape)

    @property
    def _tube(self) -> Tube:
        return self._strands[-1].tube

    def _strand(self, number: int, progress: Progress) -> tuple[LayerWriter, Earlier | None]:
        """The layers of an isovalue, ready to be encoded when those before it are done; the one that it leans on."""
        lean = self._leans_on(number)
        if lean is not None and lean.strand.tube.full and self._on_grid:
            return self._smaller(number, lean, progress), lean
        try:
            plan = self._plan_of(number, lean)
        except strategy.NotKeptError:
            if lean is None:
                raise
            lean = None
            plan = self._plan_of(number, None)
        begun = progress.begin(None if lean is None else lean.strand.progress)
        return LayerWriter(self._fields[number], self._fresh(number, lean), plan, begun), lean

    def _fresh(self, number: int, lean: Earlier | None) -> Tube:
        """A tube of an isovalue that nothing is told of yet."""
        field, truth = self._fields[number], self._truths[number]
        if lean is None:
            return field_tube(self.header, field, truth, holes=self._holes)
        frame = lean.in_frame_before
        return field_tube(self.header, field, truth, lean.strand.tube, lean.isovalue, self._holes, frame)

    def _plan_of(self, number: int, lean: Earlier | None) -> Sequence[Entry]:
        """What the options come to for one isovalue."""
        o = self.options
        plan = o.plan_for(self.isovalues[number])
        if plan is not None:
            if not len(plan) and number == len(self.isovalues) - 1:
                raise OptionError("the plan has no layers", code="plan", remedy='begin it with ("base", level)')
            field, truth = self._fields[number], self._truths[number]
            return with_meshes(plan, self._full_level, -1 if lean is None else lean.strand.progress.level,
                               lambda: Promise(field, truth=truth, holes=self._holes))
        values: list[Entry] = [(LayerKind.VALUES, None)] if o.exact or o.step is not None else []
        fine = None if values or o.signs_only else o.tolerance or DEFAULT_TOLERANCE
        # crossings of the planes that close an axis have to be the same ones
        free = self.header.profile == Profile.MAIN and not self._periodic and self._slack_keeps_order(fine)
        behind = self._behind_grid(number, [*values, *grid_offsets(fine, free)])
        searched = o.tolerance if o.base_level is None and (o.tolerance or 0) >= SEARCHED else None
        if searched is o.steps is o.criterion is None and not o.preserve_topology:
            return [*strategy.grid_plan(len(self.header.shape), self._full_level, o.base_level), *behind]
        truth = self._truths[number]
        promise = Promise(self._fields[number], lambda: self._fresh(number, lean), free, self._try, truth, self._holes)
        if o.distances is not None:
            return stepwise(promise, o.distances, o.preserve_topology)
        if o.criterion == "distortion" and o.parameter:
            return self._within(promise, values, fine, free)
        if o.criterion is not None:
            mesh: strategy.Plan = strategy.reduced(promise, o.criterion, o.parameter, o.preserve_topology)
            return mesh + values + [(LayerKind.OFFSETS, radix, 0) for radix in radices(fine)]
        if searched is not None:
            return strategy.smallest(promise, searched, o.preserve_topology)
        return [*strategy.whole_mesh(promise, True, o.base_level), *behind]

    def _behind_grid(self, number: int, asked: list[Entry]) -> list[Entry]:
        """What is told of the curve of an isovalue on the full grid, if its signs are not all."""
        return asked

    def _within(self, promise: Promise, values: list[Entry], fine: float | None, free: bool) -> Sequence[Entry]:
        """Layers under the criterion distortion, with crossings told finely enough for it unless it is said how."""
        o = self.options
        distance = o.parameter or 0.0
        told = NO_OFFSETS if fine is None else (0, 0)
        if values:
            told = LINEAR_POINTS, 0
        elif fine is not None:
            fine = fine if o.tolerance else min(fine, FINE_SHARE * distance)
            told = math.prod(radices(fine)), 0
        geometry = values + [(LayerKind.OFFSETS, radix, 0) for radix in radices(fine)]
        grid = [*strategy.whole_mesh(promise, o.preserve_topology), *values, *grid_offsets(fine, free)]
        return strategy.within(promise, distance, o.preserve_topology, geometry, told, grid)

    @property
    def _on_grid(self) -> bool:
        """Whether the options lead to the full grid, and leave open on which way."""
        o = self.options
        searched = (o.tolerance or 0) >= SEARCHED
        return o.plan is o.steps is o.criterion is o.base_level is None and not (searched or o.preserve_topology)

    def _smaller(self, number: int, lean: Earlier, progress: Progress) -> LayerWriter:
        """The layers of an isovalue that leans on one with the full grid: on its leaves, or level by level.

        Both are tried as far as all signs; the smaller one goes on from there.
        """
        grid = strategy.grid_plan(len(self.header.shape), self._full_level, None)
        leaf: list[Entry] = [(LayerKind.LEAF_BASE,)]
        counters = lean.strand.tube.state.counters
        # what inference takes of the limit of steps is not part of the file
        steps = counters.work
        trials = []
        for plan in (leaf, grid):
            counters.work = steps
            begun = progress.begin(lean.strand.progress)
            writer = LayerWriter(self._fields[number], self._fresh(number, lean), plan, begun)
            trials.append((writer, writer.trial(), counters.work))
        # of a series, levels are worth a little: their networks keep learning; geometry likes leaves in order
        least = LEVELS_WORTH if lean.in_frame_before and self.options.signs_only else 1.0
        chosen, _, counters.work = trials[0] if trials[0][1] < least * trials[1][1] else trials[1]
        chosen.go_on(self._plan_of(number, lean)[len(grid) :])
        return chosen

    def _slack_keeps_order(self, tolerance: float | None) -> bool:
        """Whether crossings of several isovalues stay in order if they are told with slack (spec annex G.3).

        First digits do not get past those of the isovalue leaned on. So each isovalue has to lie beyond all before it.
        """
        before = [self.isovalues[:i] for i in range(1, len(self.isovalues))]
        outward = all(not min(b) < v < max(b) for b, v in zip(before, self.isovalues[1:], strict=True))
        return len(self.isovalues) == 1 or (self.options.leaning and outward and len(radices(tolerance)) <= 1)

    def _leans_on(self, number: int) -> Earlier | None:
        """The earlier isovalue that lies nearest."""
        if number == 0 or not self.options.leaning:
            return None
        nearest = nearest_before(self.isovalues, number)
        return Earlier(self._strands[nearest], self.isovalues[nearest], nearest)

    def _pieces(self) -> Iterator[bytes]:
        """The file but for its checksum."""
        yield from self._beginning()
        for number in range(len(self.isovalues)):
            if number > 0:
                strand, lean = self._strand(number, self._strands[-1].progress)
                self._strands.append(strand)
                further = write_further(self.isovalues[number], lean.number if lean else None)
                yield write_chunk(ChunkType.ISOVALUE, further)
            yield from self._layers(self._strands[number], number == len(self.isovalues) - 1)

    def _beginning(self) -> Iterator[bytes]:
        """The header, and what is about the whole file."""
        yield from beginning(self.header, self._metadata)
        if self._coordinates:
            yield write_chunk(ChunkType.COORDINATES, self._coordinates, ancillary=True)
        if self._holes:
            yield write_chunk(ChunkType.MASK, self._mask_run)

    def _layers(self, strand: LayerWriter, last: bool) -> Iterator[bytes]:
        """Chunks of layers of one isovalue; behind the last one the level index."""
        if strand.within:
            promises = write_promises(Promises(strand.within, self.options.preserve_topology))
            yield write_chunk(ChunkType.PROMISES, promises, ancillary=True)
        program = replace(strand.progress.begin(None), lean_level=strand.progress.lean_level)
        done = 0
        while done < len(strand.layers):
            try:
                end, run = strand.encode_run(done, self._done)
            except FormatError as error:
                if all(layer.births for layer in self.layers if layer.kind == LayerKind.ADAPT):
                    raise
                raise OptionError(
                    "an adaptive layer of the plan leaves out new components that there are", code="plan",
                    remedy='("adapt", 1, mesh)',
                ) from error
            payload = write_program(strand.layers[done:end], program, strand.bits) + run
            done = end
            ends = last and done == len(strand.layers)
            index = write_index(self.layers, self.records) if ends else b""
            if len(index) * INDEX_SHARE > sum(s.run_bytes for s in self._strands):
                index = b""
            yield write_chunk(ChunkType.LAYERS, payload, last=ends and not index)
            if index:
                yield write_chunk(ChunkType.INDEX, index, ancillary=True, last=True)

    def _try(self) -> None:
        self._tried += 1
        if self._report:
            self._report(self._tried, 0)

    def _done(self) -> None:
        if self._report:
            waiting = len(self.isovalues) - len(self._strands)
            self._report(len(self.records), len(self.layers) + waiting * len(self._strands[0].layers))
