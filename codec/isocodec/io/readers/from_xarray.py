"""Xarray reads NetCDF, HDF5, Zarr and GRIB, and arrays with labels that are in memory, all in one way.

Samples are read when they are asked for: a frame or a window takes no more than it needs.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, one_line, plain
from ...extras import optional
from ...field.placement import Placement
from ...field.sampled import Field
from .arrays import Arrays, lazy
from .from_h5py import arrays_of_hdf5
from .from_zarr import arrays_of_zarr, is_store
from .labels import Located, is_globe, is_time, located, notes_of
from .opened import IN_MEMORY, Choice, Format, Opened, unjoined
from .packing import Packing
from .reading import about, channel_of, check_frame, choose, reading
from .slices import Slices
from .source import InputFile, check_kind

_CLASSIC = (b"CDF\1", b"CDF\2", b"CDF\5")
_UNITS = {"D": 86400, "h": 3600, "min": 60, "s": 1}
"""Seconds of the units that a step in time is written in."""


class OpenedLabels(Opened):
    """An array with labels in memory: a DataArray of xarray, or a DataFrame of pandas with its index and columns."""

    def __init__(self, array: Any) -> None:
        if not hasattr(array, "dims"):
            array = optional("xarray", extra="xarray", purpose="reading a DataFrame").DataArray(array)
        self._array = array
        super().__init__(IN_MEMORY, Choice())

    def _open(self, choice: Choice) -> None:
        array = self._array = self._array.squeeze(drop=False)
        if array.dtype.kind == "b" and self._source is not IN_MEMORY:
            array = self._array = array.astype(np.uint8)
        netcdf = bool(array.encoding.get(_NETCDF))
        self._packing = Packing.of(array.dtype, array.attrs, array.encoding, netcdf)
        self._marked, self._joined, self._where = True, True, Located(Placement())
        self.shape, self.dtype = tuple(array.shape), self._packing.dtype
        self.nodata = next(map(float, self._packing.markers), None) if self._packing.plain else None
        unit, name = array.attrs.get("units"), array.name or array.attrs.get("long_name")
        self.unit, self.name = (one_line(str(text)) if text else None for text in (unit, name))

    def field(self, frame: int | None = None, *, nodata: float | None = None) -> Field:
        """Read a field; see `Opened.field`."""
        with about(self.label):
            array = _of_field(self._taken(frame))
            # a marker takes the place of those of the input, but where these are packed
            self._marked = nodata is None or not self._packing.plain
            self._where, values = self._locate(array), self.read(array)
            if self._where.repeated:
                axis, count = self._where.repeated
                first, last = (np.ma.filled(values.take(range(start, start + count), axis), 0)
                               for start in (0, array.shape[axis] - count))
                if np.array_equal(first, last, equal_nan=values.dtype.kind == "f"):
                    array = array.isel({array.dims[axis]: slice(0, -count)})
                    self._where, values = self._locate(array), values.take(range(array.shape[axis]), axis)
            found = self._described(values, self._where.place, nodata, notes_of(array))
            return replace(found, crs=self._where.place.crs)

    def fields(self, slices: Slices, nodata: float | None = None) -> Callable[[int], Field]:
        """Give what makes a field of each of some slices; see `Opened.fields`."""
        self._marked = nodata is None or not self._packing.plain
        return super().fields(slices, nodata)

    def frames(self, axis: int | None = None, frame: int | None = None, *, placed: bool = True) -> Slices:
        """Give the samples as a series, in time if one of the axes is; see `Opened.frames`."""
        with about(self.label):
            array = self._taken(frame)
        found = super().frames(_axis_of_frames(array) if axis is None else axis, frame, placed=placed)
        return replace(found, step=_step(array, array.dims[found.axis]))

    def _described(
        self, values: Any, place: Placement, nodata: float | None, notes: Mapping[str, str] | None = None
    ) -> Field:
        gone, bare, remarks = np.ma.getmaskarray(values), np.ma.getdata(values), self._packing.remarks
        found = super()._described(bare, place, nodata, notes)
        gone = gone if found.mask is None else gone | found.mask
        if self._where.lost is not None:
            there = ~gone if bare.dtype.kind != "f" else ~gone & ~np.isnan(bare)
            if count := np.count_nonzero(there & self._where.lost):
                remarks = (*remarks, f"{count:,} samples have no coordinates, and are left out as missing")
                gone = gone | (there & self._where.lost)
        return replace(found, mask=gone if gone.any() else None, remarks=(*found.remarks, *remarks))

    def _locate(self, array: Any) -> Located:
        for one in array.coords.values():
            self._source.check_count(one.size)
        with reading("coordinates"):
            return located(array, self._joined)

    def read(self, array: Any) -> Any:
        """Samples of a part of the array: integers masked where they are missing."""
        self._source.check_array(array.shape, array.dtype)
        with reading("array"):
            values, gone = self._packing.samples(np.asarray(array.values), self._marked)
            values = np.ascontiguousarray(values, values.dtype.newbyteorder("="))
        return values if gone is None else np.ma.masked_array(values, gone)

    def _taken(self, frame: int | None) -> Any:
        if frame is None:
            return self._array
        check_frame(frame, self._array.shape[_axis_of_frames(self._array)] if self._array.ndim > 2 else 0)
        return _at(self._array, frame)

    def _values(self, frame: int | None) -> NDArray[Any]:
        return np.asarray(np.ma.getdata(self.read(self._taken(frame))))

    def _place(self, n: int, frame: int | None) -> Placement:
        array = self._taken(frame)
        while array.ndim > n:
            array = _at(array, 0)
        place = self._locate(array).place if array.ndim in (2, 3) else Placement()
        if self._joined or place.coordinates is None:
            return place
        remark = "its coordinates are left out, as windows are placed by even steps alone"
        return Placement(crs=place.crs, remark="; ".join(filter(None, (place.remark, remark))))

    def _place_of_slices(self, axis: int, n: int) -> Placement:
        array = self._array if self._array.ndim <= n + 1 else _at(self._array, 0)
        self._where = self._locate(array.isel({array.dims[axis]: 0}))
        return unjoined(self._where.place)

    def _slices(self, frame: int | None) -> Any:
        return LabelledWindows(self, self._taken(frame))

    def windows(self, nodata: float | None = None) -> Any:
        """Give the samples by windows; see `Opened.windows`."""
        self._marked = nodata is None or not self._packing.plain
        return super().windows(nodata)

    def windowed(self, nodata: float | None = None) -> Field | None:
        """Describe a field without reading its samples; see `Opened.windowed`."""
        found = super().windowed(nodata)
        assert found is not None
        return replace(found, crs=self.place(len(self.shape)).crs, notes=notes_of(self._array),
                       remarks=(*found.remarks, *self._packing.remarks))

    def _windows(self) -> LabelledWindows:
        self._joined = False
        return LabelledWindows(self, self._array)


class _LabelledFile(OpenedLabels):
    """An array of a file, whose samples are not read until they are asked for."""

    def __init__(self, source: InputFile, choice: Choice) -> None:
        Opened.__init__(self, source, choice)

    def _open(self, choice: Choice) -> None:
        source, key = self._source, None if choice.key is None else choice.key.strip("/")
        if source.named(*_GRIB):
            arrays = self.hold(_grib(source))
            shapes = {name: "(points)" if "values" in one.dims else one.shape for name, one in arrays.items()}
            self._array = arrays[choose(shapes, key)]
            if "values" in self._array.dims:
                raise InputError(f"holds points of {_kind(self._array)}, not rows and columns", code="shape",
                                 remedy="interpolate them first, as by cdo -remapbil,r720x360 (of sh -sp2gpl) IN OUT")
        elif source.named(*_HDF5):
            with source.path.open("rb") as file:
                start = file.read(4)
            opened = _classic(source, start) if start in _CLASSIC else arrays_of_hdf5(source)
            self._array = _labelled(source, self.hold(opened), key)
        else:
            # an array of a group is placed by the attributes of the group
            while is_store(source.path.resolve().parent):
                path = source.path.resolve()
                key = path.name if key is None else f"{path.name}/{key}"
                source = replace(source, path=path.parent)
            self._array = _labelled(source, self.hold(arrays_of_zarr(source)), key)
            if "c" in self._array.dims or choice.channel is not None:
                count = self._array.sizes.get("c", 1)
                self._array = self._array.isel({"c": channel_of(count, choice.channel)}, missing_dims="ignore")
        super()._open(choice)


class LabelledWindows:
    """An array, of which windows are read: NaN where floats are missing, masked where integers are."""

    def __init__(self, opened: OpenedLabels, array: Any) -> None:
        self._opened, self._array = opened, array
        self.shape, self.dtype, self.ndim = tuple(array.shape), opened.dtype, array.ndim

    def __getitem__(self, window: Any) -> Any:
        return self._opened.read(self._array[window])

    def transpose(self, order: Sequence[int]) -> LabelledWindows:
        """The array with its axes in another order."""
        return LabelledWindows(self._opened, self._array.transpose(*(self._array.dims[axis] for axis in order)))


def is_labelled(thing: Any) -> bool:
    """Whether this is an array with labels in memory."""
    if all(hasattr(thing, name) for name in ("index", "columns", "iloc")) and not hasattr(thing, "geometry"):
        return True
    return all(hasattr(thing, name) for name in ("dims", "coords", "values", "isel"))


def variable(dataset: Any, key: str | None) -> Any:
    """The array of a Dataset that a key names, or the only one of two axes or more; `InputError` for several."""
    aside = {word for one in dataset.variables.values() for word in _words(one.attrs)}
    aside |= {name for name, one in dataset.data_vars.items() if is_globe(name, one.attrs)}
    fields = {str(name): one.shape for name, one in dataset.data_vars.items() if name not in aside}
    array = dataset[choose(fields, key, [*map(str, dataset.variables)], option="key=")]
    more = {name: dataset[name] for name in aside if name in dataset.data_vars and name != array.name}
    return array.assign_coords({name: one for name, one in more.items() if set(one.dims) <= set(array.dims)})


def _axis_of_frames(array: Any) -> int:
    """The axis along which frames are counted: that of times, or the first one."""
    return next((
        axis for axis, dim in enumerate(array.dims)
        if (is_time(array.coords[dim]) if dim in array.coords else str(dim).lower() in ("time", "t"))
    ), 0)


def _of_field(array: Any) -> Any:
    """The array, if it has as many axes as a field."""
    check_kind(array.dtype)
    if array.ndim in (2, 3):
        return array
    sizes = ", ".join(f"{plain(str(name))} {count}" for name, count in array.sizes.items())
    first = plain(str(array.dims[_axis_of_frames(array)])) if array.dims else "time"
    raise InputError(
        f"an array with axes {sizes or 'of one sample each'}; a field has two or three", code="shape",
        remedy=f"choose one along {first} with --frame (frame= in Python), or array.isel({first}=0)",
    )


def _at(array: Any, frame: int) -> Any:
    return array.isel({array.dims[_axis_of_frames(array)]: frame})


def _step(array: Any, dim: Any) -> str:
    """Time from one frame to the next with its unit, if it is known and always the same."""
    times = array.coords[dim].values if dim in array.coords else np.zeros(0)
    if times.dtype.kind not in "mM" or len(times) < 2:
        return ""
    steps = np.unique(np.diff(times).astype("m8[ns]").astype(np.int64) / 1e9)
    if len(steps) > 1 or not math.isfinite(steps[0]) or steps[0] <= 0:
        return ""
    unit = next((unit for unit, seconds in _UNITS.items() if steps[0] % seconds == 0), "s")
    return f"{steps[0] / _UNITS[unit]:g} {unit}"


def _words(attributes: Mapping[str, Any]) -> list[str]:
    """Names of other arrays in attributes: of coordinates, bounds and grid mappings."""
    return [word.rstrip(":") for name in _POINTERS for word in str(attributes.get(name, "")).split()]


def _labelled(source: InputFile, arrays: Arrays, key: str | None) -> Any:
    """The array that a key names, or the only one, with its coordinates: those of its group and the groups around."""
    found, every = arrays.found, {**arrays.found, **arrays.away}
    inside = {name: name.rpartition("/")[0] for name in found}
    aside = {_visible(word, inside[name], every) for name, one in found.items() for word in _words(one.attrs)}
    aside |= {name for name, one in found.items() if is_globe(name.rpartition("/")[2], one.attrs)}
    fields: dict[str, Any] = {name: tuple(one.shape) for name, one in found.items() if name not in aside}
    fields |= {name: "in another file" for name in arrays.away if name not in aside or key == name}
    key = choose(fields, key, found, arrays.default)
    if key in arrays.away:
        raise source.refused(arrays.away[key], "in which samples lie")
    main = found[key].copy(deep=False)
    main.encoding[_NETCDF] = arrays.netcdf
    named = {_visible(word, inside[key], found) for word in (*_words(main.attrs), "spatial_ref")}
    coordinates = {}
    for name in sorted(found, key=len):
        one, short = found[name], name.rpartition("/")[2]
        around = f"{inside[key]}/".startswith(f"{inside[name]}/" if inside[name] else "")
        if name == key or not (around or name in main.dims):
            continue
        along = one.dims[0] if one.dims in ((name,), (short,)) else None
        fits = all(main.sizes.get(dim) == size for dim, size in one.sizes.items())
        if fits and (along or name in named or (one.ndim and is_globe(short, one.attrs))):
            coordinates[along or short] = _in_time(name, one)
    xarray = optional("xarray", extra="xarray", purpose="reading arrays with labels")
    return xarray.DataArray(main, {**coordinates, **arrays.along.get(key, {})}, name=key.rpartition("/")[2] or None)


def _visible(word: str, folder: str, found: Mapping[str, Any]) -> str | None:
    """The array of that name in a group, or the nearest one around it."""
    name = f"{folder}/{word}".strip("/")
    if name in found:
        return name
    return _visible(word, folder.rpartition("/")[0], found) if folder else None


def _in_time(name: str, one: Any) -> Any:
    """Coordinates, times as such where their calendar is known."""
    if " since " in str(one.attrs.get("units")):
        xarray = optional("xarray", extra="xarray", purpose="reading arrays with labels")
        with warnings.catch_warnings(action="ignore"), suppress(Exception):  # else they stay numbers with a unit
            return xarray.conventions.decode_cf_variable(name, one).load()
    return one


@contextmanager
def _classic(source: InputFile, start: bytes) -> Iterator[Arrays]:
    """Open a NetCDF file of the classic kind."""
    xarray = optional("xarray", extra="xarray", purpose="reading NetCDF of the classic kind")
    library, engine = ("netCDF4", "netcdf4") if start == _CLASSIC[-1] else ("scipy.io", "scipy")
    optional(library, extra="xarray", purpose="reading NetCDF of the classic kind")
    with reading("NetCDF file"), xarray.open_dataset(source.path, engine=engine, decode_cf=False, cache=False) as file:
        yield Arrays({str(name): one for name, one in file.variables.items()}, netcdf=True)


@contextmanager
def _grib(source: InputFile) -> Iterator[dict[str, Any]]:
    """Open a GRIB file: arrays of two axes in space, in whatever order their points come."""
    cfgrib = optional("cfgrib", extra="grib", purpose="reading GRIB")
    # the index that it would leave beside the file is another's to write
    options = {"indexpath": "", "values_dtype": np.dtype(np.float64), "encode_cf": ("parameter", "time", "vertical"),
               "read_keys": [*_SCANNING, "Nx", "Ny", "Ni", "Nj"]}
    with reading("GRIB file"):
        sets = cfgrib.open_datasets(str(source.path), backend_kwargs=options, cache=False)
        parts = [(str(name), one) for each in sets for name, one in each.data_vars.items()]
        names = [name for name, _ in parts]
        out: dict[str, Any] = {}
        for name, one in parts:
            level = f"{name}:{one.attrs.get('GRIB_typeOfLevel')}" if names.count(name) > 1 else name
            count = sum(other.partition("#")[0] == level for other in out)
            out[f"{level}#{count + 1}" if count else level] = _in_rows(one)
    yield out


def _in_rows(one: Any) -> Any:
    """An array of GRIB with rows and columns, of which each message has the points one after the other."""
    columns, rows = (one.attrs.get(f"GRIB_N{a}", one.attrs.get(f"GRIB_N{b}")) for a, b in ("xi", "yj"))
    if columns is None or rows is None or rows * columns != one.sizes["values"]:
        return one
    turning, consecutive, westwards, northwards = (one.attrs.get(f"GRIB_{name}", 0) for name in _SCANNING)
    on_globe = _kind(one).endswith(("_ll", "_gg"))
    if not on_globe and (westwards or not northwards):
        raise InputError(f"scans a {_kind(one)} grid to the west or south, of which ecCodes gives wrong coordinates",
                         code="placement", remedy="convert it with another library, such as GDAL")

    def grid(points: Any, consecutive: Any, turning: Any) -> Any:
        shaped = np.array(points).reshape((*points.shape[:-1], *((columns, rows) if consecutive else (rows, columns))))
        if turning:
            shaped[..., 1::2, :] = shaped[..., 1::2, ::-1].copy()
        return shaped.swapaxes(-1, -2) if consecutive else shaped

    def read(key: tuple[Any, ...]) -> Any:
        return grid(one.variable[key[:-2]].values, consecutive, turning)[(..., *key[-2:])]

    dims = [*one.dims[:-1], "y", "x"]
    made = lazy(dims, (*one.shape[:-1], rows, columns), one.dtype, read, one.attrs)
    coordinates = {name: each for name, each in one.coords.items() if "values" not in each.dims}
    for name in ("latitude", "longitude"):
        if name in one.coords:
            # rows never turn here, and those of a projected grid are not consecutive either
            points = grid(one.coords[name].values, consecutive and on_globe, False)
            coordinates[name] = _least(points, one.coords[name].attrs)
    return type(one)(made, coordinates, name=one.name)


def _kind(one: Any) -> str:
    """Name that GRIB has for the grid of an array."""
    return plain(str(one.attrs.get("GRIB_gridType")))


def _least(points: Any, attributes: Mapping[str, Any]) -> tuple[Any, ...]:
    """Coordinates of each sample, or those along an axis if they vary along it alone."""
    if (points == points[:1]).all():
        return "x", points[0], attributes
    return ("y", points[:, 0], attributes) if (points == points[:, :1]).all() else (("y", "x"), points, attributes)


_ZARR, _GRIB, _HDF5 = (".zarr",), (".grib", ".grib2", ".grb", ".grb2"), (".h5", ".hdf5", ".nc")
_SCANNING = ("alternativeRowScanning", "jPointsAreConsecutive", "iScansNegatively", "jScansPositively")
_NETCDF = "of netcdf"
"""Name of the encoding of an array of a NetCDF file."""
_POINTERS = ("coordinates", "bounds", "grid_mapping")
ZARR = Format("Zarr", _ZARR, _LabelledFile, extra="xarray", keyed=True, channels=True, folder=True)
FORMATS = (
    Format(
        "HDF5", _HDF5, _LabelledFile, extra="hdf5", keyed=True,
        signatures=((0, b"\x89HDF\r\n\x1a\n", ".h5"), *((0, start, ".nc") for start in _CLASSIC)),
    ),
    ZARR,
    replace(ZARR, suffixes=(".zarr.zip",), folder=False),
    Format(
        "GRIB", _GRIB, _LabelledFile, extra="grib", keyed=True, signatures=((0, b"GRIB", ".grib"),), confined="cfgrib"
    ),
)
