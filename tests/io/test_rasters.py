"""Rasters against rasterio: kinds of bands, masks, scales, places and formats, whole and by windows."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from isocodec.errors import InputError, OptionError
from isocodec.io.opener import Choice, load
from libraries import Late
from tables import looped

rasterio = Late("rasterio")

HEIGHTS = np.rint(100 - 3 * np.hypot(*(np.mgrid[:13, :17] - np.array([5.3, 8.2])[:, None, None])))
GONE = np.zeros(HEIGHTS.shape, np.bool_)
GONE[:, :3] = GONE[7, 9] = True
UTM = (30, 0, 5e5, 0, -30, 4.6e6)


def scaled(file: Any) -> None:
    file.scales, file.offsets = (0.1,) * file.count, (-20.0,) * file.count


def alpha(file: Any) -> None:
    from rasterio.enums import ColorInterp

    file.write(np.where(GONE, 0, 255).astype(file.dtypes[1]), 2)
    file.colorinterp = [ColorInterp.gray, ColorInterp.alpha]


def named(file: Any) -> None:
    file.descriptions, file.units = ("height",), ("m",)


ATTRIBUTES: dict[str, tuple[dict[str, Any], Callable[[Any], None] | None]] = {
    "int8": ({"dtype": "int8"}, None), "uint64": ({"dtype": "uint64"}, None), "float32": ({"dtype": "float32"}, None),
    "nodata": ({"nodata": 80}, None), "nodata is NaN": ({"dtype": "float32", "nodata": np.nan}, None),
    "mask": ({}, lambda file: file.write_mask(~GONE)),
    "alpha": ({"count": 2, "dtype": "uint8"}, alpha), "alpha with a sign": ({"count": 2, "dtype": "int16"}, alpha),
    "alpha of floats": ({"count": 2, "dtype": "float32"}, alpha),
    "alpha and nodata": ({"count": 2, "dtype": "int16", "nodata": 80}, alpha),
    "scale": ({"dtype": "uint16"}, scaled), "scale of floats": ({"dtype": "float64"}, scaled),
    "scale and nodata": ({"nodata": 80}, scaled),
    "scale and mask": ({}, lambda file: (scaled(file), file.write_mask(~GONE))),
    "name and unit": ({}, named), "no place": ({"crs": None, "transform": None}, None),
    "rotated": ({"transform": (30, 5, 5e5, 7, -30, 4.6e6)}, None),
    "south up": ({"transform": (30, 0, 5e5, 0, 30, 4.6e6)}, None),
    "overviews": ({}, lambda file: file.build_overviews([2, 4])),
    "points": ({}, lambda file: file.update_tags(AREA_OR_POINT="Point")),
}


def written(path: Path, attribute: str = "nodata", **more: Any) -> Path:
    options, change = ATTRIBUTES[attribute]
    profile: dict[str, Any] = {"driver": "GTiff", "height": 13, "width": 17, "count": 1, "dtype": "int16",
                               "crs": "EPSG:32631", "transform": UTM, **options, **more}
    if profile["transform"] is not None:
        profile["transform"] = rasterio.Affine(*profile["transform"])
    with warnings.catch_warnings(action="ignore"), rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(
            path, "w", **profile) as file:
        mark = profile.get("nodata", 80)
        file.write(np.where(GONE, mark, HEIGHTS).astype(profile["dtype"]), 1)
        if change is not None:
            change(file)
    return path


@looped("attribute", ATTRIBUTES)
def test_as_rasterio_has_it(tmp_path: Path, attribute: str) -> None:
    """Values, missing samples, place, name and unit; windows are the same, in another process, too."""
    path = written(tmp_path / "a.tif", attribute)
    with warnings.catch_warnings(action="ignore"), rasterio.open(path) as file:
        expected = file.read(1, masked=True)
        if file.count > 1:
            expected = np.ma.masked_where(file.read(2) == 0, expected)
        if (file.scales[0], file.offsets[0]) != (1, 0):
            expected = expected.astype(float) * file.scales[0] + file.offsets[0]
        corners = np.stack(rasterio.transform.xy(file.transform, [0, 12, 5], [0, 16, 2]), axis=1)
        about = (file.descriptions[0], file.units[0])
        field: Any = isocodec.read(path)
        again: Any = isocodec.read(file)
    gone = np.zeros(field.shape, np.bool_) if field.mask is None else field.mask
    assert np.array_equal(gone | np.isnan(field.values), np.ma.getmaskarray(expected) | np.isnan(expected.data))
    assert np.array_equal(field.values[~gone], expected.data[~gone], equal_nan=True)
    assert field.values.dtype == expected.dtype and (field.name, field.unit) == about
    assert np.array_equal(again.values, field.values, equal_nan=True)
    if attribute == "no place":
        assert field.placement is None
    else:
        assert np.allclose(field.placement.place(np.array([[0.0, 0], [12, 16], [5, 2]])), corners, rtol=1e-12)
        assert field.crs == "EPSG:32631"
    lazy: Any = load(path, Choice(), lazy=True)
    part = pickle.loads(pickle.dumps(lazy.values))[3:9, 2:17]
    whole = np.ma.masked_array(field.values, gone)
    assert np.array_equal(part.filled(0), whole[3:9, 2:17].filled(0), equal_nan=True)


FORMATS = {".asc": "AAIGrid", ".img": "HFA", ".bil": "EHdr", ".bsq": "ENVI", ".sdat": "SAGA", ".rst": "RST",
           ".bt": "BT", ".grd": "GS7BG", ".gpkg": "GPKG", ".vrt": "VRT", ".jp2": "JP2OpenJPEG", ".tiff": "GTiff",
           ".odd": "GTiff"}


@looped("suffix", FORMATS)
def test_suffixes(tmp_path: Path, suffix: str) -> None:
    """Each is opened by its driver, one that nobody knows by what is in it."""
    import rasterio.shutil

    kinds = {".grd": "float32", ".bt": "float32", ".gpkg": "uint8"}
    source = written(tmp_path / "source.tif", "uint64", dtype=kinds.get(suffix, "int16"))
    path = tmp_path / f"a{suffix}"
    options = {"QUALITY": "100", "REVERSIBLE": "YES"} if suffix == ".jp2" else {}
    with warnings.catch_warnings(action="ignore"):
        rasterio.shutil.copy(source, path, driver=FORMATS[suffix], **options)
        with rasterio.open(path) as file:
            expected, transform = file.read(1, masked=True), file.transform
        field: Any = isocodec.read(path, band=1) if suffix == ".gpkg" else isocodec.read(path)
    gone = np.zeros(field.shape, np.bool_) if field.mask is None else field.mask
    if suffix != ".gpkg":
        assert np.array_equal(gone, np.ma.getmaskarray(expected))
    assert np.array_equal(field.values[~gone], expected.data[~gone])
    assert np.allclose(field.placement.matrix[:, 1], [transform.a, transform.d])


def bare(path: Path, dtype: str, change: Callable[[Any], object] = lambda file: None, **more: Any) -> Path:
    """A TIFF without a place."""
    with warnings.catch_warnings(action="ignore"), rasterio.open(
            path, "w", driver="GTiff", height=13, width=17, count=1, dtype=dtype, **more) as file:
        file.write(HEIGHTS.astype("complex64" if "complex" in dtype else dtype), 1)
        change(file)
    return path


def test_bands(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tif", "mask", count=3)
    with pytest.raises(InputError, match=r"holds 3 bands: 1 .*int16.*choose one with --band"):
        isocodec.read(path)
    for band, words in ((4, "no band 4"), (0, "counted from 1")):
        with pytest.raises(OptionError, match=words):
            isocodec.read(path, band=band)
    assert isocodec.read(path, band=3).values.sum() == 0


def test_what_is_refused_or_remarked_on(tmp_path: Path) -> None:
    """Complex numbers, palettes, pictures on their side, control points; mosaics and servers by another name."""
    from rasterio.control import GroundControlPoint

    path = tmp_path / "a.tif"
    for dtype in ("complex64", "complex_int16"):
        with pytest.raises(InputError, match=rf"complex numbers \({dtype}\).*real part"):
            isocodec.read(bare(path, dtype))
    bare(path, "uint8", lambda file: file.write_colormap(1, {n: (n, 0, 0, 255) for n in range(256)}))
    with pytest.raises(InputError, match=r"palette.*band=1"):
        isocodec.read(path)
    assert np.array_equal(isocodec.read(path, band=1).values, HEIGHTS)
    points = [GroundControlPoint(r, c, 5e5 + 30 * c, 4.6e6 - 31 * r) for r, c in ((0, 0), (0, 16), (12, 0), (12, 15))]
    with pytest.warns(UserWarning, match=r"control points.*warp it first"):
        assert isocodec.read(bare(path, "int16", gcps=points, crs="EPSG:32631")).placement is None
    for name, words in (("a.tif", "cannot be read"), ("a.img", "cannot be read"), ("a.odd", "not a supported format")):
        (tmp_path / name).write_text('<VRTDataset rasterXSize="17" rasterYSize="13"/>')
        with pytest.raises(InputError, match=words):
            isocodec.read(tmp_path / name)


@looped("nodata", [80.0, float("nan"), 97.0])
@looped("attribute", ["nodata", "mask", "scale and nodata"])
def test_nodata_takes_the_place_of_what_is_stated(tmp_path: Path, attribute: str, nodata: float) -> None:
    """As stored, before scaling; masks remain."""
    path = written(tmp_path / "a.tif", attribute)
    field: Any = isocodec.read(path, nodata=nodata)
    with rasterio.open(path) as file:
        expected = (file.read(1) == nodata) | (GONE if attribute == "mask" else False)
    assert np.array_equal(np.zeros_like(GONE) if field.mask is None else field.mask, expected)


def test_boxes_are_windows(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tif", "mask")
    whole: Any = isocodec.read(path)
    part: Any = isocodec.read(path, bbox=(500090, 4599700, 500300, 4599940))
    assert np.array_equal(part.values, whole.values[2:10, 3:10]) and np.array_equal(part.mask, whole.mask[2:10, 3:10])
    assert np.allclose(part.placement.place(np.zeros((1, 2))), whole.placement.place(np.array([[2.0, 3]])))
    lazy: Any = load(path, Choice(bbox=(500090, 4599700, 500300, 4599940)), lazy=True)
    assert np.array_equal(lazy.values[1:3, 2:4], part.values[1:3, 2:4])
    with pytest.raises(OptionError, match="no samples lie within"):
        isocodec.read(path, bbox=(0, 0, 1, 1))


def test_systems_without_a_number(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tif", crs="+proj=aea +lat_0=3 +lon_0=11 +lat_1=20 +lat_2=40 +x_0=7 +datum=WGS84")
    assert str(isocodec.read(path).crs).startswith("PROJCRS")


@looped("tiles", [{}, {"tiled": True, "blockxsize": 16, "blockysize": 16}])
def test_damaged_deflate_is_an_error(tmp_path: Path, tiles: dict[str, Any]) -> None:
    """Also where GDAL unpacks it without a word; what lies outside of a window is left alone."""
    import tifffile

    path = written(tmp_path / "a.tif", "uint64", dtype="int16", compress="deflate", **tiles)
    with tifffile.TiffFile(path) as file:
        at, size = file.pages[0].dataoffsets[-1], file.pages[0].databytecounts[-1]
    whole, right = path.read_bytes(), isocodec.read(path).values
    refused, places = 0, range(at, at + size, 3)
    for place in places:
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
        try:
            assert np.array_equal(isocodec.read(path).values, right)  # a bit that fills up
        except InputError:
            refused += 1
    assert refused > 0.9 * len(places)
    if tiles:
        assert load(path, Choice(), lazy=True).values[0:4, 0:4].shape == (4, 4)


@looped("suffix, kind", [(".bil", "EHdr"), (".bsq", "ENVI"), (".img", "ENVI")])
def test_raw_samples_that_are_cut_short_are_an_error(tmp_path: Path, suffix: str, kind: str) -> None:
    import rasterio.shutil

    path = tmp_path / f"a{suffix}"
    rasterio.shutil.copy(written(tmp_path / "source.tif", "uint64", dtype="int16"), path, driver=kind)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(InputError, match=str(path)):
        isocodec.read(path)
