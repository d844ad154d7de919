"""The options of `encode`, parsed once from texts, numbers and sequences."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import Any, Literal, SupportsFloat, TypeAlias, TypedDict

import numpy as np

from isospec.container import Profile

from ..drawing.smoothing import NEAR
from ..errors import OptionError
from ..field.placement import PLACEMENT, read_placement
from ..field.units import distance_of
from ..grid.lattice.tables import cube_exponent
from ..grid.layers.plan import Entry
from ..search.tolerance import EXACT
from .plan_meshes import ends_alike
from .promises import STEP

ProfileName: TypeAlias = Literal["main", "baseline"]
"""Profiles of entropy coding."""
EffortName: TypeAlias = Literal["normal", "best"]
"""Time that an encoder takes to search."""
CriterionName: TypeAlias = Literal["crossing", "topology", "curvature", "distortion", "level"]
"""Criteria for coarsening a mesh."""
PrecisionGiven: TypeAlias = "float | str | Sequence[float | str] | None"
"""Types that `Precision.of` parses."""
LayersGiven: TypeAlias = "int | str | Sequence[Entry] | Mapping[float, Sequence[Entry]] | None"
"""Types that `Layers.of` parses."""
Isovalues: TypeAlias = SupportsFloat | str | Sequence[SupportsFloat]
"""One number (of Python, numpy, a fraction or a decimal), several, also as an array, or "every 20 from 5"."""

DEFAULT_TOLERANCE = 0.05
"""Default distance, in cells, between decoded and extracted curve."""
SEARCHED = 0.1
"""Distance below which no search pays: most crossings have to be coded anyway. In cells, or median edges of a mesh."""
WORTH_SEARCHING = 0.75
"""From this tolerance in cells on, a search for a mesh is worth its time without being asked for."""
COORDINATES_SHARE = 0.05
"""Coordinates of samples may take this share of a distance in the world, unless it is stated how precise they are."""
KEY_INTERVAL = 16
"""Default interval of key frames: the last of many frames decodes in the time of so many."""
SMOOTH = " smooth"
"""Suffix of a precision."""
_CRITERIA = ("crossing", "topology", "curvature", "distortion", "level")
_WORDS = "crossing, topology, curvature=K, distortion=D or level=L"
EFFORTS = NORMAL, BEST = ("normal", "best")
"""Efforts of encoding."""
LEVELS, ISOVALUES, INDEPENDENT = ORDERS = ("levels", "isovalues", "independent")
"""Orders of the layers of several isovalues."""


class EncodeOptions(TypedDict, total=False):
    """Options of `isocodec.encode`, by name."""

    precision: PrecisionGiven
    keep_topology: bool
    profile: ProfileName
    effort: EffortName
    layers: LayersGiven
    order: str | None
    interval: int
    metadata: Mapping[str, str] | None


@dataclass(frozen=True, kw_only=True)
class Precision:
    """Precision of a file's curves; the default depends on what is encoded.

    Attributes
    ----------
    exact : bool
        Integer values next to the curve, to the last bit.
    signs : bool
        Only which samples lie above, without geometry.
    tolerance : float or None
        Largest distance between decoded and extracted curve, in both directions: in cells; on meshes, in the unit of
        the points.
    world : str
        The same distance, or steps of which some are, with a unit, in the world; `tolerance` or `steps` are found when
        the field is known.
    steps : tuple of float, or None
        Decreasing distances, in cells, that successive layers guarantee; 0 for exact values.
    step : float or None
        Values of floats next to the curve, to within half of this; after `steps`, they are the exact values of these.
    error : float
        What coordinates in the file may be off in cells, so that they keep to a distance in the world; 0 if they are
        left as precise as they are.
    smooth : bool
        On the full grid, with points that a decoder moves within their parts of edges, where that brings them nearer.
    """

    exact: bool = False
    signs: bool = False
    tolerance: float | None = None
    world: str = ""
    steps: tuple[float, ...] | None = None
    step: float | None = None
    error: float = 0.0
    smooth: bool = False

    @classmethod
    def of(cls, given: PrecisionGiven | Precision) -> Precision:
        """Parse a precision: a number, "exact", "signs", "100m", "step=0.5", distances as a sequence or "4,1m,exact".

        Distances may end in "exact" or "step=0.5"; a single distance and "signs" may end in " smooth".

        Raises
        ------
        OptionError
            If it is none of these.
        """
        if given is None:
            return cls()
        if isinstance(given, cls):
            return given
        if isinstance(given, str):
            return cls._of_text(given.strip())
        if isinstance(given, Iterable) and not isinstance(given, Mapping) and np.ndim(given) > 0:
            steps = list(given)
            texts = [isinstance(step, str) and step != "exact" for step in steps]
            return cls._of_text(",".join(map(str, steps))) if any(texts) else cls(steps=_steps_of(steps))
        return cls(tolerance=number_of("precision", given))

    @classmethod
    def _of_text(cls, text: str) -> Precision:
        if text.endswith(SMOOTH):
            plain = cls._of_text(text.removesuffix(SMOOTH).rstrip())
            if not (plain.signs or plain.tolerance is not None or (plain.world and "," not in plain.world)):
                raise OptionError(f"precision {text!r} has places that leave nothing to smooth", code="precision",
                                  remedy='smooth goes with signs or with one distance: "0.2 smooth"')
            return replace(plain, smooth=True)
        if text in ("exact", "signs"):
            return cls(exact=text == "exact", signs=text == "signs")
        if text.startswith(STEP):
            return cls(step=_in_text(text.removeprefix(STEP), text))
        if "," not in text:
            number, unit = distance_of(text)
            return cls(world=text) if unit else cls(tolerance=number)
        parts = [part.strip() for part in text.split(",")]
        if parts[-1].startswith(STEP):
            return replace(cls._of_text(",".join([*parts[:-1], "exact"])), step=cls._of_text(parts[-1]).step)
        found = [(0.0, "") if part == "exact" else distance_of(part) for part in parts]
        if any(unit for _, unit in found):
            return cls(world=",".join(parts))
        return cls(steps=_steps_of("exact" if part == "exact" else number
                                   for part, (number, _) in zip(parts, found, strict=True)))

    def in_cells(self, cells_of: Callable[[str], float], error: float = 0.0) -> Precision:
        """Convert distances in the world to cells.

        Parameters
        ----------
        cells_of : callable
            Converts one distance, as `Placement.cells_of`.
        error : float
            What coordinates in the file may be off, in cells, which is taken off.
        """
        if not self.world:
            return self
        parts = self.world.split(",")
        found = ["exact" if part == "exact" else cells_of(part) - (error if distance_of(part)[1] else 0.0)
                 for part in parts]
        if len(parts) > 1:
            return replace(self, world="", steps=_steps_of(found), error=error)
        (tolerance,) = (number for number in found if not isinstance(number, str))
        if tolerance <= 0:
            raise OptionError(f"the coordinates may be off by more than {self.world}", code="coordinates",
                              remedy="give a smaller error of coordinates")
        return replace(self, world="", tolerance=tolerance, error=error)

    @property
    def rounded(self) -> bool:
        """Whether a distance is in the world, or not in whole thousandths of a cell, which chunks of promises have."""
        distances = [each for each in (self.tolerance, *(self.steps or ())) if each and math.isfinite(each)]
        return bool(self.world) or any(abs(each * 1000 - round(each * 1000)) > 1e-6 for each in distances)

    @property
    def default(self) -> bool:
        """Whether nothing was chosen."""
        return self == Precision()

    @property
    def text(self) -> str:
        """The text that `of` parses to this; empty if nothing was chosen."""
        last = "exact" if self.step is None else f"{STEP}{self.step}"
        if self.steps is not None:
            return ",".join(last if step == EXACT else f"{step:g}" for step in self.steps)
        chosen = {
            "signs": self.signs, self.world.replace("exact", last): bool(self.world),
            f"{self.tolerance}": self.tolerance is not None, last: self.exact or self.step is not None,
        }
        return next((text for text, given in chosen.items() if given), "") + (SMOOTH if self.smooth else "")

    @property
    def offsets(self) -> float | None:
        """The distance along edges that crossings on the full grid are coded to, if one is given."""
        # moved points are up to a whole part away, less what they keep from its end
        if self.smooth and self.tolerance is not None:
            return self.tolerance / (2 - 2 * NEAR)
        return self.tolerance


@dataclass(frozen=True, kw_only=True)
class Layers:
    """Layers of a file; by default, they follow from the precision.

    Attributes
    ----------
    level : int or None
        Uniform level of the base.
    criterion : str or None
        Coarsen the mesh under this criterion.
    parameter : float or None
        Number that belongs to the criterion.
    plan : sequence of entries, or None
        Explicit layers for all isovalues.
    plans : mapping of float to sequence of entries, or None
        Explicit layers for each isovalue.
    """

    level: int | None = None
    criterion: str | None = None
    parameter: float | None = None
    plan: Sequence[Entry] | None = None
    plans: Mapping[float, Sequence[Entry]] | None = None

    @classmethod
    def of(cls, given: LayersGiven | Layers) -> Layers:
        """Parse layers: a level, "distortion=1.0", the entries of a plan, or entries by isovalue.

        Raises
        ------
        OptionError
            If it is none of these.
        """
        if given is None:
            return cls()
        if isinstance(given, cls):
            return given
        if isinstance(given, str):
            return cls._of_text(given)
        if isinstance(given, Mapping):
            return cls(plans=given)
        if isinstance(given, Real):
            return cls(level=whole_of("layers", given))
        if not isinstance(given, Sequence):
            raise OptionError(
                f"layers are {given!r}; they must be a sequence of entries", code="plan",
                remedy='begin it with ("base", level)',
            )
        return cls(plan=given)

    @classmethod
    def _of_text(cls, text: str) -> Layers:
        name, equals, number = text.strip().partition("=")
        if text.strip().isdecimal():
            return cls(level=int(text))
        if name not in _CRITERIA:
            raise OptionError(f"unknown layers {text!r}", code="plan", remedy=f"a level, or {_WORDS}")
        parameter = _in_text(number, text, f"give one of {_WORDS}") if equals else None
        if parameter is not None and not (math.isfinite(parameter) and parameter >= 0):
            raise OptionError(
                f"the criterion's parameter is {parameter}; it must be a number, 0 or greater", code="criterion"
            )
        if name in ("crossing", "topology") and parameter is not None:
            raise OptionError(f"the criterion {name} takes no number", code="criterion")
        if name in ("curvature", "distortion", "level") and parameter is None:
            raise OptionError(f"the criterion {name} needs a number", code="criterion")
        return cls(criterion=name, parameter=parameter)

    @property
    def planned(self) -> bool:
        """Whether the layers are given explicitly."""
        return self.plan is not None or self.plans is not None

    @property
    def default(self) -> bool:
        """Whether nothing was chosen."""
        return self == Layers()

    def keeps_open(self, shape: tuple[int, ...]) -> bool:
        """Whether a plan leads to a mesh that may differ at the two ends of periodic axes.

        ``shape`` includes the planes that close these.
        """
        plans = [*(self.plans or {}).values()] if self.plan is None else [self.plan]
        n = len(shape)
        return not ends_alike(plans, n, n * cube_exponent(shape))

    def plan_for(self, isovalue: float) -> Sequence[Entry] | None:
        """The plan of an isovalue, if plans are given."""
        if not self.planned:
            return None
        found: object = self.plan
        if self.plans is not None:
            if isovalue not in self.plans:
                raise OptionError(f"the plan has no entry for the isovalue {isovalue!r}", code="plan")
            found = self.plans[isovalue]
        if not isinstance(found, Sequence) or isinstance(found, str):
            raise OptionError(
                f"the plan is {found!r}; it must be a sequence", code="plan", remedy='begin it with ("base", level)'
            )
        return found


@dataclass(frozen=True, kw_only=True)
class Options:
    """The options of `encode` for all kinds of input, parsed by `of`.

    Attributes
    ----------
    precision : Precision
    keep_topology : bool
        Whether every layer has the components of the complete curve, nested in the same way.
    profile : str
        Entropy coding profile.
    effort : str
        "best" also searches where that saves little.
    layers : Layers
    order : str or None
        Order of the layers of several isovalues, one of `ORDERS`; None: "levels" where possible, else "isovalues".
    interval : int
        Frames whose number is a multiple of this are key frames; 0 if only the first is.
    metadata : mapping of str to str
        Notes for the file.
    """

    precision: Precision = Precision()
    keep_topology: bool = False
    profile: str = "main"
    effort: str = "normal"
    layers: Layers = Layers()
    order: str | None = None
    interval: int = KEY_INTERVAL
    metadata: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, **given: Any) -> Options:
        """Parse the keyword parameters of `encode`.

        Raises
        ------
        OptionError
            If one is unknown or out of range, or they cannot be combined.
        """
        if unknown := [name for name in given if name not in cls.__dataclass_fields__]:
            raise OptionError(f"unknown option {unknown[0]!r}", code="options",
                              remedy=f"one of {', '.join(cls.__dataclass_fields__)}")
        options = replace(
            cls(**given), precision=Precision.of(given.get("precision")), layers=Layers.of(given.get("layers")),
            interval=check_interval(given.get("interval", KEY_INTERVAL)),
            metadata=_notes_of(given.get("metadata") or {}),
        )
        if str(options.profile).upper() not in Profile.__members__:
            names = ", ".join(p.name.lower() for p in Profile)
            raise OptionError(
                f"unknown profile {options.profile!r}", code="profile", remedy=f"choose one of: {names}"
            )
        if options.effort not in EFFORTS:
            raise OptionError(f"unknown effort {options.effort!r}", code="effort",
                              remedy=f"one of: {', '.join(EFFORTS)}")
        if options.order not in (None, *ORDERS):
            raise OptionError(f"unknown order {options.order!r}", code="order", remedy=f"one of: {', '.join(ORDERS)}")
        options._check_combined()
        return options

    def _check_combined(self) -> None:
        precision, layers = self.precision, self.layers
        if layers.planned and (self.keep_topology or not (precision.default or precision.step is not None)):
            other = "keep_topology" if self.keep_topology else f"precision {precision.text!r}"
            raise OptionError(f"a plan and {other} cannot be combined", code="options", remedy="give only the plan")
        if precision.smooth and not (layers.default and not self.keep_topology):
            raise OptionError(f"layers or topology and precision {precision.text!r} cannot be combined", code="options",
                              remedy="choose one")
        if precision.steps is not None and not layers.default:
            raise OptionError(f"layers and precision {precision.text!r} cannot be combined", code="options",
                              remedy="choose one")

    @property
    def independent(self) -> bool:
        """Whether isovalues and frames are coded without prediction from earlier ones."""
        return self.order == INDEPENDENT

    def searches(self, distance: float) -> bool:
        """Whether the encoder searches for a plan that keeps to a distance in cells."""
        return distance >= (SEARCHED if self.effort == BEST else WORTH_SEARCHING)

    @property
    def searched(self) -> float | None:
        """The tolerance, if the encoder searches for a plan that keeps to it."""
        tolerance = None if self.precision.smooth else self.precision.tolerance
        return tolerance if tolerance is not None and self.searches(tolerance) else None

    @property
    def entropy(self) -> Profile:
        """The profile, as stored in headers."""
        return Profile[self.profile.upper()]

    def check_data(self, integer: bool) -> None:
        """Refuse exact values for floating-point data."""
        exact = self.precision.exact or EXACT in (self.precision.steps or ())
        if exact and self.precision.step is None and not integer:
            raise OptionError(
                "precision 'exact' is for integer data, and the field holds floats", code="exact",
                remedy="use step=.. or a distance",
            )

    def check_unused(self, kind: str, given: Mapping[str, bool]) -> None:
        """Refuse options that do not apply to this kind of file: names, and whether each was given."""
        if name := next((name for name, there in given.items() if there), ""):
            raise OptionError(f"{name} does not apply to {kind}", code=name.split()[0], remedy="leave it out")

    def check_placement_note(self, n: int) -> None:
        """Refuse a note of a placement that a reader would ignore."""
        if PLACEMENT in self.metadata and read_placement(self.metadata, n) is None:
            raise OptionError(
                f"the note {PLACEMENT}, {self.metadata[PLACEMENT]!r}, is not valid",
                code="placement", remedy="see clause 3.7.2, or give the numbers as the placement of a Field",
            )


def _notes_of(metadata: object) -> dict[str, str]:
    """Check metadata, which must survive being written to JSON."""
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
    """Convert an option to a float; None stays None."""
    if value is None:
        return None
    if not isinstance(value, Real) or isinstance(value, bool):
        raise OptionError(f"{name} is {value!r}; it must be a number", code=name)
    return float(value)


def whole_of(name: str, value: object) -> int | None:
    """Check that an option is an integer; None stays None."""
    number = number_of(name, value)
    if number is not None and not number.is_integer():
        raise OptionError(f"{name} is {value!r}; it must be a whole number", code=name)
    return None if number is None else int(number)


def _steps_of(steps: object) -> tuple[float, ...] | None:
    """Convert the distances of successive steps to numbers."""
    if steps is None:
        return None
    if isinstance(steps, str) or not isinstance(steps, Iterable):
        raise OptionError(
            f"steps are {steps!r}; they must be a sequence", code="steps", remedy="for example 4, 1, 0.25"
        )
    out = tuple(EXACT if step in ("exact", 0) else number_of("steps", step) or math.nan for step in steps)
    for step in out[:-1] if out and out[-1] == EXACT else out:
        if not (math.isfinite(step) and step > 0):
            raise OptionError(f"the distance {step!r} in a sequence must be above 0", code="steps",
                              remedy="only the last one may be exact or step=..")
    if not out:
        raise OptionError("no steps", code="steps", remedy="for example 4, 1, 0.25")
    return out


def _in_text(number: str, text: str, remedy: str = "for example 0.5") -> float:
    """Parse a number in the text of an option."""
    try:
        return float(number)
    except ValueError:
        raise OptionError(f"{number!r} in {text!r} is not a number", code="options", remedy=remedy) from None


def check_interval(interval: int) -> int:
    """Check the interval of key frames.

    Raises
    ------
    OptionError
        If it is not an integer, 0 or greater.
    """
    if not (isinstance(interval, (int, np.integer)) and 0 <= interval < 1 << 32):
        raise OptionError(
            f"interval is {interval}; it must be an integer, 0 or greater", code="interval",
            remedy="with 0, every frame but the first is predicted from the one before it",
        )
    return int(interval)
