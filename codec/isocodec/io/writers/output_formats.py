"""Formats by suffix: what they can hold, who writes them, and the libraries that they need."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...errors import OptionError


@dataclass(frozen=True)
class Cost:
    """Bytes of memory that writing takes at most: for each point, for each cell, and in any case.

    ``kept`` of them, for each point, stay until the file is whole; all if it is None.
    """

    point: int
    cell: int
    fixed: int = 0
    kept: int | None = None

    def peak(self, points: int, cells: int) -> int:
        """While one drawing is written."""
        return self.point * points + self.cell * cells + self.fixed

    def after(self, points: int, cells: int) -> int:
        """When it has been, and others follow."""
        return self.point * points + self.cell * cells if self.kept is None else self.kept * points


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes
    ----------
    dimensions : tuple of int
        Axes of the fields of which it can hold something.
    render : callable
        Makes the whole file, or writes it.
    needs : callable, optional
        Loads the library that ``render`` needs, or raises.
    several : tuple of int
        Axes of the fields of which it can hold several things: ``render`` then takes a collection of them, which it
        goes through once.
    cost : mapping of int to Cost
        Memory that ``render`` takes, by axes of the field.
    """

    dimensions: tuple[int, ...]
    render: Callable[..., Any]
    needs: Callable[[], object] | None = None
    several: tuple[int, ...] = ()
    cost: Mapping[int, Cost] = field(default_factory=dict)

    def check_libraries(self) -> None:
        """Find out before the work that the library is missing.

        Raises
        ------
        MissingExtraError
        """
        if self.needs is not None:
            self.needs()


def find_suffix(
    formats: Mapping[str, Format], path: str | os.PathLike[str], dimension: int | None = None, what: str = ""
) -> str:
    """The suffix of ``path`` if it names one of the formats, and that holds ``what`` of ``dimension`` axes.

    Raises
    ------
    OptionError
        Naming the formats that work.
    """
    name = Path(path).name.lower()
    fitting = [s for s, f in formats.items() if dimension is None or dimension in f.dimensions]
    suffix = next((s for s in formats if name.endswith(s) and len(name) > len(s)), None)
    if suffix in fitting:
        return suffix
    if suffix is not None:
        message = f"{suffix} cannot hold {what}"
    else:
        message = f"{Path(path).suffix.lower() or 'a name without a suffix'} is not a supported output format"
    raise OptionError(message, code="suffix", remedy="one of " + ", ".join(fitting))
