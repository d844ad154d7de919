"""Layers of several isovalues in turn, coarse ones first: in which order an encoder writes them (spec clause 3.5.9)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.tables import cube_exponent

FINER = 4
"""Rounds, along each axis, that are left when every isovalue can be seen: all before them take a few percent."""


def bases(signs: Sequence[NDArray[np.bool_]], level: int, full: int) -> list[int]:
    """Find the level at which each isovalue begins.

    Parameters
    ----------
    signs : sequence of (s0, .., sn-1) bool
        The samples above each isovalue.
    level : int
        Level of a base of large curves.
    full : int
        Level of the full grid.

    Returns
    -------
    list of int
        ``level``, but for curves too small to be seen at the level `coarse`: there it is the first one that shows them.
    """
    return [_first(one, level, coarse(level, full, one.ndim)) for one in signs]


def coarse(level: int, full: int, n: int) -> int:
    """Level at which all isovalues can be seen."""
    return max(level, full - FINER * n)


def _first(signs: NDArray[np.bool_], level: int, late: int) -> int:
    n, k = signs.ndim, cube_exponent(signs.shape)
    for exponent in range(-(-late // n), k + 1):
        at = [np.minimum(np.arange(0, (1 << k) + 1, 1 << (k - exponent)), size - 1) for size in signs.shape]
        there = signs[np.ix_(*map(np.unique, at))]
        if there.any() and not there.all():
            return level if n * exponent <= late + n - 1 else n * exponent
    return level


def coarsely(begins: Sequence[int], late: int) -> Iterator[tuple[range, int]]:
    """List the turns after which every isovalue can be seen.

    Parameters
    ----------
    begins : sequence of int
        Level at which each isovalue begins.
    late : int
        Isovalues that begin beyond this level do so when the others have reached it.

    Yields
    ------
    range, int
        Numbers of isovalues, and the level up to which their layers come.
    """
    small = {number for number, level in enumerate(begins) if level > late}
    yield from ((turn, late) for turn in _runs(set(range(len(begins))) - small))
    for level in sorted({begins[number] for number in small}):
        yield from ((turn, level) for turn in _runs({number for number in small if begins[number] == level}))


def finer(begins: Sequence[int], late: int, full: int) -> Iterator[tuple[range, int]]:
    """List the turns after those of `coarsely`, up to the level of the full grid."""
    targets = sorted({level for level in begins if level > late})
    for before, level in zip([late, *targets], [*targets, full], strict=True):
        yield from ((turn, level) for turn in _runs({i for i, begun in enumerate(begins) if begun <= before < level}))


def _runs(numbers: Collection[int]) -> Iterator[range]:
    """Split numbers into ranges without gaps."""
    found = sorted(numbers)
    start = 0
    for i in range(1, len(found) + 1):
        if i == len(found) or found[i] > found[i - 1] + 1:
            yield range(found[start], found[i - 1] + 1)
            start = i
