"""The tubes (decoded states) of a file's isovalues and of its mask, for decoders (spec 3.5.5, 3.5.6, 11.2)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import cast

import numpy as np

from ..entropy.range_coder import Coder
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
    frame : int or None
        As given.
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
        self.frame = frame
        self._progresses_before: list[Progress] = []
        self._header: Header | None = None
        self._settled = 0
        self._known: dict[int, tuple[int, int]] = {}
        self._sum = np.zeros(2, np.int64)
        self._at: int | None = None
        self._layered: set[int] = set()

    @property
    def present(self) -> Tube | None:
        """A tube of the isovalues whose layers are being read; None if they are skipped."""
        if not self.all or self.past:
            return None
        turn = self._outline.turn
        found = [self.all[number] for number in turn if number < len(self.all)]
        if None in found and any(found):
            raise OptionError("layers of isovalues in turn can only be decoded together", code="only")
        return found[0] if found else None

    @property
    def turn(self) -> range:
        """Numbers of the isovalues that the next chunk of layers belongs to."""
        return self._outline.turn

    def lean(self, number: int) -> int | None:
        """Number of the isovalue of a turn that this one leans on, which may have had layers since this one began."""
        return self._outline.leans[number] if self._outline.turned else None

    def layered(self, number: int) -> None:
        """A chunk of layers of an isovalue has begun."""
        self._outline.layered.add(number)
        self._layered.add(number)

    def ready(self, number: int) -> Tube:
        """The tube of an isovalue whose next layer begins; it is made anew if it was made before what it leans on."""
        tube = self.all[number]
        assert tube is not None and self._header is not None
        self._outline.number = number
        if number != self._at:
            self._recount(number)
            tube.limits = self._left(number)
        if not tube.begun:
            lean = self._outline.leans[number]
            stale = tube.holes is not self.mask.holes or (
                lean is not None and tube.lean is None and cast("Tube", self.all[lean]).level >= 0
            )
            if self._outline.frame == 0 and (stale or number < self._settled):
                self._budget.release(tube, tube.estimates)
                tube = self.all[number] = self._fresh(self._header, number, lean, coder=tube.coder)
                self._recount(number)
        return tube

    @property
    def past(self) -> bool:
        """Whether the wanted frame has been passed."""
        return self.frame is not None and self._outline.frame > self.frame

    def _is_wanted(self, number: int) -> bool:
        """Whether isovalue ``number`` of the current frame is to be decoded."""
        if self._only is not None and number not in self._only:
            return False
        interval, frame = self._outline.interval, self.frame
        return frame is None or interval is None or self._outline.frame >= key_of(frame, interval)

    def begin(self, header: Header, lean: int | None, offset: int) -> None:
        """Begin an isovalue, which may be predicted from an earlier one."""
        number = len(self.all)
        if number >= self._limits.isovalues:
            raise LimitError(
                f"more than {self._limits.isovalues} isovalues", code="limit-isovalues", offset=offset, clause="11.2"
            )
        self.settle()
        self._header = header
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
        self._forget()

    def begin_frame(self, header: Header, event: FrameRead) -> None:
        """Begin an isovalue of a further frame; the tubes of the previous frame are in ``before``."""
        if self.past:
            return
        self.settle()
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
        self.settle()
        self.before[:], self._progresses_before = self.all, list(self.progresses)
        self.all.clear()
        self.progresses.clear()
        self._forget()
        self._sum[:] = sum((np.array(_size(tube)) for tube in self.before if tube), np.zeros(2, np.int64))

    def _fresh(
        self, header: Header, number: int, lean: int | None, before: bool = False, coder: Coder | None = None
    ) -> Tube:
        """Make the tube of an isovalue, predicted from one of its frame or of the previous one, if any."""
        isovalues = self._outline.isovalues
        tubes = self.before if before else self.all
        earlier, other = (None, 0.0) if lean is None else (tubes[lean], isovalues[lean])
        return leaning_tube(
            header, isovalues[number], earlier, other, _ROOM, self._left(), budget=self._budget, holes=self.mask.holes,
            frame=before, coder=coder,
        )

    def _left(self, number: int | None = None) -> Limits:
        """Limits for one more tube, or for one that goes on: all of a file together stay within the limits of one."""
        self._recount(self._at)
        mask = self.mask.tube
        held = self._sum - self._known.get(-1 if number is None else number, (0, 0)) + (_size(mask) if mask else 0)
        vertices, simplices = np.maximum((self._limits.vertices, self._limits.simplices) - held, 0).tolist()
        return replace(self._limits, vertices=vertices, simplices=simplices)

    def _recount(self, number: int | None) -> None:
        """Count what the tube holds whose layers came so far; those of another isovalue come from now on."""
        for at in {self._at, number} - {None}:
            assert at is not None
            tube = self.all[at] if at < len(self.all) else None
            size = _size(tube) if tube else (0, 0)
            self._sum += np.subtract(size, self._known.get(at, (0, 0)), dtype=np.int64)
            self._known[at] = size
        self._at = number

    def _forget(self) -> None:
        """Count nothing: a further frame begins."""
        self._settled, self._at = 0, None
        self._known.clear()
        self._layered.clear()
        self._sum[:] = 0

    def settle(self) -> None:
        """Let the isovalues rest to which no further layers come, and those that have none yet."""
        for number in {*self._layered, *range(self._settled, len(self.all))}:
            tube = self.all[number]
            if tube is not None:
                tube.rest()
        self._layered.clear()
        self._settled = len(self.all)
        self._recount(None)

    def begin_mask(self, header: Header, offset: int) -> None:
        """Begin the chunk of the mask."""
        self._outline.begin_mask(offset)
        self.mask.begin(header, self._left())

    def end_mask(self, header: Header) -> None:
        """Use the complete mask for isovalues whose layers have not begun."""
        self.mask.end()


def _size(tube: Tube) -> tuple[int, int]:
    """Vertices and simplices of a tube."""
    return tube.vertices, tube.simplices
