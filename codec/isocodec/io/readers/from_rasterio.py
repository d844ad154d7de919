"""Rasterio (GDAL) reads rasters: GeoTIFF, elevation models, GeoPackages and mosaics, a window at a time."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, OptionError, plain
from ...extras import optional
from ...field.cropping import spans_within
from ...field.missing import missing_samples
from ...field.placement import Placement
from ...field.reference_system import crs_text
from ...field.sampled import Field
from ...limits import patience
from .opened import Choice, Format, Opened, Windows
from .place_of_samples import placed
from .reading import LISTED, about, check_frame, reading, said, upright
from .source import InputFile, beginning

TIFF, PACKAGE, _MOSAIC = (".tif", ".tiff"), ".gpkg", ".vrt"
HEADER, IMAGE = ".hdr", ".img"
"""Suffixes of pairs of files, not of rasters alone."""
DRIVERS = dict.fromkeys(TIFF, ("GTiff",)) | {
    PACKAGE: ("GPKG",), _MOSAIC: ("VRT",), ".asc": ("AAIGrid", "GRASSASCIIGrid"), ".hgt": ("SRTMHGT",),
    IMAGE: ("HFA", "ENVI"), ".dem": ("USGSDEM",), ".bil": ("EHdr", "ENVI"), ".bip": ("EHdr", "ENVI"),
    ".bsq": ("EHdr", "ENVI"), ".flt": ("EHdr",), ".dt0": ("DTED",), ".dt1": ("DTED",), ".dt2": ("DTED",),
    ".jp2": ("JP2OpenJPEG",), ".sdat": ("SAGA",), ".rst": ("RST",), ".grd": ("GSBG", "GS7BG", "GSAG"), ".bt": ("BT",),
}
"""Drivers of GDAL by suffix. It never goes by content: other drivers open what a file names, servers included."""
_MOSAIC_TAGS = re.compile(
    "VRTDataset|SRS|GeoTransform|Metadata|MDI|VRTRasterBand|Description|UnitType|Offset|Scale|CategoryNames|Category|"
    "ColorInterp|ColorTable|Entry|NoDataValue|HideNoDataValue|MaskBand|SimpleSource|ComplexSource|SourceFilename|"
    "SourceBand|SourceProperties|SrcRect|DstRect|NODATA|ScaleOffset|ScaleRatio|UseMaskBand|OverviewList|Histograms"
)
"""Elements of a mosaic, of which one names files."""
_FURTHER = "OVERVIEW_FILE"
"""Note by which GDAL finds another file."""
_RAW, _PACKED = ("EHdr", "ENVI"), b"\x1f\x8b"
"""Drivers that give zeros for samples that are not there; beginning of a file that is packed."""


@contextmanager
def _gdal(source: InputFile) -> Iterator[Any]:
    """Rasterio, with GDAL kept from servers that nobody named and its errors turned into ours."""
    rasterio = optional("rasterio", extra="raster", purpose=f"reading {source.path.suffix}")
    options = {
        "GDAL_VRT_ENABLE_PYTHON": "NO", "OGR_SQLITE_ALLOW_EXTERNAL_ACCESS": "NO", "DTED_VERIFY_CHECKSUM": "YES",
        "GDAL_HTTP_TIMEOUT": str(patience()), "GDAL_HTTP_CONNECTTIMEOUT": str(patience()),
    }
    if not (source.follow or source.virtual):
        options["CPL_VSIL_CURL_ALLOWED_FILENAME"] = "none"
    with reading("raster"), warnings.catch_warnings(), rasterio.Env(**options):
        warnings.simplefilter("ignore")  # of files without coordinates
        try:
            yield rasterio
        except rasterio.errors.RasterioError as exc:
            text = said(exc.__cause__ or exc)
            remedy = "save it with LZW, Deflate or Zstandard" if "missing codec" in text else None
            raise InputError(f"cannot be read ({text})", code="unreadable", remedy=remedy) from exc


def _dataset(source: InputFile, drivers: Sequence[str], key: str | None = None) -> Any:
    """Open a raster by the first of some drivers that knows it; if it holds several, the one that a key names."""
    with _gdal(source) as rasterio:
        for driver in drivers:
            try:
                found = rasterio.open(source.target, driver=driver)
                break
            except rasterio.errors.RasterioIOError:
                if driver == drivers[-1]:
                    raise
        if not (source.follow or source.virtual):
            other = found.tags(ns="OVERVIEWS").get(_FURTHER)
            for each in map(Path, [other] if other else found.files if driver == "HFA" else []):
                source.beside(each.name if each.parent == Path(source.target).parent else str(each))
            if driver in _RAW and source.path.open("rb").read(2) != _PACKED:
                bits = int(found.tags(1, ns="IMAGE_STRUCTURE").get("NBITS", 8 * np.dtype(found.dtypes[0]).itemsize))
                source.check_bytes(found.count * found.height * found.width * bits // 8)
        # GTIFF_DIR:1:path, GPKG:path:table
        names = {each.split(":")[1 if driver == "GTiff" else -1]: each for each in found.subdatasets}
        names = names or ({"1": source.target} if driver == "GTiff" else {})
        listed = ", ".join(map(plain, [*names][:LISTED]))
        if key is not None and key not in names:
            raise OptionError(f"there is no raster {plain(key)} in it", code="key",
                              remedy=f"choose one of {listed}" if names else "leave out --key: it holds one")
        if key is None and not found.count:
            raise InputError(f"holds {len(names)} rasters: {listed}", code="key", remedy="choose one with --key")
        return found if key is None else rasterio.open(names[key], driver=driver)


def _check_beside(source: InputFile, drivers: Sequence[str]) -> None:
    """Check the files that GDAL opens by content for a raster: masks and overviews beside it, parts of a mosaic."""
    path = source.path
    for name in (f"{stem}.{kind}" for stem in (path.name, path.stem) for kind in ("msk", "ovr", "aux.xml")):
        other = path.with_name(name)
        if other != path and other.is_file():
            data = other.read_bytes()
            if (_FURTHER.encode() in data) if name.endswith("xml") else data[:2] not in (b"II", b"MM"):
                raise source.refused(name, "which leads to further ones")
    if drivers != DRIVERS[_MOSAIC]:
        return
    with reading("mosaic"):
        elements = [*ElementTree.parse(path).getroot().iter()]
    for each in elements:
        name = each.text or ""
        if not _MOSAIC_TAGS.fullmatch(each.tag) or each.get("subClass") or each.get("key") == _FURTHER:
            raise source.refused(each.get("subClass") or str(each.tag), "by more than its name")
        if each.tag == "SourceFilename":
            part = replace(source, path=source.beside(name))
            known = DRIVERS.get(part.path.suffix.lower(), DRIVERS[_MOSAIC])
            if each.get("relativeToVRT") != "1" or known == DRIVERS[_MOSAIC]:
                raise source.refused(name)
            _check_beside(part, known)
            _dataset(part, known).close()


class RasterWindows(Windows):
    """A band of a raster, counted from 1, by slices: scaled as the file states, masked where samples are missing.

    Attributes
    ----------
    nodata : float or None
        Value of missing samples as they are stored, instead of what the file states; NaN: none.
    """

    nodata: float | None = None

    def __init__(self, source: InputFile, drivers: Sequence[str], choice: Choice) -> None:
        self._source, self._drivers, self._key = source, drivers, choice.key
        file = self._file
        self.band = _band_of(file, choice)
        self.scaling = (file.scales[self.band - 1], file.offsets[self.band - 1])
        self.dtype = np.dtype(file.dtypes[self.band - 1] if self.scaling == (1, 0) else np.float64)
        self._start, self.shape = (0, 0), (file.height, file.width)
        if choice.bbox is not None:
            rows, columns = spans_within(self.place(), self.shape, choice.bbox)
            self._start = (rows.start, columns.start)
            self.shape = (rows.stop - rows.start, columns.stop - columns.start)
        source.check_array(self.shape, self.dtype)

    @cached_property
    def _file(self) -> Any:
        return _dataset(self._source, self._drivers, self._key)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def place(self) -> Placement:
        """Place the samples, which lie in the middle of pixels."""
        with _gdal(self._source):
            file = self._file
            a, b, c, d, e, f = file.transform[:6]
            system = crs_text(file.crs)
            remark = "its reference system is left out: it is not one of the earth" if file.crs and not system else ""
            if file.transform.is_identity:
                remark = "its reference system is ignored, as it places no pixels" if system else ""
                if kind := "ground control points" if file.gcps[0] else "rational polynomials" if file.rpcs else "":
                    remark = (f"its coordinates are ignored: it has {kind}, no steps between pixels; warp it first, or "
                              "set --transform")
                return Placement(remark=remark)
        row, column = (start + 0.5 for start in self._start)
        found = placed([[b, a, c + b * row + a * column], [e, d, f + e * row + d * column]], 2, system)
        return replace(found, remark=found.remark or remark)

    def __getitem__(self, window: tuple[slice, ...]) -> np.ma.MaskedArray[Any, Any]:
        within = [range(size)[part] for size, part in zip(self.shape, window, strict=True)]
        ends = tuple((start + part.start, start + part.stop) for start, part in zip(self._start, within, strict=True))
        with _gdal(self._source):
            values = self._file.read(self.band, window=ends)
            flags = {flag.name for flag in self._file.mask_flag_enums[self.band - 1]}
            gone = missing_samples(values, self.nodata)
            if not flags & ({"all_valid"} if self.nodata is None else {"all_valid", "nodata"}):
                gone |= self._file.read_masks(self.band, window=ends) == 0
            colours = [each.name for each in self._file.colorinterp]
            # GDAL masks by alpha of bytes and of unsigned 16 bits alone
            if "alpha" in colours and "alpha" not in flags and colours[self.band - 1] != "alpha":
                gone |= self._file.read(1 + colours.index("alpha"), window=ends) == 0
        if self.scaling != (1, 0):
            values = values * np.float64(self.scaling[0]) + self.scaling[1]
        return np.ma.masked_array(values, gone)


def _band_of(file: Any, choice: Choice) -> int:
    """Choose a band, which has to hold real numbers; alpha only if it is asked for."""
    colours, kinds = [each.name for each in file.colorinterp], file.dtypes
    listed = ", ".join(
        f"{number} ({', '.join(plain(each) for each in about if each)})"
        for number, *about in zip(file.indexes, file.descriptions, colours, kinds, strict=True)
    )
    known = [number for number, colour in zip(file.indexes, colours, strict=True) if colour != "alpha"]
    if choice.channel is not None:
        known = [number for number in file.indexes if number == choice.channel + 1]
        if not known:
            raise OptionError(f"there is no band {choice.channel + 1}: it holds {listed}", code="channel")
    if len(known) != 1:
        raise InputError(f"holds {file.count} bands: {listed}", code="colour", remedy="choose one with --band")
    (band,) = known
    bits = file.tags(band, ns="IMAGE_STRUCTURE").get("NBITS")
    grey = bits == "1" or file.tags(ns="IMAGE_STRUCTURE").get("MINISWHITE") == "YES"
    if choice.channel is None and not choice.labels and colours[band - 1] == "palette" and not grey:
        raise InputError("holds indices of a palette, not samples", code="palette",
                         remedy="--label (labels= in Python) takes them as labels; or save it as grey")
    if "complex" in kinds[band - 1]:
        raise InputError(f"holds complex numbers ({kinds[band - 1]}), not real numbers", code="dtype")
    return band


def place_beside(source: InputFile, driver: str) -> Placement:
    """Place the samples of a picture by what files beside it state: world files, notes of GDAL."""
    with closing(RasterWindows(source, (driver,), Choice(channel=0))) as band:
        return band.place()


class Raster(Opened):
    """A band of a raster, of a file with so many ``pages`` if it holds several."""

    _orientation: Any = 1

    def _open(self, choice: Choice) -> None:
        source = self._source
        drivers = next((found for end, found in DRIVERS.items() if source.target.lower().endswith(end)), ("ENVI",))
        if not (source.follow or source.virtual):
            _check_beside(source, drivers)
        elif not source.follow and drivers == DRIVERS[_MOSAIC]:
            raise source.refused("parts of a mosaic")
        self._band = band = RasterWindows(source, drivers, choice)
        file, at = self.hold(closing(band._file)), band.band - 1
        self.pages = len(file.subdatasets)
        self.shape, self.dtype, self.nodata = band.shape, band.dtype, file.nodatavals[at]
        self.name, self.unit = file.descriptions[at], file.units[at]

    def field(self, frame: int | None = None, *, nodata: float | None = None) -> Field:
        """Read a field with all that the input states; ``nodata`` as stored, before scaling."""
        if frame is not None:
            check_frame(frame, 0)
        with about(self.label):
            self._band.nodata = nodata
            found: Any = self._band[:, :]
            place = self._band.place()
            if self._orientation not in (None, 1):
                found = upright(found, self._orientation)
        return Field(
            found.data, found.mask if found.mask.any() else None, place if place.placed else None, unit=self.unit,
            name=self.name, remarks=(place.remark,) if place.remark else (),
        )

    def _values(self, frame: int | None) -> NDArray[Any]:
        return np.asarray(self.field(frame).values)

    def _place(self, n: int, frame: int | None) -> Placement:
        return self._band.place()

    def windows(self, nodata: float | None = None) -> Any:
        """Give the samples by windows, but none of a picture that has to be turned; see `Opened.windows`."""
        self._band.nodata = nodata
        return self._band if self._orientation in (None, 1) else None

    def turned(self, orientation: Any) -> Raster:
        """Show a picture of an orientation upright; one with coordinates stays as it is stored, as they do."""
        if not self._band.place().placed:
            self._orientation = orientation
            self.shape = upright(np.broadcast_to(0, self._band.shape), orientation).shape
        return self


def has_header(path: Path) -> bool:
    """Whether a file is a header, or has one beside it, that begins as those of ENVI do."""
    own = path.suffix.lower() == HEADER
    headers = [path] if own else [path.with_suffix(HEADER), path.with_suffix(HEADER.upper()), Path(f"{path}{HEADER}")]
    return any(each.is_file() and beginning(each, 4) == b"ENVI" for each in headers)


def _headed(source: InputFile, choice: Choice) -> Raster:
    """Open what a header of ENVI is about: the file of its name with another suffix, or without one."""
    path = source.path
    if path.suffix.lower() != HEADER:
        return Raster(source, choice)
    names = sorted(each.name for each in path.parent.iterdir() if path.stem in (each.stem, each.name) and each != path
                   and each.suffix.lower() in ("", ".dat", ".raw", ".bin", *DRIVERS))
    if len(names) != 1:
        raise InputError(f"is a header, with {len(names)} files of samples beside it", code="other-file",
                         remedy="give the file with the samples")
    return Raster(replace(source, path=source.beside(names[0])), choice)


_SUFFIXES = tuple(suffix for suffix in DRIVERS if suffix not in TIFF)
FORMATS = (Format("raster", _SUFFIXES, Raster, extra="raster", channels=True, keyed=True),)
HEADED = replace(FORMATS[0], suffixes=(), open=_headed)
