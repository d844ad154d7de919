"""Points in files: LAS against laspy, turned grids, and points without a value."""

from __future__ import annotations

import struct
import warnings
from itertools import product
from pathlib import Path

import laspy
import numpy as np
import pyproj
import pytest

import isocodec
from commands import fails, ok, run
from isocodec import Mesh
from isocodec.errors import InputError, LimitError, OptionError
from isocodec.io.readers.input_formats import read_mesh

COUNT = 60
RNG = np.random.default_rng(5)
PLACES = RNG.random((COUNT, 2)) * 100


def cloud(path: Path, form: int, scale: float = 0.01, offset: float = 0.0) -> laspy.LasData:
    header = laspy.LasHeader(point_format=form, version="1.4" if form > 5 else "1.2")
    header.scales, header.offsets = [scale, scale, scale / 2], [offset, 2 * offset, -offset]
    header.add_extra_dim(laspy.ExtraBytesParams("depth", "int16", scales=np.array([0.25]), offsets=np.array([7.0])))
    las = laspy.LasData(header)
    las.x, las.y = (PLACES + [offset, 2 * offset]).T
    las.z = PLACES[:, 0] / 2 - offset
    las.depth = np.arange(COUNT) * 0.25
    las.intensity = np.arange(COUNT)
    kinds = np.full(COUNT, 2)
    kinds[::7], kinds[::11], kinds[5] = 9, 7, 18
    las.classification = kinds.astype(np.uint8)
    las.withheld = (np.arange(COUNT) % 13 == 0).astype(np.uint8)
    las.write(path)
    return las


PLACED = [(1.0, 0.0), (0.01, 500000.0), (0.001, -1234.5)]
CLOUDS = [(".las", form, *PLACED[form % 3]) for form in (0, 1, 3, 6, 7, 8)]
CLOUDS += [(".laz", form, *PLACED[1]) for form in (3, 7)]


@pytest.mark.parametrize("classes", [(), (2,), (2, 9), (7,), (18,)])
@pytest.mark.parametrize("suffix, form, scale, offset", CLOUDS)
def test_clouds(suffix: str, form: int, scale: float, offset: float, classes: tuple[int, ...], tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    cloud(path, form, scale, offset)
    las = laspy.read(path)
    kind, withheld = np.asarray(las.classification), np.asarray(las.withheld) != 0
    noise = (kind == 7) | ((kind == 18) & (form >= 6))
    kept = ~withheld & (np.isin(kind, classes) if classes else ~noise)
    if not kept.any():
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mesh = isocodec.read(path, classes=classes)
    said = " ".join(str(one.message) for one in caught)
    assert f"{int(withheld.sum())} withheld" in said
    assert (f"{int((noise & ~withheld).sum())} points of noise" in said) == (not classes)
    assert np.array_equal(mesh.points, np.stack([las.x, las.y], axis=1)[kept])
    assert np.array_equal(mesh.values, np.asarray(las.z)[kept])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in () if classes else ("depth", "intensity", "classification"):
            found = isocodec.read(path, classes=classes, key=name).values
            assert np.array_equal(found, np.asarray(las[name])[kept]), name


@pytest.mark.parametrize(
    "form, system", [*product([3, 6], [None, "EPSG:32631", "EPSG:2193"]), (6, "EPSG:32631+5773")]
)
def test_reference_systems_of_clouds(form: int, system: str | None, tmp_path: Path) -> None:
    path = tmp_path / "a.las"
    header = laspy.LasHeader(point_format=form, version="1.4")
    if system:
        header.add_crs(pyproj.CRS(system))
    las = laspy.LasData(header)
    las.x, las.y, las.z = RNG.random((3, COUNT))
    las.write(path)
    found = isocodec.read(path).crs
    assert (found is None) == (system is None)
    assert system is None or pyproj.CRS(found).equals(pyproj.CRS(system))


def test_headers_are_held_against_the_file(tmp_path: Path) -> None:
    """Counts that a file of its size cannot have: records before and behind the points, and points."""
    path = tmp_path / "a.las"
    for form in (3, 6):
        cloud(path, form)
        whole = path.read_bytes()
        edits = [("<I", 100, 0xFFFFFFFF), ("<I", 100, 10**6), ("<I", 96, 10**9), ("<I", 107, 10**7),
                 ("<H", 105, 0xFFFF)]
        if form == 6:
            edits = [*edits[:3], ("<I", 243, 10**9), ("<Q", 247, 10**15), ("<Q", 235, 10**15)]
        for kind, at, number in edits:
            data = bytearray(whole)
            struct.pack_into(kind, data, at, number)
            if at == 235:
                struct.pack_into("<I", data, 243, 1)
            path.write_bytes(data)
            with pytest.raises((InputError, LimitError)):
                read_mesh(path)
        for size in (0, 4, 100, 300, len(whole) - 1):
            path.write_bytes(whole[:size])
            with pytest.raises(InputError):
                read_mesh(path)


def test_classes_on_the_command_line(tmp_path: Path) -> None:
    cloud(tmp_path / "a.las", 6)
    options = ("--values", "z", "--isovalue", 25.5, "-o", tmp_path / "a.iso")
    found = run("encode", tmp_path / "a.las", *options)
    assert "withheld" in found.stderr and "--classes" in found.stderr
    ok("encode", tmp_path / "a.las", "--classes", "2,9", *options)
    np.savetxt(tmp_path / "a.csv", np.column_stack([PLACES, PLACES[:, 0]]), delimiter=",")
    assert "classes" in fails(2, "encode", tmp_path / "a.csv", "--classes", 2, *options)
    with pytest.raises(OptionError):
        isocodec.read(np.eye(3), classes=(2,))


@pytest.mark.parametrize("digits", [None, 2, 1])
@pytest.mark.parametrize("angle", [0, 12, 25, 30, 45, 77])
def test_turned_grids(angle: float, digits: int | None) -> None:
    """One ring of the right length, whatever way the grid is turned and its places are rounded."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-2, 2, 40), np.linspace(-2, 2, 40)))
    turn = np.radians(angle)
    points = np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)], axis=1)
    size = 1.0
    if digits is not None:
        points, size = (1000 * points + [500000, 4600000]).round(digits), 1000.0
    file = isocodec.open(isocodec.encode(Mesh(points, None, np.exp(-(x**2) - y**2)), 0.5))
    contour = file.contour()
    length = np.linalg.norm(np.diff(contour.points[contour.cells], axis=1), axis=2).sum() / size
    assert len(contour.lines) == 1 and np.isclose(length, 2 * np.pi * np.sqrt(np.log(2)), rtol=0.01)


def test_points_without_a_value(tmp_path: Path) -> None:
    values = PLACES[:, 0].copy()
    values[[3, 10]] = np.nan
    there = ~np.isnan(values)
    with pytest.warns(UserWarning, match="2 points without a value"):
        data = isocodec.encode(Mesh(PLACES, None, values), 50.0)
    assert data == isocodec.encode(Mesh(PLACES[there], None, values[there]), 50.0)
    assert isocodec.open(data).verify(Mesh(PLACES, None, values))[0].there < 2
    rows = [f"{x},{y},{'' if np.isnan(z) else z}" for (x, y), z in zip(PLACES, values, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["x,y,z", *rows]))
    found = run("encode", tmp_path / "a.csv", "--values", "z", "--isovalue", 50, "-o", tmp_path / "a.iso")
    assert found.exit_code == 0 and "2 points without a value" in found.stderr
    frames = np.stack([values, PLACES[:, 1]])
    with pytest.warns(UserWarning, match="2 points without a value"):
        assert isocodec.open(isocodec.encode(Mesh(PLACES, None, frames), 50.0)).frames == 2


def test_vertices_that_no_cell_has() -> None:
    """A value may be missing there, and nowhere else."""
    points = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [9, 9.0]])
    cells = np.array([[0, 1, 2], [1, 3, 2]])
    values = np.array([0, 1, 1, 2, np.nan])
    for stored in ("known", "coded", "whole"):
        mesh = Mesh(points, cells, values, stored=stored)
        file = isocodec.open(isocodec.encode(mesh, 0.5), mesh=(points, cells) if stored == "known" else None)
        assert len(file.contour().cells) == 1 and file.verify(mesh, within=0.05)[0].kept
    with pytest.raises(InputError, match="missing"):
        isocodec.encode(Mesh(points, cells, values[::-1]), 0.5)


def test_not_fields() -> None:
    for thing in (object(), "text", None):
        with pytest.raises((InputError, OSError)):
            isocodec.read(thing)
    with pytest.raises(InputError, match=r"isocodec\.read"):
        isocodec.encode("field.npy", 9.5)
