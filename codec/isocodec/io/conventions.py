"""Places of arrays with labels by the climate and forecast conventions (CF), and by what is usual where these end."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import one_line, plain
from ..field.placement import TURN, Placement
from .libraries import library
from .packing import Packing, number_of
from .places import along_axes, at_nodes, even_steps, goes_round

Numbers = NDArray[np.float64]
DEGREES = "EPSG:4326"
_LON = re.compile(r"(nav_?|x|[tuvwc])?lon(g|gitude)?s?(_[a-z]+)?|glam[tuvf]")
_LAT = re.compile(r"(nav_?|x|[tuvwc])?lat(itude)?s?(_[a-z]+)?|gphi[tuvf]")
_EAST, _NORTH = (re.compile(rf"degrees?_?({side})") for side in ("east|e", "north|n"))
_NAMES = {
    "x": {"x", "easting", "rlon", "projection_x_coordinate", "grid_longitude"},
    "y": {"y", "northing", "rlat", "projection_y_coordinate", "grid_latitude"},
    "z": {"z", "lev", "level", "height", "depth", "altitude", "plev", "model_level_number", "air_pressure"},
}
_NO_UNITS, _RADIANS = ("", "none", "1", "deg", "degree", "degrees"), ("rad", "radian", "radians")
_KILOMETRES = ("km", "kilometer", "kilometers", "kilometre", "kilometres")
_EPSG = re.compile(r'(?:EPSG:|urn:ogc:def:crs:EPSG::|(?:AUTHORITY|ID)\["EPSG","?)(\d{4,5})"?\]*\s*$', re.IGNORECASE)
_MOST_REPEATED = 2
"""Columns of a grid around the globe that the first ones may repeat."""


class Labelled(NamedTuple):
    """Coordinates along an axis or at each sample, of an array of labels.

    Attributes
    ----------
    role : str or None
        x, y or z.
    globe : bool
        Whether it is a longitude or latitude, in degrees.
    values : array of floats, or None
        NaN where missing; None if they are times or text.
    """

    name: str
    dims: tuple[Any, ...]
    role: str | None
    globe: bool
    unit: str
    values: NDArray[Any] | None

    @classmethod
    def of(cls, name: Any, one: Any) -> Labelled:
        """Coordinates of a DataArray, unpacked."""
        role, unit = _role(name, one.attrs), str(one.attrs.get("units", "")).strip()
        if is_time(one) or one.dtype.kind not in "iuf":
            return cls(str(name), one.dims, role, False, unit, None)
        found, gone = Packing.of(one.dtype, one.attrs).samples(np.asarray(one.values))
        values = found if found.dtype.kind == "f" else found.astype(np.float64)
        globe, word = is_globe(name, one.attrs), unit.lower()
        if globe and word in _RADIANS:
            values, unit = np.degrees(values.astype(np.float64)), "degree"
        values = np.where(~np.isfinite(values) | (False if gone is None else gone), np.nan, values)
        size = np.nanmax(np.abs(values), initial=0)
        # numbers of another kind, such as metres, that only have the name
        globe &= word not in _NO_UNITS or bool(size <= (2 * TURN if role == "x" else TURN / 4 + 1))
        return cls(str(name), one.dims, role, globe, unit, values)

    def shaped(self, dims: Sequence[Any], values: NDArray[Any] | None = None) -> NDArray[Any]:
        """Coordinates with an axis for each of some dimensions."""
        values = self.values if values is None else values
        assert values is not None
        order = sorted(range(len(self.dims)), key=lambda i: dims.index(self.dims[i]))
        sizes = dict(zip(self.dims, values.shape, strict=True))
        return values.transpose(order).reshape([sizes.get(dim, 1) for dim in dims])


class Located(NamedTuple):
    """Placement of the samples of an array with labels.

    Attributes
    ----------
    place : Placement
        With a remark on what is left out.
    lost : array of bool, or None
        Samples without coordinates; broadcasts to the shape.
    repeated : tuple of int
        An axis around the globe, and how many of its last columns are the first ones again; or nothing.
    """

    place: Placement
    lost: NDArray[np.bool_] | None = None
    repeated: tuple[int, ...] = ()


def located(array: Any, joined: bool = True) -> Located:
    """Find where the samples of a DataArray of two or three axes lie, without reading them.

    x, y and z are the axes that CF conventions call so; where these do not apply, x runs along the last axis, y along
    the one before, z along the first of three. Longitude and latitude of each sample come before axes in an unknown
    reference system. Ends of even steps around the globe are left apart unless they may be ``joined``.
    """
    dims, n = list(array.dims), array.ndim
    every = {name: one for name, one in array.coords.items() if not is_mapping(one)}
    found = [Labelled.of(name, one) for name, one in every.items() if one.dims]
    remarks: list[str] = []
    axes = [_along(dim, found, remarks) for dim in dims]
    nodes = _nodes(dims, found)
    mapping = _mapping(array, [one.name for one in axes if one])
    system = _system(array, mapping, remarks)
    of_globe = bool(nodes) and all(nodes[role].globe for role in "xy")
    on_globe = {"x", "y"} <= {one.role for one in axes if one and one.globe}
    if nodes and (not any(axes) or (of_globe and not on_globe and not (system or "").startswith("EPSG:"))):
        left = ", ".join(plain(one.name) for one in axes if one and one.role in nodes)
        if left:
            remarks.append(f"the coordinates along {left} are left out, since each sample has its own")
        return _at_nodes(dims, array.shape, axes, nodes, DEGREES if of_globe else system, remarks)
    if nodes:
        remarks.append("the coordinates of each sample are left out, since its axes have coordinates")
    if not any(axes):
        return Located(Placement(crs=system, remark="; ".join(remarks)))
    across = _order([one.role if one else None for one in axes])
    lost, along = None, []
    for axis, one in enumerate(axes):
        values = np.arange(array.shape[axis], dtype=np.float64) if one is None else _filled(one.values)
        if one is None:
            _counted(dims[axis], remarks)
        elif np.isnan(one.values).any():  # type: ignore[arg-type]
            gone = one.shaped(dims, np.isnan(one.values))  # type: ignore[arg-type]
            lost = gone if lost is None else lost | gone
        steps = np.diff(values)
        if not ((steps > 0).all() or (steps < 0).all()):
            why = "neither rise nor fall" if steps.any() else "lie on one point"
            remarks.append(f"its coordinates are ignored: along axis {axis} they {why}")
            return Located(Placement(remark="; ".join(remarks)))
        along.append(values)
    system = system or (DEGREES if on_globe else None)
    if system is not None and not on_globe:
        along = [_metres(one, values, mapping) for one, values in zip(axes, along, strict=True)]
    units = [axes[across.index(row)].unit if axes[across.index(row)] else "" for row in range(n)]  # type: ignore[union-attr]
    x = across.index(0)
    if on_globe and not joined and goes_round(along[x], 0) and all(even_steps(each) for each in along):
        joined = False
        remarks.append(f"its ends along axis {x} are not joined, as it is read in windows")
    else:
        joined = True
    place = along_axes(along, across, on_globe and joined, crs=system, unit=None if system else _units(units),
                       remark="; ".join(remarks))
    repeated = _repeated([along[x]], 0) if on_globe and not place.periodic else ()
    return Located(place, lost, (x, *repeated[1:]) if repeated else ())


def is_time(one: Any) -> bool:
    """Whether coordinates are times."""
    return (
        one.dtype.kind in "mM" or " since " in str(one.attrs.get("units")) or str(one.attrs.get("axis")).lower() == "t"
        or (one.dtype.kind == "O" and one.size > 0 and hasattr(one.values.flat[0], "calendar"))
    )


def is_globe(name: Any, attributes: Mapping[str, Any]) -> bool:
    """Whether these are longitudes or latitudes, by units, or by name where these are not those of something else."""
    role, unit = _role(name, attributes), str(attributes.get("units", "")).strip().lower()
    if role not in ("x", "y"):
        return False
    if (_EAST if role == "x" else _NORTH).fullmatch(unit):
        return True
    words = (str(name).lower().rpartition("/")[2], str(attributes.get("standard_name", "")).lower())
    return unit in (*_NO_UNITS, *_RADIANS) and any((_LON if role == "x" else _LAT).fullmatch(word) for word in words)


def _role(name: Any, attributes: Mapping[str, Any]) -> str | None:
    """Whether these are x, y or z: by their axis, standard name, unit or name."""
    axis = str(attributes.get("axis", "")).lower()
    if axis in _NAMES:
        return axis
    for word in (attributes.get("standard_name"), attributes.get("units"), name):
        word = str(word).strip().lower().rpartition("/")[2]
        for role, known in (("x", (_LON, _EAST)), ("y", (_LAT, _NORTH)), ("z", ())):
            if word in _NAMES[role] or any(each.fullmatch(word) for each in known):
                return role
    return None


def _along(dim: Any, found: Sequence[Labelled], remarks: list[str]) -> Labelled | None:
    """Coordinates along an axis: those of its name, or others that vary along it alone."""
    some = [one for one in found if one.dims == (dim,) and (one.name == dim or one.role)]
    one = min(some, key=lambda one: (one.name != dim, not one.globe), default=None)
    if one is not None and one.values is None:
        remarks.append(f"coordinates along {plain(str(dim))} are left out, as they are times or text; samples are "
                       "counted there, --frame takes one")
        return None
    # longitudes may begin again within
    return one._replace(values=_unwrapped(one.values)) if one is not None and one.globe and one.role == "x" else one


def _unwrapped(values: Any) -> NDArray[Any]:
    known = np.isfinite(values)
    out = values.copy()
    out[known] = np.unwrap(values[known], period=TURN)
    # within rounding longitudes stay those of the file
    return np.where(np.abs(out - values) < 1.0, values, out)


def _filled(values: Any) -> NDArray[Any]:
    """Coordinates along an axis; missing ones between, or on the line through the two that are nearest."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) in (0, 1, len(values)):
        return np.asarray(values)
    scipy = library("scipy.interpolate", extra="labelled", purpose="coordinates of which some are missing")
    return np.asarray(scipy.make_interp_spline(known, values[known], k=1)(np.arange(len(values))))


def _nodes(dims: Sequence[Any], found: Sequence[Labelled]) -> dict[str, Labelled]:
    """x and y (and z) of each sample, if the array has both."""
    nodes: dict[str, Labelled] = {}
    for one in sorted(found, key=lambda one: not one.globe):
        if one.role and one.values is not None and len(one.dims) > 1 and {*one.dims} <= {*dims}:
            nodes.setdefault(one.role, one)
    if len(dims) == 2:
        nodes.pop("z", None)
    return nodes if {"x", "y"} <= nodes.keys() else {}


def _at_nodes(
    dims: Sequence[Any], shape: Sequence[int], axes: Sequence[Labelled | None], nodes: Mapping[str, Labelled],
    system: str | None, remarks: list[str],
) -> Located:
    """Place samples at longitude and latitude, or others, of each of them; z is that of the axis that is left."""
    coordinates = [nodes[role].shaped(dims).astype(np.float64) for role in "xy"]
    used, deep = [nodes["x"], nodes["y"]], nodes.get("z")
    if len(dims) == 3:
        rest = [axis for axis, dim in enumerate(dims) if dim not in {*nodes["x"].dims, *nodes["y"].dims}]
        deep = axes[rest[0]] or deep if rest else deep
        if deep is not None:
            used.append(deep)
            values = _filled(deep.values) if len(deep.dims) == 1 else deep.values
            coordinates.append(deep.shaped(dims, values).astype(np.float64))
        elif rest:
            _counted(dims[rest[0]], remarks)
            coordinates.append(np.arange(shape[rest[0]], dtype=np.float64).reshape(
                [-1 if a == rest[0] else 1 for a in range(3)]))
        else:
            return Located(Placement(remark="its coordinates are ignored: those of each sample have no height"))
    globe = nodes["x"].globe
    lost = np.zeros((1,) * len(dims), np.bool_)
    for each in coordinates:
        lost = lost | np.isnan(each)
    unit = None if system or len(used) < len(dims) else _units([one.unit for one in used])
    place = at_nodes(coordinates, globe, crs=system, unit=unit, remark="; ".join(remarks))
    axis = max(range(len(dims)), key=lambda a: coordinates[0].shape[a] > 1 and a)
    return Located(place, lost if lost.any() else None,
                   _repeated(coordinates, axis) if globe and not place.periodic else ())


def _repeated(coordinates: Sequence[NDArray[Any]], axis: int) -> tuple[int, ...]:
    """The axis, if its last columns lie where the first ones do, a turn further, and how many do."""
    longitude = coordinates[0]
    size = longitude.shape[axis]
    for count in range(1, _MOST_REPEATED + 1):
        if size <= 3 * count or not goes_round(longitude.take(range(size - count), axis), axis):
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


def _counted(dim: Any, remarks: list[str]) -> None:
    """Remark on an axis without coordinates, unless there is one."""
    if not any(f" along {plain(str(dim))} " in remark for remark in remarks):
        remarks.append(f"samples along {plain(str(dim))} are counted, as it has no coordinates")


def _units(units: Sequence[str]) -> str | None:
    words = ["_".join(unit.split()) for unit in units]
    return " ".join(words) if all(words) else None


def _metres(one: Labelled | None, values: NDArray[Any], mapping: Mapping[str, Any]) -> NDArray[Any]:
    """Coordinates in metres, as projected systems have them, of those in kilometres or angles of a satellite."""
    if one is None or one.role not in ("x", "y"):
        return values
    height = number_of(mapping.get("perspective_point_height")) or 1.0
    factors = {**dict.fromkeys(_KILOMETRES, 1e3), **dict.fromkeys(_RADIANS, height)}
    return values * factors.get(one.unit.lower(), 1.0)


def _order(roles: Sequence[str | None]) -> list[int]:
    """Row, 0 for x, that each axis is: by its role, or what is left, x along the last one.

    Of a section along latitude and height these two are x and y.
    """
    n = len(roles)
    if n == 2 and {*roles} == {"y", "z"}:
        return [int(role == "z") for role in roles]
    rows = ["xyz".index(role) if role in ("x", "y", "z")[:n] else None for role in roles]
    if any(rows.count(row) > 1 for row in rows if row is not None):
        rows = [None] * n
    left = [row for row in range(n) if row not in rows]
    return [left.pop() if row is None else row for row in rows]


def is_mapping(coordinate: Any) -> bool:
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
    names = sorted(parts, key=lambda name: not {*parts[name]} & {*axes})
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
        pyproj = library("pyproj", extra="labelled", purpose="reading a reference system")
        system = pyproj.CRS.from_wkt(text) if text else pyproj.CRS.from_cf(dict(mapping))
        found = system.to_authority(min_confidence=100)
        return ":".join(found) if found and found[0] == "EPSG" else one_line(system.to_wkt(), 1 << 16)
    except Exception as error:
        remarks.append(f"its grid mapping is left out: {one_line(str(error))}")
        return None
