"""Fill loops of directed edges in a plane with triangles."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Edge = tuple[int, int]


def loops_of(edges: Iterable[Edge]) -> list[list[int]]:
    """Join edges to loops that visit no point twice; as many edges must lead to each point as away from it.

    Two opposite edges between the same points cancel out.
    """
    away: dict[int, list[int]] = defaultdict(list)
    for a, b in edges:
        if a in away[b]:
            away[b].remove(a)
        else:
            away[a].append(b)
    loops = []
    for first in sorted(away):
        while away[first]:
            walk, at = [first], {first: 0}
            while walk and away[walk[-1]]:
                there = away[walk[-1]].pop()
                if there not in at:
                    at[there] = len(walk)
                    walk.append(there)
                    continue
                loop = walk[at[there] :]
                for gone in loop[1:]:
                    del at[gone]
                del walk[at[there] + 1 :]
                loops.append(loop)
    return loops


def filled(
    loop: Sequence[int], points: NDArray[np.float64], axis: int, border: set[frozenset[int]], number: int
) -> tuple[list[tuple[int, int, int]], list[NDArray[np.float64]]]:
    """Make triangles that fill a loop in a plane across an axis, with the loop's orientation.

    Corners are cut off one by one. If none can be cut off, because the loop crosses itself, the rest is filled from a
    new point in its middle, which gets the index ``number`` and is returned, too. ``border`` holds the pairs of points
    that are neighbours on the border of a square: no new edge joins two points on the same side of the square, since
    the adjacent square may have the same edge.
    """
    plane = [a for a in range(points.shape[1]) if a != axis]
    place = {k: (float(points[k, plane[0]]), float(points[k, plane[1]])) for k in loop}
    left, out = list(loop), []
    turn = sum(_cross(place[left[0]], place[a], place[b]) for a, b in pairwise(left))
    taken = {frozenset(pair) for pair in zip(left, [*left[1:], left[0]], strict=True)} | border
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(left, k, place, turn, taken)), None)
        if ear is None:
            middle = np.mean(points[left], axis=0)
            middle[axis] = points[left[0], axis]
            out += [(a, b, number) for a, b in zip(left, [*left[1:], left[0]], strict=True)]
            return out, [middle]
        before, after = left[ear - 1], left[(ear + 1) % len(left)]
        out.append((before, left[ear], after))
        taken.add(frozenset((before, after)))
        del left[ear]
    return [*out, (left[0], left[1], left[2])], []


Place = tuple[float, float]


def _is_ear(left: list[int], k: int, place: dict[int, Place], turn: float, taken: set[frozenset[int]]) -> bool:
    a, b, c = (left[(k + d) % len(left)] for d in (-1, 0, 1))
    p, q, r = place[a], place[b], place[c]
    # an edge along an axis may lie in the border, with the same edge on its other side
    if frozenset((a, c)) in taken or p[0] == r[0] or p[1] == r[1] or _cross(p, q, r) * turn <= 0:
        return False
    return not any(
        all(_cross(s, t, place[other]) * turn >= 0 for s, t in ((p, q), (q, r), (r, p)))
        for other in left if other not in (a, b, c)
    )


def _cross(p: Place, q: Place, r: Place) -> float:
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
