"""Fields from where users have them: files, URLs, open files, and arrays of other libraries with their coordinates."""

from __future__ import annotations

import io
import subprocess
import sys
import threading
import warnings
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import fsspec
import h5py
import nibabel
import numpy as np
import pytest
import rasterio
import rioxarray
import SimpleITK
import tifffile
import xarray
from rasterio.transform import from_origin

import isocodec
from inputs import CELLS, written
from isocodec import Field
from isocodec.errors import InputError, LimitError, OptionError
from isocodec.stream.encoder import encoder_of
from places import matrix, on_nodes

HILL = 100 - np.hypot(*(np.mgrid[:20, :30] - np.array([9.3, 14.2])[:, None, None])) * 5
DAYS = np.arange(20).astype("datetime64[D]")
BALL = 100 - np.linalg.norm(np.mgrid[:12, :13, :14] - np.array([5.6, 6.2, 6.9])[:, None, None, None], axis=0) * 10


def grid(**attrs: Any) -> xarray.DataArray:
    """Temperatures at longitudes and latitudes, from north to south."""
    return xarray.DataArray(
        HILL, dims=("lat", "lon"), name="tas", attrs={"units": "K", **attrs},
        coords={
            "lat": ("lat", 60 - 0.5 * np.arange(20), {"units": "degrees_north"}),
            "lon": ("lon", 5 + 0.25 * np.arange(30), {"units": "degrees_east"}), "time": np.datetime64("2020-05-01"),
            "height": ((), 2.0, {"units": "m"}),
        },
    )


def test_data_array() -> None:
    """Coordinates, name, unit and what is the same for all samples come along, into the file and out of it."""
    field = isocodec.read(grid())
    assert matrix(field).tolist() == [[0, 0.25, 5], [-0.5, 0, 60]]
    assert (field.name, field.unit, field.crs) == ("tas", "K", "EPSG:4326")
    assert field.notes["height"] == "2.0 m" and field.notes["time"].startswith("2020-05-01")
    data = isocodec.encode(grid(), 70.0)
    contour = isocodec.decode(data)
    assert contour.metadata["unit"] == "K" and contour.metadata["crs"] == "EPSG:4326"
    at = grid().interp(lon=xarray.DataArray(contour.placed[:, 0]), lat=xarray.DataArray(contour.placed[:, 1]))
    assert np.abs(at.values - 70).max() < 0.05 * 5 + 1e-6
    assert data == isocodec.encode(field, 70.0)


def test_data_array_with_x_first() -> None:
    """Which axis is x is said by the conventions, not by the order."""
    straight, turned = isocodec.read(grid()), isocodec.read(grid().transpose("lon", "lat"))
    assert matrix(turned).tolist() == [[0.25, 0, 5], [0, -0.5, 60]]
    a, b = (isocodec.decode(isocodec.encode(f, 70.0, precision=0.001)).placed for f in (straight, turned))
    assert np.abs(np.sort(a, axis=0) - np.sort(b, axis=0)).max() < 0.002


def test_data_array_of_rioxarray(tmp_path: Path) -> None:
    field = HILL.astype(np.float32)
    field[3, 4] = -9999
    with rasterio.open(
        tmp_path / "a.tif", "w", driver="GTiff", height=20, width=30, count=1, dtype="float32", nodata=-9999,
        crs="EPSG:32631", transform=from_origin(5e5, 4e6, 30, 20), compress="LZW",
    ) as file:
        file.write(field, 1)
    of_file = isocodec.read(tmp_path / "a.tif")
    with rioxarray.open_rasterio(tmp_path / "a.tif") as opened:
        of_array = isocodec.read(opened)
    for one in (of_file, of_array):
        assert one.mask is not None and one.mask.sum() == 1 and one.mask[3, 4]
        assert one.crs == "EPSG:32631"
        assert matrix(one).tolist() == [[0, 30, 500015], [-20, 0, 3999990]]
    assert not isocodec.open(isocodec.encode(of_file, 70)).valid()[3, 4]


def test_uneven_steps_are_never_dropped() -> None:
    array = grid().assign_coords(lat=60 - np.arange(20) ** 1.5)
    field = isocodec.read(array)
    assert on_nodes(field)
    x, y = field.placement.nodes()
    assert x.shape == (1, 30) and y.shape == (20, 1) and np.allclose(y[:, 0], array.lat)
    nodes = xarray.DataArray(
        HILL, dims=("j", "i"),
        coords={"lon": (("j", "i"), np.add.outer(np.arange(20) * 0.1, np.arange(30.0))),
                "lat": (("j", "i"), np.add.outer(np.arange(20.0), np.arange(30) * 0.2))},
    )
    field = isocodec.read(nodes)
    assert on_nodes(field) and np.array_equal(field.placement.nodes()[0], nodes.lon.values)


def test_what_is_left_out_is_said() -> None:
    times = xarray.DataArray(HILL, dims=("time", "x"), coords={"time": DAYS, "x": np.arange(30)})
    with pytest.warns(UserWarning, match="along time are left out"):
        field = isocodec.read(times)
    assert matrix(field)[1].tolist() == [1, 0, 0]


def test_data_arrays_that_are_no_field() -> None:
    with pytest.raises(InputError, match=r"lat 20, lon 30.*isel\(t=0\)"):
        isocodec.read(grid().expand_dims(t=3, h=2))
    with pytest.raises(InputError, match="not real numbers"):
        isocodec.read(grid().astype(str))
    with pytest.raises(InputError, match=r"2 arrays: a \(20, 30\), b \(20, 30\): choose one"):
        isocodec.read(xarray.Dataset({"a": grid(), "b": grid()}))
    assert isocodec.read(xarray.Dataset({"a": grid(), "b": grid()}), key="b").shape == (20, 30)
    with pytest.raises(OptionError, match="kind is for files"):
        isocodec.read(grid(), kind=".tif")
    assert b"".join(encoder_of(grid(), 70.0)) == isocodec.encode(isocodec.read(grid()), 70.0)


def test_images_of_nibabel_and_itk(tmp_path: Path) -> None:
    affine = nibabel.affines.from_matvec(
        nibabel.eulerangles.euler2mat(0.3, -0.2, 0.1) @ np.diag([-2.0, 1.5, 3.0]), [-90.0, 12.5, 7.0]
    )
    image = nibabel.Nifti1Image(BALL.astype(np.float32), affine)
    field = isocodec.read(image)
    assert np.allclose(matrix(field), affine[:3])
    nibabel.save(image, tmp_path / "a.nii.gz")
    same = SimpleITK.ReadImage(str(tmp_path / "a.nii.gz"))
    of_itk = isocodec.read(same)
    assert np.allclose(matrix(of_itk), affine[:3], atol=1e-5)
    assert np.array_equal(of_itk.values, field.values)
    stored = nibabel.load(tmp_path / "a.nii.gz")
    assert isocodec.encode(stored, 50.0) == isocodec.encode(isocodec.read(tmp_path / "a.nii.gz"), 50.0)
    integers = nibabel.Nifti1Image(BALL.astype(np.int16), affine)
    assert isocodec.read(integers).values.dtype == np.int16


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.png", "a.tif", "a.nii", "a.nii.gz", "a.h5", "a.mha", "a.nrrd"])
def test_open_files(tmp_path: Path, name: str) -> None:
    """The first bytes tell which format it is, or the name."""
    path, cells = written(tmp_path, name)
    for file in (path.open("rb"), io.BytesIO(path.read_bytes())):
        with file:
            assert np.array_equal(isocodec.read(file).values, cells)


def test_open_files_that_are_none() -> None:
    with pytest.raises(InputError, match="neither a name nor the first bytes"):
        isocodec.read(io.BytesIO(b"whatever"))
    with pytest.raises(OptionError, match="opened as text"):
        isocodec.read(io.StringIO("whatever"))
    buffer = io.BytesIO()
    np.save(buffer, CELLS)
    assert isocodec.read(io.BytesIO(buffer.getvalue()), kind=".npy").shape == CELLS.shape
    with pytest.raises(LimitError, match="larger than the permitted"):
        isocodec.read(io.BytesIO(buffer.getvalue() + bytes(70 << 20)), samples=8)


def test_urls(tmp_path: Path) -> None:
    """Over a web server, and out of the memory that fsspec offers."""
    path, cells = written(tmp_path, "a.tif")
    (tmp_path / "a.iso").write_bytes(isocodec.encode(HILL, 70.0))
    with fsspec.open("memory://folder/a.tif", "wb") as file:
        file.write(path.read_bytes())
    assert np.array_equal(isocodec.read("memory://folder/a.tif").values, cells)

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        at = f"http://127.0.0.1:{server.server_port}"
        assert np.array_equal(isocodec.read(f"{at}/a.tif").values, cells)
        assert np.array_equal(isocodec.decode(f"{at}/a.iso").points, isocodec.decode(tmp_path / "a.iso").points)
        with pytest.raises(FileNotFoundError):
            isocodec.read(f"{at}/none.tif")
        with pytest.raises(FileNotFoundError, match="no such file"):
            isocodec.open(f"{at}/none.iso").contour()
        server.shutdown()
    with pytest.raises(InputError, match="cannot be opened"):
        isocodec.read("gopher://nowhere/a.tif")


def test_name_and_unit_of_hdf5(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["t"] = np.where(HILL.min() == HILL, -1, HILL)
        file["t"].attrs["units"], file["t"].attrs["_FillValue"] = "degC", -1.0
    field = isocodec.read(tmp_path / "a.nc")
    assert (field.name, field.unit) == ("t", "degC") and field.mask is not None and field.mask.any()


def test_own_options_come_first() -> None:
    field = replace(isocodec.read(grid()), mask=HILL > 95, placement=(2, 3))
    data = isocodec.encode(field, 70.0, metadata={"unit": "F"})
    contour = isocodec.decode(data)
    assert matrix(contour).tolist() == [[0, 3, 0], [2, 0, 0]]
    assert contour.metadata["unit"] == "F" and contour.metadata["name"] == "tas"
    assert np.array_equal(isocodec.open(data).valid(), HILL <= 95)


def test_masks() -> None:
    """Of a mask the border is kept, without an isovalue; of anything else one has to be given."""
    mask = HILL > 70
    data = isocodec.encode(mask)
    assert np.array_equal(isocodec.open(data).above(), mask)
    assert isocodec.open(data).info.isovalues == [0.5]
    assert data == isocodec.encode(mask, 0.5, precision="signs")
    with pytest.raises(OptionError, match="no isovalue"):
        isocodec.encode(HILL)


def test_files_by_name(tmp_path: Path) -> None:
    field = Field(HILL, placement=np.array([[0.0, 30, 5e5], [-20, 0, 4e6]]), crs="EPSG:32631", unit="m")
    isocodec.save(tmp_path / "a.iso", field, [70.0, 80.0], precision=0.01)
    file = isocodec.open(tmp_path / "a.iso")
    assert file.shape == (20, 30) and file.isovalues == (70.0, 80.0) and file.crs == "EPSG:32631"
    assert np.array_equal(matrix(file), matrix(field))
    assert [c.isovalue for c in file.contours()] == [70.0, 80.0]
    assert np.array_equal(file.above(80.0), HILL > 80) and file.valid().all()
    assert "70, 80" in repr(file)
    contour = file.contour(80.0)
    for source in ((tmp_path / "a.iso").read_bytes(), str(tmp_path / "a.iso"), (tmp_path / "a.iso").open("rb")):
        assert np.array_equal(isocodec.decode(source, isovalue=80.0).points, contour.points)
    isocodec.save(tmp_path / "copy.iso", file)
    assert (tmp_path / "copy.iso").read_bytes() == file.data
    isocodec.save(tmp_path / "a.geojson", file.contours())
    isocodec.save(tmp_path / "b.svg", contour)
    assert (tmp_path / "a.geojson").stat().st_size and (tmp_path / "b.svg").stat().st_size
    for wrong in (
        lambda: isocodec.save(tmp_path / "a.stl", HILL, 70.0), lambda: isocodec.save(tmp_path / "b.iso", file, 70.0),
        lambda: isocodec.save(tmp_path / "b.stl", contour), lambda: isocodec.save(tmp_path / "b.iso", contour),
        lambda: isocodec.decode(io.StringIO("text")),
    ):
        with pytest.raises(OptionError):
            wrong()
    with pytest.raises(FileNotFoundError):
        isocodec.open(tmp_path / "none.iso")
    with pytest.raises(LimitError, match="more than 10 bytes"):
        isocodec.open(tmp_path / "a.iso", limits=isocodec.Limits(bytes=10))


SCRIPT = '''
import numpy as np
import isocodec

field = isocodec.read("a.tif")
data: bytes = isocodec.encode(field, 500.5, precision=0.5)
isocodec.save("a.iso", field, 500.5, precision="exact")
contour = isocodec.open("a.iso").contour()
points: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = contour.points
WRONG
'''
WRONG = {
    'isocodec.encode(field, 1.0, exakt=True)': 'Unexpected keyword argument "exakt"',
    'isocodec.save("a.iso", field, 1.0, precison=1)': 'Unexpected keyword argument "precison"',
    'isocodec.encode(field, 1.0, precision={1})': "incompatible type",
    'isocodec.decode(5)': "incompatible type",
    'contour.pionts': "has no attribute",
}


def test_types_of_a_script_of_a_user(tmp_path: Path) -> None:
    """Strict checking passes what is right and finds each wrong line."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.replace("WRONG", ""))
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--cache-dir", str(tmp_path / "cache")]
    good = subprocess.run([*command, script], capture_output=True, text=True, cwd=tmp_path)
    assert good.returncode == 0, good.stdout
    script.write_text(SCRIPT.replace("WRONG", "\n".join(WRONG)))
    bad = subprocess.run([*command, script], capture_output=True, text=True, cwd=tmp_path)
    lines = [line for line in bad.stdout.splitlines() if ": error: " in line]
    assert len(lines) == len(WRONG), bad.stdout
    for line, said in zip(lines, WRONG.values(), strict=True):
        assert said in line


def test_nothing_is_said_of_what_is_kept(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", HILL)
    with warnings.catch_warnings(action="error"):
        isocodec.read(tmp_path / "a.tif")
        isocodec.read(grid())
        isocodec.read(HILL)
