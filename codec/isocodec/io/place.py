"""Where the samples of a file lie in the world: what NIfTI volumes and GeoTIFF pictures say of it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .extras import optional
from .read import reading

_USER_DEFINED = 32767
"""Number of a reference system that no registry has."""
_IS_POINT = 2
"""Raster type whose coordinates are those of the samples; otherwise samples are half a pixel further on."""


def read_placement(path: str | os.PathLike[str], n: int) -> tuple[NDArray[np.float64] | None, str | None]:
    """Coordinates of a field that ``read_field`` has read, and their reference system.

    Parameters
    ----------
    path : path
    n : int
        Axes of the field.

    Returns
    -------
    placement : (n, n + 1) float64, or None
        A row for each coordinate: what a step along each axis of the array adds to it, and what it is at sample 0.
        None where the file does not say, or says it of other axes than the field has.
    crs : str or None
        As ``EPSG:32631``.

    Raises
    ------
    InputError
        If what it says cannot be read.
    MissingExtraError
        If a library is needed that is not installed.
    """
    name = Path(path).name.lower()
    if n == 3 and name.endswith((".nii", ".nii.gz")):
        nibabel = optional("nibabel", extra="nifti", purpose="reading NIfTI")
        with reading("NIfTI volume"):
            return _proper(nibabel.load(path).affine[:3]), None
    if n == 2 and name.endswith((".tif", ".tiff")):
        tifffile = optional("tifffile", extra="image", purpose="reading TIFF")
        with reading("GeoTIFF"), tifffile.TiffFile(path) as tiff:
            tags = tiff.pages[0].geotiff_tags or {}
            return _proper(_of_pixels(tags)), _system(tags)
    return None, None


def _proper(matrix: Any) -> NDArray[np.float64] | None:
    """The same numbers, unless they lay different samples on one point."""
    placement = np.asarray(matrix, np.float64)
    n = len(placement)
    usable = placement.shape == (n, n + 1) and np.isfinite(placement).all()
    return placement if n and usable and np.linalg.matrix_rank(placement[:, :n]) == n else None


def _of_pixels(tags: dict[str, Any]) -> list[list[float]]:
    """Rows for x and y, in the order (row, column), of a GeoTIFF's coordinates; none if it has none."""
    if "ModelTransformation" in tags:
        a = np.asarray(tags["ModelTransformation"], np.float64).reshape(4, 4)[:2]
        across, down, start = a[:, 0], a[:, 1], a[:, 3]
    elif "ModelPixelScale" in tags and len(tags.get("ModelTiepoint", ())) == 6:
        width, height = tags["ModelPixelScale"][:2]
        column, row, _, x, y, _ = tags["ModelTiepoint"]
        across, down = np.array([width, 0.0]), np.array([0.0, -height])
        start = np.array([x, y]) - column * across - row * down
    else:
        return []
    if tags.get("GTRasterTypeGeoKey") != _IS_POINT:
        start = start + (across + down) / 2
    rows: list[list[float]] = np.column_stack([down, across, start]).tolist()
    return rows


def _system(tags: dict[str, Any]) -> str | None:
    for key in ("ProjectedCSTypeGeoKey", "GeographicTypeGeoKey"):
        if key in tags:
            return f"EPSG:{int(tags[key])}" if int(tags[key]) != _USER_DEFINED else None
    return None
