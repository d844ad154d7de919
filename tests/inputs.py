"""Small inputs that tests share, and what is read of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import isocodec
from isocodec.field.placement import Placement
from isocodec.io.opener import Choice, load

CELLS = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
META = b"ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = 2 3 4\nElementType = MET_UCHAR\n"


def read_field(path: Path, **choice: Any) -> np.ndarray[Any, Any]:
    """The samples of a file."""
    found = load(path, Choice(**choice))
    assert isinstance(found, isocodec.Field)
    return found.values


def read_place(path: Path, **choice: Any) -> Placement:
    """Where the samples of a file lie, with all remarks."""
    found = load(path, Choice(**choice))
    assert isinstance(found, isocodec.Field)
    return replace(found.placement or Placement(crs=found.crs), remark="; ".join(found.remarks))


def says_nothing(place: Placement) -> bool:
    """Whether a file does not state where its samples lie, nor anything that is left out."""
    return not (place.placed or place.crs or place.remark)


def virtual(file: Any, name: str, target: str, inner: str) -> None:
    import h5py

    layout = h5py.VirtualLayout((3, 4), "u1")
    layout[:] = h5py.VirtualSource(target, inner, (3, 4))
    file.create_virtual_dataset(name, layout)
