"""Layers of cuts of a mesh (spec clause 10.8.7) against cells as sets of vertices."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from test_hierarchy import MESHES, Cell, Replay
from test_levels import middles

import isocodec
from brute import examples
from explicit_meshes import Mesh, crossings, plane
from isocodec.errors import FormatError, IsoError, LimitError
from isocodec.field.samples import Samples
from isocodec.format.chunks import write_chunk
from isocodec.format.events import DomainRead, MeshLayerComplete
from isocodec.limits import Limits
from isocodec.mesh.complex import complex_of
from isocodec.mesh.cut import CellHistory, history_of
from isocodec.mesh.hierarchy import hierarchy_of
from isocodec.stream.encoder import encoder_of
from isoconform.streams import split
from isospec.container import ChunkType

Nodes = NDArray[np.bool_]
LARGER = 100
"""Complexes from this seed on have a hundred vertices and more, and several rounds."""


def encoded(mesh: Mesh, values: NDArray, isovalue: Any, cuts: Callable[[CellHistory, Samples], list[Nodes]],
            **options: Any) -> bytes:
    """A file of isovalues on cuts."""
    given = isocodec.Mesh(*mesh, values, progressive=options.pop("progressive", None))
    encoder = encoder_of(given, isovalue, **options)
    encoder.frames.cuts = cuts
    return b"".join(encoder)


def replay(mesh: Mesh) -> Replay:
    return Replay(hierarchy_of(complex_of(*mesh)[0]))


def some(seed: int, layers: int) -> Callable[[CellHistory, Samples], list[Nodes]]:
    """Layers of any nodes, not what these need."""

    def cuts(history: CellHistory, field: Samples) -> list[Nodes]:
        rng = np.random.default_rng(seed)
        return [rng.random(len(history.vertex)) < rng.random() ** 2 for _ in range(layers)]

    return cuts


def mixed(cells: list[Cell], above: Nodes, apex: int) -> set[Cell]:
    """Real cells with both signs."""
    return {cell for cell in cells if apex not in cell and 0 < sum(bool(above[v]) for v in cell) < len(cell)}


def field_of(mesh: Mesh, seed: int) -> NDArray:
    """Smooth, rough, or a component at each few vertices."""
    rng = np.random.default_rng(seed)
    smooth = np.sin(mesh[0] / (np.ptp(mesh[0]) / 7)).sum(axis=1)
    return [smooth, rng.normal(size=len(smooth)) + 0.1, np.where(rng.random(len(smooth)) < 0.1, 1.0, -1.0)][seed % 3]


@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("seed", range(9))
def test_every_layer_shows_the_curve_of_its_cut(kind: str, seed: int) -> None:
    """Cut anywhere, a file draws the last complete layer: the cells of a cut, from brute force, that are crossed."""
    mesh = MESHES[kind](LARGER + seed)
    values, cuts, brute = field_of(mesh, seed), some(seed, 1 + seed % 3), replay(mesh)
    above = values > 0.1
    history = history_of(hierarchy_of(complex_of(*mesh)[0]))
    wanted: set[int] = set()
    want = []
    for layer in cuts(history, None):
        wanted |= set(np.flatnonzero(layer).tolist())
        want.append(mixed(brute.cut(wanted), above, brute.apex))
    data = encoded(mesh, values, 0.1, cuts, precision="signs")
    decoder = isocodec.Decoder(mesh=mesh)
    layers = 0
    for start in range(0, len(data), 3):
        decoder.feed(data[start : start + 3])
        layers += sum(isinstance(event, MeshLayerComplete) for event in decoder)
        if decoder.contents is None or decoder.contents.kind != "mesh":
            continue
        contour = decoder.on_mesh.contour()
        found = decoder.on_mesh.strand()
        if not layers:
            assert not len(contour.points)
            continue
        assert found is not None and found.cut is not None
        inside = set(np.flatnonzero(found.cut).tolist())
        cells = brute.cut(inside)
        known = set(np.flatnonzero(found.strand.sign >= 0).tolist())
        assert known == {v for cell in cells for v in cell} - {brute.apex}
        assert all(found.strand.sign[v] == above[v] for v in known)
        now = mixed(cells, above, brute.apex)
        assert now == want[layers - 1]
        drawn = {frozenset(cell) for cell in found.domain.mesh.cell[found.leaves].tolist()}
        assert drawn == now and len(found.leaves) == len(now)
        real = np.array([sorted(cell) for cell in cells if brute.apex not in cell])
        assert {tuple(p) for p in contour.points} == middles(mesh, real, above)
        if real.shape[1] == 3:
            assert len(contour.cells) == len(now)
    assert layers == len(want)


@pytest.mark.parametrize("kind", MESHES)
def test_nodes_that_change_nothing_stay_out(kind: str) -> None:
    """Of all nodes those come that the curve needs: with none that crosses, nobody but the vertices that are left."""
    mesh = MESHES[kind](LARGER)
    data = encoded(mesh, np.zeros(len(mesh[0])), 0.5, lambda history, _: [np.ones(len(history.vertex), np.bool_)])
    decoder = isocodec.Decoder(mesh=mesh)
    decoder.feed(data)
    found = decoder.take().on_mesh.strand()
    assert found is not None and found.cut is not None and len(found.cut) and not found.cut.any()
    assert not len(decoder.contour().points)


@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("precision", ["exact", 0.05])
def test_geometry_lies_on_the_edges_of_the_cut(kind: str, precision: Any) -> None:
    """Of all nodes: the same points as without a cut; of some: on crossed sides of the cut's cells, where values are
    linear between their ends.
    """
    for seed in range(4):
        mesh = MESHES[kind](LARGER + seed)
        values = np.rint(40 * field_of(mesh, 3 * seed)).astype(int)
        full = encoded(mesh, values, 0.5, lambda h, _: [np.ones(len(h.vertex), np.bool_)], precision=precision)
        plain = isocodec.encode(isocodec.Mesh(*mesh, values, progressive=False), 0.5, precision=precision)
        one, other = (isocodec.decode(data, mesh=mesh) for data in (full, plain))
        assert {tuple(p) for p in one.points.round(9)} == {tuple(p) for p in other.points.round(9)}
        assert len(one.cells) == len(other.cells)
        part = isocodec.open(encoded(mesh, values, 0.5, some(seed, 2), precision=precision), mesh=mesh)
        cells = part.mesh(0.5, whole=True).cells
        want = np.array(list(crossings((mesh[0], cells), values, 0.5).values()))
        points = part.contour(0.5).points
        assert len(points) == len(want)
        off = np.abs(points[:, None] - want[None]).max(axis=2).min(axis=1)
        assert off.max(initial=0) <= (1e-9 if precision == "exact" else precision)


@pytest.mark.parametrize("kind", MESHES)
def test_cuts_of_a_mesh_in_the_file(kind: str) -> None:
    """Its vertices and cells come in another order; the cut is one of the mesh as it comes."""
    mesh = MESHES[kind](126)
    values = field_of(mesh, 0)
    encoder = encoder_of(isocodec.Mesh(*mesh, values, stored="whole", error=1e-3), 0.1, precision="signs")
    encoder.frames.cuts = lambda history, _: [np.arange(len(history.vertex)) % 16 == 0]
    file = isocodec.open(b"".join(encoder))
    whole = isocodec.open(isocodec.encode(isocodec.Mesh(*mesh, values, stored="whole", error=1e-3), 0.1))
    cut, known = (each.mesh(0.1, whole=True) for each in (file, whole))
    assert {layer.kind for layer in file.info.layers} == {"cut"} and len(cut.cells) < len(known.cells)
    used = np.unique(cut.cells)
    assert np.array_equal(cut.above[used], whole.above(0.1)[used])
    mixes = mixed([frozenset(cell) for cell in cut.cells.tolist()], cut.above, -1)
    assert mixes and {frozenset(c) for c in file.mesh(0.1, whole=False).cells.tolist()} == mixes
    drawn = {tuple(p) for p in file.contour(0.1).points.round(9)}
    assert drawn == {tuple(np.round(p, 9)) for p in middles((known.points, cut.cells), cut.cells, cut.above)}


@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("progressive", [None, True, False])
def test_isovalues_that_lean_on_a_cut(kind: str, progressive: bool | None) -> None:
    """Of vertices that are not there nothing is known: those behind have the curve that they have alone."""
    for seed in range(1):
        mesh = MESHES[kind](LARGER + seed)
        values = np.rint(20 * field_of(mesh, seed)).astype(int)
        isovalues = (0.5, 5.5, -4.5)
        brute = replay(mesh)

        def cuts(history: CellHistory, field: Samples, seed: int = seed) -> list[Nodes]:
            return some(seed, 1)(history, field) if progressive is None or field.isovalue == 0.5 else []

        data = encoded(mesh, values, isovalues, cuts, precision="exact", progressive=progressive)
        file = isocodec.open(data, mesh=mesh)
        assert [file.info.leans[i] is not None for i in range(3)] == [False, True, True]
        wanted = some(seed, 1)(history_of(hierarchy_of(complex_of(*mesh)[0])), None)[0]
        for number, isovalue in enumerate(isovalues):
            whole = progressive is not None and number > 0
            cells = brute.cut(set(range(len(brute.nodes))) if whole else set(np.flatnonzero(wanted).tolist()))
            crossed = mixed(cells, values > isovalue, brute.apex)
            found = {frozenset(cell) for cell in file.mesh(isovalue, whole=False).cells.tolist()}
            assert found == crossed
            part = np.array([sorted(c) for c in crossed]).reshape(len(crossed), -1)
            apart = crossings((mesh[0], part), values, isovalue)
            assert {tuple(np.round(p, 6)) for p in file.contour(isovalue).points} == {
                tuple(np.round(p, 6)) for p in apart.values()
            }


@pytest.mark.parametrize("kind", MESHES)
def test_series_of_cuts(kind: str) -> None:
    """Frames lean on the cut of the frame before, and on any kind of layers there."""
    mesh = MESHES[kind](LARGER + 3)
    frames = np.stack([np.sin(mesh[0] / (np.ptp(mesh[0]) / 6) + step / 9).sum(axis=1) for step in range(5)])
    brute = replay(mesh)
    numbers = count(1)

    def cuts(history: CellHistory, field: Samples) -> list[Nodes]:
        return some(7, 2)(history, field) if next(numbers) % 3 else []

    data = encoded(mesh, frames, 0.1, cuts, precision=0.4)
    wanted = np.any(some(7, 2)(history_of(hierarchy_of(complex_of(*mesh)[0])), None), axis=0)
    for frame, values in enumerate(frames):
        cells = brute.cut(set(np.flatnonzero(wanted).tolist()) if (frame + 1) % 3 else set(range(len(brute.nodes))))
        file = isocodec.open(data, mesh=mesh)
        drawn = isocodec.decode(data, mesh=mesh, frame=frame)
        crossed = mixed(cells, values > 0.1, brute.apex)
        part = np.array([sorted(c) for c in crossed])
        assert len(drawn.points) == len(crossings((mesh[0], part), values, 0.1))
        assert file.info.frames[frame].before[0] == (frame > 0)


def began(mesh: Mesh) -> bytes:
    """A file up to its layers."""
    data = encoded(mesh, np.arange(len(mesh[0])) % 7, 3.5, some(1, 1), precision="signs")
    decoder = isocodec.Decoder(mesh=mesh)
    decoder.feed(data)
    (read,) = (event for event in decoder if isinstance(event, DomainRead))
    return data[: read.offset]


@examples(300)
@given(st.sampled_from(sorted(MESHES)), st.lists(st.binary(min_size=1, max_size=60), min_size=1, max_size=4))
def test_any_bytes_end(kind: str, layers: list[bytes]) -> None:
    """A layer of random bytes is decoded or refused, and leaves a cut that draws."""
    mesh = MESHES[kind](LARGER + 1)
    decoder = isocodec.Decoder(mesh=mesh)
    decoder.feed(began(mesh))
    brute = replay(mesh)
    for layer in layers:
        decoder.feed(write_chunk(ChunkType.LAYERS, b"\x04" + layer))
    try:
        list(decoder)
    except IsoError as error:
        assert isinstance(error, FormatError) and error.clause == "6.3"
        return
    found = decoder.on_mesh.strand()
    assert found is not None and found.cut is not None
    inside = set(np.flatnonzero(found.cut).tolist())
    cells = {frozenset(cell) for cell in found.domain.mesh.cell.tolist()}
    assert cells == {cell for cell in brute.cut(inside) if brute.apex not in cell}
    assert len(decoder.contour().cells) >= len(found.leaves)


def test_layers_of_few_bytes_are_counted_as_work() -> None:
    """Each finds the curve anew on all cells that are there: many of them do not take hours."""
    mesh = plane(3, 5000, 1.0)
    values = field_of(mesh, 1)
    data = encoded(mesh, values, 0.1, lambda h, _: [np.ones(len(h.vertex), np.bool_)], precision="signs")
    file = split(data)
    assert len(isocodec.decode(data, mesh=mesh, limits=Limits(work=1 << 16)).points)
    short = [replace(file.chunks[1], payload=b"\x04\xff\xff")] * 1000
    with pytest.raises(LimitError) as caught:
        isocodec.decode(bytes(file.with_chunks(*file.chunks, *short)), mesh=mesh, limits=Limits(work=1 << 16))
    assert caught.value.code == "limit-work"


def test_memory_of_a_cut_is_counted() -> None:
    """More than that of levels of the same mesh."""
    mesh = plane(3, 600, 1.0)
    values = field_of(mesh, 0)
    files = (
        encoded(mesh, values, 0.1, some(1, 1), precision="signs"),
        isocodec.encode(isocodec.Mesh(*mesh, values, progressive=True), 0.1, precision="signs"),
    )

    def refused(data: bytes, memory: int) -> bool:
        try:
            isocodec.decode(data, mesh=mesh, limits=Limits(memory=memory))
        except LimitError as error:
            assert error.code == "limit-memory"
            return True
        return False

    cut, levels = (bisect_left(range(1 << 30), True, key=lambda m, data=data: not refused(data, m)) for data in files)
    assert levels < cut < 3 * levels
