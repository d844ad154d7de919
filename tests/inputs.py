"""Small inputs that tests of readers share: of every format, headers to be put together by hand, and what is read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import nibabel
import numpy as np
import SimpleITK
import tifffile
from PIL import Image

from isocodec.field.placement import Placement
from isocodec.io.readers.input_formats import open_file
from isocodec.io.readers.opened import Choice

CELLS = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
META = b"ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = 2 3 4\nElementType = MET_UCHAR\n"
NRRD = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 3 4\nencoding: raw\n"


def read_field(
    path: Path, *, key: str | None = None, channel: int | None = None, frame: int | None = None, **bounds: Any
) -> np.ndarray:
    """The samples of a file."""
    with open_file(path, Choice(key, channel), **bounds) as opened:
        return opened.values(frame)


def read_place(path: Path, n: int, key: str | None = None, **bounds: Any) -> Placement:
    """Where the samples of a file lie, of a field of n axes."""
    with open_file(path, Choice(key), **bounds) as opened:
        return opened.place(n)


def says_nothing(place: Placement) -> bool:
    """Whether a file does not state where its samples lie, nor anything that is left out."""
    return not (place.placed or place.crs or place.remark)


def read_nodata(path: Path, key: str | None = None) -> float | None:
    """The value that stands for missing samples in a file."""
    with open_file(path, Choice(key)) as opened:
        return opened.nodata


def written(folder: Path, name: str) -> tuple[Path, np.ndarray]:
    """A file of 24 samples, or 12 for pictures, and these."""
    path = folder / name
    field = CELLS[0] if name.endswith((".png", ".jpg")) else CELLS
    if name.endswith((".npy", ".npz")):
        (np.save if name.endswith(".npy") else np.savez_compressed)(path, field)
    elif name.endswith(".h5"):
        with h5py.File(path, "w") as file:
            file.create_dataset("x", data=field, compression="gzip")
    elif name.endswith(".tif"):
        tifffile.imwrite(path, field, photometric="minisblack", compression="zlib" if "packed" in name else None)
    elif name.endswith((".png", ".jpg")):
        Image.fromarray(field).save(path, quality=100)
        field = np.asarray(Image.open(path))
    elif name.endswith((".nii", ".nii.gz")):
        nibabel.Nifti1Image(field, np.eye(4)).to_filename(path)
    else:
        SimpleITK.WriteImage(SimpleITK.GetImageFromArray(field.T.copy()), path, useCompression=True)
    return path, field


def virtual(file: Any, name: str, target: str, inner: str) -> None:
    layout = h5py.VirtualLayout((3, 4), "u1")
    layout[:] = h5py.VirtualSource(target, inner, (3, 4))
    file.create_virtual_dataset(name, layout)
