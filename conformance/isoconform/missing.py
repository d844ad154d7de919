"""Vectors of files with missing samples (clauses 3.5.6, 5.10 and 9.8)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from isocodec import Field, encode
from isospec.container import ChunkType

from .adaptive import SOME, SPACES, base_on
from .draft import Draft, encoded, within
from .fields import Integers, noise, waves
from .isovalues import GRID, HIGH, SHAPES, VALUE
from .meshes import random_mesh
from .streams import Chunk, File, split

Gone = NDArray[np.bool_]


def _holed(shape: tuple[int, ...]) -> tuple[Integers, Gone]:
    """Hills; a hole, single samples on the border and within."""
    field = waves(shape, HIGH, 4) + noise(shape, 90, 4)
    gone = np.zeros(shape, np.bool_)
    gone[tuple(slice(2, size // 2) for size in shape)] = True
    gone[(0,) * len(shape)] = gone[tuple(size - 2 for size in shape)] = gone[-1, 1] = True
    return field, gone


def whole() -> Iterator[Draft]:
    """As the reference encoder's options give them, and planned ones."""
    for shape in SHAPES:
        space, (field, gone) = SPACES[len(shape)], _holed(shape)
        mesh = random_mesh(shape, 93, SOME)
        for name, isovalues, about, options in (
            ("exact", VALUE, "values", {"precision": "exact"}),
            ("offsets", VALUE, "offsets", {}),
            ("main", VALUE, "in the main profile", {"profile": "main"}),
            ("single_rate", VALUE, "in a base", {"layers": [("base", None), ("values", None)]}),
            ("coarse", VALUE, "on a mesh that is not the full grid", {"layers": [("base", 3), ("offsets", 9, 0)]}),
            ("adaptive", VALUE, "on an adaptive mesh", {"layers": [base_on(field, mesh), ("values", 3)]}),
            ("isovalues", (VALUE, VALUE + 2), "in two isovalues", {"precision": "exact"}),
            ("empty", 300, "no curve", {"precision": "signs"}),
        ):
            yield encoded(
                f"{space}_missing_{name}", field, isovalues, f"missing samples: {about}", states=name == "exact",
                mask=gone, **options,
            )
        rough, spots = noise(shape, 94, 4), noise(shape, 95, 4) > 9
        spots[-1], spots[:, -2] = True, True
        spots[0], spots[-1, :2] = False, False
        for name, about, plan in (
            ("rounds", "in rounds", GRID),
            ("base", "in a base", [("base", None)]),
        ):
            yield encoded(
                f"{space}_missing_noise_{name}", rough, (7, 9), f"missing samples: noise and spots, {about}",
                states=False, mask=spots, layers=[*plan, ("values", None)],
            )
        most = np.arange(field.size).reshape(shape) > 0
        about = "missing samples: all but one"
        yield encoded(f"{space}_missing_all_but_one", field, VALUE, about, mask=most, precision="exact")


def _file(shape: tuple[int, ...]) -> tuple[File, Chunk]:
    """A file of two isovalues with missing samples, and its mask."""
    field, gone = _holed(shape)
    file = split(
        encode(Field(field, mask=gone), (VALUE, VALUE + 3), profile="baseline", layers=[*GRID, ("values", None)])
    )
    (mask,) = (chunk for chunk in file.chunks if chunk.type == ChunkType.MASK)
    return file, mask


def places() -> Iterator[Draft]:
    """Masks elsewhere than before the first layers, and files that are cut."""
    for shape in SHAPES:
        space, (field, gone) = SPACES[len(shape)], _holed(shape)
        mask = _file(shape)[1]
        plain = split(encode(field, VALUE, profile="baseline", precision="exact"))
        data = bytes(replace(plain, chunks=(*plain.chunks, mask)))
        yield Draft(f"{space}_missing_mask_last", data, len(shape), ("missing samples: the mask behind all layers",))
        without = [chunk for chunk in plain.chunks if chunk.type == ChunkType.LAYERS]
        later = encode(
            Field(field, mask=gone), (VALUE, VALUE + 3), profile="baseline", order="independent", precision="exact",
        )
        rest = split(later).chunks
        rest = rest[next(i for i, chunk in enumerate(rest) if chunk.type == ChunkType.ISOVALUE) :]
        for name, chunks in (("before", (mask, *rest)), ("behind", (rest[0], mask, *rest[1:]))):
            data = bytes(replace(plain, chunks=(*without, *chunks)))
            yield Draft(
                f"{space}_missing_mask_{name}_isovalue", data, len(shape),
                ("missing samples: the mask between two isovalues, of which one is coded with it",),
            )
    field, gone = _holed(SHAPES[0])
    data = within(encode(Field(field, mask=gone), VALUE, profile="baseline", precision="exact"), "values")[1]
    yield Draft("plane_missing_ends_in_values", data, 2, ("missing samples: the file ends too early",))


def refused() -> Iterator[Draft]:
    """Masks that violate the format."""
    for shape in SHAPES:
        space, (file, mask) = SPACES[len(shape)], _file(shape)
        others = tuple(chunk for chunk in file.chunks if chunk.type != ChunkType.MASK)
        for name, clause, about, chunks in (
            ("twice", "3.5.6", "a second mask", (mask, *others, mask)),
            ("ancillary", "3.5.2", "a mask marked as ancillary", (replace(mask, ancillary=True), *others)),
            ("leftover", "6.3", "bytes left over in a mask", (replace(mask, payload=mask.payload + bytes(9)), *others)),
        ):
            data = bytes(replace(file, chunks=chunks))
            yield Draft(f"{space}_missing_mask_{name}", data, len(shape), (f"error: {about}",), clause)


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (whole, places, refused):
        yield from group()
