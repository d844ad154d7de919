"""Vectors for rules of clause 10 that files of the encoder do not reach: folded meshes, chains, large numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import isocodec
from isocodec.format.domain import MeshLayerHead
from isocodec.mesh.isovalue import MeshIsovalue
from isospec.container import ChunkType, MeshLayer, write_varint, zigzag

from .draft import Draft
from .explicit import EXPLICIT, MESHES, VALUE, hills, plane
from .explicit_dump import Mesh, written
from .fields import Integers, random_numbers
from .folded import beside, piece, pinched, simplex
from .mesh_layers import Layers
from .streams import Chunk

_SIGNS = MeshLayerHead(MeshLayer.SIGNS)
FOLDED: dict[int, tuple[int, ...]] = {2: (281, 282, 284, 288, 295), 3: (15, 79, 102, 61, 862, 1526)}
"""Pieces in which some target is refused for what links have in common: vertices or, of tetrahedra, sides."""


def _levels(name: str, mesh: Mesh, *features: str) -> Draft:
    """Signs of a mesh level by level; the values are random."""
    values = np.array(random_numbers(81, len(mesh[0]), 8), np.int64)
    data = isocodec.encode(isocodec.Mesh(*mesh, values, progressive=True), 128.5, precision="signs")
    return Draft(name, data, mesh[1].shape[1] - 1, (EXPLICIT, "levels", *features), mesh=written(mesh))


def rounds() -> Iterator[Draft]:
    """Meshes whose links are what 10.8.1(5) and 10.8.2(2) are about."""
    for n, seeds in FOLDED.items():
        mesh = beside(*(piece(n, seed) for seed in seeds), simplex(n))
        kind = "surface" if n == 2 else "space"
        yield _levels(f"mesh_{kind}_levels_folded", mesh, "links that have too much in common")
    yield _levels("mesh_space_levels_pinched", pinched(), "a vertex that stays, though its link changes")


def numbers() -> Iterator[Draft]:
    """Large numbers of values, for guesses from the mean around and from the wrong side (10.6.2(3))."""
    for kind, make in MESHES.items():
        mesh = make()
        values = 3000 * hills(mesh, 0, 90)
        data = isocodec.encode(isocodec.Mesh(*mesh, values, progressive=False), 3000 * VALUE, precision="exact")
        features = (EXPLICIT, "large numbers of values")
        yield Draft(f"mesh_{kind}_large_values", data, mesh[1].shape[1] - 1, features, mesh=written(mesh))


def _chunk(kind: ChunkType, *numbers: int) -> Chunk:
    return Chunk(kind, b"".join(map(write_varint, numbers)))


def _isovalue(value: float, lean: int) -> Chunk:
    """Begin an isovalue; ``value`` is an odd number of halves."""
    return Chunk(ChunkType.ISOVALUE, bytes([lean]) + write_varint(zigzag(round(2 * value))))


def geometry() -> Iterator[Draft]:
    """Offsets and values of one isovalue, in either order."""
    mesh = plane()
    layers, values = Layers(mesh, VALUE), hills(mesh)
    steps = np.where(values > VALUE, values - 101, 100 - values)
    heads = (MeshLayerHead(MeshLayer.OFFSETS, step=64), MeshLayerHead(MeshLayer.VALUES, bits=(8, 8)))
    for name, order in (("offsets_values", heads), ("values_offsets", heads[::-1])):
        one = layers.isovalue(VALUE)
        chunks = [layers.layer(one, head, values > VALUE, steps) for head in (_SIGNS, *order)]
        yield Draft(
            f"mesh_plane_{name}", layers.file(*chunks), 2, (EXPLICIT, "offsets and values"), mesh=written(mesh)
        )


def chains() -> Iterator[Draft]:
    """Isovalues that lean on one that leans on another one, in one frame and over frames (10.1.4(1))."""
    mesh = plane()
    layers, values = Layers(mesh, VALUE), hills(mesh)
    # signs and numbers that contradict one another, so that it matters which one counts
    noise = np.array(random_numbers(91, 3 * len(values), 7), np.int64).reshape(3, -1)
    chunks: list[Chunk] = []
    earlier: list[MeshIsovalue] = []
    for i, value in enumerate((VALUE, VALUE + 20, VALUE + 10)):
        one = layers.isovalue(value, earlier[::-1])
        chunks += [_isovalue(value, 1)] * bool(i)
        chunks += [layers.layer(one, _SIGNS, values + noise[i] - 64 > value)]
        chunks += [layers.layer(one, MeshLayerHead(MeshLayer.VALUES, bits=(8, 8)), values > value, noise[i])]
        earlier.append(one)
    features = (EXPLICIT, "a chain of isovalues", "numbers that contradict one another")
    yield Draft("mesh_plane_chain", layers.file(*chunks), 2, features, mesh=written(mesh))
    yield _over_frames(mesh, layers, values)


def _over_frames(mesh: Mesh, layers: Layers, values: Integers) -> Draft:
    """A frame whose second isovalue leans on its first one, which leans on the frame before."""
    moved = hills(mesh, 3)
    first = layers.isovalue(VALUE)
    chunks = [_chunk(ChunkType.SERIES, 0), layers.layer(first, _SIGNS, values > VALUE), _isovalue(VALUE - 20, 1)]
    chunks.append(layers.layer(layers.isovalue(VALUE - 20, [first]), _SIGNS, values > VALUE - 20))
    third = layers.isovalue(VALUE, before=first)
    chunks += [_chunk(ChunkType.FRAME), layers.layer(third, _SIGNS, moved > VALUE), _chunk(ChunkType.FRAME, 1)]
    chunks.append(layers.layer(layers.isovalue(VALUE - 20, [third]), _SIGNS, moved > VALUE - 20))
    features = (EXPLICIT, "series of frames", "a chain of isovalues that ends with the frame")
    return Draft("mesh_plane_frames_chain", layers.file(*chunks), 2, features, mesh=written(mesh))


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (rounds, numbers, geometry, chains):
        yield from group()
