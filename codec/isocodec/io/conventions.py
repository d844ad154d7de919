"""Places of arrays with labels by the climate and forecast conventions (CF), and by what is usual where these end."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import one_line, plain
from ..field.placement import TURN, Placement
from ..field.reference_system import crs_text, named_system
from ..field.units import METRES, unit_of
from .libraries import library
from .packing import MaskedSamples
from .places import along_axes, at_nodes, goes_round

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
_NO_UNIT, _RADIANS = "|none|1|deg(ree)?s?", "rad(ian)?s?"


class Located(NamedTuple):
    """Placement of the samples of an array with labels.

    Attributes
    ----------
    place : Placement
        With a remark on what is left out.
    lost : array of bool
        Samples without coordinates; broadcasts to the shape.
    around : int or None
        The axis along which longitudes run whose ends are not joined.
    """

    place: Placement
    lost: NDArray[np.bool_] = np.zeros(1, np.bool_)
    around: int | None = None


def located(array: Any, joined: bool = True) -> Located:
    """Find where the samples of a DataArray of two or three axes lie, without reading them.

    x, y and z are the axes that CF conventions call so; where these do not apply, x runs along the last axis, y along
    the one before, z along the first of three. Longitude and latitude of each sample come before axes in an unknown
    reference system. Ends of even steps around the globe are left apart unless they may be ``joined``.
    """
    dims, remarks = array.dims, list[str]()
    found = [unpacked(one) for one in array.coords.values()
             if one.dims and one.dtype.kind in "iuf" and not is_mapping(one) and not is_time(one)]
    axes = {dim: one for dim in dims if (one := _along(dim, array, found, remarks)) is not None}
    several = [one for one in found if len(one.dims) > 1 and {*one.dims} <= {*dims}]
    nodes = {one.role: one for one in sorted(several, key=lambda one: one.globe) if one.role in [*"xyz"][: len(dims)]}
    mapping = _mapping(array, [one.name for one in axes.values()])
    system = _system(array, mapping, remarks)
    on_globe, of_globe = ({"x", "y"} <= {one.role for one in some.values() if one.globe} for some in (axes, nodes))
    curved = {"x", "y"} <= {*nodes} and (
        not axes or (of_globe and not on_globe and not (system or "").startswith("EPSG:")))
    if not (curved or axes):
        return Located(Placement(crs=system, remark="; ".join(remarks)))
    if left := [plain(str(one.name)) for one in (axes if curved else nodes).values() if one.role in nodes]:
        why = "each sample has its own" if curved else "its axes have coordinates"
        remarks.append(f"coordinates {', '.join(left)} are left out, since {why}")
    globe = of_globe if curved else on_globe
    if globe and (curved or not system):
        system = DEGREES
    if curved:
        chosen = [nodes["x"], nodes["y"]]
        if len(dims) == 3:
            rest = [dim for dim in dims if all(dim not in one.dims for one in chosen)]
            chosen += [one for one in (*map(axes.get, rest), nodes.get("z")) if one is not None][:1] or [
                _counted(dim, array, remarks) for dim in rest]
        if len(chosen) < len(dims):
            return Located(Placement(remark="its coordinates are ignored: those of each sample have no height"))
    else:
        chosen = [axes[dim] if dim in axes else _counted(dim, array, remarks) for dim in dims]
        if uneven := [plain(str(one.name)) for one in chosen if not _is_steady(one)]:
            return Located(Placement(remark=f"its coordinates are ignored: {', '.join(uneven)} neither rise nor fall"))
        rows = _order([one.role for one in chosen])
        if system and not globe:
            chosen = [one * _metres(one, mapping) for one in chosen]
        chosen = [chosen[axis] for axis in np.argsort(rows)]
    coordinates = [one.variable.set_dims({dim: one.sizes.get(dim, 1) for dim in dims}).values for one in chosen]
    x = max(axis for axis, size in enumerate(coordinates[0].shape) if size > 1 or not axis)
    turns = globe and (joined or curved or not goes_round(coordinates[0], x))
    if globe and not turns:
        remarks.append(f"its ends along axis {x} are not joined, as it is read in windows")
    units = ["" if system else "_".join(one.units.split()) for one in chosen]
    more = {"crs": system, "unit": " ".join(units) if all(units) else None, "remark": "; ".join(remarks)}
    if curved:
        place = at_nodes([one.astype(np.float64) for one in coordinates], turns, **more)
    else:
        place = along_axes([chosen[row].values for row in rows], rows, turns, **more)
    lost = np.isnan(sum(coordinates)) if curved else np.zeros(1, np.bool_)
    return Located(place, lost, x if turns and not place.periodic else None)


def unpacked(array: Any) -> Any:
    """Coordinates as a DataArray of floats, NaN where missing, longitudes and latitudes in degrees.

    Their attributes are the unit, the ``role`` (x, y, z or None), and whether they are on the ``globe``.
    """
    unit, (role, globe) = str(array.attrs.get("units", "")).strip(), kind_of(array.name, array.attrs)
    values = np.ma.filled(MaskedSamples(array)[...] * 1.0, np.nan)
    values = np.where(np.isfinite(values), values, np.nan)
    if globe and re.fullmatch(_RADIANS, unit.lower()):
        values, unit = np.degrees(values.astype(np.float64)), "degree"
    elif globe and re.fullmatch(_NO_UNIT, unit.lower()):
        # numbers of another kind, such as metres, may have the name, too
        globe = bool(np.nanmax(np.abs(values), initial=0) <= (2 * TURN if role == "x" else TURN / 4 + 1))
    return type(array)(values, dims=array.dims, name=array.name, attrs={"units": unit, "role": role, "globe": globe})


def is_time(one: Any) -> bool:
    """Whether coordinates are times."""
    word = one.attrs.get("axis", one.attrs.get("standard_name", str(one.name).rpartition("/")[2]))
    return one.dtype.kind in "mM" or " since " in str(one.attrs.get("units")) or str(word).lower() in ("t", "time")


def kind_of(name: Any, attributes: Mapping[str, Any]) -> tuple[str | None, bool]:
    """Find whether coordinates are x, y or z, and whether they are longitudes or latitudes.

    The first of their axis, standard name, unit and name that is known states it.
    """
    words = [str(attributes.get(each, "")).strip().lower() for each in ("axis", "standard_name", "units")]
    axis, standard, unit, name = *words, str(name).rpartition("/")[2].lower()
    role = axis if axis in _ROLES else next((
        role for word in (standard, unit, name) for role, known in _ROLES.items() if re.fullmatch(known, word)), None)
    if role not in _GLOBE:
        return role, False
    named = any(re.fullmatch(_GLOBE[role], word) for word in (standard, name))
    return role, bool(re.fullmatch(_DEGREES[role], unit) or (named and re.fullmatch(f"{_NO_UNIT}|{_RADIANS}", unit)))


def is_mapping(coordinate: Any) -> bool:
    """Whether this states a reference system."""
    return bool({"grid_mapping_name", "crs_wkt", "spatial_ref"} & coordinate.attrs.keys())


def _along(dim: Any, array: Any, found: Sequence[Any], remarks: list[str]) -> Any:
    """Coordinates along an axis: those of its name, or others that vary along it alone."""
    if dim in array.coords and all(one.name != dim for one in found):
        remarks.append(f"coordinates along {plain(str(dim))}, times or text, are left out: --frame takes one")
        return None
    some = [one for one in found if one.dims == (dim,) and (one.name == dim or one.role)]
    one = min(some, key=lambda one: (one.name != dim, not one.globe), default=None)
    if one is not None and one.globe and one.role == "x" and not _is_steady(one):  # longitudes may begin again within
        one.values = np.unwrap(one.values.astype(np.float64), period=TURN)
    return one


def _is_steady(along: Any) -> bool:
    """Whether coordinates along an axis always rise or always fall."""
    steps = np.diff(along.values)
    return bool((steps > 0).all() or (steps < 0).all())


def _counted(dim: Any, array: Any, remarks: list[str]) -> Any:
    """Count samples along an axis without coordinates, with a remark."""
    remarks.append(f"samples along {plain(str(dim))} are counted, as it has no coordinates")
    return unpacked(array.drop_vars(dim, errors="ignore")[dim]).assign_attrs(role=None, globe=False)


def _metres(one: Any, mapping: Mapping[str, Any]) -> float:
    """Metres, as projected systems have them, of the unit: kilometres, or angles of a satellite."""
    if one.role not in _GLOBE:
        return 1.0
    if re.fullmatch(_RADIANS, one.units.lower()):
        return float(mapping.get("perspective_point_height", 1.0))
    return METRES["km"] if unit_of(one.units) == "km" else 1.0


def _order(roles: Sequence[str | None]) -> list[int]:
    """Row, 0 for x, that each axis is: in the order of their roles, or of what is left, x along the last axis."""
    if any(role and roles.count(role) > 1 for role in roles):
        roles = [None] * len(roles)
    left = [role for role in "xyz"[: len(roles)] if role not in roles]
    named = [role or left.pop() for role in roles]
    return [sorted(named).index(role) for role in named]


def _mapping(array: Any, axes: Iterable[Any]) -> Mapping[str, Any]:
    """Attributes of the grid mapping; of several, each with a list of coordinates (``crs: x y``), that of the axes."""
    asked = str(array.attrs.get("grid_mapping") or array.encoding.get("grid_mapping") or "spatial_ref")
    lists = (re.search(rf"([^\s:]+)\s*:[^:]*\s{re.escape(str(name))}(?!\S)", asked) for name in axes)
    names = [found[1] for found in lists if found] + re.findall(r"[^\s:]+", asked)
    return next((array.coords[name].attrs for name in names if name in array.coords), {})


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
