"""Zarr reads the arrays of its stores, OME-Zarr among them, for `from_xarray`."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...extras import optional
from .arrays import ArrayInFile, Arrays
from .reading import reading
from .source import InputFile

_METADATA = ("zarr.json", ".zarray", ".zgroup")


def is_store(path: Path) -> bool:
    """Whether a folder is a group or an array of Zarr."""
    return any((path / name).is_file() for name in _METADATA)


@contextmanager
def arrays_of_zarr(source: InputFile) -> Iterator[Arrays]:
    """Open a store, which is an array or a group of them; its arrays by their paths."""
    zarr = optional("zarr", extra="xarray", purpose="reading .zarr")
    with reading("Zarr store"):
        top = source.path.resolve()
        if not source.follow:
            _check_links(source, top)
        found = zarr.open(str(top), mode="r")
        if hasattr(found, "dtype"):
            yield Arrays({"": _array(found)})
            return
        members = dict(found.members(max_depth=None))
        arrays = {name: _array(one) for name, one in members.items() if hasattr(one, "dtype")}
        levels: dict[str, ArrayInFile] = {}
        for name, group in {"": found, **members}.items():
            if not hasattr(group, "dtype"):
                levels |= _levels(f"{name}/" if name else "", dict(group.attrs), arrays)
        yield Arrays({**arrays, **levels}, default=next(iter(levels), None))


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


def _array(stored: Any) -> ArrayInFile:
    attributes = dict(stored.attrs)
    if stored.metadata.zarr_format == 2:
        dims = attributes.pop("_ARRAY_DIMENSIONS", None)
        # 0 is what Zarr itself begins with, not a marker; xarray has no other place for its own
        if "_FillValue" not in attributes and stored.fill_value is not None and stored.fill_value != 0:
            attributes["_FillValue"] = stored.fill_value
    else:
        dims = stored.metadata.dimension_names
    named = dims is not None and len(dims) == len(set(dims)) == stored.ndim
    return ArrayInFile(stored, list(dims) if named else [None] * stored.ndim, attributes)


def _levels(group: str, attributes: Mapping[str, Any], arrays: Mapping[str, ArrayInFile]) -> dict[str, ArrayInFile]:
    """The arrays of a multiscale image of OME-Zarr, the finest first, with coordinates along their axes in space."""
    out: dict[str, ArrayInFile] = {}
    ome = attributes.get("ome")
    images = (ome if isinstance(ome, Mapping) else attributes).get("multiscales")
    for image in images if isinstance(images, list) else ():
        axes = [axis if isinstance(axis, dict) else {"name": str(axis)} for axis in image.get("axes", "tczyx")]
        names = [str(axis["name"]) for axis in axes]
        for level in image["datasets"]:
            name = group + str(level["path"]).strip("/")
            if name not in arrays or arrays[name].stored.ndim != len(axes):
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
            given = arrays[name]
            along = {
                one: (start[i] + scale[i] * np.arange(given.stored.shape[i]),
                      {"axis": one, **({"units": axis["unit"]} if "unit" in axis else {})})
                for i, (one, axis) in enumerate(zip(names, axes, strict=True)) if axis.get("type", "space") == "space"
            }
            out[name] = ArrayInFile(given.stored, names, given.attributes, given.written, along)
    return out
