"""A mesh as a file has it: known to decoders, or stored with the cells or points that contours need (3.5.8, 10)."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isospec.container import DomainKind

from ..errors import InputError, OptionError
from ..field.meshed import Mesh
from ..format.domain import DomainHead, read_domain, write_domain
from ..mesh.complex import Complex
from ..mesh.mesh_run import encoded_mesh
from ..mesh.point_lattice import WantedTriangles, placements
from ..mesh.quantised import Quantised, quantised
from .mesh_contents import coordinates_of

REACH = 2
"""Scattered points may be moved so many times as far as they are rounded, where their triangles would change."""
CELL_KINDS, POINT_KINDS = ("known", "coded", "whole"), ("delaunay", "whole")
"""Ways to store a mesh with cells, and scattered points."""
KINDS = (*CELL_KINDS, "delaunay")
NEEDED = ("coded", "delaunay")
"""Ways to store only what the contours of all frames need."""
Crossed = Callable[[NDArray[np.int64]], NDArray[np.bool_]]
"""Finds which cells (T, n + 1) of given vertices a file needs, (T,)."""


@dataclass(frozen=True)
class StoredMesh:
    """A mesh as decoders have it.

    Attributes
    ----------
    domain : Complex
    points : (V, d) float64
        Where its vertices were given.
    source : (V,) int64
        Their numbers in the given mesh.
    payload : bytes
        Of the domain chunk.
    off : float
        How far rounded positions may lie from the given ones; 0 for a known mesh.
    rounded : (V, d) float64 or None
        Positions in a file that stores cells.
    """

    domain: Complex
    points: NDArray[np.float64]
    source: NDArray[np.int64]
    payload: bytes
    off: float = 0.0
    rounded: NDArray[np.float64] | None = None


def stored_kind(mesh: Mesh, complete: bool) -> str:
    """Choose how a mesh is stored, if it does not state that; ``complete``: it has the values of all frames.

    Raises
    ------
    OptionError
        If it cannot be stored as it asks for.
    """
    scattered = mesh.cells is None
    stored = mesh.stored or ("known" if not scattered else "delaunay" if complete else "whole")
    kinds = POINT_KINDS if scattered else CELL_KINDS
    if stored not in KINDS:
        raise OptionError(f"a mesh cannot be stored as {stored!r}", code="mesh",
                          remedy=f"choose one of: {', '.join(KINDS)}")
    if stored not in kinds:
        raise OptionError(
            f"a mesh {'without' if scattered else 'with'} cells cannot be stored as {stored!r}", code="mesh",
            remedy=f"choose one of: {', '.join(kinds)}" if scattered else "leave the cells out: a Delaunay "
                                                                         "triangulation is made from points",
        )
    if not complete and stored in NEEDED:
        raise OptionError(
            f"the {'points' if scattered else 'cells'} that contours need are known only once all frames are",
            code="mesh", remedy='give stored="whole", or encode a Mesh with values of all frames',
        )
    return stored


def known_mesh(domain: Complex, points: NDArray[np.float64]) -> StoredMesh:
    """Make the domain of a mesh that encoder and decoder both have."""
    mesh = domain.mesh
    exponent = math.frexp(domain.unit)[1] - 1
    size = len(mesh.position), len(mesh.cell)
    head = DomainHead(DomainKind.KNOWN, mesh.position.shape[1], exponent, *size, domain.digest)
    return StoredMesh(domain, points, np.arange(size[0]), write_domain(head, domain.n))


def mesh_of_cells(domain: Complex, points: NDArray[np.float64], crossed: Crossed, off: float) -> StoredMesh:
    """Store the cells of a mesh that a file needs, with vertices to within a distance.

    Raises
    ------
    InputError
        If that is not possible.
    """
    cells = _needed(domain, crossed)
    used, numbers = np.unique(cells, return_inverse=True)
    places, found = quantised(points[used], numbers.reshape(cells.shape), off)
    run, found, order = encoded_mesh(found, places.extent, places.unit)
    head = _head(DomainKind.CODED, places, found)
    rounded = coordinates_of(found, read_domain(head + run, found.n, 0)[0])
    return StoredMesh(found, points[used[order]], used[order], head + run, off, rounded)


def mesh_of_points(
    domain: Complex, points: NDArray[np.float64], crossed: Crossed, whole: bool, off: float, shared: bool
) -> StoredMesh:
    """Store scattered points: all if ``whole``, or the vertices of the triangles that a file needs.

    Their triangulation has the cells that contours cross among the given points, and no others that they cross. If
    the first lattice does not give that, the cells themselves are stored where this takes fewer bytes. If the error is
    not stated (``shared``), some points may be off by more.

    Raises
    ------
    InputError
        If neither is possible.
    """
    kept = np.arange(len(points)) if whole else np.unique(_needed(domain, crossed))
    wanted = WantedTriangles(points, domain.mesh.position, domain.mesh.cell, kept, crossed)
    trials = placements(wanted, off, REACH * off if shared else off)
    placed = next(trials)
    if placed is None:
        by_cells: StoredMesh | None = None
        with suppress(InputError):
            by_cells = mesh_of_cells(domain, points, crossed, off)
        placed = next(filter(None, trials), None)
        if by_cells is not None and (placed is None or len(placed.run) >= len(by_cells.payload)):
            return by_cells
    if placed is None:
        raise InputError(
            "some triangles of the points are too thin for positions in a file", code="mesh-error",
            remedy="scale the coordinates, so that points spread alike along both axes, or leave out points that "
                   "nearly coincide",
        )
    payload = _head(DomainKind.DELAUNAY, placed.places, placed.domain) + placed.run
    return StoredMesh(placed.domain, points[placed.source], placed.source, payload, placed.off)


def _needed(domain: Complex, crossed: Crossed) -> NDArray[np.int64]:
    """Find the cells that a file needs: one at least."""
    found = crossed(domain.mesh.cell)
    found[0] |= not found.any()
    return domain.mesh.cell[found]


def _head(kind: DomainKind, places: Quantised, domain: Complex) -> bytes:
    """Write the head of the domain chunk of a mesh with positions in the file's units."""
    size = len(domain.mesh.position), len(domain.mesh.cell)
    head = DomainHead(
        kind, len(places.extent), places.exponent, *size, b"", places.multiple, places.origin, places.extent
    )
    return write_domain(head, domain.n)
