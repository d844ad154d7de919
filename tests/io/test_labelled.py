"""Arrays with labels: one case for each kind of attribute, place and container, against netCDF4 and xarray."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import fails
from isocodec.errors import InputError, OptionError
from isocodec.io.opener import Choice, load

ROWS, COLUMNS = 6, 9
RAMP = np.add.outer(np.arange(ROWS) * 10, np.arange(COLUMNS))
LAT, LON = 50 - 2.0 * np.arange(ROWS), 5 + 0.5 * np.arange(COLUMNS)
NORTH, EAST = {"units": "degrees_north"}, {"units": "degrees_east"}
GRID = np.stack(np.broadcast_arrays(LON[None], LAT[:, None]))
MANY = (1 << 62) + 1
I2 = np.int16


def stored(folder: Path, content: dict[str, Any], container: str) -> Any:
    """Variables as dims, values and attributes, in a file of some kind or in memory."""
    import xarray

    path = folder / {"hdf5": "a.h5", "zarr2": "a.zarr", "zarr3": "a.zarr"}.get(container, "a.nc")
    made = xarray.Dataset({name: xarray.Variable(*each) for name, each in content.items()})
    for one in made.variables.values():
        one.encoding |= {} if "_FillValue" in one.attrs else {"_FillValue": None}
    if container == "memory":
        for one in made.variables.values():
            one.encoding.clear()
        return xarray.decode_cf(made, mask_and_scale=False, decode_times=False, decode_coords="all")
    if container.startswith("zarr"):
        made.to_zarr(path, zarr_format=int(container[-1]))
    elif container == "hdf5":
        import h5py

        with h5py.File(path, "w") as file:
            for name, (dims, values, attributes) in content.items():
                file[name] = values
                file[name].attrs.update(attributes)
                if dims == (name,):
                    file[name].make_scale(name)
            for name, (dims, _, _) in content.items():
                for axis, dim in enumerate(dims):
                    if dim in content and dims != (name,):
                        file[name].dims[axis].attach_scale(file[dim])
    else:
        made.to_netcdf(path, engine="scipy" if container == "classic" else "netcdf4")
    if container == "decoded":
        with xarray.open_dataset(path, decode_coords="all") as opened:
            return opened.load()
    return path


def read(folder: Path, content: dict[str, Any], container: str, **choice: Any) -> Any:
    with warnings.catch_warnings(action="ignore"):
        return isocodec.read(stored(folder, content, container), key="v", **choice)


def missing(field: Any) -> Any:
    gone = np.isnan(field.values) if field.values.dtype.kind == "f" else np.zeros(field.shape, bool)
    return gone if field.mask is None else gone | field.mask


def places(field: Any) -> Any:
    return np.stack([np.broadcast_to(each, field.shape) for each in field.placement.with_nodes(field.shape).nodes()])


def spoilt(dtype: str, *marks: Any) -> Any:
    values = RAMP.astype(dtype)
    for place, mark in enumerate(marks):
        values[place + 1, 2 * place + 1] = mark
    return values


RANGE = {"_FillValue": I2(-1), "valid_range": np.array([0, 50], I2)}
VALUES: dict[str, tuple[str, Any, dict[str, Any]]] = {
    "fill": ("netcdf4", spoilt("i2", -9), {"_FillValue": I2(-9)}),
    "fill, decoded": ("decoded", spoilt("i2", -9), {"_FillValue": I2(-9)}),
    "fill of floats": ("zarr3", spoilt("f4", -9999.9), {"_FillValue": np.float32(-9999.9)}),
    "several missing": ("hdf5", spoilt("i2", -9, -8), {"missing_value": np.array([-9, -8], I2)}),
    "fill and several": ("classic", spoilt("f4", 999, 1e20, 888), {
        "_FillValue": np.float32(1e20), "missing_value": np.array([999, 888], np.float32)}),
    "large integers": ("netcdf4", spoilt("i8", MANY, 2**63 - 2), {"_FillValue": np.int64(2**63 - 2)}),
    "unsigned": ("classic", spoilt("i1", -1, -2), {"_Unsigned": "true", "_FillValue": np.int8(-1)}),
    "unsigned words": ("zarr2", spoilt("i2", -1, -2), {"_Unsigned": "true", "_FillValue": I2(-1), "scale_factor": 0.5}),
    "valid range": ("netcdf4", spoilt("i2", 9999, -7), RANGE),
    "valid range, decoded": ("decoded", spoilt("i2", 9999, -7), {**RANGE, "scale_factor": 0.01, "add_offset": 5.0}),
    "valid range that falls": ("hdf5", spoilt("i2", 9999, -7), {**RANGE, "scale_factor": -0.01}),
    "valid range of unsigned": ("netcdf4", spoilt("i2", -9, -7), {
        "_Unsigned": "true", "_FillValue": I2(-1), "valid_range": np.array([0, -8], I2), "scale_factor": 0.5}),
    "valid minimum": ("memory", spoilt("i2", -7), {"_FillValue": I2(-1), "valid_min": I2(0)}),
    "scale and offset": ("zarr3", spoilt("i2", -9), {"_FillValue": I2(-9), "scale_factor": 0.1, "add_offset": 273.15}),
    "whole scale": ("netcdf4", spoilt("i2", -9), {"_FillValue": I2(-9), "scale_factor": 10.0, "add_offset": -3.0}),
    "never written": ("netcdf4", spoilt("i2", -32767), {}),
    "never written, classic": ("classic", spoilt("f4", 9.969209968386869e36), {}),
    "big-endian": ("hdf5", spoilt(">i4", -9), {"_FillValue": np.int32(-9)}),
}


@pytest.mark.parametrize("case", VALUES)
def test_values(tmp_path: Path, case: str) -> None:
    """As netCDF4 unpacks and masks; integers stay integers unless they are scaled by others than whole numbers."""
    import netCDF4

    container, values, attributes = VALUES[case]
    content = {"v": (("y", "x"), values, attributes)}
    (tmp_path / "right").mkdir()
    with netCDF4.Dataset(stored(tmp_path / "right", content, "netcdf4")) as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        asked = file["v"][...]
    field, gone = read(tmp_path, content, container), np.ma.getmaskarray(asked)
    assert np.array_equal(missing(field), gone)
    assert np.allclose(field.values[~gone].astype(float), asked.data[~gone].astype(float), rtol=1e-6, atol=1e-7)
    whole = all(float(attributes.get(name, 0)).is_integer() for name in ("scale_factor", "add_offset"))
    if whole and values.dtype.kind in "iu" and container != "decoded":
        assert field.values.dtype.kind in "iu"
        assert np.array_equal(field.values[~gone], asked.data[~gone].astype(np.int64))


def axes(
    lat: Any = LAT, lon: Any = LON, north: Any = NORTH, east: Any = EAST, names: str = "lat lon"
) -> dict[str, Any]:
    y, x = names.split()
    return {"v": ((y, x), RAMP.astype("f4"), {}), y: ((y,), lat, north), x: ((x,), lon, east)}


NODES = np.stack([LON[None] + 0.1 * np.arange(ROWS)[:, None], LAT[:, None] + 0.1 * np.arange(COLUMNS)[None]])


def nodes(lat: str, lon: str, north: Any, east: Any, listed: str = "", dims: str = "j i") -> dict[str, Any]:
    return {"v": (dims.split(), RAMP.astype("f4"), {"coordinates": listed} if listed else {}),
            lat: (dims.split(), NODES[1], north), lon: (dims.split(), NODES[0], east)}


def mapped(attributes: dict[str, Any], unit: str = "m", size: float = 1.0, word: str = "crs") -> dict[str, Any]:
    y, x = 6e6 - 30.0 * np.arange(ROWS), 4e5 + 30.0 * np.arange(COLUMNS)
    return {"v": (("y", "x"), RAMP.astype("f4"), {"grid_mapping": word}),
            "y": (("y",), y / size, {"units": unit, "standard_name": "projection_y_coordinate"}),
            "x": (("x",), x / size, {"units": unit, "standard_name": "projection_x_coordinate"}),
            "crs": ((), np.array(0, np.int32), attributes),
            "other": ((), np.array(0, np.int32), {"grid_mapping_name": "latitude_longitude"})}


METRES = np.stack(np.broadcast_arrays((4e5 + 30.0 * np.arange(COLUMNS))[None], (6e6 - 30.0 * np.arange(ROWS))[:, None]))
UTM = {"grid_mapping_name": "transverse_mercator", "scale_factor_at_central_meridian": 0.9996,
       "longitude_of_central_meridian": 3.0, "latitude_of_projection_origin": 0.0, "false_easting": 500000.0,
       "false_northing": 0.0, "semi_major_axis": 6378137.0, "inverse_flattening": 298.257223563}
FROM_SPACE = {"grid_mapping_name": "geostationary", "perspective_point_height": 35786023.0, "sweep_angle_axis": "x",
              "latitude_of_projection_origin": 0.0, "longitude_of_projection_origin": -75.0}
POLE = {"grid_mapping_name": "rotated_latitude_longitude", "grid_north_pole_latitude": 39.25,
        "grid_north_pole_longitude": -162.0}
ROTATED = {**axes(north={"units": "degrees"}, east={"units": "degrees"}, names="rlat rlon"),
           "spatial_ref": ((), np.array(0), POLE)}
EPSG = {"spatial_ref": "EPSG:32631"}
DEGREES = "EPSG:4326"
RADIANS = ({"units": "radian", "standard_name": "latitude"}, {"units": "rad", "standard_name": "longitude"})
UNEVEN, HEIGHT = 50 - np.arange(ROWS) ** 1.5, 100.0 * np.arange(COLUMNS)
DEEP = np.array([0.0, 5, 20])
STACK: tuple[Any, ...] = (("z", "j", "i"), np.stack([RAMP, RAMP + 1, RAMP + 2]).astype("f4"), {})
PLACES: dict[str, tuple[str, Any, Any, str | None]] = {
    "axes": ("netcdf4", axes(), GRID, DEGREES),
    "single precision": ("zarr3", axes(LAT.astype("f4"), LON.astype("f4")), GRID, DEGREES),
    "uneven": ("classic", axes(UNEVEN), [GRID[0], UNEVEN[:, None] + 0 * GRID[0]], DEGREES),
    "names alone": ("hdf5", axes(north={}, east={}, names="latitude longitude"), GRID, DEGREES),
    "names of metres": ("netcdf4", axes(LAT * 100, LON * 100, {}, {}), GRID * 100, None),
    "radians": ("netcdf4", axes(np.radians(LAT), np.radians(LON), *RADIANS, names="clat clon"), GRID, DEGREES),
    "planar": ("memory", axes(north={}, east={}, names="y x"), GRID, None),
    "across the date line": ("zarr2", axes(lon=(LON + 172) % 360 - 180),
                             [(GRID[0] + 172) % 360 - 180, GRID[1]], DEGREES),
    "packed": ("classic", axes(np.rint((LAT - 45) * 10).astype(I2), LON, {**NORTH, "scale_factor": 0.1, "add_offset":
                                                                       45.0}), GRID, DEGREES),
    "of other names": ("zarr3", {"v": (("j", "i"), RAMP.astype("f4"), {"coordinates": "la lo"}),
                                 "la": (("j",), LAT, NORTH), "lo": (("i",), LON, EAST)}, GRID, DEGREES),
    "nodes": ("netcdf4", nodes("la", "lo", NORTH, EAST, "la lo"), NODES, DEGREES),
    "nodes that none lists": ("zarr2", nodes("la", "lo", NORTH, EAST), NODES, DEGREES),
    "TLAT and TLONG": ("netcdf4", nodes("TLAT", "TLONG", {}, {}), NODES, DEGREES),
    "number": ("classic", mapped(EPSG), METRES, "EPSG:32631"),
    "kilometres": ("hdf5", mapped(EPSG, "km", 1e3), METRES, "EPSG:32631"),
    "angles from space": ("netcdf4", mapped(FROM_SPACE, "rad", 35786023.0), METRES, "PROJCRS"),
    "several mappings": ("netcdf4", mapped(EPSG, word="other: a b crs: x y"), METRES, "EPSG:32631"),
    "mapping by numbers": ("memory", mapped(UTM), METRES, "PROJCRS"),
    "rotated pole": ("netcdf4", ROTATED, GRID, "GEOGCRS"),
    "nodes of a rotated pole": ("classic", {**ROTATED, "la": (("rlat", "rlon"), NODES[1], NORTH),
                                            "lo": (("rlat", "rlon"), NODES[0], EAST)}, NODES, DEGREES),
    "decoded": ("decoded", mapped(EPSG), METRES, "EPSG:32631"),
    "section": ("netcdf4", axes(lon=HEIGHT, east={"units": "m", "axis": "Z"}, names="lat h"),
                np.broadcast_arrays(LAT[:, None], HEIGHT[None]), None),
    "volume": ("netcdf4", {**nodes("la", "lo", NORTH, EAST), "v": STACK, "z": (("z",), DEEP, {"units": "m"})},
               np.broadcast_arrays(*NODES, DEEP[:, None, None]), DEGREES),
    "heights of each sample": ("zarr3", {**nodes("la", "lo", NORTH, EAST), "v": (*STACK[:2], {"coordinates": "height"}),
                                         "height": STACK}, np.broadcast_arrays(*NODES, STACK[1]), DEGREES),
}


@pytest.mark.parametrize("case", PLACES)
def test_places(tmp_path: Path, case: str) -> None:
    container, content, expected, crs = PLACES[case]
    field = read(tmp_path, content, container)
    off = places(field) - np.stack(expected)
    off[0] -= np.rint(off[0] / 360) * 360 if crs == DEGREES else 0
    assert np.abs(off).max() < (1e-5 if crs == DEGREES else 1e-3)
    assert str(field.crs).startswith(crs or "None")
    assert case != "section" or field.placement.unit == "degrees_north m"


@pytest.mark.parametrize("kind", ["f8", "f4", "from -180", "repeated", "wraps within", "nodes", "nodes repeated twice"])
@pytest.mark.parametrize("container", ["netcdf4", "memory"])
def test_longitudes_that_go_round(tmp_path: Path, container: str, kind: str) -> None:
    """Ends are joined; columns that repeat the first ones are left out, unless their values differ."""
    lon = 360 / 7 * np.arange(7 + ("repeated" in kind) + ("twice" in kind))
    lon = lon - 180 if kind == "from -180" else (lon + 100) % 360 if kind == "wraps within" else lon
    values = np.cos(np.radians(lon))[None] + np.arange(ROWS)[:, None]
    content: dict[str, Any] = {"v": (("lat", "lon"), values.astype("f4"), {}), "lat": (("lat",), LAT, NORTH),
                               "lon": (("lon",), lon.astype("f4" if kind == "f4" else "f8"), EAST)}
    if "nodes" in kind:
        content = {"v": (("j", "i"), np.round(values, 9), {"coordinates": "la lo"}),
                   "la": (("j", "i"), LAT[:, None] + 0 * values, NORTH), "lo": (("j", "i"), lon + 0 * values, EAST)}
    field = read(tmp_path, content, container)
    assert field.placement.periodic == (1,) and field.placement.periods == (360,) and field.shape == (ROWS, 7)
    if "repeated" in kind:
        content["v"][1][2, -1] += 1
        assert read(tmp_path, content, container).shape == values.shape


@pytest.mark.parametrize("order", ["t y x", "y x t"])
@pytest.mark.parametrize("container", ["classic", "zarr3", "decoded"])
def test_frames_are_those_of_times(tmp_path: Path, container: str, order: str) -> None:
    values = np.arange(3 * ROWS * COLUMNS, dtype=I2).reshape(3, ROWS, COLUMNS)
    values[1, 2, 3] = -9
    dims = tuple(order.split())
    turned = values.transpose([("t", "y", "x").index(dim) for dim in dims]).copy()
    content = {"v": (dims, turned, {"_FillValue": I2(-9)}), "y": (("y",), LAT, NORTH), "x": (("x",), LON, EAST),
               "t": (("t",), 6.0 * np.arange(3), {"units": "hours since 2020-01-01"})}
    series = read(tmp_path, content, container, frames=True)
    assert series.times == ["2020-01-01", "2020-01-01T06:00", "2020-01-01T12:00"]
    for number, field in enumerate(series.fields):
        assert np.allclose(places(field), GRID) and missing(field).sum() == (number == 1)
        assert field.values[5, 5] == values[number, 5, 5]
        assert field.notes["t"].startswith(f"2020-01-01T{6 * number:02}")


GAP = np.where(np.arange(ROWS)[:, None] == 2, -999, NODES[1])


@pytest.mark.parametrize("remark, content", [
    ("y are counted", {"v": (("y", "x"), RAMP, {}), "x": (("x",), LON, {})}),
    ("t, times or text", {"v": (("t", "x"), RAMP, {}), "x": (("x",), LON, {}),
                          "t": (("t",), np.arange(6.0), {"units": "days since 2000-01-01"})}),
    ("lat neither rise nor fall", axes(np.array([1.0, 2, 1, 2, 1, 2]))),
    ("lat neither rise nor fall", axes(np.where(LAT == 46, -999, LAT), north={**NORTH, "_FillValue": -999.0})),
    ("9 samples have no coordinates", {**nodes("la", "lo", NORTH, EAST),
                                       "la": (("j", "i"), GAP, {**NORTH, "_FillValue": -999.0})}),
    ("have no height", {"v": STACK, **{name: (STACK[0], np.stack([each] * 3), about) for name, each, about in
                                       (("la", NODES[1], NORTH), ("lo", NODES[0], EAST))}}),
    ("la, lo are left out, since its axes", {**mapped(EPSG), "la": (("y", "x"), NODES[1], NORTH),
                                             "lo": (("y", "x"), NODES[0], EAST)}),
    ("scale_factor is ignored", {"v": (("y", "x"), RAMP, {"scale_factor": "ten"})}),
    ("scale_factor is ignored", {"v": (("y", "x"), RAMP, {"scale_factor": 0.0})}),
    ("grid mapping is left out", mapped({"grid_mapping_name": "none_such"})),
    *((f"{name}.*left out.*--spacing", {"v": (("y", "x"), RAMP, {name: [0.5, 0.25]})})
      for name in ("element_size_um", "gridSpacing", "Origin", "pixel_size")),
])
def test_what_is_left_out_is_remarked_on(tmp_path: Path, remark: str, content: dict[str, Any]) -> None:
    with pytest.warns(UserWarning, match=remark):
        isocodec.read(stored(tmp_path, content, "netcdf4"), key="v")


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("key", [None, "1", "inside"])
def test_levels_of_ome_zarr(tmp_path: Path, version: int, key: str | None) -> None:
    """The finest, or that of a key or a path, with its scale and translation; a channel by its number."""
    import zarr

    volume = np.arange(2 * 4 * 10 * 12, dtype="u2").reshape(2, 4, 10, 12)
    group = zarr.open_group(tmp_path / "a.zarr", mode="w", zarr_format=version)
    datasets = []
    for level in range(2):
        part = volume[..., :: 2**level, :: 2**level]
        more = {"dimension_names": tuple("czyx")} if version == 3 else {}
        group.create_array(str(level), shape=part.shape, dtype="u2", chunks=part.shape, **more)[...] = part
        datasets.append({"path": str(level), "coordinateTransformations": [
            {"type": "scale", "scale": [1, 2.0, 0.5 * 2**level, 0.5 * 2**level]},
            {"type": "translation", "translation": [0, 7.0, level / 4, level / 4]}]})
    axes_ = [{"name": "c", "type": "channel"}, *({"name": n, "type": "space", "unit": "micrometer"} for n in "zyx")]
    images: list[dict[str, Any]] = [{"axes": axes_, "datasets": datasets}]
    about = {"multiscales": images} if version == 2 else {"ome": {"version": "0.5", "multiscales": images}}
    group.attrs.update(about)
    path = tmp_path / "a.zarr"
    with pytest.raises(InputError, match=r"2 channels.*band=1|2 channels.*--band"):
        isocodec.read(path)
    field: Any = isocodec.read(path / "1", band=2) if key == "inside" else isocodec.read(path, key=key, band=2)
    level, size = (0, 0.5) if key is None else (1, 1.0)
    assert np.array_equal(field.values, volume[1, :, :: 2**level, :: 2**level])
    assert field.placement.matrix.tolist() == [[0, 0, size, level / 4], [0, size, 0, level / 4], [2, 0, 0, 7]]
    assert field.placement.unit == "micrometer micrometer micrometer"
    for step in ({"type": "scale", "path": "s"}, {"type": "affine", "affine": [[1, 0], [0, 1]]}):
        images[0]["coordinateTransformations"] = [step]
        group.attrs.update(about)
        with pytest.raises(InputError, match=r"a scale and a translation can be read.*zarr"):
            isocodec.read(path, band=2)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("fill", [0, 7])
def test_zeros_of_zarr_are_data(tmp_path: Path, version: int, fill: int) -> None:
    import zarr

    group = zarr.open_group(tmp_path / "a.zarr", mode="w", zarr_format=version)
    named = {"dimension_names": ("y", "x")} if version == 3 else {}
    group.create_array("v", shape=(3, 4), dtype="u1", chunks=(3, 2), fill_value=fill, **named)[:, :2] = 5
    field: Any = isocodec.read(tmp_path / "a.zarr")
    assert (field.values[:, 2:] == fill).all() and missing(field).sum() == (6 if version == 2 and fill else 0)


def test_hdf5_leaves_a_choice_and_keeps_to_its_file(tmp_path: Path) -> None:
    """Arrays in groups with coordinates of these and of those around; some that cannot be read, and why."""
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["run/density"], file["run/x"] = np.arange(3.0), RAMP[None].astype(">u2"), LON
        file["x"], file["run/y"], file["other/y"] = LON * 2, LAT, LAT * 2
        file["run/density"].attrs["coordinates"] = "y x"
        file["run"].attrs["origin"] = [1, 2]
        file["away"] = h5py.ExternalLink("other.h5", "/x")
        file.create_dataset("never", (3, 4), chunks=(3, 4))
        layout = h5py.VirtualLayout((3, 4), "u1")
        layout[:] = h5py.VirtualSource("third.h5", "w", (3, 4))
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("raw", (3, 4), "u1", external=[("fourth.bin", 0, 12)])
    with pytest.raises(InputError, match=r"run/density, away, never, raw, virtual.*--key"):
        isocodec.read(tmp_path / "a.h5")
    field: Any = isocodec.read(tmp_path / "a.h5", key="/run/density")
    assert np.array_equal(field.values, RAMP) and np.allclose(places(field), GRID)
    for key, words in (("away", r"another file, other\.h5"), ("virtual", r"another file, third\.h5"),
                       ("raw", r"another file, fourth\.bin"), ("never", "but no samples"),
                       ("none", "no arrays named 'none'")):
        with pytest.raises(InputError, match=words):
            isocodec.read(tmp_path / "a.h5", key=key)
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file["run/x"], file["x"], file["run/y"]
    with pytest.warns(UserWarning, match="origin.*--spacing"):
        isocodec.read(tmp_path / "a.h5", key="run/density")


def test_what_is_no_field_is_refused_with_a_remedy(tmp_path: Path) -> None:
    import xarray

    content: dict[str, Any] = {"mesh": ((), np.array(0), {"cf_role": "mesh_topology", "topology_dimension": 2}),
                               "v": (("n",), np.zeros(5), {"mesh": "mesh", "location": "node"})}
    path = stored(tmp_path, content, "netcdf4")
    (tmp_path / "a.grib2").write_bytes(b"GRIB")
    (tmp_path / "none.zarr").mkdir()
    (tmp_path / "classic").mkdir()
    cut = stored(tmp_path / "classic", axes(), "classic")
    cut.write_bytes(cut.read_bytes()[:-80])
    for source, choice, words in (
        (path, {}, r"UGRID.*xugrid"), (path, {"key": "v"}, r"UGRID.*xugrid"),
        (tmp_path / "a.grib2", {}, "cdo -f nc copy"), (tmp_path / "none.zarr", {}, "complete"), (cut, {"key": "v"}, ""),
        (xarray.DataArray(np.zeros((2, 2, 3, 4)), dims=("t", "z", "y", "x")), {}, "two or three: choose .* --frame"),
        (xarray.DataArray(np.full((3, 4), "a")), {}, "not real numbers"),
        (xarray.DataArray(np.ones((3, 4)), attrs={"valid_range": [1, 2, 3]}), {}, "has 3 numbers instead"),
    ):
        with pytest.raises(InputError, match=words):
            isocodec.read(source, **choice)
    with pytest.raises(OptionError, match="no frame 3"):
        isocodec.read(xarray.DataArray(np.zeros((3, 4, 5))), frame=3)


def test_pandas() -> None:
    import pandas

    table = pandas.DataFrame(RAMP * 1.0, index=pandas.Index(LAT, name="lat"), columns=pandas.Index(LON, name="lon"))
    field: Any = isocodec.read(table)
    assert np.allclose(places(field), GRID) and field.crs == DEGREES
    assert isocodec.encode(table, 30.5) == isocodec.encode(field, 30.5)


def test_zarr_without_names_or_larger_than_memory(tmp_path: Path) -> None:
    """Coordinates are read without the samples: here of a store of which no chunk is there."""
    import zarr

    values = STACK[1]
    zarr.open(str(tmp_path / "a.zarr"), mode="w", shape=values.shape, chunks=(1, 4, 4), dtype="f4")[:] = values
    assert np.array_equal(isocodec.read(tmp_path / "a.zarr", frame=1).values, values[1])
    group, size = zarr.open_group(str(tmp_path / "b.zarr"), mode="w"), 40_000
    group.create_array("z", shape=(size, size), chunks=(1000, 1000), dtype="float32", dimension_names=("y", "x"))
    for name, start, step in [("y", 9e6, -30.0), ("x", 4e5, 30.0)]:
        group.create_array(name, data=start + step * np.arange(size), dimension_names=(name,))
    large: Any = load(tmp_path / "b.zarr", Choice(), lazy=True)
    assert large.placement.matrix.tolist() == [[0, 30, 4e5], [-30, 0, 9e6]]


@pytest.mark.heavy
def test_tiles_of_damaged_zarr(tmp_path: Path) -> None:
    """Errors of other processes name the file, too."""
    import zarr

    field = np.random.default_rng(1).integers(0, 9, (40, 40))
    zarr.open(str(tmp_path / "a.zarr"), mode="w", shape=field.shape, chunks=(20, 20), dtype=field.dtype)[:] = field
    next(each for each in (tmp_path / "a.zarr" / "c").rglob("*") if each.is_file()).write_bytes(b"nothing")
    fails(3, "encode", tmp_path / "a.zarr", "-o", tmp_path / "b.iso", "--isovalue", 4.5, "--tile", 128)
