"""The tubes (decoded states) of a file's isovalues and of its mask, for decoders (spec 3.5.5, 3.5.6, 11.2)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from ..entropy.run import Account
from ..errors import LimitError, OptionError
from ..format.events import FrameRead
from ..format.frames import key_of
from ..format.header import Header
from ..format.program import Progress
from ..grid.layers.beginning import leaning_tube
from ..grid.passes.runner import Tube
from ..limits import Budget, Limits
from .mask_strand import MaskStrand
from .outline import Outline

_ROOM = 4096
"""Initial size, in bytes, of a coder's buffer for runs."""


class Tubes:
    """Tubes (decoded states), one for each isovalue read so far.

    Parameters
    ----------
    limits : Limits
    data : bytearray
        The file as far as it has arrived; it grows.
    outline : Outline
    budget : Budget
    account : Account
    only : collection of int, optional
        Numbers of the isovalues that are wanted.
    frame : int, optional
        Number of the frame that is wanted; all frames if not given.

    Attributes
    ----------
    all : list of Tube or None
        By isovalue; None for those that are skipped. In a series, those of the current frame, or of the one wanted.
    before : list of Tube or None
        Tubes of the previous frame, from which the current ones may be predicted.
    progresses : list of Progress
        State of the programs of the isovalues.
    mask : MaskStrand
    """

    def __init__(
        self, limits: Limits, data: bytearray, outline: Outline, budget: Budget, account: Account,
        only: Collection[int] | None, frame: int | None = None,
    ) -> None:
        self.all: list[Tube | None] = []
        self.before: list[Tube | None] = []
        self.progresses: list[Progress] = []
        self.mask = MaskStrand(limits, data, budget, account, self.all)
        self._limits = limits
        self._outline = outline
        self._budget = budget
        self._only = only
        self._frame = frame
        self._progresses_before: list[Progress] = []

    @property
    def present(self) -> Tube | None:
        """The tube of the isovalue whose layers are being read; None if it is skipped."""
        return self.all[-1] if self.all and not self.past else None

    @property
    def past(self) -> bool:
        """Whether the wanted frame has been passed."""
        return self._frame is not None and self._outline.frame > self._frame

    def _is_wanted(self, number: int) -> bool:
        """Whether isovalue ``number`` of the current frame is to be decoded."""
        if self._only is not None and number not in self._only:
            return False
        interval, frame = self._outline.interval, self._frame
        return frame is None or interval is None or self._outline.frame >= key_of(frame, interval)

    def begin(self, header: Header, lean: int | None, offset: int) -> None:
        """Begin an isovalue, which may be predicted from an earlier one."""
        number = len(self.all)
        if number >= self._limits.isovalues:
            raise LimitError(
                f"more than {self._limits.isovalues} isovalues", code="limit-isovalues", offset=offset, clause="11.2"
            )
        if self.present is not None:
            self.present.rest()
        before = self.progresses[-1] if self.progresses else Progress(0)
        if not self._is_wanted(number):
            self.all.append(None)
            self.progresses.append(before)
            return
        if lean is not None and self.all[lean] is None:
            raise OptionError(f"isovalue {number} is predicted from isovalue {lean}, which is not decoded", code="only")
        tube = self._fresh(header, number, lean)
        before = replace(before, full_level=tube.full_level)
        self.progresses.append(before.begin(None if lean is None else self.progresses[lean]))
        self.all.append(tube)

    def begin_series(self) -> None:
        """Handle that the file is a series, whose first frame may not be wanted."""
        for number, tube in enumerate(self.all):
            if tube is not None and not self._is_wanted(number):
                self._budget.release(tube, tube.estimates)
                self.all[number] = None

    def begin_frame(self, header: Header, event: FrameRead) -> None:
        """Begin an isovalue of a further frame; the tubes of the previous frame are in ``before``."""
        if self.past:
            return
        if self.present is not None:
            self.present.rest()
        number, lean = event.number, event.lean
        if not self._is_wanted(number):
            self.all.append(None)
            self.progresses.append(Progress(0))
            return
        earlier, progresses = (self.before, self._progresses_before) if event.before else (self.all, self.progresses)
        if lean is not None and (lean >= len(earlier) or earlier[lean] is None):
            raise OptionError(f"isovalue {number} is predicted from isovalue {lean}, which is not decoded", code="only")
        tube = self._fresh(header, number, lean, event.before)
        layers = self.progresses[-1].layers if self.progresses else 0
        before = Progress(tube.full_level, layers=layers)
        self.progresses.append(before.begin(None if lean is None else progresses[lean]))
        self.all.append(tube)

    def next_frame(self) -> None:
        """Release the previous frame, and make the current one the previous."""
        for tube in self.before:
            if tube is not None:
                self._budget.release(tube, tube.estimates)
        for tube in self.all:
            if tube is not None:
                tube.part()
        self.before[:], self._progresses_before = self.all, list(self.progresses)
        self.all.clear()
        self.progresses.clear()

    def _fresh(self, header: Header, number: int, lean: int | None, before: bool = False) -> Tube:
        """Make the tube of an isovalue, predicted from one of its frame or of the previous one, if any."""
        isovalues = self._outline.isovalues
        tubes = self.before if before else self.all
        earlier, other = (None, 0.0) if lean is None else (tubes[lean], isovalues[lean])
        return leaning_tube(
            header, isovalues[number], earlier, other, _ROOM, self._left(), budget=self._budget, holes=self.mask.holes,
            frame=before,
        )

    def _left(self) -> Limits:
        """Limits for one more tube: all tubes of a file together must stay within the limits of one."""
        whole, tubes = self._limits, [tube for tube in (*self.before, *self.all, self.mask.tube) if tube]
        return replace(
            whole, vertices=max(whole.vertices - sum(tube.vertices for tube in tubes), 0),
            simplices=max(whole.simplices - sum(tube.simplices for tube in tubes), 0),
        )

    def begin_mask(self, header: Header, offset: int) -> None:
        """Begin the chunk of the mask."""
        self._outline.begin_mask(offset)
        self.mask.begin(header, self._left())

    def end_mask(self, header: Header) -> None:
        """Use the complete mask for isovalues whose layers have not begun."""
        self.mask.end()
        present = self.present
        if present is not None and present.level < 0 and not present.running:
            self._budget.release(present, present.estimates)
            number = len(self.all) - 1
            self.all[-1] = self._fresh(header, number, self._outline.leans[number])
