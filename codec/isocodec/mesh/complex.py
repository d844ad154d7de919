"""Explicit complexes: integer positions, cells, their neighbours and stars (spec clause 10.2)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..kernel import inlined, kernel, record
from ..kernel.types import BoolVector, IntMatrix, IntVector

EXTENT_BITS = {2: 20, 3: 20}
"""Bits of positions of a known mesh along the longest side of its box; sometimes one more."""
MOST_POSITION = 1 << 40
"""Upper bound of coordinates."""
NAMED = 5
"""Most simplices that an error names."""


@inlined
def holds(cell, t, v):
    """Whether a cell has a vertex."""
    for j in range(cell.shape[1]):  # noqa: SIM110 - compiled
        if cell[t, j] == v:
            return True
    return False


@record
class CellArrays(NamedTuple):
    """View for kernels of a complex of V vertices in d dimensions and T cells of n + 1 vertices.

    ``position`` (V, d), ``cell`` (T, n + 1), ``neighbour`` (T, n + 1): the cell across the face opposite each vertex,
    or -1; ``star``: the cells of vertex v from ``first[v]`` to ``first[v + 1]``, ascending.
    """

    position: IntMatrix
    cell: IntMatrix
    neighbour: IntMatrix
    first: IntVector
    star: IntVector


@dataclass(frozen=True, eq=False)
class Complex:
    """A triangulation of the plane or of a surface, or tetrahedra.

    Attributes
    ----------
    mesh : CellArrays
    unit : float
        Unit of positions.
    mirrored : (T,) bool
        Cells whose vertex order drawing has to reverse.
    """

    mesh: CellArrays
    unit: float
    mirrored: NDArray[np.bool_]

    @property
    def n(self) -> int:
        """Dimension of the cells."""
        return self.mesh.cell.shape[1] - 1

    @cached_property
    def digest(self) -> bytes:
        """The first 16 bytes of the SHA-256 of the canonical form (spec clause 10.1.2(1))."""
        vertices, d = self.mesh.position.shape
        cells, corners = self.mesh.cell.shape
        out = hashlib.sha256()
        for part in (np.array([d, corners - 1, vertices, cells]), self.mesh.position, self.mesh.cell):
            out.update(np.ascontiguousarray(part).astype("<i8").tobytes())
        return out.digest()[:16]


def complex_of(points: ArrayLike, cells: ArrayLike, exponent: int | None = None) -> tuple[Complex, NDArray[np.float64]]:
    """Make the complex of points (V, 2 or 3) and cells (T, 3 or 4); also returns the points as floats.

    The unit of positions is ``2**exponent``; by default it follows from the mesh's extent. Raises `InputError`, naming
    the first simplices, if this is not a complex: indices out of range, degenerate or duplicate cells, faces of more
    than two cells.
    """
    coordinates = _checked_points(points)
    simplices = _checked_cells(cells, coordinates)
    if exponent is None:
        exponent = _exponent(coordinates, simplices)
    with np.errstate(over="ignore"):
        scaled = np.rint(np.ldexp(coordinates, -exponent))
    if scaled.size and np.abs(scaled).max() >= MOST_POSITION:
        raise InputError("coordinates are too large for the unit of positions", code="points")
    position = scaled.astype(np.int64)
    _check_degenerate(position, simplices)
    return assembled(position, simplices, float(np.ldexp(1.0, exponent)), neighbours(simplices)), coordinates


def assembled(
    position: NDArray[np.int64], cells: NDArray[np.int64], unit: float, neighbour: NDArray[np.int64]
) -> Complex:
    """The complex of integer positions (V, d), cells (T, n + 1) and their neighbours."""
    mesh = _arrays(position, cells, neighbour)
    return Complex(mesh, unit, _mirrored(mesh))


def _arrays(position: NDArray[np.int64], cells: NDArray[np.int64], neighbour: NDArray[np.int64]) -> CellArrays:
    """Make the view for kernels, with the star of each vertex."""
    order = np.argsort(cells.ravel(), kind="stable")
    first = np.searchsorted(cells.ravel()[order], np.arange(len(position) + 1))
    return CellArrays(
        np.ascontiguousarray(position), np.ascontiguousarray(cells), neighbour, first.astype(np.int64),
        np.ascontiguousarray(order // cells.shape[1]),
    )


def part_of(domain: Complex, cells: NDArray[np.int64], source: NDArray[np.int64]) -> Complex:
    """Make a complex of other cells (T', n + 1) on the vertices of a mesh; ``source`` names the cell each came from.

    On a surface they are oriented like that cell, in the plane and in space like the axes.
    """
    made = _arrays(domain.mesh.position, cells, neighbours(cells))
    flat = made.position.shape[1] == domain.n
    return Complex(made, domain.unit, np.zeros(len(cells), np.bool_) if flat else domain.mirrored[source])


def _checked_points(points: ArrayLike) -> NDArray[np.float64]:
    found = np.asarray(points)
    if found.dtype.kind not in "iuf" or found.ndim != 2 or found.shape[1] not in (2, 3):
        raise InputError(
            f"the points have shape {found.shape} and type {found.dtype}", code="points",
            remedy="give numbers, a row of 2 or 3 coordinates for each point",
        )
    if len(found) < 3:
        raise InputError(f"{len(found)} points; a mesh has 3 at least", code="points")
    found = found.astype(np.float64)
    if not np.isfinite(found).all():
        bad = np.flatnonzero(~np.isfinite(found).all(axis=1))
        raise InputError(f"coordinates are not finite: points {_named(bad)}", code="points")
    return found


def _checked_cells(cells: ArrayLike, points: NDArray[np.float64]) -> NDArray[np.int64]:
    found = np.asarray(cells)
    corners = (3, 4) if points.shape[1] == 3 else (3,)
    if found.dtype.kind not in "iu" or found.ndim != 2 or found.shape[1] not in corners or not len(found):
        raise InputError(
            f"the cells have shape {found.shape} and type {found.dtype}", code="cells",
            remedy="give numbers of points: rows of 3 for triangles, of 4 for tetrahedra of points in space",
        )
    bad = np.flatnonzero(((found < 0) | (found >= len(points))).any(axis=1))
    if len(bad):
        raise InputError(f"cells refer to points that do not exist: cells {_named(bad)}", code="cells")
    found = found.astype(np.int64)
    used = np.zeros(len(points), np.bool_)
    used[found] = True
    _check_coincident(points, np.flatnonzero(used))
    return found


def _check_coincident(points: NDArray[np.float64], used: NDArray[np.int64]) -> None:
    order = used[np.lexsort(points[used].T)]
    same = np.flatnonzero((points[order[1:]] == points[order[:-1]]).all(axis=1))
    if len(same):
        raise InputError(
            f"{len(same)} points coincide with others: points {_named(order[same + 1])}", code="coincident",
            remedy="merge them first, and average their values",
        )


def _exponent(points: NDArray[np.float64], cells: NDArray[np.int64]) -> int:
    """Choose a unit that is fine relative to the extent of the cells, and keeps coordinates in bounds."""
    used = points[np.unique(cells)]
    extent = float((used.max(axis=0) - used.min(axis=0)).max())
    if not 0 < extent < np.inf:
        raise InputError("the points lie in one place, or too far from one another", code="points")
    largest = float(np.abs(points).max())
    fine = int(np.frexp(extent)[1]) - EXTENT_BITS[points.shape[1]]
    coarse = int(np.frexp(largest)[1]) - MOST_POSITION.bit_length() + 2
    return max(fine, coarse)


def _named(numbers: NDArray[np.int64]) -> str:
    """The first of some numbers, for people."""
    return ", ".join(map(str, numbers[:NAMED].tolist())) + (" .." if len(numbers) > NAMED else "")


def _check_degenerate(position: NDArray[np.int64], cells: NDArray[np.int64]) -> None:
    """Refuse degenerate and duplicate cells."""
    ordered = np.sort(cells, axis=1)
    twice = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    bad = np.flatnonzero(twice | ~has_volume(position, cells))
    if len(bad):
        raise InputError(
            f"{len(bad)} degenerate cells, without size: cells {_named(bad)}", code="degenerate",
            remedy="leave them out",
        )
    order = np.lexsort(ordered.T)
    again = (ordered[order[1:]] == ordered[order[:-1]]).all(axis=1)
    if again.any():
        raise InputError(
            f"duplicate cells: cells {_named(np.sort(order[1:][again]))}", code="repeated",
            remedy="leave them out",
        )


def determinants(position: NDArray[np.int64], cells: NDArray[np.int64]) -> NDArray[Any]:
    """Compute `volumes` of cells by their vertices."""
    return volumes(position[cells])


def volumes(corners: NDArray[np.int64]) -> NDArray[Any]:
    """Twice the signed areas of triangles, or six times the volumes of tetrahedra, exactly: int64 or object.

    ``corners`` are (T, 3, 2) or (T, 4, 3).
    """
    side = corners[:, 1:] - corners[:, :1]
    if side.size and int(np.abs(side).max()) ** side.shape[2] >= 1 << 60:
        side = side.astype(object)
    if side.shape[2] == 2:
        return side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]
    a, b, c = side[:, 0], side[:, 1], side[:, 2]
    out: NDArray[Any] = (
        a[:, 0] * (b[:, 1] * c[:, 2] - b[:, 2] * c[:, 1])
        - a[:, 1] * (b[:, 0] * c[:, 2] - b[:, 2] * c[:, 0])
        + a[:, 2] * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    )
    return out


def has_volume(position: NDArray[np.int64], cells: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether cells have a size, (T,) bool."""
    if position.shape[1] == cells.shape[1] - 1:
        return np.asarray(determinants(position, cells) != 0, np.bool_)
    flat = [determinants(np.delete(position, axis, axis=1), cells) for axis in range(3)]
    return np.any([each != 0 for each in flat], axis=0)


def neighbours(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cells across the faces, (T, n + 1); refuses faces of more than two cells."""
    count, corners = cells.shape
    faces = np.concatenate([np.delete(cells, i, axis=1) for i in range(corners)])
    faces.sort(axis=1)
    order = np.lexsort(faces.T[::-1])
    same = (faces[order[1:]] == faces[order[:-1]]).all(axis=1)
    if len(same) > 1 and (same[1:] & same[:-1]).any():
        bad = np.unique(order[1:-1][same[1:] & same[:-1]] % count)
        raise InputError(
            f"not manifold: faces of more than two cells, at cells {_named(bad)}", code="manifold",
            remedy="cut the mesh there, or encode its parts",
        )
    out = np.full(count * corners, -1, np.int64)
    here, there = order[:-1][same], order[1:][same]
    out[here], out[there] = there % count, here % count
    return np.ascontiguousarray(out.reshape(corners, count).T)


def _mirrored(mesh: CellArrays) -> NDArray[np.bool_]:
    """Find cells oriented against the axes, or on a surface against the first cell of their piece."""
    if mesh.position.shape[1] == mesh.cell.shape[1] - 1:
        return np.asarray(determinants(mesh.position, mesh.cell) < 0, np.bool_)
    mirrored = np.zeros(len(mesh.cell), np.bool_)
    _agree(mesh, mirrored, np.zeros(len(mesh.cell), np.bool_), np.zeros(len(mesh.cell), np.int64))
    return mirrored


@kernel
def _agree(mesh: CellArrays, mirrored: BoolVector, seen: BoolVector, stack: IntVector) -> None:
    """Orient triangles of a surface like their neighbours, piece by piece, where it has two sides."""
    for start in range(len(mesh.cell)):
        if seen[start]:
            continue
        seen[start] = True
        stack[0] = start
        count = 1
        while count > 0:
            count -= 1
            t = stack[count]
            for i in range(3):
                other = mesh.neighbour[t, i]
                if other < 0 or seen[other]:
                    continue
                seen[other] = True
                a = mesh.cell[t, (i + 1) % 3]
                b = mesh.cell[t, (i + 2) % 3]
                same = False
                for j in range(3):
                    if mesh.cell[other, j] == a and mesh.cell[other, (j + 1) % 3] == b:
                        same = True
                mirrored[other] = mirrored[t] != same
                stack[count] = other
                count += 1
