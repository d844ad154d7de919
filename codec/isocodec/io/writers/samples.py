"""Masks out: which samples lie above, as arrays, black and white pictures, or volumes of zeros and ones."""

from __future__ import annotations

import gzip
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from ...drawing.rows import MaskRows
from ...extras import optional
from ...field.placement import Placement
from .output_formats import Format, find_suffix

Mask = NDArray[np.bool_]
Shape = tuple[int, ...]


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


def stored_last_first(suffix: str) -> bool:
    """Whether a format stores the samples of the transposed array: `write_mask` wants rows of that."""
    return suffix in (".nii", ".nii.gz")


def write_mask(file: BinaryIO, rows: MaskRows, suffix: str, placement: Placement | None = None) -> int:
    """Write the file of a mask, some rows at a time; how many samples lie above.

    Parameters
    ----------
    file : binary file
    rows : MaskRows
        Of the transposed array if `stored_last_first`.
    suffix : str
        As `check_mask_suffix` returns it.
    placement : Placement, optional
        Where the samples lie; formats without coordinates leave it out.
    """
    counted = _Counted(rows)
    _FORMATS[suffix].render(file, rows.shape, counted, placement)
    return counted.above


class _Counted:
    """Rows as they come, and how many of their samples lie above."""

    def __init__(self, rows: MaskRows) -> None:
        self.above = 0
        self._rows = rows

    def __iter__(self) -> Iterator[Mask]:
        for some in self._rows:
            self.above += int(np.count_nonzero(some))
            yield some


def _npy(file: BinaryIO, shape: Shape, rows: Iterable[Mask], _: Placement | None) -> None:
    np.lib.format.write_array_header_1_0(file, {"descr": "|b1", "fortran_order": False, "shape": shape})
    for some in rows:
        file.write(some.data)


def _pillow() -> Any:
    return optional("PIL.Image", extra="image", purpose="writing .png")


def _png(file: BinaryIO, shape: Shape, rows: Iterable[Mask], _: Placement | None) -> None:
    """Above is white. The library wants the whole picture."""
    pillow = _pillow()
    picture = pillow.new("L", shape[::-1])
    start = 0
    for some in rows:
        picture.paste(pillow.fromarray(some.view(np.uint8) * np.uint8(255)), (0, start))
        start += len(some)
    picture.save(file, "PNG")


def _nibabel() -> Any:
    return optional("nibabel", extra="nifti", purpose="writing NIfTI")


def _nii(file: BinaryIO, shape: Shape, rows: Iterable[Mask], placement: Placement | None) -> None:
    """1 above, in the coordinates of the placement; without one in none."""
    nibabel = _nibabel()
    matrix = None if placement is None else placement.matrix
    affine = None if matrix is None else np.vstack([matrix, [0, 0, 0, 1]])
    # the library sees an array of this shape that takes no memory; its samples follow the header
    image = nibabel.Nifti1Image(np.broadcast_to(np.uint8(0), shape[::-1]), affine)
    if affine is not None:
        # for programs that only know quaternions, which cannot tell sheared axes
        with suppress(nibabel.spatialimages.HeaderDataError):
            image.set_qform(affine, code="aligned", strip_shears=False)
    image.update_header()
    image.header.set_slope_inter(1, 0)
    offset = int(image.header.single_vox_offset)
    image.header.set_data_offset(offset)
    file.write(image.header.binaryblock.ljust(offset, b"\0"))
    for some in rows:
        file.write(some.data)


def _nii_gz(file: BinaryIO, shape: Shape, rows: Iterable[Mask], placement: Placement | None) -> None:
    # without the time of day: the same mask, the same bytes
    with gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=0) as packed:
        _nii(cast(BinaryIO, packed), shape, rows, placement)


_FORMATS = {
    ".npy": Format((2, 3), _npy),
    ".png": Format((2,), _png, _pillow),
    ".nii": Format((3,), _nii, _nibabel),
    ".nii.gz": Format((3,), _nii_gz, _nibabel),
}
