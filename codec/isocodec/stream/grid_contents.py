"""Chunks of a file of a sampled grid (layers, masks, frames), and drawings of what they hold (spec clause 9)."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from isospec.container import ChunkType
from isospec.elements import ELEMENTS

from ..drawing.contour import Contour
from ..drawing.drawing import draw, draw_with_ends
from ..drawing.leaves import Leaves, WholeCells
from ..drawing.meeting import Partition
from ..drawing.sample_mask import MaskRows
from ..drawing.smoothing import rounds_of
from ..drawing.snapshot import drawing_bytes, known_rows, leaves_of, state_of
from ..drawing.tessellation import Tessellation, compact, inferred, tessellated
from ..entropy.range_coder import Coder
from ..errors import LimitError, OptionError, TruncatedError
from ..field.labelling import is_of_labels
from ..field.mapped import Mapped
from ..field.placement import Placement
from ..field.samples import interval_value
from ..format.chunks import Envelope
from ..format.events import ChunkSkipped, Event, FrameRead, IsovalueRead, MaskComplete, SeriesRead
from ..format.header import Header
from ..format.program import Layer, Progress
from ..grid.layers.layer_reader import LayerReader
from ..grid.passes.runner import Tube
from ..grid.tube.decoded import Decoded
from .coordinate_coding import DecodedCoordinates
from .session import Session, within_memory
from .tubes import Tubes


class GridContents:
    """Decodes the chunks of a grid's file; draws isovalues, by number, up to the events taken so far.

    Drawing raises `LimitError` where it takes more memory than the limits allow; the decoder is unchanged.

    Parameters
    ----------
    session : Session
    header : Header

    Attributes
    ----------
    outline : Outline
    layers : list of Layer
        Layers announced so far.
    runs : list of BegunRun
    tubes, tubes_before : list of Tube or None
        Tubes of the isovalues of the current frame, and of the previous one; None for those that are skipped.
    """

    kind = "grid"

    def __init__(self, session: Session, header: Header) -> None:
        self.outline = session.outline
        self.layers: list[Layer] = self.outline.layers
        self._session, self._header, self._data = session, header, session.data
        self._budget = session.budget
        self._strands = strands = Tubes(session, header)
        self.tubes, self.tubes_before = strands.all, strands.before
        self._reader = LayerReader(
            session.limits, self._data, self.tubes, self.outline.progresses, strands.mask, self.layers, session.account,
            strands,
        )
        self.runs = self._reader.runs
        self._coordinates = DecodedCoordinates(self._budget, session.limits)
        strands.begin(None)

    # -- chunks ---------------------------------------------------------------------------------------------------

    def arrive(self, chunk: Envelope, at: int) -> tuple[Event | None, bool]:
        """See `Contents.arrive`."""
        if chunk.type == ChunkType.MASK and self._strands.mask_reader is None:
            self._strands.begin_mask()
        mask = self._strands.mask_reader
        if mask is not None and not mask.read(chunk, at):
            return None, False
        if chunk.type == ChunkType.LAYERS and self._tube is not None:
            event = self._reader.go_on(chunk, at)
            return event, not self._reader.waiting
        return None, True

    def take(self, chunk: Envelope, at: int, behind: int) -> Event | None:
        """See `Contents.take`."""
        size = chunk.end - chunk.start
        event: Event | None = None
        if self._strands.mask_reader is not None:
            self._reader.leave()
            self._strands.end_mask()
            return MaskComplete(behind, size)
        if chunk.type == ChunkType.LAYERS and self._tube is None:
            event = ChunkSkipped(behind, chunk.type, size)
        self._reader.leave()
        if chunk.type != ChunkType.LAYERS:
            event = self.outline.read(chunk, bytes(self._data[chunk.start : chunk.end]), behind)
            self._begin(event)
        if chunk.last:
            self._strands.settle()
        return event

    def drop(self) -> None:
        """See `Contents.drop`."""
        self.discard()
        self._budget.release(*(held for tube in self._strands.mask if tube for held in (tube, tube.estimates)))
        self._strands.mask.clear()
        self._strands.holes = None

    def _begin(self, event: Event) -> None:
        """Begin what an event announces: another isovalue, a series or another frame."""
        if isinstance(event, IsovalueRead):
            self._strands.begin(event.lean)
        elif isinstance(event, SeriesRead):
            self._strands.begin_series()
        elif isinstance(event, FrameRead):
            if event.number == 0 and not self.outline.past:
                self._reader.next_frame()
                self._strands.next_frame()
            self._strands.begin(event.lean, event.before)

    # -- what has been decoded -------------------------------------------------------------------------------------

    @property
    def _complete(self) -> bool:
        """Whether drawings show everything that the file stores of their frame."""
        return self._session.whole(self.outline.wanted)

    @property
    def _tube(self) -> Tube | None:
        """The tube of the isovalue whose layers are being read; None if it is skipped."""
        return self._strands.present

    def at_rest(self) -> list[tuple[Tube, Progress]]:
        """For each isovalue of a complete frame, its state and the position in its program: the next one leans on them.
        """
        self._strands.settle()
        return [(tube, progress) for tube, progress in zip(self.tubes, self.outline.progresses, strict=True) if tube]

    @property
    def mask_tube(self) -> Tube | None:
        """The tube of the mask, if its chunk has begun."""
        return self._strands.mask[0] if self._strands.mask else None

    @property
    def value_bits(self) -> tuple[int, int]:
        """Bits of the numbers above and below the isovalue, if already stated."""
        return self.outline.progresses[self.outline.turn[0]].bits or (0, 0)

    @property
    def coder(self) -> Coder:
        """The coder of the last run that was begun."""
        return self._reader.coder

    @property
    def symbols(self) -> dict[str, int]:
        """Symbols received so far, by syntax element."""
        return dict(zip(ELEMENTS, map(int, self._reader.symbols()), strict=True))

    @property
    def predictions(self) -> tuple[int, int]:
        """Number of signs predicted so far, and how many correctly."""
        made, right = self._reader.tally()[-2:]
        return int(made), int(right)

    def _tube_of(self, number: int, before: bool = False) -> Tube | None:
        """The tube of an isovalue, by number, or of the frame before; None before it is read, or if it is skipped.

        An exceeded limit is raised again: the decoded state has been dropped.
        """
        if (error := self._session.exceeded) is not None:
            raise copy(error)
        if number < 0:
            raise OptionError(f"isovalue number {number}; they are counted from 0", code="isovalue")
        tubes = self.tubes_before if before else self.tubes
        return tubes[number] if number < len(tubes) else None

    def state(self, number: int = 0, *, before: bool = False) -> Decoded | None:
        """The decoded state of an isovalue, by number, in integers; None before it is read, or if it is skipped.

        With ``before`` that of the frame before.
        """
        tube = self._tube_of(number, before)
        return state_of(tube) if tube else None

    def mask_state(self) -> Decoded | None:
        """The decoded state of the mask; None before its chunk is read."""
        return state_of(self.mask_tube) if self.mask_tube else None

    def _leaves(self, tube: Tube, isovalue: float) -> Leaves:
        """All that the drawing of a tube needs."""
        self._budget.check(drawing_bytes(tube))
        scale = self._header.scale
        return leaves_of(
            tube, isovalue, lambda steps, above: interval_value(isovalue, scale, steps, above), self._strands.holes,
            listed=False,
        )

    def _beside(self, tube: Tube) -> Callable[[int], None]:
        """Check whether there is room for some bytes beside those of a tube's drawing."""
        return lambda size: self._budget.check(drawing_bytes(tube) + size)

    @within_memory("to draw the contour")
    def contour(
        self, number: int = 0, *, smooth: bool | None = None, through_holes: bool = False, before: bool = False
    ) -> Contour:
        """Draw the curve or surface of an isovalue, by number; ``smooth`` and ``through_holes`` as for `decode`.

        It is empty before a mesh is known. With ``before``, that of the previous frame, which is complete.
        """
        tube, notes, n = self._tube_of(number, before), self.outline.notes(before), self._header.n
        if tube is None:
            contour = Contour(np.zeros((0, n)), np.zeros((0, n), np.int64), math.nan, self._header.shape, False)
        else:
            # a file asks for it on the full grid, a caller anywhere
            rounds = rounds_of(notes, smooth) if smooth or tube.full else 0
            leaves = self._leaves(tube, self.outline.isovalues[number])
            if through_holes:
                leaves = replace(leaves, whole=None)
            drawn = draw(leaves, complete=before or self._complete, smooth=rounds, check=self._beside(tube))
            contour = replace(drawn, origin_above=tube.origin_above)
        return replace(contour, metadata=notes, placement=self.placement)

    @property
    def whole_cells(self) -> WholeCells | None:
        """Make a test of unit cells, by their lowest corners (C, n), for missing ones; None without a mask."""
        return self._strands.holes.whole_cells if self._strands.holes else None

    @within_memory("to draw the contour")
    def ends(self, number: int = 0) -> tuple[Contour, NDArray[np.int64]]:
        """Draw the contour of an isovalue, by number, with the ends of its points' edges: see `draw_with_ends`."""
        tube = self._tube_of(number)
        if tube is None:
            contour = self.contour(number)
            return contour, np.zeros((0, 2, contour.n), np.int64)
        leaves = self._leaves(tube, self.outline.isovalues[number])
        contour, ends = draw_with_ends(leaves, complete=self._complete, check=self._beside(tube))
        return replace(contour, origin_above=tube.origin_above), ends

    @within_memory("for the mask")
    def above(self, number: int = 0, *, before: bool = False) -> NDArray[np.bool_]:
        """Find which samples lie above an isovalue, by number, up to the events taken so far (spec clause 9.7).

        With ``before`` that of the frame before.

        Raises
        ------
        TruncatedError
            If this has not been received yet.
        OptionError
            If the file does not store it: its mesh is coarser than the samples.
        LimitError
            If there are more samples than the limits allow.
        """
        return self.mask_rows(number, before=before).whole()

    def mask_rows(self, number: int = 0, last_first: bool = False, *, before: bool = False) -> MaskRows:
        """Find which samples lie above, some rows at a time, so that the whole mask need not be in memory.

        With ``last_first``, rows of the transposed array, whose first axis is the last one. Errors as for `above`.
        """
        known = before or self._session.complete or self._complete
        return self._rows(self._tube_of(number, before), known, last_first)

    def _rows(self, tube: Tube | None, complete: bool, last_first: bool) -> MaskRows:
        if tube is None or not tube.full:
            if not complete:
                raise self._early("which samples lie above", "9.7")
            raise OptionError(
                "the file does not hold which samples lie above: its mesh is coarser than the grid", code="mask",
                remedy="if the file was cut, use the whole file; otherwise encode signs alone, exact values, or with a "
                "tolerance below 0.1",
            )
        self._check_samples()
        rows = known_rows(tube, last_first)
        self._budget.check(rows.bytes)
        return rows

    def _early(self, what: str, clause: str) -> TruncatedError:
        return TruncatedError(
            f"too little has been received to know {what}", code="truncated", offset=len(self._data), clause=clause,
            remedy="feed more of the file",
        )

    def _check_samples(self) -> None:
        """Refuse a mask of more samples than the limits allow."""
        samples, most = math.prod(self._header.shape), self._session.limits.samples
        if samples > most:
            raise LimitError(
                f"a mask of {samples:,} samples, more than {most:,}", code="limit-samples", clause="11.2",
                remedy="to allow this, raise Limits.samples (--limits samples=..)",
            )

    @within_memory("for the mask")
    def valid(self) -> NDArray[np.bool_]:
        """Find which samples are valid, up to the events taken so far; all are valid if the file has no mask.

        Raises
        ------
        TruncatedError
            If a mask may still come.
        LimitError
            If there are more samples than the limits allow.
        """
        return self.valid_rows().whole()

    def valid_rows(self, last_first: bool = False) -> MaskRows:
        """Find which samples are valid, some rows at a time; ``last_first`` and errors as for `mask_rows`."""
        self._tube_of(0)
        # a mask belongs to the first frame, or there never is one
        known = self._session.frames > 0
        if self._strands.holes:
            return self._rows(self.mask_tube, known, last_first)
        if not known:
            raise self._early("which samples are valid", "9.8")
        self._check_samples()
        shape = self._header.shape[::-1] if last_first else self._header.shape
        return MaskRows(shape, np.zeros((1, len(shape)), np.int32), np.ones(1, np.bool_))

    @within_memory("for the labels")
    def partition(self, *, before: bool = False) -> Partition | None:
        """Find which label each sample has; None if the file is not of several labels, or not all are known (yet)."""
        count = len(self.outline.isovalues)
        if count < 2 or not is_of_labels(self.outline.metadata):
            return None
        self._budget.check(3 * math.prod(self._header.shape))
        try:
            valid = self.valid() if self._strands.holes else None
            return Partition.of((self.above(number, before=before) for number in range(count)), valid)
        except (OptionError, TruncatedError):
            return None

    def crossed(self, number: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Crossed leaves of the mesh: positions (V, n), and vertices of simplices (M, n + 1), both int64."""
        tube, n = self._tube_of(number), self._header.n
        if tube is None:
            return np.zeros((0, n), np.int64), np.zeros((0, n + 1), np.int64)
        self._budget.check(drawing_bytes(tube, listed=True))
        leaves = leaves_of(tube, 0.0, lambda steps, above: steps)
        return leaves.position.astype(np.int64), leaves.simplices

    @within_memory("for the mesh")
    def mesh(self, number: int = 0, whole: bool = True) -> Tessellation:
        """The mesh of an isovalue, by number, with signs of vertices: the whole mesh, or only its crossed leaves.

        Raises
        ------
        TruncatedError
            If this has not been received yet.
        """
        tube = self._tube_of(number)
        if tube is None or tube.origin_above is None or (whole and tube.running == "base"):
            raise TruncatedError("too little has been received to know the mesh", code="truncated", clause="4.7")
        self._budget.check(drawing_bytes(tube, listed=True))
        if whole:
            state = state_of(tube)
            points, cells, levels = tessellated(tube.shape, tube.k, state.level, state.mesh, self._budget.check)
            above = inferred(points, cells, state.position, state.above, tube.origin_above)
        else:
            leaves = leaves_of(tube, 0.0, lambda steps, above: steps)
            points, above, cells = compact(leaves.position.astype(np.int64), leaves.above, leaves.simplices)
            levels = leaves.levels
        return Tessellation(
            points, cells, levels, above, self.outline.isovalues[number], tube.shape, self._complete, self.placement,
            self.outline.notes(),
        )

    @property
    def placement(self) -> Placement | None:
        """Placement of samples, if known; errors as for `mapped`."""
        return self._coordinates.placement(self.outline.coordinates, self._header.shape, self.outline.metadata)

    def mapped(self) -> Mapped | None:
        """Decode the chunk of coordinates; None if it has not been read.

        Raises
        ------
        LimitError
            If they take more memory than the limits allow; the decoder is unchanged.
        """
        return self._coordinates.mapped(self.outline.coordinates, self._header.shape)

    def discard(self, number: int | None = None) -> None:
        """Drop the decoded state of an isovalue, or of all, once drawn; nothing that follows may depend on it."""
        for i in range(len(self.tubes)) if number is None else (number,):
            tube = self.tubes[i] if 0 <= i < len(self.tubes) else None
            if tube is not None:
                self._budget.release(tube, tube.estimates)
                self._reader.drop(i)
                self._strands.drop(i)
