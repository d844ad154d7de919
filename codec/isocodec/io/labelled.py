"""Arrays with labels (xarray) as fields: those of netCDF, HDF5 and Zarr files, and those in memory."""

from __future__ import annotations

import re
import weakref
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import InputError, OptionError, one_line, plain
from ..field.framed import Frames
from ..field.placement import Placement
from ..field.sampled import Field
from ..field.times import time_text
from ..verbs import Choice
from .arrays import VALUES, channel_of, check_kind
from .conventions import is_mapping, is_time, kind_of, located
from .in_turn import InTurn, check_frame, check_series, placed_field, unjoined
from .libraries import choose, library, reading
from .packing import MaskedSamples
from .stores import HDF5, ZARR, Arrays, arrays_of, is_store

SUFFIXES = (*HDF5, *ZARR)
_POINTERS = ("coordinates", "bounds", "grid_mapping", "ancillary_variables")
_PLACING = re.compile(r"spacing|origin|element_?size|(pixel|voxel)_?size|resolution|global_?offset|direction", re.I)
"""Attributes that place samples in files that do not follow the conventions."""
_MOST_REPEATED = 2
"""Columns of a grid around the globe that the first ones may repeat."""
_WORDS = 200
"""Characters of a note at most that names a single coordinate."""


def open_(path: Path, choice: Choice) -> Field | Frames:
    """Read an array of a netCDF or HDF5 file, or of a Zarr store; without a key its finest level, if it is an image."""
    key = None if choice.key is None else choice.key.strip("/")
    while is_store(path) and is_store(path.resolve().parent):  # an array of a group is placed by what lies around it
        path = path.resolve()
        key, path = f"{path.name}/{key}" if key else path.name, path.parent
    with ExitStack() as held:
        arrays = arrays_of(path, held)
        array, remarks = _chosen(arrays, key)
        if "c" in array.dims or choice.band is not None:
            array = array.isel({"c": channel_of(array.sizes.get("c", 1), choice.band)}, missing_dims="ignore")
        found = of_labelled(array, choice)
        if choice.frames or choice.lazy:  # samples are read later
            weakref.finalize(found.fields if isinstance(found, Frames) else found.values, held.pop_all().close)
    if isinstance(found, Field) and not found.placement:
        return replace(found, remarks=(*found.remarks, *remarks))
    return found


def of_labelled(array: Any, choice: Choice) -> Field | Frames:
    """Read a DataArray of two or three axes besides those of one sample, a variable of a Dataset, or a DataFrame.

    Frames are counted along the axis of times, or else the first axis.
    """
    if hasattr(array, "iloc"):
        array = library("xarray", extra="labelled", purpose="reading a DataFrame").DataArray(array)
    if hasattr(array, "data_vars"):
        array = _chosen(Arrays({str(name): array[name] for name in array.variables}), choice.key)[0]
    if {"mesh", "location"} <= array.attrs.keys():
        raise _unstructured()
    array = array.squeeze()
    check_kind(array.dtype)
    if choice.frame is not None:
        axis = _frame_axis(array)
        check_frame(choice.frame, array.shape[axis] if array.ndim > 2 else 0)
        array = array.isel({array.dims[axis]: choice.frame})
    if not choice.frames:
        return _field(array, choice.nodata, choice.lazy)
    check_series(array.ndim)
    dim = array.dims[_frame_axis(array)]
    times, first = _times(array, dim), _field(array.isel({dim: 0}), choice.nodata, lazy=True)
    _, remarks = unjoined(first.placement)

    def make(number: int) -> Field:
        field = _field(array.isel({dim: number}), choice.nodata, series=True)
        place, _ = unjoined(field.placement)
        return replace(field, placement=place)

    return Frames(InTurn(array.sizes[dim], make, array.shape, (*first.remarks, *remarks)), times=times)


def _field(array: Any, nodata: float | None, lazy: bool = False, series: bool = False) -> Field:
    if array.ndim not in (2, 3):
        sizes = ", ".join(f"{plain(str(name))} {count}" for name, count in array.sizes.items())
        raise InputError(f"an array with axes {sizes or 'of one sample each'}; a field has two or three", code="shape",
                         remedy="choose one along the others with --frame (frame= in Python), or array.isel(time=0)")
    with reading("attributes"):
        samples, (place, lost, around) = MaskedSamples(array, nodata), located(array, joined=not lazy)
    if lazy:
        return _described(array, samples, place, samples.remarks)
    values = samples[...]
    for count in range(1, _MOST_REPEATED + 1) if around is not None and not series else ():
        first, last = (values.take(range(*part), around).astype(np.float64).filled(np.nan)
                       for part in ((0, count), (-count, 0)))
        if np.array_equal(first, last, equal_nan=True):
            rest = array.isel({array.dims[around]: slice(-count)})
            if located(rest).place.periodic:
                return _field(rest, nodata)
    remarks = samples.remarks
    if lost.any():
        gone = lost & ~np.ma.getmaskarray(values) & (values.data == values.data)
        values[gone] = np.ma.masked
        remarks += [f"{gone.sum():,} samples have no coordinates, and are left out as missing"] * bool(gone.any())
    return _described(array, values, place, remarks)


def _described(array: Any, values: Any, place: Placement, remarks: Sequence[str]) -> Field:
    named = {"unit": array.attrs.get("units"), "name": array.name or array.attrs.get("long_name")}
    # coordinates that are the same for all samples are notes
    notes = {plain(str(name)): one_line(f"{one.values} {one.attrs.get('units', '')}".strip(), _WORDS)
             for name, one in array.coords.items() if one.ndim == 0 and not is_mapping(one)}
    return placed_field(values, None, place, remarks, crs=place.crs, notes=notes,
                        **{name: one_line(str(text)) for name, text in named.items() if text})


def _chosen(arrays: Arrays, key: str | None) -> tuple[Any, list[str]]:
    """The array that a key names, or the only one of two or more axes that is no coordinate, with its coordinates.

    Also remarks on attributes that may place it.
    """
    every = arrays.found
    if key is None:
        if any("topology_dimension" in one.attrs for one in every.values()):
            raise _unstructured()
        aside = {word for one in every.values() for word in _words(one)}
        fields = [path for path, one in every.items() if sum(size > 1 for size in one.shape) > 1
                  and not kind_of(path, one.attrs)[1] and PurePosixPath(path).name not in aside]
        fields += arrays.refused
        key = choose(fields, VALUES if VALUES in fields else arrays.default)
    key = choose([*every, *arrays.refused], key)
    if key in arrays.refused:
        raise arrays.refused[key]
    around = arrays.attributes.get(key.rpartition("/")[0], {})
    stated = [f"{plain(name)} = {one_line(str(value), 40)}" for name, value in {**around, **every[key].attrs}.items()
              if _PLACING.search(name)]
    return _with_coordinates(key, every), [
        f"its attributes {', '.join(stated)} are left out, as no convention defines them; place samples with --spacing "
        "and --origin"] * bool(stated)


def _unstructured() -> InputError:
    return InputError("holds values on an unstructured mesh (UGRID)", code="mesh",
                      remedy="open it with xugrid, and give an isocodec.Mesh")


def _with_coordinates(key: str, every: Mapping[str, Any]) -> Any:
    """An array with the coordinates that lie in its group and in the groups around it; times as such."""
    array, groups = every[key], PurePosixPath(key).parents
    named = {*_words(array), "spatial_ref"}
    coordinates: dict[Any, Any] = {}
    for path, one in sorted(every.items(), key=lambda item: len(item[0])):  # the nearest one comes last
        place = PurePosixPath(path)
        along = one.dims in ((path,), (place.name,))
        wanted = along or place.name in named or (one.ndim and kind_of(path, one.attrs)[1])
        fits = all(array.sizes.get(dim) == size for dim, size in one.sizes.items())
        if wanted and fits and path not in (key, *array.coords) and (place.parent in groups or path in array.dims):
            coordinates[one.dims[0] if along else place.name] = one.variable
    array = array.assign_coords(coordinates)
    xarray = library("xarray", extra="labelled", purpose="reading arrays with labels")
    with suppress(InputError), reading("times"):  # else they stay numbers with a unit
        array = array.assign_coords(xarray.decode_cf(
            array.coords.to_dataset(), mask_and_scale=False, decode_coords=False, decode_timedelta=False).coords)
    return array


def _words(one: Any) -> list[str]:
    """Names of other arrays in attributes: of coordinates, bounds and grid mappings."""
    attributes = {**one.encoding, **one.attrs}
    return re.findall(r"[^\s:]+", " ".join(str(attributes.get(name, "")) for name in _POINTERS))


def _frame_axis(array: Any) -> int:
    """The axis along which frames are counted: that of times, or the first one."""
    times = [is_time(array[dim]) for dim in array.dims]
    return times.index(True) if True in times else 0


def _times(array: Any, dim: Any) -> list[str] | None:
    """Times of frames along an axis; None if it states none, or others than dates and numbers."""
    if dim not in array.coords or not is_time(array[dim]):
        return None
    values, unit = array[dim].values, str(array[dim].attrs.get("units", "")).strip()
    if values.dtype.kind == "m":
        values, unit = values / np.timedelta64(1, "s"), "s"
    if values.dtype.kind == "O":  # dates of other calendars
        values = [each.isoformat() if hasattr(each, "isoformat") else each for each in values]
    elif values.dtype.kind in "iuf" and unit:  # a date that it counts from is not in the calendar
        values = [] if " since " in unit else [f"{each:.15g} {unit}" for each in values]
    with suppress(OptionError):
        return [time_text(each) for each in values] or None
    return None
