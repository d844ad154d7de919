"""What the figures are drawn of: arrays of the corpus folder, by name."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import isocodec
from isocodec.field.samples import check_field
from isocodec.format.events import LayerComplete
from isocodec.search.original import original

Y_UP = [(0.0, 0.0, -1.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)]
"""Placement of a distance field whose axes are z, y, x of a mesh with y upwards and the front at +z."""
Z_UP = [(0.0, 0.0, 1.0, 0.0), (0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)]
"""The same of a mesh with z upwards and the front at +y."""


@dataclass(frozen=True)
class Item:
    """An array at one isovalue."""

    name: str
    values: NDArray
    isovalue: float

    @property
    def title(self) -> str:
        """For above a picture."""
        return f"{Path(self.name).name} at {self.isovalue:g}"

    @property
    def short(self) -> str:
        """For the name of a file."""
        return Path(self.name).name


def load(folder: Path, name: str, isovalue: float) -> Item:
    """The array ``name`` (without its suffix) of the folder.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    """
    for suffix in (".npy", ".npz"):
        path = folder / f"{name}{suffix}"
        if path.exists():
            loaded = np.load(path)
            return Item(name, loaded["values"] if suffix == ".npz" else loaded, isovalue)
    raise FileNotFoundError(f"{folder} has neither {name}.npy nor {name}.npz: give the folder of the corpus")


def original_of(item: Item) -> isocodec.Contour:
    """What distances are measured from: the contour of the full grid, with the points of marching squares or cubes."""
    return original(check_field(item.values, item.isovalue))


@dataclass(frozen=True)
class Stage:
    """What a prefix of a file decodes to."""

    decoder: isocodec.Decoder
    layer: str
    level: int
    bytes: int


def stages(data: bytes, layers: list[int]) -> list[Stage]:
    """A file after some of its layers, counted from 1."""
    out = []
    for wanted in layers:
        decoder = isocodec.Decoder()
        decoder.feed(data)
        for event in decoder:
            if isinstance(event, LayerComplete) and event.number == wanted:
                out.append(Stage(decoder, str(event.layer.kind), event.layer.level, event.offset))
                break
    return out


def ends(data: bytes) -> list[int]:
    """Byte offsets at which the layers of a file end."""
    decoder = isocodec.Decoder()
    decoder.feed(data)
    return [event.offset for event in decoder if isinstance(event, LayerComplete)]


def by_bytes(data: bytes, count: int) -> list[int]:
    """Numbers of at most so many layers that share the file by bytes: each takes about twice those before it."""
    offsets = np.array(ends(data))
    wanted = len(data) / 2.0 ** np.arange(count - 1, -1, -1)
    return sorted({int(np.abs(np.log(offsets / size)).argmin()) + 1 for size in wanted[:-1]} | {len(offsets)})
