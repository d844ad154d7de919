"""Places of arrays with labels by the climate and forecast conventions (CF), and by what is usual where these end."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import one_line, plain
from ..field.placement import TURN, Placement
from ..field.reference_system import crs_text, named_system
from .libraries import library
from .packing import Packing
from .places import along_axes, at_nodes, even_steps, goes_round

Numbers = NDArray[np.floating[Any]]
DEGREES = "EPSG:4326"
_GLOBE = {"x": r"(nav_?|x|[tuvwc])?lon(g|gitude)?s?(_[a-z]+)?|glam[tuvf]",
          "y": r"(nav_?|x|[tuvwc])?lat(itude)?s?(_[a-z]+)?|gphi[tuvf]"}
"""Names of longitudes and latitudes, which apply unless their unit is that of something else."""
_DEGREES = {"x": r"degrees?_?(east|e)", "y": r"degrees?_?(north|n)"}
_ROLES = {
    "x": rf"x|easting|rlon|projection_x_coordinate|grid_longitude|{_GLOBE['x']}|{_DEGREES['x']}",
    "y": rf"y|northing|rlat|projection_y_coordinate|grid_latitude|{_GLOBE['y']}|{_DEGREES['y']}",
    "z": "z|lev|level|height|depth|altitude|plev|model_level_number|air_pressure",
}
"""Names, standard names and units of coordinates."""
_NO_UNIT, _RADIANS, _KILOMETRES = "|none|1|deg(ree)?s?", "rad(ian)?s?", "km|kilomet(er|re)s?"
_MOST_REPEATED = 2
"""Columns of a grid around the globe that the first ones may repeat."""


class Coordinates(NamedTuple):
    """Numbers along an axis or at each sample of an array with labels.

    Attributes
    ----------
    role : str or None
        x, y or z.
    globe : bool
        Whether these are longitudes or latitudes, in degrees.
    variable : xarray.Variable
        Floats, NaN where missing.
    """

    name: str
    role: str | None
    globe: bool
    unit: str
    variable: Any

    @classmethod
    def of(cls, name: Any, array: Any) -> Coordinates:
        """Coordinates of a DataArray, unpacked."""
        role, globe = role_of(name, array.attrs), is_globe(name, array.attrs)
        unit = str(array.attrs.get("units", "")).strip()
        values = Packing(array).samples(np.asarray(array.values))
        values = np.ma.filled(values if values.dtype.kind == "f" else values.astype(np.float64), np.nan)
        values = np.where(np.isfinite(values), values, np.nan)
        if globe and re.fullmatch(_RADIANS, unit.lower()):
            values, unit = np.degrees(values.astype(np.float64)), "degree"
        elif globe and re.fullmatch(_NO_UNIT, unit.lower()):
            # numbers of another kind, such as metres, may have the name, too
            globe = bool(np.nanmax(np.abs(values), initial=0) <= (2 * TURN if role == "x" else TURN / 4 + 1))
        return cls(str(name), role, globe, unit, array.variable.to_base_variable().copy(deep=False, data=values))

    @property
    def dims(self) -> tuple[Any, ...]:
        return tuple(self.variable.dims)

    def on(self, dims: Sequence[Any]) -> Numbers:
        """Coordinates with an axis for each of some dimensions, of one sample where they do not vary."""
        sizes = {dim: self.variable.sizes.get(dim, 1) for dim in dims}
        return np.asarray(self.variable.set_dims(sizes).values)


class Located(NamedTuple):
    """Placement of the samples of an array with labels.

    Attributes
    ----------
    place : Placement
        With a remark on what is left out.
    lost : array of bool, or None
        Samples without coordinates; broadcasts to the shape.
    repeated : tuple of int
        An axis around the globe, and how many of its last columns are the first ones again, 0 if none.
    """

    place: Placement
    lost: NDArray[np.bool_] | None = None
    repeated: tuple[int, int] = (0, 0)


def located(array: Any, joined: bool = True) -> Located:
    """Find where the samples of a DataArray of two or three axes lie, without reading them.

    x, y and z are the axes that CF conventions call so; where these do not apply, x runs along the last axis, y along
    the one before, z along the first of three. Longitude and latitude of each sample come before axes in an unknown
    reference system. Ends of even steps around the globe are left apart unless they may be ``joined``.
    """
    dims, remarks = [*array.dims], list[str]()
    found = [Coordinates.of(name, one) for name, one in array.coords.items()
             if one.dims and one.dtype.kind in "iuf" and not is_mapping(one) and not is_time(one)]
    axes = {dim: _along(dim, array, found, remarks) for dim in dims}
    known = [one for one in axes.values() if one]
    nodes = _nodes(dims, found)
    mapping = _mapping(array, known)
    system = _system(array, mapping, remarks)
    on_globe = {"x", "y"} <= {one.role for one in known if one.globe}
    of_globe = {"x", "y"} <= {role for role, one in nodes.items() if one.globe}
    curved = nodes and (not known or (of_globe and not on_globe and not (system or "").startswith("EPSG:")))
    if not (curved or known):
        return Located(Placement(crs=system, remark="; ".join(remarks)))
    left = [one for one in known if one.role in nodes] if curved else nodes.values()
    if left:
        remarks.append(f"coordinates {', '.join(plain(one.name) for one in left)} are left out, since "
                       + ("each sample has its own" if curved else "its axes have coordinates"))
    if curved:
        system = DEGREES if of_globe else system
        chosen = _curved(dims, array, axes, nodes, remarks)
    else:
        system = system or (DEGREES if on_globe else None)
        chosen = _straight(dims, array, axes, mapping if system and not on_globe else None, remarks)
    if len(chosen) < len(dims):
        return Located(Placement(remark="; ".join(remarks)))
    coordinates = [one.on(dims) for one in chosen]
    x = max(axis for axis, size in enumerate(coordinates[0].shape) if size > 1 or not axis)
    turns = chosen[0].globe and chosen[1].globe
    if turns and not (joined or curved) and goes_round(coordinates[0], x):
        remarks.append(f"its ends along axis {x} are not joined, as it is read in windows")
        turns = False
    more = {"crs": system, "unit": None if system else _units(chosen), "remark": "; ".join(remarks)}
    if curved:
        place = at_nodes([one.astype(np.float64) for one in coordinates], turns, **more)
        lost = np.isnan(sum(coordinates))
    else:
        across = [[one.dims for one in chosen].index((dim,)) for dim in dims]
        place = along_axes([chosen[row].variable.values for row in across], across, turns, **more)
        lost = np.zeros(1, np.bool_)
    repeated = _repeated(coordinates, x) if turns and not place.periodic else 0
    return Located(place, lost if lost.any() else None, (x, repeated))


def is_time(one: Any) -> bool:
    """Whether coordinates are times."""
    return (one.dtype.kind in "mM" or " since " in str(one.attrs.get("units"))
            or str(one.attrs.get("axis")).lower() == "t"
            or (one.dtype.kind == "O" and one.size > 0 and hasattr(one.values.flat[0], "calendar")))


def is_globe(name: Any, attributes: Mapping[str, Any]) -> bool:
    """Whether these are longitudes or latitudes, by units, or by name where these are not those of something else."""
    role, unit = role_of(name, attributes), str(attributes.get("units", "")).strip().lower()
    if role not in _GLOBE:
        return False
    names = str(name).rpartition("/")[2].lower(), str(attributes.get("standard_name")).lower()
    return bool(re.fullmatch(_DEGREES[role], unit)) or bool(
        re.fullmatch(f"{_NO_UNIT}|{_RADIANS}", unit) and any(re.fullmatch(_GLOBE[role], name) for name in names))


def role_of(name: Any, attributes: Mapping[str, Any]) -> str | None:
    """Whether these are x, y or z: by their axis, standard name, unit or name."""
    axis = str(attributes.get("axis", "")).lower()
    if axis in _ROLES:
        return axis
    words = attributes.get("standard_name"), attributes.get("units"), str(name).rpartition("/")[2]
    return next((role for word in words for role, known in _ROLES.items()
                 if re.fullmatch(known, str(word).strip().lower())), None)


def is_mapping(coordinate: Any) -> bool:
    """Whether this states a reference system."""
    return bool({"grid_mapping_name", "crs_wkt", "spatial_ref"} & coordinate.attrs.keys())


def _along(dim: Any, array: Any, found: Sequence[Coordinates], remarks: list[str]) -> Coordinates | None:
    """Coordinates along an axis: those of its name, or others that vary along it alone."""
    if dim in array.coords and all(one.name != str(dim) for one in found):
        remarks.append(f"coordinates along {plain(str(dim))} are left out, as they are times or text; samples are "
                       "counted there, --frame takes one")
        return None
    some = [one for one in found if one.dims == (dim,) and (one.name == str(dim) or one.role)]
    return min(some, key=lambda one: (one.name != str(dim), not one.globe), default=None)


def _nodes(dims: Sequence[Any], found: Sequence[Coordinates]) -> dict[str, Coordinates]:
    """x and y (and z) of each sample, if the array has both."""
    several = [one for one in found if len(one.dims) > 1 and {*one.dims} <= {*dims}]
    nodes = {one.role: one for one in sorted(several, key=lambda one: one.globe) if one.role in [*"xyz"][: len(dims)]}
    return nodes if {"x", "y"} <= nodes.keys() else {}  # type: ignore[return-value]


def _curved(
    dims: Sequence[Any], array: Any, axes: Mapping[Any, Coordinates | None], nodes: Mapping[str, Coordinates],
    remarks: list[str],
) -> list[Coordinates]:
    """Coordinates x and y of each sample, and z; of three axes z is that of the axis that is left."""
    chosen = [nodes["x"], nodes["y"]]
    if len(dims) == 3:
        rest = [dim for dim in dims if all(dim not in one.dims for one in chosen)]
        deep = (axes[rest[0]] if rest else None) or nodes.get("z")
        if deep or rest:
            chosen.append(deep or _counted(rest[0], array, remarks))
        else:
            remarks.append("its coordinates are ignored: those of each sample have no height")
    return chosen


def _straight(
    dims: Sequence[Any], array: Any, axes: Mapping[Any, Coordinates | None], mapping: Mapping[str, Any] | None,
    remarks: list[str],
) -> list[Coordinates]:
    """Coordinates along the axes, in the order x, y, z; those of a ``mapping`` in metres. None if they turn back."""
    chosen = []
    for axis, dim in enumerate(dims):
        one = axes[dim] or _counted(dim, array, remarks)
        values = one.variable.values
        if one.globe and one.role == "x" and not _is_steady(values):  # longitudes may begin again within
            values = np.unwrap(values.astype(np.float64), period=TURN)
        if not _is_steady(values):
            why = "neither rise nor fall" if np.diff(values).any() else "lie on one point"
            remarks.append(f"its coordinates are ignored: along axis {axis} they {why}")
            return []
        if mapping is not None and one.role in ("x", "y"):
            values = values * _metres(one.unit.lower(), mapping)
        chosen.append(one._replace(variable=one.variable.copy(deep=False, data=values)))
    rows = _order([one.role for one in chosen])
    return [chosen[rows.index(row)] for row in range(len(dims))]


def _repeated(coordinates: Sequence[Numbers], axis: int) -> int:
    """Count the last columns that lie where the first ones do, a turn further."""
    longitude, size = coordinates[0], coordinates[0].shape[axis]
    for count in range(1, _MOST_REPEATED + 1):
        if size > 3 * count and goes_round(longitude.take(range(size - count), axis), axis):
            off = [one.take(range(-count, 0), axis) - one.take(range(count), axis)
                   for one in coordinates if one.shape[axis] == size]
            off[0] = (off[0] + TURN / 2) % TURN - TURN / 2
            if not any((np.abs(each) > 1e-3).any() for each in off):
                return count
    return 0


def _is_steady(values: Numbers) -> bool:
    """Whether coordinates along an axis always rise or always fall."""
    steps = np.diff(values)
    return bool((steps > 0).all() or (steps < 0).all())


def _counted(dim: Any, array: Any, remarks: list[str]) -> Coordinates:
    """Count samples along an axis without coordinates, with a remark unless there is one."""
    if not any(f" along {plain(str(dim))} " in remark for remark in remarks):
        remarks.append(f"samples along {plain(str(dim))} are counted, as it has no coordinates")
    return Coordinates.of(dim, array.drop_vars(dim, errors="ignore")[dim])._replace(role=None, globe=False)


def _units(coordinates: Sequence[Coordinates]) -> str | None:
    units = ["_".join(one.unit.split()) for one in coordinates]
    return " ".join(units) if all(units) else None


def _metres(unit: str, mapping: Mapping[str, Any]) -> float:
    """Metres, as projected systems have them, of a unit: kilometres, or angles of a satellite."""
    if re.fullmatch(_RADIANS, unit):
        return float(mapping.get("perspective_point_height", 1.0))
    return 1e3 if re.fullmatch(_KILOMETRES, unit) else 1.0


def _order(roles: Sequence[str | None]) -> list[int]:
    """Row, 0 for x, that each axis is: in the order of their roles, or of what is left, x along the last axis."""
    if any(role and roles.count(role) > 1 for role in roles):
        roles = [None] * len(roles)
    left = [role for role in "xyz"[: len(roles)] if role not in roles]
    named = [role or left.pop() for role in roles]
    return [sorted(named).index(role) for role in named]


def _mapping(array: Any, axes: Sequence[Coordinates]) -> Mapping[str, Any]:
    """Attributes of the grid mapping of the axes; of several each is followed by the coordinates that it is of."""
    asked = str(array.attrs.get("grid_mapping") or array.encoding.get("grid_mapping") or "spatial_ref")
    first, *parts = re.split(r"(\S+?)\s*:", asked)
    coordinates = dict(zip(parts[::2], parts[1::2], strict=True)) or {first: ""}
    names = {one.name for one in axes}
    return next((array.coords[name].attrs for name in sorted(coordinates, key=lambda name: names.isdisjoint(
        coordinates[name].split())) if name in array.coords), {})


def _system(array: Any, mapping: Mapping[str, Any], remarks: list[str]) -> str | None:
    """The reference system that a grid mapping or the array states: an EPSG number, or WKT."""
    text = mapping.get("crs_wkt") or mapping.get("spatial_ref") or array.attrs.get("crs") or array.attrs.get("epsg")
    try:
        if text:
            return named_system(str(text))
        if mapping.get("grid_mapping_name", "latitude_longitude") == "latitude_longitude":
            return None
        pyproj = library("pyproj", extra="labelled", purpose="reading a reference system")
        return crs_text(pyproj.CRS.from_cf(dict(mapping)))
    except Exception as error:
        remarks.append(f"its grid mapping is left out: {one_line(str(error))}")
        return None
