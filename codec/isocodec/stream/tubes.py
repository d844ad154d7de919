"""The tubes of a file's isovalues and of its mask, as a decoder begins them (spec clauses 3.5.5, 3.5.6, 11.2)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from ..errors import LimitError, OptionError
from ..format.header import Header
from ..format.program import Progress
from ..layers.beginning import leaning_tube
from ..layers.contents import Contents
from ..limits import Budget, Limits
from ..passes.runner import Tube
from .mask_strand import MaskStrand

_ROOM = 4096
"""Bytes of runs that a coder has room for at first."""


class Tubes:
    """Tubes, one for each isovalue that has come.

    Parameters
    ----------
    limits : Limits
    data : bytearray
        The file as far as it has come; it grows.
    contents : Contents
    budget : Budget
    only : collection of int, optional
        Numbers of the isovalues that are wanted.

    Attributes
    ----------
    all : list of Tube or None
        By isovalue, None for those that are skipped.
    progresses : list of Progress
        Where their programs stand.
    mask : MaskStrand
    """

    def __init__(
        self, limits: Limits, data: bytearray, contents: Contents, budget: Budget, only: Collection[int] | None
    ) -> None:
        self.all: list[Tube | None] = []
        self.progresses: list[Progress] = []
        self.mask = MaskStrand(limits, data, budget, self.all)
        self._limits = limits
        self._contents = contents
        self._budget = budget
        self._only = only

    @property
    def present(self) -> Tube | None:
        """That of the isovalue whose layers come at present; None if it is skipped."""
        return self.all[-1] if self.all else None

    def begin(self, header: Header, lean: int | None, offset: int) -> None:
        """An isovalue has come, which may lean on an earlier one."""
        number = len(self.all)
        if number >= self._limits.isovalues:
            raise LimitError(
                f"more than {self._limits.isovalues} isovalues", code="limit-isovalues", offset=offset, clause="11.2"
            )
        if self.present is not None:
            self.present.rest()
        before = self.progresses[-1] if self.progresses else Progress(0)
        if self._only is not None and number not in self._only:
            self.all.append(None)
            self.progresses.append(before)
            return
        if lean is not None and self.all[lean] is None:
            raise OptionError(f"isovalue {number} leans on isovalue {lean}, which is not decoded", code="only")
        tube = self._fresh(header, number, lean)
        before = replace(before, full_level=tube.full_level)
        self.progresses.append(before.begin(None if lean is None else self.progresses[lean]))
        self.all.append(tube)

    def _fresh(self, header: Header, number: int, lean: int | None) -> Tube:
        """A tube of an isovalue of which no layer has come."""
        isovalues = self._contents.isovalues
        earlier, other = (None, 0.0) if lean is None else (self.all[lean], isovalues[lean])
        return leaning_tube(
            header, isovalues[number], earlier, other, _ROOM, self._left(), budget=self._budget, holes=self.mask.holes
        )

    def _left(self) -> Limits:
        """What one more tube may have: those of a file may not have more than a single one."""
        whole, tubes = self._limits, [tube for tube in (*self.all, self.mask.tube) if tube]
        return replace(
            whole, vertices=max(whole.vertices - sum(tube.vertices for tube in tubes), 0),
            simplices=max(whole.simplices - sum(tube.simplices for tube in tubes), 0),
        )  # fmt: skip

    def begin_mask(self, header: Header, offset: int) -> None:
        """The chunk of the mask begins."""
        self._contents.begin_mask(offset)
        self.mask.begin(header, self._left())

    def end_mask(self, header: Header) -> None:
        """The mask is complete; an isovalue of which no layer has begun is coded with it."""
        self.mask.end()
        present = self.present
        if present is not None and present.level < 0 and not present.running:
            self._budget.release(present, present.estimates)
            number = len(self.all) - 1
            self.all[-1] = self._fresh(header, number, self._contents.leans[number])
