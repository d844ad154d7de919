"""Least-squares fit of the values at the vertices of a triangulation to the values of all points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import kernel, record
from ..kernel.types import FloatVector, IntVector
from .removed_points import Surface
from .triangulation import orientation


@record
class Shares(NamedTuple):
    """``weight`` of a vertex in the value of ``point``, for vertex v from ``first[v]`` to ``first[v + 1]``."""

    first: IntVector
    point: IntVector
    weight: FloatVector


@kernel
def count_shares(s: Surface, first: IntVector) -> None:
    """Count the points that each vertex has a share in, including itself, in the entry after its own."""
    o = s.tri.origin
    for v in range(len(s.value)):
        if s.tri.leaving[v] >= 0:
            first[v + 1] += 1
    for t in range(len(o) // 3):
        if o[3 * t] >= 0:
            p = np.int64(s.first[t])
            while p >= 0:
                for i in range(3):
                    first[o[3 * t + i] + 1] += 1
                p = np.int64(s.next[p])


@kernel
def list_shares(s: Surface, shares: Shares, at: IntVector) -> None:
    """List the shares; ``at`` starts as a copy of ``first``."""
    tri = s.tri
    o = tri.origin
    for own in range(len(s.value)):
        if tri.leaving[own] >= 0:
            shares.point[at[own]], shares.weight[at[own]] = own, 1.0
            at[own] += 1
    for t in range(len(o) // 3):
        if o[3 * t] < 0:
            continue
        a, b, c = np.int64(o[3 * t]), np.int64(o[3 * t + 1]), np.int64(o[3 * t + 2])
        whole = np.float64(orientation(tri, a, b, c))
        p = np.int64(s.first[t])
        while p >= 0:
            for i in range(3):
                v, u, w = (a, b, c) if i == 0 else (b, c, a) if i == 1 else (c, a, b)
                shares.point[at[v]], shares.weight[at[v]] = p, orientation(tri, u, w, p) / whole
                at[v] += 1
            p = np.int64(s.next[p])


@kernel
def sweep(s: Surface, shares: Shares, step: float, low: float, high: float) -> float:
    """Give each vertex in turn the value that minimises the sum of squared errors while the others are fixed.

    With a ``step``, values are ``low`` plus a whole number of steps. Returns the largest change of a value.
    """
    moved = 0.0
    for v in range(len(s.value)):
        begin, end = shares.first[v], shares.first[v + 1]
        if begin == end:
            continue
        pull = squares = 0.0
        for k in range(begin, end):
            pull += shares.weight[k] * s.error[shares.point[k]]
            squares += shares.weight[k] * shares.weight[k]
        wanted = s.value[v] - pull / squares
        if step > 0:
            wanted = low + step * np.floor((wanted - low) / step + 0.5)
        wanted = min(max(wanted, low), high)
        change = wanted - s.value[v]
        if change != 0:
            moved = max(moved, abs(change))
            s.value[v] = wanted
            for k in range(begin, end):
                s.error[shares.point[k]] += shares.weight[k] * change
    return moved


def shares_of(s: Surface) -> Shares:
    """Compute the shares of all vertices in the values of all points."""
    first = np.zeros(len(s.value) + 1, np.int64)
    count_shares(s, first)
    first = np.cumsum(first)
    shares = Shares(first, np.zeros(first[-1], np.int64), np.zeros(first[-1]))
    list_shares(s, shares, first.copy())
    return shares


def fit(s: Surface, low: float, high: float, step: float = 0.0, sweeps: int = 12) -> None:
    """Fit the values of all vertices, from ``low`` to ``high``, in at most ``sweeps`` sweeps.

    With a ``step``, values are ``low`` plus a whole number of steps. Updates ``error``, but not the largest errors of
    triangles.
    """
    shares = shares_of(s)
    enough = 0.02 * step if step else 1e-4 * (high - low)
    for _ in range(sweeps):
        if sweep(s, shares, float(step), float(low), float(high)) <= enough:
            break
