"""The tubes (decoded states) of a file's isovalues and of its mask, for decoders (spec 3.5.5, 3.5.6, 5.10, 11.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..entropy.panel import no_panel
from ..entropy.range_coder import Coder
from ..errors import LimitError, OptionError
from ..format.header import Header
from ..grid.layers.beginning import further_coder, leaning_tube, mask_tube, shared_coder
from ..grid.layers.layer_reader import MaskReader
from ..grid.passes.runner import Tube
from ..grid.tube.holes import Holes
from ..limits import Limits
from .session import Session

_ROOM = 4096
"""Initial size, in bytes, of a coder's buffer for runs."""


@dataclass
class _Models:
    """Models that isovalues without layers are to begin with, made when the first of these has a layer.

    Attributes
    ----------
    earlier : Coder or None
        Whose models they are copies of; None for those of the start of a file.
    frame : bool
        Whether that is of the frame before.
    coder : Coder or None
        With the models, once they are made.
    """

    earlier: Coder | None
    frame: bool = False
    coder: Coder | None = None


@dataclass(frozen=True)
class _Waiting:
    """An isovalue without layers.

    Attributes
    ----------
    models : _Models
    lean : int or None
        Number of the isovalue that it leans on.
    earlier : Tube or None
        The tube of that one, if it had layers already.
    before : bool
        Whether it is of the frame before.
    """

    models: _Models
    lean: int | None
    earlier: Tube | None
    before: bool


class Tubes:
    """Tubes (decoded states), one for each isovalue read so far, and that of the mask.

    Nothing is allocated for an isovalue before its first layer: until then it has the tube ``_empty``.

    Parameters
    ----------
    session : Session
    header : Header

    Attributes
    ----------
    all : list of Tube or None
        By isovalue; None for those that are skipped. In a series, those of the current frame, or of the one wanted.
    before : list of Tube or None
        Tubes of the previous frame, from which the current ones may be predicted.
    mask : list of Tube or None
        The tube of the mask, if its chunk has begun.
    holes : Holes or None
        The holes that the mask describes, if it is complete.
    mask_reader : MaskReader or None
        Reader of the chunk of the mask, while it comes.
    """

    def __init__(self, session: Session, header: Header) -> None:
        self.all: list[Tube | None] = []
        self.before: list[Tube | None] = []
        self.mask: list[Tube | None] = []
        self.holes: Holes | None = None
        self.mask_reader: MaskReader | None = None
        self._session, self._outline, self._header = session, session.outline, header
        self._limits, self._budget = session.limits, session.budget
        self._empty: Tube | None = None
        self._waiting: dict[int, _Waiting] = {}
        self._models_before: dict[int, _Models] = {}
        self._kept: dict[int, Coder] = {}
        self._known: dict[int, tuple[int, int]] = {}
        self._sum = np.zeros(2, np.int64)
        self._at: int | None = None
        self._layered: set[int] = set()

    @property
    def present(self) -> Tube | None:
        """A tube of the isovalues whose layers are being read; None if they are skipped."""
        if not self.all or self._outline.past:
            return None
        found = [self.all[number] for number in self.turn if number < len(self.all)]
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
        self._kept.clear()

    def ready(self, number: int) -> Tube:
        """The tube of an isovalue whose next layer begins or goes on."""
        tube = self.all[number]
        assert tube is not None
        self._outline.number = number
        moved = number != self._at
        if moved:
            self._recount(number)
        if number in self._waiting:
            tube = self.all[number] = self._fresh(number, self._waiting.pop(number))
        elif moved:
            tube.limits = self._left(number)
        return tube

    def begin(self, lean: int | None, before: bool = False) -> None:
        """Begin an isovalue, which may be predicted from an earlier one of its frame or of the previous one."""
        if self._outline.past:
            return
        number = len(self.all)
        if number >= self._limits.isovalues:
            raise LimitError(f"more than {self._limits.isovalues} isovalues", code="limit-isovalues",
                             offset=self._session.at, clause="11.2")
        self.settle()
        if not self._outline.needs(number):
            self.all.append(None)
            return
        earlier = self.before if before else self.all
        if lean is not None and (lean >= len(earlier) or earlier[lean] is None):
            raise OptionError(f"isovalue {number} is predicted from isovalue {lean}, which is not decoded", code="only")
        self._wait(number, lean, before)

    def begin_series(self) -> None:
        """Handle that the file is a series, whose first frame may not be wanted."""
        for number in range(len(self.all)):
            if not self._outline.needs(number):
                self.all[number] = None
        self._forget()

    def next_frame(self) -> None:
        """Release the previous frame, and make the current one the previous."""
        self._budget.release(*(held for tube in self.before if tube for held in (tube, tube.estimates)))
        self.settle()
        self.before[:] = self.all
        self._models_before = {number: waiting.models for number, waiting in self._waiting.items()}
        self.all.clear()
        self._waiting.clear()
        self._kept.clear()
        self._forget()
        self._sum[:] = sum((np.array(_size(tube)) for tube in self.before if tube), np.zeros(2, np.int64))

    def _wait(self, number: int, lean: int | None, before: bool) -> None:
        """Let an isovalue begin, which leans on one of its frame or of the previous one, if on any."""
        earlier: Tube | None = None
        if lean is None:
            models = _Models(None)
        elif not before and lean in self._waiting:
            models = self._waiting[lean].models
        elif before and lean in self._models_before:
            then = self._models_before[lean]
            models = _Models(then.coder or then.earlier, True)
        else:
            earlier = (self.before if before else self.all)[lean]
            assert earlier is not None
            models = _Models(earlier.coder, True) if before else _Models(self._models_of(lean, earlier))
        self._waiting[number] = _Waiting(models, lean, earlier, before)
        if self._empty is None:
            self._empty = leaning_tube(self._header, 0.0, None, 0.0, 0, self._limits)
            self._empty.rest()
        self.all.append(self._empty)

    def drop(self, number: int) -> None:
        """Forget what an isovalue would begin with, whose tube has been dropped."""
        self._waiting.pop(number, None)
        if not any(self.all):
            self._empty = None

    def _models_of(self, number: int, tube: Tube) -> Coder:
        """Models of an isovalue that has had its layers; others with the same ones may change them later."""
        if number not in self._kept:
            blend = tube.coder.blend
            self._kept[number] = tube.coder._replace(blend=blend._replace(mix=blend.mix.copy(), panel=no_panel()))
        return self._kept[number]

    def _fresh(self, number: int, waiting: _Waiting) -> Tube:
        """Make the tube of an isovalue whose first layer begins."""
        models, lean, isovalues = waiting.models, waiting.lean, self._outline.isovalues
        shares = models.coder is not None
        if models.coder is None:
            models.coder = further_coder(self._header, models.earlier, _ROOM, models.frame)
        earlier = waiting.earlier
        if earlier is None and lean is not None:
            earlier = (self.before if waiting.before else self.all)[lean]
        return leaning_tube(
            self._header, isovalues[number], earlier, 0.0 if lean is None else isovalues[lean], _ROOM,
            self._left(number), budget=self._budget, holes=self.holes, frame=waiting.before,
            coder=shared_coder(models.coder, _ROOM) if shares else models.coder, shares=shares,
        )

    def _left(self, number: int | None = None) -> Limits:
        """Limits for one more tube, or for one that goes on: all of a file together stay within the limits of one."""
        self._recount(self._at)
        own = self._known.get(-1 if number is None else number, (0, 0))
        held = self._sum - own + sum((np.array(_size(tube)) for tube in self.mask if tube), np.zeros(2, np.int64))
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
        """Count nothing: another frame begins."""
        self._at = None
        self._known.clear()
        self._layered.clear()
        self._sum[:] = 0

    def settle(self) -> None:
        """Let the isovalues rest that get no more layers."""
        for number in self._layered:
            tube = self.all[number]
            if tube is not None:
                tube.rest()
        self._layered.clear()
        self._recount(None)

    def begin_mask(self) -> None:
        """Begin the chunk of the mask."""
        tube = mask_tube(self._header, _ROOM, self._left(), budget=self._budget)
        self.mask.append(tube)
        self.mask_reader = MaskReader(self._limits, self._session.data, tube, self.all, self._session.account)

    def end_mask(self) -> None:
        """Use the complete mask for isovalues whose layers have not begun."""
        tube = self.mask[-1]
        assert tube is not None
        tube.rest()
        self.mask_reader, self.holes = None, Holes(tube.state)


def _size(tube: Tube) -> tuple[int, int]:
    """Vertices and simplices of a tube."""
    return tube.vertices, tube.simplices
