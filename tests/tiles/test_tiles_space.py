"""A tolerance in space: meshes of cubes of one edge in all tiles, which meet where tiles do (spec clause 12.7)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_tiles import check_faces
from test_tiles_mixed import check_closed, mixed

import isocodec
from brute import HEAVY, INTERPRETED
from isocodec.errors import InputError
from isocodec.field.samples import check_field
from isocodec.search.original import original
from isocodec.search.proof import hausdorff
from isocodec.search.tile_faces import Faces
from isocodec.tiles.tiled import TiledFile
from libraries import Late
from tables import heavy
from tiled import encoded, tiled_of

gaussian_filter = Late("scipy.ndimage.gaussian_filter")

pytestmark = pytest.mark.skipif(INTERPRETED, reason="searches would be slow")
COUNT, MANY = 2, 40


def waves(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    """A smooth field that differs from axis to axis."""
    x, y, z = np.meshgrid(*map(np.arange, shape), indexing="ij")
    a, b, c = np.random.default_rng(seed).uniform(0, 6, 3)
    return np.sin(x / 7 + np.sin(z / 23) + a) + np.sin(y / 9 + np.cos(x / 31) + b) + np.sin(z / 8 + np.sin(y / 29) + c)


def is_searched(file: TiledFile) -> bool:
    return file.head.stages[-1].adaptive


def check_kept(file: TiledFile, field: np.ndarray, isovalue: float, tolerance: float) -> None:
    """Both ways, and closed, also where tiles stand at different layers."""
    contour, first = file.window(), original(check_field(field, isovalue))
    there, back = hausdorff(contour.points, contour.cells, first.points, first.cells, 0.001)
    assert max(there, back) <= tolerance + 0.001 + 1e-6
    check_closed(contour)
    for seed in range(2):
        check_closed(mixed(file, seed))


@pytest.mark.parametrize("tolerance", [1.0, *heavy(1.5, 2.3)])
def test_the_surface_keeps_to_it(tmp_path: Path, tolerance: float) -> None:
    field = waves((52, 70, 36))
    data = encoded(tmp_path, field, 0.4, precision=tolerance)
    file = tiled_of(data)
    assert is_searched(file)
    check_faces(data, False)
    check_kept(file, field, 0.4, tolerance)
    grid = encoded(tmp_path, field, 0.4, precision=0.49)
    assert len(data) < len(grid)


def test_random_fields(tmp_path: Path) -> None:
    check_random(tmp_path, range(COUNT))


@pytest.mark.heavy
def test_many_random_fields(tmp_path: Path) -> None:
    check_random(tmp_path, range(COUNT, MANY))


def check_random(tmp_path: Path, seeds: range) -> None:
    """Smooth ones and rough ones: what is not kept on coarse meshes is on the full grid."""
    for seed in seeds:
        dice = np.random.default_rng(seed)
        shape = dice.integers(20, 80 if HEAVY else 50, 3)
        field = gaussian_filter(dice.normal(size=shape), dice.choice([1.5, 3.0, 5.0, 8.0]))
        field *= 20 / field.std()
        if seed % 2:
            field = np.rint(field).astype(np.int16)
        tolerance = float(dice.choice([0.8, 1.0, 1.6, 2.5]))
        data = encoded(tmp_path, field, 0.5, tile=[32, 64][seed % 2], precision=tolerance)
        check_faces(data, False)
        check_kept(tiled_of(data), field, 0.5, tolerance)


@pytest.mark.parametrize("radius", [1.3, *heavy(0.8, 2.2, 3.1)])
def test_small_things_on_faces(tmp_path: Path, radius: float) -> None:
    """Meshes as fine as the samples on one side, and large things on the other: still closed."""
    x, y, z = np.meshgrid(*map(np.arange, (66, 40, 40)), indexing="ij")
    small = np.sqrt((x - 32.2) ** 2 + (y - 17.4) ** 2 + (z - 18.3) ** 2) - radius
    large = np.sqrt((x - 49) ** 2 + (y - 20) ** 2 + (z - 20) ** 2) - 13
    field = np.minimum(small, large)
    data = encoded(tmp_path, field, 0, precision=0.9)
    check_faces(data, False)
    check_kept(tiled_of(data), field, 0, 0.9)


def test_several_isovalues_and_the_baseline_profile(tmp_path: Path) -> None:
    field = waves((40, 50, 60))
    file = tiled_of(encoded(tmp_path, field, [0.4, 9.0, -0.3], precision=1.0, profile="baseline"))
    assert is_searched(file)
    for isovalue in (0.4, -0.3):
        first = original(check_field(field, isovalue))
        contour = file.window(isovalue=isovalue)
        assert max(hausdorff(contour.points, contour.cells, first.points, first.cells, 0.001)) <= 1.0011
        check_closed(contour)
    assert not len(file.window(isovalue=9.0).points)


def test_what_is_on_the_full_grid(tmp_path: Path) -> None:
    """Noise, missing samples, and what is finer than a search is worth; the folder of the first attempt is gone."""
    noise = np.random.default_rng(0).normal(size=(40, 40, 70))
    gone = waves((40, 40, 70))
    gone[3:9, 3:9, 3:9] = np.nan
    for field, tolerance in ((noise, 1.0), (gone, 1.0), (waves((40, 40, 70)), 0.4)):
        isocodec.save(tmp_path / "tiled.iso", field, 0.4, tile=32, precision=tolerance)
        assert not is_searched(tiled_of((tmp_path / "tiled.iso").read_bytes()))
        assert [path.name for path in tmp_path.iterdir()] == ["tiled.iso"]


class Breaks:
    """A field that breaks after some tiles."""

    def __init__(self, field: np.ndarray, after: int) -> None:
        self.field, self.shape, self.dtype, self.left = field, field.shape, field.dtype, after

    def __getitem__(self, key: tuple[slice, ...]) -> np.ndarray:
        self.left -= 1
        if self.left < 0:
            raise InputError("broken", code="test")
        return np.asarray(self.field[key])


@pytest.mark.parametrize("rough", [False, *heavy(True)])
def test_resumed_where_it_was(tmp_path: Path, rough: bool) -> None:
    """Also if it stopped on the full grid, after coarse meshes had been given up; the bytes are the same."""
    field = waves((24, 24, 52))
    field[:, :, 30:] += rough * np.random.default_rng(0).normal(size=(24, 24, 22))
    whole = encoded(tmp_path, field, 0.4, precision=1.0)
    assert is_searched(tiled_of(whole)) != rough
    again, reads, path = None, 0, tmp_path / "again.iso"
    while again is None:
        assert (reads := reads + 1) < 40
        try:
            isocodec.save(path, Breaks(field, 1), 0.4, tile=32, precision=1.0)
        except InputError:
            continue
        again = path.read_bytes()
    assert again == whole and reads > 1


def test_a_face_is_the_same_from_both_sides() -> None:
    """What belongs into its mesh follows from its own samples, whatever lies behind and in other faces."""
    shared = np.ones((3, 2), np.bool_)
    face = gaussian_filter(np.random.default_rng(5).normal(size=(33, 33)), 3) * 10
    found = []
    for seed, place in ((0, 32), (1, 32), (2, 0)):
        field = waves((33, 33, 33), seed)
        field[:, place] = face
        faces = Faces(field > 0.4, shared, 2)
        for axis, at in faces.planes[::-1] if seed else faces.planes:
            faces.search((axis, at), check_field(field.take(at, axis), 0.4), 1.0)
        found.append(sorted((x, z) for x, _, z in faces.wanted[1, place]))
    assert found[0] == found[1] == found[2] and found[0]
