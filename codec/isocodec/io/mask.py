"""Masks out: which samples lie above, as arrays, black and white pictures, or volumes of zeros and ones."""

from __future__ import annotations

import gzip
import io
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .extras import optional
from .formats import Format, find_suffix

Mask = NDArray[np.bool_]
Placement = NDArray[np.float64]


def check_mask_suffix(path: Path, n: int | None = None) -> str:
    """The suffix of ``path`` if masks (of ``n`` axes) can be written so, and the library for it is there.

    Raises
    ------
    OptionError
        Naming the formats that work.
    MissingExtraError
    """
    suffix = find_suffix(_FORMATS, path, n, f"a mask of {n} axes")
    _FORMATS[suffix].check_libraries()
    return suffix


def render_mask(mask: Mask, suffix: str, placement: Placement | None = None) -> bytes:
    """The whole file of a mask.

    Parameters
    ----------
    mask : (s0, s1) or (s0, s1, s2) bool
    suffix : str
        As `check_mask_suffix` returns it.
    placement : (n, n + 1) float64, optional
        Where the samples lie; formats that cannot say so do without it.
    """
    return _FORMATS[suffix].render(mask, placement)


def _npy(mask: Mask, _: Placement | None) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, mask)
    return buffer.getvalue()


def _imageio() -> Any:
    return optional("imageio.v3", extra="image", purpose="writing .png")


def _png(mask: Mask, _: Placement | None) -> bytes:
    """Above is white."""
    return bytes(_imageio().imwrite("<bytes>", mask.astype(np.uint8) * 255, plugin="pillow", extension=".png"))


def _nibabel() -> Any:
    return optional("nibabel", extra="nifti", purpose="writing NIfTI")


def _nii(mask: Mask, placement: Placement | None) -> bytes:
    """1 above, in the coordinates of the placement; without one in none."""
    nibabel = _nibabel()
    affine = None if placement is None else np.vstack([placement, [0, 0, 0, 1]])
    image = nibabel.Nifti1Image(mask.astype(np.uint8), affine)
    if affine is not None:
        # for programs that only know quaternions, which cannot tell sheared axes
        with suppress(nibabel.spatialimages.HeaderDataError):
            image.set_qform(affine, code="aligned", strip_shears=False)
    return bytes(image.to_bytes())


def _nii_gz(mask: Mask, placement: Placement | None) -> bytes:
    # without the time of day: the same mask, the same bytes
    return gzip.compress(_nii(mask, placement), mtime=0)


_FORMATS = {
    ".npy": Format((2, 3), _npy),
    ".png": Format((2,), _png, _imageio),
    ".nii": Format((3,), _nii, _nibabel),
    ".nii.gz": Format((3,), _nii_gz, _nibabel),
}
