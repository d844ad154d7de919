"""Files that xarray opens with an engine of its own: Zarr, NetCDF of the classic kind, GRIB."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, plain
from ...extras import optional
from ...field.sampled import Field
from .hdf5 import HDF5_SUFFIXES
from .labelled import Labels, labelled_field, labels_of
from .numpyfile import DEFAULT_KEY
from .reading import check_frame, reading
from .source import Source

ZARR_SUFFIXES = (".zarr",)
GRIB_SUFFIXES = (".grib", ".grib2", ".grb", ".grb2")
_LISTED = 20


def is_labelled_file(source: Source) -> bool:
    """Whether this is one of these files: Zarr and GRIB by their names, NetCDF by its first bytes."""
    if source.named(*ZARR_SUFFIXES, *GRIB_SUFFIXES):
        return True
    if not source.named(*HDF5_SUFFIXES):
        return False
    with source.path.open("rb") as file:
        return file.read(3) == b"CDF"


def read_labelled(source: Source, key: str | None, frame: int | None) -> Field:
    """The array of such a file that a key names, the only one of two or more axes if there is none, or ``values``.

    Raises
    ------
    InputError, LimitError, MissingExtraError
    """
    bare = _bare(source)
    if bare is not None:
        # such as zarr.open(path, shape=..) makes: without names, without coordinates
        if frame is not None:
            check_frame(frame, bare.shape[0] if bare.ndim > 2 else 0)
        source.check_array(bare.shape if frame is None else bare.shape[1:], bare.dtype)
        with reading("Zarr store"):
            return Field(np.squeeze(np.asarray(bare[...] if frame is None else bare[frame])))
    with _chosen(source, key, frame) as array:
        source.check_array(array.shape, array.dtype)
        return labelled_field(array.load())


@contextmanager
def stored_array(source: Source, key: str | None) -> Iterator[Any]:
    """The array that `read_labelled` reads, whose samples stay where they are until slices of it are asked for."""
    bare = _bare(source)
    if bare is not None:
        yield bare
        return
    with _chosen(source, key, None) as array:
        yield array


def read_labels(source: Source, key: str | None, frame: int | None) -> Labels | None:
    """Where the samples of an array lie that `read_labelled` reads, of any size; None if it says nothing of it."""
    if _bare(source) is not None:
        return None
    with _chosen(source, key, frame) as array:
        return labels_of(array)


def _bare(source: Source) -> Any:
    """The array that a Zarr store is, instead of a group of arrays; None if it is none."""
    if not source.named(*ZARR_SUFFIXES):
        return None
    zarr = optional("zarr", extra="xarray", purpose="reading .zarr")
    with reading("Zarr store"):
        found = zarr.open(str(source.path), mode="r")
    return found if hasattr(found, "dtype") else None


@contextmanager
def _chosen(source: Source, key: str | None, frame: int | None) -> Iterator[Any]:
    """An array with labels, whose samples are not read yet."""
    with _opened(source) as dataset:
        fields = {str(name): one.shape for name, one in dataset.data_vars.items() if sum(n > 1 for n in one.shape) > 1}
        if key is None and (len(fields) == 1 or DEFAULT_KEY in fields):
            key = DEFAULT_KEY if DEFAULT_KEY in fields else next(iter(fields))
        if key not in dataset.data_vars:
            listed = ", ".join(f"{plain(name)} {shape}" for name, shape in [*fields.items()][:_LISTED]) or "nothing"
            raise InputError(f"holds these arrays: {listed}", code="key", remedy="choose one with --key")
        array = dataset[key].squeeze(drop=False)
        if frame is not None:
            check_frame(frame, array.shape[0] if array.ndim > 2 else 0)
            array = array.isel({array.dims[0]: frame})
        yield array


@contextmanager
def _opened(source: Source) -> Iterator[Any]:
    options: dict[str, Any]
    xarray = optional("xarray", extra="xarray", purpose=f"reading {source.path.suffix}")
    if source.named(*ZARR_SUFFIXES):
        optional("zarr", extra="xarray", purpose="reading .zarr")
        what, options = "Zarr store", {"engine": "zarr", "chunks": None}
    elif source.named(*GRIB_SUFFIXES):
        optional("cfgrib", extra="grib", purpose="reading GRIB")
        # the index that it would leave beside the file is another's to write
        what, options = "GRIB file", {"engine": "cfgrib", "backend_kwargs": {"indexpath": ""}}
    else:
        optional("scipy.io", extra="geo", purpose="reading NetCDF of the classic kind")
        what, options = "NetCDF file", {"engine": "scipy"}
    with reading(what), warnings.catch_warnings():
        # about speed, of stores that have no copy of all their metadata in one place
        warnings.filterwarnings("ignore", message="Failed to open Zarr store with consolidated")
        try:
            opened = xarray.open_dataset(source.path, **options)
        except (ValueError, OverflowError) as exc:
            if "decode_times" not in str(exc):
                raise
            opened = xarray.open_dataset(source.path, decode_times=False, **options)
    with reading(what), opened:
        yield opened


def values_of(field: Field) -> NDArray[Any]:
    """Samples with NaN where they are missing, for those who know of no mask."""
    if field.mask is None:
        return field.values
    values = field.values.astype(np.result_type(field.values.dtype, np.float32))
    values[field.mask] = np.nan
    return values
