"""Surfaces in files: points and values there and back, to an error, a number of points or a size."""

from __future__ import annotations

import json
import zlib

import numpy as np
import pytest

import isocodec
from commands import run
from isocodec.errors import FormatError, InputError, LimitError, OptionError, TruncatedError
from isocodec.format.chunks import write_chunk
from isocodec.format.header import Header, write_header
from isocodec.format.surface import TinHead, write_tin
from isospec.container import ChunkType, Profile
from tables import heavy, looped

Y, X = np.mgrid[:40, :52]
HILL = np.rint(100 * np.exp(-((Y - 20.0) ** 2 + (X - 30.0) ** 2) / 200)) + (X > 12) * 20
"""A hill beside a cliff."""


def scattered(count: int = 300, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    points = np.random.default_rng(seed).normal(size=(count, 2)) * 1e3 + 5e5
    return points, np.sin(points[:, 0] / 700) * 30


def end(data: bytes) -> bytes:
    """The file with its checksum made anew."""
    return data[:-4] + zlib.crc32(data[:-4]).to_bytes(4, "big")


@looped("error", [0.0, 0.5, 2.0, 7.5, 500.0])
def test_error_is_kept(error: float):
    tin = isocodec.open(isocodec.encode(isocodec.thin(HILL, error=error))).surface()
    assert np.abs(tin.raster() - HILL).max() <= error + 1e-9
    assert tin.shape == HILL.shape
    assert tin.complete


def test_error_is_kept_at_scattered_points():
    from matplotlib.tri import LinearTriInterpolator, Triangulation

    points, values = scattered()
    tin = isocodec.open(isocodec.encode(isocodec.thin(isocodec.Mesh(points, None, values), error=1.5))).surface()
    surface = LinearTriInterpolator(Triangulation(*tin.points.T, tin.triangles), tin.values)
    # positions are rounded to a part in 2**24 of the extent: a place of the hull's border may lie outside by that
    missed = np.ma.masked_invalid(surface(*points.T)) - values
    assert np.ma.count_masked(missed) < 10
    assert np.abs(missed).max() <= 1.5 + 1e-3
    assert tin.shape is None
    with pytest.raises(OptionError):
        tin.raster()


@pytest.mark.parametrize("size", [90, 150, 400])
def test_size_is_kept(size: int):
    data = isocodec.encode(isocodec.thin(HILL, size=size))
    assert 0.8 * size < len(data) <= size


def test_any_prefix_of_a_progressive_file():
    data = isocodec.encode(isocodec.thin(HILL, error=1.0, layers=4))
    found = []
    for size in range(len(data) + 1):
        try:
            tin = isocodec.open(data).surface(max_bytes=max(size, 1))
        except TruncatedError:
            assert not found
            continue
        missed = tin.raster() - HILL
        assert tin.complete == (size == len(data))
        found.append(float((missed**2).mean()))
    assert len(found) > 0.8 * len(data)
    thirds = [np.mean(part) for part in np.array_split(found, 4)]
    assert thirds == sorted(thirds, reverse=True)
    assert np.abs(missed).max() <= 1.0 + 1e-9


def test_layers_hold_the_same_points():
    one, several = (isocodec.open(isocodec.encode(isocodec.thin(HILL, error=2.0, layers=n))).surface() for n in (1, 5))
    assert np.array_equal(one.points, several.points)
    assert np.array_equal(one.values, several.values)


def test_coordinates_come_back():
    """Those that a grid holds, far from the origin, to the last bit."""
    points = np.random.default_rng(1).integers(0, 4000, (60, 2)) * 25.5 + np.array([449999.5, -5.25e6])
    tin = isocodec.open(isocodec.encode(isocodec.thin(isocodec.Mesh(points, None, points[:, 0]), error=1e-3))).surface()
    assert set(map(tuple, tin.points)) <= set(map(tuple, points))


def test_damaged_files():
    """Every damage is found by the checksum; where that is made anew, by a rule, or gives another surface."""
    data = isocodec.encode(isocodec.thin(HILL, error=2.0))
    rng = np.random.default_rng(7)
    kinds = set()
    for turn in range(150):
        bad = bytearray(data)
        for _ in range(rng.integers(1, 4)):
            bad[rng.integers(6, len(bad) - 4)] = rng.integers(256)
        if bytes(bad) == data:
            continue
        if turn < 20:
            with pytest.raises((FormatError, OptionError)):
                isocodec.open(bytes(bad)).surface()
        try:
            tin = isocodec.open(end(bytes(bad)), limits=isocodec.Limits(vertices=20_000)).surface()
            assert len(tin.triangles) > 0
            kinds.add("fine")
        except (FormatError, LimitError, OptionError) as error:
            kinds.add(type(error).__name__)
    assert {"fine", "FormatError"} <= kinds


def test_files_cut_short():
    data = isocodec.encode(isocodec.thin(HILL, error=2.0))
    for size in range(len(data)):
        with pytest.raises(TruncatedError):
            isocodec.open(data[:size]).surface()
    with pytest.raises(FormatError):
        isocodec.open(data + b"x").surface()


def test_limits():
    data = isocodec.encode(isocodec.thin(HILL, error=0.5))
    for limits in ({"vertices": 20}, {"memory": 4000}, {"bytes": 40}):
        with pytest.raises(LimitError):
            isocodec.open(data, limits=isocodec.Limits(**limits)).surface()


def test_other_files():
    contour = isocodec.encode(HILL, 50)
    with pytest.raises(OptionError):
        isocodec.open(contour).surface()
    mesh = isocodec.encode(isocodec.Mesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], [0, 1, 2]), 0.5)
    with pytest.raises(OptionError):
        isocodec.open(mesh).surface()
    with pytest.raises(OptionError) as caught:
        isocodec.decode(isocodec.encode(isocodec.thin(HILL, to=10)))
    assert "surface" in str(caught.value)


@looped(
    "options",
    [{}, {"error": 1.0, "to": 9}, {"error": -1.0}, {"error": np.nan}, {"to": 2}, {"size": 0}, {"size": 20},
     {"to": 9, "layers": 0}, {"to": 9, "layers": 65}, {"to": 9, "step": 0.0}, {"error": 1.0, "step": 1.0}],
)
def test_options_that_make_no_sense(options: dict):
    with pytest.raises(OptionError):
        isocodec.encode(isocodec.thin(HILL, **options))


def test_input_that_makes_no_surface():
    with pytest.raises(InputError):
        isocodec.encode(isocodec.thin(np.full((4, 4), np.nan), error=1))
    with pytest.raises(InputError):
        isocodec.encode(isocodec.thin(np.zeros((1, 9)), error=1))


def test_samples_that_are_missing_and_points_that_coincide(tmp_path):
    """A surface spans holes, of which the user is warned, as of points that are merged."""
    holed, table = HILL.astype(float), tmp_path / "points.xyz"
    holed[3:9, 4:8] = np.nan
    np.save(tmp_path / "holed.npy", holed)
    np.savetxt(table, [(0, 0, 1), (9, 0, 2), (0, 9, 3), (9, 9, 4), (4, 4, 5), (4, 4, 7)])
    for out in ("out.iso", "out.npz"):
        result = run("thin", tmp_path / "holed.npy", "-o", tmp_path / out, "--error", 2)
        assert result.exit_code == 0 and "24 missing samples: the triangulation covers them" in result.stderr
    tin = isocodec.open(tmp_path / "out.iso").surface()
    there = holed[tuple(tin.points.T.astype(int))]
    assert tin.shape is None and np.abs(there - tin.values).max() <= 2
    result = run("thin", table, "-o", tmp_path / "out.ply", "--points", 5, "--json")
    assert "1 points coincide with others: each group is merged" in result.stderr
    record = json.loads(result.stdout)
    assert (record["merged"], record["removed"], record["criterion"]) == (1, 0, "AT1")


def test_work_is_bounded():
    """A few hundred bytes that ask for ever more points in a box of 2**28 a side."""
    head = TinHead((1 << 28, 1 << 28), True, 0, (0, 0), 0.0, 1.0, (), 255, (1 << 28,))
    chunk = write_chunk(ChunkType.DOMAIN, write_tin(head) + bytes(300), last=True)
    data = write_header(Header((), 0.0, None, Profile.MAIN, cells=2)) + chunk + bytes(4)
    with pytest.raises(LimitError) as caught:
        isocodec.open(end(data), limits=isocodec.Limits(work=1 << 16)).surface()
    assert caught.value.code == "limit-work"


@looped("layers", [2, 12, *heavy(3, 5, 64)])
def test_layers_add_points(layers: int):
    """Each to those before; the first have values that suit all of them, where these are free."""
    points, values = scattered()
    mesh = isocodec.Mesh(points, None, values)
    for given, options in ((HILL, {"to": 150}), (HILL, {"error": 1.0}), (mesh, {"to": 80})):
        tin = isocodec.thin(given, layers=layers, **options)
        data = isocodec.encode(tin)
        file = isocodec.open(data)
        whole = file.surface()
        assert np.array_equal(whole.points, tin.points) and np.array_equal(whole.values, tin.values)
        ends = tin.coded[1].ends
        assert 1 < len(ends) <= layers and ends[-1] == len(whole.points) and sorted(set(ends)) == [*ends]
        before: set[tuple[float, ...]] = set()
        # files of many layers at some of them: each is made anew
        for count in range(1, len(ends) + 1, max(len(ends) // 8, 1)):
            some = isocodec.open(file.edited(layers=count)).surface()
            now = set(map(tuple, np.c_[some.points, some.values].tolist()))
            assert len(some.points) == ends[count - 1] and before < now
            before = now


def test_points_on_the_hull_alone_make_one_layer():
    angle = np.arange(60) * np.pi / 30
    points = np.rint(1e6 * np.c_[np.cos(angle), np.sin(angle)])
    tin = isocodec.thin(isocodec.Mesh(points, None, np.arange(60.0)), to=60, layers=6)
    assert tin.coded[1].ends == (60,)
    assert len(isocodec.open(isocodec.encode(tin)).surface().points) == 60


@pytest.mark.parametrize("options", [{"to": 9}, {"error": 0.0}, {"size": 90}, {"criterion": "l2", "to": 6}])
def test_layers_of_constant_values(options: dict):
    field = np.full((9, 9), 7.25)
    assert (isocodec.open(isocodec.encode(isocodec.thin(field, layers=5, **options))).surface().raster() == 7.25).all()
