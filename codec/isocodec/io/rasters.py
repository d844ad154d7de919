"""Rasters as rasterio (GDAL) opens them: a band with its missing samples, scale and place, read by windows."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from itertools import product, zip_longest
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..errors import InputError, OptionError, plain
from ..field.labelling import about
from ..field.missing import missing_samples
from ..field.placement import Placement
from ..field.reference_system import crs_text
from ..field.sampled import Field
from ..limits import patience
from ..verbs import Choice
from .arrays import indices
from .in_turn import placed_field
from .libraries import choose, library, reading

TIFF, _MOSAIC = (".tif", ".tiff"), ".vrt"
SUFFIXES = (*TIFF, _MOSAIC, ".gpkg", ".asc", ".hgt", ".img", ".dem", ".bil", ".bip", ".bsq", ".flt", ".dt0", ".dt1",
            ".dt2", ".jp2", ".sdat", ".rst", ".grd", ".bt")
_DRIVERS = ["GTiff", "GPKG", "AAIGrid", "GRASSASCIIGrid", "SRTMHGT", "HFA", "USGSDEM", "ENVI", "EHdr", "DTED",
            "JP2OpenJPEG", "SAGA", "RST", "GSBG", "GS7BG", "GSAG", "BT", "NITF", "PCRaster", "ZMap", "PNG", "JPEG",
            "BMP", "GIF", "PNM", "WEBP"]
"""Drivers of GDAL, which opens files by their content; those of others name other files and servers."""


@contextmanager
def _gdal(name: str = "") -> Iterator[Any]:
    """Rasterio, without programs in files, and without servers unless the user named one."""
    rasterio = library("rasterio", extra="raster", purpose="reading rasters")
    options = {
        "GDAL_VRT_ENABLE_PYTHON": "NO", "OGR_SQLITE_ALLOW_EXTERNAL_ACCESS": "NO", "DTED_VERIFY_CHECKSUM": "YES",
        "GDAL_HTTP_TIMEOUT": str(patience()), "GDAL_HTTP_CONNECTTIMEOUT": str(patience()),
        **({} if name.startswith("/vsi") else {"CPL_VSIL_CURL_ALLOWED_FILENAME": "none"}),
    }
    with reading("raster", "gdalinfo shows what GDAL makes of it"), rasterio.Env(**options):
        try:
            yield rasterio
        except rasterio.errors.RasterioError as error:
            raise (error.__cause__ if isinstance(error.__cause__, Exception) else error) from error


def open_(path: str, key: str | None = None) -> Any:
    """Open a file, or a virtual name of GDAL (``/vsizip/..``), as a dataset of rasterio.

    A key is the page of a TIFF, counted from 1, or the table of a GeoPackage.
    """
    with _gdal(path) as rasterio:
        # rasterio.open takes one driver alone
        file = rasterio.io.DatasetReader(path, driver=["VRT"] if path.lower().endswith(_MOSAIC) else _DRIVERS)
        if file.driver in ("EHdr", "ENVI"):  # GDAL takes what is not there for zeros
            bits = int(file.tags(1, ns="IMAGE_STRUCTURE").get("NBITS", 8 * np.dtype(file.dtypes[0]).itemsize))
            least, size = file.count * file.width * file.height * bits // 8, Path(file.files[0]).stat().st_size
            if size < least:
                raise InputError(f"holds {size:,} bytes of the {least:,} that its header states, or is packed",
                                 code="unreadable", remedy="check that the file is complete, and unpack it")
        if key is None and file.count:
            return file
        # GTIFF_DIR:1:path, GPKG:path:table
        tiff = file.driver == "GTiff"
        names = {each.split(":")[1 if tiff else -1]: each for each in file.subdatasets} or ({"1": path} if tiff else {})
        return rasterio.open(names[choose([*names], key, "rasters")], driver=file.driver)


class RasterBand:
    """A band of a raster by slices, scaled as the file states, masked where samples are missing.

    Other processes receive the name of the file only, and open it again. Without a number, counted from 1, there must
    be a single band that is no alpha. ``nodata`` replaces the stored missing value of the file; NaN: none.
    """

    windowed, ndim = True, 2

    def __init__(self, dataset: Any, band: int | None = None, nodata: float | None = None) -> None:
        self._file, self._nodata = dataset, nodata
        self._name, self._driver = dataset.name, dataset.driver
        self.band = _band_of(dataset, band)
        self.shape = tuple(dataset.shape)
        self.scaling = dataset.scales[self.band - 1], dataset.offsets[self.band - 1]
        self.dtype = np.dtype(dataset.dtypes[self.band - 1] if self.scaling == (1, 0) else np.float64)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_file"}

    @cached_property
    def _file(self) -> Any:
        with _gdal(self._name) as rasterio:
            return rasterio.open(self._name, driver=self._driver)

    def __getitem__(self, window: tuple[slice, ...]) -> np.ma.MaskedArray[Any, Any]:
        ends = tuple((part.start, part.stop) for size, each in zip(self.shape, window, strict=True)
                     for part in [range(size)[each]])
        with _gdal(self._name):
            _check(self._file, self.band, ends)
            values = self._file.read(self.band, window=ends)
            flags = {flag.name for flag in self._file.mask_flag_enums[self.band - 1]}
            gone = missing_samples(values, self._nodata)
            if not flags & ({"all_valid"} if self._nodata is None else {"all_valid", "nodata"}):
                gone |= self._file.read_masks(self.band, window=ends) == 0
            colours = [each.name for each in self._file.colorinterp]
            # GDAL masks by alpha of bytes and of unsigned 16 bits alone
            if "alpha" in colours and "alpha" not in flags and colours[self.band - 1] != "alpha":
                gone |= self._file.read(1 + colours.index("alpha"), window=ends) == 0
        scale, offset = self.scaling
        return np.ma.masked_array(values if self.scaling == (1, 0) else values * np.float64(scale) + offset, gone)


def _check(file: Any, band: int, ends: Sequence[tuple[int, int]]) -> None:
    """Compare the checksums of the blocks of a Deflate TIFF within a window, which GDAL leaves out at times."""
    path, sizes = next(iter(file.files), ""), file.block_shapes[band - 1]
    if file.driver != "GTiff" or file.profile.get("compress") != "deflate" or not Path(path).is_file():
        return
    with open(path, "rb") as stored:
        for block in product(*(range(a // size, -(-b // size)) for (a, b), size in zip(ends, sizes, strict=True))):
            at, length = (int(file.get_tag_item(f"BLOCK_{what}_{block[1]}_{block[0]}", "TIFF", bidx=band) or 0)
                          for what in ("OFFSET", "SIZE"))
            stored.seek(at)
            unpacked = zlib.decompressobj()
            if length and not (unpacked.decompress(stored.read(length), 16 * file.count * sizes[0] * sizes[1] + 1)
                               and unpacked.eof):
                raise InputError("is damaged: packed samples end early or go on", code="unreadable")


def of_dataset(dataset: Any, choice: Choice) -> Field:
    """Read a band of a dataset of rasterio as a field, whose samples stay in the file until windows are read."""
    samples: Any = RasterBand(dataset, choice.band, choice.nodata)
    with _gdal():
        where, remarks = _place_of(dataset)
    at = samples.band - 1
    return placed_field(samples, None, where, remarks, name=dataset.descriptions[at], unit=dataset.units[at],
                        notes=_labels(dataset, samples.band))


def _labels(dataset: Any, band: int) -> dict[str, str]:
    """Collect names and colours of labels: categories and palette of a band, which rasterio gives by a VRT alone."""
    if np.dtype(dataset.dtypes[band - 1]).kind not in "ui":
        return {}
    copying = library("rasterio.shutil", extra="raster", purpose="reading rasters")
    with _gdal() as rasterio, rasterio.MemoryFile(ext=_MOSAIC) as file:
        copying.copy(dataset, file.name, driver="VRT")
        found = ElementTree.fromstring(file.read()).findall("VRTRasterBand")[band - 1]
    names = [each.text for each in found.iterfind("CategoryNames/Category")]
    entries = found.iterfind("ColorTable/Entry")
    colours = [[int(each.get(f"c{part}", 0)) / 255 for part in (1, 2, 3)] for each in entries]
    notes: dict[str, str] = {}
    for label, (name, colour) in enumerate(zip_longest(names, colours)):
        notes |= about(label, name, colour)
    return notes


def read(path: Any, choice: Choice) -> Field:
    """Open a file, and read a band."""
    return of_dataset(open_(str(path), choice.key), choice)


def _place_of(dataset: Any) -> tuple[Placement | None, list[str]]:
    """Place samples in the middle of pixels; with a remark on what is left out."""
    a, b, c, d, e, f = dataset.transform[:6]
    crs = crs_text(dataset.crs)
    if not dataset.transform.is_identity:
        remark = "its reference system is left out: it is not one of the earth"
        where = Placement([[b, a, c + (a + b) / 2], [e, d, f + (d + e) / 2]], crs=crs)
        return where, [remark] * bool(dataset.crs and not crs)
    if kind := "ground control points" if dataset.gcps[0] else "rational polynomials" if dataset.rpcs else "":
        return None, [f"its coordinates are ignored: it has {kind}, no steps between pixels; warp it first (gdalwarp), "
                      "or give an isocodec.Field with a placement"]
    return None, ["its reference system is ignored, as it places no pixels"] * bool(crs)


def _band_of(file: Any, band: int | None) -> int:
    colours, kinds = [each.name for each in file.colorinterp], file.dtypes
    about = zip(file.indexes, file.descriptions, colours, kinds, strict=True)
    listed = ", ".join(" ".join(plain(str(word)) for word in words if word) for words in about)
    known = [number for number, colour in zip(file.indexes, colours, strict=True) if colour != "alpha"]
    if band is not None and band not in file.indexes:
        raise OptionError(f"there is no band {band}: it holds {listed}", code="channel")
    if band is None and len(known) != 1:
        raise InputError(f"holds {file.count} bands: {listed}", code="colour",
                         remedy="choose one with --band (band= in Python)")
    number = int(known[0] if band is None else band)
    # GDAL makes palettes of bits and of grey from white to black
    ours, of_file = file.tags(number, ns="IMAGE_STRUCTURE"), file.tags(ns="IMAGE_STRUCTURE")
    grey = ours.get("NBITS") == "1" or "MINISWHITE" in of_file
    if band is None and colours[number - 1] == "palette" and not grey:
        raise indices()
    if "complex" in kinds[number - 1]:
        raise InputError(f"holds complex numbers ({kinds[number - 1]}), not real numbers", code="dtype",
                         remedy="write its real part or its modulus first")
    return number
