"""Vertices that meshes of tiles in space may have in the faces that they share (spec clause 12.7)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..drawing.drawing import draw
from ..field.samples import Samples
from ..grid.lattice.depth import levels_of
from ..grid.lattice.tables import AXES
from .coarsening import Reduction, distinct
from .promise import Promise
from .strategy import NotKeptError, Plan, onto, uniform

Vertex = tuple[int, int, int]
Plane = tuple[int, int]
"""The axis across a face, and its place there."""
IN_FACE = 0.9
"""Share of the tolerance that the curve in a face keeps to by itself, so that the surface behind it can."""
MOST_TURNS = 40
HOPELESS, SPARE = 1.05, 40
"""A mesh that takes so many times the bytes of the full grid, and so many more, is given up."""
ROUGH, SOME = 0.5, 400
"""A mesh is given up if at first this share of a curve, and more than so many pieces, is too far away."""


@dataclass
class Faces:
    """Vertices that may be in the mesh of a tile: those that bring none into shared faces but what belongs there.

    In the mesh are all corners of the cubes of one edge. What further ones belong into a face follows from the
    samples in the face alone, so that both tiles find the same.

    Attributes
    ----------
    signs : (s0, s1, s2) bool
        Of the samples of the tile.
    shared : (3, 2) bool
        Across each axis the low and the high face.
    exponent : int
        Of the edge of the cubes of the uniform mesh.
    wanted : dict of list of vertices
        By face: those to be added to its mesh.
    crossed : bool
        Whether the surface crosses one of the faces that have been searched.
    """

    signs: NDArray[np.bool_]
    shared: NDArray[np.bool_]
    exponent: int
    wanted: dict[Plane, list[Vertex]] = field(default_factory=dict)
    crossed: bool = False
    _there: set[Vertex] = field(init=False, default_factory=set)
    _known: dict[tuple[Vertex, Plane | None], bool] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.size = self.signs.shape
        shared = np.argwhere(self.shared).tolist()
        self.planes: list[Plane] = [(axis, self.size[axis] - 1 if side else 0) for axis, side in shared]

    def search(self, plane: Plane, samples: Samples, tolerance: float) -> None:
        """Find the vertices of a face that its curve needs to keep to a tolerance, as far as they are allowed.

        They are those of the tile on its other side, from the same samples.

        Parameters
        ----------
        plane : axis and place
        samples : Samples
            Those of the face.
        tolerance : float

        Raises
        ------
        NotKeptError
            If that would take too much.
        """
        if samples.signs.all() or not samples.signs.any():
            return
        self.crossed = True
        promise = Promise(samples)
        found = self._found(plane, promise, tolerance, 1)
        if found is None:
            # one tile might be drawn by cubes, and that on the other side not (clause 9.1(2))
            found = self._found(plane, promise, tolerance, 2)
        assert found is not None
        self.wanted[plane] = found
        for vertex in found:
            self._there |= {each for each in ancestry(vertex, 1 << self.exponent) if each[plane[0]] == plane[1]}
        self._known.clear()

    def _found(self, plane: Plane, promise: Promise, tolerance: float, finest: int) -> list[Vertex] | None:
        """The vertices, of coordinates that are multiples of ``finest``; None if no side that is crossed stays larger
        than those of the full grid.
        """
        axis, place = plane
        level = max(promise.full_level - 2 * self.exponent, 0)
        reduction = promise.reduction()
        reduction.reduce(level=level)
        lead = uniform(2, level)
        found: list[Vertex] = []
        for turn in range(MOST_TURNS):
            leaves = promise.leaves([*lead, onto(reduction.chosen, lead)])[1]
            places = promise.excess(draw(leaves, measured=True), IN_FACE * tolerance)
            if turn == 0 and is_rough(promise, len(places)):
                raise NotKeptError("the field is rough in a face", code="tolerance")
            wanted = distinct(2, reduction.leaves_at(places))[0] if len(places) else np.zeros((0, 4), np.int64)
            inserted = np.insert(wanted[:, :2], axis, place, axis=1)
            able = np.array([self.allowed(vertex, plane) for vertex in vertices(inserted)], np.bool_)
            able &= (wanted[:, :2] % finest == 0).all(axis=1)
            if not able.any():
                break
            reduction.add(wanted[able, :AXES], wanted[able, AXES])
            found += vertices(inserted[able])
        finer = len(leaves.levels) and leaves.levels.min() == promise.full_level
        return None if finer else found

    def allowed(self, vertex: Vertex, free: Plane | None = None) -> bool:
        """Whether a vertex may be in the mesh, with its ancestors; in the face ``free`` all may."""
        if unit_of(vertex) >> self.exponent or not self._exists(vertex):
            return True
        key = vertex, free
        if key not in self._known:
            faces = [(a, p) for a, p in self.planes if vertex[a] == p and (a, p) != free]
            # what is found for a face must not depend on other ones, of which its other tile knows nothing
            own = free is None and (vertex in self._there or all(self._idle(vertex, a) for a, _ in faces))
            here = own or not faces
            self._known[key] = here and all(self.allowed(parent, free) for parent in parents(vertex))
        return self._known[key]

    def _idle(self, vertex: Vertex, axis: int) -> bool:
        """Whether a vertex in a face across an axis makes no crossings there: its diamond in the face has one sign."""
        unit = unit_of(vertex)
        across = [a for a in range(3) if a != axis]
        odd = sum(vertex[a] // unit & 1 for a in across)
        # corners of a square around the middle of its diagonal, or the ends of an edge and those beside
        ways = product((-unit, unit), repeat=2) if odd == 2 else ((-unit, 0), (unit, 0), (0, -unit), (0, unit))
        steps = np.zeros((4, 3), np.int64)
        steps[:, across] = list(ways)
        return len({self._sign(vertex), *(self._sign(corner) for corner in vertices(steps + vertex))}) == 1

    def _sign(self, vertex: Sequence[int]) -> bool:
        x, y, z = (min(max(v, 0), s - 1) for v, s in zip(vertex, self.size, strict=True))
        return bool(self.signs[x, y, z])

    def _exists(self, vertex: Vertex) -> bool:
        """Whether it does not lie behind a shared face, where this tile has no vertices."""
        return not any(vertex[a] < 0 or (self.shared[a, 1] and vertex[a] >= s) for a, s in enumerate(self.size))


def volume_plan(promise: Promise, tolerance: float, coarse: int, faces: Faces) -> Plan:
    """A plan on cubes of one edge, bisected where needed and allowed, that is proven to keep to the tolerance.

    Parameters
    ----------
    promise : Promise
        Of the tile.
    tolerance : float
    coarse : int
        Level of a uniform mesh that it leads to first.
    faces : Faces
        Those that are shared, searched.

    Raises
    ------
    NotKeptError
        If no such plan is found, or if it takes clearly more bytes than the full grid.
    """
    n, full = promise.n, promise.full_level
    level = max(full - n * faces.exponent, coarse)
    reduction = promise.reduction()
    reduction.reduce(level=level)
    for wanted in filter(None, faces.wanted.values()):
        position = np.array(wanted, np.int64)
        reduction.add(position, levels_of(position, full // n))
    lead = uniform(n, level, coarse)
    most = HOPELESS * promise.trial(uniform(n, full, coarse))[0] + SPARE
    for turn in range(MOST_TURNS):
        plan = [*lead, onto(reduction.chosen, lead)]
        size, contour = promise.trial(plan)
        places = promise.excess(contour, tolerance)
        if not len(places):
            return plan
        if size > most or (turn == 0 and is_rough(promise, len(places))) or not bisected(reduction, places, faces):
            break
    raise NotKeptError(f"no mesh was proven to stay within a tolerance of {tolerance:g}", code="tolerance")


def is_rough(promise: Promise, faults: int) -> bool:
    """Whether a curve that is too far away at so many places is to be given up at once."""
    return faults > max(ROUGH * len(promise.contour.cells), SOME)


def vertices(position: NDArray[np.int64]) -> list[Vertex]:
    """Rows (V, 3) as tuples."""
    return list(map(tuple, position.tolist()))


def unit_of(vertex: Sequence[int]) -> int:
    """The greatest power of two that divides all coordinates, 0 of the origin."""
    bits = vertex[0] | vertex[1] | vertex[2]
    return bits & -bits or 1 << 62


def parents(vertex: Vertex) -> list[Vertex]:
    """The parents of a middle in space, of all of the lattice (spec clause 4.7(3)).

    Of the middle of an edge of a cube they are the middles of the squares around, of the middle of a square those of
    the cubes on either side, and of the middle of a cube those of its corners that are middles of edges.
    """
    unit = unit_of(vertex)
    odd = [bool(x // unit & 1) for x in vertex]
    if all(odd):
        corners = [_moved(vertex, tuple(unit * d for d in way)) for way in product((-1, 1), repeat=3)]
        return [corner for corner in corners if sum(x // (2 * unit) & 1 for x in corner) == 1]
    ways = [tuple(d * (a == axis) for a in range(3)) for axis in range(3) if not odd[axis] for d in (-unit, unit)]
    return [_moved(vertex, way) for way in ways]


def _moved(vertex: Vertex, way: Sequence[int]) -> Vertex:
    return vertex[0] + way[0], vertex[1] + way[1], vertex[2] + way[2]


def ancestry(vertex: Vertex, cube: int) -> Iterator[Vertex]:
    """A vertex and its ancestors that are no corners of cubes of an edge."""
    left, seen = [vertex], {vertex}
    while left:
        here = left.pop()
        yield here
        more = {each for each in parents(here) if unit_of(each) < cube} - seen
        seen |= more
        left += more


def bisected(reduction: Reduction, places: NDArray[np.float64], faces: Faces) -> int:
    """Bisect the leaves at some places, and those next to full ones, as far as that is allowed; how many vertices that
    adds.
    """
    leaves = reduction.leaves_at(places)
    around = np.array(list(product((-0.75, 0.0, 0.75), repeat=3)))
    more = reduction.leaves_at((places[leaves[:, AXES] < 0][:, None] + around).reshape(-1, 3))
    wanted = distinct(3, np.concatenate([leaves, more]))[0]
    able = np.array([faces.allowed(vertex) for vertex in vertices(wanted[:, :AXES])], np.bool_)
    return reduction.add(wanted[able, :AXES], wanted[able, AXES]) if able.any() else 0
