"""Files that xarray opens with an engine of its own: Zarr, NetCDF of the classic kind, GRIB."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..field.sampled import Field
from ..text import plain
from .extras import optional
from .hdf5 import HDF5_SUFFIXES
from .labelled import labelled_field
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
        source.check_array(array.shape, array.dtype)
        return labelled_field(array.load())


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
    with reading(what):
        try:
            opened = xarray.open_dataset(source.path, **options)
        except (ValueError, OverflowError) as exc:
            if "decode_times" not in str(exc):
                raise
            opened = xarray.open_dataset(source.path, decode_times=False, **options)
        with opened:
            yield opened


def values_of(field: Field) -> NDArray[Any]:
    """Samples with NaN where they are missing, for those who know of no mask."""
    if field.mask is None:
        return field.values
    values = field.values.astype(np.result_type(field.values.dtype, np.float32))
    values[field.mask] = np.nan
    return values
