"""Arrays with labels (xarray) as fields: those of netCDF, HDF5 and Zarr files, and those in memory."""

from __future__ import annotations

import re
import warnings
import weakref
from collections.abc import Mapping
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
from .packing import Packing
from .stores import HDF5, ZARR, Arrays, arrays_of, is_store

SUFFIXES = (*HDF5, *ZARR)
_POINTERS = ("coordinates", "bounds", "grid_mapping", "ancillary_variables")
_SECONDS = {"D": 86400, "h": 3600, "min": 60, "s": 1}
_PLACING = re.compile(r"spacing|origin|element_?size|(pixel|voxel)_?size|resolution|global_?offset|direction", re.I)
"""Attributes by which files that do not follow the conventions place samples."""
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
        key = _chosen(arrays, key)
        group, _, name = key.rpartition("/")
        array = library("xarray", extra="labelled", purpose="reading arrays with labels").DataArray(
            arrays.found[key], arrays.levels.get(key), name=name or None)
        array = _with_coordinates(array, key, arrays.found)
        remarks = _stated(array, arrays.attributes.get(group, {}))
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
        every = {str(name): one for name, one in array.variables.items()}
        key = _chosen(Arrays(every), key)
        array = _with_coordinates(array[key], key, every)
    if {"mesh", "location"} <= array.attrs.keys():
        raise _unstructured()
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
        self._array, self._nodata, self.packing = array, nodata, Packing(array)
        self.shape, self.ndim, self.dtype = tuple(array.shape), array.ndim, self.packing.dtype

    def __getitem__(self, window: Any) -> Any:
        with reading("array"):
            raw = np.asarray(self._array[window].values)
        # a marker takes the place of those of the input, but where these are packed
        values = self.packing.samples(raw, self._nodata is None or not self.packing.plain)
        if self._nodata is not None:
            values[missing_samples(values.data, self._nodata)] = np.ma.masked
        return values


def _windows(array: Any, nodata: float | None) -> Field:
    """A field whose samples stay where they are, placed by even steps alone."""
    return _described(array, Windows(array, nodata), located(array, joined=False).place)


def _field(array: Any, nodata: float | None, lazy: bool, drop: bool = True) -> Field:
    if array.ndim not in (2, 3):
        sizes = ", ".join(f"{plain(str(name))} {count}" for name, count in array.sizes.items())
        first = plain(str(array.dims[_frame_axis(array)])) if array.dims else "time"
        raise InputError(f"an array with axes {sizes or 'of one sample each'}; a field has two or three", code="shape",
                         remedy=_REMEDY.format(first))
    if lazy:
        return _windows(array, nodata)
    with reading("coordinates"):
        place, lost, (axis, repeated) = located(array)
    values = Windows(array, nodata)[(slice(None),) * array.ndim]
    if repeated and drop:
        ends = values.take(range(repeated), axis), values.take(range(-repeated, 0), axis)
        if np.array_equal(*(one.astype(np.float64).filled(np.nan) for one in ends), equal_nan=True):
            return _field(array.isel({array.dims[axis]: slice(-repeated)}), nodata, lazy)
    found = _described(array, values, place)
    if lost is None:
        return found
    there = lost & ~np.ma.getmaskarray(values) & (values.data == values.data)
    values[there] = np.ma.masked
    remark = f"{np.count_nonzero(there):,} samples have no coordinates, and are left out as missing"
    return replace(found, values=values, remarks=(*found.remarks, *[remark] * bool(there.any())))


def _described(array: Any, values: Any, place: Placement) -> Field:
    unit, name = array.attrs.get("units"), array.name or array.attrs.get("long_name")
    return placed_field(values, None, place, Packing(array).remarks, crs=place.crs, unit=one_line(str(unit)) if unit else None,
                        name=one_line(str(name)) if name else None, notes=_notes(array))


def _notes(array: Any) -> dict[str, str]:
    """Coordinates that are the same for all samples, as notes."""
    notes = {}
    for name, one in array.coords.items():
        if one.ndim == 0 and not is_mapping(one):
            number = one.dtype.kind in "biuf"
            words = one.values.item() if number else one.values, one.attrs.get("units", "") if number else ""
            notes[plain(str(name))] = " ".join(one_line(str(word), _WORDS) for word in words if str(word))
    return notes


def _chosen(arrays: Arrays, key: str | None) -> str:
    """The path of the array that a key names, or of the only one of two or more axes that is no coordinate."""
    every = arrays.found
    if key is None:
        if any("topology_dimension" in one.attrs for one in every.values()):
            raise _unstructured()
        aside = {word for one in every.values() for word in _words(one)}
        fields = [path for path, one in every.items() if sum(size > 1 for size in one.shape) > 1
                  and not is_globe(path, one.attrs) and path.rpartition("/")[2] not in aside]
        fields += arrays.refused
        key = choose(fields, VALUES if VALUES in fields else next(iter(arrays.levels), None))
    key = choose([*every, *arrays.refused], key)
    if key in arrays.refused:
        raise arrays.refused[key]
    return key


def _unstructured() -> InputError:
    return InputError("holds values on an unstructured mesh (UGRID)", code="mesh",
                      remedy="open it with xugrid, and give an isocodec.Mesh")


def _with_coordinates(array: Any, path: str, every: Mapping[str, Any]) -> Any:
    """A DataArray with the coordinates that lie in its group and in the groups around it."""
    folder, named = path.rpartition("/")[0], {*_words(array), "spatial_ref"}
    coordinates: dict[Any, Any] = {}
    for name in sorted({*every} - {path, *array.coords}, key=len):
        one, (where, _, short) = every[name], name.rpartition("/")
        around = f"{folder}/".startswith(f"{where}/".lstrip("/"))
        along = one.dims in ((name,), (short,))
        fits = all(array.sizes.get(dim) == size for dim, size in one.sizes.items())
        if fits and (around or name in array.dims) and (
                along or short in named or (one.ndim and is_globe(name, one.attrs))):
            coordinates[one.dims[0] if along else short] = _in_time(name, one)
    return array.assign_coords(coordinates)


def _stated(array: Any, group: Mapping[str, Any]) -> list[str]:
    """Remark on attributes of an array or its group that may place it."""
    stated = [f"{plain(name)} = {one_line(str(value), 40)}" for name, value in {**group, **array.attrs}.items()
              if _PLACING.search(name)]
    return [f"its attributes {', '.join(stated)} are left out, as no convention defines them; place samples with "
            "--spacing and --origin"] if stated else []


def _words(one: Any) -> list[str]:
    """Names of other arrays in attributes: of coordinates, bounds and grid mappings."""
    return [word.rstrip(":") for name in _POINTERS for word in str({**one.encoding, **one.attrs}.get(name)).split()]


def _in_time(name: str, one: Any) -> Any:
    """Coordinates, times as such where their calendar is known."""
    if " since " in str(one.attrs.get("units")):
        xarray = library("xarray", extra="labelled", purpose="reading arrays with labels")
        with warnings.catch_warnings(action="ignore"), suppress(Exception):  # else they stay numbers with a unit
            return xarray.conventions.decode_cf_variable(name, one).load()
    return one


def _frame_axis(array: Any) -> int:
    """The axis along which frames are counted: that of times, or the first one."""
    times = [is_time(array.coords[dim]) if dim in array.coords else str(dim).lower() in ("time", "t")
             for dim in array.dims]
    return times.index(True) if True in times else 0


def _step(array: Any, dim: Any) -> str:
    """Time from one frame to the next with its unit, if it is known and always the same."""
    times = array.coords[dim].values if dim in array.coords else np.zeros(0)
    steps = np.unique(np.diff(times)) if times.dtype.kind in "mM" else []
    if len(steps) != 1 or not steps[0] > np.timedelta64(0):
        return ""
    seconds = steps[0] / np.timedelta64(1, "s")
    unit = next((unit for unit, size in _SECONDS.items() if seconds % size == 0), "s")
    return f"{seconds / _SECONDS[unit]:g} {unit}"
