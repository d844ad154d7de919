"""Fields in files, read a window at a time: what ``isocodec tile`` takes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...extras import optional
from .engines import is_labelled_file, stored_array
from .hdf5 import check_storage, dataset, fill_value, unpacked
from .read import read_field
from .reading import reading
from .source import Source, source_of

MAPPED = (".npy", ".tif", ".tiff", ".zarr", ".h5", ".hdf5", ".nc")
"""Suffixes of files that are read a window at a time; others are read whole."""


@contextmanager
def windows_of(path: Path, key: str | None = None, samples: int | None = None) -> Iterator[Any]:
    """A field with ``shape``, ``dtype`` and slices, whose samples stay in the file until they are asked for.

    Parameters
    ----------
    path : path
        ``.npy``, GeoTIFF (one band, or the first), Zarr, HDF5 or NetCDF; other formats are read whole.
    key : str, optional
        Which array, of a file that has several.
    samples : int, optional
        Most samples of a file that is read whole.

    Raises
    ------
    OSError, InputError, MissingExtraError
    """
    suffix = path.suffix.lower()
    if suffix not in MAPPED:
        yield read_field(path, key=key, samples=samples)
        return
    source = source_of(path)
    if suffix == ".npy":
        with reading(".npy"):
            yield MappedWindows(source.path)
    elif suffix in (".tif", ".tiff"):
        with reading("TIFF"):
            yield RasterWindows(source.path)
    else:
        held = ExitStack()
        try:
            yield _opened(source, key, held)
        finally:
            # without what went wrong where the windows were used: that is not about opening
            held.close()


def _opened(source: Source, key: str | None, held: ExitStack) -> LabelledWindows | StoredWindows:
    if is_labelled_file(source):
        return LabelledWindows(held.enter_context(stored_array(source, key)))
    stored = held.enter_context(dataset(source, key))
    check_storage(source, stored, [1])
    return StoredWindows(stored)


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


class StoredWindows:
    """An array of an HDF5 file as its attributes say: unpacked, and samples that stand for none masked.

    Attributes
    ----------
    shape : tuple of int
        Without axes of one sample.
    dtype : dtype
    """

    def __init__(self, stored: Any) -> None:
        self._stored = stored
        self.shape = tuple(count for count in stored.shape if count > 1)
        self.dtype = unpacked(stored, np.zeros(0, stored.dtype)).dtype

    def __getitem__(self, window: tuple[slice, ...]) -> NDArray[Any]:
        asked = iter(window)
        place = tuple(0 if count == 1 else next(asked) for count in self._stored.shape)
        with reading("HDF5 file"):
            raw = np.asarray(self._stored[place])
        found = unpacked(self._stored, raw)
        fill = fill_value(self._stored)
        # of numbers that are unpacked NaN stands for those
        return found if found is not raw or fill is None else np.ma.masked_array(raw, raw == fill)
