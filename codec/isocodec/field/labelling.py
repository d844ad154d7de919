"""Labels of samples: which there are, which samples have one, also where scaling has moved them, and their names."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

LABELS = "labels"
"""Name of the note of files whose isovalues are labels; a sample lies above the isovalue that is its label."""
ALL = "all"
"""All labels but 0."""
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
    there = np.unique(values if gone is None else values[~gone])
    if there.dtype.kind == "f":
        there = there[np.isfinite(there)]
        whole = np.rint(there)
        there = np.unique(np.where(np.abs(there - whole) < _MOVED, whole, there)) if (
            len(np.unique(whole)) == len(there)) else there
    return tuple(each.item() for each in there if each)


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
    """Name an isovalue of a file of these notes for people: ``isovalue 500.5``, or ``label 3`` in a file of labels."""
    return f"{noun_of(notes)} {isovalue:.12g}"
