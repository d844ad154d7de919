"""Arrays with named axes and coordinates, as xarray has them: where samples lie, by the conventions (CF)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...errors import one_line, plain
from ...extras import optional
from ...field.placement import TURN, Placement
from .packing import Packing, number_of
from .place_of_samples import EVEN, goes_round, placed, placed_grid

Numbers = NDArray[np.float64]
DEGREES = "EPSG:4326"
_ROLES = {
    "x": {"x", "lon", "longitude", "nav_lon", "xlong", "easting", "rlon", "projection_x_coordinate", "grid_longitude",
          "degrees_east", "degree_east", "degree_e", "degrees_e", "degreee", "degreese"},
    "y": {"y", "lat", "latitude", "nav_lat", "xlat", "northing", "rlat", "projection_y_coordinate", "grid_latitude",
          "degrees_north", "degree_north", "degree_n", "degrees_n", "degreen", "degreesn"},
    "z": {"z", "lev", "level", "height", "depth", "altitude", "plev", "model_level_number", "air_pressure"},
}
_GLOBE = {"x": ("lon", "longitude", "nav_lon", "xlong"), "y": ("lat", "latitude", "nav_lat", "xlat")}
_GLOBE_UNITS = {role: {word for word in words if word.startswith("degree")} for role, words in _ROLES.items()}
_NO_UNITS = ("", "none", "1", "deg", "degree", "degrees")
_RADIANS = ("rad", "radian", "radians")
_KILOMETRES = ("km", "kilometer", "kilometers", "kilometre", "kilometres")
_EPSG = re.compile(r'(?:EPSG:|urn:ogc:def:crs:EPSG::|(?:AUTHORITY|ID)\["EPSG","?)(\d{4,5})"?\]*\s*$', re.IGNORECASE)
_MOST_REPEATED = 2
"""Columns of a grid around the globe that the first ones may repeat."""
_WORDS = 200
"""Characters of a note at most that names a single coordinate."""


@dataclass(frozen=True, eq=False)
class Along:
    """Coordinates along an axis or at each sample; float64, NaN where missing, None if they are times or text."""

    name: str
    dims: tuple[Any, ...]
    role: str | None
    """x, y or z."""
    globe: bool
    """Whether it is a longitude or latitude, in degrees."""
    unit: str
    values: Numbers | None
    rounding: float = 0.0
    """Distance of neighbouring numbers of their type."""

    @classmethod
    def of(cls, name: Any, one: Any) -> Along:
        """Coordinates of a DataArray, unpacked."""
        unit, role = str(one.attrs.get("units", "")).strip(), _role(name, one.attrs)
        word, named = unit.lower(), (str(name).lower(), str(one.attrs.get("standard_name", "")).lower())
        globe = role in _GLOBE and (
            word in _GLOBE_UNITS[role]
            or (word in (*_NO_UNITS, *_RADIANS) and any(each in _GLOBE[role] for each in named))
        )
        if is_time(one) or one.dtype.kind not in "iuf":
            return cls(str(name), one.dims, role, False, unit, None)
        packing = Packing.of(one.dtype, one.attrs, one.encoding)
        found, gone = packing.samples(np.asarray(one.values))
        values = found.astype(np.float64)
        if globe and word in _RADIANS:
            values, unit = np.degrees(values), "degree"
        if gone is not None:
            values[gone] = np.nan
        values[np.isinf(values)] = np.nan
        size = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
        if globe and word in _NO_UNITS and size > (2 * TURN if role == "x" else TURN / 4 + 1):
            globe = False
        rounding = float(np.finfo(found.dtype).eps) * size if found.dtype.kind == "f" else 0.0
        return cls(str(name), one.dims, role, globe, unit, values, rounding)


@dataclass(frozen=True, eq=False)
class Located:
    """Placement of the samples of an array with labels."""

    place: Placement
    """With a remark on what is left out."""
    lost: NDArray[np.bool_] | None = None
    """Samples without coordinates; broadcasts to the shape."""
    repeated: tuple[int, ...] = ()
    """An axis around the globe, and how many of its last columns are the first ones again; or nothing."""


def located(array: Any, joined: bool = True) -> Located:
    """Find where the samples of a DataArray of two or three axes lie, without reading them.

    x, y and z are the axes that CF conventions call so; where these do not apply, x runs along the last axis, y along
    the one before, z along the first of three. Longitude and latitude of each sample come before axes in an unknown
    reference system. Ends of even steps around the globe are left apart unless they may be ``joined``.
    """
    found = [Along.of(name, one) for name, one in array.coords.items() if one.dims and not _is_mapping(one)]
    where = _located(array, found, joined)
    # a reference system states its own units
    if not where.place.placed or where.place.crs is not None:
        return where
    found.sort(key=lambda one: one.name in array.dims)
    units = {one.role: "_".join(one.unit.split()) for one in found if one.unit}
    known = [units.get(role) for role in "xyz"[: array.ndim]]
    return where if None in known else replace(where, place=replace(where.place, unit=" ".join(map(str, known))))


def _located(array: Any, found: Sequence[Along], joined: bool) -> Located:
    dims, n = list(array.dims), array.ndim
    remarks: list[str] = []
    axes = [_along(dim, found, remarks) for dim in dims]
    nodes = _of_nodes(dims, found)
    mapping = _mapping(array, [one.name for one in axes if one is not None])
    system = _system(array, mapping, remarks)
    at_nodes = all(nodes[role].globe for role in "xy") if nodes else False
    on_axes = any(one is not None for one in axes)
    if nodes and (not on_axes or (at_nodes and not _on_globe(axes) and not (system or "").startswith("EPSG:"))):
        if any(one is not None and one.role in nodes for one in axes):
            remarks.append(f"the coordinates along {_listed(one for one in axes if one)} are left out, since each "
                           "sample has longitude and latitude")
        return _on_nodes(dims, array.shape, axes, nodes, DEGREES if at_nodes else system, remarks)
    if nodes:
        remarks.append("the coordinates of each sample are left out, since its axes have coordinates")
    if not on_axes:
        return Located(Placement(crs=system, remark="; ".join(remarks)))
    rows = _order([None if one is None else one.role for one in axes])
    # coordinates of each axis of the array, with something in place of those that are missing
    lost, along = None, []
    for axis, one in enumerate(axes):
        values = np.arange(array.shape[axis], dtype=np.float64) if one is None else _filled(one)
        if one is None:
            _counted(dims[axis], remarks)
        elif one.values is not None and np.isnan(one.values).any():
            gone = np.isnan(one.values).reshape([-1 if a == axis else 1 for a in range(n)])
            lost = gone if lost is None else lost | gone
        step = np.diff(values)
        if not ((step > 0).all() or (step < 0).all()):
            why = "neither rise nor fall" if step.any() else "lie on one point"
            remark = f"its coordinates are ignored: along axis {axis} they {why}"
            return Located(Placement(crs=None, remark="; ".join([*remarks, remark])))
        along.append(values)
    globe = _on_globe(axes)
    system = system or (DEGREES if globe else None)
    if system is not None and not globe:
        along = _in_metres(axes, along, mapping)
    shaped = [values.reshape([-1 if a == axis else 1 for a in range(n)]) for axis, values in enumerate(along)]
    coordinates = [shaped[rows.index(row)] for row in range(n)]
    grid = placed_grid(coordinates, array.shape, globe, system)
    even = all(one is None or _is_even(each, one) for one, each in zip(axes, along, strict=True))
    if grid.periodic and even and not joined:
        remarks.append(f"its ends along axis {grid.periodic[0]} are not joined, as it is read in windows")
    remark = "; ".join(remarks)
    if (grid.periodic and joined) or not even:
        repeated = _repeated(coordinates, rows.index(0)) if globe and not grid.periodic else ()
        return Located(replace(grid, remark=remark), lost, repeated)
    matrix = np.zeros((n, n + 1))
    for axis, values in enumerate(along):
        matrix[rows[axis], [axis, n]] = (values[-1] - values[0]) / (len(values) - 1), values[0]
    place = placed(matrix, n, system)
    place = replace(place, remark="; ".join([*remarks, *filter(None, [place.remark])]))
    return Located(place, lost, _repeated(coordinates, rows.index(0)) if globe else ())


def notes_of(array: Any) -> dict[str, str]:
    """Coordinates that are the same for all samples, as notes."""
    notes = {}
    for name, one in array.coords.items():
        if one.size == 1 and not one.dims and not _is_mapping(one):
            unit = one.attrs.get("units") if one.dtype.kind in "biuf" else None
            text = one_line(str(one.values.item() if one.dtype.kind in "biuf" else one.values), _WORDS)
            notes[plain(str(name))] = f"{text} {one_line(str(unit))}" if unit else text
    return notes


def is_time(one: Any) -> bool:
    """Whether coordinates are times."""
    return (
        one.dtype.kind in "mM" or " since " in str(one.attrs.get("units")) or str(one.attrs.get("axis")).lower() == "t"
        or (one.dtype.kind == "O" and one.size > 0 and hasattr(one.values.flat[0], "calendar"))
    )


def is_globe(name: Any, attributes: Mapping[str, Any]) -> bool:
    """Whether these are longitudes or latitudes, by attributes and name."""
    role = _role(name, attributes)
    return role in _GLOBE and (
        str(attributes.get("units")).strip().lower() in _GLOBE_UNITS[role] or str(name).lower() in _GLOBE[role]
    )


def _along(dim: Any, found: Sequence[Along], remarks: list[str]) -> Along | None:
    """Coordinates along an axis: those of its name, or others that vary along it alone."""
    some = [one for one in found if one.dims == (dim,)]
    some.sort(key=lambda one: (one.name != dim, not one.globe))
    for one in some:
        if one.name != dim and one.role is None:
            continue
        if one.values is None:
            remarks.append(f"coordinates along {plain(str(dim))} are left out, as they are times or text; samples are "
                           "counted there, --frame takes one")
            return None
        # longitudes may begin again within
        return replace(one, values=_unwrapped(one.values)) if one.globe and one.role == "x" else one
    return None


def _unwrapped(values: Numbers) -> Numbers:
    known = np.isfinite(values)
    out = values.copy()
    out[known] = np.unwrap(values[known], period=TURN)
    # within rounding longitudes stay those of the file
    return np.where(np.abs(out - values) < 1.0, values, out)


def _filled(one: Along) -> Numbers:
    """Coordinates along an axis; missing ones between, or on the line through the two that are nearest."""
    values = one.values
    assert values is not None
    known = np.flatnonzero(np.isfinite(values))
    if len(known) in (0, 1, len(values)):
        return values
    at = np.arange(len(values))
    out = np.interp(at, known, values[known])
    for near, beyond in ((known[:2], at < known[0]), (known[-2:], at > known[-1])):
        step = (values[near[1]] - values[near[0]]) / (near[1] - near[0])
        out[beyond] = values[near[0]] + step * (at[beyond] - near[0])
    return np.asarray(out)


def _of_nodes(dims: list[Any], found: Sequence[Along]) -> dict[str, Along]:
    """x and y (and z) of each sample, if the array has both."""
    nodes: dict[str, Along] = {}
    for one in sorted(found, key=lambda one: not one.globe):
        if one.role is not None and one.values is not None and len(one.dims) > 1 and set(one.dims) <= set(dims):
            nodes.setdefault(one.role, one)
    if len(dims) == 2:
        nodes.pop("z", None)
    return nodes if {"x", "y"} <= nodes.keys() else {}


def _on_nodes(
    dims: list[Any], shape: Sequence[int], axes: Sequence[Along | None], nodes: Mapping[str, Along],
    system: str | None, remarks: list[str],
) -> Located:
    """Place samples at longitude and latitude, or others, of each of them; z is that of the axis that is left."""
    def shaped(values: Numbers, of: Sequence[Any]) -> Numbers:
        order = sorted(range(len(of)), key=lambda i: dims.index(of[i]))
        return values.transpose(order).reshape([n if d in of else 1 for d, n in zip(dims, shape, strict=True)])

    coordinates = [shaped(one.values, one.dims) for role in "xy" if (one := nodes[role]).values is not None]
    if len(dims) == 3:
        deep = nodes.get("z")
        rest = [axis for axis, dim in enumerate(dims) if dim not in {*nodes["x"].dims, *nodes["y"].dims}]
        if rest and (along := axes[rest[0]]) is not None:
            deep = along
        if deep is not None and deep.values is not None:
            coordinates.append(shaped(_filled(deep) if deep.values.ndim == 1 else deep.values, deep.dims))
        elif rest:
            _counted(dims[rest[0]], remarks)
            coordinates.append(shaped(np.arange(shape[rest[0]], dtype=np.float64), (dims[rest[0]],)))
        else:
            return Located(Placement(remark="its coordinates are ignored: those of each sample have no height"))
    globe = nodes["x"].globe
    lost = np.zeros((1,) * len(dims), np.bool_)
    for each in coordinates:
        lost = lost | np.isnan(each)
    place = replace(placed_grid(coordinates, shape, globe, system), remark="; ".join(remarks))
    axis = max(range(len(dims)), key=lambda a: coordinates[0].shape[a] > 1 and a)
    repeated = _repeated(coordinates, axis) if globe and not place.periodic else ()
    return Located(place, lost if lost.any() else None, repeated)


def _repeated(coordinates: Sequence[Numbers], axis: int) -> tuple[int, ...]:
    """The axis, if its last columns lie where the first ones do, a turn further, and how many do."""
    longitude = coordinates[0]
    size = longitude.shape[axis]
    for count in range(1, _MOST_REPEATED + 1):
        if size <= 3 * count or not goes_round(longitude.take(range(size - count), axis), axis, size - count):
            continue
        step = float(np.nanmax(np.abs(np.diff(longitude.take(range(2), axis), axis=axis))))
        same = True
        for number, one in enumerate(coordinates):
            if one.shape[axis] == size:
                off = one.take(range(size - count, size), axis) - one.take(range(count), axis)
                off = (off + TURN / 2) % TURN - TURN / 2 if number == 0 else off
                same &= not bool((np.abs(off) > 1e-3 * step).any())
        if same:
            return axis, count
    return ()


def _is_even(along: Numbers, one: Along) -> bool:
    """Whether steps along an axis are the same, but for rounding."""
    step = (along[-1] - along[0]) / (len(along) - 1)
    off = float(np.abs(along - (along[0] + step * np.arange(len(along)))).max())
    return off <= max(abs(step) * EVEN, min(2 * one.rounding, abs(step) / 4))


def _counted(dim: Any, remarks: list[str]) -> None:
    """Remark on an axis without coordinates, unless there is one."""
    if not any(f" along {plain(str(dim))} " in remark for remark in remarks):
        remarks.append(f"samples along {plain(str(dim))} are counted, as it has no coordinates")


def _on_globe(axes: Sequence[Along | None]) -> bool:
    """Whether longitude and latitude are among the axes."""
    return {"x", "y"} <= {one.role for one in axes if one is not None and one.globe}


def _in_metres(axes: Sequence[Along | None], along: list[Numbers], mapping: Mapping[str, Any]) -> list[Numbers]:
    """Coordinates in metres, as projected systems have them, of those in kilometres or angles of a satellite."""
    height = number_of(mapping.get("perspective_point_height")) or 1.0
    factors = {**dict.fromkeys(_KILOMETRES, 1e3), **dict.fromkeys(_RADIANS, height)}
    return [
        values if one is None or one.role not in ("x", "y") else values * factors.get(one.unit.lower(), 1.0)
        for one, values in zip(axes, along, strict=True)
    ]


def _listed(some: Any) -> str:
    return ", ".join(plain(one.name) for one in some)


def _role(name: Any, attributes: Mapping[str, Any]) -> str | None:
    """Whether these are x, y or z: by their axis, standard name, unit or name."""
    axis = str(attributes.get("axis", "")).lower()
    if axis in _ROLES:
        return axis
    for word in (attributes.get("standard_name"), attributes.get("units"), name):
        for role, names in _ROLES.items():
            if str(word).strip().lower().rpartition("/")[2] in names:
                return role
    return None


def _order(roles: Sequence[str | None]) -> list[int]:
    """Row, 0 for x, that each axis is: by its role, or what is left, x along the last one.

    Of a section along latitude and height these two are x and y.
    """
    n = len(roles)
    if n == 2 and set(roles) == {"y", "z"}:
        return [int(role == "z") for role in roles]
    rows: list[int | None] = ["xyz".index(role) if role in ("x", "y", "z")[:n] else None for role in roles]
    if any(rows.count(row) > 1 for row in rows if row is not None):
        rows = [None] * n
    left = [row for row in range(n) if row not in rows]
    for axis in range(n - 1, -1, -1):
        if rows[axis] is None:
            rows[axis] = left.pop(0)
    return [int(row) for row in rows if row is not None]


def _is_mapping(coordinate: Any) -> bool:
    return bool({"grid_mapping_name", "crs_wkt", "spatial_ref"} & coordinate.attrs.keys())


def _mapping(array: Any, axes: Sequence[str]) -> Mapping[str, Any]:
    """Attributes of the grid mapping of the axes; of several each is followed by the coordinates that it is of."""
    asked = str(array.attrs.get("grid_mapping") or array.encoding.get("grid_mapping") or "spatial_ref")
    parts: dict[str, list[str]] = {}
    for word in asked.replace(":", ": ").split():
        if word.endswith(":") or ":" not in asked:
            parts[word.rstrip(":")] = []
        elif parts:
            parts[[*parts][-1]].append(word)
    names = sorted(parts, key=lambda name: not set(parts[name]) & set(axes))
    return next((array.coords[name].attrs for name in names if name in array.coords), {})


def _system(array: Any, mapping: Mapping[str, Any], remarks: list[str]) -> str | None:
    """The reference system that a grid mapping or the array states: an EPSG number, or WKT."""
    texts = [mapping.get("crs_wkt"), mapping.get("spatial_ref")]
    for text in [*texts, array.attrs.get("crs"), array.attrs.get("epsg")]:
        if isinstance(text, int | np.integer) or (isinstance(text, str) and text.isdigit()):
            return f"EPSG:{int(text)}"
        if text and (found := _EPSG.search(str(text).strip())):
            return f"EPSG:{found[1]}"
    text = next((str(text) for text in texts if text), None)
    if text is None and mapping.get("grid_mapping_name", "latitude_longitude") == "latitude_longitude":
        return None
    try:
        pyproj = optional("pyproj", extra="geo", purpose="reading a reference system")
        system = pyproj.CRS.from_wkt(text) if text else pyproj.CRS.from_cf(dict(mapping))
        found = system.to_authority(min_confidence=100)
        return ":".join(found) if found and found[0] == "EPSG" else one_line(system.to_wkt(), 1 << 16)
    except Exception as error:
        remarks.append(f"its grid mapping is left out: {one_line(str(error))}")
        return None
