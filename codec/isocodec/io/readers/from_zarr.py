"""Zarr reads the arrays of its stores, OME-Zarr among them, for `from_xarray`."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from itertools import product
from pathlib import Path
from typing import Any
from zipfile import Path as At
from zipfile import ZipFile

import numpy as np

from ...errors import InputError
from ...extras import optional
from .arrays import Arrays, of_file
from .reading import reading
from .source import InputFile

_PACKED = ("zstd", "blosc", "gzip", "zlib", "bz2", "lzma", "lz4", "pcodec", "zfpy")
_ZSTD = b"\x28\xb5\x2f\xfd"
_METADATA = ("zarr.json", ".zarray", ".zgroup")


def is_store(path: Path) -> bool:
    """Whether a folder is a group or an array of Zarr."""
    return any((path / name).is_file() for name in _METADATA)


@contextmanager
def arrays_of_zarr(source: InputFile) -> Iterator[Arrays]:
    """Open a store, which is an array or a group of them; its arrays by their paths."""
    zarr = optional("zarr", extra="xarray", purpose="reading .zarr")
    with reading("Zarr store"), ExitStack() as held:
        top = source.path.resolve()
        zipped: ZipFile | None = None
        root: Any = str(top)
        within = ""
        if source.named(".zip"):
            zipped = held.enter_context(ZipFile(top))
            for each in zipped.infolist():
                source.check_packed(each.file_size, each.compress_size)
            # the folder that was packed, or what was in it
            tops = [name.rpartition("/")[0] for name in zipped.namelist() if name.rpartition("/")[2] in _METADATA]
            root, within = held.enter_context(zarr.storage.ZipStore(top, mode="r")), min(tops, key=len, default="")
        elif not source.follow:
            _check_links(source, top)
        found = zarr.open(root, path=within, mode="r")
        members = {"": found} if hasattr(found, "dtype") else {"": found, **dict(found.members(max_depth=None))}
        arrays = {name: _variable(source, one, zipped) for name, one in members.items() if hasattr(one, "dtype")}
        along: dict[str, dict[str, Any]] = {}
        for name, group in members.items():
            if name not in arrays:
                along |= _levels(f"{name}/" if name else "", dict(group.attrs), arrays)
        yield Arrays(arrays, default=next(iter(along), None), along=along)


def _check_links(source: InputFile, top: Path) -> None:
    """Refuse a store that links to something elsewhere: chunks are files."""
    folders = [str(top)]
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                if entry.is_symlink() and not Path(entry.path).resolve().is_relative_to(top):
                    raise source.refused(os.path.relpath(entry.path, top), "which links to another directory")
                if entry.is_dir(follow_symlinks=False):
                    folders.append(entry.path)


def _variable(source: InputFile, stored: Any, zipped: ZipFile | None) -> Any:
    attributes = dict(stored.attrs)
    if stored.metadata.zarr_format == 2:
        dims = attributes.pop("_ARRAY_DIMENSIONS", None)
        # 0 is what Zarr itself begins with, not a marker; xarray has no other place for its own
        if "_FillValue" not in attributes and stored.fill_value is not None and stored.fill_value != 0:
            attributes["_FillValue"] = stored.fill_value
    else:
        dims = stored.metadata.dimension_names
    named = dims is not None and len(dims) == len(set(dims)) == stored.ndim
    packings = sum(getattr(one, "codec_id", type(one).__name__).lower().startswith(_PACKED)
                   for one in (*stored.compressors, *stored.filters))

    def get(key: tuple[Any, ...]) -> Any:
        _check_chunks(stored, key, zipped)
        return stored[key]

    return of_file(source, stored, dims if named else [None] * stored.ndim, attributes, packings, get)


def _check_chunks(stored: Any, key: tuple[Any, ...], zipped: ZipFile | None) -> None:
    """Check that no chunk with these slices states another size than it has to have."""
    sizes = stored.shards or stored.chunks
    most = math.prod(sizes) * stored.dtype.itemsize
    touched = []
    for part, size, chunk in zip(key, stored.shape, sizes, strict=True):
        found = range(size)[part] if isinstance(part, slice) else (int(part) % size,)
        ends = sorted((found[0] // chunk, found[-1] // chunk)) if found else (0, -1)
        touched.append(range(ends[0], ends[1] + 1))
    for numbers in product(*touched):
        name = f"{stored.path}/{stored.metadata.encode_chunk_key(numbers)}".strip("/")
        path: Any = Path(getattr(stored.store, "root", ""), name) if zipped is None else At(zipped, name)
        if path.is_file():
            with path.open("rb") as file:
                stated = _unpacked(file.read(18), stored)
            if stated > most:
                raise InputError(f"holds a chunk that states {stated:,} bytes, and has {most:,}", code="unreadable")


def _unpacked(start: bytes, stored: Any) -> int:
    """Bytes that a chunk states by its first ones, packed by Blosc or Zstandard: of others it is bounded."""
    names = [getattr(one, "codec_id", type(one).__name__).lower() for one in stored.compressors]
    if any(name.startswith("blosc") for name in names):
        return int.from_bytes(start[4:8], "little")
    if any(name.startswith("zstd") for name in names) and start[:4] == _ZSTD:
        flags = start[4]
        at = 5 + (not flags >> 5 & 1) + (0, 1, 2, 4)[flags & 3]
        size = (flags >> 5 & 1, 2, 4, 8)[flags >> 6]
        return int.from_bytes(start[at : at + size], "little") + 256 * (size == 2) if size else 1 << 62
    return 0


def _levels(group: str, attributes: Mapping[str, Any], arrays: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Coordinates along the axes in space of multiscale images of OME-Zarr, by array, the finest first.

    The arrays get the names of these axes.
    """
    out: dict[str, dict[str, Any]] = {}
    ome = attributes.get("ome")
    images = (ome if isinstance(ome, Mapping) else attributes).get("multiscales")
    for image in images if isinstance(images, list) else ():
        axes = [axis if isinstance(axis, dict) else {"name": str(axis)} for axis in image.get("axes", "tczyx")]
        names = [str(axis["name"]) for axis in axes]
        for level in image["datasets"]:
            name = group + str(level["path"]).strip("/")
            if name not in arrays or arrays[name].ndim != len(axes):
                continue
            scale, start = np.ones(len(axes)), np.zeros(len(axes))
            for step in (*level.get("coordinateTransformations", ()), *image.get("coordinateTransformations", ())):
                if step["type"] == "scale":
                    factor = np.array(step["scale"], np.float64)
                    scale, start = scale * factor, start * factor
                elif step["type"] == "translation":
                    start = start + np.array(step["translation"], np.float64)
                elif step["type"] != "identity":
                    raise InputError(f"places its samples by '{step['type']}'; a scale and a translation can be read",
                                     code="placement")
            one = arrays[name]
            arrays[name] = one._replace(dims=names)
            out[name] = {
                dim: type(one)(dim, start[i] + scale[i] * np.arange(one.shape[i]),
                               {"axis": dim, **({"units": axis["unit"]} if "unit" in axis else {})})
                for i, (dim, axis) in enumerate(zip(names, axes, strict=True)) if axis.get("type", "space") == "space"
            }
    return out
