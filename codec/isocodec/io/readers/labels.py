"""Arrays with named axes and coordinates, as xarray has them, and the conventions (CF) by which they are read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, OptionError, one_line, plain
from ...field.placement import TURN, Placement, matrix_of
from ...field.sampled import Field
from .place_of_samples import EVEN, placed_grid

Matrix = NDArray[np.float64]
DEGREES = "EPSG:4326"
_ROLES = {
    "x": {"x", "lon", "longitude", "easting", "rlon", "projection_x_coordinate", "grid_longitude", "degrees_east",
          "degree_east"},
    "y": {"y", "lat", "latitude", "northing", "rlat", "projection_y_coordinate", "grid_latitude", "degrees_north",
          "degree_north"},
    "z": {"z", "lev", "level", "height", "depth", "altitude", "plev"},
}
_EPSG = re.compile(r'(?:EPSG:|urn:ogc:def:crs:EPSG::|(?:AUTHORITY|ID)\["EPSG","?)(\d{4,5})"?\]*\s*$', re.IGNORECASE)
_WORDS = 200
"""Characters of a note at most that names a single coordinate."""


@dataclass(frozen=True)
class Labels:
    """Placement of the samples of an array, as in `Field`, and their shape without axes of one sample."""

    shape: tuple[int, ...]
    placement: Matrix | None = None
    coordinates: tuple[Matrix, ...] | None = None
    crs: str | None = None
    remarks: tuple[str, ...] = ()
    unit: str | None = None

    @property
    def record(self) -> Placement | None:
        """The placement of these labels; None without coordinates."""
        if self.coordinates is None:
            return None if self.placement is None else Placement(
                self.placement, None, self.crs, unit=self.unit
            )
        turns = self.crs == DEGREES
        grid = placed_grid(self.coordinates, self.shape, turns and len(self.shape) == 2, self.crs)
        grid = replace(grid, unit=self.unit)
        return replace(grid, periods=(TURN,)) if turns else grid


def labelled_field(array: Any) -> Field:
    """The field that a DataArray holds, with its coordinates.

    Axes of one sample are left out; their coordinates, and single ones, become notes. An axis without coordinates
    counts its samples. x, y and z are the axes that CF conventions call so; where these do not apply, x runs along the
    last axis, y along the one before, z along the first of three.

    Raises
    ------
    InputError
        If it holds no numbers, or has other than two or three axes of several samples.
    """
    labels = labels_of(array)
    array = array.squeeze(drop=False)
    values = np.asarray(array.values)
    if values.dtype.kind not in "biuf":
        raise InputError(f"an array of type {values.dtype}, not of real numbers", code="dtype")
    attributes = dict(array.attrs)
    unit, name = attributes.get("units"), array.name or attributes.get("long_name")
    return Field(
        values, _missing(array, values), labels.record, crs=labels.crs,
        unit=one_line(str(unit)) if unit else None, name=one_line(str(name)) if name else None,
        notes=_single(array), remarks=labels.remarks,
    )


def labels_of(array: Any) -> Labels:
    """Find where the samples of a DataArray lie, without reading them.

    Raises
    ------
    InputError
        If it has other than two or three axes of several samples.
    """
    array = array.squeeze(drop=False)
    if len(array.dims) not in (2, 3):
        sizes = ", ".join(f"{plain(str(name))} {count}" for name, count in array.sizes.items())
        raise InputError(
            f"an array with axes {sizes or 'of one sample each'}; a field has two or three", code="shape",
            remedy=f"choose one along the others: array.isel({plain(str(array.dims[0])) if array.dims else 'time'}=0)",
        )
    remarks: list[str] = []
    placement, coordinates = _places(array, remarks)
    return Labels(tuple(array.shape), placement, coordinates, _system(array), tuple(remarks), _units(array))


def _places(array: Any, remarks: list[str]) -> tuple[Matrix | None, tuple[Matrix, ...] | None]:
    """A placement, or coordinates where steps are uneven, of the axes or else of each sample."""
    dims = list(array.dims)
    n = len(dims)
    named = dict(array.coords.items())  # asked by name, axes without coordinates would get some
    order = _order([_role(name, named.get(name)) for name in dims])
    along: list[NDArray[np.float64]] = []
    there = False
    for name in dims:
        one = named.get(name)
        steps = None if one is None else _numbers(one)
        if one is not None and steps is None:
            remarks.append(
                f"coordinates along {plain(str(name))} are left out: they are {np.asarray(one.values).dtype}, no "
                "numbers; samples are counted there"
            )
        there |= steps is not None
        along.append(np.arange(array.sizes[name], dtype=np.float64) if steps is None else steps)
    nodes = _of_nodes(array, dims)
    if nodes is not None and not there:
        return None, nodes
    if nodes is not None:
        remarks.append("the coordinates of each sample are left out, since its axes have coordinates")
    if not there:
        return None, None
    if all(_even(steps) for steps in along):
        matrix = np.zeros((n, n + 1))
        for axis, steps in enumerate(along):
            matrix[order[axis], [axis, n]] = (steps[-1] - steps[0]) / (len(steps) - 1), steps[0]
        try:
            return matrix_of(matrix, n), None
        except OptionError as error:
            remarks.append(f"its coordinates are left out: {error.message}")
            return None, None
    shaped = [np.zeros(0)] * n
    for axis, steps in enumerate(along):
        shaped[order[axis]] = steps.reshape([-1 if a == axis else 1 for a in range(n)])
    return None, tuple(shaped)


def _units(array: Any) -> str | None:
    """Units of the coordinates x, y (, z) by their attributes, those of axes first; None if one has none."""
    found: dict[str, str] = {}
    named = sorted(array.coords.items(), key=lambda one: one[0] not in array.dims)
    for name, one in named:
        role, unit = _role(name, one), "_".join(str(one.attrs.get("units", "")).split())
        if role is not None and one.dims and unit:
            found.setdefault(role, unit)
    roles = "xyz"[: len(array.dims)]
    return " ".join(found[role] for role in roles) if found.keys() >= set(roles) else None


def _even(steps: NDArray[np.float64]) -> bool:
    step = (steps[-1] - steps[0]) / (len(steps) - 1)
    with np.errstate(invalid="ignore"):
        return bool(np.abs(steps - (steps[0] + step * np.arange(len(steps)))).max() <= abs(step) * EVEN)


def _numbers(coordinate: Any) -> NDArray[np.float64] | None:
    values = np.asarray(coordinate.values)
    return values.astype(np.float64) if values.dtype.kind in "iuf" and np.isfinite(values).all() else None


def _of_nodes(array: Any, dims: list[Any]) -> tuple[NDArray[np.float64], ...] | None:
    """x and y (and z) of each sample, if the array has them all."""
    found: dict[str, NDArray[np.float64]] = {}
    for name, one in array.coords.items():
        role = _role(name, one)
        if role is None or role in found or len(one.dims) < 2 or not set(one.dims) <= set(dims):
            continue
        values = np.asarray(one.transpose(*[d for d in dims if d in one.dims]).values)
        if values.dtype.kind in "iuf":
            shape = [array.sizes[d] if d in one.dims else 1 for d in dims]
            found[role] = values.astype(np.float64).reshape(shape)
    wanted = "xy" if len(dims) == 2 else "xyz"
    return tuple(found[role] for role in wanted) if set(wanted) <= found.keys() else None


def _role(name: Any, coordinate: Any) -> str | None:
    """Whether these are x, y or z: by their axis, standard name, unit or name."""
    attributes: Mapping[str, Any] = {} if coordinate is None else coordinate.attrs
    axis = str(attributes.get("axis", "")).lower()
    if axis in _ROLES:
        return axis
    words = [attributes.get("standard_name"), attributes.get("units"), name]
    for word in words:
        for role, names in _ROLES.items():
            if str(word).lower() in names:
                return role
    return None


def _order(roles: list[str | None]) -> list[int]:
    """Coordinate, 0 for x, that each axis is."""
    n = len(roles)
    rows = ["xyz".index(role) if role is not None and "xyz".index(role) < n else None for role in roles]
    return [int(row) for row in rows if row is not None] if sorted(str(r) for r in rows) == [
        str(r) for r in range(n)
    ] else [n - 1 - axis for axis in range(n)]


def _missing(array: Any, values: NDArray[Any]) -> NDArray[np.bool_] | None:
    """Mask samples of the fill value, where the array still names one."""
    gone = np.zeros(values.shape, np.bool_)
    for name in ("_FillValue", "missing_value", "nodata"):
        marker = array.attrs.get(name)
        if isinstance(marker, int | float | np.number) and not np.isnan(marker):
            gone |= values == marker
    return gone if gone.any() else None


def _single(array: Any) -> dict[str, str]:
    """Coordinates that are the same for all samples, as notes."""
    notes = {}
    for name, one in array.coords.items():
        if one.size == 1 and not one.dims and not _is_mapping(one):
            unit = one.attrs.get("units")
            text = one_line(str(one.values.item() if one.dtype.kind in "biuf" else one.values), _WORDS)
            notes[plain(str(name))] = f"{text} {one_line(str(unit))}" if unit else text
    return notes


def _is_mapping(coordinate: Any) -> bool:
    return bool({"grid_mapping_name", "crs_wkt", "spatial_ref"} & coordinate.attrs.keys())


def _system(array: Any) -> str | None:
    """The reference system: of a grid mapping, of the array, or degrees where the axes are longitude and latitude."""
    named = [array.coords.get(array.attrs.get("grid_mapping") or array.encoding.get("grid_mapping") or "spatial_ref")]
    texts = [one.attrs.get(key) for one in named if one is not None for key in ("crs_wkt", "spatial_ref")]
    for text in [*texts, array.attrs.get("crs"), array.attrs.get("epsg")]:
        if isinstance(text, int | np.integer) or (isinstance(text, str) and text.isdigit()):
            return f"EPSG:{int(text)}"
        if text and (found := _EPSG.search(str(text).strip())):
            return f"EPSG:{found[1]}"
    if any(one is not None for one in named) or "crs" in array.attrs:
        return None
    return DEGREES if _in_degrees(array.coords.values(), array.dims) else None


def _in_degrees(coordinates: Iterable[Any], dims: Iterable[Any]) -> bool:
    """Whether longitude and latitude are among the coordinates of the axes."""
    axes = set(dims)
    units = {str(one.attrs.get("units")).lower() for one in coordinates if set(one.dims) and set(one.dims) <= axes}
    return bool(units & {"degrees_east", "degree_east"}) and bool(units & {"degrees_north", "degree_north"})
