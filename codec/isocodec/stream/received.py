"""What a decoder has received so far: its numbers, drawings, masks and meshes (spec clause 9)."""

from __future__ import annotations

import math
from collections.abc import Collection
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from isospec.elements import ELEMENTS

from ..drawing.contour import Contour
from ..drawing.leaves import WholeCells
from ..drawing.rows import MaskRows
from ..drawing.snapshot import state_of
from ..drawing.tessellation import Tessellation
from ..entropy.range_coder import Coder
from ..errors import LimitError, OptionError, out_of_memory
from ..field.mapped import Mapped
from ..field.placement import Placement
from ..format.program import Layer, Progress
from ..grid.layers.reader import LayerReader
from ..grid.passes.runner import Tube
from ..grid.tube.decoded import Decoded
from ..limits import Limits
from .contents import Contents
from .drawn import contour_of, ends_of, mask_rows_of, mesh_of, tessellation_of, valid_rows_of
from .placing import DecodedCoordinates
from .session import ContainerDecoder
from .tubes import Tubes


class Received(ContainerDecoder):
    """What bytes have been fed and what has been decoded of them, as of the events taken so far.

    `Decoder` takes the events.
    """

    def __init__(
        self, limits: Limits | None = None, *, only: Collection[int] | None = None, frame: int | None = None
    ) -> None:
        self.layers: list[Layer] = []
        super().__init__(limits, Contents(layers=self.layers), frame)
        self._strands = strands = Tubes(self.limits, self._data, self._contents, self._budget, only, frame)
        self._tubes, self._progresses, self._mask = strands.all, strands.progresses, strands.mask
        self._reader = LayerReader(
            self.limits, self._data, self._tubes, self._progresses, self._mask.tubes, self.layers
        )
        self.runs = self._reader.runs
        self._coordinates = DecodedCoordinates(self._budget)
        self._cut = False

    @property
    def _tube(self) -> Tube | None:
        """That of the isovalue whose layers come at present; None if it is skipped."""
        return self._strands.present

    @property
    def _progress(self) -> Progress:
        return self._progresses[-1]

    @property
    def interval(self) -> int | None:
        """Of a series: frames whose number is a multiple of it lean on none before them, 0 if only the first does.

        None of a file without frames, and before that is known.
        """
        return self._contents.interval

    @property
    def value_bits(self) -> tuple[int, int]:
        """Bits of the numbers above and below the isovalue, as far as stated."""
        return (self._progress.bits if self._progresses else None) or (0, 0)

    @property
    def coder(self) -> Coder:
        """The coder of the last run that was begun."""
        return self._reader.coder

    @property
    def run_symbols(self) -> int:
        """Symbols that have been decoded of the last run that was begun."""
        return self._reader.run_symbols

    @property
    def memory(self) -> int:
        """Bytes that count to `Limits.memory` at present."""
        return self._budget.held

    @property
    def symbols(self) -> dict[str, int]:
        """Symbols received so far, by syntax element."""
        return dict(zip(ELEMENTS, map(int, self._reader.symbols()), strict=True))

    @property
    def predictions(self) -> tuple[int, int]:
        """Signs that were predicted so far, and how many of them rightly."""
        made, right = self._reader.tally()[-2:]
        return int(made), int(right)

    def _tube_of(self, number: int) -> Tube | None:
        """That of an isovalue, by number; None before it has come, or if it is skipped."""
        if isinstance(self._error, LimitError):
            # what was decoded has been dropped
            raise copy(self._error)
        if number < 0:
            raise OptionError(f"isovalue number {number}; they are counted from 0", code="isovalue")
        return self._tubes[number] if number < len(self._tubes) else None

    def state(self, number: int = 0, *, before: bool = False) -> Decoded | None:
        """The decoded state of an isovalue, by number, in integers; None before it has come, or if it is skipped.

        With ``before`` that of the frame before.
        """
        tubes = self._strands.before
        tube = (tubes[number] if number < len(tubes) else None) if before else self._tube_of(number)
        return state_of(tube) if tube else None

    def mask_state(self) -> Decoded | None:
        """The decoded state of the mask, likewise; None before its chunk has come."""
        return state_of(self._mask.tube) if self._mask.tube else None

    def drawn(
        self, number: int = 0, smooth: bool = False, through_holes: bool = False, *, before: bool = False
    ) -> Contour:
        """The curve or surface of an isovalue, by number; ``smooth`` and ``through_holes`` as in `decode`.

        With ``before`` that of the frame before, which is complete.

        Raises
        ------
        LimitError
            If drawing takes more memory than the limits allow; the decoder stays as it is.
        """
        try:
            return self._drawn(number, smooth, through_holes, before)
        except MemoryError:
            pass
        raise out_of_memory("to draw the contour")

    def _drawn(self, number: int, smooth: bool, through_holes: bool, before: bool) -> Contour:
        tube = self._strands.before[number] if before else self._tube_of(number)
        isovalue = self.isovalues[number] if tube else math.nan
        complete = before or (self._ended and not self._cut)
        contour = contour_of(
            tube, isovalue, self.header, self.metadata, complete, smooth, self._budget, self._mask.holes, through_holes
        )
        return replace(contour, placement=self.placement)

    @property
    def whole_cells(self) -> WholeCells | None:
        """Which unit cells have no missing corner, by their lowest ones (C, n); None if no mask has come."""
        return self._mask.holes.whole_cells if self._mask.holes else None

    def ends(self, number: int = 0) -> tuple[Contour, NDArray[np.int64]]:
        """The contour of an isovalue, by number, and between which samples its points lie: see `draw_with_ends`."""
        tube = self._tube_of(number)
        if tube is None or self.header is None:
            contour = self.drawn(number)
            return contour, np.zeros((0, 2, contour.n), np.int64)
        try:
            complete = self._ended and not self._cut
            return ends_of(tube, self.isovalues[number], self.header, complete, self._budget, self._mask.holes)
        except MemoryError:
            pass
        raise out_of_memory("to draw the contour")

    def mask(self, number: int = 0) -> NDArray[np.bool_]:
        """Which samples lie above an isovalue, by number, as of the events taken so far (spec clause 9.7).

        Raises
        ------
        TruncatedError
            If that has not been received yet.
        OptionError
            If the file does not tell: its mesh is coarser than the samples.
        LimitError
            If there are more samples than the limits allow.
        """
        try:
            return self.mask_rows(number).whole()
        except MemoryError:
            pass
        raise out_of_memory("for the mask")

    def mask_rows(self, number: int = 0, last_first: bool = False) -> MaskRows:
        """The same some rows at a time, so that the mask need not be in memory as a whole.

        With ``last_first`` of the transposed array, whose first axis is the last one.

        Raises
        ------
        TruncatedError, OptionError, LimitError
            As `mask`.
        """
        tube = self._tube_of(number)
        return mask_rows_of(tube, len(self._data), self.complete, last_first, self.limits, self._budget)

    def valid(self) -> NDArray[np.bool_]:
        """Which samples are valid, as of the events taken so far; all are if the file has no mask.

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
        """The same some rows at a time; ``last_first`` and errors as in `mask_rows`."""
        if isinstance(self._error, LimitError):
            raise copy(self._error)
        tube, received = self._mask.tube if self._mask.holes else None, len(self._data)
        return valid_rows_of(tube, self.header, received, self.complete, last_first, self.limits, self._budget)

    def mesh(self, number: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """The crossed leaves of the mesh: positions (V, n) and vertices of simplices (M, n + 1), both int64."""
        n = len(self.header.shape) if self.header else 2
        return mesh_of(self._tube_of(number), n, self._budget)

    def tessellation(self, number: int = 0, whole: bool = True) -> Tessellation:
        """The mesh of an isovalue, by number, with signs of vertices: of the whole box, or its crossed leaves alone.

        Raises
        ------
        TruncatedError
            If that has not been received yet.
        LimitError
            If it takes more memory than the limits allow; the decoder stays as it is.
        """
        tube = self._tube_of(number)
        isovalue = self.isovalues[number] if tube else math.nan
        complete = self._ended and not self._cut
        try:
            mesh = tessellation_of(tube, isovalue, self.header, self.metadata, complete, whole, self._budget)
            return replace(mesh, placement=self.placement)
        except MemoryError:
            pass
        raise out_of_memory("for the mesh")

    @property
    def placement(self) -> Placement | None:
        """Where samples lie, as far as that has come; errors as `mapped`."""
        if self.header is None:
            return None
        return self._coordinates.placement(self._contents.coordinates, self.header.shape, self.metadata)

    def mapped(self) -> Mapped | None:
        """The chunk of coordinates, decoded; None if it has not come.

        Raises
        ------
        LimitError
            If they take more memory than the limits allow; the decoder stays as it is.
        """
        return None if self.header is None else self._coordinates.mapped(self._contents.coordinates, self.header.shape)

    def hold(self, size: int) -> None:
        """Count ``size`` bytes that the caller holds, of drawings for example, to the limit of memory from now on.

        Raises
        ------
        LimitError
            If that is more than there may be; the decoder stays as it is.
        """
        self._budget.hold(self, size)

    def discard(self, number: int | None = None) -> None:
        """Drop what has been decoded of an isovalue, or of all: to free memory once it has been drawn.

        What is to come must not lean on it.
        """
        for i, tube in enumerate(self._tubes):
            if tube is not None and number in (None, i):
                self._budget.release(tube, tube.estimates)
                self._reader.drop(i)
