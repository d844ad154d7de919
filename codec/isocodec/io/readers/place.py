"""Where the samples of a file lie in the world: what volumes, TIFF pictures and NetCDF arrays say of it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...errors import OptionError, plain
from ...field.placement import Placement, matrix_of
from .axes import MappedPlace, auxiliary, beside, placed_grid, scales_of, text_of
from .dicom import DICOM_SUFFIXES, dicom_matrix, is_series
from .engines import is_labelled_file, read_labels
from .hdf5 import HDF5_SUFFIXES, dataset
from .labelled import DEGREES, Labels
from .raster import TIFF_SUFFIXES, opened_tiff
from .reading import reading
from .source import Source, source_of
from .volume import ITK_SUFFIXES, NIFTI_SUFFIXES, itk_reader, open_nifti
from .vti import VTI_SUFFIXES, vti_matrix

# Tags of a TIFF file.
_SCALE, _TIEPOINT, _TRANSFORMATION = 33550, 33922, 34264
# Values of GeoKeys.
_GEOGRAPHIC = 2
_IS_POINT = 2
"""Raster type whose coordinates are those of the samples; otherwise samples are half a pixel further on."""
_EPSG = range(1024, 32767)
"""Numbers of systems that the EPSG registry has."""
_EVEN = 0.01
"""How far coordinates of samples may be from even steps, in steps: they are often kept in single precision."""


@dataclass(frozen=True)
class Place:
    """What a file says of where its samples lie.

    Attributes
    ----------
    placement : (n, n + 1) float64, or None
        A row for each coordinate: what a step along each axis of the array adds to it, and what it is at sample 0.
    crs : str or None
        The reference system of the coordinates, as ``EPSG:32631``.
    remark : str
        What the file says and is left out, and why; or nothing.
    mapped : MappedPlace or None
        Instead of a placement, coordinates that are no even steps, or that go round.
    """

    placement: NDArray[np.float64] | None = None
    crs: str | None = None
    remark: str = ""
    mapped: MappedPlace | None = None

    @property
    def record(self) -> Placement:
        """The same as a placement."""
        if self.mapped is None:
            return Placement(self.placement, None, self.crs, remark=self.remark)
        return Placement(
            None, self.mapped.coordinates, self.crs, self.mapped.periodic, self.mapped.period, None, self.remark, True
        )


def read_place(
    path: str | os.PathLike[str], n: int, key: str | None = None, *, samples: int | None = None, follow: bool = False,
    frame: int | None = None,
) -> Place:
    """Coordinates of a field of n axes that ``read_field`` has read, with the same key and the same bounds.

    Of volumes those of nibabel: x to the right, y to the front, z up.

    Raises
    ------
    OSError, InputError, LimitError, MissingExtraError
        As `read_field`.
    """
    source = source_of(path, samples, follow)
    if is_labelled_file(source):
        labels = read_labels(source, key, frame)
        return Place() if labels is None else _of_labels(labels)
    if is_series(source.path) or source.named(*DICOM_SUFFIXES):
        if n != 3:
            return Place(remark="the position of a slice in space is ignored")
        return usable(dicom_matrix(source, key), n)
    if source.named(*VTI_SUFFIXES):
        return usable(vti_matrix(source), n)
    if source.named(*NIFTI_SUFFIXES):
        with reading("NIfTI volume"):
            image = open_nifti(source)
        if n != 3:
            return Place(remark="the position of a slice in space is ignored")
        place = usable(image.affine, n)
        unit = image.header.get_xyzt_units()[0]
        if place.placement is not None and unit not in ("unknown", "mm"):
            return replace(place, remark=f"the unit of its coordinates, {unit}, is ignored")
        return place
    if source.named(*TIFF_SUFFIXES):
        with reading("TIFF"), opened_tiff(source) as tiff:
            place = _of_picture(tiff.pages[0], n)
            return _of_microscope(tiff, n) if place.placement is None and not place.remark else place
    if source.named(*ITK_SUFFIXES):
        with reading("volume"):
            return of_itk(itk_reader(source), n)
    if source.named(*HDF5_SUFFIXES):
        with dataset(source, key) as stored:
            return _of_scales(source, stored, n)
    if source.named(".npz"):
        return Place(mapped=beside(source, n))
    return Place()


def _of_labels(labels: Labels) -> Place:
    """What a labelled array says; its coordinates may not have even steps."""
    if labels.coordinates is not None:
        turns = labels.crs == DEGREES and len(labels.shape) == 2
        return Place(crs=labels.crs, mapped=placed_grid(list(labels.coordinates), labels.shape, turns))
    return Place(labels.placement, labels.crs, "; ".join(labels.remarks))


def of_itk(reader: Any, n: int) -> Place:
    """What ITK knows of a volume, or of each of a series, whose x runs to the left and y to the back."""
    size = reader.GetDimension()
    if n != 3 or size < 3:
        return Place(remark="the position of a slice in space is ignored")
    directions = (np.reshape(reader.GetDirection(), (size, size)) * reader.GetSpacing())[:3, :3]
    matrix = np.column_stack([directions, reader.GetOrigin()[:3]])
    if np.array_equal(matrix, np.eye(3, 4)):  # what ITK says where a file says nothing
        return Place()
    return usable(np.diag([-1.0, -1.0, 1.0]) @ matrix, n)


def _of_scales(source: Source, stored: Any, n: int) -> Place:
    """What scales of a dataset's axes say, as far as these are kept in the file."""
    axes = [(count, _scales(source, stored, axis)) for axis, count in enumerate(stored.shape) if count > 1][-n:]
    shape = [count for count, _ in axes]
    if any(" since " in str(scale.attrs.get("units")) for _, scales in axes for scale in scales):
        return Place(remark="its coordinates are ignored, as one of its axes is time; choose one time with --frame")
    found = [_scale(*axis) for axis in axes]
    scales = [None if one is None else one[0] for one in found]
    curvilinear = auxiliary(stored, shape, scales[0] if n == 3 else None)
    if curvilinear is not None:
        return Place(mapped=curvilinear)
    if all(scale is None for scale in scales):
        return Place()
    steps = []
    even = True
    for axis, scale in enumerate(scales):
        if scale is None:
            return Place(remark="its coordinates are ignored: not all axes have them")
        step = (scale[-1] - scale[0]) / (len(scale) - 1)
        each = np.diff(scale)
        if not (np.isfinite(scale).all() and ((each > 0).all() or (each < 0).all() or not each.any())):
            return Place(remark=f"its coordinates are ignored: along axis {axis} they neither rise nor fall")
        even &= bool(np.abs(scale - (scale[0] + step * np.arange(len(scale)))).max() <= abs(step) * _EVEN)
        steps.append((step, scale[0]))
    mapped = scales_of([one for one in found if one is not None])
    return _backwards(steps) if even and not mapped.periodic else Place(mapped=mapped)


def _scales(source: Source, stored: Any, axis: int) -> list[Any]:
    scales = [*stored.dims[axis].values()]
    return [scale for scale in scales if source.follow or not (scale.is_virtual or scale.external)]


def _scale(count: int, scales: list[Any]) -> tuple[NDArray[np.float64], str] | None:
    """Coordinates along an axis of so many samples and their unit; None if there are none, or not so many."""
    for scale in scales:
        # NetCDF has scales that only say how long an axis is
        named = "This is a netCDF dimension but not a netCDF variable" not in str(scale.attrs.get("NAME"))
        if named and scale.shape == (count,) and scale.dtype.kind in "iuf":
            return np.asarray(scale[()], np.float64), text_of(scale, "units")
    return None


def _of_microscope(tiff: Any, n: int) -> Place:
    """Sizes of pixels or voxels, as OME and ImageJ have them; these may be damaged in any way."""
    try:
        sizes = _ome_sizes(tiff.ome_metadata) if tiff.ome_metadata else _imagej_sizes(tiff)
    except Exception:
        return Place()
    if not sizes:
        return Place()
    series = tiff.series[0]
    letters = [a for a, count in zip(series.axes, series.shape, strict=True) if count > 1 and a not in "SC"][-n:]
    if letters != [*"ZYX"[-n:]] or not set(letters) <= sizes.keys():
        said = f"its axes are {plain(', '.join(letters))}, and {', '.join(sizes)} have sizes"
        return Place(remark=f"the sizes of its pixels are ignored: {said}; set them with --spacing")
    return _backwards([(sizes[letter], 0.0) for letter in letters])


def _ome_sizes(text: str) -> dict[str, float]:
    pixels = next(e for e in ElementTree.fromstring(text).iter() if e.tag.endswith("Pixels"))
    sizes = {a: pixels.attrib[f"PhysicalSize{a}"] for a in "XYZ" if f"PhysicalSize{a}" in pixels.attrib}
    units = {pixels.get(f"PhysicalSize{a}Unit", "µm") for a in sizes}
    return {a: float(size) for a, size in sizes.items()} if len(units) == 1 else {}


def _imagej_sizes(tiff: Any) -> dict[str, float]:
    notes = tiff.imagej_metadata or {}
    if notes.get("unit", "pixel") in ("", "pixel") and "spacing" not in notes:
        return {}
    tags = tiff.pages[0].tags
    resolutions = {a: tags[f"{a}Resolution"].value for a in "XY" if f"{a}Resolution" in tags}
    sizes = {a: below / above for a, (above, below) in resolutions.items()}
    return sizes | ({"Z": float(notes["spacing"])} if "spacing" in notes else {})


def _backwards(steps: list[tuple[float, float]]) -> Place:
    """Of step and start along each axis of an array: x runs along the last, y along the one before."""
    n = len(steps)
    matrix = np.zeros((n, n + 1))
    for axis, step in enumerate(steps):
        matrix[n - 1 - axis, [axis, n]] = step
    return usable(matrix, n)


def usable(numbers: Any, n: int, keys: Mapping[str, Any] | None = None) -> Place:
    """A place, if the numbers are those of a placement, and its system, which GeoKeys name."""
    try:
        placement = matrix_of(numbers, n)
    except OptionError as error:
        return Place(remark=f"its coordinates are ignored: {error.message}")
    if not keys:
        return Place(placement)
    crs = _system(keys)
    return Place(placement, crs, "" if crs else "its reference system is ignored, as it has no EPSG number")


def _of_picture(page: Any, n: int) -> Place:
    """What the tags of a GeoTIFF say; they may have any type and any number of values."""
    scale, tiepoint, matrix = (_numbers(page, tag) for tag in (_SCALE, _TIEPOINT, _TRANSFORMATION))
    if not (len(scale) or len(tiepoint) or len(matrix)):
        return Place()
    if n != 2:
        return Place(remark="the coordinates of a stack of pages are ignored")
    try:
        keys = dict(page.geotiff_tags or {})
    except Exception:  # of any kind, where the tag is damaged
        keys = {}
    # numbers may be of any size
    with np.errstate(all="ignore"):
        if len(matrix) == 16 and matrix.any():
            across, down, start = matrix.reshape(4, 4)[:2, [0, 1, 3]].T
        elif len(scale) >= 2 and len(tiepoint) >= 6:
            across, down = np.array([scale[0], 0.0]), np.array([0.0, -scale[1]])
            start = tiepoint[3:5] - tiepoint[0] * across - tiepoint[1] * down
        else:
            return Place(remark="its coordinates are ignored: it has single points only, no steps between pixels")
        if keys.get("GTRasterTypeGeoKey") != _IS_POINT:
            start = start + (across + down) / 2
    return usable(np.column_stack([down, across, start]), n, keys)


def _numbers(page: Any, tag: int) -> NDArray[np.float64]:
    """Values of a tag; none if it is not there or holds none."""
    try:
        return np.atleast_1d(np.asarray(page.tags[tag].value, np.float64))
    except (KeyError, TypeError, ValueError):
        return np.zeros(0)


def _system(keys: Mapping[str, Any]) -> str | None:
    """The reference system that GeoKeys name: of the model that they state, or the one that is there."""
    names = ["ProjectedCSTypeGeoKey", "GeographicTypeGeoKey"]
    if keys.get("GTModelTypeGeoKey") == _GEOGRAPHIC:
        names.reverse()
    numbers = [keys.get(name) for name in names]
    number = next((number for number in numbers if isinstance(number, int) and number > 0), 0)
    return f"EPSG:{int(number)}" if number in _EPSG else None
