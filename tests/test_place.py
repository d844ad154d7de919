"""Where samples lie in the world: what other libraries write comes back as coordinates, whatever the file is cut to."""

from __future__ import annotations

import io
import json
import warnings
from pathlib import Path
from typing import Any

import h5py
import nibabel
import numpy as np
import pytest
import SimpleITK
import tifffile
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import isocodec
from brute import examples
from commands import fails, ok, run
from files import with_checksum
from inputs import read_place, says_nothing
from isocodec.errors import OptionError
from isocodec.field.placement import Placement, matrix_of, read_placement, unplaced, write_placement
from places import matrix
from written import rendered

HILL = 100 - np.hypot(*(np.mgrid[:20, :30] - np.array([9.3, 14.2])[:, None, None])) * 5
BALL = 100 - np.linalg.norm(np.mgrid[:12, :13, :14] - np.array([5.6, 6.2, 6.9])[:, None, None, None], axis=0) * 10
UTM = [(33550, "d", 3, (30.0, 20.0, 0.0)), (33922, "d", 6, (0, 0, 0, 500000.0, 4e6, 0))]
ROTATION = nibabel.affines.from_matvec(
    nibabel.eulerangles.euler2mat(0.3, -0.2, 0.1) @ np.diag([-2.0, 1.5, 3.0]), [-90.0, 12.5, 7.0]
)


def keys(raster: int, number: int, key: int = 3072) -> list[tuple[int, str, int, tuple[int, ...]]]:
    """Tags that name a reference system and what a pixel is."""
    return [(34735, "H", 16, (1, 1, 0, 3, 1024, 0, 1, 1 + (key == 2048), 1025, 0, 1, raster, key, 0, 1, number))]


@pytest.mark.parametrize(("raster", "half"), [(1, 0.5), (2, 0.0)])
def test_geotiff(tmp_path: Path, raster: int, half: float) -> None:
    """Pixels that are areas have their samples in the middle; rows run southwards."""
    tifffile.imwrite(tmp_path / "dem.tif", HILL.astype(np.float32), extratags=UTM + keys(raster, 32631))
    ok("encode", tmp_path / "dem.tif", "-o", tmp_path / "dem.iso", "--isovalue", 70)
    ok("decode", tmp_path / "dem.iso", "-o", tmp_path / "dem.geojson", "--keep-crs")
    feature = json.loads((tmp_path / "dem.geojson").read_text())
    assert feature["crs"]["properties"]["name"] == "urn:ogc:def:crs:EPSG::32631"
    line = feature["features"][0]["geometry"]["coordinates"]
    (rows_and_columns,) = isocodec.decode((tmp_path / "dem.iso").read_bytes()).lines
    row, column = rows_and_columns.T
    expected = np.stack([500000 + 30 * (column + half), 4e6 - 20 * (row + half)], axis=1)
    assert np.allclose(line, expected, rtol=0, atol=1e-6)

    ok("decode", tmp_path / "dem.iso", "-o", tmp_path / "plain.geojson", "--in-samples")
    feature = json.loads((tmp_path / "plain.geojson").read_text())
    assert feature["crs"]["properties"]["name"].startswith('ENGCRS["samples"')
    # with y upwards the other way around has higher values on its left
    assert np.array_equal(feature["features"][0]["geometry"]["coordinates"], rows_and_columns[::-1, ::-1])

    ok("encode", tmp_path / "dem.tif", "-o", tmp_path / "bare.iso", "--isovalue", 70, "--no-placement")
    assert not isocodec.open((tmp_path / "bare.iso").read_bytes()).info.metadata


@pytest.mark.parametrize(("raster", "start"), [(2, (50, 60)), (1, (52, 59))])
def test_geotiff_matrix(tmp_path: Path, raster: int, start: tuple[int, int]) -> None:
    """x = 3 column + row + 50, y = 2 column - 4 row + 60, at corners of pixels or in their middles."""
    matrix = (3, 1, 0, 50, 2, -4, 0, 60, 0, 0, 0, 0, 0, 0, 0, 1)
    tifffile.imwrite(tmp_path / "t.tif", HILL, extratags=[(34264, "d", 16, matrix), *keys(raster, 4326, 2048)])
    place = read_place(tmp_path / "t.tif")
    assert place.matrix is not None and place.matrix.tolist() == [[1, 3, start[0]], [-4, 2, start[1]]]
    assert place.crs == "EPSG:4326"


@pytest.mark.parametrize(
    ("tags", "crs"),
    [
        (UTM, None),  # no keys at all
        ([UTM[0], (33922, "d", 6, (2, 3, 0, 500060.0, 4e6 - 60, 0)), *keys(1, 32631)], "EPSG:32631"),
        ([UTM[0], (33922, "d", 12, (0, 0, 0, 500000.0, 4e6, 0, 9, 9, 0, 1, 2, 3)), *keys(1, 32631)], "EPSG:32631"),
        ([*UTM, (34264, "d", 16, (0.0,) * 16), *keys(1, 32767)], None),
        ([*UTM, *keys(1, 0)], None),
        ([*UTM, *keys(1, 54009)], None),
        ([*UTM, (34735, "H", 16, (1, 1, 0, 3, 1024, 0, 1, 2, 2048, 0, 1, 4326, 3072, 0, 1, 32631))], "EPSG:4326"),
        ([*UTM, (34735, "H", 16, (1, 1, 0, 3, 1024, 0, 1, 2, 2048, 0, 1, 4326, 3072, 0, 1, 0))], "EPSG:4326"),
        ([*UTM, (34735, "H", 1, 7)], None),  # a damaged directory
    ],
)
def test_geotiff_less_common(tmp_path: Path, tags: list[Any], crs: str | None) -> None:
    tifffile.imwrite(tmp_path / "t.tif", HILL, extratags=tags)
    place = read_place(tmp_path / "t.tif")
    assert place.matrix is not None and place.matrix.tolist() == [[0, 30, 500015], [-20, 0, 4e6 - 10]]
    assert place.crs == crs
    stated = tags[-1][0] == 34735 and tags[-1][2] > 1
    assert ("reference system is left out" in place.remark) == (stated and crs is None)


@pytest.mark.parametrize(
    "tags",
    [
        [(33550, "d", 3, (0.0, 20.0, 0.0)), UTM[1]],
        [(33550, "d", 3, (float("nan"), 20.0, 0.0)), UTM[1]],
        [(33550, "d", 3, (1e200, 20.0, 0.0)), UTM[1]],
        [(33550, "d", 1, 30.0), UTM[1]],
        [UTM[1]],
        [(34264, "d", 12, (1.0,) * 12)],
        [(34264, "d", 16, (1e300, 1e300, 0, 0) * 4)],
    ],
)
def test_geotiff_that_says_nothing_of_use(tmp_path: Path, tags: list[Any]) -> None:
    """The picture is encoded all the same, with a warning."""
    tifffile.imwrite(tmp_path / "t.tif", HILL, extratags=tags + keys(1, 32631))
    with np.errstate(all="raise"):
        place = read_place(tmp_path / "t.tif")
    assert place.matrix is None and place.crs is None and "ignored" in place.remark
    result = run("encode", tmp_path / "t.tif", "-o", tmp_path / "t.iso", "--isovalue", 70)
    assert result.exit_code == 0 and "warning" in result.stderr and "ignored" in result.stderr
    assert not isocodec.open((tmp_path / "t.iso").read_bytes()).info.metadata
    quiet = run("encode", tmp_path / "t.tif", "-o", tmp_path / "t.iso", "--isovalue", 70, "--no-placement")
    assert quiet.exit_code == 0 and "ignored" not in quiet.stderr


def test_pictures_that_say_nothing(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "none.tif", HILL)
    assert says_nothing(read_place(tmp_path / "none.tif"))
    tifffile.imwrite(tmp_path / "stack.tif", BALL, extratags=UTM, photometric="minisblack")
    assert "stack" in read_place(tmp_path / "stack.tif").remark


@pytest.mark.parametrize("suffix", [".nrrd", ".mha"])
def test_volumes_of_itk(tmp_path: Path, suffix: str) -> None:
    """The same image has the same coordinates, whether ITK wrote NIfTI, read by nibabel, or a format of its own."""
    image = SimpleITK.GetImageFromArray(BALL.astype(np.float32))
    image.SetSpacing((0.5, 0.75, 2.0))
    image.SetOrigin((-20.0, 31.0, 5.5))
    image.SetDirection(nibabel.eulerangles.euler2mat(0.3, -0.2, 0.1).ravel())
    SimpleITK.WriteImage(image, tmp_path / f"v{suffix}")
    SimpleITK.WriteImage(image, tmp_path / "v.nii")
    place, other = (read_place(tmp_path / name) for name in (f"v{suffix}", "v.nii"))
    assert place.matrix is not None and other.matrix is not None
    assert np.allclose(place.matrix, other.matrix, rtol=0, atol=1e-5) and not place.remark
    assert place.crs == other.crs == "right-anterior-superior" and place.space == "RAS"
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(BALL), tmp_path / f"bare{suffix}")
    assert np.array_equal(read_place(tmp_path / f"bare{suffix}").matrix, np.diag([-1.0, -1, 1, 0])[:3])
    SimpleITK.WriteImage(SimpleITK.JoinSeries([image, image]), tmp_path / f"series{suffix}")
    again = read_place(tmp_path / f"series{suffix}", frame=0)
    assert again.matrix is not None and np.allclose(again.matrix, place.matrix, rtol=0, atol=1e-5)
    SimpleITK.WriteImage(image[:, :, 3], tmp_path / f"slice{suffix}")
    flat = read_place(tmp_path / f"slice{suffix}")
    there = image[:, :, 3].TransformContinuousIndexToPhysicalPoint([3.0, 5.0])
    assert flat.space is None and not flat.remark and np.allclose(flat.place(np.array([[3.0, 5.0]])), there)


def netcdf(path: Path, field: np.ndarray, scales: list[np.ndarray | None], key: str = "z") -> Path:
    """A file of one array, its axes with scales, or with such as say nothing but how long they are."""
    with h5py.File(path, "w") as file:
        file[key] = field
        for axis, scale in enumerate(scales):
            name = f"axis{axis}"
            file[name] = np.zeros(field.shape[axis]) if scale is None else scale
            note = f"This is a netCDF dimension but not a netCDF variable.{field.shape[axis]:10}"
            file[name].make_scale(name if scale is not None else note)
            file[key].dims[axis].attach_scale(file[name])
    return path


def test_scales_of_netcdf(tmp_path: Path) -> None:
    """x is the last axis, y the one before; what the curve's file says is what the scales do."""
    north, east = (50 - np.arange(20) / 120).astype(np.float32), 7 + np.arange(30) / 60
    path = netcdf(tmp_path / "dem.nc", HILL[None], [np.zeros(1), north, east])
    ok("encode", path, "-o", tmp_path / "dem.iso", "--isovalue", 70)
    ok("decode", tmp_path / "dem.iso", "-o", tmp_path / "dem.geojson")
    line = json.loads((tmp_path / "dem.geojson").read_text())["features"][0]["geometry"]["coordinates"]
    row, column = isocodec.decode((tmp_path / "dem.iso").read_bytes()).lines[0].T
    expected = np.stack([np.interp(column, range(30), east), np.interp(row, range(20), north)], axis=1)
    assert np.allclose(line, expected, rtol=0, atol=1e-5)

    heights = np.arange(12) * 100.0
    place = read_place(netcdf(tmp_path / "v.nc", BALL, [heights, np.arange(13.0), 3 - np.arange(14.0)]))
    assert place.matrix is not None
    assert place.matrix.tolist() == [[0, 0, -1, 3], [0, 1, 0, 0], [100, 0, 0, 0]]


def test_time_is_no_place(tmp_path: Path) -> None:
    """Of a series in time each frame lies where the others do; along times samples are counted."""
    path = netcdf(tmp_path / "t.nc", np.stack([HILL, HILL + 1]), [np.arange(2.0), np.arange(20.0), np.arange(30.0)])
    with h5py.File(path, "a") as file:
        file["axis0"].attrs["units"] = "hours since 2000-01-01"
    assert "--frame" in read_place(path).remark
    assert read_place(path).matrix.tolist() == [[0, 0, 1, 0], [0, 1, 0, 0], [1, 0, 0, 0]]
    assert read_place(path).matrix is not None
    ok("encode", path, "-o", tmp_path / "t.iso", "--isovalue", 70, "--frame", 1)
    data = (tmp_path / "t.iso").read_bytes()
    assert np.array_equal(
        isocodec.open(data).above(), HILL + 1 > 70,
    ) and "placement" in isocodec.open(data).info.metadata


def test_frames_lie_where_each_of_them_does(tmp_path: Path) -> None:
    """Slices along any axis have the coordinates along the others."""
    path = netcdf(tmp_path / "t.nc", np.stack([HILL, HILL + 1]), [np.arange(2.0), np.arange(20.0), 7 - np.arange(30.0)])
    with h5py.File(path, "a") as file:
        file["axis0"].attrs["units"] = "hours since 2000-01-01"
    ok("encode", path, "-o", tmp_path / "t.iso", "--isovalue", 70, "--frames")
    contour = isocodec.decode(tmp_path / "t.iso", frame=1)
    assert len(contour.points)
    assert np.allclose(contour.placed, np.column_stack([7 - contour.points[:, 1], contour.points[:, 0]]))
    ok("encode", path, "-o", tmp_path / "none.iso", "--isovalue", 70, "--frames", "--no-placement")
    assert "placement" not in isocodec.open((tmp_path / "none.iso").read_bytes()).info.metadata


@pytest.mark.parametrize(
    ("scales", "words"),
    [
        ([None, None], ""),
        ([np.arange(20.0), np.arange(30.0) % 20], "neither rise nor fall"),
        ([np.arange(20.0), np.full(30, np.nan)], "neither rise nor fall"),
        ([np.arange(20.0), np.zeros(30)], "one point"),
    ],
)
def test_scales_of_no_use(tmp_path: Path, scales: list[np.ndarray | None], words: str) -> None:
    place = read_place(netcdf(tmp_path / "a.nc", HILL, scales))
    assert place.matrix is None and words in place.remark and bool(place.remark) == bool(words)


def test_warning_where_single_precision_loses_points(tmp_path: Path) -> None:
    path = tmp_path / "far.iso"
    for origin, words in ((5.1e6, True), (100.0, False)):
        placement = np.column_stack([0.5 * np.eye(3), [origin, 0, 0]])
        path.write_bytes(isocodec.encode(isocodec.Field(BALL, placement=placement), 0.5 * float(BALL.max())))
        for suffix in (".ply", ".stl", ".obj"):
            result = run("decode", path, "-o", tmp_path / f"far{suffix}")
            assert result.exit_code == 0 and ("are rounded" in result.stderr) == (words and suffix != ".obj")
        assert "rounded" not in run("decode", path, "-o", tmp_path / "far.ply", "--in-samples").stderr


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
def test_nifti(tmp_path: Path, suffix: str) -> None:
    """Surfaces lie where nibabel says, their normals outwards although the matrix mirrors space."""
    nibabel.save(nibabel.Nifti1Image(BALL.astype(np.float32), ROTATION), tmp_path / "b.nii.gz")
    ok("encode", tmp_path / "b.nii.gz", "-o", tmp_path / "b.iso", "--isovalue", 60)
    ok("decode", tmp_path / "b.iso", "-o", tmp_path / f"b{suffix}")
    surface = trimesh.load(tmp_path / f"b{suffix}")
    contour = isocodec.decode((tmp_path / "b.iso").read_bytes())
    points = nibabel.affines.apply_affine(ROTATION, contour.points)
    # the header keeps single precision
    assert np.allclose(contour.placed, points, atol=1e-5)
    assert np.allclose(surface.bounds, [points.min(axis=0), points.max(axis=0)], atol=1e-4)
    cells = contour.points[contour.cells]
    volume = np.linalg.det(cells).sum() / 6
    assert volume > 0 and surface.volume == pytest.approx(volume * 9, rel=1e-4)


def test_nifti_that_says_less(tmp_path: Path) -> None:
    """Without a form nibabel makes one up; slices, matrices of no use and units are left out, with a remark."""
    image = nibabel.Nifti1Image(BALL.astype(np.float32), None)
    image.header.set_zooms((0.5, 2.0, 3.0))
    nibabel.save(image, tmp_path / "sizes.nii")
    place = read_place(tmp_path / "sizes.nii")
    assert np.array_equal(place.matrix, nibabel.load(tmp_path / "sizes.nii").affine[:3]) and not place.remark
    for unit in ("mm", "micron", "meter"):
        image.header.set_xyzt_units(unit)
        nibabel.save(image, tmp_path / "unit.nii")
        assert read_place(tmp_path / "unit.nii").unit == unit
    image.header.set_xyzt_units("unknown")
    nibabel.save(nibabel.Nifti1Image(HILL.astype(np.float32)[..., None], np.eye(4)), tmp_path / "slice.nii")
    place = read_place(tmp_path / "slice.nii")
    assert place.in_space and np.array_equal(place.matrix, np.eye(4)[:3, [0, 1, 3]]) and not place.remark
    for name, wrong in (("flat", 0.0), ("nan", np.nan)):
        image.header["sform_code"] = 1
        for number, row in enumerate(("srow_x", "srow_y", "srow_z")):
            image.header[row] = np.eye(4)[number] * (wrong if number == 0 else 1)
        image.header["magic"], image.header["vox_offset"] = b"n+1", 352
        samples = BALL.astype(np.float32).tobytes("F")
        (tmp_path / f"{name}.nii").write_bytes(image.header.binaryblock + bytes(4) + samples)
        place = read_place(tmp_path / f"{name}.nii")
        assert place.matrix is None and "ignored" in place.remark


def test_spacing(tmp_path: Path) -> None:
    np.save(tmp_path / "b.npy", BALL)
    ok("encode", tmp_path / "b.npy", "-o", tmp_path / "b.iso", "--isovalue", 60, "--spacing", "3,0.5,1")
    contour = isocodec.decode((tmp_path / "b.iso").read_bytes())
    assert np.array_equal(contour.placed, contour.points * (3, 0.5, 1))
    np.save(tmp_path / "h.npy", HILL)
    ok("encode", tmp_path / "h.npy", "-o", tmp_path / "h.iso", "--isovalue", 60, "--spacing", "3,0.5")
    contour = isocodec.decode((tmp_path / "h.iso").read_bytes())
    assert np.array_equal(contour.placed, (contour.points * (3, 0.5))[:, ::-1])
    ok("decode", tmp_path / "h.iso", "-o", tmp_path / "h.npz")
    with np.load(tmp_path / "h.npz") as arrays:
        assert arrays["placement"].tolist() == [[0, 0.5, 0], [3, 0, 0]]
    for wrong, says in (("3", "give 2"), ("3,0", "one point"), ("3,nan", "neither 0"), ("3;4", "comma")):
        assert says in fails(
            2, "encode", tmp_path / "h.npy", "-o", tmp_path / "x.iso", "--isovalue", 6, "--spacing", wrong
        )
    wrong = ("encode", tmp_path / "h.npy", "-o", tmp_path / "x.iso", "--isovalue", 6)
    assert "cannot be combined" in fails(2, *wrong, "--spacing", "1,1", "--no-placement")
    assert "is not valid" in fails(2, *wrong, "--metadata", "placement=far")
    assert not (tmp_path / "x.iso").exists()


@pytest.mark.parametrize("size", [1e-30, 1e30])
def test_extreme_sizes(size: float) -> None:
    """All outputs of the smallest and the largest placements that there are."""
    for field, suffixes in ((HILL, (".geojson", ".png", ".svg")), (BALL, (".ply", ".stl", ".obj", ".png"))):
        n = field.ndim
        for steps in ((size,) * n, (size, *(1.0,) * (n - 1))):
            contour = isocodec.decode(isocodec.encode(isocodec.Field(field, placement=steps), 70))
            assert np.isfinite(contour.placed).all()
            with warnings.catch_warnings(action="error"):
                files = {suffix: rendered(contour, suffix) for suffix in suffixes}
            if n == 2:
                line = json.loads(files[".geojson"])["features"][0]["geometry"]["coordinates"]
                assert np.allclose(np.sort(line[:-1], axis=0), np.sort(contour.placed, axis=0), rtol=1e-14, atol=0)
            else:
                for suffix in (".ply", ".obj"):
                    surface = trimesh.load(io.BytesIO(files[suffix]), file_type=suffix[1:], process=False)
                    assert np.allclose(surface.vertices, contour.placed, rtol=1e-6, atol=1e-8 * min(steps))


def test_matrices_of_other_shapes() -> None:
    whole = np.eye(4)
    assert np.array_equal(matrix_of(whole, 3), whole[:3])
    assert matrix_of([[0, 1e-20, 0], [1, 0, 0]], 2).tolist() == [[0, 1e-20, 0], [1, 0, 0]]
    wrong = (np.eye(4) * 2, np.eye(3), np.eye(4, dtype=complex), [10**400, 1, 1], ["1", "2", "3"], None, [[1], [2, 3]])
    for numbers in wrong:
        with pytest.raises(OptionError) as caught:
            matrix_of(numbers, 3)
        assert caught.value.code == "placement"


def test_odd_names_of_systems() -> None:
    data = isocodec.encode(isocodec.Field(HILL, placement=(1, 1)), 70, metadata={"crs": "EPSG:\u0663\u0662"})
    text = json.loads(rendered(isocodec.decode(data), ".geojson"))
    assert text["crs"]["properties"]["name"].startswith('ENGCRS["samples"')


def test_isovalues_that_have_not_come() -> None:
    """What is known of the field is said of them, too."""
    data = isocodec.encode(isocodec.Field(HILL, placement=(1, 2)), [70, 80])
    second = next(one.offset for one in isocodec.open(data).info.chunks if one.type == "isovalue")
    decoder = isocodec.Decoder()
    decoder.feed(data[:second])
    assert len(decoder.take().isovalues) < 2
    missing = decoder.contour(1)
    assert missing.placement is not None and missing.metadata == decoder.metadata and missing.shape == HILL.shape


def test_pictures_have_the_proportions_of_the_world() -> None:
    """A disc of 10 by 5 samples, twice as far apart downwards, looks round; so does a ball."""
    y, x = np.mgrid[:24, :44]
    data = isocodec.encode(isocodec.Field(20 - np.hypot(2 * (y - 11.4), x - 21.7), placement=(2, 1)), 8)
    ink = np.asarray(Image.open(io.BytesIO(rendered(isocodec.decode(data), ".png"))).convert("RGB")).astype(int)
    blue = (ink[..., 2] - ink[..., 0] > 30).nonzero()
    sides = [int(np.ptp(axis)) for axis in blue]
    assert min(sides) > 100 and abs(sides[0] - sides[1]) <= 4
    z, y, x = np.mgrid[:12, :24, :24]
    ball = 20 - np.sqrt((2 * (z - 5.5)) ** 2 + (y - 11.5) ** 2 + (x - 11.5) ** 2)
    flat, round_ = (
        isocodec.decode(
            isocodec.encode(isocodec.Field(ball, placement=placement), 12)
        ) for placement in (None, (2, 1, 1))
    )
    seen = []
    for contour in (flat, round_):
        picture = np.asarray(Image.open(io.BytesIO(rendered(contour, ".png"))).convert("RGB")).astype(int)
        seen.append([int(np.ptp(axis)) for axis in (picture[..., 2] - picture[..., 0] > 20).nonzero()])
    apart = [abs(down - across) / across for down, across in seen]
    assert apart[1] < 0.05 < 0.2 < apart[0], seen


def test_python() -> None:
    """Kept by prefixes and shorter files; nothing else of a file changes."""
    plain = isocodec.encode(HILL, 70.5)
    data = isocodec.encode(isocodec.Field(HILL, placement=[[0, 2, 5], [-3, 0, 7]]), 70.5, metadata={"source": "test"})
    whole = isocodec.decode(data)
    assert np.array_equal(whole.points, isocodec.decode(plain).points) and isocodec.decode(plain).placement is None
    assert np.array_equal(isocodec.decode(plain).placed, whole.points[:, ::-1])
    assert whole.metadata == {"source": "test", "placement": "0 2 5 -3 0 7"}
    expected = np.stack([2 * whole.points[:, 1] + 5, 7 - 3 * whole.points[:, 0]], axis=1)
    assert np.array_equal(whole.placed, expected)
    for some in (isocodec.decode(data, layers=2), isocodec.decode(isocodec.open(data).edited(layers=2))):
        assert matrix(some).tolist() == [[0, 2, 5], [-3, 0, 7]]
    noted = isocodec.encode(isocodec.Field(HILL, placement=(1, 1)), 70.5, metadata={"placement": "2 0 0 0 1 0"})
    assert matrix(isocodec.open(noted)).tolist() == [[2, 0, 0], [0, 1, 0]]  # the note comes first
    for wrong in ("far", [1, 2, 3], [["x", 1]], np.ones((2, 3)), [1, np.inf]):
        with pytest.raises(OptionError) as caught:
            isocodec.encode(isocodec.Field(HILL, placement=wrong), 70.5)
        assert caught.value.code == "placement"


@examples(200)
@given(st.sampled_from([2, 3]), st.data())
def test_notes(n: int, data: st.DataObject) -> None:
    """Numbers come back to the last bit; texts that are no placement say nothing."""
    number = st.just(0.0) | st.floats(1e-31, 1e31) | st.floats(-1e31, -1e-31)
    drawn = np.array(data.draw(st.lists(number, min_size=n * n + n, max_size=n * n + n))).reshape(n, n + 1)
    try:
        placement = matrix_of(drawn, n)
    except OptionError:
        assert read_placement({"placement": write_placement(drawn)}, n) is None
    else:
        back = read_placement({"placement": write_placement(placement)}, n)
        assert back is not None and back.matrix is not None and np.array_equal(back.matrix, placement)
    assert read_placement({"placement": data.draw(st.text(max_size=40))}, n) is None
    assert read_placement({}, n) is None


@pytest.mark.parametrize(
    "note", ["1 0 0 0 1 x", "x", "1 0 0 0 1 nan", "1 0 0 0 1 inf", "1 0 0 0 1 0x1", "1 0 0 0 1 1_0", "1 0 0 0 1 ",
             "1 0 0 0 1", "1 0 0 0 1 0 0", "1 0 0  0 1 0", "01 0 0 0 1 0", "+1 0 0 0 1 0", "1 0 0 0 1 \u0661"],
)
def test_notes_with_something_else_than_numbers(note: str) -> None:
    """Nothing is said by them: a decoder goes on, and an encoder does not write them."""
    assert read_placement({"placement": note}, 2) is None
    with pytest.raises(OptionError, match="is not valid"):
        isocodec.encode(HILL, 70.5, metadata={"placement": note})
    body = isocodec.encode(HILL, 70.5, metadata={"placemenx": note})[:-4].replace(b"placemenx", b"placement")
    contour = isocodec.decode(with_checksum(body))
    assert contour.metadata == {"placement": note} and contour.placement is None


def test_the_users_own_system_wins(tmp_path: Path) -> None:
    """Over the one that the file names; its placement stays."""
    tifffile.imwrite(tmp_path / "dem.tif", HILL.astype(np.float32), extratags=UTM + keys(1, 32631))
    for more, crs in (((), "EPSG:32631"), (("--metadata", "crs=EPSG:25831"), "EPSG:25831")):
        ok("encode", tmp_path / "dem.tif", "-o", tmp_path / "dem.iso", "--isovalue", 70, *more)
        metadata = isocodec.open((tmp_path / "dem.iso").read_bytes()).info.metadata
        assert metadata == {"crs": crs, "placement": "0 30 500015 -20 0 3999990"}


def test_without() -> None:
    """Points are placed as if by this matrix."""
    for field in (HILL, BALL):
        plain = isocodec.decode(isocodec.encode(field, 70))
        told = isocodec.decode(isocodec.encode(isocodec.Field(field, placement=unplaced(field.ndim)), 70))
        assert np.array_equal(plain.placed, told.placed)


I, J = np.meshgrid(np.arange(6.0), np.arange(7.0), indexing="ij")
FRAMED = {
    "matrix": Placement([[3.0, 20.0, 500.0], [-7.0, 1.0, -40.0]]),
    "matrix in space": Placement([[3.0, 20, 1, 5], [-7, 1, 2, 0], [0.5, 4, -9, 1]]),
    "plane in space": Placement([[3.0, 20, 5], [-7, 1, 0], [0.5, 4, 1]]),
    "nodes": Placement([[3.0, 20.0, 500.0], [-7.0, 1.0, -40.0]]).with_nodes((6, 7)),
    "nodes in space": Placement([[3.0, 20, 1, 5], [-7, 1, 2, 0], [0.5, 4, -9, 1]]).with_nodes((6, 7, 8)),
    "axes": Placement(coordinates=[np.arange(6.0) ** 2, 2 * np.arange(7.0) ** 2]),
    "arrays": Placement(coordinates=[J**2 + I, 3 * I**2 - J]),
    "mirrored": Placement(coordinates=[I**2 - J, 3 * J**2]),
}


@pytest.mark.parametrize("name", FRAMED)
@pytest.mark.parametrize("at", [None, (0.0, 0.0), (2.4, 3.9), (4.9, 1.0), (5.0, 6.0)])
def test_frames_are_the_steps_along_axes(name: str, at: tuple[float, ...] | None) -> None:
    """By the places of samples: a column for each axis, a row for each coordinate; also of the last cells."""
    placement = FRAMED[name]
    n = 3 if name.endswith("space") and name != "plane in space" else 2
    where = None if at is None else np.array([*at, 1.5][:n])
    shape = (6, 7, 8)[:n]
    corner = np.minimum(np.floor(np.zeros(n) if where is None else where), np.array(shape) - 2)
    steps = [(placement.place((corner + step)[None]) - placement.place(corner[None]))[0] for step in np.eye(n)]
    frame = placement.frame(where)
    assert frame is not None and np.allclose(frame, np.stack(steps, axis=1), rtol=0, atol=1e-9)
    if name != "plane in space":
        assert placement.mirrored(where) == (np.linalg.det(np.stack(steps, axis=1)) < 0)


@pytest.mark.parametrize("tiled", [False, True])
@pytest.mark.parametrize("key", [None, "crs", "placement", "coordinate_unit", "value_unit", "name", "other"])
def test_notes_of_the_user_win_however_a_file_is_written(tmp_path: Path, tiled: bool, key: str | None) -> None:
    """Over each of the input's, and the others stay; the same whole and in tiles."""
    tifffile.imwrite(tmp_path / "dem.tif", HILL.astype(np.float32), extratags=UTM + keys(1, 32631))
    own = {"crs": "EPSG:32631", "placement": "0 30 500015 -20 0 3999990"}
    told = {"crs": "EPSG:25831", "placement": "0 1 0 2 0 3"}
    more = () if key is None else ("--metadata", f"{key}={told.get(key, 'a=b')}")
    ways = ("--tile", 32) if tiled else ()
    ok("encode", tmp_path / "dem.tif", "-o", tmp_path / "dem.iso", "--isovalue", 70, *more, *ways)
    expected = own | ({} if key is None else {key: told.get(key, "a=b")})
    assert dict(isocodec.open(tmp_path / "dem.iso").metadata) == expected
