"""Find which samples lie above, from those that a file on the full grid stores (spec clause 9.7)."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..kernel import kernel
from ..kernel.types import UInt8Matrix, UInt8Vector

_UNKNOWN = 0
BLOCK = 1 << 20
"""Samples inferred at a time, unless a single index along the first axis has more."""


class MaskRows:
    """Signs of all samples, inferred from the known vertices, some rows along the first axis at a time.

    All samples next to the contour are known, so that any other has the sign of its neighbours: along each row, signs
    extend to the next known one. Iterating gives arrays of bool, (rows, ..), True where value > isovalue. ``position``
    (V, n) are the sample indices of the known vertices, including (0, .. 0), and ``above`` (V,) their signs.
    """

    def __init__(self, shape: tuple[int, ...], position: NDArray[np.int32], above: NDArray[np.bool_]) -> None:
        self.shape = shape
        self._position = position
        self._above = above
        self._row = math.prod(shape[1:])
        self._rows = max(BLOCK // self._row, 1)

    @property
    def bytes(self) -> int:
        """Memory for iterating, in bytes: for each vertex, and for the current rows."""
        return 32 * len(self._above) + 3 * min(self._rows, self.shape[0]) * self._row

    def whole(self) -> NDArray[np.bool_]:
        """All rows in one array."""
        out = np.empty(self.shape, np.bool_)
        start = 0
        for some in self:
            out[start : start + len(some)] = some
            start += len(some)
        return out

    def __iter__(self) -> Iterator[NDArray[np.bool_]]:
        order = np.argsort(self._position[:, 0], kind="stable")
        first = self._position[order, 0]
        corner = np.uint8(_UNKNOWN)
        for start in range(0, self.shape[0], self._rows):
            end = min(start + self._rows, self.shape[0])
            some = order[slice(*np.searchsorted(first, (start, end)))]
            signs = np.full((end - start, *self.shape[1:]), _UNKNOWN, np.uint8)
            place = (self._position[some, 0] - start, *self._position[some, 1:].T)
            signs[place] = np.where(self._above[some], 2, 1)
            corners = signs.reshape(end - start, -1)[:, 0]
            if corners[0] == _UNKNOWN:
                corners[0] = corner
            _spread(signs)
            corner = corners[-1]
            yield np.equal(signs, 2)


def _spread(signs: NDArray[np.uint8]) -> None:
    """Extend the known signs along the last axis, and to rows without any along the others."""
    rows = signs.reshape(-1, signs.shape[-1])
    _go_on(rows)
    if signs.ndim > 1:
        heads = np.ascontiguousarray(signs[..., 0])
        _spread(heads)
        _enter_heads(rows, heads.reshape(-1))


@kernel
def _go_on(rows: UInt8Matrix) -> None:
    """Extend the signs of each row, in both directions from the first known one."""
    for i in range(len(rows)):
        sign = np.uint8(_UNKNOWN)
        for j in range(rows.shape[1]):
            if rows[i, j] != _UNKNOWN:
                if sign == _UNKNOWN:
                    rows[i, :j] = rows[i, j]
                sign = rows[i, j]
            else:
                rows[i, j] = sign


@kernel
def _enter_heads(rows: UInt8Matrix, heads: UInt8Vector) -> None:
    """Fill rows without known signs from their heads."""
    for i in range(len(rows)):
        if rows[i, 0] == _UNKNOWN:
            rows[i] = heads[i]
