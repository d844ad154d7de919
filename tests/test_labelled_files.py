"""One answer from every container: attributes of NetCDF in classic files, NetCDF-4, HDF5, Zarr 2 and 3 and in memory.

Each cell of the table is a file of one kind with one thing stated in it, held against netCDF4, which unpacks and masks,
and against xarray for coordinates.
"""

from __future__ import annotations

import gzip
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import netCDF4
import numcodecs
import numpy as np
import pandas
import pytest
import xarray
import zarr

import isocodec
from isocodec import Field, Frames
from isocodec.errors import InputError, IsoError, LimitError, OptionError
from isocodec.io.readers.input_formats import open_file
from isocodec.io.readers.opened import Choice

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
        chunks = tuple(np.maximum(values.shape, 1))
        made = group.create_array(name, shape=values.shape, dtype=values.dtype, chunks=chunks, **named)
        made[...] = values
        notes = {key: np.asarray(value).tolist() for key, value in attributes.items()}
        made.attrs.update({**notes, **({"_ARRAY_DIMENSIONS": list(dims)} if version == 2 else {})})
    return folder / f"{version}.zarr"


def in_memory(_: Path, content: Content) -> Any:
    made = xarray.Dataset({name: xarray.Variable(*each) for name, each in content.items()})
    return xarray.decode_cf(made, mask_and_scale=False, decode_times=False, decode_coords="all")


def decoded(folder: Path, content: Content) -> Any:
    path = netcdf(folder / "e.nc", content, "NETCDF4")
    with xarray.open_dataset(path, engine="netcdf4", decode_coords="all") as file:
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
    if container == "decoded" and ("large" in case or (values.dtype.kind == "i" and "missing" in case)):
        pytest.skip("xarray has made floats of them")
    with np.testing.suppress_warnings() as held:
        held.filter(UserWarning)
        field = read(CONTAINERS[container](tmp_path, content))
    gone = np.ma.getmaskarray(asked) | (np.isnan(asked.data) if asked.dtype.kind == "f" else False)
    assert np.array_equal(missing(field), gone)
    assert np.allclose(field.values[~gone].astype(float), asked.data[~gone].astype(float), rtol=1e-6, atol=1e-7)
    whole = all(float(attributes.get(name, 0)).is_integer() for name in ("scale_factor", "add_offset"))
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
        "other": ((), np.array(0, np.int32), {"grid_mapping_name": "latitude_longitude"}),
        "a": ((), np.array(1.0), {}), "b": ((), np.array(2.0), {}),
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
    "radians": (lambda: axes(np.radians(LAT), np.radians(LON), {"units": "radian", "standard_name": "latitude"},
                             {"units": "rad", "standard_name": "longitude"}, names="clat clon"), GRID, DEGREES),
    "no units, planar": (lambda: axes(north={}, east={}, names="y x"), GRID, None),
    "packed": (lambda: axes(*[p[0] for p in (P_LAT, P_LON)], *[p[1] for p in (P_LAT, P_LON)]), GRID, DEGREES),
    "packed, unsigned": (lambda: axes(
        (LAT * 5).astype("u1").view("i1"), LON, {**NORTH, "_Unsigned": "true", "scale_factor": 0.2}), GRID, DEGREES),
    "across the date line": (lambda: axes(lon=(LON + 172) % 360 - 180),
                             np.stack([(GRID[0] + 172) % 360 - 180, GRID[1]]), DEGREES),
    "across zero": (lambda: axes(lon=(LON - 7) % 360), np.stack([GRID[0] - 7, GRID[1]]), DEGREES),
    "nodes": (lambda: at_nodes((NODES[1], NORTH), (NODES[0], EAST)), NODES, DEGREES),
    "nodes that none names": (lambda: at_nodes((NODES[1], NORTH), (NODES[0], EAST), False), NODES, DEGREES),
    "packed nodes": (
        lambda: at_nodes(packed(NODES[1], "degrees_north", 0.1, 40.0), packed(NODES[0], "degrees_east", 0.1)),
        NODES, DEGREES,
    ),
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


def test_no_seam_in_windows(tmp_path: Path) -> None:
    """Tiles have a matrix: even steps around the globe stay one, with a remark."""
    lon = np.arange(0, 360, 10.0)
    content: Content = {"v": (("lat", "lon"), np.zeros((ROWS, 36), "f4"), {}), "lat": (("lat",), LAT, NORTH),
                        "lon": (("lon",), lon, EAST)}
    with open_file(netcdf4(tmp_path, content), Choice("v")) as opened:
        assert opened.windows()[1:3, 2:5].shape == (2, 3)
        place = opened.place(2)
        assert place.matrix.tolist() == [[0, 10, 0], [-2, 0, 50]] and "not joined" in place.remark


@pytest.mark.parametrize("lon", [np.arange(0, 350, 10.0), np.linspace(0, 360, 37) + 1e-1 * (np.arange(37) == 36)])
def test_no_seam(tmp_path: Path, lon: Array) -> None:
    content: Content = {"v": (("lat", "lon"), np.zeros((ROWS, len(lon)), "f4"), {}), "lat": (("lat",), LAT, NORTH),
                        "lon": (("lon",), lon, EAST)}
    field = read(netcdf4(tmp_path, content))
    assert field.placement is not None and not field.placement.periodic and field.shape == (ROWS, len(lon))


# ---- what else files state ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("order", ["t y x", "y x t", "y t x"])
def test_frames_are_those_of_times(tmp_path: Path, container: str, order: str) -> None:
    """Wherever the axis of times is; each frame has its coordinates, and the file the step between them."""
    values = np.arange(3 * ROWS * COLUMNS, dtype=np.int16).reshape(3, ROWS, COLUMNS)
    values[1, 2, 3] = -9
    dims = tuple(order.split())
    turned = values.transpose([("t", "y", "x").index(dim) for dim in dims]).copy()
    content: Content = {
        "v": (dims, turned, {"_FillValue": i2(-9)}), "y": (("y",), LAT, NORTH), "x": (("x",), LON, EAST),
        "t": (("t",), 6.0 * np.arange(3), {"units": "hours since 2020-01-01"}),
    }
    if container == "memory":
        content["t"] = ("t",), np.array(["2020-01-01T00", "2020-01-01T06", "2020-01-01T12"], "datetime64[ns]"), {}
    made = CONTAINERS[container](tmp_path, content)
    one = isocodec.read(made, key="v", frame=1)
    assert isinstance(one, Field) and one.shape == (ROWS, COLUMNS)
    assert missing(one)[2, 3] and missing(one).sum() == 1 and one.values[5, 5] == values[1, 5, 5]
    assert np.allclose(nodes_of(one), GRID) and one.notes["t"].startswith("2020-01-01T06")
    series = isocodec.read(made, key="v", frames=True)
    assert isinstance(series, Frames) and len(series.fields) == 3
    for number, field in enumerate(series.fields):
        assert np.allclose(nodes_of(field), GRID) and missing(field).sum() == (number == 1)
        assert field.values[5, 5] == values[number, 5, 5] and field.notes["frame_step"] == "6 h"


def test_four_axes(tmp_path: Path) -> None:
    """A frame of a series of volumes, the series, and the slices of a frame, with heights."""
    values = np.arange(2 * 3 * ROWS * COLUMNS, dtype="f4").reshape(2, 3, ROWS, COLUMNS)
    content: Content = {
        "v": (("t", "z", "y", "x"), values, {}), "y": (("y",), LAT, NORTH), "x": (("x",), LON, EAST),
        "z": (("z",), np.array([0, 10.0, 20]), {"units": "m", "axis": "Z"}),
        "t": (("t",), np.arange(2.0), {"units": "days since 2020-01-01"}),
    }
    path = netcdf4(tmp_path, content)
    with pytest.raises(InputError, match="choose one along t with --frame"):
        isocodec.read(path, key="v")
    volume = isocodec.read(path, key="v", frame=1)
    assert np.array_equal(volume.values, values[1])
    assert volume.placement.matrix.tolist() == [[0, 0, 0.5, 5], [0, -2, 0, 50], [10, 0, 0, 0]]
    assert isocodec.read(path, key="v", frames=True).fields[1].shape == (3, ROWS, COLUMNS)
    level = isocodec.read(path, key="v", frames=True, frame=1).fields[2]
    assert np.array_equal(level.values, values[1, 2]) and np.allclose(nodes_of(level), GRID)


def test_index_and_columns_of_pandas() -> None:
    table = pandas.DataFrame(DATA, index=pandas.Index(LAT, name="lat"), columns=pandas.Index(LON, name="lon"))
    field = isocodec.read(table)
    assert np.allclose(nodes_of(field), GRID) and field.crs == DEGREES and np.array_equal(field.values, DATA)
    assert isocodec.encode(table, 30.5) == isocodec.encode(field, 30.5)
    with pytest.warns(UserWarning, match="counted"):
        field = isocodec.read(pandas.DataFrame(DATA, columns=[f"c{i}" for i in range(COLUMNS)], index=LAT))
    assert np.allclose(nodes_of(field)[1], GRID[1])


@pytest.mark.parametrize("container", ["netcdf4", "classic", "zarr3", "memory"])
@pytest.mark.parametrize("where", ["axis", "nodes"])
def test_samples_without_coordinates(tmp_path: Path, container: str, where: str) -> None:
    """Fill values within packed coordinates: these samples are missing, the others keep their places."""
    content = PLACES["packed" if where == "axis" else "packed nodes"][0]()
    for name in ("lat", "lon") if where == "axis" else ("la", "lo"):
        dims, values, attributes = content[name]
        values = values.copy()
        values[2 if where == "axis" else (0, 2)] = -32768
        content[name] = dims, values, {**attributes, "_FillValue": i2(-32768)}
    with pytest.warns(UserWarning, match="samples have no coordinates"):
        field = read(CONTAINERS[container](tmp_path, content))
    gone = np.zeros(field.shape, bool)
    if where == "axis":
        gone[2], gone[:, 2] = True, True
    else:
        gone[0, 2] = True
    assert np.array_equal(missing(field), gone)
    expected = GRID if where == "axis" else NODES
    assert np.allclose(nodes_of(field)[:, ~gone], expected[:, ~gone], atol=1e-5)
    assert len(isocodec.decode(isocodec.encode(field, 33.5)).points)


def ome(path: Path, version: int, levels: int = 2, channels: int = 0) -> Array:
    """An image of two levels, as OME-Zarr 0.4 or 0.5 has it."""
    volume = np.zeros((4, 10, 12), "u2")
    volume[1:3, 3:8, 3:9] = 300
    group = zarr.open_group(path, mode="w", zarr_format=version)
    names = "c" * bool(channels) + "zyx"
    for level in range(levels):
        step = 2**level
        part = volume[:, ::step, ::step]
        part = np.stack([part + c for c in range(channels)]) if channels else part
        more = {"dimension_names": tuple(names)} if version == 3 else {}
        group.create_array(str(level), shape=part.shape, dtype="u2", chunks=part.shape, **more)[...] = part
    kinds = {"c": {"name": "c", "type": "channel"}}
    images = [{
        "axes": [kinds.get(n, {"name": n, "type": "space", "unit": "micrometer"}) for n in names],
        "datasets": [{"path": str(level), "coordinateTransformations": [
            {"type": "scale", "scale": [1.0] * bool(channels) + [2.0, 0.5 * 2**level, 0.5 * 2**level]},
            {"type": "translation", "translation": [0.0] * bool(channels) + [7.0, 0.25 * level, 0.25 * level]},
        ]} for level in range(levels)],
    }]
    group.attrs.update({"multiscales": images} if version == 2 else {"ome": {"version": "0.5", "multiscales": images}})
    return volume


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("key", [None, "0", "1", "inside"])
def test_levels_of_ome_zarr(tmp_path: Path, version: int, key: str | None) -> None:
    """The finest, or that of a key, with its scale and translation; by the path of the level, too."""
    path = tmp_path / "a.zarr"
    volume = ome(path, version)
    field = isocodec.read(path / "1") if key == "inside" else isocodec.read(path, key=key)
    level = 0 if key in (None, "0") else 1
    step = 2**level
    assert np.array_equal(field.values, volume[:, ::step, ::step]) and not field.remarks and not missing(field).any()
    size = 0.5 * step
    assert field.placement.matrix.tolist() == [[0, 0, size, level / 4], [0, size, 0, level / 4], [2, 0, 0, 7]]


@pytest.mark.parametrize("version", [2, 3])
def test_channels_of_ome_zarr(tmp_path: Path, version: int) -> None:
    volume = ome(tmp_path / "a.zarr", version, 1, 3)
    with pytest.raises(InputError, match="--channel 0 to 2"):
        isocodec.read(tmp_path / "a.zarr")
    assert np.array_equal(isocodec.read(tmp_path / "a.zarr", channel=2).values, volume + 2)
    with pytest.raises(OptionError, match="no channel 3"):
        isocodec.read(tmp_path / "a.zarr", channel=3)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("fill", [0, 7])
def test_fill_values_of_zarr_itself(tmp_path: Path, version: int, fill: int) -> None:
    """Of Zarr 2 a marker, as of xarray, which has no other place for its own, but 0; of Zarr 3 what is read there."""
    group = zarr.open_group(tmp_path / "a.zarr", mode="w", zarr_format=version)
    made = group.create_array("v", shape=(3, 4), dtype="u1", chunks=(3, 2), fill_value=fill,
                              **({"dimension_names": ("y", "x")} if version == 3 else {}))
    made[:, :2] = 5
    field = isocodec.read(tmp_path / "a.zarr")
    assert (field.values[:, 2:] == fill).all()
    assert missing(field).sum() == (6 if version == 2 and fill else 0)


# ---- files of others ------------------------------------------------------------------------------------------------


def zarr_by_hand(path: Path, chunk: bytes, codecs: list[Any], shape: Any = (4, 4), chunks: Any = (4, 4)) -> Path:
    (path / "c" / "0").mkdir(parents=True)
    made = {
        "zarr_format": 3, "node_type": "array", "shape": list(shape), "data_type": "uint8", "fill_value": 0,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": list(chunks)}}, "attributes": {},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}, *codecs],
    }
    (path / "zarr.json").write_text(json.dumps(made))
    (path / "c" / "0" / "0").write_bytes(chunk)
    return path


GZIP = {"name": "gzip", "configuration": {"level": 5}}
ZSTD = {"name": "zstd", "configuration": {"level": 0, "checksum": False}}
BLOSC = {"name": "blosc", "configuration": {
    "typesize": 1, "cname": "zstd", "clevel": 5, "shuffle": "noshuffle", "blocksize": 0}}
LARGE = bytes(1 << 26)
BOMBS: dict[str, tuple[Callable[[Path], Path], str]] = {
    "two packings": (lambda p: zarr_by_hand(p, gzip.compress(gzip.compress(LARGE)), [GZIP, GZIP]), "packed 2 times"),
    "Zstandard": (lambda p: zarr_by_hand(p, numcodecs.Zstd().encode(LARGE), [ZSTD]), "states 67,108,864 bytes"),
    "Blosc": (lambda p: zarr_by_hand(p, numcodecs.Blosc(cname="zstd").encode(LARGE), [BLOSC]), "states 67,108,864"),
    "chunk": (lambda p: zarr_by_hand(p, b"", [], chunks=(1 << 20, 1 << 20)), "1,099,511,627,776 samples"),
    "shape": (lambda p: zarr_by_hand(p, b"", [], shape=(1 << 40, 1 << 40)), "more than the limit"),
    "negative": (lambda p: zarr_by_hand(p, b"", [], shape=(-4, 4)), "cannot be read as Zarr"),
    "no chunk": (lambda p: zarr_by_hand(p, b"", [], chunks=(0, 0)), "cannot be read"),
}


@pytest.mark.parametrize("case", BOMBS)
def test_bombs_of_zarr(tmp_path: Path, case: str) -> None:
    make, words = BOMBS[case]
    with pytest.raises((InputError, LimitError), match=words):
        isocodec.read(make(tmp_path / "a.zarr"))


def test_bombs_of_hdf5(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        space, layout = h5py.h5s.create_simple((64, 64)), h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        layout.set_chunk((64, 64))
        layout.set_deflate(9)
        layout.set_deflate(9)
        made = h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_UINT8, space, layout)
        h5py.Dataset(made)[...] = 1
    with pytest.raises(InputError, match="packed 2 times"):
        isocodec.read(tmp_path / "a.h5")


@pytest.mark.parametrize("what", ["chunk", "array", "folder", "level"])
def test_links_of_zarr(tmp_path: Path, what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing outside of the store is opened."""
    path = tmp_path / "a.zarr"
    ome(path, 3)
    (tmp_path / "elsewhere").mkdir()
    inside = {"chunk": "0/c/0/0/0", "array": "0/zarr.json", "folder": "0", "level": "1"}[what]
    (path / inside).rename(tmp_path / "elsewhere" / "it")
    (path / inside).symlink_to(tmp_path / "elsewhere" / "it")
    with pytest.raises(InputError, match=rf"'{inside}', which links to another directory.*--follow-paths"):
        isocodec.read(path)
    assert isocodec.read(path, follow=True).values.any()


@pytest.mark.parametrize("what", ["value", "coordinate", "scale"])
def test_links_of_hdf5(tmp_path: Path, what: str) -> None:
    """Another file is neither read nor opened, for values and coordinates alike."""
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = RAMP
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["away"] = h5py.ExternalLink("other.h5", "/x")
        if what != "value":
            file["v"] = RAMP
            file["v"].attrs["coordinates"] = "away"
        if what == "scale":
            del file["away"]
            layout = h5py.VirtualLayout((ROWS,), "f8")
            layout[:] = h5py.VirtualSource("other.h5", "x", (ROWS,))
            file.create_virtual_dataset("y", layout)
            file["y"].make_scale("y")
            file["v"].dims[0].attach_scale(file["y"])
    opened: list[str] = []
    sys.addaudithook(lambda event, given: opened.append(str(given[0])) if event == "open" else None)
    if what == "value":
        with pytest.raises(InputError, match=r"other\.h5"):
            isocodec.read(tmp_path / "a.h5")
    else:
        with warnings.catch_warnings(action="ignore"):
            assert np.array_equal(isocodec.read(tmp_path / "a.h5", key="v").values, RAMP)
    assert not any("other.h5" in name for name in opened)


@pytest.mark.parametrize("container", ["classic", "netcdf4", "hdf5", "zarr2", "zarr3"])
def test_damage_is_an_error_of_ours(tmp_path: Path, container: str) -> None:
    """Bytes changed at random and ends cut off: read, or refused in one line."""
    path = Path(CONTAINERS[container](tmp_path, PLACES["packed nodes"][0]()))
    files = [path] if path.is_file() else [each for each in sorted(path.rglob("*")) if each.is_file()]
    random = np.random.default_rng(3)
    for _ in range(25):
        one = files[random.integers(len(files))]
        kept = one.read_bytes()
        data = bytearray(kept)
        for place in random.integers(0, len(data), 3):
            data[place] = random.integers(256)
        one.write_bytes(data if random.integers(4) else data[: random.integers(len(data))])
        try:
            with warnings.catch_warnings(action="ignore"):
                isocodec.read(path, key="v", samples=1 << 20)
        except IsoError as error:
            assert "\n" not in str(error)
        finally:
            one.write_bytes(kept)


# ---- GRIB -----------------------------------------------------------------------------------------------------------

MODES = [(i, j, c, first) for i in (0, 1) for j in (0, 1) for c in (0, 1) for first in (5.0, 358.0)]
OF_GRIB = """
import json, sys
import eccodes, numpy as np, isocodec
folder, out = sys.argv[1], []
def message(kind, keys, values):
    made = eccodes.codes_grib_new_from_samples(kind)
    for name, value in keys.items():
        eccodes.codes_set(made, name, value)
    eccodes.codes_set_values(made, values)
    return made
def written(name, *messages):
    with open(f"{folder}/{name}.grib2", "wb") as file:
        for each in messages:
            eccodes.codes_write(each, file)
    return f"{folder}/{name}.grib2"
def keys(i=0, j=0, c=0, first=5.0, **more):
    lon, lat = [first, (first + 4) % 360][:: 1 - 2 * i], [60.0, 57.0][:: 1 - 2 * j]
    return {"Ni": 5, "Nj": 4, "iDirectionIncrementInDegrees": 1.0, "jDirectionIncrementInDegrees": 1.0,
            "longitudeOfFirstGridPointInDegrees": lon[0], "longitudeOfLastGridPointInDegrees": lon[1],
            "latitudeOfFirstGridPointInDegrees": lat[0], "latitudeOfLastGridPointInDegrees": lat[1],
            "iScansNegatively": i, "jScansPositively": j, "jPointsAreConsecutive": c, "bitsPerValue": 24, **more}
def points(field):
    x, y = (np.broadcast_to(each, field.shape).ravel() for each in field.placement.with_nodes(field.shape).nodes())
    return sorted(zip((x % 360).round(4).tolist(), y.round(4).tolist(), np.asarray(field.values).ravel().tolist()))
KIND = "regular_ll_sfc_grib2"
VALUES = 9990 + 10.0 * np.arange(20)
for mode in json.loads(sys.argv[2]):
    made = message(KIND, keys(*mode), VALUES)
    lat, lon, values = (eccodes.codes_get_array(made, name) for name in ("latitudes", "longitudes", "values"))
    asked = sorted(zip((lon % 360).round(4).tolist(), lat.round(4).tolist(), values.tolist()))
    field = isocodec.read(written("mode", made))
    out.append([list(map(list, asked)), list(map(list, points(field)))])
holes = message(KIND, keys(bitmapPresent=1, missingValue=9999), np.where(np.arange(20) == 7, 9999, np.arange(20.0)))
field = isocodec.read(written("holes", holes))
out.append([[7], np.flatnonzero(np.isnan(field.values)).tolist()])
steps = [message(KIND, keys(stepUnits="h", step=6 * n), VALUES + n) for n in range(3)]
series = isocodec.read(written("steps", *steps), frames=True)
out.append([[3, "6 h", 9992], [len(series.fields), series.fields[0].notes["frame_step"],
                               round(float(series.fields[2].values[0, 0]))]])
levels = [message("regular_ll_pl_grib2", keys(level=level), VALUES + level) for level in (500, 850)]
field = isocodec.read(written("levels", *levels, message(KIND, keys(), VALUES)), key="t:isobaricInhPa")
out.append([[2, 4, 5], list(field.shape)])
globe = keys(first=0.0, Ni=40, longitudeOfLastGridPointInDegrees=351.0, iDirectionIncrementInDegrees=9.0)
field = isocodec.read(written("globe", message(KIND, globe, np.arange(160.0))))
out.append([[1], list(field.placement.periodic)])
print(json.dumps(out), flush=True)
import os
os._exit(0)
"""


@pytest.fixture(scope="module")
def of_grib(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """In a process of its own: the libraries of eccodes harm others."""
    pytest.importorskip("cfgrib")
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", OF_GRIB, str(tmp_path_factory.mktemp("grib")), json.dumps(MODES)],
        capture_output=True, text=True, env=dict(os.environ), check=False,
    )
    assert done.stdout, done.stderr
    return list(json.loads(done.stdout))


@pytest.mark.parametrize("number", range(len(MODES) + 4))
def test_grib(of_grib: list[Any], number: int) -> None:
    """Values and places as eccodes has them, whatever order points come in; holes, steps, levels and the seam."""
    asked, found = of_grib[number]
    assert np.shape(asked) == np.shape(found)
    if number < len(MODES):
        assert np.allclose(asked, found, atol=1e-3)
    else:
        assert asked == found
