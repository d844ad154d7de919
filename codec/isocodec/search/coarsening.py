"""Reduction of a mesh, level by level from the finest, while criteria allow it (row C2-reduce; docs/encoders.md)."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.access import dimension
from ..grid.lattice.access import members as member_count
from ..grid.lattice.grid import grid_of
from ..grid.lattice.slots import cubes, middle_of, slots
from ..grid.lattice.store import copied as copied_store
from ..grid.lattice.store import grown
from ..grid.lattice.tables import AXES, cube_exponent
from ..grid.lattice.vertex_set import GONE, Chosen, every_vertex, has
from ..grid.tube.capacity import filled
from ..grid.tube.state import Counters, truth
from ..kernel import inner, kernel
from ..kernel.types import BoolVolume, IntMatrix, IntVector
from .buckets import STACK
from .component_search import BLOCK, busy_of
from .distortion import Carried, too_far
from .location import diamonds_of, found_leaves
from .proof import Target
from .reduced import (
    EXACT_POINTS,
    FAILED,
    NEEDED,
    OPEN,
    ROOM,
    Domain,
    diamond_at,
    flags_of,
    need_parents,
    number_of,
    parent_at,
    place_of,
    set_flags,
)
from .topology import safe

_number_of, _place_of = inner(number_of), inner(place_of)

# What a vertex whose star the curve crosses is asked for.
CROSSING, TOPOLOGY = 1, 2
# What a sweep over a level does.
_OPEN, _COMMIT = range(2)
AT_ONCE = 16
"""Leaves that are always bisected at once, whatever the share."""


@inner
def _visit(dm, asked, doing, w0, w1, w2):
    """Decide, or commit, about one middle of the level; whether it is open now."""
    level, edge = np.int64(dm.counters.level), dm.counters.edge
    x, y, z = (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1
    bits = flags_of(dm, x, y, z)
    if bits & GONE or (doing == _OPEN and bits & NEEDED):
        return False
    diamond = diamond_at(dm, level, x, y, z)
    if diamond.members == 0:
        set_flags(dm, x, y, z, np.int64(GONE))
        return False
    if doing == _COMMIT:
        if bits & OPEN and not bits & FAILED:
            set_flags(dm, x, y, z, np.int64(GONE))
            return False
        set_flags(dm, x, y, z, np.int64(0))
        need_parents(dm, diamond)
        return False
    sign = truth(dm, x, y, z)
    if diamond.above == (diamond.corners if sign else 0):
        set_flags(dm, x, y, z, np.int64(GONE))
    elif not asked & CROSSING and (not asked & TOPOLOGY or safe(dm, diamond, sign)):
        set_flags(dm, x, y, z, bits | OPEN)
        return True
    return False


@kernel
def sweep(dm: Domain, busy: BoolVolume, asked: int, doing: int, opened: IntVector) -> int:
    """Visit all middles of the level. Where the curve is nowhere near, they go at once unless finer ones need them.

    Those that may go otherwise are listed in ``opened``, as numbers, as far as that goes; returns how many they are.
    """
    count = 0
    n = dimension(dm.grid.tables)
    r = dm.counters.level % n
    edge = dm.counters.edge
    c0, c1, c2 = cubes(dm.grid, dm.counters.level)
    # along the last axis, the cubes of one block at a time
    run = max((1 << BLOCK) // edge, 1)
    flags = dm.chosen.inside
    s0, s1, s2 = flags.shape
    for x in range(c0):
        for slot in range(slots(n, r)):
            for y in range(c1):
                for first in range(0, c2, run):
                    w0, w1, w2 = middle_of(n, r, x, y, np.int64(first), slot)
                    p0, p1 = (w0 * edge) >> 1, (w1 * edge) >> 1
                    idle = False
                    if edge <= 1 << BLOCK:
                        q2 = min(first * edge, s2 - 1) >> BLOCK if n == 3 else 0
                        idle = not busy[min(p0, s0 - 1) >> BLOCK, min(p1, s1 - 1) >> BLOCK, q2]
                    for _ in range(first, min(first + run, c2)):
                        p2 = (w2 * edge) >> 1
                        if p0 < s0 and p1 < s1 and p2 < s2:
                            # most vertices are settled here, without a call
                            bits = np.int64(flags[p0, p1, p2])
                            if bits & GONE or (idle and doing == _COMMIT and not bits & NEEDED):
                                w2 += 2
                                continue
                            if idle and doing == _OPEN:
                                if not bits & NEEDED:
                                    flags[p0, p1, p2] = GONE
                                w2 += 2
                                continue
                        if _visit(dm, asked, doing, w0, w1, w2):
                            if count < len(opened):
                                opened[count] = _number_of(n, (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1)
                            count += 1
                        w2 += 2
    return count


@kernel
def drop(dm: Domain) -> None:
    """Take away all middles of the level."""
    n = dimension(dm.grid.tables)
    r = dm.counters.level % n
    edge = dm.counters.edge
    c0, c1, c2 = cubes(dm.grid, dm.counters.level)
    for x in range(c0):
        for slot in range(slots(n, r)):
            for y in range(c1):
                for z in range(c2):
                    w0, w1, w2 = middle_of(n, r, x, y, z, slot)
                    set_flags(dm, (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1, np.int64(GONE))


@kernel
def add(dm: Domain, wanted: IntMatrix, levels: IntVector, room: IntMatrix) -> int:
    """Put vertices back, with all their ancestors. ``room`` holds positions and levels; returns how many were added."""
    t = dm.grid.tables
    added = 0
    for i in range(len(wanted)):
        count = 1
        room[0, 0], room[0, 1], room[0, 2], room[0, 3] = wanted[i, 0], wanted[i, 1], wanted[i, 2], levels[i]
        while count > 0:
            count -= 1
            x, y, z, level = room[count, 0], room[count, 1], room[count, 2], room[count, 3]
            if not flags_of(dm, x, y, z) & GONE:
                continue
            set_flags(dm, x, y, z, np.int64(0))
            added += 1
            if level == 0:
                continue
            diamond = diamond_at(dm, level, x, y, z)
            for m in range(member_count(t, diamond.kind)):
                if (diamond.members >> m) & 1:
                    p = parent_at(dm, diamond, m)
                    room[count, 0], room[count, 1], room[count, 2], room[count, 3] = p[0], p[1], p[2], level - 1
                    count += 1
    return added


class Reduction:
    """A mesh over a field that is taken apart and put back.

    Parameters
    ----------
    signs : (s0, s1) or (s0, s1, s2) bool
        Whether value > isovalue.
    phi : float32, of the same shape
        Value less isovalue.
    points : (P, n) float
        Points of the original curve, on the grid's edges; at least one of each crossed edge.
    start : Chosen, optional
        The mesh to begin with; the full grid if not given.
    busy : bool, optional
        Blocks that the curve passes, if they are known: `search.component_search.busy_of`.
    """

    def __init__(
        self, signs: NDArray[np.bool_], phi: NDArray[np.float32], points: NDArray[np.float64],
        start: Chosen | None = None, busy: NDArray[np.bool_] | None = None,
    ) -> None:
        self.shape = signs.shape
        self.n = n = signs.ndim
        self.k = cube_exponent(signs.shape)
        counters = Counters()
        padded = signs.shape + (1,) * (AXES - n)
        signs = signs.reshape(padded)
        chosen = every_vertex(self.shape) if start is None else copied(start)
        self.domain = Domain(grid_of(self.shape), counters, signs, phi.reshape(padded), chosen, np.zeros(ROOM),
                             EXACT_POINTS, 0)
        self.points = np.zeros((len(points), AXES), np.float32)
        self.points[:, :n] = points
        self.busy = busy_of(signs) if busy is None else busy

    @property
    def chosen(self) -> Chosen:
        """The mesh as it is."""
        return self.domain.chosen

    def reduce(
        self, *, topology: bool = False, crossing: bool = False, level: int | None = None, coarsest: int = 0,
        distortion: float | None = None, original: Target | None = None, parts: int = EXACT_POINTS, unit: int = 0,
        curvature: NDArray[np.float64] | None = None, kappa: float = 0.0,
    ) -> None:
        """Take vertices away while all criteria that are given allow it.

        Parameters
        ----------
        topology : bool
            Not if the topology of the curve changes.
        crossing : bool
            Not if the tubular neighbourhood changes.
        level : int, optional
            All vertices of this level and finer ones go that topology, crossings and curvature allow to; coarser ones
            stay.
        coarsest : int
            Vertices of coarser levels stay.
        distortion : float, optional
            Not if a point of the original curve gets farther than this many cells from the new curve.
        original : Target, optional
            The original curve. Nor if a piece of the new one is not proven to lie within the target's limit of it.
            Needed for the distortion.
        parts, unit : int
            For the distortion: a decoder knows crossings in this many parts of ``2**unit`` samples, or
            `EXACT_POINTS` or `LINEAR_POINTS`.
        curvature : (P,) float64, optional
            That of the original curve at its points, in 1 / cells.
        kappa : float
            Not if the mean curvature of the points in the vertex's star exceeds this.
        """
        asked = (CROSSING if crossing else 0) | (TOPOLOGY if topology else 0)
        coarsest = coarsest if level is None else max(coarsest, level)
        self.domain = self.domain._replace(parts=parts, unit=unit)
        carried = self._carried()
        watched = original is not None or curvature is not None
        for here in range(self.n * self.k - 1, coarsest - 1, -1):
            self.domain.counters.level = here
            self.domain.counters.edge = 1 << (self.k - here // self.n)
            self._make_room()
            dm = self.domain
            if level is not None and not asked and curvature is None:
                drop(dm)
                continue
            opened = filled(lambda out: sweep(self.domain, self.busy, asked, _OPEN, out))
            if watched and len(opened):
                # where they lie on the curve as it is now; bends are those of the original in the star
                keys = self._diamonds(here, self.points if curvature is not None else carried.places)
                if curvature is not None:
                    self._fail(bent(keys, curvature, kappa))
                if original is not None and distortion is not None:
                    if curvature is not None:
                        keys = self._diamonds(here, carried.places)
                    too_far(dm, opened, by_diamond(carried, keys, opened), original.buckets, float(distortion))
            sweep(dm, self.busy, asked, _COMMIT, opened)

    def _carried(self) -> Carried:
        """All points at their own places."""
        none = np.zeros(0, np.int64)
        places, moved = self.points.copy(), self.points.copy()
        return Carried(self.points, places, moved, none, none.reshape(0, 2), np.zeros((STACK, 9)))

    def _diamonds(self, level: int, places: NDArray[np.float32]) -> NDArray[np.int64]:
        """Numbers of the open diamonds of a level that hold the places, -1 where none does."""
        keys = np.empty(len(places), np.int64)
        diamonds_of(self.domain, level, places, np.zeros(AXES + 1), keys)
        return keys

    def restore(
        self, places: NDArray[np.float64], most: Chosen | None = None, share: float = 1.0
    ) -> int:
        """Bisect the leaves at some places; how many vertices that put back.

        Topology that was kept so far stays kept: each vertex that is left out could go by itself, whatever else stays.

        Parameters
        ----------
        places : (P, n) float64
        most : Chosen, optional
            A mesh whose vertices alone may come back.
        share : float
            Of many leaves only this share is bisected, those with the most places.
        """
        leaves = self.leaves_at(places)
        # where it is full already: the leaves next to it, so that diamonds get whole and their points implied
        back = self._bisected(np.concatenate([leaves, self._around(places[leaves[:, 3] < 0], 1)]), most, share)
        # of a given mesh more and more around a few of the places: all of it keeps what they lack
        reach = 1
        while not back and most is not None and reach < max(self.shape):
            reach *= 2
            back = self._bisected(self._around(places[:AT_ONCE], reach), most, share)
        return back

    def _around(self, places: NDArray[np.float64], reach: int) -> NDArray[np.int64]:
        """Leaves around places, up to ``reach`` steps of three quarters of a sample away, as `leaves_at`."""
        around = 0.75 * np.array(list(product(range(-reach, reach + 1), repeat=self.n)))
        return self.leaves_at((places[:, None] + around).reshape(-1, self.n))

    def _bisected(self, leaves: NDArray[np.int64], most: Chosen | None, share: float) -> int:
        """Bisect leaves; how many vertices that put back."""
        wanted, count = distinct(self.n, leaves)
        if most is not None and len(wanted):
            inside = np.array([has(most, *w[:3]) for w in wanted])
            wanted, count = wanted[inside], count[inside]
        wanted = wanted[np.argsort(-count, kind="stable")[: max(int(share * len(wanted)), AT_ONCE)]]
        return self.add(wanted[:, :3], wanted[:, 3]) if len(wanted) else 0

    def leaves_at(self, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """Middle (unclamped, padded to three axes) and level of the leaf at each place, level -1 on the full grid.

        Parameters
        ----------
        places : (P, n) float64

        Returns
        -------
        (P, 4) int64
        """
        points = np.zeros((len(places), AXES))
        points[:, : self.n] = np.clip(places, 0, np.array(self.shape) - 1)
        out = np.zeros((len(places), 4), np.int64)
        found_leaves(self.domain, points, np.zeros(AXES + 1), out)
        return out

    def _fail(self, keys: NDArray[np.int64]) -> None:
        mark(self.domain, keys, FAILED)

    def add(self, wanted: NDArray[np.int64], levels: NDArray[np.int64]) -> int:
        """Put vertices back, with their ancestors; how many were added.

        Parameters
        ----------
        wanted : (W, 3) int64
            Unclamped positions, padded to three axes.
        levels : (W,) int64
        """
        room = np.zeros((8 * self.n * self.k + 8, 4), np.int64)
        return int(add(self.domain, np.ascontiguousarray(wanted), np.ascontiguousarray(levels), room))

    def _make_room(self) -> None:
        """Pages for all lattice points of the level off the box: a layer along its upper faces."""
        counters, n = self.domain.counters, self.n
        edge = counters.edge
        last = np.array(self.shape) - 1
        over = -(-last // edge) * edge + (edge if counters.level % n else 0) > last
        if not over.any():
            return
        page = 16 if n == 2 else 8
        blocks = -(-(last + 2 * edge) // max(page, edge)) + 2
        room = int(sum(np.prod(np.delete(blocks, a)) * 3 for a in range(n)))
        chosen = self.domain.chosen
        self.domain = self.domain._replace(chosen=chosen._replace(outside=grown(chosen.outside, room, factor=1)))


def distinct(n: int, leaves: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The leaves of `Reduction.leaves_at`, each once, but for those of the full grid; how often each was there."""
    leaves = leaves[leaves[:, 3] >= 0]
    # a middle has but one level
    keys = number_of(n, *leaves[:, :3].T)
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    return leaves[first], count


def bent(keys: NDArray[np.int64], curvature: NDArray[np.float64], kappa: float) -> NDArray[np.int64]:
    """The diamonds whose points have a mean curvature above ``kappa``; keys of the others' points are -1."""
    some = np.flatnonzero(keys >= 0)
    diamonds, number = np.unique(keys[some], return_inverse=True)
    total = np.bincount(number, weights=curvature[some], minlength=len(diamonds))
    return diamonds[total > kappa * np.bincount(number, minlength=len(diamonds))]


def by_diamond(carried: Carried, keys: NDArray[np.int64], opened: NDArray[np.int64]) -> Carried:
    """Points sorted by their diamonds, and those of each of the ``opened`` ones."""
    order = np.argsort(keys, kind="stable")
    held = keys[order]
    spans = np.stack([np.searchsorted(held, opened, side) for side in ("left", "right")], axis=1)
    return carried._replace(order=order, spans=np.ascontiguousarray(spans))


@kernel
def mark(dm: Domain, keys: IntVector, bits: int) -> None:
    """Set bits of lattice points, which are given as numbers."""
    n = dimension(dm.grid.tables)
    for i in range(len(keys)):
        x, y, z = _place_of(n, keys[i])
        set_flags(dm, x, y, z, flags_of(dm, x, y, z) | bits)


def copied(chosen: Chosen) -> Chosen:
    """Copy a mesh."""
    return Chosen(chosen.inside & np.uint8(GONE), copied_store(chosen.outside, GONE))
