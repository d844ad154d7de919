"""Encoders of fields on grids: samples in, bytes out layer by layer (spec clauses 3.5.7, 5.11, 8.1)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from isospec.container import ChunkType, Profile

from ..deferred import dataclass
from ..drawing.contour import Contour
from ..drawing.drawing import draw
from ..drawing.snapshot import drawing_bytes, leaves_of
from ..entropy.range_coder import Coder
from ..entropy.run import WritingRun
from ..errors import FormatError, InputError, OptionError
from ..field.labelling import is_of_labels
from ..field.placement import Placement
from ..field.samples import Samples, mask_field
from ..format.chunks import (
    LayerRecord,
    Promises,
    write_chunk,
    write_further,
    write_index,
    write_promises,
    write_turn,
)
from ..format.frames import write_frame, write_interval
from ..format.header import Header
from ..format.kinds import LayerKind
from ..format.program import Layer, Progress
from ..grid.lattice.tables import cube_exponent
from ..grid.layers.layer_writer import RUN_BYTES, LayerWriter, encoded_mask, field_tube
from ..grid.layers.plan import Entry
from ..grid.passes.runner import Tube
from ..grid.tube.holes import Holes
from ..limits import Limits, in_units
from ..search import strategy
from ..search.fences import Fences
from ..search.ground_truth import GroundTruth, truth_of
from ..search.original import original
from ..search.promise import Promise
from ..search.reduced import LINEAR_POINTS
from ..search.shared_sides import SharedSides
from ..search.steps import stepwise
from ..search.tolerance import HALF, NO_OFFSETS, grid_offsets, radices
from .container import ContainerEncoder, beginning
from .options import DEFAULT_TOLERANCE, LEVELS, SEARCHED, Options
from .placing import coordinates_payload
from .plan_file import check_plan
from .plan_meshes import with_meshes
from .series import LeanOn, Series
from .turns import bases, coarse, coarsely, finer

Report = Callable[[int, int], object]
"""Called with the number of layers done and the total; during the search for a mesh, with the curves tried and 0."""

FINE_SHARE = 0.25
"""With the criterion distortion, crossings are stored to within this fraction of its distance, or more precisely."""
LEVELS_WORTH = 0.95
"""A frame begins with the leaves of the one before if that takes less than this fraction of the bytes of levels."""
MOST_IN_TURN = 256
"""Isovalues whose layers come in turn at most: decoders hold the states of all of them at once."""
MOST_SIGNS = 1 << 29
"""They do by default where the encoder holds at most so many signs of samples."""
INDEX_SHARE = 100
"""A layer index is written if it takes at most this fraction of the data."""


@dataclass(frozen=True)
class GridFile:
    """Properties shared by all frames of a file on a grid.

    Attributes
    ----------
    options : Options
    series : Series
    header : Header
    metadata : mapping of str to str
    periodic : tuple of int
        Periodic axes; the fields include the repeated plane of samples that closes each axis.
    gone : (s0, .., sn-1) bool, or None
        Which samples are missing.
    holes : Holes or None
        The missing samples, in the form that decoders have.
    mask, coordinates : bytes
        Payloads of the chunks of mask and coordinates; empty if there is no such chunk.
    geometry : sequence of lists of entries, or None
        Layers behind the full grid, for each isovalue, whatever the options are.
    promised : sequence of float or None, or None
        Distances in cells that the last layers promise, for each isovalue, whatever the options are.
    report : callable or None
    """

    options: Options
    series: Series
    header: Header
    metadata: Mapping[str, str]
    periodic: tuple[int, ...]
    gone: NDArray[np.bool_] | None
    holes: Holes | None
    mask: bytes
    coordinates: bytes
    geometry: Sequence[list[Entry]] | None = None
    promised: Sequence[float | None] | None = None
    report: Report | None = None

    def promise(self, number: int) -> float | None:
        """Distance in cells that the last layer of an isovalue promises; None if none, or if the plan has promises."""
        if self.promised is not None:
            return self.promised[number]
        # under a criterion the mesh keeps to another distance, or to none
        return self.options.precision.tolerance if self.options.layers.criterion is None else None

    @cached_property
    def sides(self) -> SharedSides | None:
        """Both ends of periodic axes, which are described alike; None without such axes."""
        return SharedSides.of_axes(self.header.shape, self.periodic) if self.periodic else None

    @property
    def full_level(self) -> int:
        """Level of the full grid."""
        return len(self.header.shape) * cube_exponent(self.header.shape)

    def beginning(self) -> Iterator[bytes]:
        """Write the header, and the chunks that concern the whole file."""
        yield from beginning(self.header, self.metadata)
        if self.coordinates:
            yield write_chunk(ChunkType.COORDINATES, self.coordinates, ancillary=True)
        if self.holes:
            yield write_chunk(ChunkType.MASK, self.mask)
        if self.series.interval is not None:
            yield write_chunk(ChunkType.SERIES, write_interval(self.series.interval))


def grid_file(
    fields: Sequence[Samples], series: Series, options: Options, placement: Placement | None = None,
    geometry: Sequence[list[Entry]] | None = None, promised: Sequence[float | None] | None = None,
    report: Report | None = None,
) -> GridFile:
    """Check the options of a file on a grid against its first frame, and code what concerns all frames.

    Parameters
    ----------
    fields : sequence of Samples
        The first frame at each isovalue, periodic axes closed.
    series : Series
    options : Options
    placement : Placement, optional
    geometry, promised, report
        As of `GridFile`.

    Raises
    ------
    InputError, OptionError
    """
    first = fields[0]
    shape, gone = first.signs.shape, first.gone
    periodic = () if placement is None else placement.periodic
    if periodic and options.layers.keeps_open(shape):
        raise OptionError(
            "periodic axes and this plan cannot be combined: its last mesh could differ at the two ends of the axis",
            code="periodic", remedy="end the plan on the full grid, on a mesh by criteria, or on a uniform one of a "
            f"level that is a multiple of {len(shape)}",
        )
    options.check_data(first.integer)
    radices(options.precision.offsets)
    options.check_placement_note(len(shape))
    if options.layers.written:
        plans = options.layers.plans or options.layers.plan
        assert plans is not None
        level = len(shape) * cube_exponent(shape)
        check_plan(plans, series.isovalues, level, not options.independent)
    notes = dict(options.metadata)
    if placement is not None:
        notes = {**notes, **{key: text for key, text in placement.notes().items() if key not in notes}}
    coordinates = coordinates_payload(placement, shape, gone)
    header = Header(shape, first.isovalue, options.precision.step, options.entropy)
    run, holes = b"", None
    if gone is not None:
        missing = mask_field(gone)
        run, holes = encoded_mask(header, missing, truth_of(missing))
    return GridFile(
        options, series, header, notes, periodic, gone, holes, run, coordinates, geometry, promised, report
    )


class GridFrame:
    """Encodes the isovalues of a frame one after the other; `chunks`, to be called once, yields the bytes.

    Parameters
    ----------
    file : GridFile
        Its series is at this frame.
    fields : sequence of Samples
        The frame at each isovalue.
    before : sequence of LayerWriter
        Isovalues of the previous frame; empty if this is a key frame.

    Attributes
    ----------
    strands : list of LayerWriter
        Isovalues that have begun; initially the first one.
    """

    def __init__(self, file: GridFile, fields: Sequence[Samples], before: Sequence[LayerWriter] = ()) -> None:
        self.file = file
        self._fields = fields
        self._known: tuple[int, GroundTruth] | None = None
        self._before = before
        self._tried = self._encoded = self._announced = 0
        self._keeps_order = _is_outward(file.series.isovalues)
        n = len(file.header.shape)
        self._level = strategy.base_of(n, file.full_level)
        self._coarse = coarse(self._level, file.full_level, n)
        self._bases = bases([field.signs for field in fields], self._level, file.full_level) if self._by_levels else []
        self._plans: list[tuple[Sequence[Entry], LeanOn | None]] = []
        self._originals: dict[int, Contour] = {}
        self._drawn: dict[int, Contour] = {}
        self._on_full: set[int] = set()
        self._halfway = True
        self.strands: list[LayerWriter] = []
        self._lean = self._begin(Progress(file.full_level))

    @property
    def layers(self) -> list[Layer]:
        """Layers known so far, of all isovalues."""
        return [layer for strand in self.strands for layer in strand.layers]

    @property
    def records(self) -> list[LayerRecord]:
        """Sizes of the finished layers."""
        return [record for strand in self.strands for record in strand.records]

    def chunks(self) -> Iterator[bytes]:
        """Yield the chunks of all isovalues; in a file without frames, the last chunk is marked as such."""
        if self._by_levels:
            yield from self._in_turn()
        elif self._fenced:
            yield from self._uncrossed()
        else:
            yield from self._in_order()

    def _in_order(self) -> Iterator[bytes]:
        """Yield the chunks of one isovalue after the other."""
        series = self.file.series
        count, key = len(series.isovalues), series.is_key(series.frame)
        for number, isovalue in enumerate(series.isovalues):
            if number > 0:
                self._lean = self._begin(self.strands[-1].progress)
            lean = None if self._lean is None else self._lean.coded
            if series.frame > 0:
                yield write_chunk(ChunkType.FRAME, write_frame(number, lean, key))
            elif number > 0:
                yield write_chunk(ChunkType.ISOVALUE, write_further(number, isovalue, lean))
            yield from self._layers(number, series.interval is None and number == count - 1)
            if self._fenced:
                leaves = leaves_of(self.strands[number].tube, isovalue, lambda number, above: number)
                self._drawn[number] = draw(leaves, measured=True)
            if number < count - 1:
                self.strands[number].rest()
        _warn_of_memory([strand.tube for strand in self.strands])

    @cached_property
    def _fenced(self) -> bool:
        """Whether curves of several isovalues that are near one another must not cross."""
        file, o = self.file, self.file.options
        single = len(file.series.isovalues) == 1 or file.series.interval is not None or is_of_labels(file.metadata)
        searched = o.layers.default and o.precision.steps is None and o.searched is not None
        return searched and not single and file.header.n == 2

    def _uncrossed(self) -> Iterator[bytes]:
        """Yield the chunks of all isovalues, made anew until no two curves cross.

        Those that cross nevertheless are coded on the full grid, all to the same parts of edges, half-way if that will
        do: they can touch there, but not cross.
        """
        while True:
            made = list(self._in_order())
            crossing = self._crossing()
            more = crossing - self._on_full
            if crossing and not more and self._halfway:
                more, self._halfway = set(self._on_full), False
            if not more:
                yield from made
                return
            self._on_full |= more
            del self._plans[min(more) :]
            self.strands.clear()
            self.file.series.forget_frame()
            self._encoded = self._announced = 0
            self._lean = self._begin(Progress(self.file.full_level))

    def _crossing(self) -> set[int]:
        """Find the isovalues whose curve crosses that of the next one in size."""
        sizes, found = self.file.series.isovalues, set()
        for one, other in pairwise(sorted(self._drawn, key=lambda number: sizes[number])):
            if len(Fences(sizes[other], [self._drawn[one]], []).coded_crossed(self._drawn[other])):
                found |= {one, other}
        return found

    def _fences(self, number: int) -> Fences:
        """The curves next to that of an isovalue, coded ones and others."""
        sizes = self.file.series.isovalues
        rank = sorted(range(len(sizes)), key=lambda one: sizes[one])
        place = rank.index(number)
        coded, waiting = [], []
        for side in (rank[:place][::-1], rank[place + 1 :]):
            coded += [self._drawn[one] for one in side if one < number][:1]
            waiting += [self._original(one) for one in side[:1] if one > number]
        return Fences(sizes[number], coded, waiting)

    def _original(self, number: int) -> Contour:
        """The original curve of an isovalue."""
        if number not in self._originals:
            self._originals[number] = original(self._fields[number])
        return self._originals[number]

    @cached_property
    def _by_levels(self) -> bool:
        """Whether layers of all isovalues come in turn, coarse ones first."""
        o, series = self.file.options, self.file.series
        count, samples = len(series.isovalues), math.prod(self.file.header.shape)
        possible = 1 < count <= MOST_IN_TURN and series.interval is None and self._on_grid and not o.independent
        if o.order == LEVELS and not possible:
            raise OptionError(
                f"the order levels is for 2 to {MOST_IN_TURN} isovalues of one field on the mesh of the grid, "
                "predicted from one another", code="order", remedy="leave it out",
            )
        # values give most signs of the next isovalue, which comes cheaper after them
        kept = any(entry[0] == LayerKind.VALUES for plan in self.file.geometry or () for entry in plan)
        apart = o.precision.exact or o.precision.step is not None or kept or count * samples > MOST_SIGNS
        return possible and (o.order == LEVELS or (o.order is None and not apart))

    def _in_turn(self) -> Iterator[bytes]:
        """Yield the chunks of all isovalues: signs level by level, then what places the crossings."""
        file, series, count = self.file, self.file.series, len(self.file.series.isovalues)
        for number, isovalue in enumerate(series.isovalues):
            self._lean = self._begin(self.strands[-1].progress) if number else self._lean
            if number:
                lean = None if self._lean is None else self._lean.coded
                yield write_chunk(ChunkType.ISOVALUE, write_further(number, isovalue, lean))
            strand = self.strands[number]
            if promise := file.promise(number):
                promises = write_promises(Promises({len(strand.layers): promise}, False))
                yield write_chunk(ChunkType.PROMISES, promises, ancillary=True)
        turn = range(count - 1, count)
        steps = self._steps()
        for i, (now, target) in enumerate(steps):
            if now != turn:
                yield write_chunk(ChunkType.TURN, write_turn(now))
            turn = now
            yield from self._turn(now, target, i == len(steps) - 1)
        _warn_of_memory([strand.tube for strand in self.strands])

    def _steps(self) -> list[tuple[range, int | None]]:
        """List the turns: numbers of isovalues, and the level up to which their signs come, or None for all layers."""
        full, count = self.file.full_level, len(self.strands)
        turns: list[tuple[range, int | None]] = [
            *coarsely(self._bases, self._coarse), *finer(self._bases, self._coarse, full)
        ]
        if self.strands[0].has_values:
            # values give most signs of the next isovalue
            return [*coarsely(self._bases, self._coarse), *((range(i, i + 1), None) for i in range(count))]
        signs = [strand.to_level(full) for strand in self.strands]
        left = [strand.planned - there for strand, there in zip(self.strands, signs, strict=True)]
        behind = {tuple(strand.layers[there:]) for strand, there in zip(self.strands, signs, strict=True)}
        if set(left) == {1} and len(behind) == 1 and behind != {()}:
            return [*turns, (range(count), None)]
        return turns + [(range(i, i + 1), None) for i in range(count) if left[i]]

    def _turn(self, turn: range, target: int | None, last: bool) -> Iterator[bytes]:
        """Yield chunks of layers of some isovalues: up to a level, or all that are left."""
        strands = [self.strands[number] for number in turn]
        first = strands[0]
        while (done := len(first.records)) < first.to_level(target):
            run, begun = WritingRun(first.tube.coder), 0
            while len(first.records) < first.to_level(target) and begun < RUN_BYTES:
                for number, strand in zip(turn, strands, strict=True):
                    if not strand.records and (lean := self.file.series.lean(number)) is not None:
                        # what it is predicted from may have a base by now; the models are shared
                        strand.tube = self._fresh(number, lean, strand.tube.coder)
                    begun = strand.encode_layer(run, len(strand.records), begun)
                    self._done()
            data, count = run.end(), len(first.records) - done
            programs = [strand.program(len(strand.records) - count, len(strand.records)) for strand in strands]
            ends = last and len(first.records) == first.to_level(target)
            yield write_chunk(ChunkType.LAYERS, programs[0] + data, last=ends)

    def part(self) -> list[LayerWriter]:
        """Keep what the next frame is predicted from, once all chunks are made."""
        self.strands[-1].rest()
        self._before, self._fields, self._known = (), (), None
        return self.strands

    def _begin(self, progress: Progress) -> LeanOn | None:
        """Prepare the next isovalue for encoding; returns what it is predicted from."""
        series = self.file.series
        number = len(self.strands)
        if self.strands:
            self._encoded += len(self.strands[-1].records)
            self._announced += len(self.strands[-1].layers)
        lean = series.choose(number, self.file.options.independent)
        strand, lean = self._strand(number, lean, progress)
        series.add(lean)
        self.strands.append(strand)
        return lean

    def _leant_on(self, lean: LeanOn) -> LayerWriter:
        """The layers of an earlier isovalue."""
        return (self._before if lean.before else self.strands)[lean.number]

    def _strand(self, number: int, lean: LeanOn | None, progress: Progress) -> tuple[LayerWriter, LeanOn | None]:
        """Prepare the layers of an isovalue; returns them, and the isovalue that it is predicted from."""
        if lean is not None and self._leant_on(lean).tube.full and self._on_grid:
            return self._smaller(number, lean, progress), lean
        if number < len(self._plans):
            plan, lean = self._plans[number]
        else:
            try:
                plan = self._plan_of(number, lean)
            except strategy.NotKeptError:
                if lean is None:
                    raise
                plan = self._plan_of(number, None)
                lean = lean if number in self._on_full else None
            self._plans.append((plan, lean))
        begun = progress.begin(None if lean is None else self._leant_on(lean).progress)
        return LayerWriter(self._fields[number], self._fresh(number, lean), plan, begun), lean

    def _truth(self, number: int) -> GroundTruth:
        """Ground truth of an isovalue; only the last one asked for is kept."""
        if self._known is None or self._known[0] != number:
            self._known = number, truth_of(self._fields[number])
        return self._known[1]

    def _fresh(self, number: int, lean: LeanOn | None, coder: Coder | None = None) -> Tube:
        """Make the tube of an isovalue before its first layer."""
        field, truth, file = self._fields[number], self._truth(number), self.file
        if lean is None:
            return field_tube(file.header, field, truth, holes=file.holes)
        tube, isovalue = self._leant_on(lean).tube, file.series.isovalues[lean.number]
        return field_tube(file.header, field, truth, tube, isovalue, file.holes, lean.before, coder)

    def _plan_of(self, number: int, lean: LeanOn | None) -> Sequence[Entry]:
        """Make the plan for one isovalue from the options."""
        file, o = self.file, self.file.options
        precision, level = o.precision, o.layers.level
        plan = o.layers.plan_for(file.series.isovalues[number])
        if plan is not None:
            return self._planned(plan, number, lean)
        values: list[Entry] = [(LayerKind.VALUES, None)] if precision.exact or precision.step is not None else []
        fine = None if values or precision.signs else precision.offsets or DEFAULT_TOLERANCE
        # smoothed crossings lie in their parts
        free = o.entropy == Profile.MAIN and not precision.smooth and self._slack_keeps_order(fine)
        offsets = grid_offsets(fine, free and not file.periodic)
        behind = [*values, *offsets] if file.geometry is None else file.geometry[number]
        searched = self._searched if level is None else None
        if searched is precision.steps is o.layers.criterion is None and not o.keep_topology:
            level = self._bases[number] if self._bases else level
            return [*strategy.grid_plan(len(file.header.shape), file.full_level, level), *behind]
        truth = self._truth(number)
        promise = Promise(self._fields[number], lambda: self._fresh(number, lean), free, self._try, truth, file.holes,
                          sides=file.sides, leans=lean is not None)
        if self._fenced:
            return self._beside_others(promise, number, lean)
        if precision.steps is not None:
            return stepwise(promise, precision.steps, o.keep_topology)
        criterion, parameter = o.layers.criterion, o.layers.parameter
        if criterion == "distortion" and parameter:
            return self._within(promise, parameter, values, fine, free)
        if criterion is not None:
            mesh: strategy.Plan = strategy.reduced(promise, criterion, parameter, o.keep_topology)
            return mesh + values + [(LayerKind.OFFSETS, radix, 0) for radix in radices(fine)]
        if searched is not None:
            return strategy.smallest(promise, searched, o.keep_topology)
        return [*strategy.whole_mesh(promise, True, level), *behind]

    def _beside_others(self, promise: Promise, number: int, lean: LeanOn | None) -> Sequence[Entry]:
        """Make the plan for an isovalue whose curve must not cross those next to it."""
        o = self.file.options
        assert o.searched is not None
        if number not in self._on_full:
            promise.fences = self._fences(number)
            try:
                return strategy.smallest(promise, o.searched, o.keep_topology)
            except strategy.NotKeptError:
                if lean is not None:
                    # without prediction first
                    raise
                self._on_full.add(number)
        grid = strategy.whole_mesh(promise, o.keep_topology)
        if self._halfway and not len(promise.excess(promise.trial(grid)[1], o.searched)):
            return grid
        return [*grid, *grid_offsets(o.searched, False)]

    def _planned(self, plan: Sequence[Entry], number: int, lean: LeanOn | None) -> Sequence[Entry]:
        """Replace criteria in a given plan by meshes."""
        file = self.file
        if not len(plan) and number == len(file.series.isovalues) - 1:
            raise OptionError("the plan has no layers", code="plan", remedy='begin it with ("base", level)')
        field, truth = self._fields[number], self._truth(number)
        level = -1 if lean is None else self._leant_on(lean).progress.level
        return with_meshes(plan, file.full_level, level, lambda: Promise(
            field, lambda: self._fresh(number, lean), False, self._try, truth, file.holes,
            sides=file.sides, leans=lean is not None, lean_level=level,
        ))

    def _within(
        self, promise: Promise, distance: float, values: list[Entry], fine: float | None, free: bool
    ) -> Sequence[Entry]:
        """Make layers for the criterion distortion; crossings are precise enough unless the precision is given."""
        o = self.file.options
        told = NO_OFFSETS if fine is None else (0, 0)
        if values:
            told = LINEAR_POINTS, 0
        elif fine is not None:
            fine = fine if o.precision.tolerance else min(fine, FINE_SHARE * distance)
            told = math.prod(radices(fine)), 0
        geometry = values + [(LayerKind.OFFSETS, radix, 0) for radix in radices(fine)]
        grid = [*strategy.whole_mesh(promise, o.keep_topology), *values, *grid_offsets(fine, free, promise.fixed)]
        return strategy.within(promise, distance, o.keep_topology, geometry, told, grid)

    @property
    def _on_grid(self) -> bool:
        """Whether the options lead to the full grid without fixing the layers in between."""
        o = self.file.options
        return o.layers.default and o.precision.steps is self._searched is None and not o.keep_topology

    @cached_property
    def _searched(self) -> float | None:
        """The tolerance, if a plan is searched for: also for single smooth surfaces, which slack at a slant suits."""
        o, tolerance = self.file.options, self.file.options.precision.tolerance
        slack = tolerance is not None and SEARCHED <= tolerance < HALF and not o.precision.smooth
        slanted = slack and len(self._fields) == 1 and o.entropy == Profile.MAIN and not self.file.periodic
        return tolerance if slanted and strategy.is_smooth(self._fields[0].signs) else o.searched

    def _smaller(self, number: int, lean: LeanOn, progress: Progress) -> LayerWriter:
        """Make layers for an isovalue predicted from one on the full grid: on its leaves, or level by level.

        Both are tried until all signs are coded; the smaller one is then continued.
        """
        file, leant_on = self.file, self._leant_on(lean)
        grid = strategy.grid_plan(len(file.header.shape), file.full_level, None)
        leaf: list[Entry] = [(LayerKind.LEAF_BASE,)]
        counters = leant_on.tube.state.counters
        # the steps that inference counts towards the limit are not part of the file
        steps = counters.work
        trials = []
        for plan in (leaf, grid):
            counters.work = steps
            begun = progress.begin(leant_on.progress)
            writer = LayerWriter(self._fields[number], self._fresh(number, lean), plan, begun)
            trials.append((writer, writer.trial(), counters.work))
        # in a series, levels have some advantage, since their networks keep learning; geometry prefers ordered leaves
        least = LEVELS_WORTH if lean.before and file.options.precision.signs else 1.0
        chosen, _, counters.work = trials[0] if trials[0][1] < least * trials[1][1] else trials[1]
        chosen.go_on(self._plan_of(number, lean)[len(grid) :])
        return chosen

    def _slack_keeps_order(self, tolerance: float | None) -> bool:
        """Whether the crossings of several isovalues stay in order if they are coded with slack (spec annex G.3).

        First digits cannot pass those of the isovalue that is used for prediction, so each isovalue must lie beyond all
        earlier ones.
        """
        return len(self.file.series.isovalues) == 1 or (
            not self.file.options.independent and self._keeps_order and len(radices(tolerance)) <= 1
        )

    def _layers(self, number: int, last: bool) -> Iterator[bytes]:
        """Chunks of layers of one isovalue; behind the last one the layer index."""
        strand = self.strands[number]
        if promise := self.file.promise(number):
            strand.within[len(strand.layers)] = promise
        if strand.within:
            promises = write_promises(Promises(strand.within, self.file.options.keep_topology))
            yield write_chunk(ChunkType.PROMISES, promises, ancillary=True)
        done = 0
        while done < len(strand.layers):
            try:
                end, run = strand.encode_run(done, self._done)
            except FormatError as error:
                if all(layer.births for layer in self.layers if layer.kind == LayerKind.ADAPT):
                    raise
                raise OptionError(
                    "an adaptive layer of the plan omits new components of the field", code="plan",
                    remedy='("adapt", 1, mesh)',
                ) from error
            payload = strand.program(done, end) + run
            done = end
            ends = last and done == len(strand.layers)
            index = write_index(self.layers, self.records) if ends else b""
            if ends and len(index) * INDEX_SHARE > sum(s.run_bytes for s in self.strands):
                index = b""
            yield write_chunk(ChunkType.LAYERS, payload, last=ends and not index)
            if index:
                yield write_chunk(ChunkType.INDEX, index, ancillary=True, last=True)

    def _try(self) -> None:
        self._tried += 1
        if self.file.report:
            self.file.report(self._tried, 0)

    def _done(self) -> None:
        if self.file.report:
            if self._by_levels:
                self.file.report(len(self.records), sum(strand.planned for strand in self.strands))
                return
            waiting, last = len(self.file.series.isovalues) - len(self.strands), self.strands[-1]
            self.file.report(
                self._encoded + len(last.records),
                self._announced + len(last.layers) + waiting * len(self.strands[0].layers),
            )


def _is_outward(isovalues: Sequence[float]) -> bool:
    """Whether each isovalue lies beyond all earlier ones."""
    low = high = isovalues[0]
    for value in isovalues[1:]:
        if low < value < high:
            return False
        low, high = min(low, value), max(high, value)
    return True


def _warn_of_memory(tubes: Sequence[Tube]) -> None:
    """Warn if decoding the isovalues of a frame takes more memory than decoders have by default."""
    before, most = 0, 0
    for tube in tubes:
        held = tube.budget.held
        most = max(most, before + max(tube.budget.peak, held + drawing_bytes(tube)))
        before += held
    if most > Limits().memory:
        warnings.warn(
            f"decoding needs about {in_units(most)} of memory, more than the default limit of "
            f"{in_units(Limits().memory)}: decode with --limits memory=.. (Limits.memory), or encode in tiles",
            stacklevel=2,
        )


class GridEncoder(ContainerEncoder):
    """Encodes isocontours of a field; iterating, which is possible once, yields the bytes of the file chunk by chunk.

    Parameters
    ----------
    file : GridFile
    fields : sequence of Samples
        The field at each isovalue, periodic axes closed.
    """

    def __init__(self, file: GridFile, fields: Sequence[Samples]) -> None:
        self.header = file.header
        self.isovalues = file.series.isovalues
        self.frame = GridFrame(file, fields)

    def _pieces(self) -> Iterator[bytes]:
        """Yield the pieces of the file without its checksum."""
        yield from self.frame.file.beginning()
        yield from self.frame.chunks()


class GridFrames:
    """Encodes the frames of a series as they come; at most two of them are in memory.

    Parameters
    ----------
    file : GridFile
    """

    def __init__(self, file: GridFile) -> None:
        self.file = file
        self._before: list[LayerWriter] = []

    def chunks(self, fields: Sequence[Samples]) -> list[bytes]:
        """Return the chunks of a frame, the first with the header; if an error is raised, earlier frames are kept.

        Raises
        ------
        InputError
            If the missing samples differ from those of the first frame.
        """
        file, series = self.file, self.file.series
        if not _same(fields[0].gone, file.gone):
            raise InputError(
                "the missing samples differ from those of the first frame", code="frames",
                remedy="fill the missing samples, or give one mask for all frames",
            )
        if series.number >= 0:
            series.next_frame()
        try:
            frame = GridFrame(file, fields, [] if series.is_key(series.frame) else self._before)
            out = [*(file.beginning() if series.frame == 0 else ()), *frame.chunks()]
        except BaseException:
            series.forget_frame()
            raise
        self._before = frame.part()
        return out


def _same(a: NDArray[np.bool_] | None, b: NDArray[np.bool_] | None) -> bool:
    """Whether the same samples are missing in both."""
    if a is None or b is None:
        return a is b
    return bool((a == b).all())
