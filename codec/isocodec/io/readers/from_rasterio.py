"""Rasterio reads GeoTIFF a window at a time."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...extras import optional
from .windows import Windows


class RasterWindows(Windows):
    """The first band of a raster; samples without data are masked."""

    @cached_property
    def _file(self) -> Any:
        return optional("rasterio", extra="tiles", purpose="reading GeoTIFF a window at a time").open(self._path)

    def _describe(self) -> None:
        self.shape, self.dtype = (self._file.height, self._file.width), np.dtype(self._file.dtypes[0])

    def __getitem__(self, window: tuple[slice, ...]) -> np.ma.MaskedArray[Any, Any]:
        found = self._file.read(1, window=tuple((each.start, each.stop) for each in window), masked=True)
        return np.ma.masked_array(found)
