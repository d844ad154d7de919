"""Formats by suffix: what they can hold, who writes them, and the libraries that they need."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ..errors import OptionError


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes
    ----------
    dimensions : tuple of int
        Axes of the fields of which it can hold something.
    render : callable returning bytes
        Makes the whole file.
    needs : callable, optional
        Loads the library that ``render`` needs, or raises.
    several : tuple of int
        Axes of the fields of which it can hold several things: ``render`` then takes a sequence of them.
    """

    dimensions: tuple[int, ...]
    render: Callable[..., bytes]
    needs: Callable[[], object] | None = None
    several: tuple[int, ...] = ()

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
        message = f"{Path(path).suffix.lower() or 'a name without a suffix'} is not a format that can be written"
    raise OptionError(message, code="suffix", remedy="one of " + ", ".join(fitting))
