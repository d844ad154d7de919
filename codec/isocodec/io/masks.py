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
    more: dict[str, Any] = {}
    if placement is not None and placement.matrix is not None and len(placement.matrix) == 2:
        (b, a, c), (e, d, f) = placement.matrix
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
    affine = volume_matrix(placement)
    image = nibabel.Nifti1Image(np.atleast_3d(values), affine, dtype=values.dtype)
    if affine is not None:
        # for programs that only read quaternions, which cannot express sheared axes
        with suppress(nibabel.spatialimages.HeaderDataError):
            image.set_qform(affine, code="aligned", strip_shears=False)
        image.header.set_xyzt_units("mm")
    nibabel.save(image, path)


def write_itk(values: NDArray[Any], placement: Placement | None, path: Path) -> None:
    """Write samples as MetaImage or NRRD, in coordinates left, back and top; without a placement in steps of 1."""
    sitk = library("SimpleITK", extra="volumes", purpose="writing volumes")
    image = sitk.GetImageFromArray(np.ascontiguousarray(np.atleast_3d(values).T))
    matrix = volume_matrix(placement)
    if matrix is not None:
        axes, origin = np.split(BODY_TURN @ matrix[:3], [3], axis=1)
        steps = np.linalg.norm(axes, axis=0)
        image.SetSpacing(steps.tolist())
        image.SetDirection((axes / steps).ravel().tolist())
        image.SetOrigin(origin.ravel().tolist())
    sitk.WriteImage(image, str(path), useCompression=True)


def volume_matrix(placement: Placement | None) -> NDArray[np.float64] | None:
    """Matrix (4, 4) of a volume in coordinates right, front and top; None if these are unknown.

    A field of two axes has a third of one sample, a unit long, at right angles to the others.
    """
    if placement is None or placement.matrix is None:
        return None
    rows, columns = placement.matrix.shape
    matrix = np.eye(4)
    matrix[:rows, [*range(columns - 1), 3]] = placement.matrix
    if columns == 3:
        across = np.cross(matrix[:3, 0], matrix[:3, 1])
        matrix[:3, 2] = across / np.linalg.norm(across)
    if placement.crs == LPS:
        matrix[:3] = BODY_TURN @ matrix[:3]
    return matrix
