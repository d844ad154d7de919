"""Fields in files, read a window at a time: what ``isocodec tile`` takes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OptionError
from .engines import is_labelled_file
from .extras import optional
from .hdf5 import fill_value, unpacked_by
from .read import read_field
from .reading import reading
from .source import source_of

MAPPED = (".npy", ".tif", ".tiff", ".zarr", ".h5", ".hdf5", ".nc")
"""Suffixes of files that are read a window at a time; others are read whole."""


@contextmanager
def windows_of(path: Path, key: str | None = None, samples: int | None = None) -> Iterator[Any]:
    """A field with ``shape``, ``dtype`` and slices, whose samples stay in the file until they are asked for.

    Parameters
    ----------
    path : path
        ``.npy``, GeoTIFF (one band, or the first), Zarr, HDF5 or NetCDF; other formats are read whole, and so is NetCDF
        of the classic kind.
    key : str, optional
        Which array, of a file that has several.
    samples : int, optional
        Most samples of a file that is read whole.

    Raises
    ------
    OSError, InputError, MissingExtraError
    OptionError
        If there are several arrays and none is named.
    """
    suffix = path.suffix.lower()
    source = source_of(path)
    # NetCDF of the classic kind is none of HDF5
    if suffix not in MAPPED or (suffix != ".zarr" and is_labelled_file(source)):
        yield read_field(path, key=key, samples=samples)
        return
    if suffix == ".npy":
        with reading(".npy"):
            yield MappedWindows(source.path)
    elif suffix in (".tif", ".tiff"):
        with reading("TIFF"):
            yield RasterWindows(source.path)
    elif suffix == ".zarr":
        zarr = optional("zarr", extra="xarray", purpose="reading .zarr")
        with reading("Zarr"):
            found = zarr.open(str(path), mode="r")
        yield told(found if hasattr(found, "dtype") else _named(found, key, path))
    else:
        h5py = optional("h5py", extra="hdf5", purpose=f"reading {suffix}")
        with reading("HDF5"):
            file = h5py.File(path, "r")
        with file:
            yield told(_named(file, key, path))


class _Windows:
    """A file's samples, by slices; it is opened where it is read, so that other processes get no more than its name.

    Attributes
    ----------
    shape : tuple of int
    dtype : dtype
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __init__(self, path: Path) -> None:
        self._path = path.resolve()
        self._describe()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_file"}

    @cached_property
    def _file(self) -> Any:
        raise NotImplementedError

    def _describe(self) -> None:
        self.shape, self.dtype = self._file.shape, self._file.dtype


class MappedWindows(_Windows):
    """The array of an ``.npy`` file."""

    @cached_property
    def _file(self) -> Any:
        return np.load(self._path, mmap_mode="r", allow_pickle=False)

    def __getitem__(self, window: tuple[slice, ...]) -> NDArray[Any]:
        found: NDArray[Any] = self._file[window]
        return found


class RasterWindows(_Windows):
    """The first band of a raster; samples without data are masked."""

    @cached_property
    def _file(self) -> Any:
        return optional("rasterio", extra="tiles", purpose="reading GeoTIFF a window at a time").open(self._path)

    def _describe(self) -> None:
        self.shape, self.dtype = (self._file.height, self._file.width), np.dtype(self._file.dtypes[0])

    def __getitem__(self, window: tuple[slice, ...]) -> np.ma.MaskedArray[Any, Any]:
        found = self._file.read(1, window=tuple((each.start, each.stop) for each in window), masked=True)
        return np.ma.masked_array(found)


class ToldWindows:
    """An array of HDF5, NetCDF or Zarr as its attributes say: unpacked, and samples that stand for none masked.

    Attributes
    ----------
    shape : tuple of int
    dtype : dtype
        float64 if samples are unpacked.
    """

    def __init__(self, stored: Any, unpacking: tuple[float, float] | None, fill: float | None) -> None:
        self._stored, self._unpacking, self._fill = stored, unpacking, fill
        self.shape: tuple[int, ...] = stored.shape
        self.dtype = np.dtype(stored.dtype if unpacking is None else np.float64)

    def __getitem__(self, window: tuple[slice, ...]) -> NDArray[Any] | np.ma.MaskedArray[Any, Any]:
        raw = np.asarray(self._stored[window])
        slope, offset = self._unpacking or (1.0, 0.0)
        found: NDArray[Any] = raw if self._unpacking is None else raw * slope + offset
        return found if self._fill is None else np.ma.masked_array(found, raw == self._fill)


def told(stored: Any) -> Any:
    """A stored array, with what its attributes say of its numbers if they say anything."""
    fill = fill_value(stored)
    if fill is None and getattr(getattr(stored, "metadata", None), "zarr_format", 3) == 2:
        # of Zarr's second format what is written nowhere is what stands for none; 0 is what it is if nobody says so
        fill = float(stored.fill_value) if stored.dtype.kind in "iuf" and stored.fill_value else None
    if fill is not None and np.isnan(fill):
        fill = None
    unpacking = unpacked_by(stored)
    return stored if fill is None and unpacking is None else ToldWindows(stored, unpacking, fill)


def _named(group: Any, key: str | None, path: Path) -> Any:
    """An array of a group, by its name or because there is no other."""
    names = [name for name in group if len(getattr(group[name], "shape", ())) in (2, 3)]
    if key is None and len(names) != 1:
        raise OptionError(
            f"{path.name} has the arrays {', '.join(names) or 'none'}", code="key", remedy="name one: --key"
        )
    name = key or names[0]
    if name not in group:
        raise InputError(f"has no array {name!r}", code="key", remedy=f"it has {', '.join(names)}")
    return group[name]
