"""H5py reads the arrays of HDF5 files, NetCDF-4 among them, for `from_xarray`.

Links are not followed, and what lies in other files is left there unless it is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...extras import optional
from .arrays import ArrayInFile, Arrays
from .reading import reading
from .source import InputFile

_NO_PACKING = (2, 3, 5, 6)
"""Filters that shuffle, check and round, with which nothing becomes much smaller."""
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"


@contextmanager
def arrays_of_hdf5(source: InputFile) -> Iterator[Arrays]:
    """Open an HDF5 file; its arrays by their paths."""
    h5py = optional("h5py", extra="hdf5", purpose=f"reading {source.path.suffix}")
    with reading("HDF5 file"), h5py.File(source.path, "r") as file:
        there: dict[str, Any] = {}
        links: dict[str, Any] = {}
        file.visititems(lambda name, item: there.update({name: item} if isinstance(item, h5py.Dataset) else {}))
        file.visititems_links(lambda name, link: links.update({name: link}))
        outside = {name: link.filename for name, link in links.items() if isinstance(link, h5py.ExternalLink)}
        # even the shape of an array whose samples lie elsewhere may be looked up there
        away = {n: f for n in there if (f := _other_file(n, there)) is not None} | outside
        if source.follow:
            there |= {name: item for name in outside if isinstance(item := file.get(name), h5py.Dataset)}
            away = {}
        found = {name: item for name, item in there.items() if name not in away and item.shape is not None}
        attributes = {name: _attributes(item) for name, item in found.items()}
        lengths = {name for name, notes in attributes.items() if str(notes.get("NAME")).startswith(_NO_VARIABLE)}
        names = {item.id: name for name, item in found.items()}
        yield Arrays(
            {name: ArrayInFile(item, _dims(item, names), attributes[name], _written(item), packings=_packings(item))
             for name, item in found.items() if name not in lengths},
            away, "_NCProperties" in file.attrs,
        )


def _dims(item: Any, names: Mapping[Any, str]) -> list[str | None]:
    """Names of the axes of an array: those of their scales."""
    if item.is_scale and item.ndim == 1:
        return [item.name.strip("/")]
    scales = [next((names[scale.id] for scale in axis.values() if scale.id in names), None) for axis in item.dims]
    return [scale if scales.count(scale) == 1 else None for scale in scales]


def _written(item: Any) -> bool:
    return bool(item.is_virtual or item.external or not item.size or item.id.get_storage_size())


def _packings(item: Any) -> int:
    layout = item.id.get_create_plist()
    return sum(layout.get_filter(number)[0] not in _NO_PACKING for number in range(layout.get_nfilters()))


def _attributes(item: Any) -> dict[str, Any]:
    out = {}
    for name in item.attrs:
        try:
            value = item.attrs[name]
        except (KeyError, TypeError, ValueError, OSError):  # of a type that NumPy does not have
            continue
        if (getattr(value, "size", 0) == 1 and value.dtype.kind in "OSU") or np.shape(value) == (1,):
            value = value.ravel()[0]
        value = value.decode(errors="replace") if isinstance(value, bytes) else value
        if isinstance(value, str) or getattr(value, "dtype", np.dtype("V")).kind in "biufSU":
            out[name] = value
    return out


def _other_file(name: str, there: Mapping[str, Any], seen: frozenset[str] = frozenset()) -> str | None:
    """Another file in which samples of an array lie, directly or of one that it is put together from."""
    item = there[name]
    if item.external:
        return str(item.external[0][0])
    if item.is_virtual:
        for part in item.virtual_sources():
            if part.file_name != ".":
                return str(part.file_name)
            inner = part.dset_name.strip("/")
            if inner not in there:  # a link, or a pattern of names
                return str(part.dset_name)
            if inner not in seen and (found := _other_file(inner, there, seen | {name})) is not None:
                return found
    return None
