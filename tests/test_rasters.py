"""Rasters, held against rasterio (GDAL): every attribute in every format, windows, places, hostile files."""

from __future__ import annotations

import http.server
import pickle
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import rasterio
import rasterio.shutil
import tifffile
from PIL import Image, ImageOps
from rasterio.enums import ColorInterp
from rasterio.windows import from_bounds

import isocodec
from commands import fails, ok, run
from inputs import raster, read_place
from isocodec.errors import InputError, OptionError
from isocodec.field.placement import Placement
from isocodec.io.readers.input_formats import open_file
from isocodec.io.readers.opened import Choice

HEIGHTS = np.rint(100 - 3 * np.hypot(*(np.mgrid[:13, :17] - np.array([5.3, 8.2])[:, None, None])))
GONE = np.zeros(HEIGHTS.shape, np.bool_)
GONE[:, :3] = GONE[7, 9] = True
UTM = rasterio.Affine(30, 0, 5e5, 0, -30, 4.6e6)
SQUARES: dict[str, Any] = {"crs": "EPSG:32631", "transform": UTM}
ALBERS = pyproj.CRS.from_proj4("+proj=aea +lat_0=3 +lon_0=11 +lat_1=20 +lat_2=40 +x_0=7 +datum=WGS84 +units=m")
FORMATS = {
    "GTiff": ".tif", "COG": ".tif", "VRT": ".vrt", "AAIGrid": ".asc", "HFA": ".img", "ENVI": ".img", "EHdr": ".bil",
    "SAGA": ".sdat", "RST": ".rst", "BT": ".bt", "GS7BG": ".grd", "GPKG": ".gpkg", "JP2OpenJPEG": ".jp2",
}
"""Suffixes of formats by the drivers that write them."""


def masked(file: Any) -> None:
    file.write_mask(~GONE)


def alpha(file: Any) -> None:
    file.write(np.where(GONE, 0, 255).astype(file.dtypes[1]), 2)
    file.colorinterp = [ColorInterp.gray, ColorInterp.alpha]


def scaled(file: Any) -> None:
    file.scales, file.offsets = (0.1,) * file.count, (-20.0,) * file.count


def named(file: Any) -> None:
    file.descriptions, file.units = ("height",), ("m",)


def overviews(file: Any) -> None:
    file.build_overviews([2])


def of_points(file: Any) -> None:
    file.update_tags(AREA_OR_POINT="Point")


TYPES = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64")
ATTRIBUTES: dict[str, tuple[dict[str, Any], Callable[[Any], None] | None]] = {
    **{name: ({"dtype": name}, None) for name in TYPES},
    "nodata": ({"nodata": 80}, None),
    "nodata of floats": ({"dtype": "float32", "nodata": -3.4028234663852886e38}, None),
    "nodata is NaN": ({"dtype": "float32", "nodata": np.nan}, None),
    "nodata that is not there": ({"dtype": "uint8", "nodata": 200}, None),
    "mask": ({}, masked),
    "alpha": ({"count": 2, "dtype": "uint8"}, alpha),
    "alpha of 16 bits": ({"count": 2, "dtype": "uint16"}, alpha),
    "alpha with a sign": ({"count": 2, "dtype": "int16"}, alpha),
    "alpha of floats": ({"count": 2, "dtype": "float32"}, alpha),
    "alpha and nodata": ({"count": 2, "dtype": "int16", "nodata": 80}, alpha),
    "scale": ({"dtype": "uint16"}, scaled),
    "scale and nodata": ({"nodata": 80}, scaled),
    "scale and mask": ({}, lambda file: (scaled(file), masked(file))),
    "name and unit": ({}, named),
    "overviews": ({"width": 17}, overviews),
    "points": ({}, of_points),
    "no place": ({"crs": None, "transform": None}, None),
    "rotated": ({"transform": rasterio.Affine(30, 5, 5e5, 7, -30, 4.6e6)}, None),
    "south up": ({"transform": rasterio.Affine(30, 0, 5e5, 0, 30, 4.6e6)}, None),
    "degrees": ({"crs": "EPSG:4326", "transform": rasterio.Affine(0.01, 0, 5, 0, -0.01, 50)}, None),
    "system without a number": ({"crs": ALBERS.to_wkt()}, None),
    "compound system": ({"crs": "EPSG:32631+5773"}, None),
    "system of ESRI": ({"crs": "ESRI:54009"}, None),
    "system in space": ({"crs": "EPSG:4979", "transform": rasterio.Affine(0.01, 0, 5, 0, -0.01, 50)}, None),
    "bound system": ({"crs": "+proj=tmerc +lon_0=3 +ellps=bessel +towgs84=598,73,418,0.2,0.04,-2.4,6.7"}, None),
}


def written(path: Path, driver: str, attribute: str) -> Path | None:
    """A raster with an attribute as a format keeps it; None if it cannot be written."""
    options, more = ATTRIBUTES[attribute]
    source = path.with_name("source.tif")
    profile = {"driver": "GTiff", "height": 13, "width": 17, "count": 1, "dtype": "int16", **SQUARES, **options}
    # inside of the file: GDAL would write a mask beside it
    with warnings.catch_warnings(action="ignore"), rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True):
        with rasterio.open(source, "w", **profile) as file:
            field = np.where(GONE, 80, HEIGHTS)
            if "float" in str(profile["dtype"]) and profile.get("nodata") is not None:
                field = np.where(GONE, profile["nodata"], HEIGHTS)
            file.write(field.astype(profile["dtype"]), 1)
            if more is not None:
                more(file)
        try:
            rasterio.shutil.copy(source, path, driver=driver)
            rasterio.open(path).close()  # a GeoPackage without a place holds nothing
        except (rasterio.errors.RasterioError, rasterio._err.CPLE_BaseError, TypeError, SystemError):
            return None
    return path


@pytest.mark.parametrize("attribute", ATTRIBUTES)
@pytest.mark.parametrize("driver", FORMATS)
def test_what_rasterio_has(tmp_path: Path, driver: str, attribute: str) -> None:
    """Values, missing samples, place, reference system, name and unit, whole and by windows."""
    path = written(tmp_path / f"a{FORMATS[driver]}", driver, attribute)
    if path is None:
        pytest.skip("cannot be written")
    with warnings.catch_warnings(action="ignore"), rasterio.open(path) as file:
        count = sum(each != ColorInterp.alpha for each in file.colorinterp)
        band = file.read(1, masked=True)
        for number, colour in zip(file.indexes, file.colorinterp, strict=True):
            if colour == ColorInterp.alpha and number > 1:  # GDAL masks by alpha of some types alone
                band = np.ma.masked_where(file.read(number) == 0, band)
        expected = band * file.scales[0] + file.offsets[0] if (file.scales[0], file.offsets[0]) != (1, 0) else band
        unplaced, system = file.transform.is_identity, file.crs
        corners = np.stack(rasterio.transform.xy(file.transform, [0, 12, 5], [0, 16, 2]), axis=1)
        about = (file.descriptions[0], file.units[0])
    if count > 1:
        with pytest.raises(InputError, match=r"holds \d bands: 1 \(.*choose one with --band"):
            isocodec.read(path)
    field: Any = isocodec.read(path, band=1) if count > 1 else isocodec.read(path)
    gone = np.zeros(field.shape, np.bool_) if field.mask is None else field.mask
    nan = np.isnan(field.values) if field.values.dtype.kind == "f" else False
    wanted = np.ma.getmaskarray(expected) | (np.isnan(expected.data) if np.any(nan) else False)
    assert np.array_equal(gone | nan, wanted)
    assert np.array_equal(np.where(gone | nan, 0, field.values), np.where(gone | nan, 0, expected.data))
    assert field.values.dtype == expected.dtype and (field.name, field.unit) == about
    if unplaced:
        assert field.placement is None
    else:
        placed = field.placement.place(np.array([[0.0, 0], [12, 16], [5, 2]]))
        assert np.allclose(placed, corners, rtol=1e-12, atol=0)
        elsewhere = system is not None and system.to_wkt().startswith("LOCAL_CS")
        assert elsewhere or (field.crs is None) == (system is None)
        if not (elsewhere or field.crs is None or field.crs.startswith("ENG")):
            ours, theirs = (
                np.array(pyproj.Transformer.from_crs(each, 4326, always_xy=True).transform(*corners.T))
                for each in (field.crs, system.to_wkt(version="WKT2_2019"))
            )
            assert np.allclose(ours, theirs, rtol=0, atol=1e-9)
    with open_file(path, Choice(channel=0)) as opened:
        windows = pickle.loads(pickle.dumps(opened.windows()))  # as another process has them
        part = windows[3:9, 2:17]
        assert np.array_equal(part.filled(0), np.ma.masked_array(field.values, gone)[3:9, 2:17].filled(0))


@pytest.mark.parametrize("bits", [1, 2, 4, 8, 16])
def test_white_may_be_zero(tmp_path: Path, bits: int) -> None:
    """Samples are those of the file, as GDAL has them."""
    profile = {"driver": "GTiff", "width": 9, "height": 7, "count": 1, "dtype": "uint16" if bits == 16 else "uint8"}
    samples = (np.arange(63).reshape(7, 9) % (1 << bits)).astype(profile["dtype"])
    with rasterio.open(tmp_path / "a.tif", "w", photometric="MINISWHITE", nbits=bits, **profile) as file:
        file.write(samples, 1)
    assert np.array_equal(isocodec.read(tmp_path / "a.tif").values, samples)


def test_systems_are_numbers_where_these_say_all(tmp_path: Path) -> None:
    found = {}
    for attribute in ("system without a number", "compound system", "system of ESRI", "system in space", "bound system",
                      "degrees", "int16"):
        path = written(tmp_path / "a.tif", "GTiff", attribute)
        assert path is not None
        found[attribute] = read_place(path, 2).crs or ""
    assert [found[name] for name in ("int16", "degrees", "system in space")] == ["EPSG:32631", "EPSG:4326", "EPSG:4979"]
    starts = {"system without a number": "PROJCRS", "compound system": "COMPOUNDCRS", "system of ESRI": "PROJCRS",
              "bound system": "BOUNDCRS"}
    assert {name: found[name].partition("[")[0] for name in starts} == starts


@pytest.mark.parametrize("name", ["system without a number", "compound system", "system of ESRI", "bound system"])
def test_systems_without_a_number_go_all_the_way(tmp_path: Path, name: str) -> None:
    """Into the file as WKT, out of it into GeoPackages, and to longitude and latitude."""
    import geopandas

    path = written(tmp_path / "a.tif", "GTiff", name)
    ok("encode", path, "-o", tmp_path / "a.iso", "--isovalue", 90.5)
    file = isocodec.open(tmp_path / "a.iso")
    assert file.crs == read_place(tmp_path / "a.tif", 2).crs
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.gpkg")
    table = geopandas.read_file(tmp_path / "a.gpkg")
    ours = pyproj.CRS.from_user_input(file.crs)
    assert table.crs is not None and (table.crs == ours or table.crs.to_wkt() == ours.to_wkt() or ours.is_compound)
    transformer = pyproj.Transformer.from_crs(ours, 4326, always_xy=True)
    line = file.contour().placed[file.contour().walks[0]]
    degrees = np.stack(transformer.transform(*line.T), axis=1)
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.geojson")
    assert np.allclose(np.array(geopandas.read_file(tmp_path / "a.geojson").geometry[0].geoms[0].coords), degrees)
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "b.geojson", "--keep-crs")
    kept = geopandas.read_file(tmp_path / "b.geojson")
    assert kept.crs == table.crs and np.allclose(np.array(kept.geometry[0].geoms[0].coords), line)


@pytest.mark.parametrize("nodata", [80.0, float("nan"), 97.0])
@pytest.mark.parametrize("attribute", ["int16", "nodata", "mask", "scale and nodata", "alpha"])
def test_nodata_by_choice(tmp_path: Path, attribute: str, nodata: float) -> None:
    """It takes the place of what the file states as such, as stored; masks and alpha remain."""
    path = written(tmp_path / "a.tif", "GTiff", attribute)
    assert path is not None
    field: Any = isocodec.read(path, nodata=nodata)
    with rasterio.open(path) as file:
        raw = file.read(1)
    expected = raw == nodata
    if attribute in ("mask", "alpha"):
        expected |= GONE
    assert np.array_equal(field.mask if field.mask is not None else np.zeros_like(GONE), expected)
    with open_file(path) as opened:
        assert np.array_equal(np.ma.getmaskarray(opened.windows(nodata)[2:9, 1:8]), expected[2:9, 1:8])


def bands(folder: Path) -> Path:
    with rasterio.open(
        folder / "b.tif", "w", driver="GTiff", height=13, width=17, count=4, dtype="int16", **SQUARES
    ) as file:
        for number in range(1, 5):
            file.write((HEIGHTS * number).astype("int16"), number)
        file.descriptions = ("B02", "B03", None, None)
        file.colorinterp = [ColorInterp.blue, ColorInterp.green, ColorInterp.undefined, ColorInterp.alpha]
        file.scales, file.offsets = (1, 0.5, 1, 1), (0, 3, 0, 0)
    return folder / "b.tif"


def test_bands(tmp_path: Path) -> None:
    """Counted from 1, each with its own scale; the error lists them."""
    path = bands(tmp_path)
    line = fails(3, "encode", path, "-o", tmp_path / "a.iso", "--isovalue", 90.5)
    assert "holds 4 bands: 1 (B02, blue, int16), 2 (B03, green, int16), 3 (undefined, int16), 4 (alpha" in line
    assert line.endswith("choose one with --band")
    for number, expected in ((1, HEIGHTS), (2, HEIGHTS * 2 * 0.5 + 3), (3, HEIGHTS * 3), (4, HEIGHTS * 4)):
        field: Any = isocodec.read(path, band=number)
        assert np.array_equal(field.values, expected) and field.values.dtype == (float if number == 2 else "int16")
        assert np.array_equal(isocodec.read(path, channel=number - 1).values, expected)
    ok("encode", path, "--band", 2, "-o", tmp_path / "a.iso", "--isovalue", 90.5)
    ok("verify", "--band", 2, tmp_path / "a.iso", path)
    for wrong, reason in ((["--band", 5], "there is no band 5"), (["--band", 1, "--channel", 0], "give one of them")):
        assert reason in fails(2, "encode", path, "-o", tmp_path / "x.iso", "--isovalue", 1, *wrong)
    Image.fromarray(np.dstack([HEIGHTS, HEIGHTS + 1, HEIGHTS + 2]).astype("u1")).save(tmp_path / "c.png")
    assert np.array_equal(isocodec.read(tmp_path / "c.png", band=3).values, HEIGHTS + 2)


def test_palettes_and_complex_numbers(tmp_path: Path) -> None:
    with rasterio.open(tmp_path / "p.tif", "w", driver="GTiff", height=13, width=17, count=1, dtype="uint8") as file:
        file.write(HEIGHTS.astype("u1"), 1)
        file.write_colormap(1, {number: (number, 0, 0, 255) for number in range(256)})
    with pytest.raises(InputError, match=r"palette.*--label"):
        isocodec.read(tmp_path / "p.tif")
    assert np.array_equal(isocodec.read(tmp_path / "p.tif", band=1).values, HEIGHTS)
    for kind in ("complex64", "complex128", "complex_int16"):
        with rasterio.open(tmp_path / "c.tif", "w", driver="GTiff", height=13, width=17, count=1, dtype=kind) as file:
            file.write(HEIGHTS.astype("complex64"), 1)
        with pytest.raises(InputError, match=rf"complex numbers \({kind}\)"):
            isocodec.read(tmp_path / "c.tif")


BOXES = {
    "whole": (5e5, 4.6e6 - 390, 5e5 + 510, 4.6e6), "pixels": (500090, 4599700, 500300, 4599940),
    "beyond": (0, 4599800, 500200, 1e7), "one": (500100, 4599850, 500110, 4599860),
}


@pytest.mark.parametrize("box", [box for box in BOXES if box != "one"])
@pytest.mark.parametrize("attribute", ["int16", "mask", "scale and nodata", "alpha", "south up"])
def test_boxes(tmp_path: Path, attribute: str, box: str) -> None:
    """The pixels whose middle is in it, as rasterio's windows; encoded and in tiles like the whole."""
    path = written(tmp_path / "a.tif", "GTiff", attribute)
    assert path is not None
    whole: Any = isocodec.read(path)
    index = np.stack(np.meshgrid(*map(np.arange, whole.shape), indexing="ij"), axis=-1).reshape(-1, 2).astype(float)
    x, y = whole.placement.place(index).T.reshape(2, *whole.shape)
    low_x, low_y, high_x, high_y = BOXES[box]
    inside = (low_x <= x) & (x <= high_x) & (low_y <= y) & (y <= high_y)
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    if not len(rows):
        with pytest.raises(OptionError, match="no samples"):
            isocodec.read(path, bbox=BOXES[box])
        return
    part: Any = isocodec.read(path, bbox=BOXES[box])
    spans = np.ix_(rows, columns)
    assert np.array_equal(part.values, whole.values[spans])
    if whole.mask is not None:
        assert np.array_equal(part.mask, whole.mask[spans])
    assert np.allclose(part.placement.place(np.zeros((1, 2))), [[x[spans][0, 0], y[spans][0, 0]]], rtol=1e-14, atol=0)
    if box == "pixels" and attribute != "south up":
        with rasterio.open(path) as file:
            window = from_bounds(*BOXES[box], file.transform)
        assert part.shape == (window.height, window.width)


def test_boxes_of_commands(tmp_path: Path) -> None:
    path = raster(tmp_path, ".tif")
    box = "6.0045,45.98,6.02,45.9902"
    ok("encode", path, "-o", tmp_path / "a.iso", "--isovalue", 60.5, "--bbox", box)
    ok("encode", path, "-o", tmp_path / "b.iso", "--isovalue", 60.5, "--bbox", box, "--tile", 32)
    ok("verify", tmp_path / "a.iso", path, "--bbox", box)
    one, tiled = (isocodec.open(tmp_path / name) for name in ("a.iso", "b.iso"))
    assert one.shape == tiled.shape == (10, 16)
    placed = one.contour().placed
    assert placed.min(0) @ [1, 0] >= 6.0045 and placed.max(0)[1] <= 45.9902
    np.savez(tmp_path / "a.npz", values=np.arange(120.0).reshape(10, 12), x=np.arange(12.0), y=np.arange(10.0) ** 1.1)
    assert isocodec.read(tmp_path / "a.npz", bbox=(2, 3, 5.5, 7)).shape == (3, 4)
    ok("encode", tmp_path / "a.npz", "-o", tmp_path / "c.iso", "--isovalue", 50.5, "--bbox", "2,0,9,9", "--tile", 32)
    for wrong, reason in (
        ("0,0,1,1", "no samples lie within"), ("6,45,7", "XMIN,YMIN,XMAX,YMAX"), ("7,45,6,46", "no inside"),
    ):
        assert reason in fails(2, "encode", path, "-o", tmp_path / "x.iso", "--isovalue", 1, "--bbox", wrong)
    np.save(tmp_path / "a.npy", HEIGHTS)
    assert "needs a field with a placement" in fails(
        2, "encode", tmp_path / "a.npy", "-o", tmp_path / "x.iso", "--isovalue", 1, "--bbox", "0,0,1,1")


def test_boxes_of_series(tmp_path: Path) -> None:
    values = np.arange(360.0).reshape(3, 10, 12)
    np.savez(tmp_path / "a.npz", values=values, lon=np.arange(12.0), lat=np.arange(10.0))
    fields = isocodec.read(tmp_path / "a.npz", frames=True, bbox=(2, 3, 5.5, 7)).fields
    assert fields.shape == (5, 4) and np.array_equal(fields[1].values, values[1, 3:8, 2:6])


WHERE = [
    (["--transform", "30,0,500000,0,-30,4600000"], [[0, 30, 500015], [-30, 0, 4599985]]),
    (["--transform", "30,5,500000,7,-30,4600000"], [[5, 30, 500017.5], [-30, 7, 4599988.5]]),
    (["--bounds", "0,10,34,49"], [[0, 2, 1], [-3, 0, 47.5]]),
    (["--spacing", "3,2"], [[0, 2, 0], [3, 0, 0]]),
    (["--spacing", "-3,2", "--origin", "-7,48"], [[0, 2, -7], [-3, 0, 48]]),
    (["--origin", "-7,48"], [[0, 1, -7], [1, 0, 48]]),
]


@pytest.mark.parametrize(("options", "matrix"), WHERE)
@pytest.mark.parametrize("name", ["a.npy", "a.png", "a.tif"])
def test_places_by_choice(tmp_path: Path, name: str, options: list[str], matrix: list[list[float]]) -> None:
    path = tmp_path / name
    if name == "a.npy":
        np.save(path, HEIGHTS)
    elif name == "a.png":
        Image.fromarray(HEIGHTS.astype("u1")).save(path)
    else:
        tifffile.imwrite(path, HEIGHTS.astype("f4"))
    for more in ([], ["--tile", 32]):
        ok("encode", path, "-o", tmp_path / "a.iso", "--isovalue", 90.5, *options, "--crs", "EPSG:32631", *more)
        file = isocodec.open(tmp_path / "a.iso")
        assert isinstance(file.placement, Placement) and file.placement.matrix is not None
        assert np.allclose(file.placement.matrix, matrix, rtol=1e-12) and file.crs == "EPSG:32631"


def test_what_a_choice_replaces(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tif", "GTiff", "int16")
    ok("encode", path, "-o", tmp_path / "a.iso", "--isovalue", 90.5, "--crs", ALBERS.to_wkt(), "--origin", "0,0")
    file = isocodec.open(tmp_path / "a.iso")
    assert pyproj.CRS.from_user_input(file.crs) == ALBERS
    assert file.placement.matrix.tolist() == [[0, 30, 0], [-30, 0, 0]]
    np.save(tmp_path / "v.npy", np.add.outer(HEIGHTS, np.arange(4)))
    rows = "1,0,0,5,0,2,0,6,0,0,3,7"
    ok("encode", tmp_path / "v.npy", "-o", tmp_path / "v.iso", "--isovalue", 90.5, "--transform", rows)
    assert isocodec.open(tmp_path / "v.iso").placement.matrix.tolist() == [[1, 0, 0, 5], [0, 2, 0, 6], [0, 0, 3, 7]]
    encode = ("encode", tmp_path / "v.npy", "-o", tmp_path / "x.iso", "--isovalue", 90.5)
    for wrong, reason in (
        (["--bounds", "0,0,1,1"], "bounds are for fields of two axes"),
        (["--transform", "1,2"], "has 2 numbers; give 12"), (["--origin", "1,2"], "has 2 numbers; give 3"),
        (["--crs", "nonsense"], "is not a reference system"), (["--crs", "EPSG:999999"], "is not a reference system"),
        (["--spacing", "1,1,1", "--transform", rows], "cannot be combined"),
        (["--bounds", "0,0,1,1", "--transform", rows], "cannot be combined"),
        (["--no-placement", "--crs", "EPSG:4326"], "cannot be combined"),
    ):
        assert reason in fails(2, *encode, *wrong), wrong


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("kind", ["jpg", "png", "tif", "colour.jpg"])
def test_orientations(tmp_path: Path, kind: str, orientation: int) -> None:
    """Pictures are upright, as Pillow turns them; those with coordinates stay as these are."""
    picture = np.kron(np.arange(12).reshape(3, 4) * 20, np.ones((8, 8))).astype("u1")
    path, about = tmp_path / f"a.{kind}", Image.Exif()
    about[274] = orientation
    if kind == "tif":
        tifffile.imwrite(path, picture, extratags=[(274, "H", 1, orientation, True)], metadata=None)
    else:
        shown = np.dstack([picture] * 3) if kind == "colour.jpg" else picture
        Image.fromarray(shown).save(path, exif=about, quality=95)
    seen = path
    if kind == "tif":  # of TIFF without compression Pillow itself takes rows for columns
        seen = tmp_path / "seen.png"
        Image.fromarray(picture).save(seen, exif=about)
    with Image.open(seen) as image:
        expected = np.asarray(ImageOps.exif_transpose(image))
    channel = {"channel": 1} if kind == "colour.jpg" else {}
    expected = expected[..., 1] if channel else expected
    assert np.array_equal(isocodec.read(path, **channel).values, expected)
    with open_file(path, Choice(**channel)) as opened:
        windows = opened.windows()
        assert opened.shape == expected.shape
        assert windows is None or np.array_equal(windows[2:9, 1:7], expected[2:9, 1:7])
    world = {"jpg": ".jgw", "png": ".pgw", "tif": ".tfw", "colour.jpg": ".wld"}[kind]
    path.with_suffix(world).write_text("2\n0\n0\n-3\n101\n198.5\n")
    field: Any = isocodec.read(path, **channel)
    assert field.shape == picture.shape and field.placement.matrix.tolist() == [[0, 2, 101], [-3, 0, 198.5]]


def test_files_beside(tmp_path: Path) -> None:
    """World files, systems and masks beside a raster are read; .aux.xml, too."""
    path = raster(tmp_path, ".tif", HEIGHTS, crs=None, transform=None)
    (tmp_path / "a.tfw").write_text("2\n0\n0\n-3\n101\n198.5\n")
    system = pyproj.CRS(32631).to_wkt("WKT1_GDAL")
    (tmp_path / "a.tif.aux.xml").write_text(f"<PAMDataset><SRS>{system}</SRS></PAMDataset>")
    place = read_place(path, 2)
    assert place.matrix is not None and place.matrix.tolist() == [[0, 2, 101], [-3, 0, 198.5]]
    assert place.crs == "EPSG:32631"
    with rasterio.open(path, "r+") as file, rasterio.Env(GDAL_TIFF_INTERNAL_MASK=False):
        file.write_mask(~GONE)
    assert (tmp_path / "a.tif.msk").exists() and np.array_equal(isocodec.read(path).mask, GONE)


def test_points_that_place_nothing(tmp_path: Path) -> None:
    """Ground control points and rational polynomials are remarked on."""
    from rasterio.control import GroundControlPoint

    points = [GroundControlPoint(r, c, c * 10, -r * 10) for r, c in ((0, 0), (0, 9), (9, 0), (9, 8))]
    path = raster(tmp_path, ".tif", HEIGHTS, gcps=points, transform=None)
    result = run("encode", path, "-o", tmp_path / "a.iso", "--isovalue", 90.5)
    assert result.exit_code == 0 and "ground control points" in result.stderr and "warp it first" in result.stderr
    assert "warning" not in run(
        "encode", path, "-o", tmp_path / "a.iso", "--isovalue", 90.5, "--bounds", "0,0,9,9").stderr


def test_several_rasters_in_a_file(tmp_path: Path) -> None:
    for name, factor in (("low", 1), ("high", 2)):
        with rasterio.open(
            tmp_path / "a.gpkg", "w", driver="GPKG", height=13, width=17, count=1, dtype="float32", RASTER_TABLE=name,
            APPEND_SUBDATASET="YES" if factor > 1 else "NO", **SQUARES,
        ) as file:
            file.write((HEIGHTS * factor).astype("f4"), 1)
    with pytest.raises(InputError, match=r"holds 2 rasters: low, high.*--key"):
        isocodec.read(tmp_path / "a.gpkg")
    assert np.array_equal(isocodec.read(tmp_path / "a.gpkg", key="high").values, HEIGHTS * 2)
    with pytest.raises(OptionError, match="no raster middle in it: choose one of low, high"):
        isocodec.read(tmp_path / "a.gpkg", key="middle")
    with tifffile.TiffWriter(tmp_path / "p.tif") as file:
        for factor in (1, 2):
            file.write(np.pad(HEIGHTS * factor, factor).astype("f4"), metadata=None)
    with pytest.raises(InputError, match=r"2 pictures of different kinds.*choose a page with --key"):
        isocodec.read(tmp_path / "p.tif")
    assert isocodec.read(tmp_path / "p.tif", key="2").shape == (17, 21)


@pytest.mark.parametrize("compression", [None, "zlib", "lzw", "zstd", "jpeg", "lerc", "packbits", "webp"])
@pytest.mark.parametrize("channels", [False, True])
def test_stacks_of_every_compression(tmp_path: Path, compression: str | None, channels: bool) -> None:
    """GDAL unpacks their pages as tifffile does."""
    stack = np.add.outer(np.arange(4) * 9, np.add.outer(np.arange(40), np.arange(48))).astype("u1")
    if channels or compression == "webp":
        stack = np.stack([stack, stack + 30, stack + 60], axis=-1)
    lossless = {"compressionargs": {"lossless": True}} if compression == "webp" else {}
    tifffile.imwrite(
        tmp_path / "a.tif", stack, compression=compression, photometric="rgb" if stack.ndim == 4 else "minisblack",
        tile=(16, 16), **lossless,
    )
    expected = tifffile.imread(tmp_path / "a.tif")
    for channel in range(3) if stack.ndim == 4 else [None]:
        found = isocodec.read(tmp_path / "a.tif", channel=channel).values
        wanted = expected if channel is None else expected[..., channel]
        most = 4 if compression == "jpeg" else 0
        assert found.dtype == wanted.dtype and np.abs(found.astype(int) - wanted).max() <= most


@pytest.fixture
def server() -> Iterator[tuple[str, list[str]]]:
    """A server that nobody may ask, and what it was asked for."""
    asked: list[str] = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def log_message(self, *_: Any) -> None: ...

        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_response(404)
            self.end_headers()

        do_HEAD = do_GET

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as made:
        threading.Thread(target=made.serve_forever, daemon=True).start()
        yield f"/vsicurl/http://127.0.0.1:{made.server_port}", asked
        made.shutdown()


def mosaic(target: str, relative: int = 0, more: str = "", inner: str = "") -> str:
    source = f'<SimpleSource><SourceFilename relativeToVRT="{relative}">{target}</SourceFilename></SimpleSource>'
    band = f'<VRTRasterBand dataType="Byte" band="1">{inner}{source}</VRTRasterBand>'
    return f'<VRTDataset rasterXSize="17" rasterYSize="13"{more}>{band}</VRTDataset>'


RAW = (
    '<VRTDataset rasterXSize="17" rasterYSize="13"><VRTRasterBand dataType="Byte" band="1" subClass="VRTRawRasterBand">'
    '<SourceFilename relativeToVRT="1">b.tif</SourceFilename></VRTRasterBand></VRTDataset>'
)
DERIVED = (
    '<VRTDataset rasterXSize="17" rasterYSize="13"><VRTRasterBand dataType="Byte" band="1" '
    'subClass="VRTDerivedRasterBand"><PixelFunctionLanguage>Python</PixelFunctionLanguage></VRTRasterBand></VRTDataset>'
)
SERVICE = '<GDAL_WMS><Service name="TMS"><ServerUrl>http://{}/${{z}}.png</ServerUrl></Service></GDAL_WMS>'
TABLE = (
    '<OGRVRTDataSource><OGRVRTLayer name="s"><SrcDataSource>{}</SrcDataSource><GeometryType>wkbPoint</GeometryType>'
    "</OGRVRTLayer></OGRVRTDataSource>"
)


@pytest.mark.parametrize(
    "suffix", [".tif", ".gpkg", ".asc", ".img", ".jp2", ".hgt", ".png", ".fgb", ".shp", ".geojson"]
)
@pytest.mark.parametrize("what", ["mosaic", "raw", "service", "table"])
def test_no_other_format_hides_behind_a_suffix(
    tmp_path: Path, server: tuple[str, list[str]], suffix: str, what: str
) -> None:
    address, asked = server
    np.zeros(999, "u1").tofile(tmp_path / "b.tif")
    text = {"mosaic": mosaic(f"{address}/a.tif"), "raw": RAW, "service": SERVICE.format(address[17:]),
            "table": TABLE.format(f"{address}/a.csv")}[what]
    (tmp_path / f"a{suffix}").write_text(text)
    line = fails(3, "encode", tmp_path / f"a{suffix}", "-o", tmp_path / "a.iso", "--isovalue", 1)
    assert f"a{suffix}" in line and asked == [] and not (tmp_path / "a.iso").exists()


def test_mosaics_name_files_beside_them(tmp_path: Path, server: tuple[str, list[str]]) -> None:
    address, asked = server
    (tmp_path / "in").mkdir()
    (tmp_path / "else").mkdir()
    path = raster(tmp_path / "in", ".vrt", HEIGHTS)
    assert np.array_equal(isocodec.read(path).values, HEIGHTS)
    other = raster(tmp_path / "else", ".tif", HEIGHTS)
    (tmp_path / "in" / "disguised.tif").write_text(mosaic(str(other)))
    (tmp_path / "in" / "inner.vrt").write_text(mosaic(str(other)))
    overview = f'<Overview><SourceFilename relativeToVRT="0">{other}</SourceFilename></Overview>'
    noted = f'<Metadata domain="OVERVIEWS"><MDI key="OVERVIEW_FILE">{address}/b.tif</MDI></Metadata>'
    for text in (
        mosaic(str(other)), mosaic("../else/a.tif", 1), mosaic("disguised.tif", 1), mosaic("inner.vrt", 1),
        mosaic(f"{address}/a.tif"), mosaic("a.tif", 0), RAW, DERIVED, mosaic("a.tif", 1, inner=overview),
        mosaic("a.tif", 1, ' subClass="VRTWarpedDataset"'), mosaic("a.tif", 1, inner=noted),
    ):
        path.write_text(text)
        line = fails(3, "encode", path, "-o", tmp_path / "a.iso", "--isovalue", 90.5)
        assert ("--follow-paths" in line or "disguised" in text) and asked == [], text
    path.write_text(mosaic(str(other)))
    assert np.array_equal(isocodec.read(path, follow=True).values, HEIGHTS)


def test_files_beside_are_what_they_seem(tmp_path: Path, server: tuple[str, list[str]]) -> None:
    """Masks and overviews that are mosaics, notes that name files."""
    address, asked = server
    for name, text in {
        "a.tif.msk": mosaic(f"{address}/a.tif"), "a.tif.ovr": mosaic(f"{address}/a.tif"),
        "a.tif.aux.xml": f'<PAMDataset><Metadata domain="OVERVIEWS"><MDI key="OVERVIEW_FILE">{address}/b.tif</MDI>'
        "</Metadata></PAMDataset>",
    }.items():
        path = raster(tmp_path, ".tif", HEIGHTS)
        (tmp_path / name).write_text(text)
        assert "--follow-paths" in fails(3, "encode", path, "-o", tmp_path / "a.iso", "--isovalue", 90.5)
        (tmp_path / name).unlink()
    path = raster(tmp_path, ".tif", HEIGHTS)
    with rasterio.open(path, "r+") as file:
        file.update_tags(ns="OVERVIEWS", OVERVIEW_FILE=f"{address}/b.tif")
    asked.clear()
    assert "--follow-paths" in fails(3, "encode", path, "-o", tmp_path / "a.iso", "--isovalue", 90.5)
    assert asked == []


def test_virtual_files(tmp_path: Path) -> None:
    """What the user names is read: within an archive, packed, from a server."""
    path = raster(tmp_path, ".tif", HEIGHTS)
    subprocess.run(["python3", "-m", "zipfile", "-c", "a.zip", "a.tif"], cwd=tmp_path, check=True)
    name = f"/vsizip/{tmp_path}/a.zip/a.tif"
    assert np.array_equal(isocodec.read(name).values, HEIGHTS)
    ok("encode", name, "-o", tmp_path / "a.iso", "--isovalue", 90.5, "--bbox", "6,45.992,6.0099,46")
    assert isocodec.open(tmp_path / "a.iso").shape == (8, 10)
    # in a process of its own: GDAL holds the lock of this one while it waits for an answer
    command = [sys.executable, "-u", "-m", "http.server", "0", "--bind", "127.0.0.1"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as made:
        assert made.stdout is not None
        port = made.stdout.readline().split("port ")[1].split()[0]
        try:
            assert np.array_equal(isocodec.read(f"/vsicurl/http://127.0.0.1:{port}/{path.name}").values, HEIGHTS)
        finally:
            made.kill()
    assert "no-such" in fails(3, "encode", "/vsizip/no-such.zip/a.tif", "-o", tmp_path / "x.iso", "--isovalue", 1)


@pytest.mark.parametrize("compression", ["deflate", "lzw", "zstd", "lzma", "lerc_zstd"])
def test_damaged_strips_are_errors(tmp_path: Path, compression: str) -> None:
    noise = np.random.default_rng(3).integers(0, 9999, (64, 64)).astype("i2")
    path = raster(tmp_path, ".tif", noise, compress=compression)
    data = path.read_bytes()
    with tifffile.TiffFile(path) as file:
        at, count = file.pages[0].dataoffsets[0], file.pages[0].databytecounts[0]
    changed = 0
    for step in range(7):
        broken = bytearray(data)
        where = at + count * (step + 1) // 9
        broken[where : where + 40] = bytes(40)
        path.write_bytes(broken)
        try:
            changed += not np.array_equal(isocodec.read(path).values, noise)
        except InputError:
            continue
    assert changed == 0 or compression in ("lzw", "lzma", "zstd", "lerc_zstd"), "without a checksum nobody notices"
