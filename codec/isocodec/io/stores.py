"""Arrays of HDF5 files (h5py), classic netCDF files and Zarr stores as variables of xarray, read when asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, plain
from .libraries import library, reading

HDF5, ZARR = (".nc", ".nc4", ".cdf", ".h5", ".hdf5", ".he5"), (".zarr", ".zarr.zip")
CLASSIC = (b"CDF\1", b"CDF\2", b"CDF\5")
_METADATA = ("zarr.json", ".zarray", ".zgroup")
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"


class Arrays(NamedTuple):
    """The arrays of a file, by their paths without a slash at the start.

    Attributes
    ----------
    found : mapping of str to xarray.Variable
    attributes : mapping of str to mapping
        Attributes of groups, by their paths.
    netcdf : bool
        Whether numbers that were never written are those of netCDF.
    default : str or None
        The one that is read if there are several.
    along : mapping of str to mapping of str to Variable
        Coordinates along axes that are no arrays of the file, by array.
    away : mapping of str to str
        Arrays that lie in other files, and which.
    """

    found: Mapping[str, Any]
    attributes: Mapping[str, Mapping[str, Any]] = {}
    netcdf: bool = False
    default: str | None = None
    along: Mapping[str, Mapping[str, Any]] = {}
    away: Mapping[str, str] = {}


def is_store(path: Path) -> bool:
    """Whether a folder is a group or an array of Zarr."""
    return any((path / name).is_file() for name in _METADATA)


@contextmanager
def arrays_of(path: Path) -> Iterator[Arrays]:
    """Open a file or store; raises `OSError`, `InputError` and `MissingExtraError`."""
    if path.is_dir() or path.name.lower().endswith(ZARR):
        yield _zarr(path)
        return
    with path.open("rb") as file:
        start = file.read(4)
    if start in CLASSIC:
        xarray = library("xarray", extra="labelled", purpose="reading netCDF")
        # netCDF4 fills up files that are cut short, scipy does not know the fifth kind
        engine = ("netCDF4", "netcdf4") if start == CLASSIC[-1] else ("scipy.io", "scipy")
        library(engine[0], extra="labelled", purpose="reading netCDF of the classic kind")
        with reading("netCDF file", "ncdump -h shows what it holds"):
            file = xarray.open_dataset(path, engine=engine[1], decode_cf=False, cache=False)
        with file:
            yield Arrays({str(name): one for name, one in file.variables.items()}, {"": file.attrs}, netcdf=True)
        return
    h5py = library("h5py", extra="labelled", purpose=f"reading {path.suffix}")
    with reading("HDF5 file", "h5dump -H shows what it holds"):
        opened = h5py.File(path, "r")
    with opened:
        yield _hdf5(h5py, opened)


def _hdf5(h5py: Any, file: Any) -> Arrays:
    there: dict[str, Any] = {}
    groups: dict[str, Any] = {"": file}
    links: dict[str, Any] = {}
    with reading("HDF5 file"):
        file.visititems(lambda name, item: (there if hasattr(item, "shape") else groups).update({name: item}))
        file.visititems_links(lambda name, link: links.update({name: link}))
        # these are not opened: even a shape may be looked up in another file
        away = {name: str(link.filename) for name, link in links.items() if isinstance(link, h5py.ExternalLink)}
        for name, item in there.items():
            virtual = item.virtual_sources() if item.is_virtual else ()
            others = [each[0] for each in item.external or ()]
            others += [part.file_name for part in virtual if part.file_name != "."]
            away |= {name: str(others[0])} if others else {}
        found = {name: item for name, item in there.items() if name not in away and item.shape is not None}
        names = {item.id: name for name, item in found.items()}
        made = {name: _of_hdf5(name, item, names) for name, item in found.items()}
        made = {name: one for name, one in made.items() if not str(one.attrs.get("NAME")).startswith(_NO_VARIABLE)}
        about = {name: _attributes(item) for name, item in groups.items()}
    return Arrays(made, about, "_NCProperties" in file.attrs, away=away)


def _of_hdf5(name: str, item: Any, names: Mapping[Any, str]) -> Any:
    """An array with the names of its scales for its axes."""
    def get(key: Any) -> Any:
        if item.size and not (item.is_virtual or item.id.get_storage_size()):
            raise InputError(f"holds the shape of '/{plain(name)}', {item.shape}, but no samples", code="empty",
                             remedy="check that the file is complete")
        return item[key]

    scales = [next((names[scale.id] for scale in axis.values() if scale.id in names), None) for axis in item.dims]
    dims = [scale if scales.count(scale) == 1 else None for scale in scales]
    return lazy(item, [name] if item.is_scale and item.ndim == 1 else dims, _attributes(item), get)


def _attributes(item: Any) -> dict[str, Any]:
    out = {}
    for name in item.attrs:
        with suppress(KeyError, TypeError, ValueError, OSError):  # of a type that numpy does not have
            value = item.attrs[name]
            if np.shape(value) == (1,) or (np.ndim(value) and np.size(value) == 1 and value.dtype.kind in "OSU"):
                value = value.ravel()[0]
            out[name] = value.decode(errors="replace") if isinstance(value, bytes) else value
    return {name: one for name, one in out.items() if isinstance(one, str) or np.asarray(one).dtype.kind in "biufSUO"}


def _zarr(path: Path) -> Arrays:
    """A store, which is an array or a group of them."""
    zarr = library("zarr", extra="labelled", purpose="reading Zarr")
    with reading("Zarr store", "check that the file is complete"):
        inside = ""
        root: Any = str(path)
        if path.is_file():
            root = zarr.storage.ZipStore(path, mode="r")
            from zipfile import ZipFile

            # the folder that was packed, or what was in it
            with ZipFile(path) as packed:
                tops = [name.rpartition("/")[0] for name in packed.namelist() if name.rpartition("/")[2] in _METADATA]
            inside = min(tops, key=len, default="")
        top = zarr.open(root, path=inside, mode="r")
        members = {"": top} if hasattr(top, "dtype") else {"": top, **dict(top.members(max_depth=None))}
        arrays = {name: _of_zarr(one) for name, one in members.items() if hasattr(one, "dtype")}
        about = {name: dict(one.attrs) for name, one in members.items() if name not in arrays}
        along: dict[str, dict[str, Any]] = {}
        for name, attributes in about.items():
            along |= _levels(f"{name}/" if name else "", attributes, arrays)
    return Arrays(arrays, about, default=next(iter(along), None), along=along)


def _of_zarr(stored: Any) -> Any:
    attributes = dict(stored.attrs)
    dims: Sequence[str | None] | None = stored.metadata.dimension_names if stored.metadata.zarr_format == 3 else (
        attributes.pop("_ARRAY_DIMENSIONS", None))
    # of Zarr 2, 0 is what Zarr itself begins with, not a marker
    if stored.metadata.zarr_format == 2 and stored.fill_value:
        attributes.setdefault("_FillValue", stored.fill_value)
    named = dims is not None and len(dims) == len(set(dims)) == stored.ndim
    return lazy(stored, dims if named and dims else [None] * stored.ndim, attributes)


def _levels(group: str, attributes: Mapping[str, Any], arrays: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Coordinates along the axes in space of multiscale images of OME-Zarr, by array, the finest first.

    The arrays get the names of these axes.
    """
    out: dict[str, dict[str, Any]] = {}
    ome = attributes.get("ome")
    images = (ome if isinstance(ome, Mapping) else attributes).get("multiscales")
    for image in images if isinstance(images, list) else ():
        axes = [axis if isinstance(axis, dict) else {"name": str(axis)} for axis in image.get("axes", "tczyx")]
        names = [str(axis["name"]) for axis in axes]
        for level in image["datasets"]:
            name = group + str(level["path"]).strip("/")
            if name not in arrays or arrays[name].ndim != len(axes):
                continue
            scale, start = np.ones(len(axes)), np.zeros(len(axes))
            for step in (*level.get("coordinateTransformations", ()), *image.get("coordinateTransformations", ())):
                if step["type"] == "scale":
                    factor = np.array(step["scale"], np.float64)
                    scale, start = scale * factor, start * factor
                elif step["type"] == "translation":
                    start = start + np.array(step["translation"], np.float64)
                elif step["type"] != "identity":
                    raise InputError(f"places its samples by '{step['type']}'; a scale and a translation can be read",
                                     code="placement", remedy="open it with zarr, and give an isocodec.Field")
            one = arrays[name]
            arrays[name] = one._replace(dims=names)
            out[name] = {
                dim: type(one)(dim, start[i] + scale[i] * np.arange(one.shape[i]),
                               {"axis": dim, **({"units": axis["unit"]} if "unit" in axis else {})})
                for i, (dim, axis) in enumerate(zip(names, axes, strict=True)) if axis.get("type", "space") == "space"
            }
    return out


def lazy(
    stored: Any, dims: Sequence[str | None], attributes: Mapping[str, Any], get: Callable[[Any], Any] | None = None
) -> Any:
    """A variable of xarray over an array with ``shape``, ``dtype`` and slices; axes without a name get one."""
    xarray = library("xarray", extra="labelled", purpose="reading arrays with labels")
    names: list[str] = []
    for dim, size in zip(dims, stored.shape, strict=True):
        name = f"axis of {size}"
        while dim is None and name in names:
            name += " again"
        names.append(name if dim is None else dim)
    made = _lazy_class()(tuple(stored.shape), np.dtype(stored.dtype), get or stored.__getitem__)
    return xarray.Variable(names, xarray.core.indexing.LazilyIndexedArray(made), dict(attributes))


@cache
def _lazy_class() -> Any:
    """The class of arrays whose slices are read by a function."""
    xarray = library("xarray", extra="labelled", purpose="reading arrays with labels")
    indexing = xarray.core.indexing
    base: Any = xarray.backends.BackendArray

    class Stored(base):
        def __init__(self, shape: tuple[int, ...], dtype: np.dtype[Any], get: Callable[[Any], Any]) -> None:
            self.shape, self.dtype, self._get = shape, dtype, get

        def __getitem__(self, key: Any) -> Any:
            return indexing.explicit_indexing_adapter(
                key, self.shape, indexing.IndexingSupport.BASIC, lambda found: np.asarray(self._get(found)))

    return Stored
