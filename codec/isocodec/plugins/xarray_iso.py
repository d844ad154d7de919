"""For xarray: ``open_dataset("x.iso")`` (samples above the isovalue, or labels), and ``array.iso.contour(isovalue)``.

The engine is found by its entry point; the accessor is there once this module is imported.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import xarray
from xarray.backends import BackendEntrypoint

import isocodec


class Backend(BackendEntrypoint):
    """Files as variables: ``labels``, or ``above`` with the isovalues as its first axis; frames along ``frame``."""

    description = "Masks and labels of isocontours"
    open_dataset_parameters = ("filename_or_obj", "drop_variables")

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        return isinstance(filename_or_obj, str | os.PathLike) and os.fspath(filename_or_obj).lower().endswith(".iso")

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Any = None) -> xarray.Dataset:
        file = isocodec.open(filename_or_obj)
        frames = range(file.frames) if file.frames > 1 else [None]
        axes = [f"axis_{axis}" for axis in range(len(file.shape))]
        if file.info.noun == "label":
            name, lead = "labels", []
            each = [file.labels(frame=frame) for frame in frames]
        else:
            name, lead = "above", ["isovalue"]
            each = [np.stack([file.above(value, frame=frame) for value in file.isovalues]) for frame in frames]
        values, dims = (np.stack(each), ["frame", *lead, *axes]) if file.frames > 1 else (each[0], [*lead, *axes])
        coords: dict[str, Any] = {"isovalue": list(file.isovalues)} if lead else {}
        if file.times is not None:
            coords["time"] = ("frame", file.times)
        found = xarray.Dataset({name: (dims, values)}, coords=coords, attrs=file.metadata)
        return found.drop_vars(drop_variables, errors="ignore") if drop_variables else found


@xarray.register_dataarray_accessor("iso")
class Accessor:
    """Contours of an array, by its coordinates."""

    def __init__(self, array: xarray.DataArray) -> None:
        self._array = array

    def encode(self, isovalue: Any, **options: Any) -> bytes:
        """Encode a file of these isovalues; parameters and errors as of `isocodec.encode`."""
        return isocodec.encode(self._array, isovalue, **options)

    def contour(self, isovalue: float, **options: Any) -> isocodec.Contour:
        """Make the contour that a file with these options has; errors as of `isocodec.encode`."""
        return isocodec.decode(self.encode(isovalue, **options))
