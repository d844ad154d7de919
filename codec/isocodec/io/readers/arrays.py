"""Arrays of a file that holds many: what is known of each before its samples are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, eq=False)
class ArrayInFile:
    """An array, of which slices are read.

    Attributes
    ----------
    stored : object
        With ``shape``, ``dtype``, ``chunks`` and slices.
    dims : sequence of str or None
        Names of its axes, those of the arrays with their coordinates; None for axes without a name.
    attributes : mapping
    written : bool
        Whether any samples are there.
    coordinates : mapping of str to (array, mapping)
        Coordinates along axes, with attributes, that are no arrays of the file.
    packings : int
        How many times samples are packed.
    """

    stored: Any
    dims: Sequence[str | None]
    attributes: Mapping[str, Any]
    written: bool = True
    coordinates: Mapping[str, tuple[Any, Mapping[str, Any]]] = field(default_factory=dict)
    packings: int = 0


@dataclass(frozen=True, eq=False)
class Arrays:
    """The arrays of a file.

    Attributes
    ----------
    found : mapping of str to ArrayInFile
        By their paths, without a slash at the start.
    away : mapping of str to str
        Arrays whose samples lie in another file, and which.
    netcdf : bool
        Whether numbers that were never written are those of NetCDF.
    default : str or None
        The one that is read if there are several.
    """

    found: Mapping[str, ArrayInFile]
    away: Mapping[str, str] = field(default_factory=dict)
    netcdf: bool = False
    default: str | None = None
