"""H5py reads the arrays of HDF5 files, NetCDF-4 among them, for `from_xarray`.

Links are not followed, and samples in other files are not read unless that is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...errors import InputError, plain
from ...extras import optional
from .arrays import Arrays, of_file
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
        names = {item.id: name for name, item in found.items()}
        made = {name: _variable(source, name, item, names) for name, item in found.items()}
        made = {name: one for name, one in made.items() if not str(one.attrs.get("NAME")).startswith(_NO_VARIABLE)}
        yield Arrays(made, away, "_NCProperties" in file.attrs)


def _variable(source: InputFile, name: str, item: Any, names: Mapping[Any, str]) -> Any:
    """An array with the names of its scales for its axes."""
    def get(key: Any) -> Any:
        if not (item.is_virtual or item.external or not item.size or item.id.get_storage_size()):
            raise InputError(f"holds the shape of '/{plain(name)}', {item.shape}, but no samples", code="empty")
        return item[key]

    scales = [next((names[scale.id] for scale in axis.values() if scale.id in names), None) for axis in item.dims]
    dims = [scale if scales.count(scale) == 1 else None for scale in scales]
    if item.is_scale and item.ndim == 1:
        dims = [item.name.strip("/")]
    layout = item.id.get_create_plist()
    packings = sum(layout.get_filter(number)[0] not in _NO_PACKING for number in range(layout.get_nfilters()))
    return of_file(source, item, dims, _attributes(item), packings, get)


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
    for part in item.virtual_sources() if item.is_virtual else ():
        inner = part.dset_name.strip("/")
        if part.file_name != ".":
            return str(part.file_name)
        if inner not in there:  # a link, or a pattern of names
            return str(part.dset_name)
        if inner not in seen and (found := _other_file(inner, there, seen | {name})) is not None:
            return found
    return None
