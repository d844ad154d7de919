"""One answer from every container: attributes of NetCDF in classic files, NetCDF-4, HDF5, Zarr 2 and 3 and in memory.

Each cell of the table is a file of one kind with one thing stated in it, held against netCDF4, which unpacks and masks,
and against xarray for coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import netCDF4
import numpy as np
import pytest
import xarray
import zarr

import isocodec
from isocodec import Field

Array = np.ndarray[Any, Any]
Variable = tuple[tuple[str, ...], Array, dict[str, Any]]
Content = dict[str, Variable]
ROWS, COLUMNS = 6, 9
RAMP = np.add.outer(np.arange(ROWS) * 10, np.arange(COLUMNS))
MANY = (1 << 62) + 1


# ---- containers -----------------------------------------------------------------------------------------------------


def netcdf(path: Path, content: Content, kind: str) -> Any:
    with netCDF4.Dataset(path, "w", format=kind) as file:
        for name, (dims, values, attributes) in content.items():
            for dim, size in zip(dims, values.shape, strict=True):
                if dim not in file.dimensions:
                    file.createDimension(dim, size)
            made = file.createVariable(name, values.dtype, dims, fill_value=attributes.get("_FillValue"))
            made.set_auto_maskandscale(False)
            made.setncatts({key: value for key, value in attributes.items() if key != "_FillValue"})
            made[...] = values
    return path


def classic(folder: Path, content: Content) -> Any:
    numbers = [a for _, values, more in content.values() for a in (values, *map(np.asarray, more.values()))]
    large = any(each.dtype.str[1:] not in ("i1", "i2", "i4", "f4", "f8") and each.dtype.kind != "U" for each in numbers)
    return netcdf(folder / "a.nc", content, "NETCDF3_64BIT_DATA" if large else "NETCDF3_CLASSIC")


def netcdf4(folder: Path, content: Content) -> Any:
    return netcdf(folder / "b.nc", content, "NETCDF4")


def hdf5(folder: Path, content: Content) -> Any:
    with h5py.File(folder / "c.h5", "w") as file:
        for name, (_, values, attributes) in content.items():
            file[name] = values
            file[name].attrs.update(attributes)
        for name, (dims, _, _) in content.items():
            if dims == (name,):
                file[name].make_scale(name)
        for name, (dims, _, _) in content.items():
            for axis, dim in enumerate(dims):
                if dim in content and dims != (name,):
                    file[name].dims[axis].attach_scale(file[dim])
    return folder / "c.h5"


def zarr_of(folder: Path, content: Content, version: int) -> Any:
    group = zarr.open_group(folder / f"{version}.zarr", mode="w", zarr_format=version)
    for name, (dims, values, attributes) in content.items():
        named = {"dimension_names": dims} if version == 3 else {}
        made = group.create_array(name, shape=values.shape, dtype=values.dtype, chunks=tuple(np.maximum(values.shape, 1)),
                                  **named)
        made[...] = values
        notes = {key: np.asarray(value).tolist() for key, value in attributes.items()}
        made.attrs.update({**notes, **({"_ARRAY_DIMENSIONS": list(dims)} if version == 2 else {})})
    return folder / f"{version}.zarr"


def in_memory(_: Path, content: Content) -> Any:
    made = xarray.Dataset({name: xarray.Variable(*each) for name, each in content.items()})
    return xarray.decode_cf(made, mask_and_scale=False, decode_times=False, decode_coords="all")


def decoded(folder: Path, content: Content) -> Any:
    with xarray.open_dataset(netcdf(folder / "e.nc", content, "NETCDF4"), engine="netcdf4", decode_coords="all") as file:
        return file.load()


CONTAINERS: dict[str, Callable[[Path, Content], Any]] = {
    "classic": classic, "netcdf4": netcdf4, "hdf5": hdf5, "zarr2": lambda f, c: zarr_of(f, c, 2),
    "zarr3": lambda f, c: zarr_of(f, c, 3), "memory": in_memory, "decoded": decoded,
}


def read(where: Any) -> Field:
    made = isocodec.read(where, key="v")
    assert isinstance(made, Field)
    return made


def right(folder: Path, content: Content) -> Any:
    """As netCDF4 unpacks and masks."""
    with netCDF4.Dataset(netcdf(folder / "right.nc", content, "NETCDF4")) as file:
        return file["v"][...]


# ---- values ---------------------------------------------------------------------------------------------------------


def spoilt(dtype: str, *marks: Any) -> Array:
    """A ramp with some samples changed."""
    values = RAMP.astype(dtype)
    for place, mark in enumerate(marks):
        values[place + 1, 2 * place + 1] = mark
    return values


def i2(*numbers: int) -> Any:
    return np.array(numbers, np.int16) if len(numbers) > 1 else np.int16(numbers[0])


VALUES: dict[str, tuple[Array, dict[str, Any]]] = {
    "plain": (spoilt("i2"), {}),
    "fill": (spoilt("i2", -9), {"_FillValue": i2(-9)}),
    "fill of floats": (spoilt("f4", -9999.9), {"_FillValue": np.float32(-9999.9)}),
    "missing": (spoilt("i2", -9), {"missing_value": i2(-9)}),
    "several missing": (spoilt("i2", -9, -8), {"missing_value": i2(-9, -8)}),
    "fill and several missing": (spoilt("f4", 999, 1e20, 888), {
        "_FillValue": np.float32(1e20), "missing_value": np.array([999, 888], np.float32)}),
    "missing of another type": (spoilt("i2", -9), {"missing_value": -9.0}),
    "missing of text": (spoilt("i2", -9), {"missing_value": "none"}),
    "nan": (spoilt("f8", np.nan), {}),
    "large integers": (spoilt("i8", MANY, 2**63 - 2), {"_FillValue": np.int64(2**63 - 2)}),
    "large integers with a neighbour": (spoilt("i8", MANY, MANY + 1), {"_FillValue": np.int64(MANY)}),
    "unsigned": (spoilt("i1", -1, -2), {"_Unsigned": "true", "_FillValue": np.int8(-1)}),
    "unsigned words": (spoilt("i2", -1, -2), {"_Unsigned": "true", "_FillValue": i2(-1), "scale_factor": 0.5}),
    "unsigned type": (spoilt("u2", 65535, 40000), {"_FillValue": np.uint16(65535)}),
    "valid range": (spoilt("i2", 9999, -7), {"_FillValue": i2(-1), "valid_range": i2(0, 50)}),
    "valid minimum": (spoilt("i2", -7), {"_FillValue": i2(-1), "valid_min": i2(0)}),
    "valid maximum": (spoilt("f4", 9999), {"_FillValue": np.float32(-1), "valid_max": np.float32(53)}),
    "valid range of packed": (spoilt("i2", 9999, -7), {
        "_FillValue": i2(-1), "valid_range": i2(0, 50), "scale_factor": 0.01, "add_offset": 5.0}),
    "valid range that falls": (spoilt("i2", 9999, -7), {
        "_FillValue": i2(-1), "valid_range": i2(0, 50), "scale_factor": -0.01}),
    "scale": (spoilt("i2"), {"_FillValue": i2(-1), "scale_factor": 0.01}),
    "scale and offset": (spoilt("i2", -9), {"_FillValue": i2(-9), "scale_factor": 0.1, "add_offset": 273.15}),
    "scale in single precision": (spoilt("i2", -9), {"_FillValue": i2(-9), "scale_factor": np.float32(0.1)}),
    "whole scale": (spoilt("i2", -9), {"_FillValue": i2(-9), "scale_factor": 10.0, "add_offset": -3.0}),
    "scale of one": (spoilt("i2", -9), {"_FillValue": i2(-9), "scale_factor": 1.0, "add_offset": 0.0}),
    "offset": (spoilt("u1", 255), {"_FillValue": np.uint8(255), "add_offset": 0.5}),
    "packed floats": (spoilt("f4", -9), {"_FillValue": np.float32(-9), "scale_factor": 0.5}),
    "big-endian": (spoilt(">i4", -9), {"_FillValue": np.int32(-9)}),
}


def missing(field: Field) -> Array:
    gone = np.isnan(field.values) if field.values.dtype.kind == "f" else np.zeros(field.shape, bool)
    return gone if field.mask is None else gone | field.mask


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("case", VALUES)
def test_values(tmp_path: Path, case: str, container: str) -> None:
    """Integers stay integers unless they are scaled by others than whole numbers."""
    values, attributes = VALUES[case]
    content: Content = {"v": (("y", "x"), values, attributes)}
    asked = right(tmp_path, content)
    if container == "decoded" and ("large" in case or values.dtype.kind == "i" and "missing" in case):
        pytest.skip("xarray has made floats of them")
    with np.testing.suppress_warnings() as held:
        held.filter(UserWarning)
        field = read(CONTAINERS[container](tmp_path, content))
    gone = np.ma.getmaskarray(asked) | (np.isnan(asked.data) if asked.dtype.kind == "f" else False)
    assert np.array_equal(missing(field), gone)
    assert np.allclose(field.values[~gone].astype(float), asked.data[~gone].astype(float), rtol=1e-6, atol=1e-7)
    whole = float(attributes.get("scale_factor", 1)).is_integer() and float(attributes.get("add_offset", 0)).is_integer()
    if container != "decoded" and values.dtype.kind in "iu":
        assert (field.values.dtype.kind in "iu") == whole
        assert not whole or np.array_equal(field.values[~gone], asked.data[~gone].astype(np.int64))


# ---- places ---------------------------------------------------------------------------------------------------------

LAT, LON = 50 - 2.0 * np.arange(ROWS), 5 + 0.5 * np.arange(COLUMNS)
NORTH, EAST = {"units": "degrees_north"}, {"units": "degrees_east"}
DATA = RAMP.astype(np.float32)
NODES = np.stack([5 + 0.5 * np.arange(COLUMNS)[None] + 0.1 * np.arange(ROWS)[:, None],
                  50 - 2.0 * np.arange(ROWS)[:, None] + 0.1 * np.arange(COLUMNS)[None]])


def axes(lat: Array = LAT, lon: Array = LON, north: Any = NORTH, east: Any = EAST, names: str = "lat lon") -> Content:
    y, x = names.split()
    return {"v": ((y, x), DATA[: len(lat), : len(lon)], {}), y: ((y,), lat, north), x: ((x,), lon, east)}


def packed(values: Array, unit: str, scale: float, offset: float = 0.0, **more: Any) -> tuple[Array, dict[str, Any]]:
    raw = np.rint((values - offset) / scale).astype(np.int16)
    return raw, {"units": unit, "scale_factor": scale, "add_offset": offset, **more}


def at_nodes(lat: Any, lon: Any, listed: bool = True) -> Content:
    return {"v": (("j", "i"), DATA, {"coordinates": "la lo"} if listed else {}),
            "la": (("j", "i"), *lat), "lo": (("j", "i"), *lon)}


def turned(content: Content) -> Content:
    dims, values, attributes = content["v"]
    return {**content, "v": (dims[::-1], np.ascontiguousarray(values.T), attributes)}


def mapped(mapping: dict[str, Any], unit: str = "m", size: float = 1.0, word: str = "crs") -> Content:
    x, y = 4e5 + 30.0 * np.arange(COLUMNS), 6e6 - 30.0 * np.arange(ROWS)
    return {
        "v": (("y", "x"), DATA, {"grid_mapping": word}),
        "y": (("y",), y / size, {"units": unit, "standard_name": "projection_y_coordinate"}),
        "x": (("x",), x / size, {"units": unit, "standard_name": "projection_x_coordinate"}),
        "crs": ((), np.array(0, np.int32), mapping),
    }


def wkt(number: int) -> str:
    import pyproj

    return str(pyproj.CRS.from_epsg(number).to_wkt())


GRID = np.stack(np.broadcast_arrays(LON[None], LAT[:, None]))
METRES = np.stack(np.broadcast_arrays((4e5 + 30.0 * np.arange(COLUMNS))[None], (6e6 - 30.0 * np.arange(ROWS))[:, None]))
UTM: dict[str, Any] = {
    "grid_mapping_name": "transverse_mercator", "scale_factor_at_central_meridian": 0.9996,
    "longitude_of_central_meridian": 3.0, "latitude_of_projection_origin": 0.0, "false_easting": 500000.0,
    "false_northing": 0.0, "semi_major_axis": 6378137.0, "inverse_flattening": 298.257223563,
}
DEGREES = "EPSG:4326"
PLACES: dict[str, tuple[Callable[[], Content], Array, str | None]] = {
    "axes": (axes, GRID, DEGREES),
    "axes in single precision": (lambda: axes(LAT.astype("f4"), LON.astype("f4")), GRID, DEGREES),
    "axes of whole numbers": (lambda: axes(LAT.astype("i4"), np.arange(COLUMNS)),
                              np.stack([np.arange(COLUMNS) + 0 * GRID[0], GRID[1]]), DEGREES),
    "longitude first": (lambda: turned(axes()), GRID.swapaxes(1, 2), DEGREES),
    "rising latitude": (lambda: axes(LAT[::-1].copy()), GRID[:, ::-1] * 1.0 - 0 * GRID, DEGREES),
    "uneven": (lambda: axes(lat=50 - np.arange(ROWS) ** 1.5),
               np.stack([GRID[0], (50 - np.arange(ROWS) ** 1.5)[:, None] + 0 * GRID[0]]), DEGREES),
    "no units": (lambda: axes(north={}, east={}, names="latitude longitude"), GRID, DEGREES),
    "no units, standard names": (lambda: axes(north={"standard_name": "latitude"}, east={"standard_name": "longitude"},
                                              names="a b"), GRID, DEGREES),
    "degrees alone": (lambda: axes(north={"units": "degrees"}, east={"units": "degrees"}), GRID, DEGREES),
    "no units, planar": (lambda: axes(north={}, east={}, names="y x"), GRID, None),
    "packed": (lambda: axes(*[p[0] for p in (P_LAT, P_LON)], *[p[1] for p in (P_LAT, P_LON)]), GRID, DEGREES),
    "packed, unsigned": (lambda: axes(
        (LAT * 5).astype("u1").view("i1"), LON, {**NORTH, "_Unsigned": "true", "scale_factor": 0.2}), GRID, DEGREES),
    "across the date line": (lambda: axes(lon=(LON + 172) % 360 - 180),
                             np.stack([(GRID[0] + 172) % 360 - 180, GRID[1]]), DEGREES),
    "across zero": (lambda: axes(lon=(LON - 7) % 360), np.stack([GRID[0] - 7, GRID[1]]), DEGREES),
    "nodes": (lambda: at_nodes((NODES[1], NORTH), (NODES[0], EAST)), NODES, DEGREES),
    "nodes that none names": (lambda: at_nodes((NODES[1], NORTH), (NODES[0], EAST), False), NODES, DEGREES),
    "packed nodes": (lambda: at_nodes(packed(NODES[1], "degrees_north", 0.1, 40.0), packed(NODES[0], "degrees_east", 0.1)),
                     NODES, DEGREES),
    "number of the system": (lambda: mapped({"crs_wkt": "", "spatial_ref": "EPSG:32631"}), METRES, "EPSG:32631"),
    "WKT": (lambda: mapped({"crs_wkt": wkt(32631)}), METRES, "EPSG:32631"),
    "spatial_ref": (lambda: mapped({"spatial_ref": wkt(32631)}), METRES, "EPSG:32631"),
    "kilometres": (lambda: mapped({"crs_wkt": wkt(32631)}, "km", 1e3), METRES, "EPSG:32631"),
    "several mappings": (lambda: mapped({"crs_wkt": wkt(32631)}, word="other: a b crs: x y"), METRES, "EPSG:32631"),
    "mapping by numbers": (lambda: mapped(UTM), METRES, "WKT"),
}
P_LAT, P_LON = packed(LAT, "degrees_north", 0.1, 45.0), packed(LON, "degrees_east", 0.05)


def nodes_of(field: Field) -> Array:
    placement = field.placement
    assert placement is not None
    x, y, *_ = placement.with_nodes(field.shape).nodes()
    return np.stack([np.broadcast_to(each, field.shape) for each in (x, y)])


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("case", PLACES)
def test_places(tmp_path: Path, case: str, container: str) -> None:
    make, expected, crs = PLACES[case]
    content = make()
    if container == "hdf5" and "several" in case:
        del content["v"][2]["grid_mapping"]
        content["v"][2]["grid_mapping"] = "crs: x y"
    with np.testing.suppress_warnings() as held:
        held.filter(UserWarning)
        field = read(CONTAINERS[container](tmp_path, content))
    found = nodes_of(field)
    off = found - expected
    off[0] -= np.rint(off[0] / 360) * 360 if crs == DEGREES else 0
    assert np.abs(off).max() < (1e-5 if crs == DEGREES else 1e-3)
    if crs == DEGREES:
        assert np.abs(np.diff(found[0], axis=-1)).max() < 180
    assert field.crs == crs if crs != "WKT" else str(field.crs).startswith("PROJCRS")


# ---- around the globe -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("count", [3, 7, 9, 11, 64])
@pytest.mark.parametrize("kind", ["f8", "f4", "from -180", "repeated", "wraps within", "nodes"])
def test_seams(tmp_path: Path, container: str, count: int, kind: str) -> None:
    """Steps of 360 / n degrees; where a column repeats the first one it is left out, and comes back as the seam."""
    if container not in ("netcdf4", "zarr3", "memory", "classic") and count != 7:
        pytest.skip("one count will do")
    lon = 360 / count * np.arange(count + (kind == "repeated"))
    lon = lon - 180 if kind == "from -180" else (lon + 100) % 360 if kind == "wraps within" else lon
    values = np.cos(np.radians(lon))[None] + np.arange(ROWS)[:, None]
    content: Content = {"v": (("lat", "lon"), values.astype("f4"), {}), "lat": (("lat",), LAT, NORTH),
                        "lon": (("lon",), lon.astype("f4" if kind == "f4" else "f8"), EAST)}
    if kind == "nodes":
        content = {"v": (("j", "i"), values, {"coordinates": "la lo"}),
                   "la": (("j", "i"), LAT[:, None] + 0 * values, NORTH), "lo": (("j", "i"), lon + 0 * values, EAST)}
    field = read(CONTAINERS[container](tmp_path, content))
    assert field.placement is not None and field.placement.periodic == (1,) and field.placement.periods == (360,)
    assert field.shape == (ROWS, count)


@pytest.mark.parametrize("lon", [np.arange(0, 350, 10.0), np.linspace(0, 360, 37) + 1e-1 * (np.arange(37) == 36)])
def test_no_seam(tmp_path: Path, lon: Array) -> None:
    content: Content = {"v": (("lat", "lon"), np.zeros((ROWS, len(lon)), "f4"), {}), "lat": (("lat",), LAT, NORTH),
                        "lon": (("lon",), lon, EAST)}
    field = read(netcdf4(tmp_path, content))
    assert field.placement is not None and not field.placement.periodic and field.shape == (ROWS, len(lon))
