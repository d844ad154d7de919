"""Encoders of fields on grids: samples in, bytes out layer by layer (spec clauses 3.5.7, 5.11, 8.1).

A frame is encoded in one of three orders: one isovalue after the other, all level by level, or one after the
other until no two curves cross.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import pairwise
from typing import NamedTuple

from isospec.container import ChunkType

from ..drawing.contour import Contour
from ..drawing.drawing import draw
from ..drawing.snapshot import drawing_bytes, leaves_of
from ..entropy.range_coder import Coder
from ..entropy.run import WritingRun
from ..errors import FormatError, InputError, OptionError
from ..field.labelling import is_of_labels
from ..field.samples import Samples
from ..format.chunks import LayerRecord, Promises, write_chunk, write_index, write_promises, write_turn
from ..format.frames import FRAME_BEFORE
from ..format.kinds import LayerKind
from ..format.program import Layer, Progress
from ..grid.layers.layer_writer import RUN_BYTES, LayerWriter, field_tube
from ..grid.layers.plan import Entry
from ..grid.passes.runner import Tube
from ..limits import Limits, in_units
from ..search import strategy
from ..search.fences import Fences
from ..search.ground_truth import GroundTruth, truth_of
from ..search.original import original
from ..search.promise import Promise
from ..search.tolerance import grid_offsets
from .container import ContainerEncoder
from .decoder import Decoder
from .grid_file import GridFile
from .interleaving import bases, coarse, coarsely, finer
from .layer_plans import plan_of
from .options import BEST, LEVELS

LEVELS_WORTH = 0.95
"""A frame begins with the leaves of the one before if that takes less than this fraction of the bytes of levels."""
MOST_IN_TURN = 256
"""Most isovalues whose layers come in turn: decoders hold the states of all at once."""
MOST_SIGNS = 1 << 29
"""They do by default if the encoder holds at most this number of signs of samples."""
INDEX_SHARE = 100
"""A layer index is written if it takes at most this fraction of the data."""


class Leant(NamedTuple):
    """An isovalue of the previous frame: its decoded state, and the position in its program."""

    tube: Tube
    progress: Progress


class GridFrame:
    """Encodes the isovalues of a frame one after the other; `chunks`, to be called once, yields the bytes.

    Parameters
    ----------
    file : GridFile
        Its series is at this frame.
    fields : sequence of Samples
        The frame at each isovalue.
    before : sequence of Leant
        Isovalues of the previous frame; empty if this is a key frame.

    Attributes
    ----------
    strands : list of LayerWriter
        Isovalues that have begun; initially the first one.
    """

    def __init__(self, file: GridFile, fields: Sequence[Samples], before: Sequence[Leant] = ()) -> None:
        self.file = file
        self._fields = fields
        self._known: tuple[int, GroundTruth] | None = None
        self._before = before
        self._tried = self._done = self._announced = 0
        self.strands: list[LayerWriter] = []
        self._begin()

    @property
    def layers(self) -> list[Layer]:
        """Layers known so far, of all isovalues."""
        return [layer for strand in self.strands for layer in strand.layers]

    @property
    def records(self) -> list[LayerRecord]:
        """Sizes of the finished layers."""
        return [record for strand in self.strands for record in strand.records]

    def chunks(self) -> Iterator[bytes]:
        """Yield the chunks of all isovalues."""
        series, last = self.file.series, len(self.file.series.isovalues) - 1
        for number in range(last + 1):
            if number:
                self._begin()
            yield from series.opening(number)
            yield from self._layers(number)
            if number < last:
                self.strands[number].rest()
        if series.interval is None:
            index = write_index(self.layers, self.records)
            if index and len(index) * INDEX_SHARE <= sum(strand.run_bytes for strand in self.strands):
                yield write_chunk(ChunkType.INDEX, index, ancillary=True)
        _warn_of_memory([strand.tube for strand in self.strands])

    def part(self) -> list[Leant]:
        """Keep what the next frame is predicted from, once all chunks are made."""
        self.strands[-1].rest()
        self._before, self._fields, self._known = (), (), None
        return [Leant(strand.tube, strand.progress) for strand in self.strands]

    def _begin(self) -> None:
        """Prepare the next isovalue for encoding."""
        number, leans = len(self.strands), self.file.series.leans
        progress = Progress(self.file.full_level)
        if number:
            progress = self.strands[-1].progress
            self._announced += self.strands[-1].planned
        strand, lean = self._strand(number, self.file.series.choose(number), progress)
        leans[number:] = [lean]
        self.strands.append(strand)

    def _leant_on(self, number: int, lean: int) -> LayerWriter | Leant:
        """The layers that an isovalue is predicted from."""
        return self._before[number] if lean == FRAME_BEFORE else self.strands[lean]

    def _strand(self, number: int, lean: int | None, progress: Progress) -> tuple[LayerWriter, int | None]:
        """Prepare the layers of an isovalue; returns them, and what it is predicted from."""
        if lean is not None and self.file.on_grid and self._leant_on(number, lean).tube.full:
            return self._smaller(number, lean, progress), lean
        plan, lean = self._planned(number, lean)
        begun = progress.begin(None if lean is None else self._leant_on(number, lean).progress)
        return LayerWriter(self._fields[number], self._fresh(number, lean), plan, begun), lean

    def _planned(self, number: int, lean: int | None) -> tuple[Sequence[Entry], int | None]:
        """Make the plan of an isovalue; without prediction, if that keeps it from what is asked for."""
        try:
            return self._plan_of(number, lean), lean
        except strategy.NotKeptError:
            if lean is None:
                raise
            return self._plan_of(number, None), None

    def _plan_of(self, number: int, lean: int | None) -> Sequence[Entry]:
        """Make the plan of an isovalue that is predicted from another one."""
        return plan_of(self.file, number, self._lean_level(number, lean), lambda: self._promise(number, lean))

    def _lean_level(self, number: int, lean: int | None) -> int:
        return -1 if lean is None else self._leant_on(number, lean).progress.level

    def _promise(self, number: int, lean: int | None) -> Promise:
        """The original curve of an isovalue, and trial encodings."""
        file = self.file
        return Promise(
            self._fields[number], lambda: self._fresh(number, lean), file.free and not file.options.layers.planned,
            self._try, self._truth(number), file.holes, sides=file.sides, leans=lean is not None,
            lean_level=self._lean_level(number, lean),
        )

    def _truth(self, number: int) -> GroundTruth:
        """Ground truth of an isovalue; only the last one asked for is kept."""
        if self._known is None or self._known[0] != number:
            self._known = number, truth_of(self._fields[number])
        return self._known[1]

    def _fresh(self, number: int, lean: int | None, coder: Coder | None = None) -> Tube:
        """Make the tube of an isovalue before its first layer."""
        field, truth, file = self._fields[number], self._truth(number), self.file
        if lean is None:
            return field_tube(file.header, field, truth, holes=file.holes)
        before = lean == FRAME_BEFORE
        return field_tube(
            file.header, field, truth, self._leant_on(number, lean).tube,
            file.series.isovalues[number if before else lean], file.holes, before, coder,
        )

    def _smaller(self, number: int, lean: int, progress: Progress) -> LayerWriter:
        """Make layers for an isovalue predicted from one on the full grid: on its leaves, or level by level.

        Both are tried until all signs are coded; the smaller one is then continued.
        """
        file, leant_on = self.file, self._leant_on(number, lean)
        grid = strategy.grid_plan(file.header.n, file.full_level, None)
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
        least = LEVELS_WORTH if lean == FRAME_BEFORE and file.options.precision.signs else 1.0
        chosen, _, counters.work = trials[0] if trials[0][1] < least * trials[1][1] else trials[1]
        chosen.go_on(self._plan_of(number, lean)[len(grid) :])
        return chosen

    def _promises(self, number: int) -> Iterator[bytes]:
        """Yield the chunk with the promises of an isovalue, if there are any."""
        strand = self.strands[number]
        if promise := self.file.promised[number]:
            strand.within[len(strand.layers)] = promise
        if strand.within:
            promises = write_promises(Promises(strand.within, self.file.options.keep_topology))
            yield write_chunk(ChunkType.PROMISES, promises, ancillary=True)

    def _layers(self, number: int) -> Iterator[bytes]:
        """Yield the chunks of layers of one isovalue."""
        strand = self.strands[number]
        yield from self._promises(number)
        done = 0
        while done < len(strand.layers):
            try:
                end, run = strand.encode_run(done, self._report)
            except FormatError as error:
                if all(layer.births for layer in self.layers if layer.kind == LayerKind.ADAPT):
                    raise
                raise OptionError(
                    "an adaptive layer of the plan omits new components of the field", code="plan",
                    remedy='("adapt", 1, mesh)',
                ) from error
            yield write_chunk(ChunkType.LAYERS, strand.program(done, end) + run)
            done = end

    def _try(self) -> None:
        """Report that a curve has been tried."""
        self._tried += 1
        if self.file.report:
            self.file.report(self._tried, 0)

    def _report(self) -> None:
        """Report that a layer is done."""
        self._done += 1
        if self.file.report:
            self.file.report(self._done, self._total())

    def _total(self) -> int:
        """Layers of the frame that are known; isovalues to come have as many as the first."""
        waiting = len(self.file.series.isovalues) - len(self.strands)
        return self._announced + self.strands[-1].planned + waiting * self.strands[0].planned


class _ByLevels(GridFrame):
    """Encodes layers of all isovalues in turn, coarse ones first: signs level by level, then what places crossings."""

    def __init__(self, file: GridFile, fields: Sequence[Samples]) -> None:
        n, full = file.header.n, file.full_level
        level = strategy.base_of(n, full)
        self._coarse, self._bases = coarse(level, full, n), bases([field.signs for field in fields], level, full)
        super().__init__(file, fields)

    def chunks(self) -> Iterator[bytes]:
        """See `GridFrame.chunks`."""
        series, count = self.file.series, len(self.file.series.isovalues)
        for number in range(count):
            if number:
                self._begin()
            yield from series.opening(number)
            yield from self._promises(number)
        turn = range(count - 1, count)
        for now, target in self._steps():
            if now != turn:
                yield write_chunk(ChunkType.TURN, write_turn(now))
            turn = now
            yield from self._turn(now, target)
        _warn_of_memory([strand.tube for strand in self.strands])

    def _plan_of(self, number: int, lean: int | None) -> Sequence[Entry]:
        return plan_of(self.file, number, -1, lambda: self._promise(number, lean), self._bases[number])

    def _steps(self) -> list[tuple[range, int | None]]:
        """List the turns: numbers of isovalues, and the level up to which their signs come, or None for all layers."""
        full, count = self.file.full_level, len(self.strands)
        first = [*coarsely(self._bases, self._coarse)]
        each: list[tuple[range, int | None]] = [(range(i, i + 1), None) for i in range(count)]
        if self.strands[0].has_values:
            # values give most signs of the next isovalue
            return [*first, *each]
        signs = [strand.to_level(full) for strand in self.strands]
        left = [strand.planned - there for strand, there in zip(self.strands, signs, strict=True)]
        behind = {tuple(strand.layers[there:]) for strand, there in zip(self.strands, signs, strict=True)}
        if set(left) == {1} and len(behind) == 1 and behind != {()}:
            each = [(range(count), None)]
        else:
            each = [one for one, some in zip(each, left, strict=True) if some]
        return [*first, *finer(self._bases, self._coarse, full), *each]

    def _turn(self, turn: range, target: int | None) -> Iterator[bytes]:
        """Yield chunks of layers of some isovalues: up to a level, or all that are left."""
        strands = [self.strands[number] for number in turn]
        first = strands[0]
        while (done := len(first.records)) < first.to_level(target):
            run, begun = WritingRun(first.tube.coder), 0
            while len(first.records) < first.to_level(target) and begun < RUN_BYTES:
                for number, strand in zip(turn, strands, strict=True):
                    lean = self.file.series.leans[number]
                    if not strand.records and lean is not None:
                        # what it is predicted from may have a base by now; the models are shared
                        strand.tube = self._fresh(number, lean, strand.tube.coder)
                    begun = strand.encode_layer(run, len(strand.records), begun)
                    self._report()
            data, count = run.end(), len(first.records) - done
            programs = [strand.program(len(strand.records) - count, len(strand.records)) for strand in strands]
            yield write_chunk(ChunkType.LAYERS, programs[0] + data)

    def _total(self) -> int:
        return sum(strand.planned for strand in self.strands)


class _Uncrossed(GridFrame):
    """Encodes curves that are near one another anew until no two cross.

    Those that cross nevertheless are coded on the full grid, all to the same parts of edges, half-way if that will do:
    they can touch there, but not cross.
    """

    def __init__(self, file: GridFile, fields: Sequence[Samples]) -> None:
        self._plans: list[tuple[Sequence[Entry], int | None]] = []
        self._drawn: dict[int, Contour] = {}
        self._on_full: set[int] = set()
        self._halfway = True
        self._original = cache(lambda number: original(fields[number]))
        super().__init__(file, fields)

    def chunks(self) -> Iterator[bytes]:
        """See `GridFrame.chunks`."""
        while True:
            made = list(super().chunks())
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
            self._done = self._announced = 0
            self._begin()

    def _layers(self, number: int) -> Iterator[bytes]:
        yield from super()._layers(number)
        isovalue = self.file.series.isovalues[number]
        self._drawn[number] = draw(
            leaves_of(self.strands[number].tube, isovalue, lambda number, above: number), measured=True
        )

    def _planned(self, number: int, lean: int | None) -> tuple[Sequence[Entry], int | None]:
        if number == len(self._plans):
            plan, found = super()._planned(number, lean)
            self._plans.append((plan, lean if number in self._on_full else found))
        return self._plans[number]

    def _plan_of(self, number: int, lean: int | None) -> Sequence[Entry]:
        o, promise = self.file.options, self._promise(number, lean)
        tolerance = self.file.searched
        assert tolerance is not None
        if number not in self._on_full:
            promise.fences = self._fences(number)
            try:
                return strategy.smallest(promise, tolerance, o.keep_topology, thorough=o.effort == BEST)
            except strategy.NotKeptError:
                if lean is not None:
                    # without prediction first
                    raise
                self._on_full.add(number)
        grid = strategy.whole_mesh(promise, o.keep_topology)
        if self._halfway and not len(promise.excess(promise.trial(grid)[1], tolerance)):
            return grid
        return [*grid, *grid_offsets(tolerance, False)]

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


def _frame_of(file: GridFile, fields: Sequence[Samples], before: Sequence[Leant] = ()) -> GridFrame:
    """Make the encoder of a frame, in the order that the options ask for.

    Raises
    ------
    OptionError
        If that order is not possible.
    """
    o, series, precision = file.options, file.series, file.options.precision
    count = len(series.isovalues)
    by_levels = 1 < count <= MOST_IN_TURN and series.interval is None and file.on_grid and not o.independent
    if o.order == LEVELS and not by_levels:
        raise OptionError(
            f"the order levels is for 2 to {MOST_IN_TURN} isovalues of one field on the mesh of the grid, "
            "predicted from one another", code="order", remedy="leave it out",
        )
    # values give most signs of the next isovalue, which comes cheaper after them
    apart = bool(file.values) or any(entry[0] == LayerKind.VALUES for plan in file.geometry or () for entry in plan)
    apart |= count * math.prod(file.header.shape) > MOST_SIGNS
    if by_levels and (o.order == LEVELS or (o.order is None and not apart)):
        return _ByLevels(file, fields)
    single = count == 1 or series.interval is not None or is_of_labels(file.metadata)
    searched = o.layers.default and precision.steps is None and file.searched is not None
    if searched and not single and file.header.n == 2:
        return _Uncrossed(file, fields)
    return GridFrame(file, fields, before)


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
        with file.series.next_frame():
            self.frame = _frame_of(file, fields)

    def _chunks(self) -> Iterator[bytes]:
        yield from self.frame.file.beginning()
        yield from self.frame.chunks()


class GridFrames:
    """Encodes the frames of a series as they come; at most two are in memory.

    Parameters
    ----------
    file : GridFile
    """

    def __init__(self, file: GridFile) -> None:
        self.file = file
        self._before: list[Leant] = []

    def resume(self, decoder: Decoder) -> None:
        """Continue a file after its last frame, which has been decoded."""
        self.file.series.frame = decoder.frame
        self._before = [Leant(*each) for each in decoder.grid.at_rest()]

    def chunks(self, fields: Sequence[Samples]) -> list[bytes]:
        """Return the chunks of a frame, the first with the header; if an error is raised, earlier frames are kept.

        Raises
        ------
        InputError
            If the missing samples differ from those of the first frame.
        """
        file, series, gone = self.file, self.file.series, fields[0].gone
        if gone is not file.gone and (gone is None or file.gone is None or (gone != file.gone).any()):
            raise InputError(
                "the missing samples differ from those of the first frame", code="frames",
                remedy="fill the missing samples, or give one mask for all frames",
            )
        with series.next_frame():
            frame = _frame_of(file.of_frame(fields), fields, [] if series.key else self._before)
            out = [*(file.beginning() if series.frame == 0 else ()), *frame.chunks()]
        self._before = frame.part()
        return out
