"""Plans as text: the layers of a file one by one, a line each (spec clause 3.6).

A plan is read from the top; everything after a ``#`` is a comment. A *level* of the mesh bisects all cells of the level
before; the finest level, the full grid, reaches every sample. Lines are

``isovalue V``
    Begins the layers of an isovalue. Without such lines the plan applies to every isovalue that is encoded.
``base [LEVEL]``
    A base on the uniform mesh of a level, or of the full grid if no level is given.
``adaptive-base [LEVEL] CRITERION ..``
    A base on a mesh coarsened under criteria, uniform at least up to a level (default 0).
``leaf-base``
    A base on the mesh of the earlier isovalue that this one is predicted from.
``refine [ROUNDS]``
    Uniform rounds of refinement, one layer each; without a number, as many as lead to the full grid.
``raster``
    All signs that are not known yet, row by row, in one layer: for text, plots and other fields of two axes without
    shapes to follow. It may also be the first layer.
``adapt CRITERION .. [same-components]``
    A layer that refines the mesh to one coarsened under criteria; with ``same-components`` it may add no component.
``values [BITS]``, ``values left=BITS``
    Geometry by values of the samples next to the curve, one bit per layer. With BITS: that many more bits; with
    left=BITS: until that many bits remain; with neither: down to the last bit. ``values 0`` codes newly added vertices
    to the precision that the others already have.
``offsets RADIX [unit=U]``
    Geometry by crossing offsets: where along its edge each crossing lies. The interval that may hold the crossing is
    divided into RADIX (odd) parts; on a mesh coarser than the full grid, an edge has RADIX parts for every 2**U samples
    of its length.

A CRITERION is a condition that the coarsened mesh must meet; if several are given, the mesh satisfies them all.
``crossing``: the cells that the curve crosses stay as in the full grid; ``topology``: the curve keeps its topology;
``distortion=D``: with the values or offsets that follow the line at once, or else with signs alone, the curve stays
within D cells of the original, both ways, as it is decoded; ``curvature=K``: the mesh stays finest where the curve's
mean curvature exceeds K per cell; ``level=L``: the mesh is finer than level L only where ``crossing``, ``topology`` or
``curvature`` keep it so. Meshes of later lines contain those of earlier lines, whatever is stated, and ``crossing``,
``topology`` and ``curvature`` hold for them, too; ``distortion`` and ``level`` apply to the mesh of their own line.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any

from ..errors import OptionError
from ..format.kinds import LayerKind
from ..format.program import Progress, expand
from ..grid.layers.plan import Criteria, Entry, Line, where
from .series import nearest_before

ISOVALUE = "isovalue"
CRITERIA = "crossing, topology, curvature=K, distortion=D or level=L"
MOST_BITS = 52
"""Most bits of values that there can be (spec clause 3.6.4); the actual number is known only while layers are made."""

Plan = list[Entry]


def read_plan(text: str) -> Plan | dict[float, Plan]:
    """Parse the text of a plan, for `encode`: one plan for all isovalues, or one for each isovalue that it names.

    Raises
    ------
    OptionError
        Naming the line that cannot be understood. Whether a plan can be carried out is known only with the field.
    """
    everything: Plan = []
    sections: dict[float, Plan] = {}
    layers = everything
    for number, line in enumerate(text.splitlines(), start=1):
        said = " ".join(line.partition("#")[0].split())
        if not said:
            continue
        at = Line((), number, said)
        word, *rest = said.split()
        if word != ISOVALUE:
            layers.append(Line(_entry(at, word, rest), number, said))
            continue
        isovalue = _isovalue(at, rest)
        if everything or isovalue in sections or (not layers and sections):
            raise _wrong(
                at, "layers before the first isovalue" if everything else "given twice" if isovalue in sections
                else "the isovalue before has no layers", "give each isovalue one line, followed by its layers",
            )
        layers = sections[isovalue] = []
    if not layers:
        raise OptionError("the plan has no layers", code="plan", remedy="begin with the line: base 0")
    return sections or everything


def check_plan(
    plan: Sequence[Sequence[Any]] | Mapping[float, Sequence[Sequence[Any]]], isovalues: Sequence[float],
    full_level: int, leaning: bool = True,
) -> None:
    """Refuse a plan that cannot be carried out on a grid, if that shows before its layers are made.

    Raises
    ------
    OptionError
        Naming the line, and what would work instead.
    """
    ends: list[Progress] = []
    nearest = nearest_before(isovalues)
    for number, isovalue in enumerate(isovalues):
        lean = ends[nearest[number]] if number and leaning else None
        progress = Progress(full_level, lean_level=-1 if lean is None else lean.level)
        for entry in plan[isovalue] if isinstance(plan, Mapping) else plan:
            _check(entry, progress)
        ends.append(progress)


def _check(entry: Entry, progress: Progress) -> None:
    """Check an entry in its place after those before it."""
    kind = LayerKind(str(entry[0]))
    if kind == LayerKind.VALUES and progress.bits is None and progress.level >= 0:
        progress.bits, progress.plane = (MOST_BITS, MOST_BITS), MOST_BITS
    argument, more = _number_at(entry, 1), _number_at(entry, 2) or 0
    if kind == LayerKind.OFFSETS:
        argument = (argument or 0) // 2
    elif kind in (LayerKind.LEAF_BASE, LayerKind.RASTER):
        argument = 0
    elif kind == LayerKind.VALUES and more:
        argument = max(progress.plane - more, 0)
    if kind == LayerKind.REFINE and argument == 0:
        raise OptionError(f"{where(entry)}0 rounds of refinement", code="plan", remedy=_remedy(kind, progress))
    try:
        layers = expand(kind.operation, argument or 0, argument is None, progress, more)
    except ValueError as error:
        raise OptionError(f"{where(entry)}{error}", code="plan", remedy=_remedy(kind, progress)) from None
    for layer in layers:
        progress.add(layer)


def _number_at(entry: Entry, place: int) -> int | None:
    """The member of an entry at a place, if it is a number."""
    member = entry[place] if len(entry) > place else None
    return member if isinstance(member, int) else None


def _remedy(kind: LayerKind, progress: Progress) -> str:
    """Suggest an operation instead of one that cannot follow."""
    left = progress.full_level - progress.level
    if kind in (LayerKind.BASE, LayerKind.ADAPTIVE_BASE, LayerKind.LEAF_BASE):
        if progress.level >= 0:
            return "an isovalue has only one base: continue with refine or adapt"
        if kind == LayerKind.LEAF_BASE:
            return "leaf-base needs an isovalue that is predicted from an earlier one"
        return f"give a level from 0 to {progress.full_level}"
    if progress.level < 0:
        return "begin with base, adaptive-base, leaf-base or raster"
    if kind in (LayerKind.REFINE, LayerKind.RASTER, LayerKind.ADAPT):
        if left == 0:
            return "leave it out: the mesh is already the full grid"
        return f"give at most {left} rounds, or omit the number to do all of them"
    if kind == LayerKind.VALUES:
        return "give fewer bits, or omit the number to code all of them"
    if progress.bits is not None:
        return "put offsets before the first values, or leave them out"
    return "the radix must be an odd number from 1 to 63, and the unit at most 24"


def _wrong(at: Line, message: str, remedy: str | None = None) -> OptionError:
    return OptionError(f"{where(at)}{message}", code="plan", remedy=remedy)


def _entry(at: Line, word: str, rest: list[str]) -> Sequence[object]:
    """The entry of a line."""
    if word not in _LINES:
        names = ", ".join([ISOVALUE, *_LINES])
        raise _wrong(at, f"unknown layer {word!r}", f"a line must begin with one of {names}")
    return _LINES[word](at, rest)


def _isovalue(at: Line, rest: list[str]) -> float:
    try:
        (text,) = rest
        # integers stay integers, so that those that would be rounded are noticed
        value = int(text) if re.fullmatch(r"[+-]?\d+", text) else float(text)
    except ValueError:
        raise _wrong(at, "isovalue takes one number", "for example: isovalue 500.5") from None
    if not isfinite(value):
        raise _wrong(at, "an isovalue must be a finite number")
    return value


def _counted(kind: LayerKind, what: str) -> Callable[[Line, list[str]], Sequence[object]]:
    """Make a parser for the lines of a kind that takes an optional number."""

    def read(at: Line, rest: list[str]) -> Sequence[object]:
        if len(rest) > 1:
            raise _wrong(at, f"{at.text.split()[0]} takes {what} only")
        return (kind, _whole(at, rest[0], what) if rest else None)

    return read


def _bare(kind: LayerKind) -> Callable[[Line, list[str]], Sequence[object]]:
    """Make a parser for the lines of a kind that takes nothing."""

    def read(at: Line, rest: list[str]) -> Sequence[object]:
        if rest:
            raise _wrong(at, f"{at.text.split()[0]} takes no arguments")
        return (kind,)

    return read


def _adaptive_base(at: Line, rest: list[str]) -> Sequence[object]:
    stated = bool(rest) and re.match(r"[-+\d]", rest[0]) is not None
    level = _whole(at, rest[0], "a level") if stated else 0
    return (LayerKind.ADAPTIVE_BASE, level, _criteria(at, rest[1:] if stated else rest))


def _adapt(at: Line, rest: list[str]) -> Sequence[object]:
    same = rest.count("same-components")
    return (LayerKind.ADAPT, int(not same), _criteria(at, [word for word in rest if word != "same-components"]))


def _values(at: Line, rest: list[str]) -> Sequence[object]:
    if len(rest) == 1 and rest[0].startswith("left="):
        left = _whole(at, rest[0].removeprefix("left="), "a number of bits")
        return (LayerKind.VALUES, None, left) if left else (LayerKind.VALUES, None)
    return _counted(LayerKind.VALUES, "a number of bits, or left=BITS,")(at, rest)


def _offsets(at: Line, rest: list[str]) -> Sequence[object]:
    if not 1 <= len(rest) <= 2 or (len(rest) == 2 and not rest[1].startswith("unit=")):
        raise _wrong(at, "offsets takes a radix and, optionally, a unit", "for example: offsets 9, or: offsets 9 "
                                                                          "unit=2")
    radix = _whole(at, rest[0], "a radix")
    if radix % 2 == 0:
        raise _wrong(at, f"the radix {radix} must be odd", f"for example {radix + 1}")
    unit = _whole(at, rest[1].removeprefix("unit="), "a unit") if rest[1:] else 0
    return (LayerKind.OFFSETS, radix, unit)


def _whole(at: Line, text: str, what: str) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text):
        raise _wrong(at, f"{text!r} is not {what}: it must be an integer, 0 or greater")
    return int(text)


def _criteria(at: Line, words: list[str]) -> Criteria:
    """Parse criteria, all of which must hold."""
    found: dict[str, bool | int | float] = {}
    for word in words:
        name, equals, number = word.partition("=")
        if name in found:
            raise _wrong(at, f"{name} is given twice", "give each criterion once")
        if name in ("crossing", "topology") and not equals:
            found[name] = True
        elif name == "level" and equals:
            found[name] = _whole(at, number, "a level")
        elif name in ("curvature", "distortion") and equals:
            found[name] = _number(at, name, number)
        else:
            raise _wrong(at, f"{word!r} is not a criterion", f"give {CRITERIA}")
    if not found:
        raise _wrong(at, "the mesh needs a criterion", f"give {CRITERIA}")
    return Criteria(**found)  # type: ignore[arg-type]


def _number(at: Line, name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not (isfinite(number) and number >= 0):
        raise _wrong(at, f"{text!r} is not a {name}: it must be a number, 0 or greater")
    return number


_LINES: dict[str, Callable[[Line, list[str]], Sequence[object]]] = {
    "base": _counted(LayerKind.BASE, "a level"),
    "adaptive-base": _adaptive_base,
    "leaf-base": _bare(LayerKind.LEAF_BASE),
    "refine": _counted(LayerKind.REFINE, "a number of rounds"),
    "raster": _bare(LayerKind.RASTER),
    "adapt": _adapt,
    "values": _values,
    "offsets": _offsets,
}
