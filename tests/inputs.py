"""Small inputs that tests of readers share: of every format, headers to be put together by hand, and what is read."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import h5py
import nibabel
import numpy as np
import rasterio
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


DRIVERS = {
    ".tif": "GTiff", ".asc": "AAIGrid", ".img": "HFA", ".bil": "EHdr", ".bip": "EHdr", ".bsq": "ENVI", ".flt": "EHdr",
    ".jp2": "JP2OpenJPEG", ".sdat": "SAGA", ".rst": "RST", ".grd": "GS7BG", ".bt": "BT", ".gpkg": "GPKG", ".dem":
    "USGSDEM", ".hgt": "SRTMHGT", ".dt0": "DTED", ".png": "PNG",
}
"""Drivers of GDAL that write rasters of these suffixes."""
TYPES = {".flt": "float32", ".grd": "float64", ".png": "uint8"}


def raster(folder: Path, suffix: str, field: np.ndarray | None = None, **profile: Any) -> Path:
    """A raster that GDAL wrote; 40 x 30 steps of 1/1000 degrees if no field is given."""
    if field is None:
        field = np.add.outer(np.arange(30) * 3, np.arange(40))
    path = folder / f"a{suffix}"
    known = {".dt1": ".dt0", ".dt2": ".dt0", ".tiff": ".tif"}.get(suffix, suffix)
    west, north, step = 6.0, 46.0, 1 / 1000
    if known in (".hgt", ".dt0"):  # they cover a degree, samples on its border included
        side = 1201 if known == ".hgt" else 121
        field = np.resize(field, (side, side))
        path, step = folder / f"N45E006{suffix}", 1 / (side - 1)
        west, north = west - step / 2, north + step / 2
    if suffix == ".vrt":
        parts = raster(folder, ".tif", field, **profile)
        height, width = field.shape
        place = f"{west}, {step}, 0, {north}, 0, {-step}"
        path.write_text(
            f'<VRTDataset rasterXSize="{width}" rasterYSize="{height}"><SRS>EPSG:4326</SRS><GeoTransform>{place}'
            '</GeoTransform><VRTRasterBand dataType="Int16" band="1"><SimpleSource><SourceFilename relativeToVRT="1">'
            f"{parts.name}</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>"
        )
        return path
    given = {
        "driver": DRIVERS[known], "height": field.shape[0], "width": field.shape[1], "count": 1, "crs": "EPSG:4326",
        "dtype": TYPES.get(known, "int16"), "transform": rasterio.Affine(step, 0, west, 0, -step, north), **profile,
    }
    with warnings.catch_warnings(action="ignore"), rasterio.open(path, "w", **given) as file:
        file.write(field.astype(given["dtype"]), 1)
    return path


def virtual(file: Any, name: str, target: str, inner: str) -> None:
    layout = h5py.VirtualLayout((3, 4), "u1")
    layout[:] = h5py.VirtualSource(target, inner, (3, 4))
    file.create_virtual_dataset(name, layout)
