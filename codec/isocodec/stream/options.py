"""The options of an encoder, with the checks that each of them and all together have to pass."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike

from isospec.container import MAX_ISOVALUES, Profile

from ..errors import OptionError
from ..field.placement import CRS, PLACEMENT, Placement, placement_of, read_placement
from ..field.samples import isovalue_of
from ..grid.layers.plan import Entry
from ..search.strategy import EXACT
from ..search.tolerance import radices
from .names import CriterionName, Distance, ProfileName

DEFAULT_TOLERANCE = 0.05
"""Largest distance in cells between decoded and extracted curve when nothing else is asked for."""
SEARCHED = 0.1
"""From this tolerance on the mesh is chosen; below it nearly every crossing of the grid has to be coded anyway."""
PRECISIONS = ("exact", "tolerance", "signs_only", "step", "steps")
"""Options that set the precision."""
MESHES = ("base_level", "steps", "criterion")
"""Options that choose the mesh."""
EXCLUSIVE = (
    PRECISIONS, MESHES,
    *(("plan", name) for name in (*PRECISIONS, *MESHES, "preserve_topology") if name != "step"),
)
"""Of each of these groups an encoder takes one option."""


class EncodeOptions(TypedDict, total=False):
    """Options of `isocodec.encode`, by name."""

    exact: bool
    tolerance: float | str | None
    signs_only: bool
    step: float | None
    base_level: int | None
    preserve_topology: bool
    steps: Sequence[Distance] | None
    criterion: CriterionName | None
    parameter: float | None
    leaning: bool
    mask: ArrayLike | None
    plan: Sequence[Entry] | Mapping[float, Sequence[Entry]] | None
    profile: ProfileName
    metadata: Mapping[str, str] | None
    placement: Placement | ArrayLike | None
    progress: Callable[[int, int], object] | None


@dataclass(frozen=True, kw_only=True)
class Options:
    """What an encoder is asked for: the keyword parameters of `encode`, `Encoder` and the command line.

    Numbers of any kind become Python's own. `encode` explains the options in full.

    Raises
    ------
    OptionError
        If options contradict one another or are out of range.
    """

    exact: bool = False
    """Integer data: keep the values next to the curve to the last bit."""
    tolerance: float | None = None
    """Largest distance, in cells, between the decoded and the extracted curve, both ways."""
    signs_only: bool = False
    """Keep only which samples lie above."""
    step: float | None = None
    """Float data: keep the values next to the curve to within half this step."""
    base_level: int | None = None
    """Uniform level of the base."""
    preserve_topology: bool = False
    """Every layer has the components of the curve, nested alike."""
    steps: Sequence[float | str] | None = None
    """Falling distances that the layers promise one after the other; the last may be "exact"."""
    criterion: str | None = None
    """Reduce the mesh under one criterion."""
    parameter: float | None = None
    """Number that the criterion takes."""
    leaning: bool = True
    """Each further isovalue makes use of the nearest one before it."""
    plan: Sequence[Entry] | Mapping[float, Sequence[Entry]] | None = None
    """The layers one by one, instead of all options above but ``step`` and ``leaning``."""
    profile: str = "main"
    """Entropy coding profile."""
    metadata: Mapping[str, str] | None = None
    """Notes to go into the file."""
    placement: Placement | ArrayLike | None = None
    """Where the samples lie in the world."""

    def __post_init__(self) -> None:
        for name in ("tolerance", "step", "parameter"):
            object.__setattr__(self, name, number_of(name, getattr(self, name)))
        object.__setattr__(self, "base_level", whole_of("base_level", self.base_level))
        object.__setattr__(self, "steps", _steps_of(self.steps))
        self._check_conflicts()
        self._check_criterion()
        radices(self.tolerance)
        if str(self.profile).upper() not in Profile.__members__:
            names = ", ".join(p.name.lower() for p in Profile)
            raise OptionError(f"unknown profile {self.profile!r}", code="profile", remedy=f"choose one of: {names}")
        object.__setattr__(self, "metadata", _notes_of(self.metadata or {}))

    @property
    def distances(self) -> tuple[float, ...] | None:
        """``steps`` as numbers, with `EXACT` for exact values."""
        return None if self.steps is None else tuple(float(step) for step in self.steps)

    def _check_conflicts(self) -> None:
        values = {name: getattr(self, name) for name in (*PRECISIONS, *MESHES)}
        given = {name for name, value in values.items() if value is not None and value is not False}
        if self.plan is not None and given - {"step"}:
            raise OptionError("a plan contradicts the other options", code="options", remedy="give the plan alone")
        names = conflict(given)
        if names:
            raise OptionError(f"{' and '.join(names)} contradict one another", code="options", remedy="choose one")
        where = self.placement
        if self.chooses_mesh and isinstance(where, Placement) and where.periodic and not where.inferred:
            raise OptionError(
                f"periodic axes and {self.chooses_mesh} cannot be combined: the mesh must be the same at both ends of "
                "the axis", code="periodic", remedy=f"use exact, step, signs_only or a tolerance below {SEARCHED:g}",
            )

    @property
    def chooses_mesh(self) -> str:
        """The option that leads to a mesh which is not uniform, if there is one."""
        chosen = {
            "plan": self.plan is not None, "steps": self.steps is not None, "criterion": self.criterion is not None,
            "tolerance": self.tolerance is not None and self.tolerance >= SEARCHED,
            "preserve_topology": self.preserve_topology,
        }
        return next((name for name, given in chosen.items() if given), "")

    def _check_criterion(self) -> None:
        if self.parameter is None:
            return
        if self.criterion is None:
            raise OptionError("a parameter without a criterion", code="criterion", remedy="name the criterion")
        if not (math.isfinite(self.parameter) and self.parameter >= 0):
            raise OptionError(
                f"the criterion's parameter is {self.parameter}; it must be a number from 0 on", code="criterion"
            )

    def check_data(self, integer: bool) -> None:
        """Refuse exact values of floats."""
        if not integer and (self.exact or EXACT in (self.distances or ())):
            raise OptionError(
                "exact is for integer data, and the field holds floats", code="exact", remedy="use step or tolerance"
            )

    def notes(self, n: int) -> dict[str, str]:
        """The metadata of the file of a field of ``n`` axes, where its samples lie included."""
        notes = dict(self.metadata or {})
        placement = placement_of(self.placement, n)
        own = {} if placement is None else placement.notes()
        if CRS in own:
            notes.setdefault(CRS, own[CRS])
        if PLACEMENT in own:
            if PLACEMENT in notes:
                raise OptionError("placement and metadata of that name contradict one another", code="options")
            notes[PLACEMENT] = own[PLACEMENT]
        elif PLACEMENT in notes and read_placement(notes, n) is None:
            raise OptionError(
                f"the note {PLACEMENT}, {notes[PLACEMENT]!r}, cannot be understood by a reader",
                code="placement", remedy="see clause 3.7.2, or give the numbers as the option of that name",
            )
        return notes

    def plan_for(self, isovalue: float) -> Sequence[Entry] | None:
        """The plan of an isovalue, if plans are given."""
        given: object = self.plan
        if given is None:
            return None
        if isinstance(given, Mapping):
            if isovalue not in given:
                raise OptionError(f"the plan has no entry for the isovalue {isovalue!r}", code="plan")
            given = given[isovalue]
        if not isinstance(given, Sequence) or isinstance(given, str):
            raise OptionError(
                f"the plan is {given!r}; it must be a sequence", code="plan", remedy='begin it with ("base", level)'
            )
        return given


def conflict(given: Collection[str]) -> tuple[str, ...]:
    """Those of the options given that contradict one another: of the first group of which there are several."""
    for group in EXCLUSIVE:
        names = tuple(name for name in group if name in given)
        if len(names) > 1:
            return names
    return ()


def _notes_of(metadata: object) -> dict[str, str]:
    """Metadata that a reader will find again."""
    if not isinstance(metadata, Mapping):
        raise OptionError(
            f"metadata is {metadata!r}; it must map names to texts", code="metadata", remedy='{"unit": "m"}'
        )
    for key, text in metadata.items():
        if not (isinstance(key, str) and isinstance(text, str)):
            raise OptionError(
                f"metadata {key!r}: {text!r}; it must be text", code="metadata", remedy="write numbers as text"
            )
        try:
            (key + text).encode()
        except UnicodeEncodeError:
            raise OptionError(f"metadata {key!r}: {text!r} is not Unicode text", code="metadata") from None
    return dict(metadata)


def number_of(name: str, value: object) -> float | None:
    """An option that is a number of Python's or numpy's, if it is given."""
    if value is None:
        return None
    if not isinstance(value, Real) or isinstance(value, bool):
        raise OptionError(f"{name} is {value!r}; it must be a number", code=name)
    return float(value)


def whole_of(name: str, value: object) -> int | None:
    """The same of whole numbers."""
    number = number_of(name, value)
    if number is not None and not number.is_integer():
        raise OptionError(f"{name} is {value!r}; it must be a whole number", code=name)
    return None if number is None else int(number)


def _steps_of(steps: object) -> tuple[float, ...] | None:
    """Steps as numbers."""
    if steps is None:
        return None
    if isinstance(steps, str) or not isinstance(steps, Iterable):
        raise OptionError(
            f"steps are {steps!r}; they must be a sequence", code="steps", remedy="for example 4, 1, 0.25"
        )
    out = tuple(EXACT if step in ("exact", 0) else number_of("steps", step) or math.nan for step in steps)
    for step in out[:-1] if out and out[-1] == EXACT else out:
        if not (math.isfinite(step) and step >= SEARCHED):
            raise OptionError(
                f"a step of {step!r}; it must be a number of cells from {SEARCHED:g} on", code="steps",
                remedy="the last one may be exact",
            )
    if not out:
        raise OptionError("no steps", code="steps", remedy="for example 4, 1, 0.25")
    return out


def isovalues_of(given: object) -> list[float]:
    """The isovalues of a file, from one number or a sequence of them.

    Raises
    ------
    InputError
        If one is not a number that a file can hold.
    OptionError
        If there are none, two that are equal, or too many.
    """
    if isinstance(given, str | bytes) or not isinstance(given, Sequence | np.ndarray) or np.shape(given) == ():
        return [isovalue_of(given)]
    values = [isovalue_of(value) for value in given]
    if not values:
        raise OptionError("no isovalue", code="isovalue", remedy="give one")
    if len(set(values)) < len(values):
        raise OptionError("an isovalue is given twice", code="isovalue", remedy="give each once")
    if len(values) > MAX_ISOVALUES:
        raise OptionError(f"{len(values)} isovalues; a file holds at most {MAX_ISOVALUES}", code="isovalue")
    return values


def nearest_before(isovalues: Sequence[float], number: int) -> int:
    """Number of the isovalue that a further one leans on: of those before it the one that lies nearest."""
    return min(range(number), key=lambda i: abs(isovalues[i] - isovalues[number]))


def check_interval(interval: int) -> int:
    """Every how many frames one leans on none before it.

    Raises
    ------
    OptionError
        If it is no number from 0 on.
    """
    if not (isinstance(interval, (int, np.integer)) and 0 <= interval < 1 << 32):
        raise OptionError(
            f"interval is {interval}; it must be a whole number from 0 on", code="interval",
            remedy="0 lets all frames but the first lean on the one before",
        )
    return int(interval)
