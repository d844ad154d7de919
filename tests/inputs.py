"""Small inputs that tests of readers share: of every format, and headers to be put together by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import nibabel
import numpy as np
import SimpleITK
import tifffile
from PIL import Image

CELLS = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
META = b"ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = 2 3 4\nElementType = MET_UCHAR\n"
NRRD = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 3 4\nencoding: raw\n"


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
