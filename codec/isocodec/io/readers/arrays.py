"""Arrays of a file as variables of xarray, whose samples are read when they are asked for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...extras import optional
from .source import InputFile


class Arrays(NamedTuple):
    """The arrays of a file, by their paths without a slash at the start.

    Attributes
    ----------
    found : mapping of str to Variable
    away : mapping of str to str
        Arrays whose samples lie in another file, and which.
    netcdf : bool
        Whether numbers that were never written are those of NetCDF.
    default : str or None
        The one that is read if there are several.
    along : mapping of str to mapping of str to Variable
        Coordinates along axes that are no arrays of the file, by array.
    """

    found: Mapping[str, Any]
    away: Mapping[str, str] = {}
    netcdf: bool = False
    default: str | None = None
    along: Mapping[str, Mapping[str, Any]] = {}


def lazy(
    dims: Sequence[Any], shape: Sequence[int], dtype: Any, get: Callable[[Any], Any], attributes: Mapping[str, Any]
) -> Any:
    """Make a variable, of which a function gives slices."""
    xarray = optional("xarray", extra="xarray", purpose="reading arrays with labels")
    made = xarray.core.indexing.LazilyIndexedArray(_stored_class()(tuple(shape), np.dtype(dtype), get))
    return xarray.Variable(dims, made, dict(attributes))


def of_file(
    source: InputFile, stored: Any, dims: Sequence[str | None], attributes: Mapping[str, Any], packings: int,
    get: Callable[[Any], Any],
) -> Any:
    """Make a variable of an array of a file; axes without a name get one.

    Samples that are packed more than once are not unpacked, nor those of a chunk with more than may be read: it is
    unpacked as a whole, however few are wanted.
    """
    def checked(key: Any) -> Any:
        source.check_count(math.prod(getattr(stored, "shards", None) or stored.chunks or ()))
        if packings > 1:
            raise InputError(f"holds samples that are packed {packings} times, and may unpack to any size",
                             code="unreadable", remedy="write it with one compression")
        return np.asarray(get(key))

    names: list[str] = []
    for dim, size in zip(dims, stored.shape, strict=True):
        name = f"axis of {size}"
        while dim is None and name in names:
            name += " again"
        names.append(name if dim is None else dim)
    return lazy(names, stored.shape, stored.dtype, checked, attributes)


@cache
def _stored_class() -> Any:
    """The class of arrays whose slices are read by a function."""
    xarray = optional("xarray", extra="xarray", purpose="reading arrays with labels")
    indexing = xarray.core.indexing
    base: Any = xarray.backends.BackendArray

    class Stored(base):
        def __init__(self, shape: tuple[int, ...], dtype: np.dtype[Any], get: Callable[[Any], Any]) -> None:
            self.shape, self.dtype, self._get = shape, dtype, get

        def __getitem__(self, key: Any) -> Any:
            return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._get)

    return Stored
