"""Chunks of a file of a sampled grid (layers, masks, frames), and drawings of what they hold (spec clause 9)."""

from __future__ import annotations

import math
from collections.abc import Collection
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from isospec.container import ChunkType
from isospec.elements import ELEMENTS

from ..drawing.contour import Contour
from ..drawing.leaves import WholeCells
from ..drawing.rows import MaskRows
from ..drawing.snapshot import state_of
from ..drawing.tessellation import Tessellation
from ..entropy.range_coder import Coder
from ..errors import OptionError, out_of_memory
from ..field.mapped import Mapped
from ..field.placement import Placement
from ..format.chunks import Envelope
from ..format.events import ChunkSkipped, Event, FrameRead, IsovalueRead, MaskComplete, SeriesRead
from ..format.header import Header
from ..format.program import Layer, Progress
from ..grid.layers.layer_reader import LayerReader
from ..grid.passes.runner import Tube
from ..grid.tube.decoded import Decoded
from .drawn import contour_of, ends_of, mask_rows_of, mesh_of, tessellation_of, valid_rows_of
from .outline import LAYER_CHUNKS
from .placing import DecodedCoordinates
from .session import Session
from .tubes import Tubes


class GridContents:
    """Decodes the chunks of a grid's file; draws isovalues, by number, up to the events taken so far.

    Parameters
    ----------
    session : Session
    header : Header
    only : collection of int, optional
        Numbers of the isovalues to decode; the chunks of others are skipped.
    frame : int, optional
        For a series, the frame to decode, with those that it is predicted from; if None, all frames one after the
        other.

    Attributes
    ----------
    outline : Outline
    layers : list of Layer
        Layers announced so far.
    runs : list of BegunRun
    """

    kind = "grid"

    def __init__(
        self, session: Session, header: Header, only: Collection[int] | None = None, frame: int | None = None
    ) -> None:
        self.outline = session.outline
        self.layers: list[Layer] = self.outline.layers
        self._session, self._header, self._data = session, header, session.data
        self._budget = session.budget
        self._strands = strands = Tubes(
            session.limits, self._data, self.outline, self._budget, session.account, only, frame
        )
        self._tubes, self._progresses, self._mask = strands.all, strands.progresses, strands.mask
        self._reader = LayerReader(
            session.limits, self._data, self._tubes, self._progresses, self._mask.tubes, self.layers,
            session.account, strands,
        )
        self.runs = self._reader.runs
        self._coordinates = DecodedCoordinates(self._budget, session.limits)
        strands.begin(header, None, session.at)

    # -- chunks ---------------------------------------------------------------------------------------------------

    def expect(self, chunk: Envelope, at: int) -> None:
        """See `Contents.expect`."""
        if chunk.type == ChunkType.MASK:
            self._strands.begin_mask(self._header, at)
        self.outline.begun |= chunk.type in LAYER_CHUNKS

    def arrive(self, chunk: Envelope, at: int) -> tuple[Event | None, bool]:
        """See `Contents.arrive`."""
        if not self._mask.go_on(chunk, at):
            return None, False
        if chunk.type in LAYER_CHUNKS and self._tube is not None:
            event = self._reader.go_on(chunk, at)
            return event, not self._reader.waiting
        return None, True

    def take(self, chunk: Envelope, at: int, behind: int) -> Event | None:
        """See `Contents.take`."""
        skipped = chunk.type in LAYER_CHUNKS and self._tube is None
        self._reader.leave()
        if self._mask.coming:
            self._strands.end_mask(self._header)
            return MaskComplete(behind, chunk.end - chunk.start)
        if chunk.type not in LAYER_CHUNKS:
            event = self.outline.read(chunk, bytes(self._data[chunk.start : chunk.end]), behind)
            self._begin(event)
            self._end(chunk)
            return event
        self._end(chunk)
        return ChunkSkipped(behind, chunk.type, chunk.end - chunk.start) if skipped else None

    def drop(self) -> None:
        """See `Contents.drop`."""
        self.discard()
        self._mask.drop()

    def _end(self, chunk: Envelope) -> None:
        """Free what only further layers need, after the last chunk; what a cut run began is drawn with it."""
        if chunk.last and not self._session.cut:
            self._strands.settle()

    def _begin(self, event: Event) -> None:
        """Begin what an event announces: a further isovalue, a series or a further frame."""
        if isinstance(event, IsovalueRead):
            self._strands.begin(self._header, event.lean, self._session.at)
        elif isinstance(event, SeriesRead):
            self._strands.begin_series()
        elif isinstance(event, FrameRead):
            if event.number == 0 and not self._strands.past:
                self._reader.next_frame()
                self._strands.next_frame()
            self._strands.begin_frame(self._header, event)

    # -- what has been decoded -------------------------------------------------------------------------------------

    @property
    def _complete(self) -> bool:
        """Whether drawings show everything that the file stores of their frame."""
        return self._session.whole(self._strands.frame)

    @property
    def _tube(self) -> Tube | None:
        """The tube of the isovalue whose layers are being read; None if it is skipped."""
        return self._strands.present

    @property
    def _progress(self) -> Progress:
        return self._progresses[self.outline.turn[0]]

    @property
    def tubes(self) -> list[Tube | None]:
        """Tubes of the isovalues of the current frame, by number; None for those that are skipped."""
        return self._tubes

    @property
    def mask_tube(self) -> Tube | None:
        """The tube of the mask, if its chunk has begun."""
        return self._mask.tube

    @property
    def tubes_before(self) -> list[Tube | None]:
        """Tubes of the isovalues of the previous frame."""
        return self._strands.before

    @property
    def value_bits(self) -> tuple[int, int]:
        """Bits of the numbers above and below the isovalue, if already stated."""
        return (self._progress.bits if self._progresses else None) or (0, 0)

    @property
    def coder(self) -> Coder:
        """The coder of the last run that was begun."""
        return self._reader.coder

    @property
    def run_symbols(self) -> int:
        """Symbols decoded so far of the last run that was begun."""
        return self._reader.run_symbols

    @property
    def symbols(self) -> dict[str, int]:
        """Symbols received so far, by syntax element."""
        return dict(zip(ELEMENTS, map(int, self._reader.symbols()), strict=True))

    @property
    def predictions(self) -> tuple[int, int]:
        """Number of signs that were predicted so far, and how many of them correctly."""
        made, right = self._reader.tally()[-2:]
        return int(made), int(right)

    def _tube_of(self, number: int) -> Tube | None:
        """The tube of an isovalue, by number; None before it is read, or if it is skipped."""
        self._check_limits()
        if number < 0:
            raise OptionError(f"isovalue number {number}; they are counted from 0", code="isovalue")
        return self._tubes[number] if number < len(self._tubes) else None

    def _check_limits(self) -> None:
        """Refuse to draw after a limit was exceeded, since the decoded state has been dropped."""
        if (error := self._session.exceeded) is not None:
            raise copy(error)

    def state(self, number: int = 0, *, before: bool = False) -> Decoded | None:
        """The decoded state of an isovalue, by number, in integers; None before it is read, or if it is skipped.

        With ``before`` that of the frame before.
        """
        tubes = self._strands.before
        tube = (tubes[number] if number < len(tubes) else None) if before else self._tube_of(number)
        return state_of(tube) if tube else None

    def mask_state(self) -> Decoded | None:
        """The decoded state of the mask; None before its chunk is read."""
        return state_of(self._mask.tube) if self._mask.tube else None

    def contour(
        self, number: int = 0, *, smooth: bool | None = None, through_holes: bool = False, before: bool = False
    ) -> Contour:
        """Draw the curve or surface of an isovalue, by number; ``smooth`` and ``through_holes`` as for `decode`.

        With ``before``, that of the previous frame, which is complete.

        Raises
        ------
        LimitError
            If drawing takes more memory than the limits allow; the decoder is unchanged.
        """
        try:
            return self._drawn(number, smooth, through_holes, before)
        except MemoryError:
            pass
        raise out_of_memory("to draw the contour")

    def _drawn(self, number: int, smooth: bool | None, through_holes: bool, before: bool) -> Contour:
        tube = self._strands.before[number] if before else self._tube_of(number)
        isovalue = self.outline.isovalues[number] if tube else math.nan
        contour = contour_of(
            tube, isovalue, self._header, self.outline.metadata, before or self._complete, smooth, self._budget,
            self._mask.holes, through_holes,
        )
        return replace(contour, placement=self.placement)

    @property
    def whole_cells(self) -> WholeCells | None:
        """Make a test of unit cells, by their lowest corners (C, n), for missing ones; None without a mask."""
        return self._mask.holes.whole_cells if self._mask.holes else None

    def ends(self, number: int = 0) -> tuple[Contour, NDArray[np.int64]]:
        """Draw the contour of an isovalue, by number, with the ends of its points' edges: see `draw_with_ends`."""
        tube = self._tube_of(number)
        if tube is None:
            contour = self.contour(number)
            return contour, np.zeros((0, 2, contour.n), np.int64)
        try:
            isovalue = self.outline.isovalues[number]
            return ends_of(tube, isovalue, self._header, self._complete, self._budget, self._mask.holes)
        except MemoryError:
            pass
        raise out_of_memory("to draw the contour")

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
        try:
            return self.mask_rows(number, before=before).whole()
        except MemoryError:
            pass
        raise out_of_memory("for the mask")

    def mask_rows(self, number: int = 0, last_first: bool = False, *, before: bool = False) -> MaskRows:
        """Find which samples lie above, some rows at a time, so that the whole mask need not be in memory.

        With ``last_first``, rows of the transposed array, whose first axis is the last one.

        Raises
        ------
        TruncatedError, OptionError, LimitError
            As for `above`.
        """
        session = self._session
        tube = self._strands.before[number] if before else self._tube_of(number)
        known = before or session.complete or self._complete
        return mask_rows_of(tube, len(self._data), known, last_first, session.limits, self._budget)

    def valid(self) -> NDArray[np.bool_]:
        """Find which samples are valid, up to the events taken so far; all are valid if the file has no mask.

        Raises
        ------
        TruncatedError
            If a mask may still come.
        LimitError
            If there are more samples than the limits allow.
        """
        try:
            return self.valid_rows().whole()
        except MemoryError:
            pass
        raise out_of_memory("for the mask")

    def valid_rows(self, last_first: bool = False) -> MaskRows:
        """Find which samples are valid, some rows at a time; ``last_first`` and errors as for `mask_rows`."""
        self._check_limits()
        tube, session = self._mask.tube if self._mask.holes else None, self._session
        # a mask belongs to the first frame, or there never is one
        known = session.frames > 0
        return valid_rows_of(tube, self._header, len(self._data), known, last_first, session.limits, self._budget)

    def crossed(self, number: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Crossed leaves of the mesh: positions (V, n), and vertices of simplices (M, n + 1), both int64."""
        return mesh_of(self._tube_of(number), len(self._header.shape), self._budget)

    def mesh(self, number: int = 0, whole: bool = True) -> Tessellation:
        """The mesh of an isovalue, by number, with signs of vertices: the whole mesh, or only its crossed leaves.

        Raises
        ------
        TruncatedError
            If this has not been received yet.
        LimitError
            If it takes more memory than the limits allow; the decoder is unchanged.
        """
        tube = self._tube_of(number)
        isovalue = self.outline.isovalues[number] if tube else math.nan
        try:
            mesh = tessellation_of(
                tube, isovalue, self._header, self.outline.metadata, self._complete, whole, self._budget
            )
            return replace(mesh, placement=self.placement)
        except MemoryError:
            pass
        raise out_of_memory("for the mesh")

    @property
    def placement(self) -> Placement | None:
        """Placement of samples, as far as it is known; errors as for `mapped`."""
        return self._coordinates.placement(self.outline.coordinates, self._header.shape, self.outline.metadata)

    def mapped(self) -> Mapped | None:
        """Decode the chunk of coordinates; None if it has not been read.

        Raises
        ------
        LimitError
            If they take more memory than the limits allow; the decoder is unchanged.
        """
        return self._coordinates.mapped(self.outline.coordinates, self._header.shape)

    def hold(self, size: int) -> None:
        """Count ``size`` bytes held by the caller (for example for drawings) towards the memory limit from now on.

        Raises
        ------
        LimitError
            If that is more than there may be; the decoder is unchanged.
        """
        self._budget.hold(self, size)

    def discard(self, number: int | None = None) -> None:
        """Drop the decoded state of an isovalue, or of all, once drawn; nothing that follows may depend on it.
        """
        for i in range(len(self._tubes)) if number is None else (number,):
            tube = self._tubes[i] if 0 <= i < len(self._tubes) else None
            if tube is not None:
                self._budget.release(tube, tube.estimates)
                self._reader.drop(i)
                self._strands.drop(i)
