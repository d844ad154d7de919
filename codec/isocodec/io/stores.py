"""Arrays of HDF5 files (h5py), classic netCDF files and Zarr stores as variables of xarray, read when asked for.

Xarray's engines refuse arrays some of whose axes have no names, which HDF5 and OME-Zarr have, and follow links to other
files.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple
from zipfile import ZipFile

import numpy as np

from ..errors import InputError, plain
from .libraries import library, reading

HDF5, ZARR = (".nc", ".nc4", ".cdf", ".h5", ".hdf5", ".he5"), (".zarr", ".zarr.zip")
_CLASSIC = {b"CDF\1": "scipy", b"CDF\2": "scipy", b"CDF\5": "netcdf4"}
"""Engines of xarray: netCDF4 fills up files that are cut short, scipy does not know the fifth kind."""
_METADATA = ("zarr.json", ".zarray", ".zgroup")
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"


class Arrays(NamedTuple):
    """The arrays of a file, by their paths without a slash at the start.

    Attributes
    ----------
    found : mapping of str to xarray.Variable
    attributes : mapping of str to mapping
        Attributes of groups, by their paths.
    refused : mapping of str to InputError
        Arrays that cannot be read, and why.
    levels : mapping of str to mapping of str to xarray.Variable
        Of each level of an OME-Zarr image, the finest first, coordinates along its axes.
    """

    found: Mapping[str, Any]
    attributes: Mapping[str, Mapping[str, Any]] = {}
    refused: Mapping[str, InputError] = {}
    levels: Mapping[str, Mapping[str, Any]] = {}


def is_store(path: Path) -> bool:
    """Whether a folder is a group or an array of Zarr."""
    return any((path / name).is_file() for name in _METADATA)


@contextmanager
def arrays_of(path: Path) -> Iterator[Arrays]:
    """Open a file or store; raises `OSError`, `InputError` and `MissingExtraError`."""
    xarray = library("xarray", extra="labelled", purpose="reading arrays with labels")
    if path.is_dir() or path.name.lower().endswith(ZARR):
        with reading("Zarr store", "check that the file is complete"):
            found = _zarr(path)
        yield found
        return
    with path.open("rb") as file:
        engine = _CLASSIC.get(file.read(4))
    if engine:
        with reading("netCDF file", "ncdump -h shows what it holds"):
            dataset = xarray.open_dataset(path, engine=engine, decode_cf=False, cache=False)
        with dataset:
            yield Arrays({str(name): _filled(one) for name, one in dataset.variables.items()}, {"": dataset.attrs})
        return
    h5py = library("h5py", extra="labelled", purpose=f"reading {path.suffix}")
    with reading("HDF5 file", "h5dump -H shows what it holds"):
        opened = h5py.File(path, "r")
    with opened:
        with reading("HDF5 file"):
            found = _hdf5(h5py, opened)
        yield found


def _filled(one: Any) -> Any:
    """A variable of netCDF, whose samples are missing where nothing was written; bytes may have any value."""
    netcdf = library("netCDF4", extra="labelled", purpose="reading netCDF")
    kind = one.dtype.str[1:]
    if kind in netcdf.default_fillvals and one.dtype.itemsize > 1:
        one.attrs.setdefault("_FillValue", netcdf.default_fillvals[kind])
    return one


def _hdf5(h5py: Any, file: Any) -> Arrays:
    items: dict[str, Any] = {}
    links: dict[str, Any] = {}
    file.visititems(lambda name, item: items.update({name: item}))
    file.visititems_links(lambda name, link: links.update({name: link}))
    # arrays in other files are not opened: even a shape may be looked up there
    refused = {name: _in_file(link.filename) for name, link in links.items() if isinstance(link, h5py.ExternalLink)}
    arrays: dict[str, Any] = {}
    for name, item in items.items():
        if not isinstance(item, h5py.Dataset):
            continue
        others = [each[0] for each in item.external or ()]
        others += [part.file_name for part in item.virtual_sources() if part.file_name != "."] if item.is_virtual else []
        if others:
            refused[name] = _in_file(others[0])
        elif item.size and not (item.is_virtual or item.id.get_storage_size()):
            refused[name] = InputError(f"holds the shape of '/{plain(name)}', {item.shape}, but no samples",
                                       code="empty", remedy="check that the file is complete")
        elif item.shape is not None and not str(item.attrs.get("NAME")).startswith(_NO_VARIABLE):
            arrays[name] = item
    names = {item.id: name for name, item in arrays.items()}
    made = {}
    for name, item in arrays.items():
        dims = [next((names[scale.id] for scale in axis.values() if scale.id in names), None) for axis in item.dims]
        made[name] = _variable(item, [name] if item.is_scale and item.ndim == 1 else dims, _attributes(item))
        if "_NCProperties" in file.attrs:
            _filled(made[name])
    return Arrays(made, {"": _attributes(file), **{name: _attributes(item) for name, item in items.items()}}, refused)


def _in_file(name: Any) -> InputError:
    return InputError(f"its samples lie in another file, {plain(str(name))}", code="other-file",
                      remedy="read them with h5py, and give the array")


def _attributes(item: Any) -> dict[str, Any]:
    """Attributes of HDF5, arrays of one as what they hold."""
    out = {}
    for name in item.attrs:
        with suppress(KeyError, TypeError, ValueError, OSError):  # of a type that numpy does not have
            value = item.attrs[name]
            value = value.ravel()[0] if np.size(value) == np.ndim(value) == 1 else value
            out[name] = value.decode(errors="replace") if isinstance(value, bytes) else value
    return out


def _zarr(path: Path) -> Arrays:
    """A store, which is an array or a group of them; in a zip, or of a folder in a zip."""
    zarr = library("zarr", extra="labelled", purpose="reading Zarr")
    root, inside = path, ""
    if path.is_file():
        root = zarr.storage.ZipStore(path, mode="r")
        with ZipFile(path) as packed:
            folders = [str(file.parent) for file in map(PurePosixPath, packed.namelist()) if file.name in _METADATA]
        inside = min(folders, key=len, default="").strip(".")
    top = zarr.open(root, path=inside, mode="r")
    members = {"": top, **(dict(top.members(max_depth=None)) if isinstance(top, zarr.Group) else {})}
    arrays = {name: _of_zarr(one) for name, one in members.items() if isinstance(one, zarr.Array)}
    attributes = {name: dict(one.attrs) for name, one in members.items()}
    levels: dict[str, Mapping[str, Any]] = {}
    for name, about in attributes.items():
        for image in about.get("ome", about).get("multiscales", ()):
            levels |= _levels(f"{name}/".lstrip("/"), image, arrays)
    return Arrays(arrays, attributes, levels=levels)


def _of_zarr(stored: Any) -> Any:
    coder = library("xarray.backends.zarr", extra="labelled", purpose="reading Zarr").FillValueCoder
    attributes, marker = dict(stored.attrs), stored.attrs.get("_FillValue")
    if isinstance(marker, str):
        attributes["_FillValue"] = coder.decode(marker, stored.dtype)
    if stored.metadata.zarr_format == 3:
        dims = stored.metadata.dimension_names
    else:
        dims = attributes.get("_ARRAY_DIMENSIONS")
        if stored.fill_value:  # 0 is what Zarr itself begins with, not a marker
            attributes.setdefault("_FillValue", stored.fill_value)
    return _variable(stored, dims or [None] * stored.ndim, attributes)


def _levels(group: str, image: Mapping[str, Any], arrays: dict[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Coordinates along the axes in space of the levels of an image of OME-Zarr; the arrays get the names of the axes."""
    out = {}
    axes = [axis if isinstance(axis, dict) else {"name": str(axis)} for axis in image.get("axes", "tczyx")]
    for level in image["datasets"]:
        name = group + str(level["path"]).strip("/")
        scale, start = np.ones(len(axes)), np.zeros(len(axes))
        for step in (*level.get("coordinateTransformations", ()), *image.get("coordinateTransformations", ())):
            if step["type"] not in ("scale", "translation", "identity"):
                raise InputError(f"places its samples by '{step['type']}'; a scale and a translation can be read",
                                 code="placement", remedy="open it with zarr, and give an isocodec.Field")
            factor = np.array(step["scale"] if step["type"] == "scale" else 1.0)
            scale, start = scale * factor, start * factor
            start = start + np.array(step["translation"] if step["type"] == "translation" else 0.0)
        one = arrays[name] = arrays[name]._replace(dims=[str(axis["name"]) for axis in axes])
        out[name] = {
            dim: type(one)(dim, start[i] + scale[i] * np.arange(size),
                           {"axis": dim, **({"units": axis["unit"]} if "unit" in axis else {})})
            for i, ((dim, size), axis) in enumerate(zip(one.sizes.items(), axes, strict=True))
            if axis.get("type", "space") == "space"
        }
    return out


def _variable(stored: Any, dims: Sequence[str | None], attributes: Mapping[str, Any]) -> Any:
    """A variable of xarray over an array with ``shape``, ``dtype`` and slices; axes without a name get one."""
    xarray = library("xarray", extra="labelled", purpose="reading arrays with labels")
    names: list[str] = []
    for dim, size in zip(dims, stored.shape, strict=True):
        name = dim if dim is not None and [*dims].count(dim) == 1 else f"axis of {size}"
        names.append(name + " again" * names.count(name))
    return xarray.Variable(names, xarray.core.indexing.LazilyIndexedArray(_lazy_class()(stored)), dict(attributes))


@cache
def _lazy_class() -> Any:
    """The class of arrays whose slices are read from a file."""
    xarray = library("xarray", extra="labelled", purpose="reading arrays with labels")
    indexing = xarray.core.indexing
    base: Any = xarray.backends.BackendArray

    class Stored(base):
        def __init__(self, stored: Any) -> None:
            self.shape, self.dtype, self._stored = tuple(stored.shape), np.dtype(stored.dtype), stored

        def __getitem__(self, key: Any) -> Any:
            return indexing.explicit_indexing_adapter(
                key, self.shape, indexing.IndexingSupport.BASIC, lambda found: np.asarray(self._stored[found]))

    return Stored
