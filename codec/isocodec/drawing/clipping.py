"""Remove from drawings whatever lies in unit cells with missing corners (spec clause 9.8)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .leaves import WholeCells

_GRAIN = 1 << 30
"""Points of cut pieces are merged if they agree to within this fraction of a cell."""
_TOGETHER = 1 << 12
"""Cells that are cut at a time."""
_CUT, _KEPT = 250, 800
"""Bytes for each piece during a cut, and for each that is kept."""
_TIME = 16
"""Bytes that count for each piece ever made, so that the memory limit bounds the time, too."""
Pieces = NDArray[np.float64]
"""(M, n, n) corners of segments or triangles."""
Check = Callable[[int], None]
"""Raises an error if there is no room for a number of bytes in addition to those held."""


class Clipped(NamedTuple):
    """A drawing that has been cut.

    Attributes
    ----------
    points : (Q, n) float64
    cells : (M, n) int64
    kept : (K,) int64
        Original indices of the first K points; the remaining ones were created by cutting.
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    kept: NDArray[np.int64]


def clipped(
    points: NDArray[np.float64], cells: NDArray[np.int64], shape: tuple[int, ...], whole: WholeCells, check: Check
) -> Clipped:
    """Cut the points and cells of a drawing where planes of the grid separate whole unit cells from others.

    Pieces that lie in whole cells are unchanged; unused points are removed. ``check`` is called with the bytes of the
    pieces, since a large cell of a coarse mesh lies in many unit cells.
    """
    cutting = _Cutting(shape, whole, check)
    kept = [cutting.of(points[cells[i : i + _TOGETHER]]) for i in range(0, max(len(cells), 1), _TOGETHER)]
    cutting.ask(0)
    untouched = np.concatenate([some for some, _, _ in kept])
    pieces = np.concatenate([some for _, some, _ in kept])
    owner = np.concatenate([i * _TOGETHER + some for i, (_, _, some) in enumerate(kept)])
    if len(shape) == 2:
        pieces, owner = _joined(pieces, owner)
    stays = cells[untouched]
    # corners of cut pieces are original points, too
    part, _, old = np.nonzero((pieces[:, :, None] == points[cells[owner]][:, None]).all(axis=3))
    used = np.unique(np.concatenate([stays.reshape(-1), cells[owner[part], old]]))
    number = np.zeros(len(points), np.int64)
    number[used] = np.arange(len(used))
    both = np.concatenate([points[used], pieces.reshape(-1, len(shape))])
    _, first, same = np.unique(np.rint(both * _GRAIN), axis=0, return_index=True, return_inverse=True)
    # original points stay separate, even if they coincide
    order = np.sort(first[first >= len(used)])
    place = np.empty(len(both), np.int64)
    place[order] = len(used) + np.arange(len(order))
    place[: len(used)] = np.arange(len(used))
    of_cut = place[first[same.reshape(-1)[len(used) :]]].reshape(-1, len(shape))
    out = np.concatenate([number[stays], of_cut])
    return Clipped(np.concatenate([points[used], both[order]]), out, used)


class _Cutting:
    """Cells of a drawing, cut into unit cells, some at a time."""

    def __init__(self, shape: tuple[int, ...], whole: WholeCells, check: Check) -> None:
        self._shape, self._whole, self._check = shape, whole, check
        self._made = self._kept = 0

    def of(self, corners: Pieces) -> tuple[NDArray[np.bool_], Pieces, NDArray[np.int64]]:
        """Find which cells stay unchanged, and cut the others: the remaining parts of these, and their cells."""
        pieces, owner = self._unit_pieces(corners)
        kept = _in_whole_cell(pieces, self._shape, self._whole)
        untouched = np.ones(len(corners), np.bool_)
        untouched[owner[~kept]] = False
        cut = kept & ~untouched[owner]
        self._made += len(pieces)
        self._kept += int(cut.sum())
        return untouched, pieces[cut], owner[cut]

    def ask(self, pieces: int) -> None:
        """Ask for room for ``pieces`` pieces at once, in addition to those kept so far."""
        self._check(max(_CUT * pieces + _KEPT * self._kept, _TIME * (self._made + pieces)))

    def _unit_pieces(self, pieces: Pieces) -> tuple[Pieces, NDArray[np.int64]]:
        """Cut pieces by the planes of the grid, each into one unit cell; returns parts and their pieces, in order."""
        owner = np.arange(len(pieces))
        for axis in range(pieces.shape[2]):
            while True:
                low = np.floor(pieces[:, :, axis].min(axis=1, initial=np.inf))
                high = np.ceil(pieces[:, :, axis].max(axis=1, initial=-np.inf))
                wide = high - low > 1
                if not wide.any():
                    break
                self.ask(len(pieces) + 2 * int(wide.sum()))
                plane = low[wide] + (high - low)[wide] // 2
                cut = _cut_segments if pieces.shape[2] == 2 else _cut_triangles
                parts, part_owner = cut(pieces[wide], plane, axis)
                owner = np.concatenate([owner[~wide], owner[wide][part_owner]])
                pieces = np.concatenate([pieces[~wide], parts])
        return pieces, owner


def _crossing(a: NDArray[np.float64], b: NDArray[np.float64], plane: NDArray[np.float64], axis: int) -> Pieces:
    """Intersect lines from a to b (K, n) with planes; the result does not depend on which end is a."""
    swap = a[:, axis] > b[:, axis]
    low, high = np.where(swap[:, None], b, a), np.where(swap[:, None], a, b)
    share = (plane - low[:, axis]) / (high[:, axis] - low[:, axis])
    out = low + share[:, None] * (high - low)
    out[:, axis] = plane
    return np.asarray(out)


def _cut_segments(pieces: Pieces, plane: NDArray[np.float64], axis: int) -> tuple[Pieces, NDArray[np.int64]]:
    """Split each segment into both parts."""
    middle = _crossing(pieces[:, 0], pieces[:, 1], plane, axis)
    parts = np.stack([np.stack([pieces[:, 0], middle], axis=1), np.stack([middle, pieces[:, 1]], axis=1)], axis=1)
    return parts.reshape(-1, 2, 2), np.repeat(np.arange(len(pieces)), 2)


def _cut_triangles(pieces: Pieces, plane: NDArray[np.float64], axis: int) -> tuple[Pieces, NDArray[np.int64]]:
    """Split triangles, one corner of which is alone on its side, into three parts; parts without area are dropped."""
    side = np.sign(pieces[:, :, axis] - plane[:, None])
    alone = np.argmax(
        [(side[:, i] != 0) & (side[:, i - 2] != side[:, i]) & (side[:, i - 1] != side[:, i]) for i in range(3)], axis=0
    )
    rows = np.arange(len(pieces))
    a, b, c = (pieces[rows, (alone + i) % 3] for i in range(3))
    to = []
    for i, corner in ((1, b), (2, c)):
        on_plane = side[rows, (alone + i) % 3] == 0
        cut = corner.copy()
        cut[~on_plane] = _crossing(a[~on_plane], corner[~on_plane], plane[~on_plane], axis)
        to.append(cut)
    parts = np.stack([np.stack(part, axis=1) for part in ((a, to[0], to[1]), (to[0], b, c), (to[0], c, to[1]))], axis=1)
    parts = parts.reshape(-1, 3, 3)
    real = np.ones(len(parts), np.bool_)
    for i in range(3):
        real &= (parts[:, i] != parts[:, i - 1]).any(axis=1)
    return parts[real], np.repeat(rows, 3)[real]


def _in_whole_cell(pieces: Pieces, shape: tuple[int, ...], whole: WholeCells) -> NDArray[np.bool_]:
    """Whether pieces lie in whole unit cells; a piece in a face of several cells, in one of these."""
    middle = pieces.mean(axis=1)
    low, high = np.floor(pieces.min(axis=1)), np.ceil(pieces.max(axis=1))
    cell = np.where(high > low, np.floor(middle), low).astype(np.int64)
    flat = high == low
    out = np.zeros(len(pieces), np.bool_)
    for step in product((0, 1), repeat=len(shape)):
        some = np.flatnonzero((flat | (np.array(step) == 0)).all(axis=1) & ~out)
        out[some] = whole(cell[some] - step)
    return out


def _joined(pieces: Pieces, owner: NDArray[np.int64]) -> tuple[Pieces, NDArray[np.int64]]:
    """Merge consecutive parts of the same segment; returns the merged parts and their segments."""
    if not len(pieces):
        return pieces, owner
    way = pieces[:, 1] - pieces[:, 0]
    along = (pieces[:, 0] * np.sign(way)).sum(axis=1)
    order = np.lexsort((along, owner))
    pieces, owner = pieces[order], owner[order]
    begins = np.ones(len(pieces), np.bool_)
    begins[1:] = (owner[1:] != owner[:-1]) | (pieces[1:, 0] != pieces[:-1, 1]).any(axis=1)
    ends = np.append(begins[1:], True)
    return np.stack([pieces[begins, 0], pieces[ends, 1]], axis=1), owner[begins]
