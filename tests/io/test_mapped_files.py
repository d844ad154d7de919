"""Mapped grids in files and on the command line: what NetCDF and .npz say of coordinates, and what is written there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import grids
import isocodec
from commands import ok, run
from inputs import read_place
from libraries import Late
from places import on_nodes

h5py = Late("h5py")

FIELD, NODES = grids.rotated_pole()
SOUTH, EAST = np.linspace(60, -60, 13), np.arange(36) * 10.0
WAVES = np.cos(np.radians(EAST))[None] + 0.2 * np.sin(np.radians(SOUTH))[:, None]


def netcdf(path: Path, field: np.ndarray, coordinates: dict[str, tuple[np.ndarray, str]], scales: bool) -> Path:
    """A field with coordinates: as scales of its axes, or named by its attribute."""
    with h5py.File(path, "w") as file:
        file["f"] = field
        for name, (values, units) in coordinates.items():
            file[name] = values
            file[name].attrs["units"] = units
        if not scales:
            file["f"].attrs["coordinates"] = " ".join(coordinates)
        for axis, name in enumerate(coordinates if scales else ()):
            file[name].make_scale(name)
            file["f"].dims[axis].attach_scale(file[name])
    return path


def encoded(path: Path, isovalue: float, *options: object) -> tuple[isocodec.Contour, str]:
    result = run("encode", path, "-o", path.with_suffix(".iso"), "--isovalue", isovalue, *options)
    assert result.exit_code == 0, result.output
    return isocodec.decode(path.with_suffix(".iso").read_bytes()), result.stderr


def lines_of(path: Path) -> list[Any]:
    found = [each["geometry"] for each in json.loads(path.read_text())["features"]]
    return [part for each in found
            for part in (each["coordinates"] if each["type"].startswith("Multi") else [each["coordinates"]])]


def test_longitudes_all_round(tmp_path: Path) -> None:
    """They are joined by themselves; lines in GeoJSON go on across the end of the period."""
    units = {"lat": (SOUTH, "degrees_north"), "lon": (EAST, "degrees_east")}
    path = netcdf(tmp_path / "a.nc", WAVES, units, True)
    contour, _ = encoded(path, 0.9, "--key", "f")
    assert contour.shape == (13, 37) and on_nodes(contour) and contour.placement.periodic == (1,)
    assert np.allclose(contour.placed[:, 1], np.interp(contour.points[:, 0], range(13), SOUTH), atol=0.05)
    ok("decode", path.with_suffix(".iso"), "-o", tmp_path / "a.geojson")
    lines = lines_of(tmp_path / "a.geojson")
    assert lines and all(np.abs(np.diff(np.array(line)[:, 0])).max() < 20 for line in lines)
    text = ok("info", path.with_suffix(".iso"))
    assert "axis 1 is periodic" in text and "x repeats after 360" in text
    # on a mesh that is searched for, too
    contour, said = encoded(path, 0.9, "--key", "f", "--precision", 1, "--keep-topology")
    assert contour.shape == (13, 37) and contour.placement.periodic == (1,) and "periodic" not in said
    ends = [sorted(contour.points[contour.points[:, 1] == column, 0].tolist()) for column in (0, 36)]
    assert ends[0] == ends[1] != []
    ok("verify", path.with_suffix(".iso"), path, "--key", "f")
    # under a plan they may differ at the ends: these stay apart, with a warning
    field, plan = isocodec.read(path, key="f"), [("base", 5), ("offsets", 3)]
    with pytest.warns(UserWarning, match="not treated as periodic"):
        assert isocodec.open(isocodec.encode(field, 0.9, layers=plan)).info.shape == (13, 36)


def test_longitudes_all_round_of_a_series(tmp_path: Path) -> None:
    """Frames keep their coordinates, and their ends stay apart, with a warning."""
    units = {"lat": (SOUTH, "degrees_north"), "lon": (EAST, "degrees_east")}
    path = netcdf(tmp_path / "a.nc", WAVES, units, True)
    with h5py.File(path, "a") as file:
        del file["f"]
        file["f"] = np.stack([WAVES, WAVES])
        for axis, name in enumerate(units, 1):
            file["f"].dims[axis].attach_scale(file[name])
    contour, said = encoded(path, 0.9, "--key", "f", "--frames")
    assert contour.shape == (13, 36) and "axis 1 are not joined" in said
    assert np.allclose(contour.placed[:, 1], np.interp(contour.points[:, 0], range(13), SOUTH), atol=0.05)


def test_coordinates_of_each_sample(tmp_path: Path) -> None:
    units = {"lon": (NODES[0], "degrees_east"), "lat": (NODES[1], "degrees_north")}
    contour, _ = encoded(netcdf(tmp_path / "a.nc", FIELD, units, False), 0.1, "--key", "f")
    np.savez(tmp_path / "b.npz", values=FIELD, lon=NODES[0], lat=NODES[1])
    other, _ = encoded(tmp_path / "b.npz", 0.1)
    direct = isocodec.decode(isocodec.encode(grids.placed(FIELD, NODES, periods=360), 0.1))
    assert np.array_equal(contour.placed, direct.placed) and np.array_equal(other.placed, direct.placed)
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.npz")
    assert np.array_equal(np.load(tmp_path / "a.npz")["placed"], direct.placed)
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "s.geojson", "--in-samples")
    (first, *_) = lines_of(tmp_path / "s.geojson")
    # with y upwards the other way around has higher values on its left
    assert np.allclose(first, direct.lines[0][::-1, ::-1])


def test_uneven_steps_of_volumes(tmp_path: Path) -> None:
    """x runs along the last axis."""
    field = grids.cylinder()[0]
    axes = {"z": (np.geomspace(1, 9, 9), "m"), "y": (np.arange(24.0), "m"), "x": (np.arange(11.0) ** 2, "m")}
    path = netcdf(tmp_path / "a.nc", field, axes, True)
    contour, _ = encoded(path, 0.0, "--key", "f")
    expected = [np.interp(contour.points[:, 2 - c], range(field.shape[2 - c]), axes[n][0]) for c, n in enumerate("xyz")]
    assert np.abs(contour.placed - np.stack(expected, axis=1)).max() < 0.005
    for suffix in (".ply", ".stl", ".obj"):
        ok("decode", path.with_suffix(".iso"), "-o", tmp_path / f"a{suffix}")
    ok("decode", path.with_suffix(".iso"), "-o", tmp_path / "a.vtu", "--what", "mesh")


def test_periodic_axis_by_option(tmp_path: Path) -> None:
    field = grids.polar()[0]
    np.save(tmp_path / "a.npy", field)
    contour, _ = encoded(tmp_path / "a.npy", 0.05, "--periodic", 1)
    assert contour.shape == (24, 61) and on_nodes(contour)


def test_what_files_say(tmp_path: Path) -> None:
    """Even steps stay a placement; coordinates that have nothing to do with the field are left out."""
    units = {"lat": (SOUTH, "degrees_north"), "lon": (EAST / 2, "degrees_east")}
    place = read_place(netcdf(tmp_path / "a.nc", WAVES, units, True), key="f")
    assert place.matrix is not None and place.coordinates is None
    np.savez(tmp_path / "b.npz", values=WAVES, lon=EAST, lat=SOUTH[:5])
    contour, said = encoded(tmp_path / "b.npz", 0.9)
    assert not on_nodes(contour) and contour.shape == (13, 36)
    assert "its lon (36,) and lat (5,) are left out: they do not fit samples of shape (13, 36)" in said
    np.savez(tmp_path / "b.npz", values=WAVES, x=EAST[:4], y=SOUTH, lon=EAST, lat=SOUTH)
    contour, said = encoded(tmp_path / "b.npz", 0.9)
    assert "left out" not in said and contour.placement is not None


def test_tolerance_with_a_unit(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", grids.polar()[0])
    placed = ("--spacing", "30,20", "--crs", "EPSG:32631")
    contour, _ = encoded(tmp_path / "a.npy", 0.05, *placed, "--precision", "15 m")
    half, _ = encoded(tmp_path / "a.npy", 0.05, *placed, "--precision", "0.5")
    assert np.array_equal(contour.points, half.points)
    unknown = run("encode", tmp_path / "a.npy", "-o", tmp_path / "b.iso", "--isovalue", 0, *placed[:2],
                  "--precision", "15m")
    assert unknown.exit_code == 2 and "needs the unit of the coordinates" in unknown.stderr
    nowhere = run("encode", tmp_path / "a.npy", "-o", tmp_path / "b.iso", "--isovalue", 0, "--precision", "15m")
    assert nowhere.exit_code == 2 and "15m needs a field with a placement in the world" in nowhere.stderr
