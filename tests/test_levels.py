"""Signs of a mesh in the plane level by level (spec clause 10.8)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import isocodec
from explicit_meshes import Mesh, components, plane, space
from isocodec.errors import FormatError, OptionError
from isocodec.format.chunks import write_chunk
from isocodec.format.events import DomainRead
from isocodec.mesh.complex import complex_of
from isocodec.mesh.history import MOST_RING, history_of
from isocodec.mesh.isovalue import MeshIsovalue
from isospec.container import ChunkType


def areas(position: np.ndarray, cells: np.ndarray) -> np.ndarray:
    a, b = position[cells[:, 1]] - position[cells[:, 0]], position[cells[:, 2]] - position[cells[:, 0]]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def outline(cells: np.ndarray) -> set[tuple[int, int]]:
    """Sides of one triangle only; fails if one has more than two."""
    sides, count = np.unique(np.sort(cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True)
    assert count.max() <= 2
    return {tuple(side) for side in sides[count == 1].tolist()}


def curve(
    mesh: Mesh, values: np.ndarray, isovalue: float, precision: object, progressive: bool | None = None
) -> isocodec.Contour:
    given = isocodec.Mesh(*mesh, values, progressive=progressive)
    return isocodec.decode(isocodec.encode(given, isovalue, precision=precision), mesh=mesh)  # type: ignore[arg-type]


def grid(side: int) -> Mesh:
    """Squares cut in two: all co-circular, all degrees alike."""
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    points = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64)
    a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    cells = np.concatenate([np.stack([a, a + side, a + 1], axis=1), np.stack([a + 1, a + side, a + side + 1], axis=1)])
    return points, cells


@pytest.mark.parametrize("seed", range(12))
def test_every_round_leaves_a_triangulation_of_the_same_place(seed: int) -> None:
    mesh = plane(seed, 150, 0.97) if seed else grid(12)
    domain, _ = complex_of(*mesh)
    history = history_of(domain)
    position = domain.mesh.position
    there = set(np.unique(domain.mesh.cell).tolist())
    for removed, (before, after) in zip(history.rounds, pairwise(history.cells), strict=True):
        assert areas(position, after).min() > 0
        assert areas(position, after).sum() == areas(position, before).sum()
        assert outline(after) == outline(before)
        gone = set(removed.vertex.tolist())
        rings = [removed.ring[a:b].tolist() for a, b in pairwise(removed.first)]
        assert len(gone) == len(removed.vertex) and not gone & {v for ring in rings for v in ring}
        assert max(map(len, rings)) <= MOST_RING
        of_cells = {v: set() for v in gone}
        for cell in before.tolist():
            for v in set(cell) & gone:
                of_cells[v] |= set(cell) - {v}
        assert [of_cells[v] for v in removed.vertex.tolist()] == [set(ring) for ring in rings]
        there -= gone
        assert set(np.unique(after).tolist()) == there
    inner = {v for side in outline(history.cells[-1]) for v in side}
    assert len(there) < len(position) // 2 or len(inner) > len(there) // 2


@pytest.mark.parametrize("seed", range(30))
def test_the_same_curve_as_along_a_walk(seed: int) -> None:
    mesh = plane(seed, 120, [1.0, 0.95, 0.7][seed % 3])
    rng = np.random.default_rng(seed)
    values = rng.integers(-9, 10, 120) if seed % 2 else np.sin(mesh[0] / 20).sum(axis=1)
    precision = ["exact", 0.3, "signs"][seed % 3] if seed % 2 else 0.3
    got, want = (curve(mesh, values, 0.5, precision, each) for each in (True, False))
    assert np.array_equal(np.sort(got.points, axis=0), np.sort(want.points, axis=0)) or seed % 2 == 0
    # offsets are halves of parts, the same on each edge whatever the order
    assert {tuple(p) for p in got.points.round(9)} == {tuple(p) for p in want.points.round(9)}
    assert len(got.cells) == len(want.cells)
    assert components(len(got.points), got.cells) == components(len(want.points), want.cells)


def test_further_isovalues_lean() -> None:
    mesh = plane(3, 300, 0.98)
    values = np.rint(20 * np.sin(mesh[0] / 15).sum(axis=1)).astype(int)
    data = isocodec.encode(isocodec.Mesh(*mesh, values, progressive=True), [0.5, 5.5, -4.5], precision="exact")
    alone = isocodec.encode(
        isocodec.Mesh(*mesh, values, progressive=True), [0.5, 5.5, -4.5], precision="exact", order="independent",
    )
    assert len(data) < len(alone)
    for contour, isovalue in zip(isocodec.open(data, mesh=mesh).contours(), (0.5, 5.5, -4.5), strict=True):
        want = curve(mesh, values, isovalue, "exact")
        assert {tuple(p) for p in contour.points} == {tuple(p) for p in want.points}


def test_every_layer_shows_the_curve_of_its_mesh() -> None:
    """Brute force: middles of the sides that are crossed, of the triangles that are left."""
    mesh = plane(5, 400, 1.0)
    values = np.sin(mesh[0] / 12).sum(axis=1)
    domain, _ = complex_of(*mesh)
    history = history_of(domain)
    decoder = isocodec.Decoder(mesh=mesh)
    data = isocodec.encode(isocodec.Mesh(*mesh, values, progressive=True), 0.1, precision="signs")
    sizes = []
    for end in range(0, len(data), 3):
        decoder.feed(data[end : end + 3])
        contour = decoder.take().contour()
        if decoder.contents is None or decoder.contents.kind != "mesh":
            continue
        found = decoder.on_mesh.strand()
        if found is None or found.rounds is None:
            continue
        cells, above = history.cells[found.rounds], values > 0.1
        sides = np.unique(np.sort(cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
        sides = sides[above[sides[:, 0]] != above[sides[:, 1]]]
        assert {tuple(p) for p in contour.points} == {tuple(p) for p in mesh[0][sides].mean(axis=1)}
        sizes.append(len(contour.points))
    assert len(set(sizes)) >= 3 and sizes == sorted(sizes)


def test_refused_where_there_are_no_levels() -> None:
    mesh = space(1)
    with pytest.raises(OptionError, match="planar triangle mesh"):
        isocodec.encode(isocodec.Mesh(*mesh, np.arange(len(mesh[0])), progressive=True), 5.5)


@pytest.mark.parametrize("layers, clause", [
    ([(3, 0)], "10.8.1"), ([(3, 99)], "10.1.3"), ([(3, 1), (3, 1)], "10.1.3"), ([(3, 1), (1, 5)], "10.1.3"),
    ([(3, 1), (0,)], "10.1.3"), ([(0,), (3, 0)], "10.1.3"), ([(3,)], "10.1.3"),
])
def test_layers_that_may_not_come(layers: list[tuple[int, ...]], clause: str) -> None:
    """Of tetrahedra; more rounds than there are; the same number again; geometry or a walk before all are back."""
    mesh = space(1) if clause == "10.8.1" else plane(1, 60, 1.0)
    values = np.arange(len(mesh[0])) % 7
    decoder = isocodec.Decoder(mesh=mesh)
    decoder.feed(isocodec.encode(isocodec.Mesh(*mesh, values), 9.5, precision="signs"))
    (read,) = (event for event in decoder if isinstance(event, DomainRead))
    wrong = isocodec.Decoder(mesh=mesh)
    wrong.feed(decoder.data[: read.offset])
    # above all values: nothing but zeros is told, which so short a run has
    for layer in layers:
        wrong.feed(write_chunk(ChunkType.LAYERS, bytes(layer) + run_of_nothing(mesh, layer)))
    with pytest.raises(FormatError) as caught:
        list(wrong)
    assert caught.value.clause == clause


def run_of_nothing(mesh: Mesh, layer: tuple[int, ...]) -> bytes:
    """The run of a layer in which all vertices lie below."""
    strand = MeshIsovalue(complex_of(*mesh)[0], 9.5)
    run = strand.write()
    none = np.zeros(len(mesh[0]), np.bool_)
    if layer == (0,):
        strand.code_signs(none)
    elif layer == (3, 1):
        strand.code_levels(history_of(strand.domain), 1, none)
    return run.end()
