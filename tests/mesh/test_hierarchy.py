"""The hierarchy of a mesh against brute force: cells as sets of vertices, integers of Python (spec clause 10.8.2)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import combinations, pairwise

import numpy as np
import pytest

from brute import HEAVY
from explicit_meshes import Mesh, plane, space, torus
from isocodec.errors import OptionError
from isocodec.mesh.complex import Complex, complex_of
from isocodec.mesh.hierarchy import Hierarchy, hierarchy_of
from libraries import Late

Delaunay = Late("scipy.spatial.Delaunay")

Cell = frozenset[int]
COMPLEXES = range(300) if HEAVY else range(0, 100, 8)
"""Seeds of random complexes of each kind; the later ones are larger."""


def surface(seed: int) -> Mesh:
    """A torus with dents; half of them lack some triangles."""
    rng = np.random.default_rng(seed)
    points, cells = torus(int(rng.integers(6, 20)), int(rng.integers(5, 14)))
    kept = rng.random(len(cells)) < (0.85 if seed % 2 else 1.0)
    return points + rng.normal(size=points.shape) * 0.03, cells[kept]


def planar(seed: int) -> Mesh:
    return plane(seed, 20 + seed % 140, [1.0, 0.95, 0.8][seed % 3])


def solid(seed: int) -> Mesh:
    return space(seed, 15 + seed % 150, [1.0, 0.97, 0.85][seed % 3])


MESHES = {"plane": planar, "surface": surface, "space": solid}


class Replay:
    """Cells that there are at any time, by their makers and breakers: what one may put into a cut."""

    def __init__(self, hierarchy: Hierarchy) -> None:
        self.apex = len(hierarchy.position)
        self.nodes: list[tuple[int, int, list[Cell]]] = []
        for each in hierarchy.rounds:
            faces = [frozenset(face) for face in each.face.tolist()]
            self.nodes += [
                (v, u, faces[a:b]) for v, u, (a, b) in
                zip(each.vertex.tolist(), each.target.tolist(), pairwise(each.first.tolist()), strict=True)
            ]
        self.cells = [frozenset(cell) for cell in hierarchy.cell.tolist()]
        sides = Counter(cell - {v} for cell in self.cells for v in cell)
        self.cells += [side | {self.apex} for side, count in sides.items() if count == 1]
        self.given = len(self.cells)
        self.maker: list[int | None] = [None] * len(self.cells)
        self.breaker: list[int | None] = [None] * len(self.cells)
        there = {cell: i for i, cell in enumerate(self.cells)}
        assert len(there) == len(self.cells)
        self.patch: list[list[int]] = []
        for number, (v, u, faces) in enumerate(self.nodes):
            star = {face | {v} for face in faces}
            assert star == {cell for cell in there if v in cell}, "the faces are not those of all cells of the vertex"
            for cell in star:
                self.maker[there.pop(cell)] = number
            patch = {face | {u} for face in faces if u not in face}
            assert not patch & there.keys(), "a cell that is there already"
            for cell in patch:
                there[cell] = len(self.cells)
                self.cells.append(cell)
                self.maker.append(None)
                self.breaker.append(number)
            self.patch.append([there[cell] for cell in patch])

    def cut(self, wanted: set[int]) -> list[Cell]:
        """Cells of the least cut in which some vertices are there."""
        inside: set[int] = set()
        todo = list(wanted)
        while todo:
            number = todo.pop()
            if number not in inside:
                inside.add(number)
                todo += [m for i in self.patch[number] if (m := self.maker[i]) is not None]
        return [
            cell for cell, maker, breaker in zip(self.cells, self.maker, self.breaker, strict=True)
            if (maker is None or maker in inside) and breaker not in inside
        ]


def euler(cells: set[Cell]) -> int:
    """Euler characteristic."""
    faces = {frozenset(part) for cell in cells for size in range(1, len(cell) + 1) for part in combinations(cell, size)}
    return sum((-1) ** (len(face) - 1) for face in faces)


def determinant(position: list[list[int]], cell: tuple[int, ...]) -> int:
    """Of the sides from the first vertex, exactly."""
    sides = [[x - y for x, y in zip(position[v], position[cell[0]], strict=True)] for v in cell[1:]]
    if len(sides) == 2:
        return sides[0][0] * sides[1][1] - sides[0][1] * sides[1][0]
    (a, b, c), (d, e, f), (g, h, i) = sides
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def sides_of(cells: Iterable[Cell]) -> Counter[Cell]:
    """How many cells each face has."""
    return Counter(cell - {v} for cell in cells for v in cell)


def check_cut(domain: Complex, replay: Replay, cells: list[Cell]) -> None:
    """A cut is a complex like the mesh: no cell twice, faces of two cells, the same Euler characteristic.

    Only where the border of the mesh itself touches itself may faces at the apex have more cells.
    """
    assert len(set(cells)) == len(cells)
    whole = {frozenset(cell) for cell in domain.mesh.cell.tolist()}
    real = {cell for cell in cells if replay.apex not in cell}
    assert euler(real) == euler(whole)
    assert max(sides_of(real).values()) <= 2
    border = {side for side, count in sides_of(real).items() if count == 1}
    assert border == {cell - {replay.apex} for cell in cells if replay.apex in cell}
    given = sides_of(replay.cells[: replay.given])
    assert sum(count > 2 for count in sides_of(cells).values()) <= sum(count > 2 for count in given.values())


@pytest.mark.parametrize("kind", MESHES)
def test_any_cut_is_a_complex(kind: str) -> None:
    """Random cuts of random complexes; cells of the plane and of space have a positive determinant in all of them."""
    rng = np.random.default_rng(7)
    gone = vertices = 0
    for seed in COMPLEXES:
        domain, _ = complex_of(*MESHES[kind](seed))
        hierarchy = hierarchy_of(domain)
        replay = Replay(hierarchy)
        gone, vertices = gone + len(replay.nodes), vertices + len(np.unique(domain.mesh.cell))
        for _ in range(3):
            share = rng.random() ** 2
            check_cut(domain, replay, replay.cut(set(np.flatnonzero(rng.random(len(replay.nodes)) < share).tolist())))
        position = domain.mesh.position.tolist()
        for rounds in range(len(hierarchy.rounds) + 1):
            cells = list(map(tuple, hierarchy.cells(rounds).tolist()))
            first = sum(len(each.vertex) for each in hierarchy.rounds[:rounds])
            wanted = replay.cut(set(range(first, len(replay.nodes))))
            assert set(map(frozenset, cells)) == {cell for cell in wanted if replay.apex not in cell}
            assert len(set(cells)) == len(cells)
            if domain.n == domain.mesh.position.shape[1]:
                assert all(determinant(position, cell) > 0 for cell in cells)
    assert gone > vertices // 6


def test_exact_where_positions_are_far_apart() -> None:
    """Tetrahedra across a box of 2**29 units, with determinants far beyond 64 bits, stay positive."""
    points = np.rint(np.random.default_rng(3).random((400, 3)) * (1 << 29))
    position = points.astype(int).tolist()
    domain, _ = complex_of(points, Delaunay(points).simplices, 0)
    hierarchy = hierarchy_of(domain)
    assert len(hierarchy.rounds) > 3
    assert determinant(position, tuple(hierarchy.cells(len(hierarchy.rounds))[0].tolist())) > 1 << 70
    for rounds in range(len(hierarchy.rounds) + 1):
        assert all(determinant(position, tuple(cell)) > 0 for cell in hierarchy.cells(rounds).tolist())


def test_a_mesh_may_be_too_large_for_its_unit() -> None:
    points = np.array([[0, 0], [1 << 30, 0], [0, 1]])
    with pytest.raises(OptionError, match="too large for its unit"):
        hierarchy_of(complex_of(points, [[0, 1, 2]], 0)[0])
