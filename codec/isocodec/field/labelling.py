"""Labels of samples: which there are, which samples have one, also where scaling has moved them; names and colours.

The notes of a file name a label and its colour: ``label 3`` is ``liver``, ``colour 3`` is ``#dd8265``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

LABELS = "labels"
"""Name of the note of files whose isovalues are labels; a sample lies above the isovalue that is its label."""
TYPE = "dtype"
"""Name of the note with the type that the labels had, unless that is the smallest one."""
PROBABILITY, OCCUPANCY = "probability", "occupancy"
"""Units of fractions of a segment, which are fields, not labels."""
_ABOUT = re.compile("(?:label|colour) (-?[0-9.e+-]+)")
_INTEGERS, _FLOATS = ("u1", "i1", "u2", "i2", "u4", "i4", "i8"), ("f2", "f4")
"""Types of labels that are tried, the smallest first; others are f8."""
ALL = "all"
"""All labels but 0."""
_STRIP = 1 << 22
"""Samples of a file that are read at a time."""
_MOVED = 0.05
"""Largest distance of a scaled value from the label that it is."""


def having(values: NDArray[Any], label: float) -> NDArray[np.bool_]:
    """Find the samples that have a label; of floats, if none has, those of the only value that is close to it."""
    inside = np.ascontiguousarray(values == label)
    if values.dtype.kind == "f" and not inside.any():
        near = values[np.abs(values - label) < _MOVED]
        if near.size and (near == near.flat[0]).all():
            return np.ascontiguousarray(values == near.flat[0])
    return inside


def labels_in(values: NDArray[Any], gone: NDArray[np.bool_] | None = None) -> tuple[float, ...]:
    """Find the labels of samples that are not missing, in order, but for 0; a value close to a whole number is that."""
    if getattr(values, "windowed", False):
        rows = max(1, _STRIP // math.prod(values.shape[1:]))
        whole = (slice(None),) * (values.ndim - 1)
        strips = (values[(slice(start, start + rows), *whole)] for start in range(0, values.shape[0], rows))
        there = np.unique(np.concatenate([np.unique(np.ma.compressed(strip)) for strip in strips]))
    else:
        there = np.unique(values if gone is None else values[~gone])
    if there.dtype.kind == "f":
        there = there[np.isfinite(there)]
        whole = np.rint(there)
        there = np.unique(np.where(np.abs(there - whole) < _MOVED, whole, there)) if (
            len(np.unique(whole)) == len(there)) else there
    return tuple(each.item() for each in there if each)


def about(label: float, name: str | None, colour: Any = None) -> dict[str, str]:
    """Make the notes of a label from its name and its colour: red, green and blue from 0 to 1."""
    number, notes = listed([label]), {"label": name or "", "colour": ""}
    if colour is not None:
        notes["colour"] = "#" + "".join(f"{round(255 * min(max(part, 0), 1)):02x}" for part in colour)
    return {f"{key} {number}": text for key, text in notes.items() if text}


def notes_with(notes: Mapping[str, str], labels: Iterable[float] | None) -> dict[str, str]:
    """Leave out the notes of labels that are not among those of a file."""
    kept = {listed([label]) for label in labels or ()}
    return {key: text for key, text in notes.items() if not (found := _ABOUT.fullmatch(key)) or found[1] in kept}


def has_names(notes: Mapping[str, str]) -> bool:
    """Whether the notes of a file name any of its labels."""
    return is_of_labels(notes) and any(_ABOUT.fullmatch(key) and key.startswith("label") for key in notes)


def of_some(notes: Mapping[str, str], labels: Sequence[float]) -> dict[str, str]:
    """The notes of a file with only these of its labels; those of a file of isovalues as they are."""
    return {**notes_with(notes, labels), LABELS: listed(labels)} if is_of_labels(notes) else dict(notes)


def noted(labels: Sequence[float], dtype: np.dtype[Any]) -> dict[str, str]:
    """Make the notes of a file of these labels, which had a type."""
    return {LABELS: listed(labels)} | ({} if dtype == type_of(labels) else {TYPE: dtype.name})


def name_of(label: float, notes: Mapping[str, str]) -> str:
    """Name of a label in the notes of a file; empty if it has none."""
    return notes.get(f"label {listed([label])}", "") if is_of_labels(notes) else ""


def colour_of(label: float, notes: Mapping[str, str]) -> str | None:
    """Colour of a label in the notes of a file, as ``#rrggbb``; None if it has none."""
    text = notes.get(f"colour {listed([label])}", "") if is_of_labels(notes) else ""
    return text if re.fullmatch("#[0-9a-f]{6}", text) else None


def type_of(labels: Sequence[float], notes: Mapping[str, str] | None = None) -> np.dtype[Any]:
    """The type of labels and 0 in the notes of a file, or else the smallest that holds them exactly."""
    every = np.array([0.0, *labels])
    kinds = _FLOATS if (every % 1).any() else _INTEGERS
    text = (notes or {}).get(TYPE, "")
    with np.errstate(invalid="ignore", over="ignore"):
        stated = [text] if re.fullmatch("bool|u?int(8|16|32|64)|float(16|32|64)", text) else []
        fit = (kind for kind in (*stated, *kinds) if np.array_equal(every.astype(kind).astype(float), every))
        return np.dtype(next(fit, "f8"))


def listed(labels: Iterable[float], between: str = " ") -> str:
    """List labels as the note of a file does: ``1 2 300``."""
    return between.join(repr(float(label)).removesuffix(".0") for label in labels)


def is_of_labels(notes: Mapping[str, str]) -> bool:
    """Whether the isovalues of a file of these notes are labels; the note of that name may also be another's text."""
    texts = notes.get(LABELS, "").split()
    try:
        return bool(texts) and all(math.isfinite(float(text)) for text in texts)
    except ValueError:
        return False


def noun_of(notes: Mapping[str, str]) -> str:
    """Name what a file of these notes has contours of: ``isovalue``, or ``label`` in a file of labels."""
    return "label" if is_of_labels(notes) else "isovalue"


def caption(isovalue: float, notes: Mapping[str, str]) -> str:
    """Name an isovalue of a file of these notes for people: ``isovalue 500.5``, or ``label 3 (liver)``."""
    name = name_of(isovalue, notes)
    return f"{noun_of(notes)} {isovalue:.12g}" + f" ({name})" * bool(name)
