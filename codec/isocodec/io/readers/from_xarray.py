"""Xarray reads Zarr, NetCDF of the classic kind and GRIB, and arrays with labels that are in memory."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, plain
from ...extras import optional
from ...field.missing import missing_samples
from ...field.placement import Placement
from ...field.sampled import Field
from .labels import labelled_field, labels_of
from .opened import DEFAULT_KEY, IN_MEMORY, Choice, Format, Opened
from .reading import about, check_frame, reading
from .source import InputFile

_ZARR, _GRIB = (".zarr",), (".grib", ".grib2", ".grb", ".grb2")
_LISTED = 20


class OpenedLabels(Opened):
    """An array with labels in memory."""

    def __init__(self, array: Any) -> None:
        self._array = array
        super().__init__(IN_MEMORY, Choice())

    def _open(self, choice: Choice) -> None:
        self.shape, self.dtype = tuple(self._array.shape), self._array.dtype

    def _taken(self, frame: int | None) -> Any:
        if frame is None:
            return self._array
        check_frame(frame, self._array.shape[0] if self._array.ndim > 2 else 0)
        return self._array.isel({self._array.dims[0]: frame})

    def _labelled(self, frame: int | None) -> Field:
        """Samples in memory with their labels."""
        return labelled_field(self._taken(frame))

    def field(self, frame: int | None = None, *, nodata: float | None = None) -> Field:
        """Read a field with all that its labels state; see `Opened.field`."""
        with about(self.label):
            found = self._labelled(frame)
            if nodata is None:
                return found
            gone = missing_samples(found.values, nodata) & ~missing_samples(found.values, None)
            return replace(found, mask=gone if gone.any() else None)

    def _values(self, frame: int | None) -> NDArray[Any]:
        return values_of(self._labelled(frame))

    def _place(self, n: int, frame: int | None) -> Placement:
        labels = labels_of(self._taken(frame))
        return replace(labels.record or Placement(crs=labels.crs), remark="; ".join(labels.remarks))


class _LabelledFile(OpenedLabels):
    """An array of a file, whose samples are not read until they are asked for."""

    def __init__(self, source: InputFile, choice: Choice) -> None:
        Opened.__init__(self, source, choice)

    def _open(self, choice: Choice) -> None:
        dataset = self.hold(_dataset(self._source))
        key = choice.key
        fields = {str(name): one.shape for name, one in dataset.data_vars.items() if sum(n > 1 for n in one.shape) > 1}
        if key is None and (len(fields) == 1 or DEFAULT_KEY in fields):
            key = DEFAULT_KEY if DEFAULT_KEY in fields else next(iter(fields))
        if key not in dataset.data_vars:
            listed = ", ".join(f"{plain(name)} {shape}" for name, shape in [*fields.items()][:_LISTED]) or "nothing"
            raise InputError(f"holds these arrays: {listed}", code="key", remedy="choose one with --key")
        self._array = dataset[key].squeeze(drop=False)
        super()._open(choice)

    def _labelled(self, frame: int | None) -> Field:
        array = self._taken(frame)
        self._source.check_array(array.shape, array.dtype)
        with reading("array"):
            found = labelled_field(array.load())
            return replace(found, values=np.ascontiguousarray(found.values, found.values.dtype.newbyteorder("=")))

    def _windows(self) -> LabelledWindows:
        return LabelledWindows(self._array)


class OpenedClassic(_LabelledFile):
    """An array of a NetCDF file of the classic kind."""


class _BareZarr(Opened):
    """An array of Zarr such as zarr.open(path, shape=..) makes: without names, without coordinates."""

    def __init__(self, source: InputFile, choice: Choice, stored: Any) -> None:
        self._stored = stored
        super().__init__(source, choice)

    def _open(self, choice: Choice) -> None:
        self.shape, self.dtype = tuple(self._stored.shape), self._stored.dtype

    def _values(self, frame: int | None) -> NDArray[Any]:
        stored = self._stored
        if frame is not None:
            check_frame(frame, stored.shape[0] if stored.ndim > 2 else 0)
        self._source.check_array(stored.shape if frame is None else stored.shape[1:], stored.dtype)
        with reading("Zarr store"):
            return np.squeeze(np.asarray(stored[...] if frame is None else stored[frame]))

    def _windows(self) -> Any:
        return LabelledWindows(self._stored)


def is_labelled(thing: Any) -> bool:
    """Whether this is an array with labels in memory."""
    return all(hasattr(thing, name) for name in ("dims", "coords", "values", "isel"))


def variable(dataset: Any, key: str | None) -> Any:
    """The array of a Dataset that a key names, or the only one of two axes or more.

    Raises
    ------
    InputError
        If the choice is open.
    """
    fields = [name for name, one in dataset.data_vars.items() if one.ndim > 1]
    if key is None and len(fields) == 1:
        key = fields[0]
    if key not in dataset.data_vars:
        names = ", ".join(plain(str(name)) for name in fields[:_LISTED]) or "none"
        raise InputError(f"a Dataset with the arrays {names}", code="key", remedy="choose one with key=")
    return dataset[key]


def values_of(field: Field) -> NDArray[Any]:
    """Samples with NaN where they are missing, for those who know of no mask."""
    if field.mask is None:
        return field.values
    values = field.values.astype(np.result_type(field.values.dtype, np.float32))
    values[field.mask] = np.nan
    return values


def _zarr(source: InputFile, choice: Choice) -> Opened:
    """Open a Zarr store, which is an array or a group of them."""
    zarr = optional("zarr", extra="xarray", purpose="reading .zarr")
    with reading("Zarr store"):
        found = zarr.open(str(source.path), mode="r")
    return _BareZarr(source, choice, found) if hasattr(found, "dtype") else _LabelledFile(source, choice)


class LabelledWindows:
    """An array of Zarr or of NetCDF of the classic kind, NaN where samples are missing.

    Attributes
    ----------
    shape : tuple of int
    dtype : dtype
    """

    def __init__(self, array: Any) -> None:
        self._array = array
        self.shape, self.dtype = tuple(array.shape), array.dtype

    def __getitem__(self, window: tuple[slice, ...]) -> NDArray[Any]:
        with reading("array"):
            return np.asarray(self._array[window])


@contextmanager
def _dataset(source: InputFile) -> Iterator[Any]:
    options: dict[str, Any]
    xarray = optional("xarray", extra="xarray", purpose=f"reading {source.path.suffix}")
    if source.named(*_ZARR):
        optional("zarr", extra="xarray", purpose="reading .zarr")
        what, options = "Zarr store", {"engine": "zarr", "chunks": None}
    elif source.named(*_GRIB):
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


FORMATS = (
    Format("Zarr", _ZARR, _zarr, extra="xarray", keyed=True, folder=True),
    Format(
        "GRIB", _GRIB, _LabelledFile, extra="grib", keyed=True, signatures=((0, b"GRIB", ".grib"),), confined="cfgrib"
    ),
)
