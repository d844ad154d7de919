"""Arrays with labels (xarray) as fields: those of netCDF, HDF5 and Zarr files, and those in memory."""

from __future__ import annotations

import math
import re
import warnings
import weakref
from collections.abc import Iterable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, one_line, plain
from ..field.framed import Frames
from ..field.missing import missing_samples
from ..field.placement import FRAME_STEP, Placement
from ..field.sampled import Field
from .arrays import VALUES, channel_of, check_kind
from .conventions import is_globe, is_mapping, is_time, located
from .in_turn import InTurn, check_frame, check_series, placed_field, unjoined
from .libraries import choose, library, reading
from .packing import Packing, restored
from .stores import HDF5, ZARR, Arrays, arrays_of, is_store

SUFFIXES = (*HDF5, *ZARR)
_POINTERS = ("coordinates", "bounds", "grid_mapping", "ancillary_variables")
_UNITS = {"D": 86400, "h": 3600, "min": 60, "s": 1}
"""Seconds of the units that a step in time is written in."""
_PLACING = re.compile(r"spacing|origin|element_?size|(pixel|voxel)_?size|resolution|global_?offset|direction", re.I)
"""Attributes by which files that do not follow the conventions place samples."""
_NETCDF = "of netcdf"
"""Name of the encoding of an array of a netCDF file."""
_WORDS = 200
"""Characters of a note at most that names a single coordinate."""
_REMEDY = "choose one along {0} with --frame (frame= in Python), or array.isel({0}=0)"


def is_labelled(thing: object) -> bool:
    """Whether this is a DataArray or a Dataset of xarray."""
    return all(hasattr(thing, name) for name in ("coords", "sizes", "isel"))


def open_(
    path: Path, key: str | None = None, band: int | None = None, frame: int | None = None, frames: bool = False,
    nodata: float | None = None, lazy: bool = False,
) -> Field | Frames:
    """Read an array of a netCDF or HDF5 file, or of a Zarr store.

    Parameters
    ----------
    path : Path
    key : str, optional
        Path of the array; without it the only one of two or more axes, the one named ``values``, or the finest level
        of an OME-Zarr image.
    band : int, optional
        Channel of an OME-Zarr image, counted from 1.
    frame, frames, nodata, lazy
        As of `of_labelled`.

    Raises
    ------
    OSError, InputError, OptionError, MissingExtraError
    """
    key = None if key is None else key.strip("/")
    while is_store(path) and is_store(path.resolve().parent):  # an array of a group is placed by what lies around it
        path = path.resolve()
        key, path = f"{path.name}/{key}" if key else path.name, path.parent
    with ExitStack() as held:
        arrays = held.enter_context(arrays_of(path))
        array, remarks = _array(arrays, key)
        if "c" in array.dims or band is not None:
            array = array.isel({"c": channel_of(array.sizes.get("c", 1), band)}, missing_dims="ignore")
        found = of_labelled(array, None, frame, frames, nodata, lazy)
        if frames or lazy:  # samples are read later
            weakref.finalize(found.fields if isinstance(found, Frames) else found.values, held.pop_all().close)
    if isinstance(found, Field):
        return found if found.placement else replace(found, remarks=(*found.remarks, *remarks))
    return found


def of_labelled(
    array: Any, key: str | None = None, frame: int | None = None, frames: bool = False, nodata: float | None = None,
    lazy: bool = False,
) -> Field | Frames:
    """A DataArray of two or three axes, but for those of one sample, or a variable of a Dataset, as a field.

    Parameters
    ----------
    array : xarray.DataArray or xarray.Dataset
    key : str, optional
        The variable of a Dataset.
    frame : int, optional
        Number along the axis of times, or else the first axis.
    frames : bool
        Give the whole series; with ``frame``, the slices of that volume.
    nodata : float, optional
        Stored number of missing samples, instead of what attributes state; NaN: none.
    lazy : bool
        Leave samples where they are until windows of them are read.

    Raises
    ------
    InputError
        Of other shapes and types, and of values on unstructured meshes.
    OptionError
        If there is no such frame.
    """
    if hasattr(array, "data_vars"):
        array = _array(Arrays(array.variables, {"": array.attrs}), key, array)[0]
    if {"mesh", "location"} <= array.attrs.keys():
        raise InputError("holds values on an unstructured mesh (UGRID)", code="mesh",
                         remedy="open it with xugrid, and give an isocodec.Mesh")
    array = array.squeeze()
    check_kind(array.dtype)
    if frame is not None:
        axis = _frame_axis(array)
        check_frame(frame, array.shape[axis] if array.ndim > 2 else 0)
        array = array.isel({array.dims[axis]: frame})
    if not frames:
        return _field(array, nodata, lazy)
    check_series(array.ndim)
    dim = array.dims[_frame_axis(array)]
    step, first = _step(array, dim), _windows(array.isel({dim: 0}), None)
    _, further = unjoined(first.placement)

    def make(number: int) -> Field:
        field = _field(array.isel({dim: number}), nodata, False, drop=False)
        place, _ = unjoined(field.placement)
        return replace(field, placement=place, notes={**field.notes, **({FRAME_STEP: step} if step else {})})

    return Frames(InTurn(array.sizes[dim], make, array.shape, (*first.remarks, *further)))


class Windows:
    """The samples of a DataArray by slices, masked where they are missing."""

    windowed = True

    def __init__(self, array: Any, nodata: float | None = None) -> None:
        self._array, self._nodata = array, nodata
        self.packing = Packing.of(array.dtype, array.attrs, bool(array.encoding.get(_NETCDF)))
        self._before = array.encoding if np.dtype(array.encoding.get("dtype", "f8")).kind in "iu" else {}
        self.shape, self.ndim = tuple(array.shape), array.ndim
        self.dtype = self[(slice(1),) * self.ndim].dtype if self._before else (
            np.dtype(np.uint8) if array.dtype.kind == "b" else self.packing.dtype)

    def __getitem__(self, window: Any) -> Any:
        with reading("array"):
            raw = np.asarray(self._array[window].values)
        # a marker takes the place of those of the input, but where these are packed
        marked = self._nodata is None or not self.packing.plain
        values, gone = self.packing.samples(raw, marked)
        if self._before and raw.dtype.kind == "f":
            values, gone = restored(raw, self._array.attrs, self._before)
        gone = np.zeros(values.shape, np.bool_) if gone is None else gone
        if self._nodata is not None:
            gone |= missing_samples(values, self._nodata)
        return np.ma.masked_array(np.ascontiguousarray(values), gone)


def _windows(array: Any, nodata: float | None) -> Field:
    """A field whose samples stay where they are, placed by even steps alone."""
    where = located(array, joined=False)
    return _described(array, Windows(array, nodata), where.place)


def _field(array: Any, nodata: float | None, lazy: bool, drop: bool = True) -> Field:
    if array.ndim not in (2, 3):
        sizes = ", ".join(f"{plain(str(name))} {count}" for name, count in array.sizes.items())
        first = plain(str(array.dims[_frame_axis(array)])) if array.dims else "time"
        raise InputError(f"an array with axes {sizes or 'of one sample each'}; a field has two or three", code="shape",
                         remedy=_REMEDY.format(first))
    if lazy:
        return _windows(array, nodata)
    with reading("coordinates"):
        where = located(array)
    values = Windows(array, nodata)[(slice(None),) * array.ndim]
    if where.repeated and drop:
        axis, count = where.repeated
        first, last = (values.take(range(at, at + count), axis) for at in (0, array.shape[axis] - count))
        same = (np.ma.getmaskarray(first) == np.ma.getmaskarray(last)).all() and np.array_equal(
            first.filled(0), last.filled(0), equal_nan=values.dtype.kind == "f")
        if same:
            array = array.isel({array.dims[axis]: slice(0, -count)})
            where, values = located(array), values.take(range(array.shape[axis]), axis)
    remarks: tuple[str, ...] = ()
    if where.lost is not None:
        there = ~np.ma.getmaskarray(values) & (~np.isnan(values.data) if values.dtype.kind == "f" else True)
        if count := int(np.count_nonzero(there & where.lost)):
            remarks = (f"{count:,} samples have no coordinates, and are left out as missing",)
            values = np.ma.masked_array(values.data, np.ma.getmaskarray(values) | (there & where.lost))
    found = _described(array, values, where.place)
    return replace(found, remarks=(*found.remarks, *remarks))


def _described(array: Any, values: Any, place: Placement) -> Field:
    unit, name = array.attrs.get("units"), array.name or array.attrs.get("long_name")
    packing = Packing.of(array.dtype, array.attrs)
    return placed_field(values, None, place, packing.remarks, crs=place.crs, unit=one_line(str(unit)) if unit else None,
                        name=one_line(str(name)) if name else None, notes=_notes(array))


def _notes(array: Any) -> dict[str, str]:
    """Coordinates that are the same for all samples, as notes."""
    notes = {}
    for name, one in array.coords.items():
        if one.ndim == 0 and not is_mapping(one):
            number = one.dtype.kind in "biuf"
            unit = one.attrs.get("units") if number else None
            text = one_line(str(one.values.item() if number else one.values), _WORDS)
            notes[plain(str(name))] = f"{text} {one_line(str(unit))}" if unit else text
    return notes


def _array(arrays: Arrays, key: str | None, dataset: Any = None) -> tuple[Any, tuple[str, ...]]:
    """The array that a key names, or the only one, with the coordinates of its group and of the groups around.

    Also a remark on attributes that may place it.
    """
    every = arrays.found
    if key is None and any("topology_dimension" in one.attrs for one in every.values()):
        raise InputError("holds values on an unstructured mesh (UGRID)", code="mesh",
                         remedy="open it with xugrid, and give an isocodec.Mesh")
    folders = {name: name.rpartition("/")[0] for name in map(str, every)}
    aside = {_visible(word, folders[name], every) for name, one in every.items() for word in _words(one)}
    aside |= {name for name, one in every.items()
              if is_globe(name.rpartition("/")[2], one.attrs) or one.dims == (name,)}
    fields = [name for name, one in every.items()
              if name not in aside and sum(size > 1 for size in one.shape) > 1] + [*arrays.away]
    if key is None:
        key = VALUES if VALUES in fields else arrays.default
    key = choose(fields if key is None else [*every, *arrays.away], key)
    if key in arrays.away:
        raise InputError(f"its samples lie in another file, {plain(arrays.away[key])}", code="other-file",
                         remedy="read them with h5py, and give the array")
    xarray = library("xarray", extra="labelled", purpose="reading arrays with labels")
    if dataset is not None:
        main = dataset[key]
    else:
        main = xarray.DataArray(every[key], name=key.rpartition("/")[2] or None)
        main.encoding[_NETCDF] = arrays.netcdf
    named = {_visible(word, folders[key], every) for word in (*_words(main), "spatial_ref")}
    coordinates: dict[Any, Any] = {}
    for name in sorted(map(str, every), key=len):
        one, short = every[name], name.rpartition("/")[2]
        around = f"{folders[key]}/".startswith(f"{folders[name]}/" if folders[name] else "")
        if name == key or name in main.coords or not (around or name in main.dims):
            continue
        along = one.dims[0] if one.dims in ((name,), (short,)) else None
        if all(main.sizes.get(dim) == size for dim, size in one.sizes.items()) and (
                along or name in named or (one.ndim and is_globe(short, one.attrs))):
            coordinates[along or short] = _in_time(name, one)
    around_it = [arrays.attributes.get(folders[key], {}), main.attrs] if dataset is None else [main.attrs]
    stated = [f"{name} = {one_line(str(value), 40)}" for attributes in around_it
              for name, value in attributes.items() if _PLACING.search(str(name))]
    remarks = (f"its attributes {', '.join(map(plain, stated))} are left out, as no convention defines them; "
               "place samples with --spacing and --origin",) if stated else ()
    return main.assign_coords({**coordinates, **arrays.along.get(key, {})}), remarks


def _words(one: Any) -> Iterable[str]:
    """Names of other arrays in attributes: of coordinates, bounds and grid mappings."""
    for name in _POINTERS:
        yield from (word.rstrip(":") for word in str({**one.encoding, **one.attrs}.get(name, "")).split())


def _visible(word: str, folder: str, found: Mapping[str, Any]) -> str | None:
    """The array of that name in a group, or the nearest one around it."""
    name = f"{folder}/{word}".strip("/")
    if name in found:
        return name
    return _visible(word, folder.rpartition("/")[0], found) if folder else None


def _in_time(name: str, one: Any) -> Any:
    """Coordinates, times as such where their calendar is known."""
    if " since " in str(one.attrs.get("units")):
        xarray = library("xarray", extra="labelled", purpose="reading arrays with labels")
        with warnings.catch_warnings(action="ignore"), suppress(Exception):  # else they stay numbers with a unit
            return xarray.conventions.decode_cf_variable(name, one).load()
    return one


def _frame_axis(array: Any) -> int:
    """The axis along which frames are counted: that of times, or the first one."""
    return next((
        axis for axis, dim in enumerate(array.dims)
        if (is_time(array.coords[dim]) if dim in array.coords else str(dim).lower() in ("time", "t"))
    ), 0)


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
