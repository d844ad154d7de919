"""Meshes of tiles in space for a tolerance: cubes of one edge in all tiles, finer where that will not do (clause 12.7).

Crossings are stored in few parts, with slack (annex G.3(5)): as either part that is near enough, as long as the surface
is proven to keep to the tolerance. Where it is not, slack is taken back, then simplices are bisected. In the faces that
tiles share the mesh follows from the samples there, and nothing has slack.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.depth import levels_of
from .mesh_slack import on_edges, slanted
from .promise import Promise, onto
from .strategy import NotKeptError, Plan
from .tile_faces import Faces, bisected, is_rough
from .tolerance import Edges

LARGEST = 4.0
"""Edge of the largest cubes that are tried, in tolerances."""
PARTS = 3
"""Into which a crossed edge of a cube is divided."""
LEAST = 0.2
"""Slack that has been taken back to less than this share counts as zero."""
MOST_TURNS = 32
HOPELESS, SPARE = 1.05, 40
"""A mesh that takes so many times the bytes of the full grid, and so many more, is given up."""


def cubes_for(tolerance: float | None, largest: int) -> Iterator[int]:
    """Exponents of the edges of cubes that meshes for a tolerance may begin with, the largest first."""
    if tolerance is not None:
        for exponent in range(largest, 0, -1):
            if 1 << exponent <= LARGEST * tolerance:
                yield exponent


def pitch_of(exponent: int) -> tuple[int, int]:
    """Parts and unit of offsets on cubes of an edge."""
    return PARTS, exponent


def volume_plan(promise: Promise, tolerance: float, exponent: int, lead: Plan, faces: Faces, grid: Plan) -> Plan:
    """A plan whose surface is proven to keep to the tolerance.

    Parameters
    ----------
    promise : Promise
        Of the tile; crossings that it has ``fixed``, those in shared faces, have no slack.
    tolerance : float
    exponent : int
        Of the edge of the cubes.
    lead : plan
        Layers that lead to the uniform mesh of these.
    faces : Faces
        Those that are shared, searched.
    grid : plan
        On the full grid; it is taken where nothing else is found on cubes of any edge and the surface crosses no shared
        face.

    Raises
    ------
    NotKeptError
    """
    n = promise.n
    pitch = pitch_of(exponent)
    reduction = promise.reduction()
    reduction.reduce(level=promise.full_level - n * exponent)
    uniform = True
    for wanted in filter(None, faces.wanted.values()):
        position = np.array(wanted, np.int64)
        reduction.add(position, levels_of(position, promise.full_level // n))
        uniform = False
    most = HOPELESS * promise.trial(grid)[0] + SPARE
    assert promise.fixed is not None
    slack = _Slack(promise.phi, tolerance, promise.fixed)
    for turn in range(MOST_TURNS):
        mesh = [] if uniform else [onto(reduction.chosen, lead)]
        plan: Plan = [*lead, *mesh, ("offsets", *pitch, None, slack if promise.free else None)]
        size, contour = promise.trial(plan)
        places = promise.excess(contour, tolerance)
        if not len(places):
            return plan
        if turn == 0 and is_rough(promise, len(places)):
            break
        none = slack.tighten(places) if promise.free else np.ones(len(places), np.bool_)
        added = bisected(reduction, places[none], faces) if none.any() else 0
        uniform &= not added
        if size > most or (none.all() and not added):
            break
    if exponent == 1 and not faces.crossed:
        return grid
    raise NotKeptError(f"no mesh was proven to stay within a tolerance of {tolerance:g}", code="tolerance")


class _Slack:
    """Slack of crossings on edges of any mesh: how far from where the field crosses them they may be stored.

    Parameters
    ----------
    phi : (s0, s1, s2) float32
        The field less its isovalue.
    tolerance : float
    fixed : callable
        Which edges, by the positions of their ends, have none.
    """

    def __init__(self, phi: NDArray[np.float32], tolerance: float, fixed: Edges) -> None:
        self._phi, self._tolerance, self._fixed = phi, tolerance, fixed
        self._share = np.ones(phi.shape, np.float32)

    def tighten(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Halve the slack around some places; returns at which of them no slack was left."""
        last = np.array(self._phi.shape) - 1
        here = np.clip(np.floor(places).astype(np.int64), 0, last)
        none = self._share[tuple(here.T)] == 0
        reach = math.ceil(2 * self._tolerance) + 1
        around = np.array(list(product(range(-reach, reach + 1), repeat=3)))
        near = np.clip(np.unique(here, axis=0)[:, None] + around, 0, last).reshape(-1, 3)
        near = np.unravel_index(np.unique(np.ravel_multi_index(tuple(near.T), self._phi.shape)), self._phi.shape)
        share = self._share[near] / 2
        self._share[near] = np.where(share < LEAST, 0, share)
        return none

    def __call__(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.int64]:
        """Crossings, as ``Samples.crossings``."""
        share = self._share[tuple(((low + high) >> 1).T)]
        slack = self._tolerance * (slanted(self._phi, low, high) * share)
        return on_edges(np.where(self._fixed(low, high), 0.0, slack), low, high)
