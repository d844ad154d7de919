"""Masks and labels of samples as files: GeoTIFF by rasterio, NIfTI by nibabel, MetaImage and NRRD by SimpleITK."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..field.placement import LPS, Placement
from ..field.reference_system import system_of
from .libraries import library
from .places import BODY_TURN


def write_raster(values: NDArray[Any], placement: Placement | None, path: Path) -> None:
    """Write samples with two axes as a GeoTIFF, with the transform and the reference system of their placement."""
    rasterio = library("rasterio", extra="raster", purpose="writing GeoTIFF")
    matrix = None if placement is None else placement.matrix
    more: dict[str, Any] = {}
    if placement is not None and matrix is not None and len(matrix) == 2:
        (b, a, c), (e, d, f) = matrix
        system = system_of(placement)
        # the matrix is of the centres of pixels
        more = {"transform": rasterio.Affine(a, b, c - (a + b) / 2, d, e, f - (d + e) / 2),
                "crs": None if system is None else system.to_wkt()}
    with rasterio.open(path, "w", driver="GTiff", height=values.shape[0], width=values.shape[1], count=1,
                       dtype=values.dtype, compress="deflate", **more) as file:
        file.write(values, 1)


def write_nifti(values: NDArray[Any], placement: Placement | None, path: Path) -> None:
    """Write samples as NIfTI, in coordinates right, front and top; without a placement in none."""
    nibabel = library("nibabel", extra="volumes", purpose="writing NIfTI")
    matrix = volume_matrix(placement)
    affine = None if matrix is None else np.vstack([matrix, [0, 0, 0, 1]])
    image = nibabel.Nifti1Image(values.reshape(*values.shape, *(1,) * (3 - values.ndim)), affine, dtype=values.dtype)
    if affine is not None:
        # for programs that only read quaternions, which cannot express sheared axes
        with suppress(nibabel.spatialimages.HeaderDataError):
            image.set_qform(affine, code="aligned", strip_shears=False)
        image.header.set_xyzt_units("mm")
    nibabel.save(image, path)


def write_itk(values: NDArray[Any], placement: Placement | None, path: Path) -> None:
    """Write samples as MetaImage or NRRD, in coordinates left, back and top; without a placement in steps of 1."""
    sitk = library("SimpleITK", extra="volumes", purpose="writing volumes")
    image = sitk.GetImageFromArray(np.ascontiguousarray(values.reshape(*values.shape, *(1,) * (3 - values.ndim)).T))
    matrix = volume_matrix(placement)
    if matrix is not None:
        matrix = BODY_TURN @ matrix
        steps = np.linalg.norm(matrix[:, :3], axis=0)
        image.SetSpacing(steps.tolist())
        image.SetDirection((matrix[:, :3] / steps).ravel().tolist())
        image.SetOrigin(matrix[:, 3].tolist())
    sitk.WriteImage(image, str(path), useCompression=True)


def volume_matrix(placement: Placement | None) -> NDArray[np.float64] | None:
    """Matrix (3, 4) of a volume in coordinates right, front and top, as far as it is known where they run.

    A field of two axes has a third of one sample, a unit long, at right angles to the others.
    """
    if placement is None or placement.matrix is None:
        return None
    matrix = placement.matrix
    if matrix.shape[1] == 3:
        rows = np.pad(matrix, ((0, 3 - len(matrix)), (0, 0)))
        across = np.cross(rows[:, 0], rows[:, 1])
        matrix = np.insert(rows, 2, across / np.linalg.norm(across), axis=1)
    return BODY_TURN @ matrix if placement.crs == LPS else matrix
