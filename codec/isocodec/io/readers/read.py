"""Fields in: arrays of numbers out of NumPy and HDF5 files, pictures and volumes.

The samples come as they are stored: no rescaling, no conversion to grey, no rotation. Where a file leaves a
choice (which array, which colour channel), the caller makes it; nothing is guessed.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, OptionError
from .dicom import DICOM_SUFFIXES, is_series, read_dicom
from .engines import GRIB_SUFFIXES, ZARR_SUFFIXES, is_labelled_file, read_labelled, values_of
from .hdf5 import HDF5_SUFFIXES, read_hdf5
from .numpyfile import read_numpy
from .raster import TIFF_SUFFIXES, pick_channel, read_picture, read_tiff
from .reading import pick_frame
from .source import Source, check_kind, source_of
from .volume import ITK_SUFFIXES, NIFTI_SUFFIXES, read_itk, read_nifti
from .vti import VTI_SUFFIXES, read_vti

Field = NDArray[Any]

_ARRAYS: dict[str, Callable[[Source, str | None, int | None], Field]] = {
    ".npy": read_numpy,
    ".npz": read_numpy,
    **dict.fromkeys(HDF5_SUFFIXES, read_hdf5),
    **dict.fromkeys(VTI_SUFFIXES, read_vti),
    **dict.fromkeys(DICOM_SUFFIXES, read_dicom),
}
_LABELLED = (*ZARR_SUFFIXES, *GRIB_SUFFIXES)
_PICTURES: dict[str, Callable[[Source], tuple[Field, int | None]]] = {
    ".png": read_picture,
    ".jpg": read_picture,
    ".jpeg": read_picture,
    **dict.fromkeys(TIFF_SUFFIXES, read_tiff),
}
_VOLUMES: dict[str, Callable[[Source, int | None], Field]] = {
    **dict.fromkeys(NIFTI_SUFFIXES, read_nifti),
    **dict.fromkeys(ITK_SUFFIXES, read_itk),
}
FIELD_SUFFIXES: tuple[str, ...] = (*_ARRAYS, *_PICTURES, *_VOLUMES, *_LABELLED)


def read_field(
    path: str | os.PathLike[str],
    *,
    key: str | None = None,
    channel: int | None = None,
    frame: int | None = None,
    samples: int | None = None,
    follow: bool = False,
) -> Field:
    """Read a sampled scalar field.

    Parameters
    ----------
    path : path
        ``.npy``, ``.npz``, HDF5 (``.h5``, ``.hdf5``, ``.nc``), ``.png``, ``.jpg``, ``.jpeg``, ``.tif``, ``.tiff``,
        ``.nii``, ``.nii.gz``, NRRD (``.nrrd``, ``.nhdr``), MetaImage (``.mha``, ``.mhd``), DICOM (a folder with a
        series, or ``.dcm``), ``.vti``, ``.zarr``, GRIB (``.grib``, ``.grib2``, ``.grb``, ``.grb2``).
    key : str, optional
        Name of the array in an ``.npz`` or an HDF5 file. Without it the only array is taken (of HDF5 files the only
        one of two or more axes), or the one named ``values``. Of a folder of DICOM the series.
    channel : int, optional
        Which channel of a colour picture to take, counted from 0.
    frame : int, optional
        Which of a series to take, counted from 0: along the first axis of an array or of a TIFF stack, the last axis of
        a volume file that has more than three.
    samples : int, optional
        How many samples the file may hold at most, all channels and frames that are read on the way among them;
        `isocodec.limits.FIELD_SAMPLES` if not given. Checked before anything is allocated.
    follow : bool
        Read other files that this one names by a path, or HDF5 keeps samples in. Without, only this file is read, and
        files in the same directory that the header of a MetaImage or NRRD or the notes of an OME-TIFF name.

    Returns
    -------
    ndarray
        The samples, C-contiguous, in native byte order, with the dtype of the file (truth values as uint8).
        Pictures are (rows, columns), TIFF stacks (pages, rows, columns), volumes (i, j, k) as stored: with their
        integer dtype if they state no scaling or one by whole numbers, otherwise scaled to float64, as packed
        arrays of NetCDF are. Axes of HDF5 files that have one sample only are left out.

    Raises
    ------
    OSError
        If the file cannot be opened.
    InputError
        If it is not what its name says, a device or a pipe, holds no numbers, names files that are not to be read, or
        leaves a choice open.
    LimitError
        If it holds more samples than may be read.
    OptionError
        If ``key``, ``channel`` or ``frame`` do not apply to this kind of file.
    MissingExtraError
        If a library is needed that is not installed.
    """
    source = source_of(path, samples, follow)
    path = source.path
    if is_series(path):
        return numbers(read_dicom(source, key, frame))
    suffix = next((s for s in FIELD_SUFFIXES if path.name.lower().endswith(s)), None)
    if suffix is None:
        raise InputError(
            f"{path.suffix or 'a name without a suffix'} is not a supported format of fields",
            code="suffix",
            remedy="one of " + ", ".join(FIELD_SUFFIXES),
        )
    if key is not None and suffix not in (*_ARRAYS, *_LABELLED):
        raise OptionError(f"a key names an array of a file that holds several, not of {suffix}", code="key")
    if channel is not None and suffix not in _PICTURES:
        raise OptionError(f"a channel is part of a picture, not of {suffix}", code="channel")
    if is_labelled_file(source):
        return numbers(values_of(read_labelled(source, key, frame)))
    if suffix in _ARRAYS:
        return numbers(_ARRAYS[suffix](source, key, frame))
    if suffix in _PICTURES:
        return numbers(pick_frame(pick_channel(*_PICTURES[suffix](source), channel), frame))
    return numbers(_VOLUMES[suffix](source, frame))


def numbers(array: Field) -> Field:
    """Check that ``array`` holds real numbers; native byte order and C order."""
    check_kind(array.dtype)
    if array.dtype.kind == "b":
        array = array.astype(np.uint8)
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))
