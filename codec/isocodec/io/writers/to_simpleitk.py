"""Masks and labels of volumes as NRRD, by SimpleITK."""

from __future__ import annotations

import zlib

import numpy as np

from ...extras import optional
from .output_formats import Output, OutputOptions
from .things import SampleMask, library_files, volume_matrix

_NAMED, _UNNAMED = b"\nspace: left-posterior-superior\n", b"\nspace dimension: 3\n"


def _nrrd(mask: SampleMask, suffix: str, _: OutputOptions) -> bytes:
    """1 above, or labels, in the coordinates of the placement, with the name of their space; without one in none."""
    sitk = optional("SimpleITK", extra="itk", purpose=f"writing {suffix}")
    shape, rows = mask.taken(transposed=True)
    samples = np.concatenate(list(rows))
    samples = samples.astype(np.uint8) if samples.dtype.kind == "b" else samples
    image = sitk.GetImageFromArray(samples.reshape((1,) * (3 - len(shape)) + shape))
    matrix = volume_matrix(mask.placement)
    if matrix is not None:
        # the library's x runs to the left, its y to the back
        matrix = np.diag([-1.0, -1.0, 1.0]) @ matrix
        steps = np.linalg.norm(matrix[:, :3], axis=0)
        image.SetSpacing(steps.tolist())
        image.SetDirection((matrix[:, :3] / steps).ravel().tolist())
        image.SetOrigin(matrix[:, 3].tolist())
    # the library writes to a path only
    with library_files(suffix) as folder:
        path = folder / f"mask{suffix}"
        sitk.WriteImage(image, str(path), useCompression=True)
        data = path.read_bytes()
        # the library does not see that a disk is full at the end
        zlib.decompress(data.partition(b"\n\n")[2], zlib.MAX_WBITS | 16)
    return data if matrix is not None else data.replace(_NAMED, _UNNAMED, 1)


OUTPUTS = tuple(
    Output(kind, (".nrrd",), "NRRD", _nrrd, (2, 3), names_space=True, extra="itk", libraries=("SimpleITK",))
    for kind in ("mask", "labels")
)
