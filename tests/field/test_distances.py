"""Distances with a unit: by every option that takes one, on every kind of placement, measured on the ellipsoid."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import isocodec
from commands import HILLS, fails, ok
from isocodec.errors import OptionError
from isocodec.field.placement import Placement
from isocodec.field.samples import check_field
from isocodec.field.units import METRES, converted, distance_of
from isocodec.search.original import original
from libraries import Late
from tables import looped

pyproj = Late("pyproj")
gaussian_filter = Late("scipy.ndimage.gaussian_filter")
cKDTree = Late("scipy.spatial.cKDTree")

I, J = np.meshgrid(np.arange(60.0), np.arange(70.0), indexing="ij")
DEGREES = 4 / 3600
PLACES = {
    "degrees": (Placement([[0, DEGREES, 10], [-DEGREES, 0, 60]], crs="EPSG:4326"), "EPSG:4326"),
    "degrees over the equator": (Placement([[0, 0.5, -20], [-0.5, 0, 12]], crs="EPSG:4326"), "EPSG:4326"),
    "metres": (Placement([[0, 30, 5e5], [-30, 0, 5e6]], crs="EPSG:32631"), "EPSG:32631"),
    "feet": (Placement([[0, 40, 9.8e5], [-40, 0, 2e5]], crs="EPSG:2263"), "EPSG:2263"),
    "WKT": (Placement([[0, 30, 5e5], [-30, 0, 5e6]], crs=pyproj.CRS(32631).to_wkt()), "EPSG:32631"),
    "stretched": (Placement([[0, 30, 5e5], [-30, 0, 8e6]], crs="EPSG:3857"), "EPSG:3857"),
    "equal area": (Placement([[0, 30, 5.2e6], [-30, 0, 4e6]], crs="EPSG:3035"), "EPSG:3035"),
    "rotated": (Placement([[4, 3, 5e5], [-3, 4, 4e6]], crs="EPSG:32633"), "EPSG:32633"),
    "sheared": (Placement([[4, 3, 5e5], [-1, 5, 4e6]], crs="EPSG:32633"), "EPSG:32633"),
    "mapped": (
        Placement(coordinates=[10 + 2e-4 * J + 2e-5 * I + 1e-7 * J * I, 45 + 1.5e-4 * I - 3e-5 * J], unit="degrees"),
        "EPSG:4326",
    ),
    "axes": (
        Placement(coordinates=[np.cumsum(np.linspace(20, 30, 60)), np.cumsum(np.linspace(25, 30, 70))],
                  crs="EPSG:32631"),
        "EPSG:32631",
    ),
}
"""Placements of 60 x 70 samples, and the system of their coordinates."""


@cache
def rough() -> NDArray[np.float64]:
    """Terrain whose curve uses up every tolerance somewhere."""
    even, noise = (np.random.default_rng(seed).normal(size=(60, 70)) for seed in (3, 4))
    return np.asarray(gaussian_filter(even, 3) * 100 + noise)


@cache
def to_space() -> Any:
    return pyproj.Transformer.from_crs("EPSG:4326", "EPSG:4978", always_xy=True)


@cache
def geod() -> Any:
    return pyproj.Geod(ellps="WGS84")


def degrees(points: NDArray[Any], crs: str) -> NDArray[np.float64]:
    to = pyproj.Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    return np.stack(to.transform(*points.T), axis=1)


def geodesic(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Largest distance of a point of a from b in metres, of points in degrees."""
    one, other = (np.stack(to_space().transform(*each.T, np.zeros(len(each))), axis=1) for each in (a, b))
    near = cKDTree(other).query(one, 8)[1]
    return float(np.min([geod().inv(*a.T, *b[near[:, k]].T)[2] for k in range(8)], axis=0).max())


def dense(contour: isocodec.Contour, placement: Placement, crs: str) -> NDArray[np.float64]:
    along = np.linspace(0, 1, 40)[:, None, None]
    points = along * contour.points[contour.cells[:, 0]] + (1 - along) * contour.points[contour.cells[:, 1]]
    return degrees(placement.place(points.reshape(-1, 2)), crs)


@pytest.mark.cover(1)
@pytest.mark.parametrize("name", PLACES)
@pytest.mark.parametrize("text", ["2%", "20%"])
def test_tolerances_are_kept_on_the_ellipsoid_and_used(name: str, text: str) -> None:
    """A tolerance of this share of a cell's longest side, by both curves where their files and fields place them."""
    placement, crs = PLACES[name]
    if text == "2%":
        text = {"degrees over the equator": "1km", "degrees": "1m"}.get(name, "1m")
    else:
        text = {"degrees over the equator": "11km"}.get(name, "3m")
    file = isocodec.open(isocodec.encode(isocodec.Field(rough(), placement=placement), 0.0, precision=text))
    contour = file.contour()
    assert contour.placement is not None
    ours, theirs = dense(contour, contour.placement, crs), dense(original(check_field(rough(), 0.0)), placement, crs)
    number, unit = distance_of(text)
    share = max(geodesic(ours, theirs), geodesic(theirs, ours)) / (number * METRES[unit])
    assert 0.8 <= share <= 1.0
    assert file.promise is not None and file.promise.startswith(f"within {text} (")


@pytest.mark.cover(1)
@pytest.mark.parametrize("name", PLACES)
@pytest.mark.parametrize("text", ["1m", "3ft", "3us-ft", "0.02km"])
def test_cells_are_those_of_the_longest_step(name: str, text: str) -> None:
    """Against geodesics along eight directions within every cell."""
    placement, crs = PLACES[name]
    shape = (60, 70)
    corner = np.stack([I[:-1, :-1].ravel(), J[:-1, :-1].ravel()], axis=1)
    longest = 0.0
    for turn in np.linspace(0, np.pi, 12, endpoint=False):
        step = 0.4 * np.array([np.cos(turn), np.sin(turn)])
        a, b = (degrees(placement.place(corner + 0.5 + sign * step), crs) for sign in (1, -1))
        longest = max(longest, float((geod().inv(*a.T, *b.T)[2] / 0.8).max()))
    number, unit = distance_of(text)
    cells = placement.cells_of(text, shape)
    assert cells <= number * METRES[unit] / longest * (1 + 1e-6)
    assert cells >= number * METRES[unit] / longest * 0.96


UNITS = [
    ("0.2mm", 0.2), ("200um", 0.2), ("200\u00b5m", 0.2), ("0.02cm", 0.2), ("0.0002m", 0.2), ("2e-7km", 0.2),
    (" 0.2 mm ", 0.2), ("1in", 25.4), ("0.01ft", 3.048), ("0.2 millimeters", 0.2), ("0.5", None),
]


@looped(("text", "millimetres"), UNITS)
@looped(("unit", "size"), [("mm", 1.0), ("micron", 1e-3), ("meter", 1e3), ("cm", 10.0), (None, None)])
def test_every_unit_of_a_distance_and_of_coordinates(
    text: str, millimetres: float | None, unit: str | None, size: float | None
) -> None:
    placement = Placement(np.diag([1.1, 0.8, 2.0, 1.0])[:3], unit=unit)
    if millimetres is None:
        assert placement.cells_of(text, (9, 9, 9)) == 0.5
    elif size is None:
        with pytest.raises(OptionError, match="needs the unit of the coordinates, which is unknown"):
            placement.cells_of(text, (9, 9, 9))
    else:
        assert placement.cells_of(text, (9, 9, 9)) == pytest.approx(millimetres / size / 2, rel=1e-11)


@looped(
    "text", ["15banana", "0.2foo", "1mmm", "1M", "1Mm", "1 m m", "nanm", "0m", "-1m", "infm", "m", "", "1m2"]
)
def test_what_is_no_distance(text: str) -> None:
    with pytest.raises(OptionError) as caught:
        isocodec.encode(isocodec.Field(HILLS, placement=Placement((1, 1), unit="m")), 80.5, precision=text)
    if "banana" in text:
        assert all(unit in str(caught.value) for unit in ("um", "mm", "us-ft", "deg"))


@looped("name", PLACES)
def test_degrees_are_for_degrees(name: str) -> None:
    placement, crs = PLACES[name]
    if crs != "EPSG:4326":
        with pytest.raises(OptionError, match="needs a field of longitudes and latitudes"):
            placement.cells_of("0.001deg", (60, 70))
    elif placement.matrix is not None:
        assert placement.cells_of("0.001deg", (60, 70)) == pytest.approx(0.001 / placement.matrix[0, 1])


def test_the_ellipsoid_of_the_system_counts() -> None:
    """Degrees on the sphere of the Moon are 30 km."""
    moon = Placement([[0, 0.1, 0], [-0.1, 0, 2]], crs="IAU_2015:30100")
    earth = Placement([[0, 0.1, 0], [-0.1, 0, 2]], crs="EPSG:4326")
    assert earth.cells_of("1km", (9, 9)) / moon.cells_of("1km", (9, 9)) == pytest.approx(1737.4 / 6378.137, rel=1e-3)


def test_missing_cells_and_seams_count_as_they_are() -> None:
    """The longest step lies among missing samples, or where a periodic axis closes."""
    x = np.array([0.0, 1, 2, 3, 13])
    field = np.add.outer(np.arange(6.0), np.arange(5.0))
    placement = Placement(coordinates=[np.arange(6.0), x], unit="m")
    gone = np.zeros((6, 5), np.bool_)
    assert placement.cells_of("1m", field.shape, gone) == pytest.approx(0.1)
    gone[:, 4] = True
    assert placement.cells_of("1m", field.shape, gone) == pytest.approx(1.0)
    around = Placement(coordinates=[np.array([0.0, 1]), np.array([0.0, 90, 180])], periodic=1, periods=360)
    assert around.cells_of("1000km", (2, 3)) == pytest.approx(1000 / (180 * 111.694), rel=1e-3)


# -- every option ------------------------------------------------------------------------------------------------------

PLACED = isocodec.Field(HILLS, placement=Placement([[0, 2, 0], [-2, 0, 0]], unit="m"), unit="m")
OPTIONS = {
    "precision": lambda field, text, _: isocodec.encode(field, 80.5, precision=text),
    "steps": lambda field, text, _: isocodec.encode(field, 80.5, precision=["4", text]),
    "series": lambda field, text, _: isocodec.encode(isocodec.Frames([field, field]), 80.5, precision=text),
    "tile": lambda field, text, path: isocodec.save(path, field, 80.5, tile=32, precision=text),
    "thin": lambda field, text, _: isocodec.thin(field, contours=[80.5], tolerance=text),
    "verify": lambda field, text, _: isocodec.open(isocodec.encode(field, 80.5)).verify(field, within=text),
    "edit": lambda field, text, _: exact(field).edited(precision=text),
    "mesh": lambda field, text, _: isocodec.encode(mesh_of(field), 80.5, precision=text),
    "mesh in the file": lambda field, text, _: isocodec.encode(mesh_of(field, "whole"), 80.5, precision=text),
    "points": lambda field, text, _: isocodec.encode(mesh_of(field, "delaunay"), 80.5, precision=text),
}


def exact(field: isocodec.Field) -> isocodec.IsoFile:
    return isocodec.open(isocodec.encode(field, 80.5, precision="exact"))


def mesh_of(field: isocodec.Field, stored: Any = None) -> isocodec.Mesh:
    from scipy.spatial import Delaunay

    where = np.random.default_rng(2).permutation(HILLS.size)[:300]
    points = np.stack(np.unravel_index(where, HILLS.shape), axis=1) + np.random.default_rng(1).uniform(0, 0.3, (300, 2))
    cells = None if stored == "delaunay" else Delaunay(points).simplices
    unit = None if field.placement is None else field.placement.unit
    return isocodec.Mesh(points, cells, HILLS.ravel()[where].astype(float), stored=stored, unit=unit)


@pytest.mark.parametrize("option", OPTIONS)
@pytest.mark.parametrize(
    ("text", "good"), [("100cm", True), ("0.5", True), ("0.1deg", False)]
)
def test_options_take_distances_with_units(option: str, text: str, good: bool, tmp_path: Path) -> None:
    run = OPTIONS[option]
    if good:
        run(PLACED, text, tmp_path / "a.iso")
        if text == "100cm":
            with pytest.raises(OptionError):  # nobody knows what a cell is
                run(isocodec.Field(HILLS), text, tmp_path / "b.iso")
            with pytest.raises(OptionError):
                run(isocodec.Field(HILLS, placement=(1, 1)), text, tmp_path / "b.iso")
        return
    with pytest.raises(OptionError):
        run(PLACED, text, tmp_path / "a.iso")


def test_the_command_line(tmp_path: Path, hills: Path) -> None:
    path = tmp_path / "a.iso"
    unit = ("--spacing", "2,2", "--metadata", "coordinate_unit=mm")
    ok("encode", hills, "-o", path, "--isovalue", 80.5, "--precision", "8mm,1000um", *unit)
    assert "within 8mm (4 cells), 1000um (0.5 cells)" in ok("info", path)
    assert "kept; promised within 1000um (0.5 cells): 0." in ok("verify", path, hills)
    assert "um) file to field" in ok("verify", path, hills)
    where = ("--metadata", "coordinate_unit=mm", "--metadata", "placement=0 2 0 -2 0 0")
    ok("encode", hills, "-o", path, "--isovalue", 80.5, "--precision", "1mm", "--tile", 32, *where)
    assert "kept; promised within 1mm (0.5 cells)" in ok("verify", path, hills)
    ok("encode", hills, "-o", path, "--isovalue", 80.5)
    assert "no promise; measured 0.0" in ok("verify", path, hills)
    for text, why in (("1mm", "placement"), ("15banana", "one of m, km")):
        assert why in fails(2, "encode", hills, "-o", path, "--isovalue", 80.5, "--precision", text)
        assert why in fails(2, "verify", path, hills, "--within", text)
        assert why in fails(2, "thin", hills, "-o", path, "--isovalue", 80.5, "--tolerance", text)


# -- what readers know -------------------------------------------------------------------------------------------------


@pytest.mark.cover(2)
@pytest.mark.parametrize("south", [False, True])
@pytest.mark.parametrize("falling", [False, True])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("how", ["matrix", "axes", "arrays", "around"])
@pytest.mark.parametrize("low", [0.0, 1.5, 31.0, -12.0, -14.0])
def test_a_degree_of_longitude_is_the_longest_nearest_to_the_equator(
    how: str, axis: int, falling: bool, south: bool, low: float
) -> None:
    """On which side of it, in which direction latitudes run and along which axis changes nothing."""
    latitudes = low + 4.0 * np.arange(8)
    latitudes = (-latitudes if south else latitudes)[:: -1 if falling else 1]
    longitudes = -100 + 36.0 * np.arange(10)
    shape = (10, 8) if axis else (8, 10)
    if how == "matrix":
        row = np.array([latitudes[1] - latitudes[0], 36.0])
        steps = [[0, row[1]], [row[0], 0]] if axis == 0 else [[row[1], 0], [0, row[0]]]
        placement = Placement(np.column_stack([steps, [longitudes[0], latitudes[0]]]), crs="EPSG:4326")
    else:
        x, y = np.meshgrid(longitudes, latitudes, indexing="ij" if axis else "xy")
        turning: dict[str, Any] = {"periodic": 1 - axis, "periods": (360.0, 0.0)} if how == "around" else {}
        if how == "axes":
            x, y = (x[:, :1], y[:1]) if axis else (x[:1], y[:, :1])
        placement = Placement(coordinates=[x, y], crs="EPSG:4326", **turning)
    nearest = 0.0 if low < 0 else low
    radius = 6378.137 / np.sqrt(1 - 0.00669437999014 * np.sin(np.radians(nearest)) ** 2)
    widest = radius * np.cos(np.radians(nearest)) * np.radians(36)
    assert placement.cells_of("100km", shape) == pytest.approx(100 / widest, rel=1e-6)


@looped("given", METRES)
@looped("unit", METRES)
def test_lengths_in_other_units(given: str, unit: str) -> None:
    """How many of one unit a length of another is, both ways."""
    assert converted(f"3{given}", unit, "the points") == pytest.approx(3 * METRES[given] / METRES[unit], rel=1e-12)
    there = converted(f"1{given}", unit, "the points") * converted(f"1{unit}", given, "the points")
    assert there == pytest.approx(1, rel=1e-12)
    assert (converted("1km", "m", "the points"), converted("5mm", "cm", "the points")) == (1000, pytest.approx(0.5))
