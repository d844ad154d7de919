"""The arrays of a folder, each at its isovalues."""

from __future__ import annotations

import fnmatch
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SUFFIXES = (".npy", ".npz")
KEY = "values"
"""The array of an ``.npz`` that is taken."""

Wanted = tuple[str, float | None]
"""Name of an array, its last part or a pattern of either, and an isovalue; None for those of the array."""


@dataclass(frozen=True, eq=False)
class Item:
    """An array (n axes) at one isovalue."""

    name: str
    path: Path
    isovalue: float

    @cached_property
    def values(self) -> NDArray[Any]:
        """The samples, as they are stored."""
        return load(self.path)

    @property
    def key(self) -> str:
        """For messages and tables."""
        return f"{self.name}@{self.isovalue:g}"

    @property
    def n(self) -> int:
        return self.values.ndim

    @property
    def integer(self) -> bool:
        return self.values.dtype.kind in "iub"

    @cached_property
    def mask(self) -> NDArray[np.bool_]:
        """Which samples lie above."""
        return self.values > self.isovalue

    @property
    def numbers(self) -> NDArray[np.float64]:
        return self.values.astype(np.float64)


def wanted(text: str) -> Wanted:
    """``NAME`` or ``NAME@ISOVALUE``."""
    name, at, isovalue = text.partition("@")
    return name, float(isovalue) if at else None


def read_items(folder: Path, pairs: Sequence[Wanted] = ()) -> tuple[list[Item], list[str]]:
    """The items that are wanted (all if there are none), and what is left out, with reasons."""
    found: list[Item] = []
    left_out: list[str] = []
    met = set()
    for path in sorted(path for path in folder.rglob("*") if path.suffix in SUFFIXES):
        name = path.relative_to(folder).with_suffix("").as_posix()
        here = [pair for pair in pairs if any(fnmatch.fnmatch(n, pair[0]) for n in (name, path.stem))]
        if pairs and not here:
            continue
        met.update(here)
        try:
            values = load(path)
        except (OSError, ValueError) as error:
            left_out.append(f"{name}: {error}")
            continue
        chosen = {isovalue for _, isovalue in here if isovalue is not None}
        if not pairs or any(isovalue is None for _, isovalue in here):
            chosen.update(isovalues(path, values))
        for isovalue in sorted(chosen):
            if values.min() <= isovalue < values.max():
                found.append(Item(name, path, isovalue))
            else:
                left_out.append(f"{name}@{isovalue:g}: no curve")
    return found, left_out + [f"{pair[0]}: no such array" for pair in pairs if pair not in met]


def load(path: Path) -> NDArray[Any]:
    """An array that can be measured; ValueError says why it cannot be."""
    loaded = np.load(path)
    if path.suffix == ".npz" and KEY not in loaded:
        raise ValueError(f"holds no array {KEY!r}")
    values = np.ascontiguousarray(loaded[KEY] if path.suffix == ".npz" else loaded)
    if values.ndim not in (2, 3):
        raise ValueError(f"has {values.ndim} axes")
    if values.dtype.kind not in "iubf":
        raise ValueError(f"holds {values.dtype}")
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise ValueError("holds NaN or infinity")
    return values


def isovalues(path: Path, values: NDArray[Any]) -> list[float]:
    """Those of the sidecar ``NAME.json``, without one the middle of the range; of integers floor + 0.5."""
    sidecar = path.with_suffix(".json")
    listed = json.loads(sidecar.read_text()).get("isovalues") if sidecar.exists() else None
    numbers = [float(v) for v in listed or [(float(values.min()) + float(values.max())) / 2]]
    return [math.floor(v) + 0.5 for v in numbers] if values.dtype.kind in "iub" else numbers
