"""Arrays of HDF5 files (h5py), classic netCDF files and Zarr stores as DataArrays of xarray, read when asked for.

Xarray's engines refuse arrays some of whose axes have no names, which HDF5 and OME-Zarr have, and follow links to other
files.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from struct import error as struct_error
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, plain
from .libraries import library, reading

_library = partial(library, extra="labelled", purpose="reading arrays with labels")
HDF5, ZARR = (".nc", ".nc4", ".cdf", ".h5", ".hdf5", ".he5"), (".zarr", ".zarr.zip")
_CLASSIC = {b"CDF\1": "scipy", b"CDF\2": "scipy", b"CDF\5": "netcdf4"}
"""Engines of xarray: netCDF4 fills up files that are cut short, scipy does not know the fifth kind."""
_METADATA = ("zarr.json", ".zarray", ".zgroup")
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"


class Arrays(NamedTuple):
    """The arrays of a file, by their paths without a slash at the start.

    Attributes
    ----------
    found : mapping of str to xarray.DataArray
    attributes : mapping of str to mapping
        Attributes of groups.
    refused : mapping of str to InputError
        Arrays that cannot be read.
    default : str or None
        The one that is read if there are several: the finest level of an OME-Zarr image.
    """

    found: Mapping[str, Any]
    attributes: Mapping[str, Mapping[str, Any]] = {}
    refused: Mapping[str, InputError] = {}
    default: str | None = None


def is_store(path: Path) -> bool:
    """Whether a folder is a group or an array of Zarr."""
    return any((path / name).is_file() for name in _METADATA)


def arrays_of(path: Path, held: ExitStack) -> Arrays:
    """Open a file, which is held open, or a store; raises `OSError`, `InputError` and `MissingExtraError`."""
    if path.is_dir() or path.name.lower().endswith(ZARR):
        zarr = _library("zarr")
        with reading("Zarr store", "check that it is complete; zip what is in the folder, not the folder"):
            return _zarr(zarr, path)
    with path.open("rb") as file:
        engine = _CLASSIC.get(file.read(4))
    if engine:
        with reading("netCDF file", "ncdump -h shows what it holds"):
            dataset = _library("xarray").open_dataset(path, engine=engine, decode_cf=False, cache=False)
            held.enter_context(dataset)
            return Arrays({str(name): _filled(dataset[name]) for name in dataset.variables}, {"": dataset.attrs})
    h5py = _library("h5py")
    with reading("HDF5 file", "h5dump -H shows what it holds"):
        return _hdf5(h5py, held.enter_context(h5py.File(path, "r")))


def _filled(array: Any) -> Any:
    """An array of netCDF, whose samples are missing where nothing was written; bytes may have any value."""
    usual = _library("netCDF4").default_fillvals.get(array.dtype.str[1:])
    return array.assign_attrs({"_FillValue": usual, **array.attrs}) if usual and array.dtype.itemsize > 1 else array


def _hdf5(h5py: Any, file: Any) -> Arrays:
    items, links = dict[str, Any](), dict[str, Any]()
    file.visititems(lambda name, item: items.update({name: item}))
    file.visititems_links(lambda name, link: links.update({name: link}))
    # arrays in other files are not opened: even a shape may be looked up there
    refused = {name: _away(link.filename) for name, link in links.items() if isinstance(link, h5py.ExternalLink)}
    names, found = {item.id: name for name, item in items.items()}, dict[str, Any]()
    for name, item in items.items():
        attributes = _attributes(item)
        if not isinstance(item, h5py.Dataset) or str(attributes.get("NAME")).startswith(_NO_VARIABLE):
            continue
        sources = {each[0] for each in item.external or ()}
        sources |= {each.file_name for each in item.virtual_sources()} - {"."} if item.is_virtual else set()
        if sources:
            refused[name] = _away(*sources)
        elif item.size and not (item.is_virtual or item.id.get_storage_size()):
            refused[name] = InputError(f"holds the shape of '/{plain(name)}', {item.shape}, but no samples",
                                       code="empty", remedy="check that the file is complete")
        elif item.shape is not None:
            scales = [names.get(axis[0].id) if len(axis) else None for axis in item.dims]
            array = _array(item, [name] if item.is_scale and item.ndim == 1 else scales, attributes, name)
            found[name] = _filled(array) if "_NCProperties" in file.attrs else array
    return Arrays(found, {name: _attributes(item) for name, item in {"": file, **items}.items()}, refused)


def _away(*files: Any) -> InputError:
    return InputError(f"its samples lie in another file, {plain(', '.join(map(str, files)))}", code="other-file",
                      remedy="read them with h5py, and give the array")


def _attributes(item: Any) -> dict[str, Any]:
    """Numbers and texts among attributes of HDF5, arrays of one as what they hold."""
    out = {}
    for name, value in item.attrs.items():
        value = value[0] if np.shape(value) == (1,) else value
        value = value.decode(errors="replace") if isinstance(value, bytes) else value
        if np.asarray(value).dtype.kind in "biufU":
            out[name] = value
    return out


def _zarr(zarr: Any, path: Path) -> Arrays:
    """A store, which is an array or a group of arrays, perhaps in a zip."""
    top = zarr.open(zarr.storage.ZipStore(path) if path.is_file() else path, mode="r")
    members = {"": top, **(dict(top.members(max_depth=None)) if isinstance(top, zarr.Group) else {})}
    found = {name: _of_zarr(one, name) for name, one in members.items() if isinstance(one, zarr.Array)}
    levels: dict[str, Any] = {}
    for name, one in members.items():
        for image in dict(one.attrs.get("ome", one.attrs)).get("multiscales", ()):
            levels |= _levels(f"{name}/".lstrip("/"), image, found)
    return Arrays({**found, **levels}, {name: dict(one.attrs) for name, one in members.items()},
                  default=next(iter(levels), None))


def _of_zarr(stored: Any, name: str) -> Any:
    attributes = dict(stored.attrs)
    dims = getattr(stored.metadata, "dimension_names", None) or attributes.get("_ARRAY_DIMENSIONS")
    if isinstance(marker := attributes.get("_FillValue"), str):
        with suppress(ValueError, struct_error):  # else it is a number as text
            attributes["_FillValue"] = _library("xarray.backends.zarr").FillValueCoder.decode(marker, stored.dtype)
    elif stored.metadata.zarr_format == 2 and stored.fill_value:  # 0 is what Zarr itself begins with, not a marker
        attributes.setdefault("_FillValue", stored.fill_value)
    return _array(stored, dims or [None] * stored.ndim, attributes, name)


def _levels(group: str, image: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, Any]:
    """Levels of an image of OME-Zarr with coordinates along their axes in space."""
    levels = {}
    axes = [axis if isinstance(axis, dict) else {"name": str(axis)} for axis in image.get("axes", "tczyx")]
    for level in image["datasets"]:
        scale, start = np.ones(len(axes)), np.zeros(len(axes))
        for step in (*level.get("coordinateTransformations", ()), *image.get("coordinateTransformations", ())):
            if {*step} - {"type", "scale", "translation"}:
                raise InputError(f"places its samples by {plain(str(step))}; a scale and a translation can be read",
                                 code="placement", remedy="open it with zarr, and give an isocodec.Field")
            scale, start = scale * step.get("scale", 1), start * step.get("scale", 1) + step.get("translation", 0)
        path = group + str(level["path"]).strip("/")
        named = found[path].rename(dict(zip(found[path].dims, [axis["name"] for axis in axes], strict=True)))
        levels[path] = named.assign_coords({
            dim: (dim, first + by * np.arange(size), {"units": axis.get("unit", "")})
            for (dim, size), axis, by, first in zip(named.sizes.items(), axes, scale, start, strict=True)
            if axis.get("type", "space") == "space"})
    return levels


def _array(stored: Any, dims: Sequence[str | None], attributes: Mapping[str, Any], path: str) -> Any:
    """A DataArray over an array with ``shape``, ``dtype`` and slices; axes without a name get one."""
    xarray = _library("xarray")
    names = [dim if dim and [*dims].count(dim) == 1 else f"axis of {size}" + " again" * stored.shape[:axis].count(size)
             for axis, (dim, size) in enumerate(zip(dims, stored.shape, strict=True))]
    indexing = xarray.core.indexing

    class Stored(xarray.backends.BackendArray):  # type: ignore[name-defined]
        shape, dtype = tuple(stored.shape), np.dtype(stored.dtype)

        def __getitem__(self, key: Any) -> Any:
            return indexing.explicit_indexing_adapter(
                key, self.shape, indexing.IndexingSupport.BASIC, lambda found: np.asarray(stored[found]))

    return xarray.DataArray(indexing.LazilyIndexedArray(Stored()), dims=names, attrs=attributes,
                            name=path.rpartition("/")[2] or None)
