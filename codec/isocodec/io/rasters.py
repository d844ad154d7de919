"""Rasters as rasterio (GDAL) opens them: a band with its missing samples, scale and place, read by windows."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, OptionError, plain
from ..field.missing import missing_samples
from ..field.placement import Placement
from ..field.reference_system import crs_text
from ..field.sampled import Field
from ..limits import patience
from .in_turn import placed_field
from .libraries import choose, library, reading

TIFF = (".tif", ".tiff")
DRIVERS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(TIFF, ("GTiff",)), ".gpkg": ("GPKG",), ".vrt": ("VRT",), ".asc": ("AAIGrid", "GRASSASCIIGrid"),
    ".hgt": ("SRTMHGT",), ".img": ("HFA", "ENVI"), ".dem": ("USGSDEM",), ".bil": ("EHdr", "ENVI"),
    ".bip": ("EHdr", "ENVI"), ".bsq": ("EHdr", "ENVI"), ".flt": ("EHdr",), ".dt0": ("DTED",), ".dt1": ("DTED",),
    ".dt2": ("DTED",), ".jp2": ("JP2OpenJPEG",), ".sdat": ("SAGA",), ".rst": ("RST",),
    ".grd": ("GSBG", "GS7BG", "GSAG"), ".bt": ("BT",),
}
"""Drivers of GDAL by suffix: it goes by content, and files of other drivers name files and servers."""
_NAMING = {"VRT", "WMS", "WCS", "WMTS", "GTI", "STACTA", "STACIT", "OGCAPI", "DAAS", "EEDAI", "PLMOSAIC", "HTTP"}
"""Drivers whose files name others, not tried for unknown suffixes."""


def is_raster(thing: object) -> bool:
    """Whether this is an open dataset of rasterio."""
    return all(hasattr(thing, name) for name in ("read_masks", "transform", "colorinterp"))


@contextmanager
def _gdal(network: bool = False) -> Iterator[Any]:
    """Rasterio, without programs in files, and without servers unless the user named one."""
    rasterio = library("rasterio", extra="raster", purpose="reading rasters")
    options = {
        "GDAL_VRT_ENABLE_PYTHON": "NO", "OGR_SQLITE_ALLOW_EXTERNAL_ACCESS": "NO", "DTED_VERIFY_CHECKSUM": "YES",
        "GDAL_HTTP_TIMEOUT": str(patience()), "GDAL_HTTP_CONNECTTIMEOUT": str(patience()),
        **({} if network else {"CPL_VSIL_CURL_ALLOWED_FILENAME": "none"}),
    }
    with reading("raster", "gdalinfo shows what GDAL makes of it"), rasterio.Env(**options):
        try:
            yield rasterio
        except rasterio.errors.RasterioError as error:
            raise (error.__cause__ if isinstance(error.__cause__, Exception) else error) from error


def open_(path: str, key: str | None = None, drivers: Sequence[str] | None = None) -> Any:
    """Open a file as a dataset of rasterio, by the drivers of its suffix; of several rasters the one of a key.

    Parameters
    ----------
    path : str
        Also one of GDAL's virtual names: ``/vsicurl/https://..``, ``/vsizip/..``.
    key : str, optional
        A page of a TIFF, counted from 1, or a table of a GeoPackage.
    drivers : sequence of str, optional
        Names of drivers, instead of those of the suffix; of an unknown suffix all but those that name other files.

    Raises
    ------
    InputError, OptionError, MissingExtraError
    """
    known = drivers or next((found for end, found in DRIVERS.items() if path.lower().endswith(end)), None)
    with _gdal(path.startswith("/vsi")) as rasterio:
        if known is None:
            known = sorted({*rasterio.drivers.raster_driver_extensions().values()} - _NAMING | {"ENVI", "EHdr"})
        # rasterio.open takes one driver alone
        file = rasterio.io.DatasetReader(path, driver=[*known])
        if file.driver in ("EHdr", "ENVI") and not file.tags(1, ns="IMAGE_STRUCTURE").get("NBITS"):
            with open(file.files[0], "rb") as stored:  # GDAL takes what is not there for zeros
                packed = stored.read(2) == b"\x1f\x8b"
                size = stored.seek(0, os.SEEK_END)
            least = file.count * file.width * file.height * np.dtype(file.dtypes[0]).itemsize
            if size < least and not packed:
                raise InputError(f"holds {size:,} bytes of the {least:,} that its header states", code="unreadable",
                                 remedy="check that the file is complete")
        # GTIFF_DIR:1:path, GPKG:path:table
        names = {each.split(":")[1 if file.driver == "GTiff" else -1]: each for each in file.subdatasets}
        names = names or ({"1": path} if file.driver == "GTiff" else {})
        if key is None and file.count:
            return file
        name = names[choose([*names], key, "rasters")]
        return rasterio.open(name, driver=file.driver)


class RasterBand:
    """A band of a raster by slices, scaled as the file states, masked where samples are missing.

    What other processes receive is no more than the name of the file, which they open again.

    Parameters
    ----------
    dataset : rasterio.DatasetReader
    band : int, optional
        Counted from 1; without it the only one that is no alpha.
    nodata : float, optional
        Stored value of missing samples instead of that of the file; NaN: none.

    Raises
    ------
    InputError
        If there are several bands, or none of real numbers.
    OptionError
        If there is no such band.
    """

    windowed, ndim = True, 2

    def __init__(self, dataset: Any, band: int | None = None, nodata: float | None = None) -> None:
        self._file, self._nodata = dataset, nodata
        self._name, self._driver = dataset.name, dataset.driver
        self.band = _band_of(dataset, band)
        self.shape = tuple(dataset.shape)
        self.scale, self.offset = dataset.scales[self.band - 1], dataset.offsets[self.band - 1]
        self.dtype = np.dtype(dataset.dtypes[self.band - 1] if self._plain else np.float64)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_file"}

    @cached_property
    def _file(self) -> Any:
        with _gdal(self._name.startswith("/vsi")) as rasterio:
            return rasterio.open(self._name, driver=self._driver)

    @property
    def _plain(self) -> bool:
        return (self.scale, self.offset) == (1, 0)

    def _check(self, ends: Sequence[tuple[int, int]]) -> None:
        """Compare the checksums of the blocks of a Deflate TIFF within a window, which GDAL leaves out at times."""
        file, path = self._file, next(iter(self._file.files), "")
        if file.driver != "GTiff" or file.profile.get("compress") != "deflate" or not Path(path).is_file():
            return
        sizes = file.block_shapes[self.band - 1]
        touched = zip(ends, sizes, strict=True)
        blocks = product(*(range(start // size, -(-end // size)) for (start, end), size in touched))
        most = 1 + file.count * max(np.dtype(kind).itemsize for kind in file.dtypes) * sizes[0] * sizes[1]
        with open(path, "rb") as stored:
            for row, column in blocks:
                at, length = (file.get_tag_item(f"BLOCK_{what}_{column}_{row}", "TIFF", bidx=self.band)
                              for what in ("OFFSET", "SIZE"))
                if at:  # else nothing was written there
                    stored.seek(int(at))
                    unpacked = zlib.decompressobj()
                    unpacked.decompress(stored.read(int(length)), most)
                    if not unpacked.eof:
                        raise InputError("is damaged: packed samples end early or go on", code="unreadable")

    def __getitem__(self, window: tuple[slice, ...]) -> np.ma.MaskedArray[Any, Any]:
        spans = [range(size)[part] for size, part in zip(self.shape, window, strict=True)]
        ends = tuple((span.start, span.stop) for span in spans)
        with _gdal(self._name.startswith("/vsi")):
            self._check(ends)
            values = self._file.read(self.band, window=ends)
            flags = {flag.name for flag in self._file.mask_flag_enums[self.band - 1]}
            gone = missing_samples(values, self._nodata)
            if not flags & ({"all_valid"} if self._nodata is None else {"all_valid", "nodata"}):
                gone |= self._file.read_masks(self.band, window=ends) == 0
            colours = [each.name for each in self._file.colorinterp]
            # GDAL masks by alpha of bytes and of unsigned 16 bits alone
            if "alpha" in colours and "alpha" not in flags and colours[self.band - 1] != "alpha":
                gone |= self._file.read(1 + colours.index("alpha"), window=ends) == 0
        if not self._plain:
            values = values * np.float64(self.scale) + self.offset
        return np.ma.masked_array(values, gone)


def of_dataset(dataset: Any, band: int | None = None, nodata: float | None = None) -> Field:
    """A band of a dataset of rasterio as a field, whose samples stay in the file until windows are read.

    Raises
    ------
    InputError, OptionError
        As `RasterBand`.
    """
    samples: Any = RasterBand(dataset, band, nodata)
    with _gdal():
        where, remark = place_of(dataset)
    at = samples.band - 1
    return placed_field(samples, None, where, [remark] if remark else [], name=dataset.descriptions[at],
                        unit=dataset.units[at])


def read(path: str, key: str | None = None, band: int | None = None, nodata: float | None = None) -> Field:
    """Open a file, and take a band; parameters and errors as of `open_` and `RasterBand`."""
    return of_dataset(open_(path, key), band, nodata)


def place_of(dataset: Any) -> tuple[Placement | None, str]:
    """Placement of the samples of a dataset, which lie in the middle of pixels, and a remark on what is left out."""
    a, b, c, d, e, f = dataset.transform[:6]
    crs = crs_text(dataset.crs)
    if not dataset.transform.is_identity:
        remark = "its reference system is left out: it is not one of the earth" if dataset.crs and not crs else ""
        return Placement([[b, a, c + (a + b) / 2], [e, d, f + (d + e) / 2]], crs=crs), remark
    if kind := "ground control points" if dataset.gcps[0] else "rational polynomials" if dataset.rpcs else "":
        return None, (f"its coordinates are ignored: it has {kind}, no steps between pixels; warp it first (gdalwarp), "
                      "or give an isocodec.Field with a placement")
    return None, "its reference system is ignored, as it places no pixels" if crs else ""


def _band_of(file: Any, band: int | None) -> int:
    colours, kinds = [each.name for each in file.colorinterp], file.dtypes
    listed = ", ".join(
        f"{number} ({', '.join(plain(each) for each in about if each)})"
        for number, *about in zip(file.indexes, file.descriptions, colours, kinds, strict=True)
    )
    known = [number for number, colour in zip(file.indexes, colours, strict=True) if colour != "alpha"]
    if band is not None and band not in file.indexes:
        raise OptionError(f"there is no band {band}: it holds {listed}", code="channel")
    if band is None and len(known) != 1:
        raise InputError(f"holds {file.count} bands: {listed}", code="colour",
                         remedy="choose one with --band (band= in Python)")
    number = int(known[0] if band is None else band)
    structure = file.tags(number, ns="IMAGE_STRUCTURE").get("NBITS"), file.tags(ns="IMAGE_STRUCTURE").get("MINISWHITE")
    if band is None and colours[number - 1] == "palette" and structure[0] != "1" and structure[1] != "YES":
        raise InputError("holds indices of a palette, not samples", code="palette",
                         remedy="band=1 (--band 1) takes the indices; or save it as grey")
    if "complex" in kinds[number - 1]:
        raise InputError(f"holds complex numbers ({kinds[number - 1]}), not real numbers", code="dtype",
                         remedy="write its real part or its modulus first")
    return number
