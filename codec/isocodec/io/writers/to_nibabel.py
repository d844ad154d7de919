"""Volumes of zeros and ones, or of labels, by nibabel."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from ...extras import optional
from .output_formats import Output, OutputOptions
from .things import SampleMask, volume_matrix


def _nii(mask: SampleMask, _: str, __: OutputOptions) -> Iterator[bytes]:
    """1 above, or labels, in the coordinates of the placement; without one in none."""
    nibabel = optional("nibabel", extra="nifti", purpose="writing NIfTI")
    matrix = volume_matrix(mask.placement)
    affine = None if matrix is None else np.vstack([matrix, [0, 0, 0, 1]])
    shape, rows = mask.taken(transposed=True)
    # the library sees an array of this shape that takes no memory; its samples follow the header
    dtype = np.dtype({"b": "u1", "f": "f4" if mask.dtype.itemsize <= 4 else "f8"}.get(mask.dtype.kind, mask.dtype))
    size = (*shape[::-1], *(1,) * (3 - len(shape)))
    image = nibabel.Nifti1Image(np.broadcast_to(np.zeros((), dtype), size), affine, dtype=dtype)
    if affine is not None:
        # for programs that only read quaternions, which cannot express sheared axes
        with suppress(nibabel.spatialimages.HeaderDataError):
            image.set_qform(affine, code="aligned", strip_shears=False)
    image.update_header()
    image.header.set_slope_inter(1, 0)
    offset = int(image.header.single_vox_offset)
    image.header.set_data_offset(offset)
    yield image.header.binaryblock.ljust(offset, b"\0")
    for some in rows:
        yield some.astype(dtype, copy=False).tobytes()


def _nii_gz(mask: SampleMask, suffix: str, options: OutputOptions) -> Iterator[bytes]:
    from gzip import GzipFile

    out = io.BytesIO()
    # without the time, so that equal masks give equal bytes
    with GzipFile(filename="", mode="wb", fileobj=out, mtime=0) as packed:
        for piece in _nii(mask, suffix, options):
            packed.write(piece)
            yield out.getvalue()
            out.seek(0)
            out.truncate()
    yield out.getvalue()


OUTPUTS = tuple(
    Output(kind, (suffix,), title, render, (2, 3), names_space=True, extra="nifti", libraries=("nibabel",))
    for kind in ("mask", "labels")
    for suffix, title, render in ((".nii", "NIfTI", _nii), (".nii.gz", "NIfTI, compressed", _nii_gz))
)
