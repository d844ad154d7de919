"""Where samples lie in the world: what other libraries write comes back as coordinates, whatever the file is cut to."""

from __future__ import annotations

import io
import json
from pathlib import Path

import nibabel
import numpy as np
import pytest
import tifffile
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import isocodec
from brute import examples
from commands import fails, ok
from isocodec import OptionError
from isocodec.grid.placement import placement_of, read_placement, unplaced, write_placement
from isocodec.io import read_placement as placement_in
from isocodec.io import render_contour

HILL = 100 - np.hypot(*(np.mgrid[:20, :30] - np.array([9.3, 14.2])[:, None, None])) * 5
BALL = 100 - np.linalg.norm(np.mgrid[:12, :13, :14] - np.array([5.6, 6.2, 6.9])[:, None, None, None], axis=0) * 10
UTM = [(33550, "d", 3, (30.0, 20.0, 0.0)), (33922, "d", 6, (0, 0, 0, 500000.0, 4e6, 0))]
ROTATION = nibabel.affines.from_matvec(
    nibabel.eulerangles.euler2mat(0.3, -0.2, 0.1) @ np.diag([-2.0, 1.5, 3.0]), [-90.0, 12.5, 7.0]
)


def keys(raster: int, number: int, key: int = 3072) -> list[tuple[int, str, int, tuple[int, ...]]]:
    """Tags that name a reference system and what a pixel is."""
    return [(34735, "H", 16, (1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, raster, key, 0, 1, number))]


@pytest.mark.parametrize(("raster", "half"), [(1, 0.5), (2, 0.0)])
def test_geotiff(tmp_path: Path, raster: int, half: float) -> None:
    """Pixels that are areas have their samples in the middle; rows run southwards."""
    tifffile.imwrite(tmp_path / "dem.tif", HILL.astype(np.float32), extratags=UTM + keys(raster, 32631))
    ok("encode", tmp_path / "dem.tif", "-o", tmp_path / "dem.iso", "--isovalue", 70)
    ok("decode", tmp_path / "dem.iso", "-o", tmp_path / "dem.geojson")
    feature = json.loads((tmp_path / "dem.geojson").read_text())
    assert feature["crs"]["properties"]["name"] == "urn:ogc:def:crs:EPSG::32631"
    (line,) = feature["geometry"]["coordinates"]
    (rows_and_columns,) = isocodec.decode((tmp_path / "dem.iso").read_bytes()).lines
    row, column = rows_and_columns.T
    expected = np.stack([500000 + 30 * (column + half), 4e6 - 20 * (row + half)], axis=1)
    assert np.allclose(line, expected, rtol=0, atol=1e-6)

    ok("decode", tmp_path / "dem.iso", "-o", tmp_path / "plain.geojson", "--in-samples")
    feature = json.loads((tmp_path / "plain.geojson").read_text())
    assert "crs" not in feature
    assert np.array_equal(feature["geometry"]["coordinates"][0], rows_and_columns[:, ::-1])

    ok("encode", tmp_path / "dem.tif", "-o", tmp_path / "bare.iso", "--isovalue", 70, "--no-placement")
    assert not isocodec.inspect((tmp_path / "bare.iso").read_bytes()).metadata


def test_geotiff_matrix(tmp_path: Path) -> None:
    matrix = (3, 1, 0, 50, 2, -4, 0, 60, 0, 0, 0, 0, 0, 0, 0, 1)
    tifffile.imwrite(tmp_path / "t.tif", HILL, extratags=[(34264, "d", 16, matrix), *keys(2, 4326, 2048)])
    placement, crs = placement_in(tmp_path / "t.tif", 2)
    # x = 3 column + row + 50, y = 2 column - 4 row + 60
    assert placement is not None and placement.tolist() == [[1, 3, 50], [-4, 2, 60]]
    assert crs == "EPSG:4326"


def test_geotiff_that_says_nothing_of_use(tmp_path: Path) -> None:
    flat = [(33550, "d", 3, (0.0, 20.0, 0.0)), UTM[1]]
    for name, tags in (("none", []), ("flat", flat + keys(1, 32767)), ("grid", UTM[:1] + keys(1, 32767))):
        tifffile.imwrite(tmp_path / f"{name}.tif", HILL, extratags=tags)
        assert placement_in(tmp_path / f"{name}.tif", 2) == (None, None)
    tifffile.imwrite(tmp_path / "stack.tif", BALL, extratags=UTM, photometric="minisblack")
    assert placement_in(tmp_path / "stack.tif", 3) == (None, None)


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


def test_nifti_pictures_have_no_placement(tmp_path: Path) -> None:
    nibabel.save(nibabel.Nifti1Image(HILL.astype(np.float32)[..., None], np.eye(4)), tmp_path / "p.nii")
    assert placement_in(tmp_path / "p.nii", 2) == (None, None)


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
    for wrong, says in (("3", "2 axes"), ("3,0", "one point"), ("3,nan", "not finite"), ("3;4", "comma")):
        assert says in fails(
            2, "encode", tmp_path / "h.npy", "-o", tmp_path / "x.iso", "--isovalue", 6, "--spacing", wrong
        )
    assert not (tmp_path / "x.iso").exists()


def test_pictures_have_the_proportions_of_the_world() -> None:
    """A disc of 10 by 5 samples, twice as far apart downwards, looks round; so does a ball."""
    y, x = np.mgrid[:24, :44]
    data = isocodec.encode(20 - np.hypot(2 * (y - 11.4), x - 21.7), 8, placement=(2, 1))
    ink = np.asarray(Image.open(io.BytesIO(render_contour(isocodec.decode(data), ".png"))).convert("RGB")).astype(int)
    blue = (ink[..., 2] - ink[..., 0] > 30).nonzero()
    sides = [int(np.ptp(axis)) for axis in blue]
    assert min(sides) > 100 and abs(sides[0] - sides[1]) <= 4
    z, y, x = np.mgrid[:12, :24, :24]
    ball = 20 - np.sqrt((2 * (z - 5.5)) ** 2 + (y - 11.5) ** 2 + (x - 11.5) ** 2)
    flat, round_ = (isocodec.decode(isocodec.encode(ball, 12, placement=placement)) for placement in (None, (2, 1, 1)))
    seen = []
    for contour in (flat, round_):
        picture = np.asarray(Image.open(io.BytesIO(render_contour(contour, ".png"))).convert("RGB")).astype(int)
        seen.append([int(np.ptp(axis)) for axis in (picture[..., 2] - picture[..., 0] > 20).nonzero()])
    apart = [abs(down - across) / across for down, across in seen]
    assert apart[1] < 0.05 < 0.2 < apart[0], seen


def test_python() -> None:
    """Kept by prefixes and shorter files; nothing else of a file changes."""
    plain = isocodec.encode(HILL, 70.5)
    data = isocodec.encode(HILL, 70.5, placement=[[0, 2, 5], [-3, 0, 7]], metadata={"source": "test"})
    whole = isocodec.decode(data)
    assert np.array_equal(whole.points, isocodec.decode(plain).points) and isocodec.decode(plain).placement is None
    assert np.array_equal(isocodec.decode(plain).placed, whole.points[:, ::-1])
    assert whole.metadata == {"source": "test", "placement": "0 2 5 -3 0 7"}
    expected = np.stack([2 * whole.points[:, 1] + 5, 7 - 3 * whole.points[:, 0]], axis=1)
    assert np.array_equal(whole.placed, expected)
    for some in (isocodec.decode(data, layers=2), isocodec.decode(isocodec.truncate(data, layers=2))):
        assert some.placement is not None and some.placement.tolist() == [[0, 2, 5], [-3, 0, 7]]
    with pytest.raises(OptionError, match="contradict"):
        isocodec.encode(HILL, 70.5, placement=(1, 1), metadata={"placement": "1 0 0 0 1 0"})
    for wrong in ("far", [1, 2, 3], [["x", 1]], np.ones((2, 3)), [1, np.inf]):
        with pytest.raises(OptionError) as caught:
            isocodec.encode(HILL, 70.5, placement=wrong)
        assert caught.value.code == "placement"


@examples(200)
@given(st.sampled_from([2, 3]), st.data())
def test_notes(n: int, data: st.DataObject) -> None:
    """Numbers come back to the last bit; texts that are no placement say nothing."""
    number = st.floats(-1e300, 1e300)
    matrix = np.array(data.draw(st.lists(number, min_size=n * n + n, max_size=n * n + n))).reshape(n, n + 1)
    try:
        placement = placement_of(matrix, n)
    except OptionError:
        assert read_placement({"placement": write_placement(matrix)}, n) is None
    else:
        back = read_placement({"placement": write_placement(placement)}, n)
        assert back is not None and np.array_equal(back, placement)
    assert read_placement({"placement": data.draw(st.text(max_size=40))}, n) is None
    assert read_placement({}, n) is None


def test_without() -> None:
    assert unplaced(2).tolist() == [[0, 1, 0], [1, 0, 0]]
    assert unplaced(3)[:, :3].tolist() == np.eye(3).tolist()
