"""Open files by the library that owns their format, and take objects that other libraries hold in memory."""

from __future__ import annotations

import errno
import os
import sys
import warnings
import weakref
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any, TypeAlias

import numpy as np

from ..errors import InputError, IsoError, MissingExtraError, OptionError, plain
from ..field.cropping import Box, PartWindows, cropped, part_of, spans_within
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.missing import missing_samples
from ..field.sampled import Field
from ..storage.content import is_file, is_url, local
from ..verbs import Choice
from . import arrays, clouds, dicom, images, labelled, rasters, volumes, vtk
from .in_turn import InTurn
from .stores import is_store

__all__ = ["SUFFIXES", "Choice", "about", "is_described", "load", "of_object", "read"]

Found: TypeAlias = Field | Frames | Mesh
_GRIB = (".grib", ".grib2", ".grb", ".grb2")
_SIGNATURES = {
    b"\x93NUMPY": ".npy", b"PK\3\4": ".npz", b"\x89HDF\r\n\x1a\n": ".h5", b"CDF": ".nc", b"\x89PNG": ".png",
    b"\xff\xd8\xff": ".jpg", b"II*\0": ".tif", b"MM\0*": ".tif", b"II+\0": ".tif", b"MM\0+": ".tif", b"NRRD": ".nrrd",
    b"\x1f\x8b": ".nii.gz",
}
"""Suffixes of files without a name by their first bytes."""
_NIFTI = b"\x5c\1\0\0", b"\0\0\1\x5c"
"""First bytes of headers of NIfTI and Analyze that lie beside samples: their sizes."""


def read(
    source: Any, *, key: str | None = None, band: int | None = None, frame: int | None = None, frames: bool = False,
    bbox: Box | None = None, nodata: float | None = None,
) -> Found:
    """Read a sampled field, a series of fields, or values on a mesh, with all that its source states.

    Parameters
    ----------
    source : str, path, file object, or object of another library
        A file of a format of the command line, which is opened by the library that owns the format; a URL
        (``https://``, ``s3://``, .. as fsspec knows them); a file opened in binary mode; or an object: a DataArray or
        Dataset of xarray, a dataset of rasterio, an image of SimpleITK, nibabel or Pillow, a Volume of highdicom, a
        grid, mesh or blocks of VTK or PyVista, a mesh of meshio, a table of pandas or geopandas, points of laspy, an
        array. A `Field`, `Frames` or `Mesh` stays as it is.
    key : str, optional
        Name of the array in a source that holds several: a variable (``group/name``), a level of OME-Zarr, a page of a
        TIFF (from 1), a series or segment of DICOM, a block and component of VTK (``velocity:x``,
        ``velocity:magnitude``, ``block/velocity:x``), the values of a mesh or of points. Without it the only array is
        taken (of HDF5, netCDF and Zarr the only one of two or more axes), or the one named ``values``; of meshes and
        points the only values, those named ``z``, or else none.
    band : int, optional
        Band of a raster or channel of a picture, counted from 1. Of a palette, 1 takes the indices.
    frame : int, optional
        Which of a series, counted from 0: along the axis of times, or else the first axis of an array or a TIFF stack,
        the last axis of volumes that have more than three.
    frames : bool
        Give a series: each field is read when it is asked for. With ``frame``, the slices of that volume.
    bbox : sequence of float, optional
        Read only samples within these coordinates of the placement: least x, y (, z), then largest x, y (, z). No
        more of a raster is read.
    nodata : float, optional
        Value of missing samples besides NaN, instead of the one that the source states, as it is stored. NaN: none.

    Returns
    -------
    Field, Frames or Mesh
        A Mesh of the files of meshes, point clouds, tables of points and vector files. Otherwise values with the axes
        and the type that they have in the source (truth values of files are uint8), placed in the coordinates that it
        states: x, y (, z), of medical volumes to the right, the front and upwards. Pictures are (rows, columns), TIFF
        stacks (pages, rows, columns), volumes (i, j, k) as stored: with their integer type if they state no scaling or
        one by whole numbers, otherwise scaled to float64, as packed arrays of netCDF are.

    Raises
    ------
    OSError
        If a file cannot be opened.
    InputError
        If it cannot be read, or leaves a choice open; the message begins with its name.
    LimitError
        If there is not enough memory.
    OptionError
        If an option does not apply to this source.
    MissingExtraError
        If a library is needed that is not installed.

    Warns
    -----
    UserWarning
        Of what the source states and a field cannot keep; also in ``Field.remarks``.
    """
    found = load(source, Choice(key, band, bbox, frame, None if nodata is None else float(nodata), frames))
    for remark in getattr(found.fields if isinstance(found, Frames) else found, "remarks", ()):
        warnings.warn(remark, stacklevel=2)
    return found


def load(source: Any, choice: Choice, lazy: bool = False) -> Found:
    """Read as `read` does, but leave remarks to the caller; those of a series are an attribute of its ``fields``.

    With ``lazy``, samples of a field are read by windows later, if the format can do that.
    """
    choice = replace(choice, lazy=lazy)
    if choice.band is not None and choice.band < 1:
        raise OptionError("bands are counted from 1", code="channel")
    copied = is_url(source) or (is_file(source) and not is_described(source))
    if not copied and not isinstance(source, str | os.PathLike):
        return of_object(source, choice)
    name = source if isinstance(source, str | os.PathLike) else getattr(source, "name", "")
    with ExitStack() as held, about(name):
        if not copied:
            return _of_path(os.fspath(source), choice)
        found = _of_path(str(held.enter_context(local(source, _recognised))), choice)
        kept: Any = found.fields if isinstance(found, Frames) else found.values if lazy else None
        if kept is not None:  # the copy goes when the samples do
            weakref.finalize(kept, held.pop_all().close)
        return found


def of_object(thing: Any, choice: Choice) -> Found:
    """Take an object of another library that is in memory, as `read` does.

    Raises
    ------
    InputError
        If no library is known that has such objects.
    OptionError
        If a choice does not apply to it.
    """
    if isinstance(thing, Field | Frames | Mesh):
        return _taken(lambda it, _: it, "", thing, choice)
    if known := _of_library(thing):
        return _taken(*known, thing, choice)
    # whoever has a masked array has loaded numpy.ma, which takes longer than a small field
    masked = "numpy.ma" in sys.modules and isinstance(thing, np.ma.MaskedArray)
    values = thing if masked else np.asarray(thing)
    if values.dtype.kind in "OUSV":
        raise InputError(f"is a {type(thing).__name__}, not numbers", code="dtype",
                         remedy="give a path, a URL, an open file, an array, or an object that isocodec.read lists")
    return _taken(arrays.of_array, "frame frames", values, choice)


_Taker: TypeAlias = Callable[[Any, Choice], Found]
_OBJECTS: dict[str, tuple[_Taker, str]] = {
    "xarray.Dataset": (labelled.of_labelled, "key frame frames nodata"),
    "xarray.DataArray": (labelled.of_labelled, "frame frames nodata"),
    "pandas.DataFrame": (labelled.of_labelled, "nodata"), "geopandas.GeoDataFrame": (clouds.of_shapes, "key"),
    "laspy.LasData": (clouds.of_cloud, "key"), "rasterio.DatasetBase": (rasters.of_dataset, "band nodata"),
    "PIL.Image": (images.of_picture, "band"), "SimpleITK.Image": (volumes.of_itk, "band frame frames"),
    "nibabel.SpatialImage": (volumes.of_nibabel, "band frame frames"), "highdicom.Volume": (dicom.of_volume, ""),
    "vtkmodules.vtkDataObject": (vtk.of_vtk, "key"), "meshio.Mesh": (vtk.of_meshio, "key"),
}
"""Objects of other libraries: what reads them, and what can be chosen, by library and class."""
_FILES: dict[str, tuple[tuple[str, ...], _Taker, str]] = {
    "labelled": (labelled.SUFFIXES, labelled.open_, "key band frame frames nodata"),
    "volume": (volumes.SUFFIXES, volumes.open_, "key band frame frames"),
    "slices": (dicom.SUFFIXES, dicom.open_, "key band frame frames nodata"),
    "vtk": (vtk.SUFFIXES, vtk.open_, "key frame frames"), "array": (arrays.SUFFIXES, arrays.open_, "key frame frames"),
    "picture": ((*images.FORMATS,), images.open_, "band"),
    "tiff": (rasters.TIFF, images.open_tiff, "key band frame frames nodata"),
    "cloud": (clouds.SUFFIXES, clouds.open_, "key"), "raster": (rasters.SUFFIXES, rasters.read, "key band nodata"),
}
"""Files: their suffixes, what reads them, and what can be chosen."""
SUFFIXES = (*dict.fromkeys(suffix for suffixes, _, _ in _FILES.values() for suffix in suffixes),)
"""Suffixes of the formats that are read."""


def _of_library(thing: Any) -> tuple[_Taker, str] | None:
    """Find what reads an object of a class of another library, or of one derived from it."""
    names = [f"{each.__module__.partition('.')[0]}.{each.__name__}" for each in type(thing).__mro__]
    names += ["xarray.DataArray"] * hasattr(thing, "isel")
    return next((_OBJECTS[name] for name in names if name in _OBJECTS), None)


def is_described(thing: Any) -> bool:
    """Whether something holds more than an array does, which would be lost if it were taken for one."""
    return _of_library(thing) is not None


def _taken(take: _Taker, options: str, what: Any, choice: Choice) -> Found:
    """Read something within a box by the options that apply; raises `OptionError` if others are given."""
    for option in {"key", "band", "frame", "frames"} - {*options.split()}:
        if getattr(choice, option) is not (False if option == "frames" else None):
            kind = what.suffix or "a file" if isinstance(what, Path) else type(what).__name__
            raise OptionError(f"{option} does not apply to {plain(kind)}", code=option)
    found = take(what, choice)
    if isinstance(found, Mesh):
        for option in ("band", "bbox", "nodata"):
            if getattr(choice, option) is not None:
                raise OptionError(f"{option} does not apply to meshes and points", code=option)
        return found
    rest = replace(choice, nodata=None) if "nodata" in options else choice
    if isinstance(found, Field):
        return _part(found, rest)
    fields: Any = found.fields
    if rest.bbox is None and rest.nodata is None:
        return found
    parts = InTurn(len(fields), lambda at: _part(fields[at], replace(rest, lazy=False)), fields.whole, fields.remarks)
    return replace(found, fields=parts)


def _part(field: Field, choice: Choice) -> Field:
    """Cut a field to a box, mark more samples as missing, and read them unless that may wait."""
    windowed = getattr(field.values, "windowed", False)
    if choice.bbox is not None and windowed and choice.lazy:
        spans = spans_within(field.placement, field.shape, choice.bbox)
        values: Any = PartWindows(field.values, spans)
        assert field.placement is not None
        return replace(field, values=values, placement=part_of(field.placement, spans, field.shape))
    if choice.bbox is not None:
        field = cropped(field, choice.bbox)
    elif windowed and not choice.lazy:
        field = replace(field, values=field.values[(slice(None),) * len(field.shape)])
    if choice.nodata is None:
        return field
    gone = missing_samples(np.asarray(field.values), choice.nodata)
    gone = gone if field.mask is None else field.mask | gone
    return replace(field, mask=gone if gone.any() else None)


def _of_path(path: str, choice: Choice) -> Found:
    """Read a file or a folder by the library of its suffix, or, if unknown, by the libraries that know most formats."""
    name, at = path.rstrip("/").lower(), Path(path)
    what: Any = path if path.startswith("/vsi") else at
    if what is at and not at.exists():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)
    if name.endswith(_GRIB):
        raise InputError("is GRIB, whose rows libraries flip in some scanning modes", code="grib",
                         remedy="convert it first: cdo -f nc copy IN OUT.nc; or give a DataArray of cfgrib")
    kind = next((each for each, (suffixes, _, _) in _FILES.items() if name.endswith(suffixes)), "")
    if at.is_dir():
        kind = "labelled" if is_store(at) or kind == "labelled" else "slices"
    elif _begins(at, b"DICM", 128):
        kind = "slices"
    elif at.suffix in (".hdr", ".img") and _begins(at.with_suffix(".hdr"), _NIFTI):
        kind = "volume"
    elif kind == "cloud" and clouds.holds_raster(at):
        kind = "raster"
    if kind:
        return _taken(*_FILES[kind][1:], what, choice)
    if at.suffix.lower() == ".hdr":
        raise InputError("is a header", code="other-file", remedy="give the file with the samples")
    for kind in ("raster", "vtk"):
        with suppress(InputError, MissingExtraError):
            return _taken(*_FILES[kind][1:], what, choice)
    suffix = plain(at.suffix) or "a name without a suffix"
    raise InputError(f"{suffix} is not a supported format of fields", code="suffix",
                     remedy="one of " + ", ".join(SUFFIXES))


def _begins(path: Path, signs: Any, at: int = 0) -> bool:
    """Whether a file has such bytes at some place near its beginning."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(132).startswith(signs, at)


def _recognised(name: str, first: bytes) -> str | None:
    """Find the suffix of a format: the one that a name ends in, or else that of the first bytes."""
    lower = PurePosixPath(name).name.lower()
    named = max((each for each in (*SUFFIXES, *_GRIB) if lower.endswith(each)), key=len, default=None)
    return named or next((suffix for sign, suffix in _SIGNATURES.items() if first.startswith(sign)), None)


@contextmanager
def about(name: Any) -> Iterator[None]:
    """Let errors of ours name the input that they are about, unless they name one already."""
    try:
        yield
    except IsoError as error:
        error.source = error.source or plain(str(name)) or None
        raise
