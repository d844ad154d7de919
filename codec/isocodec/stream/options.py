"""What is asked of an encoder: its options, as numbers, and none that contradict one another."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np

from isospec.container import MAX_ISOVALUES

from ..errors import OptionError
from ..field.samples import isovalue_of
from ..layers.plan import Entry
from ..search.strategy import EXACT
from ..search.tolerance import radices

SEARCHED = 0.1
"""From this tolerance on the mesh is chosen; below it nearly every crossing of the grid has to be told anyway."""


@dataclass(frozen=True)
class Asked:
    """Options of an encoder, as given."""

    exact: bool
    tolerance: float | None
    signs_only: bool
    step: float | None
    base_level: int | None
    preserve_topology: bool
    steps: list[float] | None
    criterion: str | None
    parameter: float | None
    plan: Sequence[Entry] | Mapping[float, Sequence[Entry]] | None


def check_options(o: Asked) -> None:
    """Refuse options that contradict one another."""
    given = {name: value is not None and value is not False for name, value in vars(o).items()}
    precise = [name for name in ("exact", "tolerance", "signs_only", "step", "steps") if given[name]]
    shape = [name for name in ("base_level", "steps", "criterion") if given[name]]
    if o.plan is not None and (shape or o.preserve_topology or precise not in ([], ["step"])):
        raise OptionError("a plan contradicts the other options", code="options", remedy="give the plan alone")
    for names in (precise, shape):
        if len(names) > 1:
            raise OptionError(f"{' and '.join(names)} contradict one another", code="options", remedy="choose one")
    if o.base_level is not None and o.preserve_topology:
        raise OptionError(
            "base_level and preserve_topology contradict one another: a uniform base keeps no topology", code="options",
            remedy="leave out base_level",
        )  # fmt: skip
    if o.criterion == "level" and o.preserve_topology:
        raise OptionError(
            "the criterion level and preserve_topology contradict one another: a uniform mesh keeps no topology",
            code="options", remedy="leave out one, or choose another criterion",
        )  # fmt: skip
    if o.parameter is not None and o.criterion is None:
        raise OptionError("a parameter without a criterion", code="criterion", remedy="name the criterion")
    if o.parameter is not None and not (math.isfinite(o.parameter) and o.parameter >= 0):
        raise OptionError(f"the criterion's parameter is {o.parameter}, needed is a positive number", code="criterion")
    radices(o.tolerance)


def notes_of(metadata: Mapping[str, str]) -> dict[str, str]:
    """Metadata that a reader will find again."""
    if not isinstance(metadata, Mapping):
        raise OptionError(
            f"metadata is {metadata!r}, needed are texts by their names", code="metadata", remedy='{"unit": "m"}'
        )
    for key, text in metadata.items():
        if not (isinstance(key, str) and isinstance(text, str)):
            raise OptionError(
                f"metadata {key!r}: {text!r}, needed is text", code="metadata", remedy="write numbers as text"
            )
        try:
            (key + text).encode()
        except UnicodeEncodeError:
            raise OptionError(f"metadata {key!r}: {text!r} is no text in Unicode", code="metadata") from None
    return dict(metadata)


def number_of(name: str, value: object) -> float | None:
    """An option that is a number of Python's or numpy's, if it is given."""
    if value is None:
        return None
    if not isinstance(value, Real) or isinstance(value, bool):
        raise OptionError(f"{name} is {value!r}, needed is a number", code=name)
    return float(value)


def whole_of(name: str, value: object) -> int | None:
    """The same of whole numbers."""
    number = number_of(name, value)
    if number is not None and not number.is_integer():
        raise OptionError(f"{name} is {value!r}, needed is a whole number", code=name)
    return None if number is None else int(number)


def steps_of(steps: Sequence[float | str] | None) -> list[float] | None:
    """Steps as numbers."""
    if steps is None:
        return None
    if isinstance(steps, str) or not isinstance(steps, Iterable):
        raise OptionError(f"steps are {steps!r}, needed is a sequence", code="steps", remedy="for example 4, 1, 0.25")
    out = [EXACT if step in ("exact", 0) else number_of("steps", step) or math.nan for step in steps]
    for step in out[:-1] if out and out[-1] == EXACT else out:
        if not (math.isfinite(step) and step >= SEARCHED):
            raise OptionError(
                f"a step of {step!r}, needed is a number of cells from {SEARCHED:g} on", code="steps",
                remedy="the last one may be exact",
            )  # fmt: skip
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
        raise OptionError(f"{len(values)} isovalues, at most {MAX_ISOVALUES} fit a file", code="isovalue")
    return values


def plan_of(given: object, isovalue: float) -> Sequence[Entry]:
    """What a plan, or one of each isovalue, says of an isovalue."""
    if isinstance(given, Mapping):
        if isovalue not in given:
            raise OptionError(f"the plan says nothing of the isovalue {isovalue!r}", code="plan")
        given = given[isovalue]
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise OptionError(
            f"the plan is {given!r}, needed is a sequence", code="plan", remedy='begin it with ("base", level)'
        )
    return given
