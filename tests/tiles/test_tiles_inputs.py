"""`encode --tile` is `encode`: of each kind of input the same curve, notes, placement, facts and remarks."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_servers import Server, serving

import isocodec
from brute import INTERPRETED
from commands import fails, run
from tables import looped
from tiled import hilly, pieces

pytestmark = pytest.mark.skipif(INTERPRETED, reason="slow in Python, and the same")
FIELD = hilly((70, 90))
GONE = np.zeros(FIELD.shape, np.bool_)
GONE[20:33, 40:70] = True
MARKED = np.where(GONE, -9999, FIELD).astype(np.int16)


def raster(path: Path, field: np.ndarray = MARKED, **more: Any) -> Path:
    rasterio = pytest.importorskip("rasterio")
    place = rasterio.transform.from_origin(600_000, 5_400_000, 30, 30)
    bands = field if field.ndim == 3 else field[None]
    given = {"driver": "GTiff", "count": len(bands), "dtype": field.dtype.name, "nodata": -9999, "crs": "EPSG:32631",
             "transform": place, "height": field.shape[-2], "width": field.shape[-1], **more}
    with rasterio.open(path, "w", **given) as file:
        file.write(bands)
        file.set_band_unit(1, "metre")
        file.set_band_description(1, "height")
    return path


def scaled(path: Path) -> Path:
    raster(path)
    import rasterio

    with rasterio.open(path, "r+") as file:
        file.scales, file.offsets = (0.25,), (7,)
    return path


def dataset(path: Path, seam: bool = False, uneven: bool = False, zarr: bool = False) -> Path:
    xarray = pytest.importorskip("xarray")
    lat, lon = np.linspace(60, 50, 70), np.arange(90) * 4.0 if seam else np.linspace(5, 20, 90)
    lat = lat + uneven * np.sin(np.arange(70)) / 30
    array = xarray.DataArray(
        np.where(GONE, np.nan, FIELD), {"lat": ("lat", lat, {"units": "degrees_north"}),
                                        "lon": ("lon", lon, {"units": "degrees_east"})},
        ("lat", "lon"), "t2m", {"units": "K"},
    )
    packed = {"t2m": {"dtype": "int16", "scale_factor": 0.5, "add_offset": 3.0, "_FillValue": -32768}}
    found = array.to_dataset()
    if zarr:
        found.to_zarr(path, encoding=packed)
    else:
        found.to_netcdf(path, encoding=packed)
    return path


def volume(path: Path) -> Path:
    nibabel = pytest.importorskip("nibabel")
    field = np.add.outer(hilly((40, 36)), 3 * np.arange(34)).astype(np.int16)
    nibabel.save(nibabel.Nifti1Image(field, np.diag([1.0, 2, 3, 1])), path)
    return path


def saved(path: Path, values: Any) -> Path:
    np.save(path, values)
    return path


def archive(path: Path) -> Path:
    np.savez(path, values=FIELD, other=-FIELD)
    return path


def table(path: Path) -> Path:
    raster(path, np.stack([MARKED, MARKED // 2, -MARKED]))
    return path


INPUTS: dict[str, tuple[Callable[[Path], Path], str, list[object]]] = {
    "npy": (lambda p: saved(p, FIELD), ".npy", []),
    "npy, floats with NaN": (lambda p: saved(p, np.where(GONE, np.nan, FIELD)), ".npy", []),
    "npy, marked": (lambda p: saved(p, MARKED), ".npy", ["--nodata", -9999]),
    "npy, below": (lambda p: saved(p, MARKED), ".npy", ["--nodata", -9999, "--missing", "below"]),
    "npy, above": (lambda p: saved(p, MARKED), ".npy", ["--nodata", -9999, "--missing", "above"]),
    "npy, spacing": (lambda p: saved(p, FIELD), ".npy", ["--spacing", "2,3", "--origin", "5,6", "--crs", "EPSG:32631"]),
    "npy, a frame": (lambda p: saved(p, np.stack([FIELD, FIELD // 2])), ".npy", ["--frame", 1]),
    "npz, a key": (archive, ".npz", ["--key", "other"]),
    "raster": (raster, ".tif", []),
    "raster, none missing": (raster, ".tif", ["--nodata", "nan"]),
    "raster, another marker": (raster, ".tif", ["--nodata", 33]),
    "raster, a box": (raster, ".tif", ["--bbox", "600300,5398500,602000,5399500"]),
    "raster, a distance": (raster, ".tif", ["--precision", "3m"]),
    "raster, a band": (table, ".tif", ["--band", 2]),
    "raster, a scale": (scaled, ".tif", []),
    "raster, exact": (raster, ".tif", ["--precision", "exact"]),
    "netcdf": (dataset, ".nc", []),
    "netcdf, a box": (dataset, ".nc", ["--bbox", "6,51,15,58"]),
    "zarr": (lambda p: dataset(p, zarr=True), ".zarr", []),
    "nifti": (volume, ".nii", []),
}


@looped("name", INPUTS)
def test_tiles_are_what_one_piece_is(tmp_path: Path, name: str) -> None:
    make, suffix, options = INPUTS[name]
    source = make(tmp_path / f"in{suffix}")
    compare(tmp_path, source, *options)


def compare(tmp_path: Path, source: object, *options: object) -> None:
    plain, tiled = tmp_path / "plain.iso", tmp_path / "tiled.iso"
    # beside a curve one outside of the data, and one that samples are equal to
    asked = ("--isovalue", 30.25, "--isovalue", 1e4, "--isovalue", 30, *options)
    made = [run("encode", source, "-o", plain, *asked, "--json"),
            run("encode", source, "-o", tiled, *asked, "--tile", 32, "--json")]
    assert [each.exit_code for each in made] == [0, 0], made[0].stderr + made[1].stderr
    assert made[0].stderr.splitlines() == made[1].stderr.splitlines()
    one, other = (json.loads(each.stdout) for each in made)
    for record in (one, other):
        for key in ("output", "bytes", "layers", "seconds", "tiles"):
            record.pop(key, None)
    assert one == other
    whole, parts = isocodec.open(plain), isocodec.open(tiled)
    # of files in one piece the layers hold the promise
    notes = {key: text for key, text in parts.metadata.items() if key != "promise"}
    assert (parts.promise or "") in (whole.promise or "")
    assert notes | {"promise": ""} == whole.metadata | {"promise": ""}
    assert whole.isovalues == parts.isovalues
    assert (whole.placement is None) == (parts.placement is None)
    if whole.placement is not None:
        assert np.array_equal(whole.placement.matrix, parts.placement.matrix)  # type: ignore[union-attr, arg-type]
    for isovalue in whole.isovalues:
        wanted, found = whole.contour(isovalue), parts.contour(isovalue)
        # at points that meshes share; offsets in faces may be others of the same tolerance
        assert len(wanted.points) == len(found.points) and len(wanted.cells) == len(found.cells)
        if {"exact", "signs"} & {*options}:
            assert pieces(wanted) == pieces(found)


def test_of_a_url(tmp_path: Path) -> None:
    pytest.importorskip("aiohttp")
    path = raster(tmp_path / "in.tif")
    with serving(path.read_bytes(), lambda server: server.answer(200, {}, server.data)) as (url, _):
        compare(tmp_path, url.replace("field.iso", "in.tif"))
    with serving(b"", lambda server: Server.answer(server, 404, {})) as (url, _):
        line = fails(3, "encode", url.replace("field.iso", "in.tif"), "-o", tmp_path / "x.iso", "--isovalue", 30.5,
                     "--tile", 32)
        assert "no such file" in line


def test_what_tiles_cannot_hold_is_said(tmp_path: Path) -> None:
    """Ends that meet, coordinates in uneven steps: the curve is there, with a remark."""
    for options, remark in (({"seam": True}, "not joined"), ({"uneven": True}, "coordinates are left out")):
        source = dataset(tmp_path / f"{remark[:3]}.nc", **options)
        made = run("encode", source, "-o", tmp_path / "t.iso", "--isovalue", 30.5, "--tile", 32)
        assert made.exit_code == 0 and remark in made.stderr
        wanted = isocodec.decode(isocodec.encode(np.where(GONE, np.nan, FIELD), 30.5))
        assert len(isocodec.decode(tmp_path / "t.iso").points) == len(wanted.points)
    source = saved(tmp_path / "f.npy", MARKED)
    line = fails(2, "encode", source, "-o", tmp_path / "t.iso", "--isovalue", 30, "--tile", 32, "--missing", "nearest")
    assert "nearest" in line


def test_resuming_is_said(tmp_path: Path) -> None:
    source, out = saved(tmp_path / "f.npy", FIELD), tmp_path / "t.iso"

    class Enough(Exception):
        pass

    def stop(done: int, total: int) -> None:
        if done == 4:
            raise Enough

    field = isocodec.Field(FIELD)
    with pytest.raises(Enough):
        isocodec.save(out, field, 30.25, tile=32, progress=stop)
    made = run("encode", source, "-o", out, "--isovalue", 30.25, "--tile", 32)
    assert made.exit_code == 0 and f"{out}: resuming at tile 5 of 6" in made.stderr
    assert "resuming" not in run("encode", source, "-o", out, "--isovalue", 30.25, "--tile", 32).stderr
