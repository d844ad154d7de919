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

from ..deferred import dataclass
from ..errors import InputError, IsoError, MissingExtraError, OptionError, plain
from ..field.cropping import Box, PartWindows, cropped, part_of, spans_within
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.missing import missing_samples
from ..field.sampled import Field
from ..storage.content import is_file, is_url, local
from . import arrays, clouds, images, labelled, rasters, slices, volumes, vtk
from .in_turn import InTurn
from .libraries import library
from .stores import is_store

Found: TypeAlias = Field | Frames | Mesh
VOLUMES = (".mha", ".mhd", ".nrrd", ".nhdr", ".nii", ".nii.gz")
DICOM = (".dcm", ".dicom", ".ima")
VTK = (".vti", ".vtr", ".vts", ".vtu", ".vtp", ".vtk", ".pvd", ".vtm", ".pvti", ".pvtr", ".pvtu",
       ".xdmf", ".xmf", ".vtkhdf", ".ply", ".stl", ".obj", ".msh")
NUMPY = (".npy", ".npz")
GRIB = (".grib", ".grib2", ".grb", ".grb2")
SUFFIXES = (*NUMPY, *labelled.SUFFIXES, *images.FORMATS, *rasters.DRIVERS, *VOLUMES, *DICOM, *VTK,
            *(each for each in clouds.SUFFIXES if each not in rasters.DRIVERS))
"""Suffixes of the formats that are read."""
_PAIRED = (".hdr", ".img")
_NIFTI, _ENVI = 348, b"ENVI"
_SIGNATURES = (
    (0, b"\x93NUMPY", ".npy"), (0, b"PK\3\4", ".npz"), (0, b"\x89HDF\r\n\x1a\n", ".h5"), (0, b"CDF\1", ".nc"),
    (0, b"CDF\2", ".nc"), (0, b"CDF\5", ".nc"), (0, b"GRIB", ".grib"), (0, b"\x89PNG", ".png"),
    (0, b"\xff\xd8\xff", ".jpg"), (0, b"II*\0", ".tif"), (0, b"MM\0*", ".tif"), (0, b"II+\0", ".tif"),
    (0, b"MM\0+", ".tif"), (0, b"NRRD", ".nrrd"), (128, b"DICM", ".dcm"), (344, b"n+1\0", ".nii"),
    (0, b"\x1f\x8b", ".nii.gz"), (0, b"ObjectType", ".mha"), (0, b"NDims", ".mha"),
)
"""First bytes by which a file without a name is recognised: where, which, and the suffix that it gets."""


@dataclass(frozen=True)
class Choice:
    """Choice from a source that holds several things; attributes as the parameters of `read`."""

    key: str | None = None
    band: int | None = None
    frame: int | None = None
    frames: bool = False
    bbox: Box | None = None
    nodata: float | None = None


def read(
    source: Any, *, key: str | None = None, band: int | None = None, frame: int | None = None, frames: bool = False,
    bbox: Box | None = None, nodata: float | None = None,
) -> Found:
    """Read a sampled field, a series of them, or values on a mesh, with all that its source states.

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
        Read only samples within these coordinates of the placement: least x, y (, z), then largest x, y (, z). Rasters
        are read as far as that goes.
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
    found = load(source, Choice(key, band, frame, frames, bbox, None if nodata is None else float(nodata)))
    for remark in getattr(found.fields if isinstance(found, Frames) else found, "remarks", ()):
        warnings.warn(remark, stacklevel=2)
    return found


def load(source: Any, choice: Choice, lazy: bool = False) -> Found:
    """Read as `read` does, but leave remarks to the caller; those of a series are an attribute of its ``fields``.

    With ``lazy``, samples of a field stay where they are until windows of them are read, where the format can.
    """
    if choice.band is not None and choice.band < 1:
        raise OptionError("bands are counted from 1", code="channel")
    if is_url(source) or (is_file(source) and not is_described(source)):
        name = source if isinstance(source, str) else getattr(source, "name", "")
        with ExitStack() as held, _about(name if isinstance(name, str) else ""):
            path = held.enter_context(local(source, _recognised))
            found = _of_path(str(path), choice, lazy)
            if isinstance(found, Frames) or lazy:  # the copy goes when the samples do
                kept = found.fields if isinstance(found, Frames) else found
                weakref.finalize(getattr(kept, "values", kept) if lazy else kept, held.pop_all().close)
            return found
    if not isinstance(source, str | os.PathLike):
        return _finished(of_object(source, choice, lazy), choice, lazy)
    with _about(os.fspath(source)):
        return _of_path(os.fspath(source), choice, lazy)


def of_object(thing: Any, choice: Choice | None = None, lazy: bool = False) -> Found:
    """Take an object of another library that is in memory, as `read` does.

    Raises
    ------
    InputError
        If no library is known that has such objects.
    OptionError
        If a choice does not apply to it.
    """
    choice = choice or Choice()
    if isinstance(thing, Field | Frames | Mesh):
        return _taken(lambda it: it, thing, "", choice, lazy)
    if not isinstance(thing, np.ndarray | list | tuple):
        for holds, take, options in _OBJECTS:
            if holds(thing):
                return _taken(take, thing, options, choice, lazy)
    # whoever has a masked array has loaded numpy.ma, which takes longer than a small field
    masked = "numpy.ma" in sys.modules and isinstance(thing, np.ma.MaskedArray)
    values = thing if masked else np.asarray(thing)
    if values.dtype.kind in "OUSV":
        raise InputError(f"is a {type(thing).__name__}, not numbers", code="dtype",
                         remedy="give a path, a URL, an open file, an array, or an object that isocodec.read lists")
    return _taken(arrays.of_array, values, "frame frames", choice, lazy)


def _of_frame(table: Any, nodata: float | None, lazy: bool) -> Found:
    """A table of pandas whose rows and columns have coordinates."""
    xarray = library("xarray", extra="labelled", purpose="reading a DataFrame")
    return labelled.of_labelled(xarray.DataArray(table), nodata=nodata, lazy=lazy)


_OBJECTS: tuple[tuple[Callable[[Any], bool], Callable[..., Found], str], ...] = (
    (lambda it: labelled.is_labelled(it) and hasattr(it, "data_vars"), labelled.of_labelled,
     "key frame frames nodata lazy"),
    (labelled.is_labelled, labelled.of_labelled, "frame frames nodata lazy"),
    (rasters.is_raster, rasters.of_dataset, "band nodata"),
    (lambda it: clouds.is_table(it) and hasattr(it, "geom_type"), clouds.of_shapes, "key"),
    (clouds.is_table, _of_frame, "nodata lazy"),
    (clouds.is_cloud, clouds.of_cloud, "key"),
    (images.is_picture, images.of_picture, "band frame"),
    (volumes.is_itk, volumes.of_itk, "band frame frames"),
    (volumes.is_nibabel, volumes.of_nibabel, "band frame frames"),
    (slices.is_volume, slices.of_volume, ""),
    (vtk.is_vtk, vtk.of_vtk, "key"),
    (vtk.is_meshio, vtk.of_meshio, "key"),
)
"""Objects of other libraries: how they are known, what reads them, and what can be chosen."""


def is_described(thing: Any) -> bool:
    """Whether something holds more than an array does, which would be lost if it were taken for one."""
    plain_one = isinstance(thing, np.ndarray | list | tuple | int | float)
    return not plain_one and any(holds(thing) for holds, _, _ in _OBJECTS)


def _taken(take: Callable[..., Found], what: Any, options: str, choice: Choice, lazy: bool) -> Found:
    """Read something with those options that apply; raises `OptionError` if others are chosen."""
    names = options.split()
    for option in ("key", "band", "frame", "frames"):
        given = getattr(choice, option)
        if option not in names and given is not None and given is not False:
            kind = Path(what).suffix or "a file" if isinstance(what, str | Path) else type(what).__name__
            raise OptionError(f"{option} does not apply to {plain(kind)}", code=option)
    return take(what, **{name: lazy if name == "lazy" else getattr(choice, name) for name in names})


def _of_path(path: str, choice: Choice, lazy: bool) -> Found:
    """Read a file or a folder by the library of its suffix; of an unknown one by those that know most."""
    name, at = path.rstrip("/").lower(), Path(path)
    if not (at.exists() or path.startswith("/vsi")):
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)

    def ends(*suffixes: str) -> bool:
        return name.endswith(suffixes)

    def taken(take: Callable[..., Found], options: str, what: Any = path) -> Found:
        found = _taken(take, what, options, choice, lazy)
        # a marker takes the place of the padding of slices
        return _finished(found, choice, lazy, take is not slices.open_ or choice.nodata is None)

    if ends(*GRIB):
        raise InputError("is GRIB, whose rows libraries flip in some scanning modes", code="grib",
                         remedy="convert it first: cdo -f nc copy IN OUT.nc; or give a DataArray of cfgrib")
    if ends(*labelled.SUFFIXES) or (at.is_dir() and is_store(at)):
        return taken(labelled.open_, "key band frame frames nodata lazy", at)
    if ends(*VOLUMES) or (ends(*_PAIRED) and _headed(at) == _NIFTI):
        return taken(volumes.open_, "key band frame frames", at)
    if ends(*DICOM) or at.is_dir() or (at.is_file() and _first(at).startswith(b"DICM", 128)):
        return taken(slices.open_, "key band frame frames", at)
    if ends(*VTK):
        return taken(vtk.open_, "key frame frames", at)
    if ends(*NUMPY):
        return taken(arrays.open_, "key frame frames")
    if ends(*images.FORMATS):
        return taken(images.open_, "band frame", at)
    if ends(*rasters.TIFF):
        return taken(images.open_tiff, "key band frame frames nodata")
    if ends(*clouds.SUFFIXES) and not (ends(".gpkg") and clouds.holds_raster(path)):
        return taken(clouds.open_, "key")
    if ends(*rasters.DRIVERS):
        return taken(rasters.read, "key band nodata")
    if ends(_PAIRED[0]) and _headed(at) == _ENVI:
        raise InputError("is a header", code="other-file", remedy="give the file with the samples")
    for take, options, what in ((rasters.read, "key band nodata", path), (vtk.open_, "key frame frames", at)):
        with suppress(InputError, MissingExtraError):
            return taken(take, options, what)
    suffix = plain(at.suffix) or "a name without a suffix"
    raise InputError(f"{suffix} is not a supported format of fields", code="suffix",
                     remedy="one of " + ", ".join(SUFFIXES))


def _finished(found: Found, choice: Choice, lazy: bool, masked: bool = True) -> Found:
    """Cut a field to a box, mark further samples as missing, and read them unless that may wait."""
    if isinstance(found, Mesh):
        for name in ("band", "bbox", "nodata"):
            if getattr(choice, name) is not None:
                raise OptionError(f"{name} does not apply to meshes and points", code=name)
        return found
    if isinstance(found, Frames):
        fields: Any = found.fields
        if choice.bbox is None and choice.nodata is None:
            return found
        return replace(found, fields=InTurn(
            len(fields), lambda at: _part(fields[at], choice, False, masked), fields.whole, fields.remarks))
    return _part(found, choice, lazy, masked)


def _part(field: Field, choice: Choice, lazy: bool, masked: bool) -> Field:
    windowed = marked = getattr(field.values, "windowed", False)
    if choice.bbox is not None:
        if not (windowed and lazy):
            field = cropped(field, choice.bbox)
        else:
            spans = spans_within(field.placement, field.shape, choice.bbox)
            assert field.placement is not None
            values: Any = PartWindows(field.values, spans)
            field = replace(field, values=values, placement=part_of(field.placement, spans, field.shape))
    elif windowed and not lazy:
        field = replace(field, values=field.values[(slice(None),) * len(field.shape)])
    if choice.nodata is None or marked:  # windows are marked as they are read
        return field
    gone = missing_samples(np.asarray(field.values), choice.nodata)
    gone = gone if field.mask is None or not masked else field.mask | gone
    return replace(field, mask=gone if gone.any() else None)


def _recognised(name: str, first: bytes) -> str | None:
    """Find the suffix of a format: the one that a name ends in, or else that of the first bytes."""
    lower = PurePosixPath(name).name.lower()
    named = max((each for each in SUFFIXES if lower.endswith(each)), key=len, default=None)
    return named or next((suffix for at, sign, suffix in _SIGNATURES if first.startswith(sign, at)), None)


def _first(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(132)


def _headed(path: Path) -> int | bytes:
    """First four bytes of the header beside a file: as a number if that is the size of a header of NIfTI."""
    headers = [each for end in (".hdr", ".HDR") if (each := path.with_suffix(end)).is_file()]
    start = _first(headers[0])[:4] if headers else b""
    return _NIFTI if _NIFTI in (int.from_bytes(start, "little"), int.from_bytes(start, "big")) else start


@contextmanager
def _about(name: str) -> Iterator[None]:
    """Let errors of ours name the input that they are about, unless they name one already."""
    try:
        yield
    except IsoError as error:
        error.source = error.source or plain(name) or None
        raise
