"""Vectors for rules of clause 10 that files of the encoder do not reach: folded meshes, chains, large numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import isocodec
from isocodec.format.domain import MeshLayerHead
from isocodec.mesh.isovalue import MeshIsovalue
from isocodec.tin.delaunay import triangulate
from isospec.container import ChunkType, MeshLayer, write_varint, zigzag

from .draft import Draft
from .explicit import EXPLICIT, MESHES, VALUE, _draft, hills, plane
from .explicit_dump import Mesh, written
from .fields import Integers, random_numbers
from .folded import beside, piece, pinched, simplex
from .mesh_layers import Layers
from .streams import Chunk, split

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
    """Large numbers of values: guesses from the mean around and from the wrong side (10.6.2(3)), large products."""
    for kind, make in MESHES.items():
        mesh = make()
        for name, times in (("large", 3000), ("wide", 1 << 37)):
            values = times * hills(mesh, 0, 90)
            data = isocodec.encode(isocodec.Mesh(*mesh, values, progressive=False), times * VALUE, precision="exact")
            features = (EXPLICIT, f"{name} numbers of values")
            yield Draft(f"mesh_{kind}_{name}_values", data, mesh[1].shape[1] - 1, features, mesh=written(mesh))


def shapes() -> Iterator[Draft]:
    """Cells of unlike sizes (10.4.2), long and thin ones (10.8.2(3)), and flat surfaces: cells may become lines."""
    far = np.array(random_numbers(83, 80, 16), np.int64).reshape(-1, 2)
    points = np.unique(far >> (far.sum(axis=1, keepdims=True) % 14), axis=0)
    mesh = points, triangulate(points)
    yield _draft(
        "mesh_plane_unlike", mesh, hills(mesh), VALUE, "cells of unlike sizes", precision=8.0, progressive=False
    )
    flat = np.array([(x, y, 0) for x in range(12) for y in range(12)], np.int64)
    yield _levels("mesh_surface_levels_flat", (flat, triangulate(flat[:, :2])), "cells that would become lines")
    # beside another mesh, a cell of the least area that there is, with sides of 2**28 units
    points, cells = plane(60, 200, 0)
    size = 1 << 28
    thin = np.array([[300, 0], [300 + size, size + 1], [301 + size, size + 2]], np.int64)
    mesh = np.concatenate([points, thin]), np.concatenate([cells, len(points) + np.array([[0, 1, 2]])])
    layers = Layers(mesh, VALUE, 0)
    layer = layers.layer(layers.isovalue(VALUE), MeshLayerHead(MeshLayer.LEVELS, rounds=0), hills(mesh) > VALUE)
    features = (EXPLICIT, "levels", "a long and thin cell")
    yield Draft("mesh_plane_levels_thin", layers.file(layer), 2, features, mesh=written(mesh))
    mesh = plane()
    yield _draft(
        "mesh_plane_coded_fine", mesh, hills(mesh), VALUE, "cells of more than 2**13 units", kind="coded",
        precision="signs", mesh_error=5e-4,
    )


def rounding() -> Iterator[Draft]:
    """Coordinates that are no multiples of the unit: positions are rounded, ties to even (10.1.2(1))."""
    points, cells = plane()
    points = 5 * points + np.arange(len(points))[:, None] % 4
    data = Layers((points, cells), VALUE, 2).file()
    yield Draft("mesh_plane_rounded", data, 2, (EXPLICIT, "positions that are rounded"), mesh=written((points, cells)))


def notes() -> Iterator[Draft]:
    """Ancillary chunks that have no meaning here (10.1.1(2))."""
    mesh = plane()
    file = split(isocodec.encode(isocodec.Mesh(*mesh, hills(mesh)), VALUE, precision="exact"))
    kinds = (ChunkType.INDEX, ChunkType.COORDINATES, ChunkType.FRAME_END, 20)
    further = [Chunk(kind, b"\1\2\3", ancillary=True) for kind in kinds]
    data = bytes(file.with_chunks(file.chunks[0], *further, *file.chunks[1:]))
    yield Draft("mesh_plane_notes", data, 2, (EXPLICIT, "ancillary chunks without a meaning"), mesh=written(mesh))


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


def gaps() -> Iterator[Draft]:
    """Leaning on an isovalue without layers (10.1.3(3), 10.6.4), on a frame that lacks signs or numbers (10.1.5)."""
    mesh = plane()
    layers, values, moved = Layers(mesh, VALUE), hills(mesh), hills(mesh, 3)
    offsets = MeshLayerHead(MeshLayer.OFFSETS, step=64)
    first, gap = layers.isovalue(VALUE), VALUE + 20
    chunks = [layers.layer(first, head, values > VALUE) for head in (_SIGNS, offsets)]
    none = layers.isovalue(gap, [first])
    third = layers.isovalue(VALUE + 10, [none, first])
    chunks += [_isovalue(gap, 1), _isovalue(VALUE + 10, 1)]
    chunks += [layers.layer(third, head, values > VALUE + 10) for head in (_SIGNS, offsets)]
    features = (EXPLICIT, "a chain of isovalues, one without layers")
    yield Draft("mesh_plane_chain_gap", layers.file(*chunks), 2, features, mesh=written(mesh))
    numbers = MeshLayerHead(MeshLayer.VALUES, bits=(8, 8))
    levels = [MeshLayerHead(MeshLayer.LEVELS, rounds=rounds) for rounds in (1, 0)]
    for name, before, behind in (
        ("begun", (), levels), ("signs_values", (_SIGNS,), [_SIGNS, numbers]),
    ):
        one = layers.isovalue(VALUE)
        chunks = [_chunk(ChunkType.SERIES, 0), *(layers.layer(one, head, values > VALUE) for head in before)]
        other = layers.isovalue(VALUE, before=one)
        chunks += [_chunk(ChunkType.FRAME), *(layers.layer(other, head, moved > VALUE) for head in behind)]
        about = f"a frame {'with signs alone' if before else 'without layers'}"
        yield Draft(
            f"mesh_plane_frames_{name}", layers.file(*chunks), 2, (EXPLICIT, "series of frames", about),
            mesh=written(mesh),
        )


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (rounds, numbers, shapes, rounding, notes, geometry, chains, gaps):
        yield from group()
